"""Quadratic forms in 3D that bound more tightly than the energy, and the ascent that finds them (theory, section 12.2).

As in 2D (``convex_forms``), Newton's method maximises the bound of a form together with the log of its determinant; the
barrier of the vectors c, which may be no longer than kappa, is the log of kappa^2 - |c|^2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import factor_above
from enumsol.relaxation.convex_forms import FormProducts, newton_step
from enumsol.support.deadlines import look
from enumsol.trusted.space.sector_rows import sector_row_terms
from enumsol.trusted.space.slip_forms import SlipForm

if TYPE_CHECKING:
    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.relaxation.space_relaxation import SpaceEngine, SpaceRelaxation
    from enumsol.support.array_types import Floats

    Rows = tuple[list[int], list[int]]

#: Weights of the bound and of the barrier beside that of the determinant.
_BOUND, _BARRIER = 0.125, 0.05
#: Steps of the ascent, and what two of them have to gain together.
_STEPS, _GAIN = 16, 0.1
#: Lengths are shortened by this until the form is convex, then once more; then halved, so many times at most.
_SHORTER, _INSIDE, _TRIALS, _SHORTEST = 0.7, 0.85, 8, 1e-3
#: Vectors c are shorter than kappa by this.
_WITHIN = 1.0 - 1e-9


@dataclass(frozen=True)
class _Candidate:
    """Multipliers at which the bound is known."""

    numbers: Floats
    form: SlipForm
    factor: Floats
    relaxation: SpaceRelaxation


class SpaceFormAscent:
    """Finds a form at the root of the search.

    Parameters
    ----------
    engine : SpaceEngine
        That of the energy, whose rows serve the forms as well.
    enclosed : EnclosedSpace
        Balls for its system.
    """

    def __init__(self, engine: SpaceEngine, enclosed: EnclosedSpace) -> None:
        self._engine, self._enclosed, self._system = engine, enclosed, engine.system
        system, p, size = self._system, self._system.p, len(self._system.g)
        node, axis = np.nonzero(system.tau >= 0)
        tau = system.tau[node, axis]
        #: Products of a force and a slip, in the order of mu, kappa and c: their factors' places, and multipliers.
        self._left, self._right = np.concatenate([np.arange(p), tau, node]), np.concatenate([np.arange(p), tau, tau])
        number = np.concatenate([np.arange(p), p + node, p + tau])
        #: Multipliers that have a product, and what a product gets of each of them.
        self._live = np.unique(number)
        value = np.concatenate([np.ones(size), -1.0 / system.unit[tau]])
        self._shares = np.where(self._live[:, None] == number, value, 0.0)
        #: Places of kappa and c of the nodes with friction; a c that does not occur has the last place, a zero.
        rubs = np.flatnonzero(np.any(system.tau >= 0, axis=1))
        self._cones = np.column_stack([p + rubs, np.where(system.tau[rubs] >= 0, p + system.tau[rubs], size + p)])
        self._products = FormProducts(system.S, system.g, lambda rows: rows[self._left], lambda rows: rows[self._right])

    def ascended(self, rows: Rows) -> tuple[SlipForm, SpaceRelaxation] | None:
        """The tightest form that was found, with the mean curvature of the energy, and its relaxation; or None."""
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            p, size = self._system.p, len(self._system.g)
            found = self._candidate(np.concatenate([np.ones(2 * p), np.zeros(size - p)]), rows)
            gaps: list[float] = []
            while found is not None and not found.relaxation.pruned and len(gaps) < _STEPS:
                look()
                gaps.append(-found.relaxation.bound / self._curvature(found.numbers))
                if len(gaps) > 2 and gaps[-1] > (1.0 - _GAIN) * gaps[-3]:
                    break
                better = self._step(found, rows)
                if better is None:
                    break
                found = better
            if found is None or not gaps:
                return None
            found = self._candidate(found.numbers / self._curvature(found.numbers), rows)
        return None if found is None else (found.form, found.relaxation)

    def _curvature(self, numbers: Floats) -> float:
        """The mean eigenvalue of H relative to S: c has no part in it."""
        return float(np.sum(self._shares[:, : len(self._system.g)].T @ numbers[self._live])) / len(self._system.g)

    def _lengths(self, numbers: Floats) -> tuple[Floats, Floats]:
        """kappa and c of the nodes with friction."""
        cones = np.append(numbers, 0.0)[self._cones]
        return cones[:, 0], cones[:, 1:]

    def _form(self, numbers: Floats) -> SlipForm | None:
        """Their form, if they are allowed."""
        kappa, c = self._lengths(numbers)
        if not np.all(np.linalg.norm(c, axis=1) <= _WITHIN * kappa):
            return None
        return SlipForm.of(self._enclosed, numbers)

    def _candidate(self, numbers: Floats, rows: Rows) -> _Candidate | None:
        """The relaxation with these multipliers; None where their form is not convex."""
        form = self._form(numbers)
        factor = None if form is None else factor_above(form.H)
        if form is None or factor is None:
            return None
        relaxation = self._engine.bounding(form).root(*rows)
        return None if relaxation.stalled else _Candidate(numbers, form, factor, relaxation)

    def _step(self, found: _Candidate, rows: Rows) -> _Candidate | None:
        """One step of Newton's method."""
        scale = _BOUND * len(found.form.h) / max(-found.relaxation.bound, 1e-300)
        step = self._direction(found, scale)
        if step is None:
            return None

        def moved(length: float) -> Floats:
            numbers = found.numbers.copy()
            numbers[self._live] += length * step
            return numbers

        def merit(candidate: _Candidate) -> float:
            kappa, c = self._lengths(candidate.numbers)
            barrier = float(np.sum(np.log(kappa * kappa - np.sum(c * c, axis=1))))
            determinant = 2.0 * float(np.sum(np.log(np.diagonal(candidate.factor))))
            return scale * candidate.relaxation.bound + determinant + _BARRIER * barrier

        length = 1.0
        while (form := self._form(moved(length))) is None or factor_above(form.H) is None:
            length *= _SHORTER
            if length < _SHORTEST:
                return None
        length *= _INSIDE if length < 1.0 else 1.0
        for _ in range(_TRIALS):
            look()
            trial = self._candidate(moved(length), rows)
            if trial is not None and (trial.relaxation.pruned or merit(trial) > merit(found)):
                return trial
            length *= 0.5
        return None

    def _direction(self, found: _Candidate, scale: float) -> Floats | None:
        """Newton's step; None where it fails."""
        numbers, relaxation = found.numbers, found.relaxation
        whole, normals = np.eye(len(found.form.h)), self._normals(relaxation)
        gradient, hessian = self._products.derivatives(
            found.form.H, found.factor, relaxation.forces, scale, normals, whole
        )
        slope, curved = np.zeros(len(numbers) + 1), np.zeros((len(numbers) + 1,) * 2)
        slope[self._live] = self._shares @ gradient
        curved[np.ix_(self._live, self._live)] = self._shares @ hessian @ self._shares.T
        for cone in self._cones:
            signed = np.append(numbers, 0.0)[cone] * np.array([1.0, -1.0, -1.0])
            square = float(signed[0] ** 2 - signed[1] ** 2 - signed[2] ** 2)
            own = 2.0 * signed / square
            slope[cone] += _BARRIER * own
            curved[np.ix_(cone, cone)] += _BARRIER * (np.outer(own, own) - 2.0 * np.diag([1.0, -1.0, -1.0]) / square)
        return newton_step(slope[self._live], curved[np.ix_(self._live, self._live)])

    def _normals(self, relaxation: SpaceRelaxation) -> Floats:
        """Normals of the rows that have multipliers, of length one."""
        system, size = self._system, len(self._system.g)
        numbers = relaxation.multipliers()[0].tolist()
        terms = np.zeros((len(numbers), 2 * size))
        for term, number in zip(terms, numbers, strict=True):
            places, coefficients = sector_row_terms(self._engine.rows[number], system.tau, size)
            term[list(places)] = np.array(coefficients) * system.row_unit[list(places)]
        normals = terms[:, :size] - terms[:, size:] @ system.S
        return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))
