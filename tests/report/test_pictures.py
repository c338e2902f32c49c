"""How a page looks in a headless browser: three widths, light, dark, on paper; bodies, their colours and controls."""

import matplotlib.image
import numpy as np
import pytest
from browser import find_browser
from parted_meshes import grid

from enumsol import LoadStep, enumerate_roots, fem, gallery, histories, write_report

pytest.importorskip("plotly")
pytestmark = pytest.mark.skipif(find_browser() is None, reason="no headless browser (Debian's package chromium)")
CARDS = "[...document.querySelectorAll('.card')]"


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    path = tmp_path_factory.mktemp("pages") / "wedge.html"
    write_report(enumerate_roots(gallery.get("wedge-14-5").build(), 2.2), path, units=("N", "mm"))
    return path


def show(browser, page, width=1280, colours="light", medium=""):
    scheme = [{"name": "prefers-color-scheme", "value": colours}]
    browser.call("Emulation.setEmulatedMedia", media=medium, features=scheme)
    browser.size(width, 900)
    browser.open(page)


def choose(browser, number, value):
    """Set one of the controls of all bodies."""
    select = f"document.querySelectorAll('#looks select')[{number}]"
    browser.evaluate(f"{{const s = {select}; s.value = '{value}'; s.dispatchEvent(new Event('change')); 1}}")


def luminance(rgb):
    """As the guidelines for the contrast of web pages define it."""
    return np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4) @ [0.2126, 0.7152, 0.0722]


def brightness(browser, folder):
    """Of the corner of a picture of the page, and the range over all of it."""
    browser.screenshot(folder / "page.png")
    picture = matplotlib.image.imread(folder / "page.png")[..., :3].mean(axis=2)
    return picture[2, 2], np.ptp(picture)


@pytest.mark.few(3)
@pytest.mark.parametrize(
    ("width", "colours", "medium"),
    [
        *((width, colours, "") for colours in ("light", "dark") for width in (400, 800, 1280)),
        (703, "dark", "print"),  # A4 without its margins
    ],
)
def test_screenshots(browser, page, tmp_path, width, colours, medium):
    show(browser, page, width, colours, medium)
    corner, contrast = brightness(browser, tmp_path)
    assert corner < 0.2 if (colours, medium) == ("dark", "") else corner > 0.95
    assert contrast > 0.7
    assert browser.evaluate("document.documentElement.scrollWidth") <= width
    # words can be read on what they stand on
    shades = browser.evaluate(
        "['fg', 'dim', 'force', 'accent', 'bg'].map((name) => ink(name).match(/\\d+/g).map(Number))"
    )
    *inks, ground = (np.array(shade) / 255 for shade in shades)
    for ink in inks:
        low, high = sorted((luminance(ink), luminance(ground)))
        assert (high + 0.05) / (low + 0.05) > 4.5
    # bodies are large: they fill the width of their cards, or as much of the window as can be seen
    sizes = browser.evaluate(
        f"{CARDS}.map((c) => [c, c.querySelector('svg.body')].map((e) => e.getBoundingClientRect().width))"
    )
    assert len(sizes) == 5
    assert all(picture > 0.9 * card for card, picture in sizes)
    assert all(card > (350 if width > 400 or medium else 300) or medium for card, _ in sizes)
    avoid = "['.card', 'tr', 'figure'].map((name) => getComputedStyle(document.querySelector(name)).breakInside)"
    assert browser.evaluate(avoid) == ["avoid" if medium else "auto"] * 3
    shown = browser.evaluate(
        "['.card button', '.controls', '#theme'].map((s) => getComputedStyle(document.querySelector(s)).display)"
    )
    assert (set(shown) == {"none"}) == bool(medium)
    assert browser.complaints() == []


def test_the_switch_between_light_and_dark(browser, page, tmp_path):
    show(browser, page, colours="dark")
    assert brightness(browser, tmp_path)[0] < 0.2
    browser.evaluate("byId('theme').click()")
    assert brightness(browser, tmp_path)[0] > 0.95
    browser.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    browser.evaluate("window.dispatchEvent(new Event('afterprint'))")
    browser.evaluate("byId('theme').click()")
    assert brightness(browser, tmp_path)[0] < 0.2


def test_pictures_of_a_history_are_dark_in_the_dark_and_light_on_paper(browser, tmp_path):
    found = histories(gallery.two_node_square(), [LoadStep(1.0), LoadStep(3.5)])
    write_report(found, tmp_path / "history.html")
    for colours, medium in (("light", ""), ("dark", ""), ("dark", "print")):
        show(browser, tmp_path / "history.html", colours=colours, medium=medium)
        browser.evaluate("document.querySelector('[data-step]:not([hidden]) img').scrollIntoView()")
        browser.screenshot(tmp_path / "shot.png")
        pixels = matplotlib.image.imread(tmp_path / "shot.png")[..., :3].mean(axis=2)
        bright = float(np.mean(pixels > 0.8))
        assert bright < 0.1 if (colours, medium) == ("dark", "") else bright > 0.7


def test_enlargements(browser, page):
    show(browser, page)
    inputs = "[...document.querySelectorAll('.card input')]"
    values = f"{inputs}.map((i) => Number(i.value))"
    size = browser.evaluate("data.body.size")
    moved = browser.evaluate(
        "data.roots.map((item) => Math.max(...data.body.points.map((_, k) => lengthOf(item.u, k))))"
    )
    own = browser.evaluate(values)
    assert all(0.03 < scale * length / size <= 0.0801 for scale, length in zip(own, moved, strict=True))
    assert len(set(own)) > 2
    outline = f"{CARDS}.map((c) => c.querySelector('path.after').getAttribute('d'))"
    first = browser.evaluate(outline)
    browser.evaluate(f"(() => {{ const i = {inputs}[1]; i.value = '7'; i.dispatchEvent(new Event('change')); }})()")
    assert browser.evaluate(values) == [own[0], 7, *own[2:]]
    assert [k for k, (new, old) in enumerate(zip(browser.evaluate(outline), first, strict=True)) if new != old] == [1]
    browser.evaluate("[...document.querySelectorAll('#looks button')][1].click()")
    assert browser.evaluate(values) == [2 * own[0], 14, *(2 * scale for scale in own[2:])]
    choose(browser, 0, "same")
    assert browser.evaluate(values) == [min(own)] * 5
    # 0 is the undeformed body, whose corners are those of the rim
    browser.evaluate(f"(() => {{ const i = {inputs}[0]; i.value = '0'; i.dispatchEvent(new Event('change')); }})()")
    path = "document.querySelector(`.card path.${kind}`).getAttribute('d')"
    corners = f"(kind) => new Set({path}.match(/[-0-9.e]+ [-0-9.e]+/g))"
    assert browser.evaluate(f"[...({corners})('before')].every((point) => ({corners})('after').has(point))")


def test_pictures_are_zoomed_by_buttons_keys_and_a_larger_card(browser, page):
    show(browser, page)
    box = "document.querySelector('.card svg.body').getAttribute('viewBox').split(' ').map(Number)"
    whole = browser.evaluate(box)
    browser.evaluate("document.querySelector('.card [aria-label=\"zoom in\"]').click()")
    near = browser.evaluate(box)
    assert near[2:] == pytest.approx([side / 1.5 for side in whole[2:]])
    assert near[0] + near[2] / 2 == pytest.approx(whole[0] + whole[2] / 2)
    browser.evaluate("document.querySelector('.card svg.body').focus()")
    browser.call("Input.dispatchKeyEvent", type="keyDown", key="ArrowRight")
    assert browser.evaluate(box)[0] > near[0]
    browser.call("Input.dispatchKeyEvent", type="keyDown", key="0")
    assert browser.evaluate(box) == pytest.approx(whole)
    width = "document.querySelector('.card').getBoundingClientRect().width"
    before = browser.evaluate(width)
    browser.evaluate("document.querySelector('.card h3 button').click()")
    assert browser.evaluate(width) > 1.8 * before


def test_a_button_zooms_to_the_contact_and_back(browser, page):
    show(browser, page)
    number = browser.evaluate(
        "data.roots.findIndex((item) => [...item.statuses].filter((code) => code !== '0').length === 2)"
    )
    card = f"{CARDS}[{number}]"
    box = f"{card}.querySelector('svg.body').getAttribute('viewBox').split(' ').map(Number)"
    mark = f"{card}.querySelector('polygon.stands').getBoundingClientRect().width"
    whole, size = browser.evaluate(box), browser.evaluate(mark)
    browser.evaluate(f"views.clear(); {card}.querySelector('[aria-label=\"zoom in\"]').click(); 1")
    browser.evaluate(f"{card}.querySelector('[aria-label=\"zoom to the contact, and back\"]').click()")
    x, y, width, height = browser.evaluate(box)
    assert (width < 0.999 * whole[2]) == (height < 0.999 * whole[3])
    places = browser.evaluate(
        f"[...{card}.querySelectorAll('polygon.stands')].map((e) => e.style.transformOrigin.split(' ').map(parseFloat))"
    )
    assert len(places) == 2
    assert all(x < a < x + width and y < b < y + height for a, b in places)
    # marks keep about their size on the screen
    assert browser.evaluate(mark) < 1.3 * size
    browser.evaluate(f"{card}.querySelector('[aria-label=\"zoom to the contact, and back\"]').click()")
    assert browser.evaluate(box) == pytest.approx(whole)


@pytest.fixture(scope="module")
def fine(tmp_path_factory):
    acting = {"contact": "bottom", "spring": {"left": (5, 5)}, "load": {"top": (0.1, -0.3)}, "friction": 0.4}
    scene = fem.mesh_scene(grid(60, 40, 4, 1.5), young=7, poisson=0.3, **acting)
    path = tmp_path_factory.mktemp("pages") / "fine.html"
    write_report(enumerate_roots(scene.problem(), 0), path, scene=scene)
    return path


def test_lines_of_a_fine_mesh_are_thin_or_gone(browser, fine):
    width = "getComputedStyle(document.querySelector('path.after')).strokeWidth"
    line = "getComputedStyle(document.querySelector('path.after')).stroke"
    show(browser, fine, 1280)
    cell = browser.evaluate("document.querySelector('path.rim').getBoundingClientRect().width") / 60
    assert cell > 5
    assert float(browser.evaluate(width).removesuffix("px")) == pytest.approx(cell / 16, rel=0.1)
    show(browser, fine, 320)
    assert browser.evaluate(line) == "none"
    assert browser.evaluate("getComputedStyle(document.querySelector('path.rim')).stroke") != "none"
    # seen from near they are there again
    for _ in range(3):
        browser.evaluate("document.querySelector('[aria-label=\"zoom in\"]').click()")
    assert browser.evaluate(line) != "none"
    # about twelve signs of 41 springs and 61 loads
    assert browser.evaluate("document.querySelectorAll('svg.body polyline.wall').length") == 12
    assert browser.evaluate("document.querySelectorAll('svg.body polygon.load').length") == 12
    assert "load (each arrow is a sum over nodes near it)" in browser.evaluate("byId('marks').textContent")


def test_a_body_drawn_by_its_boundary_keeps_its_lines(browser, tmp_path, monkeypatch):
    monkeypatch.setattr("enumsol.report.parts.MOST_NUMBERS", 600)
    acting = {"contact": "bottom", "clamp": "left", "load": {"top": (0.1, -0.3)}, "friction": 0.4}
    write_report(
        enumerate_roots(fem.mesh_problem(grid(20, 10, 4), young=7, poisson=0.3, **acting), 0), tmp_path / "p.html"
    )
    show(browser, tmp_path / "p.html", 320)
    assert browser.evaluate("data.body.cells") is None
    assert browser.evaluate("getComputedStyle(document.querySelector('path.after')).stroke") != "none"
    assert browser.evaluate("document.querySelectorAll('svg.body line.load').length") == 12
    assert browser.complaints() == []


def test_three_cards_stand_side_by_side_on_a_wide_screen(browser, page):
    show(browser, page, 1600)
    tops = browser.evaluate(f"{CARDS}.map((c) => c.getBoundingClientRect().top)")
    assert [tops.count(top) for top in sorted(set(tops))] == [3, 2]


def test_strips_and_words_for_screen_readers(browser, page):
    roots = enumerate_roots(gallery.get("wedge-14-5").build(), 2.2)
    show(browser, page)
    glyphs = {"open": "\N{WHITE CIRCLE}", "stick": "\N{BLACK SQUARE}", "slip+": "\N{BLACK UP-POINTING TRIANGLE}"}
    strips = browser.evaluate(f"{CARDS}.map((c) => c.querySelector('.strip').textContent)")
    assert strips == ["".join(glyphs[status.value] for status in root.statuses) for root in roots]
    images = "[...document.querySelectorAll('[role=img], img')].map((e) => e.getAttribute('aria-label') || e.alt)"
    assert all(browser.evaluate(images))
    name = "(e.ariaLabel || e.textContent || '') + [...(e.labels || [])].map((l) => l.textContent)"
    named = f"[...document.querySelectorAll('button, input, select')].map((e) => {name})"
    assert all(text.strip() for text in browser.evaluate(named))
    told = "[t.caption !== null, [...t.querySelectorAll('th')].every((h) => h.scope)]"
    tables = f"[...document.querySelectorAll('table')].map((t) => {told})"
    assert all(all(found) for found in browser.evaluate(tables))
    # the scale of the forces is as long as it says
    longest = max(np.max(np.hypot(root.lambda_n, root.lambda_t)) for root in roots)
    assert browser.evaluate("scalesOf(data.roots, data.alpha).force") == pytest.approx(longest)
    step = float(browser.evaluate("document.querySelector('.card svg text').textContent").removesuffix(" N"))
    assert 0.4 * longest < step <= longest
    last = "[...document.querySelectorAll('.card svg.body line.force')].at(-1)"
    ends = browser.evaluate(f"['x1', 'x2'].map((k) => Number({last}.getAttribute(k)))")
    size = browser.evaluate("data.body.size")
    # the line ends in the head of the arrow
    assert ends[1] - ends[0] == pytest.approx(0.16 * size * step / longest - 0.8 * 0.03 * size, rel=1e-3)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("kind", [3, 6, 8, (3, 4), (3, 9)])
def test_stresses_are_those_of_finite_elements(browser, tmp_path, kind):
    mesh = grid(3, 2, kind, shake=0.05)
    acting = {"contact": "bottom", "clamp": "left", "load": {"top": (0.1, -0.3)}, "friction": 0.4}
    roots = enumerate_roots(fem.mesh_problem(mesh, young=7, poisson=0.3, **acting), 0)
    root = roots[0]
    write_report(roots, tmp_path / "page.html")
    show(browser, tmp_path / "page.html")
    found = browser.evaluate("data.body.cells.map((cell, k) => stress(cell, k, data.roots[0].u))")
    sigma = fem.cell_stresses(root.problem, root.u)
    largest = np.max(np.abs(sigma))
    half = (sigma[:, 0, 0] - sigma[:, 1, 1]) / 2
    mean, shear = np.trace(sigma, axis1=1, axis2=2) / 2, np.hypot(half, sigma[:, 0, 1])
    np.testing.assert_allclose([part["mean"] for part in found], mean, atol=1e-5 * largest)
    np.testing.assert_allclose([part["shear"] for part in found], shear, atol=1e-5 * largest)
    choose(browser, 1, "shear")
    fills = browser.evaluate("[...document.querySelectorAll('path.after')].map((path) => path.style.fill)")
    assert len(fills) == len(mesh.cells)
    brightest = int(np.argmax([part["shear"] for part in found]))
    assert fills[brightest].replace(" ", "") == "rgb(253,231,37)"
    assert browser.complaints() == []
