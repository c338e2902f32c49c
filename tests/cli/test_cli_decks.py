"""Commands that are given a deck, as somebody has it who has never seen the package."""

import json
from pathlib import Path

import pytest

import enumsol
from enumsol.cli import main

DECK = (Path(__file__).parents[1] / "decks" / "block_on_base.inp").read_text(encoding="utf-8")


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.inp").write_text(DECK)
    first = DECK[: DECK.index("*END STEP\n") + len("*END STEP\n")]
    (tmp_path / "one.inp").write_text(first)
    return tmp_path


def test_roots_of_a_deck_with_one_step(here, capsys):
    assert main(["roots", "one.inp"]) == 0
    said = capsys.readouterr()
    assert "complete: yes (proven" in said.out
    assert "one.inp line 93   *FRICTION" in said.err
    assert "one.inp line 105  *NODE FILE            not used: it asks for output" in said.err
    assert main(["roots", "one.inp", "--quiet", "--json", "roots.json"]) == 0
    assert capsys.readouterr() == ("", "")
    found = json.loads((here / "roots.json").read_text())
    assert (found["complete"], len(found["roots"])) == (True, 1)


def test_a_history_of_a_deck_with_two_steps(here, capsys):
    assert main(["history", "model.inp", "--proof", "model.proof"]) == 0
    said = capsys.readouterr()
    assert "History of 2 steps: 1 history (verified)" in said.out
    assert "complete: yes (proven), unique until step 2" in said.out
    assert main(["verify", "model.inp", "model.proof", "--step", "1"]) == 0
    model = enumsol.read_deck("model.inp")
    found = enumsol.histories(model.problem(1), model.steps())
    assert (found.complete, found.counts) == (True, (1, 1))


def test_of_several_steps_one_is_named(here, capsys):
    assert main(["roots", "model.inp"]) == 2
    assert "has 2 steps; expected a history of them (enumsol history), or --step, the" in capsys.readouterr().err
    assert main(["roots", "model.inp", "--step", "2"]) == 0
    assert "1 root (verified" in capsys.readouterr().out
    assert main(["roots", "model.inp", "--step", "3"]) == 2
    assert "error: --step is 3; expected one of 1 to 2" in capsys.readouterr().err
    assert main(["history", "model.inp", "--step", "2"]) == 2
    assert "--step is given with a history of a deck" in capsys.readouterr().err


def test_what_would_change_the_answer_is_refused_unless_it_is_ignored(here, capsys):
    text = DECK.replace("*ELASTIC\n210000., 0.3\n", "*ELASTIC\n210000., 0.3\n*PLASTIC\n300., 0.\n")
    (here / "model.inp").write_text(text.replace("*STEP\n", "*STEP, NLGEOM\n"))
    assert main(["roots", "model.inp", "--step", "1"]) == 2
    assert "model.inp line 83: *PLASTIC is not read, and may change the answer" in capsys.readouterr().err
    assert main(["roots", "model.inp", "--step", "1", "--ignore", "PLASTIC"]) == 2
    assert "model.inp line 101: *STEP has NLGEOM" in capsys.readouterr().err
    assert main(["history", "model.inp", "--ignore", "PLASTIC", "--ignore", "nlgeom"]) == 0
    assert "*PLASTIC              not used, as you say" in capsys.readouterr().err


@pytest.mark.parametrize(
    "command",
    [
        "graph one.inp --from 0 --to 1",
        "table one.inp --alphas 0,1",
        "follow one.inp --from 0 --to 1 --start 0",
        "fixed-point one.inp",
        "history one.inp --steps 0,1",
        "roots one.inp --report page.html",
        "solve one.inp",
    ],
)
def test_other_commands_take_decks_too(here, capsys, command):
    if "report" in command:
        pytest.importorskip("plotly")
    assert main(command.split()) in (0, 3), capsys.readouterr().err
    assert "one.inp line 95" in capsys.readouterr().err


def test_a_dry_run_says_what_was_understood(here, capsys):
    assert main(["solve", "one.inp", "--dry-run"]) == 0
    said = capsys.readouterr()
    assert "*CONTACT PAIR" in said.err
    assert "5 contact nodes of the pair UNDER:UPPER" in said.out


def test_a_bare_mesh_is_no_problem(here, capsys):
    (here / "bare.inp").write_text(DECK[: DECK.index("*MATERIAL")])
    assert main(["roots", "bare.inp"]) == 2
    assert (
        "bare.inp has no *STEP; expected a deck with a step, or a bare mesh for enumsol solve"
        in capsys.readouterr().err
    )


def test_elements_of_a_bare_mesh_are_ignored_and_results_are_read_in_one_way(here, capsys):
    mesh = (
        DECK[: DECK.index("*MATERIAL")]
        + "*NODE\n900, 9., 9.\n901, 9., 10.\n902, 8., 9.\n*ELEMENT, TYPE=S3\n900, 900, 901, 902\n"
    )
    (here / "mesh.inp").write_text(mesh)
    options = ["--young", "1", "--poisson", "0.3", "--pair", "UNDER:UPPER", "--clamp", "BOTTOM", "--clamp", "TOP"]
    assert main(["solve", "mesh.inp", *options, "--friction", "0.3", "--dry-run"]) == 2
    assert "mesh.inp line" in capsys.readouterr().err
    assert main(["solve", "mesh.inp", *options, "--friction", "0.3", "--dry-run", "--ignore", "S3"]) == 0
    assert "5 contact nodes of the pair UNDER:UPPER" in capsys.readouterr().out
    (here / "mesh.msh").write_text("")
    with pytest.raises(enumsol.InvalidArgumentError, match=r"ignore is \('S3',\) for a mesh that is no deck"):
        enumsol.fem.read_mesh("mesh.msh", ignore=("S3",))
