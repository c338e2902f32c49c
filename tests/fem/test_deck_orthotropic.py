"""Decks with orthotropic materials against the closed form of a block that is pressed along no axis of its material."""

import numpy as np
import pytest
from refusals import bad_problem
from small_decks import MATERIALS, deck, step

import enumsol

#: A block of wood, 2 by 2, without friction on a lower one of height 1 and modulus 300, which nothing bends.
E1, E2, E3, N12, N13, N23, G12, G13, G23 = WOOD = (100.0, 400.0, 50.0, 0.3, 0.25, 0.2, 60.0, 40.0, 30.0)
ENGINEERING = "*ELASTIC, TYPE=ENGINEERING CONSTANTS\n100., 400., 50., 0.3, 0.25, 0.2, 60., 40.,\n30.\n"
HELD = "*BOUNDARY\nBOTTOM, 2, 2\n1, 1\n11, 1\n"
CONTACT = "*SURFACE INTERACTION, NAME=DRY\n*CONTACT PAIR, INTERACTION=DRY\nUNDER, ON\n"
NAMED = ", ORIENTATION=GRAIN"
PRESSURE = 2.0


def text_of(elastic=ENGINEERING, orientation="", named=NAMED):
    materials = MATERIALS.replace("*ELASTIC\n100., 0.3\n", elastic)
    materials = materials.replace("MATERIAL=SOFT\n*SOLID", f"MATERIAL=SOFT{named if orientation else ''}\n*SOLID")
    pressed = step(f"*DSLOAD\nABOVE, P, {PRESSURE}\n")
    return deck(type="CPS4", materials=orientation + materials, contact=CONTACT, held=HELD, steps=pressed)


def moved(tmp_path, text):
    (tmp_path / "model.inp").write_text(text)
    problem = enumsol.read_deck(tmp_path / "model.inp").problem()
    (root,) = enumsol.enumerate_roots(problem, 0)
    return problem.mesh.displacements(root.u)


def ortho():
    """The same law by its moduli, after the handbook."""
    n21, n31, n32 = N12 * E2 / E1, N13 * E3 / E1, N23 * E3 / E2
    g = 1 / (1 - N12 * n21 - N23 * n32 - N13 * n31 - 2 * n21 * n32 * N13)
    values = [
        E1 * (1 - N23 * n32) * g, E1 * (n21 + n31 * N23) * g, E2 * (1 - N13 * n31) * g,
        E1 * (n31 + n21 * n32) * g, E2 * (n32 + N12 * n31) * g, E3 * (1 - N12 * n21) * g, G12, G13,
    ]  # fmt: skip
    return "*ELASTIC, TYPE=ORTHO\n" + ", ".join(f"{value:.17g}" for value in values) + f"\n{G23}\n"


@pytest.mark.parametrize("elastic", [ENGINEERING, ortho()], ids=["engineering constants", "moduli"])
@pytest.mark.parametrize(
    ("orientation", "degrees"),
    [
        ("", 0),
        ("*ORIENTATION, NAME=GRAIN\n1., 0., 0., 0., 1., 0.\n3, 30.\n", 30),
        ("*ORIENTATION, NAME=GRAIN\n5., 2., 0., 1., 7., 0., 2., 2., 0.\n3, -40.\n", -40),
        ("*ORIENTATION, NAME=GRAIN, SYSTEM=RECTANGULAR\n0., 3., 0., -1., 1., 0.\n", 90),
        ("*ORIENTATION, NAME=GRAIN\n1., 1., 0., 0., 0., -3.\n1, 90.\n", 45),
    ],
)
def test_a_pressed_block(tmp_path, elastic, orientation, degrees):
    """Compliances in axes turned by an angle as in Jones, Mechanics of composite materials."""
    u = moved(tmp_path, text_of(elastic, orientation))
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    down = s**4 / E1 + c**4 / E2 + (1 / G12 - 2 * N12 / E1) * s**2 * c**2
    wide = s**2 * c**2 * (1 / E1 + 1 / E2 - 1 / G12) - N12 / E1 * (s**4 + c**4)
    shear = 2 * s**3 * c * (1 / E1 + N12 / E1) - 2 * s * c**3 * (1 / E2 + N12 / E1)
    shear -= (s**3 * c - s * c**3) / G12
    left, right = u[9], u[11]  # of the top
    np.testing.assert_allclose(u[9:, 1], -PRESSURE * (1 / 300 + 2 * down), rtol=1e-10)
    np.testing.assert_allclose(right[0] - left[0], -PRESSURE * 2 * wide, rtol=1e-10)
    np.testing.assert_allclose(left[0] - u[6, 0], -PRESSURE * 2 * shear, rtol=1e-10, atol=1e-14)


def test_all_cells_may_be_orthotropic(tmp_path):
    """The lower block by the isotropic law as an orthotropic one moves as the isotropic one."""
    plain = "*ELASTIC\n300., 0.2\n"
    same = "*ELASTIC, TYPE=ENGINEERING CONSTANTS\n300., 300., 300., 0.2, 0.2, 0.2, 125., 125.,\n125.\n"
    text = text_of()
    assert plain in text
    np.testing.assert_allclose(moved(tmp_path, text.replace(plain, same)), moved(tmp_path, text), rtol=0, atol=1e-13)


def test_an_orientation_of_an_isotropic_material_changes_nothing(tmp_path):
    plain = text_of("*ELASTIC\n100., 0.3\n")
    turned = text_of("*ELASTIC\n100., 0.3\n", "*ORIENTATION, NAME=GRAIN\n1., 1., 0., 0., 1., 0.\n")
    np.testing.assert_array_equal(moved(tmp_path, plain), moved(tmp_path, turned))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            text_of(orientation="*ORIENTATION, NAME=OTHER\n1., 0., 0., 0., 1., 0.\n"),
            r"line \d+: \*SOLID SECTION names the orientation GRAIN; expected one of OTHER",
        ),
        (
            text_of(orientation="*ORIENTATION, NAME=GRAIN, SYSTEM=CYLINDRICAL\n0., 0., 0., 0., 0., 1.\n"),
            r"line \d+: \*ORIENTATION is cylindrical, with axes that turn within an element",
        ),
        (text_of("*ELASTIC, TYPE=ORTHO\n1., 2., 1., 0., 0., 1., 1., 1.,\n1.\n"), r"line \d+: \*ELASTIC of SOFT"),
        (text_of(""), r"line \d+: \*MATERIAL SOFT has no \*ELASTIC; expected an elastic law"),
        (
            text_of(orientation="*ORIENTATION, NAME=GRAIN\n1., 0., 1., 0., 1., 0.\n"),
            "with which strains in the plane cause shear out of it",
        ),
    ],
)  # fmt: skip
def test_wrong_materials(tmp_path, text, message):
    bad_problem(message, moved, tmp_path, text)
