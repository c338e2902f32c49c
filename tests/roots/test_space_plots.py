"""Pictures of solutions in 3D: marks by status, and arrows along the slips."""

import numpy as np
import pytest
from problems3d import from_compliance

import enumsol


def test_arrows_point_along_the_slips():
    problem = enumsol.gallery.get("block3d-9").build()
    root = enumsol.enumerate_roots(problem, 0.5)[0]
    ax = root.plot()
    assert ax._repr_png_().startswith(b"\x89PNG")
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
    (arrows,) = [part for part in root.plot().collections if hasattr(part, "U")]
    np.testing.assert_allclose([arrows.U[0], arrows.V[0]], root.u_t[0] / np.linalg.norm(root.u_t))


def test_without_coordinates_there_is_no_picture():
    root = enumsol.enumerate_roots(from_compliance(np.eye(3), np.ones(3), 0.3), 0)[0]
    with pytest.raises(enumsol.InvalidArgumentError, match="the problem has no coordinates"):
        root.plot()
