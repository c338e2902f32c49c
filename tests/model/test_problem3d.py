"""ContactProblem3D and its friction: what is taken, what is refused and in what words."""

import pickle

import numpy as np
import pytest
import scipy.sparse as sp
from alike import assert_same
from problems3d import from_compliance
from read_only import assert_locked
from refusals import bad_argument, bad_problem

import enumsol
from enumsol import ContactProblem3D, FrictionTable

EYE = np.eye(6)


def problem(**change):
    arguments = {"A": EYE, "Bn": EYE[:2], "Bt1": EYE[2:4], "Bt2": EYE[4:], "f": np.arange(6.0)} | change
    return ContactProblem3D(**arguments)


def test_condensed_rows_are_all_normals_then_both_tangents():
    rng = np.random.default_rng(0)
    X = rng.normal(size=(9, 9))
    A = X @ X.T + np.eye(9)
    B = rng.normal(size=(6, 9))
    f, slope, gap, offset = rng.normal(size=9), rng.normal(size=9), rng.normal(size=2), rng.normal(size=(2, 2))
    body = ContactProblem3D(A, B[:2], B[2:4], B[4:], f, gap=gap, load_slope=slope, slip_offset=offset)
    inverse = np.linalg.inv(0.5 * (A + A.T))
    np.testing.assert_allclose(body.condensed.S, B @ inverse @ B.T, atol=1e-10)
    shift = np.concatenate([gap, offset[:, 0], offset[:, 1]])
    np.testing.assert_allclose(body.condensed.free_displacements(2.0), B @ inverse @ (f + 2.0 * slope) - shift)
    forces = rng.normal(size=6)
    np.testing.assert_allclose(body.A @ body.condensed.displacement(2.0, forces), f + 2.0 * slope - B.T @ forces)


@pytest.mark.parametrize(
    ("friction", "expected"),
    [
        (0.3, [[0.3, 0.3], [0.3, 0.3]]),
        ((0.3, 0.1), [[0.3, 0.1], [0.3, 0.1]]),
        (([0.3, 0.4], 0.1), [[0.3, 0.1], [0.4, 0.1]]),
        ((np.array([0.3, 0.4]), np.array([0.0, 1.0])), [[0.3, 0.0], [0.4, 1.0]]),
    ],
)
def test_forms_of_friction(friction, expected):
    body = problem(friction=friction, friction_slope=(1.0, 0.5))
    np.testing.assert_array_equal(body.friction_at(0), expected)
    np.testing.assert_allclose(body.friction_at(0.5), np.add(expected, [0.5, 0.25]))
    np.testing.assert_array_equal(np.transpose(body.friction), expected)


def test_a_callable_gets_the_row_and_the_slip_and_alpha_adds():
    body = problem(friction=lambda node, slip: (node + slip, 1.0), friction_slope=0.5)
    np.testing.assert_allclose(body.coefficients(2.0, np.array([0.25, 0.5])), [[1.25, 2.0], [2.5, 2.0]])
    assert body.depends_on_solution
    for call in (lambda: body.friction_at(0), lambda: body.fingerprint):
        bad_argument("which depends on the solution; expected constant coefficients", call)


def test_a_table_is_linear_between_and_constant_beyond():
    table = FrictionTable([0.0, 1.0], [0.2, 0.4], [[0.1, 0.1], [0.3, 0.1]])
    body = problem(friction=table)
    np.testing.assert_allclose(body.coefficients(0, np.array([0.5, 7.0])), [[0.3, 0.1], [0.4, 0.1]])
    assert body.friction is table


def test_more_contact_rows_than_freedoms_are_said_to_leave_the_forces_open():
    # a rigid block on four feet: six freedoms
    feet = np.array([[x, y, 0.0] for x in (-1, 1) for y in (-1, 1)])
    arms = np.array([np.hstack([np.eye(3), -np.cross(np.eye(3), foot - [0, 0, 1])]) for foot in feet])
    rows = np.vstack([-arms[:, 2], arms[:, 0], -arms[:, 1]])
    mass, load = np.diag([1.0, 1.0, 1.0, 0.5, 0.5, 0.8]), np.array([0.3, 0, -1, 0, 0, 0])
    message = "12 rows act on 6 degrees of freedom only, so equilibrium does not determine the contact forces"
    bad_problem(message, ContactProblem3D, mass, *np.split(rows, 3), load, friction=0.5)
    # what the message advises: a spring between the block and every row of its contact nodes
    stretch, springs = np.hstack([rows, -np.eye(12)]), np.hstack([np.zeros((12, 6)), np.eye(12)])
    A = 100.0 * stretch.T @ stretch
    A[:6, :6] += mass
    held = ContactProblem3D(A, *np.split(springs, 3), np.append(load, np.zeros(12)), friction=0.5)
    assert enumsol.enumerate_roots(held, 0).unique


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"Bt2": EYE[:3]}, r"Bt2 has shape \(3, 6\); expected \(p, n\) = \(2, 6\)"),
        ({"Bt2": EYE[2:4]}, r"\[Bn; Bt1; Bt2\] has linearly dependent rows .*expected full rank 3p = 6"),
        ({"Bt1": 0 * EYE[:2]}, r"Bt1 row 0 is zero"),
        ({"friction": (0.1, 0.2, 0.3)}, "friction is a tuple of length 3; expected a number, a pair"),
        ({"friction": np.ones(2)}, "friction is <array"),
        ({"friction": ([0.1, 0.2, 0.3], 0.1)}, r"friction F1 has shape \(3,\); expected \(2,\) or a single number"),
        ({"friction": (0.1, -0.2)}, "friction F2 is -0.2 at contact node 0; expected F >= 0"),
        ({"friction_slope": "x"}, "friction_slope is 'x'; expected a number, or a pair"),
        ({"slip_offset": 1.0}, r"slip_offset has shape \(\); expected \(p, 2\) = \(2, 2\), or 0"),
        ({"slip_offset": [1.0, 2.0]}, r"slip_offset has shape \(2,\)"),
        ({"coordinates": np.zeros((2, 2))}, r"coordinates has shape \(2, 2\); expected \(p, 3\) = \(2, 3\)"),
        ({"areas": [1.0, 0.0]}, "areas has the value 0; expected areas > 0"),
        ({"A": -EYE}, "A is not positive definite"),
        ({"f": np.ones(5)}, r"f has shape \(5,\); expected \(6,\)"),
    ],
)
def test_bad_data(change, message):
    bad_problem(message, problem, **change)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([0.0], [0.1]), "expected at least two slips that increase from 0"),
        (([1.0, 2.0], [0.1, 0.1]), "expected at least two slips that increase from 0"),
        (([0.0, 2.0, 2.0], [0.1] * 3), "expected at least two slips that increase from 0"),
        (([0.0, 2.0], [0.1] * 3), r"F1 of the friction table has shape \(3,\); expected \(2,\) or \(p, 2\)"),
        (([0.0, 2.0], [0.1, 0.1], [0.1, -0.1]), "F2 of the friction table has the value -0.1; expected F >= 0"),
        (([0.0, np.nan], [0.1, 0.1]), "slip of the friction table"),
    ],
)
def test_bad_tables(arguments, message):
    bad_problem(message, FrictionTable, *arguments)


def test_a_table_for_other_nodes():
    message = r"F1 of the friction table has shape \(3, 2\); expected \(2,\) or"
    bad_problem(message, problem, friction=FrictionTable([0.0, 1.0], np.ones((3, 2))))


def test_friction_that_is_negative_at_alpha():
    body = problem(friction=0.1, friction_slope=(0.0, -1.0), node_ids=["a", "b"])
    bad_argument(r"friction F2 at alpha = 1 is -0\.9 at contact node a; expected F >= 0", body.friction_at, 1)


def test_immutable_fingerprinted_and_pickled():
    body = problem(friction=(0.1, [0.2, 0.3]))
    with pytest.raises(AttributeError, match="immutable"):
        body.f = 0
    for array in (body.f, body.gap, *body.friction, body.slip_offset, body.A.data):
        assert_locked(array)
    same, other = problem(friction=(0.1, [0.2, 0.3])), problem(friction=(0.1, [0.2, 0.4]))
    assert body.fingerprint == same.fingerprint != other.fingerprint
    assert_same(pickle.loads(pickle.dumps(body)), body, "fingerprint", "condensed.S")
    assert "ContactProblem3D with 2 contact nodes" in repr(body)


def test_slip_means_are_checked():
    def with_weights(weights):
        T = sp.csr_array(EYE[:3])
        return problem(slip_mean=enumsol.SlipMean(T, T, np.zeros((3, 2)), sp.csr_array(weights)))

    bad_problem("slip_mean has a negative weight", with_weights, -np.ones((2, 3)) / 3)
    bad_problem("slip_mean has T1, T2, offset, weights of shapes", with_weights, np.ones((3, 3)) / 3)
    mean = with_weights(np.ones((2, 3)) / 3).slip_mean(np.arange(6.0))
    np.testing.assert_allclose(mean, np.sqrt(2.0) * np.ones(2))


def test_nodes_far_apart_are_checked_block_by_block():
    body = from_compliance(np.eye(3 * 400), np.ones(1200), 0.3)
    assert body.p == 400
    rows = np.eye(1200)
    rows[805] = rows[5]
    parts = np.split(rows, 3)
    bad_problem("Bn row 5, Bt2 row 5", ContactProblem3D, np.eye(1200), *parts, np.ones(1200))
