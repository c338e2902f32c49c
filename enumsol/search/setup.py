"""What makes a search at one alpha, in 2D and in 3D, of a body that is held or not."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property
from typing import TYPE_CHECKING, Any

from enumsol.errors import InvalidArgumentError
from enumsol.search.certifiers.protocol import Refine, UndecidedPart, Unrecorded
from enumsol.search.load_limit import LoadLimit, load_limit
from enumsol.search.nodes import Relaxations
from enumsol.search.tree import TreeSearch

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol.proof.writer import Recorder
    from enumsol.relaxation.engine import Engine
    from enumsol.search.certifiers.protocol import Certifier
    from enumsol.search.closing import TreeCloser
    from enumsol.search.form_policy import Forms
    from enumsol.search.outcome import SearchLimits, SearchProgress
    from enumsol.search.resume import Reader
    from enumsol.search.splitting import Splitting
    from enumsol.support.array_types import Alpha, Codes

#: Stiffness of the springs by which a solution of a body that nothing holds is approached, relative to the body's own.
_SPRINGS = tuple(2.0**-k for k in range(0, 21, 4))


class SearchSetup(ABC):
    """Base of the solvers of one problem at one alpha in one arithmetic: a search is made of their parts."""

    #: There is a solution for certain (theory, sections 6.7 and 12.6).
    has_solution = True
    problem: Any
    alpha: Alpha
    arithmetic: Any
    _engine: Any

    @property
    @abstractmethod
    def relaxed(self) -> Any:
        """Scaled system that the relaxations are about."""

    @property
    @abstractmethod
    def undecidable(self) -> str | None:
        """Reason why nothing can be proven about this problem, or None."""

    def search(
        self,
        certifier: Certifier,
        limits: SearchLimits | None = None,
        progress: Callable[[SearchProgress], object] | None = None,
    ) -> TreeSearch:
        """A search of the tree with a certifier made here."""
        splitting, p = self._splitting(certifier), self.problem.p
        return TreeSearch(
            Relaxations(self._engine, splitting, p, self._forms(), self._fallback),
            certifier,
            limits=limits,
            progress=progress,
            closer=self._closer(certifier),
            known_root=lambda: self.known_root,
        )

    @property
    def at_limit(self) -> LoadLimit | None:
        """The limit of what contact can hold, if the load of a body that nothing holds is there."""
        return None

    @abstractmethod
    def certifier(self, recorder: Recorder | None) -> Certifier:
        """The certifier of this arithmetic, which writes to a recorder."""

    @abstractmethod
    def remake(self) -> Callable[[], SearchSetup]:
        """Makes the same again, also in another process."""

    def fresh(self) -> SearchSetup:
        """The same without anything that searches leave behind and others would depend on: nothing here."""
        return self

    @abstractmethod
    def unloaded(self) -> bool:
        """True if g = 0, so that only lambda = 0 solves."""

    @abstractmethod
    def reader(self) -> Reader:
        """Understands the records of an earlier proof."""

    @abstractmethod
    def proof_header(self) -> dict[str, Any]:
        """First record of a proof (see enumsol.proof.proof_file).

        Raises
        ------
        InvalidArgumentError
            alpha is a fraction of more digits than a proof may hold.
        """

    @cached_property
    def known_root(self) -> Codes | None:
        """A complete selection proven to hold a strict root or a family, found without the tree; None where none is."""
        certifier = self.certifier(Unrecorded())
        for codes in self._suggested():
            answer = certifier.selection(codes)
            # a degenerate one may belong to others, which only a search tells; those of a family do in any case
            if not isinstance(answer, UndecidedPart | Refine | None) and (
                getattr(answer, "strict", True) or getattr(answer, "dimension", 0)
            ):
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
    def _splitting(self, certifier: Certifier) -> Splitting:
        """How a partial assignment is split, and which rows it imposes."""

    @property
    def _fallback(self) -> Callable[[], Engine] | None:
        """Makes a slower engine for relaxations that stall; None where there is none."""
        return None

    @abstractmethod
    def _closer(self, certifier: Certifier) -> TreeCloser | None:
        """Proposals of an only solution of the problem, or of subtrees."""

    @abstractmethod
    def _forms(self) -> Forms | None:
        """Forms with which a long search may bound in place of the energy."""


class HeldByNothing:
    """Of the solvers of a body that nothing holds, beside those of a body that is held: there may be no solution.

    Raises
    ------
    InvalidArgumentError
        Arithmetic is "fast", which has no solver for such a body, or as of a body that is held.
    """

    has_solution = False
    alpha: Any
    offered = '"verified" or "exact"'
    problem: Any
    #: The system on springs, relative to the body's own stiffness; and as of the solvers of a body that is held.
    _on_springs: Callable[[float], Any]
    _solved: Callable[[Any, Any], tuple[list[Codes], Any] | None]

    def __init__(self, problem: Any, alpha: Any, arithmetic: Any, *options: Any) -> None:
        if arithmetic == "fast":
            raise InvalidArgumentError(f'arithmetic is "fast" for a body that nothing holds; expected {self.offered}')
        super().__init__(problem, alpha, arithmetic, *options)  # type: ignore[call-arg]

    @cached_property
    def at_limit(self) -> LoadLimit | None:
        """The limit of what contact can hold, if the load is there."""
        return load_limit(self.problem, self.alpha)

    def _suggested(self) -> list[Codes]:
        """Selections of the body on springs that become weaker and weaker, those on the weakest first.

        The one of a family at the limit comes before them.
        """
        suggested, near = list[Any](), None
        for stiffness in _SPRINGS:
            found = self._solved(self._on_springs(stiffness), near)
            if found is not None:
                codes, near = found
                suggested = codes + [other for other in suggested if other not in codes]
        return suggested if self.at_limit is None or self.at_limit.codes is None else [self.at_limit.codes, *suggested]

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
