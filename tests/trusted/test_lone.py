"""The test that a root is alone below an assignment, against all selections in rationals (theory, section 6.13)."""

from itertools import product

import numpy as np
import pytest
from effort import some
from rational_closings import Closings, Lone
from rational_forms import Data, Forms, Refused, exact
from touching import problem_of_any_kind

from enumsol.condensation.enclosure import CondensedEnclosure
from enumsol.search.reduction import KnownRoot, Lone as Proposed
from enumsol.search.solvers import make_engine
from enumsol.search.splitting import ImposedRows, PlaneSplitting
from enumsol.trusted import uniqueness as lone
from enumsol.trusted.at_alpha import solve_selection
from enumsol.trusted.uniqueness import gaps, lone_root


def assignment(rng, selection, friction):
    """Codes above a selection, some of them."""
    codes = list(selection)
    for i, positive in enumerate(friction):
        above = [6, 6, *([5] if codes[i] in (1, 2, 3) else []), codes[i]]
        above += [{0: int(rng.choice([7, 8])), 2: 7, 3: 8}.get(codes[i], 6)] if positive else []
        codes[i] = int(rng.choice(above))
    return tuple(codes)


class Case:
    """A problem with everything that the test and its judge need."""

    def __init__(self, problem):
        self.problem, self.p = problem, problem.p
        self.scaled = problem.condensed.at(0.0).scaled
        self.system = CondensedEnclosure.from_problem(problem).at(0.0, self.scaled.force, self.scaled.length)
        data = Data(problem)
        self.forms = Forms(data.S, data.load(0), data.friction(0))
        self.friction = [F > 0 for F in self.forms.F]
        self.units = [[exact(float(x)) for x in part[: self.p]] for part in (self.scaled.length, self.scaled.force)]
        self.judge = Closings(self.forms, self.friction, self.units)
        self.engine = make_engine(self.scaled)
        self.rows = ImposedRows(PlaneSplitting(self.scaled.F), self.p)
        self.roots = []
        for codes in product(*((0, 1, 2, 3) if positive else (0, 4) for positive in self.friction)):
            root = solve_selection(self.system, codes)
            if root is not None and root.is_root:
                self.roots.append((codes, root))

    def proposed(self, codes, root):
        """Numbers, strengths and multipliers for a root below an assignment; None where floats find none."""
        relaxation = self.engine.root(*self.rows.over(codes, range(self.p)))
        if relaxation.pruned or relaxation.stalled:
            return None
        known = KnownRoot(root[0], root[1].force.mid, root[1].w.mid)
        proposal = Proposed(self.scaled, codes, known, relaxation).proposal()
        return None if proposal is None else [proposal.numbers, proposal.strengths, *proposal.terms]

    def terms(self, rows, values):
        """Rows with multipliers in units, in rationals."""
        units = [self.units[int(row // self.p >= 4)][row % self.p] for row in rows]
        return [(int(row), exact(float(value)) * unit) for row, value, unit in zip(rows, values, units, strict=True)]

    def judged(self, codes, selection, weights, strengths, rows, values):
        """Whether the judge in rationals finds the same."""
        numbers = weights.tolist(), strengths.ravel().tolist()
        try:
            self.judge.alone(codes, selection, *numbers, self.terms(rows, values))
        except Refused as refused:
            return str(refused)
        return None


def cases(seeds):
    for seed in seeds:
        rng = np.random.default_rng([23, seed])
        case = Case(problem_of_any_kind(rng, int(rng.integers(1, 4)), seed % 4, (0.3, 3.0)))
        for root in case.roots:
            for _ in range(3):
                codes = assignment(rng, root[0], case.friction)
                given = case.proposed(codes, root)
                if given is not None:
                    yield rng, case, codes, root[0], given


SEEDS = [range(6), pytest.param(range(some(18, of=90)), marks=pytest.mark.slow)]


@pytest.mark.parametrize("seeds", SEEDS)
def test_what_is_proven_is_so(seeds):
    proven = squares = several = 0
    for _, case, codes, selection, given in cases(seeds):
        root = lone_root(case.system, codes, selection, *given)
        if root is None:
            continue
        proven += 1
        squares += any(given[1][0, i] > 0 and codes[i] > 5 for i in range(case.p))
        several += len(case.roots) > 1
        assert case.judged(codes, selection, *given) is None
    assert proven > len(seeds) // 3
    assert squares >= len(seeds) // 9 - 1
    assert several >= len(seeds) // 9 - 1


def changed(rng, case, codes, given):
    """The same with something that may be wrong."""
    codes, (weights, strengths, rows, values) = list(codes), [a.copy() for a in given]
    how, i = rng.integers(6), int(rng.integers(case.p))
    if how == 0 and codes[i] in (1, 2, 3, 5):
        codes[i] = 6 if codes[i] == 5 else 5
        nodes, own = lone.numbers_of(codes, case.friction)
        weights = np.concatenate([np.ones(len(nodes) + np.count_nonzero(own)), np.zeros(2 * np.count_nonzero(own))])
    elif how == 1:
        strengths[0] *= rng.choice([1.01, 2.0, 100.0])
    elif how == 2:
        strengths[0, i] = 1e3
    elif how == 3 and len(values):
        values *= rng.choice([0.1, 0.9, 1.1])
    elif how == 4 and len(weights):
        weights[rng.integers(len(weights))] *= rng.choice([-1.0, 0.1, 10.0])
    else:
        strengths[1, i] = rng.choice([1.0, 1e3])
    return tuple(codes), [weights, strengths, rows, values]


@pytest.mark.slow
def test_what_is_changed_is_refused_or_true():
    refused = accepted = 0
    for rng, case, codes, selection, given in cases(range(some(15, of=90))):
        for _ in range(3):
            others = changed(rng, case, codes, given)
            if lone_root(case.system, others[0], selection, *others[1]) is None:
                refused += 1
                continue
            accepted += 1
            assert case.judged(others[0], selection, *others[1]) is None
    assert refused > some(5, of=30)
    assert accepted > some(5, of=30)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("wrong", ["equations of free nodes", "narrow gaps"])
def test_a_wrong_test_is_seen(wrong, monkeypatch):
    """Squares of what does not vanish, and gaps that are not bounds: roots are then said to be alone that are not."""
    if wrong == "narrow gaps":
        monkeypatch.setattr(lone, "gaps", lambda *arguments: 0.01 * gaps(*arguments))
    else:
        monkeypatch.setattr(lone, "_allowed", lambda *_: True)
    false = 0
    for _, case, codes, selection, given in cases(range(some(20, of=60))):
        strengths = given[1].copy()
        free = [i for i in range(case.p) if codes[i] > 5 and selection[i] != 0]
        strengths[0, free] = 1e3 if wrong != "narrow gaps" else 50.0 * strengths[0, free]
        given[1] = strengths
        if lone_root(case.system, codes, selection, *given) is not None:
            false += case.judged(codes, selection, *given) is not None
    assert false > some(0, of=2)


@pytest.mark.parametrize("count", [6, pytest.param(60, marks=pytest.mark.long)])
def test_gaps_hold_at_all_roots(count):
    for _, case, codes, _selection, (_, _, rows, values) in cases(range(count)):
        bounds = gaps(case.system, codes, rows, values)
        for other, root in case.roots:
            if KnownRoot(other, root.force.mid, root.w.mid).below(codes):
                assert np.all(-root.w.mid[: case.p] <= bounds + 1e-12)
        exactly, terms = Lone(case.forms, codes, case.friction), case.terms(rows, values)
        for i in range(case.p):
            middle, square = exactly.gap(terms, i)
            assert bounds[i] * case.scaled.length[i] >= float(middle) + float(square) ** 0.5 - 1e-12
