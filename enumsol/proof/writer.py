"""Proofs as they are written: streamed, readable up to the last records should the program be killed; and resumed.

Records are encoded to parts of the zlib stream of a proof, which are made anywhere and put together without a look
inside. Nothing in a proof that was begun is trusted: it may end in the middle of a record, and whoever uses a record
proves it again.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import itertools
import json
import os
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Protocol

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.proof.leaves import UndecidedRecord
from enumsol.proof.proof_file import DIGEST, MAGIC, PROOF_VERSION, Proof, ProofFormatError, decoded, expanded, lines_of
from enumsol.proof.reading import quoted, rational_text, same
from enumsol.proof.records import DeclaredForm
from enumsol.support.files import check_replaceable, writing

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import Alpha, Floats


# measured on multipliers: higher levels take longer for little (level 6 four times as long for a tenth of the size),
# and no matches at all (Z_HUFFMAN_ONLY) cost half as much again in size
_LEVEL = 1
#: Window of 32 kB; negative: without header and checksum.
_RAW = -zlib.MAX_WBITS
_ENCODER = json.JSONEncoder(separators=(",", ":"), allow_nan=False)
#: How a stream of this level and window begins, and the empty last block (RFC 1950, RFC 1951).
BEGIN, LAST = b"\x78\x01", b"\x03\x00"
#: Modulus of Adler-32.
_ADLER = 65521


def encoded(record: Any) -> str:
    """A record as a line of a proof, without the line feed; ValueError where a number is not finite."""
    return _ENCODER.encode(record)


@dataclass(frozen=True, slots=True)
class Part:
    """Lines of a proof, compressed without reference to what comes before, and ended at a whole byte.

    Attributes
    ----------
    data : bytes
        Blocks of a deflate stream, none of them the last.
    size, adler : int
        Bytes and Adler-32 of the text.
    """

    data: bytes
    size: int
    adler: int

    @classmethod
    def of(cls, lines: list[str]) -> Part:
        """A part of at least one line."""
        text = ("\n".join(lines) + "\n").encode()
        deflate = zlib.compressobj(_LEVEL, zlib.DEFLATED, _RAW)
        data = deflate.compress(text) + deflate.flush(zlib.Z_SYNC_FLUSH)
        return cls(data, len(text), zlib.adler32(text))


def checksum(before: int, part: Part) -> int:
    """Adler-32 of a text that goes on with a part (RFC 1950); of no text it is 1."""
    # the part's own sums began with 1
    first = (before & 0xFFFF) - 1
    low, high = first + (part.adler & 0xFFFF), (before >> 16) + (part.adler >> 16) + part.size * first
    return high % _ADLER << 16 | low % _ADLER


class Recorder(Protocol):
    """Takes the records of a proof in order."""

    def write(self, record: Any) -> None:
        """Append one record."""

    def add(self, part: Part) -> None:
        """Append records that were encoded elsewhere."""


class KeptRecords:
    """Keeps records: of a search that may begin again, or of a task whose records are sent as one part.

    Parameters
    ----------
    packed : bool
        There may be many: they are compressed as they come.
    """

    def __init__(self, *, packed: bool = False) -> None:
        self._records: list[Any] = []
        self._packed, self._loose = packed, 0

    def write(self, record: Any) -> None:
        """Keep a record."""
        self._records.append(record)
        self._loose += 1
        if self._packed and self._loose == FLUSH_EVERY:
            loose = self._records[-FLUSH_EVERY:]
            del self._records[-FLUSH_EVERY:]
            self.add(Part.of([encoded(record) for record in loose]))

    def add(self, part: Part) -> None:
        """Keep records that were encoded elsewhere."""
        self._records.append(part)
        self._loose = 0

    def release(self, recorder: Recorder) -> None:
        """Hand the records on."""
        for record in self._records:
            (recorder.add if isinstance(record, Part) else recorder.write)(record)
        self._records.clear()

    def drop(self) -> None:
        """Forget the records."""
        self._records.clear()

    def part(self) -> Part | None:
        """All records, none of which was encoded elsewhere, as one part; None if there are none."""
        return Part.of([encoded(record) for record in self._records]) if self._records else None


#: Records after which a file is readable to its end: what a killed program loses.
FLUSH_EVERY = 64
#: Endings of the file that is to replace another one, and of the one that is replaced.
BESIDE, BEFORE = ".resumed", ".before"


class ProofWriter:
    """Writes the records of a proof one by one, to a file or to memory.

    A file that cannot be written to the end (a full disk) does not stop the search: the records are dropped from there
    on, and there is no proof.

    Parameters
    ----------
    path : path or None
        Where the proof is streamed to; None keeps the compressed proof in memory.
    beside : bool
        There is a file at ``path`` that must not be lost: a file beside it is written, until `replace`. Otherwise a
        proof that is there is kept beside the new one, and comes back if that cannot be written to the end.

    Attributes
    ----------
    failure : str or None
        Why the file could not be written to the end.

    Raises
    ------
    InvalidArgumentError
        The file cannot be written, or there is one that is not a proof.
    """

    def __init__(self, path: str | Path | None = None, *, beside: bool = False) -> None:
        self._path = None if path is None else Path(path)
        self._beside: Path | None = None
        self._before: Path | None = None
        if beside and self._path is not None:
            self._path = Path(os.path.realpath(self._path))
            self._beside = self._path.with_name(self._path.name + BESIDE)
        self._may_replace = False
        self._file: BinaryIO = io.BytesIO()
        if self._path is not None:
            with writing(self._path, "proof_path"):
                self._file = self._opened(self._path)
        self.failure: str | None = None
        self._digest = hashlib.sha256()
        self._checksum = 1
        self._pending: list[str] = []
        self._emit(MAGIC + BEGIN)

    def write(self, record: Any) -> None:
        """Append one record.

        Raises
        ------
        InvalidArgumentError
            The file takes no more.
        """
        self._pending.append(encoded(record))
        if len(self._pending) >= FLUSH_EVERY:
            self._flush()

    def add(self, part: Part) -> None:
        """Append records that were encoded elsewhere."""
        self._flush()
        self._append(part)

    def replace(self) -> None:
        """Put the file that is written in the place of the one beside it, whose records it now holds."""
        if self._beside is None or self._path is None:
            return
        self._may_replace = True
        self._flush()
        if self.failure is not None:
            return
        # some systems do so only once it is closed
        with contextlib.suppress(OSError):
            os.fsync(self._file.fileno())
            self._beside.replace(self._path)
            self._beside = None

    def close(self) -> Proof:
        """Finish the file and give the proof; a damaged one when there was a ``failure``."""
        if not self._file.closed:  # by an earlier call, which was interrupted
            self._flush()
            self._emit(LAST + self._checksum.to_bytes(4, "big"))
            self._emit(self._digest.digest())
        if self._path is None:
            return Proof(self._file.getvalue())  # type: ignore[attr-defined]
        if self.failure is None:
            self._attempt(self._file.close)
            if self._before is not None:
                self._before.unlink(missing_ok=True)
        if self._beside is not None:
            beside, path = self._beside, self._path
            if self._may_replace and self.failure is None:
                self._attempt(lambda: beside.replace(path))
            else:
                beside.unlink(missing_ok=True)
            self._beside = None
        return Proof(self._path)

    def _opened(self, path: Path) -> BinaryIO:
        if self._beside is not None:
            return self._beside.open("wb")
        check_replaceable(path, "proof_path", MAGIC[:14], "a proof")
        if not path.is_file() or not path.stat().st_size or not os.access(path, os.W_OK):
            return path.open("wb")
        target = Path(os.path.realpath(path))
        with contextlib.suppress(OSError):  # a folder that takes no new names
            self._before = target.rename(target.with_name(target.name + BEFORE))
        try:
            file = target.open("wb")
            if self._before is not None:
                target.chmod(self._before.stat().st_mode & 0o7777)
        except OSError:
            self._restore()
            raise
        return file

    def _restore(self) -> None:
        """Put back the proof that was there before."""
        if self._before is not None and self._path is not None:
            self._before.replace(os.path.realpath(self._path))
            self._before = None

    def _flush(self) -> None:
        if self._pending:
            # an interruption loses records at the end, and has none written twice
            pending, self._pending = self._pending, []
            self._append(Part.of(pending))

    def _append(self, part: Part) -> None:
        self._checksum = checksum(self._checksum, part)
        self._emit(part.data)
        if self.failure is None:
            self._attempt(self._file.flush)

    def _emit(self, data: bytes) -> None:
        self._digest.update(data)
        if self.failure is None:
            self._attempt(lambda: self._file.write(data))

    def _attempt(self, action: Callable[[], object]) -> None:
        try:
            action()
        except OSError as error:
            self.failure = (
                f"proof_path {self._path} cannot be written to the end ({error.strerror}); "
                "expected a place with free space"
            )
            with contextlib.suppress(OSError):  # the same once more, for what is still in its buffer
                self._file.close()
            self._restore()


def point_header(
    problem: AnyProblem, alpha: Alpha, data: str, units: dict[str, list[int]], **kind: str
) -> dict[str, Any]:
    """The header of a proof at one alpha.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    alpha : float or Fraction
    data : what is certified, "problem" or "condensed"
    units : see ``unit_exponents``
    kind : ``kind="space"`` in 3D

    Raises
    ------
    InvalidArgumentError
        alpha is a fraction of more digits than a proof may hold.
    """
    return {
        "format": "enumsol-proof",
        "version": PROOF_VERSION,
        **kind,
        "problem": problem.fingerprint,
        "alpha": rational_text(Fraction(alpha), "alpha"),
        "p": problem.p,
        "data": data,
        **units,
    }


def unit_exponents(force: Floats, length: Floats) -> dict[str, list[int]]:
    """Binary exponents of the units of forces and displacements, powers of two."""
    return {name: (np.frexp(units)[1] - 1).tolist() for name, units in (("force", force), ("length", length))}


#: Bytes that are expanded at once: what is lost before a damaged place.
_CHUNK = 512
#: How an undecided leaf and the footer begin: what needs no proof, and is found out anew.
_OPEN = (f'["{UndecidedRecord.kind}"'.encode(), b"{")
#: How a form begins, which is no node of the tree.
_FORM = f'["{DeclaredForm.kind}"'.encode()


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

    def extent(self) -> tuple[int, int, int]:
        """Extent of the file: records that a replacement must hold, nodes of the tree, and those that are undecided.

        The first are all records after the header up to the last that is proven.
        """
        needed = nodes = undecided = 0
        for number, line in enumerate(itertools.islice(self._lines(), 1, None), start=1):
            if not line.startswith(_OPEN):
                needed = number
            nodes += line.startswith(b"[") and not line.startswith(_FORM)
            undecided += line.startswith(_OPEN[0])
        return needed, nodes, undecided

    def _records(self) -> Iterator[Any]:
        with contextlib.suppress(ProofFormatError):
            yield from map(decoded, self._lines())

    def _lines(self) -> Iterator[bytes]:
        size = self._place.stat().st_size
        # the last line may not be whole, and no digest may stand at the end
        with self._place.open("rb") as file, contextlib.suppress(ProofFormatError):
            file.seek(len(MAGIC))
            yield from lines_of(expanded(file, size + DIGEST, _CHUNK), size)


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
