"""Checker of a branch graph: every solution in the interval lies in one of the surviving selections, or on its arcs.

Records (see enumsol.proof.proof_file for the file and the reader): a header ``{"format": "enumsol-proof",
"version": 2, "kind": "graph", "problem": <fingerprint>, "interval": [a, b], "p": p, "data": "problem" | "condensed"}``;
for every piece ``{"piece": [a, b], "force", "length", "roots"}``, then its leaves ``["x", codes, rows, multipliers]``
(no solution anywhere in the piece), ``["f", codes, rows, multipliers]`` (the same by the form declared last, ``["q",
mu, nu, alpha, beta]``), ``["s", codes]`` (a surviving selection) and ``["c", codes]`` (left to both halves of the
piece), or ``["m", mu, kappa, nu]`` (all solutions lie on the arcs of the surviving selections; of a body that nothing
holds that is shown by leaves ``["o", codes, 1, rows, products]`` and ``["i", codes, direction]``); then, if the proof
holds them, arcs (see enumsol.checker.arcs); at the end ``{"pieces", "leaves", "selections"}``, with arcs ``"traces"``
and ``"arcs"``, too. Codes are strings of p digits; ends of pieces are fractions ``"a/b"`` in decimal digits.

What is checked: pieces partition the interval (it is cut first where g vanishes, see ``condensation.unloaded``), with
the subtrees left by a piece searched in both its halves; the leaves of every piece cover all selections of its roots;
every exclusion is proven at both ends of the piece. Where the surviving selections hold, and how their arcs are joined,
is checked by ``enumsol.checker.arcs``, if the proof says it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.checker.arcs import ArcChecker, PieceOnArcs
from enumsol.checker.reports import GraphVerificationReport
from enumsol.checker.walk import ProofChecker
from enumsol.condensation.enclosure import CondensedEnclosure
from enumsol.condensation.unloaded import vanishing_alpha
from enumsol.proof import reading
from enumsol.proof.leaves import OnlyReference, Unbalanced
from enumsol.proof.records import Limits, Tree
from enumsol.support.deadlines import tell
from enumsol.trusted.exclusion import Leaves, Terms, exclusion_margin, exclusion_margins
from enumsol.trusted.over_interval import KINDS, EnclosedPiece, as_computed
from enumsol.trusted.status_rows import (
    BACKWARD,
    CONTACT,
    FORWARD,
    FRICTIONLESS,
    OPEN,
    SLIP_MINUS,
    SLIP_PLUS,
    STICK,
    UNDECIDED,
    coverings_of,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from fractions import Fraction

    from enumsol.condensation.data import Data
    from enumsol.model.problem import ContactProblem
    from enumsol.support.array_types import Floats, Mask, NDArray

    Codes = NDArray[np.uint8]


#: Entries of a leaf's record, by its kind, and those of a form's.
_ENTRIES = {"x": 4, "f": 4, "s": 2, "c": 2}
#: Kinds that do not rest on a stiffness that is positive definite; and those of pieces without a tree.
_OF_ANY_BODY = ("x", "s", "c")
_BESIDE_ARCS: dict[str, tuple[int, Any]] = {"o": (5, OnlyReference), "i": (3, Unbalanced)}
_FORM, _FORM_ENTRIES = "q", 5
#: Of a piece's leaves beside arcs, at most so many times p^2.
_MOST_BESIDE_ARCS = 64
#: Begins the record of a piece without a tree.
_CLOSED = "m"
END = object()


@dataclass
class PieceLeaves:
    """A piece whose leaves are being read."""

    a: Fraction
    b: Fraction
    force: Floats
    length: Floats
    roots: Codes
    #: of every leaf its kind, and its p codes as bytes
    kinds: bytearray = field(default_factory=bytearray)
    codes: bytearray = field(default_factory=bytearray)
    # leaves of a piece after which repetitions are first looked for; then whenever their number has doubled
    look: int = 1024
    #: made when there is something to exclude
    enclosed: EnclosedPiece | None = None
    #: multipliers of the form declared last, and the piece with it
    declared: Floats | None = None
    with_form: EnclosedPiece | None = None
    closed: PieceOnArcs | None = None

    def declare(self, record: list[Any]) -> None:
        """Read a form."""
        if len(record) != _FORM_ENTRIES:
            raise ValueError(f"a form has {len(record)} entries; expected {_FORM_ENTRIES}")
        declared = np.array([reading.numbers_from(values, self.roots.shape[1]) for values in record[1:]])
        if np.any(declared[2:] < 0):
            raise ValueError("a multiplier of a form is negative and must not be")
        self.declared, self.with_form = declared, None

    def leaves(self, *kinds: str) -> Codes:
        """Codes of the leaves of these kinds, shape (k, p); all without a kind."""
        codes = np.frombuffer(bytes(self.codes), dtype=np.uint8).reshape(-1, self.roots.shape[1])
        of_kind = np.isin(np.frombuffer(bytes(self.kinds), dtype=np.uint8), [ord(kind) for kind in kinds])
        return codes[of_kind] if kinds else codes


class GraphChecker(ProofChecker):
    """Checks the records of a graph's proof.

    Parameters
    ----------
    problem : ContactProblem
    header : the proof's first record
    progress : callable, optional
        Called with the number of leaves checked after every piece.
    """

    def __init__(
        self, problem: ContactProblem, header: dict[str, Any], progress: Callable[[int], object] | None
    ) -> None:
        super().__init__()
        self.problem, self.header, self.progress = problem, header, progress
        self.pieces = self.leaves = 0
        self.selections: set[bytes] = set()
        self._handed: dict[tuple[int, ...], list[tuple[Fraction, Fraction]]] = {}
        self._closed: list[PieceOnArcs] = []
        self.interval: tuple[Fraction, Fraction] | None = None
        #: A piece has leaves of a tree that is not all left to its halves.
        self._in_trees = False
        self.data: Data = "problem"
        self._arcs: ArcChecker | None = None
        self._friction: list[bool] = []
        self._zero: Fraction | None = None

    def run(self, records: Iterator[Any]) -> GraphVerificationReport:
        """Check all records after the header."""
        with self.refusing():
            self._check(records)
        return replace(
            self._report(),
            ok=not self.failures,
            failures=tuple(self.failures),
            interval=self.interval,
            leaves=self.leaves,
            within=self.problem.rigid_reach if self._bounded else None,
        )

    @property
    def _bounded(self) -> bool:
        """True if something was shown within the bound of the rigid displacement only."""
        return not self.problem.held and (self._in_trees or any(closed.bounded for closed in self._closed))

    def _report(self) -> GraphVerificationReport:
        """Counts of what was checked."""
        return GraphVerificationReport(
            pieces=self.pieces,
            selections=frozenset() if self.failures else frozenset(map(tuple, self.selections)),
            data=self.data,
            arcs=None if self._arcs is None else len(self._arcs.arcs),
            open=0 if self._arcs is None else self._arcs.open,
            closed=len(self._closed),
        )

    def _check(self, records: Iterator[Any]) -> None:
        a, b = self._read_header()
        self._zero = self._vanishing()
        ends = [a, self._zero, b] if self._zero is not None and a < self._zero < b else [a, b]
        everything = np.full((1, self.problem.p), UNDECIDED, dtype=np.uint8)
        # pieces in the order in which they are searched, the next one last: halves come directly after what was cut
        waiting = [(x, y, everything) for x, y in pairwise(ends)][::-1]
        record = next(records, END)
        while waiting:
            x, y, roots = waiting.pop()
            tell("per cent of the interval", int(100 * (x - a) / (b - a)), 100)
            cut, record = self._piece(record, records, (x, y, roots))
            if len(cut):
                waiting += [((x + y) / 2, y, cut), (x, (x + y) / 2, cut)]
        claim = {"pieces": self.pieces, "leaves": self.leaves, "selections": len(self.selections)}
        if self.data == "problem" and isinstance(record, dict) and "force" in record and "piece" not in record:
            origin = self._zero if self._zero is not None and a <= self._zero <= b else None
            checker = ArcChecker(self.problem, self.enclosure, (a, b), origin, self._handed, self._closed, self.fail)
            record, self._arcs = checker.run(record, records), checker
            claim |= {"traces": checker.traces, "arcs": len(checker.arcs)}
        elif self._closed:
            self.fail("pieces are said to be decided by their arcs, but there are none")
        self._check_end(record, claim, "pieces", records)

    def _check_end(self, record: object, claim: Mapping[str, int | None], what: str, records: Iterator[Any]) -> None:
        """Compare the counts in the last record with those of what was read."""
        if not reading.same(record, claim):
            found = reading.quoted(record) if isinstance(record, (dict, list)) else "missing"
            self.fail(f"the counts at the end are {found}; the {what} give {claim!r}")
        if next(records, END) is not END:
            self.fail("records follow after the end of the proof")

    @cached_property
    def enclosure(self) -> CondensedEnclosure:
        """Balls for what is certified; only exclusions need them."""
        return as_computed(self.problem) if self.data == "condensed" else CondensedEnclosure.from_problem(self.problem)

    def _vanishing(self) -> Fraction | None:
        """The alpha at which g vanishes, where the interval is cut first."""
        return vanishing_alpha(self.problem, self.data)

    def _read_header(self) -> tuple[Fraction, Fraction]:
        self.data = reading.data_of(self.header, self.problem, "graph")
        try:
            a, b = interval_from(self.header.get("interval"))
            ends = [reading.friction_at(self.problem, end) for end in (a, b)]
        except ValueError as error:
            raise reading.RefusedError(f"the header cannot be read: {error}") from None
        self.interval = (a, b)
        self._friction = [max(pair) > 0 for pair in zip(*ends, strict=True)]
        return a, b

    # -- pieces ----------------------------------------------------------------------------------------------------

    def _piece(
        self, record: object, records: Iterator[Any], due: tuple[Fraction, Fraction, Codes]
    ) -> tuple[Codes, Any]:
        """Check the piece that begins with this record; gives what it leaves to its halves, and the record after it."""
        number = self.pieces + 1
        try:
            piece = self._begin(record)
        except ValueError as error:
            raise reading.RefusedError(f"piece {number} is missing or cannot be read: {error}") from None
        if (piece.a, piece.b) != due[:2] or not np.array_equal(_sorted(piece.roots), _sorted(due[2])):
            raise reading.RefusedError(f"piece {number} is not the next one: the interval is not covered")
        self.pieces = number
        record = next(records, END)
        while isinstance(record, list):
            batch: list[list[Any]] = []
            # leaves read and checked together
            while isinstance(record, list) and len(batch) < 256 and not (batch and record[:1] in ([_FORM], [_CLOSED])):
                batch.append(record)
                record = next(records, END)
            try:
                self._read_leaves(piece, batch)
            except ValueError as error:
                raise reading.RefusedError(f"a leaf of piece {number} cannot be read: {error}") from None
        _check_repetitions(piece)
        handed = piece.leaves("s")
        if np.any(handed >= CONTACT):
            self.fail(f"piece {number}: a surviving selection is not complete")
        elif np.any((handed != OPEN) & ((handed == FRICTIONLESS) == np.array(self._friction))):
            self.fail(f"piece {number}: a surviving selection has a status that a node cannot have")
        if piece.closed is not None:
            beside = np.array([codes for codes, _ in piece.closed.leaves], dtype=np.uint8).reshape(-1, self.problem.p)
            covering = np.concatenate([beside, piece.leaves("x")])
            empty = 0 if self.problem.held else len(piece.leaves("x"))
            other = len(handed) + empty < len(piece.leaves()) or piece.declared is not None
            whole = self.problem.held or covers(piece.roots, covering, self._friction)
            if np.any(piece.roots != UNDECIDED) or other or not whole:
                self.fail(f"piece {number}: it is decided by its arcs, but not whole, or has other leaves")
            self._closed.append(piece.closed)
        else:
            self._in_trees |= not np.array_equal(piece.leaves(), piece.leaves("c"))
            if not covers(piece.roots, piece.leaves(), self._friction):
                self.fail(f"piece {number}: its leaves do not cover all selections")
        self.selections.update(row.tobytes() for row in handed)
        for row in handed.tolist():
            self._handed.setdefault(tuple(row), []).append((piece.a, piece.b))
        if self.progress is not None:
            self.progress(self.leaves)
        return piece.leaves("c"), record

    def _begin(self, record: object) -> PieceLeaves:
        if not isinstance(record, dict):
            raise ValueError("no piece begins here")  # noqa: TRY004 (as in reading)
        reading.names_only(record, ("piece", "force", "length", "roots"))
        a, b = interval_from(record["piece"])
        units = reading.units_from(record, self.problem.p)
        return PieceLeaves(a, b, *units, reading.codes_from(record["roots"], self.problem.p))

    def _read_leaves(self, piece: PieceLeaves, batch: list[list[Any]]) -> None:
        """Record some leaves, the first perhaps a form or the piece's numbers, and check those claimed to be empty."""
        kinds = _ENTRIES if self.problem.held else {kind: _ENTRIES[kind] for kind in _OF_ANY_BODY}
        if batch[0][:1] == [_FORM] and self.problem.held:
            piece.declare(batch[0])
            batch = batch[1:]
        elif batch[0][:1] == [_CLOSED]:
            if piece.closed is not None:
                raise ValueError("it is decided by its arcs twice")
            if len(piece.leaves("x")):  # of those before it is not known whether they need the bound
                raise ValueError("it is decided by its arcs, but leaves without a solution are before that")
            piece.closed = PieceOnArcs.read(piece.a, piece.b, batch[0], self.problem.p, held=self.problem.held)
            batch = batch[1:]
        if piece.closed is not None and not self.problem.held:
            batch = [record for record in batch if not self._read_beside_arcs(piece.closed, record)]
        for record in batch:
            kind = record[0] if record else None
            if not isinstance(kind, str) or kind not in kinds:
                raise ValueError(f"unknown kind of record {reading.quoted(kind)}")
            if len(record) != kinds[kind]:
                raise ValueError(f"a record of kind {kind!r} has {len(record)} entries; expected {kinds[kind]}")
        if not batch:
            return
        beside_arcs = piece.closed is not None and not self.problem.held
        most = BACKWARD if beside_arcs else UNDECIDED
        codes = reading.codes_from([record[1] for record in batch], self.problem.p, most)
        piece.codes += codes.tobytes()
        piece.kinds += "".join(record[0] for record in batch).encode()
        if len(piece.kinds) >= piece.look:
            _check_repetitions(piece)
            piece.look = 2 * len(piece.kinds)
        for kind in ("x", "f"):
            empty = [k for k, record in enumerate(batch) if record[0] == kind]
            if empty:
                within = self._enclosed(piece) if kind == "x" else self._with_form(piece)
                texts = (batch[k][2:] for k in empty)
                terms = [reading.multipliers_from(text, KINDS * self.problem.p) for text in texts]
                self._exclusions(within, codes[empty], terms)
                if piece.closed is not None and beside_arcs and not piece.closed.bounded:
                    margins = exclusion_margins(within.unbounded, Leaves.of(codes[empty], terms))
                    piece.closed.bounded = not np.all(margins > 0)

    def _read_beside_arcs(self, closed: PieceOnArcs, record: list[Any]) -> bool:
        """Keep a leaf below which there is nothing beside the arcs; False if the record is none."""
        size, kind = _BESIDE_ARCS.get(record[0] if record and isinstance(record[0], str) else "", (0, None))
        if kind is None:
            return False
        if len(record) != size:
            raise ValueError(f"a record of kind {record[0]!r} has {len(record)} entries; expected {size}")
        (codes,) = reading.codes_from([record[1]], self.problem.p, BACKWARD).tolist()
        # the form of the piece is the one that is declared
        given: Any = (closed.numbers,)
        limits = Limits(tuple(codes), Tree.FLOATING_PLANE, self._friction, given, modes=self.problem.modes.r)
        if len(closed.leaves) >= _MOST_BESIDE_ARCS * self.problem.p**2:
            raise ValueError("it has too many leaves beside its arcs")
        closed.leaves.append((tuple(codes), kind.of(record[2:], limits)))
        self.leaves += 1
        return True

    def _exclusions(self, within: EnclosedPiece, codes: Codes, terms: list[Terms]) -> None:
        margins = exclusion_margins(within, Leaves.of(codes, terms))
        for number in np.flatnonzero(~(margins > 0)):
            # alone it is summed in the order of the search, which may matter for a nearly singular S
            if not exclusion_margin(within, codes[number], *terms[number]) > 0:
                self.fail(f"leaf {self.leaves + number + 1}: its multipliers do not exclude it")
        self.leaves += len(terms)

    def _with_form(self, piece: PieceLeaves) -> EnclosedPiece:
        """The data at both ends of the piece, with the form declared last."""
        enclosed = self._enclosed(piece)
        if piece.declared is None:
            raise ValueError("its form was not declared")
        if piece.with_form is None:
            piece.with_form = enclosed.with_form(piece.declared)
        return piece.with_form

    def _enclosed(self, piece: PieceLeaves) -> EnclosedPiece:
        """The data at both ends of the piece, with S proven positive definite."""
        if piece.enclosed is None:
            piece.enclosed = self._data_on(piece)
            if not all(end.smallest_eigenvalue > 0 for end in piece.enclosed.ends):
                raise reading.RefusedError("S is not proven positive definite")
        return piece.enclosed

    def _data_on(self, piece: PieceLeaves) -> EnclosedPiece:
        origin = self._zero if self._zero in (piece.a, piece.b) else None
        return EnclosedPiece.from_enclosure(self.enclosure, piece.a, piece.b, piece.force, piece.length, origin)


def interval_from(ends: object) -> tuple[Fraction, Fraction]:
    """Both ends of an interval."""
    if not isinstance(ends, list) or len(ends) != 2:
        raise ValueError(f"{reading.quoted(ends)} is not an interval")
    a, b = (reading.rational_from(end) for end in ends)
    if not a < b:
        raise ValueError("an interval is empty")
    return a, b


def _check_repetitions(piece: PieceLeaves) -> None:
    """Refuse a piece that gives a leaf twice: the leaves of a tree are different, and so bounded in number."""
    leaves = piece.leaves()
    if len(np.unique(leaves, axis=0)) < len(leaves):
        raise reading.RefusedError("a piece has a leaf twice")


def _sorted(codes: Codes) -> Codes:
    return codes[np.lexsort(codes.T)]


def covers(roots: Codes, leaves: Codes, friction: Sequence[bool]) -> bool:
    """True if the leaves that refine one of the roots together cover every selection in the roots.

    Both are sets of partial assignments, (k, p) arrays of codes. They come from trees, so that in every cell that holds
    some of them there is a node at which all of them refine it; splitting there gives smaller cells. A list that is not
    a tree is refused even if it covers.
    """
    cell = np.full(len(friction), UNDECIDED, dtype=np.uint8)
    # a cell, the roots in it (None: the whole cell is to be covered), and the leaves in it
    cells: list[tuple[Codes, Codes | None, Codes]] = [(cell, np.unique(roots, axis=0), np.unique(leaves, axis=0))]
    while cells:
        cell, targets, found = cells.pop()
        if targets is not None and len(targets) == 1:
            cell, found, targets = targets[0], found[np.all(_refines(found, targets[0]), axis=1)], None
        elif targets is not None and np.any(np.all(targets == cell, axis=1)):
            targets = None
        if targets is None and np.any(np.all(found == cell, axis=1)):
            continue
        node = _split(cell, found if targets is None else targets, friction)
        if node is None:
            return False
        for child in _covering(int(cell[node]), found[:, node], friction=friction[node]):
            smaller = cell.copy()
            smaller[node] = child
            part = found[_refines(found[:, node], child)]
            inside = None if targets is None else targets[_refines(targets[:, node], child)]
            if inside is None or len(inside):
                cells.append((smaller, inside, part))
    return True


def _split(cell: Codes, refinements: Codes, friction: Sequence[bool]) -> int | None:
    """A node of the cell with alternatives at which all of its refinements are finer than the cell itself."""
    if not len(refinements):
        return None
    for node in np.flatnonzero(np.all(refinements != cell, axis=0)).tolist():
        if coverings_of(int(cell[node]), friction=friction[node]):
            return int(node)
    return None


def _covering(code: int, finer: Codes, *, friction: bool) -> Sequence[int]:
    """Statuses that cover that of a node, if possible such that all of these refine one of them."""
    ways = coverings_of(code, friction=friction)
    fits = (way for way in ways if np.all(np.any([_refines(finer, child) for child in way], axis=0)))
    return next(fits, ways[0])


def _refines(codes: Codes, coarse: int | Codes) -> Mask:
    """Mask of the codes that are ``coarse`` or refine it."""
    held = (coarse == CONTACT) & (codes >= STICK) & (codes <= SLIP_MINUS)
    for sliding, slip in ((FORWARD, SLIP_PLUS), (BACKWARD, SLIP_MINUS)):
        held = held | ((coarse == sliding) & ((codes == OPEN) | (codes == slip)))
    return np.asarray((codes == coarse) | (coarse == UNDECIDED) | held)
