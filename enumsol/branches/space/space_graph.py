"""branch_graph in 3D: curves, and the tree that shows that there are no others (theory, section 12.9)."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property, partial
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from enumsol.branches.elements import ANOTHER_INTERVAL, MORE_NODES, MORE_TIME, SHORT_INTERVAL
from enumsol.branches.graph_data import GraphData, GraphStats
from enumsol.branches.proof_records import graph_header
from enumsol.branches.space.chains import chain_through
from enumsol.branches.space.make_curved import CurvedGraph
from enumsol.branches.space.pieces import runs_and_turns
from enumsol.condensation.enclosure import NotEnclosedError, enclosure_of
from enumsol.model.sectors import SECTORS, is_sector, nearest, run_of
from enumsol.proof.curve_records import box_record
from enumsol.proof.leaves import UndecidedRecord
from enumsol.proof.records import CutPiece
from enumsol.proof.writer import ProofWriter, unit_exponents
from enumsol.roots.enumerate import enumerate_roots
from enumsol.roots.root_set import RigidBound, RootSet, SearchStats, Undecided
from enumsol.roots.space_roots import SpaceEnumeration
from enumsol.search.outcome import Stop, StopReason, joined
from enumsol.search.space.known_curves import Curves
from enumsol.search.space.piece_tree import OpenLeaf, PieceTree, SpreadPieces
from enumsol.search.space.space_search import SpaceSolvers
from enumsol.support.deadlines import TimeOverError, look, remaining, within
from enumsol.support.messages import counted
from enumsol.trusted.space.curve_parts import Run, arcs_over
from enumsol.trusted.space.curve_runs import apart
from enumsol.trusted.space.leaves import SpaceRoot, distinct_roots, settle
from enumsol.trusted.space.sector_rows import leaf_code
from enumsol.trusted.space.solution_curve import AlphaProblem

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from concurrent.futures import Executor

    from enumsol.branches.elements import Arc, Tick, Vertex
    from enumsol.condensation.enclosure import CondensedEnclosure
    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.model.problem3d import ContactProblem3D
    from enumsol.proof.curve_records import CurvePart
    from enumsol.proof.proof_file import Proof
    from enumsol.proof.records import Record
    from enumsol.support.array_types import Alpha, Codes, Floats
    from enumsol.support.deadlines import Deadline
    from enumsol.trusted.space.curve_parts import Turn
    from enumsol.trusted.space.curve_runs import CurveChain

    Bounds = tuple[Fraction, Fraction]
    #: The parts into which a curve is cut, and their records.
    _Cut = tuple[Sequence[Run | Turn], Sequence[CurvePart]]


#: Where solutions are sampled if more than one curve may be needed, as shares of the interval; nodes of a search there.
_SAMPLED, _NODES = (Fraction(15, 16), Fraction(1, 2), Fraction(1, 16)), 500
#: After so many curves that are not new, or neither whole nor as long as this share of the interval, no further one is
#: followed.
_FAILURES, _LONG = 3, 2.0**-6


@dataclass(eq=False)
class ByCurves:
    """The way in 3D: curves of solutions over an interval that a tree finds, cut into arcs.

    It keeps what it has found, so that an interruption loses none of it.

    Attributes
    ----------
    problem : ContactProblem3D
    interval : first and last alpha
    chains : list of CurveChain
        No two have a solution in common.
    records : list
        Of the tree, in the order of a walk; open leaves among them.
    failed : int
        Curves that were met and of no use.
    nodes : int
    settled : bool
        The records say of the whole tree what is open.
    refused : list of str
        Why there is no search.
    stop : Stop or None
        How far the search came, if a limit ended it.
    searched : bool
    cuts : dict
        By the number of a curve the parts into which it is cut, and their records.
    begun : dict
        Parts of the others.
    """

    problem: ContactProblem3D
    interval: Bounds
    chains: list[CurveChain] = field(default_factory=list)
    records: list[Record | OpenLeaf] = field(default_factory=list)
    failed: int = 0
    nodes: int = 0
    settled: bool = False
    refused: list[str] = field(default_factory=list)
    stop: Stop | None = None
    searched: bool = False
    cuts: dict[int, _Cut] = field(default_factory=dict)
    begun: dict[int, list[Run | Turn]] = field(default_factory=dict)

    @property
    def gaps(self) -> list[Bounds]:
        """Ranges of alpha over which something is not decided, in order, those that touch as one."""
        return joined([*((leaf.low, leaf.high) for leaf in self.records if isinstance(leaf, OpenLeaf)), *self.ends])

    @property
    def ends(self) -> list[Bounds]:
        """Alphas of the interval at which curves go on where nothing is known of them."""
        low, high = self.interval
        return [(max(begin, low), min(end, high)) for chain in self.chains for begin, end in chain.gaps]

    @cached_property
    def enclosure(self) -> CondensedEnclosure:
        """Balls for all alpha; NotEnclosedError where there are none."""
        return enclosure_of(self.problem)

    @cached_property
    def _given(self) -> AlphaProblem:
        return AlphaProblem.of(self.enclosure)

    def _units(self) -> tuple[Floats, Floats]:
        system = SpaceSolvers(self.problem, sum(self.interval) / 2, "verified").system
        return system.force, system.length

    # -- the search ------------------------------------------------------------------------------------------------

    def run(self, max_nodes: int | None, limits: Deadline, tick: Tick | None, executor: Executor | None) -> None:
        """Search the tree, and follow curves where it wants them (theory, section 12.9).

        ``tick`` is called with the share that is done, ``executor`` as in ``branch_graph``.
        """
        try:
            with within(limits):
                curves = Curves(self._given, self.interval)
                tree = PieceTree(self.enclosure, self._units(), curves, max_nodes, tick)
                self._search(tree, tree if executor is None else SpreadPieces(executor, tree))
            self.stop = None if tree.stopped is None else Stop(tree.stopped, self.nodes)
        except NotEnclosedError as error:
            self.refused.append(str(error))
        except TimeOverError:
            self.stop = Stop(StopReason.TIME_LIMIT, self.nodes)
        self.searched = True

    def _search(self, tree: PieceTree, search: PieceTree | SpreadPieces) -> None:
        try:
            search.run()
            while tree.wanted is not None:
                for x in self._points(tree.curves) if tree.wanted.x is None else [tree.wanted.x]:
                    self._follow(x, tree.curves)
                search.run()
        except TimeOverError:
            tree.stop_for_time()
        finally:
            search.end()
            self.records, self.nodes = tree.records, tree.nodes
            self.settled = tree.settled and bool(tree.records)

    def _follow(self, x: Floats, curves: Curves) -> None:
        """Follow a curve through a solution, unless a known one seems to pass through it."""
        if curves.final or curves.is_known(x):
            return
        chain = chain_through(self._given, self.problem, x, self.interval, self._take)
        new = chain is not None and self._take(chain)
        # what is left open costs as much at every further point of the same curve
        self.failed += chain is None or not new or not self._is_of_use(chain)
        curves.final = self.failed >= _FAILURES
        if chain is not None and new:
            curves.take(chain)

    def _points(self, curves: Curves) -> Iterator[Floats]:
        """Solutions at some alphas, as many as short searches find: forces, rigid displacements if any, and alpha."""
        curves.sampled = True
        low, high = self.interval
        for alpha in (low + share * (high - low) for share in _SAMPLED):
            look()
            seconds = remaining()
            # seconds that it has at least
            left = None if seconds is None else max(seconds, 1e-3)
            for root in enumerate_roots(self.problem, alpha, max_nodes=_NODES, time_limit=left):
                rigid = np.zeros(0) if root.rigid_coordinates is None else root.rigid_coordinates
                yield np.concatenate([root.lambda_n, *root.lambda_t.T, rigid, [float(alpha)]])

    def _is_of_use(self, chain: CurveChain) -> bool:
        alphas, (low, high) = [end for joint in chain.joints for end in joint.alphas], self.interval
        return chain.whole or max(alphas) - min(alphas) > Fraction(_LONG) * (high - low)

    def _take(self, chain: CurveChain) -> bool:
        """Take in a curve, if it is proven to have nothing in common with those that are known."""
        new = all(apart(chain, other) for other in self.chains)
        if new:
            self.chains.append(chain)
        return new

    # -- arcs ------------------------------------------------------------------------------------------------------

    def made(self, limits: Deadline, tick: Tick | None) -> GraphData:
        """Arcs into which the curves are cut."""
        with within(limits):
            return self._made(tick, self.stop)

    def ended(self, reason: StopReason) -> GraphData:
        """Arcs of the curves that were found."""
        return self._made(None, Stop(reason, self.nodes))

    def _made(self, tick: Tick | None, stop: Stop | None) -> GraphData:
        """Vertices and arcs of all curves found; after an interruption while they were cut, of those cut by then."""
        graph = self._elements(tick, stop) if self.chains else None
        vertices, arcs = ([], []) if graph is None else graph.made()
        told, left_open = ([], []) if graph is None else (graph.reasons, graph.left_open)
        reasons, cut = [*self.refused, *([] if stop is None else [str(stop)])], len(self.cuts) == len(self.chains)
        return GraphData(
            self.problem,
            None,
            self.interval,
            "verified",
            tuple(vertices),
            tuple(arcs),
            (*reasons, *([] if reasons else self._sentences()), *told),
            GraphStats(
                pieces=1 + sum(isinstance(record, CutPiece) for record in self.records),
                nodes=self.nodes,
                selections=len({arc.selections for arc in arcs}),
            ),
            make_proof=None if reasons else partial(self.proof, with_arcs=cut),
            left_open=self._left_open(left_open) if self.settled and cut else None,
        )

    def _elements(self, tick: Tick | None, stop: Stop | None) -> CurvedGraph:
        """Curves cut into parts, as far as there is time."""
        # the gaps tell what the tree left open
        curves, remedy = self.chains, None
        if stop is not None:
            remedy = MORE_NODES if stop.reason is StopReason.NODE_LIMIT else MORE_TIME
        made = CurvedGraph(self.problem, self._given, self.interval)
        over = stop is not None and stop.interrupted and self.searched
        for k, chain in enumerate(curves):
            try:
                if tick is not None:
                    tick(k / len(curves))
                if k not in self.cuts and not over:
                    found = self.begun.setdefault(k, [])
                    records: list[CurvePart] = []
                    found.clear()
                    self.cuts[k] = runs_and_turns(chain, found, records), records
            except TimeOverError:
                cut = f"the time was over before curve {k + 1} of {len(curves)} was cut into arcs"
                made.reasons.append(f"{cut}; {MORE_TIME}")
            if k in self.cuts:
                made.add(self.cuts[k][0], chain.ends, remedy, closed=chain.closed)
            else:
                parts = self.begun.get(k, [])
                made.add(parts, _ends_of(parts), MORE_TIME)
        if tick is not None:
            tick(1.0)
        return made

    def _left_open(self, beside: Sequence[Bounds]) -> tuple[Bounds, ...]:
        """Ranges of alpha outside of which nothing is missing, with those left open when curves were cut."""
        low, high = self.interval
        ranges = ((max(begin, low), min(end, high)) for begin, end in (*self.gaps, *beside))
        return tuple(joined(ends for ends in ranges if ends[0] <= ends[1]))

    def _sentences(self) -> list[str]:
        """Sentences on where solutions may be missing, why, and what may decide it."""
        found, gaps, named = [], self.gaps, 5
        met = [leaf for leaf in self.records if isinstance(leaf, OpenLeaf) and leaf.met]
        for low, high in gaps[:named]:
            ends = sum(low <= begin and end <= high for begin, end in self.ends)
            why, remedy = "pieces of alpha as short as are tried left statuses undecided", SHORT_INTERVAL
            if ends:
                curves = counted(ends, "end of a curve", "ends of curves")
                meet = "branches meet" + ("" if self.problem.held else " or a rigid displacement reaches its bound")
                why, remedy = f"nothing is proven beyond {curves} there, as where {meet}", ANOTHER_INTERVAL
            elif any(low <= leaf.low and leaf.high <= high for leaf in met):
                why, remedy = "no curve through a solution there was proven", ANOTHER_INTERVAL
            found.append(
                f"solutions may be missing for alpha in [{float(low):.8g}, {float(high):.8g}]: {why}; {remedy}"
            )
        more = len(gaps) - named
        return [*found, f"and {more} gaps more"] if more > 0 else found

    # -- its proof -------------------------------------------------------------------------------------------------

    def proof(self, *, with_arcs: bool = False) -> Proof:
        """Curves and tree for ``enumsol.verify``; ``with_arcs``: and the parts into which all curves are cut."""
        writer = ProofWriter()
        writer.write(
            graph_header(self.problem, self.interval, "problem")
            | unit_exponents(*self._units())
            | {"steps": self._given.steps.tolist()}
        )
        arcs, open_parts = 0 if with_arcs else None, 0
        for number, chain in enumerate(self.chains):
            writer.write({"curve": len(chain.links)})
            for k, joint in enumerate(chain.joints):
                writer.write(box_record(joint.box))
                if k < len(chain.links):
                    writer.write(box_record(chain.links[k].curve.box))
            if arcs is not None:
                parts, records = self.cuts[number]
                writer.write({"parts": True})
                for part in records:
                    writer.write(part.write())
                inside, gaps_between = arcs_over(parts, self.interval, closed=chain.closed)
                arcs, open_parts = arcs + inside, open_parts + len(gaps_between)
        writer.write({"tree": True})
        leaves, gaps = 0, len(self.ends) + open_parts
        no_curve = UndecidedRecord("solutions there lie on no curve that is known")
        for record in self.records:
            written = no_curve if isinstance(record, OpenLeaf) else record
            gaps += written is not record
            leaves += written.kind not in ("p", "b")
            writer.write(written.write())
        writer.write({"curves": len(self.chains), "arcs": arcs, "leaves": leaves, "gaps": gaps})
        return writer.close()


def _ends_of(parts: Sequence[Run | Turn]) -> tuple[Bounds | None, Bounds | None]:
    """Bounds of alpha at both ends of a part of a curve."""
    if not parts:
        return None, None
    first, last = parts[0], parts[-1]
    return first.start if isinstance(first, Run) else first.alphas, last.end if isinstance(last, Run) else last.alphas


_NOT_PROVEN = "the root of an arc could not be proven at this alpha"


def roots_on_arcs(
    data: GraphData, alpha: Alpha, arcs: Sequence[Arc], vertices: Sequence[Vertex], near: Sequence[Vertex]
) -> RootSet:
    """The roots of arcs at an alpha; what lies too close to a vertex is undecided.

    Parameters
    ----------
    arcs : those that pass over the alpha
    vertices : at it, on the border of the interval
    near : of which it is not known on which side of the alpha they lie
    """
    numbers = {v.number for v in vertices}
    arcs = [*arcs, *(arc for arc in data.arcs if numbers & {arc.tail, arc.head})]
    solvers = SpaceSolvers(data.problem, alpha, "verified")
    enumeration = SpaceEnumeration(solvers, None, None)
    leaves: list[tuple[Codes, SpaceRoot]] = []
    undecided: list[Undecided] = []
    for arc in arcs:
        forces = arc.state(alpha)[0]
        found = root_near(solvers.enclosed, arc.selections[0], forces)
        if found is None:
            undecided.append(Undecided(arc.statuses, _NOT_PROVEN, "another alpha, or enumerate_roots there"))
        else:
            leaves.append(found)
    distinct, doubtful, _ = distinct_roots(leaves)
    # every arc has a root of its own
    lost = len(leaves) - len(distinct)
    undecided += [Undecided((None,) * data.problem.p, _NOT_PROVEN, "enumerate_roots there")] * lost
    undecided += [
        Undecided(
            v.statuses, "alpha cannot be told from a vertex of the graph", "another alpha, or enumerate_roots there"
        )
        for v in near
    ]
    roots = [enumeration.root(codes, root) for codes, root in distinct]
    roots.sort(key=lambda root: (-float(np.sum(root.lambda_n)), root.lambda_n.tolist(), root.lambda_t.tolist()))
    known = data.claims.knows(Fraction(alpha))
    whole = not undecided and known
    return RootSet(
        alpha=alpha,
        roots=roots,
        families=(),
        undecided=undecided,
        arithmetic="verified",
        method="graph",
        stopped=None if known else str(Stop(StopReason.GRAPH_INCOMPLETE)),
        stats=SearchStats(selections=len(arcs)),
        node_ids=data.problem.node_ids,
        # others beyond it were not looked for
        rigid_bound=None if data.problem.held else RigidBound(data.problem.rigid_reach, needed=True),
        at_least=None if whole else max(len(roots) - len(doubtful), data.claims.multiplicity(data.inside(alpha)).count),
    )


def root_near(system: EnclosedSpace, codes: Codes, forces: Floats) -> tuple[Codes, SpaceRoot] | None:
    """The regular root with these statuses near given forces (in the problem's units), proven; None where it is not.

    ``codes`` as in a graph: slip in any direction.
    """
    # levels of the sectors in which a root is looked for, the narrow ones first
    for level in (22, 16, 11, 8, 6):
        for leaf in product(*(_leaves(system, i, code, forces, level) for i, code in enumerate(codes))):
            found = settle(system, leaf)
            if isinstance(found, SpaceRoot):
                return leaf, found
    return None


def _leaves(system: EnclosedSpace, i: int, code: int, forces: Floats, level: int) -> Iterable[int]:
    """Codes of a node in a leaf: of a node that slips, the sectors of a level around the direction of its friction."""
    p = len(system.tau)
    tau = forces[p:].reshape(2, p)[:, i] / np.where(system.F[i] > 0, system.F[i], 1.0)
    code = leaf_code(code, system.tau[i], tau, level)
    if code < SECTORS:
        return (code,)
    begin = nearest(float(tau[0]), float(tau[1]), level)
    first = 1 << level
    before = first + (begin - first - 1) % first
    both = run_of(before, 2) if before < begin else before
    if before < begin and is_sector(both):
        return (SECTORS + both,)
    return (SECTORS + begin, SECTORS + before)
