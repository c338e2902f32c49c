"""One solution by one certificate, and one in a box, for space_judge, in balls of many digits.

Numbers in brackets are sections of docs/proof_format.md; the mathematics is in theory, sections 12.6 and 12.7.
"""

from flint import arb, arb_mat
from rational_forms import need
from space_judge_boxes import NaturalMap
from space_judge_data import Undecided, column, is_definite, length_of
from space_judge_leaves import Singular

_HEAVY = arb(2) ** 120
_ZERO = arb(2) ** -110


class Weights:
    """[6.5] The numbers of an "a" leaf, by nodes."""

    def __init__(self, system, numbers):
        p, tau = len(system.tau), system.tau
        self.system = system
        self.mu, self.kappa, self.s = (numbers[k * p : (k + 1) * p] for k in range(3))
        vectors = numbers[3 * p :], numbers[2 * p + system.m :]
        self.nu, self.theta = ([[part[place - p] for place in places] for places in tau] for part in vectors)
        for i, places in enumerate(tau):
            need(self.mu[i] > 0 and self.kappa[i] > 0 and self.s[i] >= 0, "mu, kappa or s has the wrong sign")
            need(places or self.s[i].is_zero(), "s at a node without tau")
            need(_square(self.nu[i]) <= self.mu[i] * self.mu[i], "nu is longer than mu")
            length = _square(self.theta[i])
            if abs(length - 1) < arb(2) ** -40:
                self.theta[i] = [x / length.sqrt() for x in self.theta[i]]
            else:
                need(length <= 1 - arb(2) ** -40, "theta is longer than one")
            need(self.s[i].is_zero() or length.is_zero(), "theta where there is s")

    def map(self, theta):
        """D, by rows."""
        m = self.system.m
        D = arb_mat(m, m)
        for i, places in enumerate(self.system.tau):
            D[i, i] = self.mu[i]
            for place, nu, t in zip(places, self.nu[i], theta[i], strict=True):
                D[i, place], D[place, place], D[place, i] = nu, self.kappa[i], -self.kappa[i] * t
        return D

    def form(self, theta, codes=None):
        """The form of the test, with the squares of the equations of codes."""
        S, rows = self.system.S, self.system.S.tolist()
        Q = self.map(theta).transpose() * S
        Q = (Q + Q.transpose()) / arb(2)
        for i, places in enumerate(self.system.tau):
            if self.s[i] > 0:
                Q[i, i] -= self.s[i] / 2
                for place in places:
                    Q -= square(rows[place]) * (self.kappa[i] ** 2 / self.s[i] / 2)
        weight = _HEAVY * max(abs(x).upper() for x in Q.entries())
        for row in equations(self.system, codes or ()):
            Q += square(row) * weight
        return Q


def _square(values):
    return sum((x * x for x in values), arb(0))


def square(row):
    return column(row) * arb_mat([row])


def equations(system, codes):
    """Unit rows of what vanishes of d at nodes of these codes (sectors and slip counting as contact)."""
    rows, found = system.S.tolist(), []
    for i, code in enumerate(codes):
        if code == 0:
            found += [[arb(int(k == place)) for k in range(system.m)] for place in (i, *system.tau[i])]
        elif code != 6:
            found += [rows[place] for place in (i, *(system.tau[i] if code == 1 else ()))]
    return [[x / length_of(row) for x in row] for row in found]


def serving(weights, y, w):
    """theta0 of a solution that is known in balls, by nodes."""
    found = []
    for i, places in enumerate(weights.system.tau):
        tau, v = ([part[place] for place in places] for part in (y, w))
        theta = weights.theta[i]
        if weights.s[i] > 0 or not places:
            found.append([arb(0)] * len(places))
        elif y[i] > 0:
            found.append([x / y[i] for x in tau])
        elif w[i] < 0 and _serves(weights, i, theta, w[i], v):
            found.append(theta)
        else:
            length = length_of(v)
            if not length > 0:
                raise Undecided("no theta is known to serve the solution")
            found.append([x / length for x in v])
    return found


def _serves(weights, i, theta, normal, v):
    room = (weights.mu[i] - length_of(weights.nu[i])) * -normal
    cost = weights.kappa[i] * (length_of(v) - sum((a * b for a, b in zip(theta, v, strict=True)), arb(0)))
    return room >= cost or (cost - room).upper() <= arb(2) ** -200


def natural_map(system, steps=None):
    """That of a problem at one alpha; g is g0."""
    inverse = system.inverse.tolist()
    if steps is None:
        steps = [(inverse[i][i] / system.S[i, i]).sqrt().mid() for i in range(system.m)]
        for places in system.tau:
            for place in places:
                steps[place] = steps[places[0]]
    nodes = list(enumerate(system.tau))
    return NaturalMap(system.S, system.g0, system.g1, nodes, [(a, arb(0)) for a, _ in system.discs], steps, arb(0))


def only_solution(weights, start):
    """[6.5] y and w of the only solution, near a point, where its statuses are not said (theory, (6.10))."""
    system = weights.system
    natural = natural_map(system)
    try:
        zeta = natural.zero_near(natural.place_of(start, arb(0)))
    except Singular as error:
        raise Undecided("Newton's method finds no solution") from error
    raw = [x.mid() for x in natural.forces(zeta)]
    moves = natural.moves(raw, arb(0))
    small = _ZERO * (1 + max(abs(x).upper() for x in raw))
    y, w, theta = list(raw), list(moves), []
    for i, places in enumerate(system.tau):
        tau, v = ([part[place] for place in places] for part in (raw, moves))
        if raw[i] > small:
            w[i] = arb(0)
            slips = length_of(tau) > raw[i] - small * raw[i]
            length = length_of(tau)
            theta.append([x / (length if slips else raw[i]) for x in tau])
            c = sum((a * b for a, b in zip(theta[i], v, strict=True)), arb(0)).max(arb(0))
            for place, t in zip(places, theta[i], strict=True):
                y[place], w[place] = raw[i] * t, c * t if slips else arb(0)
            continue
        y[i], w[i] = arb(0), moves[i].min(arb(0))
        rests = weights.s[i] > 0 and length_of(v) < small
        serves = w[i] < 0 and _serves(weights, i, weights.theta[i], w[i], v)
        theta.append(weights.theta[i] if serves or rests or not places else [x / length_of(v) for x in v])
        for place in places:
            y[place], w[place] = arb(0), arb(0) if rests else moves[place]
    at = (column(system.g0) - system.S * column(y)).entries()
    delta = column([a - b for a, b in zip(w, at, strict=True)])
    used = [[arb(0)] * len(t) if s > 0 else t for t, s in zip(theta, weights.s, strict=True)]
    Q = weights.form(used)
    need(is_definite(Q), "the form is not definite")
    size = length_of((weights.map(theta).transpose() * delta).entries()) * Q.inv().trace()
    y = [a + arb(0, size.upper()) for a in y]
    moved = arb(0, (size * length_of(system.S.entries())).upper())
    return y, [a + moved for a in w]


def boxed_solution(system, centre, radius, rho):
    """[6.6] The map, the box's centre and the only solution in the box of an "l" leaf, with its index."""
    natural = natural_map(system, rho)
    middle = natural.place_of(centre, arb(0))
    try:
        index = natural.at_most_one(middle, radius)
        point = natural.zero_near(middle)
        _, z, around, _ = natural.zeros_around(point)
    except Singular as error:
        raise Undecided("the box is not shown to hold one solution") from error
    zeta = [a + arb(0, b) for a, b in zip(point, around, strict=True)]
    need(
        all(abs(a - b) < c for a, b, c in zip(zeta, middle, radius, strict=True)), "the box does not hold the solution"
    )
    y = natural.forces(zeta)
    for i, status in enumerate(natural.statuses(z[:-1], arb(0))):
        for place in (i, *system.tau[i]) if status == "open" else ():
            y[place] = arb(0)
    return natural, middle, y, index
