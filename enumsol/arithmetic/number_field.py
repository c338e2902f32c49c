"""Exact arithmetic at an irrational critical alpha: the real number field Q(alpha) (theory, section 7.4)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flint import fmpq, fmpq_poly

from enumsol.arithmetic.algebraic import integer_polynomial
from enumsol.arithmetic.rationals import to_fraction

if TYPE_CHECKING:
    from enumsol.arithmetic.algebraic import CriticalAlpha


class NumberFieldElement:
    """An element of Q(alpha): a polynomial in alpha modulo its minimal polynomial, ordered as a real number.

    Parameters
    ----------
    poly : fmpq_poly
    field : NumberField
    """

    __slots__ = ("field", "poly")
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, poly: Any, field: NumberField) -> None:
        self.poly, self.field = poly, field

    def _of(self, value: Any) -> Any:
        return value.poly if isinstance(value, NumberFieldElement) else fmpq_poly([value])

    def _new(self, poly: Any) -> NumberFieldElement:
        return NumberFieldElement(poly, self.field)

    def __add__(self, other: Any) -> NumberFieldElement:
        return self._new(self.poly + self._of(other))

    def __sub__(self, other: Any) -> NumberFieldElement:
        return self._new(self.poly - self._of(other))

    def __rsub__(self, other: Any) -> NumberFieldElement:
        return self._new(self._of(other) - self.poly)

    def __mul__(self, other: Any) -> NumberFieldElement:
        return self._new(self.poly * self._of(other) % self.field.modulus)

    def __truediv__(self, other: Any) -> NumberFieldElement:
        return self._new(self.poly * self.field.inverse(self._of(other)) % self.field.modulus)

    def __rtruediv__(self, other: Any) -> NumberFieldElement:
        return self._new(self._of(other) * self.field.inverse(self.poly) % self.field.modulus)

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self) -> NumberFieldElement:
        return self._new(-self.poly)

    def sign(self) -> int:
        """Sign of the real number."""
        return 0 if self.poly.is_zero() else self.field.alpha.sign_of(integer_polynomial(self.poly))

    def _minus(self, other: Any) -> NumberFieldElement:
        return self._new(self.poly - self._of(other))

    def __bool__(self) -> bool:
        return not self.poly.is_zero()

    def __eq__(self, other: object) -> bool:
        return bool(self._minus(other).poly.is_zero())

    def __lt__(self, other: Any) -> bool:
        return self._minus(other).sign() < 0

    def __le__(self, other: Any) -> bool:
        return self._minus(other).sign() <= 0

    def __gt__(self, other: Any) -> bool:
        return self._minus(other).sign() > 0

    def __ge__(self, other: Any) -> bool:
        return self._minus(other).sign() >= 0

    def __float__(self) -> float:
        # a narrow interval bounds the error; the value is rounded once
        self.field.alpha.narrow(fmpq(1, 2**400))
        return float(to_fraction(self.poly((self.field.alpha.lo + self.field.alpha.hi) / 2)))


class NumberField:
    """The field Q(alpha) of an irrational critical alpha.

    Parameters
    ----------
    alpha : CriticalAlpha
    """

    def __init__(self, alpha: CriticalAlpha) -> None:
        self.alpha = alpha
        self.modulus = fmpq_poly(alpha.minimal_polynomial())

    @property
    def generator(self) -> NumberFieldElement:
        """Alpha itself."""
        return NumberFieldElement(fmpq_poly([0, 1]) % self.modulus, self)

    def inverse(self, poly: Any) -> Any:
        """The inverse of a polynomial modulo the minimal polynomial.

        Raises
        ------
        ZeroDivisionError
            The polynomial is zero.
        """
        if poly.is_zero():
            raise ZeroDivisionError("division by zero in a number field")
        common, s, _ = poly.xgcd(self.modulus)
        return s / common[0] % self.modulus


def exact_value(alpha: CriticalAlpha) -> Any:
    """The number as an element of an exact ordered field: an fmpq, or a NumberFieldElement when it is irrational."""
    if not alpha.is_rational:
        field = NumberField(alpha)
        if not alpha.is_rational:
            return field.generator
    return alpha.lo
