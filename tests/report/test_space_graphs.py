"""The page of a graph in 3D: its numbers against arcs and roots, its words, and how it works in a headless browser."""

import re

import numpy as np
import pytest
from branches.test_degenerate import pair
from browser import find_browser
from command_line import printed
from pages import data_of, text_of
from parted_solids import solid
from problems3d import SLIDING

import enumsol
from enumsol import branch_graph, fem, gallery, write_report
from enumsol.branches import ways
from enumsol.branches.figures.curves import QUANTITIES, curves
from enumsol.model.shapes import body_mesh, contact_forces
from enumsol.report.parts import given_section

pytest.importorskip("plotly")
in_a_browser = pytest.mark.skipif(find_browser() is None, reason="no headless browser (Debian's package chromium)")


#: A node that slips under a load that turns: its friction has one size, and its direction is that of the load.
TURNING = enumsol.ContactProblem3D(
    np.eye(3), *np.eye(3)[:, None], [2.0, 3.0, 0.5], friction=1.0, load_slope=[0.0, 0.0, 3.0]
)


@pytest.fixture(scope="module")
def turning():
    return branch_graph(TURNING, (0.0, 0.5))


@pytest.fixture(scope="module")
def wedge():
    return branch_graph(gallery.get("wedge3d-2-3").build(), (1.0, 1.05))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("pages")


@pytest.fixture(scope="module")
def node_page(turning, folder):
    write_report(turning, folder / "node.html", units=("N", "mm"))
    return folder / "node.html"


@pytest.fixture(scope="module")
def wedge_page(wedge, folder):
    write_report(wedge, folder / "wedge.html")
    return folder / "wedge.html"


def check_arcs(data, graph):
    for record, arc in zip(data["arcs"], graph.arcs, strict=True):
        assert [data["statuses"][int(code)] for code in record["statuses"]] == [s.value for s in arc.statuses]
        for k in range(0, len(record["a"]), 5):
            forces, moves = arc.state(record["a"][k])
            np.testing.assert_allclose(record["f"][k], forces, rtol=1e-8, atol=1e-15)
            np.testing.assert_allclose(record["w"][k], moves, rtol=1e-8, atol=1e-15)
    for record, v in zip(data["vertices"], graph.vertices, strict=True):
        p = len(v.statuses)
        np.testing.assert_allclose(np.reshape(record["f"], (3, p))[1:].T, v.lambda_t, rtol=1e-8)
        np.testing.assert_allclose(np.reshape(record["w"], (3, p))[1:].T, v.u_t, rtol=1e-8)


def test_the_numbers_of_a_node_and_the_words(turning, node_page):
    data, text = data_of(node_page), text_of(node_page)
    check_arcs(data, turning)
    assert data["tangents"] == 2
    assert data["no_body"] == "The problem has no mesh and no coordinates, so no body is drawn"
    assert "3^1 = 3, and a direction for every node that slips" in text
    assert "F1 = 1, F2 = 1" in text
    assert text.count("complete: yes (proven)") == 2
    assert "one solution throughout" in text


def test_components_are_near_the_arcs_where_forces_turn(turning):
    """The length of the friction force alone would need two points."""
    assert turning.complete
    (arc,) = turning.arcs
    curve = curves([arc], tuple(QUANTITIES), 0.5, 1e-3, components=True)[arc.number]
    assert len(curve.values[0]) == len(QUANTITIES) + 6
    for alpha in np.linspace(0.01, 0.49, 25):
        near = [np.interp(alpha, curve.alphas, column) for column in curve.forces.T]
        load = np.array([3.0, 0.5 + 3.0 * alpha])
        assert near == pytest.approx([2.0, *(2.0 * load / np.linalg.norm(load))], abs=4e-3)


@pytest.mark.slow
def test_the_bodies_of_a_graph_move_as_the_roots_say(wedge, wedge_page):
    data = data_of(wedge_page)
    check_arcs(data, wedge)
    body, alpha = data["body"], 1.02
    mesh = body_mesh(wedge.problem)
    node = [int(np.argmin(np.linalg.norm(mesh.points - point, axis=1))) for point in np.array(body["points"])]
    roots = wedge.roots_at(alpha)
    assert len(roots) == 3
    for root in roots:
        forces = np.concatenate([root.lambda_n, root.lambda_t.ravel("F")])
        u = np.array(body["u0"]) + alpha * np.array(body["u1"]) - forces @ np.array(body["c"])
        terms = np.max(np.abs(body["u0"])) + np.max(np.abs(forces) @ np.abs(body["c"]))
        np.testing.assert_allclose(u.reshape(-1, 3), mesh.displacements(root.u)[node], atol=1e-6 * terms)
        nodal = np.zeros_like(mesh.points)
        for force, acts in zip(forces, body["acts"], strict=True):
            for k, *act in acts:
                nodal[node[k]] += force * np.array(act)
        expected = contact_forces(wedge.problem, root.lambda_n, root.lambda_t)
        np.testing.assert_allclose(nodal, expected, atol=1e-6 * np.max(np.abs(expected), initial=1e-30))


def test_options_of_plane_bodies_are_not_told_of_a_solid():
    options = {"young": 2, "poisson": 0.3, "contact": "bottom", "clamp": "left", "load": {"top": (0.1, 0, -0.3)}}
    scene = fem.mesh_scene(solid((2, 1, 1), 8), **options, friction=0.4)
    told = re.findall(r'<tr><th scope="row">(.*?)</th>', given_section(scene, ("N", "mm")))
    assert told == ["young", "poisson", "contact", "friction", "clamp", "load", "gap"]


@pytest.mark.slow
def test_the_command_takes_a_problem_in_3d(tmp_path, capsys):
    enumsol.write_problem(TURNING, tmp_path / "node.npz")
    page, proof = tmp_path / "node.html", tmp_path / "node.proof"
    command = ("report", tmp_path / "node.npz", "--from", 0, "--to", "1/4", "-o", page)
    assert printed(capsys, *command, "--proof", proof).endswith("complete: yes (proven)\n")
    assert f"enumsol verify {tmp_path / 'node.npz'} {proof}" in text_of(page)
    assert printed(capsys, *command, "--jobs", 2).endswith("complete: yes (proven)\n")
    enumsol.write_problem(SLIDING, tmp_path / "node.npz")
    printed(capsys, *command, "--to", 3, "--max-nodes", 1, status=3)
    assert "This graph is not complete" in text_of(page)


# -- in a browser -----------------------------------------------------------------------------------------------------


@in_a_browser
def test_a_node_has_bars_and_lengths_of_tangential_vectors(browser, node_page, turning):
    browser.show(node_page, 400)
    assert browser.evaluate("document.documentElement.scrollWidth") <= 400
    assert browser.evaluate("document.querySelectorAll('#cards svg.bars rect').length") == 6
    arc = turning.arcs[0]
    for name in ("sum_t", "lambda_t", "u_t", "lambda_n"):
        browser.choose("quantity", name)
        trace = f"byId('diagram').data.find((t) => t.meta === {arc.number})"
        x, y = (browser.evaluate(f"{trace}.{part}[3]") for part in ("x", "customdata"))
        n, t = arc.values(x)
        slip = arc.displacements(x)[1]
        expected = {"lambda_n": n[0], "u_t": np.linalg.norm(slip)}.get(name, np.linalg.norm(t))
        assert y == pytest.approx(expected, rel=1e-8)
    heads = "[...document.querySelectorAll('#cards th')].map((h) => h.textContent)"
    browser.open_details()
    assert " ".join(browser.evaluate(heads)[:8]) == "node status lambda_n lambda_t1 lambda_t2 u_n u_t1 u_t2"
    assert browser.complaints() == []


@pytest.mark.long
@in_a_browser
def test_bodies_follow_the_slider(browser, wedge_page, wedge):
    browser.show(wedge_page, 1000, 500)
    everywhere = "scenes.length === 3 && scenes.every((s) => s.dataset.drawn)"
    browser.wait_for(everywhere)
    browser.evaluate("window.first = [...scenes]; showAlpha(1.02)")
    browser.wait_for(everywhere)
    # a browser makes few of them: they are taken again
    assert browser.evaluate("scenes.every((s, k) => s === first[k] && s.isConnected)")
    cones = browser.evaluate("scenes.map((s) => s.data.filter((t) => t.type === 'cone').map((t) => t.x.length))")
    expected = []
    for root in wedge.roots_at(1.02):
        forces = contact_forces(wedge.problem, root.lambda_n, root.lambda_t)
        counts = [int(np.sum(np.any(forces != 0, axis=1))), sum(s.value == "slip" for s in root.statuses)]
        expected.append([count for count in counts if count])
    assert sorted(cones) == sorted(expected)
    marks = browser.evaluate("scenes.map((s) => s.data.filter((t) => t.mode === 'markers').map((t) => t.name))")
    assert sorted(marks) == sorted([sorted({s.value for s in root.statuses}) for root in wedge.roots_at(1.02)])
    assert browser.evaluate("document.documentElement.scrollWidth") <= 1000
    assert browser.complaints() == []


@in_a_browser
def test_a_graph_without_arcs_says_that_none_was_found(browser, folder):
    graph = branch_graph(TURNING, (0.0, 0.5), max_nodes=1, time_limit=1e-9)
    assert not graph.arcs
    write_report(graph, folder / "none.html")
    text = text_of(folder / "none.html")
    assert text.count("None was found.") == 2
    assert "no status changes" not in text
    browser.show(folder / "none.html", 1000, 500)
    assert browser.evaluate("byId('count').textContent") == "0 solutions found, at least 1 exists at alpha = 0.25"
    assert browser.complaints() == []


@in_a_browser
def test_no_arc_is_drawn_beyond_its_ends(browser, folder, monkeypatch):
    """Beside a place that balls leave open arcs end before the vertex that stands for it."""
    monkeypatch.setattr(ways, "FAST_EXACT_DOF", 0)
    monkeypatch.setattr(ways, "LARGEST_EXACT_WORK", 0)
    graph = branch_graph(pair(0.0), (2.9, 3.1))
    (gap,) = (v for v in graph.vertices if v.kind == "unsettled")
    late = max((arc for arc in graph.arcs if arc.tail == gap.number), key=lambda arc: arc.lo)
    assert gap.alpha < late.lo
    write_report(graph, folder / "gap.html")
    browser.show(folder / "gap.html", 1000, 500)
    for alpha in (0.5 * (gap.alpha + late.lo), 3.05):
        browser.evaluate(f"showAlpha({alpha!r})")
        held = [f"arc {arc.number}" for arc in graph.arcs if arc.lo < alpha < arc.hi and gap.number != arc.head]
        assert browser.evaluate("solutionsAt(state.alpha).map((item) => item.key)") == held
    assert browser.complaints() == []
