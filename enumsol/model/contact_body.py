"""Common part of contact problems in 2D and 3D: stiffness, contact rows, gap, load path, labels, validation."""

from __future__ import annotations

import hashlib
import inspect
from contextlib import suppress
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import scipy.sparse as sp

from enumsol.condensation.data import exactly_at
from enumsol.errors import EnumsolError, InvalidArgumentError, InvalidProblemError, NotHeldError
from enumsol.model.mesh import ASYMMETRY_TOLERANCE, BodyMesh, checked_mass
from enumsol.model.rigid_modes import RigidModes, largest_displacement
from enumsol.support.arguments import alpha_value, instance_of, shown
from enumsol.support.array_arguments import array_of, real_array, real_matrix
from enumsol.support.immutable import Immutable, SealedMatrix, sealed
from enumsol.support.messages import counted

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from enumsol.condensation.condensed import CondensedProblem
    from enumsol.condensation.enclosure import CondensedEnclosure, Products
    from enumsol.condensation.factorization import Factorization
    from enumsol.support.array_types import AlphaLike, ArrayLike, Floats, Indices

#: Singular values of the row-normalised contact rows below this fraction of the largest mean dependent rows.
ROW_RANK_TOLERANCE = 1e-12


class ContactBody(Immutable):
    """A linear elastic body with p contact nodes: A, Bn and one or two tangents, f(alpha), gap and slip offset.

    ``problem.replace(f=...)`` makes a problem of the same data but for those named: every argument of a subclass is the
    name of an attribute that it takes back.

    Parameters
    ----------
    A : (n, n) array_like or sparse
    rows : mapping of names to (p, n) array_like or sparse
        Contact rows, Bn first; together of full rank.
    f, load_slope : (n,) array_like; the second may be None
    gap : float or (p,) array_like
    node_ids : sequence of length p or None
    coordinates : (p, dimension) array_like or None
    """

    _instead = "build a new problem, or one with other data by problem.replace"
    friction: Any
    friction_slope: Any
    slip_offset: Floats
    #: How far the slip offset may be from ``slip_offset``, and its value where no floats hold it: a step of a history
    #: starts where the step before it ended (see enumsol.model.problem).
    offset_radius: Floats | None = None
    exact_offset: tuple[Fraction, ...] | None = None
    #: The problem that this one was made from with the same matrices, which computes what rests on them for both.
    _origin: ContactBody | None = None
    #: The rigid modes of a body that nothing holds; of others there are none of them.
    modes: RigidModes
    rigid_modes: Floats | None = None
    max_rigid_displacement: float | None = None
    mesh: BodyMesh | None = None
    #: What of a scene (``fem.mesh_problem``) may not have been intended; copies with other data have none.
    notes: tuple[str, ...] = ()

    def __init__(
        self,
        A: ArrayLike | sp.sparray | sp.spmatrix,
        rows: Mapping[str, ArrayLike | sp.sparray | sp.spmatrix],
        f: ArrayLike,
        gap: ArrayLike,
        load_slope: ArrayLike | None,
        node_ids: Iterable[object] | None,
        coordinates: ArrayLike | None,
    ) -> None:
        stiffness = real_matrix(A, "A")
        n = stiffness.shape[0]
        if stiffness.shape != (n, n) or n == 0:
            raise InvalidProblemError(f"A has shape {stiffness.shape}; expected a square matrix (n, n) with n >= 1")
        contact = {name: real_matrix(value, name) for name, value in rows.items()}
        p = contact["Bn"].shape[0]
        if p == 0:
            raise InvalidProblemError("Bn has no rows (p = 0 contact nodes); expected at least one contact node")
        for name, matrix in contact.items():
            if matrix.shape != (p, n):
                raise InvalidProblemError(f"{name} has shape {matrix.shape}; expected (p, n) = ({p}, {n})")
        self._A = SealedMatrix.of(_symmetric(stiffness))
        self._rows = {name: SealedMatrix.of(sp.csr_array(matrix)) for name, matrix in contact.items()}
        _check_row_rank({name: matrix.matrix() for name, matrix in self._rows.items()})
        self.f = vector(f, "f", n)
        self.gap = vector(gap, "gap", p, broadcast=True)
        self.load_slope = None if load_slope is None else vector(load_slope, "load_slope", n)
        self.node_ids = _node_ids(node_ids, p)
        self.coordinates = None if coordinates is None else sealed(_places(coordinates, p, len(rows)))

    @property
    def A(self) -> sp.csc_array:  # noqa: N802 (the field's letter)
        """Stiffness, sparse (n, n); a new object at every access, whose parts are read-only."""
        return self._A.matrix()

    @property
    def Bn(self) -> sp.csr_array:  # noqa: N802 (as above)
        """Normal displacement of the contact nodes, sparse (p, n); a new object as A is."""
        return self._rows["Bn"].matrix()

    @property
    def contact_rows(self) -> sp.csr_array:
        """Bn and the tangents one above the other, sparse (2p, n) or (3p, n); a new object as A is."""
        return sp.csr_array(sp.vstack([matrix.matrix() for matrix in self._rows.values()], format="csr"))

    @property
    def mass(self) -> sp.csc_array | None:
        """Mass that was given, sparse (n, n), or None; a new object as A is [force time^2 / length]."""
        return None if self._mass is None else self._mass.matrix()

    @property
    def inertia(self) -> sp.csc_array:
        """The mass that was given, or that of the mesh with a density of one, which changes no verdict (n, n).

        Raises
        ------
        InvalidArgumentError
            Neither a mass nor a mesh is known.
        """
        if self._mass is not None:
            return self._mass.matrix()
        if self.mesh is None:
            raise InvalidArgumentError(
                "the problem has no mass and no mesh; expected mass, an (n, n) matrix, of the problem or of this call"
            )
        M = self.mesh.mass()
        # what is held but stays in the problem, uncoupled and at rest, has no part in any motion
        alone = np.diff(self.A.indptr) == 1
        if np.all(alone) or not np.any(alone):
            return M
        coupled = sp.diags_array(np.where(alone, 0.0, 1.0))
        return sp.csc_array(coupled @ M @ coupled + sp.diags_array(np.where(alone, M.diagonal(), 0.0)))

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return self._A.shape[0]

    @property
    def p(self) -> int:
        """Number of contact nodes."""
        return self._rows["Bn"].shape[0]

    def _complete(
        self,
        mesh: BodyMesh | None,
        rigid_modes: ArrayLike | None,
        max_rigid_displacement: float | None,
        mass: ArrayLike | sp.sparray | sp.spmatrix | None,
    ) -> None:
        """Take the mesh, the mass and the arguments about a body that nothing holds; nothing changes from here on."""
        if mesh is not None:
            self.mesh = instance_of(mesh, BodyMesh, "mesh").check(self.n, self.p, len(self._rows))
        self.modes = RigidModes.of(rigid_modes, self.A)
        self.rigid_modes = None if self.held else self.modes.N
        self.max_rigid_displacement = largest_displacement(max_rigid_displacement, self.modes)
        self._mass = None if mass is None else SealedMatrix.of(checked_mass(mass, self.A, self.modes.N))
        self._freeze()
        self.on_springs.factorization.check_positive_definite()

    @property
    def held(self) -> bool:
        """True if supports or springs hold the body: it has no rigid modes."""
        return self.modes.r == 0

    @cached_property
    def on_springs(self) -> Self:
        """The body held by springs at some degrees of freedom, if nothing holds it (theory, section 14.1); or itself.

        Raises
        ------
        InvalidProblemError
            Springs there do not hold it: A is singular not only on the rigid modes.
        """
        if self.held:
            return self
        # pictures of it are of no use, nor are bounds of a rigid displacement
        without = {"A", "mass", *self._rows, "coordinates", "areas", "mesh", "rigid_modes", "max_rigid_displacement"}
        data = {name: value for name, value in self.arguments.items() if name not in without}
        known = {"offset_radius": self.offset_radius, "exact_offset": self.exact_offset}
        if self._origin is not None:
            held: Any = self._origin.on_springs
            return held._made(held.arguments | data, _origin=held._origin or held, **known)  # type: ignore[no-any-return]
        rows = {name: matrix.matrix() for name, matrix in self._rows.items()}
        try:
            return self._made({"A": sp.csc_array(self.A + self.modes.springs()), **rows, **data}, **known)
        except InvalidProblemError as error:
            raise InvalidProblemError(
                f"A is singular or indefinite on more than the {self.modes.r} rigid_modes, for springs that hold "
                f"these leave it so ({error})"
            ) from None

    @cached_property
    def rigid_reach(self) -> float:
        """Bound of the rigid displacement, ``max_rigid_displacement`` or its default; 0 of a held body [length]."""
        if self.held:
            return 0.0
        if self.max_rigid_displacement is not None:
            return self.max_rigid_displacement
        for points in (None if self.mesh is None else self.mesh.points, self.coordinates):
            if points is not None and np.any(np.ptp(points, axis=0)):
                return float(10.0 * np.max(np.ptp(points, axis=0)))
        condensed = self.on_springs.condensed
        largest = float(np.max(np.abs(condensed.g0)) + np.max(np.abs(condensed.g1)))
        # a power of two: the same wherever the problem is read, although what is computed may differ in its last bits
        return float(np.exp2(np.ceil(np.log2(1000.0 * largest)))) if largest > 0 else 1.0

    @cached_property
    def condensed(self) -> CondensedProblem:
        """The problem condensed to its 2p or 3p contact forces (theory, section 4.1)."""
        self.check_held("condensation")
        from enumsol.condensation.condensed import CondensedProblem  # scipy's solvers come with the first use

        return CondensedProblem.from_problem(self)

    def check_held(self, what: str, why: str = "", instead: str = "") -> None:
        """Refuse a body that neither supports nor springs hold; the arguments are words of the message.

        ``what`` was asked of it, ``why`` that needs supports, and ``instead`` is what else will do.

        Raises
        ------
        NotHeldError
            Nothing holds the body: A is singular, and what needs its inverse is not there.
        """
        if not self.held:
            raise NotHeldError(
                f"{what} cannot take a body that nothing holds (rigid_modes is given){why and f', {why}'}; "
                f"expected a body held by supports or springs{instead}"
            )

    @cached_property
    def factorization(self) -> Factorization:
        """Sparse factorization of A, shared by everything that solves with it."""
        self.check_held("a factorization of A")
        if self._origin is not None:
            return self._origin.factorization
        from enumsol.condensation.factorization import Factorization  # scipy's solvers come with the first use

        return Factorization(self.A)

    @cached_property
    def products(self) -> Products:
        """Products that condensation and enclosure have in common."""
        self.check_held("condensation")
        if (origin := self._origin) is not None:
            mine, theirs = ((body.f, body.load_slope) for body in (self, origin))
            return origin.products if all(map(_equal, mine, theirs)) else origin.products.with_loads_of(self)
        from enumsol.condensation.enclosure import Products  # as above

        return Products.of(self)

    @cached_property
    def enclosure(self) -> CondensedEnclosure:
        """Rigorous enclosure of the condensed problem.

        Raises
        ------
        NotEnclosedError
            A is positive definite only within rounding.
        """
        self.check_held("an enclosure of S")
        from enumsol.condensation.enclosure import CondensedEnclosure, NotEnclosedError  # as above

        if self._origin is not None:
            with suppress(NotEnclosedError):  # because of the other load, perhaps
                return self._origin.enclosure.restarted(self, self.products)
        return CondensedEnclosure.from_problem(self, self.products)

    def is_unloaded(self, alpha: AlphaLike) -> bool:
        """True if load, gap and slip offset are exactly zero at alpha: then only lambda = 0, w = 0 solves."""
        a = Fraction(alpha_value(alpha))
        if np.any(self.gap) or np.any(self.slip_offset) or self.offset_radius is not None:
            return False
        if self.load_slope is None:
            return not np.any(self.f)
        return not any(exactly_at(a, self.f, self.load_slope))

    @property
    def known_exactly(self) -> bool:
        """True if rationals hold all data: a slip offset may be known as a ball only."""
        return self.offset_radius is None or self.exact_offset is not None

    @property
    def arguments(self) -> dict[str, Any]:
        """The data by the names of the arguments: ``type(problem)(**problem.arguments)`` builds the same anew."""
        return {name: getattr(self, name) for name in inspect.signature(type(self)).parameters}

    def replace(self, **changes: Any) -> Self:
        """Copy of the problem with other data; what depends on A, Bn and Bt alone is not computed again.

        Parameters
        ----------
        **changes
            Arguments of the class by their names, such as ``f``, ``friction``, ``gap`` or ``slip_offset``. A problem
            with another A shares nothing, and one with other rows Bn or Bt only the factorization of A. What is not
            named is kept, such as ``load_slope``. Where ``friction_slope`` is not 0, it has to be given with
            ``friction``: 0 for a coefficient that does not depend on alpha.

        Raises
        ------
        InvalidProblemError
            The new data cannot be used.
        TypeError
            There is no argument of that name.

        Examples
        --------
        >>> import enumsol
        >>> problem = enumsol.gallery.one_node_triangle()
        >>> for factor in (1, 2, 3):  # factorized once
        ...     root = enumsol.enumerate_roots(problem.replace(f=-factor * problem.f), alpha=0)[0]
        ...     print(root.lambda_n.round(6))
        [0.5]
        [1.]
        [1.5]
        """
        if "friction" in changes and "friction_slope" not in changes and np.any(self.friction_slope):
            raise InvalidProblemError(
                "friction is given without friction_slope, which is not 0 in this problem; expected both, "
                "friction_slope=0 for a coefficient that does not depend on alpha"
            )
        matrices = {"A": self._A, **self._rows}
        kept = [
            name for name, own in matrices.items() if name not in changes or own.holds(real_matrix(changes[name], name))
        ]
        known: dict[str, Any] = {}
        if len(kept) == len(matrices) and "rigid_modes" not in changes:
            known["_origin"] = self._origin or self
        elif "A" in kept and self.held:
            known["factorization"] = self.factorization
        if "slip_offset" not in changes:
            known |= {"offset_radius": self.offset_radius, "exact_offset": self.exact_offset}
        return self._made(self.arguments | changes, **known)

    def _made(self, arguments: Mapping[str, Any], **known: Any) -> Self:
        """A problem of the same class, with attributes that no argument gives."""
        other = object.__new__(type(self))
        for name, value in known.items():
            setattr(other, name, value)
        type(self).__init__(other, **arguments)
        return other

    @property
    def affine_friction(self) -> tuple[Floats, Floats]:
        """Coefficients at alpha = 0 and their derivatives, (p,) both, in 3D (p, 2)."""
        raise NotImplementedError

    @staticmethod
    def constant_friction(values: Floats) -> dict[str, Any]:
        """The attributes of a problem whose coefficients do not depend on alpha, for ``model.restart``."""
        raise NotImplementedError

    def friction_at(self, alpha: AlphaLike) -> Floats:
        """Coefficients F(alpha) = friction + alpha friction_slope, shape (p,), in 3D (p, 2).

        Raises
        ------
        InvalidArgumentError
            alpha is not finite, a coefficient is negative there (the node and its value are named), or the coefficients
            depend on the solution.
        """
        a = Fraction(alpha_value(alpha))
        F = friction_values(a, *self.affine_friction)
        check_signs(F, self.node_ids, f" at alpha = {float(a):g}", error=InvalidArgumentError)
        return F

    @property
    def depends_on_alpha(self) -> bool:
        """True if friction or load change with alpha."""
        return self.load_slope is not None or bool(np.any(self.friction_slope))

    def load_at(self, alpha: AlphaLike) -> Floats:
        """Load f(alpha) = f + alpha load_slope, shape (n,) [force].

        Raises
        ------
        InvalidArgumentError
            alpha is not finite.
        """
        value = float(alpha_value(alpha))
        return self.f.copy() if self.load_slope is None else self.f + value * self.load_slope

    def _digest(self, kind: bytes, friction: Sequence[Floats]) -> str:
        """SHA-256 of all data, as 64 hexadecimal digits."""
        slope = np.zeros(self.n) if self.load_slope is None else self.load_slope
        vectors = [self.f, self.gap, *friction, slope, self.slip_offset.ravel()]
        if self.offset_radius is not None:
            kind, vectors = kind + b", from a ball", [*vectors, self.offset_radius.ravel()]
        if not self.held:
            kind, vectors = kind + b", held by nothing", [*vectors, self.modes.N.ravel(), np.array([self.rigid_reach])]
        matrices = [self.A]
        if self._mass is not None:
            kind, matrices = kind + b", with mass", [self.A, self._mass.matrix()]
        digest = hashlib.sha256(kind)
        parts: list[Any] = [np.array([self.n, self.p])]
        rows = (sp.csc_array(matrix.matrix()).sorted_indices() for matrix in self._rows.values())
        for matrix in (*matrices, *rows):
            parts += [matrix.indptr, matrix.indices, matrix.data]
        for part in (*parts, *vectors):
            numbers = "<f8" if part.dtype.kind == "f" else "<i8"
            digest.update(np.ascontiguousarray(part, dtype=numbers).tobytes())
            digest.update(b"|")
        return digest.hexdigest()

    def _text(self, friction: str) -> str:
        """Text that ``repr`` gives; ``friction`` are the coefficients in words."""
        load = "constant" if self.load_slope is None else "f + alpha load_slope"
        text = (
            f"{type(self).__name__} with {counted(self.p, 'contact node')}\n"
            f"  degrees of freedom  {self.n}  (A: {self.A.nnz} nonzeros)\n"
            f"  friction            {friction}\n"
            f"  load                {load},  max |f| = {np.max(np.abs(self.f)):.4g}\n"
            f"  gap                 {span(self.gap)}"
        )
        if not self.held:
            text += f"\n  rigid modes         {self.modes.r}, of displacements up to {self.rigid_reach:g}"
        return "\n".join([text, *(f"  note                {note}" for note in self.notes)])

    def __getstate__(self) -> dict[str, Any]:
        # the factorization (SuperLU) cannot be pickled; workers that need it compute it again
        return {key: value for key, value in self.__dict__.items() if key not in ("factorization", "_origin")}


def _equal(one: Floats | None, other: Floats | None) -> bool:
    """True if two loads, or two slopes of loads, are equal."""
    return one is other or (one is not None and other is not None and np.array_equal(one, other))


def friction_values(alpha: Fraction, first: Floats, slope: Floats) -> Floats:
    """Coefficients first + alpha slope, rounded once from the exact values: zero and the sign are decided exactly.

    Raises
    ------
    InvalidArgumentError
        One is too large for float64.
    """
    try:
        return np.array([float(x) for x in exactly_at(alpha, first.ravel(), slope.ravel())]).reshape(first.shape)
    except OverflowError:
        raise InvalidArgumentError(
            f"friction at alpha = {float(alpha):g} is too large for float64; expected a finite value"
        ) from None


def check_signs(
    F: Floats, labels: Sequence[Any], where: str = "", error: type[EnumsolError] = InvalidProblemError
) -> None:
    """Refuse negative coefficients of friction, (p,) or (p, 2), ``where`` they are found; the node is named.

    Raises
    ------
    InvalidProblemError or ``error``
        One is negative.
    """
    if np.any(F < 0):
        node, *axis = map(int, np.unravel_index(int(np.argmin(F)), F.shape))
        along = f" F{axis[0] + 1}" if axis else ""
        raise error(f"friction{along}{where} is {np.min(F):g} at contact node {labels[node]}; expected F >= 0")


def span(values: Floats) -> str:
    """The range of some numbers, in words."""
    low, high = float(np.min(values)), float(np.max(values))
    return f"{low:g}" if low == high else f"[{low:g}, {high:g}]"


def vector(value: object, name: str, size: int, *, broadcast: bool = False) -> Floats:
    """Value as a read-only array of the given size; if ``broadcast``, one number stands for all entries.

    Raises
    ------
    InvalidProblemError
        It is not that.
    """
    array = real_array(value, name)
    if array.ndim == 0 and broadcast:
        array = np.full(size, float(array))
    if array.shape != (size,):
        scalar = " or a single number" if broadcast else ""
        raise InvalidProblemError(f"{name} has shape {array.shape}; expected ({size},){scalar}")
    # -0.0 becomes 0.0: not every file format keeps the sign of zero, and equal problems are to have equal fingerprints
    return sealed(array + 0.0)


def _symmetric(A: sp.csc_array) -> sp.csc_array:
    scale = float(np.max(np.abs(A.data))) if A.nnz else 0.0
    difference = sp.csc_array(A - A.T)
    worst = float(np.max(np.abs(difference.data))) if difference.nnz else 0.0
    if worst > ASYMMETRY_TOLERANCE * scale:
        raise InvalidProblemError(
            f"A is not symmetric: max|A - A'| = {worst:.3g} where max|A| = {scale:.3g}; "
            f"expected an asymmetry of at most {ASYMMETRY_TOLERANCE:g} max|A|"
        )
    if worst > 0.0:
        # halve before adding, so that entries near the largest float do not overflow
        A = sp.csc_array(0.5 * A + 0.5 * A.T)
    A.sort_indices()
    return A


def _check_row_rank(contact: Mapping[str, sp.csr_array]) -> None:
    rows = sp.csr_array(sp.vstack(list(contact.values()), format="csr"))
    p = rows.shape[0] // len(contact)
    names = [f"{name} row {row}" for name in contact for row in range(p)]
    stack = f"[{'; '.join(contact)}]"
    norms = np.sqrt(np.asarray(rows.multiply(rows).sum(axis=1)).ravel())
    if np.any(norms == 0):
        row = int(np.argmin(norms))
        raise InvalidProblemError(f"{names[row]} is zero; expected linearly independent rows of {stack}")
    from scipy.sparse.csgraph import connected_components  # with it come scipy's solvers

    unit = sp.csr_array(sp.diags_array(1.0 / norms) @ rows)
    gram = sp.csr_array(unit @ unit.T)
    # rows that share no degree of freedom, directly or through others, are independent of each other
    count, block = connected_components(gram, directed=False)
    order = np.argsort(block, kind="stable")
    for members in np.split(order, np.cumsum(np.bincount(block, minlength=count))[:-1]):
        involved = _dependent_rows(unit[members], gram[members][:, members].toarray())
        if len(involved):
            some = ", ".join(names[row] for row in members[involved][:6])
            freedoms = len(np.unique(unit[members].indices))
            raise InvalidProblemError(
                f"{stack} has linearly dependent rows ({some}); expected full rank {len(contact)}p = {len(names)} "
                + (_DEPENDENT if freedoms >= len(members) else _REDUNDANT.format(len(members), freedoms))
            )


_DEPENDENT = "(is a contact node listed twice, or held fixed?)"
_REDUNDANT = (
    "({} rows act on {} degrees of freedom only, so equilibrium does not determine the contact forces; make the "
    "contacts compliant, by an elastic body or by springs between a rigid one and its contact nodes, or take fewer)"
)


def _dependent_rows(unit: sp.csr_array, gram: Floats) -> Indices:
    """The rows (of length one) that take part in a linear dependence; empty where there is none."""
    values, vectors = np.linalg.eigh(gram)
    # the Gram matrix squares the singular values: below sqrt(eps) decide by the singular values themselves
    if values[0] > 1e-7 * values[-1]:
        return np.empty(0, dtype=np.intp)
    used = np.unique(unit.indices)
    singular = np.linalg.svd(unit[:, used].toarray(), compute_uv=False)
    if len(used) >= len(gram) and singular[-1] > ROW_RANK_TOLERANCE * singular[0]:
        return np.empty(0, dtype=np.intp)
    return np.flatnonzero(np.abs(vectors[:, 0]) > 0.1 * np.max(np.abs(vectors[:, 0])))


def _node_ids(value: Iterable[object] | None, p: int) -> tuple[Any, ...]:
    if value is None:
        return tuple(range(p))
    wanted = f"expected a sequence of {p} distinct labels"
    if isinstance(value, (str, bytes, bytearray, set, frozenset, dict)):
        raise InvalidProblemError(f"node_ids is {shown(value)}; {wanted}")
    try:
        ids = tuple(v.item() if isinstance(v, np.generic) else v for v in value)
        distinct = len(set(ids))
    except TypeError:
        raise InvalidProblemError(f"node_ids is {shown(value)}; {wanted}") from None
    if len(ids) != p or distinct != p:
        raise InvalidProblemError(f"node_ids has {len(ids)} entries, {distinct} distinct; expected {p} distinct labels")
    return ids


def _places(value: ArrayLike, p: int, dimension: int) -> Floats:
    expected = f"(p, {dimension}) = ({p}, {dimension})"
    return array_of(value, "coordinates", (p, dimension), expected, InvalidProblemError)
