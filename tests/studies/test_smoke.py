"""Every study runs at its smoke size, by the command that README gives, and writes the results that it promises."""

import csv
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

import enumsol

STUDIES = Path(__file__).parents[2] / "studies"
NAMES = sorted(file.parent.name for file in STUDIES.glob("*/run.py"))
#: Studies that compare versions; this interpreter stands for that of an older one.
VERSIONS = ("proven_graphs", "requirements")
#: Study -> the library of its peer, what it says when that is not installed, and a column that is there all the same.
PEERS = {
    "against_scip": ("pyscipopt", "pyscipopt is not installed: SCIP is left out", "roots"),
    "fixed_points_scaling": ("cvxpy", "cvxpy is not installed: it is left out", "iterations"),
    "peers": ("pyscipopt", "pyscipopt is not installed: it is left out", "known"),
    "qp_engines": ("daqp", "daqp is not installed: it is left out", "proven by multipliers"),
}
#: What studies at their smoke size conclude.
CONCLUSIONS = {
    "accuracy_vs_speed": ("all 4^p selections: 38, 0 differ", "verified: 0 wrong answers, 0 wrong claims"),
    "branch_shapes": ("40 squares, 0 not complete; 2 closed branches",),
    "continuation_coverage": ("random: 8 of 8 problems settled",),
    "continuation_steps": ("checked steps, h_max 1 5: jumps 0 0",),
    "discs": ("unequal radii, soft: 2 of 2 complete", "unequal weights, stiff: 2 of 2 complete"),
    "extremes": ("all: 15 cases, 15 right, 0 undecided, 0 wrong",),
    "fixed_points_basins": ("sign of the index at all: yes", "none of the repelling ones: yes"),
    "fixed_points_scaling": ("all converged: yes", "Newton needed no help: yes"),
    "grazing": ("chains: all complete and checked: yes; at most", "rows of equal discs: 4 of 4 complete"),
    "histories": ("all complete and unique, proven: yes", "unique until step 2, complete: yes"),
    "jamming_wedge": (
        "jams from F = 1.37, from coarse to fine; at most 5",
        "holds from F = 0.122, from coarse to fine",
    ),
    "paper_examples": ("all 19 facts hold", "no arc or continuum missed, no jump"),
    "peers": ("enumsol: ended on 3 of 3", "4^p selections: ended on 3 of 3"),
    "requirements": ("both interpreters import the same enumsol", "import enumsol: "),
    "same_body_by_other_codes": (
        "the same roots to 1e-09, all complete: yes",
        "two bodies: the same roots to 1e-09, all complete: yes",
    ),
    "samples_vs_graph": ("branches of length 0.001 are missed by 50 samples", "20 of 20 root sets agree"),
    "stability": ("12 equilibria, 8 different with nodes at their limit", "undecided: 0"),
    "workers": ("all complete and checked: yes; one proof whatever the number of workers: yes",),
    "uniqueness_vs_mesh": ("bound on F: 2D, nodes H^0.58, 0.54 between the finest (paper 0.5)",),
}
#: Studies that take more than two and a half seconds at their smoke size, but for the examples of the paper.
LONG = (
    "accuracy_vs_speed",
    "against_calculix",
    "branching_rule",
    "certification_cost",
    "condensation_cost",
    "contact_alone",
    "continuation_coverage",
    "continuation_steps",
    "extremes",
    "fixed_points_basins",
    "fixed_points_scaling",
    "forms",
    "grazing",
    "histories",
    "jamming_wedge",
    "one_certificate",
    "peers",
    "proven_graphs",
    "requirements",
    "same_body_by_other_codes",
    "samples_vs_graph",
    "search_in_3d",
    "search_in_3d_choices",
    "search_size",
    "stability",
    "uniqueness_vs_mesh",
    "workers",
)
#: Studies that read the peak memory from /proc.
LINUX = ("fixed_points_scaling", "requirements")


def run(*command):
    """Output of a new process that imports the enumsol of this one; warnings are errors."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(Path(enumsol.__file__).parents[1])}
    command = [sys.executable, "-W", "error", *map(str, command)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def results():
    """Size and time of all results in the tree."""
    files = [file for file in STUDIES.glob("*/results/*") if file.is_file()]
    return {file: (file.stat().st_size, file.stat().st_mtime_ns) for file in files}


def names(folder, suffix):
    return {file.name for file in folder.iterdir() if file.suffix == suffix}


def rows_of(file):
    with file.open(encoding="utf-8") as table:
        return list(csv.DictReader(table))


def on_this_platform(name, seldom=()):
    marks = [pytest.mark.long] * (name in seldom)
    if name in LINUX:
        marks.append(pytest.mark.skipif(sys.platform != "linux", reason="peak memory is read from /proc"))
    return pytest.param(name, marks=marks)


@pytest.mark.slow
@pytest.mark.parametrize("name", [on_this_platform(name, LONG) for name in NAMES])
def test_a_study_runs_at_its_smoke_size(name, tmp_path):
    before = results()
    versions = ("--rounds", "1", "--against", sys.executable) if name in VERSIONS else ()
    output = run(STUDIES, name, "--smoke", "--results", tmp_path, *versions)
    for text in CONCLUSIONS.get(name, ()):
        assert text in output
    committed = STUDIES / name / "results"
    assert names(tmp_path, ".csv") == names(committed, ".csv")
    assert bool(names(tmp_path, ".png")) == bool(names(committed, ".png"))
    assert bool(names(tmp_path, ".json")) == (name in VERSIONS)
    for file in names(tmp_path, ".csv"):
        rows = rows_of(tmp_path / file)
        assert rows
        assert all(None not in row and None not in row.values() for row in rows)
    if name in PEERS:
        library, sentence, _ = PEERS[name]
        assert (sentence in output) == (find_spec(library) is None)
    assert results() == before


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", [on_this_platform(name) for name in PEERS])
def test_a_study_without_its_peer_does_the_rest_and_says_so(name, tmp_path):
    library, sentence, column = PEERS[name]
    hidden = (
        f"import sys, runpy; sys.modules[{library!r}] = None; runpy.run_path({str(STUDIES)!r}, run_name='__main__')"
    )
    output = run("-c", hidden, name, "--smoke", "--results", tmp_path)
    assert sentence in output.splitlines()
    rows = rows_of(tmp_path / f"{name}.csv")
    assert rows
    assert all(int(row[column]) > 0 for row in rows)


@pytest.mark.long
def test_one_part_of_a_study(tmp_path):
    run(STUDIES, "samples_vs_graph", "--smoke", "--results", tmp_path, "--part", "thin")
    assert {file.name for file in tmp_path.iterdir()} == {"branch_thin.csv", "branch_thin.txt", "branch_thin.png"}


@pytest.mark.long
def test_a_smoke_run_without_a_folder_leaves_the_results_alone(tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    before = results()
    run(STUDIES, "condensation_cost", "--smoke")
    assert results() == before
    assert {file.name for file in tmp_path.glob("condensation_cost*/*.csv")} == {"condensation.csv", "loads.csv"}


def test_without_a_name_the_questions_are_listed():
    lines = run(STUDIES).splitlines()
    for name in NAMES:
        (line,) = [line for line in lines if line.startswith(f"{name} ")]
        assert line.endswith("?")


def test_an_unknown_study_is_refused():
    done = subprocess.run([sys.executable, STUDIES, "nothing"], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "there is no study 'nothing'" in done.stderr
    assert all(name in done.stdout for name in NAMES)
