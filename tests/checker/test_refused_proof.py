"""A refused proof says what was refused and why, and not that its leaves cover all selections."""

import numpy as np
import pytest
from proof_tools import of_kind, proof_of, put, records_of

from enumsol import Proof, branch_graph, enumerate_roots, gallery, verify, write_problem
from enumsol.cli import main

PROBLEM = gallery.get("two-node-5").build()


@pytest.fixture(scope="module")
def proofs():
    """A proof of each kind."""
    return {
        "leaves cover": enumerate_roots(PROBLEM, 5.0).proof,
        "every solution lies in": branch_graph(PROBLEM, (0.0, 3.0)).proof,
    }


def tampered(proof):
    """Refused at the header, at a leaf, and at the end."""
    records = records_of(proof)
    yield "another problem", put(records, (0, "problem"), "0" * 64)
    yield "do not exclude it", put(records, (of_kind(records, "x")[0],), lambda record: [*record[:-2], "", ""])
    yield "counts at the end", put(records, (-1, "leaves"), 10**6)


def test_what_is_printed(proofs):
    for claim, proof in proofs.items():
        assert claim in repr(verify(PROBLEM, proof))
        for reason, records in tampered(proof):
            report = verify(PROBLEM, proof_of(records))
            lines = repr(report).splitlines()
            assert lines[0].startswith("proof: REFUSED")
            assert lines[1] == f"  failure: {report.failures[0]}"
            assert reason in lines[1]
            for phrase in ("cover all selections", "every solution lies", "isolated", "certified data", "verified"):
                assert phrase not in repr(report)
            assert "which show nothing" in lines[-2]
            assert lines[-1] == "  complete: no"


def test_a_refused_graph_names_no_selections(proofs):
    for _, records in tampered(proofs["every solution lies in"]):
        assert verify(PROBLEM, proof_of(records)).selections == frozenset()


def test_what_the_command_line_prints(proofs, tmp_path, capsys):
    write_problem(PROBLEM, tmp_path / "problem.npz")
    for proof in proofs.values():
        for reason, records in tampered(proof):
            proof_of(records).save(tmp_path / "tampered.proof")
            assert main(["verify", str(tmp_path / "problem.npz"), str(tmp_path / "tampered.proof")]) == 2
            out, err = capsys.readouterr()
            assert err == ""
            assert reason in out
            assert "cover all selections" not in out


def test_the_counts_of_a_verified_proof_agree_with_their_nouns():
    unloaded = gallery.one_node_triangle((0.0, 0.0))
    text = repr(verify(unloaded, enumerate_roots(unloaded, 1.0).proof))
    assert "1 leaf covers all selections" in text
    assert "1 isolated root, 0 families" in text
    many = repr(verify(PROBLEM, Proof(enumerate_roots(PROBLEM, np.float64(5.0)).proof._source)))
    assert "leaves cover all selections" in many
