"""Named contact problems for documentation, tests and benchmarks: closed forms, blocks, wedges, parts of machines.

Every function returns a `ContactProblem`, those whose names end with 3d a `ContactProblem3D`. `GALLERY` lists
ready-made ones with a parameter value at which each is worth a look and, where it is known, the number of its roots
there; `get` finds one by name.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING

from enumsol.gallery.machine_parts import brake_shoe, clip, dovetail, lap_joint, pressed_rings
from enumsol.gallery.problems import (
    block3d,
    block_on_table,
    block_on_table3d,
    chain,
    clamped_block,
    one_node_3d,
    one_node_triangle,
    taper,
    two_node_square,
    wedge,
    wedge3d,
)
from enumsol.support import arguments

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from enumsol.gallery.problems import Pair
    from enumsol.model.problem3d import AnyProblem

__all__ = [
    "GALLERY",
    "GalleryEntry",
    "block3d",
    "block_on_table",
    "block_on_table3d",
    "brake_shoe",
    "chain",
    "clamped_block",
    "clip",
    "close_names",
    "dovetail",
    "get",
    "lap_joint",
    "one_node_3d",
    "one_node_triangle",
    "pressed_rings",
    "taper",
    "two_node_square",
    "wedge",
    "wedge3d",
]


@dataclass(frozen=True)
class GalleryEntry:
    """A named problem of the gallery.

    Attributes
    ----------
    name : str
        Its name, as in ``gallery:NAME``.
    summary : str
        What it shows, in one line.
    alpha : float
        A value of the parameter at which its solutions are worth a look.
    roots : int or None
        Number of its roots at that alpha; None if they are not all isolated or the number is not known.
    build : callable
        Function without arguments that returns the problem.
    dimension : int
        2 or 3.
    """

    name: str
    summary: str
    alpha: float
    roots: int | None
    build: Callable[[], AnyProblem] = field(repr=False)
    dimension: int = 2


def get(name: str) -> GalleryEntry:
    """Return the entry of `GALLERY` with this name.

    Raises
    ------
    InvalidArgumentError
        There is no such entry; the message lists similar names, or all of them.

    Examples
    --------
    >>> import enumsol
    >>> entry = enumsol.gallery.get("wedge-8-5")
    >>> entry.roots == len(enumsol.enumerate_roots(entry.build(), entry.alpha))
    True
    """
    return arguments.entry_named(name, GALLERY, "the gallery", "one-node-6.1")


def close_names(name: str) -> list[str]:
    """Up to five names of `GALLERY` that resemble this one, the closest first; only this one if it is among them.

    Examples
    --------
    >>> import enumsol
    >>> "wedge-8-5" in enumsol.gallery.close_names("wedge8-5")
    True
    """
    return arguments.close_names(name, GALLERY)


def _small() -> Iterator[GalleryEntry]:
    def one(name: str, summary: str, alpha: float, roots: int | None, f: Pair) -> GalleryEntry:
        return GalleryEntry(f"one-node-{name}", summary, alpha, roots, partial(one_node_triangle, f))

    def two(name: str, summary: str, alpha: float, roots: int, loads: tuple[Pair, Pair]) -> GalleryEntry:
        build = partial(two_node_square, *loads)
        return GalleryEntry(f"two-node-{name}", f"own geometry, {summary}", alpha, roots, build)

    def path(name: str, sign: float, alpha: float) -> GalleryEntry:
        slope = ((0.1, sign * 1.1), (0.2, sign * 0.8))
        build = partial(two_node_square, (0.4, 0.2), (1.8, -0.1), friction=4.0, load_slope=slope)
        summary = f"own geometry, loading path of Example 6.7, tangential slopes {sign * 1.1:+g} and {sign * 0.8:+g}"
        return GalleryEntry(f"two-node-6.7-{name}", summary, alpha, 3, build)

    yield one("6.1", "two branches: open for every alpha, and a fold at alpha = 8/3", 5.0, 3, (1.5, -4.0))
    yield one("6.2", "one branch", 5.0, 1, (1.5, 7.0))
    yield one("6.3", "two branches that meet in a continuum of roots at alpha = 2", 2.0, None, (1.0, -2.0))
    yield one("6.3-perturbed", "a small change of the load destroys that bifurcation", 5.0, 3, (0.98, -2.0))
    yield two("6.4", "loads of Example 6.4: five roots between alpha = 3 and 3.8", 3.5, 5, ((1.0, -3.0), (1.0, -1.0)))
    yield two("6.5", "loads of Example 6.5: three roots from alpha = 3.5 on", 5.0, 3, ((0.4, -1.4), (1.5, -1.3)))
    yield two("6.6", "loads of Example 6.6: one root", 5.0, 1, ((2.0, -3.0), (1.0, -1.0)))
    yield path("minus", -1.0, 1.6)
    yield path("plus", 1.0, -1.0)
    yield two("5", "own loads: five well separated roots", 5.0, 5, ((1.0, -4.0), (1.5, -3.5)))


def _large() -> Iterator[GalleryEntry]:
    for p in (8, 16, 32, 64, 100):
        build = partial(clamped_block, p, p // 2)
        yield GalleryEntry(f"clamped-block-{p}", f"block on {p} contact nodes: one root", 3.0, 1, build)
    yield GalleryEntry("block-on-table-5", "block that nothing but contact holds: one root", 0.0, 1, block_on_table)
    for p in (8, 14, 20, 32):
        build = partial(wedge, 4, p // 2)
        yield GalleryEntry(f"wedge-{p}-3", "wedge pulled straight: jammed, free or sliding out", 1.0, 3, build)
    # at each of these alpha the five roots are well away from changes of status
    for p, alpha in ((8, 3.0), (14, 2.2), (20, 2.25), (32, 2.2)):
        build = partial(wedge, 4, p // 2, (4e-4, 1e-3))
        yield GalleryEntry(f"wedge-{p}-5", "wedge pulled obliquely: it may hang tilted too", alpha, 5, build)
    for p in (8, 14):
        build = partial(taper, 4, p // 2)
        yield GalleryEntry(
            f"taper-{p}", "self-holding taper of steel, pulled: it holds, slides or is free", 0.2, 3, build
        )
    for p in (2, 4, 6, 8):
        yield GalleryEntry(f"chain-{p}", f"{p} separate one-node triangles: 3^{p} roots", 5.0, 3**p, partial(chain, p))
    for p in (2, 4, 6, 8):
        build = partial(chain, p, 0.05)
        yield GalleryEntry(f"chain-{p}-coupled", f"{p} one-node triangles joined by weak springs", 5.0, 3**p, build)


def _machine_parts() -> Iterator[GalleryEntry]:
    yield GalleryEntry("dovetail-14", "dovetail root of a blade, pulled into its slot: one root", 0.2, 1, dovetail)
    yield GalleryEntry(
        "brake-shoe-9", "brake shoe, pulled off: it is released, or locked by the drum", 0.4, 3, brake_shoe
    )
    yield GalleryEntry("clip-17", "clip on a round bar, pulled off: it grips, or has sprung off", 0.25, 3, clip)
    yield GalleryEntry(
        "pressed-rings-16", "two rings with a press fit that transmits a torque: one root", 0.15, 1, pressed_rings
    )
    yield GalleryEntry("lap-joint-9", "lap joint of two plates, stretched: its ends slip, one root", 0.3, 1, lap_joint)


def _solids() -> Iterator[GalleryEntry]:
    yield GalleryEntry("one-node-3d", "one node by its compliance: a public test", 0.0, 1, one_node_3d, 3)
    jamming = partial(one_node_3d, ((2.0, 1.0, 0.2), (1.0, 2.0, 0.1), (0.2, 0.1, 1.0)), (0.9, 6.45, -0.4), 5.0)
    yield GalleryEntry("one-node-3d-3", "one node that is jammed, slides or is open", 0.0, 3, jamming, 3)
    for p, cells, roots in ((4, (2, 1, 2), 1), (9, (3, 2, 2), 1), (16, (4, 3, 2), 1), (100, (10, 9, 4), None)):
        summary = f"block in 3D on {p} contact nodes, pressed and sheared"
        yield GalleryEntry(f"block3d-{p}", summary, 0.5, roots, partial(block3d, *cells), 3)
    for p, nz in ((2, 2), (4, 3)):
        summary = f"wedge in 3D on {p} patches, pulled straight: jammed, free or sliding out"
        yield GalleryEntry(f"wedge3d-{p}-3", summary, 1.0, 3, partial(wedge3d, 2, 1, nz), 3)
    build = partial(wedge3d, 2, 2, 2, (0.0, 5e-5, 5e-4))
    yield GalleryEntry("wedge3d-4-9", "wedge in 3D, pulled obliquely: either end may come out", 3.0, 9, build, 3)
    build = partial(wedge3d, 2, 1, 2, (4e-4, 1e-4, 1e-3), multipliers="nodes")
    yield GalleryEntry("wedge3d-8-5", "wedge in 3D on 8 nodes, pulled obliquely: it may hang tilted", 2.0, 5, build, 3)


#: All named problems, by name.
GALLERY: Mapping[str, GalleryEntry] = MappingProxyType(
    {entry.name: entry for entry in (*_small(), *_large(), *_machine_parts(), *_solids())}
)
