"""Quadratic forms other than the energy that bound more tightly, and the ascent that finds them (theory, section 5.8).

The bound of a form over a partial assignment is concave in its multipliers, which may be what they like as long as the
form is convex on the subspace of the assignment's equations. Newton's method maximises it together with barriers: the
log of the determinant of the form there, and the logs of the multipliers that have a sign. It moves those logs: a step
that moves the multipliers themselves is cut where the first of them vanishes. All terms are of rank two, so that
gradients and second derivatives need products of matrices of size 2p only.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cho_factor, cho_solve, qr, solve_triangular

from enumsol.arithmetic.balls import factor_above
from enumsol.relaxation.active_set import ActiveSetEngine, ActiveSetRelaxation, FormEngine
from enumsol.relaxation.imposed_rows import row_normals
from enumsol.support.deadlines import look
from enumsol.trusted.quadratic_forms import EnclosedForm, Equations
from enumsol.trusted.status_rows import CONTACT, UNDECIDED

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.support.array_types import Codes, Floats, Indices

    Rows = tuple[list[int], list[int]]

#: Weights of the bound and of the logs of multipliers beside that of the determinant, for every unknown.
_BOUND, _LOGS = 0.125, 0.05
#: Multipliers with a sign are kept above this share of the largest.
_LEAST = 1e-4
#: A step ends the ascent when it promises less than this.
_ENOUGH = 1.0
#: Lengths are shortened by this until the form is convex, then once more; then halved, so many times at most.
_SHORTER, _INSIDE, _TRIALS = 0.7, 0.85, 8
#: The least step length, and the furthest that one step moves the log of a multiplier.
_SHORTEST, _FURTHEST = 1e-3, 2.0
#: First weight of the equations by the mean curvature, and how often it is multiplied by ten.
_WEIGHT, _HEAVIER = 10.0, 6
#: Least curvature of a form by its mean curvature.
_CURVATURE = 1e-9
#: Part of a normal outside the span of others below which it counts as in it.
_DEPENDENT = 1e-10


@dataclass(frozen=True)
class _Subspace:
    """lambda = anything with the equations of a partial assignment.

    Attributes
    ----------
    across : (2p, r) array
        Orthonormal columns that span what the equations leave free.
    live : int array
        Numbers of the multipliers (of all 4p) whose terms do not vanish there, and may be at most zero at a solution.
    """

    across: Floats
    live: Indices


@dataclass(frozen=True)
class _Candidate:
    """Multipliers at which the bound is known."""

    multipliers: Floats
    form: EnclosedForm
    factor: Floats
    relaxation: ActiveSetRelaxation

    @property
    def log_determinant(self) -> float:
        return 2.0 * float(np.sum(np.log(np.diagonal(self.factor))))


class FormAscent:
    """Finds forms for partial assignments of one problem.

    Parameters
    ----------
    scaled : ScaledSystem
    enclosed : EnclosedSystem
        Balls for the same system.
    engine : ActiveSetEngine
        That of the energy, whose rows and branching rule serve the forms as well.
    """

    def __init__(self, scaled: ScaledSystem, enclosed: EnclosedSystem, engine: ActiveSetEngine) -> None:
        self._scaled, self._enclosed, self._engine = scaled, enclosed, engine

    @property
    def energy(self) -> Floats:
        """The multipliers with which the form is the energy."""
        p = self._scaled.p
        return np.stack([np.ones(p), np.zeros(p), np.full(p, 0.5), np.full(p, 0.5)])

    def improve(
        self, codes: Codes, multipliers: Floats, rows: Rows, steps: int
    ) -> tuple[EnclosedForm, ActiveSetRelaxation] | None:
        """A form for a partial assignment and its solved relaxation; None where nothing is found.

        Parameters
        ----------
        codes : status codes
        multipliers : (4, p) array
            Where the ascent begins: those of a form that serves the assignment.
        rows : numbers and modes of the rows of the assignment
        steps : int
            Most steps.
        """
        space = self._subspace(codes)
        start = np.zeros(multipliers.size)
        values = multipliers.ravel()[space.live]
        if not len(space.live) or not space.across.shape[1]:
            return None
        signed = space.live >= 2 * self._scaled.p
        start[space.live] = np.where(signed, np.maximum(values, _LEAST * np.max(np.abs(values))), values)
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            found = self._candidate(codes, space, start, rows)
            for _ in range(steps):
                look()
                if found is None or found.relaxation.pruned:
                    break
                better = self._step(codes, space, found, rows)
                if better is None:
                    break
                found, last = better
                if last:
                    break
        return None if found is None else (found.form, found.relaxation)

    def _subspace(self, codes: Codes) -> _Subspace:
        p, status = self._scaled.p, np.asarray(codes)
        a = Equations.of(self._enclosed, codes).a
        across = _complement(a) if len(a) else np.eye(2 * p)
        normal = status == UNDECIDED
        tangential = (normal | (status == CONTACT)) & (self._scaled.F > 0)
        live = np.flatnonzero(np.concatenate([normal, normal & tangential, tangential, tangential]))
        return _Subspace(across, live)

    def _factor(self, form: EnclosedForm, space: _Subspace) -> Floats | None:
        """The Cholesky factor of a form on the subspace; None where it is not convex there."""
        whole = space.across.shape[1] == len(form.h)
        return factor_above(form.H if whole else space.across.T @ form.H @ space.across)

    def _plain(self, codes: Codes, multipliers: Floats, weight: float = 0.0) -> EnclosedForm:
        return EnclosedForm.of(self._enclosed, codes, multipliers.reshape(4, -1), weight)

    def _candidate(self, codes: Codes, space: _Subspace, multipliers: Floats, rows: Rows) -> _Candidate | None:
        """The relaxation with these multipliers; None where their form is not convex."""
        proven = self._plain(codes, multipliers)
        factor = self._factor(proven, space)
        if factor is None:
            return None
        mean = float(np.sum(factor * factor)) / len(factor)
        if len(factor) < len(proven.h):
            for k in range(_HEAVIER):
                proven = self._plain(codes, multipliers, _WEIGHT * mean * 10.0**k)
                if _is_convex(proven.H, mean):
                    break
            else:
                return None
        elif not _is_convex(proven.H, mean):
            return None
        relaxation = FormEngine(self._engine, self._scaled, proven).root(*rows)
        if relaxation.stalled or not isinstance(relaxation, ActiveSetRelaxation):
            return None
        return _Candidate(multipliers, proven, factor, relaxation)

    def _step(self, codes: Codes, space: _Subspace, found: _Candidate, rows: Rows) -> tuple[_Candidate, bool] | None:
        """One step of Newton's method; with it whether it is to be the last."""
        z, live = found.multipliers, space.live
        signed = live >= 2 * self._scaled.p
        # the bound in the scale of the barriers
        scale = _BOUND * 2 * self._scaled.p / max(-found.relaxation.bound, 1e-300)
        newton = self._direction(space, found, scale)
        if newton is None:
            return None
        step, promised = newton

        def moved(length: float) -> Floats:
            values, change = z.copy(), length * step
            grown = z[live] * np.exp(np.clip(change, -_FURTHEST, _FURTHEST))
            values[live] = np.where(signed, grown, z[live] + change)
            return values

        def merit(candidate: _Candidate) -> float:
            logs = float(np.sum(np.log(candidate.multipliers[live][signed])))
            return scale * candidate.relaxation.bound + candidate.log_determinant + _LOGS * logs

        length = 1.0
        while self._factor(self._plain(codes, moved(length)), space) is None:
            length *= _SHORTER
            if length < _SHORTEST:
                return None
        length *= _INSIDE
        for _ in range(_TRIALS):
            look()
            trial = self._candidate(codes, space, moved(length), rows)
            if trial is not None and (trial.relaxation.pruned or merit(trial) > merit(found)):
                return trial, promised < _ENOUGH
            length *= 0.5
        return None

    def _direction(self, space: _Subspace, found: _Candidate, scale: float) -> tuple[Floats, float] | None:
        """Newton's step, in the logs of multipliers that have a sign, and what it promises; None where it fails."""
        scaled, live = self._scaled, space.live
        signed = live >= 2 * scaled.p
        numbers, _ = found.relaxation.multipliers()
        normals = row_normals(scaled.p, scaled.F, scaled.S, numbers) @ space.across
        terms = FormProducts(
            scaled.S, scaled.g, lambda rows: self._left(rows)[live], lambda rows: self._right(rows)[live]
        )
        forces = found.relaxation.forces
        gradient, hessian = terms.derivatives(found.form.H, found.factor, forces, scale, normals, space.across)
        slope = np.where(signed, found.multipliers[live], 1.0)
        gradient *= slope
        hessian *= slope[:, None] * slope
        diagonal = np.diagonal(hessian).copy()
        # what the logs add to the curvature, where it is concave
        diagonal[signed] += np.maximum(-gradient[signed], _LOGS)
        gradient[signed] += _LOGS
        hessian[np.diag_indices(len(live))] = diagonal
        step = newton_step(gradient, hessian)
        return None if step is None else (step, float(gradient @ step))

    # -- the terms of all 4p multipliers: products of a factor in lambda and one in S lambda - g -----------------------

    def _left(self, rows: Floats) -> Floats:
        """Factors lambda_n, lambda_t, lambda_t - F lambda_n, lambda_t + F lambda_n, given rows for lambda."""
        normal, tangential = rows[: self._scaled.p], rows[self._scaled.p :]
        bound = self._scaled.F[:, None] * normal
        return np.concatenate([normal, tangential, tangential - bound, tangential + bound])

    def _right(self, rows: Floats) -> Floats:
        """Factors w_n, w_n, w_t, w_t, given rows for w."""
        normal, tangential = rows[: self._scaled.p], rows[self._scaled.p :]
        return np.concatenate([normal, normal, tangential, tangential])


@dataclass(frozen=True)
class FormProducts:
    """Products of a factor in y and one in S y - g, of which a form is the sum with multipliers.

    Attributes
    ----------
    S, g : arrays
    left, right : callables
        Rows of the factors of all products, given rows for y and for S y - g.
    """

    S: Floats
    g: Floats
    left: Callable[[Floats], Floats]
    right: Callable[[Floats], Floats]

    def derivatives(
        self, H: Floats, factor: Floats, forces: Floats, scale: float, normals: Floats, across: Floats
    ) -> tuple[Floats, Floats]:
        """Gradient, and minus the second derivative, of scale times the bound plus the log of the determinant.

        Parameters
        ----------
        H : of the form
        factor : Cholesky factor of H on the subspace
        forces : (m,) array
            The minimiser.
        scale : float
        normals : (k, r) array
            Of the rows that are active, on the subspace.
        across : (m, r) array
            Columns that span the subspace.
        """
        left = self.left(forces[:, None])[:, 0]
        right = self.right((self.S @ forces - self.g)[:, None])[:, 0]
        X = solve_triangular(factor, across.T, lower=True)
        P = X.T @ X
        PS = P @ self.S
        mixed = self.right(self.left(PS).T).T
        gradient = scale * left * right + np.diagonal(mixed)
        lefts, rights = self.left(self.left(P).T), self.right(self.right(self.S @ PS).T)
        bending = scale * self._bending(H, left, right, normals, across)
        return gradient, 0.5 * (lefts * rights + mixed * mixed.T) + bending

    def _bending(self, H: Floats, left: Floats, right: Floats, normals: Floats, across: Floats) -> Floats:
        """Minus the second derivative of the bound: the minimiser moves on the face of the rows that are active."""
        free = across @ _complement(normals) if len(normals) else across
        factor = factor_above(free.T @ H @ free) if free.shape[1] else None
        if factor is None:
            return np.zeros((len(left), len(left)))
        slopes = self.left(free) * right[:, None] + self.right(self.S @ free) * left[:, None]
        moved = solve_triangular(factor, slopes.T, lower=True)
        return np.asarray(0.5 * (moved.T @ moved))


def newton_step(gradient: Floats, hessian: Floats) -> Floats | None:
    """The step of Newton's method, given minus the second derivative; None where that is not definite."""
    hessian[np.diag_indices(len(hessian))] *= 1.0 + 1e-8
    if not (np.all(np.isfinite(hessian)) and np.all(np.isfinite(gradient))):
        return None
    try:
        return np.asarray(cho_solve(cho_factor(hessian, overwrite_a=True), gradient))
    except np.linalg.LinAlgError:
        return None


def _is_convex(H: Floats, mean: float) -> bool:
    return factor_above(H, _CURVATURE * mean) is not None


def _complement(rows: Floats) -> Floats:
    """Columns that span what is orthogonal to some rows."""
    Q, R, _ = qr(rows.T, pivoting=True)
    size = np.abs(np.diagonal(R))
    return np.asarray(Q[:, int(np.sum(size > _DEPENDENT * max(size[0], 1e-300))) :])
