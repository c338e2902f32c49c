"""Proofs as files: a streamed, compressed sequence of records under one checksum.

File layout: the line ``enumsol-proof 1``, a zlib stream, and the SHA-256 digest (32 bytes) of everything before it.
The stream holds one JSON record a line: a header, the tree in preorder, and a footer.

Header
    ``{"format": "enumsol-proof", "version": 1, "problem": <fingerprint>, "alpha": "a/b", "p": p,
    "data": "problem" | "condensed", "force": [...], "length": [...]}``; ``force`` and ``length`` are binary exponents
    of the units in which the multipliers are written. ``data`` says what is certified: the problem's own matrices, or
    the condensed S and g as computed.
Tree
    ``["b", node, [codes]]``: contact node ``node`` is branched on; the children follow, in this order.
    ``["x", rows, multipliers]``: no solution; the dual inequality is positive. Base64 of little-endian 32-bit unsigned
    row numbers and 64-bit floats. ``["X", ...]``: the same, to be checked in rational arithmetic.
    ``["n"]``: no solution; the selection is regular and its only candidate breaks a condition strictly, or its
    equations contradict the bound on all solutions.
    ``["r", [mid], [rad], index]``: exactly one root, regular; 2p balls of lambda in the problem's units.
    ``["N"]``: no solution, in rational arithmetic.
    ``["D", [[point], ...], dimension]``: in rational arithmetic, the selection's roots are the hull of these points,
    each a list of 2p fractions ``"a/b"`` of lambda in the problem's units, in hexadecimal digits (they may be long).
    ``["z"]``: the unloaded body; nothing but lambda = 0 solves.
    ``["u", reason]``: undecided.
Footer
    ``{"roots": ..., "families": ..., "undecided": ..., "leaves": ...}``.
"""

from __future__ import annotations

import base64
import hashlib
import io
import json
import re
import zlib
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Protocol

import numpy as np

from enumsol.checks import file_path, writing
from enumsol.errors import EnumsolError, InvalidArgumentError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

MAGIC = b"enumsol-proof 1\n"
_DIGEST = 32
_CHUNK = 1 << 16
# measured on multipliers: level 6 saves 4 % of the size and takes several times as long
_LEVEL = 1
_ENCODER = json.JSONEncoder(separators=(",", ":"), allow_nan=False)
#: Characters of one record; longer ones are no proof.
_LONGEST = 1 << 26
_HEX_FRACTION = re.compile(r"(-?[0-9a-f]+)/([0-9a-f]+)", re.ASCII)


class ProofFormatError(EnumsolError, ValueError):
    """A proof file is damaged, truncated or of another version."""


def packed(rows: NDArray[np.intp], values: NDArray[np.float64]) -> tuple[str, str]:
    """Multipliers as text."""
    return (
        base64.b64encode(rows.astype("<u4").tobytes()).decode(),
        base64.b64encode(values.astype("<f8").tobytes()).decode(),
    )


def unpacked(rows: str, values: str) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Multipliers from text.

    Raises
    ------
    ValueError
        The text is no base64 of whole numbers, or rows and multipliers are not as many.
    """
    row = np.frombuffer(base64.b64decode(rows, validate=True), dtype="<u4").astype(np.intp)
    value = np.frombuffer(base64.b64decode(values, validate=True), dtype="<f8").astype(np.float64)
    if len(row) != len(value):
        raise ValueError(f"{len(row)} rows and {len(value)} multipliers")
    return row, value


def fraction_text(numerator: int, denominator: int) -> str:
    """A fraction in hexadecimal digits, which Python converts without a limit on their number."""
    return f"{numerator:x}/{denominator:x}"


def fraction_from(text: Any) -> Fraction:
    """A fraction from its text.

    Raises
    ------
    ValueError
        It is no text of that form, or the denominator is zero.
    """
    match = _HEX_FRACTION.fullmatch(text) if isinstance(text, str) else None
    if match is None or not int(match[2], 16):
        raise ValueError(f"{str(text)[:20]!r} is no fraction")
    return Fraction(int(match[1], 16), int(match[2], 16))


class Recorder(Protocol):
    """Takes the records of a proof in order."""

    def write(self, record: Any) -> None:
        """Append one record."""


class ProofWriter:
    """Writes the records of a proof one by one, to a file or to memory.

    Parameters
    ----------
    path : path or None
        Where the proof is streamed to; None keeps the compressed proof in memory.

    Raises
    ------
    InvalidArgumentError
        The file cannot be written.
    """

    def __init__(self, path: str | Path | None = None) -> None:
        self._path = None if path is None else Path(path)
        try:
            self._file: BinaryIO = io.BytesIO() if self._path is None else self._path.open("wb")
        except OSError as error:
            raise InvalidArgumentError(
                f"proof_path {path} cannot be written ({error.strerror}); expected a path for a new file"
            ) from error
        self._digest = hashlib.sha256()
        self._zip = zlib.compressobj(_LEVEL)
        self._pending: list[str] = []
        self._emit(MAGIC)

    def write(self, record: Any) -> None:
        """Append one record."""
        self._pending.append(_ENCODER.encode(record))
        if len(self._pending) >= 256:
            self._flush()

    def close(self) -> Proof:
        """Finish the file and give the proof."""
        self._flush()
        self._emit(self._zip.flush())
        self._file.write(self._digest.digest())
        if self._path is not None:
            self._file.close()
            return Proof(self._path)
        return Proof(self._file.getvalue())  # type: ignore[attr-defined]

    def _flush(self) -> None:
        if self._pending:
            self._emit(self._zip.compress(("\n".join(self._pending) + "\n").encode()))
            self._pending.clear()

    def _emit(self, data: bytes) -> None:
        self._digest.update(data)
        self._file.write(data)


def _no_number(name: str) -> Any:
    raise ValueError(f"{name} is no number of a proof")


class Proof:
    """A proof that a set of roots is complete; ``enumsol.verify(problem, proof)`` checks it.

    Parameters
    ----------
    source : path or bytes
        A proof file or its content.
    """

    def __init__(self, source: Path | bytes) -> None:
        self._source = source

    @property
    def size(self) -> int:
        """Bytes of the proof file."""
        return self._source.stat().st_size if isinstance(self._source, Path) else len(self._source)

    def save(self, path: str | Path) -> None:
        """Write the proof to a file."""
        data = self._source.read_bytes() if isinstance(self._source, Path) else self._source
        place = file_path(path, "path")
        with writing(place, "path"):
            place.write_bytes(data)

    @classmethod
    def load(cls, path: str | Path) -> Proof:
        """A proof from a file.

        Raises
        ------
        ProofFormatError
            The file cannot be read, is no proof, is damaged or of another version.
        """
        proof = cls(file_path(path, "path"))
        proof.check_integrity()
        return proof

    def _open(self) -> BinaryIO:
        if not isinstance(self._source, Path):
            return io.BytesIO(self._source)
        try:
            return self._source.open("rb")
        except OSError as error:
            raise ProofFormatError(
                f"proof {self._source} cannot be read ({error.strerror}); expected a proof file"
            ) from error

    def check_integrity(self) -> None:
        """Raise ProofFormatError unless magic line, version and checksum are right."""
        name = str(self._source) if isinstance(self._source, Path) else "in memory"
        with self._open() as file:
            size = file.seek(0, io.SEEK_END)
            file.seek(0)
            start = file.read(len(MAGIC))
            if start != MAGIC:
                if start.startswith(b"enumsol-proof "):
                    raise ProofFormatError(
                        f"proof {name} has another version ({start[:20]!r}); expected {MAGIC.decode().strip()!r}"
                    )
                raise ProofFormatError(f"proof {name} is no proof file; expected it to begin with 'enumsol-proof'")
            digest = hashlib.sha256(start)
            left = size - len(MAGIC) - _DIGEST
            while left > 0 and (chunk := file.read(min(_CHUNK, left))):
                digest.update(chunk)
                left -= len(chunk)
            if left != 0 or file.read() != digest.digest():
                raise ProofFormatError(f"proof {name} is damaged or truncated: its checksum does not agree")

    def records(self) -> Iterator[Any]:
        """The records in order, read as a stream.

        Raises
        ------
        ProofFormatError
            The content is not a sequence of JSON records.
        """
        inflate = zlib.decompressobj()
        rest = b""
        with self._open() as file:
            left = file.seek(0, io.SEEK_END) - len(MAGIC) - _DIGEST
            file.seek(len(MAGIC))
            while left > 0:
                chunk = file.read(min(_CHUNK, left))
                left -= len(chunk) or left
                try:
                    rest += inflate.decompress(chunk)
                    *lines, rest = rest.split(b"\n")
                    decoded = [json.loads(line, parse_constant=_no_number) for line in lines]
                except (zlib.error, ValueError, RecursionError) as error:
                    raise ProofFormatError(f"the proof's content cannot be decoded ({error})") from error
                if len(rest) > _LONGEST:
                    raise ProofFormatError(f"the proof has a record of more than {_LONGEST} characters")
                yield from decoded
        if rest or not inflate.eof or inflate.unused_data:
            raise ProofFormatError("the proof ends in the middle of a record")

    def __repr__(self) -> str:
        where = str(self._source) if isinstance(self._source, Path) else "in memory"
        return f"Proof ({where}, {self.size} bytes)"
