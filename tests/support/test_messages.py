"""Counts agree with their nouns."""

import pytest

import enumsol
from enumsol.support.messages import counted, shortened


@pytest.mark.parametrize(
    ("number", "words", "text"),
    [
        (0, ("root",), "0 roots"),
        (1, ("root",), "1 root"),
        (2, ("vertex", "vertices"), "2 vertices"),
        (1, ("leaf covers", "leaves cover"), "1 leaf covers"),
    ],
)
def test_a_number_and_its_noun(number, words, text):
    assert counted(number, *words) == text


def test_printed_results_count_one_of_a_kind():
    problem = enumsol.gallery.one_node_triangle()
    graph = enumsol.branch_graph(problem, (0, 10))
    assert "open, 1 arc, alpha" in repr(graph)
    path = enumsol.follow(problem, graph.starting_points()[1], -1, interval=(0, 10))
    assert [line for line in repr(path).splitlines() if line.endswith("of them 1 fold")]
    assert "1 arcs" not in repr(graph)


def test_texts_of_other_packages_are_one_short_line():
    assert shortened("a\n  b") == "a b"
    long = shortened("x" * 5000)
    assert len(long) == 200
    assert long.endswith("x...")
