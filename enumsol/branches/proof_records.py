"""The proof of a branch graph's search as a file (see enumsol.checker.graph for its records)."""

from __future__ import annotations

import enum
from typing import TYPE_CHECKING

from enumsol.proof.proof_file import Proof, ProofWriter, packed
from enumsol.proof.reading import fits
from enumsol.search.proof_header import unit_exponents

if TYPE_CHECKING:
    from collections.abc import Sequence
    from fractions import Fraction

    from enumsol.problem import ContactProblem
    from enumsol.search.interval import SearchedPiece
    from enumsol.selections.solution import Codes


class GraphLeaf(enum.StrEnum):
    """Kinds of leaves in the proof of a graph (docs/proof_format.md); the checker keeps its own list."""

    EXCLUDED = "x"
    SELECTION = "s"
    CUT = "c"


def write_graph_proof(
    problem: ContactProblem, interval: tuple[Fraction, Fraction], data: str, pieces: Sequence[SearchedPiece]
) -> Proof | None:
    """The leaves of all pieces with their multipliers; None if the end of a piece has too many digits for it."""
    if not all(fits(end) for found in pieces for end in (found.piece.a, found.piece.b)):
        return None
    writer = ProofWriter()
    ends = [str(end) for end in interval]
    writer.write(
        {
            "format": "enumsol-proof",
            "version": 1,
            "kind": "graph",
            "problem": problem.fingerprint,
            "interval": ends,
            "p": problem.p,
            "data": data,
        }
    )
    selections = set()
    leaves = 0
    for found in pieces:
        units = unit_exponents(found.system.scaled.force, found.system.scaled.length)
        writer.write(
            {
                "piece": [str(found.piece.a), str(found.piece.b)],
                **units,
                "roots": [_text(codes) for codes in found.roots],
            }
        )
        for leaf in found.empty:
            writer.write([GraphLeaf.EXCLUDED, _text(leaf.codes), *packed(leaf.rows, leaf.values)])
        for kind, kept in ((GraphLeaf.SELECTION, found.selections), (GraphLeaf.CUT, found.cut)):
            for codes in kept:
                writer.write([kind, _text(codes)])
        leaves += len(found.empty)
        selections |= set(found.selections)
    writer.write({"pieces": len(pieces), "leaves": leaves, "selections": len(selections)})
    return writer.close()


def _text(codes: Codes) -> str:
    return "".join(map(str, codes))
