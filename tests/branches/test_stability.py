"""Which arcs run away: verdicts of graphs, and that what follows shows them."""

import json
import time
from itertools import pairwise

import networkx as nx
import numpy as np
import pytest

import enumsol
from enumsol.support.deadlines import Deadline, TimeOverError, within

QUIET, AWAY = "does not run away", "runs away"


@pytest.fixture
def triangle():
    return enumsol.branch_graph(enumsol.gallery.one_node_triangle(), (0, 3))


@pytest.fixture(scope="module")
def square():
    found = enumsol.branch_graph(enumsol.gallery.two_node_square(), (0, 10))
    found.stability()
    return found


@pytest.fixture(scope="module")
def untold():
    return enumsol.branch_graph(enumsol.gallery.two_node_square(), (0, 10))


def test_verdicts_of_arcs_are_those_of_their_roots(square):
    found = square.stability()
    assert len(found) == len(square.arcs)
    for arc, spans in zip(square.arcs, found, strict=True):
        assert (spans[0].low, spans[-1].high) == (arc.lo, arc.hi)
        assert all(a.high == b.low for a, b in pairwise(spans))
    alpha = 3.5
    roots = square.roots_at(alpha)
    by_statuses = {
        arc.statuses: span.verdict
        for arc, spans in zip(square.arcs, found, strict=True)
        for span in spans
        if span.low <= alpha <= span.high
    }
    assert {root.statuses: one.verdict for root, one in zip(roots, roots.stability(), strict=True)} == by_statuses
    assert sorted(by_statuses.values()) == [QUIET] * 2 + [AWAY] * 3


def test_short_parts_are_searched_as_a_whole_where_what_serves_in_the_middle_leaves_no_room():
    graph = enumsol.branch_graph(enumsol.gallery.get("dovetail-14").build(), (0.6, 0.75))
    assert [[span.verdict for span in spans] for spans in graph.stability()] == [[QUIET]]


def test_a_mass_that_is_given_counts_and_stays(triangle):
    assert triangle.verdicts is None
    once = triangle.stability(mass=np.eye(2))
    assert triangle.verdicts is not None
    assert triangle.stability() == once == triangle.verdicts
    assert [spans[0].verdict for spans in once] == [QUIET, QUIET, AWAY]
    assert once[2][0].growth[0] < once[2][0].growth[1]


def test_what_is_cut_short_goes_on(triangle):
    with within(Deadline(time.perf_counter() - 1)), pytest.raises(TimeOverError):
        triangle.stability()
    assert triangle.verdicts is None
    with pytest.raises(enumsol.InvalidProblemError):
        triangle.stability(mass=-np.eye(triangle.problem.n))
    found = triangle.stability()
    triangle._found["verdicts"] = [*found[:2]]  # as if it had been cut short there
    assert triangle.verdicts is None
    assert triangle.stability() == found


def test_no_mass_is_refused():
    problem = enumsol.ContactProblem(np.eye(2), [[1, 0]], [[0, 1]], [1, 2], friction=0.5)
    for body in (problem, enumsol.gallery.one_node_3d()):
        graph = enumsol.branch_graph(body, (0, 1))
        with pytest.raises(enumsol.InvalidArgumentError, match="no mass and no mesh; expected mass"):
            graph.stability()


def test_files_keep_verdicts_as_what_they_say(square, tmp_path):
    square.save(tmp_path / "square.json")
    loaded = enumsol.BranchGraph.load(tmp_path / "square.json")
    assert loaded.verdicts == square.verdicts
    assert (square.verdicts_read, loaded.verdicts_read) == (False, True)
    assert "as the file of this graph says, which nothing has checked" in repr(loaded)
    assert (square.summary()["stability_read"], loaded.summary()["stability_read"]) == (False, True)
    assert loaded.stability() == square.stability()
    assert not loaded.verdicts_read
    assert repr(loaded) == repr(square)


def test_verdicts_that_a_file_only_claims_are_found_again(square, tmp_path):
    file = tmp_path / "square.json"
    square.save(file)
    record = json.loads(file.read_text())
    for spans in record["verdicts"]:
        for span in spans:
            span["verdict"] = QUIET
    file.write_text(json.dumps(record))
    loaded = enumsol.BranchGraph.load(file)
    assert {span.verdict for spans in loaded.verdicts for span in spans} == {QUIET}
    assert loaded.stability() == square.stability()


@pytest.mark.parametrize("change", ["missing", "gap", "backwards", "word", "number"])
def test_verdicts_that_do_not_fit_the_arcs_are_refused(square, tmp_path, change):
    file = tmp_path / "square.json"
    square.save(file)
    record = json.loads(file.read_text())
    first = record["verdicts"][0]
    if change == "missing":
        del record["verdicts"][0]
    elif change == "gap":
        first[0]["high"] = 0.5 * (first[0]["low"] + first[0]["high"])
    elif change == "backwards":
        middle = first[0]["high"] + 1
        first[:] = [first[0] | {"high": middle}, first[0] | {"low": middle}]
    elif change == "word":
        first[0]["verdict"] = "stable"
    else:
        first[0]["growth"] = [1, None]
    file.write_text(json.dumps(record))
    with pytest.raises(enumsol.InvalidArgumentError, match=r"square\.json"):
        enumsol.BranchGraph.load(file)


def test_graphml_has_verdicts(square, untold, tmp_path):
    for graph, expected in ((square, square.to_frame().stability.tolist()), (untold, [None] * len(untold.arcs))):
        graph.write_graphml(tmp_path / "square.graphml")
        read = nx.read_graphml(tmp_path / "square.graphml", force_multigraph=True)
        words = {int(number): data.get("stability") for _, _, number, data in read.edges(keys=True, data=True)}
        assert [words[k] for k in range(len(graph.arcs))] == expected
        assert ("stability" in read.graph) is (graph is square)


def lines_of(figure, colour):
    """Line styles of curves of a colour in the first panel."""
    drawn = [line for line in figure.axes[0].lines if line.get_color() == colour and line.get_linewidth() == 1.6]
    return [styled(line) for line in drawn]


def styled(line):
    """The words for a line style."""
    return {None: QUIET, 5: AWAY, 1.2: "undecided"}[(line._unscaled_dash_pattern[1] or [None])[0]]


def legend_of(figure):
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def test_figures_draw_what_runs_away_dashed(square, untold):
    assert {"index +1", "index -1"} <= set(legend_of(untold.plot(zoom=False)))
    figure = square.plot(zoom=False)
    words = legend_of(figure)
    assert words[:2] == [QUIET, AWAY]
    assert not any("index" in word for word in words)
    assert lines_of(figure, "#1f5fa8") == [QUIET]
    assert lines_of(figure, "#d9730d") == [AWAY, QUIET, AWAY, AWAY]
    # of nodes the statuses
    assert set(legend_of(square.plot("lambda_n"))) >= {"open", "stick"}


def test_an_arc_with_several_verdicts_is_drawn_in_pieces(triangle):
    triangle.stability()
    low, high = triangle.arcs[2].lo, triangle.arcs[2].hi
    parts = [(low, 2.75, QUIET), (2.75, 2.76, "undecided"), (2.76, 2.9, AWAY), (2.9, high, "undecided")]
    spans = tuple(enumsol.Span(*part) for part in parts)
    triangle._found["verdicts"] = [*triangle.verdicts[:2], spans]
    figure = triangle.plot("sum_t", zoom=False)
    assert legend_of(figure)[:3] == [QUIET, AWAY, "undecided"]
    drawn = [line for line in figure.axes[0].lines if line.get_linewidth() == 1.6][2:]
    assert [styled(line) for line in drawn] == [part[2] for part in parts]
    assert [(line.get_xdata()[0], line.get_xdata()[-1]) for line in drawn] == [part[:2] for part in parts]
    for line in drawn:
        exact = [triangle.arcs[2].state(min(x, high))[0][1] for x in line.get_xdata()]
        assert line.get_ydata() == pytest.approx(exact, abs=1e-3)
    assert triangle.to_frame().stability.tolist() == [QUIET, QUIET, f"{QUIET}, then {AWAY}, partly undecided"]
    assert [span["verdict"] for span in triangle.summary()["stability"][2]] == [part[2] for part in parts]


def test_printed_graphs_and_tables_show_verdicts(square, untold):
    assert "stability" not in repr(untold)
    assert "stability" not in untold.to_frame()
    assert "stability" not in untold.summary()
    text = repr(square)
    assert f"    stability: {QUIET}\n" in text
    assert f"    stability: {QUIET} (1 arc); {AWAY} (3 arcs)\n" in text
    assert "stability: whether the body can leave it along a straight line" in text
    assert ">stability</th>" in square._repr_html_()
    assert square.to_frame().stability.tolist() == [QUIET, AWAY, QUIET, AWAY, AWAY]


def test_tables_can_leave_out_what_runs_away():
    problem = enumsol.gallery.one_node_triangle()
    table = enumsol.multiplicity_table(problem, [1, 5])
    assert "left_out" not in table
    table = enumsol.multiplicity_table(problem, [1, 5], without="running away")
    assert table["roots"].tolist() == [1, 2]
    assert table["left_out"].tolist() == [0, 1]
    assert table["stability_undecided"].tolist() == [0, 0]
    assert table["with_slip_minus"].tolist() == [0, 0]
    assert table["index_sum"].tolist() == [1, 1]
    fast = enumsol.multiplicity_table(problem, [5], without="running away", arithmetic="fast")
    assert fast[["roots", "left_out", "stability_undecided"]].to_numpy().tolist() == [[3, 0, 3]]


def test_tables_refuse_what_they_cannot_leave_out():
    problem = enumsol.gallery.one_node_triangle()
    with pytest.raises(enumsol.InvalidArgumentError, match="without is 'sliding'"):
        enumsol.multiplicity_table(problem, [1], without="sliding")
    bare = enumsol.ContactProblem(np.eye(2), [[1, 0]], [[0, 1]], [1, 2], friction=0.5)
    with pytest.raises(enumsol.InvalidArgumentError, match="no mass and no mesh"):
        enumsol.multiplicity_table(bare, [1], without="running away")
