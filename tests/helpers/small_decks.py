"""Decks of two blocks, one on the other, with cards put in; and the same mesh by hand, with its parts."""

import numpy as np

from enumsol import fem

#: Two elements on two others; the lower block is wider by nothing, and nothing is joined.
MESH = """*HEADING
Two blocks
*NODE, NSET=ALL
1, 0., 0.
2, 1., 0.
3, 2., 0.
4, 0., 1.
5, 1., 1.
6, 2., 1.
11, 0., 1.
12, 1., 1.
13, 2., 1.
14, 0., 3.
15, 1., 3.
16, 2., 3.
*ELEMENT, TYPE={type}, ELSET=LOWER
1, 1, 2, 5, 4
2, 2, 3, 6, 5
*ELEMENT, TYPE={type}, ELSET=UPPER
11, 11, 12, 15, 14
12, 12, 13, 16, 15
*NSET, NSET=BOTTOM
1, 2, 3
*NSET, NSET=TOP
14, 15, 16
*NSET, NSET=SIDE
11, 14
*SURFACE, NAME=UNDER
11, S1
12, S1
*SURFACE, NAME=ON
1, S3
2, S3
*SURFACE, NAME=ABOVE
11, S3
12, S3
*SURFACE, NAME=RIGHT
12, S2
"""
MATERIALS = """*MATERIAL, NAME=SOFT
*ELASTIC
100., 0.3
*DENSITY
2.
*MATERIAL, NAME=HARD
*ELASTIC
300., 0.2
*DENSITY
3.
*SOLID SECTION, ELSET=UPPER, MATERIAL=SOFT
*SOLID SECTION, ELSET=LOWER, MATERIAL=HARD
"""
CONTACT = """*SURFACE INTERACTION, NAME=DRY
*FRICTION
0.3
*CONTACT PAIR, INTERACTION=DRY
UNDER, ON
"""
HELD = """*BOUNDARY
BOTTOM, 1, 2
SIDE, 1
TOP, 2, 2
"""


def step(cards, options=""):
    """A step with these cards."""
    return f"*STEP{options}\n*STATIC\n{cards}*END STEP\n"


PRESSED = step("*BOUNDARY\nTOP, 2, 2, -0.01\n*DLOAD\n12, P2, 2.\n")


def deck(*, mesh=MESH, materials=MATERIALS, contact=CONTACT, held=HELD, steps=PRESSED, type="CPE4"):
    """A deck of these parts."""
    return mesh.format(type=type) + materials + contact + held + steps


def mesh(facets=(), nodes=(), bodies=(), third=False):
    """The same mesh by hand, with more parts by rows of nodes or of cells; and a third block beside the upper one."""
    points = [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1], [0, 1], [1, 1], [2, 1], [0, 3], [1, 3], [2, 3]]
    cells = [[0, 1, 4, 3], [1, 2, 5, 4], [6, 7, 10, 9], [7, 8, 11, 10]]
    named = {
        "UNDER": [[6, 7], [7, 8]],
        "ON": [[5, 4], [4, 3]],
        "ABOVE": [[11, 10], [10, 9]],
        "RIGHT": [[8, 11]],
        **dict(facets),
    }
    sets = {"BOTTOM": [0, 1, 2], "TOP": [9, 10, 11], "SIDE": [6, 9], **dict(nodes)}
    parts = {"LOWER": [0, 1], "UPPER": [2, 3], **dict(bodies)}
    if third:
        points += [[2, 1], [3, 1], [2, 3], [3, 3]]
        cells += [[12, 13, 15, 14]]
        named["LEFT"], parts["THIRD"] = [[14, 12]], [4]
    return fem.PartedMesh(
        np.array(points, dtype=float),
        np.array(cells),
        *({name: np.array(rows) for name, rows in each.items()} for each in (named, sets, parts)),
    )


#: What the deck says without further cards.
OPTIONS = {
    "young": {"UPPER": 100.0, "LOWER": 300.0},
    "poisson": {"UPPER": 0.3, "LOWER": 0.2},
    "density": {"UPPER": 2.0, "LOWER": 3.0},
    "pairs": [("UNDER", "ON")],
    "friction": 0.3,
    "clamp": "BOTTOM",
    "displacement": {"SIDE": (0.0, None), "TOP": (None, -0.01)},
    "pressure": {"RIGHT": 2.0},
}


def by_hand(parts=None, **options):
    """The problem that options of `mesh_problem` describe, in place of those of the plain deck."""
    given = {name: value for name, value in {**OPTIONS, **options}.items() if value is not None}
    return fem.mesh_problem(mesh(**(parts or {})), **given)


def assert_same(one, two):
    """Two problems are the same but for rounding."""
    assert (one.n, one.p) == (two.n, two.p)
    for name in ("A", "Bn", "Bt"):
        difference = abs(getattr(one, name) - getattr(two, name))
        assert difference.max() <= 1e-12 * abs(getattr(two, name)).max(), name
    for name in ("f", "gap", "slip_offset", "friction", "friction_slope"):
        np.testing.assert_allclose(getattr(one, name), getattr(two, name), atol=1e-12, err_msg=name)
