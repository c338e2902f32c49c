"""The page of a report in a headless browser: nothing complains, pointing, clicking and sliding work, it fits."""

import re

import pytest
from browser import Browser, find_browser

import enumsol
from enumsol import branch_graph, gallery, write_report

pytest.importorskip("plotly")
pytestmark = pytest.mark.skipif(find_browser() is None, reason="no headless browser (Debian's package chromium)")
HOSTILE = "</script><script>document.title = 'broken'</script><img src=x onerror=\"document.title='broken'\">"


@pytest.fixture(scope="module")
def graphs():
    square = gallery.two_node_square()
    bare = enumsol.ContactProblem(square.A, square.Bn, square.Bt, square.f, node_ids=[HOSTILE, "b"])
    return {
        "wedge": branch_graph(gallery.get("wedge-14-5").build(), (0, 3)),
        "bare": branch_graph(bare, (0, 10)),
        "cut": branch_graph(square, (0, 10), max_nodes=8),
        "chain": branch_graph(gallery.chain(3), (0, 10)),
        "square": branch_graph(square, (0, 10)),
    }


@pytest.fixture(scope="module")
def pages(graphs, tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")
    for name, graph in graphs.items():
        write_report(graph, folder / f"{name}.html", title=HOSTILE)
    return {name: folder / f"{name}.html" for name in graphs}


def cards(browser):
    return browser.evaluate("document.querySelectorAll('#cards article').length")


def slide_to(browser, position):
    browser.evaluate(
        f"{{const s = byId('slider'); s.value = String({position}); s.dispatchEvent(new Event('input')); s.value}}"
    )
    return browser.evaluate("state.alpha")


@pytest.mark.parametrize("width", [1280, 400])
@pytest.mark.parametrize("name", ["wedge", "bare"])
def test_it_opens_without_complaint_and_fits(browser, pages, name, width):
    browser.show(pages[name], width)
    assert browser.complaints() == []
    assert browser.evaluate("document.title") == HOSTILE
    assert browser.evaluate("document.documentElement.scrollWidth") <= width
    assert browser.evaluate("document.querySelector('#diagram .main-svg').getBoundingClientRect().width") <= width
    assert browser.evaluate("document.querySelectorAll('#diagram .scatterlayer path.js-line').length") > 0
    # no text of the page is cut off: what is wider scrolls in a box of its own
    wide = "[...document.querySelectorAll('h1, h2, p, dd, li, .card')].filter((e) => e.scrollWidth > e.clientWidth + 1)"
    assert browser.evaluate(f"{wide}.map((e) => e.textContent.slice(0, 40))") == []
    assert cards(browser) > 0


def test_the_slider_shows_as_many_solutions_as_there_are(browser, pages, graphs):
    browser.show(pages["wedge"])
    last = browser.evaluate("data.slider.length") - 1
    seen = set()
    for position in (0, last // 3, last // 2, last // 2 + 1, last // 2 + 2, last - 3):
        alpha = slide_to(browser, position)
        count = graphs["wedge"].multiplicity_at(alpha)
        assert cards(browser) == count
        assert browser.evaluate("byId('count').textContent").startswith(f"{count} solution")
        assert browser.evaluate("byId('alpha').value") == repr(alpha).removesuffix(".0")
        assert browser.evaluate("document.querySelectorAll('#cards svg.body').length") == count
        seen.add(count)
    assert seen >= {1, 5}
    browser.evaluate("byId('next').click()")
    assert browser.evaluate("state.alpha") == browser.evaluate("data.slider[Number(byId('slider').value)]") > alpha
    # at a critical alpha, from the table
    browser.evaluate("document.querySelector('tr[data-alpha]').click()")
    fold = next(v.alpha for v in graphs["wedge"].vertices if v.kind != "end")
    assert browser.evaluate("state.alpha") == fold
    assert cards(browser) == 2  # the free wedge, and the fold
    assert browser.complaints() == []


def test_it_opens_where_most_solutions_are(browser, pages, graphs):
    browser.show(pages["wedge"])
    alpha = browser.evaluate("state.alpha")
    assert graphs["wedge"].multiplicity_at(alpha) == 5
    # they begin at 1.7278, and there are five up to 3
    assert alpha == pytest.approx((graphs["wedge"].folds[-1].alpha + 3) / 2)
    assert browser.evaluate("document.querySelector('.answers li').textContent").startswith(
        "five solutions for alpha between 1.7278 and 3, three between 1.5217 and 1.7278, one elsewhere"
    )
    titles = browser.evaluate("[...document.querySelectorAll('.card h3')].map((h) => h.childNodes[1].textContent)")
    assert len(set(titles)) == 5
    assert titles[:2] == ["branch 0: free", "branch 1: held (11 open, 1 stick, 2 slip+)"]
    assert titles[2].startswith("branch 1: sliding (")
    # cards that would have the same title are told apart by their arcs
    items = "[1, 2].map((k) => ({ name: 'b', words: `arc ${k}, x`, statuses: '0'.repeat(p) }))"
    browser.evaluate(f"window.items = {items}; entitle(items)")
    assert browser.evaluate("items.map((item) => item.title)") == ["b: free, arc 1", "b: free, arc 2"]


def test_rounding_is_not_enlarged(browser, pages):
    """One of the five bodies rests: what seven digits leave of its displacements is drawn as nothing."""
    browser.show(pages["square"])
    browser.evaluate("showAlpha(3.5)")
    scales = browser.evaluate("[...document.querySelectorAll('#cards input[type=number]')].map((i) => Number(i.value))")
    assert len(scales) == 5
    assert max(scales) < 1e3


def test_arrows_and_marks_are_those_of_the_roots(browser, pages, graphs):
    browser.show(pages["wedge"])
    browser.evaluate("showAlpha(2.2)")
    roots = enumsol.enumerate_roots(graphs["wedge"].problem, 2.2)
    each = "[...document.querySelectorAll('#cards .card')]"
    pressed = browser.evaluate(f"{each}.map((c) => c.querySelectorAll('.arrow').length)")
    assert sorted(pressed) == sorted(sum(root.lambda_n > 0) for root in roots)
    browser.open_details()
    rows = "[...c.querySelectorAll('tbody tr')].map((r) => r.children[1].textContent)"
    found = sorted(browser.evaluate(f"{each}.map((c) => {rows})"))
    assert found == sorted([status.value for status in root.statuses] for root in roots)


def test_pointing_and_clicking(browser, pages, graphs):
    browser.show(pages["wedge"])
    branch = graphs["wedge"].branches[1]
    arc = max(branch.arcs, key=lambda arc: arc.length)
    place = f"""(() => {{
        const layout = byId('diagram')._fullLayout, box = byId('diagram').getBoundingClientRect();
        const trace = byId('diagram').data.find((t) => t.meta === {arc.number}), k = Math.floor(trace.x.length / 2);
        const x = box.left + layout.xaxis._offset + layout.xaxis.l2p(trace.x[k]);
        return [x, box.top + layout.yaxis._offset + layout.yaxis.l2p(trace.y[k]), trace.x[k]];
    }})()"""
    browser.evaluate("byId('diagram').scrollIntoView()")

    def point():
        """Plotly takes no notice of a move that comes while it draws: the mouse moves until it is seen."""
        x, y, alpha = browser.evaluate(place)
        browser.mouse("mouseMoved", x - 3, y)
        browser.mouse("mouseMoved", x, y)
        browser.settle()
        return x, y, alpha

    pointed = browser.wait_for("document.querySelector('.hoverlayer').textContent", point)
    alpha = point()[2]
    assert f"branch {branch.number}, arc {arc.number}" in pointed
    assert "alpha" in pointed
    assert any(status.value in pointed for status in arc.statuses)
    chosen = browser.wait_for("state.branch === null ? '' : String(state.branch)", lambda: browser.click(*point()[:2]))
    assert chosen == str(branch.number)
    assert browser.evaluate("state.alpha") == pytest.approx(alpha)
    assert browser.evaluate("document.querySelectorAll('#arcs tbody tr').length") == len(branch.arcs)
    assert browser.evaluate("document.querySelector('tr.chosen').dataset.branch") == str(branch.number)
    assert browser.complaints() == []


@pytest.mark.slow
def test_every_quantity_and_node_is_drawn(browser, pages, graphs):
    browser.show(pages["bare"])
    graph = graphs["bare"]
    arc = graph.arcs[1]
    for name in ("norm", "sum_n", "lambda_n", "lambda_t", "u_n", "u_t"):
        for node in (0, 1):
            browser.evaluate(f"byId('node').value = '{node}'")
            browser.choose("quantity", name)
            trace = f"byId('diagram').data.find((t) => t.meta === {arc.number})"
            x, y = (browser.evaluate(f"{trace}.{part}[3]") for part in ("x", "customdata"))
            n, t = arc.values(x)
            u, w = arc.displacements(x)
            overviews = {"norm": (n @ n + t @ t) ** 0.5, "sum_n": n.sum()}
            by_node = {"lambda_n": n, "lambda_t": t, "u_n": u, "u_t": w}
            expected = overviews[name] if name in overviews else by_node[name][node]
            assert y == pytest.approx(expected, rel=1e-7, abs=1e-12)
    # lambda_n of node 1 is 0 on two branches, which are drawn apart
    browser.choose("quantity", "lambda_n")
    flat = "byId('diagram').data.filter((t) => t.meta !== undefined && t.customdata.every((y) => y === 0))"
    heights = browser.evaluate(f"{flat}.map((t) => t.y[0])")
    assert len(heights) == 2
    assert heights[0] != heights[1]
    assert "side by side" in browser.evaluate("byId('key').textContent")
    assert browser.complaints() == []


@pytest.mark.slow
def test_more_solutions_than_fit_are_on_further_pages(browser, pages):
    browser.show(pages["chain"])
    browser.evaluate("showAlpha(5)")
    assert browser.evaluate("byId('count').textContent") == "27 solutions at alpha = 5"
    assert cards(browser) == 12
    browser.evaluate("byId('more').click(); byId('more').click(); byId('more').click()")
    assert browser.evaluate("byId('range').textContent") == "25 to 27 of 27"
    assert cards(browser) == 3
    assert browser.complaints() == []


@pytest.mark.slow
def test_a_graph_cut_short_never_counts_as_complete(browser, pages, graphs):
    browser.show(pages["cut"])
    for position in range(0, browser.evaluate("data.slider.length"), 20):
        slide_to(browser, position)
        said = browser.evaluate("byId('count').textContent")
        found, least = map(int, re.match(r"(\d+) solutions? found, at least (\d+) exists? at", said).groups())
        assert found == cards(browser)
        assert 1 <= least == max(found, graphs["cut"].at_least(browser.evaluate("state.alpha")))
    text = browser.evaluate("document.body.innerText")
    assert "complete: yes" not in text
    assert "at least" in browser.evaluate("byId('diagram').textContent")
    assert browser.complaints() == []


@pytest.mark.slow
def test_a_page_that_has_crashed_is_not_waited_for():
    other = Browser(find_browser())

    def crash():
        other.call("Page.navigate", url="chrome://crash")
        other.evaluate("1")

    try:
        with pytest.raises(AssertionError, match="the page has crashed"):
            crash()
    finally:
        other.close()
