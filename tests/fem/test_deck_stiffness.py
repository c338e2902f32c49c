"""Stiffness of decks as CalculiX assembles it, against the package's own where both have the same elements."""

import runpy
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_decks import by_hand, deck, step

import enumsol
from enumsol.errors import InvalidArgumentError, InvalidProblemError
from tests.helpers.command_line import run
from tests.helpers.documents import ROOT

CASES = runpy.run_path(str(ROOT / "studies" / "against_calculix" / "decks.py"))["CASES"]
#: What CalculiX 2.20 wrote for the elements of the deck of two blocks.
RECORDED = Path(__file__).parent / "assembled"
needs_calculix = pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")
#: Elements that both programs integrate alike.
SAME = ("block CPE4", "block CPE8", "block CPE6", "block C3D8", "block C3D4", "block C3D10")


@pytest.fixture
def command(tmp_path, monkeypatch):
    """A command ccx that does what a shell script says."""

    def install(script):
        place = tmp_path / "bin" / "ccx"
        place.parent.mkdir()
        place.write_text(f"#!/bin/sh\n{script}\n")
        place.chmod(0o755)
        monkeypatch.setenv("PATH", f"{place.parent}:/usr/bin:/bin")

    return install


@pytest.fixture
def model_file(tmp_path):
    def written(text):
        (tmp_path / "model.inp").write_text(text)
        return tmp_path / "model.inp"

    return written


def assert_condensed_alike(one, two, rtol):
    for name in ("S", "g0", "F0"):
        a, b = (np.asarray(getattr(problem.condensed, name)) for problem in (one, two))
        np.testing.assert_allclose(a, b, rtol=0, atol=rtol * np.max(np.abs(b)), err_msg=name)


def test_what_calculix_wrote_gives_the_same_problem_and_proof(command, model_file, tmp_path, capsys):
    command(f"cp '{RECORDED}'/elements.* .")
    file = model_file(deck())
    problem = enumsol.read_deck(file, assemble="ccx").problem()
    assert_condensed_alike(problem, by_hand(), 1e-12)
    assert (problem.A != by_hand().A).nnz  # it is not the package's own
    options = [str(file), "--assemble", "ccx"]
    assert run(capsys, "roots", *options, "--proof", str(tmp_path / "p"), "--quiet")[0] == 0
    assert run(capsys, "verify", str(file), str(tmp_path / "p"), "--assemble", "ccx", "--quiet")[0] == 0
    assert run(capsys, "verify", str(file), str(tmp_path / "p"), "--quiet")[0] != 0


def test_the_steps_of_a_history_share_one_run(command, model_file, tmp_path):
    command(f"cp '{RECORDED}'/elements.* . && echo run >> '{tmp_path}/runs'")
    steps = step("*BOUNDARY\nTOP, 2, 2, -0.011\n") + step("*DLOAD\n12, P2, 2.\n")
    model = enumsol.read_deck(model_file(deck(steps=steps)), assemble="ccx")
    assert len(model.steps()) == 2
    assert (tmp_path / "runs").read_text().split() == ["run"]


@pytest.mark.parametrize(
    ("script", "said"),
    [
        (None, "there is no command ccx; expected CalculiX to be installed"),
        ("echo ' *ERROR in solid sections: no material'; echo more; exit 201", r"\(\*ERROR in solid sections: no mat"),
        ("true", "CalculiX writes no stiffness .it says nothing"),
        ("echo 1 1 x > elements.sti; echo 1.1 > elements.dof", "what CalculiX writes cannot be read"),
        ("echo 1 1 2. > elements.sti; echo 5.1 > elements.dof", "CalculiX has no displacement 1 of node 4;"),
    ],
    ids=["absent", "error", "silent", "damaged", "partial"],
)
def test_a_calculix_that_fails_is_told_in_a_sentence(command, model_file, monkeypatch, script, said):
    if script is None:
        monkeypatch.setenv("PATH", "/nowhere")
    else:
        command(script)
    file = model_file(deck())
    with pytest.raises(InvalidProblemError, match=said) as caught:
        enumsol.read_deck(file, assemble="ccx").problem()
    assert str(caught.value).startswith(str(file))


def test_other_codes_are_refused(model_file):
    with pytest.raises(InvalidArgumentError, match="assemble is 'abaqus'; expected"):
        enumsol.read_deck(model_file(deck()), assemble="abaqus")


def test_temperatures_that_vary_are_refused(command, model_file):
    command(f"cp '{RECORDED}'/elements.* .")
    warm = deck(steps=step("*BOUNDARY\nTOP, 2, 2, -0.01\n*TEMPERATURE\nTOP, 20.\n")).replace(
        "*DENSITY\n2.", "*EXPANSION\n1e-5\n*DENSITY\n2."
    )
    with pytest.raises(InvalidProblemError, match="temperatures act that vary, whose forces CalculiX does not write"):
        enumsol.read_deck(model_file(warm), assemble="ccx").problem()


@needs_calculix
@pytest.mark.parametrize("name", SAME)
def test_elements_of_one_formulation_are_alike(model_file, name):
    make, kind = CASES[name]
    file = model_file(make(kind, 2))
    assert_condensed_alike(enumsol.read_deck(file, assemble="ccx").problem(), enumsol.read_deck(file).problem(), 1e-8)


@needs_calculix
def test_elements_of_twenty_nodes_are_our_own_without_their_nodes_inside(model_file):
    """The shape functions of 27 nodes, with those inside where the others put them, are those of 20."""
    make, kind = CASES["block C3D20"]
    scene = enumsol.read_deck(model_file(make(kind, 2)), assemble="ccx").scene()
    own = replace(scene, stiffness=None).problem()
    assert_condensed_alike(scene.problem(), own, 1e-8)
    assert own.p == 12  # nodes between corners


@needs_calculix
@pytest.mark.parametrize("kind", ["CPS4", "CPS8R", "CPE4R", "C3D8R", "C3D8I", "C3D20R", "C3D6"])
def test_a_body_that_nothing_touches_moves_as_in_calculix(model_file, tmp_path, kind):
    """Elements that are others here: a block that is drawn away from the slab is what CalculiX says it is."""
    make, _ = CASES["block CPE4"]
    up, plain = ("Z3", "C3D") if kind.startswith("C3D") else ("Y2", "CPE")
    plain = {"C3D6": "C3D6", "CPS4": "CPS4"}.get(kind, plain + kind.removesuffix("R").removesuffix("I")[3:])
    text = make(plain, 2).replace(f"TYPE={plain},", f"TYPE={kind},").partition("*STEP")[0]
    text += f"""*STEP
*STATIC
1., 1.
*BOUNDARY
NBLOCK_{up[0]}1, 1, {int(up[1]) - 1}, 4e-4
NBLOCK_{up[0]}1, {up[1]}, {up[1]}, 1e-3
*CLOAD
NBLOCK_{up[0]}0, {up[1]}, -0.01
*NODE PRINT, NSET=ALL
U
*END STEP
"""
    file = model_file(text)
    model = enumsol.read_deck(file, assemble="ccx")
    problem = model.problem()
    roots = enumsol.enumerate_roots(problem, 0)
    subprocess.run(["ccx", "model"], cwd=tmp_path, capture_output=True, check=True)
    result = enumsol.read_results(tmp_path / "model.dat")[-1]
    compared = enumsol.compare_result(problem, roots, result.on(problem.mesh, model.mesh.node_labels))
    assert compared.distances["root", 0] < 1e-6
