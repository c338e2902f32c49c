"""Balls, verified selections and bounds of exclusions against the exact numbers."""

from fractions import Fraction

import numpy as np
from oracles import _affine, _at, _conditions
from proof_tools import det_sign


def fraction(x):
    """The number of a float, a fraction or a rational of FLINT."""
    return Fraction(int(x.p), int(x.q)) if hasattr(x, "p") else Fraction(x)


def holds(mid, rad, exact):
    """Whether every exact number lies in its ball."""
    exact = [x for row in exact for x in (row if isinstance(row, (list, tuple)) else [row])]
    triples = zip(np.ravel(mid).tolist(), np.ravel(rad).tolist(), exact, strict=True)
    return all(abs(Fraction(m) - fraction(x)) <= Fraction(r) for m, r, x in triples)


def agrees_with_exact(ball, S, g, F, codes):
    """A verified selection against its exact solution; its verdict."""
    assert ball.index == det_sign(S, F, codes) != 0
    equations, inequalities = _conditions(S, g, F, codes)
    point, free = _affine(equations)
    assert not free
    w = [b - sum(s * x for s, x in zip(row, point, strict=True)) for b, row in zip(g, S, strict=True)]
    assert holds(ball.force.mid, ball.force.rad, point)
    assert holds(ball.w.mid, ball.w.rad, w)
    least = min(_at(row, point) for row in inequalities)
    assert not ball.is_root or least > 0
    assert not ball.is_excluded or least < 0
    return ball.is_root or ball.is_excluded


def exact_bound(judge, rows, values):
    """The bound of an exclusion itself, in the units of the judge."""
    m = 2 * len(judge.F)
    linear, constant = [-x for x in judge.g], Fraction(0)
    for row, value in zip(np.asarray(rows).tolist(), np.asarray(values).tolist(), strict=True):
        kind, i = divmod(row, len(judge.F))
        u = Fraction(value) * (judge.length[i] if kind < 4 else judge.force[i])
        form = judge._row(kind, i)
        linear = [a - u * b for a, b in zip(linear, form, strict=False)]
        constant -= u * form[m]
    solved = _affine([[*row, v / 2] for row, v in zip(judge.S, linear, strict=True)])[0]
    return sum(a * x for a, x in zip(linear, solved, strict=True)) / 2 + constant
