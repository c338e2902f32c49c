"""In 3D: boxes that hold one solution, for leaves that are left open near it (theory, section 12.7)."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from enumsol.search.space.space_fathoming import NEAR, Point
from enumsol.search.space.space_newton import Isotropic
from enumsol.trusted.space.boxed_solution import BoxedSolution, box_around, is_inside, solution_in_box
from enumsol.trusted.space.leaves import Open, settle

if TYPE_CHECKING:
    from enumsol.condensation.space_condensed import EnclosedSpace, SpaceSystem
    from enumsol.support.array_types import Floats


#: What a writer of proofs asks for (see ``solution_in_box``).
_ERRORS = 2.0


class KnownBoxes:
    """Looks for the solution near a leaf that is left open, and for a box in which it is the only one.

    A leaf that would be halved otherwise is worth a look now and then: less and less often where that is in vain.

    Parameters
    ----------
    system : SpaceSystem
    enclosed : EnclosedSpace
    """

    def __init__(self, system: SpaceSystem, enclosed: EnclosedSpace) -> None:
        self._system, self._enclosed = system, enclosed
        self._found: list[BoxedSolution] = []
        self._passed: list[Floats] = []
        self._wait = self._pause = 0

    @cached_property
    def _problem(self) -> Isotropic:
        return Isotropic.of(self._system)

    def holding(self, leaf: Open, *, halved: bool) -> BoxedSolution | None:
        """The one solution that an open leaf can have, which is ``halved`` otherwise, if that is proven."""
        y, w = leaf.y, leaf.w
        if y is None or w is None:
            return None
        for known in self._found:
            if is_inside(y, w, known.box, _ERRORS):
                return known
        if halved:
            # forces known no better than this, relative to the largest, tell no solution near which to look
            if not np.max(y.rad) <= 0.1 * np.max(np.abs(y.mid) + y.rad):
                return None
            if self._wait > 0:
                self._wait -= 1
                return None
        found = self._sought(y.mid, halved=halved)
        self._pause = 2 * self._pause + 1 if found is None else 0
        self._wait = self._pause
        return found if found is not None and is_inside(y, w, found.box, _ERRORS) else None

    def _sought(self, y: Floats, *, halved: bool) -> BoxedSolution | None:
        """A new solution near a point, in a box of its own; near a leaf to be ``halved``, one that no leaf settles."""
        with np.errstate(all="ignore"):
            near = self._problem.near(y, self._system)
            if near is None:
                return None
            # nearer ones are the same solution
            size = 1e-6 * float(np.max(np.abs(near)))
            if any(np.max(np.abs(near - other)) <= size for other in self._passed):
                return None
            point = Point.of(self._system, self._problem, self._problem.by_node(near, self._system))
            self._passed.append(near)
            # a regular root is settled by a leaf that is narrow enough, unless rounding hides it
            if halved and point.slack > NEAR and not isinstance(settle(self._enclosed, point.codes), Open):
                return None
            box = box_around(self._enclosed, near)
        found = None if box is None else solution_in_box(self._enclosed, box, _ERRORS)
        if found is not None:
            self._found.append(found)
        return found
