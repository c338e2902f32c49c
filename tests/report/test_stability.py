"""Pages of graphs and of roots whose verdicts are known."""

import pytest
from browser import find_browser
from pages import data_of, text_of

import enumsol

pytest.importorskip("plotly")
QUIET, AWAY = "does not run away", "runs away"


@pytest.fixture(scope="module")
def graph():
    found = enumsol.branch_graph(enumsol.gallery.two_node_square(), (0, 10))
    found.stability()
    return found


@pytest.fixture(scope="module")
def page(graph, tmp_path_factory):
    place = tmp_path_factory.mktemp("page") / "square.html"
    enumsol.write_report(graph, place)
    return place


def test_the_page_of_a_graph_has_the_verdicts(graph, page):
    data = data_of(page)
    assert [[span[2] for span in arc["spans"]] for arc in data["arcs"]] == [[QUIET], [AWAY], [QUIET], [AWAY], [AWAY]]
    assert data["arcs"][1]["spans"][0][:2] == [graph.arcs[1].lo, graph.arcs[1].hi]
    words = text_of(page)
    assert f"{QUIET} (1 arc); {AWAY} (3 arcs)" in words
    assert "Stability: whether the body can leave it along a straight line" in words


def test_the_page_of_roots_has_a_column(graph, tmp_path):
    roots = graph.roots_at(3.5)
    enumsol.write_report(roots, tmp_path / "before.html")
    assert "stability" not in text_of(tmp_path / "before.html").replace("physical stability", "")
    verdicts = [one.verdict for one in roots.stability()]
    enumsol.write_report(roots, tmp_path / "roots.html")
    assert [root["stability"] for root in data_of(tmp_path / "roots.html")["roots"]] == verdicts
    assert text_of(tmp_path / "roots.html").count(QUIET) == verdicts.count(QUIET)


@pytest.mark.skipif(find_browser() is None, reason="no headless browser (Debian's package chromium)")
def test_the_diagram_and_its_key_say_it_in_these_words(browser, page):
    browser.show(page)
    assert browser.complaints() == []
    assert browser.evaluate("[...document.querySelectorAll('#key span')].map((e) => e.textContent)") == [QUIET, AWAY]
    dashes = "byId('diagram').data.filter((t) => t.meta !== undefined).map((t) => t.line.dash)"
    assert browser.evaluate(dashes) == ["solid", "dash", "solid", "dash", "dash"]
    # an arc with several verdicts is drawn in pieces
    cut = "arcs.get(4).spans = [[3, 5, 'runs away'], [5, 5.5, 'undecided'], [5.5, 10, 'does not run away']]"
    browser.evaluate(f"{cut}; selectBranch(1); showAlpha(6)")
    assert browser.evaluate(dashes) == ["solid", "dash", "solid", "dash", "dash", "dot", "solid"]
    ends = "byId('diagram').data.filter((t) => t.meta === 4).map((t) => [t.x[0], t.x[t.x.length - 1]])"
    assert browser.evaluate(ends) == [[3, 5], [5, 5.5], [5.5, 10]]
    cards = browser.evaluate("byId('cards').textContent")
    assert f"arc 4, index \u22121, {QUIET}" in cards
    assert "stability" in browser.evaluate("byId('arcs').textContent")
    assert browser.complaints() == []
