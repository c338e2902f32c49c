"""Real zeros of polynomials with rational coefficients, by Sturm sequences, for rational_arcs."""

from itertools import pairwise

from flint import fmpq, fmpq_poly


def interpolated(values):
    """The polynomial of lowest degree with these values at 0, 1, 2, ..., by divided differences."""
    c = list(values)
    for step in range(1, len(c)):
        for i in range(len(c) - 1, step - 1, -1):
            c[i] = (c[i] - c[i - 1]) / step
    found = fmpq_poly([0])
    for i in range(len(c) - 1, -1, -1):
        found = found * fmpq_poly([-i, 1]) + fmpq_poly([c[i]])
    return found


def sign(value):
    return (value > 0) - (value < 0)


def primitive(f):
    """A positive multiple with coprime integer coefficients, which keeps numbers short."""
    return fmpq_poly(f.numer() // f.numer().content()) if f != 0 else f


def squarefree(f):
    return f // f.gcd(f.derivative()) if f.degree() > 0 else f


class Sturm:
    """The sequence of the squarefree part of f, which is not 0."""

    def __init__(self, f):
        self.f = primitive(squarefree(f))
        self.sequence = [self.f, self.f.derivative()]
        while self.sequence[-1] != 0:
            self.sequence.append(primitive(-(self.sequence[-2] % self.sequence[-1])))

    def _changes(self, x):
        signs = [s for s in (sign(f(x)) for f in self.sequence) if s]
        return sum(a != b for a, b in pairwise(signs))

    def above(self, x, y):
        """How many zeros lie in (x, y]."""
        return self._changes(x) - self._changes(y) if x < y else 0

    def within(self, x, y):
        """How many zeros lie in [x, y]."""
        return self.above(x, y) + (self.f(x) == 0)


def count(f, x, y):
    """How many different zeros f, which is not 0, has in [x, y]."""
    return Sturm(f).within(x, y)


class Zero:
    """The only zero of a polynomial in (low, high], or the rational number low = high."""

    def __init__(self, sturm, low, high):
        self._sturm, self.low, self.high = sturm, low, high

    def halve(self):
        middle = (self.low + self.high) / 2
        if self._sturm.above(self.low, middle):
            self.high = middle
        else:
            self.low = middle

    def sign_of(self, f):
        """The sign that f has there."""
        if f == 0 or self.low == self.high:
            return 0 if f == 0 else sign(f(self.high))
        if Sturm(self._sturm.f.gcd(f)).above(self.low, self.high):
            return 0
        other = Sturm(f)
        while other.within(self.low, self.high):
            self.halve()
        return sign(f(self.high))


def rational(x):
    return Zero(None, x, x)


def zeros(f, x, y):
    """The zeros of f, which is not 0, in [x, y], from left to right."""
    sturm = Sturm(f)
    found = [rational(x)] if sturm.f(x) == 0 else []
    due = [(x, y)] if x < y else []
    while due:
        low, high = due.pop()
        number = sturm.above(low, high)
        if number > 1:
            middle = (low + high) / 2
            due += [(middle, high), (low, middle)]
        elif number:
            found.append(Zero(sturm, low, high))
    return found


def cells(polynomials, x, y):
    """Points of [x, y] of which one is a zero of the polynomials or lies in each interval between zeros."""
    together = fmpq_poly([1])
    for f in polynomials:
        if f != 0 and count(f, x, y):
            together = squarefree(together * f)
    points, last = [rational(x)], x
    for zero in zeros(together, x, y):
        if zero.low != zero.high:
            while zero.low <= last:
                zero.halve()
            points.append(rational(zero.low))
        points.append(zero)
        last = zero.high
    return [*points, rational(y)]


def one_sign(f, x, y):
    """The sign that f has in all of [x, y], or 0."""
    return 0 if f == 0 or count(f, x, y) else sign(f(fmpq(x)))
