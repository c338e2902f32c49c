"""The trusted test in 3D that a problem, or an assignment, has one solution only, which is enclosed.

A solution that is known well enough is the only one where a matrix is positive definite. That there is one follows from
the degree. It is enclosed by a leaf, where it is regular, or by a point near it, whatever statuses hold there. Below an
assignment the matrix has to be definite on the subspace of its equations (theory, section 12.6). Over a piece of alpha
the solution is known from a curve of solutions (theory, section 12.9).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, dense_eigenvalue_bound, upper_norm
from enumsol.model.sectors import DEEPEST, SECTORS, is_sector, level_of
from enumsol.trusted.space.leaves import SpaceRoot, settle
from enumsol.trusted.space.sector_rows import CONTACT, FRICTIONLESS, OPEN, SLIP_MINUS, SLIP_PLUS, STICK, UNDECIDED

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Self

    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.support.array_types import Floats, Mask

    Flags = Mask

#: Directions whose squared length is as near to one stand for the direction of length one.
_UNIT_LENGTH = 2.0**-40
#: Units of tau beyond this, or below its inverse, are left to the tree: nothing here underflows with others.
LARGEST_UNIT = 2.0**128
#: Weights of equations that are tried, by the largest entry of S.
EQUATION_WEIGHTS = 16.0, 1024.0


@dataclass(frozen=True)
class LooseSolution:
    """One solution of a problem as balls; its statuses need not be known.

    Attributes
    ----------
    y, w : Ball of shape (m,)
        Forces (lambda_n, tau) and displacements, scaled; without radius where they are 0 for certain.
    open, stick, slip : (p,) bool arrays
        Statuses that may hold; of nodes without friction that may touch both of the last two.
    index : int
        Its degree.
    """

    y: Ball
    w: Ball
    open: Flags
    stick: Flags
    slip: Flags
    index: int

    def certain(self, rubs: Flags) -> tuple[int, ...] | None:
        """Open, stick or contact (slip, or no friction) of every node; None where one is not certain."""
        several = self.open & (self.stick | self.slip) | rubs & self.stick & self.slip
        codes = np.where(self.open, OPEN, np.where(rubs & self.stick, STICK, CONTACT))
        return None if np.any(several) else tuple(codes.tolist())

    @classmethod
    def of(cls, system: EnclosedSpace, y: Ball, w: Ball, index: int, **more: Any) -> Self:
        """By the statuses that may hold within balls; what vanishes by those that hold for certain is put to 0."""
        p = len(system.tau)
        touch = w.mid[:p] + w.rad[:p] >= 0
        loose = y.mid[:p] - y.rad[:p] <= 0
        w.mid[:p], w.rad[:p] = np.where(loose, w.mid[:p], 0.0), np.where(loose, w.rad[:p], 0.0)
        stick, slip = touch.copy(), touch.copy()
        for i, places in enumerate(system.tau):
            t = places[places >= 0]
            if not len(t):
                continue
            scale = system.unit[t] * system.disc_scale[i]
            tau = upper_norm((np.abs(y.mid[t]) + y.rad[t]) * scale * SAFE + TINY)
            if tau < (y.mid[i] - y.rad[i]) * system.disc_scale[i] / SAFE:
                slip[i] = False
                w.mid[t], w.rad[t] = 0.0, 0.0
            stick[i] &= bool(np.all(np.abs(w.mid[t]) <= w.rad[t]))
        return cls(y, w, loose, stick, slip, index, **more)


def displacements(system: EnclosedSpace, y: Ball) -> Ball:
    """w = g - S y."""
    return Ball(system.g, system.g_rad) - (Ball(system.S, system.S_rad) @ y[:, None])[:, 0]


class OnlySolution(LooseSolution):
    """The one solution of a problem."""


def only_solution_in_space(
    system: EnclosedSpace, numbers: Floats, normal: Floats, errors: float = 1.0
) -> OnlySolution | None:
    """The only solution near a point, or None where that is not proven.

    Parameters
    ----------
    system : EnclosedSpace
    numbers : see ``SpaceWeights.of``
    normal : (p,) array, lambda_n of the point, scaled; what is negative counts as 0
    errors : what is not known of theta counts as often: 1 proves, a writer of proofs takes more, so that a checker,
        which rounds otherwise, comes to the same answer

    Raises
    ------
    NotEnclosedError
        S is not proven positive definite.
    """
    with np.errstate(all="ignore"):
        form = _Form.of(system, numbers)
        return None if form is None else form.enclosed(normal, errors)


def only_root(system: EnclosedSpace, numbers: Floats, codes: Sequence[int], errors: float = 1.0) -> SpaceRoot | None:
    """The regular root of a leaf, if it is proven that it has one and that there is no other solution at all.

    Parameters and errors as for ``only_solution_in_space``; ``codes`` are those of the leaf.
    """
    if not is_complete(system, codes):
        return None
    with np.errstate(all="ignore"):
        form = _Form.of(system, numbers)
        root = None if form is None else settle(system, codes)
        # the degree of a problem is +1
        if form is None or not isinstance(root, SpaceRoot) or root.index != 1:
            return None
        return root if form.serves(root.y, root.w, errors) else None


def lone_root(
    system: EnclosedSpace, codes: Sequence[int], numbers: Floats, leaf: Sequence[int], errors: float = 1.0
) -> SpaceRoot | None:
    """The regular root of a leaf, if it is proven that no other solution has the statuses of an assignment.

    Parameters
    ----------
    system : EnclosedSpace
    codes : (partial) status codes of the assignment; a sector counts as contact
    numbers, errors : as for ``only_solution_in_space``
    leaf : codes of the leaf, whose statuses the assignment allows

    Raises
    ------
    NotEnclosedError
        S is not proven positive definite.
    """
    if not is_complete(system, leaf) or not all(map(_allows, codes, leaf)):
        return None
    with np.errstate(all="ignore"):
        root = settle(system, leaf)
        if not isinstance(root, SpaceRoot):
            return None
        forms = (_Form.of(system, numbers, equations(system, codes, weight)) for weight in EQUATION_WEIGHTS)
        served = any(form is not None and form.serves(root.y, root.w, errors) for form in forms)
        return root if served else None


def _allows(code: int, final: int) -> bool:
    if code == UNDECIDED:
        return True
    if code == CONTACT or code > SECTORS:
        return final != OPEN
    return final == code


def equations(system: EnclosedSpace, codes: Sequence[int], weight: float) -> Ball:
    """Rows a with a d = 0 for the difference d of two solutions with these statuses, as balls, each with a weight.

    d is zero at open nodes, S d in the normal direction of nodes in contact, and in both others where nodes stick.
    """
    held = list[int]()
    separate = list[int]()
    for i, (code, tau) in enumerate(zip(codes, system.tau.tolist(), strict=True)):
        own = [t for t in tau if t >= 0]
        if code == OPEN:
            separate += [i, *own]
        elif code != UNDECIDED:
            held += [i, *own] if code == STICK else [i]
    # any numbers are weights
    weight = float(np.sqrt(weight * np.max(np.abs(system.S))))
    factor = weight / np.linalg.norm(system.S[held], axis=1, keepdims=True)
    rows = Ball(system.S[held], system.S_rad[held]) * Ball.exact(factor)
    return Ball.joined(rows, Ball.exact(weight * np.eye(len(system.g))[separate]))


def is_complete(system: EnclosedSpace, codes: Sequence[int]) -> bool:
    """True if every node has a final code that it can have."""
    tangents = np.sum(system.tau >= 0, axis=1).tolist()
    return len(codes) == len(tangents) and all(map(_is_final, codes, tangents))


def _is_final(code: int, tangents: int) -> bool:
    if tangents == 2 and code > SECTORS:
        return is_sector(code - SECTORS) and level_of(code - SECTORS) <= DEEPEST + 1
    return code in ((OPEN, FRICTIONLESS), (OPEN, STICK, SLIP_PLUS, SLIP_MINUS), (OPEN, STICK))[tangents]


@dataclass(frozen=True)
class SpaceWeights:
    """The numbers of the form of theory, (12.7), node by node.

    Where there is no tau, components are 0.

    Attributes
    ----------
    mu, kappa, wide : (p,) arrays
        ``wide`` is positive where the form serves any theta.
    nu, theta : (p, 2) arrays
    off : (p,) array
        theta stands for one that is no farther away: where ``whole``, for that of length one.
    whole : (p,) bool array
    """

    mu: Floats
    kappa: Floats
    wide: Floats
    nu: Floats
    theta: Floats
    off: Floats
    whole: Flags

    @classmethod
    def of(cls, system: EnclosedSpace, numbers: Floats) -> SpaceWeights | None:
        """From one array: mu, kappa and wide of all nodes, then nu and theta of all tau, in the order of y.

        mu and kappa are positive, wide is not negative, |nu| <= mu, |theta| <= 1, and theta = 0 where wide is positive.
        None where this is not so.
        """
        p, m = len(system.tau), len(system.g)
        if numbers.shape != (p + 2 * m,) or not np.all(np.isfinite(numbers)):
            return None
        (mu, kappa, wide), pairs = numbers[: 3 * p].reshape(3, p), numbers[3 * p :].reshape(2, m - p)
        place = np.where(system.tau >= 0, system.tau - p, m - p)
        nu, theta = (np.append(pair, 0.0)[place] for pair in pairs)
        square = np.sum(theta * theta, axis=1)
        whole = np.abs(square - 1.0) < _UNIT_LENGTH
        wrong = (mu <= 0) | (kappa <= 0) | (wide < 0) | (upper_norm(nu, axis=1) > mu)
        wrong |= ~whole & (square > 1.0 - _UNIT_LENGTH)
        wrong |= (wide > 0) & (np.any(theta != 0, axis=1) | np.all(system.tau < 0, axis=1))
        # | |theta| - 1 | <= | |theta|^2 - 1 |
        off = np.where(whole, (np.abs(square - 1.0) + 8 * UNIT) * SAFE, 0.0)
        return None if np.any(wrong) else cls(mu, kappa, wide, nu, theta, off, whole)

    def turn(self, system: EnclosedSpace) -> Ball:
        """theta over the units of the tau, of shape (p, 2), with that of length one for which it stands."""
        # units are powers of two: what is rounded is less than TINY
        unit = np.where(system.tau >= 0, system.unit[system.tau], 1.0)
        turn = Ball(self.theta / unit, self.off[:, None] / unit * SAFE + TINY)
        known = (system.tau < 0) | ((self.theta == 0) & (self.off == 0)[:, None])
        return Ball(turn.mid, np.where(known, 0.0, turn.rad))

    def push(self, system: EnclosedSpace) -> Floats:
        """nu times the units of the tau, of shape (p, 2)."""
        return np.asarray(self.nu * np.where(system.tau >= 0, system.unit[system.tau], 1.0))

    def gap_serves(self, system: EnclosedSpace, i: int, w: Ball) -> bool:
        """True if theta of a node without load serves for all w in a ball, by its gap (theory, (12.6))."""
        places = system.tau[i]
        t, theta = places[places >= 0], self.theta[i][places >= 0]
        gap = -float(w.mid[i] + w.rad[i]) / SAFE
        if not gap > 0:
            return False
        unit = system.unit[t]
        v = Ball(w.mid[t] / unit, w.rad[t] / unit * SAFE + TINY)
        slip = float(upper_norm(v.size)) - float(theta @ v.mid) + float(np.abs(theta) @ v.rad)
        slip += 32 * UNIT * float(np.sum(v.size)) + float(self.off[i] * np.sum(v.size))
        room = (self.mu[i] - float(upper_norm(self.nu[i])) * SAFE) / SAFE
        return bool(room * gap / SAFE >= self.kappa[i] * slip * SAFE * SAFE + TINY)

    def off_at(self, system: EnclosedSpace, i: int, y: Ball, w: Ball) -> float:
        """Largest distance of theta from one that serves a solution within a node's balls; infinite if that is open."""
        places = system.tau[i]
        t, theta = places[places >= 0], self.theta[i][places >= 0]
        if not len(t) or self.wide[i] > 0:
            return 0.0
        if w.mid[i] + w.rad[i] < 0 and self.gap_serves(system, i, w):
            return 0.0
        off, unit = np.inf, system.unit[t]
        scale = system.slip_scale[i] / unit
        v, v_rad = w.mid[t] * scale, float(upper_norm(w.rad[t] * scale * SAFE + TINY))
        length = float(np.linalg.norm(v))
        if length * (1.0 - 32 * UNIT) > v_rad * SAFE:
            # it slides, in a direction that is off by 2 v_rad / length at most
            apart = np.linalg.norm(v / length - theta) + (2.0 * v_rad / length if len(t) > 1 else 0.0)
            off = float(apart * SAFE + 32 * UNIT)
        low = float(y.mid[i] - y.rad[i]) / SAFE
        if low > 0:
            # |tau / lambda_n - theta| = |tau - theta lambda_n| / lambda_n
            scale, most = unit * system.disc_scale[i], system.disc_scale[i]
            tau, n = Ball(y.mid[t] * scale, y.rad[t] * scale * SAFE + TINY), Ball(y.mid[i] * most, y.rad[i] * most)
            apart = upper_norm((tau - Ball.exact(theta) * n).size + TINY) / (low * most)
            off = min(off, float(apart * SAFE * SAFE))
        return off


def moderate_units(unit: Floats) -> bool:
    """True if nothing underflows with these units of tau."""
    return bool(np.max(np.maximum(unit, 1.0 / unit)) <= LARGEST_UNIT)


def in_range(system: EnclosedSpace) -> bool:
    """True if nothing underflows with units of tau, and the discs have the radius one."""
    discs = system.discs
    return moderate_units(system.unit) and bool(np.all((discs.mid == 1.0) & (discs.rad == 0)))


@dataclass(frozen=True)
class _Form:
    """Q of theory, (12.7), and what it proves; in the units of FrictionUnits.

    Attributes
    ----------
    least : float
        Positive lower bound of the eigenvalues of Q, for every theta that ``numbers`` stand for.
    turn : Ball of shape (p, 2)
        theta over the unit of the tau.
    push : (p, 2) array
        nu times that unit.
    held : rows that are held at zero
    """

    system: EnclosedSpace
    numbers: SpaceWeights
    turn: Ball
    push: Floats
    held: Ball | None
    least: float

    @classmethod
    def of(cls, system: EnclosedSpace, values: Floats, held: Ball | None = None) -> _Form | None:
        """None where Q is not proven definite, or not with the squares of the rows that are held at zero."""
        numbers = SpaceWeights.of(system, values)
        if numbers is None or not system.smallest_eigenvalue > 0:
            return None
        if not in_range(system):
            return None
        form = cls(system, numbers, numbers.turn(system), numbers.push(system), held, 0.0)
        least = form.smallest(np.zeros(len(system.tau)), np.zeros(len(system.tau)))
        return replace(form, least=least) if least > 0 else None

    def smallest(self, off: Floats, lost: Floats) -> float:
        """Lower bound of the eigenvalues of Q less what is lost where theta is off, at most 0 where none is positive.

        Where theta is not off ``lost`` is 0; elsewhere any positive numbers are right.
        """
        numbers, wide = self.numbers, self.numbers.wide > 0
        off, lost = np.where(wide, 1.0, off), np.where(wide, numbers.wide, lost)
        return least_eigenvalue(self.system, (numbers.mu, numbers.kappa), self.turn, self.push, (off, lost), self.held)

    # -- enclosure -------------------------------------------------------------------------------------------------

    def enclosed(self, normal: Floats, errors: float) -> OnlySolution | None:
        """The only solution by its distance from a point, None where it is not proven to be the only one."""
        tau, p = self.system.tau, len(self.system.tau)
        n = np.maximum(normal, 0.0)
        if n.shape != (p,) or not np.all(np.isfinite(n)):
            return None
        y = Ball(np.zeros(len(self.system.g)), np.zeros(len(self.system.g)))
        y.mid[:p] = n
        for k in range(2):
            has = (tau[:, k] >= 0) & (n > 0)
            part = Ball.exact(n[has]) * self.turn[has, k]
            y.mid[tau[has, k]], y.rad[tau[has, k]] = part.mid, part.rad
        reach = self._moved(self._change(n, displacements(self.system, y))) / self.least * SAFE
        if not np.isfinite(reach):
            return None
        y = Ball(y.mid, (y.rad + reach) * SAFE)
        w = displacements(self.system, y)
        # open at every solution
        for i in np.flatnonzero((n == 0) & (w.mid[:p] + w.rad[:p] < 0)):
            y.rad[[i, *tau[i][tau[i] >= 0]]] = 0.0
        w = displacements(self.system, y)
        return OnlySolution.of(self.system, y, w, 1) if self.serves(y, w, errors) else None

    def _change(self, n: Floats, w: Ball) -> Floats:
        """Bound of the change of the load, row by row, that makes a point with these lambda_n a solution."""
        system, numbers, p = self.system, self.numbers, len(n)
        change = w.size.copy()
        apart = n == 0
        change[:p][apart] = np.maximum(w.mid[:p] + w.rad[:p], 0.0)[apart] * SAFE
        for i, places in enumerate(system.tau):
            t = places[places >= 0]
            if numbers.whole[i]:
                # v along theta
                unit, theta = system.unit[t], self.turn[i][places >= 0]
                along = max(float(numbers.theta[i][places >= 0] @ (w.mid[t] / unit)), 0.0)
                change[t] = (w[t] - theta * Ball.exact(along * unit * unit)).size
            elif apart[i] and numbers.gap_serves(system, i, w):
                change[t] = 0.0
        return change

    def _moved(self, change: Floats) -> float:
        """Upper bound of ||D'delta||, |delta| <= change."""
        numbers, tau, p = self.numbers, self.system.tau, len(self.system.tau)
        moved = np.zeros_like(change)
        moved[:p] = numbers.mu * change[:p]
        for k in range(2):
            has = tau[:, k] >= 0
            t, kappa = tau[has, k], numbers.kappa[has]
            moved[:p][has] += kappa * self.turn.size[has, k] * change[t]
            moved[t] = np.abs(self.push[has, k]) * change[:p][has] + kappa * change[t]
        return float(upper_norm(moved * SAFE + TINY) * SAFE)

    # -- uniqueness ------------------------------------------------------------------------------------------------

    def serves(self, y: Ball, w: Ball, errors: float) -> bool:
        """True if any solution within these balls is the only one, given that all lie there or that it exists."""
        numbers, system = self.numbers, self.system
        off = np.array([numbers.off_at(system, i, y, w) for i in range(len(system.tau))])
        lost = numbers.kappa * off * slip_sizes(system)
        if not np.all(np.isfinite(lost)):
            return False
        if self.least > errors * upper_norm(lost * SAFE + TINY) * SAFE:
            return True
        # node by node
        apart = off > 0
        return self.smallest(np.where(apart, errors * off * SAFE, 0.0), np.where(apart, lost + TINY, 0.0)) > 0


def slip_sizes(system: EnclosedSpace) -> Floats:
    """Upper bounds of the norms of the rows of S that give v, node by node, (p,)."""
    found = np.zeros(system.tau.shape)
    size = (np.abs(system.S) + system.S_rad) * SAFE
    for k in range(2):
        has = system.tau[:, k] >= 0
        t = system.tau[has, k]
        found[has, k] = upper_norm(size[t], axis=1) / system.unit[t] * SAFE
    return np.asarray(upper_norm(found, axis=1))


def least_eigenvalue(
    system: EnclosedSpace,
    factors: tuple[Floats, Floats],
    turn: Ball,
    push: Floats,
    rest: tuple[Floats, Floats],
    held: Ball | None = None,
) -> float:
    """Lower bound of the smallest eigenvalue of Q, less what is lost, plus held'held; at most 0 if none is positive.

    D d has mu d_n + push . d_tau for lambda_n, and kappa (d_tau - turn d_n) for tau (theory, (12.7)).

    Parameters
    ----------
    system : EnclosedSpace
    factors : mu and kappa, (p,) arrays
    turn, push : Ball and array of shape (p, 2)
        Over the unit of the tau, and times that unit.
    rest : (off, lost), (p,) arrays
        How far ``turn``, times the unit, may be off, and what is subtracted for this, theory, (12.8): where ``off`` is
        positive any positive ``lost`` is right, elsewhere both are 0.
    held : rows, as balls, that are zero on the subspace of which Q is asked
    """
    tau, p, (mu, kappas), (off, wide) = system.tau, len(system.tau), factors, rest
    unit = np.where(tau >= 0, system.unit[tau], 1.0)
    S, form = Ball(system.S, system.S_rad), weighted(system, mu, kappas, turn, push)
    spread = Ball.exact(np.zeros_like(S.mid))
    for k in range(2):
        has = np.flatnonzero(tau[:, k] >= 0)
        t, kappa = tau[has, k], kappas[has]
        used = np.flatnonzero(wide[has] > 0)
        # weights at least kappa off / sqrt(s), for any rounding
        weight = kappa[used] * off[has[used]] / np.sqrt(wide[has[used]]) / unit[has[used], k]
        rows = S[t[used]] * Ball.exact((weight * SAFE + TINY)[:, None])
        spread = spread + Ball(rows.mid.T, rows.rad.T) @ rows
    Q = form - Ball(0.5 * spread.mid, 0.5 * spread.rad)
    if held is not None:
        Q = Q + Ball(held.mid.T, held.rad.T) @ held
    normal = np.arange(p)
    Q.mid[normal, normal] -= 0.5 * wide
    Q.rad[normal, normal] += 2 * UNIT * (np.abs(Q.mid[normal, normal]) + wide)
    mid = 0.5 * (Q.mid + Q.mid.T)
    # the symmetric part of the form lies in the mean of both triangles
    rad = (np.maximum(Q.rad, Q.rad.T) + 4 * UNIT * np.abs(mid)) * SAFE
    if not (np.all(np.isfinite(mid)) and np.all(np.isfinite(rad))):
        return 0.0
    return float((dense_eigenvalue_bound(mid) - float(upper_norm(rad))) / SAFE)


def weighted(system: EnclosedSpace, mu: Floats, kappa: Floats, turn: Ball, push: Floats) -> Ball:
    """D'S, (m, m), for multipliers as of ``least_eigenvalue``."""
    tau, p, S = system.tau, len(system.tau), Ball(system.S, system.S_rad)
    form = Ball(S.mid.copy(), S.rad.copy())
    along = S[:p] * Ball.exact(mu[:, None])
    form.mid[:p], form.rad[:p] = along.mid, along.rad
    for k in range(2):
        has = np.flatnonzero(tau[:, k] >= 0)
        t, factor = tau[has, k], kappa[has]
        turned = form[has] - S[t] * (turn[has, k] * Ball.exact(factor))[:, None]
        pushed = S[t] * Ball.exact(factor[:, None]) + S[has] * Ball(push[has, k], np.full(len(has), TINY))[:, None]
        for rows, part in ((has, turned), (t, pushed)):
            form.mid[rows], form.rad[rows] = part.mid, part.rad
    return form
