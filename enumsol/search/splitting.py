"""How the status of a contact node splits into others, and which rows a status imposes.

With a certifier for its leaves and an engine for its relaxations, this is all that the tree needs of a dimension.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from enumsol.model.statuses import CONTACT, FRICTIONLESS, OPEN, SLIDING, SLIP_MINUS, SLIP_PLUS, STICK, UNDECIDED
from enumsol.relaxation.active_set import interval_rows
from enumsol.trusted.status_rows import is_covering, refines

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping, Sequence

    from enumsol.relaxation.engine import Relaxation
    from enumsol.support.array_types import Codes, Floats


class Splitting(Protocol):
    """The statuses of a contact node as the tree sees them."""

    def children(self, codes: Codes, node: int, relaxation: Relaxation | None) -> list[int]:
        """Codes that together cover the node's partial status, in the order in which they are examined."""

    def covers(self, node: int, code: int, children: Sequence[int]) -> bool:
        """True if codes, in any order, cover a partial status of a node."""

    def holds(self, code: int, final: int) -> bool:
        """True if a status allows a final one."""

    def towards(self, codes: Codes, node: int, final: int) -> list[int]:
        """Codes that cover the node's status, which allows a final one."""

    def above(self, code: int, deeper: Iterable[int]) -> int:
        """A code of which this one may be a child, and of which the others are parts."""

    def rows(self, node: int, code: int) -> Sequence[tuple[int, int]]:
        """(kind, mode) of the rows that the node imposes in a status; those of a child extend its parent's."""


class ImposedRows:
    """The rows of a splitting as engines number them, kind * p + node, asked for once per node and status.

    Parameters
    ----------
    splitting : Splitting
    p : number of contact nodes
    """

    def __init__(self, splitting: Splitting, p: int) -> None:
        self._splitting, self._p = splitting, p
        self._known: dict[tuple[int, int], tuple[list[int], list[int]]] = {}

    def of(self, node: int, code: int) -> tuple[list[int], list[int]]:
        """Rows that a node imposes in a status, and their modes."""
        rows = self._known.get((node, code))
        if rows is None:
            pairs = self._splitting.rows(node, code)
            rows = [kind * self._p + node for kind, _ in pairs], [mode for _, mode in pairs]
            self._known[node, code] = rows
        return rows

    def over(self, codes: Codes, nodes: Sequence[int]) -> tuple[list[int], list[int]]:
        """The rows of some nodes in a partial assignment, and their modes."""
        if len(nodes) == 1:
            return self.of(nodes[0], codes[nodes[0]])
        parts = [self.of(node, codes[node]) for node in nodes]
        return [row for rows, _ in parts for row in rows], [mode for _, modes in parts for mode in modes]


def branching_node(
    codes: Codes,
    forced: tuple[int, ...] | None,
    relaxation: Relaxation | None,
    last: Collection[int] = (),
    choose: Callable[[Codes, Relaxation], int] = lambda codes, relaxation: relaxation.choose(codes),
) -> tuple[int, tuple[int, ...] | None]:
    """The contact node to branch on, -1 when all are decided; and the forced ones that the children begin with.

    Parameters
    ----------
    codes : status codes
    forced : those of the node of the tree (see TreeNode)
    relaxation : with its minimiser, or None
    last : nodes that are branched on when no others are left
    choose : rule that gives a node, or -1 when all are decided
    """
    if relaxation is None:
        node = next((i for i, code in enumerate(codes) if code in (CONTACT, UNDECIDED)), -1)
        return (node if node >= 0 else _sliding_node(codes)), forced
    if forced is not None:
        forced = forced or relaxation.forced(codes)
        if forced:
            return forced[0], forced[1:]
    node = choose(tuple(OPEN if i in last else code for i, code in enumerate(codes)), relaxation) if last else -1
    if node < 0:
        node = choose(codes, relaxation)
    return (node if node >= 0 else _sliding_node(codes)), None


def _sliding_node(codes: Codes) -> int:
    return next((i for i, code in enumerate(codes) if code in SLIDING), -1)


#: What a node in contact with friction may be.
_CONTACT = STICK, SLIP_PLUS, SLIP_MINUS


class PlaneSplitting:
    """Two dimensions: open or in contact; then stick, slip+ or slip-.

    Parameters
    ----------
    F : (p,) array
        Friction coefficients; a node with F = 0 is only open or in contact.
    allowed : per node the final codes to be examined; default all
    sliding : FORWARD or BACKWARD for nodes that slide without load as far as is known; read as the search goes on
        They are split into that code and the two statuses that it does not contain.
    least : (p,) array, optional
        Over an interval of alpha the smallest coefficients, F being the largest; by default there is one alpha.
    """

    def __init__(
        self,
        F: Floats,
        allowed: Sequence[frozenset[int]] | None = None,
        sliding: Mapping[int, int] | None = None,
        least: Floats | None = None,
    ) -> None:
        self._F: list[float] = F.tolist()
        self._sliding = sliding if sliding is not None else {}
        self.friction = [bool(f > 0) for f in F]
        self._constant = [least is None or bool(least[i] == f) for i, f in enumerate(F)]
        every = frozenset((OPEN, STICK, SLIP_PLUS, SLIP_MINUS, FRICTIONLESS))
        self._allowed = list(allowed) if allowed is not None else [every] * len(F)
        #: Per node the codes of its friction in contact, and those of the two parts of an undecided one.
        self._contact = [tuple(c for c in _CONTACT if c in some) for some in self._allowed]
        self._parts = [self._touching_or_not(i) for i in range(len(F))]

    def covers(self, node: int, code: int, children: Sequence[int]) -> bool:
        """True if codes, in any order, cover a partial status of a node."""
        return is_covering(code, children, friction=self.friction[node])

    def holds(self, code: int, final: int) -> bool:
        """True if a status allows a final one."""
        return refines(final, code) or final in SLIDING.get(code, ())

    def towards(self, codes: Codes, node: int, final: int) -> list[int]:
        """Codes of the node's children."""
        del final
        return self.children(codes, node, None)

    def above(self, code: int, deeper: Iterable[int]) -> int:
        """A code of which this one may be a child, and of which the others are parts."""
        return CONTACT if all(refines(c, CONTACT) for c in (code, *deeper)) and code != CONTACT else UNDECIDED

    def rows(self, node: int, code: int) -> Sequence[tuple[int, int]]:
        """(kind, mode) of the rows that a contact node imposes in a status."""
        return interval_rows(code, friction=self.friction[node], constant=self._constant[node])

    def children(self, codes: Codes, node: int, relaxation: Relaxation | None) -> list[int]:
        """Codes of the children, the one nearest to the minimiser first."""
        code = codes[node]
        if code in SLIDING:
            return list(SLIDING[code])
        if code == UNDECIDED:
            if self.friction[node] and node in self._sliding:
                side = self._sliding[node]
                return [side, STICK, SLIP_MINUS if SLIP_PLUS in SLIDING[side] else SLIP_PLUS]
            children = list(self._parts[node])
            if relaxation is not None:
                normal, w_n = relaxation.at(node)
                if normal > -w_n:
                    children.reverse()
            return children
        contact = self._contact[node]
        if relaxation is None:
            return list(contact)
        normal, _ = relaxation.at(node)
        tangential, w_t = relaxation.at(len(codes) + node)
        forward, backward = _CONTACT[1:] if w_t >= 0.0 else _CONTACT[:0:-1]
        if self._F[node] * normal - abs(tangential) > abs(w_t):
            order = STICK, forward, backward
        elif w_t != 0.0:
            order = forward, STICK, backward
        else:
            order = forward, backward, STICK
        return [c for c in order if c in contact]

    def _touching_or_not(self, node: int) -> tuple[int, ...]:
        """The children of an undecided node: open, and in contact."""
        allowed, contact = self._allowed[node], self._contact[node]
        touching = FRICTIONLESS if not self.friction[node] else (contact[0] if len(contact) == 1 else CONTACT)
        children = (OPEN,) if OPEN in allowed else ()
        return (*children, touching) if (contact if self.friction[node] else FRICTIONLESS in allowed) else children
