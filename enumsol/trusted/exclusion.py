"""The exclusion inequality: a proven bound over partial assignments, from multipliers of rows (theory, section 6).

With multipliers that combine to y on S lambda - g and to c on lambda, v = g + c + S y and q = g + c,

    min e  >=  -1/4 v'S^{-1}v + y'g  =  1/2 y'(g - c) - 1/4 y'S y - 1/4 q'S^{-1}q

and, for any x, q'S^{-1}q = 2 x'q - x'S x + r'S^{-1}r with r = q - S x. For another form, and v = h + c + S y,

    min q  >=  k + y'g - 1/4 v'H^{-1}v

and, for any x, v'H^{-1}v = 2 x'v - x'H x + r'H^{-1}r with r = v - H x. Over an interval of alpha the bound is concave
in alpha (see ``trusted.over_interval``). ``trusted.quadratic_forms`` has the bounds themselves.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, Self, cast

import numpy as np

from enumsol.arithmetic.balls import SAFE, gamma
from enumsol.condensation.enclosure import EnclosedSystem
from enumsol.trusted.floating_bounds import floating_bounds
from enumsol.trusted.over_interval import EnclosedPiece
from enumsol.trusted.quadratic_forms import EnclosedForm, energy_bounds, form_bounds
from enumsol.trusted.status_rows import FORBIDDEN, NONNEGATIVE, ROW_KINDS, row_signs

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.support.array_types import Floats, Indices, NDArray


class Terms(NamedTuple):
    """Row numbers, kind * p + node, and their multipliers."""

    rows: Indices
    values: Floats


@dataclass(frozen=True, eq=False)
class Leaves:
    """Partial assignments, and the multipliers by which they are said to be excluded.

    Attributes
    ----------
    codes : (m, p) array of (partial) status codes
    leaf : (k,) array, the assignment to which each multiplier belongs
    rows, values : (k,) arrays of row numbers (kind * p + node) and multipliers. A row that the assignment does not
        impose, or a multiplier of the wrong sign, makes that assignment's bound -inf.
    """

    codes: Indices
    leaf: Indices
    rows: Indices
    values: Floats

    @classmethod
    def of(cls, codes: Sequence[Sequence[int]] | NDArray[np.uint8], terms: Sequence[Terms]) -> Self:
        """Assignments, and the multipliers of each."""
        rows, values = zip(*terms, strict=True)
        leaf = np.repeat(np.arange(len(rows)), [len(r) for r in rows])
        return cls(np.array(codes, dtype=np.intp), leaf, np.concatenate(rows), np.concatenate(values))


def exclusion_margin(
    within: EnclosedSystem | EnclosedForm | EnclosedPiece,
    codes: Sequence[int],
    rows: Indices,
    values: Floats,
    errors: float = 1.0,
) -> float:
    """Proven lower bound over one partial assignment (see exclusion_margins)."""
    return float(exclusion_margins(within, Leaves.of([codes], [Terms(rows, values)]), errors)[0])


def exclusion_margins(
    within: EnclosedSystem | EnclosedForm | EnclosedPiece, leaves: Leaves, errors: float = 1.0
) -> Floats:
    """Proven lower bounds over partial assignments; positive means that one holds no solution.

    Parameters
    ----------
    within : EnclosedSystem, EnclosedForm or EnclosedPiece
        What is bounded: the energy at one alpha; a form, of a partial assignment that holds all of these; or for all
        alpha of a piece the energy, or the piece's form.
    leaves : Leaves
        Over a piece with nine kinds of rows.
    errors : how often the error bound is subtracted (see energy_bounds)

    Returns
    -------
    (m,) array, -inf where a form is not proven positive definite.
    """
    if isinstance(within, EnclosedPiece):
        low, high, allowed = within.low, within.high, within.row_signs(leaves.codes)
        ends: Sequence[EnclosedSystem | EnclosedForm] = within.forms or within.ends
    else:
        low = high = (within.system if isinstance(within, EnclosedForm) else within).F
        ends, allowed = (within,), row_signs(leaves.codes, high)
    if not all(end.smallest_eigenvalue > 0 for end in ends if isinstance(end, EnclosedForm)):
        return np.full(len(leaves.codes), -np.inf)
    return _margins(ends, allowed, low, high, leaves, errors)


def _margins(
    ends: Sequence[EnclosedSystem | EnclosedForm],
    allowed: NDArray[np.int8],
    low: Floats,
    high: Floats,
    leaves: Leaves,
    errors: float,
) -> Floats:
    """Bounds that hold at all ends, -inf where one is not finite.

    Parameters
    ----------
    ends : systems or forms that differ in g only, and in F, which enters by its bounds
    allowed : (m, p, kinds) array, what the multipliers may be: seven kinds of rows, or nine over an interval
    low, high : (p,) arrays, the smallest and the largest coefficients; equal where friction is constant
    """
    m, p, kinds = allowed.shape
    leaf, rows, values = leaves.leaf, leaves.rows, leaves.values
    bad = (rows < 0) | (rows >= kinds * p) | ~np.isfinite(values)
    rows, values = np.where(bad, 0, rows), np.where(bad, 0.0, values)
    kind, node = np.divmod(rows, p)
    signs = allowed[leaf, node, kind]
    bad |= (signs == FORBIDDEN) | ((signs == NONNEGATIVE) & (values < 0))
    refused = np.bincount(leaf[bad], minlength=m) > 0
    # one table per leaf with a row for each kind; several multipliers of a row add up
    place, count = leaf * (kinds * p) + rows, kinds * p * m
    table = np.bincount(place, values, minlength=count).reshape(m, kinds, p)
    size = np.bincount(place, np.abs(values), minlength=count).reshape(m, kinds, p)
    # what overflows gives no bound
    with np.errstate(over="ignore", invalid="ignore"):
        cone_size = size[:, 2] + size[:, 3]
        y = np.hstack([table[:, 4], table[:, 6] - table[:, 5]])
        normal, tangential = table[:, 0] + high * (table[:, 2] + table[:, 3]), table[:, 1] - table[:, 2] + table[:, 3]
        normal_size, tangential_size = size[:, 0] + high * cone_size, size[:, 1] + cone_size
        if kinds > ROW_KINDS:
            normal, tangential = normal - low * (table[:, 7] + table[:, 8]), tangential + table[:, 7] - table[:, 8]
            least_size = size[:, 7] + size[:, 8]
            normal_size, tangential_size = normal_size + low * least_size, tangential_size + least_size
        c, c_size = np.hstack([normal, tangential]), np.hstack([normal_size, tangential_size])
        # The rounded y is as good a choice of multipliers as the exact one: every component belongs to rows of one
        # sign, or to rows that are free, and sums of one sign keep it. c is not free in this way: cone rows tie its two
        # halves by F. A component of c is a sum over at most five kinds of rows, four at one alpha, each repeated at
        # most so often.
        repeated = int(np.bincount(place, minlength=1).max())
        c_rad = gamma((5 if kinds > ROW_KINDS else 4) * repeated + 8) * c_size
        # where friction is constant a cone row may be an equation, and its coefficient must be the exact one
        c_rad[:, :p] += np.max([end.F_rad for end in ends], axis=0) * (low == high) * cone_size
        c_rad *= SAFE
        if isinstance(ends[0], EnclosedSystem) and not ends[0].held:
            least = floating_bounds(cast("Sequence[EnclosedSystem]", ends), y, c, c_rad, errors)
        else:
            least = np.min([_bounds(end, y, c, c_rad, errors) for end in ends], axis=0)
    return np.where(refused | ~np.isfinite(least), -np.inf, least)


def _bounds(end: EnclosedSystem | EnclosedForm, y: Floats, c: Floats, c_rad: Floats, errors: float) -> Floats:
    if isinstance(end, EnclosedForm):
        return form_bounds(end, y, c, c_rad, errors)
    return energy_bounds(end, y, c, c_rad, errors)
