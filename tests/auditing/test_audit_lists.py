"""An audit names points by path and row, explains its tolerance, and reads columns by label."""

import json

import numpy as np
import pandas as pd
import pytest
from command_line import assert_refused, call, printed, run
from refusals import bad_argument

from enumsol import ContactProblem, audit, branch_graph, follow_all, gallery, write_problem
from enumsol.auditing import read_points
from enumsol.auditing.graph_map import GraphMap

AUDIT = ("audit", "gallery:one-node-6.1")


@pytest.fixture(scope="module")
def frame(graph):
    """All arcs followed, one row per point; paths are named and their rows are mixed."""
    paths = follow_all(graph.problem, (0.0, 20.0), graph=graph).paths
    names = ["up", "down", "left", "right", "more"]
    one = pd.concat([path.to_frame().assign(path=name) for name, path in zip(names, paths, strict=False)])
    return one.sort_values("arclength", kind="stable").reset_index(drop=True)


@pytest.fixture(scope="module")
def wrong(frame):
    """A point off the graph and a jump, with their rows."""
    bad = frame.copy()
    row = bad.index[bad["status_0"].eq("stick") & bad["alpha"].gt(4)][2]
    bad.loc[row, "lambda_n_0"] += 1e-3
    late = bad["status_0"].eq("slip-") & bad["alpha"].gt(10)
    bad.loc[late, ["lambda_n_0", "lambda_t_0"]] = 0.0
    name = bad.loc[late, "path"].iloc[0]
    assert bad.loc[late, "path"].eq(name).all()
    rows = bad.index[bad["path"].eq(name)]
    second = late.idxmax()
    first = rows[rows.get_loc(second) - 1]
    if not late[first]:
        return bad, row, (first, second)
    pytest.fail("the jump starts the path")


# -- points and jumps --------------------------------------------------------------------------------------------------


def test_points_off_are_listed_by_path_and_row_with_arc_and_distance(graph, wrong):
    bad, row, _ = wrong
    report = audit(bad, graph)
    (point,) = (report.points[k] for k in report.off)
    stick = next(arc for arc in graph.arcs if arc.statuses[0].value == "stick")
    assert (point.path, point.row, point.alpha) == (bad.loc[row, "path"], row, bad.loc[row, "alpha"])
    assert (point.place.kind, point.place.number, point.branch) == ("arc", stick.number, graph.branch_of[stick.number])
    assert 1e-4 < point.distance < 1e-3
    text = f"path {point.path}, row {row}, alpha = {point.alpha:.8g}: {point.distance:.2e} from arc {stick.number} of "
    assert text in repr(report)
    assert "rows are counted from 0" in repr(report)


def test_jumps_are_listed_by_path_and_rows(graph, wrong):
    bad, _, rows = wrong
    report = audit(bad, graph)
    (jump,) = report.jumps
    assert jump.rows == rows
    assert jump.path == bad.loc[rows[0], "path"]
    assert jump.alpha == tuple(bad.loc[list(rows), "alpha"])
    assert bad.loc[bad["path"].eq(jump.path)].index[jump.point] == rows[0]
    said, ((first, last), (low, high)) = repr(report), (rows, jump.alpha)
    ways = "branch {} -> {} (arc {} -> {})".format(*jump.branches, *jump.arcs)
    assert f"path {jump.path}, rows {first} and {last}, between alpha = {low:.8g} and {high:.8g}: {ways}" in said
    assert f"{jump.distance:.2e} apart and no way along the graph" in said


def test_frames_and_files_have_the_same_rows(graph, wrong, capsys, tmp_path):
    bad, row, rows = wrong
    table = audit(bad, graph).to_frame()
    assert table.loc[table["off"], ["path", "row"]].to_numpy().tolist() == [[bad.loc[row, "path"], row]]
    assert table.loc[table["jump"], "row"].tolist() == [rows[0]]
    assert table.set_index("row")["alpha"].sort_index().tolist() == bad["alpha"].tolist()
    points, result, written = (tmp_path / name for name in ("p.csv", "r.json", "r.csv"))
    bad.to_csv(points, index=False)
    out = printed(capsys, *AUDIT, points, "--json", result, "--csv", written, status=3)
    assert f", row {row}, alpha" in out
    assert f", rows {rows[0]} and {rows[1]}, between" in out
    same = pd.read_csv(written)
    assert same.loc[same["off"], "row"].tolist() == [row]
    assert same.loc[same["jump"], "row"].tolist() == [rows[0]]
    content = json.loads(result.read_text())
    (point,) = content["off"]
    assert (point["path"], point["row"], point["place"]) == (bad.loc[row, "path"], row, "arc")
    assert point["distance"] == pytest.approx(table.loc[table["off"], "distance"].item())
    (jump,) = content["jumps"]
    assert (jump["rows"], jump["way"]) == (list(rows), None)
    assert "counted from 0" in content["row_numbers"]


def test_points_of_paths_are_named_by_their_place_in_the_sequence(graph):
    paths = follow_all(graph.problem, (0.0, 20.0), graph=graph).paths
    report = audit(paths, branch_graph(graph.problem, (0.0, 10.0)))
    late = [(k, j) for k, path in enumerate(paths) for j, alpha in enumerate(path.alpha) if alpha > 10 + 1e-4]
    assert [(report.points[k].path, report.points[k].row) for k in report.not_compared] == late
    assert {report.points[k].verdict for k in report.not_compared} == {"not compared"}


def test_a_long_list_says_how_much_is_left_out(graph, frame):
    report = audit(frame.assign(lambda_n_0=frame["lambda_n_0"] + 0.1), graph)
    assert f"    ... {len(report.off) - 8} more" in repr(report)


@pytest.mark.parametrize("name", ["one-node-6.1", "two-node-6.4"])
def test_the_arc_that_is_named_is_the_nearest(name):
    graph = branch_graph(gallery.get(name).build(), (0.0, 8.0))
    chart = GraphMap(graph, 1e-5)
    rng = np.random.default_rng(3)
    p = graph.problem.p
    for _ in range(200):
        forces = rng.normal(size=2 * p) * chart.equation.force * rng.choice([0.01, 0.3, 2.0])
        x = chart.equation.point(float(rng.uniform(0.0, 8.0)), forces)
        place = chart.place(x)
        distances = {arc.number: chart.arc_distance(x, arc) for arc in graph.arcs}
        nearest = min(*distances.values(), *(chart.vertex_distance(x, v.number) for v in graph.vertices))
        assert place.distance == pytest.approx(nearest, rel=1e-6)
        # an arc, unless it is a vertex at which none ends
        assert place.kind == "arc"
        assert distances[place.number] == place.distance


# -- the tolerance -----------------------------------------------------------------------------------------------------


def test_the_help_explains_distance_and_tolerance(capsys):
    out = " ".join(run(capsys, "audit", "--help")[1].split())
    for text in (
        "energy norm sqrt(d' S d) of the difference d of the contact forces",
        "relative to the load, that is to the largest sqrt(g' S^-1 g) in the interval",
        "a is the difference of alpha in twentieths of the interval",
        "For points of another code, give ten times the relative error of its forces",
        "--tolerance",
        "rows are counted from 0",
    ):
        assert text in out
    assert "energy norm" in audit.__doc__
    assert "another code" in audit.__doc__.replace("\n    ", " ")


def test_the_distance_is_the_one_that_the_help_explains(graph):
    """By its formula, from the problem's own matrices."""
    problem = graph.problem
    B = np.vstack([problem.Bn.toarray(), problem.Bt.toarray()])
    A = problem.A.toarray()
    S, g = B @ np.linalg.solve(A, B.T), B @ np.linalg.solve(A, problem.f)
    arc = next(arc for arc in graph.arcs if arc.statuses[0].value == "stick")
    on = np.concatenate(arc.values(10.0))
    d = np.array([1e-3, 2e-3])
    report = audit(pd.DataFrame([[10.0, *(on + d)]], columns=["alpha", "lambda_n_0", "lambda_t_0"]), graph)
    # forces do not change along the stick arc: the nearest point is at the same alpha
    assert report.distances[0] == pytest.approx(np.sqrt(d @ S @ d / (g @ np.linalg.solve(S, g))), rel=1e-9)
    # beyond the end of an arc by a hundredth of the unit of alpha
    report = audit(pd.DataFrame([[20.01, *on]], columns=["alpha", "lambda_n_0", "lambda_t_0"]), graph, tolerance=0.5)
    assert report.distances[0] == pytest.approx(0.01)


def test_points_with_few_digits_pass_with_the_tolerance_that_the_help_advises(graph, frame, capsys, tmp_path):
    file = tmp_path / "p.csv"
    frame[["path", "alpha", "lambda_n_0", "lambda_t_0"]].to_csv(file, index=False, float_format="%.5g")
    assert run(capsys, *AUDIT, file)[0] == 3
    assert run(capsys, *AUDIT, file, "--tolerance", 1e-3)[0] == 0


# -- errors ------------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_errors_name_the_file_and_the_columns_found(capsys, tmp_path, frame, graph):
    file = tmp_path / "forces.csv"
    frame.rename(columns={"lambda_t_0": "lambda_T"})[["alpha", "lambda_n_0", "lambda_T"]].to_csv(file, index=False)
    found = "expected alpha, lambda_n_0, lambda_t_0 by row number; found alpha, lambda_n_0, lambda_T"
    assert_refused(*run(capsys, *AUDIT, file), f"{file} has no column 'lambda_t_0'; {found}")
    with file.open() as stdin:
        done = call(*AUDIT, "-", stdin=stdin)
    assert_refused(done.returncode, done.stdout, done.stderr, f"stdin has no column 'lambda_t_0'; {found}")
    bad_argument(r"forces\.csv has no column 'lambda_t_0'", audit, file, graph)
    bad_argument(r"path has no column 'alpha'; .*; found none", audit, pd.DataFrame(), graph)


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("alpha,lambda_n_0,lambda_t_0\n1,0,0\n2,0,zero\n", "lambda_t_0 is not numeric in row 1 ('zero')"),
        ("alpha,lambda_n_0,lambda_t_0\n1,0,0\n2,,0\n", "lambda_n_0 is not finite in row 1 (empty or nan)"),
        ("alpha,lambda_n_0,lambda_t_0\n1,0,0\n2,0\n", "lambda_t_0 is not finite in row 1 (empty or nan)"),
        ("alpha,lambda_n_0,lambda_t_0\n1,0,0\n2,inf,0\n", "lambda_n_0 is not finite in row 1 (inf)"),
        ("alpha,lambda_n_0,lambda_t_0\n1,0,0,\n2,0,0,\n", "Expected 3 fields in line 2, saw 4"),
        ("alpha,lambda_n_0,lambda_t_0,alpha\n1,0,0,2\n", "has 2 columns 'alpha'; expected one"),
        ("alpha,lambda_n_0,lambda_t_0\n", "holds no points"),
        ("alpha;lambda_n_0;lambda_t_0\n1;0;0\n", "found alpha;lambda_n_0;lambda_t_0"),
    ],
)
def test_errors_name_the_file_and_the_row(capsys, tmp_path, text, part):
    file = tmp_path / "bad.csv"
    file.write_text(text)
    assert_refused(*run(capsys, *AUDIT, file, "--to", 3), str(file), part)


def test_names_of_columns_may_have_spaces_around_them(graph, tmp_path):
    file = tmp_path / "spaces.csv"
    file.write_text("\ufeffpath , alpha, lambda_n_0 , lambda_t_0\nup, 5, 0, 0\n\nup, 6, 0, 0\n", encoding="utf-8")
    report = audit(file, graph)
    assert report.ok
    assert [(point.path, point.row) for point in report.points] == [("up", 0), ("up", 1)]


# -- labels of nodes ---------------------------------------------------------------------------------------------------


def labelled(labels):
    """Two nodes, their graph, and points on it with columns by row number."""
    base = gallery.two_node_square()
    problem = ContactProblem(base.A, base.Bn, base.Bt, base.f, node_ids=labels)
    graph = branch_graph(problem, (0.0, 8.0))
    places = [(arc, alpha) for arc in graph.arcs for alpha in np.linspace(arc.lo, arc.hi, 4)]
    rows = [[alpha, *np.ravel(arc.values(alpha))] for arc, alpha in places]
    names = ["alpha", *(f"{force}_{k}" for force in ("lambda_n", "lambda_t") for k in range(2))]
    frame = pd.DataFrame(rows, columns=names)
    return problem, graph, frame.assign(path=np.repeat(range(len(graph.arcs)), 4))


def by_label(frame, labels):
    pairs = [(force, k, label) for force in ("lambda_n", "lambda_t") for k, label in enumerate(labels)]
    return frame.rename(columns={f"{force}_{k}": f"{force}_{label}" for force, k, label in pairs})


@pytest.mark.parametrize("labels", [("left", "right"), (17, 4), ("1", 2), (0.5, (1, 2))])
def test_labels_name_columns_as_row_numbers_do(labels):
    _, graph, frame = labelled(labels)
    named = by_label(frame, labels)
    assert set(named.columns) != set(frame.columns)
    for given, columns in ((frame, "auto"), (frame, "rows"), (named, "auto"), (named, "labels")):
        report = audit(given, graph, columns=columns)
        assert (report.ok, report.complete) == (True, True)
    assert audit(by_label(frame, labels[::-1]), graph).off


def test_labels_on_the_command_line(capsys, tmp_path):
    problem, _, frame = labelled(("left", "right"))
    body, points = tmp_path / "p.npz", tmp_path / "points.csv"
    write_problem(problem, body)
    named = by_label(frame, ("left", "right"))
    named.to_csv(points, index=False)
    assert ": ok, complete" in printed(capsys, "audit", body, points)
    assert_refused(*run(capsys, "audit", body, points, "--columns", "rows"), "has no column 'lambda_n_0'")
    named.drop(columns="lambda_t_right").to_csv(points, index=False)
    expected = "alpha, lambda_n_left, lambda_n_right, lambda_t_left, lambda_t_right by label"
    assert_refused(*run(capsys, "audit", body, points), f"{points} has no column 'lambda_t_right'", expected)


@pytest.mark.few(2)
@pytest.mark.parametrize("labels", [(1, 0), (0, 5), (5, 1)])
def test_columns_that_fit_row_numbers_and_labels_are_refused(capsys, tmp_path, labels):
    """(1, 0): each name fits two nodes. (0, 5), (5, 1): a file with columns for more nodes than those in contact."""
    problem, graph, frame = labelled(labels)
    # named by label; what else the file has is about other nodes
    named = by_label(frame, labels)
    for force in ("lambda_n", "lambda_t"):
        for k in range(2):
            if f"{force}_{k}" not in named:
                named[f"{force}_{k}"] = 0.0
    bad_argument(r"fit the nodes' row numbers .* as well as their labels", audit, named, graph)
    assert audit(named, graph, columns="labels").complete
    assert not audit(named, graph, columns="rows").ok
    body, points = tmp_path / "p.npz", tmp_path / "points.csv"
    write_problem(problem, body)
    named.to_csv(points, index=False)
    assert_refused(*run(capsys, "audit", body, points), "columns=rows or columns=labels", str(points))
    assert run(capsys, "audit", body, points, "--columns", "labels")[0] == 0
    assert run(capsys, "audit", body, points, "--columns", "rows")[0] == 3


def test_a_way_to_name_columns_that_does_not_exist_is_refused(graph, frame):
    bad_argument("columns is 'names'; expected 'auto', 'rows' or 'labels'", audit, frame, graph, columns="names")
    problem, twins, points = labelled((1, "1"))
    assert [str(label) for label in problem.node_ids] == ["1", "1"]
    assert audit(points, twins).ok
    bad_argument("two labels are the same text", audit, points, twins, columns="labels")


def test_points_of_a_problem_with_other_nodes_are_refused(graph, frame):
    other = branch_graph(gallery.two_node_square(), (0.0, 8.0))
    path = follow_all(graph.problem, (0.0, 20.0), graph=graph).paths[0]
    for points in (path, read_points(frame, graph.problem)):
        bad_argument("path has 1 contact nodes; expected the graph's 2", audit, points, other)
