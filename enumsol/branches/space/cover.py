"""All solutions of a problem in 3D over an interval of alpha: curves in boxes, and the tree that shows it.

The tree finds the curves (theory, section 12.9): at a solution that lies in no box yet a curve is followed through it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.branches.space.chains import chain_through
from enumsol.condensation.enclosure import enclosure_of
from enumsol.proof.curve_records import CurveBoxRecord
from enumsol.proof.leaves import UndecidedRecord
from enumsol.proof.proof_file import PROOF_VERSION, Proof
from enumsol.proof.writer import ProofWriter, unit_exponents
from enumsol.roots.enumerate import enumerate_roots
from enumsol.search.space.known_curves import Curves, joined
from enumsol.search.space.piece_parallel import spread_over
from enumsol.search.space.piece_tree import OpenLeaf, PieceTree
from enumsol.search.space.space_setup import SpaceSolvers
from enumsol.support.deadlines import look, remaining
from enumsol.trusted.space.curve_chains import apart
from enumsol.trusted.space.curve_parts import arcs_over
from enumsol.trusted.space.solution_curve import AlphaProblem

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from concurrent.futures import Executor

    from numpy.typing import NDArray

    from enumsol.condensation.enclosure import CondensedEnclosure
    from enumsol.model.problem3d import ContactProblem3D
    from enumsol.proof.curve_records import CurvePart
    from enumsol.search.outcome import StopReason
    from enumsol.trusted.space.curve_chains import CurveChain
    from enumsol.trusted.space.curve_parts import Run, Turn

    Array = NDArray[np.float64]

#: Nodes of a search at one alpha that is to find curves.
_SAMPLED = 500
#: After so many curves that are not new, or neither whole nor as long as this share of the interval, no further one is
#: followed.
_FAILURES, _LONG = 3, 2.0**-6


@dataclass(eq=False)
class SpaceCover:
    """Curves over an interval, and what is proven of them.

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
    stopped : StopReason or None
        Why the tree was not searched to its end.
    settled : bool
        The records say of the whole tree what is open.
    """

    problem: ContactProblem3D
    interval: tuple[Fraction, Fraction]
    chains: list[CurveChain] = field(default_factory=list)
    records: list[Any] = field(default_factory=list)
    failed: int = 0
    nodes: int = 0
    stopped: StopReason | None = None
    settled: bool = False

    @property
    def gaps(self) -> list[tuple[Fraction, Fraction]]:
        """Ranges of alpha over which something is not decided, in order, those that touch as one."""
        return joined([*((leaf.low, leaf.high) for leaf in self.records if isinstance(leaf, OpenLeaf)), *self.ends])

    @property
    def ends(self) -> list[tuple[Fraction, Fraction]]:
        """Alphas of the interval at which curves go on where nothing is known of them."""
        low, high = self.interval
        return [(max(begin, low), min(end, high)) for chain in self.chains for begin, end in chain.gaps]

    def unexplained(self, low: Fraction, high: Fraction) -> bool:
        """True if a solution was met over a gap through which no curve is known."""
        leaves = (leaf for leaf in self.records if isinstance(leaf, OpenLeaf) and leaf.forces is not None)
        return any(low <= leaf.low and leaf.high <= high for leaf in leaves)

    @cached_property
    def enclosure(self) -> CondensedEnclosure:
        """Balls for all alpha; NotEnclosedError where there are none."""
        return enclosure_of(self.problem)

    def _units(self) -> tuple[Array, Array]:
        system = SpaceSolvers(self.problem, sum(self.interval) / 2, "verified").system
        return system.force, system.length

    def search(
        self,
        max_nodes: int | None = None,
        tick: Callable[[float], object] | None = None,
        executor: Executor | None = None,
    ) -> None:
        """Search the tree; ``tick`` is called with the share that is done, ``executor`` as in ``branch_graph``.

        Raises
        ------
        NotEnclosedError
            The data cannot be enclosed.
        """
        given = AlphaProblem.of(self.enclosure)

        def more(x: Array) -> CurveChain | None:
            chain = chain_through(given, self.problem, x, self.interval, self._take)
            if chain is not None and not self._take(chain):
                chain = None
            # what is left open costs as much at every further point of the same curve
            self.failed += chain is None or not self._is_of_use(chain)
            curves.more = more if self.failed < _FAILURES else None
            return chain

        curves = Curves(self.enclosure, self.interval, more if self.failed < _FAILURES else None, self._solutions)
        tree = PieceTree(self.enclosure, self.interval, self._units(), curves, max_nodes, tick)
        try:
            tree.run(None if executor is None else partial(spread_over, executor))
        finally:
            self.records, self.nodes, self.stopped = tree.records, tree.nodes, tree.stopped
            self.settled = tree.settled and bool(tree.records)

    def _is_of_use(self, chain: CurveChain) -> bool:
        alphas, (low, high) = [end for joint in chain.joints for end in joint.alphas], self.interval
        return chain.whole or max(alphas) - min(alphas) > Fraction(_LONG) * (high - low)

    def _take(self, chain: CurveChain) -> bool:
        """Take in a curve, if it is proven to have nothing in common with those that are known."""
        new = all(apart(chain, other) for other in self.chains)
        if new:
            self.chains.append(chain)
        return new

    def _solutions(self, alpha: Fraction) -> list[Array]:
        """Forces of solutions at an alpha, as many as a short search finds, with rigid displacements if any."""
        look()
        seconds = remaining()
        # seconds that it has at least
        left = None if seconds is None else max(seconds, 1e-3)
        roots = enumerate_roots(self.problem, alpha, max_nodes=_SAMPLED, time_limit=left)
        rigid = [np.zeros(0) if root.rigid_coordinates is None else root.rigid_coordinates for root in roots]
        return [np.concatenate([root.lambda_n, *root.lambda_t.T, q]) for root, q in zip(roots, rigid, strict=True)]

    def proof(self, cuts: Sequence[tuple[Sequence[Run | Turn], Sequence[CurvePart]]] | None = None) -> Proof:
        """Curves and tree for ``enumsol.verify``.

        ``cuts``: of every curve the parts into which it is cut, and their records, for a proof that has arcs.
        """
        writer = ProofWriter()
        writer.write(
            {
                "format": "enumsol-proof",
                "version": PROOF_VERSION,
                "kind": "graph",
                "problem": self.problem.fingerprint,
                "interval": [str(end) for end in self.interval],
                "p": self.problem.p,
                "data": "problem",
                **({} if self.problem.held else {"max_rigid_displacement": self.problem.rigid_reach}),
                **unit_exponents(*self._units()),
                "steps": AlphaProblem.of(self.enclosure).steps.tolist(),
            }
        )
        arcs, open_parts = None if cuts is None else 0, 0
        for number, chain in enumerate(self.chains):
            writer.write({"curve": len(chain.links)})
            for k, joint in enumerate(chain.joints):
                writer.write(CurveBoxRecord.around(joint.box).write())
                if k < len(chain.links):
                    writer.write(CurveBoxRecord.around(chain.links[k].curve.box).write())
            if cuts is not None and arcs is not None:
                parts, records = cuts[number]
                writer.write({"parts": True})
                for part in records:
                    writer.write(part.write())
                inside, gaps_between = arcs_over(parts, self.interval, closed=chain.closed)
                arcs, open_parts = arcs + inside, open_parts + len(gaps_between)
        writer.write({"tree": True})
        leaves, gaps = 0, len(self.ends) + open_parts
        for record in self.records:
            is_open = isinstance(record, OpenLeaf)
            gaps += is_open
            leaves += is_open or record.kind not in ("p", "b")
            # what the record of an open leaf says
            writer.write(
                (UndecidedRecord("solutions there lie on no curve that is known") if is_open else record).write()
            )
        writer.write({"curves": len(self.chains), "arcs": arcs, "leaves": leaves, "gaps": gaps})
        return writer.close()
