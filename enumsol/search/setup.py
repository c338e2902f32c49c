"""What makes a search at one alpha, in 2D and in 3D, of a body that is held or not."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property
from typing import TYPE_CHECKING, Any

from enumsol.errors import InvalidArgumentError
from enumsol.search.certifiers.protocol import Refine, UndecidedPart, Unrecorded
from enumsol.search.tree import TreeSearch

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol.search.certifiers.protocol import Certifier
    from enumsol.search.outcome import SearchLimits, SearchProgress
    from enumsol.support.array_types import Codes

#: Stiffness of the springs by which a solution of a body that nothing holds is approached, relative to the body's own.
_SPRINGS = tuple(2.0**-k for k in range(0, 21, 4))


class SearchSetup(ABC):
    """Base of the solvers of one problem at one alpha: a search is made of their parts.

    Attributes
    ----------
    relaxed : ScaledSystem or SpaceSystem
        What the relaxations are about.
    """

    #: There is a solution for certain (theory, sections 6.7 and 12.6).
    has_solution = True
    relaxed: Any
    _engine: Any

    def search(
        self,
        certifier: Certifier,
        limits: SearchLimits | None = None,
        progress: Callable[[SearchProgress], object] | None = None,
    ) -> TreeSearch:
        """A search of the tree with a certifier made here."""
        return TreeSearch(
            self.relaxed,
            certifier,
            engine=self._engine,
            splitting=self._splitting(certifier),
            limits=limits,
            progress=progress,
            closer=self._closer(certifier),
            forms=self._forms(),
            known_root=lambda: self.known_root,
        )

    @abstractmethod
    def certifier(self, recorder: Any) -> Certifier:
        """The certifier of this arithmetic, which writes to a recorder."""

    @cached_property
    def known_root(self) -> Codes | None:
        """A complete selection that is proven to hold a strict root, found without the tree; None where that failed."""
        certifier = self.certifier(Unrecorded())
        for codes in self._suggested():
            answer = certifier.selection(codes)
            # a degenerate one may belong to others, which only a search tells
            if not isinstance(answer, UndecidedPart | Refine | None) and getattr(answer, "strict", True):
                return codes
        return None

    def _suggested(self) -> list[Codes]:
        """Complete selections that may hold a root, as far as floats tell, the likeliest first."""
        found = self._solved(self.relaxed, None)
        return [] if found is None else found[0]

    @abstractmethod
    def _solved(self, system: Any, near: Any) -> tuple[list[Codes], Any] | None:
        """Selections, one of which holds at a solution of a system in floats, and that solution, near another one."""

    @abstractmethod
    def _splitting(self, certifier: Certifier) -> Any:
        """How a partial assignment is split, and which rows it imposes."""

    @abstractmethod
    def _closer(self, certifier: Certifier) -> Any:
        """What decides the problem, or subtrees, by an only solution; None where nothing does."""

    @abstractmethod
    def _forms(self) -> Any:
        """What a long search may bound with in place of the energy, or None."""


class HeldByNothing:
    """Of the solvers of a body that nothing holds, beside those of a body that is held: there may be no solution.

    Raises
    ------
    InvalidArgumentError
        Arithmetic is "fast", which has no solver for such a body, or as of a body that is held.
    """

    has_solution = False
    offered = '"verified" or "exact"'
    problem: Any
    #: The system on springs, relative to the body's own stiffness; and as of the solvers of a body that is held.
    _on_springs: Callable[[float], Any]
    _solved: Callable[[Any, Any], tuple[list[Codes], Any] | None]

    def __init__(self, problem: Any, alpha: Any, arithmetic: Any, *options: Any) -> None:
        if arithmetic == "fast":
            raise InvalidArgumentError(f'arithmetic is "fast" for a body that nothing holds; expected {self.offered}')
        super().__init__(problem, alpha, arithmetic, *options)  # type: ignore[call-arg]

    def _suggested(self) -> list[Codes]:
        """Selections of the body on springs that become weaker and weaker, those on the weakest first."""
        suggested, near = list[Any](), None
        for stiffness in _SPRINGS:
            found = self._solved(self._on_springs(stiffness), near)
            if found is not None:
                codes, near = found
                suggested = codes + [other for other in suggested if other not in codes]
        return suggested

    def _closer(self, certifier: Certifier) -> Any:
        """There may be no solution: what takes the place of the tree is a root that is known."""

    def _forms(self) -> None:
        """Bounds of these bodies are of the energy."""

    def unloaded(self) -> bool:
        """Without load the body may be moved: there is no one solution."""
        return False

    def proof_header(self) -> dict[str, Any]:
        """First record of a proof: with the bound of the rigid displacement."""
        header: dict[str, Any] = super().proof_header()  # type: ignore[misc]
        return header | {"max_rigid_displacement": self.problem.rigid_reach}
