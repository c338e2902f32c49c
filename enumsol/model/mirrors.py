"""Mirrors: which contact node is the image of which, and what becomes of the tangents (theory, section 6.14)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.model.shapes import body_shape, row_frames
from enumsol.model.statuses import ContactStatus
from enumsol.support.arguments import one_of
from enumsol.support.array_arguments import real_array, short_vector
from enumsol.support.array_types import ArrayLike, Floats, Integers
from enumsol.support.immutable import Sealed, sealed

#: How far a node may be from the image of another, relative to the extent of the contact nodes, and how far normals and
#: tangents: meshes are symmetric within rounding, or not at all.
_NEAR = 1e-6
_TURNED = {ContactStatus.SLIP_PLUS: ContactStatus.SLIP_MINUS, ContactStatus.SLIP_MINUS: ContactStatus.SLIP_PLUS}


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Mirror(Sealed):
    """A reflection of the contact nodes of a problem.

    Parameters
    ----------
    nodes : (p,) array_like of int
        The row number of the mirror image of every contact node; a node in the plane of the mirror is its own image.
    signs : (p,) array_like, in 3D (p, 2)
        +1 where a tangent of a node is taken to that of its image, -1 where it is taken to the opposite direction.

    Raises
    ------
    InvalidArgumentError
        Nodes are not images of one another, or a sign is not +1 or -1, or not the same for a node and its image.

    Examples
    --------
    A wedge in a notch, whose left side (nodes 0 to 3) is the mirror image of its right side; tangents point out of the
    notch on both:

    >>> import enumsol
    >>> enumsol.Mirror([4, 5, 6, 7, 0, 1, 2, 3], [1] * 8)
    Mirror of 8 contact nodes, 0 of them in its plane
    >>> enumsol.Mirror.across(enumsol.gallery.get("wedge-8-3").build(), "x").nodes.tolist()
    [4, 5, 6, 7, 0, 1, 2, 3]
    """

    nodes: Integers
    signs: Floats

    def __init__(self, nodes: ArrayLike, signs: ArrayLike) -> None:
        numbers = real_array(nodes, "nodes", error=InvalidArgumentError)
        p = len(np.atleast_1d(numbers))
        if numbers.shape != (p,) or not np.array_equal(np.sort(numbers), np.arange(p)):
            raise InvalidArgumentError(f"nodes is not a permutation; expected every number from 0 to {p - 1} once")
        rows = numbers.astype(np.int64)
        if not np.array_equal(rows[rows], np.arange(p)):
            k = int(np.flatnonzero(rows[rows] != np.arange(p))[0])
            raise InvalidArgumentError(
                f"nodes takes {k} to {rows[k]} and {rows[k]} to {rows[rows[k]]}; expected it to take {rows[k]} back"
            )
        turns = real_array(signs, "signs", error=InvalidArgumentError)
        if turns.shape not in ((p,), (p, 2)):
            raise InvalidArgumentError(f"signs has shape {turns.shape}; expected (p,) = ({p},), or in 3D ({p}, 2)")
        if np.any(np.abs(turns) != 1):
            raise InvalidArgumentError("signs holds other numbers than +1 and -1; expected these only")
        if np.any(turns[rows] != turns):
            k = int(np.flatnonzero(np.any((turns[rows] != turns).reshape(p, -1), axis=1))[0])
            raise InvalidArgumentError(
                f"signs of node {k} and of its image {rows[k]} differ; expected the same, so that the image of the "
                "image is the node itself"
            )
        self.__dict__.update(nodes=sealed(rows), signs=sealed(turns))

    @classmethod
    def across(cls, problem: Any, normal: Any, point: ArrayLike | None = None) -> Mirror:
        """The mirror that a plane is, or in 2D a line, from the places, normals and tangents of the contact nodes.

        Parameters
        ----------
        problem : ContactProblem or ContactProblem3D
            With a mesh.
        normal : "x", "y", "z" or (d,) array_like
            Direction across which is mirrored.
        point : (d,) array_like, optional
            A point of the plane [length]; default the middle of the extent of the contact nodes.

        Raises
        ------
        InvalidArgumentError
            The problem has no mesh, or a contact node has no mirror image; the message names it.
        """
        if problem.mesh is None:
            raise InvalidArgumentError(
                "the problem has no mesh, which tells normals and tangents; expected one, or a Mirror(nodes, signs)"
            )
        shape = body_shape(problem)
        places = shape.at_rows(shape.points) if problem.coordinates is None else problem.coordinates
        d = places.shape[1]
        axis = _direction(normal, d)
        middle = 0.5 * (np.min(places, axis=0) + np.max(places, axis=0))
        through = middle if point is None else short_vector(point, "point", d)
        reflection = np.eye(d) - 2.0 * np.outer(axis, axis)
        frames = row_frames(problem)
        images = through + (places - through) @ reflection
        size = max(float(np.max(np.ptp(places, axis=0))), float(np.max(np.abs(places - through))))
        return _matched(problem.node_ids, places, images, frames, frames @ reflection, size)

    @property
    def p(self) -> int:
        """Number of contact nodes."""
        return len(self.nodes)

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return 1 + self.signs.reshape(self.p, -1).shape[1]

    @property
    def rows(self) -> tuple[Integers, Floats]:
        """Images of the condensed problem's rows, normals first, and their signs: two arrays (2p,), in 3D (3p,)."""
        tangents = self.signs.reshape(self.p, -1)
        images = np.concatenate([self.nodes + k * self.p for k in range(self.dimension)])
        return images, np.concatenate([np.ones(self.p), tangents.ravel(order="F")])

    def image(self, values: Floats, *, tangential: bool = False) -> Floats:
        """Values of the contact nodes (p, ...) at their images; tangential components change signs."""
        image = np.empty_like(values)
        image[self.nodes] = values * self.signs if tangential else values
        return image

    def statuses(self, held: tuple[frozenset[ContactStatus], ...]) -> tuple[frozenset[ContactStatus], ...]:
        """Statuses that hold at the contact nodes of the mirror image of a solution."""
        image: list[frozenset[ContactStatus]] = [frozenset()] * self.p
        for k, statuses in enumerate(held):
            turned = self.dimension == 2 and self.signs[k] < 0
            image[self.nodes[k]] = frozenset(_TURNED.get(s, s) for s in statuses) if turned else statuses
        return tuple(image)

    def __repr__(self) -> str:
        own = int(np.sum(self.nodes == np.arange(self.p)))
        return f"Mirror of {self.p} contact nodes, {own} of them in its plane"


def _direction(normal: object, d: int) -> Floats:
    if isinstance(normal, str):
        return np.asarray(np.eye(d)["xyz".index(one_of(normal, "normal", tuple("xyz"[:d])))])
    vector = short_vector(normal, "normal", d)
    length = float(np.linalg.norm(vector))
    if not length > 0:
        raise InvalidArgumentError("normal is zero; expected a direction, such as 'x'")
    return np.asarray(vector / length)


def _matched(
    labels: tuple[Any, ...], places: Floats, images: Floats, frames: Floats, turned: Floats, size: float
) -> Mirror:
    """The contact node at the image of each, whose normal is the image's."""
    near = _NEAR * size
    nodes, signs = np.empty(len(places)), np.empty((len(places), places.shape[1] - 1))
    for k, place in enumerate(images):
        away = np.linalg.norm(places - place, axis=1)
        if np.min(away) > near:
            nearest = int(np.argmin(away))
            raise InvalidArgumentError(
                f"contact node {labels[k]} has no mirror image: the contact node nearest to it, {labels[nearest]}, is "
                f"{away[nearest]:.3g} away; expected one within {near:.3g}"
            )
        # cosines between the axes of the image and those of the nodes there
        there = np.flatnonzero(away <= near)
        cosines = np.einsum("ac,jbc->jab", turned[k], frames[there])
        target = np.abs(cosines)
        target[:, 0, 0] = cosines[:, 0, 0]  # normals keep their direction
        fits = np.flatnonzero(np.max(np.abs(target - np.eye(places.shape[1])), axis=(1, 2)) <= _NEAR)
        if len(fits) != 1:
            raise InvalidArgumentError(
                f"normal and tangents of contact node {labels[k]} are not taken to those of one node at its mirror "
                f"image ({', '.join(str(labels[j]) for j in there)}); expected them to be, up to the tangents' signs"
            )
        nodes[k] = there[fits[0]]
        signs[k] = np.sign(np.diagonal(cosines[fits[0]])[1:])
    return Mirror(nodes, signs[:, 0] if places.shape[1] == 2 else signs)
