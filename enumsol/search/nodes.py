"""Nodes of the tree, their relaxations, what may close them, lookahead, and forms in place of the energy.

Closers propose certificates that leave a subtree one solution, or none, so that it need not be split; the certifier
proves what they propose, or the tree is searched. Lookahead solves the children of all undecided nodes near the root of
a long tree (theory, section 5.5): one costs almost half as much as a node of the tree. A form (theory, sections 5.8 and
7.8) costs as much as hundreds of nodes, and does not pay everywhere: a search that is still far from its end after many
nodes tries one at its root, and begins again with it if that is worth it. Nothing proven rests on any of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from enumsol.condensation.enclosure import EnclosedSystem
from enumsol.model.statuses import CONTACT, FRICTIONLESS, OPEN, UNDECIDED
from enumsol.relaxation.active_set import ActiveSetEngine
from enumsol.relaxation.engine import PRUNE_MARGIN
from enumsol.search.splitting import ImposedRows, Splitting

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.relaxation.engine import Engine, Relaxation
    from enumsol.relaxation.interior_point import InteriorPointEngine
    from enumsol.search.certifiers.protocol import Led
    from enumsol.support.array_types import Codes
    from enumsol.trusted.quadratic_forms import EnclosedForm, QuadraticForm

    Rows = tuple[list[int], list[int]]


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
        Gives a slower engine for relaxations that stall, or whose multipliers prove nothing.
    """

    def __init__(
        self,
        engine: Engine,
        splitting: Splitting,
        p: int,
        forms: Forms | None = None,
        fallback: Callable[[], InteriorPointEngine] | None = None,
    ) -> None:
        self.engine, self.splitting, self.forms, self._make_fallback = engine, splitting, forms, fallback
        self.nothing: Codes = (UNDECIDED,) * p
        self.rows = ImposedRows(splitting, p)

    def of(self, item: TreeNode) -> Relaxation:
        """The relaxation of a node, from its parent's if that is there; solved or stalled."""
        relaxation = self.below(item.parent, item.codes, (item.changed,), last=item.last)
        alone = item.parent is None and item.changed >= 0
        return self._by_steps(item.codes) if alone and relaxation.stalled else relaxation

    def below(self, parent: Relaxation | None, codes: Codes, changed: Sequence[int], *, last: bool) -> Relaxation:
        """The relaxation of a partial assignment, from its parent's if that is there, by the nodes that changed."""
        return self._root(codes) if parent is None else parent.child(*self.rows.over(codes, changed), last=last)

    def energy(self, codes: Codes) -> Relaxation | None:
        """The relaxation of a partial assignment with the energy, if it is solved and leaves a minimiser."""
        return _usable(self._root(codes, self.engine))

    def fallen_back(self, codes: Codes, failed: Relaxation) -> Relaxation | None:
        """The relaxation by the slower engine; None when that gives no answer either, or none that proves more."""
        engine = self._fallback
        relaxation = None if engine is None or not (failed.stalled or engine.softens) else self._root(codes, engine)
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
    def _fallback(self) -> InteriorPointEngine | None:
        return None if self._make_fallback is None else self._make_fallback()


def _usable(relaxation: Relaxation) -> Relaxation | None:
    """A relaxation that is solved and leaves a minimiser."""
    return None if relaxation.stalled or relaxation.pruned else relaxation


class TreeCloser:
    """Base of the closers of a tree: this one closes nothing.

    Attributes
    ----------
    known : a root that was found before, or what else workers are to know; None where nothing is
    sliding : dict
        FORWARD or BACKWARD for nodes that slide without load as far as is known; they are branched on last.
    relaxed : callable
        Gives the relaxation of an assignment with the energy, if it is solved; the search sets it.
    """

    def __init__(self) -> None:
        self.known: Any = None
        self.sliding: dict[int, int] = {}
        self.relaxed: Callable[[Codes], Relaxation | None] = lambda _: None

    def whole(self) -> list[Any] | None:
        """All solutions of the problem, if one certificate proves that there is one only."""
        return None

    @property
    def leads(self) -> bool:
        """True if `led` decides some nodes of the tree."""
        return False

    def led(self, codes: Codes) -> Led | None:
        """Solutions below an assignment before its relaxation is solved, or else the node to split and how; or None."""
        del codes
        return None

    def closed(self, codes: Codes, relaxation: Relaxation | None) -> list[Any] | None:
        """The solutions of a subtree that can be closed, None where it has to be searched."""
        del codes, relaxation
        return None

    def again(self, codes: Codes, relaxation: Relaxation | None) -> list[Any] | None:
        """The solutions of a subtree that was closed in an earlier search."""
        return self.closed(codes, relaxation)

    def met(self, answer: object) -> None:
        """Take note of what a complete selection holds."""

    def begins_again(self, nodes: int) -> bool:
        """True if so much has become known after some nodes that a search had better begin again."""
        del nodes
        return False


#: A search begins again with lookahead after so many nodes. After more, more are lost, and clips gain less; after 400
#: the tree of the dovetail does, which is soon done (studies/branching_rule).
NODES = 500
#: Share of the tree below which it does, and decisions down to which it then looks ahead: with larger shares trees
#: begin again that are soon done, and deeper clips take twice as many nodes (studies/branching_rule).
_DEPTHS = ((5e-4, 12), (0.03, 6))
#: What is added to the shares, and the weight of three children beside two (studies/branching_rule).
_LEAST, _LATER = 1e-2, 0.05
#: Number of decisions that a status took; of the others two.
_DECISIONS = {UNDECIDED: 0, OPEN: 1, CONTACT: 1, FRICTIONLESS: 1}


class Lookahead:
    """The rule by which one search branches.

    Parameters
    ----------
    relaxations : Relaxations

    Attributes
    ----------
    depth : int
        Partial assignments with at most so many decisions are branched on by their solved children; -1: none.
    """

    def __init__(self, relaxations: Relaxations) -> None:
        self._relaxations = relaxations
        self.depth, self._decided = -1, False

    @property
    def pays(self) -> bool:
        """True if it may pay: relaxations do not solve the children of all nodes anyway, as those of 3D do."""
        return not self._relaxations.engine.solves_children

    def due(self, nodes: int) -> bool:
        """True if it is time to decide, once, whether to look ahead."""
        return not self._decided and nodes >= NODES and self.pays

    def begins(self, covered: float) -> bool:
        """True if a search that has done such a share of the tree had better look ahead; it does from then on."""
        self._decided, self.depth = True, next((depth for share, depth in _DEPTHS if covered < share), -1)
        return self.depth >= 0

    def choose(self, codes: Codes, relaxation: Relaxation) -> int:
        """The contact node to branch on, -1 when all are decided."""
        node = self._best(codes, relaxation) if _decisions(codes) <= self.depth else -1
        return relaxation.choose(codes) if node < 0 else node

    def _best(self, codes: Codes, relaxation: Relaxation) -> int:
        """The undecided node with the largest product of the shares of the gap that its children close, as in (5.7)."""
        best, most = -1, 0.0
        for node, code in enumerate(codes):
            if code not in (UNDECIDED, CONTACT):
                continue
            children = self._relaxations.splitting.children(codes, node, relaxation)
            open_, worth = 0, _LATER if len(children) > 2 else 1.0
            for child in children:
                share = self._share(node, child, relaxation)
                open_, worth = open_ + (share < 1.0), worth * (share + _LEAST)
                if worth <= most:
                    break  # the shares of the others are at most 1
            else:
                if open_ <= 1:
                    return node
                best, most = node, worth
        return best

    def _share(self, node: int, code: int, relaxation: Relaxation) -> float:
        """The share of the gap to pruning that a child closes."""
        child = relaxation.child(*self._relaxations.rows.of(node, code), last=False)
        if child.pruned or child.stalled:
            return float(child.pruned)
        gap = max(PRUNE_MARGIN - relaxation.bound, 1e-300)
        return min(max((child.bound - relaxation.bound) / gap, 0.0), 1.0)

    def learn(self, codes: Codes, node: int) -> bool:
        """Take the rule of an earlier search from how it branched there; False once its rule is known.

        Of a search that looked ahead all its first branchings tell that, down to the depth to which it did.
        """
        decisions = _decisions(codes)
        depth = next((depth for _, depth in reversed(_DEPTHS) if decisions <= depth), -1)
        relaxation = None if depth < 0 else self._relaxations.energy(codes)
        if relaxation is None:
            return False
        if relaxation.forced(codes) or (plain := relaxation.choose(codes)) == (ahead := self._best(codes, relaxation)):
            return True
        if node == ahead:
            self.depth = depth
        return node not in (plain, ahead) or node == ahead


def _decisions(codes: Codes) -> int:
    return sum(_DECISIONS.get(code, 2) for code in codes)


#: Nodes examined with the energy before a form is tried: more than what that costs.
FORM_AFTER = 1000
#: Steps of the ascent on trial, and those that follow once it pays.
TRIAL, STEPS = 4, 2
#: A form pays when it closes so much more of the gap at the root, or so many times as much.
MORE, TIMES = 0.1, 3.0


class Forms:
    """The form of one search, in 2D and 3D.

    Parameters
    ----------
    better : callable
        Gives a form that is clearly tighter than the energy over a partial assignment, or None; from an engine with the
        energy, the status codes, and numbers and modes of the rows of the assignment.
    nodes : int
        Nodes examined with the energy before a form is tried, by default FORM_AFTER.
    """

    def __init__(self, better: Callable[[Any, Codes, Rows], Any], nodes: int | None = None) -> None:
        self._better, self._nodes = better, FORM_AFTER if nodes is None else nodes
        #: Relaxations with the form in use, and that form, an EnclosedForm or SlipForm; None for the energy.
        self.engine: Engine | None = None
        self.form: QuadraticForm | None = None

    def due(self, nodes: int, covered: float) -> bool:
        """True if it is time to try a form."""
        # a form is tried where at least half of the tree is left
        return self.tried(nodes) and covered < 0.5

    def tried(self, nodes: int) -> bool:
        """True if a search of so many nodes has tried a form."""
        return nodes >= self._nodes

    def use(self, engine: Engine, form: QuadraticForm | None) -> None:
        """Go on with a form that is known already, or with the energy."""
        if form is not None and form is self.form:
            return
        convex = form is not None and form.smallest_eigenvalue > 0
        self.form, self.engine = form, engine.bounding(form) if convex else None

    def pay(self, engine: Engine, codes: Codes, rows: ImposedRows) -> bool:
        """True if a form at the root of the search is clearly tighter than the energy; it is then in use."""
        form = self._better(engine, codes, rows.over(codes, range(len(codes))))
        if form is None or not form.smallest_eigenvalue > 0:
            return False
        self.use(engine, form)
        return True


def ascended(
    scaled: ScaledSystem, enclosed: EnclosedSystem, engine: Engine, codes: Codes, rows: Rows
) -> EnclosedForm | None:
    """A form that is clearly tighter than the energy over a partial assignment; None: there is none.

    Parameters
    ----------
    scaled : ScaledSystem
    enclosed : EnclosedSystem
        Balls for the same system.
    engine : Engine
        Relaxations with the energy; only those of an ActiveSetEngine can bound forms.
    codes : status codes
    rows : numbers and modes of the rows of the assignment
    """
    if not isinstance(engine, ActiveSetEngine):
        return None
    from enumsol.relaxation.convex_forms import PlaneFormAscent

    ascent = PlaneFormAscent(scaled, enclosed, engine, codes, rows)
    plain = engine.root(*rows)
    found = ascent.improve(ascent.energy, TRIAL)
    if found is None or plain.stalled or plain.pruned:
        return None
    if not found[1].pruned:
        before, after = plain.gap_closed(codes), found[1].gap_closed(codes)
        if after < min(before + MORE, TIMES * before):
            return None
        found = ascent.improve(found[0].multipliers, STEPS) or found
    return found[0]
