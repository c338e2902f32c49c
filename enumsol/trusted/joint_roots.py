"""The trusted test that several selections share one root (theory, section 14.9), and lists of roots of leaves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Generic, NamedTuple, TypeVar

import numpy as np

from enumsol.arithmetic.balls import Ball, hull
from enumsol.trusted.at_alpha import VerifiedSelection, solve_selection
from enumsol.trusted.status_rows import CONDITIONS, SLIP_MINUS, SLIP_PLUS, STICK

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.support.array_types import Codes


#: Nodes between stick and slip at most: there are twice as many selections for each.
MOST_BETWEEN = 8
#: The rows that change places there: the slip bound of a sticking node, and the slip of one that slips.
_PAIRS = {SLIP_PLUS: {STICK: 2, SLIP_PLUS: 5}, SLIP_MINUS: {STICK: 3, SLIP_MINUS: 6}}


@dataclass(frozen=True)
class JointRoot:
    """The one root that some selections have together, for all data; in which of them it is may depend on the data.

    Attributes
    ----------
    core : codes of the selection in which all nodes between stick and slip stick
    possible : per node the codes that may hold there
    force, w : Ball of shape (2p,)
        Of all of them.
    index : int
    rigid : Ball of shape (r,), or None
        Of a body that nothing holds, the coordinates q of its rigid displacement.
    """

    core: Codes
    possible: tuple[frozenset[int], ...]
    force: Ball
    w: Ball
    index: int
    rigid: Ball | None

    def has(self, codes: Codes) -> bool:
        """True if it is the root of a selection, if that has one."""
        return all(code in held for code, held in zip(codes, self.possible, strict=True))

    @property
    def slips(self) -> tuple[tuple[int, int], ...]:
        """The nodes between stick and slip, and how they slip."""
        return tuple((i, max(held)) for i, held in enumerate(self.possible) if len(held) > 1)


def joint_root(system: EnclosedSystem, core: Codes, slips: Mapping[int, int]) -> JointRoot | None:
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
    balls = list[VerifiedSelection]()
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
    force, w = (hull([getattr(ball, name) for ball in balls]) for name in ("force", "w"))
    rigid = [ball.rigid for ball in balls if ball.rigid is not None]
    return JointRoot(core, possible, force, w, balls[0].index, hull(rigid) if rigid else None)


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
