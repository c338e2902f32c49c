"""Forged proofs about bodies that nothing holds, in 2D and 3D, are refused; nothing excludes what holds a solution."""

import random
from fractions import Fraction

import numpy as np
import pytest
from complete import proven_roots
from effort import some
from helpers.floating_oracle import Oracle, block_on_table, random_body
from helpers.floating_space import known_body
from helpers.proof_tools import (
    copied,
    leaves_of,
    multipliers,
    of_kind,
    proof_of,
    put,
    records_of,
    refused,
    replaced,
    why_refused,
    with_multipliers,
)
from rational_checker import check_records
from rational_forms import Refused
from trusted.test_confinement import enclosed, final_codes

import enumsol
from enumsol.condensation.enclosure import enclosure_of
from enumsol.condensation.space_condensed import EnclosedSpace
from enumsol.model import sectors
from enumsol.model.sectors import SECTORS, nearest
from enumsol.search.solvers import Solvers
from enumsol.trusted.exclusion import exclusion_margin
from enumsol.trusted.space import sector_rows as sr
from enumsol.trusted.space.force_bound import is_unbalanced_in_space
from enumsol.trusted.space.sector_margins import space_margin
from enumsol.trusted.status_rows import FORBIDDEN, FREE, row_signs


def proven(problem):
    return problem, records_of(enumsol.enumerate_roots(problem, 0).proof)


@pytest.fixture(scope="module", params=["plane", "space"])
def body(request):
    """A body and the records of its proof."""
    block = block_on_table(cells=2, push=0.5, max_rigid_displacement=4.0)
    return proven(block if request.param == "plane" else known_body(113).problem)


def is_plane(problem):
    return isinstance(problem, enumsol.ContactProblem)


SLIDING = block_on_table(cells=1, push=1.0, max_rigid_displacement=4.0)


def test_the_proof_itself_is_accepted(body):
    problem, records = body
    assert enumsol.verify(problem, proof_of(records)).complete


@pytest.mark.parametrize("bound", [2.0, 8.0, 15.0, 60.0, 4, 30, None, "4.0", "30.0"])
def test_another_bound_in_the_header(body, bound):
    problem, records = body
    other = {key: value for key, value in records[0].items() if key != "max_rigid_displacement"}
    for header in (other, other | {"max_rigid_displacement": bound}):
        assert "bound of the rigid displacement" in why_refused(problem, [header, *records[1:]])


def test_another_problem(body):
    problem, records = body
    modes = problem.rigid_modes
    changes = [{"max_rigid_displacement": 2.0}, {"max_rigid_displacement": 8.0}]
    changes += [{"rigid_modes": 2 * modes}, {"rigid_modes": modes[:, ::-1]}] if modes.shape[1] > 1 else []
    for other in (problem.on_springs, *(problem.replace(**change) for change in changes)):
        assert "another problem" in why_refused(other, records)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [None, 0])
def test_every_exclusion_is_needed_as_it_is(seed):
    problem, records = proven(known_body(113).problem if seed is None else random_body(seed))
    exclusions = of_kind(records, "x")
    assert exclusions
    for place in exclusions[: some(4, of=len(exclusions))]:
        if not is_plane(problem):
            forgeries = [["x", [], ""]]
        else:
            rows, values = multipliers(records[place])
            others = ([0.0] * len(values), [-v for v in values])
            forgeries = [with_multipliers(records[place], rows, other) for other in others]
        for forged in forgeries:
            assert "do not exclude" in why_refused(problem, replaced(records, place, forged))


EMPTY = with_multipliers(["x", "", ""], [], [])[1:]
ONE = [[0] * 3, [], [[], [], [], [], []], [0.0] * 6]
LONE = ["a", [0] * 3, [], [], [], 1, [], *EMPTY]
HELD = [["z"], ["m", *ONE], ["m", [0] * 3, [], [[]], 0], LONE, ["l", [], [], [], [], [], 1]]
HELD_3D = [["z"], LONE[:6], ["l", [], [], [], [], [], 1], ["D", [], 0]]


def test_leaves_that_rest_on_a_body_that_is_held(body):
    problem, records = body
    for leaf in HELD if is_plane(problem) else HELD_3D:
        assert "unknown kind" in why_refused(problem, replaced(records, leaves_of(records)[0][0], leaf))
    place = leaves_of(records)[0][0]
    for by in (1, "rational"):
        why = why_refused(problem, replaced(records, place, ["x", *EMPTY, by]))
        assert ("its form was not declared" if by == 1 or not is_plane(problem) else "rational arithmetic") in why or (
            "cannot be tested in rational arithmetic" in why
        )


#: Bodies whose proofs have leaves of all kinds that refer to a root, and a block that sticks and slips.
REFERRED = {seed: lambda seed=seed: random_body(seed).replace(load_slope=None, friction_slope=0.0) for seed in (23, 8)}
REFERRED |= {"block": lambda: block_on_table(cells=1, push=0.5, max_rigid_displacement=4.0)}


def other_forms(record):
    """Other declarations: of another root, or with other numbers of its form."""
    _, selection, weights, (balance, share) = record
    for i, code in enumerate(selection):
        yield from (put(record, (1, i), other) for other in (0, 1, 2, 3, 4, 5, 6, True) if other != code)
    for i, value in enumerate(weights):
        others = -value, 0.0, value * (1 + 1e-9), value + 0.25, 0.5 * value, 4 * value, 1e3, 1e300
        yield from (put(record, (2, i), other) for other in others if other != value)
    yield from (put(record, (2,), other) for other in ([], weights[:-1], [*weights, 0.0]))
    yield from (put(record, (3, 0), other) for other in (-balance, 0.0, 1e-3, 1e6, 1e300))
    yield from (put(record, (3, 1), other) for other in (-share, 0.0, 0.5 * share, share * (1 + 1e-9), 1e6))


def other_leaves(record, p, mid):
    """Other leaves that refer to a root."""
    _, back, rows, pairs, *claim = record
    yield from (put(record, (1,), other) for other in (back - 1, back + 1, -back, True, float(back)))
    yield from (put(record, (2,), rows[:k] + rows[k + 1 :]) for k in range(len(rows)))
    yield from (put(record, (2,), [*rows, row]) for row in (-1, *range(7 * p), 7 * p))
    yield from (put(record, (3,), other) for other in ([], [*pairs, *pairs]) if pairs)
    yield from (put(record, (3,), [*pairs, [k, k, 1.0]]) for k in (*range(7 * p), 7 * p))
    for place, (one, other, factor) in enumerate(pairs):
        yield from (put(record, (3, place, side), row) for side in (0, 1) for row in range(4 * p, 7 * p))
        yield put(record, (3, place), [other, one, factor])
        yield put(record, (3, place), [one, other])
        others = -factor, 0.0, factor / 16, factor * (1 + 1e-9), 16 * factor, 1e6, 1e300
        yield from (put(record, (3, place, 2), value) for value in others)
    yield record[:4] if claim else [*record, mid, [1.0] * 2 * p, 1]
    if claim:
        yield [*record[:4], [x + 1.0 for x in claim[0]], *claim[1:]]
        yield [*record[:6], -claim[2]]


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", REFERRED)
@pytest.mark.usefixtures("enclosed_once")
def test_what_is_accepted_of_a_declared_root_holds_in_rationals(name):
    """Forms, leaves and their places; a few of them are proofs, too, and then the judge says so as well."""
    problem, records = proven(REFERRED[name]())
    declared, leaves = of_kind(records, "q")[0], of_kind(records, "o")
    mutants = [replaced(records, declared, other) for other in other_forms(records[declared])]
    for place in leaves:
        mutants += [replaced(records, place, other) for other in other_leaves(records[place], problem.p, [0.0] * 6)]
    for place, _ in leaves_of(records):
        for other in leaves:
            moved = copied(records)
            moved[place], moved[other] = moved[other], moved[place]
            mutants.append(moved)
    mutants.append(replaced(records, declared))
    assert len(mutants) > 100
    mutants = random.Random(0).sample(mutants, some(60, of=len(mutants)))
    accepted = [mutant for mutant in mutants if mutant != records and not refused(problem, mutant)]
    assert 5 < len(accepted) < 0.5 * len(mutants)
    for mutant in accepted:
        try:
            check_records(problem, mutant)
        except Refused as error:
            changed = [(own, other) for own, other in zip(records, mutant, strict=False) if own != other]
            pytest.fail(f"{error}: {changed}")


def test_a_root_cannot_be_left_out_or_moved(body):
    problem, records = body
    for place in of_kind(records, "r")[: some(1, of=9)]:
        _, mid, rad, index = records[place]
        fewer = {**records[-1], "roots": records[-1]["roots"] - 1}
        for leaf in (["n"], *([["n", "rational"]] if is_plane(problem) else [])):
            said = why_refused(problem, [*replaced(records, place, leaf)[:-1], fewer])
            assert "it holds a root" in said or (leaf == ["n"] and is_plane(problem))
        for forged in (["r", [mid[0] + 1.0, *mid[1:]], rad, index], ["r", mid, rad, -index]):
            assert why_refused(problem, replaced(records, place, forged))
        assert why_refused(problem, replaced(records, place, ["r", mid, [0.0, *rad[1:]], index])) or not rad[0]


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_direction_of_imbalance_is_tested(dimension):
    problem = block_on_table(cells=2, push=1.25)
    if dimension == 3:  # the load pulls the body away
        problem = known_body(1).problem
        away = 50 * (problem.Bn.sum(axis=0) @ problem.rigid_modes) @ problem.rigid_modes.T
        problem = problem.replace(f=problem.f - away)
    problem, records = proven(problem)
    found = of_kind(records, "i")
    assert found
    for place in found:
        z = records[place][1]
        for forged in ([-x for x in z], [0.0] * len(z)):
            assert "in balance with the load" in why_refused(problem, replaced(records, place, ["i", forged]))
        for forged in (z[:-1], [*z, 1.0], ["1", *z[1:]], 1.0):
            assert f"expected {len(z)} numbers" in why_refused(problem, replaced(records, place, ["i", forged]))


def test_a_direction_of_imbalance_means_nothing_for_a_body_that_is_held():
    held, (header, *_, footer) = proven(SLIDING.on_springs)
    records = [header, ["i", [1.0, 0.0, 0.0]], {**footer, "leaves": 1, "roots": 0}]
    assert "unknown kind" in why_refused(held, records)


def test_a_proof_with_huge_multipliers_is_accepted():
    # once a bound that was positive, but too small, was taken in place of a better one
    proven_roots(random_body(32146), 0)


def test_a_family_is_as_long_as_the_bound():
    _, records = proven(SLIDING)
    assert enumsol.verify(SLIDING, proof_of(records)).within == 4.0
    place = of_kind(records, "D")[0]
    for point in range(len(records[place][1])):
        path = (place, 1, point)
        assert "not those that are claimed" in why_refused(SLIDING, put(records, (*path, -1), "1/1"))
        assert "expected points of 7 fractions" in why_refused(SLIDING, put(records, path, lambda point: point[:-1]))


@pytest.mark.slow
def test_no_multipliers_exclude_a_solution():
    rng, tried = np.random.default_rng(0), 0
    for seed in range(25):
        problem = random_body(seed)
        oracle = Oracle(problem)
        if not oracle.parts:
            continue
        system = enclosed(problem)
        free = system.reaching(np.full(problem.modes.r, np.inf))
        best = _proposals(problem)
        for codes, _ in oracle.parts:
            final = final_codes(codes, oracle)
            signs = row_signs(np.array(final), system.F).T.ravel()
            allowed = np.flatnonzero(signs != FORBIDDEN)
            for size in (1e-3, 1.0, 1e3):
                values = rng.normal(size=len(allowed)) * size * (rng.random(len(allowed)) < 0.7)
                values = np.where(signs[allowed] == FREE, values, np.abs(values))
                assert not any(exclusion_margin(within, final, allowed, values) > 0 for within in (system, free))
                tried += 1
            for rows, values in best(final):
                assert not any(exclusion_margin(within, final, rows, values) > 0 for within in (system, free))
    assert tried > 30


def _proposals(problem):
    """Multipliers that the relaxation of a selection ends with, times some factors."""
    from enumsol.search.solvers import Solvers
    from enumsol.search.splitting import ImposedRows, PlaneSplitting

    solvers = Solvers(problem, 0, "verified", 1e-9)
    rows = ImposedRows(PlaneSplitting(solvers.scaled.F), problem.p)

    def best(codes):
        relaxation = solvers._engine.root(*rows.over(tuple(codes), range(problem.p)))
        if relaxation.stalled or relaxation.pruned:
            return
        found, values = relaxation.multipliers()
        for factor in (1.0, 1.0 + 1e-9, 1e3, 1e6):
            yield found, values * factor

    return best


def _status(known, system, node, rng):
    """A code of a node, complete or not, that the known solution has."""
    force, F = known.lambda_n[node], np.array(known.problem.friction).T[node]
    tau = known.lambda_t[node] / F / force if force > 0 else np.zeros(2)
    if rng.random() < 0.3:
        return sr.UNDECIDED
    if force == 0:
        return sr.OPEN
    if rng.random() < 0.3:
        return sr.CONTACT
    if np.hypot(*tau) < 0.99:
        return sr.STICK
    number = nearest(*tau, 6)
    number = 64 + (number - 64 - 1) % 64 if rng.random() < 0.5 else number
    return SECTORS + number


def test_what_holds_a_solution_is_not_excluded():
    """Whatever the multipliers are. Sectors are the two around the direction; only those with it inside are used."""
    tried = 0
    for seed in range(6):
        known, rng = known_body(seed), np.random.default_rng(seed)
        ones = np.ones(known.problem.p)
        system = EnclosedSpace.of_problem(enclosure_of(known.problem), Fraction(0), ones, ones)
        free = system.reaching(np.full_like(system.reach, np.inf))
        for _ in range(12):
            codes = [_status(known, system, node, rng) for node in range(known.problem.p)]
            if not all(_inside(known, node, code) for node, code in enumerate(codes)):
                continue
            rows = [row for node, code in enumerate(codes) for row in _rows(node, code)]
            signs = [sr.row_sign(codes[row[1]], row) for row in rows]
            for scale in (0.1, 1.0, 10.0):
                values = scale * rng.normal(size=len(rows))
                values = np.where(np.array(signs) == sr.NONNEGATIVE, np.abs(values), values)
                for within in (system, free):
                    assert not space_margin(within, codes, rows, values) > 0
            for z in rng.normal(size=(10, len(system.reach))):
                assert not is_unbalanced_in_space(system, codes, z)
            tried += 1
    assert tried > 30


def _rows(node, code):
    """Some rows that a node imposes."""
    rows = [(sr.GAP, node, 0), (sr.FORCE, node, 0), *((sr.TANGENT, node, 8 + k) for k in range(8))]
    rows += [(sr.TAU, node, k) for k in (0, 1)] if code == sr.OPEN else []
    rows += [(sr.SLIP, node, k) for k in (0, 1)] if code == sr.STICK else []
    if code > SECTORS:
        rows += [(kind, node, code - SECTORS) for kind in (sr.CHORD, sr.LEFT, sr.RIGHT)]
    return [row for row in rows if sr.row_sign(code, row) != sr.FORBIDDEN]


def _inside(known, node, code):
    if code <= SECTORS:
        return True
    tau = known.lambda_t[node] / np.array(known.problem.friction).T[node]
    (x, y), (p, q) = sectors.direction(code - SECTORS), sectors.direction(sectors.end_number(code - SECTORS))
    return x * tau[1] - y * tau[0] > 0 and tau[0] * q - tau[1] * p > 0


@pytest.mark.parametrize("seed", [340, 376, 592])
def test_roots_that_selections_share_are_judged_by_all_of_them(seed, monkeypatch):
    """Where rationals are not to be had, a root between stick and slip is a leaf "g"."""
    monkeypatch.setattr(Solvers, "exact_certifier", None)
    problem = random_body(seed)
    roots = enumsol.enumerate_roots(problem, 0)
    records = records_of(roots.proof)
    leaves = of_kind(records, "g")
    assert len(leaves) == 2
    assert check_records(problem, records)["roots"] == len(roots)
    node, code = records[leaves[0]][1][0]
    for place, value in ((1, [[node, 5 - code]]), (1, [[node, 1]]), (1, []), (4, -records[leaves[0]][4])):
        forged = put(records, (leaves[0], place), value)
        with pytest.raises(Refused):
            check_records(problem, forged)
        assert why_refused(problem, forged)
    mid = records[leaves[0]][2]
    moved = put(records, (leaves[0], 2), [mid[0] + 1.0, *mid[1:]])
    with pytest.raises(Refused, match="misses"):
        check_records(problem, moved)
