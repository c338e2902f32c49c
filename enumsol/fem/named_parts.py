"""Meshes with named parts, in two and in three dimensions."""

from __future__ import annotations

import difflib
import re
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.model.cells import KINDS, by_kind
from enumsol.support.arguments import shown

if TYPE_CHECKING:
    from collections.abc import Mapping

    from enumsol.support.array_types import Floats, Integers

#: The name of all facets where nothing names groups of them.
ALL = "boundary"


@dataclass(frozen=True)
class PartedMesh:
    """A mesh with named parts: sets of facets, and sets of nodes. In 3D it is a `SolidMesh`.

    Attributes
    ----------
    points : (N, d) array
        Positions of the nodes [length].
    cells : (M, k) int array
        Nodes of each cell, in the order of VTK: its corners, then those on its edges, on its facets, and inside. In 2D
        3 or 6 nodes of triangles, 4, 8 or 9 of quadrilaterals; in 3D 4 or 10 of tetrahedra, 8 or 27 of hexahedra. Among
        quadrilaterals a triangle is one whose last corner is named twice (a, b, c, c), in second order with this corner
        for the node between the two and for that inside, too.
    facets : mapping of names to (k, m) int arrays
        Nodes of the facets of parts of the boundary: corners, then, in second order, the nodes between them, then that
        inside.
    node_sets : mapping of names to (k,) int arrays
        Nodes of parts that are given by nodes.
    bodies : mapping of names to (k,) int arrays
        Rows of the cells of named parts of the body: materials, or several bodies.
    """

    points: Floats
    cells: Integers
    facets: Mapping[str, Integers]
    node_sets: Mapping[str, Integers] = field(default_factory=lambda: MappingProxyType({}))
    bodies: Mapping[str, Integers] = field(default_factory=lambda: MappingProxyType({}))

    def body(self, name: str) -> Integers:
        """Rows of the cells of this name.

        Raises
        ------
        InvalidArgumentError
            There are none.
        """
        if name not in self.bodies:
            raise self._unknown(name, "cells", self.bodies)
        return self.bodies[name]

    def part(self, name: str) -> Integers:
        """Facets of this name.

        Raises
        ------
        InvalidArgumentError
            There are none.
        """
        if name not in self.facets:
            raise self._unknown(name, "facets", self.facets)
        return self.facets[name]

    def nodes(self, name: str) -> Integers:
        """Nodes of this name, or of the facets of this name, in order.

        Raises
        ------
        InvalidArgumentError
            There are none.
        """
        if name in self.node_sets:
            return np.unique(self.node_sets[name])
        if name not in self.facets:
            raise self._unknown(
                name, "facets or nodes" if self.node_sets else "facets", {**self.facets, **self.node_sets}
            )
        return np.unique(self.facets[name])

    def _unknown(self, name: str, what: str, known: Mapping[str, object]) -> InvalidArgumentError:
        close = difflib.get_close_matches(str(name), known, n=1)
        several = [part for part in re.split(r"[\s,;]+", str(name)) if part]
        hint = f" (did you mean {close[0]}?)" if close else ""
        if len(several) > 1 and all(part in known for part in several):
            hint = f" (give {' and '.join(several)} one by one)"
        elif [*known] == [ALL]:
            hint = " (the file names no parts of its boundary; in gmsh physical groups do)"
        elif what == "cells":
            hint = hint or " (in gmsh, physical groups of surfaces, in 3D of volumes, name parts of the body)"
        return InvalidArgumentError(
            f"the mesh has no {what} named {shown(name)}; expected one of {', '.join(known) or 'none'}{hint}"
        )

    def __repr__(self) -> str:
        parts = ", ".join(f"{name} ({len(part)})" for name, part in self.facets.items()) or "none"
        dimension = self.points.shape[1]
        kinds = [
            f"{len(rows)} {KINDS[dimension, cells.shape[1]].name}" for rows, cells in by_kind(dimension, self.cells)
        ]
        lines = [
            f"{type(self).__name__} with {len(self.points)} nodes",
            f"  cells   {', '.join(kinds)}",
            f"  facets  {parts}",
        ]
        if self.bodies:
            lines.insert(2, "  bodies  " + ", ".join(f"{name} ({len(rows)})" for name, rows in self.bodies.items()))
        if self.node_sets:
            lines.append("  nodes   " + ", ".join(f"{name} ({len(part)})" for name, part in self.node_sets.items()))
        return "\n".join(lines)


class SolidMesh(PartedMesh):
    """A mesh of tetrahedra or hexahedra with named sets of facets.

    Attributes
    ----------
    points : (N, 3) array
        Positions of the nodes [length].
    cells : (M, k) int array
        Nodes of each tetrahedron (k = 4 or 10) or hexahedron (k = 8 or 27), in the order of VTK.
    facets : mapping of names to (k, m) int arrays
        Nodes of the triangles (m = 3 or 6) or quadrilaterals (m = 4 or 9) of parts of the boundary.
    node_sets, bodies : mappings of names to (k,) int arrays
        As in `PartedMesh`.
    """
