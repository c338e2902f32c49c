"""Of a body in 3D that nothing holds: exclusions, and resultants of contact forces (theory, section 14.6)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, gamma
from enumsol.condensation.space_condensed import EnclosedSpace
from enumsol.model.sectors import SECTORS, direction, end_number
from enumsol.trusted.floating_bounds import balanced, balancing, bounds_within
from enumsol.trusted.space.sector_rows import FRICTIONLESS, OPEN, SLIP_MINUS, SLIP_PLUS, Multiplied, Row, sector_margin

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.condensation.space_condensed import PieceSpace
    from enumsol.support.array_types import Floats

#: A disc of forces lies in a polygon of so many corners.
_CORNERS = 16
#: Binary digits of multipliers of the rows of balance over a piece.
_DIGITS = 40
_HALF = Ball.exact(np.array(0.5))


class Bounding(Protocol):
    """A form, or a piece of alpha, that has bounds of its own: SlipForm, Ellipsoid and AlphaPiece."""

    def margin(self, codes: Sequence[int], rows: Sequence[Row], values: Floats, errors: float = 1.0) -> float:
        """See ``space_margin``."""


def space_margin(
    within: EnclosedSpace | Bounding, codes: Sequence[int], rows: Sequence[Row], values: Floats, errors: float = 1.0
) -> float:
    """Lower bound over a partial assignment in 3D; positive means that it holds no solution."""
    if not isinstance(within, EnclosedSpace):
        return within.margin(codes, rows, values, errors)
    return (sector_margin if within.held else floating_margin)(within, codes, rows, values, errors)


@np.errstate(over="ignore", invalid="ignore")
def floating_margin(
    system: EnclosedSpace, codes: Sequence[int], lines: Sequence[Row], multipliers: Floats, errors: float = 1.0
) -> float:
    """Proven lower bound on e - h'q over a partial assignment, as ``sector_margin``; the better one of both of (14.6).

    ``lines`` are the rows, whose multipliers are given.
    """
    rows = Multiplied.of(system, codes, lines, multipliers)
    if rows is None:
        return -np.inf
    first = _bound(system, rows.y, rows.c, errors)
    y = None if first > 0 or not rows.pushes else _at_balance(system, rows, errors)
    return first if y is None else max(first, _bound(system, y, rows.c, errors, at_balance=True))


@np.errstate(over="ignore", invalid="ignore")
def swept_floating_margin(
    ends: tuple[PieceSpace, PieceSpace],
    middle: PieceSpace,
    codes: Sequence[int],
    lines: Sequence[Row],
    multipliers: tuple[Floats, Floats],
    errors: float = 1.0,
) -> float:
    """Lower bound at all alpha between two, by (14.19), multipliers between both ends (``swept_margin``)."""
    own, mixed = (
        [Multiplied.of(end, codes, lines, part) for end, part in zip(ends, values, strict=True)]
        for values in (multipliers, multipliers[::-1])
    )
    known = [rows for rows in own if rows is not None]
    c = [rows.c for rows in mixed if rows is not None]
    if len(known) < len(ends) or len(c) < len(ends):
        return -np.inf
    between = (c[0] + c[1]) * _HALF
    first = _swept(ends, middle, [rows.y for rows in known], known, between, errors)
    if first > 0 or not known[0].pushes:
        return first
    balances = [_at_balance(end, rows, errors) for end, rows in zip(ends, known, strict=True)]
    y = [there for there in balances if there is not None]
    if len(y) < len(ends):
        return first
    return max(first, _swept(ends, middle, y, known, between, errors, at_balance=True))


def _swept(
    ends: tuple[PieceSpace, PieceSpace],
    middle: PieceSpace,
    y: Sequence[Ball],
    rows: Sequence[Multiplied],
    between: Ball,
    errors: float,
    *,
    at_balance: bool = False,
) -> float:
    """The least number of (14.19), or that of an end that is not positive."""
    least, parts = np.inf, list(zip(ends, y, rows, strict=True))
    z = _rounded(np.array([balancing(end, there.mid[None], part.c.mid[None])[0] for end, there, part in parts]))
    for (end, there, part), own in zip(parts, z, strict=True):
        least = min(least, _bound(end, there, part.c, errors, own, at_balance=at_balance))
        if not least > 0:
            return least
    bound = _bound(middle, (y[0] + y[1]) * _HALF, between, errors, 0.5 * (z[0] + z[1]), at_balance=at_balance)
    (low, high), turn = (Ball.joined(Ball(end.g, end.g_rad), end.rows.h) for end in ends), Ball.exact(z[1] - z[0])
    lost = (Ball.joined(y[1] - y[0], turn)[None] @ (high - low)[:, None])[0, 0]
    bound -= 0.25 * float(lost.mid)
    bound -= errors * (0.25 * float(lost.rad) + 4 * UNIT * (abs(bound) + abs(float(lost.mid)))) * SAFE
    return min(least, bound) if np.isfinite(bound) else -np.inf


def _rounded(z: Floats) -> Floats:
    """Numbers near z of so few digits that the mean of any two is exact."""
    largest = float(np.max(np.abs(z), initial=0.0))
    unit = 2.0 ** (np.frexp(largest)[1] - _DIGITS) if largest > TINY else 1.0
    return np.asarray(np.round(z / unit) * unit)


def _bound(
    system: EnclosedSystem, y: Ball, c: Ball, errors: float, z: Floats | None = None, *, at_balance: bool = False
) -> float:
    """See ``bounds_within``; -inf where there is none."""
    return _finite(
        bounds_within(
            system,
            y.mid[None],
            y.rad[None],
            c.mid[None],
            c.rad[None],
            errors,
            None if z is None else z[None],
            at_balance=at_balance,
        )
    )


def _at_balance(system: EnclosedSystem, rows: Multiplied, errors: float) -> Ball | None:
    """The y of multipliers of the same signs next to those given for which G y = h; None where none are shown to exist.

    What changes is the multipliers of the rows on w: each y belongs to several of them.
    """
    size, k = len(system.g), gamma(len(rows.pushes) + 8)
    T, values = np.zeros((size, len(rows.pushes))), np.array([value for value, _ in rows.pushes])
    for column, (_, terms) in enumerate(rows.pushes):
        for i, coefficient in terms:
            T[i, column] += coefficient
    T_abs = np.abs(T)
    along, change, sure = balanced(system.rows.G @ Ball(T, 2 * UNIT * T_abs), system.rows.h, values[None], errors)
    if not sure[0]:
        return None
    y_rad = (T_abs @ (change[0] + k * np.abs(along[0]))) * (1 + k) * SAFE + TINY
    return Ball(T @ along[0], y_rad)


def _finite(bounds: Floats) -> float:
    return float(bounds[0]) if np.isfinite(bounds[0]) else -np.inf


def is_unbalanced_in_space(system: EnclosedSpace | PieceSpace, codes: Sequence[int], z: Floats) -> bool:
    """True if no forces below a partial assignment are in balance with the load, by z (r,); see theory, (14.7).

    z'h > 0, and z'G y <= 0 for all y of every node: (1, tau) with tau in the disc, or on the arc of its sector. Proven
    at both ends of a piece of alpha, it is so in between (theory, section 14.14).
    """
    with np.errstate(over="ignore", invalid="ignore"):
        (G, h), p, k = (system.rows.G, system.rows.h), system.p, gamma(len(z) + 16)
        z_abs = np.abs(z)
        load = float(z @ h.mid - (z_abs @ (h.rad + k * np.abs(h.mid))) * (1 + k) * SAFE - TINY)
        work = z @ G.mid / system.unit
        size = z_abs @ (np.abs(G.mid) + G.rad) / system.unit
        # what underflows is less, and nothing of it is left where all is zero
        slack = np.where(size > 0, (z_abs @ G.rad / system.unit + k * size) * (1 + k) * SAFE + TINY, 0.0)
        across, spread = system.tangential(work), system.tangential(slack).sum(axis=1)
        length = np.sqrt(np.sum(across * across, axis=1)) * (1 + 8 * UNIT) * SAFE
        # a direction in floats, and products with it, are off by less
        spread = (spread + 8 * UNIT * length) * SAFE
        most, discs = work[:p] + slack[:p], system.discs
        radii = np.stack([discs.mid - discs.rad * SAFE, discs.mid + discs.rad * SAFE])
    if not load > 0:
        return False
    for i, code in enumerate(codes):
        if code == OPEN:
            continue
        friction = _most_friction(code, across[i], float(length[i]), float(spread[i]))
        friction = max(float(radius) * friction for radius in radii[:, i])
        # products and their sum are rounded by less than their parts' units
        if not float(most[i]) + friction + 8 * UNIT * (abs(float(work[i])) + abs(friction)) <= 0:
            return False
    return True


def _most_friction(code: int, across: Floats, length: float, spread: float) -> float:
    """Maximum of across . tau for the tau of a node of this code, |tau| <= 1."""
    if code == FRICTIONLESS:
        return 0.0
    if code in (SLIP_PLUS, SLIP_MINUS):  # one component only: the other one is zero
        return float(across[0] + across[1]) * (1.0 if code == SLIP_PLUS else -1.0) + spread
    if code > SECTORS:
        (a1, a2), (b1, b2) = direction(code - SECTORS), direction(end_number(code - SECTORS))
        x, y = across.tolist()
        if min(a1 * y - a2 * x, x * b2 - y * b1) < -spread:
            # it points out of the sector, so that an end is the best
            return float(max(x * a1 + y * a2, x * b1 + y * b2)) + spread
    return length + spread


def unbounded(system: EnclosedSpace) -> EnclosedSpace:
    """The system without bounds of the rigid displacement."""
    return system.reaching(np.full_like(system.reach, np.inf))


def resultants(system: EnclosedSpace | PieceSpace, codes: Sequence[int]) -> list[Floats]:
    """Resultants G y, (r,) each, whose cone holds all that the forces of an assignment can have, but for rounding."""
    G, discs = system.rows.G.mid / system.unit, system.discs.mid.tolist()
    found = []
    for i, code in enumerate(codes):
        if code == OPEN:
            continue
        places = [int(t) for t in system.tau[i] if t >= 0]
        found += [
            G[:, i] + discs[i] * sum((x * G[:, t] for x, t in zip(tau, places, strict=True)), 0.0 * G[:, i])
            for tau in _corners(code, len(places))
        ]
    return found


def _corners(code: int, tangents: int) -> list[tuple[float, ...]]:
    """Corners of a polygon around the tau of a node, |tau| <= 1."""
    if code == FRICTIONLESS or not tangents:
        return [(0.0,) * tangents]
    if tangents == 1:
        return [(sign,) for sign in (1.0, -1.0) if code != (SLIP_MINUS if sign > 0 else SLIP_PLUS)]
    if code > SECTORS:
        a, b = (np.array(direction(n)) for n in (code - SECTORS, end_number(code - SECTORS)))
        return [tuple(corner) for corner in (a, b, (a + b) / (1.0 + a @ b))]
    angles = 2.0 * np.pi * np.arange(_CORNERS) / _CORNERS
    return list(zip(*(np.array([np.cos(angles), np.sin(angles)]) / np.cos(np.pi / _CORNERS)).tolist(), strict=True))
