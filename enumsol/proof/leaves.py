"""The kinds of leaves that may stand in a tree of a proof."""

from __future__ import annotations

from functools import cache
from typing import Any

from enumsol.proof import records
from enumsol.proof.records import Record, Tree

_AT_POINTS = (
    *(records.Excluded, records.Unbalanced, records.NoRoot, records.RegularRoot, records.SharedRoot),
    *(records.RootSetRecord, records.Closed, records.Alone, records.BoxedRoot, records.OnlyReference),
    *(records.Unloaded, records.UndecidedRecord),
)


@cache
def leaves_of(tree: Tree) -> dict[str, type[Any]]:
    """The kinds of leaves whose theorems hold in a tree, by their letters."""
    every: tuple[type[Record], ...] = _AT_POINTS
    if tree & Tree.PIECES:
        from enumsol.proof.curve_records import OnCurve, ThroughCurveBox  # for graphs in 3D only

        every += OnCurve, ThroughCurveBox
    return {record.kind: record for record in every if record.trees & tree}


def kind_of(record: list[Any], tree: Tree) -> type[Any] | None:
    """The class of a leaf; None for one that may not stand in a tree."""
    return leaves_of(tree).get(record[0]) if record and isinstance(record[0], str) else None
