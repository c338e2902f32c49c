"""Nodes of the tree, and their relaxations."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

from enumsol.model.statuses import UNDECIDED
from enumsol.search.splitting import ImposedRows, Splitting

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from enumsol.relaxation.engine import Engine, Relaxation
    from enumsol.search.form_policy import Forms
    from enumsol.support.array_types import Codes


@dataclass(slots=True)
class TreeNode:
    """A node of the tree that waits to be examined: its parent's relaxation and what it adds."""

    parent: Relaxation | None
    codes: Codes
    changed: int  # the contact node decided last, or -1
    last: bool  # the last of its siblings: may take over the parent's state
    weight: float
    #: Presolve: nodes with one child that is not excluded, to be branched on first; None once there were no more.
    forced: tuple[int, ...] | None = None

    def sent(self) -> TreeNode:
        """Node as it is sent to a worker, where it begins without its parent."""
        return replace(self, parent=None, last=False)


class Relaxations:
    """Relaxations of the nodes of one tree.

    Parameters
    ----------
    engine : Engine
    splitting : Splitting
    p : int
        Number of contact nodes.
    forms : Forms or None
        What may be bounded in place of the energy.
    fallback : callable or None
        Gives a slower engine for relaxations that stall.
    """

    def __init__(
        self,
        engine: Engine,
        splitting: Splitting,
        p: int,
        forms: Forms | None = None,
        fallback: Callable[[], Engine] | None = None,
    ) -> None:
        self.engine, self.splitting, self.forms, self._make_fallback = engine, splitting, forms, fallback
        self.nothing: Codes = (UNDECIDED,) * p
        self.rows = ImposedRows(splitting, p)

    def of(self, item: TreeNode) -> Relaxation:
        """The relaxation of a node, from its parent's if that is there; solved or stalled."""
        if item.parent is not None:
            return item.parent.child(*self.rows.of(item.changed, item.codes[item.changed]), last=item.last)
        relaxation = self._root(item.codes)
        return self._by_steps(item.codes) if relaxation.stalled and item.changed >= 0 else relaxation

    def energy(self, codes: Codes) -> Relaxation | None:
        """The relaxation of a partial assignment with the energy, if it is solved and leaves a minimiser."""
        return _usable(self._root(codes, self.engine))

    def fallen_back(self, codes: Codes) -> Relaxation | None:
        """The relaxation by the slower engine; None when that gives no answer either."""
        relaxation = None if self._fallback is None else self._root(codes, self._fallback)
        return None if relaxation is None or relaxation.stalled else relaxation

    def planted(self, items: Sequence[TreeNode]) -> list[TreeNode]:
        """Subtrees of one search, the first one last, with the relaxations from which each of them begins."""
        if len(items) < 2 or any(item.changed < 0 for item in items):
            return list(items)
        planted, codes, relaxation = list[TreeNode](), self.nothing, None
        for k, item in enumerate(items):
            node = item.changed
            over = self.splitting.above(item.codes[node], [deeper.codes[node] for deeper in items[k + 1 :]])
            above = (*item.codes[:node], over, *item.codes[node + 1 :])
            moved = [i for i, (one, other) in enumerate(zip(codes, above, strict=True)) if one != other]
            if relaxation is None:
                relaxation = self._root(above)
            elif moved and _usable(relaxation) is not None:
                relaxation = relaxation.child(*self.rows.over(above, moved), last=False)
            # the first of those with this parent is examined last
            last = bool(moved) or not planted
            planted.append(replace(item, parent=_usable(relaxation), last=last))
            codes = above
        return planted

    def _root(self, codes: Codes, engine: Engine | None = None) -> Relaxation:
        """The relaxation of a partial assignment without a parent; by default with the form in use, if there is one."""
        engine = engine or (None if self.forms is None else self.forms.engine) or self.engine
        return engine.root(*self.rows.over(codes, range(len(codes))))

    def _by_steps(self, codes: Codes) -> Relaxation:
        """The relaxation of a partial assignment, its nodes one after the other."""
        relaxation = self._root(self.nothing)
        for node, code in enumerate(codes):
            if _usable(relaxation) is None:
                break
            if code != UNDECIDED:
                relaxation = relaxation.child(*self.rows.of(node, code), last=True)
        return relaxation

    @cached_property
    def _fallback(self) -> Engine | None:
        return None if self._make_fallback is None else self._make_fallback()


def _usable(relaxation: Relaxation) -> Relaxation | None:
    """A relaxation that is solved and leaves a minimiser."""
    return None if relaxation.stalled or relaxation.pruned else relaxation
