"""The trusted test of a root that is alone below an assignment (theory, section 6.13).

The root is the verified solution of a selection, so that no existence has to be shown; that it is the only one follows
from the form of theory, (6.9), with the squares of what vanishes below the assignment, or cannot be large there.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.ball_arrays import Ball
from enumsol.arithmetic.balls import SAFE, TINY, gamma
from enumsol.trusted.at_alpha import solve_selection
from enumsol.trusted.exclusion import exclusion_margin
from enumsol.trusted.selection import Unknowns
from enumsol.trusted.status_rows import (
    CONTACT,
    FRICTIONLESS,
    OPEN,
    ROW_KINDS,
    SLIP_MINUS,
    SLIP_PLUS,
    STICK,
    UNDECIDED,
    final_codes,
    refines,
    slip_directions,
)
from enumsol.trusted.uniqueness_weights import Components, Weights

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from enumsol.arithmetic.balls import Array
    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.trusted.at_alpha import VerifiedSelection

_TOUCHING = (STICK, SLIP_PLUS, SLIP_MINUS, FRICTIONLESS, CONTACT)


def numbers_of(codes: Sequence[int], friction: Sequence[bool]) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """The nodes that are not open in an assignment, and of these those that have a lambda_t of their own."""
    status = np.array(codes, dtype=np.intp)
    nodes = np.flatnonzero(status != OPEN)
    return nodes, np.array(friction, dtype=bool)[nodes] & np.isin(status[nodes], (STICK, CONTACT, UNDECIDED))


def lone_root(
    system: EnclosedSystem,
    codes: Sequence[int],
    selection: Sequence[int],
    weights: Array,
    strengths: Array,
    rows: NDArray[np.intp],
    values: Array,
) -> VerifiedSelection | None:
    """The only root below an assignment, that of a selection and regular; None where that is not proven.

    Parameters
    ----------
    system : EnclosedSystem
    codes : of the assignment
    selection : final codes below it
    weights : mu of the nodes that are not open in the assignment, then kappa, nu and theta / F of those with a lambda_t
        of their own
    strengths : (2, p) array, factors of the squares of (S d)_n and (S d)_t, not negative
    rows, values : multipliers that the assignment allows, for bounds of gaps
    """
    own = [final_codes(F > 0) for F in system.F]
    if any(code not in may or not refines(code, above) for code, above, may in zip(selection, codes, own, strict=True)):
        return None
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        root = solve_selection(system, selection)
        if root is None or not root.is_root:
            return None
        part = _components(system, codes, selection)
        numbers = Weights.of(part, np.concatenate([weights, np.zeros(len(part.at.normal))]))
        if numbers is None or not _allowed(part, codes, numbers, strengths, root, rows, values):
            return None
        x, w = root.force[part.at.places], root.w[part.at.places]
        numbers = numbers.beside(x, part.at.tangential[numbers.normal])
        least = part.least(numbers, _squares(part, strengths))
        return root if part.serves(numbers, x, w, least) else None


def _components(system: EnclosedSystem, codes: Sequence[int], selection: Sequence[int]) -> Components:
    """lambda of the nodes that are not open, with lambda_t = +-F lambda_n put in where the assignment has that."""
    nodes, own = numbers_of(codes, (system.F > 0).tolist())
    at, (S, _, F) = Unknowns(system.p, nodes, own, slip_directions(codes)[nodes]), system.balls
    return Components(system, tuple(selection), at, at.columns(S[at.places], F))


def _squares(part: Components, strengths: Array) -> Ball | None:
    """Rows of (S d)_n and (S d)_t, each times the root of its strength."""
    factors = np.sqrt(strengths.ravel()[part.at.places])
    used = np.flatnonzero(factors)
    return part.R[used] * Ball.exact(factors[used][:, None]) if len(used) else None


def _allowed(
    part: Components,
    codes: Sequence[int],
    numbers: Weights,
    strengths: Array,
    root: VerifiedSelection,
    rows: NDArray[np.intp],
    values: Array,
) -> bool:
    """Whether the squares that do not vanish below the assignment are no more than what the form leaves out."""
    system, p, status = part.system, part.system.p, np.array(codes)
    normal, tangential = strengths
    if not np.all(np.isfinite(strengths)) or np.any(strengths < 0) or np.any(tangential[status != STICK] > 0):
        return False
    place = np.flatnonzero((normal[part.at.nodes] > 0) & ~np.isin(status[part.at.nodes], _TOUCHING))
    loose = part.at.nodes[place]
    if not len(loose):
        return True
    left = Ball.exact(numbers.mu[place]) * root.force[loose]
    nu = np.zeros(len(part.at.nodes))
    nu[numbers.normal] = numbers.nu
    left = left + Ball.exact(nu[place]) * root.force[p + loose]
    # the roots of strengths are rounded
    needed = normal[loose] * gaps(system, codes, rows, values)[loose] * SAFE + TINY
    return bool(np.all(np.array(part.selection)[loose] != OPEN) and np.all(needed <= left.low / SAFE))


def gaps(system: EnclosedSystem, codes: Sequence[int], rows: NDArray[np.intp], values: Array) -> Array:
    """Upper bounds of -w_n at all roots below an assignment; infinite where the multipliers are not allowed.

    With multipliers that combine to y on S lambda - g and to c on lambda, the energy less the rows times them is its
    minimum m and ||lambda - lambda~||^2 in the norm of S, w~ = (g - c - S y) / 2. So the norm is at most sqrt(-m).
    """
    p = system.p
    least = exclusion_margin(system, codes, rows, values)
    if not np.isfinite(least):
        return np.full(p, np.inf)
    table, size = (np.bincount(rows, v, minlength=ROW_KINDS * p).reshape(ROW_KINDS, p) for v in (values, abs(values)))
    cone = size[2] + size[3]
    c = table[0] + system.F * (table[2] + table[3])
    error = gamma(4 * len(rows) + 8) * (size[0] + system.F * cone) + system.F_rad * cone * SAFE
    S, g, _ = system.balls
    pushed = S[:p] @ Ball.exact(np.concatenate([table[4], table[6] - table[5]]))
    twice = g[:p] - Ball(c, error * SAFE + TINY) - pushed
    diagonal = np.diagonal(system.S)[:p] + np.diagonal(system.S_rad)[:p]
    reach = np.sqrt(max(-least, 0.0) * diagonal) * SAFE * SAFE + TINY
    return np.asarray((np.maximum(twice.rad - twice.mid, 0.0) * 0.5 + reach) * SAFE)
