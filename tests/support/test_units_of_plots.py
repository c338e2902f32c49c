"""Every figure of the public interface takes units for its axes and the file that it is saved in."""

import inspect

import pytest
from parted_meshes import grid

import enumsol
from enumsol import fem

UNITS = ("kN", "mm")
SQUARE = enumsol.gallery.two_node_square()
SOLID = enumsol.gallery.wedge3d(2, 1, 2)


def scene():
    contact = {"contact": "bottom", "friction": 0.3, "young": 1.0, "poisson": 0.3, "clamp": "top"}
    return fem.mesh_scene(grid(2, 2, 4), **contact)


#: By the name of the function: a call, and units that stand in its figure.
FIGURES = {
    "BranchGraph.plot": (lambda **o: enumsol.branch_graph(SQUARE, (0, 10)).plot(**o), "[kN]"),
    "Path.plot": (
        lambda **o: enumsol.follow(SQUARE, enumsol.newton(SQUARE, 0), interval=(0, 1)).plot(quantity="u_n", **o), "[mm]"
    ),
    "RootSet.plot_bodies": (lambda **o: enumsol.enumerate_roots(SQUARE, 3.5).plot_bodies(**o), "up to 3.162 kN"),
    "Root.plot": (enumsol.newton(SOLID, 1).plot, "y [mm]"),
    "Root.plot_body": (enumsol.newton(SQUARE, 1).plot_body, "x [mm]"),
    "History.plot": (lambda **o: enumsol.histories(SQUARE, [0, 1]).plot("dissipated", "lambda_n", **o), "[kN mm]"),
    "MultiplicityMap.plot": (lambda **o: enumsol.multiplicity_map(SQUARE, (0, 1), {"gap": [0, 0.1]}).plot(**o), "[mm]"),
    "Scene.plot": (lambda **o: scene().plot(**o), "x [mm]"),
}  # fmt: skip


def words(figure):
    from matplotlib.text import Text

    return " | ".join(text.get_text() for text in figure.findobj(Text))


@pytest.mark.parametrize("name", FIGURES)
def test_units_stand_at_the_axes_and_the_figure_is_saved(name, tmp_path):
    draw, said = FIGURES[name]
    figure = draw(units=UNITS, file=tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 1000
    assert said in words(figure)
    assert not any(unit in words(draw()) for unit in UNITS)
    with pytest.raises(enumsol.InvalidArgumentError, match="units is 'kN'; expected units of force and length"):
        draw(units="kN")
    assert said in words(draw(units="kN, mm"))


def test_no_figure_is_forgotten():
    """Whatever is called plot or plot_..., of all that is public."""
    found = set()
    for name in enumsol.__all__:
        made = getattr(enumsol, name)
        if inspect.isclass(made):
            found |= {f"{name}.{part}" for part, _ in inspect.getmembers(made, inspect.isroutine) if part[:4] == "plot"}
    assert found <= FIGURES.keys()
    assert len(found) >= 7


def test_a_dollar_sign_in_a_name_begins_no_formula(tmp_path):
    problem = enumsol.gallery.one_node_triangle().replace(node_ids=["a $x_{$"])
    graph = enumsol.branch_graph(problem, (0, 1))
    figure = graph.plot(nodes=problem.node_ids, title="costs $x_{$ 5", file=tmp_path / "graph.png")
    assert (tmp_path / "graph.png").stat().st_size > 1000
    figure.draw_without_rendering()
    assert r"costs \$x_{\$ 5" in words(figure)
