"""What a known root of a body that nothing holds makes of the tree (theory, section 14.11); nothing here is trusted.

Where a certificate leaves no other root below an assignment, the tree ends there. And where certificates for single
nodes that stick, and for pairs of nodes that slip in opposite directions, prove next to everything, the tree is led to
such assignments first.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from enumsol.model.statuses import BACKWARD, FORWARD, OPEN, SLIP_MINUS, SLIP_PLUS, STICK, UNDECIDED
from enumsol.proof.leaves import OnlyReference
from enumsol.search.definite import SHARED
from enumsol.search.nodes import TreeCloser
from enumsol.support.deadlines import look
from enumsol.trusted.at_alpha import solve_selection
from enumsol.trusted.floating_bounds import is_unbalanced, motion_against
from enumsol.trusted.selection import PENETRATION, SLIP_BACKWARD as BACK, SLIP_FORWARD as FORTH
from enumsol.trusted.status_rows import FREE, row_signs

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.relaxation.engine import Relaxation
    from enumsol.search.certifiers.protocol import Certifier, Led
    from enumsol.support.array_types import Codes, Floats
    from enumsol.trusted.reference import PlaneReference

#: Why there is no root below an assignment.
Why = TypeVar("Why")
#: Factors of products that are tried, relative to the compliance.
_FACTORS = np.geomspace(2.0**-8, 2.0**8, 17)
#: Share of the certificates for single nodes and pairs from which the tree is led by them; so many are tried.
_WORTH, _SAMPLE = 0.75, 24
#: Of a row of G, what counts as none of it.
_NOTHING = 1e-9


class ReferenceCloser(TreeCloser):
    """Ends the tree where only a known root is left, in 2D and 3D, and leads it there if it has a cover that pays.

    Parameters
    ----------
    certifier : Certifier
    root : callable giving the codes of a leaf with a strict root, or None
    proposed : callable giving an OnlyReference for the form of a root and an assignment
    cover : callable, optional
        Gives the Cover of a reference, by which the tree may be led.
    worth : callable
        Whether a reference is of any use.
    pause : callable
        After so many tries in vain, how many assignments pass before the next one.
    easy : int
        Assignments that pass before the first try.

    Attributes
    ----------
    known : codes of that leaf, none if there is none, and None if that is not known
    """

    def __init__(
        self,
        certifier: Certifier,
        root: Callable[[], Codes | None],
        proposed: Callable[[Any, Codes], OnlyReference],
        *,
        cover: Callable[[Any], Cover] | None = None,
        worth: Callable[[Any], bool] = lambda _: True,
        pause: Callable[[int], int] = lambda vain: 2**vain - 1,
        easy: int = 0,
    ) -> None:
        super().__init__()
        self._certifier, self._root, self._proposed, self._worth, self._pause = certifier, root, proposed, worth, pause
        self._covered, self._easy, self._wait, self._vain = cover, easy, 0, 0

    @cached_property
    def _reference(self) -> Any:
        if self.known is None:
            self.known = self._root() or ()
        found = self._certifier.reference(self.known) if self.known else None
        return found if found is not None and self._worth(found) else None

    @cached_property
    def _cover(self) -> Cover | None:
        """Leads the tree where that pays."""
        if self._covered is None or self._reference is None:
            return None
        cover = self._covered(self._reference)
        return cover if cover.is_whole and cover.pays else None

    @property
    def leads(self) -> bool:
        """True if the tree is led."""
        return self._cover is not None

    def led(self, codes: Codes) -> Led | None:
        """The roots below an assignment if certificates decide it, or else the node to split and how; or None."""
        if self._cover is None:
            return None
        found = self.again(codes, None) if self._cover.is_due(codes) else None
        return self._cover.split(codes) if found is None else found

    def whole(self) -> list[Any] | None:
        """All solutions of the problem, if one certificate proves that there is one only."""
        if self._easy or self._reference is None:
            return None
        return self.again((UNDECIDED,) * len(self.known), None)

    def closed(self, codes: Codes, relaxation: Relaxation | None) -> list[Any] | None:
        """The solutions of a subtree that can be closed, None where it has to be searched."""
        if self._cover is not None and self._cover.is_due(codes):
            return None  # it was tried before it was split
        if self._easy or self._wait:
            self._easy, self._wait = max(self._easy - 1, 0), max(self._wait - 1, 0)
            return None
        found = self.again(codes, relaxation)
        self._vain = 0 if found is not None else self._vain + 1
        self._wait = self._pause(self._vain)
        return found

    def again(self, codes: Codes, relaxation: Relaxation | None) -> list[Any] | None:
        """The solutions of a subtree that was closed in an earlier search."""
        del relaxation
        if self._reference is None:
            return None
        with np.errstate(all="ignore"):
            proposal = self._proposed(self._reference, codes)
        return self._certifier.only_root(codes, self._reference, proposal)


#: mu of all nodes where kappa is one, and factors of |G d|^2, that are tried.
NUMBERS = tuple((mu, balance) for balance in (16.0, 1024.0) for mu in (1.0, 3.0, 10.0))


def reference_numbers(system: EnclosedSystem, selection: Codes) -> Iterator[tuple[Floats, float, float]]:
    """Numbers of which the form of a root may be made: weights, balance and share (see ``trusted.reference``)."""
    root = solve_selection(system, selection)
    if root is None or not root.is_root:
        return
    F, p, code = system.F, system.p, np.array(selection)
    force, (w_n, w_t) = root.force.mid.reshape(2, -1), root.w.mid.reshape(2, -1)
    own = F > 0
    with np.errstate(divide="ignore", invalid="ignore"):
        stuck = np.clip(force[1] / (F * force[0]), -1.0, 1.0)
        needed = np.where(w_t != 0, -w_n / np.abs(F * w_t), 1.0)
    for mu, balance in NUMBERS:
        apart = np.sign(w_t) * np.maximum(0.0, 1.0 - SHARED * mu * needed)
        choices = [code == SLIP_PLUS, code == SLIP_MINUS, code == STICK]
        share = np.select(choices, [np.ones(p), -np.ones(p), stuck], apart)[own]
        yield np.concatenate([np.full(p, mu), np.ones(len(share)), np.zeros(len(share)), share]), balance, mu


def proposed(references: Sequence[PlaneReference], codes: Codes) -> OnlyReference:
    """All equations of an assignment, and if need be a product of opposite slips with the factor that is best.

    For one root, or for those along a branch, whose form was declared last.
    """
    rows, forward, backward = rows_of(references, codes)
    if not forward or not backward:
        return OnlyReference(1, rows, [])
    pairs = [(one, other) for one in {forward[0], forward[-1]} for other in {backward[0], backward[-1]}]
    middle = references[len(references) // 2]
    found = [_factor(middle, rows, one, other) for one, other in pairs]
    k = int(np.argmax([least for least, _ in found]))
    return OnlyReference(1, rows, [(*pairs[k], found[k][1])] if found[k][0] > 0 else [])


def rows_of(references: Sequence[PlaneReference], codes: Codes) -> tuple[list[int], list[int], list[int]]:
    """Rows on displacements that are equations, and tight ones of nodes that slip forward, and backward."""
    p, F = references[0].system.p, references[0].system.F
    signs = row_signs(np.array(codes), F)
    own = row_signs(np.array(list({one.selection for one in references})), F)
    equal = (signs == FREE) & np.all(own == FREE, axis=0)
    rows = [int(kind * p + node) for kind in (PENETRATION, FORTH) for node in np.flatnonzero(equal[:, kind])]
    tight = list[list[int]]()
    for kind, other in ((FORTH, BACK), (BACK, FORTH)):
        opposed = np.all((own[..., kind] == FREE) | (own[..., other] > 0), axis=0)
        fits = (signs[:, kind] > 0) & opposed & (F > 0) & ~equal[:, kind]
        tight.append([int(kind * p + node) for node in np.flatnonzero(fits)])
    return rows, tight[0], tight[1]


def _factor(reference: PlaneReference, rows: list[int], one: int, other: int) -> tuple[float, float]:
    """The largest least eigenvalue of the small matrix with a product of two tight rows, and its factor."""
    M = reference.form.small_matrix(reference.rows(rows), reference.rows([one, other]), []).mid
    product = np.zeros_like(M)
    product[-1, -2] = product[-2, -1] = 0.5
    least = np.linalg.eigvalsh(M - _FACTORS[:, None, None] * product)[:, 0]
    k = int(np.argmax(least))
    return float(least[k]), float(_FACTORS[k])


class Cover:
    """Leads the tree to nodes that stick, and to pairs that slip in opposite directions.

    Any other root has a node that sticks, or slips backward, unless all nodes are open or slip forward.

    Parameters
    ----------
    references : sequence of PlaneReference
        One, or those along a branch.
    reach : (r,) array, optional
        Bounds of q, by default those of the first system.
    """

    def __init__(self, references: Sequence[PlaneReference], reach: Floats | None = None) -> None:
        self._references, reference = references, references[0]
        self._reach = reference.system.reach if reach is None else reach
        selection = np.array(list({one.selection for one in references}))
        forward = np.count_nonzero(selection == SLIP_PLUS) >= np.count_nonzero(selection == SLIP_MINUS)
        #: Codes of slip with and against the direction in which most nodes slip; with these, open as well.
        self._with, self._against = (SLIP_PLUS, SLIP_MINUS) if forward else (SLIP_MINUS, SLIP_PLUS)
        self._along, self._back = (FORWARD, BACKWARD) if forward else (BACKWARD, FORWARD)
        sticks, *slips = (np.isin(selection, (STICK, code)) for code in (STICK, self._against, self._with))
        self._first, self._second = (np.flatnonzero(np.all(either, axis=0)).tolist() for either in slips)
        self._stick = np.flatnonzero(np.all(sticks, axis=0)).tolist()
        G, at = reference.system.rows.G.mid, reference.at
        self._normal = G[:, : reference.system.p].T
        self._tangential = np.where(at.tangential[:, None] >= 0, G[:, reference.system.p :].T, 0.0)

    @cached_property
    def pays(self) -> bool:
        """True if single nodes that stick, and pairs that slip in opposite directions, mostly leave no other root."""
        p, stick = self._references[0].system.p, self._stick
        if not stick:
            return False
        tried = [{i: STICK} for i in _some(stick)]
        tried += [{stick[0]: self._with, i: self._against} for i in _some(self._second) if i != stick[0]]
        found = [self._closed(tuple(codes.get(i, UNDECIDED) for i in range(p))) is not None for codes in tried]
        return sum(found) >= _WORTH * len(found)

    @cached_property
    def is_whole(self) -> bool:
        """True if balance excludes what neither sticks nor slips where a root does, so that no tree is left there."""
        system = self._references[0].system
        rest = tuple(self._back if i in self._first else UNDECIDED for i in range(system.p))
        return is_unbalanced(system, rest, motion_against(system, rest))

    def _closed(self, codes: Codes) -> OnlyReference | None:
        """Why no other root lies below an assignment; None where that is not proven."""
        with np.errstate(all="ignore"):
            proposal = proposed(self._references, codes)
        given = codes, proposal.rows, proposal.products, self._reach
        alone = (one.is_only_root(*given) for one in self._references)
        return proposal if all(alone) else None

    def leaves(
        self, excluded: Callable[[Codes], Why | None], searched: Callable[[Codes], list[tuple[Codes, Why]] | None]
    ) -> list[tuple[Codes, OnlyReference | Why]] | None:
        """Assignments that cover all, with why no other root lies below each of them; None where that is not proven.

        ``excluded`` gives a reason why there is none below an assignment, or None; ``searched`` the leaves of a tree
        below it, with theirs.
        """
        whole = (UNDECIDED,) * self._references[0].system.p
        if (alone := self._closed(whole)) is not None:
            return [(whole, alone)]
        found: list[tuple[Codes, OnlyReference | Why]] = []
        waiting = [whole] if self.pays else []
        while waiting:
            look()
            codes = waiting.pop()
            reason = (self._closed(codes) if self.is_due(codes) else None) or excluded(codes)
            if reason is not None:
                found.append((codes, reason))
            elif (split := self.split(codes)) is not None:
                node, children = split
                waiting += [(*codes[:node], code, *codes[node + 1 :]) for code in children]
            elif (below := searched(codes)) is not None:
                found += below
            else:
                return None
        return found or None

    def is_due(self, codes: Codes) -> bool:
        """True if an assignment may be one that leaves the root alone."""
        rows, forward, backward = rows_of(self._references, codes)
        return bool(forward and backward) or any(row >= FORTH * len(codes) for row in rows)

    def split(self, codes: Codes) -> tuple[int, list[int]] | None:
        """The node to split next, and how; None where nothing is gained by it."""
        rows, *tight = rows_of(self._references, codes)
        moved = tight[0 if self._with == SLIP_PLUS else 1]
        modes = self._left(rows)
        if not moved:
            for i in self._first:
                if codes[i] == UNDECIDED and np.any(self._moves(i, modes)):
                    return i, [STICK, self._with, self._back]
            return None
        j = moved[0] % len(codes)
        for i in self._second:
            if i == j or not self._opposes(i, j, modes):
                continue
            if codes[i] == UNDECIDED:
                return i, [STICK, self._against, self._along]
            if codes[i] == self._back:
                return i, [self._against, OPEN]
        return None

    def _left(self, rows: list[int]) -> Floats:
        """Rigid modes along which no equation changes, as columns."""
        G, p = self._references[0].system.rows.G.mid, self._references[0].system.p
        fixed = np.array(
            [self._normal[row % p] if row // p == PENETRATION else self._tangential[row % p] for row in rows]
        )
        if not len(fixed):
            return np.eye(len(G))
        _, sizes, V = np.linalg.svd(fixed)
        return np.asarray(V[int(np.count_nonzero(sizes > _NOTHING)) :].T)

    def _moves(self, i: int, modes: Floats) -> Any:
        return np.abs(np.array([self._normal[i], self._tangential[i]]) @ modes) > _NOTHING

    def _opposes(self, i: int, j: int, modes: Floats) -> bool:
        """True if two nodes in contact move in the same direction along what is left."""
        if not modes.shape[1]:
            return False
        normal = self._normal[i] @ modes
        size = float(normal @ normal)
        along = [self._tangential[k] @ modes for k in (i, j)]
        if size > _NOTHING**2:
            along = [a - normal * float(a @ normal) / size for a in along]
        return float(along[0] @ along[1]) > _NOTHING


def _some(nodes: Sequence[int]) -> list[int]:
    """Not too many of them."""
    return [nodes[k] for k in np.unique(np.linspace(0, len(nodes) - 1, min(len(nodes), _SAMPLE)).astype(int))]
