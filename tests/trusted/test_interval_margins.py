"""Exclusion over a piece of the interval: the compiled copy of the search against the kernel of the checker."""

from fractions import Fraction

import numpy as np
import pytest
from path_problems import generic_problem

from enumsol.search.certifiers._margin import Margins
from enumsol.search.subintervals import IntervalCertifier, IntervalSearch
from enumsol.trusted.exclusion import exclusion_margin
from enumsol.trusted.over_interval import KINDS, EnclosedPiece, interval_row_tables
from enumsol.trusted.status_rows import FORBIDDEN, FREE

CODES = (0, 1, 2, 3, 5, 6)


def piece_of(problem, a, b):
    """The piece [a, b] in units of powers of two near those of g and S."""
    units = np.ldexp(1.0, np.frexp(np.diagonal(problem.condensed.S))[1] // 2)
    return EnclosedPiece.from_enclosure(problem.enclosure, Fraction(a), Fraction(b), 1.0 / units, units, None)


def multipliers(rng, piece, codes, share):
    """Random multipliers of rows that the codes allow."""
    signs = interval_row_tables()[(piece.low != piece.high).astype(int), codes]
    rows = [kind * len(signs) + node for node, kind in np.argwhere(signs != FORBIDDEN) if rng.random() < share]
    free = [signs[row % len(signs), row // len(signs)] == FREE for row in rows]
    values = 10.0 ** rng.uniform(-3, 1, len(rows)) * np.where(free, rng.choice([-1, 1], len(rows)), 1)
    return np.array(rows, dtype=np.intp), values


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("kind", ["friction", "load", "both"])
def test_compiled_margins_equal_those_of_the_kernel(kind):
    rng = np.random.default_rng(5)
    finite, kinds = 0, set()
    for p in (1, 2, 3, 5) * 5:
        piece = piece_of(generic_problem(rng, p, kind), 1.0, 1.0 + rng.choice([2.0**-10, 0.5, 3.0]))
        compiled = Margins(piece.ends, piece.low, piece.high)
        for _ in range(30):
            codes = rng.choice(CODES, size=p)
            rows, values = multipliers(rng, piece, codes, rng.choice([0.2, 0.7, 1.0]))
            ours = compiled.margin(tuple(codes.tolist()), rows, values)
            theirs = exclusion_margin(piece, codes, rows, values, errors=2.0)
            # beyond an end whose bound is not positive the compiled loops do not look
            size = np.sum(np.abs(values)) ** 2 + 1.0
            if theirs > 0:
                assert ours == pytest.approx(theirs, rel=1e-9, abs=1e-9 * size)
            assert not (ours > 0 and theirs <= -1e-9 * size)
            finite += theirs > -np.inf
            kinds.update((rows // p).tolist())
    assert finite > 500
    assert kinds == set(range(KINDS)) - ({7, 8} if kind == "load" else set())


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("kind", ["friction", "load", "both"])
def test_both_refuse_the_same_multipliers(kind):
    rng = np.random.default_rng(6)
    refused = 0
    for _ in range(40):
        p = int(rng.integers(1, 4))
        piece = piece_of(generic_problem(rng, p, kind), 1.0, 2.0)
        compiled = Margins(piece.ends, piece.low, piece.high)
        for row in range(-1, (KINDS + 1) * p):
            codes = rng.choice(CODES, size=p)
            arrays = np.array([row], dtype=np.intp), np.array([rng.choice([-1.0, 1.0, np.nan])])
            no = compiled.margin(tuple(codes.tolist()), *arrays) == -np.inf
            assert no == (exclusion_margin(piece, codes, *arrays) == -np.inf)
            refused += no
    assert refused > 200


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("kind", ["friction", "load", "both"])
def test_positive_margins_of_a_search_agree(kind):
    rng = np.random.default_rng(8)
    positive, kinds = 0, set()
    for _ in range(20):
        problem = generic_problem(rng, 4, kind)
        search = IntervalSearch(problem.condensed, (Fraction(0), Fraction(6)), None, IntervalCertifier())
        search.run()
        for part in search.pieces:
            units, ends = part.system.scaled, (part.piece.a, part.piece.b)
            piece = EnclosedPiece.from_enclosure(problem.enclosure, *ends, units.force, units.length, None)
            compiled = Margins(piece.ends, piece.low, piece.high)
            for leaf in part.empty:
                theirs = exclusion_margin(piece, leaf.codes, leaf.rows, leaf.values, errors=2.0)
                ours = compiled.margin(leaf.codes, leaf.rows, leaf.values)
                assert (ours > 0) == (theirs > 0)
                if theirs > 0:
                    assert ours == pytest.approx(theirs, rel=1e-3)  # multipliers along a ray are large
                    positive += 1
                    kinds.update((leaf.rows // problem.p).tolist())
    assert positive > 100
    assert kinds == set(range(KINDS)) - ({7, 8} if kind == "load" else set())
