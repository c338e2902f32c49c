"""Are the roots the same when the same body is assembled by scikit-fem, FEniCSx and GetFEM?

A wedge of P1 triangles, pressed into a notch and pulled at its top, which springs hold. Each code's script
(``by_scikit_fem.py``, ``by_dolfinx.py``, ``by_getfem.py``) reads the mesh, assembles stiffness and load in its own way
and its own order of the degrees of freedom, and writes A, Bn, Bt and f to a .npz file, as a user of that code would;
the scripts import nothing of this package. All solutions of each file are then enumerated and proven.

A code is looked for in this Python, in the ``python3`` of the system (where Debian's python3-dolfinx and
python3-getfem are) and in ``--python``; one that is nowhere is left out. ``difference`` is the largest one between
contact forces and those of scikit-fem, relative to the largest force.

Then two bodies whose meshes do not match, one on the other (``two_bodies_by_scikit_fem.py``), against the pair of
``enumsol.fem``.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import enumsol
from enumsol import fem
from shared.interpreters import call, interpreter
from shared.results import yes

if TYPE_CHECKING:
    import argparse

    from enumsol import RootSet
    from shared.results import Run

HERE = Path(__file__).parent
#: Script of each code, and what it imports.
CODES = {
    "scikit-fem": ("by_scikit_fem", "skfem"),
    "dolfinx": ("by_dolfinx", "dolfinx"),
    "GetFEM": ("by_getfem", "getfem"),
}
#: Cells along and across the wedge, and alphas at which its roots are enumerated.
SIZES, SMOKE_SIZES = ((4, 4), (6, 7), (10, 10)), ((4, 4),)
ALPHAS, SMOKE_ALPHAS = (1.5, 2.5, 4.0), (2.5,)
#: Cells along the upper and the lower of two bodies.
TWO_BODIES, SMOKE_TWO_BODIES = ((4, 6), (7, 5), (8, 12)), ((4, 6),)
#: How near forces are to be.
CLOSE = 1e-9
#: The search of the largest wedge stops here; only what is complete is compared.
MOST_NODES = 20_000


def options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--python", metavar="PYTHON", help="another interpreter to look for the codes in")


def write_mesh(place: Path, nx: int, ny: int) -> None:
    """The wedge, with what acts on it."""
    mesh = fem.trapezoid(nx, ny, bottom=1.0, top=1.7, height=1.0)
    # the top row stands in the mouth of the notch
    sides = (mesh.left[:-1], mesh.right[:-1])
    normal = np.array([-1.0, -0.35]) / np.hypot(1.0, 0.35)
    np.savez(
        place,
        points=mesh.points,
        triangles=mesh.triangles,
        contact=np.concatenate(sides),
        normals=np.repeat([normal, normal * [-1, 1]], len(sides[0]), axis=0),
        lame=[1.0, 1.0],
        spring=0.02,
        traction=[1e-4, 1e-3],
        gap=-5e-4,
    )


def problems(size: tuple[int, int], pythons: dict[str, str]) -> dict[str, Any]:
    """The problem by each code."""
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        mesh = Path(folder, "mesh.npz")
        write_mesh(mesh, *size)
        for code, python in pythons.items():
            file = Path(folder, f"{CODES[code][0]}.npz")
            done = call(python, str(HERE / f"{CODES[code][0]}.py"), str(mesh), str(file))
            if done.returncode:
                sys.exit(f"{code}: {done.stderr}")
            found[code] = enumsol.read_problem(file)
    return found


def forces(roots: RootSet) -> np.ndarray:
    return np.array([[root.lambda_n, root.lambda_t] for root in roots])


def compared(size: tuple[int, int], alpha: float, by_code: dict[str, Any]) -> list[dict[str, Any]]:
    rows = []
    roots = {code: enumsol.enumerate_roots(body, alpha, max_nodes=MOST_NODES) for code, body in by_code.items()}
    first = next(iter(roots.values()))
    for code, found in roots.items():
        same = len(found) == len(first) and all(a.statuses == b.statuses for a, b in zip(found, first, strict=True))
        scale = np.max(np.abs(forces(first)))
        rows.append(
            {
                "cells": f"{size[0]}x{size[1]}",
                "p": by_code[code].p,
                "alpha": alpha,
                "code": code,
                "roots": len(found),
                "complete": yes(found.complete),
                "same statuses": yes(same),
                "difference": float(np.max(np.abs(forces(found) - forces(first))) / scale) if same else np.inf,
            }
        )
    return rows


def two_bodies(place: Path, upper: int, lower: int) -> enumsol.ContactProblem:
    """One block on another, by `enumsol.fem`; what the other code needs is written to a file."""
    top, bottom = fem.rectangle(upper, 2, 1.5, 0.5), fem.rectangle(lower, 2, 2.0, 0.5)
    count = len(bottom.points)
    points = np.concatenate([bottom.points, top.points + np.array([0.2, 0.5])])
    triangles = np.concatenate([bottom.triangles, count + top.triangles])
    parts = {"floor": bottom.bottom, "below": bottom.top, "above": count + top.bottom, "end": count + top.left}
    facets = {name: fem.edges_along(nodes) for name, nodes in parts.items()} | {
        "roof": top.parted().part("top") + count
    }
    lame, traction, gap = fem.lame(2.5, 0.25), (0.1, -0.3), 1e-3
    np.savez(
        place,
        points=points,
        triangles=triangles,
        slave=parts["above"],
        master=parts["below"],
        held=np.union1d(parts["floor"], parts["end"]),
        loaded=facets["roof"],
        lame=lame,
        traction=traction,
        gap=gap,
    )
    return fem.mesh_problem(
        fem.PartedMesh(points, triangles, facets),
        young=2.5,
        poisson=0.25,
        pairs=[("above", "below")],
        clamp=["floor", "end"],
        load={"roof": traction},
        gap=gap,
    )


def both(upper: int, lower: int, alphas: tuple[float, ...]) -> list[dict[str, Any]]:
    """Rows of the two bodies by scikit-fem and by `enumsol.fem`."""
    with tempfile.TemporaryDirectory() as folder:
        mesh, file = Path(folder, "mesh.npz"), Path(folder, "problem.npz")
        own = two_bodies(mesh, upper, lower)
        done = call(sys.executable, str(HERE / "two_bodies_by_scikit_fem.py"), str(mesh), str(file))
        if done.returncode:
            sys.exit(f"scikit-fem: {done.stderr}")
        by_code = {"scikit-fem": enumsol.read_problem(file), "enumsol.fem": own}
    return [row for alpha in alphas for row in compared((upper, lower), alpha, by_code)]


def main(run: Run) -> None:
    more = getattr(run.options, "python", None)
    found = {code: interpreter(library, more) for code, (_, library) in CODES.items()}
    pythons = {code: python for code, python in found.items() if python is not None}
    rows = []
    for size in SMOKE_SIZES if run.smoke else SIZES:
        by_code = problems(size, pythons)
        for alpha in SMOKE_ALPHAS if run.smoke else ALPHAS:
            rows += compared(size, alpha, by_code)
    same = all(row["same statuses"] == row["complete"] == "yes" and row["difference"] < CLOSE for row in rows)
    run.table(
        "same_body_by_other_codes",
        rows,
        f"the same roots to {CLOSE:g}, all complete: {yes(same)}",
        f"largest difference {max(row['difference'] for row in rows):.1e}; codes: {', '.join(pythons)}",
        *(f"{code} is not installed: it is left out" for code in CODES if code not in pythons),
    )
    rows = [row for sizes in (SMOKE_TWO_BODIES if run.smoke else TWO_BODIES) for row in both(*sizes, (0.2, 0.5, 1.0))]
    same = all(row["same statuses"] == row["complete"] == "yes" and row["difference"] < CLOSE for row in rows)
    run.table(
        "two_bodies",
        rows,
        f"two bodies: the same roots to {CLOSE:g}, all complete: {yes(same)}",
        f"largest difference {max(row['difference'] for row in rows):.1e}",
    )
