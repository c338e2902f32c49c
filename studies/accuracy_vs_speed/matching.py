"""Counting what an enumeration missed, invented and found twice, against the exact answer.

Near a degeneracy two exact roots may be as close as the distance to it, so closeness alone says little. The rule:

1. A found and an exact root with the same statuses at every node are the same. (A selection holds at most one isolated
   root, so there is no choice.)
2. Of what is left, pairs are made by their difference in forces, the least first, up to NEAR of the largest force (of
   load and contact). They are the same root with the status of a node misjudged, which near a change of status is no
   loss; they are counted as "renamed".
3. A found root that is left over is a duplicate if it is so near to an exact root (another found root has that one),
   and invented otherwise. An exact root that is left over is missed, however near the next one is.
4. Families are matched with families only, when every corner of either is near a corner of the other. A family found
   in place of two roots is invented, and the roots are missed; and the other way round.

What is missed is covered when a selection that the enumeration lists as undecided holds there. An answer is wrong when
anything is invented, found twice, or missed and not covered. The bounds that come with a root are checked too.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from enumsol import ContactStatus

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from enumsol import Root, RootSet

    Array = NDArray[np.float64]

#: Difference in forces, as a part of the largest one, up to which roots of different statuses may be the same.
NEAR = 1e-2


@dataclass(frozen=True)
class Comparison:
    """What differs from the exact answer, in numbers of roots and families.

    Attributes
    ----------
    uncovered : int
        Missed, and not in a selection listed as undecided.
    outside : int
        Roots found with bounds that do not hold the exact forces.
    error : float
        Largest difference of a force of roots that were matched, as a part of the largest force.
    """

    missed: int = 0
    uncovered: int = 0
    invented: int = 0
    duplicates: int = 0
    renamed: int = 0
    outside: int = 0
    error: float = 0.0

    @property
    def wrong(self) -> bool:
        """Whether the answer is not even right about what it leaves open."""
        return bool(self.uncovered or self.invented or self.duplicates)


def compare(found: RootSet, exact: RootSet, load: Array) -> Comparison:
    """Count by the rule above; ``load`` gives the size of forces where no node is in contact."""
    ours, theirs = [_forces(root) for root in found], [_forces(root) for root in exact]
    families = [_corners(family.vertices) for family in exact.families]
    size = max(float(np.max(np.abs(x), initial=0.0)) for x in (load, *theirs, *families)) or 1.0
    matched = _by_statuses(found, exact)
    renamed = _by_forces(ours, theirs, matched, NEAR * size)
    matched |= renamed
    left = [x for k, x in enumerate(ours) if k not in matched]
    duplicates = sum(any(_far(x, y) <= NEAR * size for y in theirs) for x in left)
    found_families = [_corners(family.vertices) for family in found.families]
    same = _by_corners(found_families, families, NEAR * size)
    missed = [root.active for j, root in enumerate(exact) if j not in matched.values()]
    for k, family in enumerate(exact.families):
        if k not in same:
            # a status that holds on one of its polytopes
            missed.append(tuple(map(frozenset, zip(*(part.statuses for part in family.polytopes), strict=True))))
    return Comparison(
        missed=len(missed),
        uncovered=sum(not any(_covers(item.statuses, active) for item in found.undecided) for active in missed),
        invented=len(left) - duplicates + len(found_families) - len(same),
        duplicates=duplicates,
        renamed=len(renamed),
        outside=sum(not _within(found[i], exact[j]) for i, j in matched.items()),
        error=max((_far(ours[i], theirs[j]) for i, j in matched.items()), default=0.0) / size,
    )


def _covers(undecided, active) -> bool:
    """Whether an undecided part of the selections has a selection that holds."""
    return all(
        status is None or bool(holds - {ContactStatus.OPEN} if status == "contact" else holds & {status})
        for status, holds in zip(undecided, active, strict=True)
    )


def _within(root: Root, exact: Root) -> bool:
    """Whether a root's bounds, where it has any, hold the exact forces (which are rounded once)."""
    if root.enclosure is None:
        return True
    bounds = np.concatenate([root.enclosure.lambda_n, root.enclosure.lambda_t])
    forces = _forces(exact)
    ulp = np.spacing(np.abs(forces))
    return bool(np.all(bounds[:, 0] - ulp <= forces) and np.all(forces <= bounds[:, 1] + ulp))


def _forces(root: Root) -> Array:
    return np.concatenate([root.lambda_n, root.lambda_t])


def _corners(vertices: Array) -> Array:
    return vertices.reshape(len(vertices), -1)


def _far(x: Array, y: Array) -> float:
    return float(np.max(np.abs(x - y)))


def _by_statuses(found: RootSet, exact: RootSet) -> dict[int, int]:
    place = {root.statuses: j for j, root in enumerate(exact)}
    matched: dict[int, int] = {}
    for i, root in enumerate(found):
        j = place.pop(root.statuses, None)
        if j is not None:
            matched[i] = j
    return matched


def _by_forces(ours: Sequence[Array], theirs: Sequence[Array], matched: dict[int, int], near: float) -> dict[int, int]:
    """Pairs of what is not matched yet, the nearest first."""
    free_ours = [i for i in range(len(ours)) if i not in matched]
    free_theirs = [j for j in range(len(theirs)) if j not in matched.values()]
    pairs = sorted((_far(ours[i], theirs[j]), i, j) for i, j in product(free_ours, free_theirs))
    chosen: dict[int, int] = {}
    for distance, i, j in pairs:
        if distance <= near and i not in chosen and j not in chosen.values():
            chosen[i] = j
    return chosen


def _by_corners(ours: Sequence[Array], theirs: Sequence[Array], near: float) -> set[int]:
    """Exact families that agree with a found one, one to one."""
    same: set[int] = set()
    for family in ours:
        for k, other in enumerate(theirs):
            distances = np.max(np.abs(family[:, None] - other[None]), axis=2)
            if k not in same and max(np.max(np.min(distances, axis=0)), np.max(np.min(distances, axis=1))) <= near:
                same.add(k)
                break
    return same
