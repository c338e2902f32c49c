"""All solutions of a problem in 3D at one alpha; regions of leaves left undecided (theory, sections 12 and 12.5)."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, smaller, solution, upper_norm
from enumsol.condensation.condensed import CondensedProblem, condensation_of
from enumsol.condensation.enclosure import moved_by_modes
from enumsol.errors import InvalidArgumentError
from enumsol.model.sectors import SECTORS
from enumsol.model.statuses import (
    CONTACT,
    FRICTIONLESS,
    OPEN,
    SLIP_MINUS,
    SLIP_PLUS,
    STICK,
    UNDECIDED,
    ContactStatus,
    space_status,
)
from enumsol.roots.enumeration import Enumeration
from enumsol.roots.local_branch import SelectionTangent
from enumsol.roots.root import Enclosure, Root
from enumsol.roots.root_set import RootSet, Undecided
from enumsol.search.space.open_leaves import Cause
from enumsol.search.space.space_search import SpaceSolvers
from enumsol.support.deadlines import over, tell
from enumsol.support.immutable import sealed
from enumsol.trusted.space.boxed_solution import BoxedSolution, apart_in_boxes
from enumsol.trusted.space.leaves import Open, SpaceRoot, distinct_roots, settle, unsettled
from enumsol.trusted.space.space_uniqueness import LooseSolution

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.search.certifiers.protocol import UndecidedPart
    from enumsol.support.array_types import Codes, Floats, Indices, Mask


#: The first of these that may hold is the status of a root of which several may.
_STATUSES = (ContactStatus.OPEN, ContactStatus.STICK, ContactStatus.SLIP)


class SpaceEnumeration(Enumeration[SpaceSolvers]):
    """One call of enumerate_roots in 3D."""

    def _distinct(self) -> tuple[list[tuple[Codes, Any]], list[Codes]]:
        verified = self.certifier.certified.verified
        boxed = [leaf for leaf in verified.items() if isinstance(leaf[1], BoxedSolution)]
        only = [leaf for leaf in verified.items() if type(leaf[1]) is LooseSolution]
        if only:
            return only, []
        regular = distinct_roots(leaf for leaf in verified.items() if not isinstance(leaf[1], BoxedSolution))
        others = apart_in_boxes(regular.kept, boxed)
        return [*regular.kept, *others.kept], [codes for codes, _ in (*regular.doubtful, *others.doubtful)]

    def _enough(self, stop_after: int) -> Callable[[list[Any]], bool]:
        return lambda solutions: len(solutions) >= stop_after and len(self._distinct()[0]) >= stop_after

    def _result(self) -> RootSet:
        outcome = self.outcome
        distinct, doubtful = self._distinct()
        roots = [
            self._loose(root) if isinstance(root, LooseSolution) else self.root(codes, root) for codes, root in distinct
        ]
        if self.unloaded:
            roots = [self._rest()]
        roots.sort(key=lambda root: (-float(np.sum(root.lambda_n)), root.lambda_n.tolist(), root.lambda_t.tolist()))
        undecided = [*self._undecided(outcome.undecided), *(self._doubtful(codes) for codes in doubtful)]
        whole = outcome.stopped is None and not undecided
        return self._root_set(roots, undecided, None if whole else self._at_least(len(roots) - len(doubtful)))

    # -- in the user's terms ---------------------------------------------------------------------------------------

    def root(self, codes: Codes, found: SpaceRoot) -> Root:
        """The root that a leaf holds."""
        forces, F = self._forces(found.y.mid), self.solvers.system.F
        rigid = None if found.rigid is None else self._in_units(found.rigid)
        u_n, u_t = self._displacements(*forces, rigid)
        closed = np.array([code != OPEN for code in codes])
        u_n = np.where(closed, 0.0, np.minimum(u_n, 0.0))
        u_t = np.where((np.array(codes) == STICK)[:, None] & (F > 0), 0.0, u_t)
        statuses = tuple(space_status(code, u_t[i]) for i, code in enumerate(codes))
        active, bounds = [frozenset((status,)) for status in statuses], self._root_enclosure(codes, found)
        root = self._root(statuses, active, forces, (u_n, u_t), self._angles(codes, found), found.index, bounds)
        flat, moved = (np.append(normal, along.ravel(order="F")) for normal, along in (forces, (u_n, u_t)))
        return replace(
            root,
            regular=True,
            margin=found.slack,
            _tangent=SelectionTangent.at(self.problem, self.alpha, codes, flat, moved),
            _rigid=None if rigid is None else rigid.mid + 0.0,
        )

    def _loose(self, found: LooseSolution) -> Root:
        """A solution whose statuses need not be known."""
        tau, bounds, forces = self.solvers.system.tau, self._enclosure(found.y, found.w), self._forces(found.y.mid)
        u_n, u_t = self._displacements(*forces)
        u_n, u_t = (np.clip(u, b[..., 0], b[..., 1]) for u, b in ((u_n, bounds.u_n), (u_t, bounds.u_t)))
        active = [frozenset(_possible(found, i, u_t[i], rubs=bool(np.any(tau[i] >= 0)))) for i in range(len(tau))]
        statuses = [next(status for status in _STATUSES if status in held) for held in active]
        return self._root(statuses, active, forces, (u_n, u_t), self._loose_angles(found), found.index, bounds)

    def _root(
        self,
        statuses: Sequence[ContactStatus],
        active: Sequence[frozenset[ContactStatus]],
        forces: tuple[Floats, Floats],
        moved: tuple[Floats, Floats],
        slip_angle: Floats,
        index: int,
        bounds: Enclosure | None,
    ) -> Root:
        """A root that is not known to be regular, with its bounds in verified arithmetic."""
        return Root(
            alpha=self.alpha,
            statuses=tuple(statuses),
            active=tuple(active),
            lambda_n=forces[0],
            lambda_t=forces[1],
            u_n=moved[0],
            u_t=moved[1],
            slip_angle=slip_angle,
            index=index,
            regular=False,
            margin=0.0,
            enclosure=bounds if self.arithmetic == "verified" else None,
            _condensed=self._condensed,
        )

    def _forces(self, scaled: Floats) -> tuple[Floats, Floats]:
        """lambda_n and lambda_t."""
        system = self.solvers.system
        unit = system.force
        return scaled[: system.p] * unit, system.tangential(scaled) * system.F * unit[:, None]

    def _loose_angles(self, found: LooseSolution) -> Floats:
        return np.array([_around(*pair) for pair in zip(*loose_angles(self.solvers.enclosed, found), strict=True)])

    @cached_property
    def _condensed(self) -> CondensedProblem:
        """Condensation with which roots compute their displacements."""
        return condensation_of(self.problem)

    def _in_units(self, rigid: Ball) -> Ball:
        """Coordinates of a rigid displacement, without the units of their rows, which are powers of two."""
        unit = self.solvers.enclosed.rigid_unit
        return Ball(rigid.mid * unit, rigid.rad * unit)

    @cached_property
    def _moved(self) -> Ball:
        """B N in the problem's units, (3p, r), of a body that nothing holds."""
        return moved_by_modes(self.problem)

    @cached_property
    def _in_balls(self) -> tuple[Ball, Ball]:
        """S and g in the problem's units, those of all 3p rows: as enclosed, or in fast arithmetic as computed."""
        problem, size = self.problem.on_springs, 3 * self.problem.p
        if self.arithmetic != "verified":
            return Ball.exact(problem.condensed.S), Ball.exact(problem.condensed.free_displacements(self.alpha))
        ones = np.ones(size)
        S, S_rad, g, g_rad = problem.enclosure.in_units(Fraction(self.alpha), ones, ones)
        return Ball(S, S_rad), Ball(g, g_rad)

    def _displacements(self, lambda_n: Floats, lambda_t: Floats, rigid: Ball | None = None) -> tuple[Floats, Floats]:
        """u_n and u_t; floats may have S and g off by more than the root's enclosure is wide."""
        S, g = self._in_balls
        w = g.mid - S.mid @ np.concatenate([lambda_n, lambda_t.ravel(order="F")])
        if rigid is not None:
            w += self._moved.mid @ rigid.mid
        return w[: self.problem.p], w[self.problem.p :].reshape(2, -1).T

    def _angles(self, codes: Codes, found: SpaceRoot) -> Floats:
        """Bounds of the directions of v."""
        pairs = zip(*slip_angles(self.solvers.enclosed, codes, found), strict=True)
        return np.array([_around(middle, radius) for middle, radius in pairs])

    def _enclosure(self, y: Ball, w: Ball, rigid: Ball | None = None) -> Enclosure:
        """Bounds in the problem's units, for scaled forces and displacements in balls.

        ``rigid``: of a body that nothing holds, coordinates of its rigid displacement, by default all in question.
        """
        system, exact, p = self.solvers.system, self.solvers.enclosed, self.problem.p
        S, g = self._in_balls
        forces, known = exact.forces_of(y, system.force), exact.displacements_of(w, system.length)
        computed, moves = g - (S @ forces[:, None])[:, 0], None
        if not exact.held:
            rigid = self._in_units(Ball(0.0 * exact.reach, exact.reach) if rigid is None else rigid)
            computed = computed + (self._moved @ rigid[:, None])[:, 0]
            moves = np.stack([rigid.mid - rigid.rad * SAFE, rigid.mid + rigid.rad * SAFE], axis=1)
        bounds = [(b.mid - b.rad * SAFE, b.mid + b.rad * SAFE) for b in (forces, known, computed)]
        low, high = np.maximum(bounds[1][0], bounds[2][0]), np.minimum(bounds[1][1], bounds[2][1])
        bounds[0][0][:p], high[:p] = np.maximum(bounds[0][0][:p], 0.0), np.minimum(high[:p], 0.0)
        pairs = [np.stack(pair, axis=-1) for pair in (bounds[0], (low, high))]
        parts = [(b[:p], np.stack([b[p : 2 * p], b[2 * p :]], axis=1)) for b in pairs]
        return Enclosure(*parts[0], *parts[1], moves)

    def _root_enclosure(self, codes: Codes, found: SpaceRoot) -> Enclosure | None:
        if self.arithmetic != "verified":
            return None
        y, w = with_zeros(self.solvers.enclosed, codes, found.y, found.w)
        return self._enclosure(y, w, found.rigid)

    # -- what stayed undecided -------------------------------------------------------------------------------------

    def _undecided(self, parts: Sequence[UndecidedPart]) -> list[Undecided]:
        """Leaves as regions, with a reason that leaves of them have, then the parts that were not searched."""
        leaves = {part.codes: part for part in parts if part.examined}
        found = []
        for region in regions_of(self.solvers.enclosed, list(leaves)) if leaves else ():
            reasons = [(leaves[codes].reason, leaves[codes].hint) for codes in region.codes]
            # at the borders of what is singular conditions hold with equality as well
            telling = [each for each in reasons if each[0] != Cause.EQUALITY.value]
            ((reason, hint), _), *_ = Counter(telling or reasons).most_common()
            found.append(
                Undecided(
                    statuses=_common([_names(codes) for codes in region.codes]),
                    reason=reason,
                    hint=hint,
                    leaves=len(region.codes),
                    slip_angle=region.slip_angle,
                    bounds=self._enclosure(region.y, region.w) if self.arithmetic == "verified" else None,
                )
            )
        rest = [part for part in parts if not part.examined]
        return found + [Undecided(_names(part.codes), part.reason, part.hint) for part in rest]

    def _doubtful(self, codes: Codes) -> Undecided:
        root = self.certifier.certified.verified[codes]
        if isinstance(root, LooseSolution):
            angles = self._loose_angles(root)
            bounds = self._enclosure(root.y, root.w) if self.arithmetic == "verified" else None
        else:
            angles, bounds = self._angles(codes, root), self._root_enclosure(codes, root)
        reason = "two leaves hold roots that could not be told apart"
        return Undecided(_names(codes), reason, "perturb the load", slip_angle=angles, bounds=bounds)


def _names(codes: Codes) -> tuple[ContactStatus | str | None, ...]:
    special: dict[int, ContactStatus | str | None] = {UNDECIDED: None, CONTACT: "contact", FRICTIONLESS: "contact"}
    special |= {OPEN: ContactStatus.OPEN, STICK: ContactStatus.STICK}
    return tuple(special.get(code, ContactStatus.SLIP) for code in codes)


def _common(leaves: Sequence[tuple[ContactStatus | str | None, ...]]) -> tuple[ContactStatus | str | None, ...]:
    """Status of every node in all leaves; "contact" or None where they differ."""
    nodes = [set(names) for names in zip(*leaves, strict=True)]
    return tuple(node.pop() if len(node) == 1 else None if ContactStatus.OPEN in node else "contact" for node in nodes)


def _possible(found: LooseSolution, i: int, u_t: Floats, *, rubs: bool) -> list[ContactStatus]:
    """The statuses that a node may have."""
    touching = [space_status(FRICTIONLESS, u_t)] if found.stick[i] else []
    if rubs:
        touching = [ContactStatus.STICK] * bool(found.stick[i]) + [ContactStatus.SLIP] * bool(found.slip[i])
    return [ContactStatus.OPEN] * bool(found.open[i]) + touching


def _around(middle: float, radius: float) -> Floats:
    """Bounds of an angle, the lower one in [-pi, pi)."""
    low = middle - radius
    turns = np.floor((low + np.pi) / (2.0 * np.pi))
    return sealed(np.array([low, middle + radius]) - 2.0 * np.pi * turns)


def check_supported(arithmetic: str, method: str, engine: str | None) -> None:
    """Refuse what is not offered in 3D.

    Raises
    ------
    InvalidArgumentError
        The first such argument is named.
    """
    for wrong, sentence in (
        (
            arithmetic == "exact",
            'arithmetic is "exact", which problems in 3D do not have; expected "verified" or "fast"',
        ),
        (method != "tree", 'method is "exhaustive", which problems in 3D do not have; expected "tree"'),
        (engine == "clarabel", 'engine is "clarabel", which problems in 3D do not take; expected None'),
    ):
        if wrong:
            raise InvalidArgumentError(sentence)


@dataclass(frozen=True)
class Region:
    """Leaves that touch, and what bounds every root in them.

    Attributes
    ----------
    codes : tuple of Codes
    y, w : Ball of shape (m,)
        Forces and displacements, scaled.
    slip_angle : (p, 2) array
        Bounds of the angles of v, the lower one in [-pi, pi); nan where no leaf slips in a sector.
    """

    codes: tuple[Codes, ...]
    y: Ball
    w: Ball
    slip_angle: Floats


@dataclass(frozen=True)
class _Boxes:
    """Bounds of the roots of N leaves: of (y, w), (N, 2 m), and of angles, (N, p), nan where a node does not slip."""

    low: Floats
    high: Floats
    angle: Floats
    radius: Floats
    in_sector: Mask

    def touching(self, one: int, others: Indices) -> Mask:
        """Which of the others may have a root in common with one, or roots that are connected."""
        meet = np.all((self.low[others] <= self.high[one]) & (self.high[others] >= self.low[one]), axis=1)
        turn = np.abs(np.remainder(self.angle[others] - self.angle[one] + np.pi, 2 * np.pi) - np.pi)
        apart = self.in_sector[others] & self.in_sector[one] & (turn > self.radius[others] + self.radius[one])
        return np.asarray(meet & ~np.any(apart, axis=1))


def regions_of(system: EnclosedSpace, leaves: Sequence[Codes]) -> list[Region]:
    """Undecided leaves as regions, in the order of their first leaves.

    Two leaves touch if their bounds of forces and displacements meet and, at every node that slips in both, those of
    its direction. Statuses may differ: at a border of two statuses the bounds of both leaves meet. Leaves left
    when the time is over get the bounds that all solutions have.
    """
    boxes = _boxes(system, leaves)
    left = np.arange(len(leaves))
    regions = []
    while len(left):
        members, waiting = [], [int(left[0])]
        left = left[1:]
        while waiting:
            tell("undecided leaves joined", len(leaves) - len(left) - len(waiting), len(leaves))
            one = waiting.pop()
            members.append(one)
            touching = boxes.touching(one, left)
            waiting += left[touching].tolist()
            left = left[~touching]
        members.sort()
        m = len(system.g)
        both = _ball(np.min(boxes.low[members], axis=0), np.max(boxes.high[members], axis=0))
        angles = [_hull(boxes.angle[members, i], boxes.radius[members, i]) for i in range(boxes.angle.shape[1])]
        codes = tuple(leaves[k] for k in members)
        regions.append(Region(codes, both[:m], both[m:], np.array(angles)))
    return regions


def with_zeros(system: EnclosedSpace, codes: Codes, y: Ball, w: Ball) -> tuple[Ball, Ball]:
    """Forces and displacements of a leaf without radii where its statuses say that they are 0."""
    tau, p, code = system.tau, len(system.tau), np.array(codes)
    done = []
    for ball, normal, tangential in ((y, code == OPEN, code == OPEN), (w, code != OPEN, code == STICK)):
        zero = np.zeros(len(ball.mid), dtype=bool)
        zero[:p] = normal
        zero[tau[tangential][tau[tangential] >= 0]] = True
        done.append(Ball(np.where(zero, 0.0, ball.mid), np.where(zero, 0.0, ball.rad)))
    return done[0], done[1]


def slip_angles(system: EnclosedSpace, codes: Codes, leaf: SpaceRoot | Open | None) -> tuple[Floats, Floats]:
    """Directions of v as angles and radii, (p,) each; nan where a node does not slip against friction."""
    angle, radius = np.full((2, len(codes)), np.nan)
    for i, code in enumerate(codes):
        if code in (SLIP_PLUS, SLIP_MINUS):
            angle[i] = (0.0 if code == SLIP_PLUS else np.pi) + (0.0 if system.tau[i, 0] >= 0 else 0.5 * np.pi)
            radius[i] = 1e-15
    turning = [i for i, code in enumerate(codes) if code > SECTORS]
    if leaf is not None:
        angle[turning] = np.arctan2(leaf.centre[:, 1], leaf.centre[:, 0]) + leaf.angle
        radius[turning] = leaf.angle_rad * SAFE + 1e-14
    return angle, radius


def loose_angles(system: EnclosedSpace, found: LooseSolution) -> tuple[Floats, Floats]:
    """Directions of v as angles and radii, (p,) each; nan where a node does not slip against friction for certain."""
    angle, radius = np.full((2, len(found.slip)), np.nan)
    for i in np.flatnonzero(found.slip):
        t = system.tau[i]
        if not np.any(t >= 0):
            continue
        scale = system.slip_scale[i] / system.unit[t]
        v, r = np.where(t >= 0, found.w.mid[t] * scale, 0.0), np.where(t >= 0, found.w.rad[t] * scale, 0.0)
        known, wide = float(np.linalg.norm(v)), float(upper_norm(r * SAFE + TINY))
        angle[i] = np.arctan2(v[1], v[0])
        # sin x >= 2 x / pi
        radius[i] = 0.5 * np.pi * wide / known * SAFE + 1e-14 if known > wide * SAFE else np.pi
    return angle, radius


def _boxes(system: EnclosedSpace, leaves: Sequence[Codes]) -> _Boxes:
    count, p, m = len(leaves), len(system.tau), len(system.g)
    low, high = np.empty((2, count, 2 * m))
    angle, radius = np.empty((2, count, p))
    everywhere = _energy_bounds(system)
    modes, (S, g, _) = len(system.reach), system.balls
    for k, codes in enumerate(leaves):
        tell("undecided leaves bounded", k, count)
        leaf = unsettled(system, codes) if over() else settle(system, codes)
        angle[k], radius[k] = slip_angles(system, codes, leaf)
        y = everywhere if leaf is None or leaf.y is None else smaller(leaf.y, everywhere)
        # with -q, which is known no better here, as the last unknowns of a body that nothing holds
        all_y = Ball.joined(y, Ball(np.zeros(modes), system.reach))
        w = (g - (S @ all_y[:, None])[:, 0])[:m]
        y, w = with_zeros(system, codes, y, w if leaf is None or leaf.w is None else smaller(leaf.w, w))
        mid, rad = np.concatenate([y.mid, w.mid]), np.concatenate([y.rad, w.rad]) * SAFE
        low[k], high[k] = mid - rad, mid + rad
    # lambda_n >= 0 and w_n <= 0
    low[:, :p], high[:, m : m + p] = np.maximum(low[:, :p], 0.0), np.minimum(high[:, m : m + p], 0.0)
    return _Boxes(np.minimum(low, high), high, angle, radius, np.array(leaves) > SECTORS)


def _energy_bounds(system: EnclosedSpace) -> Ball:
    """All y with e(y) <= 0: an ellipsoid around S^{-1} g / 2 through 0.

    Of a body that nothing holds e(y) <= h'q, which is at most the product of the load and the bounds of q.
    """
    m = len(system.g)
    S, g = Ball(system.S, system.S_rad), Ball(system.g, system.g_rad)
    inverse = solution(S, Ball.exact(np.eye(m)))
    if inverse is None:
        return Ball(np.zeros(m), np.full(m, system.largest_forces))
    middle = (inverse @ Ball(0.5 * g.mid[:, None], 0.5 * g.rad[:, None]))[:, 0]
    energy = float((g[None] @ middle[:, None]).size[0, 0]) * 0.5 + system.largest_work
    reach = np.sqrt(np.diagonal(inverse.size) * energy) * (1.0 + 4 * UNIT)
    return Ball(middle.mid, (middle.rad + reach) * SAFE + TINY)


def _ball(low: Floats, high: Floats) -> Ball:
    """The ball between bounds."""
    mid = low + 0.5 * (high - low)
    return Ball(mid, np.maximum(high - mid, mid - low) * SAFE)


def _hull(angle: Floats, radius: Floats) -> Floats:
    """The shortest arc that holds some arcs, the nan left out; nan where there is none."""
    known = np.isfinite(radius)
    if not np.any(known):
        return np.full(2, np.nan)
    start = np.remainder(angle[known] - radius[known] + np.pi, 2 * np.pi) - np.pi
    order = np.argsort(start)
    start, end = start[order], (start + 2.0 * radius[known])[order]
    # how far the arcs that begin no later reach, once round included
    reach = np.maximum.accumulate(np.concatenate([end - 2 * np.pi, end]))[len(end) - 1 :]
    gaps = np.append(start, start[0] + 2 * np.pi) - reach
    widest = int(np.argmax(gaps))
    if not gaps[widest] > 0:
        return np.array([-np.pi, np.pi])
    low = start[widest % len(start)]
    high = reach[widest] + (2 * np.pi if reach[widest] < low else 0.0)
    return np.array([low, high])
