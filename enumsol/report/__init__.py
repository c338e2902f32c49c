"""Reports as HTML pages that need no network: all solutions, over an interval of alpha or at one, and histories."""

from __future__ import annotations

from typing import TYPE_CHECKING

from enumsol.branches import BranchGraph
from enumsol.errors import InvalidArgumentError
from enumsol.loading.history import History
from enumsol.report import graph_page, roots_page
from enumsol.report.parts import Heading
from enumsol.roots.root_set import RootSet
from enumsol.support.arguments import file_path, instance_of
from enumsol.support.files import write_file
from enumsol.support.plotting import checked_units

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Sequence

    from enumsol.fem import Scene

__all__ = ["write_report"]


def write_report(
    solutions: BranchGraph | RootSet | History,
    file: str | os.PathLike[str],
    *,
    title: str = "Contact problem with Coulomb friction",
    units: tuple[str, str] | None = None,
    commands: Sequence[str] = (),
    scene: Scene | None = None,
) -> None:
    """Write all solutions over an interval of alpha, at one alpha, or after every load step, as one HTML page.

    It needs no network.

    The page of a graph, in 2D or 3D, has the branches against alpha (pointing shows values and statuses, a click on a
    branch its arcs), the number of solutions, a slider over alpha with the deformed bodies of all solutions, tables of
    branches, transitions and folds, and what is certified. It says "complete" only where ``graph.complete`` does; of a
    graph that was cut short it says what is missing.

    Bodies can be enlarged in their displacements one by one or all at once, and coloured by displacement or stress.
    Load, supports, springs and contact forces are drawn, the latter with a scale. In the plane bodies can be zoomed;
    the foundation is drawn, and the statuses along the boundary in a strip. In 3D they can be turned; directions of
    slip are drawn. Without a mesh there are bars of the forces and displacements of the contact nodes, and in 3D these
    nodes at their coordinates. Pages follow the light or dark setting of the browser and print on A4.

    The page of a RootSet, in 2D or 3D, has a card for each root with the deformed body, contact forces, statuses,
    directions of slip and a table over the contact nodes; tables of roots, continua and undecided parts; and what is
    certified.

    The page of a History has a table of the steps, the tree of the roots, figures of load, displacement and work of
    friction, the deformed bodies of all roots of a step that is chosen (with a mesh), and what is certified.

    Parameters
    ----------
    solutions : BranchGraph, RootSet or History
    file : str or path-like
        An existing file is replaced.
    title : str
        What the problem is.
    units : (str, str), optional
        Of forces and of lengths; the figures of a History have none.
    commands : sequence of str
        Lines of a shell by which a reader can check the proof.
    scene : fem.Scene, optional
        What the problem was made of, from `fem.mesh_scene` or `fem.read_mesh_scene`: material, supports, springs, loads
        and gaps are then told as they were given, with their units.

    Raises
    ------
    InvalidArgumentError
        There can be no such file, or an argument is not of that form.
    MissingDependencyError
        plotly is not installed, whose script draws diagrams and bodies in 3D in the page; for a History matplotlib.
    OutputError
        There is no room for the file.

    Examples
    --------
    >>> import enumsol, pathlib, tempfile
    >>> graph = enumsol.branch_graph(enumsol.gallery.two_node_square(), (0, 10))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     enumsol.write_report(graph, f"{folder}/square.html", title="Square in a corner")
    ...     "complete: yes (proven)" in pathlib.Path(folder, "square.html").read_text()
    True
    """
    pages: dict[type, Callable[..., str]] = {
        BranchGraph: graph_page.graph_page,
        RootSet: roots_page.roots_page,
        History: roots_page.history_page,
    }
    page = next((page for kind, page in pages.items() if isinstance(solutions, kind)), None)
    if page is None:
        raise InvalidArgumentError(
            f"solutions is a {type(solutions).__name__}; expected a BranchGraph, a RootSet or a History"
        )
    place = file_path(file, "file")
    heading = Heading(instance_of(title, str, "title"), checked_units(units), tuple(commands), _checked_scene(scene))
    write_file(place, page(solutions, heading), "file")


def _checked_scene(scene: object) -> Scene | None:
    if scene is None:
        return None
    from enumsol.fem import Scene  # scikit-fem takes a while

    return instance_of(scene, Scene, "scene")
