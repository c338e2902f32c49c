"""The independent checker: does a proof show that its list of roots is complete? It imports nothing from the search.

What it takes on faith: IEEE double arithmetic, the error bounds of ``condensation.enclosure`` and ``kernel``, and
rational arithmetic. It recomputes S, g and F (or their enclosures) from the problem, proves S positive definite, walks
the tree from its root, so that the leaves cover all selections by construction, and checks every leaf.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.arithmetic.balls import SAFE
from enumsol.checker.graph import GraphChecker, GraphVerificationReport
from enumsol.checks import optional_callable
from enumsol.condensation.enclosure import CondensedEnclosure, EnclosedSystem, NotEnclosedError
from enumsol.errors import InvalidArgumentError, InvalidProblemError
from enumsol.kernel.point import exclusion_margins, holds_no_root, solve_selection
from enumsol.kernel.rows import FRICTIONLESS, UNDECIDED, children_of, row_signs
from enumsol.problem import ContactProblem
from enumsol.proof.proof_file import Proof, fraction_from, unpacked

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from enumsol.checker.rational import RationalSystem

    #: codes of a selection, the vertices of its root set, and its dimension
    Polytope = tuple[tuple[int, ...], list[Any], int]

_MAX_FAILURES = 20
_REPORT_EVERY = 256
#: Exclusion leaves checked together.
_BATCH = 256
_EXPONENTS = range(-900, 901)
_FRACTION = re.compile(r"-?[0-9]{1,4000}(/[0-9]{1,4000})?", re.ASCII)
#: Covers underflow of one product.
_SUBNORMAL = 2.0**-1070
_END = object()


@dataclass(frozen=True)
class VerificationReport:
    """What the checker found.

    Attributes
    ----------
    ok : bool
        Every leaf was checked and the counts agree; with ``undecided`` 0 the list of roots is proven complete.
    failures : tuple of str
    roots, families, undecided, leaves : int
        Counts that were checked: isolated roots, families, undecided leaves, all leaves.
    data : str
        "problem": the theorem holds for the problem's own matrices; "condensed": for S, g and F as computed.
    alpha : Fraction or None
        The parameter that the proof is about; None when its header cannot be read.
    """

    ok: bool
    failures: tuple[str, ...]
    roots: int
    families: int
    undecided: int
    leaves: int
    data: str
    alpha: Fraction | None

    @property
    def complete(self) -> bool:
        """The proof shows that nothing but the listed roots and families solves the problem."""
        return self.ok and self.undecided == 0

    def __repr__(self) -> str:
        where = "" if self.alpha is None else f" at alpha = {_shown(self.alpha)}"
        lines = [
            f"proof: {'verified' if self.ok else 'REFUSED'}{where}",
            f"  {self.leaves} leaves cover all selections, {self.undecided} of them undecided",
            f"  {self.roots} isolated roots, {self.families} families",
            f"  certified data: {'A, Bn, Bt, f as given' if self.data == 'problem' else 'S and g as computed'}",
            f"  complete: {'yes' if self.complete else 'no'}",
        ]
        return "\n".join(lines + [f"  failure: {failure}" for failure in self.failures])


def verify(
    problem: ContactProblem, proof: Proof, progress: Callable[[int], object] | None = None
) -> VerificationReport | GraphVerificationReport:
    """Check a proof, of a root set or of a branch graph's search, against a problem.

    Parameters
    ----------
    problem : ContactProblem
    proof : Proof
    progress : callable, optional
        Called now and then with the number of leaves checked.

    Returns
    -------
    VerificationReport or GraphVerificationReport

    Raises
    ------
    ProofFormatError
        The file is damaged (its checksum does not agree) or of another version.
    InvalidArgumentError
        An argument is of another type.
    """
    for name, value, kind in (("problem", problem, ContactProblem), ("proof", proof, Proof)):
        if not isinstance(value, kind):
            raise InvalidArgumentError(f"{name} is a {type(value).__name__}; expected a {kind.__name__}")
    optional_callable(progress, "progress")
    proof.check_integrity()
    records = proof.records()
    header = next(records, None)
    if isinstance(header, dict) and header.get("kind") == "graph":
        return GraphChecker(problem, header, progress).run(records)
    return Checker(problem, progress).run(chain([header], records))


class _Refused(Exception):  # noqa: N818 (never leaves this module)
    """The proof cannot be followed any further."""


@dataclass
class Checker:
    """One walk through a proof."""

    problem: ContactProblem
    progress: Callable[[int], object] | None
    alpha: Fraction = field(init=False)
    failures: list[str] = field(default_factory=list)
    regular: int = 0
    undecided: int = 0
    leaves: int = 0
    polytopes: list[Polytope] = field(default_factory=list)
    data: str = "problem"
    _waiting: list[tuple[int, tuple[int, ...], Any, Any]] = field(default_factory=list)

    def run(self, records: Iterator[Any]) -> VerificationReport:
        """Check all records."""
        families = isolated = 0
        try:
            self._header(next(records, _END))
            self._walk(records)
            isolated, families = self._count()
            footer = next(records, _END)
            claim = {
                "roots": self.regular + isolated,
                "families": families,
                "undecided": self.undecided,
                "leaves": self.leaves,
            }
            if footer != claim:
                found = "missing" if footer is _END else str(footer)[:200]
                self.fail(f"the counts at the end are {found}; the leaves give {claim}")
            if next(records, _END) is not _END:
                self.fail("records follow after the end of the proof")
        except _Refused as refusal:
            self.fail(str(refusal))
        except (NotEnclosedError, InvalidProblemError, InvalidArgumentError) as error:
            self.fail(f"the problem's data cannot be enclosed: {error}")
        return VerificationReport(
            not self.failures,
            tuple(self.failures[:_MAX_FAILURES]),
            self.regular + isolated,
            families,
            self.undecided,
            self.leaves,
            self.data,
            getattr(self, "alpha", None),
        )

    # -- header and tree -------------------------------------------------------------------------------------------

    def _header(self, header: Any) -> None:
        p = self.problem.p
        if not isinstance(header, dict) or header.get("format") != "enumsol-proof" or header.get("version") != 1:
            raise _Refused("the first record is no header of an enumsol-proof of version 1")
        if header.get("problem") != self.problem.fingerprint:
            raise _Refused("the proof belongs to another problem (its fingerprint is different)")
        if header.get("p") != p or header.get("data") not in ("problem", "condensed"):
            raise _Refused("the header does not fit the problem")
        self.data = header["data"]
        force, length, alpha = (header.get(key, []) for key in ("force", "length", "alpha"))
        if not (_are_exponents(force, 2 * p) and _are_exponents(length, 2 * p)):
            raise _Refused("the header's units are no binary exponents")
        sizes = {a + b for a, b in zip(force, length, strict=True)}
        if len(sizes) != 1 or force[:p] != force[p:]:
            raise _Refused("the header's units are no common scaling of energy and of the two directions of a node")
        self.force, self.length = np.ldexp(1.0, np.array(force)), np.ldexp(1.0, np.array(length))
        if not isinstance(alpha, str) or _FRACTION.fullmatch(alpha) is None or not int(alpha.partition("/")[2] or 1):
            raise _Refused("the header's alpha is no fraction")
        self.alpha = Fraction(alpha)
        F0, F1 = self.problem.friction
        exact = [Fraction(x) + self.alpha * Fraction(y) for x, y in zip(F0.tolist(), F1.tolist(), strict=True)]
        if min(exact) < 0:
            raise _Refused("friction is negative at the header's alpha")
        self.friction = [F > 0 for F in exact]

    @cached_property
    def system(self) -> EnclosedSystem:
        """Balls for S, g and F in the proof's units."""
        if self.data == "condensed":
            scaled = self.problem.condensed.at(self.alpha)
            zero = np.zeros_like
            with np.errstate(over="ignore", invalid="ignore"):
                pair = self.force[:, None] / self.length[None, :]
                S, g = scaled.S * pair, scaled.g / self.length
            finite = np.all(np.isfinite(S)) and np.all(np.isfinite(g))
            if not finite or np.any(np.array(self.friction) & (scaled.F == 0)):
                raise _Refused("S, g or F over- or underflow in the proof's units")
            enclosed = EnclosedSystem(S, zero(S), g, zero(g), scaled.F, 4 * np.spacing(scaled.F))
        else:
            enclosed = CondensedEnclosure.from_problem(self.problem).at(self.alpha, self.force, self.length)
        if not enclosed.smallest_eigenvalue > 0:
            raise _Refused("S is not proven positive definite")
        return enclosed

    @cached_property
    def rational(self) -> RationalSystem:
        """The condensed problem in rationals; only leaves that need it ask for it."""
        if self.data == "condensed":
            raise _Refused("a rational leaf in a proof about S and g as computed")
        from enumsol.checker.rational import RationalSystem  # python-flint, not always needed

        return RationalSystem(self.problem, self.alpha)

    def _walk(self, records: Iterator[Any]) -> None:
        p = self.problem.p
        stack: list[tuple[int, ...]] = [(UNDECIDED,) * p]
        while stack:
            codes = stack.pop()
            record = next(records, _END)
            if not isinstance(record, list) or not record:
                raise _Refused(f"{len(stack) + 1} subtrees are not accounted for: the tree breaks off")
            if record[0] == "b":
                stack.extend(reversed(self._children(codes, record)))
                continue
            self.leaves += 1
            try:
                problem = self._leaf(codes, record)
            except (TypeError, ValueError, OverflowError, ZeroDivisionError, IndexError) as error:
                problem = f"the record cannot be read ({error})"
            if problem is not None:
                self.fail(f"leaf {self.leaves}: {problem}")
            if len(self._waiting) >= _BATCH:
                self._exclusions()
            if self.progress is not None and self.leaves % _REPORT_EVERY == 0:
                self.progress(self.leaves)
        self._exclusions()

    def _exclusions(self) -> None:
        """Check the dual inequalities of the waiting leaves together."""
        if not self._waiting:
            return
        numbers, codes, rows, values = zip(*self._waiting, strict=True)
        self._waiting.clear()
        leaf = np.repeat(np.arange(len(rows)), [len(r) for r in rows])
        margins = exclusion_margins(
            self.system, np.array(codes, dtype=np.intp), leaf, np.concatenate(rows), np.concatenate(values)
        )
        for number in np.array(numbers)[~(margins > 0)]:
            self.fail(f"leaf {number}: its multipliers do not exclude it")

    def _children(self, codes: tuple[int, ...], record: list[Any]) -> list[tuple[int, ...]]:
        try:
            _, node, children = record
            expected = children_of(codes[node], friction=self.friction[node]) if node >= 0 else ()
            fits = expected and sorted(children) == sorted(expected)
        except (TypeError, ValueError, IndexError):
            fits = False
        if not fits:
            raise _Refused(f"a branching {str(record)[:60]} does not cover the assignment that it splits")
        return [(*codes[:node], int(code), *codes[node + 1 :]) for code in children]

    def fail(self, message: str) -> None:
        """Take note of a failure."""
        self.failures.append(message)

    # -- leaves ----------------------------------------------------------------------------------------------------

    def _leaf(self, codes: tuple[int, ...], record: list[Any]) -> str | None:
        """Check one leaf; the reason when it proves nothing."""
        kind = record[0]
        if kind == "x":
            self._waiting.append((self.leaves, codes, *unpacked(*record[1:])))
            return None
        if kind == "X":
            return self._rational_exclusion(codes, record)
        if kind == "u":
            self.undecided += 1
            return None
        if kind == "z":
            unloaded = all(c == UNDECIDED for c in codes) and self.problem.is_unloaded(self.alpha)
            # g = 0: the energy bound reads lambda' S lambda <= 0
            self.polytopes.append(((0,) * self.problem.p, [tuple([Fraction(0)] * (2 * self.problem.p))], 0))
            return None if unloaded else "the problem is not unloaded"
        if any(code > FRICTIONLESS for code in codes):
            return "a root or a solved selection is claimed where statuses are still open"
        if kind in ("n", "r"):
            return self._solved(codes, record)
        if kind in ("N", "D"):
            return self._rational_selection(codes, record)
        return f"unknown kind of record {str(kind)[:20]!r}"

    def _solved(self, codes: tuple[int, ...], record: list[Any]) -> str | None:
        ball = solve_selection(self.system, codes)
        if record[0] == "n":
            if holds_no_root(self.system, codes, ball):
                return None
            return "its candidate does not break a condition strictly, nor do its equations contradict each other"
        if ball is None:
            return "its selection is not proven regular"
        if not ball.is_root:
            return "its candidate is not proven to be a root"
        self.regular += 1
        _, mid, rad, index = record
        centre, radius = _floats(mid, len(ball.force)), _floats(rad, len(ball.force))
        with np.errstate(over="ignore", invalid="ignore"):
            reach = np.abs(centre - ball.force * self.force) + ball.force_rad * self.force
            inside = reach * SAFE + np.where(ball.force_rad > 0, _SUBNORMAL, 0.0) <= radius
        if not np.all(inside):
            return "its enclosure does not hold the root"
        return None if index == ball.det_sign else "its index is wrong"

    def _rational_exclusion(self, codes: tuple[int, ...], record: list[Any]) -> str | None:
        rows, values = unpacked(*record[1:])
        p = self.problem.p
        if np.any(rows >= 7 * p):
            return "a row does not exist"
        signs = row_signs(np.array(codes), np.array(self.friction, dtype=float))
        units = [Fraction(self.length[r % p] if r // p < 4 else self.force[r % p]) for r in range(7 * p)]
        positive = self.rational.energy_bound_positive(signs, rows.tolist(), values.tolist(), units)
        return None if positive else "its multipliers do not exclude it in rational arithmetic"

    def _rational_selection(self, codes: tuple[int, ...], record: list[Any]) -> str | None:
        from enumsol.checker.hull import hull_of_selections

        hull = hull_of_selections(self.rational, codes)
        if record[0] == "N":
            return "it holds a root" if hull.points else None
        _, points, dimension = record
        claimed = [tuple(fraction_from(x) for x in point) for point in points]
        if not hull.points or sorted(claimed) != hull.points or dimension != hull.dimension:
            return "its roots are not those that are claimed"
        self.polytopes.append((codes, claimed, hull.dimension))
        return None

    # -- counting --------------------------------------------------------------------------------------------------

    def _count(self) -> tuple[int, int]:
        """Isolated degenerate roots and families: rational solutions joined where they have a point in common.

        A strict root solves no second selection, so it is none of these, and strict roots of two leaves are two.
        """
        groups: list[list[int]] = []
        for k, polytope in enumerate(self.polytopes):
            joined = [k]
            rest = []
            for group in groups:
                if any(self._touch(polytope, self.polytopes[m]) for m in group):
                    joined += group
                else:
                    rest.append(group)
            groups = [*rest, joined]
        families = sum(any(self.polytopes[m][2] > 0 for m in group) for group in groups)
        return len(groups) - families, families

    def _touch(self, a: Polytope, b: Polytope) -> bool:
        """Whether two root sets have a point in common."""
        if set(a[1]) & set(b[1]):
            return True
        if a[2] == b[2] == 0:
            return False
        from enumsol.checker.hull import hull_of_selections

        return bool(hull_of_selections(self.rational, a[0], b[0]).points)


def _shown(alpha: Fraction) -> str:
    """A short text: the float where it is the same number, or else the fraction or its beginning."""
    exact = abs(alpha) < 10**300 and Fraction(float(alpha)) == alpha
    return str(float(alpha)) if exact else str(alpha)[:40]


def _are_exponents(values: Any, size: int) -> bool:
    return isinstance(values, list) and len(values) == size and all(type(x) is int and x in _EXPONENTS for x in values)


def _floats(values: Any, size: int) -> NDArray[np.float64]:
    if not isinstance(values, list) or len(values) != size or not all(type(x) in (int, float) for x in values):
        raise ValueError(f"expected {size} numbers")
    return np.array(values, dtype=np.float64)
