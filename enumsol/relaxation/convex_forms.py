"""Quadratic forms other than the energy that bound more tightly, and the ascent that finds them (theory, section 5.8).

The bound of a form over a partial assignment is concave in its multipliers, which may be what they like as long as the
form is convex on the subspace of the assignment's equations. Newton's method maximises it together with barriers: the
log of the determinant of the form there, and those of the multipliers. In 2D these are the logs of the multipliers that
have a sign, which a step moves: one that moves the multipliers themselves is cut where the first of them vanishes. In
3D (theory, section 12.2) vectors c may be no longer than kappa, and their barrier is the log of kappa^2 - |c|^2. All
terms are of rank two, so that gradients and second derivatives need products of matrices of the size of S only.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np
import scipy.sparse as sp
from scipy.linalg import cho_factor, cho_solve, qr, solve_triangular

from enumsol.arithmetic.balls import factor_above
from enumsol.relaxation.active_set import ActiveSetRelaxation
from enumsol.relaxation.engine import row_normals
from enumsol.relaxation.space_relaxation import SpaceRelaxation
from enumsol.support.deadlines import look
from enumsol.trusted.quadratic_forms import EnclosedForm, equations_of
from enumsol.trusted.space.sector_margins import SlipForm
from enumsol.trusted.space.sector_rows import sector_row_terms
from enumsol.trusted.status_rows import CONTACT, UNDECIDED

if TYPE_CHECKING:
    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.relaxation.active_set import ActiveSetEngine
    from enumsol.relaxation.space_relaxation import SpaceEngine
    from enumsol.support.array_types import Codes, Floats

    Rows = tuple[list[int], list[int]]

_Form = TypeVar("_Form", EnclosedForm, SlipForm)
_Relaxation = TypeVar("_Relaxation", ActiveSetRelaxation, SpaceRelaxation)

#: Weights of the bound and of the barriers of multipliers beside that of the determinant, for every unknown.
_BOUND, _BARRIER = 0.125, 0.05
#: Part of the longest step that leaves the form convex: after a longer one the next ones are short.
_INSIDE = 0.85


@dataclass(frozen=True)
class _Candidate(Generic[_Form, _Relaxation]):
    """Multipliers at which the bound is known."""

    multipliers: Floats
    form: _Form
    factor: Floats
    relaxation: _Relaxation


class FormAscent(ABC, Generic[_Form, _Relaxation]):
    """Newton's method for the multipliers of a form that bounds one partial assignment.

    A form is the sum, with multipliers, of products of a factor in y and one in S y - g.
    """

    #: The length of a first step that leaves the form convex.
    whole: float
    #: S and g, shapes (m, m) and (m,).
    S: Floats
    g: Floats
    #: Factors of the products: rows of combinations of y, and of S y - g.
    left: sp.csr_array
    right: sp.csr_array
    #: Orthonormal columns that span what the equations of the assignment leave free, shape (m, r).
    across: Floats

    @abstractmethod
    def _form(self, multipliers: Floats) -> _Form | None:
        """The form of these multipliers, if they are allowed."""

    @abstractmethod
    def _relaxed(self, form: _Form, factor: Floats, multipliers: Floats) -> tuple[_Form, _Relaxation] | None:
        """The form as it is convex everywhere, and its relaxation; None where it is hardly convex."""

    @abstractmethod
    def _barrier(self, multipliers: Floats) -> float:
        """The sum of the logs that keep multipliers where they are allowed."""

    @abstractmethod
    def _moved(self, multipliers: Floats, change: Floats) -> Floats:
        """Multipliers after a step."""

    @abstractmethod
    def _derivatives(self, found: _Candidate[_Form, _Relaxation], scale: float) -> tuple[Floats, Floats]:
        """Gradient, and minus the second derivative, of what is maximised."""

    def _convex(self, multipliers: Floats) -> tuple[_Form, Floats] | None:
        """The form of these multipliers and its Cholesky factor on the subspace; None where it is not convex there."""
        form = self._form(multipliers)
        if form is None:
            return None
        whole = self.across.shape[1] == len(form.h)
        factor = factor_above(form.H if whole else self.across.T @ form.H @ self.across)
        return None if factor is None else (form, factor)

    def _candidate(self, multipliers: Floats) -> _Candidate[_Form, _Relaxation] | None:
        """The relaxation with these multipliers; None where their form is not convex, or that stalls."""
        convex = self._convex(multipliers)
        found = None if convex is None else self._relaxed(*convex, multipliers)
        if convex is None or found is None or found[1].stalled:
            return None
        return _Candidate(multipliers, found[0], convex[1], found[1])

    def _step(self, found: _Candidate[_Form, _Relaxation]) -> tuple[_Candidate[_Form, _Relaxation], float] | None:
        """The end of one step of Newton's method, and what it promised; None where it gains nothing."""
        # the bound in the scale of the barriers
        scale = _BOUND * len(found.form.h) / max(-found.relaxation.bound, 1e-300)
        newton = _newton_step(*self._derivatives(found, scale))
        if newton is None:
            return None
        step, promised = newton

        def merit(candidate: _Candidate[_Form, _Relaxation]) -> float:
            log_determinant = 2.0 * float(np.sum(np.log(np.diagonal(candidate.factor))))
            barriers = log_determinant + _BARRIER * self._barrier(candidate.multipliers)
            return scale * candidate.relaxation.bound + barriers

        length = 1.0
        while self._convex(self._moved(found.multipliers, length * step)) is None:
            length *= 0.7
            if length < 1e-3:
                return None
        length = self.whole if length == 1.0 else _INSIDE * length
        for _ in range(8):  # each half as long as the one before
            look()
            trial = self._candidate(self._moved(found.multipliers, length * step))
            if trial is not None and (trial.relaxation.pruned or merit(trial) > merit(found)):
                return trial, promised
            length *= 0.5
        return None

    def _of_products(
        self, found: _Candidate[_Form, _Relaxation], scale: float, normals: Floats
    ) -> tuple[Floats, Floats]:
        """Gradient, and minus the second derivative, of scale times the bound plus the log of the determinant.

        These are by the multipliers of the products; ``normals`` are those of the rows that are active, on the
        subspace, (k, r).
        """
        S, L, R, forces = self.S, self.left, self.right, found.relaxation.forces
        left, right = L @ forces, R @ (S @ forces - self.g)
        X = solve_triangular(found.factor, self.across.T, lower=True)
        P = X.T @ X
        PS = P @ S
        mixed = (R @ (L @ PS).T).T
        gradient = scale * left * right + np.diagonal(mixed)
        lefts, rights = L @ (L @ P).T, R @ (R @ (S @ PS)).T
        bending = scale * self._bending(found.form.H, left, right, normals)
        return gradient, 0.5 * (lefts * rights + mixed * mixed.T) + bending

    def _bending(self, H: Floats, left: Floats, right: Floats, normals: Floats) -> Floats:
        """Minus the second derivative of the bound: the minimiser moves on the face of the rows that are active."""
        free = self.across @ _complement(normals) if len(normals) else self.across
        factor = factor_above(free.T @ H @ free) if free.shape[1] else None
        if factor is None:
            return np.zeros((len(left), len(left)))
        slopes = (self.left @ free) * right[:, None] + (self.right @ (self.S @ free)) * left[:, None]
        moved = solve_triangular(factor, slopes.T, lower=True)
        return np.asarray(0.5 * (moved.T @ moved))


class PlaneFormAscent(FormAscent[EnclosedForm, ActiveSetRelaxation]):
    """Forms in 2D.

    Parameters
    ----------
    scaled : ScaledSystem
    enclosed : EnclosedSystem
        Balls for the same system.
    engine : ActiveSetEngine
        That of the energy, whose rows and branching rule serve the forms as well.
    codes : status codes of the partial assignment
    rows : numbers and modes of its rows
    """

    whole = _INSIDE

    def __init__(
        self, scaled: ScaledSystem, enclosed: EnclosedSystem, engine: ActiveSetEngine, codes: Codes, rows: Rows
    ) -> None:
        self._scaled, self._enclosed, self._engine, self._codes, self._rows = scaled, enclosed, engine, codes, rows
        self.S, self.g = scaled.S, scaled.g
        p, status = scaled.p, np.asarray(codes)
        a = equations_of(enclosed, codes)[0].mid
        self.across = _complement(a) if len(a) else np.eye(2 * p)
        normal = status == UNDECIDED
        tangential = (normal | (status == CONTACT)) & (scaled.F > 0)
        #: Numbers of the multipliers (of all 4p) whose terms do not vanish there, and are at most zero at a solution.
        self._live = np.flatnonzero(np.concatenate([normal, normal & tangential, tangential, tangential]))
        self._signed = self._live >= 2 * p
        one, none = sp.eye_array(p), sp.csr_array((p, p))
        bound = sp.diags_array(scaled.F)
        # lambda_n, lambda_t, lambda_t - F lambda_n, lambda_t + F lambda_n, and w_n, w_n, w_t, w_t
        left = sp.block_array([[one, none], [none, one], [-bound, one], [bound, one]], format="csr")
        right = sp.block_array([[one, none], [one, none], [none, one], [none, one]], format="csr")
        self.left, self.right = left[self._live], right[self._live]

    @property
    def energy(self) -> Floats:
        """The multipliers with which the form is the energy."""
        p = self._scaled.p
        return np.stack([np.ones(p), np.zeros(p), np.full(p, 0.5), np.full(p, 0.5)])

    def improve(self, multipliers: Floats, steps: int) -> tuple[EnclosedForm, ActiveSetRelaxation] | None:
        """A form for the assignment and its solved relaxation; None where nothing is found.

        Parameters
        ----------
        multipliers : (4, p) array
            Where the ascent begins: those of a form that serves the assignment.
        steps : int
            Most steps.
        """
        live, start = self._live, np.zeros(multipliers.size)
        values = multipliers.ravel()[live]
        if not len(live) or not self.across.shape[1]:
            return None
        # a multiplier with a sign that begins at zero would stay there
        start[live] = np.where(self._signed, np.maximum(values, 1e-4 * np.max(np.abs(values))), values)
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            found = self._candidate(start)
            for _ in range(steps):
                look()
                better = None if found is None or found.relaxation.pruned else self._step(found)
                if better is None:
                    break
                found, promised = better
                if promised < 1.0:
                    break
        return None if found is None else (found.form, found.relaxation)

    def _form(self, multipliers: Floats, weight: float = 0.0) -> EnclosedForm:
        return EnclosedForm.of(self._enclosed, self._codes, multipliers.reshape(4, -1), weight)

    def _relaxed(
        self, form: EnclosedForm, factor: Floats, multipliers: Floats
    ) -> tuple[EnclosedForm, ActiveSetRelaxation] | None:
        mean = float(np.sum(factor * factor)) / len(factor)
        # of the equations: light ones leave the form concave off the subspace, heavy ones lose digits
        weights = [10.0 * mean * 10.0**k for k in range(6)] if len(factor) < len(form.h) else [0.0]
        for weight in weights:
            trial = self._form(multipliers, weight) if weight else form
            if factor_above(trial.H, 1e-9 * mean) is not None:
                return trial, self._engine.bounding(trial).root(*self._rows)
        return None

    def _barrier(self, multipliers: Floats) -> float:
        return float(np.sum(np.log(multipliers[self._live][self._signed])))

    def _moved(self, multipliers: Floats, change: Floats) -> Floats:
        values, live = multipliers.copy(), self._live
        grown = multipliers[live] * np.exp(np.clip(change, -2.0, 2.0))
        values[live] = np.where(self._signed, grown, multipliers[live] + change)
        return values

    def _derivatives(self, found: _Candidate[EnclosedForm, ActiveSetRelaxation], scale: float) -> tuple[Floats, Floats]:
        """With respect to the logs of multipliers that have a sign."""
        scaled, live, signed = self._scaled, self._live, self._signed
        numbers, _ = found.relaxation.multipliers()
        normals = row_normals(scaled.p, scaled.F, scaled.S, numbers) @ self.across
        gradient, hessian = self._of_products(found, scale, normals)
        slope = np.where(signed, found.multipliers[live], 1.0)
        gradient *= slope
        hessian *= slope[:, None] * slope
        diagonal = np.diagonal(hessian).copy()
        # what the logs add to the curvature, where it is concave
        diagonal[signed] += np.maximum(-gradient[signed], _BARRIER)
        gradient[signed] += _BARRIER
        hessian[np.diag_indices(len(live))] = diagonal
        return gradient, hessian


class SlipFormAscent(FormAscent[SlipForm, SpaceRelaxation]):
    """Forms in 3D, at the root of the search.

    Parameters
    ----------
    engine : SpaceEngine
        That of the energy, whose rows serve the forms as well.
    enclosed : EnclosedSpace
        Balls for its system.
    rows : numbers and modes of the rows of the root
    """

    whole = 1.0

    def __init__(self, engine: SpaceEngine, enclosed: EnclosedSpace, rows: Rows) -> None:
        self._engine, self._enclosed, self._system, self._rows = engine, enclosed, engine.system, rows
        system, p, size = self._system, self._system.p, len(self._system.g)
        self.S, self.g, self.across = system.S, system.g, np.eye(size)
        node, axis = np.nonzero(system.tau >= 0)
        tau = system.tau[node, axis]
        # products of a force and a slip, in the order of mu, kappa and c
        every = sp.eye_array(size, format="csr")
        self.left = every[np.concatenate([np.arange(p), tau, node])]
        self.right = every[np.concatenate([np.arange(p), tau, tau])]
        number = np.concatenate([np.arange(p), p + node, p + tau])
        #: Multipliers that have a product, and what a product gets of each of them.
        self._live = np.unique(number)
        value = np.concatenate([np.ones(size), -1.0 / system.unit[tau]])
        self._shares = np.where(self._live[:, None] == number, value, 0.0)
        #: Places of kappa and c of the nodes with friction; a c that does not occur has the last place, a zero.
        rubs = np.flatnonzero(np.any(system.tau >= 0, axis=1))
        self._cones = np.column_stack([p + rubs, np.where(system.tau[rubs] >= 0, p + system.tau[rubs], size + p)])

    def ascended(self) -> tuple[SlipForm, SpaceRelaxation] | None:
        """The tightest form that was found, with the mean curvature of the energy, and its relaxation; or None."""
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            p, size = self._system.p, len(self._system.g)
            found = self._candidate(np.concatenate([np.ones(2 * p), np.zeros(size - p)]))
            gaps: list[float] = []
            while found is not None and not found.relaxation.pruned and len(gaps) < 16:
                look()
                gaps.append(-found.relaxation.bound / self._curvature(found.multipliers))
                if len(gaps) > 2 and gaps[-1] > 0.9 * gaps[-3]:  # two steps have to gain that together
                    break
                better = self._step(found)
                if better is None:
                    break
                found = better[0]
            if found is None or not gaps:
                return None
            found = self._candidate(found.multipliers / self._curvature(found.multipliers))
        return None if found is None else (found.form, found.relaxation)

    def _curvature(self, numbers: Floats) -> float:
        """The mean eigenvalue of H relative to S: c has no part in it."""
        return float(np.sum(self._shares[:, : len(self._system.g)].T @ numbers[self._live])) / len(self._system.g)

    def _lengths(self, numbers: Floats) -> tuple[Floats, Floats]:
        """kappa and c of the nodes with friction."""
        cones = np.append(numbers, 0.0)[self._cones]
        return cones[:, 0], cones[:, 1:]

    def _form(self, multipliers: Floats) -> SlipForm | None:
        kappa, c = self._lengths(multipliers)
        if not np.all(np.linalg.norm(c, axis=1) <= (1.0 - 1e-9) * kappa):
            return None
        return SlipForm.of(self._enclosed, multipliers)

    def _relaxed(self, form: SlipForm, factor: Floats, multipliers: Floats) -> tuple[SlipForm, SpaceRelaxation]:
        return form, self._engine.bounding(form).root(*self._rows)

    def _barrier(self, multipliers: Floats) -> float:
        kappa, c = self._lengths(multipliers)
        return float(np.sum(np.log(kappa * kappa - np.sum(c * c, axis=1))))

    def _moved(self, multipliers: Floats, change: Floats) -> Floats:
        values = multipliers.copy()
        values[self._live] += change
        return values

    def _derivatives(self, found: _Candidate[SlipForm, SpaceRelaxation], scale: float) -> tuple[Floats, Floats]:
        numbers = found.multipliers
        gradient, hessian = self._of_products(found, scale, self._normals(found.relaxation))
        slope, curved = np.zeros(len(numbers) + 1), np.zeros((len(numbers) + 1,) * 2)
        slope[self._live] = self._shares @ gradient
        curved[np.ix_(self._live, self._live)] = self._shares @ hessian @ self._shares.T
        for cone in self._cones:
            signed = np.append(numbers, 0.0)[cone] * np.array([1.0, -1.0, -1.0])
            square = float(signed[0] ** 2 - signed[1] ** 2 - signed[2] ** 2)
            own = 2.0 * signed / square
            slope[cone] += _BARRIER * own
            curved[np.ix_(cone, cone)] += _BARRIER * (np.outer(own, own) - 2.0 * np.diag([1.0, -1.0, -1.0]) / square)
        return slope[self._live], curved[np.ix_(self._live, self._live)]

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


def _newton_step(gradient: Floats, hessian: Floats) -> tuple[Floats, float] | None:
    """The step of Newton's method, given minus the second derivative, and what it promises; None: not definite."""
    hessian[np.diag_indices(len(hessian))] *= 1.0 + 1e-8
    if not (np.all(np.isfinite(hessian)) and np.all(np.isfinite(gradient))):
        return None
    try:
        step = np.asarray(cho_solve(cho_factor(hessian, overwrite_a=True), gradient))
    except np.linalg.LinAlgError:
        return None
    return step, float(gradient @ step)


def _complement(rows: Floats) -> Floats:
    """Columns that span what is orthogonal to some rows."""
    Q, R, _ = qr(rows.T, pivoting=True)
    size = np.abs(np.diagonal(R))
    return np.asarray(Q[:, int(np.sum(size > 1e-10 * max(size[0], 1e-300))) :])
