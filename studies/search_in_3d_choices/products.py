"""Searches in 3D that bound by the best quadratic form of a subtree in place of the energy (theory, section 12.2).

At every solution products of two rows of a node are nonnegative, or zero. Minus their sum with multipliers is a form
that is at most zero there, and stays so in all children. The best multipliers come from a semidefinite program.
"""

from __future__ import annotations

import warnings
from functools import cached_property
from time import process_time
from typing import TYPE_CHECKING

import cvxpy
import numpy as np
import scipy.linalg

from enumsol import gallery
from enumsol.model.sectors import SECTORS, direction, end_number, width_level
from enumsol.model.statuses import CONTACT, OPEN, STICK, UNDECIDED
from enumsol.relaxation.engine import EQUALITY, FEASIBILITY_TOLERANCE, PRUNE_MARGIN
from enumsol.relaxation.space_relaxation import SpaceEngine, SpaceRelaxation, imposed
from enumsol.search.certifiers.protocol import Unrecorded
from enumsol.search.nodes import Relaxations
from enumsol.search.outcome import SearchLimits
from enumsol.search.space.space_fathoming import Point
from enumsol.search.space.space_newton import Isotropic
from enumsol.search.space.space_search import SpaceCertifier, SpaceSolvers, SpaceSplitting
from enumsol.search.splitting import ImposedRows
from enumsol.search.tree import TreeSearch
from enumsol.trusted.space.leaves import distinct_roots
from enumsol.trusted.space.sector_rows import sector_row_terms
from search_in_3d.feet import FRICTION, SPRINGS, foot

if TYPE_CHECKING:
    from shared.results import Run

#: Least eigenvalue of a form relative to the energy, if the mean is one.
LEAST = 0.05
#: Decisions after which a new form is sought; None: the energy only.
CHOICES = {"energy": None, "at the root": np.inf, "every 6": 6.0, "every 3": 3.0}
WEDGES = {
    f"{'x'.join(map(str, cells))}, F = {F:g}": (cells, F)
    for cells, coefficients in (((2, 1, 2), (1.0, 2.0, 3.0)), ((1, 1, 2), (1.0, 2.0, 3.0)))
    for F in coefficients
}
SMOKE, SMOKE_NODES = {"1x1x2, F = 2": ((1, 1, 2), 2.0)}, 20
#: Products of table ``around``, besides those of the work and of lambda_n c . v.
AROUND = {
    "none": (),
    "discs": ("disc",),
    "slips across the ends": ("slips",),
    "slips and forces across the ends": ("slips", "across", "forces"),
    "slips across the ends, discs": ("slips", "disc"),
    "all": None,
}
#: Levels of the sectors around the root, 0 standing for contact.
LEVELS, SMOKE_LEVELS = (0, 2, 3, 4), (3,)


def products(system, codes, kinds=None):
    """Products of rows at a partial assignment, and what their multipliers may be; of some kinds only, or of all.

    Matrices (m + 1, m + 1) of quadratic functions of y; which of them are at least zero, others being zero; and triples
    whose first multiplier is at least the length of the other two.
    """
    size = len(system.g)
    y, w = np.eye(size + 1), np.vstack([np.hstack([-system.S, system.g[:, None]]), np.eye(size + 1)[-1:]])
    found, signed, cones = [], [], []

    def add(matrix, sign, kind=None):
        if kinds is not None and kind not in (None, *kinds):
            return None
        found.append(matrix)
        signed.append(sign)
        return len(found) - 1

    for i, code in enumerate(codes):
        if code == OPEN:
            continue
        places = system.tau[i]
        n, tau = y[i], y[places] * system.unit[places, None]
        v, disc = w[places] / system.unit[places, None], _times(n, n) - _times(tau[0], tau[0]) - _times(tau[1], tau[1])
        if code == UNDECIDED:
            for force in (n, *tau):
                add(_times(force, w[i]), False)
        if code == STICK:
            add(disc, True, "disc")
            continue
        work = _times(tau[0], v[0]) + _times(tau[1], v[1])
        add(_times(tau[0], v[1]) - _times(tau[1], v[0]), False, "turn")
        cones.append([add(work, True), *(add(-_times(n, slip), False) for slip in v)])
        add(disc, code <= SECTORS, "disc")
        if code > SECTORS:
            a, b = (np.array(direction(number)) for number in (code - SECTORS, end_number(code - SECTORS)))
            middle = (a + b) / np.linalg.norm(a + b)
            cosine = float(middle @ a)
            inner = np.array([[-a[1], a[0]], [b[1], -b[0]]])
            chord = middle @ tau - cosine * n
            for kind, one, other in (("across", tau, v), ("forces", tau, tau), ("slips", v, v)):
                add(_times(inner[0] @ one, inner[1] @ other), True, kind)
            pairs = [(n, normal @ x) for normal in inner for x in (tau, v)] + [(n, chord), (chord, middle @ v)]
            for pair in pairs:
                add(_times(*pair), True, "with lambda_n")
            add(_times(n, middle @ v) - cosine * work, True, "work")
    return np.array(found), np.array(signed), cones


def _times(a, b):
    return 0.5 * (np.outer(a, b) + np.outer(b, a))


def rows_of(system, codes):
    """Inequalities and equations of a partial assignment, rows (m + 1) on (y, 1)."""
    size, rows = len(system.g), ([], [])
    values = np.vstack([np.eye(size, size + 1), np.hstack([-system.S, system.g[:, None]])])
    for node, code in enumerate(codes):
        for row, mode in imposed(system.tau, node, code):
            places, coefficients = map(list, sector_row_terms(row, system.tau, size))
            rows[mode == EQUALITY].append((np.array(coefficients) * system.row_unit[places]) @ values[places])
    return (np.array(part).reshape(-1, size + 1) for part in rows)


def best_form(system, codes, kinds=None):
    """H, h and k of the form y'Hy - h'y + k with the largest minimum, its mean curvature being one; None: none found.

    Equations of the assignment are added with a weight that makes it convex.
    """
    matrices, signed, cones = products(system, codes, kinds)
    size = len(system.g)
    inequalities, equations = rows_of(system, codes)
    a, b = equations[:, :size], -equations[:, size]
    across, at = (scipy.linalg.null_space(a), np.linalg.lstsq(a, b)[0]) if len(b) else (np.eye(size), np.zeros(size))
    rank = across.shape[1]
    if not rank:
        return None
    # columns of the subspace in which the energy has the unit matrix
    across = across @ np.linalg.inv(np.linalg.cholesky(across.T @ system.S @ across)).T
    inside = np.zeros((size + 1, rank + 1))
    inside[:size, :rank], inside[:size, rank], inside[size, rank] = across, at, 1.0
    reduced, rows = inside.T @ matrices @ inside, inequalities @ inside
    length = np.linalg.norm(rows[:, :rank], axis=1)
    rows = rows[length > 1e-9] / length[length > 1e-9, None]
    z, u, least = cvxpy.Variable(len(matrices)), cvxpy.Variable(len(rows), nonneg=True), cvxpy.Variable()
    shape, corner = (rank + 1, rank + 1), np.zeros((rank + 1, rank + 1))
    corner[rank, rank] = 1.0
    form = cvxpy.reshape(-reduced.reshape(len(reduced), -1).T @ z, shape, order="C")
    added = np.array([_times(row, corner[rank]) for row in rows]).reshape(len(rows), -1)
    limits = [form - cvxpy.reshape(added.T @ u, shape, order="C") - least * corner >> 0]
    limits += [cvxpy.trace(form[:rank, :rank]) == rank, form[:rank, :rank] >> LEAST * np.eye(rank)]
    limits += [z[np.flatnonzero(signed)] >= 0] if np.any(signed) else []
    limits += [cvxpy.norm(z[pair]) <= z[first] for first, *pair in cones]
    try:
        with warnings.catch_warnings():
            # an inaccurate form is one, too
            warnings.simplefilter("ignore", UserWarning)
            cvxpy.Problem(cvxpy.Maximize(least), limits).solve(solver=cvxpy.CLARABEL)
    except cvxpy.SolverError:
        return None
    if z.value is None:
        return None
    values = np.where(signed, np.maximum(z.value, 0.0), z.value)
    for first, *pair in cones:
        values[first] = max(values[first], np.linalg.norm(values[pair]))
    whole = -np.tensordot(values, matrices, 1)
    H, h, k = whole[:size, :size], -2.0 * whole[:size, size], whole[size, size]
    if len(b):
        metric, weight = scipy.linalg.pinvh(a @ np.linalg.solve(system.S, a.T)), 10.0
        while not _convex(heavy := H + weight * a.T @ metric @ a, system.S):
            weight *= 4.0
            if weight > 1e8:
                return None
        H, h, k = heavy, h + 2.0 * weight * a.T @ (metric @ b), k + weight * float(b @ metric @ b)
    return (0.5 * (H + H.T), h, k) if _convex(H, system.S) else None


def _convex(H, S):
    eigenvalues = scipy.linalg.eigh(0.5 * (H + H.T), S, eigvals_only=True, subset_by_index=[0, 0])
    return float(eigenvalues[0]) > 0.5 * LEAST


class FormEngine(SpaceEngine):
    """Programs with a form in place of the energy, whose rows have the numbers that another engine gives them."""

    def __init__(self, other, codes, H, h, k):
        super().__init__(other.system)
        self.other, self.codes, self.offset = other, codes, -k
        system, data = self.system, self.data
        rows, zeros = data.m, np.zeros(3 * data.m)
        start = 3 * np.arange(rows + 1, dtype=np.intp)
        places = np.zeros(3 * rows, dtype=np.intp)
        self.data = type(self.data)(H, h, -system.S, system.g, start, places, zeros, zeros[:rows])
        self.rows, self.there = other.rows, set()

    def need(self, places):
        """Store rows that are not stored yet."""
        for place in places:
            if place not in self.there:
                self.there.add(place)
                self._put(place, self.rows[place])

    def slot(self, row):
        """The slot of a row among those of its node."""
        found = self.other.slot(row)
        self.need([] if found is None else [found * self.system.p + row[1]])
        return found

    def imposed(self, node, code):
        """Numbers and modes of the rows that a node imposes."""
        return self.other.imposed(node, code)

    def root(self, rows, modes):
        """The relaxation with the given rows on."""
        return FormRelaxation(self, self._state(self.data), rows, modes)


class FormRelaxation(SpaceRelaxation):
    """A relaxation with a form, in floats."""

    __slots__ = ()

    def _solve(self, rows, modes):
        engine = self._engine
        engine.need(rows)
        self._state.switch(rows, modes)
        status = self._state.solve(PRUNE_MARGIN + engine.offset, FEASIBILITY_TOLERANCE, engine.limit)
        self.bound = self._state.bound - engine.offset
        self.pruned, self.stalled = status == 1, status == 2

    @property
    def codes(self):
        """Where its form was made."""
        return self._engine.codes


class Certifier(SpaceCertifier):
    """Believes what a form excludes."""

    def excluded(self, codes, relaxation):
        """Whether the relaxation excludes a partial assignment."""
        if isinstance(relaxation, FormRelaxation):
            return relaxation.bound > PRUNE_MARGIN
        return super().excluded(codes, relaxation)


def decided(codes):
    """How much is decided: a status counts two, contact one, and so do two halvings of a sector."""
    return sum(
        (code != UNDECIDED) + (code not in (UNDECIDED, CONTACT)) + 0.5 * max(_level(code) - 2, 0) for code in codes
    )


def _level(code):
    return width_level(code - SECTORS) if code > SECTORS else 0


class Search(TreeSearch):
    """Makes a new form at nodes that are not excluded, where enough was decided since the last one."""

    every, made, seconds = None, 0, 0.0

    def relax(self, item):
        """The relaxation, with a new form where it is time."""
        found = super().relax(item)
        if self.every is None or found.pruned or found.stalled:
            return found
        begun = self.relaxations.nothing
        last = found.codes if isinstance(found, FormRelaxation) else None
        if last is not None and decided(item.codes) < decided(last) + self.every:
            return found
        if last is None and item.codes != begun:
            return found
        started = process_time()
        form = best_form(self.relaxations.engine.system, item.codes)
        self.seconds += process_time() - started
        if form is None:
            return found
        self.made += 1
        engine = FormEngine(self.relaxations.engine, item.codes, *form)
        new = engine.root(*self.relaxations.rows.over(item.codes, range(len(item.codes)))).inheriting(found)
        return found if new.stalled else new


class Solvers(SpaceSolvers):
    """A search with forms."""

    @cached_property
    def _engine(self):
        return SpaceEngine(self.system)

    def certifier(self, recorder=None):
        """One that writes no proof."""
        return Certifier(self._engine, self.enclosed, Unrecorded())

    def search(self, certifier, limits=None, progress=None):
        """A search of the tree."""
        splitting = SpaceSplitting(self._engine)
        relaxations = Relaxations(self._engine, splitting, self.system.p)
        return Search(relaxations, certifier, limits=limits, progress=progress)


def forms(run: Run, most: int) -> None:
    """The table of forms.

    Parameters
    ----------
    most : nodes of the tree
    """
    rows = []
    for (choice, every), (name, (cells, F)) in (
        (choice, wedge) for choice in CHOICES.items() for wedge in (SMOKE if run.smoke else WEDGES).items()
    ):
        solvers = Solvers(gallery.wedge3d(*cells, friction=F, multipliers="nodes"), 0.0, "verified")
        certifier = solvers.certifier()
        search = solvers.search(certifier, SearchLimits(max_nodes=SMOKE_NODES if run.smoke else most))
        search.every = every
        started = process_time()
        outcome = search.run()
        seconds = process_time() - started
        row = {"choice": choice, "problem": name, "nodes": outcome.nodes, "forms": search.made}
        row["roots"] = len(distinct_roots(certifier.certified.verified.items())[0])
        row["complete"] = outcome.stopped is None and not outcome.undecided
        rows.append({**row, "s": seconds, "of which for forms": search.seconds})
    run.table("forms", rows, *notes(rows))


def around(run: Run) -> None:
    """The table of gaps that the best form leaves around the root of an angle plate that the search leaves open."""
    system = SpaceSolvers(foot("angle-14", SPRINGS[0], FRICTION[1]), 0.0, "verified").system
    problem, engine, rows = Isotropic.of(system), SpaceEngine(system), []
    point, imposing = Point.of(system, problem, problem.solution()), ImposedRows(SpaceSplitting(engine), system.p)
    for level in SMOKE_LEVELS if run.smoke else LEVELS:
        codes = tuple(_wider(code, level) for code in point.codes)
        there = imposing.over(codes, range(system.p))
        row = {"sectors": f"{360 / 2**level:g} degrees" if level else "contact", "energy": -engine.root(*there).bound}
        for name, kinds in list(AROUND.items())[: 1 if run.smoke else None]:
            form = best_form(system, codes, kinds)
            row[name] = None if form is None else -FormEngine(engine, codes, *form).root(*there).bound
        rows.append(row)
    run.table("around", rows)


def _wider(code, level):
    """The sector of a level around a narrow one; contact for level 0."""
    if code <= SECTORS:
        return code
    number = code - SECTORS
    return SECTORS + (number >> (number.bit_length() - 1 - level)) if level else CONTACT


def notes(rows):
    """What each choice takes, and what a form may cost."""
    before = {row["problem"]: row for row in rows if row["choice"] == "energy"}
    for choice in list(CHOICES)[1:]:
        own = [row for row in rows if row["choice"] == choice]
        nodes = ", ".join(f"{row['nodes'] / before[row['problem']]['nodes']:.2f} ({row['problem']})" for row in own)
        count = sum(row["forms"] for row in own)
        saved = sum(before[row["problem"]]["nodes"] - row["nodes"] for row in own)
        cost = 1000 * sum(row["of which for forms"] for row in own) / max(count, 1)
        each = sum(row["s"] for row in before.values()) / sum(row["nodes"] for row in before.values())
        yield (
            f"{choice}: {nodes} times the nodes with the energy; {count} forms save {saved / max(count, 1):.1f} nodes "
            f"each, which take {1000 * each * saved / max(count, 1):.1f} ms; a form takes {cost:.0f} ms"
        )
