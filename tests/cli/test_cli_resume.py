"""``--resume``: a search goes on with its proof file."""

import json

import pytest
from cli.test_cli_solve import BODY, OPTIONS
from command_line import assert_refused, printed, run

from enumsol import Proof, gallery, verify

WEDGE = ("roots", "gallery:wedge-8-5", "--alpha", 3)


def test_a_search_in_two_parts(capsys, tmp_path):
    proof, report = tmp_path / "w.proof", tmp_path / "w.json"
    # the same line every time
    search = (*WEDGE, "--proof", proof, "--json", report, "--max-nodes", 150, "--resume")
    assert "resumed" not in printed(capsys, *search, status=3)
    assert json.loads(report.read_text())["stats"]["resumed"] == 0
    out = printed(capsys, *search)
    second = json.loads(report.read_text())
    # beside the nodes of the search, those on the way to a root that is known; what the limit left are leaves, too
    assert (second["stats"]["resumed"], second["stats"]["nodes"]) == (158, 79)
    assert "resumed: 158 of 172 nodes in the file (14 undecided there), 79 more searched" in out
    assert len(second["roots"]) == 5
    assert verify(gallery.get("wedge-8-5").build(), Proof.load(proof)).complete
    out = printed(capsys, *search)
    assert "resumed: 237 of 237 nodes in the file, nothing was left to search" in out
    printed(capsys, "verify", "gallery:wedge-8-5", proof)


def test_solve(capsys, tree_only, tmp_path):
    mesh, proof, report = tmp_path / "body.msh", tmp_path / "b.proof", tmp_path / "b.json"
    mesh.write_text(BODY)
    search = ("solve", mesh, *OPTIONS, "--friction", "0.5", "--proof", proof, "--json", report, "--resume")
    assert run(capsys, *search, "--max-nodes", 1)[0] == 3
    for _ in range(2):
        assert run(capsys, *search)[0] == 0
    stats = json.loads(report.read_text())["stats"]
    assert stats["nodes"] == 0
    assert stats["resumed"] > 1


def test_what_is_refused(capsys, tmp_path):
    assert_refused(*run(capsys, *WEDGE, "--resume"), "--resume is given without --proof")
    proof = tmp_path / "w.proof"
    run(capsys, *WEDGE, "--proof", proof)
    before = proof.read_bytes()
    other = ("roots", "gallery:wedge-8-5", "--alpha", "5/2", "--proof", proof, "--resume")
    assert_refused(*run(capsys, *other), f"--proof {proof} belongs to another alpha ('3'; here '5/2')")
    assert proof.read_bytes() == before


@pytest.mark.parametrize("verb", ["roots", "solve"])
def test_the_help_says_so(verb, capsys):
    assert "--resume" in printed(capsys, verb, "--help")
