"""The deck of a wedge that may hold, and what CalculiX found of it."""

import shutil
import subprocess

import numpy as np
import pytest
from small_decks import deck

import enumsol
from enumsol.auditing.results import compare_result
from enumsol.errors import InvalidArgumentError
from tests.helpers.command_line import run
from tests.helpers.documents import ROOT

needs_calculix = pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")
FOLDER = ROOT / "studies" / "against_calculix"


@pytest.fixture(scope="module")
def wedge():
    model = enumsol.read_deck(FOLDER / "wedge.inp")
    problem = model.problem()
    return model, problem, enumsol.enumerate_roots(problem, 0)


def test_the_wedge_is_free_slides_or_holds(wedge):
    _, problem, roots = wedge
    assert problem.p == 8
    assert roots.complete
    assert [[str(status) for status in root.statuses] for root in roots] == [
        ["open"] * 8, ["slip-"] * 4 + ["slip+"] * 4, ["stick"] * 8,
    ]  # fmt: skip
    roots.stability()
    assert [verdict.verdict for verdict in roots.verdicts] == ["does not run away", "runs away", "does not run away"]
    # free, it hangs on its springs: a pull of 5e-4 on a stiffness of 0.02
    np.testing.assert_allclose(problem.mesh.displacements(roots[0].u)[:25], [[0, 0.025]] * 25, atol=1e-12)


def test_calculix_found_the_free_one(wedge):
    model, problem, roots = wedge
    result = enumsol.read_results(FOLDER / "results" / "wedge.dat")[-1]
    compared = compare_result(problem, roots, result.on(problem.mesh, model.mesh.node_labels))
    assert compared.found == ("root", 0)
    assert compared.distances["root", 0] < 1e-9
    assert compared.missed == [("root", 1), ("root", 2)]


def test_the_same_on_the_command_line(capsys):
    files = FOLDER / "wedge.inp", FOLDER / "results" / "wedge.dat"
    status, out, _ = run(capsys, "audit", *files)
    assert status == 0
    assert "the result is root 0" in out
    assert "not found: it differs from root 1 by 1958 % and root 2 by 4410 %" in out


@pytest.fixture
def dat(tmp_path):
    """A result of the wedge that ends at another time."""

    def written(*times):
        text = (FOLDER / "results" / "wedge.dat").read_text()
        whole = "\n".join(text[text.index(" displ") :].replace("0.1000000E+01", time) for time in times)
        (tmp_path / "wedge.dat").write_text(whole)
        return tmp_path / "wedge.dat"

    return written


def test_a_run_that_was_broken_off_is_told_with_both_times(dat, tmp_path, capsys):
    file = dat("0.2000000E+00", "0.4000000E+00")
    _, out, _ = run(capsys, "audit", FOLDER / "wedge.inp", file)
    assert "wedge.dat at time 0.4: the result is root 0" in out
    assert out.endswith("the run was broken off, or writes no end of its step: time 1 was asked for\n")
    heading = "SUMMARY OF JOB INFORMATION\n  STEP      INC     ATT  ITRS     TOT TIME     STEP TIME      INC TIME\n"
    row = "     1          {}     1{}    9  {}  0.200000E+00  0.200000E+00\n"
    rows = row.format(1, " ", "0.200000E+00") + row.format(2, "U", "0.400000E+00")
    (tmp_path / "wedge.sta").write_text(heading + rows)
    status, out, _ = run(capsys, "audit", FOLDER / "wedge.inp", file)
    assert status == 0
    assert "wedge.dat at time 0.2: the result is root 0" in out  # what was written at 0.4 did not converge
    assert out.endswith("time 1 was asked for; the last increment that converged ended at time 0.2\n")


def test_a_run_to_its_end_is_not_told_to_be_broken_off(dat, tmp_path, capsys):
    _, out, _ = run(capsys, "audit", FOLDER / "wedge.inp", dat("0.5000000E+00", "0.1000000E+01"))
    assert "wedge.dat at time 1: the result" in out
    assert "broken off" not in out
    (tmp_path / "wedge.sta").write_text("     1          1     1     9  0.2E+01  0.1E+01  0.2E+00\n")
    _, out, _ = run(capsys, "audit", FOLDER / "wedge.inp", dat("0.2000000E+01"))
    assert "wedge.dat at time 2: the result" in out  # a run of more than the deck has, as of --start
    assert "broken off" not in out


def test_displacements_in_local_axes_are_refused(tmp_path):
    (tmp_path / "a.dat").write_text(" displacements (vx,vy,vz) for set A and time  0.1E+01\n\n  1  0.1 0.2 0.3 L\n")
    with pytest.raises(InvalidArgumentError, match=r"local axes; expected .NODE PRINT, GLOBAL=YES"):
        enumsol.read_results(tmp_path / "a.dat")


@needs_calculix
@pytest.mark.parametrize(("number", "stays"), [(0, True), (1, False), (2, True)])
def test_calculix_is_led_to_each_of_the_three(wedge, tmp_path, number, stays):
    """Let go, it stays where it does not run away; friction holds the jammed wedge for itself."""
    model, problem, roots = wedge
    enumsol.write_start(model, roots[number], tmp_path / "start.inp")
    subprocess.run(["ccx", "start"], cwd=tmp_path, capture_output=True, check=False)
    for result in enumsol.read_results(tmp_path / "start.frd"):
        found = compare_result(problem, roots, result.on(problem.mesh, model.mesh.node_labels)).found
        if result.time in (1.0, 2.0):
            assert found == ("root", number)
    assert (result.time == 2.0) == stays


def test_the_deck_of_a_start_holds_slips_and_lets_them_go(wedge, tmp_path, capsys):
    """Equations, held values, forces and supports, read back from the file."""
    _, problem, roots = wedge
    status, _, _ = run(capsys, "roots", FOLDER / "wedge.inp", "--start", tmp_path / "go.inp")
    assert status == 0
    assert sorted(file.name for file in tmp_path.iterdir()) == ["go-0.inp", "go-1.inp", "go-2.inp"]
    text = (tmp_path / "go-1.inp").read_text()
    head, first, second = text.split("*STEP, INC=1000\n")
    assert head.startswith((FOLDER / "wedge.inp").read_text().partition("*STEP")[0])
    equations = [card.splitlines()[2:] for card in head.split("*EQUATION\n")[1:]]
    assert len(equations) == problem.p
    assert not any(len(field) > 20 for line in text.splitlines() for field in line.split(",") if "*" not in line)
    new = range(215, 215 + problem.p)  # behind the nodes of the deck

    def of_slips(step):
        """Numbers of the lines of supports and of forces at these nodes."""
        rows = [[float(field) for field in line.split(",")] for line in step.splitlines() if line[:1].isdigit()]
        own = [row for row in rows if row[0] in new]
        return np.array([row for row in own if len(row) == 4]), np.array([row for row in own if len(row) == 3])

    held, pushed = of_slips(first)
    np.testing.assert_allclose(held, np.column_stack([new, *np.ones((2, problem.p)), roots[1].u_t]), rtol=1e-11)
    np.testing.assert_allclose(pushed, np.column_stack([new, np.ones(problem.p), -roots[1].lambda_t]), rtol=1e-11)
    held, pushed = of_slips(second)
    assert not len(held)
    np.testing.assert_array_equal(pushed, np.column_stack([new, np.ones(problem.p), np.zeros(problem.p)]))
    assert second.startswith("*STATIC\n0.1, 1.\n*BOUNDARY, OP=NEW\n101, 1, 1,")


def test_what_no_start_can_be_written_for(wedge, tmp_path, capsys):
    _, _, roots = wedge
    other = tmp_path / "other.inp"
    other.write_text(deck())
    with pytest.raises(InvalidArgumentError, match="root is of another problem"):
        enumsol.write_start(enumsol.read_deck(other), roots[0], tmp_path / "start.inp")
    included = tmp_path / "whole.inp"
    included.write_text("*INCLUDE, INPUT=other.inp\n")
    model = enumsol.read_deck(included)
    with pytest.raises(InvalidArgumentError, match="includes its steps; expected steps in the deck itself"):
        enumsol.write_start(model, enumsol.enumerate_roots(model.problem(), 0)[0], tmp_path / "start.inp")
    status, _, error = run(capsys, "roots", "gallery:wedge-8-3", "--alpha", "1", "--start", tmp_path / "s.inp")
    assert status == 2
    assert "--start is given, but gallery:wedge-8-3 is no deck; expected an .inp PROBLEM" in error
