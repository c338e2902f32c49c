"""Roots whose displacements are not small are noted: in Python, in print, in reports."""

import numpy as np
import pytest
from parted_meshes import grid

import enumsol
from enumsol import fem, gallery, write_report


def on_springs(**more):
    """A block on a floor, held by weak springs; the same with other loads moves by any length."""
    given = {"young": 1e4, "poisson": 0.0, "contact": "bottom", "friction": 0.0, "spring": {"top": (1.0, 1.0)}}
    return fem.mesh_problem(grid(4, 2, 4), **given | more)


def test_a_root_that_moves_farther_than_the_contact_is_wide(tmp_path):
    """Pushed by 2 against springs of 1: it is off by 2, while it is 1 wide."""
    roots = enumsol.enumerate_roots(on_springs(load={"top": (2.0, -0.1)}), alpha=0)
    (note,) = roots.notes
    assert note == (
        "1 root moves contact nodes farther than the contact is wide, root 0 by 2, which is 2 times its width: "
        "displacements are taken to be small"
    )
    assert f"note: {note}" in repr(roots)
    write_report(roots, tmp_path / "roots.html")
    assert f"Note: {note}." in (tmp_path / "roots.html").read_text(encoding="utf-8")
    assert enumsol.enumerate_roots(on_springs(load={"top": (0.9, -0.1)}), alpha=0).notes == ()


@pytest.mark.parametrize(("moment", "noted"), [(0.05, True), (0.005, False)])
def test_a_root_that_turns(moment, noted):
    """Lifted and turned against springs along y on the whole top: by 12 times the moment."""
    half = fem.mesh_problem(
        grid(4, 2, 4), young=1e4, poisson=0.0, contact="bottom", spring={"top": (1.0, 1.0)}, friction=0.0, gap=5.0,
        displacement={"left": ("free", "free")}, load={"left": (0.0, -moment), "right": (0.0, moment)},
    )  # fmt: skip
    roots = enumsol.enumerate_roots(half, alpha=0)
    turned = -np.degrees(np.polyfit(half.coordinates[:, 0], roots[0].u_n, 1)[0])
    assert (turned > 10) == noted
    assert len(roots.notes) == noted
    if noted:
        assert f"root 0 by {turned:.3g}: rotations" in roots.notes[0]


def test_solids_turn_about_any_axis():
    solid = fem.box(2, 2, 1)
    given = {"young": 1e4, "poisson": 0.0, "contact": "bottom", "spring": {"top": (1.0, 1.0)}, "friction": 0.0}
    load = {"left": (0.0, -0.2, 0.0), "right": (0.0, 0.2, 0.0)}
    (note,) = enumsol.enumerate_roots(fem.mesh_problem(solid, **given, gap=1.0, load=load), alpha=0).notes
    assert note.startswith("1 root turns the contact by more than 10 degrees, root 0 by ")


def test_problems_without_lengths_have_none():
    """Those of the paper are matrices, whatever their triangles look like."""
    roots = enumsol.enumerate_roots(gallery.get("two-node-6.4").build(), alpha=gallery.get("two-node-6.4").alpha)
    assert max(abs(root.u_t).max() for root in roots) > 1
    assert roots.notes == ()
