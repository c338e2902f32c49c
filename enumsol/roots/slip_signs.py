"""Signs of u_t at a root, from its enclosure or from rationals: they name the slip of nodes without friction."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from enumsol.condensation.data import EXACT_DOF_LIMIT
from enumsol.model.statuses import FRICTIONLESS, SLIP_MINUS, SLIP_PLUS, STATUSES, STICK, ContactStatus

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from enumsol.model.problem import ContactProblem
    from enumsol.selections.solution import ActiveSets, Codes
    from enumsol.support.arguments import Alpha


@dataclass(frozen=True)
class SlipSigns:
    """Signs of u_t at a root of one selection.

    Attributes
    ----------
    problem : ContactProblem
    alpha : float or Fraction
    codes : tuple of p status codes
        The root's selection, which is regular where a sign has to be found in rationals.
    known : tuple of p (int or None)
        Signs that the enclosure, rationals or the tolerance of fast arithmetic decide; None where they do not.
    """

    problem: ContactProblem
    alpha: Alpha
    codes: Codes
    known: tuple[int | None, ...]

    def sign(self, node: int) -> int | None:
        """-1, 0 or 1; None where it would take rationals and the problem is too large for them."""
        known = self.known[node]
        return known if known is not None or self._exact is None else self._exact[node]

    @cached_property
    def _exact(self) -> tuple[int, ...] | None:
        """All signs in rationals; None when the problem is too large for them."""
        if self.problem.n > EXACT_DOF_LIMIT or not self.problem.known_exactly:
            return None
        from enumsol.condensation.exact import exact_system  # python-flint, not for fast arithmetic
        from enumsol.selections.rational_selections import ExactSelections

        solver = ExactSelections(exact_system(self.problem, self.alpha))
        solution = solver.solve(self.codes)
        return None if solution is None else solver.slip_signs(solution.vertices[0])


def slip_names(sign: int | None) -> frozenset[ContactStatus]:
    """Statuses of a node in contact without friction by the sign of its u_t: all three where that is 0 or not known."""
    if not sign:
        return frozenset(STATUSES[code] for code in (STICK, SLIP_PLUS, SLIP_MINUS))
    return frozenset((STATUSES[SLIP_PLUS if sign > 0 else SLIP_MINUS],))


def named_statuses(
    active: ActiveSets, slip_sign: Callable[[int], int | None]
) -> tuple[tuple[ContactStatus, ...], tuple[frozenset[ContactStatus], ...]]:
    """Of every node the first status that holds, and all; ``slip_sign`` gives the sign of u_t without friction."""
    names = tuple(
        frozenset(
            name
            for code in codes
            for name in (slip_names(slip_sign(node)) if code == FRICTIONLESS else (STATUSES[code],))
        )
        for node, codes in enumerate(active)
    )
    return tuple(next(status for status in STATUSES if status in held) for held in names), names


def sign_over(signs: Iterable[int]) -> int:
    """The sign of u_t on a polytope whose corners have these signs; 0 where it takes both or none."""
    found = set(signs) - {0}
    return found.pop() if len(found) == 1 else 0
