"""The checker of graphs of bodies that nothing holds (theory, section 14.8), as `enumsol.verify` uses it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from enumsol.checker.floating import check_bound
from enumsol.checker.graph_checker import GraphChecker
from enumsol.proof.reading import RefusedError, quoted
from enumsol.trusted.over_interval import EnclosedPiece

if TYPE_CHECKING:
    from fractions import Fraction

    from enumsol.checker.graph_checker import Piece

#: Kinds of leaves: excluded, a surviving selection, left to both halves.
_KINDS = ("x", "s", "c")


class FloatingGraphChecker(GraphChecker):
    """Checks that every solution within the bound of the rigid displacement lies in one of the surviving selections."""

    follows_arcs = False

    @property
    def within(self) -> float | None:
        """Bound of the rigid displacement."""
        reach: float = self.problem.rigid_reach
        return reach

    def _read_header(self) -> tuple[Fraction, Fraction]:
        interval = super()._read_header()
        if self.data != "problem":
            raise RefusedError("a proof about S and g as computed, of a body that nothing holds")
        check_bound(self.header, self.problem)
        return interval

    def _vanishing(self) -> None:
        """Where g vanishes the body may still be moved."""

    def _read_leaves(self, piece: Piece, batch: list[list[Any]]) -> None:
        for record in batch:
            kind = record[0] if record else None
            if kind not in _KINDS:
                raise ValueError(f"unknown kind of record {quoted(kind)}")
        super()._read_leaves(piece, batch)

    def _data_on(self, piece: Piece) -> EnclosedPiece:
        return EnclosedPiece.floating(self.problem, piece.a, piece.b, piece.force, piece.length)
