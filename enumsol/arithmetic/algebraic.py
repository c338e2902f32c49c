"""Real algebraic numbers: roots of integer polynomials, isolated and compared exactly (theory, section 7.2).

A critical alpha is either a rational number or the only root of a polynomial in an open interval with rational ends.
Signs of other polynomials there are decided without rounding: a common root is found by the greatest common divisor,
and a polynomial that does not vanish has constant sign once the interval is narrow enough. Arithmetic with an
irrational alpha is that of the real number field Q(alpha) (theory, section 7.4).
"""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from functools import cmp_to_key
from typing import TYPE_CHECKING, Any

from flint import fmpq, fmpq_poly, fmpz, fmpz_poly

from enumsol.arithmetic.rationals import to_fraction

#: Width to which an isolating interval is narrowed before the greatest common divisor decides about a common root.
_NARROW = fmpq(1, 2**64)
#: Steps of bisection between two attempts to separate numbers.
_STEPS = 16


def sign(value: Number) -> int:
    """-1, 0 or 1."""
    return int(value > 0) - int(value < 0)


def integer_polynomial(poly: fmpq_poly | fmpz_poly) -> fmpz_poly:
    """The primitive integer polynomial that is a positive multiple of a rational or integer polynomial."""
    numerator = poly.numer() if isinstance(poly, fmpq_poly) else poly
    content = numerator.content()
    return numerator if content in (0, 1) else fmpz_poly([c // content for c in numerator.coeffs()])


def variations(poly: fmpz_poly, lo: fmpq, hi: fmpq) -> int:
    """Sign variations of ``poly`` over (lo, hi): no fewer than its roots there, and of equal parity."""
    moved = poly(fmpq_poly([lo, hi - lo])).numer()
    degree = poly.degree()
    coefficients = moved.coeffs()
    coefficients += [fmpz(0)] * (degree + 1 - len(coefficients))
    count = last = 0
    for c in fmpz_poly(coefficients[::-1])(fmpz_poly([1, 1])).coeffs():
        if c != 0:
            s = 1 if c > 0 else -1
            count += int(s == -last)
            last = s
    return count


class CriticalAlpha:
    """A real algebraic number.

    Attributes
    ----------
    poly : fmpz_poly or None
        Vanishes at the number, with a sign change; None when the number is known to be rational.
    lo, hi : fmpq
        The number is the only root of ``poly`` in the open interval (lo, hi); lo = hi when it is rational. The interval
        only ever shrinks.
    """

    __slots__ = ("_sign_hi", "hi", "lo", "poly")

    def __init__(self, poly: fmpz_poly | None, lo: fmpq, hi: fmpq) -> None:
        self.poly: Any = poly
        self.lo, self.hi = lo, hi
        self._sign_hi = 0 if poly is None else sign(poly(hi))
        if poly is not None and poly.degree() == 1:
            self._settle(fmpq(-poly[0], poly[1]))

    @classmethod
    def rational(cls, value: fmpq) -> CriticalAlpha:
        """A rational number."""
        return cls(None, value, value)

    def _settle(self, value: fmpq) -> None:
        self.poly, self.lo, self.hi = None, value, value

    @property
    def is_rational(self) -> bool:
        """True if the number is known to be rational."""
        return self.poly is None

    def __float__(self) -> float:
        while self.poly is not None and float(to_fraction(self.lo)) != float(to_fraction(self.hi)):
            if (self.hi - self.lo) * 2**1100 < 1:  # an interval around zero or around a tie of two floats
                break
            self.refine(_STEPS)
        return float(to_fraction((self.lo + self.hi) / 2))

    def __repr__(self) -> str:
        return f"CriticalAlpha({float(self)!r})"

    def enclosure(self) -> tuple[Fraction, Fraction]:
        """Rational bounds, equal when the number is rational; narrower than a unit in the last place of its float."""
        float(self)
        return to_fraction(self.lo), to_fraction(self.hi)

    def refine(self, steps: int = _STEPS) -> None:
        """Halve the isolating interval a number of times."""
        for _ in range(steps):
            if self.poly is None:
                return
            middle = (self.lo + self.hi) / 2
            s = sign(self.poly(middle))
            if s == 0:
                self._settle(middle)
            elif s == self._sign_hi:
                self.hi = middle
            else:
                self.lo = middle

    def narrow(self, width: fmpq = _NARROW) -> None:
        """Refine until the isolating interval is no wider than ``width``."""
        while self.hi - self.lo > width:
            self.refine()

    def _shares_root(self, other: fmpz_poly) -> bool:
        """True if ``other``, a polynomial, vanishes here; then the representation is simplified."""
        common = self.poly.gcd(other)
        # lo and hi are no roots of poly, hence none of the divisor, which has at most one root between them
        if common.degree() == 0 or sign(common(self.lo)) == sign(common(self.hi)):
            return False
        if common.degree() < self.poly.degree():
            self.poly = common
            self._sign_hi = sign(common(self.hi))
            if common.degree() == 1:
                self._settle(fmpq(-common[0], common[1]))
        return True

    def sign_of(self, poly: fmpz_poly) -> int:
        """Exact sign of an integer polynomial at this number."""
        if poly.degree() <= 0:
            return sign(poly[0])
        if self.poly is None:
            return sign(poly(self.lo))
        self.narrow()
        checked = False
        while self.poly is not None and variations(poly, self.lo, self.hi) > 0:
            if not checked and self._shares_root(poly):
                return 0
            checked = True
            self.refine()
        return sign(poly((self.lo + self.hi) / 2))

    def compare(self, other: CriticalAlpha) -> int:
        """-1, 0 or 1 as this number is less than, equal to or greater than ``other``."""
        if self is other:
            return 0
        if isinstance(other, EnclosedAlpha):
            return -other.compare(self)
        checked = False
        while True:
            if self.poly is None and other.poly is None:
                return sign(self.lo - other.lo)
            if self.hi <= other.lo:
                return -1
            if other.hi <= self.lo:
                return 1
            if self.poly is None or other.poly is None:
                point, root = (self, other) if self.poly is None else (other, self)
                if root.poly(point.lo) == 0:
                    root._settle(point.lo)
                    return 0
            elif not checked and max(self.hi - self.lo, other.hi - other.lo) <= _NARROW:
                checked = True
                if self._equals_irrational(other):
                    return 0
            self.refine()
            other.refine()

    def _equals_irrational(self, other: CriticalAlpha) -> bool:
        common = self.poly.gcd(other.poly)
        lo, hi = max(self.lo, other.lo), min(self.hi, other.hi)
        if common.degree() == 0 or sign(common(lo)) == sign(common(hi)):
            return False
        for number in (self, other):
            number.poly, number.lo, number.hi, number._sign_hi = common, lo, hi, sign(common(hi))
            if common.degree() == 1:
                number._settle(fmpq(-common[0], common[1]))
        return True

    def minimal_polynomial(self) -> fmpz_poly:
        """The irreducible integer polynomial of the number; a number found to be rational is settled as such."""
        if self.poly is None:
            return fmpz_poly([-self.lo.p, self.lo.q])
        factor: fmpz_poly
        for factor, _ in self.poly.factor()[1]:
            if sign(factor(self.lo)) != sign(factor(self.hi)):
                self.poly, self._sign_hi = factor, sign(factor(self.hi))
                if factor.degree() == 1:
                    self._settle(fmpq(-factor[0], factor[1]))
                return factor
        raise AssertionError("an isolated root belongs to no factor")


class EnclosedAlpha(CriticalAlpha):
    """A real number of which bounds are known and nothing else; exact where they are equal.

    Parameters
    ----------
    lo, hi : fmpq
    """

    __slots__ = ()

    def __init__(self, lo: fmpq, hi: fmpq) -> None:
        super().__init__(None, lo, hi)

    @property
    def is_rational(self) -> bool:
        """True if the number is known exactly."""
        return bool(self.lo == self.hi)

    def compare(self, other: CriticalAlpha) -> int:
        """-1 or 1 where the bounds tell the numbers apart; 0 where they are equal or may be."""
        while not isinstance(other, EnclosedAlpha) and other.lo < self.hi and self.lo < other.hi:
            if other.poly is None or other.hi - other.lo < (self.hi - self.lo) / 4:
                break
            other.refine()
        if self.hi < other.lo:
            return -1
        return int(other.hi < self.lo)


def real_roots(poly: fmpz_poly, a: fmpq, b: fmpq) -> list[CriticalAlpha]:
    """The distinct roots of a nonzero integer polynomial in the closed interval [a, b], in no particular order."""
    found: list[CriticalAlpha] = []

    def take_out(q: fmpz_poly, value: fmpq) -> fmpz_poly:
        linear = fmpz_poly([-value.p, value.q])
        found.append(CriticalAlpha.rational(value))
        while q(value) == 0:
            q = integer_polynomial(q // linear)
        return q

    for end in (a, b) if a != b else (a,):
        if poly(end) == 0:
            poly = take_out(poly, end)
    if poly.degree() < 1 or a == b:
        return found
    count = variations(poly, a, b)
    if count >= 2:
        poly = integer_polynomial(poly // poly.gcd(poly.derivative()))
    waiting = [(a, b, poly)] if count else []
    while waiting:
        lo, hi, q = waiting.pop()
        count = variations(q, lo, hi)
        if count == 1:
            found.append(CriticalAlpha(q, lo, hi))
        elif count > 1:
            middle = (lo + hi) / 2
            if q(middle) == 0:
                q = take_out(q, middle)
            waiting += [(lo, middle, q), (middle, hi, q)]
    return found


def merge(numbers: Iterable[CriticalAlpha]) -> list[list[CriticalAlpha]]:
    """The numbers in increasing order, equal ones grouped."""
    groups: list[list[CriticalAlpha]] = []
    for number in sorted(numbers, key=cmp_to_key(CriticalAlpha.compare)):
        if groups and groups[-1][0].compare(number) == 0:
            groups[-1].append(number)
        else:
            groups.append([number])
    return groups


def rational_between(a: CriticalAlpha, b: CriticalAlpha) -> fmpq:
    """A rational number of few digits strictly between two different numbers a < b."""
    while not (
        a.hi < b.lo or (a.hi == b.lo and not (a.is_rational and b.is_rational) and a.hi != a.lo and b.hi != b.lo)
    ):
        a.refine()
        b.refine()
    if a.hi == b.lo:
        return a.hi
    width = b.lo - a.hi
    step = fmpq(1)
    while step >= width / 2:
        step /= 2
    while step * 8 < width:
        step *= 2
    return (a.hi / step).floor() * step + step


class NumberFieldElement:
    """An element of Q(alpha): a polynomial in alpha modulo its minimal polynomial, ordered as a real number.

    Parameters
    ----------
    poly : fmpq_poly
    alpha : CriticalAlpha, irrational
    modulus : fmpq_poly
        Its minimal polynomial.
    """

    __slots__ = ("alpha", "modulus", "poly")
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, poly: fmpq_poly, alpha: CriticalAlpha, modulus: fmpq_poly) -> None:
        self.poly, self.alpha, self.modulus = poly, alpha, modulus

    def _of(self, value: Number) -> fmpq_poly:
        return value.poly if isinstance(value, NumberFieldElement) else fmpq_poly([value])

    def _new(self, poly: fmpq_poly) -> NumberFieldElement:
        return NumberFieldElement(poly, self.alpha, self.modulus)

    def _inverse(self, poly: fmpq_poly) -> fmpq_poly:
        """The inverse of a polynomial; ZeroDivisionError where it is zero."""
        if poly.is_zero():
            raise ZeroDivisionError("division by zero in a number field")
        common, s, _ = poly.xgcd(self.modulus)
        return s / common[0] % self.modulus

    def __add__(self, other: Number) -> NumberFieldElement:
        return self._new(self.poly + self._of(other))

    def __sub__(self, other: Number) -> NumberFieldElement:
        return self._new(self.poly - self._of(other))

    def __rsub__(self, other: Number) -> NumberFieldElement:
        return self._new(self._of(other) - self.poly)

    def __mul__(self, other: Number) -> NumberFieldElement:
        return self._new(self.poly * self._of(other) % self.modulus)

    def __truediv__(self, other: Number) -> NumberFieldElement:
        return self._new(self.poly * self._inverse(self._of(other)) % self.modulus)

    def __rtruediv__(self, other: Number) -> NumberFieldElement:
        return self._new(self._of(other) * self._inverse(self.poly) % self.modulus)

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self) -> NumberFieldElement:
        return self._new(-self.poly)

    def sign(self) -> int:
        """Sign of the real number."""
        return 0 if self.poly.is_zero() else self.alpha.sign_of(integer_polynomial(self.poly))

    def _minus(self, other: Number) -> NumberFieldElement:
        return self._new(self.poly - self._of(other))

    def __bool__(self) -> bool:
        return not self.poly.is_zero()

    def __eq__(self, other: Number) -> bool:  # type: ignore[override]
        return bool(self._minus(other).poly.is_zero())

    def __lt__(self, other: Number) -> bool:
        return self._minus(other).sign() < 0

    def __le__(self, other: Number) -> bool:
        return self._minus(other).sign() <= 0

    def __gt__(self, other: Number) -> bool:
        return self._minus(other).sign() > 0

    def __ge__(self, other: Number) -> bool:
        return self._minus(other).sign() >= 0

    def __float__(self) -> float:
        # a narrow interval bounds the error; the value is rounded once
        self.alpha.narrow(fmpq(1, 2**400))
        return float(to_fraction(self.poly((self.alpha.lo + self.alpha.hi) / 2)))


def exact_value(alpha: CriticalAlpha) -> Any:
    """The number as an element of an exact ordered field: an fmpq, or a NumberFieldElement when it is irrational."""
    if not alpha.is_rational:
        modulus = fmpq_poly(alpha.minimal_polynomial())
        if not alpha.is_rational:
            return NumberFieldElement(fmpq_poly([0, 1]) % modulus, alpha, modulus)
    return alpha.lo


if TYPE_CHECKING:
    #: Elements of exact ordered fields, and integers.
    Number = NumberFieldElement | fmpq | fmpz | int
