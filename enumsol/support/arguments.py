"""Arguments of calls: one parser for alpha, one for intervals of it, and checks of counts, numbers and options.

Everything that takes alpha reads it here, in Python and on the command line, so that a value means the same everywhere:

- a real number of any type (int, float, Fraction, Decimal, NumPy scalar, array without dimensions) is the exact number
  that it is: ``numpy.float32(0.1)`` is that float32, an integer above 2^53 is not rounded;
- a text is an integer or a fraction such as ``"8/3"``, taken exactly, or a decimal number, read as float64;
- bool, complex, nan, infinities, and what float64 can only round to zero or to infinity are refused.

Every refusal is one sentence: which argument, what was found, what was expected.
"""

from __future__ import annotations

import difflib
import math
import numbers
import operator
import os
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from reprlib import Repr
from typing import Any, SupportsIndex, TypeVar, cast

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.support.array_types import Alpha, NDArray

#: Most binary digits of a numerator or denominator: four times those of any float64, which bounds the cost.
MAX_BITS = 4096
_DECIMAL = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_FRACTION = re.compile(r"([+-]?\d+)(?:\s*/\s*(\d+))?", re.ASCII)
_EXPECTED = "expected a finite real number such as 2.5 or a fraction such as 8/3"
_RANGE = "expected a finite real number in the range of float64: 0, or 5e-324 to 1.8e308 in size"
_SHOWN = 60

T = TypeVar("T")
N = TypeVar("N", float, "Alpha")


# -- what was found ------------------------------------------------------------------------------------------------


class _Short(Repr):
    """Short texts of values, of huge ones too."""

    def repr_int(self, x: int, level: int) -> str:
        """Digits, or how many binary ones there are: Python refuses to write a very long integer."""
        del level
        return repr(x) if x.bit_length() <= 200 else f"<integer of {x.bit_length()} bits>"

    def repr_Fraction(self, x: Fraction, level: int) -> str:  # noqa: N802 (reprlib looks for the type's name)
        """Text of a fraction, a/b."""
        return f"{self.repr_int(x.numerator, level)}/{self.repr_int(x.denominator, level)}"

    def repr_ndarray(self, x: NDArray[Any], level: int) -> str:
        """Shape and type; the number itself of an array without dimensions."""
        del level
        number = x.ndim == 0 and x.dtype.kind in "biufc"
        return str(x[()]) if number else f"<array of shape {x.shape} and type {x.dtype}>"


_SHORT = _Short()
_SHORT.maxstring = _SHORT.maxother = _SHOWN
_SHORT.maxlist = _SHORT.maxtuple = 4


def shown(value: object) -> str:
    """A value as a short text in one line, for messages."""
    try:
        text = str(value) if isinstance(value, (np.number, np.bool_)) else _SHORT.repr(value)
    except (ValueError, TypeError, OverflowError, RecursionError):  # an integer too long to write, a faulty repr
        text = f"<{type(value).__name__}>"
    text = " ".join(text.split())
    return text if len(text) <= 2 * _SHOWN else text[: 2 * _SHOWN - 3] + "..."


def _refusal(value: object, name: str, expected: str) -> InvalidArgumentError:
    return InvalidArgumentError(f"{name} is {shown(value)}; expected {expected}")


# -- alpha -----------------------------------------------------------------------------------------------------------


def alpha_value(value: object, name: str = "alpha") -> Alpha:
    """The exact value of alpha: a float where it is one, otherwise (and for fractions that were given) a Fraction.

    Parameters
    ----------
    value : AlphaLike
        A real number of any type, or a text (see the module).
    name : str
        What the argument is called in messages.

    Raises
    ------
    InvalidArgumentError
        It is no finite real number, or float64 can only round it to zero or to infinity.
    """
    if type(value) is float and math.isfinite(value):
        return value
    value = _without_array(value)
    number = _from_text(value, name) if isinstance(value, str) else exact_number(value)
    if number is None or (isinstance(number, float) and not math.isfinite(number)):
        raise InvalidArgumentError(f"{name} is {shown(value)}; {_EXPECTED}")
    if isinstance(number, float):
        return number
    if max(number.numerator.bit_length(), number.denominator.bit_length()) > MAX_BITS:
        raise InvalidArgumentError(
            f"{name} is a fraction of more than {MAX_BITS} binary digits; expected a finite real number with fewer"
        )
    if not _in_range(number):
        raise InvalidArgumentError(f"{name} is {shown(value)}; {_RANGE}")
    kept = isinstance(value, Fraction) or (isinstance(value, str) and "/" in value)
    return number if kept or Fraction(float(number)) != number else float(number)


def _in_range(number: Fraction) -> bool:
    """True if float64 neither rounds a fraction to zero nor to infinity."""
    try:
        return number == 0 or float(number) != 0
    except OverflowError:
        return False


def exact_number(value: object) -> float | Fraction | None:
    """The exact value of a real number of any type; None for anything else.

    A float is given for floats, which may be nan or infinite, and a Fraction for everything else. A Decimal whose
    exact value would take for ever is replaced by a number that is refused for the same reason.
    """
    value = _without_array(value)
    if isinstance(value, (bool, np.bool_)):
        return None
    if isinstance(value, float):  # numpy.float64 too
        return float(value)
    if isinstance(value, np.floating):
        return Fraction(*map(int, value.as_integer_ratio())) if np.isfinite(value) else float(value)
    if isinstance(value, Decimal):
        return _from_decimal(value)
    if isinstance(value, numbers.Rational):  # int, Fraction, numpy integers and those of other packages
        return Fraction(int(value.numerator), int(value.denominator))
    return None


def _without_array(value: object) -> Any:
    """The content of an array without dimensions; anything else unchanged (a masked value too)."""
    if isinstance(value, np.ndarray) and value.ndim == 0 and not np.ma.is_masked(value):
        return np.asarray(value)[()]
    return value


def _from_decimal(value: Decimal) -> float | Fraction:
    if not value.is_finite():
        return math.nan if value.is_nan() else math.copysign(math.inf, value)
    if value and abs(value.adjusted()) > 400:
        return (-1 if value < 0 else 1) * Fraction(2) ** (1100 if value.adjusted() > 0 else -1100)
    if len(value.as_tuple().digits) > MAX_BITS:
        return Fraction(1, 2**MAX_BITS)
    return Fraction(value)


def _from_text(text: str, name: str) -> float | Fraction | None:
    stripped = text.strip() if len(text) <= 2600 else ""  # enough for every fraction within MAX_BITS
    fraction = _FRACTION.fullmatch(stripped)
    if fraction is not None:
        denominator = int(fraction[2] or 1)
        return Fraction(int(fraction[1]), denominator) if denominator else None
    if _DECIMAL.fullmatch(stripped) is None:
        return None
    number = float(stripped)
    mantissa = re.split("[eE]", stripped)[0]
    if math.isinf(number) or (number == 0 and re.search("[1-9]", mantissa)):
        raise InvalidArgumentError(f"{name} is {shown(text)}; {_RANGE}")
    return number


def text_of(value: object, name: str) -> str:
    """A text.

    Raises
    ------
    InvalidArgumentError
        It is something else.
    """
    if not isinstance(value, str):
        raise InvalidArgumentError(f"{name} is {shown(value)}; expected a text in quotes")
    return value


def alpha_list(values: object, name: str = "alphas") -> list[Alpha]:
    """The exact values of several alphas, in their order.

    Raises
    ------
    InvalidArgumentError
        It is one number or a text instead of several, or one of them is no alpha.
    """
    try:
        several = None if isinstance(values, (str, bytes, bytearray)) else iter(cast("Iterable[object]", values))
    except TypeError:
        several = None
    if several is None:
        raise InvalidArgumentError(f"{name} is {shown(values)}; expected several numbers, such as [1.0, 2.5]")
    return [alpha_value(value, f"{name}[{k}]") for k, value in enumerate(several)]


def even_alphas(ends: object, samples: object, name: str = "alphas") -> list[Alpha]:
    """Evenly spaced alphas, both ends included: exact ones between fractions, else the floats nearest to the decimals.

    Between -1 and 0.2 the sixth of seven is 0, and not what is left of -1 + 5 * 0.2 in floats.

    Raises
    ------
    InvalidArgumentError
        The ends are no pair of alphas in increasing order, or there are fewer than two samples.
    """
    low, high = alpha_interval(ends, name)
    last = positive_integer(samples, "samples", least=2) - 1
    start, end = (Fraction(repr(value)) if isinstance(value, float) else value for value in (low, high))
    inside = [start + (end - start) * k / last for k in range(1, last)]
    rounded = isinstance(low, float) and isinstance(high, float)
    return [low, *(map(float, inside) if rounded else inside), high]


def alpha_interval(value: object, name: str = "interval") -> tuple[Alpha, Alpha]:
    """Both ends of an interval of alpha, exactly.

    Raises
    ------
    InvalidArgumentError
        It is no pair of alphas of which the first is below the second.
    """
    low, high = (alpha_value(end, f"{name}[{k}]") for k, end in enumerate(_pair(value, name)))
    return _in_order(low, high, value, name)


def unbounded_interval(value: object, name: str = "interval") -> tuple[float, float]:
    """Both ends of an interval that may reach to infinity, as floats.

    Raises
    ------
    InvalidArgumentError
        As for alpha_interval.
    """
    ends = []
    for k, end in enumerate(_pair(value, name)):
        number = exact_number(end)
        infinite = isinstance(number, float) and math.isinf(number)
        ends.append(float(end) if infinite else float(alpha_value(end, f"{name}[{k}]")))
    return _in_order(ends[0], ends[1], value, name)


def _in_order(low: N, high: N, value: object, name: str) -> tuple[N, N]:
    if not low < high:
        raise _refusal(value, name, "its first alpha below its last")
    return low, high


def _pair(value: object, name: str) -> list[Any]:
    given = cast("Collection[Any]", value)
    unordered = isinstance(value, (str, bytes, bytearray, set, frozenset, dict))
    try:
        ends = [] if unordered or len(given) != 2 else list(given)
    except TypeError:
        ends = []
    if len(ends) != 2:
        raise _refusal(value, name, "a pair of numbers (first alpha, last alpha)")
    return ends


# -- counts and numbers ----------------------------------------------------------------------------------------------
# Each gives the value in a plain type and raises InvalidArgumentError for anything else.


def positive_integer(value: object, name: str, least: int = 1, most: int | None = None) -> int:
    """Value as an int of at least ``least`` and, where that is given, at most ``most``."""
    number = _whole(value, name, lambda k: k >= least, f"an integer of at least {least}")
    if most is not None and number > most:
        raise _refusal(value, name, f"an integer of at most {most}")
    return number


def optional_count(value: object, name: str) -> int | None:
    """Value as a positive int, or None for no limit."""
    return None if value is None else _whole(value, name, lambda k: k >= 1, "a positive integer or None")


def row_number(value: object, name: str, count: int, expected: str = "") -> int:
    """Value as an int in 0 .. count - 1; ``expected`` says in messages what it counts."""
    return _whole(value, name, lambda k: 0 <= k < count, expected or f"a row number below {count}")


def optional_seconds(value: object, name: str = "time_limit") -> float | None:
    """Value as a positive number of seconds, or None for no limit."""
    return None if value is None else _real(value, name, lambda x: x > 0, "a positive number of seconds or None")


def share(value: object, name: str = "tolerance") -> float:
    """Value as a float of at least zero and below one."""
    return _real(value, name, lambda x: 0 <= x < 1, "a number in [0, 1)")


def finite_number(value: object, name: str) -> float:
    """Value as a finite float, which it is exactly."""
    number = _real(value, name, math.isfinite, "a finite number")
    if number != exact_number(value):
        raise InvalidArgumentError(f"{name} is {shown(value)}, which float64 would round; expected a finite number")
    return number


def direction_value(value: object) -> int:
    """Value as +1 or -1."""
    number = exact_number(value)
    if number not in (1, -1):
        raise InvalidArgumentError(f"direction is {shown(value)}; expected +1 or -1")
    return 1 if number == 1 else -1


def positive_number(value: object, name: str) -> float:
    """Value as a finite float above zero, rounded if need be."""
    return _real(value, name, lambda x: 0 < x < math.inf, "a finite number > 0")


def nonnegative_number(value: object, name: str) -> float:
    """Value as a finite float of at least zero, rounded if need be."""
    return _real(value, name, lambda x: 0 <= x < math.inf, "a finite number >= 0")


def _real(value: object, name: str, admissible: Callable[[float], bool], expected: str) -> float:
    number = real_or_nan(value)
    if not admissible(number):
        raise _refusal(value, name, expected)
    return number


def _whole(value: object, name: str, admissible: Callable[[int], bool], expected: str) -> int:
    try:
        number = None if isinstance(value, (bool, np.bool_)) else operator.index(cast("SupportsIndex", value))
    except TypeError:
        number = None
    if number is None or not admissible(number):
        raise _refusal(value, name, expected)
    return number


def real_or_nan(value: object) -> float:
    """A real number of any type as a float, rounded if necessary; nan for anything else."""
    number = exact_number(value)
    try:
        return math.nan if number is None else float(number)
    except OverflowError:
        return math.inf if number is not None and number > 0 else -math.inf


# -- options, objects and files --------------------------------------------------------------------------------------


def one_of(value: object, name: str, known: Collection[str | None]) -> Any:
    """Value, if it is one of the known texts (or None, if that is among them)."""
    if not (value is None or isinstance(value, str)) or value not in known:
        raise _refusal(value, name, f"one of {', '.join(map(repr, known))}")
    return value


def entry_named(name: object, entries: Mapping[str, T], where: str, example: str) -> T:
    """The entry of that name; a refusal names similar ones, or all."""
    if not isinstance(name, str):
        raise InvalidArgumentError(f"name is {shown(name)}; expected a name of {where}, such as {example}")
    if name in entries:
        return entries[name]
    close = close_names(name, entries)
    some = list(entries)[:40]
    more = f" and {len(entries) - len(some)} more" if len(entries) > len(some) else ""
    known = f"did you mean {', '.join(close)}?" if close else f"expected one of {', '.join(some)}{more}"
    raise InvalidArgumentError(f"{where} has no problem named {shown(name)}; {known}")


def close_names(name: str, entries: Collection[str]) -> list[str]:
    """Up to five names of entries similar to this one, the most similar first; only itself if it is one of them."""
    if name.lower() in entries:
        return [name.lower()]
    return difflib.get_close_matches(name.lower(), entries, n=5, cutoff=0.5)


def instance_of(value: object, kind: type[T], name: str) -> T:
    """Value, which is of a type; another one may say in ``taken_by`` what takes it."""
    if not isinstance(value, kind):
        article = "an" if kind.__name__[0] in "AEIOU" else "a"
        hint = getattr(type(value), "taken_by", "")
        raise InvalidArgumentError(f"{name} is a {type(value).__name__}; expected {article} {kind.__name__}{hint}")
    return value


def optional_callable(value: object, name: str) -> Any:
    """Value, which can be called, or None."""
    if value is not None and not callable(value):
        raise _refusal(value, name, "a function or None")
    return value


def optional_executor(value: object, jobs: object = None) -> None:
    """Refuse what is not like a concurrent.futures.Executor nor None, a number of jobs that is none, and both."""
    if value is not None and not callable(getattr(value, "submit", None)):
        raise _refusal(value, "executor", "a concurrent.futures.Executor or None")
    if jobs is not None:
        positive_integer(jobs, "jobs")
        if value is not None:
            raise InvalidArgumentError("executor and jobs are both given; expected one of them, or neither")


def file_path(value: object, name: str, expected: str = "the name of a file") -> Path:
    """Value as a path."""
    try:
        text = os.fspath(cast("str", value))
    except TypeError:
        text = None
    if not isinstance(text, str):
        raise InvalidArgumentError(f"{name} is a {type(value).__name__}; expected {expected}")
    if not text:
        raise InvalidArgumentError(f"{name} is an empty text; expected {expected}")
    try:
        unusable = b"\0" in os.fsencode(text)
    except UnicodeEncodeError:
        unusable = True
    if unusable:
        raise InvalidArgumentError(f"{name} is {shown(text)}, with a character that no name has; expected {expected}")
    return Path(text)
