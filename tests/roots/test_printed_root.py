"""Line 12: `print(root)` is a short table."""

from fractions import Fraction

import pytest

import enumsol
from enumsol import ContactProblem, gallery


def printed(root, capsys):
    print(root)  # noqa: T201  # printing it is the test
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    return lines


def test_one_line_a_node_under_a_heading(capsys):
    roots = enumsol.enumerate_roots(gallery.two_node_square(), 3.5)
    heading, columns, *rows = printed(roots[1], capsys)
    assert heading == f"Root at alpha = 3.5: index -1, regular, margin {roots[1].margin:.2e}"
    assert columns.split() == ["node", "status", "lambda_n", "lambda_t", "u_n", "u_t"]
    assert [row.split() for row in rows] == [
        ["0", "slip-", "0.5", "-1.75", "0", "-1"],
        ["1", "open", "0", "0", "-0.25", "-0.75"],
    ]


def test_a_root_that_is_not_regular_says_so(capsys):
    roots = enumsol.enumerate_roots(gallery.one_node_triangle(), Fraction(8, 3))
    assert printed(roots[1], capsys)[0] == "Root at alpha = 2.66667: index +0, not regular, margin 0.00e+00"


def test_labels_are_those_of_the_problem(capsys):
    square = gallery.two_node_square()
    labels = ["left foot", 17]
    problem = ContactProblem(square.A, square.Bn, square.Bt, square.f, friction=(0.0, 1.0), node_ids=labels)
    lines = printed(enumsol.enumerate_roots(problem, 3.5)[1], capsys)
    assert lines[2].startswith("left foot slip-")
    assert lines[3].startswith("       17 open")


@pytest.mark.slow
@pytest.mark.parametrize(("size", "more"), [(16, 0), (32, 12), (100, 80)])
def test_large_roots_are_cut(capsys, size, more):
    entry = gallery.get(f"clamped-block-{size}")
    problem = entry.build()
    lines = printed(enumsol.newton(problem, entry.alpha), capsys)
    if more:
        assert len(lines) == 2 + 20 + 1
        assert lines[-1].startswith(f"... {more} more nodes; all of them: ")
    else:
        assert len(lines) == 2 + problem.p


def test_the_prompt_shows_the_same():
    root = enumsol.newton(gallery.one_node_triangle(), 1.0)
    assert repr(root) == str(root)
