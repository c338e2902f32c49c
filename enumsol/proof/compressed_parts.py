"""Records as bytes: parts of the zlib stream of a proof, made anywhere and put together without a look inside."""

from __future__ import annotations

import json
import zlib
from dataclasses import dataclass
from typing import Any, Protocol

# measured on multipliers: higher levels take longer for little (level 6 four times as long for a tenth of the size),
# and no matches at all (Z_HUFFMAN_ONLY) cost half as much again in size
_LEVEL = 1
#: Window of 32 kB; negative: without header and checksum.
_RAW = -zlib.MAX_WBITS
_ENCODER = json.JSONEncoder(separators=(",", ":"), allow_nan=False)
#: How a stream of this level and window begins, and the empty last block (RFC 1950, RFC 1951).
BEGIN, _LAST = b"\x78\x01", b"\x03\x00"
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


class Checksum:
    """Adler-32 of parts that follow on each other (RFC 1950)."""

    def __init__(self) -> None:
        self._low, self._high = 1, 0

    def add(self, part: Part) -> None:
        """Go on with a part."""
        low, high = part.adler & 0xFFFF, part.adler >> 16
        # the part's own sums began with low = 1
        self._high = (self._high + high + part.size * (self._low - 1)) % _ADLER
        self._low = (self._low + low - 1) % _ADLER

    def end(self) -> bytes:
        """How the stream ends."""
        return _LAST + (self._high << 16 | self._low).to_bytes(4, "big")


class Recorder(Protocol):
    """Takes the records of a proof in order."""

    def write(self, record: Any) -> None:
        """Append one record."""

    def add(self, part: Part) -> None:
        """Append records that were encoded elsewhere."""


class KeptRecords:
    """Keeps records: of a search that may begin again, or of a task whose records are sent as one part."""

    def __init__(self) -> None:
        self._records: list[Any] = []

    def write(self, record: Any) -> None:
        """Keep a record."""
        self._records.append(record)

    def add(self, part: Part) -> None:
        """Keep records that were encoded elsewhere."""
        self._records.append(part)

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
