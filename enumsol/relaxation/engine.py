"""Relaxations, convex QPs in lambda, and engines that solve them, as the search sees them (theory, section 5)."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

from enumsol.support.array_types import Codes, Floats, Indices

#: Largest violation of a row (rows of unit length in the norm of S^{-1}) that the QP ignores.
FEASIBILITY_TOLERANCE = 1e-11
#: A leaf is pruned when its energy bound exceeds this; g' S^{-1} g lies in [1, 4), so it is relative to the data.
PRUNE_MARGIN = 1e-9
#: Nodes whose children are bounded before one of them is branched on (measured in studies/branching_rule).
BRANCHING_CANDIDATES = 24


def not_compiled(error: ImportError) -> str:
    """Sentence that the compiled solver cannot be imported, and what to do.

    Python imports the first enumsol that it finds: in a source tree the one there, where nothing may be compiled.
    """
    package = Path(__file__).resolve().parents[1]
    return (
        f"the compiled active-set solver cannot be loaded from {package} ({' '.join(str(error).split())}; install "
        f"enumsol with a C compiler, and start Python in another directory than {package.parent} if it is installed)"
    )


class Relaxation(Protocol):
    """The solved relaxation of one partial assignment."""

    pruned: bool  # the energy bound is above PRUNE_MARGIN: no solution
    stalled: bool  # the engine gave no answer: no conclusion
    bound: float

    @property
    def form(self) -> Any:
        """The form that ``bound`` is about: an EnclosedForm, in 3D a SlipForm; None for the energy."""

    @property
    def forces(self) -> Floats:
        """lambda at the minimiser, shape (2p,), scaled."""

    @property
    def displacements(self) -> Floats:
        """w at the minimiser, shape (2p,), scaled."""

    def at(self, i: int) -> tuple[float, float]:
        """Number i of the forces and of the displacements."""

    def multipliers(self) -> tuple[Indices, Floats]:
        """Rows and their multipliers, which prove ``bound``."""

    def choose(self, codes: Codes) -> int:
        """The contact node to branch on, -1 when all are decided."""

    def forced(self, codes: Codes) -> tuple[int, ...]:
        """Undecided contact nodes with at most one child that no known bound excludes."""

    def child(self, rows: list[int], modes: list[int], *, last: bool) -> Relaxation:
        """The relaxation with further rows switched on; ``last``: this object is not used again."""


class Engine(Protocol):
    """Makes the relaxation at the root of the tree."""

    name: str
    #: Its relaxations solve the children of all nodes before they choose one.
    solves_children: bool

    def root(self, rows: list[int], modes: list[int]) -> Relaxation:
        """The relaxation with the given rows on."""
