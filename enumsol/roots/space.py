"""All solutions of a problem in 3D at one alpha (theory, section 12)."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.arithmetic.balls import SAFE
from enumsol.errors import InvalidArgumentError
from enumsol.kernel.ball_arrays import Ball
from enumsol.kernel.leaves import distinct_roots
from enumsol.roots.enumeration import Enumeration
from enumsol.roots.root import Enclosure
from enumsol.roots.root3d import Root3D
from enumsol.roots.root_set import RootSet, Undecided
from enumsol.sealed import sealed
from enumsol.search.certifiers.protocol import UndecidedPart
from enumsol.search.space_solvers import SpaceSolvers
from enumsol.sectors import SECTORS, direction, end_number
from enumsol.statuses import CONTACT, FRICTIONLESS, OPEN, STICK, UNDECIDED, ContactStatus

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from enumsol.kernel.leaves import SpaceRoot
    from enumsol.search.tree import SearchProgress
    from enumsol.selections.solution import Codes

    Array = NDArray[np.float64]


class SpaceEnumeration(Enumeration[SpaceSolvers]):
    """One call of enumerate_roots in 3D."""

    def __init__(
        self,
        solvers: SpaceSolvers,
        progress: Callable[[SearchProgress], object] | None,
        proof_path: str | Path | None,
    ) -> None:
        super().__init__(solvers, progress, proof_path)
        self.problem, self.alpha, self.arithmetic = solvers.problem, solvers.alpha, solvers.arithmetic
        self.system, self.enclosed = solvers.system, solvers.enclosed

    def _distinct(self) -> tuple[list[tuple[Codes, SpaceRoot]], list[Codes]]:
        return distinct_roots(self.certifier.certified.verified.items())

    def _enough(self, stop_after: int) -> Callable[[list[Any]], bool]:
        return lambda solutions: len(solutions) >= stop_after and len(self._distinct()[0]) >= stop_after

    def _result(self) -> RootSet:
        outcome = self.outcome
        distinct, doubtful = self._distinct()
        roots = [self._root(codes, root) for codes, root in distinct]
        if self.unloaded:
            roots = [self._rest()]
        roots.sort(key=lambda root: (-float(np.sum(root.lambda_n)), root.lambda_n.tolist(), root.lambda_t.tolist()))
        undecided = [self._named(part) for part in outcome.undecided]
        undecided += [Undecided(self._names(codes), _DOUBTFUL, "perturb the load") for codes in doubtful]
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
            at_least=None if whole else max(len(roots) - len(doubtful), min(len(roots), 1)),
            proof=self._proof(roots=len(roots)),
        )

    # -- in the user's terms ---------------------------------------------------------------------------------------

    def _root(self, codes: Codes, found: SpaceRoot) -> Root3D:
        system, p = self.system, self.system.p
        forces, F = found.y.mid, system.F
        lambda_n = forces[:p] * system.force
        lambda_t = system.tangential(forces) * F * system.force[:, None]
        u_n, u_t = self._displacements(lambda_n, lambda_t)
        closed = np.array([code != OPEN for code in codes])
        u_n = np.where(closed, 0.0, np.minimum(u_n, 0.0))
        u_t = np.where((np.array(codes) == STICK)[:, None] & (F > 0), 0.0, u_t)
        return Root3D(
            alpha=self.alpha,
            statuses=tuple(_status(code, u_t[i]) for i, code in enumerate(codes)),
            active=tuple(frozenset((_status(code, u_t[i]),)) for i, code in enumerate(codes)),
            lambda_n=lambda_n,
            lambda_t=lambda_t,
            u_n=u_n,
            u_t=u_t,
            slip_angle=self._angles(codes, found),
            index=found.index,
            regular=True,
            margin=found.slack,
            enclosure=self._enclosure(codes, found) if self.arithmetic == "verified" else None,
            _condensed=self.problem.condensed,
        )

    def _displacements(self, lambda_n: Array, lambda_t: Array) -> tuple[Array, Array]:
        condensed, p = self.problem.condensed, self.problem.p
        w = condensed.free_displacements(self.alpha)
        w = w - condensed.S @ np.concatenate([lambda_n, lambda_t.ravel(order="F")])
        return w[:p], w[p:].reshape(2, p).T

    def _angles(self, codes: Codes, found: SpaceRoot) -> Array:
        """Bounds of the directions of v."""
        angles = np.full((len(codes), 2), np.nan)
        turning = [i for i, code in enumerate(codes) if code > SECTORS]
        for k, i in enumerate(turning):
            middle = float(np.arctan2(found.centre[k, 1], found.centre[k, 0])) + found.angle[k]
            angles[i] = _around(middle, float(found.angle_rad[k]) * SAFE + 1e-14)
        for i, code in enumerate(codes):
            if code in (2, 3):
                axis = int(np.argmax(self.system.tau[i]))
                angles[i] = _around((0.0 if code == 2 else np.pi) + (0.0 if axis == 0 else 0.5 * np.pi), 1e-15)
        return angles

    def _enclosure(self, codes: Codes, found: SpaceRoot) -> Enclosure:
        """Bounds of forces and displacements in the problem's units."""
        problem, system, p = self.problem, self.system, self.problem.p
        exact = self.enclosed
        S, S_rad, g, g_rad = problem.enclosure.in_units(Fraction(self.alpha), np.ones(3 * p), np.ones(3 * p))
        forces = Ball(np.zeros(3 * p), np.zeros(3 * p))
        forces.mid[:p], forces.rad[:p] = found.y.mid[:p] * system.force, found.y.rad[:p] * system.force
        for k in range(2):
            occurs = system.tau[:, k] >= 0
            t = system.tau[occurs, k]
            part = Ball(found.y.mid[t], found.y.rad[t]) * Ball(exact.F[occurs, k], exact.F_rad[occurs, k])
            place = (1 + k) * p + np.flatnonzero(occurs)
            forces.mid[place], forces.rad[place] = part.mid * system.force[occurs], part.rad * system.force[occurs]
        w = Ball(g, g_rad) - (Ball(S, S_rad) @ Ball(forces.mid[:, None], forces.rad[:, None]))[:, 0]
        for i, code in enumerate(codes):
            if code == OPEN:
                forces.mid[i::p] = forces.rad[i::p] = 0.0
            else:
                w.mid[i] = w.rad[i] = 0.0
            for k in range(2):
                if code == STICK and system.tau[i, k] >= 0:
                    w.mid[(1 + k) * p + i] = w.rad[(1 + k) * p + i] = 0.0
        bounds = [np.stack([b.mid - b.rad * SAFE, b.mid + b.rad * SAFE], axis=-1) for b in (forces, w)]
        low_high = [(b[:p], np.stack([b[p : 2 * p], b[2 * p :]], axis=1)) for b in bounds]
        return Enclosure(*low_high[0], *low_high[1])

    def _rest(self) -> Root3D:
        """The unloaded body: nothing moves, and every status holds."""
        p = self.problem.p
        zero, plane = np.zeros(p), np.zeros((p, 2))
        every = frozenset((ContactStatus.OPEN, ContactStatus.STICK, ContactStatus.SLIP))
        bounds = Enclosure(*(np.zeros(shape) for shape in ((p, 2), (p, 2, 2)) * 2))
        return Root3D(
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
            _condensed=self.problem.condensed,
        )

    def _names(self, codes: Codes) -> tuple[ContactStatus | str | None, ...]:
        special: dict[int, ContactStatus | str | None] = {UNDECIDED: None, CONTACT: "contact", FRICTIONLESS: "contact"}
        special |= {OPEN: ContactStatus.OPEN, STICK: ContactStatus.STICK}
        return tuple(special.get(code, ContactStatus.SLIP) for code in codes)

    def _named(self, part: UndecidedPart) -> Undecided:
        """An undecided leaf, with the directions that it leaves open."""
        boxes: list[str] = []
        for label, code in zip(self.problem.node_ids, part.codes, strict=True):
            if code > SECTORS and len(boxes) < _SHOWN_BOXES:
                ends = (direction(n) for n in (code - SECTORS, end_number(code - SECTORS)))
                low, high = (np.degrees(np.arctan2(y, x)) for x, y in ends)
                boxes.append(f"{low:.6g} to {high:.6g} degrees at node {label}")
        where = f" (slip directions {', '.join(boxes)})" if boxes else ""
        return Undecided(self._names(part.codes), part.reason + where, part.hint)


_DOUBTFUL = "two leaves hold roots that could not be told apart"
#: Boxes of directions that the reason of an undecided leaf names.
_SHOWN_BOXES = 3


def _status(code: int, u_t: Array) -> ContactStatus:
    if code == OPEN:
        return ContactStatus.OPEN
    if code == STICK or (code == FRICTIONLESS and not np.any(u_t)):
        return ContactStatus.STICK
    return ContactStatus.SLIP


def _around(middle: float, radius: float) -> Array:
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
