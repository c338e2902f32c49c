"""The checker of proofs about problems in 3D: leaves are statuses and sectors of slip directions."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.arithmetic.balls import SAFE
from enumsol.checker.walk import TreeChecker
from enumsol.condensation.affine import exactly_at
from enumsol.condensation.enclosure import CondensedEnclosure
from enumsol.condensation.space_condensed import EnclosedSpace
from enumsol.model.sectors import DEEPEST, SECTORS, level_of
from enumsol.proof.reading import RefusedError, data_of, exponents_from, numbers_from, rational_from, shown, shown_alpha
from enumsol.proof.reading_space import multipliers_in_space
from enumsol.trusted.space.leaves import Open, distinct_roots, settle
from enumsol.trusted.space.sector_rows import CONTACT, UNDECIDED, children_of, exclusion_margin
from enumsol.trusted.space.space_uniqueness import only_root, only_solution

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from enumsol.trusted.space.leaves import SpaceRoot
    from enumsol.trusted.space.space_uniqueness import OnlySolution

#: Entries of a leaf's record, by its kind.
_ENTRIES = {"x": 3, "n": 1, "r": 4, "z": 1, "u": 2, "m": 6}


@dataclass
class SpaceChecker(TreeChecker):
    """Checks one proof of a problem in 3D."""

    roots: list[tuple[tuple[int, ...], SpaceRoot]] = field(default_factory=list)
    doubtful: int = 0

    # -- header and tree -------------------------------------------------------------------------------------------

    def _read_header(self, header: Any) -> None:
        self.data = data_of(header, self.problem, "space")
        if self.data != "problem":
            raise RefusedError("a proof about a problem in 3D certifies the problem's own data only")
        try:
            self.force, self.length = _units(header, self.problem.p)
            self.alpha = rational_from(header.get("alpha"))
            pairs = zip(self.problem.friction, self.problem.friction_slope, strict=True)
            exact = [exactly_at(self.alpha, *pair) for pair in pairs]
        except ValueError as error:
            raise RefusedError(f"the header cannot be read: {error}") from None
        if min(min(column) for column in exact) < 0:
            raise RefusedError(f"friction is negative at alpha = {shown_alpha(self.alpha)}")
        self.tangents = [sum(F > 0 for F in node) for node in zip(*exact, strict=True)]

    @cached_property
    def system(self) -> EnclosedSpace:
        """Balls for S, g and F in the proof's units."""
        enclosure = CondensedEnclosure.from_problem(self.problem)
        enclosed = EnclosedSpace.of_problem(enclosure, self.alpha, self.force, self.length)
        if not enclosed.smallest_eigenvalue > 0:
            raise RefusedError("S is not proven positive definite")
        return enclosed

    def _coverings(self, code: int, node: int) -> tuple[tuple[int, ...], ...]:
        if code > SECTORS and level_of(code - SECTORS) > DEEPEST:
            return ()
        children = children_of(code, self.tangents[node])
        return (children,) if children else ()

    # -- leaves ----------------------------------------------------------------------------------------------------

    def _leaf(self, codes: tuple[int, ...], record: list[Any]) -> str | None:
        kind = record[0]
        if not isinstance(kind, str) or kind not in _ENTRIES:
            return f"unknown kind of record {shown(kind)}"
        if len(record) != _ENTRIES[kind]:
            return f"its record has {len(record)} entries; expected {_ENTRIES[kind]}"
        if kind == "x":
            rows, values = multipliers_in_space(record[1], record[2], self.problem.p)
            positive = exclusion_margin(self.system, codes, rows, values) > 0
            return None if positive else "its multipliers do not exclude it"
        if kind == "u":
            self.undecided += 1
            return None if isinstance(record[1], str) else "its reason is no text"
        if kind == "z":
            unloaded = all(code == UNDECIDED for code in codes) and self.problem.is_unloaded(self.alpha)
            # g = 0: the energy bound reads y' S y <= 0
            self.regular += 1
            return None if unloaded else "the problem is not unloaded"
        if kind == "m":
            return self._only(codes, record)
        if any(code in (CONTACT, UNDECIDED) for code in codes):
            return "a root or a solved selection is claimed where statuses are still open"
        return self._settled(codes, record)

    def _settled(self, codes: tuple[int, ...], record: list[Any]) -> str | None:
        found = settle(self.system, codes)
        if isinstance(found, Open):
            return "what it holds is not proven"
        if record[0] == "n":
            return None if found is None else "it holds a root"
        if found is None:
            return "it holds no root"
        self.roots.append((codes, found))
        return self._placed(found, record[1:])

    def _only(self, codes: tuple[int, ...], record: list[Any]) -> str | None:
        """The only solution of all."""
        if any(code != UNDECIDED for code in codes):
            return "its only solution is claimed below the root of the tree"
        system, p, m = self.system, self.problem.p, len(self.system.g)
        _, values, leaf, mid, *_ = record
        numbers, centre = numbers_from(values, p + 2 * m), numbers_from(mid, m)
        if not isinstance(leaf, list) or not all(type(code) is int for code in leaf):
            return "its leaf is no list of codes"
        found: OnlySolution | SpaceRoot | None
        found = only_root(system, numbers, tuple(leaf)) if leaf else only_solution(system, numbers, centre[:p])
        if found is None:
            return "its solution is not proven to be the only one"
        self.regular += 1
        return self._placed(found, record[3:])

    def _placed(self, found: SpaceRoot | OnlySolution, said: list[Any]) -> str | None:
        """Why the ball and the index that are said to be those of a root are not, or None."""
        mid, rad, index = said
        centre, radius = (numbers_from(values, len(found.y.mid)) for values in (mid, rad))
        with np.errstate(over="ignore", invalid="ignore"):
            unit = self.system.unit
            inside = (np.abs(centre - found.y.mid * unit) + found.y.rad * unit) * SAFE <= radius
        if not np.all(inside):
            return "its enclosure does not hold the root"
        return None if type(index) is int and index == found.index else "its index is wrong"

    # -- counting --------------------------------------------------------------------------------------------------

    @property
    def _doubtful(self) -> int:
        return self.doubtful

    def _count(self) -> tuple[int, int]:
        """Roots that two leaves share count once; what cannot be told apart leaves the count open."""
        distinct, doubtful = distinct_roots(self.roots)
        self.doubtful = len(doubtful)
        return len(distinct), 0

    def _claim(self, isolated: int, families: int) -> dict[str, int]:
        return {"roots": self.regular + isolated, "undecided": self.undecided, "leaves": self.leaves}


def _units(header: dict[str, Any], p: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Units of forces and displacements of the nodes, powers of two with one product."""
    force, length = (exponents_from(header.get(key), p) for key in ("force", "length"))
    if len({a + b for a, b in zip(force, length, strict=True)}) != 1:
        raise ValueError("the units are no common scaling of energy")
    return np.ldexp(1.0, np.array(force)), np.ldexp(1.0, np.array(length))
