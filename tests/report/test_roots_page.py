"""The page of a RootSet, in 2D and 3D: numbers against the roots, words, and how it looks in a headless browser."""

import json
import re
import sys

import numpy as np
import pytest
from browser import find_browser
from command_line import assert_refused, printed, run
from pages import Reader, data_of, page_of, text_of
from parted_solids import solid
from refusals import bad_argument, refusal

import enumsol
from enumsol import MissingDependencyError, enumerate_roots, fem, gallery, write_report
from enumsol.fem.bases import von_mises
from enumsol.model.shapes import body_mesh, contact_forces, slip_directions
from enumsol.report import parts, roots_page

pytest.importorskip("plotly")
HOSTILE = '</script><script>document.title = "broken"</script>'


@pytest.fixture(scope="module")
def found():
    wedge = gallery.get("wedge3d-4-9").build()
    square = gallery.two_node_square()
    node = gallery.get("one-node-3d-3").build()
    rows = (node.A, node.Bn, node.Bt1, node.Bt2, node.f)
    two = np.kron(np.eye(2), node.A.toarray())
    places = {"coordinates": [[0, 0, 0], [1, 2, 0]], "node_ids": [HOSTILE, "b"]}
    scattered = enumsol.ContactProblem3D(
        two, *(np.kron(np.eye(2), part.toarray()) for part in rows[1:4]), np.tile(node.f, 2), friction=5.0, **places
    )
    return {
        "wedge": enumerate_roots(wedge, 3),
        "turned": enumerate_roots(gallery.get("wedge3d-2-3").build(), 1),
        "many": enumerate_roots(gallery.chain(2), 5),
        "plane": enumerate_roots(gallery.get("wedge-8-5").build(), 3),
        "scattered": enumerate_roots(scattered, 0),
        "bare": enumerate_roots(enumsol.ContactProblem3D(*rows, friction=5.0), 0),
        "bars": enumerate_roots(enumsol.ContactProblem(square.A, square.Bn, square.Bt, square.f), 3.5),
        "cut": enumerate_roots(wedge, 3, max_nodes=500),
    }


@pytest.fixture(scope="module")
def pages(found, tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")
    for name, roots in found.items():
        write_report(roots, folder / f"{name}.html", title=HOSTILE, units=("N", "mm"))
    return {name: folder / f"{name}.html" for name in found}


# -- the text of the page ---------------------------------------------------------------------------------------------


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", ["wedge", "plane"])
def test_bodies_and_forces_are_those_of_the_roots(found, pages, name):
    data, roots = data_of(pages[name]), found[name]
    problem = roots[0].problem
    mesh, d = body_mesh(problem), problem.mesh.points.shape[1]
    points = np.array(data["body"]["points"])
    # each drawn point is a node of the mesh
    node = [int(np.argmin(np.linalg.norm(mesh.points - point, axis=1))) for point in points]
    np.testing.assert_allclose(mesh.points[node], points, atol=1e-6)
    assert len(data["roots"]) == len(roots)
    for record, root in zip(data["roots"], roots, strict=True):
        assert [data["statuses"][int(code)] for code in record["statuses"]] == [s.value for s in root.statuses]
        np.testing.assert_allclose(record["f"], np.concatenate([root.lambda_n, root.lambda_t.ravel("F")]), rtol=1e-6)
        np.testing.assert_allclose(record["w"], np.concatenate([root.u_n, root.u_t.ravel("F")]), rtol=1e-6)
        moved = problem.mesh.displacements(root.u)
        np.testing.assert_allclose(np.reshape(record["u"], (-1, d)), moved[node], rtol=1e-5, atol=1e-6 * np.max(moved))
        forces = np.zeros_like(mesh.points)
        for k, *force in record["forces"]:
            forces[node[k]] = force
        expected = contact_forces(problem, root.lambda_n, root.lambda_t)
        np.testing.assert_allclose(forces, expected, rtol=1e-5, atol=1e-6 * np.max(np.abs(expected), initial=0))
        if d == 3:
            rows, ways = slip_directions(problem, root.u_t, root.statuses)
            slip = np.reshape(record["w"], (3, -1))[1:, rows]
            drawn = np.einsum("ki,ikc->ic", slip, np.array(data["body"]["tangents"])[rows])
            drawn /= np.linalg.norm(drawn, axis=1, keepdims=True)
            np.testing.assert_allclose(drawn, ways, atol=1e-6)
    at = [sum(weight * points[k] for k, weight in row) for row in data["body"]["rows"]]
    np.testing.assert_allclose(at, problem.coordinates, atol=1e-6)


@pytest.mark.slow
def test_the_surface_is_closed(pages):
    drawn = data_of(pages["wedge"])["body"]
    triangles = np.array(drawn["triangles"]).T
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    _, count = np.unique(edges, axis=0, return_counts=True)
    assert set(count) == {2}
    # a trapezoid of length 1 along y
    assert volume_of(drawn) == pytest.approx(1 + np.tan(np.radians(20)), rel=1e-5)


def volume_of(drawn):
    """What the triangles of a drawn surface enclose."""
    return np.sum(np.linalg.det(np.array(drawn["points"])[np.array(drawn["triangles"]).T])) / 6


@pytest.mark.slow
def test_words_and_tables(found, pages):
    reader = Reader(pages["wedge"].read_text())
    assert "The problem has 9 isolated solutions at this alpha, and no other." in reader.text
    assert reader.text.count("complete: yes (proven)") == 2
    assert "Sum of the indices: +1." in reader.text
    assert found["wedge"][0].problem.fingerprint in reader.text
    assert sum("data-root" in attributes for tag, attributes in reader.tags if tag == "tr") == 9
    assert "Undecided" not in reader.text
    assert HOSTILE in reader.text


def test_a_result_that_is_not_complete_says_so(found, pages):
    text = text_of(pages["cut"])
    assert not found["cut"].complete
    assert not re.search("complete: yes|It is proven", text)
    for said in (
        "This result is not complete. Every root shown is a solution, but there may be more.",
        f"at least {found['cut'].at_least} exist",
        "the search was stopped before it got here",
        "Nothing is claimed about solutions that are not listed",
    ):
        assert said in text


def test_what_is_undecided_has_a_table(tmp_path):
    """A node in 3D that slides with any lambda_n from 0 to 1."""
    A = np.array([[2, 1, 0], [1, 1, 0], [0, 0, 1]])
    region = enumerate_roots(enumsol.ContactProblem3D(A, *np.eye(3)[:, None], [1, 1, 0], friction=1), 0)
    (part,) = region.undecided
    text = text_of(page_of(region, tmp_path))
    assert part.reason in text
    assert "0 to 1.2071" in text  # lambda_n of a root in it
    fast = page_of(enumerate_roots(gallery.two_node_square(), 3.5, arithmetic="fast"), tmp_path)
    assert "Nothing is proven: the result rests on floating-point arithmetic" in text_of(fast)


def test_a_continuum_is_in_a_table(tmp_path):
    text = text_of(page_of(enumerate_roots(gallery.one_node_triangle(f=(1, -2)), 2), tmp_path))
    assert "The problem has 0 isolated solutions and 1 continuum of solutions at this alpha, and no other." in text
    assert "Connected sets of infinitely many solutions. They are not drawn." in text


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("scattered", "The problem has no mesh: its contact nodes are drawn at their coordinates"),
        ("bare", "The problem has no mesh and no coordinates, so no body is drawn"),
        ("bars", "The problem has no mesh, so no body is drawn"),
    ],
)
def test_problems_without_a_mesh(pages, name, words):
    data = data_of(pages[name])
    assert data["no_body"].startswith(words)
    assert (data["body"] is None) == (name != "scattered")


def test_pages_are_small_and_ask_the_network_for_nothing(pages, monkeypatch):
    for name, limit in (("wedge", 3_000_000), ("plane", 90_000), ("bare", 70_000)):
        text = pages[name].read_text()
        assert len(text.encode()) < limit
        for tag, attributes in Reader(text).tags:
            assert not {"src", "srcset", "data", "action"} & set(attributes), tag
    roots = enumerate_roots(gallery.chain(2), 5)
    monkeypatch.setattr(roots_page, "MOST_NUMBERS", 40)
    shortened = roots_page.roots_content(roots)
    assert (len(shortened["roots"]), shortened["all"]) == (2, 9)


def test_large_meshes_are_drawn_in_part_or_not_at_all(found, monkeypatch):
    count = 3 * len(roots_page.roots_content(found["wedge"])["body"]["points"])
    monkeypatch.setattr(parts, "MOST_NUMBERS", 4 * count)
    part = roots_page.roots_content(found["wedge"])
    assert ["u" in record for record in part["roots"]] == [True] * 3 + [False] * 6
    assert part["no_body"] == "The bodies of the first 3 roots are drawn: the page holds no more"
    monkeypatch.setattr(parts, "MOST_NUMBERS", count)
    assert roots_page.roots_content(found["wedge"])["no_body"].startswith("The mesh is too large to draw: ")
    plane = found["plane"]
    nodes = len(plane[0].problem.mesh.points)
    monkeypatch.setattr(parts, "MOST_NUMBERS", 2 * nodes * (len(plane) + 1) - 1)
    boundary = roots_page.roots_content(plane)["body"]
    assert boundary["cells"] is None
    assert len(boundary["points"]) == len(boundary["lines"]) < nodes


def test_second_order_solids_are_drawn_by_their_surface(tmp_path):
    options = {"contact": "bottom", "clamp": "left", "load": {"top": (0.1, 0.0, -0.3)}, "friction": 0.4}
    problem = fem.mesh_problem(solid((2, 1, 1), 27), young=2, poisson=0.3, **options)
    drawn = roots_page.roots_content(enumerate_roots(problem, 0))["body"]
    assert volume_of(drawn) == pytest.approx(1, rel=0.01)


@pytest.mark.slow
def test_the_command(tmp_path, capsys, monkeypatch):
    page, proof = tmp_path / "a page.html", tmp_path / "wedge.proof"
    command = ("roots", "gallery:wedge3d-2-3", "--alpha", 1, "--report", page)
    assert printed(capsys, *command, "--proof", proof).endswith("complete: yes (proven)\n")
    text = text_of(page)
    assert text.startswith("gallery:wedge3d-2-3")
    assert f"enumsol verify gallery:wedge3d-2-3 {proof}" in text
    printed(capsys, *command)
    assert "enumsol roots gallery:wedge3d-2-3 --alpha=1.0 --proof roots.proof" in text_of(page)
    answer = run(capsys, "roots", "gallery:two-node-5", "--alpha", 5, "--report", "-")
    assert_refused(*answer, "--report is -; expected the name of a file")
    bad_argument("solutions is a int; expected a BranchGraph, a RootSet or a", write_report, 3, page)
    monkeypatch.setitem(sys.modules, "plotly.offline", None)
    roots = enumerate_roots(gallery.get("wedge3d-2-3").build(), 1)
    refusal(MissingDependencyError, r"enumsol\[report\]", write_report, roots, page)
    write_report(enumerate_roots(gallery.two_node_square(), 3.5), page)  # nothing in it needs plotly


# -- in a browser -----------------------------------------------------------------------------------------------------

in_a_browser = pytest.mark.skipif(find_browser() is None, reason="no headless browser (Debian's package chromium)")


def drawn(browser, count):
    """Wait until so many scenes are drawn."""
    browser.wait_for(f"document.querySelectorAll('.scene[data-drawn]').length >= {count}")


@in_a_browser
@pytest.mark.parametrize(
    ("name", "width"),
    [pytest.param("turned", 1000, marks=pytest.mark.slow), ("plane", 400), ("bare", 400), ("bars", 1280)],
)
def test_it_opens_without_complaint_and_fits(browser, pages, found, name, width):
    """In 3D scenes are drawn by software, which takes its time; one page has all that is asked of them."""
    browser.show(pages[name], width, 500)
    roots = found[name]
    if name == "turned":
        drawn(browser, 3)
        check_scenes(browser, roots)
    assert browser.evaluate("document.title") == HOSTILE
    assert browser.evaluate("document.documentElement.scrollWidth") <= width
    wide = "[...document.querySelectorAll('h1, h2, p, dd, li, .card')].filter((e) => e.scrollWidth > e.clientWidth + 1)"
    assert browser.evaluate(f"{wide}.map((e) => e.textContent.slice(0, 40))") == []
    assert browser.evaluate("document.querySelectorAll('#cards article').length") == len(roots)
    pictures = {"turned": "#cards .scene canvas", "plane": "#cards svg.body"}
    drawn_by = pictures.get(name, "#cards svg.bars")
    assert browser.evaluate(f"document.querySelectorAll('{drawn_by}').length") >= len(roots)
    browser.open_details()
    statuses = "[...c.querySelectorAll('tbody tr')].map((r) => r.children[1].textContent)"
    rows = browser.evaluate(f"[...document.querySelectorAll('.card')].map((c) => {statuses})")
    assert rows == [[status.value for status in root.statuses] for root in roots]
    assert browser.complaints() == []


def check_scenes(browser, roots):
    """Arrows and marks are those of the roots, and bodies are turned together."""
    traces = "scenes.map((s) => s.data.filter((t) => {0}).map((t) => [t.name, t.x.length]))"
    cones = browser.evaluate(traces.replace("{0}", "t.type === 'cone'"))
    marks = browser.evaluate(traces.replace("{0}", "t.mode === 'markers' && data.statuses.includes(t.name)"))
    mesh = body_mesh(roots[0].problem)
    for root, arrows, marked in zip(roots, cones, marks, strict=True):
        names = [status.value for status in root.statuses]
        forces = contact_forces(root.problem, root.lambda_n, root.lambda_t)
        expected = {"force": int(np.sum(np.any(forces != 0, axis=1))), "way of slip": names.count("slip")}
        expected |= {"load": int(np.sum(np.any((mesh.motion @ root.problem.f).reshape(-1, 3), axis=1))), "scale": 1}
        assert dict(arrows) == {name: count for name, count in expected.items() if count}
        assert dict(marked) == {name: names.count(name) for name in set(names)}
    check_first_view(browser, roots)
    check_colours(browser, roots)
    places = {"eye": (-1.5, 0.5, 1.0), "center": (0, 0, 0), "up": (0, 0, 1)}
    camera = {name: dict(zip("xyz", place, strict=True)) for name, place in places.items()}
    browser.evaluate(f"Plotly.relayout(scenes[1], {{'scene.camera': {json.dumps(camera)}}}).then(() => 1)")
    browser.settle()
    assert browser.evaluate("scenes.map((s) => s._fullLayout.scene.camera.eye.x)") == [-1.5] * len(roots)


def check_colours(browser, roots):
    """Stresses on the surface are those of the cells of finite elements."""
    choices = "[...document.querySelectorAll('#looks select')[1].options].map((o) => o.value)"
    assert browser.evaluate(choices) == ["none", "moved", "mises", "pressure"]
    sigma = fem.cell_stresses(roots[0].problem, roots[0].u)
    for kind, own in (("mises", von_mises(sigma)), ("pressure", np.trace(sigma, axis1=1, axis2=2) / 3)):
        found = np.array(browser.evaluate(f"surfaceStress(data.roots[0].s, '{kind}')"))
        largest = np.max(np.abs(own))
        # of every facet one cell, and every cell of this wedge has a facet on the surface
        assert np.max(np.min(np.abs(found[:, None] - own), axis=1)) < 1e-5 * largest
        assert np.max(np.min(np.abs(found[:, None] - own), axis=0)) < 1e-5 * largest
        browser.evaluate(
            f"{{const s = document.querySelectorAll('#looks select')[1]; s.value = '{kind}';"
            "s.dispatchEvent(new Event('change')); 1}"
        )
        trace = "scenes[0].data.find((t) => t.type === 'mesh3d')"
        assert browser.evaluate(f"[{trace}.intensitymode, {trace}.intensity.length]") == [
            "cell", browser.evaluate("data.body.triangles[0].length")
        ]  # fmt: skip
        assert browser.evaluate(f"{trace}.cmax") == pytest.approx(np.max(np.abs(found)))
        # the free body has no stress but rounding
        free = next(k for k, root in enumerate(roots) if not root.lambda_n.any())
        trace = f"scenes[{free}].data.find((t) => t.type === 'mesh3d')"
        assert browser.evaluate(f"[{trace}.showscale, Math.max(...{trace}.intensity)]") == [False, 0]


def check_first_view(browser, roots):
    """Bodies fill their pictures, one flank is looked at, and the scale is as long as it says."""
    camera = browser.evaluate("scenes[0]._fullLayout.scene.camera")
    eye, centre = (np.array([camera[name][axis] for axis in "xyz"]) for name in ("eye", "center"))
    assert camera["projection"]["type"] == "orthographic"
    way = (eye - centre) / np.linalg.norm(eye - centre)
    normals = roots[0].problem.mesh.directions(roots[0].problem.Bn)
    assert np.max(normals @ way / np.linalg.norm(normals, axis=1)) > 0.5
    # the picture is two units high, and as wide as its proportions say
    ratio = np.array([browser.evaluate(f"scenes[0]._fullLayout.scene.aspectratio.{axis}") for axis in "xyz"])
    low, high = np.array(browser.evaluate("ranges")).T
    points = np.array(browser.evaluate("[data.body.points, ...data.roots.map(displaced)].flat()"))
    at = ratio * ((points - low) / (high - low) - 0.5) - centre
    right = np.array([-way[1], way[0], 0]) / np.hypot(*way[:2])
    across, up = np.ptp(at @ right) / 2, np.ptp(at @ np.cross(way, right)) / 2
    wide, tall = browser.evaluate("[scenes[0].clientWidth, scenes[0].clientHeight]")
    assert 0.7 < max(across / (wide / tall), up) <= 0.95
    step, tail, tip = browser.evaluate("[scaled.step, scaled.tail, scaled.tip]")
    force = browser.evaluate("compared.force")
    assert 0.4 * force < step <= force
    size = browser.evaluate("data.body.size")
    assert np.linalg.norm(np.subtract(tip, tail)) == pytest.approx(0.16 * size * step / force)
    words = "scenes[0].data.filter((t) => t.mode === 'text').map((t) => t.text[0].trim())"
    assert browser.evaluate(words) == [browser.evaluate("short(scaled.step)") + " N"]


@pytest.mark.slow
@in_a_browser
def test_many_roots_are_on_several_pages(browser, pages, found):
    browser.show(pages["many"])
    shown = "[...document.querySelectorAll('#cards h3')].map((h) => h.firstChild.textContent.split(':')[0])"
    assert browser.evaluate(shown) == [f"Root {k}" for k in range(6)]
    browser.evaluate("byId('more').click()")
    assert browser.evaluate(shown) == ["Root 6", "Root 7", "Root 8"]
    assert browser.evaluate("byId('range').textContent") == "7 to 9 of 9"
    assert browser.evaluate("byId('more').disabled")
    browser.evaluate("document.querySelector('tr[data-root=\"1\"]').click()")
    assert browser.evaluate(shown)[0] == "Root 0"
    assert len(found["many"]) == 9
    assert browser.complaints() == []


@in_a_browser
def test_small_numbers_are_written_as_in_tables(browser, pages):
    """JavaScript writes those down to a millionth with zeros in front: 0.00000153 beside 6.29e-7."""
    browser.open(pages["bare"])
    numbers = "[0, 0.00000153, -0.000000629, 0.00012, -3.5, 1234567, null].map(short)"
    expected = ["0", "1.53e\u22126", "\u22126.29e\u22127", "0.00012", "\u22123.5", "1234570", "?"]
    assert browser.evaluate(numbers) == expected
