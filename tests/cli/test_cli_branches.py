import csv
import importlib.util
import io
import json

import numpy as np
import pytest
from branches.test_degenerate import pair
from command_line import assert_refused, on_terminal, printed, run
from interruptions import CtrlC

from enumsol import BranchGraph, gallery, write_problem

#: Whether verdicts are shown without being asked for depends on the clock.
UNTOLD = ("--no-stability",)
GRAPH = ("graph", "gallery:one-node-6.1", *UNTOLD, "--from", 0, "--to", 20)
TABLE = ("table", "gallery:one-node-6.1")
SAMPLED = ("table", "gallery:two-node-6.4", "--from", 0, "--to", 10)


# -- table -------------------------------------------------------------------------------------------------------------


def test_table_of_the_first_example(capsys):
    out = printed(capsys, *TABLE, "--from", 1, "--to", 5, "--samples", 5, "--arithmetic", "verified")
    rows = [line.split() for line in out.splitlines()[1:6]]
    assert [(row[0], row[1]) for row in rows] == [("1", "1"), ("2", "1"), ("3", "3"), ("4", "3"), ("5", "3")]
    assert out.endswith("complete: yes (proven at all 5 alphas; says nothing about those in between)\n")
    assert max(map(len, out.splitlines())) <= 80


def test_listed_alphas_may_be_fractions(capsys):
    out = printed(capsys, *TABLE, "--alphas", "1, 8/3,5", "--csv", "-")
    assert [row["roots"] for row in csv.DictReader(io.StringIO(out))] == ["1", "2", "3"]
    out = printed(capsys, *TABLE, "--from", "7/3", "--to", "3", "--samples", 3)
    assert [line.split()[1] for line in out.splitlines()[1:4]] == ["1", "2", "3"]


def test_long_tables_are_printed_as_runs(capsys):
    out = printed(capsys, *SAMPLED, "--samples", 101, "--arithmetic", "fast")
    rows = [line.split() for line in out.splitlines()[1:5]]
    assert [row[:3] for row in rows] == [["0", "2.9", "1"], ["3", "3", "3"], ["3.1", "3.8", "5"], ["3.9", "10", "3"]]
    assert out.endswith("complete: not proven (0 undecided)\n")


@pytest.mark.slow
def test_table_as_json_and_with_jobs(capsys, tmp_path):
    file = tmp_path / "table.json"
    arguments = ("table", "gallery:two-node-6.5", "--from", 0, "--to", 9, "--samples", 7, "--json")
    assert run(capsys, *arguments, file, "--jobs", 2)[0] == 0
    spread, serial = json.loads(file.read_text()), json.loads(printed(capsys, *arguments, "-"))
    assert [row["roots"] for row in spread["rows"]] == [1, 1, 1, 3, 3, 3, 3]
    for name in ("alpha", "roots", "families", "index_sum", "complete"):
        assert [row[name] for row in spread["rows"]] == [row[name] for row in serial["rows"]]


@pytest.mark.parametrize("arithmetic", ["verified", "fast"])
def test_table_cut_short_is_status_3(capsys, arithmetic):
    command = ("table", "gallery:chain-4", "--from", 1, "--to", 5, "--samples", 3, "--max-nodes", 3)
    out = printed(capsys, *command, "--arithmetic", arithmetic, status=3)
    assert "complete: no (at " in out
    assert "undecided" in out.splitlines()[0]


@pytest.mark.slow
def test_ctrl_c_prints_the_table_so_far(tmp_path):
    file, result = tmp_path / "chain.npz", tmp_path / "table.csv"
    write_problem(gallery.chain(6, 0.05), file)
    arguments = ("--from", 1, "--to", 5, "--samples", 400, "--csv", result)
    with on_terminal("table", file, *arguments) as (process, wait_for):
        wait_for(b"alphas")
        process.send_signal(2)
        out, _ = process.communicate(timeout=120)
    assert process.returncode == 130
    assert out.splitlines()[-1].startswith("complete: no (interrupted after ")
    assert 1 < len(result.read_text().splitlines()) < 400


# -- graph -------------------------------------------------------------------------------------------------------------


def test_graph_of_the_first_example(capsys):
    out = printed(capsys, *GRAPH)
    assert "branches 2, arcs 3" in out
    assert "folds at 2.66667" in out
    assert "one solution below alpha = 2.6666667" in out
    assert out.endswith("complete: yes (proven)\n")
    assert max(map(len, out.splitlines())) <= 100


def test_graph_answers(capsys):
    out = printed(capsys, "graph", "gallery:one-node-6.2", *UNTOLD, "--from", 0, "--to", 20, "--arithmetic", "fast")
    assert "one solution throughout" in out
    assert out.endswith("complete: not proven (degrees balance at every vertex)\n")
    for name, low, high, said in (
        ("one-node-6.3", 0, 20, "bifurcations at alpha = 2\n"),
        ("one-node-6.1", 3, 20, "several solutions from the first alpha on"),
        ("two-node-6.7-minus", -3, 3, "jumps with increasing alpha at 2.5714286"),
    ):
        assert said in printed(capsys, "graph", f"gallery:{name}", *UNTOLD, "--from", low, "--to", high)


def test_graph_files(capsys, tmp_path):
    files = {name: tmp_path / f"graph.{name}" for name in ("save", "json", "csv", "graphml", "plot")}
    files["plot"] = tmp_path / "graph.png"
    out = printed(capsys, *GRAPH, *(part for name, file in files.items() for part in (f"--{name}", file)))
    assert "branches 2" in out
    assert len(BranchGraph.load(files["save"]).arcs) == 3
    content = json.loads(files["json"].read_text())
    assert content["folds"] == [pytest.approx(8 / 3)]
    assert [branch["arcs"] for branch in content["branch_list"]] == [[0], [1, 2]]
    assert (len(content["arc_list"]), len(content["vertex_list"])) == (3, 5)
    rows = list(csv.DictReader(io.StringIO(files["csv"].read_text())))
    assert sorted(row["statuses"] for row in rows) == ["open", "slip-", "stick"]
    assert files["graphml"].read_text().startswith("<?xml")
    assert files["plot"].read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_a_proof_that_leaves_arcs_open_is_not_complete(capsys, tmp_path):
    problem, proof = tmp_path / "pair.npz", tmp_path / "pair.proof"
    write_problem(pair(0.0), problem)  # two conditions vanish at one alpha
    assert run(capsys, "graph", problem, "--from", "0", "--to", "6", "--proof", proof)[0] == 0
    status, out, _ = run(capsys, "verify", problem, proof, "--json", tmp_path / "report.json")
    assert (status, out.splitlines()[-1]) == (3, "  complete: no")
    content = json.loads((tmp_path / "report.json").read_text())
    assert (content["ok"], content["complete"]) == (True, False)


def test_a_graph_has_a_proof(capsys, tmp_path):
    file = tmp_path / "graph.proof"
    assert run(capsys, *GRAPH, "--proof", file)[0] == 0
    out = printed(capsys, "verify", "gallery:one-node-6.1", file)
    assert "proof: verified for alpha in [0, 20]" in out
    assert "complete: yes" in out
    assert run(capsys, "verify", "gallery:one-node-6.2", file)[0] == 2
    file.unlink()
    note = "enumsol: note: no proof was written, only verified arithmetic gives one\n"
    assert run(capsys, *GRAPH, "--proof", file, "--arithmetic", "exact")[::2] == (0, note)
    assert not file.exists()


@pytest.mark.slow
def test_graph_plots_chosen_nodes_and_quantities(capsys, tmp_path):
    for ending, options in (("svg", ("--quantity", "u_t", "--nodes", "1")), ("pdf", ("--nodes", "0,1"))):
        file = tmp_path / f"graph.{ending}"
        printed(capsys, "graph", "gallery:two-node-6.5", *UNTOLD, "--from", 0, "--to", 9, "--plot", file, *options)
        assert file.stat().st_size > 1000


def test_graph_cut_short_is_status_3(capsys):
    out = printed(
        capsys, "graph", "gallery:chain-4-coupled", *UNTOLD, "--from", 0, "--to", 5, "--max-nodes", 5, status=3
    )
    assert out.splitlines()[-1].startswith("complete: no (")


@pytest.mark.slow
def test_graph_with_jobs(capsys, tmp_path):
    outputs = []
    for jobs in (1, 2):
        graph, proof = tmp_path / f"{jobs}.graph", tmp_path / f"{jobs}.proof"
        arguments = ("--from", 0, "--to", 5, "--jobs", jobs, "--save", graph, "--proof", proof)
        out = printed(capsys, "graph", "gallery:two-node-6.4", *UNTOLD, *arguments)
        outputs.append((out, proof.read_bytes()))
    assert outputs[0] == outputs[1]
    assert run(capsys, "verify", "gallery:two-node-6.4", proof)[0] == 0


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("jobs", [1, 2])
def test_ctrl_c_stops_a_graph(jobs):
    with on_terminal("graph", "gallery:wedge-32-5", "--from", 0, "--to", 5, "--jobs", jobs) as (process, wait_for):
        wait_for(b"search")
        process.send_signal(2)
        process.communicate(timeout=120)
    assert process.returncode == 130


# -- bad input ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (TABLE, "expected --from and --to, or --alphas"),
        ((*TABLE, "--from", 1), "expected --from and --to, or --alphas"),
        ((*TABLE, "--from", 5, "--to", 1), "--from is 5 and --to is 1; expected the first below the second"),
        ((*TABLE, "--from", 1, "--to", 5, "--alphas", "1"), "--alphas and --from or --to are both given"),
        ((*TABLE, "--alphas", "1,two"), "--alphas[1] is 'two'"),
        ((*TABLE, "--alphas", "1,-1"), "friction at alpha = -1 is -1 at contact node 0"),
        ((*TABLE, "--from", 0, "--to", 1, "--samples", 1), "--samples is '1'; expected at least 2"),
        ((*TABLE, "--from", 0, "--to", 1, "--csv", "-", "--json", "-"), "--json and --csv are both -"),
        ((*GRAPH, "--json", "/no/where.json"), "--json is /no/where.json, which cannot be written"),
        ((*GRAPH, "--save", "-"), "--save is -; expected the name of a file"),
        ((*GRAPH, "--plot", "-"), "a figure is a binary file"),
        ((*GRAPH, "--plot", "graph.txt"), "--plot is graph.txt; expected a file name that ends in .png, .pdf or .svg"),
        ((*GRAPH, "--plot", "graph"), "--plot is graph; expected a file name that ends in"),
        ((*GRAPH, "--plot", "graph.png", "--nodes", "0,7"), "there is no contact node 7; expected one of 0"),
        ((*GRAPH, "--quantity", "sigma"), "--quantity is 'sigma'; expected one of"),
        ((*GRAPH[:-1], "-1"), "--from is 0 and --to is -1"),
        (("graph", "gallery:one-node-6.1", "--from", "-1", "--to", "1"), "negative in the interval"),
        (("graph", "gallery:one-node-6.1", "--from", "0"), "missing option '--to'"),
        (("graph", "gallery:nothing", "--from", "0", "--to", "1"), "no problem named 'nothing'"),
        ((*GRAPH, "--time-limit", "-1"), "--time-limit is -1.0"),
    ],
)
def test_bad_calls_get_one_sentence(capsys, tmp_path, monkeypatch, arguments, part):
    monkeypatch.chdir(tmp_path)
    assert_refused(*run(capsys, *arguments), part)
    assert not any(tmp_path.iterdir())


def test_without_matplotlib_the_extra_is_named(capsys, monkeypatch, tmp_path):
    find = importlib.util.find_spec
    monkeypatch.setattr("enumsol.cli.options.find_spec", lambda name: None if name == "matplotlib" else find(name))
    answer = run(capsys, *GRAPH, "--plot", tmp_path / "graph.png")
    assert_refused(*answer, "--plot needs matplotlib", 'pip install "enumsol[plots]"')


def test_json_has_no_nan(capsys):
    out = printed(capsys, "table", "gallery:one-node-6.3", "--alphas", "2", "--json", "-")
    assert "NaN" not in out
    (row,) = json.loads(out)["rows"]
    assert row["families"] == 1
    assert np.isfinite(row["alpha"])


# -- plots of graphs that were cut short -------------------------------------------------------------------------------


#: Among them graphs without any arc, with arcs that end in the middle, and with a continuum.
NAMES = ("one-node-6.1", "one-node-6.3", "two-node-6.4", "two-node-6.7-minus", "clamped-block-8")


def draw(capsys, tmp_path, name, *options, status):
    """The last line of what a command prints that plots a graph and ends with this status."""
    file = tmp_path / "graph.png"
    command = ("graph", f"gallery:{name}", *UNTOLD, "--from", 0, "--to", 10, "--plot", file)
    out = printed(capsys, *command, *options, status=status)
    assert file.read_bytes().startswith(b"\x89PNG")
    return out.splitlines()[-1]


@pytest.mark.few(0, 2)
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("nodes", [1, 2, 5, 7])
def test_after_so_many_nodes(capsys, tmp_path, tree_only, name, nodes):
    quantity = "lambda_n" if nodes != 2 else "u_t"
    last = draw(capsys, tmp_path, name, "--max-nodes", nodes, "--quantity", quantity, status=3)
    assert last.startswith(f"complete: no (stopped after max_nodes = {nodes} node")


def test_after_no_time(capsys, tmp_path):
    last = draw(capsys, tmp_path, "two-node-6.4", "--time-limit", 1e-9, status=3)
    assert last.startswith("complete: no (stopped by the time limit")


def test_after_ctrl_c(capsys, tmp_path, monkeypatch):
    # the first word of progress comes from the search
    monkeypatch.setattr("enumsol.cli.progress.Display.show", CtrlC())
    assert draw(capsys, tmp_path, "wedge-8-5", status=130).startswith("complete: no (interrupted after ")


# -- columns of tables -------------------------------------------------------------------------------------------------


CAPTION = "open, stick, slip+, slip-: how many of the roots have a node in that status"


def test_the_columns_are_explained_below_them(capsys):
    lines = printed(capsys, *SAMPLED, "--samples", 3).splitlines()
    assert lines[0].split()[:2] == ["alpha", "roots"]
    assert {"open", "stick", "slip+", "slip-"} <= set(lines[0].split())
    assert lines[4] == CAPTION
    assert len(lines) == 7  # heading, three rows, caption, blank, closing line


def test_rows_of_several_alphas_say_so(capsys):
    out = printed(capsys, *SAMPLED, "--samples", 101)
    lines = out.splitlines()
    assert lines[0].startswith("first alpha last alpha  roots")
    assert "to alpha" not in out
    assert CAPTION in lines
    assert "each row stands for all alphas tried from the first to the last, which have equal counts" in lines
    assert max(map(len, lines)) <= 90


def test_an_empty_table_explains_nothing(capsys, monkeypatch):
    monkeypatch.setattr("enumsol.branches.samples.table_row", CtrlC())
    out = printed(capsys, *SAMPLED, "--samples", 3, status=130)
    assert out == "\ncomplete: no (interrupted after 0 of 3 alphas)\n"


# -- bodies that nothing holds -----------------------------------------------------------------------------------------


def test_a_graph_that_there_is_not_is_refused_in_the_words_of_commands(capsys):
    name, interval = "gallery:block-on-table-5", ("--from", 0, "--to", 1)
    assert_refused(*run(capsys, "graph", name, *interval, "--arithmetic", "fast"), "--arithmetic is fast for a body")
