"""Why a search ended early: a reason to decide by, and the sentence that results show."""

import pytest
from interruptions import CtrlC, interrupted

import enumsol
from enumsol import gallery
from enumsol.branches import branch_graph
from enumsol.search.outcome import Stop, StopReason


@pytest.mark.parametrize(
    ("stop", "sentence"),
    [
        (Stop(StopReason.NODE_LIMIT, 40), "stopped after max_nodes = 40 nodes"),
        (Stop(StopReason.NODE_LIMIT, 40, "selection"), "stopped after max_nodes = 40 selections"),
        (Stop(StopReason.ENOUGH_ROOTS, unexamined=0), "stopped after enough roots, 0 subtrees not examined"),
        (Stop(StopReason.TIME_LIMIT, unexamined=7), "stopped by the time limit, 7 subtrees not examined"),
        (Stop(StopReason.INTERRUPTED, 0), "interrupted after 0 nodes"),
        (Stop(StopReason.INTERRUPTED, 3, arcs_of=9), "interrupted after the arcs of 3 of 9 selections"),
    ],
    ids=str,
)
def test_the_sentence_that_a_stop_gives(stop, sentence):
    assert str(stop) == sentence
    assert stop.interrupted == sentence.startswith("interrupted")


def test_every_reason_has_a_sentence_of_its_own():
    sentences = {str(Stop(reason, 1)) for reason in StopReason}
    assert len(sentences) == len(StopReason)
    assert all(sentences)


def test_results_show_the_sentence_and_nothing_is_decided_by_it(monkeypatch):
    monkeypatch.setattr(Stop, "__str__", lambda stop: f"interrupted? not examined? {stop.reason.name}")
    problem, alpha = gallery.get("wedge-8-5").build(), 3.0
    cut = enumsol.enumerate_roots(problem, alpha, max_nodes=40)
    assert cut.stopped.endswith("NODE_LIMIT")
    assert enumsol.verify(problem, cut.proof).ok
    partial = interrupted("interrupted", enumsol.enumerate_roots, problem, alpha, progress=CtrlC())
    assert partial.stopped.endswith("INTERRUPTED")
    assert partial.proof is None
    assert branch_graph(problem, (0.0, 1.0), max_nodes=5).reasons[0].endswith("NODE_LIMIT")
    partial = interrupted("interrupted", branch_graph, problem, (0.0, 1.0), progress=CtrlC())
    assert partial.reasons[0].endswith("INTERRUPTED")
