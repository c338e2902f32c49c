"""Proofs as files: a streamed, compressed sequence of records under one checksum.

File layout: the line ``enumsol-proof 2``, a zlib stream, and the SHA-256 digest (32 bytes) of everything before it.
The stream holds one JSON record per line, in ASCII: a header, the tree in preorder, and a footer. (Proofs of branch
graphs have other records.) docs/proof_format.md says what the records are; ``proof.records`` has a class for each kind
of leaf.

What reading costs
    A file is read as a stream, its header first. Whatever its bytes are, they become at most EXPANSION times as many
    characters, of which one record has at most RECORD_SHARE times the size of the file; numbers are finite and whole
    numbers have at most 18 digits. The checkers read records strictly (``proof.reading``), stop where the records cease
    to make sense or soon after they cease to prove anything, and keep no more of them than what they still need.
"""

from __future__ import annotations

import base64
import hashlib
import io
import json
import math
import stat
import zlib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from enumsol.errors import EnumsolError, InvalidArgumentError
from enumsol.support.arguments import file_path
from enumsol.support.array_types import Floats, Indices
from enumsol.support.files import check_replaceable, write_file
from enumsol.support.messages import html_lines

MAGIC = b"enumsol-proof 2\n"
#: Version of the format, as headers have it.
PROOF_VERSION = 2
#: Bytes of the digest at the end.
DIGEST = 32
_CHUNK = 1 << 16
#: Most characters that a byte of a file may stand for. The level at which proofs are written does not go beyond 1 : 230
#: even for one character repeated; a file that does was made to be expanded.
EXPANSION = 256
#: Longest record, in sizes of its file. A record is long by its multipliers, the digits of its points or the codes of
#: its subtrees, none of which compress that far.
RECORD_SHARE = 16
#: Characters that the smallest file may hold; its few records may compress far.
SMALL = 1 << 16
#: In the bits of a double, half a unit of the upper 32 of them, and these.
_HALF, _UPPER = np.uint64(1 << 31), np.uint64(0xFFFFFFFF << 32)


class ProofFormatError(EnumsolError, ValueError):
    """A proof file is damaged, truncated or of another version."""


#: A row of a problem in 2D and in 3D.
PLANE_ROW, SPACE_ROW = np.dtype("<u4"), np.dtype([("kind", "<u4"), ("node", "<u4"), ("number", "<i8")])


def packed(rows: Indices | Sequence[tuple[int, int, int]], values: Floats) -> tuple[str, str]:
    """Rows, an array of numbers or in 3D a list, and their multipliers as two texts in base64."""
    numbers = rows.astype(PLANE_ROW) if isinstance(rows, np.ndarray) else np.array([*map(tuple, rows)], SPACE_ROW)
    return base64.b64encode(numbers.tobytes()).decode(), base64.b64encode(values.astype("<f8").tobytes()).decode()


def coarse(values: Floats) -> Floats:
    """Values to 21 binary digits: the lower half of their bits is zero, which compresses well."""
    return ((values.view(np.uint64) + _HALF) & _UPPER).view(np.float64)


def fraction_text(numerator: int, denominator: int) -> str:
    """A fraction in hexadecimal digits, which Python converts without a limit on their number."""
    return f"{numerator:x}/{denominator:x}"


class Proof:
    """A proof that a set of roots is complete; ``enumsol.verify(problem, proof)`` checks it.

    Parameters
    ----------
    source : path or bytes
        A proof file or its content.

    Examples
    --------
    >>> import enumsol, tempfile
    >>> problem = enumsol.gallery.one_node_triangle()
    >>> proof = enumsol.enumerate_roots(problem, alpha=5).proof
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     proof.save(f"{folder}/roots.proof")
    ...     again = enumsol.Proof.load(f"{folder}/roots.proof")
    ...     enumsol.verify(problem, again).complete
    True
    """

    def __init__(self, source: str | Path | bytes) -> None:
        if not isinstance(source, str | Path | bytes):
            raise InvalidArgumentError(f"proof is a {type(source).__name__}; expected a path, or bytes")
        self._source = Path(source) if isinstance(source, str) else source

    @property
    def _name(self) -> str:
        return str(self._source) if isinstance(self._source, Path) else "in memory"

    @property
    def size(self) -> int:
        """Bytes of the proof file.

        Raises
        ------
        ProofFormatError
            The file cannot be read.
        """
        with self._open() as file:
            return file.seek(0, io.SEEK_END)

    def save(self, path: str | Path) -> None:
        """Write the proof to a file.

        Raises
        ------
        InvalidArgumentError
            The file cannot be written, or there is one that is not a proof.
        ProofFormatError
            The proof's own file cannot be read any more.
        """
        place = file_path(path, "path")
        check_replaceable(place, "path", MAGIC[:14], "a proof")
        write_file(place, self.content(), "path")

    def content(self) -> bytes:
        """The bytes of the proof file.

        Raises
        ------
        ProofFormatError
            The file cannot be read any more.
        """
        with self._open() as file:
            return file.read()

    @classmethod
    def load(cls, path: str | Path) -> Proof:
        """A proof from a file.

        Raises
        ------
        ProofFormatError
            The file cannot be read, is no proof, is damaged or of another version.
        InvalidArgumentError
            ``path`` is no path.
        """
        proof = cls(file_path(path, "path"))
        proof.check_integrity()
        return proof

    def _open(self) -> BinaryIO:
        if not isinstance(self._source, Path):
            return io.BytesIO(self._source)
        reason = "it is not a regular file"
        try:
            # a pipe or a device has no size that its content could be measured by
            if stat.S_ISREG(self._source.stat().st_mode):
                return self._source.open("rb")
        except (OSError, ValueError) as error:
            reason = _reason(error)
        raise ProofFormatError(f"proof {self._source} cannot be read ({reason}); expected a proof file")

    def check_integrity(self) -> None:
        """Raise ProofFormatError unless magic line, version and checksum are right."""
        with self._open() as file:
            size = file.seek(0, io.SEEK_END)
            file.seek(0)
            start = file.read(len(MAGIC))
            if start != MAGIC:
                if start.startswith(b"enumsol-proof "):
                    raise ProofFormatError(
                        f"proof {self._name} has another version ({start[:20]!r}); expected {MAGIC.decode().strip()!r}"
                    )
                raise ProofFormatError(
                    f"proof {self._name} is not a proof file; expected it to begin with 'enumsol-proof'"
                )
            digest = hashlib.sha256(start)
            left = size - len(MAGIC) - DIGEST
            while left > 0 and (chunk := file.read(min(_CHUNK, left))):
                digest.update(chunk)
                left -= len(chunk)
            if left != 0 or file.read() != digest.digest():
                raise ProofFormatError(f"proof {self._name} is damaged or truncated: its checksum does not agree")

    def records(self) -> Iterator[Any]:
        """The records in order, read as a stream: only the records asked for are expanded.

        Raises
        ------
        ProofFormatError
            The content is not a sequence of JSON records, expands beyond what a proof may, or goes on after its end.
        """
        with self._open() as file:
            size = file.seek(0, io.SEEK_END)
            file.seek(len(MAGIC))
            for line in lines_of(expanded(file, size), size):
                yield decoded(line)

    def __repr__(self) -> str:
        try:
            size = f"{self.size} bytes"
        except ProofFormatError:
            size = "which cannot be read"
        return f"Proof ({self._name}, {size})"

    def _repr_html_(self) -> str:
        return html_lines([repr(self)])


def _reason(error: Exception) -> str:
    return error.strerror if isinstance(error, OSError) and error.strerror else str(error)


def expanded(file: BinaryIO, size: int, chunk_size: int = _CHUNK) -> Iterator[bytes]:
    """The decompressed stream in parts of at most _CHUNK bytes, read in chunks; ``file`` stands at its beginning."""
    inflate = zlib.decompressobj()
    left = size - len(MAGIC) - DIGEST
    total, most = 0, EXPANSION * size + SMALL
    while left > 0 and not inflate.eof:
        chunk = file.read(min(chunk_size, left))
        left -= len(chunk) or left
        full = True
        # a part that is not full has all that the chunk gives
        while full and not inflate.eof:
            try:
                part = inflate.decompress(chunk, _CHUNK)
            except zlib.error as error:
                raise ProofFormatError(f"the proof's content cannot be decoded ({error})") from error
            chunk, full = inflate.unconsumed_tail, len(part) == _CHUNK
            total += len(part)
            if total > most:
                raise ProofFormatError(f"the proof's {size} bytes expand to more than {most} characters")
            yield part
    if not inflate.eof:
        raise ProofFormatError("the proof ends in the middle of a record")
    if left > 0 or inflate.unused_data:
        raise ProofFormatError("the proof's content ends in the middle of its file")


def lines_of(parts: Iterable[bytes], size: int) -> Iterator[bytes]:
    """The lines of a stream, the last one ended too."""
    longest = min(1 << 26, RECORD_SHARE * size + SMALL)
    begun: list[bytes] = []
    length = 0
    for part in parts:
        *ended, rest = part.split(b"\n")
        for line in ended:
            _check_length(length + len(line), longest)
            yield b"".join([*begun, line])
            begun, length = [], 0
        begun.append(rest)
        length += len(rest)
        _check_length(length, longest)
    if length:
        raise ProofFormatError("the proof ends in the middle of a record")


def decoded(line: bytes) -> Any:
    """The record in a line; ProofFormatError if there is none, or something beside it."""
    if b"\r" in line or line != line.strip():
        raise ProofFormatError("the proof has a line with white space around its record, or a carriage return in it")
    try:
        return _DECODER.decode(line.decode("ascii"))
    except (ValueError, RecursionError) as error:
        raise ProofFormatError(f"the proof's content cannot be decoded ({error})") from error


def _check_length(length: int, longest: int) -> None:
    if length > longest:
        raise ProofFormatError(f"the proof has a record of more than {longest} characters")


def _whole(text: str) -> int:
    # codes, exponents and counts have fewer digits
    if len(text) > 18:
        raise ValueError(f"a whole number has {len(text)} digits")
    return int(text)


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"a number is not finite: {text[:20]}")
    return value


def _no_number(name: str) -> Any:
    raise ValueError(f"{name} is not a number of a proof")


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        raise ValueError("a record gives a name twice")
    return found


_DECODER = json.JSONDecoder(parse_int=_whole, parse_float=_finite, parse_constant=_no_number, object_pairs_hook=_object)
