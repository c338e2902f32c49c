"""Leaves proven empty over a whole piece of the interval in rational arithmetic (theory, section 7.9)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flint import fmpq, fmpq_mat

from enumsol.arithmetic.rationals import rational
from enumsol.relaxation.interval import IntervalRowKind, imposed_interval_rows
from enumsol.relaxation.rows import INEQUALITY, RowKind

if TYPE_CHECKING:
    from fractions import Fraction

    from enumsol.condensation.exact import ExactPath
    from enumsol.relaxation.interval import IntervalSystem
    from enumsol.search.interval import EmptyLeaf, Piece

_FORCE_ROWS = (
    RowKind.NORMAL_FORCE,
    RowKind.TANGENTIAL_FORCE,
    RowKind.CONE_PLUS,
    RowKind.CONE_MINUS,
    IntervalRowKind.SLIP_AT_LEAST_PLUS,
    IntervalRowKind.SLIP_AT_LEAST_MINUS,
)


class ExactIntervalCertifier:
    """Accepts a leaf when the dual bound of its multipliers is positive at both ends of the piece, exactly.

    With fixed multipliers the bound is concave in alpha, so that it is positive between the ends too.

    Parameters
    ----------
    exact : ExactPath
    """

    checkable = False

    def __init__(self, exact: ExactPath) -> None:
        self._exact = exact
        self._inverse: Any = None
        self._S = exact.rows
        self._bounds: tuple[Piece, tuple[Any, ...], tuple[Any, ...]] | None = None

    def excluded(self, piece: Piece, system: IntervalSystem, leaf: EmptyLeaf) -> bool:
        """Whether the dual bounds at both ends of the piece are positive."""
        if self._inverse is None:
            self._inverse = self._exact.S.inv()
        lowest, highest = self._friction(piece)
        terms = []
        for row, value in zip(leaf.rows, leaf.values, strict=True):
            kind, node = divmod(int(row), self._exact.p)
            mode = imposed_interval_rows(
                leaf.codes[node], friction=highest[node] > 0, constant=lowest[node] == highest[node]
            ).get(kind)
            if mode is None or (mode == INEQUALITY and value <= 0):
                continue
            # multipliers of the scaled problem, back in the problem's units
            unit = system.scaled.length[node] if kind in _FORCE_ROWS else system.scaled.force[node]
            terms.append((kind, node, rational(float(value)) * rational(float(unit))))
        return all(self._positive(terms, g, lowest, highest) for g in self._loads(piece))

    def _friction(self, piece: Piece) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
        """Smallest and largest coefficients on the piece."""
        if self._bounds is None or self._bounds[0] != piece:
            ends = [self._exact.at(rational(alpha))[1] for alpha in (piece.a, piece.b)]
            self._bounds = (
                piece,
                tuple(min(pair) for pair in zip(*ends, strict=True)),
                tuple(max(pair) for pair in zip(*ends, strict=True)),
            )
        return self._bounds[1], self._bounds[2]

    def _loads(self, piece: Piece) -> list[tuple[Any, ...]]:
        """g at both ends, once where it does not vary; at an end where g vanishes its direction stands for it."""
        exact = self._exact
        origin = exact.origin
        ends: list[Fraction] = [piece.a, piece.b]
        if origin is not None and origin in [rational(end) for end in ends]:
            direction = 1 if rational(piece.b) > origin else -1
            return [tuple(direction * v for v in exact.g1)]
        return [exact.at(rational(end))[0] for end in (ends if exact.loaded else ends[:1])]

    def _positive(
        self,
        terms: list[tuple[int, int, Any]],
        g: tuple[Any, ...],
        lowest: tuple[Any, ...],
        highest: tuple[Any, ...],
    ) -> bool:
        """Whether -1/4 v' S^-1 v - sum u * constant > 0 with v = g + sum u * form."""
        p, v, total = self._exact.p, list(g), fmpq(0)
        for kind, node, u in terms:
            if kind == RowKind.NORMAL_FORCE:
                v[node] += u
            elif kind == RowKind.TANGENTIAL_FORCE:
                v[p + node] += u
            elif kind in (RowKind.CONE_PLUS, RowKind.CONE_MINUS):
                v[node] += u * highest[node]
                v[p + node] += -u if kind == RowKind.CONE_PLUS else u
            elif kind in (IntervalRowKind.SLIP_AT_LEAST_PLUS, IntervalRowKind.SLIP_AT_LEAST_MINUS):
                v[node] -= u * lowest[node]
                v[p + node] += u if kind == IntervalRowKind.SLIP_AT_LEAST_PLUS else -u
            else:
                index = node if kind == RowKind.PENETRATION else p + node
                factor = u if kind == RowKind.SLIP_FORWARD else -u
                # a row factor * w, w = g - S lambda
                v = [x - factor * s for x, s in zip(v, self._S[index], strict=True)]
                total -= factor * g[index]
        column = fmpq_mat([[x] for x in v])
        square = (column.transpose() * (self._inverse * column))[0, 0]
        return bool(4 * total > square)
