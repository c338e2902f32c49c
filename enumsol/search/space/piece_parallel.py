"""The tree over alpha searched by the workers of an executor, put together in the tree's order.

A task is a part of the tree with the curves that are known, and depends on nothing else. Where it would look for
another curve it ends: that is done by the calling process when the walk through the tree comes to it, and what lies
behind is searched again if a curve is found. So curves and proof depend neither on timing nor on the number of workers.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from enumsol.search.parts import Answer, Spread
from enumsol.search.space.known_curves import Curves
from enumsol.search.space.piece_tree import PieceTree
from enumsol.support.deadlines import remaining
from enumsol.trusted.space.curve_runs import KnownCurve
from enumsol.trusted.space.solution_curve import AlphaProblem

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from concurrent.futures import Executor
    from fractions import Fraction

    from enumsol.condensation.enclosure import CondensedEnclosure
    from enumsol.search.space.piece_multipliers import AlphaPoint
    from enumsol.search.space.piece_tree import PieceNode
    from enumsol.support.array_types import Floats
    from enumsol.trusted.space.curve_chains import CurveChain

#: Nodes of a task.
NODES = 16


class CurveWantedError(Exception):
    """A tree whose curves are given would look for another one."""


class GivenCurves(Curves):
    """Curves that are given; where another one would be looked for, CurveWantedError is raised."""

    def follow(self, x: Floats) -> bool:
        """True, or an error, if there may be a new curve through a solution."""
        if self.more is None or self.is_known(x):
            return False
        raise CurveWantedError

    def sample(self) -> bool:
        """Solutions are sampled by the calling process."""
        raise CurveWantedError

    def seek(self, point: Callable[[], AlphaPoint]) -> bool:
        """Curves are sought by the calling process."""
        raise CurveWantedError


@dataclass(frozen=True)
class PieceWorker:
    """All that the search of a subtree depends on where no further curve is looked for.

    Attributes
    ----------
    problem : (enclosure, interval, units, smallest), as PieceTree takes them
    chains : sequence of CurveChain
    sampled : solutions were sampled
    sought : how often a curve through the middle of a piece was looked for
    final : no further curve is to be followed
    """

    problem: tuple[CondensedEnclosure, tuple[Fraction, Fraction], tuple[Floats, Floats], float]
    chains: tuple[CurveChain, ...]
    sampled: bool
    sought: int
    final: bool

    @classmethod
    def of(cls, tree: PieceTree) -> PieceWorker:
        """Worker for parts of a tree as it is now."""
        curves = tree.curves
        chains = tuple(known.chain for known in curves.known)
        return cls(tree.problem, chains, curves.sampled, curves.sought, curves.more is None)

    @cached_property
    def _known(self) -> list[KnownCurve]:
        given = AlphaProblem.of(self.problem[0])
        return [KnownCurve(given, chain) for chain in self.chains]

    def examined(self, roots: Sequence[PieceNode], nodes: int) -> Answer:
        """Examine so many nodes, until the time is over or a curve is wanted."""
        enclosure, interval, units, smallest = self.problem
        curves = GivenCurves(enclosure, interval, None if self.final else lambda _: None)
        curves.sampled, curves.sought = self.sampled, self.sought
        for known in self._known:
            curves.take(known)
        tree, waiting, wanted = PieceTree(enclosure, interval, units, curves, smallest=smallest), list(roots), False
        try:
            tree.examine(waiting, nodes)
        except CurveWantedError:
            wanted = True
        return Answer(tree.records, tree.nodes, tree.covered, [item.sent() for item in waiting], wanted)


class SpreadPieces(Spread):
    """Searches a tree over alpha with the help of an executor.

    Parameters
    ----------
    executor : Executor
    tree : PieceTree
    """

    def __init__(self, executor: Executor, tree: PieceTree) -> None:
        super().__init__(executor, tree, NODES, remaining)
        self._pieces = tree
        self._renew()

    def run(self, waiting: list[PieceNode]) -> None:
        """Examine what waits; what no worker has examined when a limit is reached is open."""
        stack = self._begin(waiting)
        try:
            self._pieces.away = True
            waiting.clear()
            self._examine(stack)
        finally:
            self._leave(stack)
            self._pieces.away = False

    def _worker(self) -> PieceWorker:
        self._sent = self._state
        return PieceWorker.of(self._pieces)

    def _is_current(self, *, afresh: bool) -> bool:
        del afresh
        return self._sent == self._state

    @property
    def _state(self) -> tuple[Any, ...]:
        """Facts about the curves that workers are to know, and that change during a search."""
        curves = self._pieces.curves
        return len(curves.known), curves.sampled, curves.sought_enough, curves.more is None


def spread_over(executor: Executor, tree: PieceTree, waiting: list[PieceNode]) -> None:
    """Examine what waits with the help of an executor, see ``PieceTree.run``."""
    SpreadPieces(executor, tree).run(waiting)
