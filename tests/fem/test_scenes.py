"""Wrong scenes, each refused or noted in one sentence; what a scene says and draws."""

import re

import numpy as np
import pytest
from parted_meshes import grid
from refusals import bad_problem, refusal
from two_bodies import blocks, boxes, shifted, together

from enumsol import EnumsolError, fem

GOOD = {"young": 2.0, "poisson": 0.3, "contact": "bottom", "clamp": "top", "load": {"left": (0.01, 0.0)}}
PAIR = {**GOOD, "contact": (), "pairs": [("upper.bottom", "lower.top")], "clamp": ["upper.top", "lower.bottom"]}
PAIR["load"] = {"upper.right": (0.01, 0.0)}


def one():
    return grid(2, 2, 4)


def two():
    flat = blocks(4, 3, 2)
    return fem.PartedMesh(flat.points, flat.cells, flat.facets, {}, {"pad": np.arange(6), "disc": np.arange(6, 10)})


def three():
    """A third block beside two others."""
    return together(
        ("upper", shifted(grid(2, 1, 4), (0, 1))), ("lower", grid(2, 1, 4)), ("loose", shifted(one(), (5, 0)))
    )


def apart(gap):
    return lambda: blocks(4, gap=gap)


def rolling():
    """A block with a round bottom on a flat one."""
    round_one = grid(8, 4, 4)
    x, y = round_one.points.T
    points = np.stack([x + 0.5, y + 1.0 + 1.2 * (1 - y) * (x - 0.5) ** 2], axis=1)
    return together(("upper", fem.PartedMesh(points, round_one.cells, round_one.facets)), ("lower", grid(8, 2, 4, 2.0)))


def wide():
    return together(("upper", shifted(grid(6, 1, 4, 3.0), (0, 1))), ("lower", grid(2, 1, 4)))


def scene_of(mesh, changes):
    """The scene of one body on a foundation, or of two on each other, with other options than the good ones."""
    scene = fem.mesh_scene(mesh(), **(GOOD if mesh is one else PAIR) | changes)
    scene.problem()
    return scene


REFUSED = [
    (one, {"obstacle": {"plane": (0, -0.1, 0, -1)}}, "obstacle plane is behind the contact boundary, .* point away"),
    (one, {"obstacle": {"plane": (0, 2.0, 0, -1)}}, "obstacle plane is behind .*expected the direction from the plane"),
    (
        one,
        {"obstacle": {"circle": (0.5, 3, 1)}},
        "obstacle circle is behind the contact boundary, .*or hole for a body",
    ),
    (one, {"obstacle": {"hole": (0.5, -3, 1)}}, "obstacle hole is behind .* or circle or sphere"),
    (two, {"pairs": [("upper.bottom", "lower.bottom")]}, "upper.bottom of the pair .* face each other with opp"),
    (two, {"pairs": [("upper.top", "lower.bottom")]}, "upper.top of the pair .* has no node that faces a facet"),
    (two, {"pairs": [("upper.left", "lower.left")]}, "upper.left of the pair .* has no node that faces a facet"),
    (
        two,
        {"contact": ["upper.bottom"], "pairs": ()},
        "contact names upper.bottom, whose facets coincide with those of lower.top, .*expected the pair upper.bottom:",
    ),
    (
        two,
        {"contact": ["lower.left", "lower.top", "upper.bottom"], "pairs": ()},
        "contact names (lower.top|upper.bottom), whose facets coincide .* put a rigid wall between both bodies",
    ),
    (two, {"contact": ["upper.bottom"]}, "all nodes of upper.bottom belong to another contact already"),
    (two, {"clamp": "upper.top"}, "^disc is free to move as a rigid body; expected clamp"),
    (two, {"clamp": "lower.bottom"}, "^pad is free to move as a rigid body; expected clamp"),
    (
        three,
        {},
        r"^the body with the boundary loose.bottom, loose.top, loose.left, ... is free to move as a rigid body",
    ),
    (two, {"young": {"pad": 1.0}}, "young is not given for 4 of 10 cells, those of disc"),
    (two, {"friction": {"lower.top": 0.1}}, "friction is given for lower.top, which has no contact nodes"),
    (two, {"pairs": [("upper.bottom", "lower.top", None)]}, "gap of the pair .* is None; expected a finite"),
    (two, {"symmetry": ["upper.bottom"]}, "normals at the plane of symmetry row 0 is zero"),
    (one, {"contact": "top"}, "contact has no node that clamp or displacement leave free"),
    (one, {"contact": "floor"}, "no facets named 'floor'; expected one of bottom, top, left, right"),
    (one, {"clamp": ()}, "^the body is free to move as a rigid body"),
    (one, {"displacement": {"bottom": (0.1, "free")}}, "contact node 0 is held or displaced in some components only"),
    (one, {"displacement": {"top": (0.1, 0.0)}}, "top moves node 6 by 0.1 in x, and another part .* by 0"),
    (one, {"thickness": -1}, "thickness is -1; expected a finite number > 0"),
    (
        two,
        {"pairs": [("lower.top", "lower.bottom")]},
        "lower.top of the pair .* through the body that both belong",
    ),
    (
        two,
        {"pairs": [("lower.left", "lower.right", 0.0)]},
        "lower.left of the pair .* expected parts of two bodies, or of one that face each other with a gap",
    ),
]

NOTED = [
    (apart(3.5), {}, "the smallest gap of the pair upper.bottom:lower.top is 3.5, .* will not be in contact"),
    (
        one,
        {"gap": 5.0},
        "the smallest gap of bottom is 5, more than the extent 1 of the body: it will not be in contact",
    ),
    (one, {"gap": -0.5}, "the press fit of bottom is 0.5, which is not small beside the extent 1"),
    (apart(-0.3), {}, "the press fit of the pair upper.bottom:lower.top is 0.3, which is not small"),
    (one, {"max_rigid_displacement": 2.0}, "max_rigid_displacement has no effect, for supports or springs hold ever"),
    (one, {"load": {"bottom": (0.1, 0.0)}}, "load of bottom acts on contact nodes, as bottom is in contact"),
    (one, {"pressure": {"bottom": 0.1}}, "pressure of bottom acts on contact nodes"),
    (one, {"load": None}, "nothing acts on the body: it has no load, press fit or given displacement, and rests"),
    (
        one,
        {"load": {"left": (3e6, 0.0)}},
        "the loads would strain the body by about .*, which is far from small; are",
    ),
    (one, {"young": 2e13, "load": {"left": (1e-3, 0)}}, "the loads would strain the body by .* next to nothing; are"),
    (one, {"clamp": (), "displacement": {"top": (0.0, -3.0)}}, "a displacement of 3 is given, which is not small"),
    (one, {"friction": 30}, "friction is 30; coefficients of friction above 1 are rare"),
    (two, {"young": {"pad": 1.0, "disc": 1e10}}, r"the moduli of parts differ by a factor of 1e\+10"),
    (
        apart(0.5),
        {"contact": "upper.left", "pairs": ()},
        "the body with the boundary lower.bottom, .* touches nothing: it has no contact part and is in no pair",
    ),
    (
        rolling,
        {"clamp": "lower.bottom", "spring": {"upper.top": (0.1, 0.1)}, "load": {"upper.top": (0.0, -0.01)}},
        "the normals of the pair upper.bottom:lower.top turn along the contact, up to 46 degrees .* caught as in a",
    ),
    (
        one,
        {"young": 2e11, "gap": -1e-3, "load": {"left": (1.0, 0)}},
        "the press fit of bottom is 0.001, while the loads strain the body of extent 1 by about .* fit together",
    ),
    (one, {"young": 2e11, "gap": 1e-3, "load": {"left": (1.0, 0)}}, "the gap of bottom is 0.001, while the loads"),
    (wide, {}, "4 of 7 nodes of upper.bottom face nothing of lower.top and have no contact"),
]


@pytest.mark.parametrize(("mesh", "changes", "message"), REFUSED)
def test_wrong_scenes_that_are_refused(mesh, changes, message):
    refusal(EnumsolError, message, scene_of, mesh, changes)


@pytest.mark.parametrize(("mesh", "changes", "message"), NOTED)
def test_wrong_scenes_that_are_noted(mesh, changes, message):
    (note,) = scene_of(mesh, changes).notes
    assert re.search(message, note)
    assert "\n" not in note
    assert not note.endswith(".")


def test_there_are_thirty_of_them():
    assert len(REFUSED) + len(NOTED) >= 30


@pytest.mark.parametrize(
    ("mesh", "changes"),
    [
        (one, {}),
        (two, {}),
        (one, {"obstacle": {"plane": (0, -0.1, 0, 1)}, "friction": 0, "friction_slope": 1}),
        (one, {"obstacle": {"circle": (0.5, -3, 2.9)}}),
        (one, {"obstacle": {"hole": (0.5, 1.0, 1.5)}}),
        (one, {"contact": ["bottom", "right"], "gap": -1e-3}),
        (apart(0.1), {}),
        (rolling, {}),
        (one, {"young": 2e11, "gap": 1e-3, "load": {"left": (1.0, 0)}, "clamp": (), "spring": {"top": (1.0, 1.0)}}),
        (lambda: boxes(4, 2, 1), {"load": {"upper.right": (0.01, 0, 0)}}),
    ],
)
def test_right_scenes_are_neither(mesh, changes):
    assert scene_of(mesh, changes).notes == []


def test_rollers_given_as_displacements_are_a_plane_of_symmetry():
    """Also where a curved contact ends there, as decks of Abaqus say it."""
    flat = grid(4, 2, 4)
    x, y = flat.points.T
    curved = fem.PartedMesh(np.stack([x, y + 0.1 * x * (2 - x) * (1 - y)], axis=1), flat.cells, flat.facets)
    options = GOOD | {"clamp": "right", "load": {"top": (0.0, -0.01)}, "friction": 0.3}
    mirrored = fem.mesh_problem(curved, **options, symmetry="left")
    assert fem.mesh_problem(curved, **options, displacement={"left": (0.0, "free")}).fingerprint == mirrored.fingerprint
    message = "contact node 0 is held or displaced in some components only, .*by symmetry of a part of the boundary"
    for moved in ((0.1, "free"), ("free", 0.0)):
        refusal(EnumsolError, message, fem.mesh_problem, curved, **options, displacement={"left": moved})


def test_a_scene_in_words():
    mesh = two()
    scene = fem.mesh_scene(
        mesh, **PAIR, friction={"upper.bottom": 0.1}, friction_slope=0.5, load_slope={"upper.left": (0.0, -2.0)}
    )
    said = str(scene)
    for line in (
        "mesh      21 nodes, 10 quadrilaterals, from (0, 0) to (2, 2)",
        "bodies    pad: 6 cells, area 2, held",
        "          disc: 4 cells, area 2, held",
        "material  young 2",
        "upper.bottom: 3 facets, length 2; contact nodes of the pair upper.bottom:lower.top",
        "lower.bottom: 2 facets, length 2; clamp",
        "lower.left: 2 facets, length 1; not used",
        "loads     resultant (0.01, 0)",
        "times alpha: resultant (0, -2)",
        "contact   4 contact nodes of the pair upper.bottom:lower.top, gap 0",
        "          friction 0.1 (upper.bottom)",
        "          friction_slope 0.5",
    ):
        assert line in said
    assert "note" not in said
    assert fem.mesh_problem(mesh, **PAIR).fingerprint == fem.mesh_scene(mesh, **PAIR).problem().fingerprint


def test_what_is_free_is_counted():
    free = PAIR | {"clamp": "lower.bottom"}
    loose = fem.mesh_scene(blocks(4), **free)
    assert "cells, area 2, 3 rigid modes that nothing but contact holds" in str(loose)
    rollers = fem.mesh_scene(blocks(4), **free, symmetry="upper.left")
    assert "1 rigid mode that nothing but contact holds" in str(rollers)
    bad_problem("free to move", rollers.problem)
    solid = fem.mesh_scene(boxes(8), **free | {"load": {"upper.right": (0.01, 0, 0)}, "gap": 0.5, "friction": 0.5})
    assert "volume 0.5, 6 rigid modes that nothing but contact holds" in str(solid)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mesh", "more"),
    [
        (two, {"load_slope": {"upper.left": (0.0, 1.0)}}),
        (lambda: boxes(10, 1, 1), {"load": {"upper.right": (0.01, 0, 0)}}),
    ],
)
def test_a_scene_as_a_picture(mesh, more, tmp_path):
    figure = fem.mesh_scene(mesh(), **(PAIR | more)).plot()
    labels = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert "upper.bottom: contact nodes of the pair upper.bottom:lower.top" in labels
    assert "lower.bottom: clamp" in labels
    figure.savefig(tmp_path / "scene.png")
    assert (tmp_path / "scene.png").stat().st_size > 5000


def test_a_load_on_many_nodes_is_drawn_by_twelve_arrows():
    acting = {"contact": "bottom", "clamp": "right", "load": {"top": (0.1, -0.3)}, "friction": 0.3}
    scene = fem.mesh_scene(fem.rectangle(60, 5).parted(), young=1, poisson=0.3, **acting)
    figure = scene.plot()
    (arrows,) = [part for part in figure.axes[0].collections if "loads" in str(part.get_label())]
    assert arrows.get_label() == "loads, summed over nodes side by side"
    assert len(arrows.U) == 12
    # by the scale of the longest, their sum is that of the loads
    total = np.array([arrows.U.sum(), arrows.V.sum()])
    np.testing.assert_allclose(total / np.linalg.norm(total), np.array([1, -3]) / np.sqrt(10), rtol=1e-6)


def test_options_that_do_not_exist():
    message = "there is no option 'contacts'; did you mean contact"
    refusal(EnumsolError, message, fem.mesh_scene, one(), **GOOD, contacts="bottom")


def test_the_name_of_pairs_in_files_is_suggested(tmp_path):
    (tmp_path / "pairs.toml").write_text("mesh = 'a.msh'\ncontact_pairs = [['upper', 'lower']]\n", encoding="utf-8")
    message = r"there is no option 'contact_pairs'; did you mean contact_pair\?"
    bad_problem(message, fem.read_mesh_problem, tmp_path / "pairs.toml")
