"""How far the data may change before the proven list of roots may: the proof evaluated on wider balls.

A certificate that holds for a ball of data holds for all data in it. So the multipliers and selections of a proof are
checked again with the balls of S, g and F widened, and the widening is enlarged as long as every leaf passes.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, cast

import numpy as np

from enumsol.arithmetic.balls import SAFE, Ball, gamma
from enumsol.checker.floating import FloatingChecker
from enumsol.checker.plane_checker import Checker, FormLeaves
from enumsol.checker.verify import verify
from enumsol.condensation.enclosure import EnclosedSystem, NotEnclosedError
from enumsol.condensation.floating import FloatingSystem
from enumsol.model.problem import ContactProblem
from enumsol.proof import records
from enumsol.support.arguments import instance_of
from enumsol.trusted.at_alpha import solve_selection
from enumsol.trusted.exclusion import Leaves, exclusion_margins
from enumsol.trusted.floating_bounds import is_unbalanced
from enumsol.trusted.uniqueness import lone_root

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol.checker.walk import Test
    from enumsol.proof.proof_file import Proof
    from enumsol.proof.records import Record
    from enumsol.support.array_types import Codes, Floats, Indices

#: Largest radius that is tried; below 1 a positive friction coefficient stays positive.
LARGEST = 0.5
#: A smaller radius is within rounding, and 0 is returned.
SMALLEST = 2.0**-50
#: Multipliers are stretched or shrunk by at most this.
_STRETCH = 1e9
#: The radius is found to within this factor.
_RATIO = 1.05


def stability_radius(problem: ContactProblem, proof: Proof) -> float:
    """A radius within which the condensed data may change and the roots stay the same in number, status and index.

    For every symmetric S', every g' and F' with, componentwise,

        |S'_ij - S_ij| <= r sqrt(S_ii S_jj)
        |g'_i - g_i|   <= r sqrt(S_ii) max_j |g_j| / sqrt(S_jj)
        |F'_i - F_i|   <= r F_i

    the problem has as many roots as the proof lists, all of them regular, in the same selections and with the same
    indices, and no families. (For the units: sqrt(S_ii S_jj) bounds |S_ij|, and a displacement is measured by the root
    of its own compliance.) A change of load, gap, slip offset, friction or alpha is such a change of g and F. The
    largest radius is larger: only the multipliers of this proof are tried. The cost is that of several
    checks of the proof.

    Of a body that nothing holds, S and g are those of the body on springs, the roots those within its bound of the
    rigid displacement, and the load of the body as a whole (theory, (14.2)) may change as well:

        |h'_k - h_k|   <= r H_k a,    H_k = sum_i |G_ki| / sqrt(S_ii)

    where a is the larger one of max_j |g_j| / sqrt(S_jj), in place of which it is, and of max_k |h_k| / H_k.

    Parameters
    ----------
    problem : ContactProblem
    proof : Proof

    Returns
    -------
    float
        r, found to within 5 per cent; at most LARGEST. 0 when the proof does not verify or leaves selections undecided,
        when a root is degenerate or part of a family, and when the margins are no larger than rounding.

    Raises
    ------
    ProofFormatError
        The file is damaged or of another version.
    InvalidArgumentError
        The problem is no ContactProblem.
    """
    kind = _WidenedChecker if instance_of(problem, ContactProblem, "problem").modes is None else _WidenedFloating
    if not verify(problem, proof).complete:
        return 0.0
    search = kind(problem, None, radius=LARGEST, adjust=True)
    search.run(proof)
    radius = search.radius
    # what was found leaf by leaf is proven for all leaves at once
    while radius >= SMALLEST:
        check = kind(problem, None, radius=radius, adjust=False)
        if check.run(proof).complete and not check.polytopes:
            return radius
        radius *= 0.5
    return 0.0


@dataclass
class _WidenedChecker(Checker):
    """A checker whose balls are wider; ``adjust`` lowers the radius until every leaf passes."""

    radius: float = LARGEST
    adjust: bool = False
    _systems: dict[float, EnclosedSystem | None] = field(default_factory=dict)

    @cached_property
    def _sizes(self) -> tuple[Floats, Floats]:
        """Upper bounds of what changes of S and g are measured by."""
        system = self.system
        root = np.sqrt(np.diagonal(system.S) + np.diagonal(system.S_rad)) * SAFE
        return np.outer(root, root) * SAFE, root * self._load * SAFE

    @cached_property
    def _roots(self) -> Floats:
        """Lower bounds of the roots of S_ii."""
        return np.asarray(np.sqrt(np.diagonal(self.system.S) - np.diagonal(self.system.S_rad)) / SAFE)

    @cached_property
    def _load(self) -> float:
        """An upper bound of the size of the load."""
        return float(np.max((np.abs(self.system.g) + self.system.g_rad) / self._roots) * SAFE)

    def _with(self, system: EnclosedSystem, radius: float) -> EnclosedSystem:
        """Wider balls, complete."""
        return system

    def _widened(self, radius: float) -> EnclosedSystem | None:
        """The balls of this radius; None when S is not positive definite in all of them."""
        if radius not in self._systems:
            self._systems.clear()
            system = self.system
            S_size, g_size = self._sizes
            wide = EnclosedSystem(
                system.S,
                (system.S_rad + radius * S_size) * SAFE,
                system.g,
                (system.g_rad + radius * g_size) * SAFE,
                system.F,
                (system.F_rad + radius * (system.F + system.F_rad)) * SAFE,
            )
            wide = self._with(wide, radius)
            # the midpoint is the same
            wide.__dict__["inverse"] = system.inverse
            try:
                self._systems[radius] = wide if wide.smallest_eigenvalue > 0 else None
            except NotEnclosedError:
                self._systems[radius] = None
        return self._systems[radius]

    def _passes(self, holds: Callable[[EnclosedSystem], bool]) -> bool:
        """Whether a leaf holds at the radius, which is lowered until it does if that is allowed."""

        def at(radius: float) -> bool:
            wide = self._widened(radius)
            return wide is not None and holds(wide)

        if self.radius >= SMALLEST and at(self.radius):
            return True
        if not self.adjust:
            return False
        good, bad = self.radius, self.radius
        while good >= SMALLEST and not at(good):
            bad, good = good, good / 4
        while good >= SMALLEST and bad / good > _RATIO:
            middle = float(np.sqrt(good * bad))
            good, bad = (middle, bad) if at(middle) else (good, middle)
        self.radius = good if good >= SMALLEST else 0.0
        return self.radius > 0

    def _check_exclusions(self, numbers: Indices, leaves: Leaves) -> None:
        sturdy = leaves.times(_sturdiest(self.system, leaves))

        def excluded(system: EnclosedSystem) -> bool:
            bounds = [exclusion_margins(system, claimed) for claimed in (leaves, sturdy)]
            return bool(np.all(np.maximum(*bounds) > 0))

        if not self._passes(excluded):
            self.fail(f"leaves {numbers[0]} to {numbers[-1]}: the multipliers do not exclude them")

    def _check_forms(self, leaves: FormLeaves) -> None:
        if not self._passes(lambda system: not leaves.failing(system)):
            self.fail("multipliers with forms do not exclude their leaves")

    def _tests(self) -> dict[type[Record], Test]:
        """Only leaves of some kinds may hold for other data than those given."""
        kept = records.Excluded, records.ExcludedByForm, records.NoRoot, records.RegularRoot
        return {kind: test for kind, test in super()._tests().items() if kind in (*kept, records.Closed, records.Alone)}

    def _untested(self) -> str:
        self.radius = 0.0
        return "it was proven for the given data alone"

    def _no_root(self, codes: Codes, said: records.NoRoot) -> str | None:
        return self._for_all(lambda system: (ball := solve_selection(system, codes)) is not None and ball.is_excluded)

    def _regular_root(self, codes: Codes, said: records.RegularRoot) -> str | None:
        self.regular += 1
        return self._for_all(lambda system: (ball := solve_selection(system, codes)) is not None and ball.is_root)

    def _closed(self, codes: Codes, said: records.Closed) -> str | None:
        from enumsol.checker.fathomed_subtrees import one_regular_root

        reason = super()._closed(codes, said)
        if reason is None and not self._passes(lambda system: one_regular_root(system, said, self.force)):
            reason = self._untested()
        return reason

    def _alone(self, codes: Codes, said: records.Alone) -> str | None:
        self.regular += 1
        return self._for_all(lambda system: lone_root(system, codes, *said.arguments) is not None)

    def _for_all(self, holds: Callable[[EnclosedSystem], bool]) -> str | None:
        return None if self._passes(holds) else "it does not hold for all data"


@dataclass
class _WidenedFloating(_WidenedChecker, FloatingChecker):
    """The same for a body that nothing holds, within its bound of the rigid displacement."""

    @cached_property
    def _weights(self) -> tuple[Floats, Floats]:
        """Lower and upper bounds of what changes of h are measured by, for a load of size one, (r,)."""
        G, S, k = self.system.rows.G, self.system, gamma(len(self.system.g) + 2)
        most = np.sqrt(np.diagonal(S.S) + np.diagonal(S.S_rad)) * SAFE
        least = np.sum(np.maximum(np.abs(G.mid) - G.rad, 0.0) / most, axis=1)
        return least * (1 - k), np.sum((np.abs(G.mid) + G.rad) / self._roots, axis=1) * (1 + k) * SAFE

    @cached_property
    def _load(self) -> float:
        h, (least, _) = self.system.rows.h.size, self._weights
        own = np.max(np.divide(h, least, out=np.zeros_like(h), where=least > 0))
        return float(max(np.max((np.abs(self.system.g) + self.system.g_rad) / self._roots), own) * SAFE)

    def _with(self, system: EnclosedSystem, radius: float) -> EnclosedSystem:
        rows = self.system.rows
        h = Ball(rows.h.mid, (rows.h.rad + radius * self._weights[1] * self._load * SAFE) * SAFE)
        return FloatingSystem.on(system, replace(rows, h=h))

    def _tests(self) -> dict[type[Record], Test]:
        # what rationals told of a selection may hold in balls as well
        return super()._tests() | {
            records.Unbalanced: self._unbalanced,
            records.NoRootInRationals: self._no_root,
        }

    def _unbalanced(self, codes: Codes, said: records.Unbalanced) -> str | None:
        return self._for_all(lambda system: is_unbalanced(cast("FloatingSystem", system), codes, said.direction))


def _sturdiest(system: EnclosedSystem, leaves: Leaves) -> Floats:
    """Positive factors of the leaves' multipliers that make their bounds large against their errors.

    With multipliers stretched by t the bound is -a + b t - c t^2, known from three points, and its error grows like
    t^2: their quotient is largest at t = 2 a / b. The multipliers of infeasible leaves may be far from that.
    """
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        zero, one, two = (exclusion_margins(system, leaves.times(t)) for t in (0.0, 1.0, 2.0))
        slope = one - zero - 0.5 * (two - 2 * one + zero)
        best = -2 * zero / slope
    return np.where((slope > 0) & np.isfinite(best), np.clip(best, 1 / _STRETCH, _STRETCH), 1.0)
