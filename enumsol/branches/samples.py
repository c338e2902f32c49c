"""multiplicity_table and link_samples: roots at samples, counted or joined into a graph (theory, section 7.12)."""

from __future__ import annotations

import enum
import itertools
from collections import Counter
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import networkx as nx
import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.model.problem import ContactProblem, check_is_problem
from enumsol.model.statuses import STATUSES, ContactStatus
from enumsol.roots.enumerate import enumerate_roots
from enumsol.roots.local_branch import ratios
from enumsol.support.arguments import alpha_list, even_alphas, one_of, optional_callable, optional_executor
from enumsol.support.deadlines import keeping
from enumsol.support.messages import counted
from enumsol.support.workers import spread, workers_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence
    from concurrent.futures import Executor

    import pandas as pd

    from enumsol.branches.graph import BranchGraph
    from enumsol.model.problem3d import AnyProblem
    from enumsol.roots.root import Root
    from enumsol.roots.root_set import RootSet
    from enumsol.support.array_types import Alpha, AlphaLike, Floats


#: Solutions that tables and maps can leave out, and the columns that tell how many they are, and how many may be.
RUNNING_AWAY, _LEFT_OUT = "running away", ("left_out", "stability_undecided")
#: Attributes of a root that are those of its node, too.
_SHOWN = ("statuses", "lambda_n", "lambda_t", "index")


class LinkRule(enum.StrEnum):
    """Why two roots are linked; members compare with their texts."""

    #: The same selection holds at both samples.
    SELECTION = "selection"
    #: Neighbouring selections hold, which share a vanishing test function.
    FLIP = "flip"


@dataclass(frozen=True)
class Missed:
    """Parts that a sampled graph lacks, compared with the exact graph.

    Attributes
    ----------
    arcs : tuple of int
        Numbers of the exact graph's arcs that no sample lies on.
    branches : tuple of int
        Numbers of its branches none of whose arcs has a sample.
    components : tuple of int
        Numbers of its components without any sample.
    families : int
        Families at single alphas, none of them a sample.
    shortest_seen : float
        Length in alpha of the shortest arc that has a sample (nan when there is none).
    """

    arcs: tuple[int, ...]
    branches: tuple[int, ...]
    components: tuple[int, ...]
    families: int
    shortest_seen: float


@dataclass(frozen=True)
class SampledGraph:
    """Roots at sampled alphas, linked from each sample to the next.

    Attributes
    ----------
    graph : networkx.Graph
        Nodes (sample, root) with alpha, statuses, lambda_n, lambda_t, index and root; edges with ``rule``, a LinkRule,
        and ``heuristic`` True: only the exact graph proves a link.
    root_sets : tuple of RootSet
    ambiguous : tuple of pairs of nodes
        Pairs between which a link is possible but not the only one; they are not linked.
    """

    graph: Any
    root_sets: tuple[RootSet, ...]
    ambiguous: tuple[tuple[tuple[int, int], tuple[int, int]], ...]

    @property
    def alphas(self) -> tuple[float, ...]:
        """The samples, increasing."""
        return tuple(float(roots.alpha) for roots in self.root_sets)

    @property
    def branches(self) -> tuple[frozenset[tuple[int, int]], ...]:
        """Linked sets of nodes, in the order of their first sample."""
        return tuple(frozenset(group) for group in sorted(nx.connected_components(self.graph), key=min))

    def missed(self, exact: BranchGraph) -> Missed:
        """Arcs and branches of the exact graph that the samples miss."""
        seen: set[int] = set()
        for alpha in self.alphas:
            if exact.interval[0] <= alpha <= exact.interval[1]:
                seen.update(arc.number for arc in exact.arcs_at(alpha))
        arcs = tuple(arc.number for arc in exact.arcs if arc.number not in seen)
        lengths = [arc.length for arc in exact.arcs if arc.number in seen]
        return Missed(
            arcs,
            tuple(b.number for b in exact.branches if not any(arc.number in seen for arc in b.arcs)),
            tuple(c.number for c in exact.components if not any(arc.number in seen for arc in c.arcs)),
            sum(family.alpha not in self.alphas for family in exact.families),
            min(lengths, default=float("nan")),
        )

    def __repr__(self) -> str:
        return (
            f"SampledGraph of {counted(len(self.root_sets), 'sample')}: "
            f"{counted(self.graph.number_of_nodes(), 'root')}, "
            f"{counted(self.graph.number_of_edges(), 'link')} (heuristic), "
            f"{counted(len(self.ambiguous), 'ambiguous pair')} left open"
        )


def link_samples(
    problem: AnyProblem,
    alphas: Iterable[AlphaLike],
    *,
    arithmetic: str | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> SampledGraph:
    """Roots at the samples, linked into branches by their selections.

    Two roots at neighbouring samples are linked when they have the same statuses and, if both are regular, the same
    index. Of the roots left over, two are linked when their statuses differ at one node only and the test function that
    separates them is predicted to vanish between the samples (one step more allowed), by the derivatives at both roots.
    Where a root has several such partners, as several in 3D may have the same statuses, none is chosen and the pairs
    are marked as ambiguous. What happens between samples is not seen: use
    ``branch_graph``.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    alphas : iterable of float, Fraction or whatever enumerate_roots accepts as alpha
        Sorted by the function; at least one.
    arithmetic : str, optional
        Of ``enumerate_roots``; by default "fast", which bodies that nothing holds do not have, and for these
        "verified". Families are not linked.
    progress : callable, optional
        Called with the numbers of samples done and of all.

    Returns
    -------
    SampledGraph

    Raises
    ------
    InvalidArgumentError
        There is no alpha, or one is not a finite number; or arithmetic is none that the problem has.

    Examples
    --------
    >>> import enumsol
    >>> enumsol.link_samples(enumsol.gallery.one_node_triangle(), [4, 5, 6])
    SampledGraph of 3 samples: 9 roots, 6 links (heuristic), 0 ambiguous pairs left open
    """
    check_is_problem(problem)
    optional_callable(progress, "progress")
    samples = sorted(set(alpha_list(alphas)))
    if not samples:
        raise InvalidArgumentError("alphas is empty; expected at least one number")
    arithmetic = arithmetic or ("fast" if problem.held else "verified")
    root_sets = []
    for k, alpha in enumerate(samples):
        root_sets.append(enumerate_roots(problem, alpha, arithmetic))  # type: ignore[arg-type]
        if progress is not None:
            progress(k + 1, len(samples))
    graph = nx.Graph()
    for s, roots in enumerate(root_sets):
        for r, root in enumerate(roots):
            graph.add_node((s, r), alpha=float(root.alpha), root=root, **{name: getattr(root, name) for name in _SHOWN})
    ambiguous: list[tuple[tuple[int, int], tuple[int, int]]] = []
    for s, (left, right) in enumerate(itertools.pairwise(root_sets)):
        ambiguous += _link(graph, problem, s, left, right)
    return SampledGraph(graph, tuple(root_sets), tuple(ambiguous))


def _link(
    graph: nx.Graph, problem: AnyProblem, sample: int, left: RootSet, right: RootSet
) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Link neighbouring samples; returns the pairs left open."""
    equal = [(i, j) for i, a in enumerate(left) for j, b in enumerate(right) if _may_continue(a, b)]
    linked = [pair for pair in equal if _alone(pair, equal)]
    for i, j in linked:
        graph.add_edge((sample, i), (sample + 1, j), rule=LinkRule.SELECTION, heuristic=True)
    open_pairs = [((sample, i), (sample + 1, j)) for i, j in equal if (i, j) not in linked]
    # of those that no root with the same statuses may continue
    free = [set(range(len(roots))) - {pair[k] for pair in equal} for k, roots in enumerate((left, right))]
    pairs = [(i, j) for i in sorted(free[0]) for j in sorted(free[1]) if _may_flip(problem, left[i], right[j])]
    # two roots of one sample that differ by a flip may belong to a fold between the samples instead
    for i, j in pairs:
        if _alone((i, j), pairs) and left[i].index == right[j].index:
            graph.add_edge((sample, i), (sample + 1, j), rule=LinkRule.FLIP, heuristic=True)
        else:
            open_pairs.append(((sample, i), (sample + 1, j)))
    return open_pairs


def _alone(pair: tuple[int, int], pairs: Sequence[tuple[int, int]]) -> bool:
    """True if both roots of a pair are in no other one."""
    return sum(a == pair[0] for a, _ in pairs) == 1 and sum(b == pair[1] for _, b in pairs) == 1


def _may_continue(a: Root, b: Root) -> bool:
    """True if one selection holds at two roots, which a branch may have; along a regular one the index is the same."""
    return a.statuses == b.statuses and (a.index == b.index or not (a.regular and b.regular))


def _may_flip(problem: AnyProblem, a: Root, b: Root) -> bool:
    """True if the statuses differ at one node by a flip that both roots predict to happen between the samples."""
    nodes = [i for i, (x, y) in enumerate(zip(a.statuses, b.statuses, strict=True)) if x is not y]
    if len(nodes) != 1:
        return False
    step = float(b.alpha) - float(a.alpha)
    for root, other in ((a, b), (b, a)):
        at = _vanishing(problem, root, nodes[0], other)
        if at is not None and not float(a.alpha) - step <= at <= float(b.alpha) + step:
            return False
    return True


def _vanishing(problem: AnyProblem, root: Root, node: int, other: Root) -> float | None:
    """Predicted alpha at which the condition that keeps a node from its status at another root vanishes, or None.

    With the direction d of slip, at that root or the other one, a node in contact sticks while c lambda_n exceeds
    d . lambda_t / q, and slips while d . q u_t is positive; q = F / c.
    """
    if root.dlambda_dalpha is None or root.du_dalpha is None:
        return None
    (F0, F1), p = problem.affine_friction, problem.p
    F, dF = ((one.reshape(p, -1)[node]) for one in (F0 + float(root.alpha) * F1, F1))
    (force, force_rate), (move, move_rate) = (
        (np.append(normal[node], along[node]), rate[node])
        for normal, along, rate in (
            (root.lambda_n, root.lambda_t, root.dlambda_dalpha),
            (root.u_n, root.u_t, root.du_dalpha),
        )
    )
    (c,), (q,) = ratios(F[None])
    status, target = root.statuses[node], other.statuses[node]
    if status is ContactStatus.OPEN:
        value, rate = -move[0], -move_rate[0]
    elif target is ContactStatus.OPEN or ContactStatus.STICK not in (status, target):
        value, rate = force[0], force_rate[0]
    elif status is ContactStatus.STICK:
        d = _direction(F, np.atleast_1d(other.u_t[node])) / q
        value, rate = c * force[0] - d @ force[1:], c * force_rate[0] - d @ force_rate[1:]
        rate += (d * d @ (dF * q)) * force[0]
    else:
        d = _direction(F, move[1:]) * q
        value, rate = d @ move[1:], d @ move_rate[1:]
    return None if rate == 0 else float(root.alpha) - float(value) / float(rate)


def _direction(F: Floats, slip: Floats) -> Floats:
    """The direction of slip of a node against friction."""
    size = np.linalg.norm(F * slip)
    return np.asarray(F * slip / (size if size > 0 else 1.0))


#: Columns with the number of roots at which at least one node has the status.
_KINDS = {status: f"with_{status.name.lower()}" for status in STATUSES}
_KINDS_3D = {
    status: f"with_{status.name.lower()}" for status in (ContactStatus.OPEN, ContactStatus.STICK, ContactStatus.SLIP)
}


def multiplicity_table(
    problem: AnyProblem,
    alphas: Iterable[AlphaLike],
    *,
    samples: int | None = None,
    arithmetic: str = "verified",
    without: str | None = None,
    executor: Executor | None = None,
    jobs: int | None = None,
    progress: Callable[[int, int], object] | None = None,
    **options: Any,
) -> pd.DataFrame:
    """Table of the number of solutions at many alphas.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    alphas : iterable of float, Fraction or whatever enumerate_roots accepts as alpha
    samples : int, optional
        The number of evenly spaced alphas, if ``alphas`` has their first and last one only. They are the floats nearest
        to the decimals, where numpy.linspace(-1, 0.2, 7) has -1.1e-16 for 0.
    arithmetic : str
        Of ``enumerate_roots``.
    without : "running away", optional
        Leave out the isolated roots that are proven to run away (see `stability`; the problem needs a mass or a mesh).
        Undecided ones are counted as roots, and the row is then not complete.
    executor : concurrent.futures.Executor, optional
        Enumerates at several alphas at a time: a process pool, or the Client of a dask cluster.
    jobs : int, optional
        Number of processes that work, instead of an ``executor``; a script then needs ``if __name__ == "__main__":``.
    progress : callable, optional
        Called with the numbers of alphas done and of all.
    **options
        Further keyword arguments of ``enumerate_roots``, such as ``time_limit`` for each alpha.

    Returns
    -------
    pandas.DataFrame
        One row per alpha, in the order given: alpha, roots, families; with_open, with_stick, with_slip_plus and
        with_slip_minus, or in 3D with_slip (isolated roots at which at least one node has the status); index_sum
        (missing where a degree is not known), complete, undecided, stopped (why the search ended early, or missing),
        nodes of the search, and seconds. Where a search was cut short or left something undecided, the counts are
        those of what was found, and so lower bounds. With ``without`` also left_out, the number of roots that run away,
        and stability_undecided; index_sum is that of all roots all the same. ``attrs["held"]`` says whether supports or
        springs hold the body: if not, the indices may have any sum.

    Raises
    ------
    InvalidArgumentError
        ``alphas`` is one number, an alpha is not a finite number, or makes a friction coefficient negative; or
        ``without`` is something else, or there is no mass for it.
    Interrupted, OutOfMemoryError
        On Ctrl-C, or where the memory does not suffice; ``partial`` is the table of what was done.

    Examples
    --------
    >>> import enumsol
    >>> table = enumsol.multiplicity_table(enumsol.gallery.one_node_triangle(), [1, "8/3", 5])
    >>> table["roots"].tolist(), bool(table["complete"].all())
    ([1, 2, 3], True)
    """
    given: Any = problem
    check_is_problem(given)
    optional_executor(executor, jobs)
    optional_callable(progress, "progress")
    chosen = alpha_list(alphas) if samples is None else even_alphas(alphas, samples)
    for alpha in chosen:
        problem.friction_at(alpha)
    if without is not None:
        check_without(without, problem)
    row = partial(table_row, problem, {"arithmetic": arithmetic, **options}, without=without)
    done: dict[int, dict[str, Any]] = {}

    def work() -> pd.DataFrame:
        with (
            workers_of(executor, jobs) as pool,
            closing(spread(pool, ((k, row, (alpha,)) for k, alpha in enumerate(chosen)))) as rows,
        ):
            for k, found in rows:
                done[k] = found
                if progress is not None:
                    progress(len(done), len(chosen))
        return _frame(problem, done)

    return keeping(
        "multiplicity_table",
        work,
        lambda _: _frame(problem, done),
        lambda _: f" after {len(done)} of {counted(len(chosen), 'alpha')}",
    )


def _frame(problem: AnyProblem, done: dict[int, dict[str, Any]]) -> pd.DataFrame:
    """Rows in the order of their places."""
    import pandas as pd

    told = [name for name in _LEFT_OUT if any(name in row for row in done.values())]
    counts = ["alpha", "roots", *told, "families", *kinds_of(problem).values(), "index_sum"]
    columns = [*counts, "complete", "undecided", "stopped", "nodes", "seconds"]
    table = pd.DataFrame([done[k] for k in sorted(done)], columns=columns)
    table = table.astype({"index_sum": "Int64"})  # whole numbers, and missing ones
    table.attrs["held"] = problem.held
    return table


def check_without(without: str, problem: AnyProblem) -> None:
    """Refuse what cannot be left out of the solutions of a problem.

    Raises
    ------
    InvalidArgumentError
        It is no name of such solutions, or there is no mass to tell them by.
    """
    from enumsol.roots.stability import Stabilities  # sparse graphs and solvers come with it

    one_of(without, "without", (RUNNING_AWAY,))
    Stabilities(problem)


def table_row(
    problem: AnyProblem, options: dict[str, Any], alpha: Alpha, *, without: str | None = None
) -> dict[str, Any]:
    """Row of the table (a module-level function, so that other processes can import it)."""
    roots = enumerate_roots(problem, alpha, **options)
    verdicts = [found.verdict for found in roots.stability()] if without is not None else [""] * len(roots)
    counted_ones = [root for root, verdict in zip(roots, verdicts, strict=True) if verdict != "runs away"]
    counts = kinds(counted_ones)
    left_out = (verdicts.count("runs away"), verdicts.count("undecided"))
    return {
        "alpha": float(alpha),
        "roots": len(counted_ones),
        **(dict(zip(_LEFT_OUT, left_out, strict=True)) if without is not None else {}),
        "families": len(roots.families),
        **{name: counts[status] for status, name in kinds_of(problem).items()},
        "index_sum": roots.index_sum,
        "complete": roots.complete and "undecided" not in verdicts,
        "undecided": len(roots.undecided),
        "stopped": roots.stopped,
        "nodes": roots.stats.nodes,
        "seconds": roots.stats.seconds,
    }


def kinds_of(problem: AnyProblem) -> Mapping[ContactStatus, str]:
    """The columns that count roots by the statuses of their nodes."""
    return _KINDS if isinstance(problem, ContactProblem) else _KINDS_3D


def kinds(roots: Iterable[Root]) -> Counter[ContactStatus]:
    """For every status the number of isolated roots at which some node has it."""
    return Counter(status for root in roots for status in set(root.statuses))
