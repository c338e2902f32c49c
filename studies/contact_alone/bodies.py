"""Bodies in the plane that nothing but contact holds, of quadrilaterals."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol import fem

if TYPE_CHECKING:
    from collections.abc import Callable

FREE = {"max_rigid_displacement": "auto"}


def grid(nx: int, ny: int, place: Callable[[Any, Any], tuple[Any, Any]], *, closed: bool = False) -> fem.PartedMesh:
    """nx by ny cells at the places of (0, 1) x (0, 1); if ``closed``, the right side is the left one."""
    x, y = np.meshgrid(np.linspace(0, 1, nx + 1), np.linspace(0, 1, ny + 1))
    points, number = np.stack(place(x, y), axis=-1), np.arange((nx + 1) * (ny + 1)).reshape(ny + 1, nx + 1)
    if closed:
        points, number = points[:, :-1], np.arange(nx * (ny + 1)).reshape(ny + 1, nx)
        number = np.hstack([number, number[:, :1]])
    cells = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1).reshape(-1, 4)
    sides = {"bottom": number[0], "top": number[-1], "left": number[:, 0], "right": number[:, -1]}
    facets = {name: np.stack([line[:-1], line[1:]], axis=1) for name, line in sides.items()}
    return fem.PartedMesh(points.reshape(-1, 2), cells, facets)


def box(nx: int, ny: int, left: float, low: float, width: float, height: float) -> fem.PartedMesh:
    return grid(nx, ny, lambda x, y: (left + width * x, low + height * y))


def joined(**bodies: fem.PartedMesh) -> fem.PartedMesh:
    """Bodies in one mesh; their parts are called BODY-PART."""
    points, cells, facets, count = [], [], {}, 0
    for name, mesh in bodies.items():
        points.append(mesh.points)
        cells.append(mesh.cells + count)
        facets |= {f"{name}-{part}": lines + count for part, lines in mesh.facets.items()}
        count += len(mesh.points)
    return fem.PartedMesh(np.concatenate(points), np.concatenate(cells), facets)


def half_plate(count: int) -> Any:
    """Half of a plate on a floor, rollers at its plane of symmetry, pressed from above and from the side: one mode."""
    return fem.mesh_problem(
        fem.rectangle(count, count).parted(), young=1000.0, poisson=0.2, contact="bottom", symmetry="right",
        pressure={"top": 0.5, "left": 1.5}, friction=1.0, **FREE,
    )  # fmt: skip


def stack(k: int, blocks: int = 1, push: float = 0.2) -> Any:
    """Square blocks on a slab, one on the other, the highest pushed by less than friction can hold."""
    slab = box(40 * k, 4 * k, 0.0, 0.0, 4.0, 1.0)
    others = {f"b{i}": box(10 * k, 4 * k, 1.0, 1.0 + i, 1.0, 1.0) for i in range(blocks)}
    pairs = [(f"b{i}-bottom", f"b{i - 1}-top" if i else "slab-top") for i in range(blocks)]
    last = f"b{blocks - 1}"
    return fem.mesh_problem(
        joined(slab=slab, **others), young=210.0, poisson=0.3, pairs=pairs, clamp="slab-bottom",
        pressure={f"{last}-top": 1.0}, load={f"{last}-left": (push, 0.0)}, friction=0.3, **FREE,
    )  # fmt: skip


def pin(cells: int, friction: float, *, half: bool = True, clearance: float = 0.0) -> Any:
    """A pin with a bore in the hole of a strip, pulled at its bore: as half with rollers one mode, whole three."""
    turn, rings = (math.pi if half else 2 * math.pi), max(3, cells // 8)

    def strip(x: Any, y: Any) -> tuple[Any, Any]:
        angle = turn * (1 - x)
        side = 3.0 / np.maximum(np.abs(np.cos(angle)), np.abs(np.sin(angle)))
        radius = 1.0 + y * (side - 1.0)
        return radius * np.cos(angle), radius * np.sin(angle)

    def disc(x: Any, y: Any) -> tuple[Any, Any]:
        angle, radius = turn * (1 - x), 0.3 + 0.7 * y
        return radius * np.cos(angle), radius * np.sin(angle)

    parts = joined(strip=grid(cells, rings, strip, closed=not half), pin=grid(cells, rings, disc, closed=not half))
    far = parts.facets["strip-top"]
    held = far[np.all(parts.points[far, 0] < -3.0 + 1e-9, axis=1)]
    symmetry = [f"{body}-{side}" for body in ("strip", "pin") for side in ("left", "right")] if half else []
    mesh = fem.PartedMesh(parts.points, parts.cells, {**parts.facets, "held": held})
    return fem.mesh_problem(
        mesh, young=210.0, poisson=0.3, pairs=[("pin-top", "strip-bottom", clearance)], clamp="held",
        symmetry=symmetry, load={"pin-bottom": (1.0, 0.0)}, friction=friction, **FREE,
    )  # fmt: skip


def telescope(cells: int, friction: float = 0.2, press: float = 0.0) -> Any:
    """A bar between two plates that are clamped at their left end, its free end pushed down: three modes."""
    span, ny = 10.0, max(2, cells // 40)
    bar = box(cells + cells // 2, ny, 0.0, 0.0, 1.5 * span, 1.0)
    inside = {name: bar.facets[name][:cells] for name in ("bottom", "top")}
    bar = fem.PartedMesh(bar.points, bar.cells, {**inside, "end": bar.facets["right"]})
    mesh = joined(bar=bar, low=box(cells, ny, 0.0, -0.5, span, 0.5), high=box(cells, ny, 0.0, 1.0, span, 0.5))
    return fem.mesh_problem(
        mesh, young=210.0, poisson=0.3, pairs=[("bar-bottom", "low-top", -press), ("bar-top", "high-bottom", -press)],
        clamp=["low-left", "high-left"], load={"bar-end": (0.0, -0.01)}, friction=friction, **FREE,
    )  # fmt: skip


def wedge(
    rows: int, friction: float, pull: tuple[float, float] = (0.0, 5e-4), press: float = 5e-4, half_angle: float = 20.0
) -> Any:
    """The wedge of the gallery in its notch, without its springs."""
    slope = math.tan(math.radians(half_angle))
    mesh = grid(4, rows, lambda x, y: ((x - 0.5) * (1.0 + 2 * slope * y), y))
    return fem.mesh_problem(
        mesh, young=2.5, poisson=0.25, contact=["left", "right"], load={"top": pull}, gap=-press, friction=friction,
        **FREE,
    )  # fmt: skip


def brake_shoe(columns: int, friction: float, pull: float = 0.05, turn: float = 0.1) -> Any:
    """The brake shoe of the gallery without its return spring: it may turn about its pin."""

    def place(x: Any, y: Any) -> tuple[Any, Any]:
        across = (x - 0.5) * 40.0
        rim = np.sqrt(300.0**2 - across**2)
        return across - 10.0 * y, rim + y * (420.0 - rim)

    mesh = grid(columns, 6, place)
    mesh = fem.PartedMesh(
        mesh.points, mesh.cells, {**mesh.facets, "eye": mesh.facets["top"][-1:]},
        {"pin": mesh.facets["top"][:1, 0]},
    )  # fmt: skip
    shoe = fem.mesh_problem(
        mesh, young=500.0, poisson=0.3, plane="stress", contact="bottom", clamp="pin", load={"eye": (0.0, pull)},
        friction=friction, **FREE,
    )  # fmt: skip
    return shoe.replace(slip_offset=np.full(shoe.p, -turn))


def clip(columns: int, friction: float, pull: float = 1.0, press: float = 0.1) -> Any:
    """The clip of the gallery, without the line that springs it back: three modes."""
    half = math.radians(80.0)

    def place(x: Any, y: Any) -> tuple[Any, Any]:
        angle, radius = math.pi / 2 + half * (1 - 2 * x), 10.0 + 2.0 * y
        return radius * np.cos(angle), radius * np.sin(angle)

    mesh = grid(columns, 2, place)
    middle = columns // 2
    mesh = fem.PartedMesh(
        mesh.points, mesh.cells, {**mesh.facets, "crown": mesh.facets["top"][middle - 1 : middle + 1]}
    )
    return fem.mesh_problem(
        mesh, young=210e3, poisson=0.3, plane="stress", contact="bottom", load={"crown": (0.0, pull)}, gap=-press,
        friction=friction, **FREE,
    )  # fmt: skip
