"""One parser for alpha and its intervals, everywhere, with one style of error."""

import math
import re
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pandas as pd
import pytest
from command_line import printed, run
from refusals import bad_argument

import enumsol
from enumsol import gallery
from enumsol.continuation import start_tangents
from enumsol.support.arguments import MAX_BITS, alpha_interval, alpha_list, alpha_value, unbounded_interval

#: What is given, and the number that it is.
NUMBERS = {
    "int": (3, Fraction(3)),
    "float": (2.75, Fraction(11, 4)),
    "float64": (np.float64(2.75), Fraction(11, 4)),
    "float32": (np.float32(2.7), Fraction(float(np.float32(2.7)))),
    "float16": (np.float16(2.7), Fraction(float(np.float16(2.7)))),
    "longdouble": (np.longdouble(2) + np.longdouble(2) ** -60, 2 + Fraction(1, 2**60)),
    "int8": (np.int8(3), Fraction(3)),
    "uint64": (np.uint64(3), Fraction(3)),
    "Fraction": (Fraction(8, 3), Fraction(8, 3)),
    "Decimal": (Decimal("2.7"), Fraction(27, 10)),
    "0-d float": (np.array(2.75), Fraction(11, 4)),
    "0-d float32": (np.array(2.7, dtype=np.float32), Fraction(float(np.float32(2.7)))),
    "0-d int": (np.array(3), Fraction(3)),
    "0-d object": (np.array(Fraction(8, 3)), Fraction(8, 3)),
    "0-d text": (np.array("8/3"), Fraction(8, 3)),
    "unmasked": (np.ma.array(2.75), Fraction(11, 4)),
    "decimal text": ("2.7", Fraction(2.7)),
    "fraction text": ("8/3", Fraction(8, 3)),
    "spaced text": (" 8 / 3 ", Fraction(8, 3)),
    "numpy text": (np.str_("8/3"), Fraction(8, 3)),
}
if np.finfo(np.longdouble).nmant < 60:  # a platform whose longdouble is float64
    del NUMBERS["longdouble"]

REFUSED = {
    "nan": math.nan,
    "inf": math.inf,
    "float32 nan": np.float32("nan"),
    "longdouble inf": np.longdouble("-inf"),
    "bool": True,
    "numpy bool": np.True_,
    "complex": 2 + 1j,
    "complex with nothing imaginary": np.complex128(2),
    "None": None,
    "text": "five",
    "text nan": "nan",
    "text inf": "inf",
    "bytes": b"2",
    "empty text": "",
    "zero denominator": "1/0",
    "two slashes": "1/2/3",
    "underscore": "1_0",
    "array": np.array([2.0]),
    "list": [2.0],
    "masked": np.ma.masked,
    "missing": pd.NA,
    "date": np.datetime64("2020-01-01"),
    "too large": 10**400,
    "too large as text": "1e400",
    "far too large as text": "1e4000000",
    "far too large as Decimal": Decimal("1e4000000"),
    "too large as fraction": "1" + 400 * "0" + "/3",
    "too small": Fraction(1, 10**400),
    "too small as text": "1e-400",
    "negative and too small": "-1e-400",
    "far too small as text": "1e-4000000",
    "far too small as Decimal": Decimal("1e-4000000"),
    "too long": Fraction(2**MAX_BITS + 1, 2**MAX_BITS),
    "too long as text": "1" * 5000,
    "too long as int": 10**5000,
    "too long as Decimal": Decimal("0." + "1" * 5000),
}


@pytest.mark.parametrize("kind", NUMBERS)
def test_alpha_is_the_exact_number_that_was_given(kind):
    given, exact = NUMBERS[kind]
    value = alpha_value(given)
    assert type(value) in (float, Fraction)
    assert Fraction(value) == exact
    assert alpha_value(value) == value


def test_integers_are_not_rounded():
    large = 2**53 + 1
    for given in (large, np.int64(large), np.array(large), str(large)):
        assert alpha_value(given) == Fraction(large)
    assert alpha_value(2**60) == 2.0**60
    assert type(alpha_value(2**60)) is float


def test_a_fraction_survives_its_text():
    for value in (Fraction(8, 3), Fraction(2**53 + 1), Fraction(5), Fraction(1, 3**500), Fraction(5e-324)):
        assert alpha_value(str(value)) == value


def test_zero_is_zero_in_any_form():
    for zero in (0, 0.0, -0.0, "0", "0.0e99", "-0/5", Decimal("0E-5000"), np.float32(0), Fraction(0)):
        assert alpha_value(zero) == 0


@pytest.mark.parametrize("kind", REFUSED)
def test_what_is_no_alpha_gets_one_sentence(kind):
    error = bad_argument(r"^start is .*; expected a finite real number", alpha_value, REFUSED[kind], "start")
    assert len(str(error)) < 300


def test_1e_minus_400_is_not_zero():
    message = r"alpha is '1e-400'; .* in the range of float64: 0, or 5e-324 to"
    bad_argument(message, enumsol.enumerate_roots, gallery.one_node_triangle(), "1e-400")


# -- everywhere ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def problem():
    """Load and friction depend on alpha, and A, f are such that nothing rounds by accident."""
    return gallery.two_node_square(
        (0.4, 0.2), (1.8, -0.1), friction=0.5, friction_slope=0.25, load_slope=((0.1, -1.1), (0.2, -0.8))
    )


@pytest.fixture(scope="module")
def graph(problem):
    return enumsol.branch_graph(problem, (0, 4))


def _content(roots):
    return float(roots.alpha), [(root.statuses, root.lambda_n.tolist(), root.lambda_t.tolist()) for root in roots]


def _end(answer):
    return answer.exact_interval


def _one_arc(graph, alpha):
    return next(arc for arc in graph.arcs if arc.lo <= float(alpha) <= arc.hi)


#: Everything in Python that takes alpha, as functions of (problem, graph, alpha, exact alpha) with comparable answers.
TAKE = {
    "enumerate_roots fast": lambda p, g, a, x: _content(enumsol.enumerate_roots(p, a, "fast")),
    "enumerate_roots verified": lambda p, g, a, x: _content(enumsol.enumerate_roots(p, a)),
    "enumerate_roots exact": lambda p, g, a, x: _content(enumsol.enumerate_roots(p, a, "exact")),
    "alpha of the proof": lambda p, g, a, x: enumsol.verify(p, enumsol.enumerate_roots(p, a).proof).alpha,
    "multiplicity_table": lambda p, g, a, x: enumsol.multiplicity_table(p, [a])[["alpha", "roots"]].to_dict(),
    "link_samples": lambda p, g, a, x: [_content(roots) for roots in enumsol.link_samples(p, [a, 1]).root_sets],
    "branch_graph from": lambda p, g, a, x: _end(enumsol.branch_graph(p, (a, 4), "fast")),
    "branch_graph to": lambda p, g, a, x: _end(enumsol.branch_graph(p, [1, a], "fast")),
    "roots_at": lambda p, g, a, x: _content(g.roots_at(a)),
    "multiplicity_at": lambda p, g, a, x: g.multiplicity_at(a),
    "at_least": lambda p, g, a, x: g.at_least(a),
    "arcs_at": lambda p, g, a, x: [arc.number for arc in g.arcs_at(a)],
    "arc.values": lambda p, g, a, x: np.array(_one_arc(g, x).values(a)).tolist(),
    "arc.displacements": lambda p, g, a, x: np.array(_one_arc(g, x).displacements(a)).tolist(),
    "newton": lambda p, g, a, x: enumsol.newton(p, a).lambda_n.tolist(),
    "follow": lambda p, g, a, x: enumsol.follow(p, enumsol.newton(p, x), 1, (1, a)).interval[1],
    "follow start": lambda p, g, a, x: enumsol.follow(p, (a, *_forces(p, x)), 1, (1, 4)).alpha[0],
    "start_tangents": lambda p, g, a, x: len(start_tangents(p, (a, *_forces(p, x)), (1, "10/3"))),
    "follow_all": lambda p, g, a, x: enumsol.follow_all(p, (1, a)).graph.exact_interval,
    "friction_at": lambda p, g, a, x: p.friction_at(a).tolist(),
    "load_at": lambda p, g, a, x: p.load_at(a).tolist(),
    "is_unloaded": lambda p, g, a, x: p.is_unloaded(a),
    "condensed.at": lambda p, g, a, x: p.condensed.at(a).g.tolist(),
    "condensed.displacement": lambda p, g, a, x: p.condensed.displacement(a, np.zeros(4)).tolist(),
    "enclosure.at": lambda p, g, a, x: p.enclosure.at(a, np.ones(4), np.ones(4)).g.tolist(),
    "residual": lambda p, g, a, x: enumsol.PiecewiseSmoothEquation(p).residual(np.zeros(8), a).tolist(),
    "problem_at": lambda p, g, a, x: _smooth().problem_at(p, a).friction.tolist(),
}


def _smooth():
    return enumsol.SmoothPath(F=lambda alpha: 0.1 * alpha, dF=lambda _: 0.1)


def _forces(problem, alpha):
    root = enumsol.newton(problem, alpha)
    return root.lambda_n, root.lambda_t


@pytest.mark.few(0, 3)
@pytest.mark.parametrize("name", TAKE)
def test_every_function_takes_every_kind_of_number(problem, graph, name):
    known = {exact: TAKE[name](problem, graph, exact, exact) for exact in {exact for _, exact in NUMBERS.values()}}
    for given, exact in NUMBERS.values():
        assert TAKE[name](problem, graph, given, exact) == known[exact]


@pytest.mark.parametrize("name", TAKE)
def test_every_function_refuses_alike(problem, graph, name):
    for kind in ("nan", "bool", "complex", "text", "array", "None", "too small as text", "far too large as text"):
        message = r"is .*; expected a finite real number"
        bad_argument(message, TAKE[name], problem, graph, REFUSED[kind], Fraction(2))


def test_a_rational_alpha_stays_one(problem, graph):
    for given in ("8/3", Fraction(8, 3)):
        roots = enumsol.enumerate_roots(problem, given)
        assert roots.alpha == roots[0].alpha == Fraction(8, 3)
        assert graph.roots_at(given).alpha == Fraction(8, 3)
    assert type(enumsol.enumerate_roots(problem, np.float32(2.5), "fast").alpha) is float


# -- several of them -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("alphas", [1.0, "1.0", np.float64(1.0), np.array(1.0), "1,2", b"1", None, 5])
@pytest.mark.parametrize("function", [enumsol.multiplicity_table, enumsol.link_samples])
def test_one_number_is_not_several(problem, function, alphas):
    bad_argument(r"alphas is .*; expected several numbers, such as \[1\.0, 2\.5\]", function, problem, alphas)


@pytest.mark.parametrize(
    "alphas",
    [
        (x for x in ("1", 2.5, Fraction(3))),
        pd.Series([1.0, 2.5, 3.0], index=["a", "b", "c"]),
        np.array([1.0, 2.5, 3.0], dtype=np.float32),
        np.array([1.0, 2.5, 3.0], dtype=np.longdouble),
        (np.int8(1), "5/2", Decimal(3)),
        np.ma.array([1.0, 2.5, 3.0]),
    ],
)
def test_several_of_any_kind_are_read(problem, alphas):
    table = enumsol.multiplicity_table(problem, alphas, arithmetic="fast")
    assert table["alpha"].tolist() == [1.0, 2.5, 3.0]


def test_a_wrong_one_among_several_is_named(problem):
    for alphas in ([1.0, "x"], [1.0, np.ma.masked], [1.0, None], np.ma.array([1.0, 2.0], mask=[False, True])):
        bad_argument(r"^alphas\[1\] is .*; expected a finite real number", enumsol.multiplicity_table, problem, alphas)
    assert alpha_list([]) == []


@pytest.mark.parametrize(
    "interval", [(0, 1), [0, 1], np.array([0, 1]), np.array([0, 1], dtype=np.float32), ("0", "1"), pd.Series([0, 1])]
)
def test_intervals_of_any_kind_are_read(interval):
    assert alpha_interval(interval) == (0.0, 1.0)
    assert unbounded_interval(interval) == (0.0, 1.0)


@pytest.mark.parametrize("interval", [None, 5, "01", "0,1", {0, 1}, {0: 1, 2: 3}, (0,), (0, 1, 2), [], iter((0, 1))])
def test_what_is_no_interval_gets_one_sentence(problem, interval):
    expected = r"^interval is .*; expected a pair of numbers \(first alpha, last alpha\)$"
    bad_argument(expected, enumsol.branch_graph, problem, interval)
    bad_argument(expected, enumsol.follow_all, problem, interval)
    if interval is not None:  # all alpha, for a path
        bad_argument(expected, enumsol.follow, problem, enumsol.newton(problem, 1), 1, interval)


def test_the_order_of_the_ends_is_exact(problem):
    third = Fraction(1, 3)
    assert alpha_interval((1 / 3, third)) == (1 / 3, third)
    for interval in ((third, 1 / 3), (1, 1), (2, 1), ("8/3", Fraction(8, 3))):
        message = r"interval is .*; expected its first alpha below its last"
        bad_argument(message, enumsol.branch_graph, problem, interval)


def test_only_paths_may_go_to_infinity(problem):
    assert unbounded_interval((-math.inf, np.float32("inf"))) == (-math.inf, math.inf)
    bad_argument(r"interval\[1\] is inf; expected a finite real number", enumsol.branch_graph, problem, (0, math.inf))
    bad_argument(r"interval\[0\] is nan", enumsol.follow, problem, enumsol.newton(problem, 1), 1, (math.nan, 4))


# -- the command line ------------------------------------------------------------------------------------------------


@pytest.mark.few(30)
@pytest.mark.parametrize("text", ["five", "nan", "inf", "1e400", "1e-400", "1e4000000", "1e-4000000", "1/0", "", "1_0"])
@pytest.mark.parametrize(
    ("option", "command"),
    [
        ("--alpha", "roots gallery:one-node-6.1"),
        ("--alphas[0]", "table gallery:one-node-6.1"),
        ("--from", "graph gallery:one-node-6.1 --to 10"),
        ("--to", "graph gallery:one-node-6.1 --from 0"),
        ("--start", "follow gallery:one-node-6.1 --from 0 --to 10"),
    ],
)
def test_the_command_line_refuses_as_python_does(capsys, option, command, text):
    said = bad_argument(f"^{re.escape(option)} is", alpha_value, text, option)
    answer = run(capsys, *command.split(), option.removesuffix("[0]"), text)
    assert answer == (2, "", f"enumsol: error: {said}\n")


def test_the_command_line_reads_fractions_exactly(capsys):
    out = printed(capsys, "roots", "gallery:one-node-6.1", "--alpha", "8/3")
    assert "2 roots" in out  # the fold, exactly
    printed(capsys, "table", "gallery:one-node-6.1", "--alphas", "8/3, 2.5")
