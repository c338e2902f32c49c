"""What README shows runs as it stands, and what its comments say comes out."""

import re
import shlex
from pathlib import Path

import pytest

import enumsol
from enumsol import gallery
from enumsol.cli import main

README = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
LINES = re.findall(r"^    (?:\.venv/bin/)?(enumsol (?:.*\\\n)*.*)$", README, re.MULTILINE)
#: That on a mesh stands in docs/from_a_mesh.md, too, and is tested there.
COMMANDS = [shlex.split(line)[1:] for line in LINES if "MESH.msh" not in line]


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_enumeration(elsewhere):
    problem = gallery.get("wedge-14-5").build()
    A, Bn, Bt = (matrix.toarray() for matrix in (problem.A, problem.Bn, problem.Bt))
    seen = {"A": A, "Bn": Bn, "Bt": Bt, "f": problem.f}
    exec(BLOCKS[0], seen)
    assert seen["roots"].complete
    assert len(seen["roots"]) % 2 == 1
    assert (elsewhere / "roots.proof").stat().st_size > 1000


def test_a_mesh():
    seen = {}
    exec(BLOCKS[1], seen)
    assert seen["problem"].p == 6
    text = (Path(__file__).parent.parent / "docs" / "from_a_mesh.md").read_text(encoding="utf-8")
    (line,) = [line for line in LINES if "MESH.msh" in line]
    assert line.replace("MESH.msh", "punch.msh").replace("problem.npz", "punch.npz") in text


def test_branches_and_continuation(elsewhere):
    assert len(BLOCKS) == 6
    seen = {}
    exec(BLOCKS[2], seen)
    graph, path = seen["graph"], seen["path"]
    assert graph.complete
    assert graph.multiplicity_at(3.5) == 5
    assert graph.uniqueness_limit == 3
    assert "of them 3 folds" in str(path)
    assert not seen["report"].complete
    assert seen["everything"].complete
    assert list(seen["table"]["roots"]) == [1, 1, 1]
    assert enumsol.verify(seen["problem"], graph.proof).complete
    assert (elsewhere / "branches.png").stat().st_size > 1000


def test_three_dimensions_and_fixed_points(elsewhere):
    seen = {}
    exec(BLOCKS[3], seen)
    assert seen["limit"].converged
    assert seen["weakening"].converged
    assert (elsewhere / "block.vtu").stat().st_size > 1000


def test_all_solutions_in_three_dimensions(elsewhere):
    seen = {}
    exec(BLOCKS[4], seen)
    assert [str(root.statuses[0]) for root in seen["roots"]] == ["stick", "slip", "open"]
    assert seen["roots"].complete


def test_a_cluster():
    pytest.importorskip("distributed")
    seen = {"__name__": "__main__"}
    exec(BLOCKS[5].replace("n_workers=2", 'n_workers=2, dashboard_address=":0"'), seen)
    assert seen["roots"].complete
    assert len(seen["roots"]) == 5


def test_commands(elsewhere, capsys):
    # in README's order: later ones read what earlier ones wrote
    assert len(COMMANDS) >= 6
    for command in COMMANDS:
        assert main(command) == 0, (command, capsys.readouterr())
        assert capsys.readouterr().out.strip()
    assert {path.name for path in elsewhere.iterdir()} >= {"wedge.proof", "branches.png", "graph.json", "POINTS.csv"}
