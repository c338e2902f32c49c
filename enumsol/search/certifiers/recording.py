"""What the certifiers that write a proof have in common, in the plane and in space."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from enumsol.proof.records import Branching, UndecidedRecord, Unloaded

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.proof.compressed_parts import Recorder
    from enumsol.proof.records import Record
    from enumsol.search.certifiers.protocol import Certified
    from enumsol.selections.solution import Codes

#: The balls written into a proof are wider than those found by this factor, so that a checker's own balls fit in.
WIDEN = 4.0


class RecordingCertifier:
    """Base of these certifiers: it writes what needs no proof, and keeps count.

    Parameters
    ----------
    recorder : Recorder
        Where the records of the proof go.
    """

    def __init__(self, recorder: Recorder) -> None:
        self.recorder = recorder
        self.sliding: dict[int, int] = {}
        self._verified: dict[Codes, Any] = {}
        self._leaves = 0

    def branching(self, node: int, children: Sequence[int]) -> None:
        """Write a branching of the tree."""
        self.recorder.write(Branching(node, list(children)).write())

    def skipped(self, codes: Codes, reason: str) -> None:
        """Write a subtree that was not examined."""
        del codes
        self._leaf(UndecidedRecord(reason))

    def unloaded(self) -> None:
        """Write the proof of the unloaded body."""
        self._leaf(Unloaded())

    def add(self, part: Certified) -> None:
        """Take over what the certifier of a subtree has proven."""
        self._verified |= part.verified
        self._leaves += part.leaves
        self.sliding |= part.sliding

    def forget(self) -> None:
        """Forget what was proven."""
        self._verified, self._leaves = {}, 0

    def _leaf(self, leaf: Record) -> None:
        self._leaves += 1
        self.recorder.write(leaf.write())
