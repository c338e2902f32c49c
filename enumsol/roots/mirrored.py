"""Which roots of a symmetric problem are mirror images of one another (theory, section 6.14)."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import SAFE, UNIT
from enumsol.condensation.data import exactly_at
from enumsol.condensation.enclosure import NotEnclosedError
from enumsol.errors import InvalidArgumentError
from enumsol.model.mirrors import Mirror
from enumsol.support.arguments import instance_of
from enumsol.support.immutable import Sealed
from enumsol.support.messages import counted, visible

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.model.problem3d import AnyProblem
    from enumsol.model.statuses import ContactStatus
    from enumsol.roots.root import Root
    from enumsol.support.array_types import Alpha, Floats


#: By how much S, g and F may change under a mirror, relative to their size. Meshes and stiffness matrices are symmetric
#: within rounding, which weak springs of a body make larger, or not at all.
SYMMETRIC = 1e-6
#: By how much a root and the image of its partner may differ: so many times as much as the data, or by rounding of
#: fast arithmetic.
_AMPLIFIED, _ROUNDING = 1e3, 1e-9


@dataclass(frozen=True)
class Asymmetry(Sealed):
    """How far a problem is from its own mirror image.

    Attributes
    ----------
    bound : float
        By how much S, g and F change at most, relative to their size: S and g in units in which a row or its image
        has compliance one, g then relative to its largest entry [-].
    proven : bool
        It is a bound for the data as given; otherwise it is one for S and g as computed.
    differs : bool
        The data are proven not to be exactly symmetric.
    """

    bound: float
    proven: bool
    differs: bool


@dataclass(frozen=True)
class MirrorImages(Sealed):
    """The mirror images of roots among these.

    Attributes
    ----------
    images : tuple of int or None
        The number of the root that is the mirror image of each: its own for a symmetric one, None where there is none.
    ambiguous : tuple of int
        Roots that have none because several roots are too close together to be told apart.
    asymmetry : Asymmetry
        Of the problem.
    difference : float
        By how much a root and the image of its partner differ at most, beyond their enclosures, relative to the largest
        force and the largest displacement at contact nodes [-]; 0 if all enclosures meet.

    Examples
    --------
    >>> import enumsol
    >>> roots = enumsol.enumerate_roots(enumsol.gallery.get("wedge-8-3").build(), 1)
    >>> roots.mirrored("x").mirror_images.images
    (0, 1, 2)
    """

    images: tuple[int | None, ...]
    ambiguous: tuple[int, ...]
    asymmetry: Asymmetry
    difference: float
    mirror: Mirror = field(repr=False, compare=False)

    @property
    def missing(self) -> tuple[int, ...]:
        """Roots without a mirror image."""
        return tuple(k for k, image in enumerate(self.images) if image is None and k not in self.ambiguous)

    def words(self, k: int) -> str:
        """Text about a root."""
        image = self.images[k]
        if image is None:
            return "mirror image not told apart" if k in self.ambiguous else "no mirror image"
        return "its own mirror image" if image == k else f"mirror image of root {image}"

    def notes(self, *, complete: bool) -> list[str]:
        """Lines below the table of roots."""
        pairs = sum(image is not None and image > k for k, image in enumerate(self.images))
        own = sum(image == k for k, image in enumerate(self.images))
        data = "not exactly symmetric, but" if self.asymmetry.differs else "symmetric"
        how = "proven" if self.asymmetry.proven else "as computed"
        lines = [
            f"mirror: {counted(pairs, 'pair')}, {counted(own, 'symmetric root')}; the data are {data} within "
            f"{self.asymmetry.bound:.1e} ({how})"
        ]
        if self.missing:
            which = ", ".join(map(str, self.missing))
            why = "if the data are symmetric, these are still to be found"
            if complete:
                why = "a complete result of exactly symmetric data cannot have this, one of nearly symmetric data may"
            lines.append(f"mirror: roots without a mirror image: {which} ({why})")
        return lines


def problem_asymmetry(problem: AnyProblem, alpha: Alpha, mirror: Mirror, tolerance: float) -> Asymmetry:
    """Distance of the condensed problem from its mirror image.

    Raises
    ------
    InvalidArgumentError
        It is further than the tolerance, or the mirror is one of other contact nodes.
    """
    instance_of(mirror, Mirror, "mirror")
    dimension = 2 if hasattr(problem, "Bt") else 3
    if (mirror.p, mirror.dimension) != (problem.p, dimension):
        raise InvalidArgumentError(
            f"mirror is one of {counted(mirror.p, 'contact node')} in {mirror.dimension}D; expected one of "
            f"{problem.p} in {dimension}D"
        )
    S, S_rad, g, g_rad, proven = _condensed(problem, alpha)
    rows, signs = mirror.rows
    # the same for a row and its image, so that it hides no difference between them
    unit = 1.0 / np.sqrt(np.maximum(np.diagonal(S), np.diagonal(S)[rows]))
    S, S_rad, g, g_rad = (S * unit[:, None] * unit, S_rad * unit[:, None] * unit, g * unit, g_rad * unit)
    load = max(float(np.max(np.abs(g))), np.finfo(np.float64).tiny)
    own = _relative_friction(problem, alpha, mirror)
    changes = (
        ("the compliance", S - np.outer(signs, signs) * S[np.ix_(rows, rows)], S_rad + S_rad[np.ix_(rows, rows)]),
        ("the free displacement", (g - signs * g[rows]) / load, (g_rad + g_rad[rows]) / load),
        ("the friction", own, np.zeros(len(own))),
    )
    bound, differs = 0.0, False
    for name, middle, radius in changes:
        # roundings of units, of the products and of the difference
        most = (np.abs(middle) + radius) * SAFE + 16 * UNIT * np.any(radius)
        worst = float(np.max(most))
        if not worst <= tolerance:
            where = np.unravel_index(int(np.argmax(most)), most.shape)
            nodes = " and ".join(dict.fromkeys(visible(problem.node_ids[int(k) % problem.p]) for k in where))
            changes_by = (
                "changes by" if np.abs(middle[where]) > tolerance else "is known too coarsely, and may change by"
            )
            raise InvalidArgumentError(
                f"the problem is not its own mirror image: at contact node {nodes} {name} {changes_by} {worst:.2g} "
                f"of its size; expected at most {tolerance:g}"
            )
        bound = max(bound, worst)
        differs |= proven and bool(np.any(np.abs(middle) > (radius + 16 * UNIT * (radius > 0)) * SAFE))
    return Asymmetry(bound, proven, differs)


def _condensed(problem: AnyProblem, alpha: Alpha) -> tuple[Floats, Floats, Floats, Floats, bool]:
    """S and g at alpha with radii, and whether these are proven."""
    try:
        ones = np.ones(len(problem.condensed.g0))
        return *problem.enclosure.in_units(Fraction(alpha), ones, ones), True
    except NotEnclosedError:
        S, g = problem.condensed.S, problem.condensed.free_displacements(alpha)
        return S, np.zeros_like(S), g, np.zeros_like(g), False


def _relative_friction(problem: AnyProblem, alpha: Alpha, mirror: Mirror) -> Floats:
    """By how much the coefficients of friction change, relative to the largest, (p,); exact but for a rounding."""
    changes = np.zeros(problem.p)
    for pair in zip(*(np.atleast_2d(part.T) for part in problem.affine_friction), strict=True):
        F = exactly_at(Fraction(alpha), *pair)
        most = max(*F, Fraction(1, 10**300))
        changes = np.maximum(changes, [float(abs(F[k] - F[image]) / most) for k, image in enumerate(mirror.nodes)])
    return np.asarray(changes)


def paired_roots(roots: Sequence[Root], mirror: Mirror, asymmetry: Asymmetry) -> MirrorImages:
    """Which of the roots are mirror images, by their enclosures, statuses and indices."""
    boxes = [_box(root, None) for root in roots]
    low, high = (np.array([box[k] for box in boxes]) for k in range(2))
    scale = _scale(roots, low.shape[1] // 2)
    slack = max(_AMPLIFIED * asymmetry.bound, _ROUNDING)
    near: list[dict[int, float]] = []
    for root in roots:
        below, above = _box(root, mirror)
        apart = np.max(np.maximum(np.maximum(low - above, below - high), 0.0) / scale, axis=1)
        held = mirror.statuses(root.active)
        close = np.flatnonzero(apart <= slack).tolist()
        near.append({j: float(apart[j]) for j in close if _alike(root, held, roots[j])})
    images: list[int | None] = []
    ambiguous = []
    for k, found in enumerate(near):
        only = next(iter(found)) if len(found) == 1 else None
        images.append(only if only is not None and list(near[only]) == [k] else None)
        if found and images[-1] is None:
            ambiguous.append(k)
    difference = max((near[k][j] for k, j in enumerate(images) if j is not None), default=0.0)
    return MirrorImages(tuple(images), tuple(ambiguous), asymmetry, difference, mirror)


def _scale(roots: Sequence[Root], forces: int) -> Floats:
    """The largest force and the largest displacement at contact nodes of all roots, for every entry of a box."""
    largest = [
        max(float(np.max(np.abs(getattr(root, name)))) for root in roots for name in names)
        for names in (("lambda_n", "lambda_t"), ("u_n", "u_t"))
    ]
    return np.repeat([max(value, 1e-300) for value in largest], forces)


def _alike(root: Root, image: Sequence[frozenset[ContactStatus]], other: Root) -> bool:
    """True if statuses and index of a root may be those of the mirror image of another."""
    indices = {root.index, other.index} - {None}
    return len(indices) < 2 and all(a & b for a, b in zip(image, other.active, strict=True))


def _box(root: Root, mirror: Mirror | None) -> tuple[Floats, Floats]:
    """Bounds of forces and displacements at the contact nodes, of the root or of its mirror image."""
    below, above = [], []
    for name in ("lambda_n", "lambda_t", "u_n", "u_t"):
        values = getattr(root, name)
        bounds = np.stack([values, values], axis=-1) if root.enclosure is None else getattr(root.enclosure, name)
        ends = [bounds[..., 0], bounds[..., 1]]
        if mirror is not None:
            ends = [mirror.image(end, tangential=name.endswith("_t")) for end in ends]
        below.append(np.minimum(*ends).ravel())
        above.append(np.maximum(*ends).ravel())
    return np.concatenate(below), np.concatenate(above)
