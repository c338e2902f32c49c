"""Records of a proof of stability: for every root what was found, and certificates for parts of the body."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.proof.reading import numbers_from, quoted
from enumsol.trusted.running_away import Behaviour, Growing, NoMotion

if TYPE_CHECKING:
    from enumsol.support.array_types import Floats

#: What is found of a root, as records and reports have it.
RUNS_AWAY, DOES_NOT, UNDECIDED = VERDICTS = "runs away", "does not run away", "undecided"
#: Kinds of records: a root, a motion that grows, and a range in which none does.
ROOT, GROWS, NOTHING = "v", "g", "n"


def root_record(point: Floats, verdict: str) -> list[Any]:
    """The record of a root: forces near it, and what was found."""
    return [ROOT, point.tolist(), verdict]


def root_from(record: Any, size: int) -> tuple[Floats, str]:
    """Forces near a root and the verdict; ValueError where a record is none of a root."""
    if not isinstance(record, list) or len(record) != 3 or record[0] != ROOT or record[2] not in VERDICTS:
        raise ValueError(f"{quoted(record)} is not about a root")
    return numbers_from(record[1], size), record[2]


def is_certificate(record: Any) -> bool:
    """True if a record belongs to the root before it."""
    return isinstance(record, list) and bool(record) and record[0] in (GROWS, NOTHING)


def certificate_record(part: int, said: Growing | NoMotion) -> list[Any]:
    """The record of a certificate about a part of the body."""
    if isinstance(said, Growing):
        return [GROWS, part, said.low, said.high, list(said.way.slides)]
    k = len(said.weights)
    high = None if math.isinf(said.high) else said.high
    decided = [int(i) for i in said.slides], [int(i) for i in said.stays]
    return [
        *(NOTHING, part, said.low, high, said.beside, *decided, _entries(said.weights, np.eye(k))),
        *(_entries(N, np.zeros((k, k))) for N in said.products),
    ]


def part_of(record: list[Any], count: int) -> int:
    """The part of the body that a certificate is about; ValueError where there is none such."""
    if len(record) < 2 or type(record[1]) is not int or not 0 <= record[1] < count:
        raise ValueError(f"{quoted(record)} is about no part of the body with a node at its limit")
    return record[1]


def certificate_from(record: list[Any], k: int) -> Growing | NoMotion:
    """The certificate in a record, about k components; ValueError where it makes no sense."""
    if record[0] == GROWS:
        if len(record) != 5:
            raise ValueError(f"{quoted(record)} is not about a motion that grows")
        low, high = numbers_from(record[2:4], 2).tolist()
        return Growing(low, high, Behaviour(_indices(record[4], k)))
    if len(record) != 10:
        raise ValueError(f"{quoted(record)} is not about a range in which nothing grows")
    _, _, low, high, beside, slides, stays, weights, first, last = record
    ends = [None if value is None else float(numbers_from([value], 1)[0]) for value in (high, beside)]
    zero = np.zeros((k, k))
    products = _matrix(first, k, zero), _matrix(last, k, zero)
    return NoMotion(
        float(numbers_from([low], 1)[0]),
        math.inf if ends[0] is None else ends[0],
        ends[1],
        _indices(slides, k),
        _indices(stays, k),
        _matrix(weights, k, np.eye(k)),
        products,
    )


def _entries(matrix: Floats, usual: Floats) -> list[list[Any]] | None:
    """Entries that are not zero; None where the matrix is the usual one."""
    if np.array_equal(matrix, usual):
        return None
    return [[int(i), int(j), float(matrix[i, j])] for i, j in np.argwhere(matrix != 0)]


def _matrix(entries: object, k: int, usual: Floats) -> Floats:
    if entries is None:
        return usual
    if not isinstance(entries, list) or len(entries) > k * k:
        raise ValueError("a matrix is not a list of entries")
    matrix, before = np.zeros((k, k)), -1
    for entry in entries:
        if not isinstance(entry, list) or len(entry) != 3:
            raise ValueError(f"{quoted(entry)} is not an entry of a matrix")
        i, j, value = entry
        if type(i) is not int or type(j) is not int or not (0 <= i < k and 0 <= j < k) or i * k + j <= before:
            raise ValueError(f"the entry {quoted(entry)} is not one of {k} rows and columns, or not in order")
        before = i * k + j
        matrix[i, j] = numbers_from([value], 1)[0]
    return matrix


def _indices(values: object, k: int) -> tuple[int, ...]:
    if not isinstance(values, list) or len(values) > k or not all(type(i) is int and 0 <= i < k for i in values):
        raise ValueError(f"{quoted(values)} are not components, of which there are {k}")
    return tuple(values)
