"""Proofs that were begun: read as far as they were written, for a search that resumes from them.

Nothing in such a file is trusted. It may end in the middle of a record; whoever uses a record proves it again.
"""

from __future__ import annotations

import contextlib
import itertools
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from enumsol.errors import InvalidArgumentError
from enumsol.proof.leaves import UndecidedRecord
from enumsol.proof.proof_file import EXPANSION, MAGIC, SMALL, ProofFormatError, decoded, lines_of
from enumsol.proof.reading import quoted, same
from enumsol.proof.records import DeclaredForm

#: Bytes that are expanded at once: what is lost before a damaged place.
_CHUNK = 512
#: How an undecided leaf and the footer begin: what needs no proof, and is found out anew.
_OPEN = (f'["{UndecidedRecord.kind}"'.encode(), b"{")
#: How a form begins, which is no node of the tree.
_FORM = f'["{DeclaredForm.kind}"'.encode()


class ProofExtent(NamedTuple):
    """Extent of a proof that was begun.

    Attributes
    ----------
    needed : int
        How many records, after the header, a file that replaces it must hold: all up to the last that is proven.
    nodes : int
        Of all its records, those of nodes of the tree.
    undecided : int
        Nodes of these that are undecided.
    """

    needed: int
    nodes: int
    undecided: int


class BegunProof:
    """A proof file as far as it goes.

    Parameters
    ----------
    place : Path

    Raises
    ------
    InvalidArgumentError
        The file cannot be read, or is no proof of this version.
    """

    def __init__(self, place: Path) -> None:
        self._place = place
        try:
            with place.open("rb") as file:
                start = file.read(len(MAGIC))
        except OSError as error:
            raise _refusal(place, f"cannot be read ({error.strerror or error})") from error
        if not MAGIC.startswith(start):
            other = start.startswith(b"enumsol-proof ")
            raise _refusal(place, f"is of another version ({start!r})" if other else "is not a proof")

    def header(self) -> Any:
        """The first record; None if the file does not go so far."""
        return next(self._records(), None)

    def records(self) -> Iterator[Any]:
        """Records after the header, up to the last one that is whole."""
        return itertools.islice(self._records(), 1, None)

    def extent(self) -> ProofExtent:
        """Extent of the file."""
        needed = nodes = undecided = 0
        for number, line in enumerate(itertools.islice(self._lines(), 1, None), start=1):
            if not line.startswith(_OPEN):
                needed = number
            nodes += line.startswith(b"[") and not line.startswith(_FORM)
            undecided += line.startswith(_OPEN[0])
        return ProofExtent(needed, nodes, undecided)

    def _records(self) -> Iterator[Any]:
        for line in self._lines():
            try:
                yield decoded(line)
            except ProofFormatError:
                return

    def _lines(self) -> Iterator[bytes]:
        try:
            yield from lines_of(self._expanded(), self._place.stat().st_size)
        except ProofFormatError:
            return  # the last line is not whole

    def _expanded(self) -> Iterator[bytes]:
        """The decompressed stream as far as it goes; at most EXPANSION times the size of the file."""
        inflate = zlib.decompressobj()
        with self._place.open("rb") as file:
            left = EXPANSION * self._place.stat().st_size + SMALL
            file.seek(len(MAGIC))
            with contextlib.suppress(zlib.error):
                while left > 0 and not inflate.eof and (chunk := inflate.unconsumed_tail or file.read(_CHUNK)):
                    part = inflate.decompress(chunk, 1 << 16)
                    left -= len(part)
                    yield part
                yield inflate.flush()


def begun_proof(place: Path, header: dict[str, Any]) -> BegunProof | None:
    """The proof in a file from which a search with this header resumes; None if there is nothing in it yet.

    Raises
    ------
    InvalidArgumentError
        It is a file of something else; it says what.
    """
    if not place.exists():
        return None
    begun = BegunProof(place)
    found = begun.header()
    if found is None:
        return None
    if not isinstance(found, dict) or found.get("format") != header["format"]:
        raise _refusal(place, "is not a proof")
    if not same(found.get("kind", ()), header.get("kind", ())):
        raise _refusal(place, f"is a proof of another kind, {quoted(found.get('kind', 'point'))}")
    for name, words in _NAMES.items():
        if not same(found.get(name), header[name]):
            raise _refusal(
                place, f"belongs to another {words} ({quoted(found.get(name))}; here {quoted(header[name])})"
            )
    if not same(found, header):
        raise _refusal(place, "was written with other units of force and length")
    return begun


#: What must agree, in the order in which it is looked at.
_NAMES = {"version": "version", "problem": "problem", "alpha": "alpha", "p": "number of contact nodes", "data": "data"}


def _refusal(place: Path, what: str) -> InvalidArgumentError:
    return InvalidArgumentError(f"proof_path {place} {what}; expected the proof of this search, to be resumed")
