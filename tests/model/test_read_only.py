"""What a problem or a result holds, in 2D and 3D, cannot be written to: no answer changes behind a proof."""

import copy
import pickle
from fractions import Fraction

import networkx as nx
import numpy as np
import pytest
import scipy.sparse as sp
from alike import assert_same
from complete import proven_roots, read_back
from plain_arrays import DENSE, A
from read_only import assert_locked, reachable

import enumsol
from enumsol import ContactProblem, gallery
from enumsol.support.immutable import SealedMatrix, sealed

DATA = {
    **DENSE,
    "gap": np.array([0.0, 0.125]),
    "friction": np.array([0.25, 0.5]),
    "friction_slope": np.array([0.5, 0.0]),
    "load_slope": np.array([0.5, 0.25, 0.0, -0.5]),
    "slip_offset": np.array([0.0, 0.0625]),
    "coordinates": np.array([[0.0, 0.0], [1.0, 0.0]]),
}
MATRICES = ("A", "Bn", "Bt")
COPIES = [copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))]


@pytest.fixture
def problem():
    """A problem that has answered, so that everything is in its caches."""
    made = ContactProblem(**DATA, node_ids=["a", "b"])
    assert made.fingerprint
    assert made.condensed.S.shape == made.enclosure.S.shape == (4, 4)
    assert enumsol.enumerate_roots(made, 1.5).complete
    return made


@pytest.fixture
def body():
    """The same in 3D, with a table of friction and means of slips."""
    table = enumsol.FrictionTable([0, 0.1, 1], [0.5, 0.4, 0.3], [0.3, 0.2, 0.2])
    made = gallery.block3d(4, 4, 1, friction=table, multipliers="elements", ratio=2)
    assert enumsol.successive_approximations(made, 0).converged
    assert enumsol.lipschitz_estimate(made, 0).C2 > 0
    return made


def forces(body):
    return enumsol.successive_approximations(body, 0).forces.tolist()


def unchangeable(owner, *names):
    for name in names:
        for change in (lambda name=name: setattr(owner, name, None), lambda name=name: delattr(owner, name)):
            with pytest.raises(AttributeError):
                change()


def locked_parts(value, name="copy"):
    """The arrays that can be reached, by their names; none can be written to."""
    found = dict(reachable(value, name))
    for array in found.values():
        assert_locked(array)
    return found


def answers(problem):
    roots = proven_roots(problem, 1.5)
    fresh = ContactProblem(
        *(getattr(problem, name) for name in (*MATRICES, "f")),
        **{name: getattr(problem, name) for name in ("gap", "friction", "friction_slope", "load_slope", "slip_offset")},
    )
    # what is cached belongs to what is there
    assert_same(problem, fresh, "fingerprint", "condensed.S", "enclosure.S")
    return [(root.statuses, root.lambda_n.tolist(), root.lambda_t.tolist(), root.u.tolist()) for root in roots]


# -- sparse matrices -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("part", ["data", "indices", "indptr"])
@pytest.mark.parametrize("name", MATRICES)
def test_replacing_a_part_of_a_matrix_changes_nothing(problem, name, part):
    before = answers(problem)
    matrix = getattr(problem, name)
    setattr(matrix, part, np.zeros_like(getattr(matrix, part)))
    assert answers(problem) == before


@pytest.mark.parametrize("part", ["data", "indices", "indptr"])
@pytest.mark.parametrize("name", MATRICES)
def test_writing_into_a_part_of_a_matrix_is_refused(problem, name, part):
    assert_locked(getattr(getattr(problem, name), part))


@pytest.mark.parametrize("name", MATRICES)
def test_writing_an_entry_of_a_matrix_is_refused_or_changes_nothing(problem, name):
    before = answers(problem)
    matrix = getattr(problem, name)
    rows, columns = matrix.nonzero()
    with pytest.raises(ValueError, match="read-only"):
        matrix[rows[0], columns[0]] = 7.0
    for operation in ("setdiag", "resize", "eliminate_zeros", "sum_duplicates", "sort_indices", "prune"):
        arguments = {"setdiag": (5.0,), "resize": ((1, 1),)}.get(operation, ())
        try:
            getattr(getattr(problem, name), operation)(*arguments)
        except ValueError as error:
            assert "read-only" in str(error)  # noqa: PT017 (either is right)
    assert answers(problem) == before


def test_in_place_arithmetic_reaches_no_problem(problem):
    before = answers(problem)
    matrix = problem.A
    with pytest.raises(ValueError, match="read-only"):
        matrix *= 2.0
    dense = problem.A.toarray()
    dense[:] = 0.0
    copied = problem.A.copy()
    copied.data[:] = 0.0
    assert answers(problem) == before


def test_matrices_are_made_without_copying_and_work_as_any(problem):
    assert isinstance(problem.A, sp.csc_array)
    assert isinstance(problem.Bn, sp.csr_array)
    assert problem.A is not problem.A
    assert np.shares_memory(problem.A.data, problem.A.data)
    assert np.shares_memory(problem.factorization._A.matrix().data, problem.A.data)
    assert np.array_equal((problem.A @ problem.Bn.T).toarray(), A @ DATA["Bn"].T)
    assert np.array_equal((problem.A + problem.A.T).toarray(), 2 * A)
    assert problem.A[0, 0] == 2.0


# -- everything else that a problem holds ----------------------------------------------------------------------------


def test_no_array_of_a_problem_can_be_written(problem):
    assert len(problem.factorization._parts[0]) == 4
    parts = [
        "_A.data",
        "f",
        "friction",
        "friction_slope",
        "coordinates",
        "factorization._scale",
        "factorization._parts[0]",
    ]
    parts += [f"condensed.{name}" for name in ("S", "g0", "g1")]
    parts += [f"enclosure.{name}{end}" for name in ("S", "g0", "g1") for end in ("", "_rad")]
    assert {f"problem.{part}" for part in parts} <= locked_parts(problem, "problem").keys()


def test_no_array_of_a_problem_in_3d_can_be_written(body):
    parts = ["f", "areas", "law.F1", "mesh.points", "mesh.rows", "slip_mean.offset", "condensed.S"]
    parts += ["_A.data", "_rows[Bt1].data", "slip_mean._parts[weights].data"]
    assert {f"problem.{part}" for part in parts} <= locked_parts(body, "problem").keys()


def test_no_attribute_of_a_problem_can_be_set(problem, body):
    unchangeable(problem, "A", "_A", "f", "node_ids", "fingerprint", "condensed", "new")
    for part in (problem.condensed, problem.enclosure, body.condensed):
        unchangeable(part, "S")
    unchangeable(problem.factorization, "_scale", "_lu")
    unchangeable(problem._A, "data")
    assert type(problem.node_ids) is tuple


def test_no_attribute_of_a_problem_in_3d_can_be_set(body):
    before = forces(body)
    mean = body.slip_mean
    unchangeable(body, "law", "areas", "slip_mean", "mesh")
    unchangeable(body.friction, "F1", "new")
    unchangeable(body.mesh, "rows")
    unchangeable(mean, "weights", "offset")
    for name in ("T1", "T2", "weights"):
        matrix = getattr(mean, name)
        matrix.data = np.zeros_like(matrix.data)
        assert_locked(getattr(mean, name).data)
    assert forces(body) == before


def test_what_flint_computes_with_cannot_be_written():
    graph = enumsol.branch_graph(gallery.two_node_square(), (0, 4))
    before = graph.roots_at(3.5)
    matrix = graph.exact.S
    matrix[0, 0] = 77
    assert graph.exact.S[0, 0] != 77
    assert [root.lambda_n.tolist() for root in graph.roots_at(3.5)] == [root.lambda_n.tolist() for root in before]
    for rows in (graph.exact.rows, graph.exact.integers.rows):
        with pytest.raises(TypeError, match="does not support item assignment"):
            rows[0][0] = 77


def test_the_callers_arrays_are_copied():
    data = {name: value.copy() for name, value in DATA.items()}
    data |= {name: sp.csc_array(data[name]) for name in MATRICES}
    labels = ["a", "b"]
    made = ContactProblem(**data, node_ids=labels)
    before = made.fingerprint
    for value in data.values():
        parts = [value.data] if sp.issparse(value) else value if isinstance(value, tuple) else [value]
        for part in parts:
            part[...] = 99.0
    labels[0] = "z"
    assert made.node_ids == ("a", "b")
    assert made.fingerprint == before == ContactProblem(**DATA).fingerprint
    assert np.array_equal(made.coordinates, DATA["coordinates"])


def test_the_callers_arrays_are_copied_in_3d():
    mesh = gallery.block3d(2, 1, 1).mesh
    given = {name: np.array(getattr(mesh, name)) for name in ("points", "cells", "dofs", "facets")}
    weights, rows, offset = np.array([[0.5, 0.5]]), np.eye(4)[:2], np.zeros((2, 2))
    made, mean = enumsol.BodyMesh.of_dofs(**given), enumsol.SlipMean(rows, rows, offset, weights)
    slips = np.array([0.0, 1.0, 2.0])
    table = enumsol.FrictionTable(slips, slips)
    for array in (*given.values(), weights, rows, offset, slips):
        array[...] = 7
    assert_same(made, mesh, "points", "cells")
    assert mean([1.0, 3.0, 0.0, 0.0]) == pytest.approx([2.0 * np.sqrt(2.0)])
    assert table.slip.tolist() == table.F1.tolist() == [0.0, 1.0, 2.0]


@pytest.mark.parametrize("again", COPIES)
def test_copies_are_as_locked_and_as_right(problem, again):
    other = again(problem)
    assert answers(other) == answers(problem)
    locked_parts(other)
    with pytest.raises(AttributeError, match="ContactProblem is immutable: f cannot be set; build a new problem"):
        other.f = other.f
    with pytest.raises(AttributeError, match="ContactProblem is immutable: f cannot be deleted"):
        del other.f


@pytest.mark.parametrize("again", COPIES)
def test_copies_in_3d_are_as_locked_and_as_right(body, again):
    other = again(body)
    assert forces(other) == forces(body)
    locked_parts(other)
    for owner, name in ((other, "f"), (other.friction, "F1"), (other.slip_mean, "offset")):
        with pytest.raises(AttributeError, match=f"is immutable: {name} cannot be set"):
            setattr(owner, name, None)


# -- results ---------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def results():
    problem = gallery.two_node_square((1.0, -3.0), (1.0, -1.0))
    roots = enumsol.enumerate_roots(problem, 3.5)
    family = enumsol.enumerate_roots(gallery.one_node_triangle((1.0, -2.0)), 2.0)
    assert family.families[0].vertices.size
    assert all(root.dlambda_dalpha is not None for root in roots)
    graph = enumsol.branch_graph(problem, (0, 10))
    assert graph.components
    assert graph.branches
    path = enumsol.follow(problem, roots[0], 1, (0, 10))
    return {
        "roots": roots,
        "exact": enumsol.enumerate_roots(problem, Fraction(7, 2), "exact"),
        "family": family,
        "vertices": graph.vertices,
        "components": graph.components,
        "path": path,
        "point": path[1],
        "tangents": enumsol.continuation.start_tangents(problem, roots[0]),
        "audit": enumsol.audit(path, graph),
        "graph": graph,
    }


@pytest.mark.parametrize("name", ["roots", "exact", "family", "vertices", "components", "path", "point", "tangents"])
def test_no_array_of_a_result_can_be_written(results, name):
    assert locked_parts(results[name])
    if name in ("roots", "path"):
        assert locked_parts(copy.deepcopy(results[name]))


def test_no_attribute_of_a_result_can_be_set(results):
    """``roots.stopped = None`` made a search that was cut short print "complete: yes (proven)"."""
    cut = enumsol.enumerate_roots(gallery.get("wedge-8-5").build(), 3.0, max_nodes=20)
    graph = results["graph"]
    unchangeable(cut, "stopped", "undecided", "arithmetic")
    unchangeable(graph, "reasons", "arithmetic", "arcs")
    unchangeable(graph.vertices[0], "kind")
    for part in (graph.arcs[0], results["roots"][0]):
        unchangeable(part, "index")
    unchangeable(results["path"], "alpha")
    assert not cut.complete


@pytest.mark.parametrize("again", [lambda x: x, *COPIES[1:]])
def test_no_array_or_attribute_of_a_fixed_point_can_be_changed(body, again, tmp_path):
    limit = enumsol.successive_approximations(body, 0)
    loaded = read_back(limit, tmp_path / "limit.npz", body)
    for result in (limit, enumsol.solve_tresca(body, 1.0, 0), loaded):
        assert result.u.size
        assert result.statuses
        assert result.residuals
        kept = again(result)
        locked_parts(kept)
        unchangeable(kept, "lambda_n", "u", "statuses", "residuals", "new")
        with pytest.raises(TypeError, match="does not support item assignment"):
            result.residuals["cone"] = 0.0
    unchangeable(limit, "outcome")
    unchangeable(enumsol.lipschitz_estimate(body, 0), "sampled")


def test_the_network_of_a_graph_is_frozen(results):
    graph = results["graph"]
    assert nx.is_frozen(graph.graph)
    for change in (lambda: graph.graph.add_edge(0, 1), lambda: graph.graph.remove_node(0)):
        with pytest.raises(nx.NetworkXError, match="Frozen graph"):
            change()
    loose = nx.MultiGraph(graph.graph)
    loose.remove_node(0)
    assert len(graph.graph) == len(loose) + 1
    with pytest.raises(TypeError, match="does not support item assignment"):
        graph.branch_of[0] = 5


def test_frames_are_new_at_every_call(results):
    for name in ("roots", "path", "graph", "audit"):
        frame = results[name].to_frame()
        column = "alpha" if "alpha" in frame else "alpha_from"
        frame[column] = -1.0
        frame.loc[:, :] = frame.iloc[::-1].to_numpy()
        assert not results[name].to_frame().equals(frame)
        assert (results[name].to_frame()[column] >= 0).all()


# -- the means -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("shape", [(), (0,), (3,), (2, 3), (0, 2)])
@pytest.mark.parametrize("dtype", [float, np.int8, bool])
def test_sealing_keeps_everything_but_the_lock(shape, order, dtype):
    array = np.ones(shape, dtype=dtype, order=order)
    locked = sealed(array)
    assert np.array_equal(locked, array)
    assert (locked.dtype, locked.shape) == (array.dtype, array.shape)
    assert locked.flags.c_contiguous == array.flags.c_contiguous
    assert locked.flags.f_contiguous == array.flags.f_contiguous
    assert locked.flags.aligned
    assert sealed(locked) is locked
    assert sealed(locked[...]).base is not None
    if array.size:
        assert_locked(locked)
        array[...] = 0
        assert np.all(locked == 1)


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
@pytest.mark.parametrize("size", [3, 100, 10_000])
def test_arrays_of_any_size_come_sealed_out_of_a_pickle(size, protocol):
    """NumPy puts large ones on the bytes of the pickle, and leaves them writable."""
    matrix = pickle.loads(pickle.dumps(SealedMatrix.of(sp.eye_array(size, format="csr")), protocol))
    for array in (matrix.data, matrix.indices, matrix.indptr):
        assert_locked(array)


def test_a_sealed_matrix_shares_what_is_sealed_and_copies_what_is_not():
    loose = sp.csr_array(A)
    once = SealedMatrix.of(loose)
    loose.data[:] = 0.0
    assert np.array_equal(once.matrix().toarray(), A)
    again = SealedMatrix.of(once.matrix())
    assert np.shares_memory(again.data, once.data)
    assert again.matrix().has_canonical_format
