"""The discrete contact problem in 3D, and its friction: orthotropic, constant or a function of the slip."""

from __future__ import annotations

import warnings
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import scipy.sparse as sp

from enumsol.errors import FrictionJumpWarning, InvalidArgumentError, InvalidProblemError
from enumsol.model.contact_body import ContactBody, check_signs, friction_values, span, vector
from enumsol.support.arguments import alpha_value, exact_number, instance_of, shown
from enumsol.support.array_arguments import plain_array, real_array, real_matrix, vector_of
from enumsol.support.immutable import Immutable, Sealed, SealedMatrix, sealed

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from enumsol.model.mesh import BodyMesh
    from enumsol.model.problem import ContactProblem
    from enumsol.support.array_types import AlphaLike, ArrayLike, Floats


_EXPECTED = "expected a number, a pair (F1, F2) of numbers or (p,) arrays, a FrictionTable, or a callable F(node, slip)"


@dataclass(frozen=True)
class ConstantFriction(Sealed):
    """Coefficients that do not depend on the solution, values of shape (p, 2)."""

    values: Floats
    depends_on_slip = False

    def at(self, slip: Floats) -> Floats:
        """Coefficients at a slip: the same for every slip."""
        return self.values

    def __str__(self) -> str:
        return f"F1 in {span(self.values[:, 0])}, F2 in {span(self.values[:, 1])}"


class FrictionTable(Immutable):
    """Coefficients as piecewise linear functions of the slip ``|u_t|``, constant beyond the last one.

    Parameters
    ----------
    slip : (k,) array_like
        Slips, increasing, the first one 0 [length].
    F1 : (k,) or (p, k) array_like
        Coefficient in the first axis at these slips, for all nodes or for each [-].
    F2 : (k,) or (p, k) array_like or None
        Likewise in the second axis; None: as F1 (isotropic).

    Raises
    ------
    InvalidProblemError
        The slips do not increase from 0, or a coefficient is negative or of the wrong shape.

    Examples
    --------
    >>> import enumsol
    >>> enumsol.FrictionTable(slip=[0, 0.1, 1], F1=[0.6, 0.4, 0.3])
    FrictionTable of 3 slips up to 1: F1 in [0.3, 0.6], F2 in [0.3, 0.6], by a table of |u_t|
    """

    depends_on_slip = True

    def __init__(self, slip: ArrayLike, F1: ArrayLike, F2: ArrayLike | None = None) -> None:
        knots = real_array(slip, "slip of the friction table")
        if knots.ndim != 1 or len(knots) < 2 or knots[0] != 0 or np.any(np.diff(knots) <= 0):
            raise InvalidProblemError(
                f"slip of the friction table is {shown(slip)}; expected at least two slips that increase from 0"
            )
        self.slip = sealed(knots)
        self.F1 = _column(F1, "F1", len(knots))
        self.F2 = self.F1 if F2 is None else _column(F2, "F2", len(knots))
        self._freeze()

    def at(self, slip: Floats) -> Floats:
        """Coefficients F1, F2 at slips (p,) [length], shape (p, 2) [-]."""
        return np.stack([self._interpolated(values, slip) for values in (self.F1, self.F2)], axis=1)

    def _interpolated(self, values: Floats, slip: Floats) -> Floats:
        if values.ndim == 1:
            return np.interp(slip, self.slip, values)
        return np.array([np.interp(s, self.slip, row) for s, row in zip(slip, values, strict=True)])

    def check_nodes(self, p: int) -> None:
        """Raise InvalidProblemError unless the table fits p contact nodes."""
        for name, values in (("F1", self.F1), ("F2", self.F2)):
            if values.ndim == 2 and len(values) != p:
                raise InvalidProblemError(
                    f"{name} of the friction table has shape {values.shape}; expected ({len(self.slip)},) or "
                    f"(p, {len(self.slip)}) = ({p}, {len(self.slip)})"
                )

    def __repr__(self) -> str:
        return f"FrictionTable of {len(self.slip)} slips up to {self.slip[-1]:g}: {self}"

    def __str__(self) -> str:
        return f"F1 in {span(self.F1)}, F2 in {span(self.F2)}, by a table of |u_t|"


@dataclass(frozen=True)
class FrictionFunction:
    """Coefficients given by a callable ``F(node, slip)``.

    Attributes
    ----------
    function : callable
        Of the row number of a contact node and its slip ``|u_t|`` [length]; returns one coefficient, or F1 and F2 [-].
    labels : tuple
        Names of the contact nodes, for messages.
    """

    function: Callable[[int, float], Any]
    labels: tuple[Any, ...]
    depends_on_slip = True

    def at(self, slip: Floats) -> Floats:
        """Coefficients F1, F2 at slips (p,) [length], shape (p, 2) [-].

        Raises
        ------
        InvalidProblemError
            The callable returns something else than one or two finite numbers >= 0.
        """
        return np.array([self._pair(node, value) for node, value in enumerate(slip.tolist())])

    def _pair(self, node: int, slip: float) -> tuple[float, float]:
        found = self.function(node, slip)
        values = np.full(2, np.nan)
        with np.errstate(over="ignore"), suppress(InvalidProblemError, TypeError, ValueError, OverflowError):
            numbers = plain_array(found, "friction", error=InvalidProblemError)
            if numbers.dtype.kind in "fiuO":
                values = np.broadcast_to(numbers.astype(np.float64), (2,))
        if not np.all(np.isfinite(values) & (values >= 0)):
            raise InvalidProblemError(
                f"friction returns {shown(found)} at contact node {self.labels[node]} for slip {slip:g}; "
                "expected one coefficient or a pair (F1, F2), finite and >= 0"
            )
        return float(values[0]), float(values[1])

    def __str__(self) -> str:
        return f"{getattr(self.function, '__name__', type(self.function).__name__)}(node, |u_t|)"


#: Each has coefficients at given slips.
FrictionLaw = ConstantFriction | FrictionTable | FrictionFunction


def friction_law(value: object, p: int, labels: tuple[Any, ...]) -> FrictionLaw:
    """The coefficients of p contact nodes from a number, pair, FrictionTable or callable.

    Raises
    ------
    InvalidProblemError
        It is none of these, or has the wrong shape.
    """
    if isinstance(value, FrictionTable):
        value.check_nodes(p)
        return value
    if callable(value):
        return FrictionFunction(value, labels)
    return ConstantFriction(friction_pair(value, "friction", p))


def friction_pair(value: object, name: str, p: int) -> Floats:
    """A number, or a pair of numbers or arrays, as an array of shape (p, 2).

    Raises
    ------
    InvalidProblemError
        It is neither.
    """
    if exact_number(value) is not None:
        value = (value, value)
    if not isinstance(value, (tuple, list)) or len(value) != 2:
        found = f"a {type(value).__name__} of length {len(value)}" if isinstance(value, (tuple, list)) else shown(value)
        expected = _EXPECTED if name == "friction" else "expected a number, or a pair of numbers or (p,) arrays"
        raise InvalidProblemError(f"{name} is {found}; {expected}")
    return np.stack([vector(value[k], f"{name} F{k + 1}", p, broadcast=True) for k in range(2)], axis=1)


def warn_of_jumps(law: FrictionLaw, reach: Floats, labels: tuple[Any, ...]) -> None:
    """Warn where a coefficient seems to jump as a function of the slip, for slips up to ``reach`` of shape (p,).

    The largest step between neighbouring samples of every node is bisected: a step that does not get smaller with the
    distance is a jump. A function that jumps need not have a fixed point (paper, Section 3).
    """
    shares = np.linspace(0.0, 1.0, 33)
    values = np.array([law.at(share * reach) for share in shares])
    step = np.max(np.abs(np.diff(values, axis=0)), axis=2)
    where = np.argmax(step, axis=0)
    low, high = shares[where] * reach, shares[where + 1] * reach
    at_low, at_high = law.at(low), law.at(high)
    for _ in range(40):
        middle = 0.5 * (low + high)
        at_middle = law.at(middle)
        first = _size(at_middle - at_low) >= _size(at_high - at_middle)
        low, high = np.where(first, low, middle), np.where(first, middle, high)
        at_low, at_high = np.where(first[:, None], at_low, at_middle), np.where(first[:, None], at_middle, at_high)
    largest, scale = np.max(step, axis=0), np.max(np.abs(values), axis=(0, 2))
    # the share of the step that must be left for it to count as a jump
    jumps = (_size(at_high - at_low) > 0.5 * largest) & (largest > 1e-6 * scale)
    if np.any(jumps):
        node = int(np.argmax(jumps))
        warnings.warn(
            f"friction jumps by {_size(at_high - at_low)[node]:.3g} near slip {high[node]:.6g} at contact node "
            f"{labels[node]}; expected a Lipschitz function of the slip, without which there may be no fixed point",
            FrictionJumpWarning,
            stacklevel=9,  # the caller of successive_approximations
        )


def _size(change: Floats) -> Floats:
    return np.asarray(np.max(np.abs(change), axis=1))


def _column(value: ArrayLike, name: str, count: int) -> Floats:
    array = real_array(value, f"{name} of the friction table")
    if array.ndim not in (1, 2) or array.shape[-1] != count:
        raise InvalidProblemError(
            f"{name} of the friction table has shape {array.shape}; expected ({count},) or (p, {count})"
        )
    if np.min(array) < 0:
        raise InvalidProblemError(f"{name} of the friction table has the value {np.min(array):g}; expected F >= 0")
    return sealed(array)


class SlipMean(Immutable):
    """The slip that coefficients depend on, as weighted means of ``|u_t|``: the return operator r_h (paper, Section 3).

    The slips are ``weights @ |(T1 u, T2 u) - offset|``.

    Parameters
    ----------
    T1, T2 : (q, n) array_like or sparse
        Tangential displacements at q places of the contact surface.
    offset : (q, 2) array_like
        Tangential positions from which slip is counted there [length].
    weights : (p, q) array_like or sparse
        Of nonnegative rows that add up to one.

    Raises
    ------
    InvalidProblemError
        An argument is not of that form.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.block3d(4, 4, 1, multipliers="elements", ratio=2)
    >>> problem.slip_mean.weights.sum(axis=1)
    array([1., 1., 1., 1.])
    """

    def __init__(
        self,
        T1: ArrayLike | sp.sparray | sp.spmatrix,
        T2: ArrayLike | sp.sparray | sp.spmatrix,
        offset: ArrayLike,
        weights: ArrayLike | sp.sparray | sp.spmatrix,
    ) -> None:
        given = {"T1": T1, "T2": T2, "weights": weights}
        matrices = {name: sp.csr_array(real_matrix(value, f"slip_mean_{name}")) for name, value in given.items()}
        self.offset = sealed(real_array(offset, "slip_mean_offset"))
        self._parts = {name: SealedMatrix.of(matrix) for name, matrix in matrices.items()}
        self.check(matrices["T1"].shape[1], matrices["weights"].shape[0])
        if np.any(matrices["weights"].data < 0):
            raise InvalidProblemError("slip_mean has a negative weight; expected weights >= 0")
        sums = np.asarray(matrices["weights"].sum(axis=1)).ravel()
        # how far from 1 weights of a mean may add up to
        if np.any(np.abs(sums - 1.0) > 1e-9):
            row = int(np.argmax(np.abs(sums - 1.0)))
            raise InvalidProblemError(f"slip_mean has weights that add up to {sums[row]:g} in row {row}; expected 1")
        self._freeze()

    @property
    def T1(self) -> sp.csr_array:  # noqa: N802 (the field's letter)
        """Displacements along the first tangent, sparse (q, n); a new object, whose parts are read-only."""
        return self._parts["T1"].matrix()

    @property
    def T2(self) -> sp.csr_array:  # noqa: N802 (as above)
        """Displacements along the second tangent, sparse (q, n); a new object as T1 is."""
        return self._parts["T2"].matrix()

    @property
    def weights(self) -> sp.csr_array:
        """Weights, sparse (p, q); a new object as T1 is."""
        return self._parts["weights"].matrix()

    def __call__(self, u: ArrayLike) -> Floats:
        """Slip of the p contact rows, shape (p,), for u of shape (n,) [length].

        Raises
        ------
        InvalidArgumentError
            u is not that.
        """
        v = vector_of(u, "u", self._parts["T1"].shape[1])
        return np.asarray(self.weights @ np.hypot(self.T1 @ v - self.offset[:, 0], self.T2 @ v - self.offset[:, 1]))

    def check(self, n: int, p: int) -> SlipMean:
        """The mean, which has to be one of a problem with n degrees of freedom and p contact rows."""
        q = self._parts["T1"].shape[0]
        found = (*(self._parts[name].shape for name in ("T1", "T2")), self.offset.shape, self._parts["weights"].shape)
        if found != (expected := ((q, n), (q, n), (q, 2), (p, q))):
            raise InvalidProblemError(f"slip_mean has T1, T2, offset, weights of shapes {found}; expected {expected}")
        return self

    def __repr__(self) -> str:
        (p, q), n = self._parts["weights"].shape, self._parts["T1"].shape[1]
        return f"SlipMean of |u_t| at {q} places for {p} contact rows and {n} degrees of freedom"


class ContactProblem3D(ContactBody):
    """A linear elastic body in 3D on a rigid foundation with orthotropic Coulomb friction (theory, section 11.1).

    Find u, lambda_n (p,) and lambda_t (p, 2) with::

        A u + Bn' lambda_n + Bt1' lambda_t1 + Bt2' lambda_t2 = f(alpha)
        lambda_n >= 0,  u_n = Bn u - gap <= 0,  lambda_n u_n = 0
        lambda_t = F tau,  |tau| <= lambda_n,  F = diag(F1, F2) at every node
        u_t = (Bt1 u, Bt2 u) - slip_offset;  F u_t = 0  or  tau = lambda_n F u_t / |F u_t|

    with F_k(alpha) = F_k + alpha friction_slope_k and f(alpha) = f + alpha load_slope. The axes (t1, t2) of Bt1, Bt2
    are those of the orthotropy; with the normal they are orthonormal, and may vary from node to node. The object is
    immutable, as `ContactProblem` is, and data are taken exactly as given.

    Parameters
    ----------
    A : (n, n) array_like or sparse
        Stiffness, symmetric positive definite [force / length]. An asymmetry within 1e-12 max|A| is averaged away.
    Bn, Bt1, Bt2 : (p, n) array_like or sparse
        Normal displacement of the p contact nodes and the displacements along t1 and t2 as rows; together of full rank.
    f : (n,) array_like
        Load at alpha = 0 [force].
    gap : float or (p,) array_like
        Initial normal gap [length]; negative is a press fit.
    friction : float, pair, FrictionTable or callable
        Coefficients [-]: one number; a pair (F1, F2), each a number or a (p,) array; or, for successive approximations
        only, Lipschitz functions of the slip ``|u_t|``: a `FrictionTable`, or a callable F(node, slip) of the row
        number and the slip that returns one coefficient or two.
    friction_slope : float or pair
        Derivatives of F1 and F2 with respect to alpha [1 / unit of alpha].
    load_slope : (n,) array_like or None
        Derivative of the load with respect to alpha [force / unit of alpha].
    slip_offset : 0 or (p, 2) array_like
        Tangential positions from which slip is counted [length].
    node_ids : sequence of length p or None
        Labels of the contact nodes for frames and messages; default 0 .. p-1.
    coordinates : (p, 3) array_like or None
        Positions of the contact nodes, for plots and files [length].
    areas : (p,) array_like or None
        Area of the contact surface that each contact row stands for, for pressures and norms [length^2].
    mesh : BodyMesh or None
        The mesh the problem was made of.
    slip_mean : SlipMean or None
        The slip that friction depends on, where it is not ``|u_t|`` of the node itself.
    rigid_modes, max_rigid_displacement
        Of a body that nothing holds, as in `ContactProblem`.

    mass : (n, n) array_like or sparse, or None
        Mass, symmetric and positive semidefinite [force time^2 / length]; it says which equilibria run away
        (`stability`) and changes nothing else. Without it that of ``mesh`` with a uniform density.

    Raises
    ------
    InvalidProblemError
        The data cannot be used; the message names the argument, what was found and what was expected.

    Examples
    --------
    >>> import enumsol
    >>> import numpy as np
    >>> rows = np.eye(3)
    >>> enumsol.ContactProblem3D(np.diag([2, 1, 1]), rows[:1], rows[1:2], rows[2:], [1, 3, 4], friction=(0.5, 0.3))
    ContactProblem3D with 1 contact node
      degrees of freedom  3  (A: 3 nonzeros)
      friction            F1 in 0.5, F2 in 0.3
      load                constant,  max |f| = 4
      gap                 0
    """

    taken_by: ClassVar[str] = (
        " (problems in 3D are taken by enumerate_roots, multiplicity_table, link_samples, branch_graph, newton, "
        "follow, follow_all, audit, local_branch_test, successive_approximations and solve_tresca so far)"
    )

    def __init__(
        self,
        A: ArrayLike | sp.sparray | sp.spmatrix,
        Bn: ArrayLike | sp.sparray | sp.spmatrix,
        Bt1: ArrayLike | sp.sparray | sp.spmatrix,
        Bt2: ArrayLike | sp.sparray | sp.spmatrix,
        f: ArrayLike,
        gap: ArrayLike = 0.0,
        friction: Friction = 0.5,
        friction_slope: float | tuple[ArrayLike, ArrayLike] = 0.0,
        load_slope: ArrayLike | None = None,
        slip_offset: ArrayLike = 0.0,
        node_ids: Iterable[object] | None = None,
        coordinates: ArrayLike | None = None,
        areas: ArrayLike | None = None,
        mesh: BodyMesh | None = None,
        slip_mean: SlipMean | None = None,
        rigid_modes: ArrayLike | None = None,
        max_rigid_displacement: float | None = None,
        mass: ArrayLike | sp.sparray | sp.spmatrix | None = None,
    ) -> None:
        super().__init__(A, {"Bn": Bn, "Bt1": Bt1, "Bt2": Bt2}, f, gap, load_slope, node_ids, coordinates)
        p = self.p
        self.law = friction_law(friction, p, self.node_ids)
        self._slope = sealed(friction_pair(friction_slope, "friction_slope", p))
        self.slip_offset = _slip_offset(slip_offset, p)
        self.areas = None if areas is None else _areas(areas, p)
        self.slip_mean = None if slip_mean is None else instance_of(slip_mean, SlipMean, "slip_mean").check(self.n, p)
        if isinstance(self.law, ConstantFriction) and not np.any(self._slope):
            check_signs(self.law.values, self.node_ids)
        self._complete(mesh, rigid_modes, max_rigid_displacement, mass)

    @property
    def Bt1(self) -> sp.csr_array:  # noqa: N802 (the field's letter)
        """Displacement of the contact nodes along t1, sparse (p, n); a new object as A is."""
        return self._rows["Bt1"].matrix()

    @property
    def Bt2(self) -> sp.csr_array:  # noqa: N802 (as above)
        """Displacement of the contact nodes along t2, sparse (p, n); a new object as A is."""
        return self._rows["Bt2"].matrix()

    @property
    def friction(self) -> Any:
        """Coefficients at alpha = 0: a pair (F1, F2) of (p,) arrays, or the table or callable that was given."""
        if isinstance(self.law, ConstantFriction):
            return tuple(sealed(column) for column in self.law.values.T)
        return getattr(self.law, "function", self.law)

    @property
    def friction_slope(self) -> tuple[Floats, Floats]:
        """Derivatives of F1 and F2 with respect to alpha, two (p,) arrays."""
        return sealed(self._slope[:, 0]), sealed(self._slope[:, 1])

    @property
    def affine_friction(self) -> tuple[Floats, Floats]:
        """Coefficients at alpha = 0 and their derivatives, (p, 2) both.

        Raises
        ------
        InvalidArgumentError
            They depend on the solution.
        """
        if not isinstance(self.law, ConstantFriction):
            raise self._no_constants()
        return self.law.values, self._slope

    @property
    def depends_on_solution(self) -> bool:
        """True if the coefficients are functions of the slip: then only successive approximations are offered."""
        return self.law.depends_on_slip

    def coefficients(self, alpha: AlphaLike, slip: ArrayLike) -> Floats:
        """Coefficients F1, F2 at alpha for slips of shape (p,) [length], shape (p, 2).

        Raises
        ------
        InvalidArgumentError
            alpha is not finite, slip has another shape, or a coefficient is negative there (the node and its value
            are named).
        InvalidProblemError
            A callable returns something else than finite numbers >= 0.
        """
        exact = Fraction(alpha_value(alpha))
        slip = real_array(slip, "slip", error=InvalidArgumentError)
        if slip.shape != (self.p,):
            raise InvalidArgumentError(f"slip has shape {slip.shape}; expected (p,) = ({self.p},)")
        F = friction_values(exact, self.law.at(slip), self._slope)
        check_signs(F, self.node_ids, f" at alpha = {float(exact):g}", error=InvalidArgumentError)
        return F

    def _no_constants(self) -> InvalidArgumentError:
        return InvalidArgumentError(
            f"friction is {self.law}, which depends on the solution; expected constant coefficients here "
            "(successive_approximations takes both)"
        )

    @staticmethod
    def constant_friction(values: Floats) -> dict[str, Any]:
        """The attributes of a problem with coefficients that do not depend on alpha, for ``model.restart``."""
        return {"law": ConstantFriction(values), "_slope": sealed(np.zeros_like(values))}

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of all data, as 64 hexadecimal digits; proofs are bound to it.

        Raises
        ------
        InvalidArgumentError
            The coefficients depend on the solution.
        """
        if self.depends_on_solution:
            raise self._no_constants()
        return self._digest(b"enumsol problem in 3D, 1", (*self.friction, *self.friction_slope))

    def __repr__(self) -> str:
        slope = "" if not np.any(self._slope) else f" + alpha [{span(self._slope[:, 0])}, {span(self._slope[:, 1])}]"
        return self._text(f"{self.law}{slope}")


def _slip_offset(value: ArrayLike, p: int) -> Floats:
    array = real_array(value, "slip_offset")
    if array.ndim == 0 and array == 0:
        array = np.zeros((p, 2))
    if array.shape != (p, 2):
        raise InvalidProblemError(f"slip_offset has shape {array.shape}; expected (p, 2) = ({p}, 2), or 0")
    return sealed(array + 0.0)


def _areas(value: ArrayLike, p: int) -> Floats:
    array = vector(value, "areas", p)
    if np.min(array) <= 0:
        raise InvalidProblemError(f"areas has the value {np.min(array):g}; expected areas > 0")
    return array


if TYPE_CHECKING:
    #: A problem in 2D or in 3D.
    AnyProblem = ContactProblem | ContactProblem3D
    #: Coefficients of a problem in 3D.
    Friction = float | tuple[ArrayLike, ArrayLike] | FrictionTable | Callable[[int, float], float | tuple[float, float]]
