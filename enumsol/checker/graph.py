"""Checker of a branch graph's search: every solution in the interval lies in one of the selections handed on.

Records after the header (see enumsol.proof.proof_file for the file): for every piece ``{"piece": [a, b], "force",
"length", "roots"}``, then its leaves ``["x", codes, rows, multipliers]`` (no solution anywhere in the piece),
``["s", codes]`` (a selection handed on) and ``["c", codes]`` (left to both halves of the piece); at the end
``{"pieces", "leaves", "selections"}``. Codes are strings of p digits.

What is checked: pieces partition the interval, with the subtrees left by a piece searched in both its halves; the
leaves of every piece cover all selections of its roots; every exclusion is proven at both ends of the piece. What is
not: that the arcs of the selections handed on are all there. They follow from these selections by exact algebra, and
the balance of degrees checks them (theory, section 7.7).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.condensation.enclosure import CondensedEnclosure, NotEnclosedError
from enumsol.kernel.interval import (
    EnclosedPiece,
    as_computed,
    interval_exclusion_margins,
    vanishing_alpha,
)
from enumsol.kernel.rows import CONTACT, UNDECIDED, children_of
from enumsol.proof.proof_file import unpacked

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from enumsol.problem import ContactProblem

_MAX_FAILURES = 20
_EXPONENTS = range(-900, 901)
_READ_ERRORS = (KeyError, TypeError, ValueError, IndexError, ZeroDivisionError, OverflowError, AttributeError)

Codes = tuple[int, ...]


@dataclass(frozen=True)
class GraphVerificationReport:
    """What the checker found about a branch graph's search.

    Attributes
    ----------
    ok : bool
        Every solution for every alpha in the interval lies in one of ``selections``.
    failures : tuple of str
    interval : (Fraction, Fraction) or None
    pieces, leaves : int
    selections : frozenset of tuples of status codes
    data : str
        "problem": about the problem's own matrices; "condensed": about S and g as computed.
    """

    ok: bool
    failures: tuple[str, ...]
    interval: tuple[Fraction, Fraction] | None
    pieces: int
    leaves: int
    selections: frozenset[Codes]
    data: str

    @property
    def complete(self) -> bool:
        """Same as ok: a search that was cut short has no proof."""
        return self.ok

    def __repr__(self) -> str:
        ends = () if self.interval is None else tuple(float(end) for end in self.interval)
        span = f" for alpha in [{ends[0]:g}, {ends[1]:g}]" if ends else ""
        lines = [
            f"proof: {'verified' if self.ok else 'REFUSED'}{span}",
            f"  {self.leaves} leaves in {self.pieces} pieces; every solution lies in one of "
            f"{len(self.selections)} selections",
            f"  certified data: {'A, Bn, Bt, f as given' if self.data == 'problem' else 'S and g as computed'}",
        ]
        return "\n".join(lines + [f"  failure: {failure}" for failure in self.failures])


class _Refused(Exception):  # noqa: N818 (never leaves this module)
    """The proof cannot be followed any further."""


@dataclass
class _Piece:
    a: Fraction
    b: Fraction
    force: np.ndarray[Any, Any]
    length: np.ndarray[Any, Any]
    roots: list[Codes]
    empty: list[tuple[Codes, Any, Any]] = field(default_factory=list)
    handed: list[Codes] = field(default_factory=list)
    cut: list[Codes] = field(default_factory=list)


class GraphChecker:
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
        self.problem, self.header, self.progress = problem, header, progress
        self.failures: list[str] = []
        self.pieces = self.leaves = 0
        self.selections: set[Codes] = set()
        self.interval: tuple[Fraction, Fraction] | None = None
        self.data = "problem"

    def run(self, records: Iterator[Any]) -> GraphVerificationReport:
        """Check all records."""
        try:
            self._check(records)
        except _Refused as refusal:
            self.failures.append(str(refusal))
        except NotEnclosedError as error:
            self.failures.append(f"the problem's data cannot be enclosed: {error}")
        failures = tuple(self.failures[:_MAX_FAILURES])
        selections = frozenset(self.selections)
        return GraphVerificationReport(
            not failures, failures, self.interval, self.pieces, self.leaves, selections, self.data
        )

    def _check(self, records: Iterator[Any]) -> None:
        self._read_header()
        assert self.interval is not None
        a, b = self.interval
        everything = [(UNDECIDED,) * self.problem.p]
        enclosure = as_computed(self.problem) if self.data == "condensed" else self._enclosure()
        origin = vanishing_alpha(self.problem, enclosure)
        ends = [a, origin, b] if origin is not None and a < origin < b else [a, b]
        # pieces in the order in which they are searched: halves come directly after the piece that was cut
        waiting = [(x, y, everything) for x, y in pairwise(ends)]
        record = next(records, None)
        while waiting:
            x, y, roots = waiting.pop(0)
            piece, record = self._read_piece(record, records)
            if (piece.a, piece.b) != (x, y) or sorted(piece.roots) != sorted(roots):
                raise _Refused(f"piece {self.pieces + 1} is not the one that is due: the interval is not covered")
            self._check_piece(piece, enclosure, origin if origin in (x, y) else None)
            if piece.cut:
                middle = (x + y) / 2
                waiting[:0] = [(x, middle, piece.cut), (middle, y, piece.cut)]
        claim = {"pieces": self.pieces, "leaves": self.leaves, "selections": len(self.selections)}
        if record != claim:
            self.failures.append(f"the counts at the end are {str(record)[:80]}; the pieces give {claim!r}")
        if next(records, None) is not None:
            self.failures.append("records follow after the end of the proof")

    def _enclosure(self) -> CondensedEnclosure:
        return CondensedEnclosure.from_problem(self.problem)

    def _read_header(self) -> None:
        header = self.header
        if header.get("version") != 1 or header.get("problem") != self.problem.fingerprint:
            raise _Refused("the proof belongs to another problem or version")
        if header.get("p") != self.problem.p or header.get("data") not in ("problem", "condensed"):
            raise _Refused("the header does not fit the problem")
        self.data = header["data"]
        try:
            a, b = (Fraction(end) for end in header["interval"])
        except _READ_ERRORS:
            raise _Refused("the header's interval cannot be read") from None
        if not a < b:
            raise _Refused("the header's interval is empty")
        self.interval = (a, b)
        for end in (a, b):
            F0, F1 = self.problem.friction
            if any(Fraction(x) + end * Fraction(y) < 0 for x, y in zip(F0.tolist(), F1.tolist(), strict=True)):
                raise _Refused(f"friction is negative at alpha = {end}")

    # -- pieces ----------------------------------------------------------------------------------------------------

    def _read_piece(self, record: Any, records: Iterator[Any]) -> tuple[_Piece, Any]:
        """A piece and the record after it."""
        p = self.problem.p
        try:
            a, b = (Fraction(end) for end in record["piece"])
            units = [[int(x) for x in record[key]] for key in ("force", "length")]
            force, length = (np.array(exponents, dtype=int) for exponents in units)
            roots = [self._codes(text) for text in record["roots"]]
        except _READ_ERRORS:
            raise _Refused(f"piece {self.pieces + 1} is missing or cannot be read") from None
        if not (
            force.shape == length.shape == (2 * p,)
            and all(x in _EXPONENTS for x in units[0] + units[1])
            and np.ptp(force + length) == 0
            and np.array_equal(force[:p], force[p:])
        ):
            raise _Refused("the units of a piece are no common scaling of energy and of the two directions of a node")
        piece = _Piece(a, b, np.ldexp(1.0, force), np.ldexp(1.0, length), roots)
        record = next(records, None)
        while isinstance(record, list):
            try:
                kind, text, *rest = record
                codes = self._codes(text)
                if kind == "x":
                    piece.empty.append((codes, *unpacked(*rest)))
                elif kind in ("s", "c") and not rest:
                    (piece.handed if kind == "s" else piece.cut).append(codes)
                else:
                    raise _Refused(f"unknown kind of record {str(kind)[:20]!r}")
            except _READ_ERRORS as error:
                raise _Refused(f"a leaf of piece {self.pieces + 1} cannot be read ({error})") from None
            record = next(records, None)
        return piece, record

    def _codes(self, text: str) -> Codes:
        codes = tuple(int(digit) for digit in text)
        if len(codes) != self.problem.p or not all(0 <= c <= UNDECIDED for c in codes):
            raise ValueError("codes of the wrong length or value")
        return codes

    def _check_piece(self, piece: _Piece, enclosure: CondensedEnclosure, origin: Fraction | None) -> None:
        self.pieces += 1
        enclosed = EnclosedPiece.from_enclosure(enclosure, piece.a, piece.b, piece.force, piece.length, origin)
        friction = [bool(F > 0) for F in enclosed.high]
        for codes in piece.handed:
            if any(code >= CONTACT for code in codes):
                self.failures.append(f"piece {self.pieces}: a selection handed on is not complete")
        leaves = [codes for codes, _, _ in piece.empty] + piece.handed + piece.cut
        for root in piece.roots:
            if not covers(root, [leaf for leaf in leaves if _below(leaf, root)], friction):
                self.failures.append(f"piece {self.pieces}: its leaves do not cover all selections")
        if piece.empty:
            codes, rows, values = zip(*piece.empty, strict=True)
            leaf = np.repeat(np.arange(len(rows)), [len(r) for r in rows])
            margins = interval_exclusion_margins(
                enclosed, np.array(codes, dtype=np.intp), leaf, np.concatenate(rows), np.concatenate(values)
            )
            for number in np.flatnonzero(~(margins > 0)):
                # alone it is added up in another order, that of the search: for a nearly singular S that may decide
                alone = np.array([codes[number]], dtype=np.intp), np.zeros(len(rows[number]), dtype=np.intp)
                if interval_exclusion_margins(enclosed, *alone, rows[number], values[number])[0] > 0:
                    continue
                self.failures.append(f"leaf {self.leaves + number + 1}: its multipliers do not exclude it")
        self.leaves += len(piece.empty)
        self.selections |= set(piece.handed)
        if self.progress is not None:
            self.progress(self.leaves)


def _below(leaf: Codes, root: Codes) -> bool:
    """Whether the assignment ``leaf`` is ``root`` or refines it."""
    return all(_refines(x, y) for x, y in zip(leaf, root, strict=True))


def _refines(fine: int, coarse: int) -> bool:
    return coarse in (fine, UNDECIDED) or (coarse == CONTACT and fine in (1, 2, 3))


def covers(root: Codes, leaves: list[Codes], friction: list[bool]) -> bool:
    """Whether the leaves, all refinements of ``root``, cover every selection in it.

    They come from a tree, so that at some node every leaf refines the root; splitting there gives smaller covers. A
    list that is no tree is refused even if it covers.
    """
    if root in leaves:
        return True
    if not leaves:
        return False
    for node, code in enumerate(root):
        children = children_of(code, friction=friction[node])
        if children and all(leaf[node] != code for leaf in leaves):
            return all(
                covers(child, [leaf for leaf in leaves if _below(leaf, child)], friction)
                for child in ((*root[:node], c, *root[node + 1 :]) for c in children)
            )
    return False
