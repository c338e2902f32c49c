"""Test that a strict root of a body that nothing holds is the only one below an assignment (theory, section 14.11)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from enumsol.arithmetic.balls import Ball
from enumsol.trusted.at_alpha import VerifiedSelection, solve_selection
from enumsol.trusted.selection import PENETRATION, SLIP_BACKWARD, SLIP_FORWARD, Unknowns
from enumsol.trusted.status_rows import FREE, NONNEGATIVE, OPEN, final_codes, refines, row_signs
from enumsol.trusted.uniqueness import Components, Weights
from enumsol.trusted.uniqueness_forms import RootForm, RootReference

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.support.array_types import Codes, Floats

#: Rows on displacements, and their signs in w.
_SIGNS = {PENETRATION: -1.0, SLIP_FORWARD: 1.0, SLIP_BACKWARD: -1.0}
_OPPOSITE = {SLIP_FORWARD: SLIP_BACKWARD, SLIP_BACKWARD: SLIP_FORWARD}


@dataclass(frozen=True)
class PlaneReference(RootReference[int]):
    """Rows at the roots that a selection has in 2D, and their form, at one alpha or along an arc.

    Attributes
    ----------
    at : Unknowns
        Which components d has: lambda_n of all nodes, lambda_t of those with friction.
    root : VerifiedSelection or None
        At one alpha the only root that the selection has, which is strict.
    """

    at: Unknowns
    root: VerifiedSelection | None = None

    @classmethod
    def of(cls, system: EnclosedSystem, selection: Codes, weights: Floats, balance: float, share: float) -> Self | None:
        """At one alpha; None where the selection holds no strict root, or its form is not definite for G d = 0.

        Parameters
        ----------
        system : EnclosedSystem
        selection : final codes
        weights : mu of all nodes, then kappa, nu and theta / F of those with friction
        balance : factor of |G d|^2
        share : c of theory, (14.14)
        """
        friction = system.F > 0
        if any(code not in final_codes(bool(F)) for code, F in zip(selection, friction, strict=True)):
            return None
        if not (0 <= balance < np.inf and abs(share) < np.inf):
            return None
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            root = solve_selection(system, selection)
            if root is None or not root.is_root:
                return None
            at = Unknowns(system.p, np.arange(system.p), friction, np.zeros(system.p, dtype=np.intp))
            S, G = Ball(system.S, system.S_rad)[np.ix_(at.places, at.places)], system.rows.G[:, at.places]
            part = Components(system, tuple(selection), at, S)
            numbers = Weights.of(part, np.concatenate([weights, np.zeros(len(at.normal))]))
            if numbers is None:
                return None
            x, w = root.force[at.places], root.w[at.places]
            numbers = numbers.beside(x, at.tangential[at.normal])
            loaded = x, np.array(selection) != OPEN
            form = RootForm.of(S, G, numbers.multipliers(at), numbers.distances(at, x, w), loaded, balance, share)
            return None if form is None else cls(system, tuple(selection), form, at, root)

    def allow(self, codes: Sequence[int], rows: Sequence[int], tight: Sequence[int]) -> bool:
        """True if the first rows are equations, and the others nonnegative but not positive at the root."""
        p, F = self.system.p, self.system.F
        signs, own = (row_signs(np.array(given), F) for given in (codes, self.selection))
        for row in (*rows, *tight):
            kind, node = divmod(row, p)
            if kind not in _SIGNS or (kind != PENETRATION and not F[node] > 0):
                return False
        for kind, node in (divmod(row, p) for row in rows):
            if not signs[node, kind] == own[node, kind] == FREE:
                return False
        for kind, node in (divmod(row, p) for row in tight):
            opposed = kind in _OPPOSITE and own[node, _OPPOSITE[kind]] == NONNEGATIVE
            if signs[node, kind] < NONNEGATIVE or not (own[node, kind] == FREE or opposed):
                return False
        return True

    def rows(self, rows: Sequence[int]) -> Ball:
        """Rows as coefficients of the components of w that d has."""
        found = np.zeros((len(rows), len(self.at.places)))
        for k, row in enumerate(rows):
            kind, node = divmod(row, self.system.p)
            found[k, node if kind == PENETRATION else self.at.tangential[node]] = _SIGNS[kind]
        return Ball.exact(found)

    def lies_below(self, codes: Sequence[int]) -> bool:
        """True if the root has the statuses of an assignment."""
        return all(refines(own, code) for own, code in zip(self.selection, codes, strict=True))
