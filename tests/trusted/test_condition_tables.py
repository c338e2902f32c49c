"""The table of the statuses that the search reads, and the checkers' own copy of it in enumsol.trusted.selection."""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest

from enumsol.model import statuses
from enumsol.model.statuses import RowKind
from enumsol.relaxation.active_set import interval_rows
from enumsol.relaxation.engine import EQUALITY, INEQUALITY, imposed_rows, status_rows, with_implied
from enumsol.trusted import over_interval as interval, status_rows as rows

NAMES = ("OPEN", "STICK", "SLIP_PLUS", "SLIP_MINUS", "FRICTIONLESS", "CONTACT", "UNDECIDED", "FORWARD", "BACKWARD")
FINAL = range(5)
#: Rows of the kernel's table: a code, or STILL for an undecided node without friction.
TABLE = rows.row_table()


def test_both_sides_use_the_same_codes():
    assert [getattr(statuses, name) for name in NAMES] == [getattr(rows, name) for name in NAMES] == list(range(9))
    assert (INEQUALITY, EQUALITY) == (rows.NONNEGATIVE, rows.FREE)
    assert len(RowKind) == rows.ROW_KINDS


@pytest.mark.parametrize("code", FINAL)
def test_both_sides_impose_the_same_conditions(code):
    ours, theirs = statuses.CONDITIONS[code], rows.CONDITIONS[code]
    assert set(rows.CONDITIONS) == set(FINAL)
    assert [tuple(map(int, part)) for part in ours] == list(theirs)


@pytest.mark.parametrize("code", range(9))
def test_the_multipliers_fit_the_conditions(code):
    equations, inequalities = statuses.CONDITIONS[code]
    assert all(TABLE[code, kind] == rows.FREE for kind in equations)
    assert all(TABLE[code, kind] >= rows.NONNEGATIVE for kind in inequalities)


@pytest.mark.parametrize(("code", "friction"), [*product(range(9), [True]), *product((0, 4, 6), [False])])
def test_the_search_believes_no_row_that_a_proof_may_not_use(code, friction):
    allowed = TABLE[rows.STILL if code == rows.UNDECIDED and not friction else code]
    assert dict(status_rows(code, friction=friction)).items() <= imposed_rows(code, friction=friction).items()
    assert all(mode <= allowed[kind] for kind, mode in imposed_rows(code, friction=friction).items())


@pytest.mark.parametrize("code", range(7))
def test_the_same_over_an_interval(code):
    allowed = interval._VARYING[code]
    found = with_implied(code, interval_rows(code, friction=True, constant=False))
    assert all(mode <= allowed[kind] for kind, mode in found.items())
    slips = code in (rows.SLIP_PLUS, rows.SLIP_MINUS)
    assert (max(found) >= rows.ROW_KINDS) == slips


@pytest.mark.parametrize("parent", [rows.UNDECIDED, rows.CONTACT, rows.FORWARD, rows.BACKWARD])
def test_children_impose_what_their_parents_do(parent):
    assert rows.coverings_of(parent, friction=True)[0] == rows.children_of(parent, friction=True)
    for child in {child for covering in rows.coverings_of(parent, friction=True) for child in covering}:
        assert rows.refines(child, parent)
        assert not rows.refines(parent, child)
        below, above = TABLE[child], TABLE[parent]
        assert all(a <= b for a, b in zip(above, below, strict=True))
        if child != rows.OPEN:
            assert dict(status_rows(parent, friction=True)).keys() <= dict(status_rows(child, friction=True)).keys()


#: lambda_n, lambda_t, w_n, w_t at points of every status, written out from their meaning (theory, section 2.1).
HALF = Fraction(1, 2)
POINTS = {
    rows.OPEN: [(0, 0, -1, 3), (0, 0, 0, -2)],
    rows.STICK: [(2, 1, 0, 0), (2, -1, 0, 0), (0, 0, 0, 0), (2, Fraction(1, 3), 0, 0)],
    rows.SLIP_PLUS: [(2, 1, 0, 5), (2, 1, 0, 0), (0, 0, 0, 1)],
    rows.SLIP_MINUS: [(2, -1, 0, -5), (2, -1, 0, 0), (0, 0, 0, -1)],
    rows.FRICTIONLESS: [(2, 0, 0, 4), (2, 0, 0, -4), (0, 0, 0, 1)],
}


@pytest.mark.parametrize("code", FINAL)
def test_the_rows_hold_where_the_status_does(code):
    F = 0 if code == rows.FRICTIONLESS else HALF
    values = np.array([(n, t, F * n - t, F * n + t, -w_n, w_t, -w_t) for n, t, w_n, w_t in POINTS[code]])
    for kind, mode in enumerate(TABLE[code]):
        assert mode == rows.FORBIDDEN or np.all(values[:, kind] >= 0)
        # and it is an equation where the row vanishes at all of them
        assert (mode == rows.FREE) == (not np.any(values[:, kind]))
