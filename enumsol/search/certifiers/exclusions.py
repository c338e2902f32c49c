"""Exclusions of assignments in balls, as records of a proof (theory, sections 6.2 and 14.4)."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from enumsol.proof.leaves import Excluded, NoRoot, Unbalanced
from enumsol.proof.proof_file import coarse
from enumsol.proof.records import DeclaredForm
from enumsol.search.certifiers.protocol import energy_margin
from enumsol.search.reference_closer import reference_numbers
from enumsol.trusted.at_alpha import settled_selection
from enumsol.trusted.exclusion import Terms
from enumsol.trusted.floating_bounds import motion_against, without_bound
from enumsol.trusted.reference import PlaneReference
from enumsol.trusted.selection import PENETRATION, SLIP_BACKWARD, SLIP_FORWARD
from enumsol.trusted.status_rows import CONDITIONS, FORBIDDEN, FREE, row_signs

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.proof.leaves import OnlyReference
    from enumsol.search.certifiers.protocol import Bound, Margin
    from enumsol.support.array_types import Codes, Floats, Indices

    #: A record of a leaf without a root, and whether it needs the bound of the rigid displacement.
    Nothing = tuple[Excluded | Unbalanced | NoRoot, bool]

#: Rounding the multipliers hardly lowers bounds above this: for a wedge, 10 of 28,196 bounds are halved.
_CLEAR = 1e-6


def in_balance(system: EnclosedSystem, codes: Codes, rows: Indices, values: Floats) -> tuple[Indices, Floats]:
    """Multipliers next to given ones with G y = h, up to rounding, or these where there are none.

    Those of the body on weak springs satisfy this up to the springs only, times the rigid displacement.
    """
    p, G, h = system.p, system.rows.G.mid, system.rows.h.mid
    signs = row_signs(np.array(codes), system.F)
    normal, forward, backward = (signs[:, kind] for kind in (PENETRATION, SLIP_FORWARD, SLIP_BACKWARD))
    low = np.concatenate([normal == FREE, forward != FORBIDDEN])
    high = np.concatenate([normal != FORBIDDEN, backward != FORBIDDEN])
    table = np.bincount(rows, values, minlength=signs.size).reshape(-1, p)
    y = np.concatenate([table[PENETRATION], table[SLIP_BACKWARD] - table[SLIP_FORWARD]])
    size = np.abs(y)
    # multipliers that are zero change only where the others cannot do it
    weight = np.where(low | high, size + 2.0**-20 * np.max(size), 0.0)
    # multipliers that would change their sign are set to zero, and what is left is balanced again
    for _ in range(8):
        step = np.linalg.lstsq((G * weight) @ G.T, h - G @ y, rcond=1e-13)[0]
        y = y + weight * (step @ G)
        wrong = np.where(y < 0, ~low, ~high) & (y != 0)
        if not np.any(wrong):
            break
        y, weight = np.where(wrong, 0.0, y), np.where(wrong, 0.0, weight)
    else:
        return rows, values
    forces = rows < PENETRATION * p
    kind = np.repeat([PENETRATION, SLIP_BACKWARD], p)
    kind[p:][y[p:] < 0] = SLIP_FORWARD
    given, of = np.flatnonzero(y), np.tile(np.arange(p), 2)
    sizes = np.where(kind == PENETRATION, y, np.abs(y))
    return np.concatenate([rows[forces], kind[given] * p + of[given]]), np.concatenate([values[forces], sizes[given]])


def proven(margin: Margin, codes: Codes, rows: Indices, values: Floats) -> Floats | None:
    """Multipliers that exclude a partial assignment, rounded if these do it as well; None if those given do not."""
    short = coarse(values)
    if margin(codes, rows, short) > _CLEAR:
        return short
    return values if margin(codes, rows, values) > 0 else None


class Exclusions:
    """Exclusions of assignments; of a body that nothing holds if possible without a bound of its rigid displacement.

    Parameters
    ----------
    enclosed : EnclosedSystem
    rests_on_reach : of a complete selection without a solution, whether it may have one beyond the bound
    within : whether exclusions may use the bound from the beginning

    Attributes
    ----------
    system, free : EnclosedSystem
        With its bound, and with one beyond which there are no solutions; the same of a body that is held.
    """

    def __init__(
        self,
        enclosed: EnclosedSystem,
        rests_on_reach: Callable[[Codes], bool] = lambda _: False,
        *,
        within: bool = False,
    ) -> None:
        self.rests_on_reach, self._within = rests_on_reach, within
        self.system, self.free = enclosed, enclosed if enclosed.held else without_bound(enclosed)
        self._references: dict[Codes, PlaneReference | None] = {}
        #: How the forms of roots are declared, by their selections.
        self.declared: dict[Codes, DeclaredForm] = {}

    @cached_property
    def _margins(self) -> tuple[Margin, Margin]:
        return energy_margin(self.free), energy_margin(self.system)

    def record(self, codes: Codes, bound: Bound, *, within: bool) -> Nothing | None:
        """A record that excludes a partial assignment, and whether it needs the bound; or None.

        Whether the bound is needed must not depend on the numbers that a relaxation arrives at. So an assignment that
        only the bound excludes is split, down to complete selections, unless ``within``: the bound is known to be
        needed (theory, section 14.4).
        """
        given, tried = Terms(*bound.multipliers()), list[Terms]()
        # as given first: those of an earlier proof stay as they are, and many need no other ones
        found = self._excluded(0, codes, [given]) if self.system.held or len(given.rows) else None
        if self.system.held:
            return None if found is None else (found, False)
        if found is None and len(given.rows):
            tried = [given, Terms(*in_balance(self.system, codes, *given))]
        if (found := found or self._excluded(0, codes, tried[1:])) is not None:
            return found, False
        if (unbalanced := self.unbalanced(codes)) is not None:
            return unbalanced, False
        found, within = self._excluded(1, codes, tried), within or self._within
        if found is None or not (within or (all(code in CONDITIONS for code in codes) and self.rests_on_reach(codes))):
            return None
        return found, True

    def _excluded(self, margin: int, codes: Codes, tried: list[Terms]) -> Excluded | None:
        """The first multipliers that prove something, with bounds beyond which there are no solutions, or its own."""
        kept = ((terms, proven(self._margins[margin], codes, *terms)) for terms in tried)
        return next((Excluded(terms.rows, values) for terms, values in kept if values is not None), None)

    def no_root(self, codes: Codes, *, none: bool, within: bool) -> Nothing | None:
        """A record that a complete selection holds no root, which holds ``none`` within the bound; as of ``record``."""
        if not self.system.held:
            if settled_selection(self.free, codes) is None:
                return NoRoot(), False
            if not (none and (within or self.rests_on_reach(codes))):
                return None
        return (NoRoot(), not self.system.held) if none else None

    def reference(self, selection: Codes) -> PlaneReference | None:
        """The form of a root, if one is proven definite."""
        if selection not in self._references:
            self._references[selection] = None
            for weights, *more in reference_numbers(self.system, selection):
                found = PlaneReference.of(self.system, selection, weights, *more)
                if found is not None:
                    self.declared[selection] = DeclaredForm(selection, weights, np.array(more))
                    self._references[selection] = found
                    break
        return self._references[selection]

    def only_root(
        self, codes: Codes, reference: PlaneReference, proposal: OnlyReference, *, within: bool
    ) -> bool | None:
        """True if the bound is needed for no other root to lie below an assignment; None if that is not proven."""
        for system in (self.free, self.system)[: 2 if within else 1]:
            if proposal.holds(reference, codes, system.reach):
                return system is self.system
        return None

    def unbalanced(self, codes: Codes) -> Unbalanced | None:
        """A record that no forces below a partial assignment are in balance with the load; or None."""
        if self.system.held:
            return None
        record = Unbalanced(motion_against(self.system, codes))
        return record if record.holds(self.system, codes) else None
