"""Leaves that close a subtree by its only possible solution, as the checker tests them (docs/proof_format.md)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from flint import fmpq_mat

from enumsol.arithmetic.balls import SAFE
from enumsol.arithmetic.rationals import to_fraction
from enumsol.proof.reading import numbers_from, same
from enumsol.trusted.status_rows import BACKWARD, CONTACT, FORWARD, OPEN, STICK, UNDECIDED, final_codes, refines
from enumsol.trusted.uniqueness import closed_solution, only_solution, same_solution

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from numpy.typing import NDArray

    from enumsol.checker.rational import RationalSystem
    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.trusted.uniqueness import ClosedSolution

    Codes = tuple[int, ...]
    Array = NDArray[np.float64]
    #: The core of a solution, and per node the codes that may hold there.
    Known = tuple[Codes, Sequence[frozenset[int]]]


def closed_by_balls(
    system: EnclosedSystem, codes: Codes, record: list[Any], force: Array
) -> tuple[str | None, ClosedSolution | None]:
    """Why a record of kind "m" proves nothing, or None; and the root that it proves, if it claims one."""
    if len(record) not in (5, 7):
        return f"its record has {len(record)} entries; expected 5 or 7", None
    free, selection, weights, mid = _read(system, record)
    if any(not refines(code, selection[i]) for i, code in enumerate(codes) if i not in free):
        return "a node that has a status in its proof has another one in its assignment", None
    ball = closed_solution(system, selection, free, weights, mid / force)
    if ball is None:
        return "its reduced problem is not proven to have one solution", None
    if len(record) == 5:
        return (None if ball.is_excluded else "its only solution does not break a condition strictly"), None
    if not ball.is_root:
        return "its only solution is not proven to be a root", None
    radius = numbers_from(record[5], 2 * system.p)
    with np.errstate(over="ignore", invalid="ignore"):
        inside = (np.abs(mid - ball.force * force) + ball.force_rad * force) * SAFE <= radius
    if not np.all(inside | ((ball.force_rad == 0) & (mid == 0) & (radius >= 0))):
        return "its enclosure does not hold the root", None
    return (None if type(record[6]) is int and record[6] == ball.sign else "its index is wrong"), ball


def one_regular_root(system: EnclosedSystem, record: list[Any], force: Array) -> bool:
    """Whether a record of kind "m" proves that all data in the balls have one root, regular and in its selection."""
    free, selection, weights, mid = _read(system, record)
    ball = closed_solution(system, selection, free, weights, mid / force)
    return ball is not None and ball.regular is not None


def closed_in_rationals(
    system: EnclosedSystem, rational: RationalSystem, codes: Codes, record: list[Any]
) -> tuple[str | None, Codes, list[Any]]:
    """Why a record of kind "M" proves nothing, or None; the selection that it names, and the root in it, if any."""
    friction = system.F > 0
    selection = _selection(record[1], friction)
    free = tuple(i for i, code in enumerate(codes) if code in (CONTACT, UNDECIDED))
    if any(not refines(selection[i], code) for i, code in enumerate(codes) if i not in free):
        return "its selection is none below its assignment", selection, []
    slides = {i: code for i, code in enumerate(codes) if code in (FORWARD, BACKWARD)}
    named = tuple(slides.get(i, code) for i, code in enumerate(selection))
    weights = _weights(record[2], free, named, friction)
    point = _point(rational, selection)
    if point is None:
        return "its selection is singular", selection, []
    w = _displacements(rational, point)
    least = {i: min(rational.node_conditions(selection[i], i, point)) for i in range(rational.p)}
    if any(least[i] < 0 for i in free) or any(w[i] > 0 if selection[i] == OPEN else point[i] < 0 for i in slides):
        return "the point of its selection does not solve the reduced problem", selection, []
    if not only_solution(system, named, free, weights, point, w):
        return "its solution is not proven to be the only one", selection, []
    touching = all(w[i] == 0 for i, code in enumerate(codes) if code == CONTACT)
    holds = touching and all(least[i] >= 0 for i in range(rational.p) if i not in free)
    if not same(record[3], int(holds)):
        return "it holds another number of roots than it claims", selection, []
    return None, selection, [tuple(to_fraction(x) for x in point)] if holds else []


def count_apart(closed: dict[Codes, ClosedSolution], others: list[Codes]) -> tuple[int, int]:
    """Closed roots that are not among those of complete selections, each once, and how many of them are in doubt."""
    known: list[Known] = [(codes, tuple(frozenset((code,)) for code in codes)) for codes in others if closed]
    kept = doubtful = 0
    for core, ball in sorted(closed.items()):
        answers = [same_solution(core, ball.possible, *other) for other in known]
        if True in answers:
            continue
        doubtful += None in answers
        kept += 1
        known.append((core, ball.possible))
    return kept, doubtful


def _read(system: EnclosedSystem, record: list[Any]) -> tuple[tuple[int, ...], Codes, Array, Array]:
    """Free nodes, selection, numbers and forces of a record of kind "m"."""
    free = _nodes(record[2], system.p)
    selection = _selection(record[1], system.F > 0, sliding=set(range(system.p)) - set(free))
    weights = _weights(record[3], free, selection, system.F > 0)
    return free, selection, weights, numbers_from(record[4], 2 * system.p)


def _selection(value: Any, friction: NDArray[np.bool_], sliding: Collection[int] = ()) -> Codes:
    """Final codes; FORWARD and BACKWARD are allowed as well at the given nodes."""
    if not isinstance(value, list) or len(value) != len(friction) or not all(type(code) is int for code in value):
        raise ValueError(f"its selection is no list of {len(friction)} codes")
    for i, (code, positive) in enumerate(zip(value, friction.tolist(), strict=True)):
        if code in final_codes(positive) or (positive and code in (FORWARD, BACKWARD) and i in sliding):
            continue
        raise ValueError("a node cannot have the code that its selection gives it")
    return tuple(value)


def _nodes(value: Any, p: int) -> tuple[int, ...]:
    if not isinstance(value, list) or not all(type(i) is int and 0 <= i < p for i in value):
        raise ValueError("its free nodes are no list of nodes")
    if sorted(set(value)) != value:
        raise ValueError("its free nodes are not ascending")
    return tuple(value)


def _weights(value: Any, free: Codes, selection: Codes, friction: NDArray[np.bool_]) -> Array:
    """The numbers of the form: one for every free or sliding node, and four more where a free node has friction."""
    sliding = sum(code in (FORWARD, BACKWARD) for code in selection)
    return numbers_from(value, len(free) + sliding + 4 * int(np.count_nonzero(friction[list(free)])))


def _point(rational: RationalSystem, selection: Codes) -> list[Any] | None:
    """The only solution of a selection's equations; None where they are singular."""
    p, S = rational.p, rational.S
    closed = [i for i, code in enumerate(selection) if code != OPEN]
    held = [p + i for i, code in enumerate(selection) if code == STICK]
    rows, point = closed + held, [rational.zero] * (2 * p)
    if not rows:
        return point
    turn = [{2: rational.F[i], 3: -rational.F[i]}.get(selection[i], rational.zero) for i in closed]
    table = [
        [S[r, i] + f * S[r, p + i] for i, f in zip(closed, turn, strict=True)] + [S[r, k] for k in held] for r in rows
    ]
    try:
        y = fmpq_mat(table).solve(fmpq_mat([[rational.g[r]] for r in rows])).entries()
    except ZeroDivisionError:
        return None
    for i, f, force in zip(closed, turn, y, strict=False):
        point[i], point[p + i] = force, f * force
    for k, force in zip(held, y[len(closed) :], strict=True):
        point[k] = force
    return point


def _displacements(rational: RationalSystem, point: list[Any]) -> list[Any]:
    moved = (rational.S * fmpq_mat([[x] for x in point])).entries()
    return [g - x for g, x in zip(rational.g, moved, strict=True)]
