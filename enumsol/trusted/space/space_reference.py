"""The trusted test in 3D that a strict root is the only one below assignments of a body that nothing holds.

See theory, sections 14.6 and 14.11; the multipliers are those of theory, section 12.6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball
from enumsol.trusted.root_forms import Body, Multipliers, RootForm, less, plus, times
from enumsol.trusted.space.leaves import SpaceRoot, settle
from enumsol.trusted.space.sector_rows import (
    ALONG,
    FREE,
    GAP,
    LEFT,
    NONNEGATIVE,
    OPEN,
    RIGHT,
    SLIP,
    STICK,
    row_sign,
    sector_row_terms,
)
from enumsol.trusted.space.space_uniqueness import SpaceWeights, in_range, is_complete, weighted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.support.array_types import Codes, Floats
    from enumsol.trusted.space.sector_rows import Row

    #: Two tight rows, and a positive factor.
    SpaceProduct = tuple[Row, Row, float]


@dataclass(frozen=True)
class SpaceReference:
    """A strict root of a leaf, and its form.

    Attributes
    ----------
    system : EnclosedSpace
    leaf : final codes
    root : SpaceRoot
    form : RootForm
    """

    system: EnclosedSpace
    leaf: Codes
    root: SpaceRoot
    form: RootForm

    @classmethod
    def of(cls, system: EnclosedSpace, leaf: Codes, numbers: Floats, balance: float, share: float) -> Self | None:
        """None where the leaf holds no strict root, or its form is not proven definite where G d = 0.

        Parameters
        ----------
        system : EnclosedSpace
        leaf : final codes
        numbers : see ``SpaceWeights.of``; no node serves any theta
        balance : factor of |G d|^2
        share : c of theory, section 14.11
        """
        if not (0 <= balance < np.inf and abs(share) < np.inf) or not is_complete(system, leaf):
            return None
        with np.errstate(all="ignore"):
            weights = SpaceWeights.of(system, numbers)
            if weights is None or np.any(weights.wide > 0) or not in_range(system):
                return None
            root = settle(system, leaf)
            if not isinstance(root, SpaceRoot):
                return None
            multipliers = _multipliers(system, weights, root, np.array(leaf) != OPEN, share)
            if multipliers is None:
                return None
            form = RootForm.of(Body(Ball(system.S, system.S_rad), system.rows.G), multipliers, balance)
        return None if form is None else cls(system, tuple(leaf), root, form)

    def is_only_root(
        self, codes: Sequence[int], rows: Sequence[Row], products: Sequence[SpaceProduct], reach: Floats
    ) -> bool:
        """True if every root below an assignment, with |q| within reach, is this one.

        Parameters
        ----------
        codes : (partial) status codes
        rows : rows on displacements that are equations below the assignment and at the root
        products : pairs of rows that are nonnegative below the assignment and not positive at the root, and a factor
        reach : (r,) array, bounds of q, may be infinite

        Raises
        ------
        ValueError
            A node has no such row.
        """
        rows, tight = sorted(set(rows)), sorted({row for one, other, _ in products for row in (one, other)})
        coefficients = self.rows(rows), self.rows(tight)
        if not all(self.is_equation(codes, row) for row in rows) or not all(self.is_tight(codes, row) for row in tight):
            return False
        if not all(0 < factor < np.inf for *_, factor in products):
            return False
        numbered = [(tight.index(one), tight.index(other), factor) for one, other, factor in products]
        return self.form.is_only_root(*coefficients, numbered, reach)

    def is_equation(self, codes: Sequence[int], row: Row) -> bool:
        """True if a row on displacements vanishes below an assignment and at the root."""
        node = row[1]
        return row[0] in (GAP, SLIP) and row_sign(codes[node], row) == row_sign(self.leaf[node], row) == FREE

    def is_tight(self, codes: Sequence[int], row: Row) -> bool:
        """True if a row on displacements is nonnegative below an assignment, and not positive at the root."""
        kind, node, _ = row
        if kind not in (GAP, ALONG, LEFT, RIGHT) or row_sign(codes[node], row) not in (NONNEGATIVE, FREE):
            return False
        code = self.leaf[node]
        if code == STICK or (kind == GAP and code != OPEN):
            return True
        with np.errstate(all="ignore"):
            found = self.rows([row]) @ self.root.w[:, None]
        return bool(found.high[0, 0] <= 0)

    def rows(self, rows: Sequence[Row]) -> Ball:
        """Rows as coefficients of w; ValueError where a node has no such row."""
        size, unit = len(self.system.g), self.system.row_unit
        found = Ball.exact(np.zeros((len(rows), size)))
        for k, row in enumerate(rows):
            for i, coefficient in zip(*sector_row_terms(row, self.system.tau, size), strict=True):
                found.mid[k, i - size] = coefficient * unit[i]
                # a power of two; those of directions are rounded
                found.rad[k, i - size] = 0.0 if row[0] in (GAP, SLIP, ALONG) else UNIT * abs(found.mid[k, i - size])
        found.rad[:] = np.where(found.rad > 0, found.rad * SAFE + TINY, 0.0)
        return found


def _multipliers(
    system: EnclosedSpace, weights: SpaceWeights, root: SpaceRoot, loaded: np.ndarray, share: float
) -> Multipliers | None:
    """None where it is not known which theta serves."""
    turn, push, p, y = weights.turn(system), weights.push(system), len(system.tau), root.y
    form = weighted(system, weights.mu, weights.kappa, turn, push)
    off = np.array([weights.off_at(system, i, y, root.w) for i in range(p)])
    lost, cost, price = np.zeros(len(system.g)), np.zeros(len(system.g)), Ball.exact(weights.mu) * y[:p]
    for k in range(2):
        has = system.tau[:, k] >= 0
        t = system.tau[has, k]
        lost[t] = np.where(off[has] > 0, weights.kappa[has] * off[has] / system.unit[t] * SAFE + TINY, 0.0)
        pushed = Ball(push[has, k], np.where(push[has, k] == 0, 0.0, TINY)) * y[t]
        price[has] = price[has] + pushed
    cost[:p] = np.where(loaded, np.maximum(price.low / SAFE, 0.0), 0.0)
    if not np.all(np.isfinite(lost)):
        return None
    return Multipliers(form, _cross(system, weights, turn, push, share), lost, cost)


def _cross(system: EnclosedSpace, weights: SpaceWeights, turn: Ball, push: Floats, share: float) -> Ball:
    """C = -G (D - c), without radius where nothing is left of it."""
    G, p = system.rows.G, len(system.tau)
    C = Ball.exact(np.zeros(G.shape))
    C[:, :p] = times(G[:, :p], less(share, weights.mu))
    for k in range(2):
        has = np.flatnonzero(system.tau[:, k] >= 0)
        t, kappa = system.tau[has, k], weights.kappa[has]
        C[:, has] = plus(C[:, has], times(times(G[:, t], turn[has, k]), Ball.exact(kappa)))
        pushed = Ball(-push[has, k], np.where(push[has, k] == 0, 0.0, TINY))
        C[:, t] = plus(times(G[:, has], pushed), times(G[:, t], less(share, kappa)))
    return C
