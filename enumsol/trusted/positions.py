"""Positions of the contact nodes at a root: the start of the next step of a history (theory, section 13.2)."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.arithmetic.balls import SAFE, Ball, hull, smaller
from enumsol.condensation.enclosure import enclosure_of, moved_by_modes
from enumsol.trusted.at_alpha import displacements
from enumsol.trusted.status_rows import OPEN, SLIP_MINUS, SLIP_PLUS, STICK

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from fractions import Fraction

    from enumsol.model.problem import ContactProblem
    from enumsol.support.array_types import Mask

    #: The codes that every node may have.
    Among = Sequence[frozenset[int]]

#: Positions known to within this share of the largest of them are known well enough.
_WELL_KNOWN = 2.0**-30


def certain_statuses(forces: Ball, slips: Ball) -> tuple[int, ...] | None:
    """Status codes that a root in 2D has for certain, read off its balls; None where one of them is not certain.

    Parameters
    ----------
    forces : Ball of shape (2p,)
        lambda_n, then lambda_t [force].
    slips : Ball of shape (p,)
        u_t [length].
    """
    codes = []
    normal = zip(forces.mid.tolist(), forces.rad.tolist(), strict=True)
    for (force, near), slip, far in zip(normal, slips.mid.tolist(), slips.rad.tolist(), strict=False):
        if force == near == 0:
            codes.append(OPEN)
        elif not force > near:
            return None
        elif slip == far == 0:
            codes.append(STICK)
        elif abs(slip) > far:
            codes.append(SLIP_PLUS if slip > 0 else SLIP_MINUS)
        else:
            return None
    return tuple(codes)


def tangential_positions(
    problem: Any,
    alpha: Fraction,
    forces: Ball,
    still: Mask,
    before: Ball,
    codes: Sequence[int] | None = None,
    *,
    rigid: Ball | None = None,
    among: Among | None = None,
    share: float = 1.0,
) -> Ball:
    """Bt u at a root whose forces lie in a ball, for every slip offset in a ball.

    A node with u_t = 0 for certain stays where it was: its ball is carried over unchanged. Any other is where the load
    and the forces move it, theory, (13.2), whatever its own offset was. If the statuses of all nodes are certain,
    their equations say more: in 2D where nothing holds the body, and in balls of many digits where it is held by
    springs that are so weak that (13.2) says little; in 3D then by a leaf.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
        That of the step.
    alpha : Fraction
    forces : Ball of shape (2p,) or (3p,)
        lambda: normal components first, of which those that are not negative count [force].
    still : (p,) or (2p,) bool array
        Tangential components for which u_t = 0 at the root, whatever the data in their balls are.
    before : Ball of the same shape
        The slip offset [length].
    codes : p status codes or None
        Those of the root, if they are certain; in 3D any one that is neither open nor stick means slip.
    rigid : Ball of shape (r,), or None
        Of a body that nothing holds, the coordinates q of its rigid displacement; without them it may be anywhere.
    among : per node the codes that it may have, or None
        Of a root of such a body that is in one of these selections for certain, where its statuses are not.
    share : float
        Of the radius from which on more digits are asked for.

    Raises
    ------
    NotEnclosedError
        The step's data cannot be enclosed.
    """
    enclosure, p = enclosure_of(problem), problem.p
    S = Ball(enclosure.S, enclosure.S_rad)
    forces = _pressing(forces, p)
    with np.errstate(over="ignore", invalid="ignore"):
        moved = (enclosure.moved_freely(alpha) - (S @ forces[:, None])[:, 0])[p:]
        if rigid is not None:
            moved = moved + (moved_by_modes(problem)[p:] @ rigid[:, None])[:, 0]
        elif not problem.held:
            moved = Ball(moved.mid, np.full_like(moved.rad, np.inf))
    well_known, found = np.max(moved.rad) <= share * _WELL_KNOWN * np.max(np.abs(moved.mid)), None
    if len(moved.mid) == p and not problem.held:
        selections = [codes] if codes is not None else product(*among) if among is not None else ()
        found = _by_selections(problem, alpha, selections, before)
    elif codes is not None and not well_known:
        if len(moved.mid) == p:
            found = _by_many_digits(problem, alpha, codes, before)
        else:
            from enumsol.trusted.space.leaf_positions import leaf_positions  # in 3D only

            found = leaf_positions(problem, alpha, forces, codes)
    moved = moved if found is None else smaller(found, moved)
    return Ball(np.where(still, before.mid, moved.mid), np.where(still, before.rad, moved.rad))


def _pressing(forces: Ball, p: int) -> Ball:
    """The forces of a ball whose normal components are not negative, as those of a root are."""
    half = 0.5 * (forces.mid + forces.rad)
    cut = (np.arange(len(half)) < p) & (forces.mid < forces.rad) & (half > 0)
    return Ball(np.where(cut, half, forces.mid), np.where(cut, half * SAFE, forces.rad))


def _by_selections(problem: Any, alpha: Fraction, selections: Iterable[Sequence[int]], before: Ball) -> Ball | None:
    """Places of nodes at the root of a body that nothing holds which is that of one of these selections.

    None where there are none, or one may be singular.
    """
    units, p, found = problem.on_springs.condensed.at(alpha).proposals, problem.p, list[Ball]()
    length = units.length[p:]
    for codes in selections:
        moves = np.array(codes) != STICK
        w = displacements(enclosure_of(problem).without_offsets(moves).at(alpha, units.force, units.length), codes)
        if w is None:
            return None
        mid, rad = w.mid[p:] * length, w.rad[p:] * length
        found.append(Ball(np.where(moves, mid, before.mid), np.where(moves, rad, before.rad)))
    return hull(found) if found else None


def _by_many_digits(problem: ContactProblem, alpha: Fraction, codes: Sequence[int], before: Ball) -> Ball | None:
    """Positions of all nodes at the regular root of a selection; None where many digits do not enclose it."""
    from enumsol.trusted.arcs.precise import PreciseSelection, system_in_many_digits

    system = system_in_many_digits(problem)
    return None if system is None else PreciseSelection(system, codes).positions(alpha, before)
