"""Do the displacements of CalculiX, with its penalties, and of enumsol converge to each other on the same decks?

Twelve decks, one for each type of element: a block that is pressed on a slab and pushed along it, in the plane and in
3D, and a ring with a press fit on a shaft and on a cone, axisymmetric. Both programs read the same file, on meshes that
are refined twice. CalculiX takes contact from surface to surface with a penalty, and enumsol from node to surface,
exactly; friction is Coulomb's in both, with a stiffness of stick in CalculiX.

Read ``displacements``: the largest difference of the displacement of a node, in parts of the largest displacement; and
``forces``: the difference of the total contact force on the slab or the shaft (axisymmetric: along the axis), in parts
of its size. They should fall with the size of the cells, down to what the penalty leaves. ``displacements_same`` and
``forces_same`` are these with the stiffness that CalculiX assembles (``assemble="ccx"``), so that contact alone
differs: the thickness of its elements of plane stress is a displacement of their nodes, and its
wedges have two points of integration. Tetrahedra of 10 nodes are the same elements; on their facets forces are at the
nodes between corners here, and CalculiX spreads its penalty over the facets, which on facets as coarse as these is the
difference. So it is, with CalculiX's stiffness, for hexahedra of 20 nodes, which the package completes to 27 nodes
otherwise, all of them in contact. ``roots`` is the number of equilibria, all proven; ``audit`` whether the result of
CalculiX was told to be one of them. Needs CalculiX (``ccx``); without it its columns are empty.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import enumsol
from against_calculix.decks import CASES, SOLID
from enumsol.model.shapes import row_frames

if TYPE_CHECKING:
    from shared.results import Run

ABSENT = "CalculiX is not installed: its results are left out"
#: Columns of what is compared with CalculiX.
COMPARED = ("displacements", "forces", "audit", "displacements_same", "forces_same")
#: Cells along the block.
PLANE_SIZES, SOLID_SIZES = (2, 4, 8), (2, 4, 6)


def solved(file, assemble=None):
    """The model of a deck, its problem and all roots of it."""
    model = enumsol.read_deck(file, assemble=assemble)
    problem = model.problem()
    return model, problem, enumsol.enumerate_roots(problem, 0)


def differences(result, model, problem, roots, base):
    """Shares by which displacements and total contact force of the nearest root differ, and if the audit found it."""
    audit = enumsol.compare_result(problem, roots, result.on(problem.mesh, model.mesh.node_labels))
    number = min(audit.distances, key=audit.distances.__getitem__)
    ours = total(problem, roots[number[1]])
    if model.scene().body.axisymmetric:  # CalculiX has a slice of two degrees
        ours, base = ours[1:], 180.0 * base[1:]
    return audit.distances[number], float(np.linalg.norm(ours + base) / np.linalg.norm(ours)), audit.found is not None


def compared(name, cells, folder):
    """One row of a deck."""
    make, kind = CASES[name]
    file = Path(folder) / f"{name.replace(' ', '_')}_{cells}.inp"
    file.write_text(make(kind, cells))
    model, problem, roots = solved(file)
    row = {
        "deck": name,
        "cells": cells,
        "n": problem.n,
        "p": problem.p,
        "roots": len(roots),
        "complete": roots.complete,
    }
    if shutil.which("ccx") is None:
        return row | dict.fromkeys(COMPARED, "-")
    done = subprocess.run(["ccx", file.stem], cwd=folder, capture_output=True, text=True, check=False)
    if "Job finished" not in done.stdout or "ERROR" in done.stdout:
        return row | dict.fromkeys(COMPARED, "-") | {"audit": "CalculiX found no result"}
    result = enumsol.read_results(file.with_suffix(".dat"))[-1]
    base = reaction(file.with_suffix(".dat"), problem.mesh.points.shape[1])
    moved, pushed, found = differences(result, model, problem, roots, base)
    alike = differences(result, *solved(file, "ccx"), base)
    return row | dict(zip(COMPARED, (moved, pushed, found, *alike[:2]), strict=True))


def total(problem, root):
    """The total contact force on the second body, (d,)."""
    frames = row_frames(problem)  # normals out of the first body, and tangents
    if frames.shape[1] == 2:  # a node may be held along its tangent
        frames[:, 1] = np.column_stack([-frames[:, 0, 1], frames[:, 0, 0]])
    forces = np.column_stack([root.lambda_n, root.lambda_t])
    return np.einsum("pk,pkd->d", forces, frames)


def reaction(file, d):
    """The total reaction that CalculiX prints last, (d,)."""
    lines = file.read_text().splitlines()
    last = max(k for k, line in enumerate(lines) if "total force" in line)
    return np.array([float(word) for word in lines[last + 2].split()[:d]])


def conclusion(rows):
    """How the differences fall from mesh to mesh."""
    if shutil.which("ccx") is None:
        return ABSENT
    by_deck = {}
    for row in rows:
        by_deck.setdefault(row["deck"], []).append([row[name] for name in COMPARED if name != "audit"])
    last = np.array([values[-1] for values in by_deck.values()])
    rest = [values[-1][0] for values in by_deck.values() if values[-1][0] >= values[0][0]]
    return (
        f"Conclusion: on the finest meshes the displacements differ by {100 * min(last[:, 0]):.2g} to "
        f"{100 * max(last[:, 0]):.2g} % of the largest, and the total contact forces by {100 * min(last[:, 1]):.2g} to "
        f"{100 * max(last[:, 1]):.2g} %. The displacements come closer on {len(by_deck) - len(rest)} of {len(by_deck)} "
        f"decks; on the others they differ by at most {100 * max(rest, default=0.0):.2g} %, which the penalty leaves. "
        f"With the same stiffness the forces differ by {100 * min(last[:, 3]):.2g} to {100 * max(last[:, 3]):.2g} %; "
        f"those of plane stress by {100 * by_deck['block CPS4'][-1][3]:.2g} in place of "
        f"{100 * by_deck['block CPS4'][-1][1]:.2g} %, and those of wedges by "
        f"{100 * by_deck['block C3D6'][-1][3]:.2g} in place of {100 * by_deck['block C3D6'][-1][1]:.2g} %."
    )


def main(run: Run) -> None:
    with tempfile.TemporaryDirectory() as folder:
        rows = [
            compared(name, cells, folder)
            for name, (_, kind) in CASES.items()
            for cells in (SOLID_SIZES if kind in SOLID else PLANE_SIZES)[: 1 if run.smoke else None]
        ]
    run.table("against_calculix", rows, conclusion(rows))
