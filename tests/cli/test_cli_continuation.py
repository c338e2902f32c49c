import csv
import io
import json

import pandas as pd
import pytest
from command_line import assert_refused, on_terminal, printed, run
from path_problems import closed_branch
from problems3d import OneNode

from enumsol import Interrupted, branch_graph, enumerate_roots, follow, gallery, write_problem
from enumsol.cli.follow import _passes

FOLLOW = ("follow", "gallery:one-node-6.1", "--from", 0, "--to", 20, "--start", 5)


AUDIT = ("audit", "gallery:one-node-6.1")


@pytest.fixture
def points(capsys, tmp_path):
    """All branches of the paper's Example 6.1, followed."""
    printed(capsys, *FOLLOW, "--csv", tmp_path / "points.csv")
    return tmp_path / "points.csv"


@pytest.fixture
def graph(capsys, tmp_path):
    printed(
        capsys,
        "graph",
        "gallery:one-node-6.1",
        "--no-stability",
        "--from",
        0,
        "--to",
        20,
        "--save",
        tmp_path / "graph.json",
    )
    return tmp_path / "graph.json"


# -- follow ------------------------------------------------------------------------------------------------------------


def test_one_branch_through_its_fold(capsys):
    out = printed(capsys, *FOLLOW, "--root", 2, "--direction", "-1")
    assert out.startswith("path 0, from root 2 in direction -1: Path with ")
    assert "alpha = 2.6666667    stick -> slip-, fold, no local branch" in out
    assert out.endswith("1 path, 1 of them left the interval or closed\n")


def test_all_roots_and_none_twice(capsys):
    out = printed(capsys, *FOLLOW)
    assert "root 2 lies on path" in out
    assert out.endswith("4 paths, 4 of them left the interval or closed\n")


@pytest.mark.slow
def test_follow_csv_names_columns_by_label(capsys, tmp_path):
    body, labels, frames = gallery.two_node_square(), ("toe", "heel"), []
    for name, problem in (("rows", body), ("labels", body.replace(node_ids=labels))):
        write_problem(problem, tmp_path / f"{name}.npz")
        interval = ("--from", 0, "--to", 10, "--start", 5)
        printed(capsys, "follow", tmp_path / f"{name}.npz", *interval, "--csv", tmp_path / f"{name}.csv")
        frames.append(pd.read_csv(tmp_path / f"{name}.csv"))
    for quantity in ("lambda_n", "lambda_t", "u_n", "u_t", "status"):
        by_row = frames[0][[f"{quantity}_{row}" for row in range(2)]]
        assert not by_row.iloc[:, 0].equals(by_row.iloc[:, 1])
        for row, label in enumerate(labels):
            assert frames[1][f"{quantity}_{label}"].tolist() == by_row.iloc[:, row].tolist()
    assert not {"lambda_n_0", "status_0"} & set(frames[1].columns)
    status, out, _ = run(capsys, "audit", tmp_path / "labels.npz", tmp_path / "labels.csv", "--json", "-")
    assert status in (0, 3)
    assert json.loads(out)["off"] == []


def test_columns_go_by_row_where_two_labels_are_the_same_text():
    problem = gallery.two_node_square().replace(node_ids=["1", 1])
    path = follow(problem, enumerate_roots(problem, 5.0)[0], interval=(0.0, 10.0))
    assert {"lambda_n_0", "lambda_n_1", "status_1"} <= set(path.to_frame().columns)


def test_follow_csv_and_json(capsys, tmp_path):
    file = tmp_path / "paths.json"
    out = printed(capsys, *FOLLOW, "--root", 1, "--csv", "-", "--json", file)
    rows = list(csv.DictReader(io.StringIO(out)))
    assert {row["path"] for row in rows} == {"0", "1"}
    assert {row["direction"] for row in rows} == {"1", "-1"}
    content = json.loads(file.read_text())
    assert [path["direction"] for path in content["paths"]] == [1, -1]
    assert sum(len(path["points"]["alpha"]) for path in content["paths"]) == len(rows)
    folds = [fold for path in content["paths"] for fold in path["folds"]]
    assert folds == [pytest.approx(8 / 3, abs=1e-12)]
    (turn,) = [item for path in content["paths"] for item in path["transitions"]]
    assert (turn["before"], turn["after"], turn["local_branch"]) == (["slip-"], ["stick"], False)


def test_closed_branches_are_followed_once(capsys, tmp_path):
    write_problem(closed_branch(), tmp_path / "closed.npz")
    out = printed(capsys, "follow", tmp_path / "closed.npz", "--from", -3, "--to", 3, "--start", 0.1)
    assert "closed" in out
    assert out.count("path ") >= 2
    assert "lies on path" in out


@pytest.mark.slow
def test_steps_can_be_set(capsys):
    def rows(*options):
        return len(printed(capsys, *FOLLOW, "--root", 0, "--direction", "+1", "--csv", "-", *options).splitlines())

    assert rows("--h-max", 0.1) > 2 * rows() > 2 * rows("--h-max", 5)
    # the first step is no longer than the longest
    assert rows("--h-max", 0.05) > 200


def test_the_algorithm_as_printed_jumps_and_the_audit_says_so(capsys, tmp_path):
    file = tmp_path / "points.csv"
    run(capsys, *FOLLOW, "--root", 2, "--direction", "-1", "--no-check-steps", "--h-max", 0.5, "--csv", file)
    out = printed(capsys, *AUDIT, file, "--from", 0, "--to", 20, status=3)
    assert "jumps             1\n" in out
    assert "branch 1 -> 0" in out


def test_step_limit_is_status_3(capsys):
    out = printed(capsys, *FOLLOW, "--root", 0, "--max-steps", 3, status=3)
    assert "the limit of 3 steps was reached" in out


def test_degenerate_starts(capsys):
    example = ("follow", "gallery:one-node-6.1", "--from", 0, "--to", 20, "--start", "8/3")
    # the fold itself: one tangent of each orientation, on both arcs
    assert "2 paths" in printed(capsys, *example, "--root", 1)
    # where stick and slip of both nodes meet: several tangents, and the user is told how to choose
    chain = ("follow", "gallery:chain-2", "--from", 0, "--to", 6, "--start", "8/3")
    assert "choose with tangent=k" in printed(capsys, *chain, status=3)
    forward = (*chain, "--root", 3, "--direction", "+1")
    assert_refused(*run(capsys, *forward), "admissible tangents have orientation +1")
    printed(capsys, *forward, "--tangent", 0)


@pytest.mark.slow
def test_follow_plots(capsys, tmp_path, graph):
    file = tmp_path / "path.png"
    for options in ((), ("--graph", graph, "--quantity", "u_t", "--node", "0")):
        printed(capsys, *FOLLOW, "--plot", file, *options)
        assert file.read_bytes().startswith(b"\x89PNG")
        file.unlink()


@pytest.mark.slow
def test_ctrl_c_prints_the_paths_so_far(tmp_path):
    result = tmp_path / "points.csv"
    # a second or more a path
    options = ("--h-max", 0.02, "--max-steps", 10**6, "--csv", result)
    with on_terminal(*FOLLOW, *options) as (process, wait_for):
        wait_for(b"paths")
        process.send_signal(2)
        out, _ = process.communicate(timeout=120)
    assert process.returncode == 130
    assert out.startswith("path 0, from root 0 in direction +1")
    assert out.endswith(" left the interval or closed (interrupted)\n")
    assert "root 2" not in out
    assert pd.read_csv(result)["path"].nunique() >= 2


# -- audit -------------------------------------------------------------------------------------------------------------


def test_audit_of_all_branches(capsys, points):
    out = printed(capsys, *AUDIT, points)
    assert ": ok, complete" in out
    assert "jumps             0" in out
    assert "3 visited, 0 missed" in out
    # the interval is that of the points
    assert "graph for alpha in [0, 20], 3 arcs" in out


def test_audit_names_a_missed_branch(capsys, points, tmp_path):
    frame, some = pd.read_csv(points), tmp_path / "some.csv"
    frame[frame["root"] > 0].to_csv(some, index=False)
    assert "arc 0 of branch 0, alpha from 0 to 20: open" in printed(capsys, *AUDIT, some, "--from", 0, status=3)


def test_audit_reads_stdin(capsys, points, monkeypatch):
    monkeypatch.setattr("sys.stdin", io.StringIO(points.read_text()))
    assert ": ok, complete" in printed(capsys, *AUDIT, "-")


def test_audit_reads_points_before_it_searches(capsys, tmp_path, monkeypatch):
    file = tmp_path / "bad.csv"
    file.write_text("alpha,lambda_n_0\n1,2\n2,2\n")
    monkeypatch.setattr("enumsol.cli.graph.build", lambda *_, **__: pytest.fail("the graph was built"))
    assert_refused(*run(capsys, *AUDIT, file), "no column 'lambda_t_0'")


def test_ctrl_c_audits_what_was_found(capsys, points, monkeypatch):
    partial = branch_graph(gallery.get("one-node-6.1").build(), (0.0, 20.0), max_nodes=3)

    def interrupted(*_, **__):
        raise Interrupted("interrupted", partial)

    monkeypatch.setattr("enumsol.cli.graph.build", interrupted)
    assert "but the graph is not complete: stopped" in printed(capsys, *AUDIT, points, status=130)


# -- bad input ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "part"),
    [
        (("--direction", "2"), "--direction is 2; expected +1, -1 or both"),
        (("--root", 3), "--root is 3; expected a number below 3, the number of roots at alpha = 5"),
        (("--tangent", 0), "--tangent is given without --root or --direction"),
        (("--root", 0, "--direction", "+1", "--tangent", 9), "tangent is 9; expected an index below 2"),
        (("--h-max", -1), "options.h_max is -1.0; expected a finite number > 0"),
        (("--h-min", 3), "options.h_init is 0.05"),
        (("--eps", 0), "options.eps is 0.0"),
        (("--graph", "graph.json"), "--graph is given without --plot"),
        (("--node", "7"), "there is no contact node 7"),
        (("--plot", "p.xyz"), "--plot is p.xyz; expected a file name that ends in"),
        (("--csv", "-", "--json", "-"), "--json and --csv are both -"),
        (("--graph", "graph.json", "--plot", "p.png"), "graph.json cannot be read"),
    ],
)
def test_bad_follow_calls_get_one_sentence(capsys, tmp_path, monkeypatch, options, part):
    monkeypatch.chdir(tmp_path)
    assert_refused(*run(capsys, *FOLLOW, *options), part)
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("alpha", "name", "part"),
    [
        (25, "one-node-6.1", "--start is 25; expected an alpha between 0 and 20"),
        (2, "one-node-6.3", "there is no isolated root at alpha = 2 (complete: yes (proven))"),
        ("two", "one-node-6.3", "--start is 'two'"),
    ],
)
def test_bad_starts(capsys, alpha, name, part):
    assert_refused(*run(capsys, "follow", f"gallery:{name}", "--from", 0, "--to", 20, "--start", alpha), part)


def test_bad_points_get_one_sentence(capsys, tmp_path, points, graph):
    file = tmp_path / "bad.csv"
    assert_refused(*run(capsys, *AUDIT, file), "expected a CSV file of points")
    for text, part in (
        ("", "expected a CSV file of points"),
        ("lambda_n_0,lambda_t_0\n1,2\n", "no column 'alpha'"),
        ("alpha,lambda_n_0,lambda_t_0\n1,0,0\n", "alpha goes from 1 to 1; expected an interval"),
    ):
        file.write_text(text)
        assert_refused(*run(capsys, *AUDIT, file), part)
    assert_refused(*run(capsys, *AUDIT, points, "--graph", graph, "--to", 3), "a graph has its own interval")
    other = ("audit", "gallery:one-node-6.2", points, "--graph", graph)
    assert_refused(*run(capsys, *other), "a graph of another problem")
    assert_refused(*run(capsys, *AUDIT, points, "--graph", points), "it is not JSON")


def test_two_node_branches_end_to_end(capsys, tmp_path):
    file = tmp_path / "points.csv"
    write_problem(gallery.get("two-node-6.4").build(), tmp_path / "p.npz")
    printed(capsys, "follow", tmp_path / "p.npz", "--from", 0, "--to", 10, "--start", 3.5, "--csv", file)
    printed(capsys, "audit", tmp_path / "p.npz", file, "--arithmetic", "exact")


def test_a_path_in_3d_passes_the_roots_that_lie_on_it_and_no_others():
    """Of three roots of a node two slip, as one branch does before and after its fold."""
    node = OneNode(1, load=True)
    fold = node.alpha(node.folds()[0])
    roots = enumerate_roots(node.problem, fold - 0.01)
    assert [root.statuses[0].value for root in roots] == ["stick", "slip", "slip"]
    before = {way: follow(node.problem, roots[1], way, (fold - 0.015, fold + 0.005)) for way in (1, -1)}
    around = next(path for path in before.values() if path.folds)
    straight = next(path for path in before.values() if not path.folds)
    passed = [[_passes(path, root, node.problem) for root in roots] for path in (straight, around)]
    assert passed == [[False, True, False], [False, True, True]]


def test_follow_takes_problems_in_3d(capsys, tmp_path):
    file = tmp_path / "points.csv"
    sliding = ("follow", "gallery:block3d-4", "--from", 0, "--to", 0.5, "--start", 0.25, "--csv", file)
    assert "left the interval or closed" in printed(capsys, *sliding)
    assert "lambda_t2_" in file.read_text().splitlines()[0]
