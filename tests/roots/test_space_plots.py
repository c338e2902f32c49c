"""Pictures of solutions in 3D: marks by status, and arrows along the slips."""

import numpy as np
from problems3d import from_compliance
from refusals import bad_argument

import enumsol
from enumsol.support.plotting import new_figure


def test_arrows_point_along_the_slips():
    problem = enumsol.gallery.get("block3d-9").build()
    root = enumsol.enumerate_roots(problem, 0.5)[0]
    body, ax = root.plot().axes
    assert body.name == "3d"
    (alone,) = root.plot(new_figure().subplots()).axes
    assert alone.name != "3d"
    slides = [str(status) == "slip" for status in root.statuses]
    (arrows,) = [part for part in ax.collections if hasattr(part, "U")]
    # the axes of the gallery's block are x and -y
    expected = root.u_t[slides] * [1.0, -1.0]
    expected /= np.linalg.norm(expected, axis=1)[:, None]
    np.testing.assert_allclose(np.stack([arrows.U, arrows.V], axis=1), expected, atol=1e-12)
    np.testing.assert_allclose(arrows.XY, problem.coordinates[slides][:, :2])
    assert sum(len(line.get_xdata()) for line in ax.lines) == problem.p
    assert {text.get_text() for text in ax.get_legend().get_texts()} == {"open (1)", "stick (4)", "slip (4)"}


def test_without_a_mesh_the_local_axes_are_drawn():
    root = enumsol.enumerate_roots(enumsol.gallery.one_node_3d(), 0)[0]
    (arrows,) = [part for part in root.plot().axes[0].collections if hasattr(part, "U")]
    np.testing.assert_allclose([arrows.U[0], arrows.V[0]], root.u_t[0] / np.linalg.norm(root.u_t))


def test_without_coordinates_there_is_no_picture():
    root = enumsol.enumerate_roots(from_compliance(np.eye(3), np.ones(3), 0.3), 0)[0]
    bad_argument("the problem has no coordinates", root.plot)


def test_what_is_known_in_2d_only_is_refused():
    root = enumsol.enumerate_roots(enumsol.gallery.one_node_3d(), 0)[0]
    assert isinstance(root, enumsol.Root)
    for name in ("condition", "dlambda_dalpha", "signs"):
        bad_argument(f"{name} is asked of a root in 3D; expected one in 2D", getattr, root, name)
    bad_argument("local_branch_test is asked of a root in 3D", root.local_branch_test)


def test_a_root_in_2d_is_plotted_as_its_body():
    root = enumsol.enumerate_roots(enumsol.gallery.two_node_square(), 3.5)[0]
    assert root.slip_angle is None
    assert [ax.get_title() for ax in root.plot().axes] == [ax.get_title() for ax in root.plot_body().axes]
