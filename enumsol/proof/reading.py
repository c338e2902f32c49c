"""The parts of a proof's records, read strictly: for both checkers, which trust nothing that stands in a file.

Every function returns a value of the stated kind and size, bounded and finite, or raises ValueError. Numbers of a
record are finite and whole numbers have at most 18 digits before they come here (``Proof.records``).
"""

from __future__ import annotations

import base64
import re
import reprlib
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.condensation.data import Data, exactly_at
from enumsol.errors import InvalidArgumentError
from enumsol.proof.proof_file import PLANE_ROW, PROOF_VERSION, SPACE_ROW
from enumsol.trusted.exclusion import Terms
from enumsol.trusted.status_rows import BACKWARD, CONTACT, FORWARD, UNDECIDED, final_codes

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import Codes, Floats

    #: A row in 3D: its kind, its node, and the number of a direction or sector.
    Row = tuple[int, int, int]

#: Most digits of the numerator and of the denominator of a fraction.
MOST_DIGITS = 4000

_SLIDING = FORWARD, BACKWARD
#: Codes that are not final.
_PARTIAL = CONTACT, UNDECIDED, *_SLIDING

_RATIONAL = re.compile(rf"-?[0-9]{{1,{MOST_DIGITS}}}(/[0-9]{{1,{MOST_DIGITS}}})?", re.ASCII)
_BEYOND: int = 10**MOST_DIGITS
_SHORT = reprlib.Repr()
_SHORT.maxlevel = 3
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 40
_SHORT.maxlist = _SHORT.maxdict = 5


class RecordError(ValueError):
    """A record makes no sense; what it says is a whole sentence about it."""


class RefusedError(Exception):
    """A proof cannot be followed any further; it never leaves the checkers."""


def check_header(header: Any, problem: AnyProblem, kind: str | None, names: Collection[str] | None = None) -> None:
    """Refuse a header that does not fit the problem and the kind of proof.

    ``names`` are those that it has beside the usual ones, no others; None where others have no meaning.

    Raises
    ------
    RefusedError
        It does not fit.
    """
    known = isinstance(header, dict) and header.get("format") == "enumsol-proof"
    if not known or not same(header.get("version"), PROOF_VERSION):
        raise RefusedError(f"the first record is not the header of an enumsol-proof of version {PROOF_VERSION}")
    if header.get("problem") != problem.fingerprint:
        raise RefusedError("the proof belongs to another problem (its fingerprint is different)")
    if ("kind" in header) != (kind is not None) or header.get("kind") != kind:
        raise RefusedError(f"the header names an unknown kind of proof, {quoted(header.get('kind'))}")
    usual = {"format", "version", "kind", "problem", "p"}
    if not same(header.get("p"), problem.p) or (names is not None and header.keys() != usual | {*names}):
        raise RefusedError("the header does not fit the problem")


def data_of(header: Any, problem: AnyProblem, kind: str | None) -> Data:
    """Data that a header claims to certify, "problem" or "condensed", once it fits the problem and the kind of proof.

    Raises
    ------
    RefusedError
        It does not.
    """
    check_header(header, problem, kind)
    if header.get("data") not in ("problem", "condensed"):
        raise RefusedError("the header does not fit the problem")
    if problem.held:
        return "problem" if header["data"] == "problem" else "condensed"
    if header["data"] != "problem":
        raise RefusedError("a proof about S and g as computed, of a body that nothing holds")
    found, reach = header.get("max_rigid_displacement"), problem.rigid_reach
    if not same(found, reach):
        raise RefusedError(f"its bound of the rigid displacement is {quoted(found)}; the problem's is {reach:g}")
    return "problem"


def same(found: object, expected: object) -> bool:
    """True if a value of a proof is the one expected, of the same type throughout: neither ``true`` nor 1.0 is 1."""
    if isinstance(expected, dict) and isinstance(found, dict):
        return found.keys() == expected.keys() and all(same(found[key], value) for key, value in expected.items())
    if isinstance(expected, list) and isinstance(found, list):
        return len(found) == len(expected) and all(map(same, found, expected))
    return type(found) is type(expected) and bool(found == expected)


def names_only(record: dict[str, Any], names: Collection[str]) -> None:
    """Raise ValueError unless an object has exactly these names."""
    if record.keys() != set(names):
        raise ValueError(f"the names {quoted(sorted(record))} are not {', '.join(names)}")


def rational_text(value: Fraction, name: str) -> str:
    """An alpha as text that ``rational_from`` reads.

    Raises
    ------
    InvalidArgumentError
        Its numerator or denominator has more than MOST_DIGITS digits; ``name`` says which number it is.
    """
    if not fits(value):
        raise InvalidArgumentError(f"{name} is a fraction of more than {MOST_DIGITS} digits; expected a shorter one")
    return str(value)


def fits(value: Fraction) -> bool:
    """True if a proof can hold this fraction."""
    return max(abs(value.numerator), value.denominator) < _BEYOND


def rational_from(text: object) -> Fraction:
    """An alpha from its text: digits, or digits / digits, with a sign before them.

    The one way in which a fraction of a proof becomes a number. Numerator and denominator have at most MOST_DIGITS
    digits each, there is no exponent, and the value is within the range of float64.
    """
    if not isinstance(text, str) or _RATIONAL.fullmatch(text) is None:
        raise ValueError(f"{quoted(text)} is not a fraction of at most {MOST_DIGITS} digits")
    numerator, _, denominator = text.partition("/")
    if denominator and not int(denominator):
        raise ValueError("a fraction's denominator is zero")
    value = Fraction(int(numerator), int(denominator or 1))
    try:
        float(value)
    except OverflowError:
        raise ValueError("a fraction is beyond the range of float64") from None
    return value


def units_from(header: dict[str, Any], p: int, *, by_node: bool = False) -> tuple[Floats, Floats]:
    """Units of forces and displacements, powers of two, whose binary exponents a record gives.

    In 2D (2p,), those of both directions of a node being the same; ``by_node``, in 3D, (p,).
    """
    force, length = (exponents_from(header.get(key), p if by_node else 2 * p) for key in ("force", "length"))
    if len({a + b for a, b in zip(force, length, strict=True)}) != 1 or force[:p] != force[-p:]:
        directions = "" if by_node else " and of the two directions of a node"
        raise ValueError(f"the units are no common scaling of energy{directions}")
    return np.ldexp(1.0, np.array(force)), np.ldexp(1.0, np.array(length))


def exponents_from(value: object, size: int) -> list[int]:
    """``size`` binary exponents of units."""
    if not (isinstance(value, list) and len(value) == size and all(type(x) is int and -900 <= x <= 900 for x in value)):
        raise ValueError(f"the units are not {size} binary exponents")
    return value


def bytes_from(text: str) -> bytes:
    """Bytes that a text in base64 stands for, if it is the one text that stands for them."""
    data = base64.b64decode(text, validate=True)
    if base64.b64encode(data).decode() != text:
        raise ValueError("a text in base64 has bits to spare that are not zero")
    return data


def multipliers_from(texts: list[Any], most: int | None, ends: int = 1) -> Terms:
    """Rows and their multipliers, from base64.

    ``most``: the number of rows, of which there are no more in a record; in 2D. None: rows in 3D, as a list of kind,
    node and number, and at so many ``ends`` of a piece of alpha as many multipliers each, one end after the other.
    """
    if len(texts) != 2 or not all(isinstance(text, str) for text in texts):
        raise ValueError("its multipliers are not two texts")
    row: Any = np.frombuffer(bytes_from(texts[0]), SPACE_ROW if most is None else PLANE_ROW)
    value = np.frombuffer(bytes_from(texts[1]), dtype="<f8").astype(np.float64)
    if ends * len(row) != len(value):
        raise ValueError(f"{len(row)} rows and {len(value)} multipliers")
    if not np.all(np.isfinite(value)):
        raise ValueError("a multiplier is not finite")
    if most is None:
        return Terms(row.tolist(), value if ends == 1 else value.reshape(ends, -1))
    if len(row) > most:
        raise ValueError(f"it has {len(row)} multipliers, and there are {most} rows")
    if np.any(row >= most):
        raise ValueError(f"row {np.max(row)} does not exist; there are {most}")
    return Terms(row.astype(np.intp), value)


def numbers_from(values: object, size: int) -> Floats:
    """``size`` finite numbers."""
    if not isinstance(values, list) or len(values) != size or not all(type(x) in (int, float) for x in values):
        raise ValueError(f"expected {size} numbers")
    numbers = np.array(values, dtype=np.float64)
    if not np.all(np.isfinite(numbers)):
        raise ValueError("a number is not finite")
    return numbers


def check_complete(codes: Codes) -> None:
    """Raise RecordError where an assignment is not complete."""
    if any(code in _PARTIAL for code in codes):
        raise RecordError("a root or a solved selection is claimed where statuses are still open")


def is_code_of_leaf(code: object) -> bool:
    """True for a status in 3D that is not undecided, or that of a sector."""
    from enumsol.model.sectors import SECTORS, is_sector  # in 3D only

    return type(code) is int and (0 <= code < UNDECIDED or (code > SECTORS and is_sector(code - SECTORS)))


def checked_row(row: object, p: int) -> Row:
    """A row in 3D; ValueError where there is none such."""
    from enumsol.model.sectors import DEEPEST, RUN  # in 3D only
    from enumsol.trusted.space.sector_rows import FORCE, GAP, RIGHT

    if not isinstance(row, list | tuple) or len(row) != 3 or not all(type(x) is int for x in row):
        raise ValueError(f"{quoted(row)} is not a row")
    kind, node, number = row
    # numbers of directions and sectors are less; directions of tangents are less than RUN
    known = 0 <= kind <= RIGHT and 0 <= node < p and -1 <= number < RUN << DEEPEST
    if not known or (kind in (GAP, FORCE) and number):
        raise ValueError(f"row {quoted(list(row))} does not exist")
    return kind, node, number


def selection_from(value: object, friction: Sequence[bool], sliding: Iterable[int] = ()) -> Codes:
    """Final codes; FORWARD and BACKWARD are allowed as well at the given nodes."""
    if not isinstance(value, list) or len(value) != len(friction) or not all(type(code) is int for code in value):
        raise ValueError(f"its selection is not a list of {len(friction)} codes")
    for i, (code, positive) in enumerate(zip(value, friction, strict=True)):
        if code in final_codes(positive) or (positive and code in _SLIDING and i in sliding):
            continue
        raise ValueError("a node cannot have the code that its selection gives it")
    return tuple(value)


def nodes_from(value: object, p: int) -> Codes:
    """Ascending nodes."""
    if not isinstance(value, list) or not all(type(i) is int and 0 <= i < p for i in value):
        raise ValueError("its free nodes are not a list of nodes")
    if sorted(set(value)) != value:
        raise ValueError("its free nodes are not ascending")
    return tuple(value)


def weights_from(value: object, free: Codes, codes: Codes, friction: Sequence[bool]) -> Floats:
    """The numbers of the form: one for every free or sliding node, and four more where a free node has friction."""
    sliding = sum(code in _SLIDING for code in codes)
    return numbers_from(value, len(free) + sliding + 4 * sum(friction[i] for i in free))


def friction_at(problem: AnyProblem, alpha: Fraction) -> list[Fraction]:
    """The friction coefficients at an alpha, exactly; ValueError where one is negative."""
    exact = exactly_at(alpha, *problem.affine_friction)
    if min(exact) < 0:
        raise ValueError(f"friction is negative at alpha = {shown_alpha(alpha)}")
    return exact


def quoted(value: object) -> str:
    """Any value from a proof as a short text."""
    return _SHORT.repr(value)


def shown_alpha(alpha: Fraction) -> str:
    """A short text: the float where it is the same number, or else the fraction or its beginning."""
    exact = abs(alpha) < 10**300 and Fraction(float(alpha)) == alpha
    return str(float(alpha)) if exact else str(alpha)[:40]
