"""A picture of a scene: bodies, named parts of their boundaries, loads, contact nodes with their normals."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.model.cells import KINDS, boundary_facets, by_kind, facet_outlines
from enumsol.support.plotting import new_figure

if TYPE_CHECKING:
    from enumsol.support.array_types import Floats

#: Length of the longest force, and of a normal, as a part of the extent.
_FORCE, _NORMAL = 0.16, 0.06
_BODY, _EDGE, _LOAD, _SLOPE, _CONTACT = "#dfe6ee", "#aab6c3", "#b3202c", "#d9730d", "#1f5fa8"


def draw_scene(scene: Any) -> Any:
    """A figure of a `Scene`."""
    from matplotlib.collections import LineCollection, PolyCollection  # with the first figure
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    mesh, d = scene.mesh, scene.dimension
    figure = new_figure(figsize=(8.0, 5.6))
    ax = figure.add_subplot(**({"projection": "3d"} if d == 3 else {}))
    if d == 2:
        for _, cells in by_kind(2, mesh.cells):
            outlines = mesh.points[cells[:, KINDS[2, cells.shape[1]].outline]]
            ax.add_collection(PolyCollection(list(outlines), facecolor=_BODY, edgecolor=_EDGE, linewidth=0.5))
    else:
        faces = mesh.points[facet_outlines(boundary_facets(3, mesh.cells))]
        ax.add_collection3d(Poly3DCollection(list(faces), facecolor=_BODY, edgecolor=_EDGE, linewidth=0.3, alpha=0.25))
    for k, (name, facets) in enumerate(mesh.facets.items()):
        label = f"{name}: {', '.join(scene.uses(name)) or 'not used'}"
        if d == 2:
            along = facets if facets.shape[1] == 2 else facets[:, [0, 2, 1]]
            ax.add_collection(LineCollection(list(mesh.points[along]), color=f"C{k}", linewidth=3, label=label))
        else:
            outlines = list(mesh.points[facet_outlines(facets)])
            ax.add_collection3d(Poly3DCollection(outlines, facecolor=f"C{k}", alpha=0.35, label=label))
    places = mesh.points[scene.contacts.rows.nodes]
    extent = float(np.max(np.ptp(mesh.points, axis=0)))
    ax.plot(*places.T, "o", color=_CONTACT, markersize=4, label="contact nodes and their normals", zorder=5)
    _arrows(ax, places, _NORMAL * extent * scene.contacts.rows.normals, _CONTACT)
    for forces, colour, label in ((scene.forces, _LOAD, "loads"), (scene.slope, _SLOPE, "loads times alpha")):
        loaded = np.flatnonzero(np.any(forces != 0, axis=1))
        if len(loaded):
            long = _FORCE * extent / np.max(np.linalg.norm(forces, axis=1)) * forces[loaded]
            _arrows(ax, mesh.points[loaded] - long, long, colour, label)
    if d == 2:
        ax.autoscale_view()
        ax.set_aspect("equal", adjustable="datalim")
        ax.margins(0.1)
    else:
        ax.auto_scale_xyz(*mesh.points.T)
        ax.set_aspect("equal")
    figure.legend(loc="outside right upper", fontsize=7)
    return figure


def _arrows(ax: Any, places: Floats, vectors: Floats, colour: str, label: str | None = None) -> None:
    if places.shape[1] == 2:
        options = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "width": 0.004, "zorder": 4}
        ax.quiver(*places.T, *vectors.T, color=colour, label=label, **options)
        ax.update_datalim(np.concatenate([places, places + vectors]))
    else:
        ax.quiver(*places.T, *vectors.T, color=colour, label=label, arrow_length_ratio=0.25)
