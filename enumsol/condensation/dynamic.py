"""The dynamic stiffness of contact rows: K(mu) = (B (A + mu M)^-1 B')^-1, in balls (theory, section 15.2).

K(mu) is the stiffness with which contact rows resist motions that grow like exp(rho t), mu = rho^2. It increases with
mu and is concave (theory, section 15.2), so that its values at a few mu bound it everywhere.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, Inverse
from enumsol.condensation.enclosure import CondensedEnclosure, NotEnclosedError, Products, product
from enumsol.condensation.factorization import Factorization
from enumsol.errors import InvalidProblemError

if TYPE_CHECKING:
    from fractions import Fraction

    from enumsol.support.array_types import Floats, Mask


#: Relative radii of S up to which it is not refined: what grows is proven in ranges of mu as narrow as 1e-8.
_FINE = 1e-9


class Pencil:
    """A + mu M at one mu, with rows B, as what condensing asks of a problem without any load.

    Parameters
    ----------
    A : (n, n) sparse matrix, symmetric
    rows : (m, n) sparse matrix
    """

    load_slope: Floats | None = None
    offset_radius: Floats | None = None
    exact_offset: tuple[Fraction, ...] | None = None
    held = True

    def __init__(self, A: sp.csc_array, rows: sp.csr_array) -> None:
        self.A, self.contact_rows, self.n = A, rows, A.shape[0]
        self.f, self.gap, self.slip_offset = np.zeros(self.n), np.zeros(rows.shape[0]), np.zeros(0)

    @cached_property
    def factorization(self) -> Factorization:
        """Factors of A + mu M."""
        return Factorization(self.A)

    def compliance(self, rounding: Floats | None = None, *, refined: bool = True) -> Ball:
        """B (A + E)^-1 B' for all symmetric E with |E| x <= ``rounding`` for x = 1, entry by entry.

        Parameters
        ----------
        rounding : (n, n) sparse matrix, optional
            Bounds of the entries of E.
        refined : bool
            With an error of second order in the residual: of an A that is exact and badly conditioned.

        Raises
        ------
        NotEnclosedError
            A is not proven positive definite.
        """
        try:
            itself: Any = self  # as much of a problem as condensing asks for
            products = Products.of(itself, refined=refined)
            enclosed = CondensedEnclosure.from_problem(itself, products)
        except InvalidProblemError as error:
            raise NotEnclosedError(str(error)) from None
        S, m = Ball(enclosed.S, enclosed.S_rad), len(enclosed.S)
        if rounding is None:
            return S
        # b'(A + E)^-1 c - b'A^-1 c = -b'A^-1 E (A + E)^-1 c, in units in which A has a diagonal near one
        scale, bound = products.scale, enclosed.stiffness_bound
        off = float(np.max(scale * (rounding @ scale))) * (1 + self.n * UNIT) * SAFE
        if not off < 0.5 * bound:
            raise NotEnclosedError("the rounding of A + mu M is as large as its smallest eigenvalue")
        lengths = (products.lengths[:m] + products.left[:m] / bound) * SAFE
        more = np.outer(lengths, lengths) * (off / (1 - off / bound))
        return Ball(S.mid, (S.rad + more * SAFE) * SAFE + TINY)


class DynamicStiffness:
    """K(mu) of some contact rows of a body.

    Parameters
    ----------
    A, M : (n, n) sparse matrices, symmetric
        Stiffness and mass; A + mu M is positive definite for mu > 0.
    rows : (m, n) sparse matrix
        B, of full rank.
    modes : (n, r) array, optional
        Rigid modes N, A N = 0, of a body that nothing holds.
    springs : (n, n) sparse matrix, optional
        With them A is positive definite.
    rest : Ball (m, m), optional
        B A^-1 B', if it is known.
    """

    def __init__(
        self,
        A: sp.csc_array,
        M: sp.csc_array,
        rows: sp.csr_array,
        modes: Floats | None = None,
        springs: Any = None,
        rest: Ball | None = None,
    ) -> None:
        self.A, self.M, self.rows, self.springs = A, M, rows, springs
        self._modes = np.zeros((A.shape[0], 0)) if modes is None else modes
        self._rest, self._known = rest, dict[float, Ball | None]()

    def at(self, mu: float) -> Ball | None:
        """K(mu), (m, m) [force / length]; None where it is not enclosed."""
        if not self.rows.shape[0]:
            return Ball.exact(np.zeros((0, 0)))
        if mu not in self._known:
            try:
                self._known[mu] = self._inverse(self._compliance(mu)) if mu or self.held else self._slow()
            except NotEnclosedError:
                self._known[mu] = None
        return self._known[mu]

    @property
    def held(self) -> bool:
        """True if A is positive definite: K(mu) is there for some mu < 0, too."""
        return not self._modes.shape[1]

    @property
    def known(self) -> list[float]:
        """All mu at which K(mu) has been enclosed, in order."""
        return sorted(mu for mu, K in self._known.items() if K is not None)

    @cached_property
    def yields(self) -> Mask:
        """Rows that act on some degree of freedom without mass, (m,)."""
        return np.asarray(abs(self.rows)[:, ~self._massive].sum(axis=1) > 0).ravel()

    @cached_property
    def steepest(self) -> Ball | None:
        """The limit of K(mu) / mu for large mu, (B M^-1 B')^-1, zero in rows that yield; None where not enclosed."""
        return None if self._mobility is None else self._placed(self._mobility, ~self.yields)

    @cached_property
    def stiffest(self) -> Ball | None:
        """The limit of K(mu) in rows that yield, the others held, zero in these; None where it is not enclosed."""
        still, rows = ~self._massive, sp.csr_array(self.rows[self.yields])
        if not rows.shape[0]:
            return Ball.exact(np.zeros((self.rows.shape[0],) * 2))
        part = sp.csc_array(sp.csr_array(self.A)[still][:, still])
        try:
            return self._placed(Pencil(part, sp.csr_array(rows[:, still])).compliance(), self.yields)
        except NotEnclosedError:
            return None

    @property
    def increases(self) -> bool:
        """True if M is proven positive definite where it is not zero: K(mu) then increases with mu."""
        return self._mobility is not None

    @cached_property
    def _massive(self) -> Mask:
        """Degrees of freedom with mass."""
        return np.asarray(self.M.diagonal() > 0)

    @cached_property
    def _mobility(self) -> Ball | None:
        """B M^-1 B' of rows that do not yield, or of any if all do; None: M is not definite where it is not zero."""
        massive = self._massive
        if not np.any(massive) or sp.csr_array(self.M)[~massive].nnz:
            return None
        rows = self.rows[:1] if np.all(self.yields) else self.rows[~self.yields]
        part = sp.csc_array(sp.csr_array(self.M)[massive][:, massive])
        try:
            return Pencil(part, sp.csr_array(rows[:, massive])).compliance(refined=False)
        except NotEnclosedError:
            return None

    def _placed(self, S: Ball, rows: Mask) -> Ball | None:
        """S^-1 of some rows, zero in the others; None where it is not enclosed."""
        whole, own = Ball.exact(np.zeros((len(rows),) * 2)), np.ix_(rows, rows)
        if np.any(rows):
            try:
                whole[own] = self._inverse(S)
            except NotEnclosedError:
                return None
        return whole

    def _compliance(self, mu: float) -> Ball:
        if mu == 0:
            return Pencil(self.A, self.rows).compliance() if self._rest is None else self._rest
        added = mu * self.M
        rounding = (abs(self.A) + 2.0 * abs(added)) * (2.0 * UNIT)
        pencil = Pencil(sp.csc_array(self.A + added), self.rows)
        S = pencil.compliance(rounding, refined=False)
        fine = np.max(S.rad) <= _FINE * np.min(S.mid.diagonal())
        return S if fine else pencil.compliance(rounding)

    def forces(self, load: Floats) -> Ball | None:
        """Forces y on the rows, held at w = 0, under a load at rest, (m,); None where they are not enclosed.

        Of a body that nothing holds they also balance the load as a whole.
        """
        K, m = self.at(0.0), self.rows.shape[0]
        size = float(np.max(np.abs(load), initial=0.0))
        if K is None or not size or not m:
            return None if K is None else Ball.exact(np.zeros(m))
        # a load is one more row: B A^-1 f'
        rows = sp.csr_array(sp.vstack([self.rows, sp.csr_array(load[None, :])]))
        try:
            if self.held:
                return K @ Pencil(self.A, rows).compliance()[:m, m]
            _, share, inverse = self._on_springs
            h = product(sp.csr_array(load[None, :]), self._modes)
            balance = inverse.solve(h.T)
            return K @ self._springs_and(rows)[:m, m] + (share @ balance)[:, 0]
        except NotEnclosedError:
            return None

    @cached_property
    def _on_springs(self) -> tuple[Ball, Ball, Inverse]:
        """K of the body on springs, K G', and what solves with G K G'."""
        K = self._inverse(self._springs_and(self.rows))
        G = product(self.rows, self._modes)
        share = K @ G
        inverse = Inverse.of(G.T @ share)
        if inverse is None:
            raise NotEnclosedError("some rigid displacement moves no node in contact")
        return K, share, inverse

    def _springs_and(self, rows: sp.csr_array) -> Ball:
        """S of rows of the body on springs."""
        held = Pencil(sp.csc_array(self.A + self.springs), rows)
        return held.compliance((abs(self.A) + abs(self.springs)) * (2.0 * UNIT))

    def _slow(self) -> Ball:
        """K(0) of a body that nothing holds: stiffness against all but the rigid motions (theory, (15.5))."""
        K, share, inverse = self._on_springs
        return (K - share @ inverse.solve(share.T)).symmetric

    @staticmethod
    def _inverse(S: Ball) -> Ball:
        if not len(S.mid):
            return S
        inverse = Inverse.of(S)
        if inverse is None:
            raise NotEnclosedError("S(mu) is not proven regular")
        return inverse.whole().symmetric
