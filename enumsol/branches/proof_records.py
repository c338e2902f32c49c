"""The proof of a branch graph in 2D as a file; enumsol.checker.graph_checker and checker.arcs read it."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.branches.enclosed.cutting import ArcPart, ArcPartKind
from enumsol.condensation.data import exactly_at
from enumsol.proof.leaves import Excluded, OnlyReference, Survivor, Unbalanced
from enumsol.proof.proof_file import PROOF_VERSION, Proof
from enumsol.proof.reading import fits
from enumsol.proof.records import Branching, CutPiece, DeclaredForm
from enumsol.proof.writer import ProofWriter, unit_exponents
from enumsol.trusted.status_rows import BACKWARD, UNDECIDED, coverings_of, refines

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from enumsol.branches.enclosed.following import Followed
    from enumsol.model.problem import ContactProblem
    from enumsol.model.problem3d import AnyProblem
    from enumsol.search.subintervals import ClosedPiece, SearchedPiece
    from enumsol.support.array_types import Codes, Floats, NDArray


def graph_header(problem: AnyProblem, interval: tuple[Fraction, Fraction], data: str) -> dict[str, Any]:
    """The record with which the proof of a graph begins."""
    return {
        "format": "enumsol-proof",
        "version": PROOF_VERSION,
        "kind": "graph",
        "problem": problem.fingerprint,
        "interval": [str(end) for end in interval],
        "p": problem.p,
        "data": data,
        **({} if problem.held else {"max_rigid_displacement": problem.rigid_reach}),
    }


def write_graph_proof(
    problem: ContactProblem,
    interval: tuple[Fraction, Fraction],
    data: str,
    pieces: Sequence[SearchedPiece],
    followed: Followed | None,
) -> Proof | None:
    """The trees over all pieces with their multipliers, and the traces of the surviving selections.

    None if the end of a piece has too many digits for it.
    """
    if not all(fits(end) for found in pieces for end in (found.piece.a, found.piece.b)):
        return None
    writer = ProofWriter()
    writer.write(graph_header(problem, interval, data))
    selections, leaves = set(), 0
    at_ends = (exactly_at(end, *problem.affine_friction) for end in interval)
    friction = [max(pair) > 0 for pair in zip(*at_ends, strict=True)]
    # assignments that pieces left to their halves, of the next piece the last ones
    due: list[list[Codes]] = []
    for found in pieces:
        roots = due.pop() if due else [(UNDECIDED,) * problem.p]
        one = np.ones(2 * problem.p)
        scaled = None if found.system is None else found.system.scaled
        units = unit_exponents(*((one, one) if scaled is None else (scaled.force, scaled.length)))
        writer.write({"piece": [str(found.piece.a), str(found.piece.b)], **units})
        said = _leaves(problem, found)
        declared: list[DeclaredForm] = []
        cut: list[Codes] = []
        if found.closed is not None:
            declared.append(_form_of_arcs(found.closed, held=problem.held))
            writer.write(declared[0].write())
        for record in trees(roots, list(said), friction):
            if isinstance(record, Branching):
                writer.write(record.write())
                continue
            leaf, form = said[record]
            if form is not None:
                leaf = replace(leaf, by=_place_of(form, declared, writer))
            elif isinstance(leaf, CutPiece):
                cut.append(record)
            writer.write(leaf.write())
        due += [cut, cut] if cut else []
        leaves += sum(isinstance(leaf, (Excluded, Unbalanced, OnlyReference)) for leaf, _ in said.values())
        leaves -= int(found.closed is not None and problem.held)
        selections |= set(found.selections)
    counts = {"pieces": len(pieces), "leaves": leaves, "selections": len(selections)}
    if followed is not None and all(fits(Fraction(end)) for end in _ends(followed)):
        counts |= _write_arcs(writer, followed)
    writer.write(counts)
    return writer.close()


def _form_of_arcs(closed: ClosedPiece, *, held: bool) -> DeclaredForm:
    """The form of the arcs that hold all solutions over a piece."""
    numbers = closed.numbers
    more = [] if held else [numbers.balance, numbers.share, numbers.degree]
    given = np.concatenate([numbers.mu, numbers.kappa, numbers.nu])
    return DeclaredForm(tuple(closed.selections), given, np.array(more, dtype=np.float64))


def _leaves(problem: ContactProblem, found: SearchedPiece) -> dict[Codes, tuple[Any, Floats | None]]:
    """Leaves of the trees over a piece by their assignments, and the multipliers of their forms."""
    if found.closed is not None:
        beside = found.closed.leaves if not problem.held else [(found.roots[0], OnlyReference(1, [], []))]
        return {codes: (said, None) for codes, said in beside}
    leaves: dict[Codes, tuple[Any, Floats | None]] = {
        leaf.codes: (Excluded(leaf.rows, leaf.values), leaf.form) for leaf in found.empty
    }
    leaves |= {codes: (Survivor(), None) for codes in found.selections}
    return leaves | {codes: (CutPiece(str(found.piece.middle)), None) for codes in found.cut}


def _place_of(multipliers: Floats, declared: list[DeclaredForm], writer: ProofWriter) -> int:
    """Number of declarations since a form was declared, this one included; it is declared now if it was not."""
    form = DeclaredForm((UNDECIDED,) * multipliers.shape[1], multipliers.ravel(), np.zeros(0))
    # the same form is another object when it comes from a worker
    place = next((k for k, other in enumerate(declared) if form.same(other)), len(declared))
    if place == len(declared):
        declared.append(form)
        writer.write(form.write())
    return len(declared) - place


#: Whether a code (first) is another one or refines it.
_REFINES = np.array([[refines(code, coarse) for coarse in range(BACKWARD + 1)] for code in range(BACKWARD + 1)])


def trees(roots: Sequence[Codes], leaves: Sequence[Codes], friction: Sequence[bool]) -> Iterator[Branching | Codes]:
    """Branchings and leaves, in preorder, of the trees below some assignments, from their leaves.

    In every cell of a tree there is a node at which all leaves refine it, and so where the cell may be split.
    """
    codes, left = np.array(leaves, dtype=np.uint8), np.arange(len(leaves))
    for root in roots:
        below = np.all(_REFINES[codes[left], root], axis=1)
        waiting = [(root, left[below])]
        left = left[~below]
        while waiting:
            cell, places = waiting.pop()
            if [leaves[k] for k in places[:2]] == [cell]:
                yield cell
                continue
            split = _split(cell, codes[places], friction)
            yield split
            own = codes[places, split.node]
            parts = [places[_REFINES[own, child]] for child in split.children]
            waiting += zip(split.below(cell)[::-1], parts[::-1], strict=True)


def _split(cell: Codes, finer: NDArray[np.uint8], friction: Sequence[bool]) -> Branching:
    """Branching at a node at which all of these refine a cell, into codes such that each of them refines one."""
    for node in np.flatnonzero(np.all(finer != cell, axis=0)).tolist() if len(finer) else ():
        for way in coverings_of(cell[node], friction=friction[node]):
            if np.all(np.any(_REFINES[finer[:, node]][:, way], axis=1)):
                return Branching(node, list(way))
    raise AssertionError("the leaves are those of no tree")


def _ends(followed: Followed) -> Iterator[float | Fraction]:
    """All alphas of the traces."""
    for trace in followed.traces:
        for box in trace.boxes:
            yield from (box.low, box.high)
            for part in box.parts:
                yield part.high
                if part.kind is ArcPartKind.EVENT:
                    yield from part.zero


def _write_arcs(writer: ProofWriter, followed: Followed) -> dict[str, int]:
    """Write the traces of all selections, box by box; gives the counts for the footer."""
    writer.write({"traces": len(followed.traces), **unit_exponents(followed.traced.force, followed.traced.length)})
    for trace in followed.traces:
        ends = [_number(end) for end in (trace.low, trace.high)]
        writer.write(["t", trace.selection.rows.codes, *ends, int(trace.side)])
        for box in trace.boxes:
            ends = [_number(end) for end in (box.low, box.high)]
            writer.write(["w", *ends, int(box.precise), [_part(part) for part in box.parts]])
    return {"traces": len(followed.traces), "arcs": len(followed.joined.arcs)}


def _part(part: ArcPart) -> list[Any]:
    """The kind of a part, its upper end, and what it says; its lower end is the upper end of the part before."""
    end = _number(part.high)
    if part.kind is ArcPartKind.HOLDS:
        return [part.kind, end, part.index]
    if part.kind is ArcPartKind.EVENT:
        zero = [_number(bound) for bound in part.zero]
        return [part.kind, end, part.index, part.condition, int(part.rising), *zero]
    return [part.kind, end]


def _number(value: float | Fraction) -> float | str:
    """An alpha: a float, or a fraction as text."""
    return float(value) if isinstance(value, float) else str(Fraction(value))
