"""All solutions of a problem in 3D at one alpha (theory, section 12)."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.arithmetic.balls import SAFE, UNIT, Ball
from enumsol.condensation.condensed import condensation_of
from enumsol.condensation.floating import RigidRows
from enumsol.condensation.space_condensed import FloatingSpace
from enumsol.errors import InvalidArgumentError
from enumsol.model.statuses import CONTACT, FRICTIONLESS, OPEN, STICK, UNDECIDED, ContactStatus, space_status
from enumsol.roots.enumeration import Enumeration
from enumsol.roots.root import Enclosure, Root
from enumsol.roots.root_set import RootSet, Undecided
from enumsol.roots.space_regions import loose_angles, regions_of, slip_angles, with_zeros
from enumsol.search.space.space_setup import SpaceSolvers
from enumsol.support.immutable import sealed
from enumsol.trusted.space.boxed_solution import BoxedSolution, apart_in_boxes
from enumsol.trusted.space.leaves import Cause, distinct_roots
from enumsol.trusted.space.space_uniqueness import LooseSolution, OnlySolution

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from enumsol.condensation.condensed import Condensation
    from enumsol.model.problem3d import ContactProblem3D
    from enumsol.search.certifiers.protocol import UndecidedPart
    from enumsol.search.outcome import SearchProgress
    from enumsol.selections.solution import Codes
    from enumsol.support.arguments import Alpha
    from enumsol.trusted.space.leaves import SpaceRoot

    Array = NDArray[np.float64]


class SpaceEnumeration(Enumeration[SpaceSolvers]):
    """One call of enumerate_roots in 3D."""

    def __init__(
        self,
        solvers: SpaceSolvers,
        progress: Callable[[SearchProgress], object] | None,
        proof_path: str | Path | None,
        *,
        resumed: bool = False,
        started: float | None = None,
    ) -> None:
        super().__init__(solvers, progress, proof_path, resumed=resumed, started=started)
        self.problem, self.alpha, self.arithmetic = solvers.problem, solvers.alpha, solvers.arithmetic
        self.system, self.enclosed = solvers.system, solvers.enclosed

    def _distinct(self) -> tuple[list[tuple[Codes, Any]], list[Codes]]:
        verified = self.certifier.certified.verified
        only = [(codes, root) for codes, root in verified.items() if isinstance(root, OnlySolution)]
        if only:
            return only, []
        boxed = [(codes, root) for codes, root in verified.items() if isinstance(root, BoxedSolution)]
        regular, doubtful = distinct_roots(leaf for leaf in verified.items() if not isinstance(leaf[1], BoxedSolution))
        kept, uncertain = apart_in_boxes([root for _, root in regular], boxed)
        return [*regular, *kept], [*doubtful, *uncertain]

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
        return RootSet(
            alpha=self.alpha,
            roots=roots,
            families=(),
            undecided=undecided,
            arithmetic=self.arithmetic,
            method="tree",
            stopped=None if outcome.stopped is None else str(outcome.stopped),
            stats=self._stats(),
            node_ids=self.problem.node_ids,
            at_least=None if whole else self._at_least(len(roots) - len(doubtful)),
            proof=self._proof(roots=len(roots)),
            rigid_bound=self._rigid_bound(self.problem),
        )

    # -- in the user's terms ---------------------------------------------------------------------------------------

    def root(self, codes: Codes, found: SpaceRoot) -> Root:
        """The root that a leaf holds."""
        system, p = self.system, self.system.p
        forces, F = found.y.mid, system.F
        lambda_n = forces[:p] * system.force
        lambda_t = system.tangential(forces) * F * system.force[:, None]
        rigid = None if found.rigid is None else self._in_units(found.rigid)
        u_n, u_t = self._displacements(lambda_n, lambda_t, rigid)
        closed = np.array([code != OPEN for code in codes])
        u_n = np.where(closed, 0.0, np.minimum(u_n, 0.0))
        u_t = np.where((np.array(codes) == STICK)[:, None] & (F > 0), 0.0, u_t)
        return Root(
            alpha=self.alpha,
            statuses=tuple(space_status(code, u_t[i]) for i, code in enumerate(codes)),
            active=tuple(frozenset((space_status(code, u_t[i]),)) for i, code in enumerate(codes)),
            lambda_n=lambda_n,
            lambda_t=lambda_t,
            u_n=u_n,
            u_t=u_t,
            slip_angle=self._angles(codes, found),
            index=found.index,
            regular=True,
            margin=found.slack,
            enclosure=self._root_enclosure(codes, found),
            _condensed=self._condensed,
            _rigid=None if rigid is None else rigid.mid + 0.0,
        )

    def _loose(self, found: LooseSolution) -> Root:
        """A solution whose statuses need not be known."""
        system, p = self.system, self.system.p
        bounds = self._loose_bounds(found)
        lambda_n = found.y.mid[:p] * system.force
        lambda_t = system.tangential(found.y.mid) * system.F * system.force[:, None]
        u_n, u_t = self._displacements(lambda_n, lambda_t)
        u_n, u_t = (np.clip(u, b[..., 0], b[..., 1]) for u, b in ((u_n, bounds.u_n), (u_t, bounds.u_t)))
        active = tuple(frozenset(_possible(found, i, u_t[i], rubs=bool(np.any(system.tau[i] >= 0)))) for i in range(p))
        order = (ContactStatus.OPEN, ContactStatus.STICK, ContactStatus.SLIP)
        return Root(
            alpha=self.alpha,
            statuses=tuple(next(status for status in order if status in held) for held in active),
            active=active,
            lambda_n=lambda_n,
            lambda_t=lambda_t,
            u_n=u_n,
            u_t=u_t,
            slip_angle=self._loose_angles(found),
            index=found.index,
            regular=False,
            margin=0.0,
            enclosure=bounds if self.arithmetic == "verified" else None,
            _condensed=self._condensed,
        )

    def _loose_bounds(self, found: LooseSolution) -> Enclosure:
        return self._enclosure(found.y, Ball(found.w.mid, np.where(found.w.rad > 0, np.inf, 0.0)))

    def _loose_angles(self, found: LooseSolution) -> Array:
        return np.array([_around(*pair) for pair in zip(*loose_angles(self.enclosed, found), strict=True)])

    @cached_property
    def _condensed(self) -> Condensation:
        """What roots compute their displacements with."""
        found: Condensation = condensation_of(self.problem)
        return found

    def _in_units(self, rigid: Ball) -> Ball:
        """Coordinates of a rigid displacement, without the units of their rows, which are powers of two."""
        unit = self._rigid_unit
        return Ball(rigid.mid * unit, rigid.rad * unit)

    @property
    def _rigid_unit(self) -> Array:
        return self.enclosed.rows.unit if isinstance(self.enclosed, FloatingSpace) else np.ones(0)

    @cached_property
    def _moved(self) -> Ball:
        """B N in the problem's units, (3p, r), of a body that nothing holds."""
        ones = np.ones(3 * self.problem.p)
        rows = RigidRows.of(self.problem, Fraction(self.alpha), ones, ones)
        return Ball(rows.G.mid / rows.unit[:, None], rows.G.rad / rows.unit[:, None]).T

    @cached_property
    def _in_balls(self) -> tuple[Ball, Ball]:
        """S and g in the problem's units, those of all 3p rows: as enclosed, or in fast arithmetic as computed."""
        problem, size = self.problem.on_springs, 3 * self.problem.p
        if self.arithmetic != "verified":
            return Ball.exact(problem.condensed.S), Ball.exact(problem.condensed.free_displacements(self.alpha))
        ones = np.ones(size)
        S, S_rad, g, g_rad = problem.enclosure.in_units(Fraction(self.alpha), ones, ones)
        return Ball(S, S_rad), Ball(g, g_rad)

    def _displacements(self, lambda_n: Array, lambda_t: Array, rigid: Ball | None = None) -> tuple[Array, Array]:
        """u_n and u_t; floats may have S and g off by more than the root's enclosure is wide."""
        S, g = self._in_balls
        w = g.mid - S.mid @ np.concatenate([lambda_n, lambda_t.ravel(order="F")])
        if rigid is not None:
            w += self._moved.mid @ rigid.mid
        return w[: self.problem.p], w[self.problem.p :].reshape(2, -1).T

    def _angles(self, codes: Codes, found: SpaceRoot) -> Array:
        """Bounds of the directions of v."""
        pairs = zip(*slip_angles(self.enclosed, codes, found), strict=True)
        return np.array([_around(middle, radius) for middle, radius in pairs])

    def _enclosure(self, y: Ball, w: Ball, rigid: Ball | None = None) -> Enclosure:
        """Bounds in the problem's units, for scaled forces and displacements in balls.

        ``rigid``: of a body that nothing holds, coordinates of its rigid displacement, by default all in question.
        """
        system, exact, p = self.system, self.enclosed, self.problem.p
        S, g = self._in_balls
        forces, known = (Ball(np.zeros(3 * p), np.full(3 * p, radius)) for radius in (0.0, np.inf))
        for k in range(3):
            occurs = np.arange(p) if k == 0 else np.flatnonzero(system.tau[:, k - 1] >= 0)
            part = occurs if k == 0 else system.tau[occurs, k - 1]
            F = Ball.exact(np.ones(p)) if k == 0 else Ball(exact.F[occurs, k - 1], exact.F_rad[occurs, k - 1])
            inverse = Ball(1.0 / F.mid, (2.0 * F.rad / F.mid + 2 * UNIT) / F.mid * SAFE)
            for ball, scaled, factor, unit in ((forces, y, F, system.force), (known, w, inverse, system.length)):
                product = scaled[part] * factor
                zero = (scaled.mid[part] == 0) & (scaled.rad[part] == 0)
                ball.mid[k * p + occurs] = product.mid * unit[occurs]
                ball.rad[k * p + occurs] = np.where(zero, 0.0, product.rad * unit[occurs])
        computed = g - (S @ forces[:, None])[:, 0]
        if isinstance(exact, FloatingSpace):
            rigid = self._in_units(Ball(0.0 * exact.reach, exact.reach) if rigid is None else rigid)
            computed = computed + (self._moved @ rigid[:, None])[:, 0]
        bounds = [(b.mid - b.rad * SAFE, b.mid + b.rad * SAFE) for b in (forces, known, computed)]
        low, high = np.maximum(bounds[1][0], bounds[2][0]), np.minimum(bounds[1][1], bounds[2][1])
        bounds[0][0][:p], high[:p] = np.maximum(bounds[0][0][:p], 0.0), np.minimum(high[:p], 0.0)
        pairs = [np.stack(pair, axis=-1) for pair in (bounds[0], (low, high))]
        parts = [(b[:p], np.stack([b[p : 2 * p], b[2 * p :]], axis=1)) for b in pairs]
        return Enclosure(*parts[0], *parts[1])

    def _root_enclosure(self, codes: Codes, found: SpaceRoot) -> Enclosure | None:
        if self.arithmetic != "verified":
            return None
        y, w = with_zeros(self.enclosed, codes, found.y, found.w)
        # displacements are those of the forces
        return self._enclosure(y, Ball(w.mid, np.where(w.rad > 0, np.inf, 0.0)), found.rigid)

    def _rest(self) -> Root:
        """The unloaded body: nothing moves, and every status holds."""
        p = self.problem.p
        zero, plane = np.zeros(p), np.zeros((p, 2))
        every = frozenset((ContactStatus.OPEN, ContactStatus.STICK, ContactStatus.SLIP))
        bounds = Enclosure(*(np.zeros(shape) for shape in ((p, 2), (p, 2, 2)) * 2))
        return Root(
            alpha=self.alpha,
            statuses=(ContactStatus.OPEN,) * p,
            active=(every,) * p,
            lambda_n=zero,
            lambda_t=plane,
            u_n=zero,
            u_t=plane,
            slip_angle=np.full((p, 2), np.nan),
            index=1,
            regular=False,
            margin=0.0,
            enclosure=bounds if self.arithmetic == "verified" else None,
            _condensed=self._condensed,
        )

    # -- what stayed undecided -------------------------------------------------------------------------------------

    def _undecided(self, parts: Sequence[UndecidedPart]) -> list[Undecided]:
        """Leaves as regions, with a reason that leaves of them have, then the parts that were not searched."""
        leaves = {part.codes: part for part in parts if part.examined}
        found = []
        for region in regions_of(self.enclosed, list(leaves)) if leaves else ():
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
            bounds = self._loose_bounds(root) if self.arithmetic == "verified" else None
        else:
            angles, bounds = self._angles(codes, root), self._root_enclosure(codes, root)
        return Undecided(_names(codes), _DOUBTFUL, "perturb the load", slip_angle=angles, bounds=bounds)


def _names(codes: Codes) -> tuple[ContactStatus | str | None, ...]:
    special: dict[int, ContactStatus | str | None] = {UNDECIDED: None, CONTACT: "contact", FRICTIONLESS: "contact"}
    special |= {OPEN: ContactStatus.OPEN, STICK: ContactStatus.STICK}
    return tuple(special.get(code, ContactStatus.SLIP) for code in codes)


def _common(leaves: Sequence[tuple[ContactStatus | str | None, ...]]) -> tuple[ContactStatus | str | None, ...]:
    """What is known of every node in all leaves."""
    nodes = [set(names) for names in zip(*leaves, strict=True)]
    return tuple(node.pop() if len(node) == 1 else None if ContactStatus.OPEN in node else "contact" for node in nodes)


_DOUBTFUL = "two leaves hold roots that could not be told apart"


def _possible(found: LooseSolution, i: int, u_t: Array, *, rubs: bool) -> list[ContactStatus]:
    """The statuses that a node may have."""
    touching = [space_status(FRICTIONLESS, u_t)] if found.stick[i] else []
    if rubs:
        touching = [ContactStatus.STICK] * bool(found.stick[i]) + [ContactStatus.SLIP] * bool(found.slip[i])
    return [ContactStatus.OPEN] * bool(found.open[i]) + touching


def _around(middle: float, radius: float) -> Array:
    """Bounds of an angle, the lower one in [-pi, pi)."""
    low = middle - radius
    turns = np.floor((low + np.pi) / (2.0 * np.pi))
    return sealed(np.array([low, middle + radius]) - 2.0 * np.pi * turns)


def solvers_in_space(problem: ContactProblem3D, alpha: Alpha, arithmetic: str) -> SpaceSolvers:
    """Those of a body that is held, or that nothing holds."""
    if problem.modes is None:
        return SpaceSolvers(problem, alpha, arithmetic)
    from enumsol.search.space.space_floating import FloatingSpaceSolvers  # for such bodies only

    return FloatingSpaceSolvers(problem, alpha, arithmetic)


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
