"""What makes a search at one alpha, in 2D and in 3D, of a body that is held or not."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property
from typing import TYPE_CHECKING, Any

from enumsol.errors import InvalidArgumentError
from enumsol.proof.writer import point_header, unit_exponents
from enumsol.search.certifiers.protocol import Refine, UndecidedPart, Unrecorded
from enumsol.search.load_limit import LoadLimit, load_limit
from enumsol.search.nodes import Relaxations
from enumsol.search.tree import TreeSearch

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol.condensation.enclosure import RigidRows
    from enumsol.model.problem3d import AnyProblem
    from enumsol.proof.writer import Recorder
    from enumsol.relaxation.engine import Engine
    from enumsol.search.certifiers.protocol import Certifier
    from enumsol.search.closing import TreeCloser
    from enumsol.search.form_policy import Forms
    from enumsol.search.outcome import SearchLimits, SearchProgress
    from enumsol.search.resume import Reader
    from enumsol.search.splitting import Splitting
    from enumsol.support.array_types import Alpha, Codes, Floats

#: Stiffness of the springs by which a solution of a body that nothing holds is approached, relative to the body's own.
_SPRINGS = tuple(2.0**-k for k in range(0, 21, 4))
#: That of the springs of its relaxations (theory, section 14.5).
WEAK = 2.0**-20


def weakly_held(S: Floats, g: Floats, rows: RigidRows, stiffness: float = WEAK) -> tuple[Floats, ...]:
    """S and g with weak springs in place of those that they have."""
    G, h = rows.G.mid, rows.h.mid
    soft = G.T / stiffness
    S = S + soft @ G
    return 0.5 * (S + S.T), g + soft @ h


class SearchSetup(ABC):
    """Base of the solvers of one problem at one alpha in one arithmetic: a search is made of their parts.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    alpha : float or Fraction
    arithmetic : str

    Raises
    ------
    InvalidArgumentError
        Arithmetic is "fast", which has no solver for a body that nothing holds.
    """

    #: Arithmetics for a body that nothing holds.
    _offered = '"verified" or "exact"'
    #: The scaled system: a ScaledSystem, in 3D a SpaceSystem.
    scaled: Any
    _engine: Any

    def __init__(self, problem: AnyProblem, alpha: Alpha, arithmetic: str) -> None:
        if arithmetic == "fast" and not problem.held:
            raise InvalidArgumentError(f'arithmetic is "fast" for a body that nothing holds; expected {self._offered}')
        self.problem: Any = problem
        self.alpha, self.arithmetic = alpha, arithmetic

    def search(
        self,
        certifier: Certifier,
        limits: SearchLimits | None = None,
        progress: Callable[[SearchProgress], object] | None = None,
    ) -> TreeSearch:
        """A search of the tree with a certifier made here."""
        splitting, p = self._splitting(certifier), self.problem.p
        # bounds of bodies that nothing holds are of the energy
        forms = self._forms if self.problem.held else None
        return TreeSearch(
            Relaxations(self._engine, splitting, p, forms, self._fallback),
            certifier,
            limits=limits,
            progress=progress,
            closer=self._closer(certifier),
            known_root=lambda: self.known_root,
        )

    # -- the problem -----------------------------------------------------------------------------------------------

    @property
    def relaxed(self) -> Any:
        """The system that the relaxations are about."""
        return self.scaled

    @property
    @abstractmethod
    def undecidable(self) -> str | None:
        """Reason why nothing can be proven about this problem, or None."""

    @property
    def data(self) -> str:
        """Data that a proof is about: "problem" (the matrices as given) or "condensed" (S and g as computed)."""
        return "problem"

    @property
    def has_solution(self) -> bool:
        """True if there is a solution for certain (theory, sections 6.7 and 12.6)."""
        return bool(self.problem.held)

    @cached_property
    def at_limit(self) -> LoadLimit | None:
        """The limit of what contact can hold, if the load of a body that nothing holds is there."""
        return None if self.problem.held else load_limit(self.problem, self.alpha)

    def unloaded(self) -> bool:
        """True if g = 0 for the data as given, so that only lambda = 0 solves: not of a body that may be moved then."""
        return bool(self.problem.held and self.problem.is_unloaded(self.alpha))

    def proof_header(self) -> dict[str, Any]:
        """First record of a proof (see enumsol.proof.proof_file).

        Raises
        ------
        InvalidArgumentError
            alpha is a fraction of more digits than a proof may hold.
        """
        units = unit_exponents(self.scaled.force, self.scaled.length)
        header = point_header(self.problem, self.alpha, self.data, units, **self._kind)
        return header if self.problem.held else header | {"max_rigid_displacement": self.problem.rigid_reach}

    #: Entries of a proof's header beside those of 2D.
    _kind: dict[str, str] = {}  # noqa: RUF012 (never changed)

    # -- parts of a search -----------------------------------------------------------------------------------------

    @abstractmethod
    def certifier(self, recorder: Recorder | None) -> Certifier:
        """The certifier of this arithmetic, which writes to a recorder."""

    @abstractmethod
    def reader(self) -> Reader:
        """Understands the records of an earlier proof."""

    @abstractmethod
    def remake(self) -> Callable[[], SearchSetup]:
        """Makes the same again, also in another process."""

    def fresh(self) -> SearchSetup:
        """Solvers without anything that searches leave behind and others would depend on: these have nothing of it."""
        return self

    @abstractmethod
    def _splitting(self, certifier: Certifier) -> Splitting:
        """Children and rows of partial assignments."""

    @property
    def _fallback(self) -> Callable[[], Engine] | None:
        """Makes a slower engine for relaxations that stall; None where there is none."""
        return None

    @abstractmethod
    def _closer(self, certifier: Certifier) -> TreeCloser | None:
        """Proposals of an only solution of the problem, or of subtrees."""

    @property
    @abstractmethod
    def _forms(self) -> Forms | None:
        """Forms with which a long search may bound in place of the energy."""

    # -- a root without the tree -----------------------------------------------------------------------------------

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
        """Complete selections that may hold a root, as far as floats tell, the likeliest first.

        Of a body that nothing holds, that of a family at the limit, then those on springs, the weakest first.
        """
        suggested, near = list[Any](), None
        for stiffness in (0.0,) if self.problem.held else _SPRINGS:
            found = self._solved(self._on_springs(stiffness), near)
            if found is not None:
                codes, near = found
                suggested = codes + [other for other in suggested if other not in codes]
        limit = self.at_limit
        return suggested if limit is None or limit.codes is None else [limit.codes, *suggested]

    def _on_springs(self, stiffness: float) -> Any:
        """The system on springs, by their stiffness relative to that of the body; of a body that is held, its own."""
        del stiffness
        return self.relaxed

    @abstractmethod
    def _solved(self, system: Any, near: Any) -> tuple[list[Codes], Any] | None:
        """Selections, one of which holds at a solution of a system in floats, and that solution, near another one."""
