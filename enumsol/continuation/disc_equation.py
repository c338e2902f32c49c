"""The condensed equation H = 0 in 3D, on which the continuation works (theory, section 8.12).

At a node with friction let c be the mean of its coefficients, q = F / c their ratios to it, and

    zeta = lambda_t / q + r q w_t,    d = zeta / |zeta|,

component by component. A slipping node has lambda_t = lambda_n F d: one smooth piece holds all directions of slip. It
stays smooth where F = 0, where lambda_t tells no direction and the slip does, and where the slip vanishes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from enumsol.continuation.scaled_equation import STATUS_TOLERANCE, ScaledEquation
from enumsol.model.statuses import FRICTIONLESS, OPEN, SLIP, STICK, ContactStatus
from enumsol.support.array_types import Codes, Floats, Mask

_NAMES = {OPEN: ContactStatus.OPEN, STICK: ContactStatus.STICK, SLIP: ContactStatus.SLIP}


@dataclass(frozen=True)
class _Cone:
    """Friction at one alpha: F = c q, c (p,) the mean coefficient of a node and q (p, 2), and derivatives."""

    c: Floats
    q: Floats
    dc: Floats
    dq: Floats


@dataclass(frozen=True)
class _Trial:
    """zeta, its length and its direction, (p, 2), (p,) and (p, 2), and lambda_t / q."""

    length: Floats
    direction: Floats
    force: Floats


class DiscEquation(ScaledEquation):
    """H in 3D: selections are named by rows (p, 2), whether a node is in contact and whether it slips.

    Parameters are those of ScaledEquation.
    """

    single_valued = False
    neighbours = MappingProxyType(
        {OPEN: ((SLIP, FRICTIONLESS),), STICK: ((SLIP,),), SLIP: ((OPEN,), (STICK,)), FRICTIONLESS: ((OPEN,),)}
    )

    # -- friction ----------------------------------------------------------------------------------------------------

    def _cone(self, x: Floats) -> _Cone:
        values, rubs = self.at(x), ~self.without
        count = np.maximum(np.sum(rubs, axis=1), 1)
        F, dF = np.where(rubs, values.F, 0.0), np.where(rubs, values.dF, 0.0)
        c, dc = np.sum(F, axis=1) / count, np.sum(dF, axis=1) / count
        # where c = 0 the coefficients vanish together, and keep their ratios
        some, part = np.where(c != 0, c, dc), np.where((c != 0)[:, None], F, dF)
        ratio = part / np.where(some != 0, some, 1.0)[:, None]
        q = np.where(rubs & (some != 0)[:, None], ratio, 1.0)
        dq = np.where(rubs & (c != 0)[:, None], (dF - q * dc[:, None]) / np.where(c != 0, c, 1.0)[:, None], 0.0)
        return _Cone(c, q, dc, dq)

    def _inverse(self, cone: _Cone) -> Floats:
        """1 / q of the components with friction, 0 of the others."""
        return np.where(self.without | (cone.q == 0), 0.0, 1.0 / np.where(cone.q != 0, cone.q, 1.0))

    def _trial(self, x: Floats, r: Floats, cone: _Cone) -> _Trial:
        slip, force = self.split(self.w(x))[1], self.split(x[:-1])[1] * self._inverse(cone)
        zeta = force + self.split(r)[1] * np.where(self.without, 0.0, cone.q * slip)
        length = np.linalg.norm(zeta, axis=1)
        return _Trial(length, zeta / np.where(length > 0, length, 1.0)[:, None], force)

    # -- H and its selections ----------------------------------------------------------------------------------------

    def _projected(self, x: Floats, r: Floats) -> Floats:
        """lambda - P(lambda + r w), P into lambda_n >= 0 and the disc of that lambda_n, in units of q."""
        cone = self._cone(x)
        trial, (normal, tangential), (w_n, w_t) = self._trial(x, r, cone), self.split(x[:-1]), self.split(self.w(x))
        (r_n, r_t), rubs = self.split(r), self._inverse(cone) != 0
        most = np.maximum(normal + r_n * w_n, 0.0)
        radius = cone.c * most
        inside = trial.length <= radius
        left = np.where(inside[:, None], -r_t * cone.q * w_t, trial.force - radius[:, None] * trial.direction)
        found = _flat(np.where(most > 0, -r_n * w_n, normal), np.where(rubs, cone.q * left, tangential))
        return np.append(found, -self.left(x))

    def selection_at(self, x: Floats) -> Mask:
        """Rows of the selection that is active at x, shape (p, 2)."""
        cone = self._cone(x)
        normal = self.split(x[: self.m] + self.r * self.w(x))[0]
        slips = self._trial(x, self.r, cone).length > cone.c * np.maximum(normal, 0.0)
        return np.column_stack([normal > 0, slips & ~self.frictionless])

    def selection(self, codes: Codes) -> Mask:
        """Rows of the selection in which the nodes have these statuses, shape (p, 2)."""
        named = np.array(codes)
        return np.column_stack([named != OPEN, named == SLIP])

    def selection_residual(self, rows: Mask, x: Floats) -> Floats:
        """The named selection function of H, shape (3p + r,)."""
        (normal, tangential), (w_n, w_t) = self.split(x[:-1]), self.split(self.w(x))
        closed, slips = rows[:, 0], (rows[:, 0] & rows[:, 1])[:, None]
        direction = self._trial(x, self.r, self._cone(x)).direction
        held = np.where(slips, tangential - normal[:, None] * self.at(x).F * direction, -w_t)
        free = ~closed[:, None] | self.without
        return np.append(_flat(np.where(closed, -w_n, normal), np.where(free, tangential, held)), -self.left(x))

    def jacobian(self, rows: Mask, x: Floats) -> Floats:
        """Gradient of the named selection function (see selection_residual), shape (3p + r, 3p + r + 1)."""
        p, values, cone = self.p, self.at(x), self._cone(x)
        closed, slips = rows[:, 0], (rows[:, 0] & rows[:, 1])[:, None, None]
        dw_n, dw_t = _parted(self._slopes(x))
        (dn, dt), node = _parted(np.eye(3 * p, len(x))), np.arange(p)
        direction, turned = self._turning(x, cone, dw_t, dt)
        slip = dt - (x[:p, None] * values.F)[:, :, None] * turned
        slip[node, :, node] -= values.F * direction
        slip[:, :, -1] -= x[:p, None] * values.dF * direction
        held = np.where(slips, slip, -dw_t)
        free = ~closed[:, None] | self.without
        tangential = np.where(free[:, :, None], dt, held)
        rest = np.column_stack([self.bordered[self.m :], -values.dg[self.m :]])
        return np.concatenate([np.where(closed[:, None], -dw_n, dn), tangential[:, 0], tangential[:, 1], rest])

    def _turning(self, x: Floats, cone: _Cone, dw_t: Floats, dt: Floats) -> tuple[Floats, Floats]:
        """Directions of slip, (p, 2), and their gradients, (p, 2, 3p + r + 1)."""
        trial, r, inverse = self._trial(x, self.r, cone), self.split(self.r)[1], self._inverse(cone)
        slip = self.split(self.w(x))[1]
        moved = inverse[:, :, None] * dt + np.where(self.without, 0.0, r * cone.q)[:, :, None] * dw_t
        moved[:, :, -1] += np.where(self.without, 0.0, r * slip * cone.dq) - trial.force * inverse * cone.dq
        d = trial.direction
        across = moved - d[:, :, None] * np.einsum("ik,ikj->ij", d, moved)[:, None]
        with np.errstate(divide="ignore"):
            return d, across * np.where(trial.length > 0, 1.0 / trial.length, 0.0)[:, None, None]

    # -- statuses and their conditions -------------------------------------------------------------------------------

    def _room(self, x: Floats, cone: _Cone) -> tuple[Floats, Floats]:
        """c lambda_n - |lambda_t / q| over 1 + c, (p,), and the direction of lambda_t / q."""
        force = self.split(x[:-1])[1] * self._inverse(cone)
        size = np.linalg.norm(force, axis=1)
        return (cone.c * x[: self.p] - size) / (1.0 + cone.c), force / np.where(size > 0, size, 1.0)[:, None]

    def slacks(self, codes: Codes, x: Floats) -> Floats:
        """Values that are >= 0 where the statuses hold, shape (p, 2); infinite where there is one condition."""
        named, cone, (w_n, w_t) = np.array(codes), self._cone(x), self.split(self.w(x))
        along = np.sum(self._trial(x, self.r, cone).direction * cone.q * w_t, axis=1)
        first = np.select([named == OPEN, named == STICK], [-w_n, self._room(x, cone)[0]], x[: self.p])
        return np.column_stack([first, np.where(named == SLIP, along, np.inf)])

    def slack_gradients(self, codes: Codes, x: Floats) -> Floats:
        """Gradients of all slacks, shape (p, 2, 3p + r + 1), 0 where there is one condition."""
        p, named, cone = self.p, np.array(codes), self._cone(x)
        dw_n, dw_t = _parted(self._slopes(x))
        (dn, dt), node = _parted(np.eye(3 * p, len(x))), np.arange(p)
        found = np.zeros((p, 2, len(x)))
        found[:, 0] = np.where((named == OPEN)[:, None], -dw_n, dn)
        room, towards = self._room(x, cone)
        inverse, tangential = self._inverse(cone), self.split(x[:-1])[1]
        stick = -np.einsum("ik,ikj->ij", towards * inverse, dt)
        stick[node, node] += cone.c
        stick[:, -1] += cone.dc * (x[:p] - room) + np.sum(towards * tangential * inverse**2 * cone.dq, axis=1)
        found[:, 0] = np.where((named == STICK)[:, None], stick / (1.0 + cone.c)[:, None], found[:, 0])
        direction, turned = self._turning(x, cone, dw_t, dt)
        slip = self.split(self.w(x))[1]
        along = np.einsum("ik,ikj->ij", direction * cone.q, dw_t) + np.einsum("ik,ikj->ij", cone.q * slip, turned)
        along[:, -1] += np.sum(direction * cone.dq * slip, axis=1)
        found[:, 1] = np.where((named == SLIP)[:, None], along, 0.0)
        return found

    def _touching(self, i: int, x: Floats) -> int:
        return SLIP

    def active(self, x: Floats, tolerance: float = STATUS_TOLERANCE) -> tuple[frozenset[int], ...]:
        """Per node the status codes whose equations and conditions hold within the tolerance."""
        found: list[set[int]] = [set() for _ in range(self.p)]
        for code in (OPEN, STICK, SLIP, FRICTIONLESS):
            codes = (code,) * self.p
            broken = np.abs(self.selection_residual(self.selection(codes), x)[: self.m]).reshape(3, -1)
            broken[1:] /= 1.0 + np.max(np.abs(self.at(x).F), axis=1)
            least = np.min(self.slacks(codes, x), axis=1)
            least = least if code == OPEN else np.minimum(least, x[: self.p])
            fits = self.frictionless if code == FRICTIONLESS else ~self.frictionless if code != OPEN else True
            holds = fits & np.all(broken <= tolerance, axis=0) & (least >= -tolerance)
            for i in np.flatnonzero(holds):
                found[i].add(code)
        return tuple(map(frozenset, found))

    def _codes(self, x: Floats) -> Codes:
        ones, cone = np.ones(3 * self.p), self._cone(x)
        normal = x[: self.p] + self.w(x)[: self.p]
        slips = self._trial(x, ones, cone).length >= cone.c * np.maximum(normal, 0.0)
        touching = np.where(self.frictionless, FRICTIONLESS, np.where(slips, SLIP, STICK))
        return tuple(np.where(normal > 0, touching, OPEN).tolist())

    def statuses(self, codes: Sequence[int], slip: Floats) -> tuple[ContactStatus, ...]:
        """Names of the statuses; a frictionless node in contact slips wherever its u_t is not 0."""
        moves = np.any(np.reshape(slip, (2, -1)) != 0, axis=0)
        without = (ContactStatus.STICK, ContactStatus.SLIP)
        return tuple(_NAMES.get(code, without[bool(move)]) for code, move in zip(codes, moves, strict=True))


def _flat(normal: Floats, tangential: Floats) -> Floats:
    """Normal and tangential parts, (p,) and (p, 2), as one array (3p,), all normals first."""
    return np.concatenate([normal, tangential[:, 0], tangential[:, 1]])


def _parted(rows: Floats) -> tuple[Floats, Floats]:
    """Rows (3p, k) as those of normals, (p, k), and of both tangents, (p, 2, k)."""
    normal, first, second = rows.reshape(3, -1, rows.shape[1])
    return normal, np.stack([first, second], axis=1)
