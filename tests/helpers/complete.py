"""Results that leave nothing open: enumerations, graphs, what the checker says of proofs, limits of iterations."""

import functools

from problems3d import random_over_alpha

from enumsol import branch_graph, enumerate_roots, successive_approximations, verify


def all_roots(problem, alpha, *arguments, **options):
    """The roots of a problem, in a search that leaves nothing open."""
    roots = enumerate_roots(problem, alpha, *arguments, **options)
    assert roots.complete, roots
    return roots


def only_root(problem, alpha=0, *arguments, **options):
    """The root of a problem that has no other, in such a search."""
    (root,) = all_roots(problem, alpha, *arguments, **options)
    return root


def proven_roots(problem, alpha, *arguments, **options):
    """The same with a proof that the checker accepts."""
    roots = all_roots(problem, alpha, *arguments, **options)
    complete_report(problem, roots.proof)
    return roots


def whole_graph(problem, interval, *arguments, **options):
    """A graph without gaps."""
    graph = branch_graph(problem, interval, *arguments, **options)
    assert graph.complete, graph
    return graph


@functools.cache
def graph_over_alpha(p, seed):
    """Such a graph over [0, 1] of the random problem in 3D with this seed, made once in a process, and that problem."""
    problem = random_over_alpha(p, seed)
    return problem, whole_graph(problem, (0, 1))


def proven_graph(problem, interval, *arguments, **options):
    """The same with a proof that the checker accepts, arcs and all."""
    graph = whole_graph(problem, interval, *arguments, **options)
    complete_report(problem, graph.proof)
    return graph


def accepted_report(problem, proof, *arguments, **options):
    """What the checker says of a proof that it accepts, whether or not this leaves something open."""
    report = verify(problem, proof, *arguments, **options)
    assert report.ok, report
    return report


def complete_report(problem, proof, *arguments, **options):
    """What the checker says of a proof that leaves nothing open."""
    report = verify(problem, proof, *arguments, **options)
    assert report.complete, report
    return report


def read_back(result, file, *arguments):
    """What the class of a result reads from the file to which this was saved."""
    result.save(file)
    return type(result).load(file, *arguments)


def limit_of(problem, alpha, *arguments, **options):
    """Where successive approximations converge to."""
    found = successive_approximations(problem, alpha, *arguments, **options)
    assert found.converged, found
    return found
