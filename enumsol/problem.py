"""The discrete contact problem: data, validation and the paths of friction and load over alpha."""

from __future__ import annotations

import hashlib
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.checks import Alpha, finite_alpha
from enumsol.errors import InvalidArgumentError, InvalidProblemError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from enumsol.condensation.condensed import CondensedProblem
    from enumsol.condensation.enclosure import CondensedEnclosure
    from enumsol.condensation.factorization import Factorization

#: An asymmetry of A up to this fraction of max|A| is rounding of the user's assembly and is averaged away.
ASYMMETRY_TOLERANCE = 1e-12
#: Singular values of the row-normalised [Bn; Bt] below this fraction of the largest mean dependent rows.
ROW_RANK_TOLERANCE = 1e-12


class ContactProblem:
    """A linear elastic body on a rigid foundation with Coulomb friction (theory: equilibrium, Signorini, Coulomb).

    Find u, lambda_n, lambda_t with::

        A u + Bn' lambda_n + Bt' lambda_t = f(alpha)
        lambda_n >= 0,  u_n = Bn u - gap <= 0,  lambda_n u_n = 0
        |lambda_t| <= F lambda_n,  u_t = Bt u - slip_offset
        u_t > 0 => lambda_t = F lambda_n;  u_t < 0 => lambda_t = -F lambda_n

    with F(alpha) = F0 + alpha F1 and f(alpha) = f + alpha load_slope. The object is immutable.

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
        stiffness = _matrix(A, "A")
        n = stiffness.shape[0]
        if stiffness.shape != (n, n) or n == 0:
            raise InvalidProblemError(f"A has shape {stiffness.shape}; expected a square matrix (n, n) with n >= 1")
        normal, tangent = _matrix(Bn, "Bn"), _matrix(Bt, "Bt")
        p = normal.shape[0]
        if p == 0:
            raise InvalidProblemError("Bn has no rows (p = 0 contact nodes); expected at least one contact node")
        for name, rows in (("Bn", normal), ("Bt", tangent)):
            if rows.shape != (p, n):
                raise InvalidProblemError(f"{name} has shape {rows.shape}; expected (p, n) = ({p}, {n})")
        self.A = _symmetric(stiffness)
        self.Bn = sp.csr_array(normal)
        self.Bt = sp.csr_array(tangent)
        _check_row_rank(self.Bn, self.Bt)
        _lock((self.A, self.Bn, self.Bt))
        self.f = _vector(f, "f", n)
        self.gap = _vector(gap, "gap", p, broadcast=True)
        self.friction = _friction(friction, p)
        self.load_slope = None if load_slope is None else _vector(load_slope, "load_slope", n)
        self.slip_offset = _vector(slip_offset, "slip_offset", p, broadcast=True)
        self.node_ids = _node_ids(node_ids, p)
        self.coordinates = None if coordinates is None else _coordinates(coordinates, p)
        self._frozen = True
        self.factorization.check_positive_definite()

    def __setattr__(self, name: str, value: object) -> None:
        if getattr(self, "_frozen", False):
            raise AttributeError(f"ContactProblem is immutable: {name} cannot be set; build a new problem")
        super().__setattr__(name, value)

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return int(self.A.shape[0])

    @property
    def p(self) -> int:
        """Number of contact nodes."""
        return int(self.Bn.shape[0])

    @cached_property
    def factorization(self) -> Factorization:
        """One sparse factorization of A, shared by everything that solves with it."""
        from enumsol.condensation.factorization import Factorization  # condensed imports this module's types

        return Factorization(self.A)

    @cached_property
    def condensed(self) -> CondensedProblem:
        """The problem condensed to its 2p contact forces (theory, section 4)."""
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

    def friction_at(self, alpha: Alpha) -> NDArray[np.float64]:
        """Coefficients F(alpha) = F0 + alpha F1, shape (p,).

        Raises
        ------
        InvalidArgumentError
            alpha is not finite, or a coefficient is negative there (the node and its value are named).
        """
        value = finite_alpha(alpha)
        # rounded once from the exact value, so that zero and its sign are decided exactly
        a = Fraction(alpha)
        try:
            F = np.array(
                [
                    float(Fraction(x) + a * Fraction(y))
                    for x, y in zip(*map(np.ndarray.tolist, self.friction), strict=True)
                ]
            )
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

    def is_unloaded(self, alpha: Alpha) -> bool:
        """Whether load, gap and slip offset are exactly zero at alpha: then only lambda = 0, w = 0 solves."""
        if np.any(self.gap) or np.any(self.slip_offset):
            return False
        if self.load_slope is None:
            return not np.any(self.f)
        a = Fraction(alpha)
        pairs = zip(self.f.tolist(), self.load_slope.tolist(), strict=True)
        return all(Fraction(x) + a * Fraction(y) == 0 for x, y in pairs)

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of all data, as 64 hexadecimal digits; proofs are bound to it."""
        digest = hashlib.sha256(b"enumsol problem 1")
        slope = np.zeros(self.n) if self.load_slope is None else self.load_slope
        parts: list[Any] = [np.array([self.n, self.p])]
        for matrix in (self.A, sp.csc_array(self.Bn), sp.csc_array(self.Bt)):
            ordered = matrix.sorted_indices()
            parts += [ordered.indptr, ordered.indices, ordered.data]
        for part in (*parts, self.f, self.gap, *self.friction, slope, self.slip_offset):
            kind = "<f8" if part.dtype.kind == "f" else "<i8"
            digest.update(np.ascontiguousarray(part, dtype=kind).tobytes())
            digest.update(b"|")
        return digest.hexdigest()

    def load_at(self, alpha: Alpha) -> NDArray[np.float64]:
        """Load f(alpha) = f + alpha load_slope, shape (n,) [force]."""
        value = finite_alpha(alpha)
        return self.f.copy() if self.load_slope is None else self.f + value * self.load_slope

    def __getstate__(self) -> dict[str, Any]:
        # the factorization (SuperLU) cannot be pickled; workers that need it make it again
        return {key: value for key, value in self.__dict__.items() if key != "factorization"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        # arrays come out of a pickle writable
        _lock(tuple(state.values()))

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


def _readonly(array: NDArray[Any]) -> NDArray[Any]:
    array.setflags(write=False)
    return array


def _lock(value: object) -> None:
    """Make arrays, sparse matrices and tuples of them read-only; leave anything else alone."""
    if isinstance(value, np.ndarray):
        value.setflags(write=False)
    elif isinstance(value, tuple):
        for item in value:
            _lock(item)
    elif isinstance(value, (sp.csc_array, sp.csr_array)):
        _lock((value.data, value.indices, value.indptr))


def _numeric(value: object, name: str) -> NDArray[np.float64]:
    try:
        raw = np.asarray(value)
        array = None if np.iscomplexobj(raw) else np.array(raw, dtype=np.float64)
    except (TypeError, ValueError):
        array = None
    if array is None:
        raise InvalidProblemError(
            f"{name} is not an array of real numbers (found {type(value).__name__}); expected float64 values"
        )
    if not np.all(np.isfinite(array)):
        where = tuple(int(k) for k in np.argwhere(~np.isfinite(array))[0])
        raise InvalidProblemError(f"{name} has the value {array[where]} at index {where}; expected finite numbers only")
    return array


def _matrix(value: Any, name: str) -> sp.csc_array:
    if sp.issparse(value):
        if np.iscomplexobj(value.data):
            raise InvalidProblemError(f"{name} has complex entries; expected real numbers")
        matrix = sp.csc_array(value, dtype=np.float64, copy=True)
        matrix.sum_duplicates()
        if not np.all(np.isfinite(matrix.data)):
            k = int(np.argmax(~np.isfinite(matrix.data)))
            column = int(np.searchsorted(matrix.indptr, k, side="right")) - 1
            row = int(matrix.indices[k])
            raise InvalidProblemError(
                f"{name} has the value {matrix.data[k]} at index ({row}, {column}); expected finite numbers only"
            )
    else:
        array = _numeric(value, name)
        if array.ndim != 2:
            raise InvalidProblemError(f"{name} has {array.ndim} dimension(s), shape {array.shape}; expected a matrix")
        matrix = sp.csc_array(array)
    matrix.eliminate_zeros()
    return matrix


def _vector(value: object, name: str, size: int, *, broadcast: bool = False) -> NDArray[np.float64]:
    array = _numeric(value, name)
    if array.ndim == 0 and broadcast:
        array = np.full(size, float(array))
    if array.shape != (size,):
        scalar = " or a single number" if broadcast else ""
        raise InvalidProblemError(f"{name} has shape {array.shape}; expected ({size},){scalar}")
    # -0.0 becomes 0.0: not every file format keeps the sign of zero, and equal problems are to have equal fingerprints
    return _readonly(array + 0.0)


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
    elif np.isscalar(value) or (isinstance(value, np.ndarray) and value.ndim == 0):
        first, second = value, 0.0
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
    try:
        ids = tuple(v.item() if isinstance(v, np.generic) else v for v in value)
        distinct = len(set(ids))
    except TypeError:
        raise InvalidProblemError(f"node_ids is {value!r}; expected a sequence of {p} distinct labels") from None
    if len(ids) != p or distinct != p:
        raise InvalidProblemError(f"node_ids has {len(ids)} entries, {distinct} distinct; expected {p} distinct labels")
    return ids


def _coordinates(value: ArrayLike, p: int) -> NDArray[np.float64]:
    array = _numeric(value, "coordinates")
    if array.shape != (p, 2):
        raise InvalidProblemError(f"coordinates has shape {array.shape}; expected (p, 2) = ({p}, 2)")
    return _readonly(array)
