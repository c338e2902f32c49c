"""What every certifier offers, and that nothing asks for the class of one."""

import ast
from pathlib import Path

import pytest
from generators import named

import enumsol
from enumsol.search.certifiers.protocol import Certified, Escalations
from enumsol.search.solvers import Solvers, plane_search
from enumsol.selections.float_selections import SIGN_TOLERANCE


class Records(list):
    write = list.append


def searched(arithmetic):
    """The certifier after a search, and the records that it wrote."""
    solvers, records = Solvers(*named("two-node-6.4"), arithmetic, SIGN_TOLERANCE), Records()
    certifier = solvers.certifier(records)
    outcome = plane_search(solvers.scaled, certifier).run()
    assert len(outcome.solutions) == 5
    return certifier, records


@pytest.mark.parametrize("arithmetic", ["fast", "exact"])
def test_without_a_proof_every_answer_is_neutral(arithmetic):
    certifier, records = searched(arithmetic)
    certifier.skipped((4, 4), "a reason")
    certifier.branching(0, [0, 1])
    certifier.unloaded()
    certifier.recorder.write(["x"])
    certifier.add(Certified({}, Escalations(balls=3), leaves=2))
    assert (certifier.certified, records) == (Certified(), [])


def test_a_proof_counts_what_subtrees_proved_and_writes_to_the_recorder_of_the_moment():
    certifier, records = searched("verified")
    before = certifier.certified
    assert before.leaves == sum(record[0] != "b" for record in records)
    assert len(before.verified) == 5
    balls, leaves = before.escalations.balls, before.leaves
    written, certifier.recorder = len(records), (later := Records())
    certifier.add(Certified({(9, 9): before.verified[next(iter(before.verified))]}, Escalations(balls=2), leaves=4))
    certifier.skipped((4, 4), "a reason")
    assert (later, len(records)) == ([["u", "a reason"]], written)
    after = certifier.certified
    assert (after.leaves, after.escalations.balls, len(after.verified)) == (leaves + 5, balls + 2, 6)


@pytest.mark.slow
def test_nothing_asks_for_the_class_of_a_certifier_or_keeps_anything_by_the_address_of_an_object():
    files = sorted(Path(enumsol.__file__).parent.rglob("*.py"))
    nodes = (node for file in files for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))))
    calls = [node for node in nodes if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)]
    asked = [ast.unparse(call) for call in calls if call.func.id == "isinstance"]
    assert len(asked) > 50
    assert [text for text in asked if "Certifier" in text] == []
    assert [ast.unparse(call) for call in calls if call.func.id == "id"] == []
