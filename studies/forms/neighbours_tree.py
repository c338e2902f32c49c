"""Trees with forms of products of neighbours' rows at some levels, handed down in between, and what a program takes."""

from __future__ import annotations

import time
from functools import partial
from types import SimpleNamespace

import numpy as np

import enumsol
from enumsol import gallery
from enumsol.model.statuses import CONTACT, UNDECIDED
from enumsol.relaxation.active_set import ActiveSetEngine
from enumsol.relaxation.engine import status_rows
from enumsol.search.solvers import Solvers
from enumsol.selections.float_selections import SIGN_TOLERANCE
from forms.neighbours import NeighbourForms, by_clarabel
from shared.loads import Loaded, oblique_wedge, straight_wedge
from shared.searches import search

#: Least bound of a relaxation with a form handed down that excludes: a form may be nearly semidefinite.
CLEAR = 1e-6


def taper(p):
    """A self-holding taper with p contact nodes, at F = 0.2."""
    return Loaded(f"taper {p}", p, partial(gallery.taper, 4, p // 2), 0.2)


#: Problems, and at how many levels of the tree there is a program: each, each second, each fourth.
TREES = (
    (oblique_wedge(14), (1, 2, 4)),
    (straight_wedge(14), (1, 2, 4)),
    (taper(16), (1, 2, 4)),
    (taper(32), (1, 4)),
    (oblique_wedge(32), (1, 4)),
)
SMOKE_TREES = ((oblique_wedge(8), (1,)),)
#: Contact nodes, distances of nodes whose rows are multiplied, and the largest p that Clarabel is given.
SIZES, SMOKE_SIZES, REACHES, CLARABEL = (8, 14, 32, 64), (4,), (1, 3), 14


class NeighbourEngine(ActiveSetEngine):
    """Relaxations with the energy, and with such forms.

    Parameters
    ----------
    system : ScaledSystem
    reach : int
        As of NeighbourForms.
    levels : int
        A program is solved so many levels below the last one.
    """

    def __init__(self, system, reach, levels):
        super().__init__(system)
        self.forms, self.levels = NeighbourForms(system, reach), levels

    def root(self, rows, modes):
        """The relaxation with the given rows on."""
        return Relaxed(self, super().root(rows, modes), dict(zip(rows, modes, strict=True)))

    def with_form(self, modes, form):
        """The relaxation of rows with a form, or None where that is hardly convex."""
        numbers = self.forms.in_lambda(form, modes)
        if numbers is None:
            return None
        H, h, k = numbers
        try:
            engine = self.bounding(SimpleNamespace(H=H, h=h, k=k))
        except np.linalg.LinAlgError:
            return None
        return ActiveSetEngine.root(engine, list(modes), list(modes.values()))


class Relaxed:
    """The relaxation with the energy, beside it that with a form of a node above; pruned if either is."""

    def __init__(self, engine, energy, modes, parent=None, formed=None):
        self._engine, self._energy, self._modes, self._formed = engine, energy, modes, formed
        self.u = engine.forms.energy if parent is None else parent.u
        self.level = 0 if parent is None else parent.level + 1
        self.pruned = energy.pruned or _excludes(formed)
        if not (self.pruned or energy.stalled) and self.level % engine.levels == 0:
            found = engine.forms.solve(modes, self.u)
            self.pruned, self.u = found.excluded, found.u
            if engine.levels > 1 and not found.excluded:
                self._formed = engine.with_form(modes, found) or self._formed
                self.pruned = _excludes(self._formed)
        self.bound = energy.bound if energy.pruned or not self.pruned else 1.0

    def __getattr__(self, name):
        return getattr(self._energy, name)

    def multipliers(self):
        """Those of the energy; none where a form excludes the assignment, whose word is taken for it."""
        rows, values = self._energy.multipliers()
        return (rows[:0], values[:0]) if self.pruned and not self._energy.pruned else (rows, values)

    def child(self, rows, modes, *, last):
        """The relaxation with further rows switched on."""
        energy, formed = self._energy.child(rows, modes, last=last), self._formed
        if formed is not None:
            usable = not (energy.pruned or formed.stalled or formed.pruned)
            formed = formed.child(rows, modes, last=last) if usable else None
        return Relaxed(self._engine, energy, self._modes | dict(zip(rows, modes, strict=True)), self, formed)


def _excludes(relaxation):
    return relaxation is not None and relaxation.pruned and relaxation.bound > CLEAR


def _modes(codes):
    p = len(codes)
    return {kind * p + i: mode for i, code in enumerate(codes) for kind, mode in status_rows(code, friction=True)}


def programs(sizes):
    """What one program takes at the root of the tree, and where the first half of the nodes is in contact."""
    for p in sizes:
        loaded = oblique_wedge(p)
        system = Solvers(loaded.build(), loaded.alpha, "fast", SIGN_TOLERANCE).scaled
        for reach in REACHES:
            if p == max(SIZES) and reach > 1:
                continue
            for where, codes in (("root", ()), ("half in contact", (CONTACT,) * (p // 2))):
                modes = _modes((*codes, *(UNDECIDED,) * (p - len(codes))))
                forms = NeighbourForms(system, reach)
                found = forms.solve(modes, forms.energy)
                line = {"p": p, "reach": reach, "node": where, "multipliers": forms.multipliers, "steps": found.steps}
                line |= {"ms": 1e3 * forms.seconds, "ms a step": 1e3 * forms.seconds / max(found.steps, 1)}
                best = by_clarabel(forms.program(modes)[0]) if p <= CLARABEL else None
                yield line | {
                    "excluded": "yes" if found.excluded else "no",
                    "-t": "-" if found.excluded else -found.t,
                    "-t, Clarabel": "-" if best is None else max(-best[0], 0.0),
                    "ms, Clarabel": "-" if best is None else 1e3 * best[1],
                }


def trees(choices):
    """Trees with such forms beside those of the package, in seconds of the processor."""
    for loaded, levels in choices:
        problem = loaded.build()
        problem.enclosure  # noqa: B018
        enumsol.enumerate_roots(problem, loaded.alpha, max_nodes=10)
        start = time.process_time()
        roots = enumsol.enumerate_roots(problem, loaded.alpha)
        today = time.process_time() - start
        for every in levels:
            engines = []

            def make(system, every=every, engines=engines):
                engines.append(NeighbourEngine(system, 1, every))
                return engines[-1]

            start = time.process_time()
            outcome = search(problem, loaded.alpha, make)
            seconds, forms = time.process_time() - start, engines[-1].forms
            assert outcome.stopped is None
            assert len(outcome.solutions) == len(roots)
            yield {
                "problem": loaded.name,
                "roots": len(roots),
                "a form every": every,
                "nodes": outcome.nodes,
                "nodes, package": roots.stats.nodes,
                "programs": forms.programs,
                "steps": forms.steps,
                "multipliers": round(forms.multipliers / forms.programs),
                "ms a program": 1e3 * forms.seconds / forms.programs,
                "seconds": seconds,
                "seconds, package": today,
                "ms to break even": 1e3 * today / forms.programs,
            }


def _times_too_dear(row):
    return f"{row['problem']} every {row['a form every']} {row['ms a program'] / row['ms to break even']:.0f}"


def tables(run):
    """Both tables."""
    run.table("neighbours", list(programs(SMOKE_SIZES if run.smoke else SIZES)))
    rows = list(trees(SMOKE_TREES if run.smoke else TREES))
    note = "milliseconds of a program by those with which it would break even: "
    run.table("neighbours_trees", rows, note + ", ".join(map(_times_too_dear, rows)))
