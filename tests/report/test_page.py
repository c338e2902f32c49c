"""The page of a report against the graph it was made of: numbers, words, tables; what is escaped; what is refused."""

import base64
import json
import re
import sys
from importlib.resources import files

import numpy as np
import pytest
from command_line import assert_refused, printed, run
from pages import Reader, data_of, page_of, text_of
from path_problems import sheet_of_one_node
from refusals import bad_argument, refusal

import enumsol
from enumsol import MissingDependencyError, branch_graph, enumerate_roots, fem, gallery, histories, write_report
from enumsol.model.cells import boundary_facets
from enumsol.model.shapes import contact_forces
from enumsol.report import graph_page as content, parts as bodies, roots_page
from enumsol.report.graph_page import slider_alphas
from enumsol.report.parts import body_record, short_list
from enumsol.support.plotting import new_figure

pytest.importorskip("plotly")
HOSTILE = '</script><script>alert("2")</script>'
REPORT = ("report", "gallery:two-node-6.4", "--no-stability", "--from", 0, "--to", 10)


def matrices(problem):
    """What a problem has without its mesh."""
    return problem.A, problem.Bn, problem.Bt, problem.f


@pytest.fixture(scope="module")
def wedge():
    return branch_graph(gallery.get("wedge-14-5").build(), (0, 3))


@pytest.fixture(scope="module")
def wedge_page(wedge, tmp_path_factory):
    return page_of(wedge, tmp_path_factory.mktemp("wedge"), title="Wedge in a notch", units=("N", "mm"))


@pytest.mark.slow
def test_the_numbers_are_those_of_the_graph(wedge, wedge_page):
    data = data_of(wedge_page)
    p = wedge.problem.p
    assert (data["interval"], data["complete"]) == ([0, 3], True)
    assert data["nodes"] == [str(label) for label in wedge.problem.node_ids]
    assert (data["steps"]["alphas"], data["steps"]["at"], data["steps"]["between"]) == tuple(
        [float(x) if k == 0 else x for x in part] for k, part in enumerate(wedge.steps)
    )
    assert len(data["arcs"]) == len(wedge.arcs)
    for record, arc in zip(data["arcs"], wedge.arcs, strict=True):
        assert (record["number"], record["branch"]) == (arc.number, wedge.branch_of[arc.number])
        assert (record["tail"], record["head"], record["index"]) == (arc.tail, arc.head, arc.index)
        assert [data["statuses"][int(code)] for code in record["statuses"]] == [s.value for s in arc.statuses]
        assert (record["a"][0], record["a"][-1]) == arc.interval
        for k in range(0, len(record["a"]), 7):
            lambda_n, lambda_t = arc.values(record["a"][k])
            u_n, u_t = arc.displacements(record["a"][k])
            np.testing.assert_allclose(record["f"][k], np.concatenate([lambda_n, lambda_t]), rtol=1e-8)
            np.testing.assert_allclose(record["w"][k], np.concatenate([u_n, u_t]), rtol=1e-8)
    assert [v["alpha"] for v in data["vertices"]] == [v.alpha for v in wedge.vertices]
    for record, v in zip(data["vertices"], wedge.vertices, strict=True):
        assert (record["number"], record["kind"], record["border"]) == (v.number, v.kind.value, v.border)
        np.testing.assert_allclose(record["f"][:p], v.lambda_n, rtol=1e-8)
        np.testing.assert_allclose(record["w"][p:], v.u_t, rtol=1e-8)
        assert set(record["several"]) == {k for k, holds in enumerate(v.active) if len(holds) > 1}
    assert {b["number"]: b["arcs"] for b in data["branches"]} == {
        b.number: [arc.number for arc in b.arcs] for b in wedge.branches
    }


@pytest.mark.slow
def test_interpolated_values_are_near_the_roots(wedge, wedge_page):
    data = data_of(wedge_page)
    for alpha in (1.6, 2.2, 2.9):
        roots = enumerate_roots(wedge.problem, alpha)
        found = []
        for arc in data["arcs"]:
            if arc["a"][0] < alpha < arc["a"][-1]:
                f = np.array(arc["f"])
                found.append(np.array([np.interp(alpha, arc["a"], column) for column in f.T]))
        assert len(found) == len(roots)
        largest = max(np.max(np.abs(root.lambda_n)) for root in roots)
        for root in roots:
            exact = np.concatenate([root.lambda_n, root.lambda_t])
            assert min(np.max(np.abs(values - exact)) for values in found) < 3 * data["tolerance"] * largest


@pytest.mark.slow
def test_bodies_move_as_the_roots_say(wedge, wedge_page):
    body = data_of(wedge_page)["body"]
    mesh = wedge.problem.mesh
    np.testing.assert_allclose(body["points"], mesh.points, atol=1e-6)
    assert body["cells"] == mesh.cells.tolist()
    for root in enumerate_roots(wedge.problem, 2.2):
        forces = np.concatenate([root.lambda_n, root.lambda_t])
        u = np.array(body["u0"]) + 2.2 * np.array(body["u1"]) - forces @ np.array(body["c"])
        scale = np.max(np.abs(body["u0"]))
        np.testing.assert_allclose(u.reshape(-1, 2), mesh.displacements(root.u), atol=1e-6 * scale)
        nodal = np.zeros_like(mesh.points)
        for force, acts in zip(forces, body["acts"], strict=True):
            for node, x, y in acts:
                nodal[node] += force * np.array([x, y])
        expected = contact_forces(wedge.problem, root.lambda_n, root.lambda_t)
        np.testing.assert_allclose(nodal, expected, atol=1e-8 * max(np.max(np.abs(expected)), 1e-30))
    assert [[node for node, _ in row] for row in body["rows"]] == [[node] for node in wedge.problem.node_ids]


@pytest.mark.slow
def test_large_meshes_are_drawn_by_their_boundary_or_not_at_all():
    problem = gallery.clamped_block(80, 80, contact=10)
    body, _ = body_record(problem)
    assert body["cells"] is None
    assert len(body["lines"]) == 320  # edges along the four sides
    assert len(body["points"]) == 320
    # two components of 400 nodes by 200 forces, load and slope of the load
    _, said = body_record(gallery.clamped_block(100, 100))
    assert said.startswith("The mesh is too large to draw: the displacements of 400 nodes on its boundary")
    assert "are 161,600 numbers, and a page holds at most 150,000" in said


def test_what_is_said_of_a_body_that_is_not_drawn(monkeypatch):
    square = gallery.two_node_square()
    bare, meshed = (branch_graph(one, (0, 1)) for one in (enumsol.ContactProblem(*matrices(square)), square))
    made = content.report_content(bare)
    assert (made["body"], made["no_body"]) == (None, "The problem has no mesh, so no body is drawn")
    monkeypatch.setattr(bodies, "MOST_NUMBERS", 10)
    made = content.report_content(meshed)
    assert made["body"] is None
    assert "too large to draw: the displacements of 4 nodes" in made["no_body"]
    monkeypatch.undo()
    made = content.report_content(meshed)
    assert (len(made["body"]["points"]), made["no_body"]) == (4, "")


def test_the_slider_reaches_every_narrow_step():
    critical = [0.0, 0.3, 0.300001, 0.5, 1.0]
    found = slider_alphas(critical, (0.0, 1.0))
    assert found == sorted(set(found))
    assert set(critical) <= set(found)
    assert sum(0.3 < alpha < 0.300001 for alpha in found) >= 3
    assert 150 < len(found) < 200
    assert len(slider_alphas([k / 1000 for k in range(1001)], (0.0, 1.0))) < 2100


@pytest.mark.slow
def test_a_graph_of_many_arcs_is_drawn_more_coarsely(wedge, monkeypatch):
    fine = content.report_content(wedge)
    assert fine["tolerance"] == 1e-3
    monkeypatch.setattr(content, "_MOST_NUMBERS", 1)
    coarse = content.report_content(wedge)
    assert 0.01 < coarse["tolerance"] < 0.05
    points = [sum(len(arc["a"]) for arc in part["arcs"]) for part in (coarse, fine)]
    assert points[0] < points[1]


def test_numbers_are_short_and_finite():
    assert short_list([1 / 3, 2.0, -0.0, 1e20], 9) == [0.333333333, 2, 0, 1e20]
    assert json.dumps(short_list(np.eye(2), 9)) == "[[1, 0], [0, 1]]"


def test_words_and_tables(wedge, wedge_page):
    reader = Reader(wedge_page)
    assert reader.text.count("complete: yes (proven)") == 2
    assert wedge.problem.fingerprint in reader.text
    assert "one solution below alpha = 1.5216925" in reader.text
    assert "4^14" in reader.text
    rows = [attributes for tag, attributes in reader.tags if tag == "tr" and "data-alpha" in attributes]
    assert [float(row["data-alpha"]) for row in rows] == [v.alpha for v in wedge.vertices if v.kind != "end"]
    assert sum("data-branch" in attributes for tag, attributes in reader.tags if tag == "tr") == len(wedge.branches)
    assert data_of(wedge_page)["units"] == ["N", "mm"]


def test_the_page_is_small_and_asks_the_network_for_nothing(wedge_page):
    assert len(wedge_page.encode()) < 5_000_000
    for tag, attributes in Reader(wedge_page).tags:
        assert not {"src", "srcset", "data", "action"} & set(attributes), tag
        assert attributes.get("href", "data:,") == "data:,"
    policy = next(a["content"] for tag, a in Reader(wedge_page).tags if a.get("http-equiv"))
    assert policy.startswith("default-src 'none'")


def test_names_are_escaped(tmp_path):
    square = gallery.two_node_square()
    problem = enumsol.ContactProblem(*matrices(square), node_ids=[HOSTILE, "<b>&amp;"])
    page = page_of(branch_graph(problem, (0, 10)), tmp_path, title=HOSTILE, units=(HOSTILE, "<i>"), commands=[HOSTILE])
    plain = page_of(branch_graph(square, (0, 10)), tmp_path, commands=["enumsol"])
    names = [[tag for tag, _ in Reader(text).tags] for text in (page, plain)]
    assert names[0] == names[1]
    assert HOSTILE in text_of(page)
    assert HOSTILE not in page
    data = data_of(page)
    assert (data["nodes"], data["body"]) == ([HOSTILE, "<b>&amp;"], None)


@pytest.mark.parametrize("nodes", [1, 8, 12])
def test_a_graph_cut_short_says_so(tmp_path, nodes):
    graph = branch_graph(gallery.two_node_square(), (0, 10), max_nodes=nodes)
    assert not graph.complete
    page = page_of(graph, tmp_path)
    text = text_of(page)
    assert not re.search("complete: yes|It is proven", text)
    for said in ("This graph is not complete", graph.closing_line, "numbers of solutions are lower bounds"):
        assert said in text
    data = data_of(page)
    assert (data["complete"], data["exact_counts"]) == (False, False)


def test_fast_arithmetic_proves_nothing(tmp_path):
    graph = branch_graph(gallery.two_node_square(), (0, 10), "fast")
    page = page_of(graph, tmp_path)
    assert not re.search("complete: yes|It is proven", text_of(page))
    assert "Nothing is proven" in text_of(page)
    assert data_of(page)["complete"] is False


def test_continua_and_sheets(tmp_path):
    data = data_of(page_of(branch_graph(gallery.one_node_triangle(f=(1, -2)), (0, 5)), tmp_path))
    (family,) = [v["family"] for v in data["vertices"] if v["family"] is not None]
    assert family["dimension"] == 1
    assert family["f"] == [[0, 0], [1, -2]]
    page = page_of(branch_graph(sheet_of_one_node(), (-1, 1)), tmp_path)
    (sheet,) = [arc for arc in data_of(page)["arcs"] if arc["dimension"]]
    assert "a" not in sheet
    assert (sheet["lo"], sheet["hi"]) == (0, 1)
    assert "sheet (a continuum over an interval)" in text_of(page)


def test_what_cannot_be_written_is_refused(tmp_path, monkeypatch):
    graph, page = branch_graph(gallery.one_node_triangle(), (0, 5)), tmp_path / "page.html"
    bad_argument("solutions is a int", write_report, 3, page)
    bad_argument("title is a int", write_report, graph, page, title=3)
    bad_argument("units is 'N'", write_report, graph, page, units="N")
    bad_argument("cannot be written", write_report, graph, tmp_path / "nowhere" / "page.html")
    monkeypatch.setitem(sys.modules, "plotly.offline", None)
    refusal(MissingDependencyError, r"enumsol\[report\]", write_report, graph, page)
    assert not page.exists()


@pytest.mark.slow
def test_the_command(tmp_path, capsys):
    page, proof = tmp_path / "a page.html", tmp_path / "square.proof"
    assert printed(capsys, *REPORT, "-o", page, "--proof", proof).endswith("complete: yes (proven)\n")
    text = text_of(page)
    assert f"enumsol verify gallery:two-node-6.4 {proof}" in text
    assert text.startswith("gallery:two-node-6.4")
    printed(capsys, "verify", "gallery:two-node-6.4", proof)
    options = ("--max-nodes", 3, "--title", "<T>", "--units", "kN,m", "--json", "-")
    found = json.loads(printed(capsys, *REPORT, "-o", page, *options, status=3))
    assert (found["report"], found["complete"]) == (str(page), False)
    page_text = page.read_text(encoding="utf-8")
    assert "<h1>&lt;T&gt;</h1>" in page_text
    assert data_of(page_text)["units"] == ["kN", "m"]
    assert "enumsol verify gallery" not in text_of(page)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["-o", "-"], "--output is -"),
        (["-o", "nowhere/page.html"], "--output is nowhere/page.html"),
        (["--units", "N"], "--units is 'N'"),
        (["--to", "-1"], "--from is 0"),
    ],
)
def test_the_command_refuses_before_it_searches(capsys, options, message):
    assert_refused(*run(capsys, *REPORT, *options), message)


# -- what was given ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def scene():
    options = {"young": 210000, "poisson": 0.3, "plane": "stress", "contact": "bottom", "symmetry": "left"}
    acting = {"spring": {"right": (20, 10)}, "load": {"top": (30, -60)}, "gap": 1e-4, "friction": 0.3}
    return fem.mesh_scene(fem.rectangle(4, 2).parted(), **options, **acting)


def test_the_problem_is_told_as_it_was_given(scene, tmp_path):
    graph = branch_graph(scene.problem(), (0, 1))
    cells = {"young": ["210000", "N/mm²"], "spring": ["right: 20, 10", "N/mm³"], "load": ["top: 30, -60", "N/mm²"]}
    cells |= {"gap": ["0.0001", "mm"], "thickness": ["1", "mm"]}
    bare = {"poisson": "0.3", "plane": "stress", "contact": "bottom", "symmetry": "left", "friction": "0.3"}
    cells |= {name: [value, ""] for name, value in bare.items()}
    page = page_of(graph, tmp_path, units=("N", "mm"), scene=scene)
    given = page[page.index('<section id="given">') :]
    rows = re.findall(r'<tr><th scope="row">(.*?)</th>(.*?)</tr>', given[: given.index("</table>")])
    assert {name: re.findall("<td>(.*?)</td>", row) for name, row in rows} == cells
    text = text_of(page)
    assert "resultant (30, -60)" in text
    assert "gap 0.0001 mm" in text
    roots = enumerate_roots(scene.problem(), 0)
    plain = page_of(roots, tmp_path, scene=scene)
    assert "Numbers are in the user's own consistent units" in text_of(plain)
    assert 'id="given"' not in page_of(roots, tmp_path)
    bad_argument("scene is a str; expected a Scene", write_report, graph, tmp_path / "page.html", scene="scene.toml")


@pytest.mark.slow
def test_the_page_of_a_history_tells_what_was_given(scene, tmp_path):
    history = enumsol.histories(scene.problem(), [enumsol.LoadStep(load=[0.0] * scene.problem().n)])
    page = page_of(history, tmp_path, scene=scene, units=("N", "mm"))
    assert "N/mm³" in page[page.index('id="given"') :]
    assert all(attributes["alt"] for tag, attributes in Reader(page).tags if tag == "img")


def test_what_acts_on_the_body_and_holds_it(scene):
    problem = scene.problem()
    body, _ = body_record(problem, scene)
    points = np.array(body["points"])
    load = np.array(body["load"])
    np.testing.assert_allclose(load[:, 1], 1)  # on top
    # the horizontal force at the corner on the plane of symmetry is the support's
    np.testing.assert_allclose(load[:, 2:].sum(axis=0), [30 * 7 / 8, -60, 0, 0], rtol=1e-6)
    assert [[points[k, 0], abs(x), abs(y)] for k, x, y in body["held"]] == [[0, 1, 0]] * 2  # one more is a contact node
    assert {points[k, 0] for k in body["springs"]} == {1}
    assert [wall[1:] for wall in body["walls"]] == [[0, -1, 1e-4]] * problem.p
    lam, mu = body["lame"][0]
    E, nu = mu * (3 * lam + 2 * mu) / (lam + mu), lam / (2 * (lam + mu))
    assert (E, nu) == pytest.approx((210000 * (1 + 2 * 0.3) / 1.3**2, 0.3 / 1.3), rel=1e-6)  # plane stress
    rim = {tuple(sorted(edge)) for edge in body["rim"]}
    assert len(rim) == 12
    assert body_record(problem)[0]["springs"] == []


def test_supports_along_slopes_and_many_loads():
    """A slope moves along it only; a weight is drawn as its resultant."""
    mesh = fem.rectangle(12, 12).parted()
    options = {"young": 1, "poisson": 0.3, "contact": "bottom", "clamp": "left", "body_force": (0, -2), "friction": 0.3}
    body, _ = body_record(fem.mesh_problem(mesh, **options))
    assert len(body["load"]) == 1
    x, y, fx, fy, *slope = body["load"][0]
    assert (x, y, fx, slope) == (pytest.approx(0.5, abs=0.05), pytest.approx(0.5, abs=0.05), 0, [0, 0])
    assert fy == pytest.approx(-2, rel=0.05)  # without what the clamp takes
    assert [way for _, *way in body["held"]] == [[0, 0]] * 13


def test_many_springs_loads_and_supports_have_about_twelve_signs_a_side():
    sides = {"contact": "bottom", "clamp": "right", "spring": {"left": (2.0, 1.0)}, "load": {"top": (0.1, -0.3)}}
    scene = fem.mesh_scene(fem.rectangle(60, 40, 1.5, 1.0).parted(), young=1, poisson=0.3, friction=0.3, **sides)
    problem = scene.problem()
    body, _ = body_record(problem, scene)
    points, load = np.array(body["points"]), np.array(body["load"])
    for places, along in (
        (points[[k for k, _, _ in body["held"]]], 1), (points[body["springs"]], 1), (load[:, :2], 0)
    ):  # fmt: skip
        spots = np.sort(places[:, along])
        assert len(spots) == 12
        assert np.ptp(spots) > 0.97 * (1.5, 1.0)[along] - 0.05  # the corner in contact is no support
        gaps = np.diff(spots)
        assert gaps.max() < 1.5 * gaps.min()
    # nothing of the load is lost
    total = (problem.mesh.motion @ problem.f).reshape(-1, 2).sum(axis=0)
    np.testing.assert_allclose(load[:, 2:4].sum(axis=0), total, rtol=1e-6)
    assert body["summed"]


def test_stresses_of_a_solid_follow_the_contact_forces():
    problem = gallery.get("wedge3d-2-3").build()
    body, _ = body_record(problem)
    root = enumerate_roots(problem, 1)[0]
    forces = np.concatenate([root.lambda_n, root.lambda_t.ravel(order="F")])
    # root.u solves with these forces at alpha = 1
    found = np.array(body["s0"]) + np.array(body["s1"]) - forces @ np.array(body["s"])
    sigma = fem.cell_stresses(problem, root.u)
    six = sigma[:, [0, 1, 2, 1, 2, 0], [0, 1, 2, 2, 0, 1]]
    away = np.linalg.norm(found.reshape(-1, 6)[:, None] - six, axis=2).min(axis=1)
    assert away.max() < 1e-5 * np.abs(six).max()
    assert len(found) == 6 * len(boundary_facets(3, problem.mesh.cells))


def test_loads_and_supports_of_a_solid_are_told():
    problem = gallery.get("block3d-9").build()
    body, _ = body_record(problem)
    forces = (problem.mesh.motion @ problem.f).reshape(-1, 3)
    load = np.array(body["load"])
    np.testing.assert_allclose(load[:, 3:6].sum(axis=0), forces.sum(axis=0), rtol=1e-6)
    still = ~np.any(problem.mesh.motion.toarray().reshape(len(forces), -1), axis=1)
    places = np.array(body["points"])[[k for k, *_ in body["held"]]]
    assert 0 < len(places) <= 12
    assert all(np.any(np.all(np.isclose(problem.mesh.points[still], place), axis=1)) for place in places)
    # contact is below, and that is where it is first seen from
    assert body["view"][2] < -0.3


def test_commands_tell_what_a_toml_file_gave(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    mesh = fem.rectangle(2, 1)
    meshio = pytest.importorskip("meshio")
    sides = {"bottom": mesh.bottom, "left": mesh.left, "top": mesh.top}
    meshio.Mesh(mesh.points, {"triangle": mesh.triangles}, point_sets=sides).write("block.inp")
    keys = 'mesh = "block.inp"\nyoung = 7\npoisson = 0.3\ncontact = "bottom"\nclamp = "left"\nload.top = [0.1, -0.3]\n'
    (tmp_path / "block.toml").write_text(keys + "friction = 0.4\n")
    for verb in ("roots", "solve"):
        assert run(capsys, verb, "block.toml", "--alpha", 0, "--report", f"{verb}.html", "--units", "kN,m")[0] == 0
        assert "top: 0.1, -0.3 kN/m²" in text_of(tmp_path / f"{verb}.html")
    answer = run(capsys, "roots", "block.toml", "--alpha", 0, "--units", "kN")
    assert_refused(*answer, "--units is 'kN'; expected units of force and length")


def test_no_outline_is_as_wide_as_a_body_is_long():
    """One unit of a picture is one of length: outlines are measured in pixels, or by their shape."""
    sheet = files("enumsol.report").joinpath("page.css").read_text()
    rules = dict(re.findall(r"^svg ([^{]+) \{ (.*) \}$", sheet, re.M))
    drawn = {names: rule for names, rule in rules.items() if re.search(r"stroke: var", rule)}
    assert {".before", ".after", ".held", ".wall"} <= rules.keys()
    measured = " ".join(names for names, rule in rules.items() if "non-scaling-stroke" in rule)
    # the width of .stands is set where it is drawn, that of .axis is one of a diagram
    assert {names for names in drawn if names not in measured} == {".axis", ".stands"}


# -- the page of a history ---------------------------------------------------------------------------------------------


def test_pictures_are_within_the_page():
    figure = new_figure(figsize=(2, 1))
    text = roots_page._image(figure, "u < v")
    found = re.fullmatch(r'<figure><img src="data:image/png;base64,(.+)" alt="u &lt; v"></figure>', text)
    data = base64.b64decode(found[1], validate=True)
    assert data.startswith(b"\x89PNG")
    assert [int.from_bytes(data[k : k + 4]) for k in (16, 20)] == [2 * 96, 96]


def test_an_incomplete_history_says_so(tmp_path, monkeypatch):
    """Of three roots of the second step one is followed."""
    monkeypatch.setattr(roots_page, "_image", lambda _, words: f"<p>Picture of {words}.</p>")
    problem = gallery.one_node_triangle()
    history = histories(problem, [5, 4], follow="nearest")
    text = text_of(page_of(history, tmp_path, units=("N", "mm")))
    assert not history.complete
    assert "This history is not complete." in text
    assert "these are all histories" not in text
    for said in (history.closing_line, *history.reasons, problem.fingerprint, "enumsol verify PROBLEM FILE"):
        assert said in text
    for drawn in ("alpha against displacement", "lambda_n against step", "deformed bodies of step 2"):
        assert f"Picture of {drawn}." in text
