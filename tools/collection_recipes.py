"""What the problems of the collection are made of: functions of the gallery and seeds, frozen at one friction and load.

A name and what it stands for never change: whoever cites a problem must find it again.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

import enumsol
from enumsol import fem, gallery

if TYPE_CHECKING:
    from collections.abc import Callable

Problem = Any


@dataclass(frozen=True)
class Recipe:
    """How a problem of the collection is made.

    Attributes
    ----------
    name : str
        Its identifier.
    summary : str
        What it shows, in a line.
    source : str
        Where it comes from, in a line.
    build : callable
        Makes the problem, whose friction and load do not depend on alpha.
    kinds : tuple of str
        Words to choose by: "degenerate", "continuum", "soft", "large", "steel", "random".
    """

    name: str
    summary: str
    source: str
    build: Callable[[], Problem]
    kinds: tuple[str, ...] = ()


# -- problems ----------------------------------------------------------------------------------------------------------


def frozen(problem: Problem, alpha: float = 0.0, friction: float | None = None) -> Problem:
    """The problem with the load that it has at alpha, and with the friction that it has there or is given.

    In 3D friction becomes isotropic, as fclib has no other: the coefficient of the first axis.
    """
    F = problem.friction_at(alpha)
    changes: dict[str, Any] = {"friction": F if friction is None else friction, "friction_slope": 0.0}
    if isinstance(problem, enumsol.ContactProblem3D):
        mu = F[:, 0] if friction is None else friction
        changes = {"friction": (mu, mu), "friction_slope": 0.0}
    return problem.replace(f=problem.load_at(alpha), load_slope=None, node_ids=range(problem.p), **changes)


def several(*parts: Problem) -> Problem:
    """Problems in the plane side by side, without a coupling."""
    A, Bn, Bt = (sp.block_diag([getattr(part, name) for part in parts], "csc") for name in ("A", "Bn", "Bt"))
    f, F = (np.concatenate(arrays) for arrays in zip(*((part.f, part.friction) for part in parts), strict=True))
    return enumsol.ContactProblem(A, Bn, Bt, f, friction=F)


def random_problem(seed: int, p: int, friction: float, dimension: int) -> Problem:
    """A compliance of p nodes and a free displacement, whose entries are fractions with small denominators of two."""
    rng, size = np.random.default_rng(seed), dimension * p
    root = rng.integers(-8, 9, (size, size)) / 4.0
    S = root @ root.T + np.eye(size) / 8.0
    # as in fclib's local problems: with A = B = S and f = g the compliance is S, and nothing is inverted
    f = rng.integers(-16, 17, size) / 8.0
    rows = [S[k * p : (k + 1) * p] for k in range(dimension)]
    if dimension == 2:
        return enumsol.ContactProblem(S, *rows, f, friction=friction)
    return enumsol.ContactProblem3D(S, *rows, f, friction=friction)


def half_smooth_block() -> Problem:
    """A block every other contact node of which has no friction."""
    block = gallery.clamped_block(8, 4, traction=(-0.3, -1.0))
    return frozen(block).replace(friction=np.where(np.arange(block.p) % 2, 0.0, 0.8), friction_slope=0.0)


def soft_box(cells: tuple[int, int, int], stiffness: float) -> Problem:
    """A box in 3D that is pressed onto the floor and sheared, and whose top is held by springs alone."""
    mesh = fem.box(*cells)
    top = mesh.facets["top"]
    return fem.solid_contact_problem(
        mesh.points,
        mesh.cells,
        (1.0, 1.0),
        contact=mesh.facets["bottom"],
        normals=(0.0, 0.0, -1.0),
        axes=(1.0, 0.0, 0.0),
        springs=fem.facet_forces(mesh.points, top, (stiffness,) * 3),
        forces=fem.facet_forces(mesh.points, top, (0.05, 0.02, -0.1)),
        friction=0.0,
    )


# -- the list ----------------------------------------------------------------------------------------------------------


def named(name: str, summary: str, entry: str, alpha: float | None = None, *kinds: str) -> Recipe:
    """A problem of the gallery at an alpha, by default the one of its entry there."""
    at = gallery.get(entry).alpha if alpha is None else alpha
    isotropic = ", isotropic" if gallery.get(entry).dimension == 3 else ""
    source = f"gallery:{entry} at alpha = {at:g}{isotropic}"
    return Recipe(name, summary, source, lambda: frozen(gallery.get(entry).build(), at), kinds)


def made(
    name: str, summary: str, source: str, friction: float | None, build: Callable[[], Problem], *kinds: str
) -> Recipe:
    """A problem that a function makes, with a coefficient of friction; None: with its own."""
    words = source if friction is None else f"{source}, friction {friction:g}"
    return Recipe(name, summary, words, lambda: frozen(build(), 0.0, friction), kinds)


def drawn(seed: int, p: int, friction: float, dimension: int, summary: str, *kinds: str) -> Recipe:
    """A random problem."""
    name = f"random{'-3d' if dimension == 3 else ''}-{p}-{seed}"
    source = f"random_problem({seed}, {p}, {friction:g}, {dimension}) in tools/collection_recipes.py"
    return Recipe(name, summary, source, lambda: random_problem(seed, p, friction, dimension), ("random", *kinds))


OBLIQUE, OBLIQUE_3D = (4e-4, 1e-3), (4e-4, 1e-4, 1e-3)
TRIANGLE, BLOCK, WEDGE, WEDGE_3D = (
    f"gallery.{name}" for name in ("one_node_triangle", "clamped_block", "wedge", "wedge3d")
)
IDENTITY = np.eye(3)

SMALL = (
    named("triangle-3", "one node that is open, sticks or slips", "one-node-6.1", 5.0),
    named("triangle-1", "one node that is pressed onto the floor", "one-node-6.2", 5.0),
    made(
        "triangle-fold",
        "friction at the fold, where stick at its limit and slip are one solution",
        f"{TRIANGLE}((1.5, -3.75))",
        2.5,
        lambda: gallery.one_node_triangle((1.5, -3.75)),
        "degenerate",
    ),
    named("triangle-continuum", "a segment of solutions, from open to stick", "one-node-6.3", 2.0, "continuum"),
    made(
        "triangle-unloaded",
        "no load: contact without force",
        f"{TRIANGLE}((0, 0))",
        1.0,
        lambda: gallery.one_node_triangle((0.0, 0.0)),
        "degenerate",
    ),
    made(
        "two-continua",
        "two nodes, each with a segment of solutions: together a square of them",
        f"two of {TRIANGLE}((1, -2)) side by side, friction 2",
        None,
        lambda: several(*[frozen(gallery.one_node_triangle((1.0, -2.0)), 2.0) for _ in range(2)]),
        "continuum",
    ),
    made(
        "continuum-and-three",
        "one node with a segment of solutions, one with three: three segments",
        f"{TRIANGLE}((1, -2)) with friction 2 and {TRIANGLE}() with friction 5 side by side",
        None,
        lambda: several(frozen(gallery.one_node_triangle((1.0, -2.0)), 2.0), frozen(gallery.one_node_triangle(), 5.0)),
        "continuum",
    ),
    made(
        "fold-and-three",
        "one node at its fold, one with three solutions: three of the six are degenerate",
        f"{TRIANGLE}((1.5, -3.75)) with friction 2.5 and {TRIANGLE}() with friction 5 side by side",
        None,
        lambda: several(frozen(gallery.one_node_triangle((1.5, -3.75)), 2.5), frozen(gallery.one_node_triangle(), 5.0)),
        "degenerate",
    ),
    named("square-5", "two nodes and five solutions", "two-node-6.4", 3.5),
    named(
        "square-fold", "square-5 at the friction from which it has five solutions", "two-node-6.4", 3.0, "degenerate"
    ),
    named("square-path", "two nodes under a load on a loading path", "two-node-6.7-minus", 1.6),
    named("square-far", "two nodes and five solutions far from each other", "two-node-5", 5.0),
    named("chain-2", "two nodes that do not feel each other: 3^2 solutions", "chain-2"),
    named("chain-4", "four nodes that do not feel each other: 3^4 solutions", "chain-4"),
    named("chain-4-coupled", "four nodes joined by weak springs: 3^4 solutions", "chain-4-coupled"),
    drawn(253, 2, 1.5, 2, "two nodes at a fold", "degenerate"),
    drawn(16, 2, 1.5, 2, "two nodes, full compliance"),
    drawn(34, 3, 1.5, 2, "three nodes, full compliance"),
    drawn(10, 4, 2.0, 2, "four nodes, full compliance"),
)

PLANE = (
    named("wedge-8-3", "a wedge in a notch: jammed, sliding out or free", "wedge-8-3"),
    named("wedge-8-5", "wedge-8-3 pulled obliquely: it may hang tilted, too", "wedge-8-5"),
    named("wedge-14-3", "a finer mesh of wedge-8-3", "wedge-14-3"),
    named("wedge-14-5", "a finer mesh of wedge-8-5", "wedge-14-5"),
    named("wedge-20-5", "a finer mesh of wedge-14-5", "wedge-20-5", None, "large"),
    made(
        "wedge-8-soft",
        "wedge-8-5 on springs 1000 times as soft",
        f"{WEDGE}(4, 4, (4e-4, 1e-3), springs=(4e-5, 2e-5))",
        3.0,
        lambda: gallery.wedge(4, 4, OBLIQUE, springs=(4e-5, 2e-5)),
        "soft",
    ),
    made(
        "wedge-14-soft",
        "wedge-14-3 on springs 1000 times as soft",
        f"{WEDGE}(4, 7, springs=(4e-5, 2e-5))",
        1.0,
        lambda: gallery.wedge(4, 7, springs=(4e-5, 2e-5)),
        "soft",
    ),
    named("taper-8", "a self-holding taper of steel in N and mm", "taper-8", None, "steel"),
    named("taper-14", "a finer mesh of taper-8", "taper-14", None, "steel"),
    named("block-8", "a clamped block, pressed and sheared: parts of it stick and slip", "clamped-block-8", 0.2),
    made(
        "block-32",
        "a finer mesh of such a block",
        f"{BLOCK}(32, 16, traction=(0.6, -1))",
        0.2,
        lambda: gallery.clamped_block(32, 16, traction=(0.6, -1.0)),
        "large",
    ),
    made(
        "block-ridges",
        "a fine mesh that meets the floor on eight ridges",
        f"{BLOCK}(32, 16, traction=(0.6, -1), contact=8)",
        0.2,
        lambda: gallery.clamped_block(32, 16, traction=(0.6, -1.0), contact=8),
        "large",
    ),
    made(
        "block-long",
        "a long strip on 100 nodes, nearly all of which slip",
        f"{BLOCK}(100, 3, length=20, traction=(0.02, -0.05))",
        0.4,
        lambda: gallery.clamped_block(100, 3, length=20.0, traction=(0.02, -0.05)),
        "large",
    ),
    made(
        "block-unloaded",
        "a block that touches the floor and is not loaded",
        f"{BLOCK}(4, 2, traction=(0, 0))",
        1.0,
        lambda: gallery.clamped_block(4, 2, traction=(0.0, 0.0)),
        "degenerate",
    ),
    made(
        "block-smooth",
        "such a block without friction",
        f"{BLOCK}(8, 4)",
        0.0,
        lambda: gallery.clamped_block(8, 4),
    ),
    made(
        "block-half-smooth",
        "a block with friction 0.8 at every other node, and none between",
        "half_smooth_block() in tools/collection_recipes.py",
        None,
        half_smooth_block,
    ),
    made(
        "block-press-fit",
        "a block pressed in by a negative gap, and no load",
        f"{BLOCK}(8, 4, traction=(0, 0), gap=-0.1)",
        0.5,
        lambda: gallery.clamped_block(8, 4, traction=(0.0, 0.0), gap=-0.1),
    ),
)

SPACE = (
    named("node-3d-1", "one contact, a public test of the contact community", "one-node-3d"),
    named("node-3d-3", "one contact that is jammed, slides or is open", "one-node-3d-3"),
    made(
        "node-3d-limit",
        "stick at the limit of friction, without slip",
        "gallery.one_node_3d(identity, (-1, 0.5, 0))",
        0.5,
        lambda: gallery.one_node_3d(IDENTITY, (-1.0, 0.5, 0.0)),
        "degenerate",
    ),
    made(
        "node-3d-grazing",
        "contact without force while the node slides",
        "gallery.one_node_3d(identity, (0, 0.5, 0.25))",
        0.5,
        lambda: gallery.one_node_3d(IDENTITY, (0.0, 0.5, 0.25)),
        "degenerate",
    ),
    drawn(61, 1, 1.5, 3, "one node, full compliance"),
    drawn(3, 3, 1.0, 3, "three nodes, full compliance; two solutions are near each other"),
    named("wedge-3d-2-3", "a wedge in 3D: jammed, sliding out or free", "wedge3d-2-3"),
    named("wedge-3d-4-9", "a wedge in 3D either end of which may come out", "wedge3d-4-9"),
    named("wedge-3d-8-5", "a wedge in 3D that may hang tilted", "wedge3d-8-5"),
    made(
        "wedge-3d-8-9",
        "a coarser mesh of wedge-3d-8-5, with more friction",
        f"{WEDGE_3D}(1, 1, 2, (4e-4, 1e-4, 1e-3), multipliers='nodes')",
        3.0,
        lambda: gallery.wedge3d(1, 1, 2, OBLIQUE_3D, multipliers="nodes"),
    ),
    made(
        "wedge-3d-8-soft",
        "wedge-3d-8-5 on springs 100 times as soft",
        f"{WEDGE_3D}(2, 1, 2, (4e-4, 1e-4, 1e-3), springs=(4e-4, 4e-4, 2e-4), multipliers='nodes')",
        2.0,
        lambda: gallery.wedge3d(2, 1, 2, OBLIQUE_3D, springs=(4e-4, 4e-4, 2e-4), multipliers="nodes"),
        "soft",
    ),
    named("block-3d-9", "a clamped block in 3D, pressed and sheared", "block3d-9"),
    made(
        "block-3d-36",
        "a flat block in 3D on 36 nodes",
        "gallery.block3d(6, 5, 1)",
        0.5,
        lambda: gallery.block3d(6, 5, 1),
        "large",
    ),
    made(
        "box-3d-6-soft",
        "a box on weak springs, pressed onto the floor and sheared",
        "soft_box((2, 1, 2), 0.001) in tools/collection_recipes.py",
        1.0,
        lambda: soft_box((2, 1, 2), 1e-3),
        "soft",
    ),
    made(
        "box-3d-9-soft",
        "a finer mesh of box-3d-6-soft on softer springs",
        "soft_box((2, 2, 2), 0.0001) in tools/collection_recipes.py",
        1.0,
        lambda: soft_box((2, 2, 2), 1e-4),
        "soft",
    ),
)

#: All problems of the collection, in the order of the index.
RECIPES = (*SMALL, *PLANE, *SPACE)
