"""Data of a contact problem that condensing needs; ``enumsol.model.problem.ContactProblem`` is one.

Friction and load at an alpha are computed here without rounding: whether one is zero, or negative, is decided with
these values.
"""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any, Literal, Protocol

if TYPE_CHECKING:
    import scipy.sparse as sp

    from enumsol.condensation.factorization import Factorization
    from enumsol.support.array_types import AlphaLike, Floats


#: What a proof is about: A, Bn, Bt, f as given, or S and g as computed from them in floats.
Data = Literal["problem", "condensed"]
#: Most degrees of freedom of a problem of which A, Bn, Bt and f are condensed in rationals; proofs about larger ones
#: hold no rational leaves.
EXACT_DOF_LIMIT = 250


class ProblemData(Protocol):
    """A contact problem in 2D or 3D as condensing sees it.

    Attributes
    ----------
    f : (n,) array, load at alpha = 0 [force]
    load_slope : (n,) array or None
    gap : (p,) array, slip_offset : (p,) or (p, 2) array [length]
    offset_radius : array of the shape of slip_offset, or None
        How far the slip offset may be from ``slip_offset``; None: not at all.
    exact_offset : tuple of Fraction, or None
        The slip offset where no floats hold it.
    node_ids : tuple of p labels
    """

    f: Floats
    load_slope: Floats | None
    gap: Floats
    slip_offset: Floats
    offset_radius: Floats | None
    exact_offset: tuple[Fraction, ...] | None
    node_ids: tuple[Any, ...]

    @property
    def A(self) -> sp.csc_array:  # noqa: N802 (the field's letter)
        """Stiffness, symmetric positive definite [force / length]."""

    @property
    def contact_rows(self) -> sp.csr_array:
        """Bn and the tangents one above the other."""

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""

    @property
    def p(self) -> int:
        """Number of contact nodes."""

    @property
    def factorization(self) -> Factorization:
        """Factors of A."""

    @property
    def products(self) -> Any:
        """B A^{-1} [B', f, load_slope], as `Products`."""

    @property
    def condensed(self) -> Any:
        """S, g0 and g1 as computed, as `CondensedProblem`."""

    @property
    def enclosure(self) -> Any:
        """S, g0 and g1 in balls, as `CondensedEnclosure`."""

    @property
    def held(self) -> bool:
        """True if supports or springs hold the body."""

    @property
    def modes(self) -> Any:
        """Rigid modes of a body that nothing holds; of others there are none."""

    @property
    def on_springs(self) -> Any:
        """The problem of the body on springs; of a body that is held the problem itself."""

    @property
    def rigid_reach(self) -> float:
        """Bound of the rigid displacement [length]."""

    @property
    def affine_friction(self) -> tuple[Floats, Floats]:
        """Coefficients of friction at alpha = 0, and their derivatives, (p,) or (p, 2)."""

    def load_at(self, alpha: AlphaLike) -> Floats:
        """f(alpha), shape (n,)."""

    def friction_at(self, alpha: AlphaLike) -> Floats:
        """F(alpha), shape (p,) or (p, 2)."""


def exactly_at(alpha: Fraction, first: Floats, slope: Floats) -> list[Fraction]:
    """The values first + alpha slope of floats, exactly: F(alpha) for the parts of ``problem.affine_friction``."""
    return [Fraction(x) + alpha * Fraction(y) for x, y in zip(first.tolist(), slope.tolist(), strict=True)]
