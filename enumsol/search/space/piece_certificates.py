"""Certificates in 3D that a known curve has all solutions over a piece of alpha (theory, section 12.9).

Nothing here is trusted: what is proposed is proven, or the tree goes on.
"""

from __future__ import annotations

from functools import cached_property
from itertools import combinations_with_replacement, pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from enumsol.arithmetic.balls import Ball
from enumsol.condensation.space_condensed import SpaceSystem
from enumsol.model.statuses import UNDECIDED
from enumsol.search.space.space_fathoming import DefiniteForm
from enumsol.trusted.space.curve_runs import CurveParts, KnownCurve, LinkRange
from enumsol.trusted.space.space_uniqueness import PieceWeights, equations, how_far_off

if TYPE_CHECKING:
    from collections.abc import Sequence
    from fractions import Fraction

    from numpy.typing import NDArray

    from enumsol.selections.solution import Codes
    from enumsol.trusted.space.pieces import AlphaPiece

    Array = NDArray[np.float64]
    Flags = NDArray[np.bool_]

#: Smallest eigenvalue relative to S from which a form counts as definite, nodes from which better ones are sought.
_DEFINITE, _MANY = 1e-9, 8
#: By how much more a writer of proofs has theta vary.
ERRORS = 1.0 + 2.0**-6


class Passage(NamedTuple):
    """A run of a known curve that passes every alpha of a piece, and its parts there."""

    curve: int
    run: LinkRange
    parts: CurveParts


def runs_over(known: KnownCurve, low: Fraction, high: Fraction) -> list[LinkRange]:
    """The runs of a curve that pass every alpha of a piece, each as short as may be."""
    (first, last), count = known.joint_alphas, len(known.chain.links)
    below, above = np.nextafter(float(low), -np.inf), np.nextafter(float(high), np.inf)
    sides = (first >= above).astype(int) - (last <= below)
    sides = np.concatenate([sides[:-1], sides[:-1]]) if known.chain.closed else sides
    beside = np.flatnonzero(sides)
    found = {LinkRange(int(j) % count, int(k - 1) % count) for j, k in pairwise(beside) if sides[j] == -sides[k]}
    return sorted(found)


class PieceProposals:
    """Numbers of forms over one piece of alpha.

    Parameters
    ----------
    piece : AlphaPiece
    """

    def __init__(self, piece: AlphaPiece) -> None:
        self._piece, self._middle = piece, piece.space.at(piece.middle)
        self._system = SpaceSystem.in_middle(self._middle, piece.space.units)

    def numbers(self, codes: Codes, parts: CurveParts) -> Array | None:
        """Numbers of a form that seems to serve all over the piece, or None."""
        p, places, whole = self._system.p, self._system.tau >= 0, self._piece.whole
        with np.errstate(all="ignore"):
            thetas, apart = self._thetas(parts)
            psi = [Ball.exact(x * disc.mid[:, None]) for x, disc in zip(thetas, whole.end_discs, strict=True)]
            plain = PieceWeights(np.ones(p), np.ones(p), np.zeros((p, 2)), (thetas[0], thetas[1]))
            off = ERRORS * how_far_off(whole, (self._piece.low, self._piece.high), plain, psi, parts)
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
            form = DefiniteForm(self._system, turns, apart, ERRORS * off * discs, most, self._rows(codes))
            return form.best(_DEFINITE, better=self._system.p >= _MANY) is not None

    def _rows(self, codes: Codes) -> Array | None:
        """Rows that are zero for the difference of two solutions with these statuses."""
        # weighed so by the largest entry of S, equations leave little of what does not satisfy them
        return None if all(code == UNDECIDED for code in codes) else equations(self._middle, codes, 1024.0).mid

    def _turn(self, parts: CurveParts, apart: Flags) -> tuple[Array, Array]:
        """theta of the curve at the middle of the piece, (p, 2), and how far it is from one that serves there, (p,)."""
        if not len(parts.alpha.mid):
            return np.zeros((self._system.p, 2)), np.ones(self._system.p)
        theta, known = self._served(parts)
        turn = np.where((self._system.tau >= 0) & known[0][:, None], theta[0], 0.0)
        far = np.max(np.where(known, parts.thetas[1] + np.linalg.norm(theta - turn, axis=2), 1.0), axis=0)
        return turn, np.where(apart | np.all(self._system.tau < 0, axis=1), 0.0, np.minimum(far, 1.0))

    def _served(self, parts: CurveParts) -> tuple[Array, Flags]:
        """theta that serves, and where one is known: a shorter one than v / |v| where a node is open all the time."""
        (theta, far), normal, slip = parts.thetas, *(part.mid for part in parts.slips)
        r = np.maximum(parts.F.mid, 0.0) / self._piece.whole.references
        pushed = self._piece.whole.references * r * np.linalg.norm(slip, axis=2)
        # half of a gap serves for the slip
        shorter = np.maximum(1.0 - 0.5 * np.maximum(-normal, 0.0) / np.maximum(pushed, 1e-300), 0.0)
        apart = self._apart(parts)
        return np.where(apart[:, None], shorter[:, :, None] * theta, theta), np.isfinite(far) | apart

    @staticmethod
    def _apart(parts: CurveParts) -> Flags:
        """Nodes that are open all the time."""
        return np.asarray(np.all(parts.open & (parts.slips[0].mid < 0), axis=0))

    def _thetas(self, parts: CurveParts) -> tuple[Sequence[Array], Flags]:
        """Thetas at both ends, (p, 2) each, whose psi is near the curve's all over the piece, and open nodes."""
        low, high, reference = float(self._piece.low), float(self._piece.high), self._piece.whole.references
        share = np.clip((parts.alpha.mid - low) / (high - low), 0.0, 1.0)
        r = np.maximum(parts.F.mid, 0.0) / reference
        ends = [np.maximum(end.mid, 0.0) for end in self._piece.whole.end_discs]
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


def _only_turns(alpha: Array, piece: AlphaPiece) -> bool:
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
    def proposals(self) -> PieceProposals:
        """Forms that may be definite over the piece."""
        return PieceProposals(self.piece)

    def along(
        self, curves: Sequence[KnownCurve], piece: AlphaPiece | None = None
    ) -> list[tuple[KnownCurve, CurveParts]]:
        """Known curves and their parts over the piece, or over a longer one."""
        piece = self.piece if piece is None else piece
        parts = self.parts.setdefault((piece.low, piece.high), [])
        for known in curves[len(parts) :]:
            whole = LinkRange(0, len(known.chain.links) - 1)
            parts.append(known.over(whole, piece.low, piece.high))
        return list(zip(curves, parts, strict=True))

    def ends_within(self, curves: Sequence[KnownCurve], statuses: tuple[int, ...]) -> bool:
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
