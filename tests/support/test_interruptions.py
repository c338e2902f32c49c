"""Ctrl-C, and a lack of memory, at any line of a call: what was found is kept, and nothing false is claimed of it."""

import numpy as np
import pytest
from complete import whole_graph
from cut_short import false_claims_of_graph, false_claims_of_roots
from effort import some
from interruptions import AtLine
from problems3d import SLIDING

import enumsol
from enumsol import Interrupted, OutOfMemoryError, gallery
from enumsol.support import deadlines
from enumsol.support.deadlines import current

TRIANGLE, SQUARE = gallery.one_node_triangle(), gallery.two_node_square()
ROOTS = enumsol.enumerate_roots(TRIANGLE, 5)
WEDGE = gallery.get("wedge-8-3").build()
ENDINGS = {KeyboardInterrupt: Interrupted, MemoryError: OutOfMemoryError}


def partials(call, count):
    """Partial results of a call that is ended at lines spread over all of it, more of them at its end."""
    with AtLine() as counted:
        call()
    lines = counted.lines
    assert lines > 100
    spread = {1, lines - 1, lines, *np.linspace(2, lines, count).astype(int), *range(lines - 240, lines, 60)}
    for k, line in enumerate(sorted(line for line in spread if line > 0)):
        error = (KeyboardInterrupt, MemoryError)[k % 4 == 3]
        with pytest.raises(ENDINGS[error]) as caught, AtLine(line, error):
            call()
        assert current() is None
        assert caught.value.partial is not None
        yield caught.value.partial


CALLS = {
    "roots": lambda: enumsol.enumerate_roots(SQUARE, 3.5),
    "roots, exact": lambda: enumsol.enumerate_roots(TRIANGLE, 5, arithmetic="exact"),
    "all selections": lambda: enumsol.enumerate_roots(TRIANGLE, 5, arithmetic="fast", method="exhaustive"),
    "roots in 3D": lambda: enumsol.enumerate_roots(SLIDING, 1.8),
}


@pytest.mark.parametrize("name", CALLS)
def test_roots_that_were_found_are_kept_wherever_the_search_is_ended(name):
    call = CALLS[name]
    full = call()
    kept = list(partials(call, 12))
    for partial in kept:
        assert partial.stopped.startswith(("interrupted", "out of memory"))
        assert not partial.complete
        assert partial.at_least <= len(full)
        if name == "roots":
            assert list(false_claims_of_roots(partial, full)) == []
    # all of them, once the search is over
    assert len(kept[-1]) == len(full)


@pytest.mark.parametrize(
    ("problem", "interval", "arithmetic"),
    [
        (TRIANGLE, (0, 10), "verified"),
        (SQUARE, (0, 5), "exact"),
        pytest.param(SQUARE, (0, 5), "verified", marks=pytest.mark.slow),
        pytest.param(WEDGE, (0.0, 1.0), "verified", marks=pytest.mark.slow),
    ],
    ids=["triangle", "square, exact", "square", "wedge by balls"],
)
def test_arcs_that_were_found_are_kept_wherever_a_graph_is_ended(problem, interval, arithmetic):
    full = whole_graph(problem, interval)
    kept = list(partials(lambda: enumsol.branch_graph(problem, interval, arithmetic), some(4, of=8)))
    for partial in kept:
        assert partial.reasons
        assert list(false_claims_of_graph(partial, full)) == []
    assert len(kept[-1].arcs) == len(full.arcs)


@pytest.mark.slow
def test_curves_that_were_found_are_kept_wherever_a_graph_in_3d_is_ended():
    full = whole_graph(SLIDING, (1.78, 1.82))
    kept = list(partials(lambda: enumsol.branch_graph(SLIDING, (1.78, 1.82)), some(4, of=8)))
    for partial in kept:
        assert not partial.complete
        assert all(partial.at_least(alpha) <= full.multiplicity_at(alpha) for alpha in (1.785, 1.8, 1.81))
    assert len(kept[-1].arcs) == len(full.arcs)


OTHERS = {
    "table": (lambda: enumsol.multiplicity_table(TRIANGLE, [1, 5]), len),
    "histories": (lambda: enumsol.histories(TRIANGLE, [1, 2]), lambda found: found.graph.number_of_nodes()),
    "path": (lambda: enumsol.follow(TRIANGLE, ROOTS[2], -1, (4.5, 5.5)), len),
    "iteration": (lambda: enumsol.successive_approximations(TRIANGLE, 5, 10), lambda found: found.iterations),
    "map": (
        lambda: enumsol.multiplicity_map(TRIANGLE, (0, 1), {"gap": [0, 0.1]}),
        lambda found: len(found.rows),
    ),
}


@pytest.mark.parametrize("name", OTHERS)
def test_what_was_done_is_kept_wherever_a_call_is_ended(name):
    call, size = OTHERS[name]
    full = size(call())
    kept = [size(partial) for partial in partials(call, 6)]
    assert all(number <= full for number in kept)
    assert kept[-1] == full


@pytest.mark.slow
def test_a_path_that_was_interrupted_goes_on_from_its_last_point():
    def call():
        return enumsol.follow(TRIANGLE, ROOTS[2], -1, (0, 10))

    full = call()
    for partial in partials(call, some(6, of=12)):
        assert len(partial.transitions) == sum(kind == "transition" for kind in partial.kinds)
        again = partial.resume()
        assert again.status == full.status
        assert [item.alpha for item in again.transitions] == pytest.approx([item.alpha for item in full.transitions])


def test_a_second_ctrl_c_loses_nothing():
    calls = []

    def rest(ending):
        calls.append(ending)
        if len(calls) < 3:
            raise KeyboardInterrupt
        return "what was found"

    def work():
        raise KeyboardInterrupt

    with pytest.raises(Interrupted, match=r"^call was interrupted; so far$") as caught:
        deadlines.keeping("call", work, rest, lambda _: "; so far")
    assert caught.value.partial == "what was found"


def test_without_memory_to_keep_anything_there_is_one_sentence():
    def full(*_):
        raise MemoryError

    with pytest.raises(OutOfMemoryError, match=r"^call ran out of memory, and nothing could be kept$") as caught:
        deadlines.keeping("call", full, full, str)
    assert caught.value.partial is None
