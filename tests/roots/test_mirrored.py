"""Roots of symmetric problems as mirror images of one another, and what is said of problems that are not symmetric."""

import json

import numpy as np
import pandas as pd
import pytest
from refusals import bad_argument

import enumsol
from enumsol import Mirror, fem, gallery
from enumsol.cli import main
from enumsol.roots.enumeration import not_begun
from enumsol.roots.mirrored import paired_roots, problem_asymmetry
from enumsol.search.outcome import StopReason


@pytest.fixture(scope="module")
def wedge():
    """A wedge that is pulled straight out, and either end of which may come out first."""
    problem = gallery.wedge3d(2, 2, 2)
    return problem, enumsol.enumerate_roots(problem, 1)


#: Two columns that do not feel each other, pushed to the same side: node 0 with normal and tangent, then node 1.
COLUMNS = enumsol.ContactProblem(np.eye(4) * 2.0, np.eye(4)[[0, 2]], np.eye(4)[[1, 3]], [1, 2, 1, 2], friction=0.5)


def images_by_hand(problem, roots, axis):
    """Partners by reflecting displacements of the whole mesh: nothing of the code that is tested."""
    points = problem.mesh.points
    reflected = points.copy()
    middle = 0.5 * (points[:, axis].min() + points[:, axis].max())
    reflected[:, axis] = 2 * middle - points[:, axis]
    there = np.array([np.argmin(np.linalg.norm(points - place, axis=1)) for place in reflected])
    assert np.allclose(points[there], reflected)
    moves = [problem.mesh.displacements(root.u) for root in roots]
    found = []
    for own in moves:
        image = np.empty_like(own)
        image[there] = own * np.where(np.arange(own.shape[1]) == axis, -1, 1)
        away = [np.max(np.abs(image - other)) / np.max(np.abs(own)) for other in moves]
        found.append(int(np.argmin(away)))
        assert min(away) < 1e-7
    return tuple(found)


@pytest.mark.parametrize(("axis", "partners"), [("x", (0, 1, 2, 3, 4)), ("y", (0, 2, 1, 3, 4))])
def test_a_wedge_in_space(wedge, axis, partners):
    problem, roots = wedge
    mirrored = roots.mirrored(axis)
    images = mirrored.mirror_images
    assert images.images == partners == images_by_hand(problem, roots, "xyz".index(axis))
    assert (images.missing, images.ambiguous) == ((), ())
    assert images.asymmetry.proven
    assert 0 < images.asymmetry.bound < 1e-11
    assert images.difference < 1e-9
    # nothing else of the result is different
    assert [root is other for root, other in zip(mirrored, roots, strict=True)] == [True] * 5
    assert (mirrored.complete, mirrored.index_sum, mirrored.proof) == (True, 1, roots.proof)
    assert roots.mirror_images is None
    assert "mirror" not in repr(roots)
    text = repr(mirrored)
    assert text.count("mirror image of root 2") == (axis == "y")
    assert f"mirror: {'1 pair, 3' if axis == 'y' else '0 pairs, 5'} symmetric roots; the data are" in text
    assert text.endswith("complete: yes (proven)")


@pytest.mark.slow
def test_nodal_multipliers():
    problem = gallery.wedge3d(2, 1, 2, multipliers="nodes", pull=(0, 0, 1e-3))
    roots = enumsol.enumerate_roots(problem, 2)
    for axis, partners in (("x", (0, 1, 2, 3, 4)), ("y", (0, 2, 1, 3, 4))):
        assert roots.mirrored(axis).mirror_images.images == partners
        assert images_by_hand(problem, roots, "xyz".index(axis)) == partners


def test_in_2d_slip_turns_to_the_other_side():
    """Two columns that are pushed apart: what slips to the right on one side slips to the left on the other."""
    roots = enumsol.enumerate_roots(COLUMNS.replace(f=[1, 2, 1, -2]), 0)
    assert [status.value for status in roots[0].statuses] == ["slip+", "slip-"]
    assert roots.mirrored(Mirror([1, 0], [-1, -1])).mirror_images.images == (0,)
    bad_argument("at contact node 0 the free displacement changes by", roots.mirrored, Mirror([1, 0], [1, 1]))


def test_pairs_in_2d():
    """Separate nodes of three roots each: a result of nine, by what each node does."""
    problem = gallery.chain(2)
    roots = enumsol.enumerate_roots(problem, 5)
    assert len(roots) == 9
    mirrored = roots.mirrored(Mirror([1, 0], [1, 1]))
    does = [root.statuses for root in roots]
    assert mirrored.mirror_images.images == tuple(does.index((right, left)) for left, right in does)
    assert "mirror: 3 pairs, 3 symmetric roots; the data are" in repr(mirrored)
    fast = enumsol.enumerate_roots(problem, 5, arithmetic="fast").mirrored(Mirror([1, 0], [1, 1]))
    assert fast.mirror_images.images == mirrored.mirror_images.images
    frame = mirrored.to_frame()
    assert list(frame["mirror_image"][::2]) == list(mirrored.mirror_images.images)
    assert "mirror_image" not in roots.to_frame()


def test_a_mesh_in_2d():
    # a press fit, symmetric about x = 0, whose two sides hold or slip
    mesh = fem.trapezoid(2, 3, bottom=1.0, top=1.7, height=1.0).parted()
    where = {"contact": ["left", "right"], "spring": {"top": (0.02, 0.02)}, "load": {"top": (0.0, 1e-3)}}
    problem = fem.mesh_problem(mesh, young=2.5, poisson=0.25, gap=-5e-4, friction=0.0, friction_slope=1.0, **where)
    roots = enumsol.enumerate_roots(problem, 2)
    images = roots.mirrored("x").mirror_images
    assert (images.images, images.missing) == (images_by_hand(problem, roots, 0), ())
    bad_argument(r"contact node .* has no mirror image: the contact node nearest", roots.mirrored, "y")
    bad_argument("normal is 'z'; expected", roots.mirrored, "z")


def test_data_that_are_not_symmetric_are_refused(wedge):
    _, roots = wedge
    oblique = enumsol.enumerate_roots(gallery.wedge3d(2, 2, 2, pull=(0, 5e-5, 5e-4)), 3, stop_after=1)
    assert oblique.mirrored("x").mirror_images.images == (0,)
    bad_argument(r"not its own mirror image: at contact node .* free displacement", oblique.mirrored, "y")
    assert roots.mirrored("y").mirror_images is not None
    bad_argument("expected at most 1e-18", roots.mirrored, "y", tolerance=1e-18)


@pytest.mark.parametrize(
    ("changed", "what"),
    [
        ({"A": np.diag([2.0, 2.0, 2.0, 3.0])}, "the compliance changes by 0.33"),
        ({"friction": np.array([0.5, 0.6]), "friction_slope": 0.0}, "the friction changes by 0.17"),
        ({"gap": [0.0, 0.1]}, "the free displacement changes by"),
    ],
)
def test_every_part_of_the_data_is_compared(changed, what):
    mirror = Mirror([1, 0], [1, 1])
    for arithmetic in ("verified", "fast"):
        found = enumsol.enumerate_roots(COLUMNS, 0, arithmetic)
        assert found.mirrored(mirror).mirror_images.images == (0,)
        bad_argument(what, enumsol.enumerate_roots(COLUMNS.replace(**changed), 0, arithmetic).mirrored, mirror)


def test_nearly_symmetric_data_are_said_to_be_just_that():
    exact, near = (COLUMNS.replace(A=np.diag([2, 2, 2, last])) for last in (2.0, 2.0 + 1e-11))
    mirror = Mirror([1, 0], [1, 1])
    symmetric, off = (problem_asymmetry(problem, 0.0, mirror, 1e-9) for problem in (exact, near))
    assert (bool(symmetric.differs), bool(off.differs)) == (False, True)
    assert symmetric.bound < 1e-14
    assert off.bound == pytest.approx(5e-12, rel=0.01)
    text = repr(enumsol.enumerate_roots(near, 0).mirrored(mirror))
    assert "the data are not exactly symmetric, but within 5.0e-12" in text


def test_weak_springs():
    """Rounding of the stiffness is large beside the springs: what is said of the data shows it."""
    problem = gallery.wedge3d(2, 1, 2, springs=(1e-7, 1e-7, 1e-7), pull=(0, 0, 1e-9), friction=0.3)
    asymmetry = problem_asymmetry(problem, 0, Mirror.across(problem, "x"), 1e-6)
    assert 1e-12 < asymmetry.bound < 1e-6
    message = r"at contact node .* (changes|may change) by"
    bad_argument(message, problem_asymmetry, problem, 0, Mirror.across(problem, "x"), 1e-13)


def test_a_missing_partner_is_said(wedge):
    problem, roots = wedge
    mirror = Mirror.across(problem, "y")
    asymmetry = problem_asymmetry(problem, 1, mirror, 1e-9)
    images = paired_roots([roots[k] for k in (0, 1, 3, 4)], mirror, asymmetry)
    assert (images.images, images.missing, images.words(1)) == ((0, None, 2, 3), (1,), "no mirror image")
    assert "a complete result of exactly symmetric data cannot have this" in images.notes(complete=True)[1]
    assert "these are still to be found" in images.notes(complete=False)[1]
    twice = paired_roots([roots[0], roots[0]], mirror, asymmetry)
    assert (twice.images, twice.ambiguous, twice.missing) == ((None, None), (0, 1), ())
    none = not_begun(problem, 1.0, "verified", "tree", 0.0, StopReason.TIME_LIMIT)
    bad_argument("no isolated roots to compare", none.mirrored, "y")


@pytest.mark.parametrize(
    ("nodes", "signs", "message"),
    [
        ([0, 0], [1, 1], "nodes is not a permutation; expected every number from 0 to 1 once"),
        ([1, 2, 0], [1, 1, 1], "nodes takes 0 to 1 and 1 to 2; expected it to take 1 back"),
        ([1, 0], [1, 1, 1], r"signs has shape \(3,\); expected \(p,\) = \(2,\)"),
        ([1, 0], [1, 0.5], r"signs holds other numbers than \+1 and -1"),
        ([1, 0], [1, -1], "signs of node 0 and of its image 1 differ"),
        ([2, 1, 0], [1, 1, 1], "mirror is one of 3 contact nodes in 2D; expected one of 2 in 2D"),
        ([1, 0], [[1, 1], [1, 1]], "mirror is one of 2 contact nodes in 3D; expected one of 2 in 2D"),
        ([0, 1], [1, -1], "the compliance changes by"),
    ],
)
def test_wrong_mirrors_are_refused(nodes, signs, message):
    roots = enumsol.enumerate_roots(gallery.chain(2), 5)
    bad_argument(message, lambda: roots.mirrored(Mirror(nodes, signs)))


def test_what_a_plane_needs():
    bare = enumsol.ContactProblem(np.eye(2), [[1, 0]], [[0, 1]], [1, 1])
    bad_argument(r"no mesh, which tells normals and tangents; .* Mirror\(nodes", Mirror.across, bare, "x")
    problem = gallery.get("wedge-8-3").build()
    bad_argument("normal is zero", Mirror.across, problem, (0, 0))
    assert Mirror.across(problem, (-2, 0), point=(0, 5)).nodes.tolist() == [4, 5, 6, 7, 0, 1, 2, 3]
    bad_argument("has no mirror image", Mirror.across, problem, "x", point=(0.1, 0))
    # the normals of the sides differ, as do those of a body whose other side is steeper
    where = {"contact": ["left", "bottom"], "clamp": "right"}
    skew = fem.mesh_problem(fem.rectangle(2, 2).parted(), young=1, poisson=0.2, friction=0.5, **where)
    bad_argument(r"contact node .* has no mirror image|are not taken to those of one", Mirror.across, skew, (1, -1))


def test_the_command(tmp_path, capsys):
    file, table = tmp_path / "roots.json", tmp_path / "roots.csv"
    command = ["roots", "gallery:wedge3d-4-3", "--alpha", "1", "--mirror", "y"]
    assert main([*command, "--json", str(file), "--csv", str(table)]) == 0
    out = capsys.readouterr().out
    assert out.count("its own mirror image") == 3
    assert out.endswith("complete: yes (proven)\n")
    content = json.loads(file.read_text())
    assert [root["mirror_image"] for root in content["roots"]] == [0, 1, 2]
    assert content["mirror"]["missing"] == []
    assert content["mirror"]["asymmetry"] < 1e-9
    assert list(pd.read_csv(table)["mirror_image"]) == np.repeat([0, 1, 2], 4).tolist()
    assert main(["roots", "gallery:wedge3d-4-9", "--alpha", "3", "--mirror", "y"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert "the problem is not its own mirror image" in err
    assert err.count("\n") == 1
