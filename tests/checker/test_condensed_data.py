"""Proofs about S and g as computed: accepted for what they say, and only where balls decide every leaf."""

import numpy as np
from complete import complete_report
from generators import integer_problem, named
from proof_tools import of_kind, proof_of, put, records_of, why_refused
from trees import by_the_tree

from enumsol import enumerate_roots, gallery
from enumsol.model.restart import SlipStart, restarted


def records(problem, alpha):
    """Those of a set of roots, which say that they are about S and g as computed."""
    with by_the_tree():
        found = records_of(enumerate_roots(problem, alpha).proof)
    return put(found, (0, "data"), "condensed")


def test_roots_of_what_was_computed_are_counted():
    problem, alpha = named("wedge-8-5")
    report = complete_report(problem, proof_of(records(problem, alpha)))
    assert (report.roots, report.data) == (5, "condensed")
    assert "certified data: S and g as computed" in repr(report)


def test_rationals_are_not_about_what_was_computed():
    problem = integer_problem(np.random.default_rng(34), 2)
    said = records(problem, 0.0)
    assert of_kind(said, "D")
    assert "a rational leaf in a proof about S and g as computed" in why_refused(problem, said)


def test_a_ball_of_slip_offsets_is_not_computed():
    problem = gallery.one_node_triangle()
    wide = restarted(problem, SlipStart(np.zeros(1), np.full(1, 1e-9)))
    said = records(wide, 5.0)
    assert "of a problem whose slip offset is a ball" in why_refused(wide, said)
    rational = put(said, (0, "data"), "problem")
    for k in of_kind(said, "x"):
        rational = put(rational, (k,), [*rational[k], "rational"])
    assert "a rational leaf in a proof about a problem whose slip offset is a ball" in why_refused(wide, rational)


def test_units_in_which_what_was_computed_overflows():
    problem = gallery.one_node_triangle()
    said = put(put(records(problem, 5.0), (0, "force"), [900] * 2), (0, "length"), [-900] * 2)
    assert "over- or underflow in the proof's units" in why_refused(problem, said)
