"""Boxes in 3D that may hold one curve of solutions, points near one, and coordinates in floats.

Nothing here is trusted: ``trusted.space.solution_curve`` proves what is proposed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import TINY, UNIT, Ball
from enumsol.search.certifiers.protocol import ERRORS
from enumsol.search.space.space_newton import projected
from enumsol.trusted.space.solution_curve import CurveBox, curve_of, map_around

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.support.array_types import Floats
    from enumsol.trusted.space.krawczyk import Contraction, NaturalMap, Step
    from enumsol.trusted.space.solution_curve import AlphaProblem, SolutionCurve

#: How much more room the radii have than the curve seems to need, in the hope that this suffices for what the room
#: itself adds; the least radius relative to the largest; and steps of Newton's method.
_ROOMS, _LEAST, _STEPS = (1.2, 1.3, 1.5, 1.5, 1.5, 1.5, 1.5), 1e-3, 8
#: Of the radii with which the step seems to contract, what is tried first; and by how much larger than they need to be
#: radii are at least that are as large as they may be.
_OF_LIMIT, _TWICE = 0.8, 2.0
#: Between both, shares of the logarithm that are tried.
_SHARES = (0.6, 0.3, 0.0)
#: That a longer box has this room, too: (1 - e h)^2 / (k a) where the step contracts by e h + k r and moves by a.
_ROOM = 5.0
#: Factors of the steps of the natural map at a node that changes its status; how wide corners may be without them, and
#: how much wider in a shorter box with those of a longer one.
_TURNED, _AS_WIDE = 0.5, 1.05
_FACTORS = (1.0, 4.0, 16.0, 64.0, 256.0, 0.25, 0.0625, 0.015625)


#: How much longer a box is than the way between the points that it is to have: with more of it boxes fail, with less
#: points are outside.
_LONGER = 1.05


def curve_along(
    problem: AlphaProblem,
    ends: tuple[Floats, Floats],
    border: Floats,
    changing: Sequence[int],
    steps: dict[tuple[int, ...], tuple[Floats, float]] | None = None,
    *,
    roomy: bool = False,
) -> SolutionCurve | None:
    """The curve in a box that has two points, as of ``curve_around``; None where the second is not ahead.

    ``steps``: those of the natural map at a corner, by the nodes that change, put in when they are known.
    """
    chord = ends[1] - ends[0]
    length = float(border @ chord)
    if not length > 0:
        return None
    at, nodes, rho = (ends[0] + 0.5 * chord, chord / length, border, 0.5 * _LONGER * length), tuple(changing), None
    if steps is not None:
        steps[nodes] = corner_steps(problem, *at, changing, steps.get(nodes))
        rho = steps[nodes][0]
    return curve_around(problem, *at, changing, rho=rho, roomy=roomy)


def curve_around(
    problem: AlphaProblem,
    x: Floats,
    direction: Floats,
    border: Floats,
    half: float,
    changing: Sequence[int] = (),
    *,
    rho: Floats | None = None,
    roomy: bool = True,
) -> SolutionCurve | None:
    """The curve that runs near x, in a box that is proposed and proven with room for a checker.

    Parameters
    ----------
    changing : nodes whose status changes in the box
    rho : steps of the natural map relative to those of the problem; ``corner_steps`` by default
    roomy : whether its radii are to be as large as they may be
    """
    with np.errstate(all="ignore"):
        steps = corner_steps(problem, x, direction, border, half, changing)[0] if rho is None else rho
        box = CurveBox(x, direction, border, half, np.zeros(problem.m + 1), steps)
        near = map_around(problem, box)
        found = _contraction(near, roomy=roomy)
        return None if found is None else curve_of(problem, replace(box, radius=found.radius * problem.unit), found)


def corner_steps(
    problem: AlphaProblem,
    x: Floats,
    direction: Floats,
    border: Floats,
    half: float,
    changing: Sequence[int],
    known: tuple[Floats, float] | None = None,
) -> tuple[Floats, float]:
    """Steps for ``curve_around`` where nodes change their statuses, and how wide corners are with them.

    ``known``: what is returned for a longer box around the same corner: mostly it serves for all of them.
    """
    rho, best = np.ones(problem.m), 0.0
    if not len(changing):
        return rho, best
    with np.errstate(all="ignore"):

        def turned(steps: Floats) -> float:
            return _turned(map_around(problem, CurveBox(x, direction, border, half, np.zeros(problem.m + 1), steps)))

        if known is not None and known[1] < 1.0 and turned(known[0]) <= _AS_WIDE * known[1]:
            return known
        best = turned(rho)
        # all nodes alike, then each of them by itself
        for nodes in [changing, *([[i] for i in changing] if len(changing) > 1 else [])]:
            if best < _TURNED:
                continue
            tau = [int(t) for i in nodes for t in problem.tau[i]]
            found: list[tuple[float, Floats]] = []
            for factor in _FACTORS:
                for places in (list(nodes), tau, [*nodes, *tau]):
                    other = rho.copy()
                    other[places] *= factor
                    found.append((turned(other), other))
            best, rho = min(found, key=lambda pair: pair[0])
        return rho, best


@dataclass(frozen=True, eq=False)
class CurvePoint:
    """A solution x as floats have it, the direction of its curve, and statuses by the signs of their conditions.

    z are the arguments of P there, and alpha.
    """

    x: Floats
    direction: Floats
    statuses: tuple[int | None, ...]
    z: Floats


def curve_point(problem: AlphaProblem, x: Floats, border: Floats) -> CurvePoint | None:
    """The point of a solution's curve near x with border (x' - x) = 0, by Newton's method.

    Its direction has the product 1 with the border; at a change of statuses it is that of one side.
    """
    m, unit = problem.m, problem.unit
    x, row, asked = x / unit, border * unit, np.zeros((m + 1, 2))
    asked[m, 1] = 1.0
    moves = np.vstack([2.0 * problem.part.mid - np.eye(m, m + 1), np.eye(1, m + 1, m)])
    at = np.column_stack([np.arange(problem.p), problem.places, np.full(problem.p, m)])
    has, kept = at[:, :3] >= 0, np.arange(3 * problem.p, m)
    with np.errstate(all="ignore"):
        for _ in range(_STEPS):
            y = problem.part.mid @ x + problem.offset.mid
            z = np.append(2.0 * y - x[:m], x[m])
            P, D = projected(problem.places, problem.F0 + z[m] * problem.F1, problem.F1, z)
            asked[:m, 0] = P - y
            B = np.vstack([problem.part.mid, row])
            B[kept] -= moves[kept]
            B[at[:, :3][has]] -= (D @ moves[at])[has]
            try:
                found = np.linalg.solve(B, asked)
            except np.linalg.LinAlgError:
                return None
            x = x + found[:, 0]
            if np.all(np.abs(found[:, 0]) <= 4 * UNIT * np.max(np.abs(x))):
                break
        statuses = problem.statuses(Ball.exact(z))
    return CurvePoint(x * unit, found[:, 1] * unit, statuses, z) if np.all(np.isfinite(found)) else None


def proven_point(problem: AlphaProblem, near: CurvePoint | None, border: Floats) -> SolutionCurve | None:
    """The solution at a point, in a box without length, if all statuses hold strictly there; None where not proven."""
    found = None if near is None else curve_around(problem, near.x, near.direction, border, 0.0, roomy=False)
    return None if found is None or None in found.statuses else found


def _contraction(near: NaturalMap, *, roomy: bool) -> Contraction | None:
    """The operator around a box with radii of about what it needs, or as large as they may be."""
    step = straight = near.step(near.extent())
    found = None
    for room in _ROOMS:
        radius = None if step is None else step.balanced(near.half, 1.0, room)
        if step is None or radius is None:
            return None
        radius = np.maximum(radius, _LEAST * np.max(radius)) + TINY
        shares = step.shares(radius, near.half)
        if shares is None:
            return None
        side = near.beside(step, shares)
        step, found = near.tried(radius, ERRORS, side)
        if found is not None and not roomy and np.any(side):
            # a checker begins without a side, from where another treatment of a corner may be come to
            found = near.mapped(radius, ERRORS)
        if found is not None:
            break
    if found is None or straight is None or not roomy:
        return found
    # parts of the curve are to have room beside it
    larger = (near.mapped(factor * found.radius, ERRORS) for factor in _factors(straight, found))
    return next((one for one in larger if one is not None), None)


def _factors(straight: Step, found: Contraction) -> list[float]:
    """Factors of a radius, the first one with which the step may still contract."""
    near, radius = found.near, found.radius
    most = float(np.max(np.abs(near.d))) * near.half / float(np.max(radius))
    none, once = (float(np.max(step.E @ radius / radius)) for step in (straight, found.step))
    moved = float(np.max((straight.move.size + straight.drift * near.half) / radius))
    # it contracts by e + k r; the larger r at which what it leaves is r
    k, free = max(once - none, 0.0), max(1.0 - none, 0.0)
    limit = (free + np.sqrt(max(free * free - 4.0 * k * moved, 0.0))) / (2.0 * k) if k > 0 else np.inf
    most = max(min(most, _OF_LIMIT * float(limit)), _TWICE)
    return [_TWICE * (most / _TWICE) ** share for share in (_SHARES if most > _TWICE else _SHARES[-1:])]


def _turned(near: NaturalMap) -> float:
    """Width of corners relative to what the test bears: less than 1 where it bears them."""
    step = near.step(near.extent())
    if step is None or not np.all(np.isfinite(step.slopes)):
        return np.inf
    return float(np.max(np.abs(np.linalg.eigvals(step.slopes)), initial=0.0))


def stretch(curve: SolutionCurve) -> float:
    """Factor by which a box that is found as that of a curve was may about be longer."""
    found = curve.found
    if not found.near.half:
        return 1.0
    radius, (spread, _, closer) = found.radius, found.spread
    with np.errstate(all="ignore"):
        whole, least = (float(np.max(step.E @ radius / radius)) for step in (found.step, closer))
        share = float(np.max(spread / radius))
        # the step contracts by e h + k r for boxes of length h and radius r
        k = max((whole - least) / (1.0 - share), 0.0) if share < 1 else 0.0
        most = 1.0 / (max(least - k * share, 0.0) + np.sqrt(_ROOM * k * share * max(1.0 - least, 0.0)))
    return float(most) if most > 0 else 1.0


# -- coordinates, in floats --------------------------------------------------------------------------------------------


def placed(problem: AlphaProblem, x: Floats) -> Floats:
    """(zeta, alpha) of forces and alpha, (..., m + 1)."""
    y = x[..., :-1] / problem.force
    w = problem.g0.mid + x[..., -1:] * problem.g1.mid - y @ problem.S.mid.T
    return np.append((problem.inverse.mid * y - problem.rho * w) * problem.force, x[..., -1:], axis=-1)


def unplaced(problem: AlphaProblem, x: Floats) -> Floats:
    """Forces and alpha of (zeta, alpha), (..., m + 1)."""
    y = (x / problem.unit) @ problem.part.mid.T + problem.offset.mid
    return np.append(y * problem.ratio.mid * problem.force, x[..., -1:], axis=-1)


def border_of_forces(problem: AlphaProblem, border: Floats) -> Floats:
    """The row by (forces, alpha) of one by (zeta, alpha), (..., m + 1)."""
    return np.asarray(border @ _derivative(problem))


def border_of_zeta(problem: AlphaProblem, border: Floats) -> Floats:
    """The row by (zeta, alpha) of one by (forces, alpha), (m + 1,)."""
    return np.asarray(np.linalg.solve(_derivative(problem).T, border))


def _derivative(problem: AlphaProblem) -> Floats:
    """The derivative of (zeta, alpha) with respect to forces and alpha."""
    force, m = problem.force, problem.m
    J = np.eye(m + 1)
    S = problem.S.mid * (problem.rho * force)[:, None] / force
    J[:m, :m], J[:m, m] = np.diag(problem.inverse.mid) + S, -problem.rho * problem.g1.mid * force
    return J
