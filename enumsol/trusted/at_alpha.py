"""The trusted core: verified solves of selections on an EnclosedSystem (theory, sections 6.3 and 6.4).

Everything that makes the word "complete" true for a regular problem passes through the functions of this module,
in the search and in the checker alike; beside them is the test that several selections share one root (theory, section
14.9). Codes and row kinds are plain integers with the meaning documented in ``enumsol.trusted.selection``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import product
from typing import TYPE_CHECKING, Generic, NamedTuple, TypeVar

import numpy as np

from enumsol.arithmetic.balls import (
    ROOT_TINY,
    SAFE,
    TINY,
    UNIT,
    Ball,
    VerifiedSolution,
    column_scale,
    gamma,
    hull,
    upper_norm,
    verified_solve,
)
from enumsol.trusted.selection import Numbers, Selection, row_values
from enumsol.trusted.status_rows import CONDITIONS, SLIP_MINUS, SLIP_PLUS, STICK

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.support.array_types import Codes, Floats


@dataclass(frozen=True)
class VerifiedSelection:
    """The one solution of a selection whose matrix is proven regular for all data in the enclosure, as balls.

    Attributes
    ----------
    force : Ball of shape (2p,)
        lambda.
    w : Ball of shape (2p,)
        w = g - S lambda, exact zeros where the statuses set them.
    slack : Ball
        Of the inequalities; a root needs all of them to be nonnegative.
    index : int
        Sign of the determinant of the matrix, of a body that nothing holds as on weak springs (theory, section 14.2):
        the index of the root, if it is one.
    rigid : Ball of shape (r,), or None
        Of such a body, the coordinates q of its rigid displacement.
    """

    force: Ball
    w: Ball
    slack: Ball
    index: int
    rigid: Ball | None = None

    @property
    def is_root(self) -> bool:
        """All conditions hold strictly: exactly one root."""
        return bool(np.all(self.slack.mid > self.slack.rad))

    @property
    def is_excluded(self) -> bool:
        """Some condition is broken strictly: no root."""
        return bool(np.any(self.slack.mid < -self.slack.rad))


#: Radii of forces by the largest force, beyond which a solution is hardly placed.
_WIDE = 1e-3


@dataclass(frozen=True)
class ClosedSolution(VerifiedSelection):
    """The one solution of several selections, as balls: below some statuses, or that they share.

    Below a partial assignment it is that of a reduced problem (theory, section 6.11): ``index`` is the sign of the
    determinant of the fixed nodes' equations, and ``slack`` the conditions of the fixed nodes and, of every sliding
    one, the sign of its slip, unless it is open. Of selections that share it (theory, section 14.9) ``slack`` are the
    conditions that hold strictly in all of them; in which of them it is may depend on the data.

    Attributes
    ----------
    core : status codes, UNDECIDED at free nodes, FORWARD or BACKWARD at those that slide
        Of selections that share it that one in which all nodes between stick and slip stick.
    possible : per node the final codes that may hold there; those of a fixed node that holds strictly are its own only
    regular : VerifiedSelection or None
        Its selection's solution, where its balls were taken for it.
    """

    core: Codes = field(kw_only=True)
    possible: tuple[frozenset[int], ...] = field(kw_only=True)
    regular: VerifiedSelection | None = field(kw_only=True, default=None)

    @property
    def is_wide(self) -> bool:
        """The balls hardly tell where it lies."""
        return bool(np.max(self.force.rad, initial=0.0) > _WIDE * np.max(np.abs(self.force.mid), initial=0.0))

    def has(self, codes: Codes) -> bool:
        """True if it is the root of a selection, if that has one."""
        return all(code in held for code, held in zip(codes, self.possible, strict=True))

    @property
    def slips(self) -> tuple[tuple[int, int], ...]:
        """The nodes between stick and slip, and how they slip, of selections that share it."""
        return tuple((i, max(held)) for i, held in enumerate(self.possible) if len(held) > 1)


class _Solved(NamedTuple):
    """The solution of a selection's equations in scaled unknowns, the scale, lambda, and w with its zeros exact."""

    equations: VerifiedSolution
    scale: Floats
    force: Ball
    w: Ball


@np.errstate(over="ignore", invalid="ignore")
def solve_selection(system: EnclosedSystem, codes: Sequence[int]) -> VerifiedSelection | None:
    """The verified solution of a complete selection, or None when its matrix is not proven regular."""
    selection = Selection(codes, len(system.reach))
    if not len(selection.unknown):
        return _conditions(system, codes, Ball.exact(np.zeros(2 * system.p)), system.balls[1], 1)
    solved = _solved(system, selection)
    if solved is None:
        return None
    equations, _, force, w = solved
    found = _conditions(system, codes, force, w, equations.sign)
    if found.is_root or found.is_excluded:
        return found
    return _conditions(system, codes, force, _closer(system, selection, solved), equations.sign)


@dataclass(frozen=True)
class Unsettled:
    """A selection of which it is not proven whether it holds a root; its verified solution, if it has one."""

    near: VerifiedSelection | None


def settled_selection(
    system: EnclosedSystem,
    codes: Codes,
    precisely: Callable[[Codes], VerifiedSelection | None] = lambda _: None,
) -> VerifiedSelection | Unsettled | None:
    """The root of a complete selection, None where it holds none, or that this is open.

    The one criterion of the search, which writes such a leaf, and of the checker, which reads it. ``precisely`` gives
    the verified solution in many digits, or None; it is asked where double arithmetic does not decide.
    """
    ball = solve_selection(system, codes)
    if ball is None or not ball.is_root:
        if (ball is not None and ball.is_excluded) or contradicts(system, codes):
            return None
        ball = precisely(codes) or ball
        if ball is not None and ball.is_excluded:
            return None
    return ball if ball is not None and ball.is_root else Unsettled(ball)


def contradicts(system: EnclosedSystem, codes: Sequence[int]) -> bool:
    """True if the equations M z = b of a complete selection are proven to hold for no forces that a root can have.

    At a root lambda' S lambda <= g' lambda, so that ||z|| <= ||lambda|| <= ||g|| / mu with mu the smallest eigenvalue
    of S; of a body that nothing holds theory, (14.5), bounds the unknowns. Any vector y for which |y'b| is more than
    ||M'y|| times this bound excludes that; the one tried is close to the left null vectors of a singular or nearly
    singular M. Where the equations miss a continuum of solutions by d, the margin is of order d, that of the energy
    only of order d^2.
    """
    with np.errstate(over="ignore", divide="ignore", invalid="ignore", under="ignore"):
        selection, (S, g, F) = Selection(codes, len(system.reach)), system.balls
        M, b = selection.matrix(S, F), g[selection.unknown]
        if not len(b.mid) or not np.all(np.isfinite(M.mid)):
            return False
        try:
            U, sizes, _ = np.linalg.svd(M.mid)
        except np.linalg.LinAlgError:
            return False
        sizes = np.maximum(sizes / np.max(np.abs(system.S)), UNIT)
        y = U @ ((b.mid @ U) / sizes**2)
        # its length does not matter
        y /= np.max(np.abs(y))
        y_abs, k = np.abs(y), gamma(len(b.mid) + 2)
        least = abs(float(y @ b.mid)) - float(y_abs @ (b.rad + k * np.abs(b.mid))) * (1 + 2 * k) * SAFE - TINY
        product = np.abs(y @ M.mid) + y_abs @ (M.rad + k * np.abs(M.mid)) * (1 + 2 * k) * SAFE
        return bool(least > upper_norm(product) * system.largest_unknowns * SAFE + ROOT_TINY)


def displacements(system: EnclosedSystem, codes: Sequence[int]) -> Ball | None:
    """w of the one solution of a selection's equations, (2p,), as close as its data allow; None if it may be singular.

    Whether the solution satisfies the selection's conditions does not matter.
    """
    selection = Selection(codes, len(system.reach))
    with np.errstate(over="ignore", invalid="ignore"):
        solved = _solved(system, selection) if len(selection.unknown) else None
        w = system.balls[1] if not len(selection.unknown) else solved and _closer(system, selection, solved)
    return w and w[: 2 * system.p]


def _solved(system: EnclosedSystem, selection: Selection) -> _Solved | None:
    """The solution of a selection's equations, of which there are some; None if they are not proven regular."""
    (S, g, F), rows = system.balls, selection.unknown
    # scale the columns by powers of two, so that the unknowns are comparable in the contraction
    M = selection.matrix(S, F)
    scale = column_scale(M)
    # what underflows in the scaling is less than TINY
    solved = verified_solve(M.mid * scale, M.rad * scale + TINY, g.mid[rows], g.rad[rows])
    if solved is None:
        return None
    force = selection.forces(Ball(solved.y * scale, solved.radius * scale + TINY), F)
    w = g - S @ force
    w[rows] = 0.0
    return _Solved(solved, scale, force, w)


def _closer(system: EnclosedSystem, selection: Selection, found: _Solved) -> Ball:
    """w with radii in which errors of lambda cancel: those of a solution of ill-conditioned equations do.

    With lambda = E (y + e), e = R rest + (I - R M) e: S E R is not large where S E and R are.
    """
    solved, scale, force, w = found
    (S_ball, g, _), size, slipping = system.balls, gamma(selection.size + 2), selection.slip
    S = S_ball.mid
    moved = selection.columns(S, system.F) * scale
    product, reach = moved @ solved.inverse, np.abs(moved)
    k = gamma(moved.shape[1] + 8)
    # what rounds off in the inverse and in both products, and what is left of e
    beside = (np.abs(solved.inverse) * k + solved.rounded) @ solved.rest + solved.defect @ solved.radius
    error = (np.abs(product) @ solved.rest) * (1 + k) + (reach @ beside) * (1 + k) ** 3
    # of F, where E is a ball, and of S and g; then of g - S lambda as it is computed
    most = np.abs(force.mid) + force.rad
    turned = np.zeros_like(most)
    turned[system.p + slipping] = (system.F_rad + 4 * UNIT * system.F)[slipping] * most[slipping]
    error += g.rad + S_ball.rad @ most + np.abs(S) @ (turned + size * most)
    radius = np.fmin(w.rad, (error * (1 + size) + size * np.abs(g.mid)) * SAFE * SAFE + TINY)
    radius[selection.unknown] = 0.0
    return Ball(w.mid, radius)


def _conditions(system: EnclosedSystem, codes: Sequence[int], force: Ball, w: Ball, sign: int) -> VerifiedSelection:
    slack = conditions_of(codes, force, w, system.balls[2])
    if not len(system.reach):
        return VerifiedSelection(force, w, slack, sign)
    # the unknowns beyond the contact forces are -q, by which the columns of the border change sign
    contact, rigid = 2 * system.p, -force[2 * system.p :]
    if np.all(np.isfinite(system.reach)):
        reach = Ball.exact(system.reach)
        slack = Ball.joined(slack, reach - rigid, reach + rigid)
    sign = -sign if len(system.reach) % 2 else sign
    return VerifiedSelection(force[:contact], w[:contact], slack, sign, rigid)


def conditions_of(codes: Sequence[int], force: Numbers, w: Numbers, F: Numbers) -> Numbers:
    """Values of the inequalities of a complete selection, node by node, as balls or numbers of any kind."""
    kinds, nodes = np.array([(kind, i) for i, code in enumerate(codes) for kind in CONDITIONS[code][1]]).T
    values: Numbers = row_values(force, w, F)[kinds, nodes]
    return values


#: Nodes between stick and slip at most: there are twice as many selections for each.
MOST_BETWEEN = 8
#: The rows that change places there: the slip bound of a sticking node, and the slip of one that slips.
_PAIRS = {SLIP_PLUS: {STICK: 2, SLIP_PLUS: 5}, SLIP_MINUS: {STICK: 3, SLIP_MINUS: 6}}


def joint_root(system: EnclosedSystem, core: Codes, slips: Mapping[int, int]) -> ClosedSolution | None:
    """The root that selections share, of which some nodes stick or slip; None where that is not proven.

    Parameters
    ----------
    system : EnclosedSystem
    core : complete codes
    slips : the nodes, all of which stick in ``core``, and SLIP_PLUS or SLIP_MINUS for each
    """
    if not 0 < len(slips) <= MOST_BETWEEN or any(core[i] != STICK or slips[i] not in _PAIRS for i in slips):
        return None
    possible = tuple(frozenset((code, slips.get(i, code))) for i, code in enumerate(core))
    balls, strict = list[VerifiedSelection](), list[Ball]()
    for codes in product(*possible):
        ball = solve_selection(system, codes)
        if ball is None or (balls and ball.index != balls[0].index):
            return None
        left = {i: _PAIRS[slips[i]][codes[i]] for i in slips}
        rows = [(kind, i) for i, code in enumerate(codes) for kind in CONDITIONS[code][1]]
        between = np.array([left.get(i) == kind for kind, i in rows] + [False] * (len(ball.slack.mid) - len(rows)))
        if not np.all(between | (ball.slack.mid > ball.slack.rad)):
            return None
        balls.append(ball)
        strict.append(ball.slack[~between])
    force, w = (hull([getattr(ball, name) for ball in balls]) for name in ("force", "w"))
    rigid = [ball.rigid for ball in balls if ball.rigid is not None]
    slack, moved = Ball.joined(*strict), hull(rigid) if rigid else None
    return ClosedSolution(force, w, slack, balls[0].index, moved, core=core, possible=possible)


Leaf = TypeVar("Leaf")


class Apart(NamedTuple, Generic[Leaf]):
    """Leaves by the roots that they hold.

    Attributes
    ----------
    kept : one leaf of every root
    doubtful : those of them whose root may be that of another one
    same : every other leaf, with one whose root is proven to be its own
    """

    kept: list[Leaf]
    doubtful: list[Leaf]
    same: list[tuple[Leaf, Leaf]]


def told_apart(
    found: Iterable[Leaf], same: Callable[[Leaf, Leaf], bool | None], known: Sequence[Leaf] = ()
) -> Apart[Leaf]:
    """Leaves by the roots that they hold, without those whose roots are among known ones.

    Parameters
    ----------
    found : leaves with one root each
    same : whether the roots of two leaves, the earlier one first, are one for all data in their balls; None: open
    known : leaves whose roots are different
    """
    apart: Apart[Leaf] = Apart([], [], [])
    for one in found:
        others = [*known, *apart.kept]
        answers = [same(other, one) for other in others]
        if True in answers:
            apart.same.append((one, others[answers.index(True)]))
            continue
        if None in answers:
            apart.doubtful.append(one)
        apart.kept.append(one)
    return apart
