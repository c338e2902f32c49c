"""Arguments that describe meshes and what acts on their nodes, in two and in three dimensions.

Each function gives the value in a plain type and raises InvalidArgumentError for anything else.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.support.arguments import finite_number, one_of, positive_number, shown
from enumsol.support.array_arguments import plain_array, real_array, short_vector
from enumsol.support.array_types import ArrayLike, Floats, Integers, Mask

#: Coordinates that differ by less than this share of the extent of a mesh are equal: much larger, nodes of a fine mesh
#: would be one.
SAME = 1e-9
#: Largest coordinates of which areas and volumes are computed, by dimension.
LARGEST_COORDINATE = {2: 1e150, 3: 1e100}


def positions(points: ArrayLike, dimension: int) -> Floats:
    """Positions of nodes, (N, dimension), small enough for areas and volumes."""
    nodes = real_array(points, "points", error=InvalidArgumentError)
    if nodes.ndim != 2 or nodes.shape[1] != dimension:
        raise InvalidArgumentError(f"points has shape {nodes.shape}; expected (N, {dimension})")
    size, most = float(np.max(np.abs(nodes), initial=0.0)), LARGEST_COORDINATE[dimension]
    if size > most:
        power = {2: "square", 3: "cube"}[dimension]
        raise InvalidArgumentError(
            f"points has the coordinate {size:g}, whose {power} overflows; expected at most {most:g}"
        )
    return nodes


def elements(value: ArrayLike, name: str, corners: int | tuple[int, ...], count: int) -> Integers:
    """Nodes of each element, (k, corners) with k >= 1, all below ``count``."""
    array = plain_array(value, name, error=InvalidArgumentError)
    numbers = (corners,) if isinstance(corners, int) else corners
    if array.ndim != 2 or array.shape[1] not in numbers or len(array) == 0:
        expected = " or ".join(f"(k, {number})" for number in numbers)
        raise InvalidArgumentError(f"{name} has shape {array.shape}; expected {expected} node numbers, k >= 1")
    return node_numbers(array.ravel(), name, count, distinct=False).reshape(array.shape)


def node_numbers(value: ArrayLike, name: str, count: int, *, distinct: bool = True) -> Integers:
    """Node numbers below ``count``, (k,) with k >= 1."""
    array = plain_array(value, name, error=InvalidArgumentError)
    if array.ndim != 1 or array.size == 0 or array.dtype.kind not in "iu":
        raise InvalidArgumentError(
            f"{name} has shape {array.shape} and type {array.dtype}; expected at least one node number (integers)"
        )
    if np.min(array) < 0 or np.max(array) >= count:
        raise InvalidArgumentError(
            f"{name} has node numbers from {np.min(array)} to {np.max(array)}; expected them in 0 .. {count - 1}"
        )
    if distinct and len(np.unique(array)) != len(array):
        raise InvalidArgumentError(f"{name} names a node twice; expected distinct nodes")
    return array.astype(np.int64)


def cell_name(row: int, labels: Integers | None = None) -> str:
    """Name of a cell in messages: its number in the file, if that is known, or its row."""
    return f"cells row {row}" if labels is None else f"element {labels[row]}"


def check_every_node_is_used(cells: Integers, count: int, name: str, kind: str) -> None:
    """Raise InvalidArgumentError if a node belongs to no cell: it would have no stiffness."""
    used = np.unique(cells)
    if len(used) != count:
        lone = int(np.setdiff1d(np.arange(count), used)[0])
        raise InvalidArgumentError(f"{name} leave node {lone} out; expected every node in some {kind}")


def check_facets(found: Sequence[object], facets: Integers, name: str) -> None:
    """Raise InvalidArgumentError if a facet of the boundary is found twice, or -1 for one that is none."""
    if -1 in found:
        k = found.index(-1)
        raise InvalidArgumentError(
            f"{name} row {k}, nodes {facets[k].tolist()}, is not a facet on the boundary of the body; "
            "expected facets of one cell each"
        )
    if len(set(found)) != len(found):
        raise InvalidArgumentError(f"{name} names a facet twice; expected distinct facets")


def lame_coefficients(value: object, dimension: int) -> tuple[float, float]:
    """Value as the Lame coefficients (l, m) of a body, in plane strain or in 3D, that make its energy positive."""
    lam, mu = (float(entry) for entry in short_vector(value, "lame", 2))
    if not (mu > 0 and dimension * lam + 2 * mu > 0):
        bulk = {2: "l + m", 3: "3 l + 2 m"}[dimension]
        raise InvalidArgumentError(
            f"lame is {shown(value)}; expected Lame coefficients (l, m) with m > 0 and {bulk} > 0"
        )
    return lam, mu


def lame(young: float, poisson: float, plane: Literal["strain", "stress"] = "strain") -> tuple[float, float]:
    """Lame coefficients l, m of a material, as the functions of this package take them [force / length^2].

    Parameters
    ----------
    young : float
        Young's modulus, > 0 [force / length^2].
    poisson : float
        Poisson's ratio, above -1 and below 0.5 [-].
    plane : {"strain", "stress"}
        For plane stress l is the one with which the formulas of plane strain give the stiffness of a thin plate.

    Raises
    ------
    InvalidArgumentError
        An argument is not of the stated form.

    Examples
    --------
    >>> from enumsol import fem
    >>> fem.lame(young=2.5, poisson=0.25)
    (1.0, 1.0)
    """
    E, nu = positive_number(young, "young"), finite_number(poisson, "poisson")
    if not -1 < nu < 0.5:
        raise InvalidArgumentError(f"poisson is {nu:g}; expected Poisson's ratio, above -1 and below 0.5")
    stress = one_of(plane, "plane", ("strain", "stress")) == "stress"
    return E * nu / ((1 + nu) * (1 - (nu if stress else 2 * nu))), E / (2 * (1 + nu))


def held_mask(held: ArrayLike, shape: tuple[int, ...]) -> Mask:
    """Mask (N, dimension) of held components, of node numbers or a mask."""
    array = plain_array(held, "held", error=InvalidArgumentError)
    mask = np.zeros(shape, dtype=bool)
    if array.size == 0:
        return mask
    if array.dtype == bool:
        if array.shape != shape:
            raise InvalidArgumentError(f"held has shape {array.shape}; expected {shape} for a mask of components")
        return array
    mask[node_numbers(array, "held", shape[0], distinct=False)] = True
    return mask


def vectors_of_all(value: object, name: str, shape: tuple[int, ...]) -> Floats:
    """Vectors (k, dimension), one each or one for all."""
    array = real_array(value, name, error=InvalidArgumentError)
    if array.ndim == 1:
        return np.tile(short_vector(value, name, shape[1]), (shape[0], 1))
    if array.shape != shape:
        raise InvalidArgumentError(f"{name} has shape {array.shape}; expected ({shape[1]},) or {shape}")
    return array


def unit_vectors(vectors: Floats, name: str) -> Floats:
    """Vectors (k, dimension) scaled to length one."""
    lengths = np.linalg.norm(vectors, axis=1)
    if np.any(lengths == 0):
        raise InvalidArgumentError(f"{name} row {int(np.argmin(lengths))} is zero; expected directions")
    return np.asarray(vectors / lengths[:, None])


def spring_stiffnesses(springs: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """Stiffnesses of springs to the ground, (N, dimension)."""
    values = vectors_of_all(springs, "springs", shape)
    if np.min(values) < 0:
        raise InvalidArgumentError(f"springs has the value {np.min(values):g}; expected stiffnesses >= 0")
    return values


def nodal_vectors(forces: ArrayLike | None, name: str, shape: tuple[int, ...]) -> Floats:
    """Forces on all nodes in the order of degrees of freedom, (dimension N,); zero for None."""
    if forces is None:
        return np.zeros(shape[0] * shape[1])
    array = real_array(forces, name, error=InvalidArgumentError)
    if array.shape != shape:
        raise InvalidArgumentError(f"{name} has shape {array.shape}; expected {shape}, a force for every node")
    return array.ravel()
