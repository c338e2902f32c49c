"""Enumerations and graphs that leave nothing open, and whose proofs the checker accepts."""

from enumsol import branch_graph, enumerate_roots, verify


def all_roots(problem, alpha, *arguments, **options):
    """The roots of a problem, in a search that leaves nothing open."""
    roots = enumerate_roots(problem, alpha, *arguments, **options)
    assert roots.complete, roots
    return roots


def proven_roots(problem, alpha, *arguments, **options):
    """The same with a proof that the checker accepts."""
    roots = all_roots(problem, alpha, *arguments, **options)
    report = verify(problem, roots.proof)
    assert report.complete, report
    return roots


def whole_graph(problem, interval, *arguments, **options):
    """A graph without gaps."""
    graph = branch_graph(problem, interval, *arguments, **options)
    assert graph.complete, graph
    return graph


def proven_graph(problem, interval, *arguments, **options):
    """The same with a proof that the checker accepts, arcs and all."""
    graph = whole_graph(problem, interval, *arguments, **options)
    report = verify(problem, graph.proof)
    assert report.complete, report
    return graph
