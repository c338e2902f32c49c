"""Leaves that close a subtree by its only possible solution, as the checker tests them (docs/proof_format.md)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.arithmetic.balls import SAFE
from enumsol.arithmetic.rationals import to_fraction
from enumsol.proof.reading import same
from enumsol.trusted.joint_roots import told_apart
from enumsol.trusted.status_rows import BACKWARD, CONTACT, FORWARD, OPEN
from enumsol.trusted.uniqueness import ClosedSolution, closed_solution, only_solution, same_solution

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from enumsol.checker.rational import RationalBody
    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.proof.records import Closed
    from enumsol.support.array_types import Codes, Floats
    from enumsol.trusted.joint_roots import Apart, JointRoot

    #: The core of a solution, and per node the codes that may hold there.
    Known = tuple[Codes, Sequence[frozenset[int]]]


def closed_by_balls(system: EnclosedSystem, said: Closed, force: Floats) -> tuple[str | None, ClosedSolution | None]:
    """Why a record proves nothing, or None; and the root that it proves, if it claims one."""
    ball = closed_solution(system, said.selection, said.free, np.asarray(said.weights), np.asarray(said.at) / force)
    if ball is None:
        return "its reduced problem is not proven to have one solution", None
    if said.enclosure is None:
        return (None if ball.is_excluded else "its only solution does not break a condition strictly"), None
    if not ball.is_root:
        return "its only solution is not proven to be a root", None
    mid, radius = said.enclosure.numbers(2 * system.p)
    with np.errstate(over="ignore", invalid="ignore"):
        inside = (np.abs(mid - ball.force.mid * force) + ball.force.rad * force) * SAFE <= radius
    inside |= (ball.force.rad == 0) & (mid == 0) & (radius >= 0)
    refusal = said.enclosure.refusal(ball.sign, inside=bool(np.all(inside)))
    return refusal, ball if np.all(inside) else None


def closed_in_rationals(
    system: EnclosedSystem, rational: RationalBody, codes: Codes, said: Closed
) -> tuple[str | None, list[Any]]:
    """Why a record proves nothing, or None; and its root, if it holds one."""
    selection, free = said.selection, said.free
    slides = {i: code for i, code in enumerate(codes) if code in (FORWARD, BACKWARD)}
    named = tuple(slides.get(i, code) for i, code in enumerate(selection))
    point = rational.point(selection)
    if point is None:
        return "its selection is singular", []
    w = rational.moved(point)
    least = {i: rational.least(selection[i], i, point) for i in range(rational.p)}
    if any(least[i] < 0 for i in free) or any(w[i] > 0 if selection[i] == OPEN else point[i] < 0 for i in slides):
        return "the point of its selection does not solve the reduced problem", []
    if not only_solution(system, named, free, np.asarray(said.weights), point, w):
        return "its solution is not proven to be the only one", []
    touching = all(w[i] == 0 for i, code in enumerate(codes) if code == CONTACT)
    holds = touching and all(least[i] >= 0 for i in range(rational.p) if i not in free)
    if not same(said.at, int(holds)):
        return "it holds another number of roots than it claims", []
    return None, [tuple(to_fraction(x) for x in point)] if holds else []


def closed_apart(closed: Mapping[Codes, ClosedSolution | JointRoot], others: list[Codes]) -> Apart[Known]:
    """Closed roots, each once, without those that are roots of complete selections."""
    known: list[Known] = [(codes, tuple(frozenset((code,)) for code in codes)) for codes in others]
    found: list[Known] = [(core, ball.possible) for core, ball in sorted(closed.items())]
    return told_apart(found, lambda other, one: same_solution(*one, *other), known)
