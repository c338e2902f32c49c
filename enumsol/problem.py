"""The discrete contact problem: data, validation and the paths of friction and load over alpha."""

from __future__ import annotations

import hashlib
import numbers
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.array_checks import real_array, real_matrix
from enumsol.checks import alpha_value, exact_number, shown
from enumsol.condensation.affine import exactly_at
from enumsol.errors import InvalidArgumentError, InvalidProblemError
from enumsol.sealed import Immutable, SealedMatrix, sealed

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from enumsol.checks import AlphaLike
    from enumsol.condensation.condensed import CondensedProblem
    from enumsol.condensation.enclosure import CondensedEnclosure
    from enumsol.condensation.factorization import Factorization

#: An asymmetry of A up to this fraction of max|A| is rounding of the user's assembly and is averaged away.
ASYMMETRY_TOLERANCE = 1e-12
#: Singular values of the row-normalised [Bn; Bt] below this fraction of the largest mean dependent rows.
ROW_RANK_TOLERANCE = 1e-12


class ContactProblem(Immutable):
    """A linear elastic body on a rigid foundation with Coulomb friction (theory, section 1.1).

    Find u, lambda_n, lambda_t with::

        A u + Bn' lambda_n + Bt' lambda_t = f(alpha)
        lambda_n >= 0,  u_n = Bn u - gap <= 0,  lambda_n u_n = 0
        |lambda_t| <= F lambda_n,  u_t = Bt u - slip_offset
        u_t > 0 => lambda_t = F lambda_n;  u_t < 0 => lambda_t = -F lambda_n

    with F(alpha) = F0 + alpha F1 and f(alpha) = f + alpha load_slope. The object is immutable: its arrays are
    read-only, and every access to A, Bn or Bt gives a new sparse matrix, made in O(1) on read-only parts.

    Data are taken exactly as given: what float64 cannot hold (an integer above 2^53, digits of a longdouble) is
    refused. Sparse matrices may have any format of scipy.sparse; arrays of bool count as 0 and 1.

    Parameters
    ----------
    A : (n, n) array_like or sparse
        Stiffness, symmetric positive definite [force / length]. An asymmetry within 1e-12 max|A| is averaged away.
    Bn, Bt : (p, n) array_like or sparse
        Normal and tangential displacement of the p contact nodes as rows; [Bn; Bt] of full rank.
    f : (n,) array_like
        Load at alpha = 0 [force].
    gap : float or (p,) array_like
        Initial normal gap [length]; negative is a press fit.
    friction : float or tuple (F0, F1)
        Coulomb coefficient [-]. A number is constant; otherwise exactly two entries, each a number or a (p,) array.
    load_slope : (n,) array_like or None
        Derivative of the load with respect to alpha [force / unit of alpha].
    slip_offset : float or (p,) array_like
        Tangential position from which slip is counted [length].
    node_ids : sequence of length p or None
        Labels of the contact nodes for frames and messages; default 0 .. p-1.
    coordinates : (p, 2) array_like or None
        Positions of the contact nodes, for plots [length].

    Raises
    ------
    InvalidProblemError
        The data cannot be used; the message names the argument, what was found and what was expected.

    Examples
    --------
    >>> import enumsol
    >>> A, Bn, Bt, f = [[2, -1], [-1, 2]], [[1, 0]], [[0, 1]], [1.5, -4]
    >>> enumsol.ContactProblem(A, Bn, Bt, f, friction=(0.5, 1))
    ContactProblem with 1 contact node
      degrees of freedom  2  (A: 4 nonzeros)
      friction            F0 + alpha F1,  F0 in 0.5, F1 in 1
      load                constant,  max |f| = 4
      gap                 0
    """

    def __init__(
        self,
        A: ArrayLike | sp.sparray | sp.spmatrix,
        Bn: ArrayLike | sp.sparray | sp.spmatrix,
        Bt: ArrayLike | sp.sparray | sp.spmatrix,
        f: ArrayLike,
        gap: ArrayLike = 0.0,
        friction: float | tuple[ArrayLike, ArrayLike] = (0.0, 1.0),
        load_slope: ArrayLike | None = None,
        slip_offset: ArrayLike = 0.0,
        node_ids: Any = None,
        coordinates: ArrayLike | None = None,
    ) -> None:
        stiffness = real_matrix(A, "A")
        n = stiffness.shape[0]
        if stiffness.shape != (n, n) or n == 0:
            raise InvalidProblemError(f"A has shape {stiffness.shape}; expected a square matrix (n, n) with n >= 1")
        normal, tangent = real_matrix(Bn, "Bn"), real_matrix(Bt, "Bt")
        p = normal.shape[0]
        if p == 0:
            raise InvalidProblemError("Bn has no rows (p = 0 contact nodes); expected at least one contact node")
        for name, rows in (("Bn", normal), ("Bt", tangent)):
            if rows.shape != (p, n):
                raise InvalidProblemError(f"{name} has shape {rows.shape}; expected (p, n) = ({p}, {n})")
        self._A = SealedMatrix.of(_symmetric(stiffness))
        self._Bn = SealedMatrix.of(sp.csr_array(normal))
        self._Bt = SealedMatrix.of(sp.csr_array(tangent))
        _check_row_rank(self.Bn, self.Bt)
        self.f = _vector(f, "f", n)
        self.gap = _vector(gap, "gap", p, broadcast=True)
        self.friction = _friction(friction, p)
        self.load_slope = None if load_slope is None else _vector(load_slope, "load_slope", n)
        self.slip_offset = _vector(slip_offset, "slip_offset", p, broadcast=True)
        self.node_ids = _node_ids(node_ids, p)
        self.coordinates = None if coordinates is None else _coordinates(coordinates, p)
        self._freeze()
        self.factorization.check_positive_definite()

    _instead = "build a new problem"

    @property
    def A(self) -> sp.csc_array:  # noqa: N802 (the field's letter)
        """Stiffness, sparse (n, n); a new object at every access, whose parts are read-only."""
        return self._A.matrix()

    @property
    def Bn(self) -> sp.csr_array:  # noqa: N802 (as above)
        """Normal displacement of the contact nodes, sparse (p, n); a new object as A is."""
        return self._Bn.matrix()

    @property
    def Bt(self) -> sp.csr_array:  # noqa: N802 (as above)
        """Tangential displacement of the contact nodes, sparse (p, n); a new object as A is."""
        return self._Bt.matrix()

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return self._A.shape[0]

    @property
    def p(self) -> int:
        """Number of contact nodes."""
        return self._Bn.shape[0]

    @cached_property
    def factorization(self) -> Factorization:
        """One sparse factorization of A, shared by everything that solves with it."""
        from enumsol.condensation.factorization import Factorization  # condensed imports this module's types

        return Factorization(self.A)

    @cached_property
    def condensed(self) -> CondensedProblem:
        """The problem condensed to its 2p contact forces (theory, section 4.1)."""
        from enumsol.condensation.condensed import CondensedProblem  # as above

        return CondensedProblem.from_problem(self)

    @cached_property
    def enclosure(self) -> CondensedEnclosure:
        """Rigorous enclosure of the condensed problem.

        Raises
        ------
        NotEnclosedError
            A is positive definite only within rounding.
        """
        from enumsol.condensation.enclosure import CondensedEnclosure  # as above

        return CondensedEnclosure.from_problem(self)

    def friction_at(self, alpha: AlphaLike) -> NDArray[np.float64]:
        """Coefficients F(alpha) = F0 + alpha F1, shape (p,).

        Raises
        ------
        InvalidArgumentError
            alpha is not finite, or a coefficient is negative there (the node and its value are named).
        """
        a = Fraction(alpha_value(alpha))
        value = float(a)
        # rounded once from the exact value, so that zero and its sign are decided exactly
        try:
            F = np.array([float(x) for x in exactly_at(a, *self.friction)])
        except OverflowError:
            F = np.array([np.inf])
        if np.any(F < 0):
            node = int(np.argmin(F))
            raise InvalidArgumentError(
                f"friction at alpha = {value:g} is {F[node]:g} at contact node {self.node_ids[node]}; expected F >= 0"
            )
        if not np.all(np.isfinite(F)):
            raise InvalidArgumentError(
                f"friction at alpha = {value:g} is too large for float64; expected a finite value"
            )
        return np.asarray(F)

    def is_unloaded(self, alpha: AlphaLike) -> bool:
        """Whether load, gap and slip offset are exactly zero at alpha: then only lambda = 0, w = 0 solves."""
        a = Fraction(alpha_value(alpha))
        if np.any(self.gap) or np.any(self.slip_offset):
            return False
        if self.load_slope is None:
            return not np.any(self.f)
        return not any(exactly_at(a, self.f, self.load_slope))

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of all data, as 64 hexadecimal digits; proofs are bound to it."""
        digest = hashlib.sha256(b"enumsol problem 1")
        slope = np.zeros(self.n) if self.load_slope is None else self.load_slope
        parts: list[Any] = [np.array([self.n, self.p])]
        for matrix in (self.A, *(sp.csc_array(rows).sorted_indices() for rows in (self.Bn, self.Bt))):
            parts += [matrix.indptr, matrix.indices, matrix.data]
        for part in (*parts, self.f, self.gap, *self.friction, slope, self.slip_offset):
            kind = "<f8" if part.dtype.kind == "f" else "<i8"
            digest.update(np.ascontiguousarray(part, dtype=kind).tobytes())
            digest.update(b"|")
        return digest.hexdigest()

    def load_at(self, alpha: AlphaLike) -> NDArray[np.float64]:
        """Load f(alpha) = f + alpha load_slope, shape (n,) [force].

        Raises
        ------
        InvalidArgumentError
            alpha is not finite.
        """
        value = float(alpha_value(alpha))
        return self.f.copy() if self.load_slope is None else self.f + value * self.load_slope

    def __getstate__(self) -> dict[str, Any]:
        # the factorization (SuperLU) cannot be pickled; workers that need it compute it again
        return {key: value for key, value in self.__dict__.items() if key != "factorization"}

    def __repr__(self) -> str:
        F0, F1 = self.friction
        path = f"F0 in {_span(F0)}, F1 in {_span(F1)}"
        load = "constant" if self.load_slope is None else "f + alpha load_slope"
        return (
            f"ContactProblem with {self.p} contact node{'s' if self.p != 1 else ''}\n"
            f"  degrees of freedom  {self.n}  (A: {self.A.nnz} nonzeros)\n"
            f"  friction            F0 + alpha F1,  {path}\n"
            f"  load                {load},  max |f| = {np.max(np.abs(self.f)):.4g}\n"
            f"  gap                 {_span(self.gap)}"
        )


def _span(values: NDArray[np.float64]) -> str:
    low, high = float(np.min(values)), float(np.max(values))
    return f"{low:g}" if low == high else f"[{low:g}, {high:g}]"


def _vector(value: object, name: str, size: int, *, broadcast: bool = False) -> NDArray[np.float64]:
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


def _check_row_rank(Bn: sp.csr_array, Bt: sp.csr_array) -> None:
    rows = sp.csr_array(sp.vstack([Bn, Bt], format="csr"))
    p = Bn.shape[0]
    norms = np.sqrt(np.asarray(rows.multiply(rows).sum(axis=1)).ravel())
    if np.any(norms == 0):
        row = int(np.argmin(norms))
        raise InvalidProblemError(
            f"{'Bn' if row < p else 'Bt'} row {row % p} is zero; expected linearly independent rows of [Bn; Bt]"
        )
    unit = sp.csr_array(sp.diags_array(1.0 / norms) @ rows)
    gram = (unit @ unit.T).toarray()
    values, vectors = np.linalg.eigh(gram)
    # the Gram matrix squares the singular values: below sqrt(eps) decide by the singular values themselves
    if values[0] > 1e-7 * values[-1]:
        return
    used = np.unique(unit.indices)
    singular = np.linalg.svd(unit[:, used].toarray(), compute_uv=False)
    if len(used) < 2 * p or singular[-1] <= ROW_RANK_TOLERANCE * singular[0]:
        involved = np.flatnonzero(np.abs(vectors[:, 0]) > 0.1 * np.max(np.abs(vectors[:, 0])))
        names = ", ".join(f"{'Bn' if r < p else 'Bt'} row {r % p}" for r in involved[:6])
        raise InvalidProblemError(
            f"[Bn; Bt] has linearly dependent rows ({names}); expected full rank 2p = {2 * p} "
            "(is a contact node listed twice, or held fixed?)"
        )


def _friction(value: Any, p: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    hint = "expected a number, or a tuple (F0, F1) of exactly two, each a number or an array of shape (p,)"
    if isinstance(value, tuple):
        if len(value) != 2:
            raise InvalidProblemError(f"friction is a tuple of {len(value)} entries; {hint}")
        first, second = value
    elif exact_number(value) is not None:
        first, second = value, 0.0
    elif isinstance(value, (str, bytes, bool, np.generic, numbers.Number)) or getattr(value, "ndim", 1) == 0:
        raise InvalidProblemError(f"friction is {shown(value)}; {hint}")
    else:
        raise InvalidProblemError(f"friction is a bare {type(value).__name__}, which is ambiguous; {hint}")
    F0 = _vector(first, "friction F0", p, broadcast=True)
    F1 = _vector(second, "friction F1", p, broadcast=True)
    if not np.any(F1) and np.any(F0 < 0):
        node = int(np.argmin(F0))
        raise InvalidProblemError(f"friction is {F0[node]:g} at contact node {node}; expected F >= 0")
    return F0, F1


def _node_ids(value: Any, p: int) -> tuple[Any, ...]:
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


def _coordinates(value: ArrayLike, p: int) -> NDArray[np.float64]:
    array = real_array(value, "coordinates")
    if array.shape != (p, 2):
        raise InvalidProblemError(f"coordinates has shape {array.shape}; expected (p, 2) = ({p}, 2)")
    return sealed(array)
