"""Proofs as they are written: streamed, and readable up to the last records should the program be killed."""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from enumsol.proof.compressed_parts import BEGIN, Checksum, Part, encoded
from enumsol.proof.proof_file import MAGIC, Proof
from enumsol.proof.reading import rational_text
from enumsol.support.files import writing

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from enumsol.model.problem import ContactProblem
    from enumsol.model.problem3d import ContactProblem3D
    from enumsol.support.arguments import Alpha

#: Records after which a file is readable to its end: what a killed program loses.
FLUSH_EVERY = 64
#: Ending of the file that is to replace another one.
BESIDE = ".resumed"


class ProofWriter:
    """Writes the records of a proof one by one, to a file or to memory.

    A file that cannot be written to the end (a full disk) does not stop the search: the records are dropped from there
    on, and there is no proof.

    Parameters
    ----------
    path : path or None
        Where the proof is streamed to; None keeps the compressed proof in memory.
    beside : bool
        There is a file at ``path`` that must not be lost: a file beside it is written, until `replace`.

    Attributes
    ----------
    failure : str or None
        Why the file could not be written to the end.

    Raises
    ------
    InvalidArgumentError
        The file cannot be written.
    """

    def __init__(self, path: str | Path | None = None, *, beside: bool = False) -> None:
        self._path = None if path is None else Path(path)
        self._beside: Path | None = None
        if beside and self._path is not None:
            self._path = Path(os.path.realpath(self._path))
            self._beside = self._path.with_name(self._path.name + BESIDE)
        self._may_replace = False
        with contextlib.nullcontext() if self._path is None else writing(self._path, "proof_path"):
            place = self._beside or self._path
            self._file: BinaryIO = io.BytesIO() if place is None else place.open("wb")
        self.failure: str | None = None
        self._digest = hashlib.sha256()
        self._checksum = Checksum()
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
        self._flush()
        self._emit(self._checksum.end())
        self._emit(self._digest.digest())
        if self._path is None:
            return Proof(self._file.getvalue())  # type: ignore[attr-defined]
        if self.failure is None:
            self._attempt(self._file.close)
        if self._beside is not None:
            beside, path = self._beside, self._path
            if self._may_replace and self.failure is None:
                self._attempt(lambda: beside.replace(path))
            else:
                beside.unlink(missing_ok=True)
        return Proof(self._path)

    def _flush(self) -> None:
        if self._pending:
            self._append(Part.of(self._pending))
            self._pending.clear()

    def _append(self, part: Part) -> None:
        self._checksum.add(part)
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


def point_header(
    problem: ContactProblem | ContactProblem3D, alpha: Alpha, data: str, units: dict[str, list[int]], **kind: str
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
        "version": 1,
        **kind,
        "problem": problem.fingerprint,
        "alpha": rational_text(Fraction(alpha), "alpha"),
        "p": problem.p,
        "data": data,
        **units,
    }


def unit_exponents(force: NDArray[np.float64], length: NDArray[np.float64]) -> dict[str, list[int]]:
    """Binary exponents of the units of forces and displacements, powers of two."""
    return {name: (np.frexp(units)[1] - 1).tolist() for name, units in (("force", force), ("length", length))}
