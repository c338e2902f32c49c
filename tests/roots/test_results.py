"""RootSet and Root as the user sees them."""

import pickle
import re
from fractions import Fraction
from html.parser import HTMLParser

import numpy as np
import pytest
from compare import forces
from generators import dense_compliance, from_condensed, named, planted_load
from problems3d import from_compliance, in_space, random_over_alpha, random_plane_over_alpha

import enumsol
from enumsol import ContactProblem, ContactStatus, PiecewiseSmoothEquation, branch_graph, enumerate_roots, gallery
from enumsol.support.messages import html_lines, html_table

CASES = [
    ("one-node-6.1", None), ("two-node-5", None), ("two-node-6.7-minus", None), ("two-node-6.7-plus", None),
    ("wedge-8-3", None), ("wedge-8-5", None), ("clamped-block-16", None), ("clamped-block-16", 0.0),
]  # fmt: skip


@pytest.mark.parametrize(("name", "alpha"), CASES)
def test_roots_solve_the_problem(name, alpha):
    problem, usual = named(name)
    alpha = usual if alpha is None else alpha
    size = np.max(np.abs(problem.load_at(alpha))) + np.max(np.abs(problem.A.data)) * np.max(np.abs(problem.gap))
    for root in enumsol.enumerate_roots(problem, alpha, "fast"):
        u = root.u
        balance = problem.A @ u + problem.contact_rows.T @ forces(root) - problem.load_at(alpha)
        assert np.max(np.abs(balance)) < 1e-10 * size
        scale = np.max(np.abs(u)) + size / np.max(np.abs(problem.A.data))
        np.testing.assert_allclose(problem.Bn @ u - problem.gap, root.u_n, atol=1e-9 * scale)
        np.testing.assert_allclose(problem.Bt @ u - problem.slip_offset, root.u_t, atol=1e-9 * scale)
        assert np.all(root.lambda_n >= 0)
        assert np.all(root.u_n <= 0)
        for r in (0.1, 1.0, 10.0):
            equation = PiecewiseSmoothEquation(problem, r)
            x = np.concatenate([u, forces(root)])
            assert np.max(np.abs(equation.residual(x, alpha))) < 1e-9 * size
            if root.regular:
                # open nodes: theta2 and theta3 carry the sign of u_t
                tested = equation.test_functions(x, alpha)
                clear = np.abs(tested) > 1e-9 * size
                assert np.array_equal(root.signs[clear], np.sign(tested[clear]))
                assert np.all(clear[:, 0])


def test_signs_name_the_selection():
    roots = enumsol.enumerate_roots(gallery.one_node_triangle(), 5.0, "fast")
    assert [root.signs.tolist() for root in roots] == [[[-1, -1, -1]], [[1, -1, -1]], [[1, -1, 1]]]
    for root in roots:
        assert root.active == (frozenset({root.statuses[0]}),)
    # at the fold stick meets slip-: theta3 vanishes
    fold = enumsol.enumerate_roots(gallery.one_node_triangle(), Fraction(8, 3), "exact")[1]
    assert fold.active == (frozenset({ContactStatus.STICK, ContactStatus.SLIP_MINUS}),)
    assert (fold.signs.tolist(), fold.statuses) == ([[1, -1, 0]], (ContactStatus.STICK,))


def paths():
    """Problems with roots that move with alpha: friction path, loading path, both; with slipping nodes."""
    yield gallery.one_node_triangle(), 5.0
    yield gallery.get("two-node-5").build(), 5.0
    yield gallery.get("two-node-6.7-minus").build(), 1.6
    yield gallery.get("wedge-8-5").build(), 3.0
    yield gallery.clamped_block(8, 4), 0.7
    yield gallery.clamped_block(8, 4), 0.0
    rng = np.random.default_rng(8)
    loads = ((dense_compliance(rng, 3), np.exp(rng.uniform(0, 3, size=3))) for _ in range(20))
    planted = [(S, g, F) for S, F in loads if (g := planted_load(rng, S, F)) is not None]
    for S, g, F in planted[:5]:
        base = from_condensed(S, g, F)
        slope = 0.1 * base.A @ rng.normal(size=6)
        yield (
            ContactProblem(base.A, base.Bn, base.Bt, base.f, friction=F, friction_slope=0.1 * F, load_slope=slope),
            0.0,
        )


@pytest.mark.parametrize(("problem", "alpha"), list(paths()))
def test_derivative_against_finite_differences(problem, alpha):
    h = 1e-6
    sides = {}
    for sign in (1, -1) if alpha > 0 or problem.load_slope is not None else (1,):
        for root in enumsol.enumerate_roots(problem, alpha + sign * h, "fast"):
            sides.setdefault(root.statuses, {})[sign] = forces(root)
    moving = 0
    for root in enumsol.enumerate_roots(problem, alpha, "fast"):
        assert root.regular
        near = sides[root.statuses]
        difference = (near[1] - near.get(-1, forces(root))) / (h * len(near))
        given = root.dlambda_dalpha.T.ravel()
        size = np.max(np.abs(difference)) + np.max(np.abs(forces(root)))
        np.testing.assert_allclose(given, difference, rtol=1e-4, atol=(1e-5 if len(near) == 1 else 1e-6) * size)
        moving += np.max(np.abs(given)) > 1e-6 * size
    assert moving > 0


def test_derivative_in_closed_form():
    alpha = 5.0
    roots = enumsol.enumerate_roots(gallery.one_node_triangle(), alpha, "fast")
    slip = -1 / (alpha - 2) ** 2
    expected = {"open": [0, 0], "stick": [0, 0], "slip-": [slip, -1 / (alpha - 2) - alpha * slip]}
    for root in roots:
        np.testing.assert_allclose(root.dlambda_dalpha[0], expected[root.statuses[0].value], rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("seed", range(12))
def test_derivatives_in_3d_against_finite_differences(seed):
    """Of forces and displacements, where friction, load or both depend on alpha."""
    problem, alpha, h = random_over_alpha(2, seed), 0.4, 1e-5
    before, at, after = (enumsol.enumerate_roots(problem, alpha + k * h, "fast") for k in (-1, 0, 1))
    assert len(before) == len(at) == len(after)
    for low, root, high in zip(before, at, after, strict=True):
        assert root.regular
        assert low.statuses == root.statuses == high.statuses
        parts = (("lambda_n", "lambda_t"), root.dlambda_dalpha), (("u_n", "u_t"), root.du_dalpha)
        for names, given in parts:
            difference = np.column_stack([(getattr(high, name) - getattr(low, name)) / (2 * h) for name in names])
            size = max(np.max(np.abs(getattr(root, name))) for name in names)
            np.testing.assert_allclose(given, difference, rtol=1e-6, atol=1e-7 * (1 + size))


@pytest.mark.parametrize("seed", range(6))
def test_a_problem_in_2d_written_in_3d_has_the_same_derivatives(seed):
    problem = random_plane_over_alpha(2, seed)
    flat, solid = (enumsol.enumerate_roots(one, 0.3, "fast") for one in (problem, in_space(problem)))
    assert len(flat) == len(solid)
    for one in flat:
        other = min(solid, key=lambda root: np.max(np.abs(root.lambda_n - one.lambda_n)))
        for name in ("dlambda_dalpha", "du_dalpha"):
            np.testing.assert_allclose(getattr(other, name)[:, :2], getattr(one, name), rtol=1e-9, atol=1e-9)
            assert np.max(np.abs(getattr(other, name)[:, 2])) < 1e-9


def test_derivative_in_3d_where_friction_begins():
    """F = alpha: at alpha = 0 the force of friction grows along the slip; where the node rests it may stick."""
    S, g = np.diag([1.0, 2.0, 3.0]), np.array([1.0, 0.3, -0.4])
    root = enumsol.enumerate_roots(from_compliance(S, g, 0.0).replace(friction_slope=(1.0, 2.0)), 0)[0]
    d = np.array([0.3, -0.8]) / np.hypot(0.3, 0.8)
    np.testing.assert_allclose(root.dlambda_dalpha[0], [0.0, d[0], 2 * d[1]], atol=1e-12)
    np.testing.assert_allclose(root.du_dalpha[0], [0.0, -2 * d[0], -6 * d[1]], atol=1e-12)
    rest = from_compliance(S, np.array([1.0, 0.0, 0.0]), 0.0).replace(friction_slope=(1.0, 2.0))
    (found,) = enumsol.enumerate_roots(rest, 0)
    assert found.dlambda_dalpha is found.du_dalpha is None


def test_margin_shrinks_towards_the_change_of_status():
    # stick ends at alpha = 8/3, slip- too; open never
    margins = [
        [root.margin for root in enumsol.enumerate_roots(gallery.one_node_triangle(), alpha, "fast")]
        for alpha in (2.667, 2.7, 3.0, 4.0)
    ]
    sticks, slips = [m[2] for m in margins], [m[1] for m in margins]
    assert 0 < sticks[0] < sticks[1] < sticks[2] < sticks[3]
    assert 0 < slips[0] < slips[1] < slips[2]
    assert len({m[0] for m in margins}) == 1


def test_condition_grows_towards_a_singular_selection():
    # the determinant of slip- vanishes at alpha = 2
    problem = gallery.one_node_triangle((1.0, -1.9))
    for alpha in (3.0, 2.5, 2.1):
        by_status = {root.statuses[0].value: root for root in enumsol.enumerate_roots(problem, alpha, "fast")}
        assert 1 <= by_status["stick"].condition < np.inf


def test_sequence():
    roots = enumsol.enumerate_roots(gallery.get("two-node-5").build(), 5.0, "fast")
    assert len(roots) == 5
    assert roots[0] is next(iter(roots))
    assert roots[-1] is roots[4]
    assert roots[1:3] == (roots[1], roots[2])
    assert next(reversed(roots)) is roots[4]
    with pytest.raises(IndexError):
        roots[5]
    assert [roots.index(root) for root in roots] == [0, 1, 2, 3, 4]
    assert roots[4] in roots


def test_an_item_beyond_the_end_is_refused_in_a_sentence():
    problem = gallery.one_node_triangle()
    roots, graph = enumerate_roots(problem, 5), branch_graph(problem, (0, 5))
    history = enumsol.histories(problem, [5, 4])
    path = enumsol.follow(problem, roots[0], interval=(4, 5), direction=-1)
    three = "there are 3 roots; expected a number from 0 to 2, or from -3 to -1"
    for items, at, said in (
        (roots, 9, f"there is no root 9: {three}"),
        (roots, -4, f"there is no root -4: {three}"),
        (roots.families, 0, "there is no family 0: there are 0 families"),
        (graph.arcs, 99, "there is no arc 99: there are"),
        (graph.branches, 99, "there is no branch 99: there are 2 branches"),
        (history.roots(1), 3, f"there is no root 3: {three}"),
        (history.stages(1), 1, "there is no stage 1: there is 1 stage; expected 0"),
        (path, len(path), f"there is no point {len(path)}: there are"),
        (pickle.loads(pickle.dumps(roots)), 9, f"there is no root 9: {three}"),
    ):
        with pytest.raises(enumsol.NoSuchItemError, match=re.escape(said)) as refused:
            items[at]
        assert isinstance(refused.value, IndexError)
        assert isinstance(refused.value, enumsol.EnumsolError)
    assert type(graph.arcs[:1]) is tuple


@pytest.mark.parametrize("asked", [(), (1,), ("root",)])
def test_a_position_is_asked_of_a_root(asked):
    """The index of a root set is that of any sequence; who expects the topological one is told where that is."""
    roots = enumerate_roots(gallery.one_node_triangle(), 5)
    with pytest.raises(enumsol.InvalidArgumentError, match=r"expected one of these 3 roots .*roots\[0\]\.index"):
        roots.index(*asked)


def test_a_result_that_is_not_complete_is_never_taken_for_one():
    """A text is true whatever it says: no result has one that is called completeness."""
    problem = gallery.one_node_triangle()
    graph = branch_graph(problem, (0, 5), max_nodes=1)
    history = enumsol.histories(problem, [5, 4], max_nodes=1)
    over = enumsol.multiplicity_map(problem, (0, 1), {"friction": [0.1]}, max_nodes=1)
    for result in (enumerate_roots(problem, 5, max_nodes=1), graph, history, over):
        assert result.complete is False
        assert result.closing_line.startswith("complete: no")
        assert repr(result).endswith(result.closing_line)
        assert not hasattr(result, "completeness")


def test_one_undecided_part_is_not_counted():
    found = enumerate_roots(gallery.one_node_triangle(), 5, max_nodes=1)
    names = ("alpha", "families", "arithmetic", "method", "stopped", "stats", "node_ids")
    kept = {name: getattr(found, name) for name in names}
    texts = [repr(enumsol.RootSet(roots=(), undecided=found.undecided[:1] * n, **kept)) for n in (1, 2)]
    assert "\nundecided: " in texts[0]
    assert "\nundecided, 2 times: " in texts[1]


@pytest.mark.parametrize("arithmetic", ["fast", "exact"])
def test_order_is_deterministic(arithmetic):
    for method in ("tree", "exhaustive"):
        roots = enumsol.enumerate_roots(gallery.get("two-node-5").build(), 5.0, arithmetic, method)
        names = [[s.value for s in root.statuses] for root in roots]
        assert names == sorted(names)


def test_frame():
    problem = gallery.get("two-node-5").build().replace(node_ids=["floor", "wall"])
    roots = enumsol.enumerate_roots(problem, 5.0, "fast")
    frame = roots.to_frame()
    assert list(frame.columns) == [
        "alpha", "root", "node", "status", "lambda_n", "lambda_t", "u_n", "u_t", "index", "regular",
    ]  # fmt: skip
    assert frame["node"].tolist() == ["floor", "wall"] * 5
    for k, part in frame.groupby("root"):
        root = roots[k]
        assert part["status"].tolist() == [s.value for s in root.statuses]
        for name in ("lambda_n", "lambda_t", "u_n", "u_t"):
            assert np.array_equal(part[name], getattr(root, name))
        assert part["index"].tolist() == [root.index] * 2
    assert frame["alpha"].eq(5.0).all()
    assert frame["regular"].all()
    none = enumsol.enumerate_roots(gallery.one_node_triangle((1.0, -2.0)), 2.0, "exact")
    assert len(none.to_frame()) == 0


def test_repr():
    roots = enumsol.enumerate_roots(gallery.one_node_triangle(), 5.0, "fast")
    heading, columns, *lines, total, complete = repr(roots).splitlines()
    assert heading == "RootSet at alpha = 5: 3 roots (fast, tree)"
    assert columns.split() == ["index", "regular", "margin", "max", "lambda_n", "contact"]
    assert [line.split()[1] for line in lines[:3]] == ["+1", "-1", "+1"]
    assert (total, complete) == ("index sum: +1", "complete: not proven (0 undecided)")
    exact = enumsol.enumerate_roots(gallery.one_node_triangle(), 5.0, "exact")
    assert repr(exact).splitlines()[-1] == "complete: yes (proven)"
    many = repr(enumsol.enumerate_roots(gallery.chain(4), 5.0, "fast"))
    assert "... 61 more" in many
    assert len(many.splitlines()) < 30


def test_exact_values_are_rounded_once():
    # every lambda is a float nearest to a rational: compare with the closed form in rationals
    for alpha in (Fraction(7, 2), Fraction(10, 3), Fraction(22, 7)):
        roots = enumsol.enumerate_roots(gallery.one_node_triangle(), alpha, "exact")
        assert forces(roots[1]).tolist() == [float(1 / (alpha - 2)), float(-alpha / (alpha - 2))]
        assert roots.alpha == alpha


# -- a root in print ---------------------------------------------------------------------------------------------------


def printed(root, capsys):
    print(root)  # noqa: T201  # printing it is the test
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    return lines


def test_one_line_a_node_under_a_heading(capsys):
    roots = enumsol.enumerate_roots(gallery.two_node_square(), 3.5)
    heading, columns, *rows = printed(roots[1], capsys)
    assert heading == f"Root at alpha = 3.5: index -1, regular, margin {roots[1].margin:.2e}"
    assert columns.split() == ["node", "status", "lambda_n", "lambda_t", "u_n", "u_t", "at", "(x,", "y)"]
    assert [row.split() for row in rows] == [
        ["0", "slip-", "0.5", "-1.75", "0", "-1", "(0,", "0)"],
        ["1", "open", "0", "0", "-0.25", "-0.75", "(1,", "0)"],
    ]
    # whose places are not known
    bare = enumsol.enumerate_roots(gallery.two_node_square().replace(mesh=None, coordinates=None), 3.5)
    assert printed(bare[1], capsys)[1].split()[-1] == "u_t"


def test_a_root_that_is_not_regular_says_so(capsys):
    roots = enumsol.enumerate_roots(gallery.one_node_triangle(), Fraction(8, 3))
    assert printed(roots[1], capsys)[0] == "Root at alpha = 2.66667: index +0, not regular, margin 0.00e+00"


def test_labels_are_those_of_the_problem(capsys):
    problem = gallery.two_node_square().replace(node_ids=["left foot", 17])
    lines = printed(enumsol.enumerate_roots(problem, 3.5)[1], capsys)
    assert lines[2].startswith("left foot slip-")
    assert lines[3].startswith("       17 open")


@pytest.mark.slow
@pytest.mark.parametrize(("size", "more"), [(16, 0), (32, 12), (100, 80)])
def test_large_roots_are_cut(capsys, size, more):
    lines = printed(enumsol.newton(*named(f"clamped-block-{size}")), capsys)
    assert len(lines) == (2 + 20 + 1 if more else 2 + size)
    assert not more or lines[-1].startswith(f"... {more} more nodes; all of them: ")


def test_the_prompt_shows_the_same():
    root = enumsol.newton(gallery.one_node_triangle(), 1.0)
    assert repr(root) == str(root)


# -- in notebooks ------------------------------------------------------------------------------------------------------


class Cells(HTMLParser):
    """Elements and texts of a piece of HTML; complains about what is not closed."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.cells = [], [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)
        self.tags.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.cells.append(data)


def test_texts_are_escaped():
    cells = Cells(html_lines(["a < b & c"]) + html_table(["<i>"], [["<script>x</script>", 3]]))
    assert cells.cells == ["a < b & c", "<i>", "<script>x</script>", "3"]
    assert "script" not in cells.tags


def test_roots_and_root_sets():
    labels = ["<script>x</script>", "b"]
    roots = enumerate_roots(gallery.two_node_square().replace(node_ids=labels), 3.5)
    cells = Cells(roots._repr_html_())
    assert (cells.tags.count("tr"), cells.cells[0]) == (6, repr(roots).splitlines()[0])
    assert cells.cells[-2:] == ["index sum: +1", "complete: yes (proven)"]
    one = Cells(roots[1]._repr_html_())
    assert set(labels) <= set(one.cells)
    assert (one.tags.count("script"), one.tags.count("tr")) == (0, 3)
    assert {*repr(roots[1]).split()[-7:-2], "(1, 0)", "at (x, y)"} <= set(one.cells)


def test_a_family():
    family = enumerate_roots(gallery.get("one-node-6.3").build(), 2).families[0]
    cells = Cells(family._repr_html_())
    assert cells.cells[0] == "RootFamily at alpha = 2: index +1, dimension 1"
    assert cells.cells[-5:] == ["0", "1", "2", "1", "slip-"]


def test_many_nodes_and_many_roots_are_cut():
    roots = enumerate_roots(gallery.chain(4), 5.0)
    cells = Cells(roots._repr_html_())
    assert cells.tags.count("tr") == 21
    assert any("61 more" in text for text in cells.cells)
    block = enumerate_roots(gallery.clamped_block(24, 2), 3.0)[0]
    assert Cells(block._repr_html_()).tags.count("tr") == 21
    assert "... 4 more nodes" in block._repr_html_()
    space = enumerate_roots(gallery.get("one-node-3d-3").build(), 0)
    assert "lambda_t2" in Cells(space[1]._repr_html_()).cells


@pytest.mark.parametrize("nodes", [None, 3])
def test_graphs_and_proofs(nodes):
    problem = gallery.two_node_square()
    graph = branch_graph(problem, (0, 10), max_nodes=nodes)
    cells = Cells(graph._repr_html_())
    assert cells.cells[-1] == graph.closing_line
    assert cells.tags.count("tr") == (1 + len(graph.branches) if graph.branches else 0)
    proofs = [enumerate_roots(problem, 3.5, max_nodes=nodes).proof]
    if nodes is None:
        assert Cells(graph.proof._repr_html_()).cells == [repr(graph.proof)]
        proofs.append(graph.proof)
    for report in (enumsol.verify(problem, proof) for proof in proofs):
        assert Cells(report._repr_html_()).cells == repr(report).splitlines()
