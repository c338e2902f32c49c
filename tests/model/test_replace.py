"""replace makes a problem with other data; what is not named stays to the last bit, and factors are shared."""

import pickle
import pprint

import numpy as np
import pytest
import scipy.sparse as sp
from alike import anew, assert_close, assert_same
from problems3d import from_compliance, random_compliance
from refusals import bad_problem

import enumsol
from enumsol import ContactProblem, ContactProblem3D, FrictionTable, gallery
from enumsol.condensation.enclosure import Products
from enumsol.condensation.factorization import Factorization
from enumsol.model.restart import SlipStart, restarted


def plane():
    """A problem in 2D with every argument given, asymmetric by rounding and with numbers of all sizes."""
    rng = np.random.default_rng(1)
    X = rng.normal(size=(6, 6))
    A = X @ X.T + np.eye(6)
    A[0, 1] *= 1 + 1e-15
    return ContactProblem(
        A, sp.coo_array(np.eye(6)[:2]), np.eye(6)[[3, 2]], rng.normal(size=6) * 1e-7, gap=[-1e-9, 0.5],
        friction=np.array([0.1, 0.0]), friction_slope=[1.0, 1 / 3], load_slope=rng.normal(size=6),
        slip_offset=[0.0, -0.25], node_ids=["left", 7], coordinates=rng.normal(size=(2, 2)),
    )  # fmt: skip


def space(friction=((0.5, 0.25), (0.125, 2.0))):
    """The same in 3D."""
    rng = np.random.default_rng(2)
    return from_compliance(
        random_compliance(rng, 2), rng.normal(size=6), friction, friction_slope=(0.5, (0.0, 1.0)), gap=[0.0, 0.1],
        load_slope=rng.normal(size=6), slip_offset=rng.normal(size=(2, 2)), node_ids=("a", "b"),
        coordinates=rng.normal(size=(2, 3)), areas=[1.0, 2.0],
    )  # fmt: skip


PROBLEMS = {"plane": plane, "space": space, "block": lambda: gallery.clamped_block(2, 1)}
PROBLEMS["block in 3D"] = lambda: gallery.block3d(2, 1, 1)
WAYS = (anew, lambda problem, **changes: problem.replace(**changes))


@pytest.mark.parametrize("replace", WAYS)
@pytest.mark.parametrize("name", PROBLEMS)
def test_nothing_named_is_the_same_problem(name, replace):
    problem = PROBLEMS[name]()
    same = replace(problem)
    assert type(same) is type(problem)
    assert same is not problem
    assert_same(same, problem, "fingerprint", *problem.arguments)
    assert repr(same) == repr(problem)
    assert pprint.pformat(problem) == repr(problem)


@pytest.mark.parametrize("replace", WAYS)
@pytest.mark.parametrize("name", PROBLEMS)
def test_what_is_named_changes_and_nothing_is_carried_over(name, replace):
    problem = PROBLEMS[name]()
    _ = problem.condensed, problem.enclosure, problem.fingerprint
    other = replace(problem, f=2 * problem.f, gap=1.0)
    assert np.array_equal(other.f, 2 * problem.f)
    assert np.array_equal(other.gap, np.ones(problem.p))
    assert other.mesh is problem.mesh
    assert_same(other, problem, "node_ids", "friction")
    assert other.fingerprint != problem.fingerprint
    assert not np.array_equal(other.condensed.g0, problem.condensed.g0)


def test_roots_of_a_problem_with_another_load():
    problem = gallery.one_node_triangle()
    doubled = anew(problem, f=2 * problem.f)
    pairs = zip(enumsol.enumerate_roots(problem, 5), enumsol.enumerate_roots(doubled, 5), strict=True)
    assert all(np.allclose(2 * one.lambda_n, other.lambda_n) for one, other in pairs)


def test_friction_that_depends_on_the_slip_is_kept():
    table = FrictionTable([0.0, 1.0], [0.5, 0.25])
    for friction in (table, lambda node, slip: 0.3 / (1.0 + slip)):
        problem = anew(space(), friction=friction, friction_slope=0.0)
        other = anew(problem, gap=1.0)
        assert other.friction is friction
        assert other.depends_on_solution
        slips = np.array([0.2, 3.0])
        assert np.array_equal(other.coefficients(0, slips), problem.coefficients(0, slips))


@pytest.mark.parametrize("replace", WAYS)
def test_data_that_do_not_fit_and_names_that_do_not_exist(replace):
    problem = plane()
    bad_problem(r"f has shape \(5,\); expected \(6,\)", replace, problem, f=np.ones(5))
    bad_problem("A has 1 dimension", replace, problem, A=np.ones(5))
    with pytest.raises(TypeError, match="unexpected keyword argument 'load'"):
        replace(problem, load=problem.f)
    with pytest.raises(AttributeError, match=r"build a new problem, or one with other data by problem\.replace"):
        problem.f = np.ones(6)
    assert isinstance(space(), ContactProblem3D)


CHANGES = {
    "f": lambda problem: 3 * problem.f,
    "load_slope": lambda problem: np.ones(problem.n),
    "gap": lambda problem: problem.gap + 0.01,
    "slip_offset": lambda problem: problem.slip_offset + 0.01,
    "node_ids": lambda problem: [f"n{k}" for k in range(problem.p)],
    "friction": lambda problem: 0.25,
}


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("name", ["plane", "space"])
def test_what_the_matrices_alone_decide_is_computed_once(name, change, monkeypatch):
    problem = PROBLEMS[name]()
    changes = {"friction_slope": problem.friction_slope, change: CHANGES[change](problem)}
    fresh = anew(problem, **changes)
    expected, bounds = fresh.condensed, fresh.enclosure
    _ = problem.enclosure
    monkeypatch.setattr(Factorization, "__init__", lambda *_: pytest.fail("factorized again"))
    solved = []
    whole = Products._of.__func__
    monkeypatch.setattr(Products, "_of", classmethod(lambda *given: solved.append(given[2]) or whole(*given)))
    other = problem.replace(**changes).replace(coordinates=None)
    assert other.factorization is problem.factorization
    assert other.fingerprint == fresh.fingerprint
    assert_close(other.condensed, expected, "S", "g0", "g1", rtol=1e-12, atol=1e-18)
    for one in ("g0", "g1"):  # both balls hold the exact value
        apart = np.abs(getattr(other.enclosure, one) - getattr(bounds, one))
        assert np.all(apart <= getattr(other.enclosure, one + "_rad") + getattr(bounds, one + "_rad"))
    assert_same(other.enclosure, bounds, "S")
    assert solved == ([0] if "f" in changes or "load_slope" in changes else [])


def test_other_matrices_share_what_is_theirs():
    problem = gallery.clamped_block(2, 1)
    same = problem.replace(A=problem.A.toarray(), Bn=problem.Bn, f=2 * problem.f)
    assert same.factorization is problem.factorization
    assert same.products.mid[0, 0] == problem.products.mid[0, 0]
    rows = problem.replace(Bn=2 * problem.Bn)
    assert rows.factorization is problem.factorization
    assert np.allclose(rows.condensed.S[0, 0], 4 * problem.condensed.S[0, 0])
    body = problem.replace(A=2 * problem.A)
    assert body.factorization is not problem.factorization
    assert np.allclose(body.condensed.S, problem.condensed.S / 2)
    assert body.fingerprint == anew(problem, A=2 * problem.A).fingerprint


def test_roots_and_proofs_are_those_of_the_problem_built_anew():
    problem = gallery.one_node_triangle()
    for factor in (0.0, 0.5, -1.0, 1e-200, 1e200):
        made, fresh = problem.replace(f=factor * problem.f), anew(problem, f=factor * problem.f)
        one, other = enumsol.enumerate_roots(made, 5), enumsol.enumerate_roots(fresh, 5)
        assert one.complete
        assert [root.statuses for root in one] == [root.statuses for root in other]
        assert enumsol.verify(fresh, one.proof).ok
        assert enumsol.verify(made, other.proof).ok


def test_a_problem_whose_own_load_is_not_enclosed_does_not_matter():
    problem = gallery.one_node_triangle()
    wild = problem.replace(f=1e308 * np.sign(problem.f))
    tame = wild.replace(f=problem.f)
    assert np.array_equal(tame.enclosure.S, problem.enclosure.S)
    assert len(enumsol.enumerate_roots(tame, 5)) == len(enumsol.enumerate_roots(problem, 5))


def test_a_start_that_is_a_ball_stays_unless_it_is_named():
    problem = gallery.one_node_triangle()
    wide = restarted(problem, SlipStart(np.full(1, 0.5), np.full(1, 0.25)))
    assert wide.replace(gap=0.5).offset_radius is wide.offset_radius
    assert wide.replace(gap=wide.gap).fingerprint == wide.fingerprint
    assert wide.replace(slip_offset=0.0).offset_radius is None


def test_copies_out_of_a_pickle_stand_alone():
    problem = gallery.clamped_block(2, 1)
    other = problem.replace(f=2 * problem.f)
    again = pickle.loads(pickle.dumps(other))
    assert_same(again, other, "fingerprint")
    assert_close(again, problem, "condensed.S")
    assert len(pickle.dumps(other)) < 1.1 * len(pickle.dumps(problem))
