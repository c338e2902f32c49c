"""The trusted test in 3D that a strict root is the only one below assignments of a body that nothing holds.

See theory, sections 14.6 and 14.11; the multipliers are those of theory, section 12.6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball
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
    Row,
    row_sign,
    sector_row_terms,
)
from enumsol.trusted.space.space_uniqueness import SpaceWeights, in_range, is_complete
from enumsol.trusted.uniqueness_forms import Body, RootForm, RootReference

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.support.array_types import Codes, Floats


@dataclass(frozen=True)
class LeafReference(RootReference[Row]):
    """The strict root of a leaf, and its form."""

    system: EnclosedSpace
    root: SpaceRoot

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
            off, loaded = weights.distances(system, root.y, root.w), (root.y, np.array(leaf) != OPEN)
            body = Body(Ball(system.S, system.S_rad), system.rows.G)
            form = RootForm.of(body, weights.multipliers(system), off, loaded, balance, share)
        return None if form is None else cls(system, tuple(leaf), form, root)

    def allow(self, codes: Sequence[int], rows: Sequence[Row], tight: Sequence[Row]) -> bool:
        """True if the first rows are equations, and the others nonnegative but not positive at the root.

        Raises
        ------
        ValueError
            A node has no such row.
        """
        for row in (*rows, *tight):
            sector_row_terms(row, self.system.tau, len(self.system.g))
        return all(self.is_equation(codes, row) for row in rows) and all(self.is_tight(codes, row) for row in tight)

    def is_equation(self, codes: Sequence[int], row: Row) -> bool:
        """True if a row on displacements vanishes below an assignment and at the root."""
        node = row[1]
        return row[0] in (GAP, SLIP) and row_sign(codes[node], row) == row_sign(self.selection[node], row) == FREE

    def is_tight(self, codes: Sequence[int], row: Row) -> bool:
        """True if a row on displacements is nonnegative below an assignment, and not positive at the root."""
        kind, node, _ = row
        if kind not in (GAP, ALONG, LEFT, RIGHT) or row_sign(codes[node], row) not in (NONNEGATIVE, FREE):
            return False
        code = self.selection[node]
        if code == STICK or (kind == GAP and code != OPEN):
            return True
        with np.errstate(all="ignore"):
            found = self.rows([row]) @ self.root.w[:, None]
        return bool(found.high[0, 0] <= 0)

    def rows(self, rows: Sequence[Row]) -> Ball:
        """Rows as coefficients of w.

        Raises
        ------
        ValueError
            A node has no such row.
        """
        size, unit = len(self.system.g), self.system.row_unit
        found = Ball.exact(np.zeros((len(rows), size)))
        for k, row in enumerate(rows):
            for i, coefficient in zip(*sector_row_terms(row, self.system.tau, size), strict=True):
                found.mid[k, i - size] = coefficient * unit[i]
                # a power of two; those of directions are rounded
                found.rad[k, i - size] = 0.0 if row[0] in (GAP, SLIP, ALONG) else UNIT * abs(found.mid[k, i - size])
        found.rad[:] = np.where(found.rad > 0, found.rad * SAFE + TINY, 0.0)
        return found
