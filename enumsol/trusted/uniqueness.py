"""The trusted test of closed subtrees: one reduced solution where some contact nodes are free (theory, section 6.11).

Some nodes have a status, others are free: they may have any; and others slide: they are open or slip in one direction.
Eliminating the equations of the fixed nodes leaves the reduced problem of the others, w = h - R x. Where its matrix
passes a test of definiteness it has exactly one solution, which is enclosed without knowing the statuses of its nodes.

A root that is alone below an assignment (theory, section 6.13) is the verified solution of a selection, so that no
existence has to be shown; that it is the only one follows from the form of theory, (6.9), with the squares of what
vanishes below the assignment, or cannot be large there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, determinant_sign, gamma, solution
from enumsol.trusted.at_alpha import ClosedSolution, VerifiedSelection, solve_selection
from enumsol.trusted.exclusion import exclusion_margin
from enumsol.trusted.selection import Selection, Unknowns, row_values
from enumsol.trusted.status_rows import (
    BACKWARD,
    CONDITIONS,
    CONTACT,
    FORWARD,
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
from enumsol.trusted.uniqueness_forms import Multipliers, UniqueForm

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.support.array_types import Codes, Floats, Indices, Mask
    from enumsol.trusted.selection import Unknowns
    from enumsol.trusted.uniqueness_forms import UniqueForm


#: Codes of nodes that are open or slip in one direction.
SLIDES = (FORWARD, BACKWARD)


@dataclass(frozen=True)
class Weights:
    """The numbers of the form of theory, (6.9).

    Attributes
    ----------
    mu : one number per node
    kappa, nu, share, tau : one number for every free node with friction
    slope : Ball
        theta there.
    friction : Ball
        F there.
    normal : places of lambda_n of free nodes with friction
    """

    mu: Floats
    kappa: Floats
    nu: Floats
    share: Floats
    tau: Floats
    slope: Ball
    friction: Ball
    normal: Indices

    @classmethod
    def of(cls, part: Components, numbers: Floats) -> Weights | None:
        """From one array: mu of all nodes, then kappa, nu, theta / F and tau of the free ones with friction.

        mu and kappa are positive, |nu| F <= mu, |theta| <= F; theta = +-F at nodes that slip in the selection; tau is
        not negative, and theta = 0 where it is positive. None where this is not so.
        """
        system, m, normal = part.system, len(part.at.nodes), part.at.normal
        if len(numbers) != m + 4 * len(normal) or not np.all(np.isfinite(numbers)):
            return None
        mu, (kappa, nu, share, tau) = numbers[:m], numbers[m:].reshape(4, -1)
        nodes = part.at.nodes[normal]
        friction = system.balls[2][nodes]
        sides = slip_directions(part.selection)[nodes]
        wrong = (np.abs(share) > 1) | ((sides != 0) & (share != sides)) | ((tau > 0) & (share != 0))
        wrong |= np.abs(nu) * friction.size * SAFE + TINY > mu[normal]
        if np.any(wrong) or np.any(mu <= 0) or np.any(kappa <= 0) or np.any(tau < 0):
            return None
        turned = friction * Ball.exact(share)
        whole = np.abs(share) == 1
        slope = Ball(np.where(whole, share * friction.mid, turned.mid), np.where(whole, friction.rad, turned.rad))
        return cls(mu, kappa, nu, share, tau, slope, friction, normal)

    def at(self, part: Components, point: Sequence[Any], w: Sequence[Any]) -> Weights | None:
        """With theta = lambda_t / lambda_n where lambda_n > 0 at a rational solution; None if they do not serve it."""
        p, slope = part.system.p, self.slope.copy()
        for k, i in enumerate(self.normal):
            node = int(part.at.nodes[i])
            if self.tau[k] > 0:
                continue
            if point[node] != 0:
                ratio = point[p + node] / point[node]
                slope.mid[k] = int(ratio.p) / int(ratio.q)
                slope.rad[k] = 2 * UNIT * abs(slope.mid[k]) + TINY
            elif self.beyond(k, *_bounds(w[node], w[p + node])) > 0:
                return None
        return replace(self, slope=slope)

    def beside(self, x: Ball, tangential: Indices) -> Weights:
        """With theta = lambda_t / lambda_n at the middle of a solution's ball where it is not F or -F, nor tau > 0."""
        n, t = x.mid[self.normal], x.mid[tangential]
        told = (self.tau == 0) & (np.abs(self.share) < 1) & (n > 0)
        ratio = np.where(told, t / np.where(told, n, 1.0), self.slope.mid)
        # off says how far that is from theta
        return replace(self, slope=Ball(ratio, np.where(told, 0.0, self.slope.rad)))

    def beyond(self, k: int, gap: float, up: float, down: float) -> float:
        """Excess of w_t of an open node over what the numbers allow, if -w_n >= gap and -down <= w_t <= up."""
        excess = 0.0
        for side, size in ((1.0, up), (-1.0, down)):
            left = (1.0 - side * self.share[k]) * self.kappa[k] * self.friction.size[k] * SAFE
            if left > 0 and size > 0:
                normal = self.mu[self.normal[k]] + side * self.nu[k] * self.friction.mid[k]
                normal -= (abs(self.nu[k]) * self.friction.rad[k] + 4 * UNIT * self.mu[self.normal[k]]) * SAFE
                excess = max(excess, size - max(normal, 0.0) * gap / left / SAFE)
        return float(excess * SAFE)

    def off(self, k: int, n: Ball, t: Ball, w_n: Ball, w_t: Ball) -> float:
        """Distance of theta at most from one that serves a solution within a node's balls; infinite if that is open."""
        share, F = float(self.share[k]), self.friction[k]
        slips = np.sign(w_t.mid) if abs(w_t.mid) > w_t.rad else 0.0
        if self.tau[k] > 0 or (slips and share == slips):
            return 0.0
        if w_n.mid + w_n.rad < 0:
            up, down = (max(float(side), 0.0) * SAFE for side in (w_t.mid + w_t.rad, w_t.rad - w_t.mid))
            return np.inf if self.beyond(k, -float(w_n.mid + w_n.rad) / SAFE, up, down) > 0 else 0.0
        low = float(n.mid - n.rad) / SAFE
        if low <= 0:
            return np.inf
        slope = self.slope[k]
        if slips:
            return float((abs(slips * F.mid - slope.mid) + F.rad + slope.rad) * SAFE)
        # |lambda_t / lambda_n - theta| = |lambda_t - theta lambda_n| / lambda_n
        apart = t - slope * n
        return float(apart.size / low * SAFE)

    def distances(self, at: Unknowns, x: Ball, w: Ball) -> Floats:
        """Distances of theta at most from one that serves a solution within balls, (m,); infinite where open."""
        found, t = np.zeros(len(self.mu)), at.tangential
        for k, n in enumerate(self.normal):
            found[n] = self.off(k, x[n], x[t[n]], w[n], w[t[n]])
        return found

    def multipliers(self, at: Unknowns) -> Multipliers:
        """D of all nodes."""
        unit = np.ones((len(self.mu), 1))
        turn, push, kappa = Ball.exact(0.0 * unit), 0.0 * unit, np.ones(len(self.mu))
        turn[self.normal, 0], push[self.normal, 0], kappa[self.normal] = self.slope, self.nu, self.kappa
        return Multipliers(at.tangential[:, None], self.mu, kappa, turn, Ball.exact(push), unit)

    def form(self, part: Components, further: Ball | None = None) -> UniqueForm | None:
        """Q of theory, (6.9), of some components; None where it is not proven definite.

        ``further``: rows whose squares are added to the form.
        """
        off, lost = np.zeros(len(self.mu)), np.zeros(len(self.mu))
        lost[self.normal] = self.tau
        off[self.normal] = np.where(self.tau > 0, self.friction.size, 0.0)
        return UniqueForm.of(part.R, self.multipliers(part.at), off, lost, further)


def _bounds(w_n: Any, w_t: Any) -> tuple[float, float, float]:
    """-w_n >= 0 from below, and from above w_t and -w_t where they are positive, of rationals."""
    try:
        gap, slip = -int(w_n.p) / int(w_n.q), int(w_t.p) / int(w_t.q)
    except OverflowError:
        return 0.0, np.inf, np.inf
    size = abs(slip) * SAFE + TINY
    return max(gap / SAFE - TINY, 0.0), size * bool(w_t > 0), size * bool(w_t < 0)


@dataclass(frozen=True)
class Components:
    """Components x of lambda and those of w that belong to them, which change by -R d where x changes by d.

    Attributes
    ----------
    system : EnclosedSystem
    selection : status codes; those of the nodes below name the slip at a solution
    at : Unknowns
        Which components.
    R : Ball
    """

    system: EnclosedSystem
    selection: tuple[int, ...]
    at: Unknowns
    R: Ball

    def point(self, force: Floats, numbers: Weights) -> Ball:
        """Forces in the cones, with the statuses of the selection, near the given ones."""
        mid = np.array([0.0 if self.selection[i] == OPEN else max(float(force[i]), 0.0) for i in self.at.nodes])
        turned = Ball.exact(mid[self.at.tangential >= 0]) * numbers.slope
        radii = np.where(mid[self.at.tangential >= 0] > 0, turned.rad, 0.0)
        return Ball(np.concatenate([mid, turned.mid]), np.concatenate([np.zeros(len(mid)), radii]))

    def distance(self, point: Floats, w: Ball, numbers: Weights) -> float:
        """Bound of the numerator of theory, (6.10), for a point that is a solution with another h."""
        size, change = w.size, np.zeros(len(self.at.places))
        up, down = np.maximum(w.high, 0.0) * SAFE, np.maximum(w.rad - w.mid, 0.0) * SAFE
        gap = np.maximum(-w.high, 0.0) / SAFE
        if not np.all(np.isfinite(size)):
            return np.inf
        for i, node in enumerate(self.at.nodes):
            code, t = self.selection[node], self.at.tangential[i]
            apart = code == OPEN or (code in SLIDES and point[i] == 0)
            change[i] = up[i] if apart else size[i]
            if t >= 0:
                slips = {STICK: size[t], SLIP_PLUS: down[t], SLIP_MINUS: up[t]}
                change[t] = numbers.beyond(t - len(self.at.nodes), gap[i], up[t], down[t]) if apart else slips[code]
        return numbers.multipliers(self.at).moved(change)


def core_of(selection: Sequence[int], free: Sequence[int]) -> Codes:
    """The selection with its free nodes undecided."""
    chosen = set(free)
    return tuple(UNDECIDED if i in chosen else code for i, code in enumerate(selection))


def closed_solution(
    system: EnclosedSystem, selection: Codes, free: Sequence[int], weights: Floats, force: Floats
) -> ClosedSolution | None:
    """The only solution of the reduced problem, or None where that is not proven.

    Parameters
    ----------
    system : EnclosedSystem
    selection : final codes, those of the free nodes only name a point near the solution; FORWARD or BACKWARD where a
        node slides
    free : ascending nodes, none of which slides
    weights : numbers of the form of theory, (6.9), as ``Weights.of`` takes them
    force : (2p,) array, lambda near the solution; only lambda_n of nodes that are free or slide is read
    """
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        reduced = Reduced.of(system, selection, free)
        numbers = None if reduced is None else Weights.of(reduced, weights)
        return None if reduced is None or numbers is None else reduced.enclosed(numbers, force)


def only_solution(
    system: EnclosedSystem,
    selection: Codes,
    free: Sequence[int],
    weights: Floats,
    point: Sequence[Any],
    w: Sequence[Any],
) -> int:
    """The determinant's sign of the fixed nodes' equations if a solution of the reduced problem is its only one.

    0 where that is not proven.

    Parameters
    ----------
    system, selection, free, weights : as for ``closed_solution``
    point, w : 2p rationals each, lambda in units of force and w in units of length
        At a solution of the reduced problem that has the statuses of the selection at the nodes that do not slide.
    """
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        reduced = Reduced.of(system, selection, free)
        numbers = None if reduced is None else Weights.of(reduced, weights)
        numbers = None if reduced is None or numbers is None else numbers.at(reduced, point, w)
        return reduced.sign if reduced is not None and numbers is not None and numbers.form(reduced) is not None else 0


def same_solution(
    one: Codes, one_possible: Sequence[frozenset[int]], other: Codes, other_possible: Sequence[frozenset[int]]
) -> bool | None:
    """True if two solutions, each the only one of its core, are the same; None where that is open.

    The solution of one core solves that of another if it has the statuses of its fixed nodes. A solution in a complete
    selection is one whose core is complete.
    """
    if any(not a & b for a, b in zip(one_possible, other_possible, strict=True)):
        return False
    for core, possible in ((one, other_possible), (other, one_possible)):
        if all(all(refines(c, code) for c in held) for code, held in zip(core, possible, strict=True)):
            return True
    return None


@dataclass(frozen=True)
class Reduced(Components):
    """w = h - R x on the nodes that are free or slide, by elimination of the fixed ones.

    Attributes
    ----------
    at : Unknowns
        Of the nodes that are free, then of those that slide.
    E, Z : Ball
        lambda = E y + P x, and y = Z (1, -x): the fixed nodes' forces for x.
    h : Ball
    """

    rows: Indices
    E: Ball
    Z: Ball
    h: Ball
    sign: int

    @classmethod
    def of(cls, system: EnclosedSystem, selection: Codes, free: Sequence[int]) -> Reduced | None:
        """None where the fixed nodes' equations are not proven regular, or a node cannot have its code."""
        chosen = set(free)
        for i, (code, F) in enumerate(zip(selection, system.F, strict=True)):
            if code not in final_codes(F > 0) and not (code in SLIDES and F > 0 and i not in chosen):
                return None
        status = np.array(core_of(selection, free), dtype=np.intp)
        slides = np.isin(status, SLIDES)
        nodes = np.concatenate([np.array(free, dtype=np.intp), np.flatnonzero(slides)])
        own = (system.F[nodes] > 0) & ~slides[nodes]
        at = Unknowns(system.p, nodes, own, slip_directions(status[nodes]))
        fixed, (S, g, F) = Selection(np.where(slides | (status == UNDECIDED), OPEN, status).tolist()), system.balls
        rows = fixed.unknown
        forms = fixed.forces(Ball.exact(np.eye(len(rows))), F)
        M = S[rows] @ forms
        sign = determinant_sign(M)
        across, places = at.columns(S, F), at.places
        above = across[rows]
        right = Ball(np.column_stack([g.mid[rows], above.mid]), np.column_stack([g.rad[rows], above.rad]))
        Z = solution(M, right) if sign else None
        if Z is None:
            return None
        moved = (S[places] @ forms) @ Z
        R, h = across[places] - moved[:, 1:], g[places] - moved[:, 0]
        return cls(system, selection, at, R, rows, forms, Z, h, sign)

    def enclosed(self, numbers: Weights, force: Floats) -> ClosedSolution | None:
        """The solution as a ball, None where it is not proven to exist and to be the only one."""
        if len(self.at.nodes) == self.system.p and not any(code in SLIDES for code in self.selection):
            # all nodes are free: where its selection holds strictly, that is closer than (6.10) if Q is hardly definite
            root = solve_selection(self.system, self.selection)
            if root is not None and root.is_root:
                # R is S and h is g: so these are x and w here, and w is closer than R times the radii of x gives it
                x, w = root.force[self.at.places], root.w[self.at.places]
                numbers = numbers.beside(x, self.at.tangential[numbers.normal])
                alone = self._alone(x, w, numbers, numbers.form(self))
                return None if alone is None else replace(alone, regular=root)
        form = numbers.form(self)
        if form is None:
            return None
        x = self.point(force, numbers)
        reach = self.distance(x.mid, self._displacements(x), numbers) / form.least * SAFE
        if not np.isfinite(reach):
            return None
        x = Ball(x.mid, (x.rad + reach) * SAFE)
        w = self._displacements(x)
        for i, node in enumerate(self.at.nodes):
            # open at every solution
            if self.selection[node] == OPEN and w.mid[i] + w.rad[i] < 0:
                x.rad[[i, self.at.tangential[i]] if self.at.tangential[i] >= 0 else i] = 0.0
        return self._alone(x, self._displacements(x), numbers, form)

    def _alone(self, x: Ball, w: Ball, numbers: Weights, form: UniqueForm | None) -> ClosedSolution | None:
        """The solution that is known to lie in a ball, if Q is definite for every theta that it may have there."""
        served = form is not None and form.serves(numbers.distances(self.at, x, w))
        return self._solution(x, w) if served else None

    def _displacements(self, x: Ball) -> Ball:
        """w of the free components."""
        return self.h - self.R @ x

    def _solution(self, x: Ball, w_free: Ball) -> ClosedSolution:
        system, p = self.system, self.system.p
        (S, g, F), at = system.balls, self.at
        force = self.E @ (self.Z[:, 0] - self.Z[:, 1:] @ x)
        free = [int(node) for node in at.nodes if self.selection[node] not in SLIDES]
        core = core_of(self.selection, free)
        status = np.array(core)
        fixed = (status != UNDECIDED) & ~np.isin(status, SLIDES)
        idle = np.concatenate([~fixed | (status == OPEN), ~fixed | (status == OPEN) | (status == FRICTIONLESS)])
        force[idle] = 0.0
        at.put(x, F, force)
        w = g - S @ force
        w[at.places], w[self.rows] = w_free, 0.0
        conditions = row_values(force, w, F)
        values, radii = conditions.mid, conditions.rad
        tests = [(values[kind, i], radii[kind, i]) for i in np.flatnonzero(fixed) for kind in CONDITIONS[core[i]][1]]
        tests += [self._slides(core[node], values[:, node], radii[:, node]) for node in at.nodes[at.side]]
        slack = Ball(*(np.array(part) for part in (zip(*tests, strict=True) if tests else ((), ()))))
        possible = tuple(
            frozenset((core[i],)) if fixed[i] else self._possible(i, values[:, i], radii[:, i]) for i in range(p)
        )
        return ClosedSolution(force, w, slack, self.sign, core=core, possible=possible)

    @staticmethod
    def _slides(code: int, values: Floats, radii: Floats) -> tuple[float, float]:
        """Condition by which a sliding node slips in its direction or is open, with its radius."""
        forward = 5 if code == FORWARD else 6
        separate, slips = (values[4], radii[4]), (values[forward], radii[forward])
        if values[4] > radii[4]:
            return separate
        loaded = values[0] > radii[0]
        return slips if loaded or slips[0] > slips[1] else (0.0, 0.0)

    def _possible(self, node: int, values: Floats, radii: Floats) -> frozenset[int]:
        """Final codes of a node that its balls do not exclude."""
        high, low = values + radii, values - radii
        return frozenset(
            code
            for code in final_codes(self.system.F[node] > 0)
            if all(low[k] <= 0 <= high[k] for k in CONDITIONS[code][0])
            and all(high[k] >= 0 for k in CONDITIONS[code][1])
        )


_TOUCHING = (STICK, SLIP_PLUS, SLIP_MINUS, FRICTIONLESS, CONTACT)


def numbers_of(codes: Sequence[int], friction: Sequence[bool]) -> tuple[Indices, Mask]:
    """The nodes that are not open in an assignment, and of these those that have a lambda_t of their own."""
    status = np.array(codes, dtype=np.intp)
    nodes = np.flatnonzero(status != OPEN)
    return nodes, np.array(friction, dtype=bool)[nodes] & np.isin(status[nodes], (STICK, CONTACT, UNDECIDED))


def lone_root(
    system: EnclosedSystem,
    codes: Sequence[int],
    selection: Sequence[int],
    weights: Floats,
    strengths: Floats,
    rows: Indices,
    values: Floats,
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
        form = numbers.form(part, _squares(part, strengths))
        return root if form is not None and form.serves(numbers.distances(part.at, x, w)) else None


def _components(system: EnclosedSystem, codes: Sequence[int], selection: Sequence[int]) -> Components:
    """lambda of the nodes that are not open, with lambda_t = +-F lambda_n put in where the assignment has that."""
    nodes, own = numbers_of(codes, (system.F > 0).tolist())
    at, (S, _, F) = Unknowns(system.p, nodes, own, slip_directions(codes)[nodes]), system.balls
    return Components(system, tuple(selection), at, at.columns(S[at.places], F))


def _squares(part: Components, strengths: Floats) -> Ball | None:
    """Rows of (S d)_n and (S d)_t, each times the root of its strength."""
    factors = np.sqrt(strengths.ravel()[part.at.places])
    used = np.flatnonzero(factors)
    return part.R[used] * Ball.exact(factors[used][:, None]) if len(used) else None


def _allowed(
    part: Components,
    codes: Sequence[int],
    numbers: Weights,
    strengths: Floats,
    root: VerifiedSelection,
    rows: Indices,
    values: Floats,
) -> bool:
    """True if the squares that do not vanish below the assignment are no more than what the form leaves out."""
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


def gaps(system: EnclosedSystem, codes: Sequence[int], rows: Indices, values: Floats) -> Floats:
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
