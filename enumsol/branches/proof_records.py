"""The proof of a branch graph as a file; its records are read by enumsol.checker.graph_checker and checker.arcs."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.branches.enclosed.cutting import ArcPart, ArcPartKind
from enumsol.proof.proof_file import PROOF_VERSION, Proof, packed
from enumsol.proof.reading import fits
from enumsol.proof.writer import ProofWriter, unit_exponents

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from enumsol.branches.enclosed.following import Followed
    from enumsol.model.problem import ContactProblem
    from enumsol.model.problem3d import AnyProblem
    from enumsol.search.subintervals import SearchedPiece
    from enumsol.support.array_types import Codes


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
    """The leaves of all pieces with their multipliers, and the traces of the surviving selections.

    None if the end of a piece has too many digits for it.
    """
    if not all(fits(end) for found in pieces for end in (found.piece.a, found.piece.b)):
        return None
    writer = ProofWriter()
    writer.write(graph_header(problem, interval, data))
    selections = set()
    leaves = 0
    for found in pieces:
        one = np.ones(2 * problem.p)
        scaled = None if found.system is None else found.system.scaled
        units = unit_exponents(*((one, one) if scaled is None else (scaled.force, scaled.length)))
        writer.write(
            {
                "piece": [str(found.piece.a), str(found.piece.b)],
                **units,
                "roots": [_text(codes) for codes in found.roots],
            }
        )
        declared = None
        for leaf in found.empty:
            kind = "x" if leaf.form is None else "f"
            # the same form is another object when it comes from a worker
            if leaf.form is not None and not (declared is not None and np.array_equal(declared, leaf.form)):
                declared = leaf.form
                # begins the record of a form, which is no leaf
                writer.write(["q", *declared.tolist()])
            writer.write([kind, _text(leaf.codes), *packed(leaf.rows, leaf.values)])
        if found.closed is not None:
            numbers, beside = found.closed.numbers, found.closed.leaves
            more = [] if problem.held else [[numbers.balance, numbers.share, numbers.degree]]
            writer.write(["m", *(part.tolist() for part in (numbers.mu, numbers.kappa, numbers.nu)), *more])
            for codes, said in beside:
                kind, *entries = said.write()
                writer.write([kind, _text(codes), *entries])
            leaves += len(beside)
        for kind, kept in (("s", found.selections), ("c", found.cut)):
            for codes in kept:
                writer.write([kind, _text(codes)])
        leaves += len(found.empty)
        selections |= set(found.selections)
    counts = {"pieces": len(pieces), "leaves": leaves, "selections": len(selections)}
    if followed is not None and all(fits(Fraction(end)) for end in _ends(followed)):
        counts |= _write_arcs(writer, followed)
    writer.write(counts)
    return writer.close()


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
        writer.write(["t", _text(trace.selection.rows.codes), *ends, int(trace.side)])
        for box in trace.boxes:
            ends = [_number(end) for end in (box.low, box.high)]
            writer.write(["b", *ends, int(box.precise), [_part(part) for part in box.parts]])
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


def _text(codes: Codes) -> str:
    return "".join(map(str, codes))
