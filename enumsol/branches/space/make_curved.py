"""Vertices and arcs in the user's terms, made from curves in 3D (theory, section 12.10)."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from enumsol.arithmetic.algebraic import EnclosedAlpha
from enumsol.arithmetic.rationals import rational
from enumsol.branches.elements import (
    END_ELSEWHERE,
    TOLD_APART,
    Arc,
    ArcValues,
    VertexKind,
    make_vertex,
    sides_of,
    tangential,
    with_exact_zeros,
)
from enumsol.model.statuses import ContactStatus, space_status
from enumsol.search.space.curve_proposals import border_of_forces, border_of_zeta, curve_point, placed, unplaced
from enumsol.trusted.space.curve_parts import Run, Turn, ends_of, side_of
from enumsol.trusted.space.solution_curve import AlphaProblem

if TYPE_CHECKING:
    from collections.abc import Sequence, Set

    from enumsol.branches.elements import Pair, Sides, Vertex
    from enumsol.model.problem3d import ContactProblem3D
    from enumsol.support.array_types import Codes, Floats

    Bounds = tuple[Fraction, Fraction]


@dataclass(frozen=True, eq=False)
class CurvedArcValues(ArcValues):
    """Values in double arithmetic along a part of a curve on which alpha goes one way.

    Attributes
    ----------
    given : AlphaProblem
    problem : ContactProblem3D
    codes : statuses
    knots : (K + 1, m + 1) array
        Points (lambda_n, both lambda_t, alpha) in the order of alpha, m = 3p; of a body that nothing holds its rigid
        displacement is before alpha, m = 3p + r.
    borders : (K, m + 1) array
        Rows of the parameter between two of them, by forces and alpha.
    """

    given: AlphaProblem
    problem: ContactProblem3D
    codes: Codes
    knots: Floats
    borders: Floats

    def point(self, alpha: float) -> Floats:
        """Forces and alpha of the solution on the arc; beside its ends those of its first or last knot."""
        k = bisect_right(self.knots[:, -1].tolist(), alpha) - 1
        if not 0 <= k < len(self.borders):
            return np.asarray(self.knots[max(0, min(k, len(self.borders)))])
        start, end, border = self.knots[k], self.knots[k + 1], self.borders[k]
        row = border_of_zeta(self.given, border)
        low, high, share = 0.0, 1.0, float((alpha - start[-1]) / (end[-1] - start[-1]))
        x: Floats = start + share * (end - start)
        for _ in range(60):
            found = curve_point(self.given, placed(self.given, start + share * (end - start)), row)
            if found is None:
                break
            x, off = unplaced(self.given, found.x), float(found.x[-1] - alpha)
            if abs(off) <= 2.0**-50 * max(1.0, abs(alpha)):
                break
            low, high = (share, high) if off < 0 else (low, share)
            # by the curve's direction, which has the product one with the border
            length = float(border @ (end - start))
            rate = float(found.direction[-1]) * length
            ahead = share - off / rate if rate else low
            share = ahead if low < ahead < high else 0.5 * (low + high)
        return x

    def at(self, alpha: Fraction) -> Pair:
        """Forces and displacements at an alpha."""
        return state_of(self.problem, self.point(float(alpha)), [{code} for code in self.codes])

    def record(self) -> dict[str, Any]:
        """Its points, and the rows of the parameter between them."""
        return {"knots": self.knots.tolist(), "borders": self.borders.tolist()}


def state_of(problem: ContactProblem3D, x: Floats, active: Sequence[Set[int]]) -> Pair:
    """Forces and displacements of forces and alpha x, with the zeros of the statuses that hold at every node."""
    m, condensed = 3 * problem.p, problem.on_springs.condensed
    forces = x[:m]
    w = condensed.free_displacements(float(x[-1])) - condensed.S @ forces
    if not problem.held:
        w = w + problem.contact_rows @ (problem.modes.N @ x[m:-1])
    return with_exact_zeros((forces + 0.0, w), active)


@dataclass
class _Piece:
    """An arc that will be, and the numbers of its places."""

    run: Run
    ends: tuple[int, int]
    begin: Fraction | None
    end: Fraction | None


@dataclass
class CurvedGraph:
    """Vertices and arcs of curves over an interval.

    Attributes
    ----------
    problem : ContactProblem3D
    given : AlphaProblem
    interval : first and last alpha
    reasons : what stayed open
    left_open : ranges of alpha outside of which nothing of that is missing
    """

    problem: ContactProblem3D
    given: AlphaProblem
    interval: Bounds
    reasons: list[str] = field(default_factory=list)
    left_open: list[Bounds] = field(default_factory=list)
    _places: list[Turn] = field(default_factory=list)
    #: Numbers of places on the border of the interval, and of those where nothing is known.
    _borders: set[int] = field(default_factory=set)
    _missing: set[int] = field(default_factory=set)
    _pieces: list[_Piece] = field(default_factory=list)

    # -- curves ----------------------------------------------------------------------------------------------------

    def add(
        self,
        parts: Sequence[Run | Turn],
        ends: tuple[Bounds | None, Bounds | None],
        remedy: str | None,
        *,
        closed: bool = False,
    ) -> None:
        """Take in a curve; only what lies over the interval.

        Parameters
        ----------
        parts : of a closed curve all of them
        ends : bounds of alpha at a first and a last point beyond which it is not known
            Such an end is not settled.
        remedy : what may prove more of it, None where it is told elsewhere that something is missing there
        closed : whether the last part goes on with the first one
        """
        known: dict[int, int] = {}
        parts, open_ends = _with_open_ends(parts, ends) if parts else (parts, [])
        if remedy is not None:
            self._tell_ends([end.alphas for end in open_ends], remedy)
        for part in parts:
            if part in open_ends:
                continue
            if isinstance(part, Turn) and not part.settled and side_of(part.alphas, self.interval) in (0, None):
                low, high = (float(end) for end in part.alphas)
                self._leave_open(
                    f"between alpha = {low!r} and {high!r} it stayed open how a curve changes its statuses or turns, "
                    f"for it was not shown that one condition alone changes its sign there; {TOLD_APART}",
                    part.alphas,
                )
        for k, part in enumerate(parts):
            if isinstance(part, Run):
                self._take(parts, k, known, closed=closed)

    def _leave_open(self, reason: str, *alphas: Bounds) -> None:
        """Note what is open, and between which alphas."""
        self.reasons.append(reason)
        self.left_open.append((min(low for low, _ in alphas), max(high for _, high in alphas)))

    def _tell_ends(self, ends: Sequence[Bounds], remedy: str) -> None:
        """Say where a curve that is not whole ends inside the interval."""
        a, b = self.interval
        near = [(max(low, a), min(high, b)) for low, high in ends if side_of((low, high), (a, b)) in (0, None)]
        inside = [f"{float((low + high) / 2):.8g}" for low, high in near]
        if inside:
            self.reasons.append(f"a curve was not followed beyond its ends at alpha = {' and '.join(inside)}; {remedy}")

    def _take(self, parts: Sequence[Run | Turn], k: int, known: dict[int, int], *, closed: bool) -> None:
        run = parts[k]
        if not isinstance(run, Run):
            return
        ends = ends_of(parts, k, closed=closed)
        sides = [side_of(alphas, self.interval) for _, alphas, _ in ends]
        if sides[0] == 1 or sides[1] == -1:
            return
        numbers: list[int] = []
        inner: list[Fraction | None] = []
        for (number, _, beyond), side, way in zip(ends, sides, (-1, 1), strict=True):
            # an end that is not open is beyond the interval
            if number is None or side == way:
                numbers.append(self._border(run, self.interval[way > 0]))
                inner.append(None)
                continue
            turn = cast("Turn", parts[number])
            if number not in known:
                known[number] = self._turn(turn, settled=turn.settled and side == 0)
            numbers.append(known[number])
            settled = self._places[known[number]].settled
            if not settled:
                # the arc may end beside it
                self.left_open.append((min(beyond[0], turn.alphas[0]), max(beyond[1], turn.alphas[1])))
            # beside what is open an arc is known to hold up to its last point
            reach = beyond if not turn.settled else turn.alphas
            inner.append(None if settled else reach[way < 0])
        begin, end = (self._limits(numbers[j], inner[j]) for j in (0, 1))
        if begin < end:
            self._pieces.append(_Piece(run, (numbers[0], numbers[1]), inner[0], inner[1]))
        else:
            self._leave_open(
                f"an arc near alpha = {float(begin)!r} is shorter than its ends are known; {TOLD_APART}",
                run.start,
                run.end,
                *(self._places[number].alphas for number in numbers),
            )
            for number in numbers:
                # an arc is missing there; that the curve has a solution at the border is not known
                self._places[number] = replace(self._places[number], settled=False)
                self._missing |= {number} & self._borders

    def _limits(self, number: int, inner: Fraction | None) -> Fraction:
        return sum(self._places[number].alphas, Fraction(0)) / 2 if inner is None else inner

    def _border(self, run: Run, alpha: Fraction) -> int:
        x = self._values(run).point(float(alpha))
        self._borders.add(len(self._places))
        return self._placed(Turn((alpha, alpha), x, (run.codes,), settled=True))

    def _placed(self, turn: Turn) -> int:
        """The number of a place where a vertex will be, with forces in place of zeta."""
        self._places.append(turn)
        return len(self._places) - 1

    def _turn(self, turn: Turn, *, settled: bool) -> int:
        a, b = self.interval
        alphas = turn.alphas if settled else (max(turn.alphas[0], a), min(turn.alphas[1], b))
        if not settled and turn.settled:
            low, high = (float(end) for end in turn.alphas)
            self._leave_open(
                f"whether a change between alpha = {low!r} and {high!r} lies inside the interval stayed open; "
                f"{END_ELSEWHERE}",
                turn.alphas,
            )
        return self._placed(replace(turn, alphas=alphas, x=unplaced(self.given, turn.x), settled=settled))

    def _values(self, run: Run) -> CurvedArcValues:
        knots = unplaced(self.given, np.array(run.knots)[:: run.rises])
        borders = border_of_forces(self.given, np.array(run.borders)[:: run.rises])
        return CurvedArcValues(self.given, self.problem, run.codes, knots, borders)

    # -- in the user's terms ---------------------------------------------------------------------------------------

    def made(self) -> tuple[list[Vertex], list[Arc]]:
        """Vertices in the order of alpha, and arcs."""
        there = (k for k in range(len(self._places)) if k not in self._missing)
        order = sorted(there, key=lambda k: self._places[k].alphas)
        number = {old: new for new, old in enumerate(order)}
        places = [self._places[k] for k in order]
        exact = [EnclosedAlpha(*map(rational, place.alphas)) for place in places]
        pieces = sorted(self._pieces, key=lambda piece: (number[piece.ends[0]], number[piece.ends[1]]))
        arcs = [self._arc(k, piece, number, exact) for k, piece in enumerate(pieces)]
        sides = sides_of(arcs, len(places))
        vertices = [
            self._vertex(k, place, exact[k], sides[k], border=order[k] in self._borders)
            for k, place in enumerate(places)
        ]
        for reason, *alphas in unordered(vertices):
            self._leave_open(reason, *alphas)
        return vertices, arcs

    def _arc(self, number: int, piece: _Piece, numbers: dict[int, int], exact: Sequence[EnclosedAlpha]) -> Arc:
        run = piece.run
        tail, head = (numbers[end] for end in piece.ends)
        begin, end = (
            exact[vertex] if known is None else EnclosedAlpha(rational(known), rational(known))
            for vertex, known in ((tail, piece.begin), (head, piece.end))
        )
        low, high = begin.enclosure()[1], end.enclosure()[0]
        sample, values = (low + high) / 2, self._values(run)
        return Arc(
            number=number,
            statuses=self._statuses(run.codes, values.at(sample)),
            lo=float(begin),
            hi=float(end),
            tail=tail,
            head=head,
            index=run.index or None,
            selections=(run.codes,),
            begin=begin,
            end=end,
            sample=sample,
            _values=values,
        )

    def _statuses(self, codes: Codes, state: Pair) -> tuple[ContactStatus, ...]:
        slip = tangential(state[1], self.problem.p)
        return tuple(map(space_status, codes, slip))

    def _vertex(self, number: int, place: Turn, exact: EnclosedAlpha, sides: Sides, *, border: bool) -> Vertex:
        active = [frozenset(codes) for codes in zip(*place.selections, strict=True)]
        state = state_of(self.problem, place.x, active if place.settled else [frozenset()] * self.problem.p)
        named = [self._statuses(codes, state) for codes in place.selections]
        names = tuple(frozenset(held) for held in zip(*named, strict=True))
        return make_vertex(
            number,
            exact,
            sides,
            state,
            names,
            place.selections,
            border=border,
            settled=place.settled,
            bounded=place.bounded,
        )


def _with_open_ends(
    parts: Sequence[Run | Turn], ends: tuple[Bounds | None, Bounds | None]
) -> tuple[list[Run | Turn], list[Turn]]:
    """With a turn that is not settled at every end with bounds of alpha, and these turns."""
    found, turns = list(parts), []
    for alphas, place in zip(ends, (0, -1), strict=True):
        if alphas is None:
            continue
        last = found[place]
        if isinstance(last, Turn):
            bounds = *alphas, *last.alphas
            turn = replace(last, alphas=(min(bounds), max(bounds)), settled=False)
            found[place] = turn
        else:
            turn = Turn(alphas, last.knots[place], (last.codes,), settled=False)
            found.insert(0 if place == 0 else len(found), turn)
        turns.append(turn)
    return found, turns


def unordered(vertices: Sequence[Vertex]) -> list[tuple[str, Bounds, Bounds]]:
    """Vertices at which the number of solutions changes and which bounds of alpha do not put in an order, in pairs."""
    changing = [v for v in vertices if not v.border and v.kind not in (VertexKind.TRANSITION, VertexKind.UNSETTLED)]
    return [
        (
            f"which of the vertices {one.number} and {other.number} is at the smaller alpha stayed open, near "
            f"{one.alpha!r}; {TOLD_APART}",
            one.enclosure,
            other.enclosure,
        )
        for k, one in enumerate(changing)
        for other in changing[k + 1 :]
        if one.exact.compare(other.exact) == 0
    ]
