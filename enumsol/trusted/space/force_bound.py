"""Forces in 3D of bodies that nothing holds: in balance with a load or not, and how far they are from known ones.

See theory, sections 14.6 and 14.15. The bound holds whatever the statuses of the other root are.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, gamma, least_eigenvalue, upper_norm
from enumsol.model.sectors import SECTORS, direction, end_number
from enumsol.trusted.space.sector_rows import FRICTIONLESS, OPEN, SLIP_MINUS, SLIP_PLUS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.support.array_types import Floats, Indices
    from enumsol.trusted.uniqueness_forms import Multipliers


@dataclass(frozen=True)
class ForceBound:
    """The forces of all roots: those of a known one plus centre + T s, with |s| <= reach.

    Attributes
    ----------
    force : Ball (m,)
        Of the known root.
    places, unit : (p, k) arrays
        As of the multipliers: tau is ``unit`` times the component at its place.
    turn : Ball (p, k)
        theta over the units.
    centre : (m,) array
    T : (m, m) array
    reach : float
    least : float
        The form of these multipliers with |G d|^2 is at least so many |d|^2.
    left : float
        ||R||: e'G D d is at most so many |e| |d|.
    """

    force: Ball
    places: Indices
    unit: Floats
    turn: Ball
    centre: Floats
    T: Floats
    reach: float
    least: float
    left: float

    @classmethod
    def of(
        cls,
        body: tuple[Ball, Ball],
        numbers: Multipliers,
        root: tuple[Ball, Ball],
        rigid: Floats,
    ) -> Self | None:
        """None where no bound is proven (theory, section 14.15).

        Parameters
        ----------
        body : S and G, (m, m) and (r, m)
        numbers : Multipliers
            With any theta of at most the length one.
        root : its lambda and w, (m,)
        rigid : (r,) array, bounds of |q|, may be infinite
        """
        (S, G), (force, w) = body, root
        tangents = np.zeros(len(force.mid), dtype=bool)
        tangents[numbers.places[numbers.places >= 0]] = True
        slip = Ball(np.where(tangents, w.mid, 0.0), np.where(tangents, w.rad, 0.0))
        # kappa (tau* - theta lambda*_n), which is 0 at lambda_n
        off = numbers.turned(force)
        # any factor of |G d|^2, which is 0
        weighted = G * Ball.exact(np.array(np.sqrt(np.max(np.abs(S.mid), initial=0.0))))
        P = (numbers.form(S) + weighted.T @ weighted).symmetric
        b = (S @ off[:, None] - numbers.form(slip[:, None]))[:, 0]
        const = (off[None] @ slip[:, None])[0, 0]
        # -R and -G a: cross is -G D
        left, pushed = _left(numbers.cross(G, 0.0), G), (G @ -off[:, None])[:, 0]
        found = _ellipsoid(P, b, const, left, pushed, 2.0 * rigid * SAFE)
        least = least_eigenvalue(P)
        if found is None or not least > 0:
            return None
        return cls(force, numbers.places, numbers.unit, numbers.turn, *found, least, float(upper_norm(left.size)))

    def holds_by(self, i: int) -> float:
        """A number c with lambda_n |v| - (tau* + theta d_n) . v >= c |v| at all roots; at most 0 if none is known."""
        t = self.places[i][self.places[i] >= 0]
        has = self.places[i] >= 0
        away = float(upper_norm(self.T[i]) * self.reach) * SAFE
        found = np.inf
        # the left-hand side is concave in d_n
        for end in (self.centre[i] - away, self.centre[i] + away):
            d = Ball(np.array(end), np.array(4 * UNIT * abs(end)))
            tau = (self.force[t] + self.turn[i, has] * d) * Ball.exact(self.unit[i, has])
            normal = self.force[i] + d
            found = min(found, float(normal.mid - normal.rad) / SAFE - float(upper_norm(tau.size)) * SAFE)
        return found - 4 * UNIT * abs(found)

    @property
    def farthest(self) -> float:
        """Upper bound of |d|."""
        return float(upper_norm(self.centre) + upper_norm(self.T) * self.reach) * SAFE


def _left(D: Ball, G: Ball) -> Ball:
    """D, of the shape of G, less a combination of the rows of G, which is any: G d = 0."""
    part = D.mid @ np.linalg.pinv(G.mid)
    return D - Ball.exact(np.where(np.isfinite(part), part, 0.0)) @ G


def _ellipsoid(
    P: Ball, b: Ball, const: Ball, left: Ball, pushed: Ball, most: Floats
) -> tuple[Floats, Floats, float] | None:
    """Centre, T and reach of all d with d'P d + b'd <= const + |e|'|left d + pushed|, |e| <= most; or None."""
    try:
        T = np.linalg.inv(np.linalg.cholesky(P.mid)).T
    except np.linalg.LinAlgError:
        return None
    centre = -0.5 * (T @ (T.T @ b.mid))
    if not (np.all(np.isfinite(T)) and np.all(np.isfinite(centre))):
        return None
    columns, point = Ball.exact(T), Ball.exact(centre)[:, None]
    moved, half = P @ point, b[:, None] * Ball.exact(np.array(0.5))
    off = float(upper_norm((columns.T @ (P @ columns) - Ball.exact(np.eye(len(T)))).size)) * SAFE
    slope = float(most @ upper_norm((left @ columns).size, axis=1)) * SAFE
    pull = (float(upper_norm((columns.T @ (moved + half)).size)) + 0.5 * slope) * SAFE
    value = (point.T @ moved + b[None] @ point)[0, 0] - const
    low = float(value.mid - (value.rad + 4 * UNIT * abs(value.mid)) * SAFE)
    low -= float(most @ ((left @ point)[:, 0] + pushed).size) * SAFE
    # the form in the coordinates of the ellipsoid is within a half of the unit matrix
    if not (off < 0.5 and np.isfinite(pull) and np.isfinite(low)):
        return None
    # least |s|^2 - 2 pull |s| + low <= 0, of which d = 0 is a solution
    least = (1.0 - off) / SAFE
    under = max(pull * pull * SAFE * SAFE - least * low / (SAFE if low > 0 else 1.0 / SAFE), 0.0)
    return centre, T, float((pull + np.sqrt(under) * SAFE) / least * SAFE * SAFE + TINY)


def is_unbalanced_in_space(system: EnclosedSpace, codes: Sequence[int], z: Floats) -> bool:
    """True if no forces below a partial assignment are in balance with the load, by z (r,); see theory, (14.7).

    z'h > 0, and z'G y <= 0 for all y of every node: (1, tau) with tau in the disc, or on the arc of its sector. Proven
    at both ends of a piece of alpha, it is so in between (theory, section 14.8).
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
