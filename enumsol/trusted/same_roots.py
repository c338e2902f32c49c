"""Roots that several leaves hold, each once, and which leaves hold the same one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Generic, NamedTuple, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

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
