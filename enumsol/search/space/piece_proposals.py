"""Proposals over a piece of alpha in 3D: multipliers that exclude, and forms by which a curve has all solutions.

See theory, section 12.9. Relaxations are those of one alpha. Their multipliers serve around it; what does not serve all
of a piece may serve together with that of others. Nothing here is trusted: what is proposed is proven, or the tree goes
on.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from itertools import combinations_with_replacement, pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import nnls

from enumsol.arithmetic.balls import Ball
from enumsol.condensation.space_condensed import EnclosedSpace, SpaceSystem
from enumsol.model.statuses import UNDECIDED
from enumsol.proof.leaves import Excluded
from enumsol.relaxation.space_relaxation import SpaceEngine
from enumsol.search.certifiers.protocol import ERRORS
from enumsol.search.setup import weakly_held
from enumsol.search.space.space_fathoming import DefiniteForm
from enumsol.search.space.space_newton import Isotropic
from enumsol.search.space.space_search import SpaceSplitting, unbalanced
from enumsol.search.splitting import ImposedRows
from enumsol.trusted.space.curve_runs import CurveChain, CurveParts, LinkRange
from enumsol.trusted.space.sector_rows import FORCE, FREE, GAP, OF_DISCS, TAU, Row, row_sign, sector_row_terms
from enumsol.trusted.space.space_uniqueness import PieceWeights, equations, how_far_off

if TYPE_CHECKING:
    from collections.abc import Sequence
    from fractions import Fraction

    from enumsol.condensation.space_condensed import AlphaSpace
    from enumsol.proof.leaves import Unbalanced
    from enumsol.relaxation.space_relaxation import SpaceRelaxation
    from enumsol.support.array_types import Codes, Floats, Mask
    from enumsol.trusted.space.pieces import AlphaPiece


class AlphaPoint:
    """The problem at one alpha, for relaxations.

    Parameters
    ----------
    space : AlphaSpace
    alpha : Fraction
    """

    def __init__(self, space: AlphaSpace, alpha: Fraction) -> None:
        self.alpha = alpha
        self.system, self._floats = _relaxed(space, alpha), not space.fixed.held
        # the rows of a program at one alpha
        self.engine = SpaceEngine(self.system, 4096)
        self.splitting = SpaceSplitting(self.engine)
        self.rows = ImposedRows(self.splitting, self.system.p)
        self._discs = space.discs(alpha).mid

    def root(self, codes: Codes) -> SpaceRelaxation:
        """The relaxation of an assignment."""
        return self.engine.root(*self.rows.over(codes, range(self.system.p)))

    def multipliers(self, relaxation: SpaceRelaxation) -> tuple[list[Row], Floats]:
        """Multipliers of a relaxation in the variables of a space: tau is less there by the discs' radii, v is more."""
        numbers, values = relaxation.multipliers()
        rows = [self.engine.rows[number] for number in numbers.tolist()]
        return rows, values * np.array([self._factor(row) for row in rows])

    def _factor(self, row: Row) -> float:
        kind, node, _ = row
        disc = float(self._discs[node])
        return 1.0 if kind in (GAP, FORCE) else 1.0 / disc if kind == TAU or kind in OF_DISCS else disc

    def imposed(self, codes: Codes) -> list[Row]:
        """The rows that an assignment imposes."""
        return [self.engine.rows[number] for number in self.rows.over(codes, range(self.system.p))[0]]

    def solution(self) -> Floats | None:
        """Forces of a solution in the units of the problem, (3p,), by Newton's method; no claim.

        None of a body that nothing holds.
        """
        system = self.system
        if self._floats:
            return None
        with np.errstate(all="ignore"):
            y = Isotropic.of(system).solution()
        if y is None:
            return None
        F = system.F / system.tau_units
        return np.concatenate([y[: system.p], *(F * system.tangential(y)).T]) * np.tile(system.force, 3)


def _relaxed(space: AlphaSpace, alpha: Fraction) -> SpaceSystem:
    """The problem at one alpha, of a body that nothing holds on weak springs (theory, section 14.5)."""
    enclosed = EnclosedSpace.of_problem(space.enclosure, alpha, *space.units)
    S, g = weakly_held(enclosed.S, enclosed.g, enclosed.rows)
    return replace(SpaceSystem.in_middle(enclosed, space.units), S=S, g=g)


class PieceBounds:
    """The numbers (12.19) of a piece, as functions of multipliers m of rows at its lower, then its upper end, (2 n,).

    They are q'm - |v + B m|^2 / 4; the last one is for what lies between the ends.

    Parameters
    ----------
    piece : AlphaPiece
    codes : (partial) status codes
    rows : sequence of n rows
    """

    def __init__(self, piece: AlphaPiece, codes: Sequence[int], rows: Sequence[Row]) -> None:
        self._free = np.flatnonzero(2 * [row_sign(codes[row[1]], row) == FREE for row in rows])
        (low, high), n = piece.ends, len(rows)
        held, normals, slips = _columns(low, rows)
        discs = [np.r_[end.discs.mid, np.zeros(len(low.g) - len(low.tau))] for end in (low, high)]
        both = [held + disc[:, None] * normals for disc in discs]
        (S, g_low), (_, g_high) = (weakly_held(end.S, end.g, end.rows) for end in (low, high))
        lower = np.linalg.cholesky(S)
        scaled = solve_triangular(lower, np.column_stack([g_low, g_high, *both]), lower=True, check_finite=False)
        g, A = scaled.T[:2], (scaled[:, 2 : 2 + n], scaled[:, 2 + n :])
        own = [-load @ slips for load in (g_low, g_high)]
        none = np.zeros_like(A[0])
        self._v = np.stack([g[0], g[1], 0.5 * (g[0] + g[1])])
        self._B = np.stack([np.hstack([A[0], none]), np.hstack([none, A[1]]), 0.5 * np.hstack([A[1], A[0]])])
        self._q = np.stack([np.r_[own[0], none[0]], np.r_[none[0], own[1]], 0.5 * np.r_[own[1], own[0]]])

    def of(self, m: Floats) -> Floats:
        """The three numbers."""
        return np.asarray(self._q @ m - 0.25 * np.sum((self._v + self._B @ m) ** 2, axis=1))

    def positive(self) -> Floats | None:
        """Multipliers for which all three seem to be positive; None if none are found.

        For fixed weights their mean is largest at the solution of a problem of nonnegative least squares, where
        multipliers without a sign count twice; weights move to the number that is the least.
        """
        size = np.sqrt(np.sum(self._B * self._B, axis=(0, 1))) + 1e-300
        B, q = self._B / size, self._q / size
        B, q = np.concatenate([B, -B[:, :, self._free]], axis=2), np.concatenate([q, -q[:, self._free]], axis=1)
        # squares of multipliers, by the lengths of their rows, keep these bounded
        weight, ridge = np.full(3, 1 / 3), np.sqrt(1e-12)
        for _ in range(6):
            root = np.sqrt(weight)[:, None]
            matrix = np.vstack([*(root[:, :, None] * B), ridge * np.eye(B.shape[2])])
            target = np.concatenate([*(root * self._v), -2.0 / ridge * (weight @ q)])
            try:
                found, _ = nnls(matrix, -target)
            except (RuntimeError, ValueError):
                # it does not end, or something overflows
                return None
            m = found[: len(size)].copy()
            m[self._free] -= found[len(size) :]
            m /= size
            bounds = self.of(m)
            if np.all(bounds > 0):
                return np.asarray(m)
            if not weight @ bounds > 0:
                return None
            weight = weight * np.exp(-bounds / np.max(np.abs(bounds)))
            weight /= np.sum(weight)
        return None


def exclusion(piece: AlphaPiece, codes: Sequence[int], rows: Sequence[Row]) -> Excluded | None:
    """The proof by multipliers of rows that a piece holds no solution; None if none are found."""
    with np.errstate(over="ignore", invalid="ignore"):
        try:
            found = PieceBounds(piece, codes, rows).positive()
        except np.linalg.LinAlgError:
            found = None
    if found is None:
        return None
    low, high = np.split(found, 2)
    if not piece.margin(codes, rows, (low, high), ERRORS) > 0:
        return None
    used = np.flatnonzero((low != 0) | (high != 0))
    return Excluded([rows[k] for k in used.tolist()], np.stack([low[used], high[used]]))


def _columns(system: EnclosedSpace, rows: Sequence[Row]) -> tuple[Floats, Floats, Floats]:
    """Parts of the load that rows add: but for discs, by these, and the rows on w, (m, n) each."""
    size, units = len(system.g), system.row_unit
    columns, normals = np.zeros((2 * size, len(rows))), np.zeros((size, len(rows)))
    for k, row in enumerate(rows):
        for i, coefficient in zip(*sector_row_terms(row, system.tau, size), strict=True):
            of_disc = i == row[1] and row[0] in OF_DISCS
            (normals if of_disc else columns)[i, k] += coefficient * units[i]
    return columns[:size] - weakly_held(system.S, system.g, system.rows)[0] @ columns[size:], normals, columns[size:]


# -- forms by which a known curve has all solutions --------------------------------------------------------------------

#: Smallest eigenvalue relative to S from which a form counts as definite, nodes from which better ones are sought.
_DEFINITE, _MANY = 1e-9, 8
#: By how much more a writer of proofs has theta vary.
THETA = 1.0 + 2.0**-6


class Passage(NamedTuple):
    """A run of a known curve that passes every alpha of a piece, and its parts there."""

    curve: int
    run: LinkRange
    parts: CurveParts


def runs_over(known: CurveChain, low: Fraction, high: Fraction) -> list[LinkRange]:
    """The runs of a curve that pass every alpha of a piece, each as short as may be."""
    (first, last), count = known.joint_alphas, len(known.links)
    below, above = np.nextafter(float(low), -np.inf), np.nextafter(float(high), np.inf)
    sides = (first >= above).astype(int) - (last <= below)
    sides = np.concatenate([sides[:-1], sides[:-1]]) if known.closed else sides
    beside = np.flatnonzero(sides)
    found = {LinkRange(int(j) % count, int(k - 1) % count) for j, k in pairwise(beside) if sides[j] == -sides[k]}
    return sorted(found)


def _only_turns(alpha: Floats, piece: AlphaPiece) -> bool:
    """True if a run along a curve, given by alphas, passes some alphas of a piece twice, but none just once."""
    low, high = float(piece.low), float(piece.high)
    # at four alphas of the piece
    beyond = alpha > (low + (high - low) * (2.0 * np.arange(4) + 1.0) / 8)[:, None]
    passed = np.sum(beyond[:, 1:] != beyond[:, :-1], axis=1)
    return bool(np.any(passed > 1) and not np.any(passed == 1))


class ExaminedPiece:
    """A piece with what the search needs of it."""

    def __init__(self, piece: AlphaPiece) -> None:
        self.piece = piece
        #: Runs of known curves that pass the piece, of so many curves.
        self.passages: list[Passage] = []
        self.curves = 0
        #: Parts of known curves over the piece, and over longer ones.
        self.parts: dict[tuple[Fraction, Fraction], list[CurveParts]] = {}
        #: Assignments of statuses for which no form is definite.
        self.hopeless: set[tuple[int, ...]] = set()

    @cached_property
    def _middle(self) -> EnclosedSpace:
        return self.piece.space.at(self.piece.middle)

    @cached_property
    def _system(self) -> SpaceSystem:
        return SpaceSystem.in_middle(self._middle, self.piece.space.units)

    def unbalanced(self, codes: Codes) -> Unbalanced | None:
        """A record that no forces below an assignment are in balance with the load over the piece; or None."""
        return unbalanced(self.piece, (*self.piece.ends, self.piece.whole), codes)

    def along(
        self, curves: Sequence[CurveChain], piece: AlphaPiece | None = None
    ) -> list[tuple[CurveChain, CurveParts]]:
        """Known curves and their parts over the piece, or over a longer one."""
        piece = self.piece if piece is None else piece
        parts = self.parts.setdefault((piece.low, piece.high), [])
        for known in curves[len(parts) :]:
            whole = LinkRange(0, len(known.links) - 1)
            parts.append(known.over(whole, piece.low, piece.high))
        return list(zip(curves, parts, strict=True))

    def ends_within(self, curves: Sequence[CurveChain], statuses: tuple[int, ...]) -> bool:
        """True if in one run along the known curves, and in no other, these statuses hold over a part of a piece.

        Not where that run turns back and passes no alpha just once: with two solutions at one no form is definite.
        """
        runs = 0
        for _, parts in self.along(curves):
            held = parts.held(statuses)
            if len(held):
                runs += int(held[0]) + int(np.sum(held[1:] & ~held[:-1]))
                runs += int(_only_turns(parts.alpha.mid[held], self.piece))
        return runs == 1

    # -- forms that may be definite over the piece ---------------------------------------------------------------------

    def numbers(self, codes: Codes, parts: CurveParts) -> Floats | None:
        """Numbers of a form that seems to serve all over the piece, or None."""
        p, places, whole = self._system.p, self._system.tau >= 0, self.piece.whole
        with np.errstate(all="ignore"):
            thetas, apart = self._thetas(parts)
            psi = [Ball.exact(x * disc.mid[:, None]) for x, disc in zip(thetas, whole.end_discs, strict=True)]
            plain = PieceWeights(np.ones(p), np.ones(p), np.zeros((p, 2)), (thetas[0], thetas[1]))
            off = THETA * how_far_off(whole, (self.piece.low, self.piece.high), plain, psi, parts)
            turns, rows = [end.mid for end in psi], self._rows(codes)
            found = DefiniteForm(self._system, turns, apart, off, whole.largest_discs, rows).best(
                _DEFINITE, better=p >= _MANY
            )
        if found is None:
            return None
        mu, kappa, nu = found
        return np.concatenate([mu, kappa, nu[places], *(theta[places] for theta in thetas)])

    def is_hopeful(self, codes: Codes, parts: CurveParts) -> bool:
        """True if a shorter piece may have such a form: the middle has one, by the parts of the curve there."""
        with np.errstate(all="ignore"):
            apart, discs = self._apart(parts), self._middle.discs.mid
            turn, off = self._turn(parts, apart)
            turns, most = [turn * discs[:, None]], self._middle.largest_discs
            form = DefiniteForm(self._system, turns, apart, THETA * off * discs, most, self._rows(codes))
            return form.best(_DEFINITE, better=self._system.p >= _MANY) is not None

    def _rows(self, codes: Codes) -> Floats | None:
        """Rows that are zero for the difference of two solutions with these statuses."""
        # weighed so by the largest entry of S, equations leave little of what does not satisfy them
        return None if all(code == UNDECIDED for code in codes) else equations(self._middle, codes, 1024.0).mid

    def _turn(self, parts: CurveParts, apart: Mask) -> tuple[Floats, Floats]:
        """theta of the curve at the middle of the piece, (p, 2), and how far it is from one that serves there, (p,)."""
        if not len(parts.alpha.mid):
            return np.zeros((self._system.p, 2)), np.ones(self._system.p)
        theta, known = self._served(parts)
        turn = np.where((self._system.tau >= 0) & known[0][:, None], theta[0], 0.0)
        far = np.max(np.where(known, parts.thetas[1] + np.linalg.norm(theta - turn, axis=2), 1.0), axis=0)
        return turn, np.where(apart | np.all(self._system.tau < 0, axis=1), 0.0, np.minimum(far, 1.0))

    def _served(self, parts: CurveParts) -> tuple[Floats, Mask]:
        """theta that serves, and where one is known: a shorter one than v / |v| where a node is open all the time."""
        (theta, far), normal, slip = parts.thetas, *(part.mid for part in parts.slips)
        r = np.maximum(parts.F.mid, 0.0) / self.piece.whole.references
        pushed = self.piece.whole.references * r * np.linalg.norm(slip, axis=2)
        # half of a gap serves for the slip
        shorter = np.maximum(1.0 - 0.5 * np.maximum(-normal, 0.0) / np.maximum(pushed, 1e-300), 0.0)
        apart = self._apart(parts)
        return np.where(apart[:, None], shorter[:, :, None] * theta, theta), np.isfinite(far) | apart

    @staticmethod
    def _apart(parts: CurveParts) -> Mask:
        """Nodes that are open all the time."""
        return np.asarray(np.all(parts.open & (parts.slips[0].mid < 0), axis=0))

    def _thetas(self, parts: CurveParts) -> tuple[Sequence[Floats], Mask]:
        """Thetas at both ends, (p, 2) each, whose psi is near the curve's all over the piece, and open nodes."""
        low, high, reference = float(self.piece.low), float(self.piece.high), self.piece.whole.references
        share = np.clip((parts.alpha.mid - low) / (high - low), 0.0, 1.0)
        r = np.maximum(parts.F.mid, 0.0) / reference
        ends = [np.maximum(end.mid, 0.0) for end in self.piece.whole.end_discs]
        (theta, known), apart = self._served(parts), self._apart(parts)
        psi = np.where(known[:, :, None], r[:, :, None] * theta, 0.0)
        basis = (1.0 - share)[:, None] * ends[0], share[:, None] * ends[1]
        weight = np.ones_like(r)
        fitted = [np.zeros_like(theta[0]), np.zeros_like(theta[0])]
        # large distances get more weight each time, the least ones a little
        for _ in range(4):
            a, b, c = (np.sum(weight * x * y, axis=0) for x, y in combinations_with_replacement(basis, 2))
            a, c = a + 1e-12 * (a + c) + 1e-300, c + 1e-12 * (a + c) + 1e-300
            one, other = (np.sum((weight * x)[:, :, None] * psi, axis=0) for x in basis)
            det = (a * c - b * b)[:, None]
            fitted = [(c[:, None] * one - b[:, None] * other) / det, (a[:, None] * other - b[:, None] * one) / det]
            missed = np.linalg.norm(psi - sum(x[:, :, None] * y for x, y in zip(basis, fitted, strict=True)), axis=2)
            weight *= missed / np.maximum(np.max(missed, axis=0), 1e-300) + 1e-3
        size = [np.linalg.norm(theta, axis=1) for theta in fitted]
        shrunk = [np.where(apart & (x > 1.0), (1.0 - 4e-16) / np.maximum(x, 1.0), 1.0) for x in size]
        places = self._system.tau >= 0
        return [np.where(places, theta * by[:, None], 0.0) for theta, by in zip(fitted, shrunk, strict=True)], apart
