"""No output takes the place of an input, of another output, or of a file of another kind: refused before any work."""

import os
import shutil
from pathlib import Path

import pytest
from command_line import assert_refused, call, run

import enumsol
from enumsol import gallery
from enumsol.cli.options import check_files

MESHES = Path(__file__).parents[1] / "fem" / "meshes"
BODY = ("--young", 2.5, "--poisson", 0.25, "--contact", "floor", "--clamp", "lid", "--friction", 0.3, "--alpha", 0)
TOML = 'mesh = "body.msh"\nyoung = 2.5\npoisson = 0.25\ncontact = "floor"\nclamp = "lid"\nsteps = "steps.csv"\n'


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A folder with inputs of all kinds, which is where commands run."""
    shutil.copy(MESHES / "block.22.msh", tmp_path / "body.msh")
    (tmp_path / "body.toml").write_text(TOML)
    (tmp_path / "steps.csv").write_text("alpha\n1\n")
    (tmp_path / "body.inp").write_text("*include, input=part.txt\n")
    (tmp_path / "part.txt").write_text("*node\n")
    problem = gallery.one_node_triangle()
    enumsol.write_problem(problem, tmp_path / "p.npz")
    enumsol.write_problem(problem, tmp_path / "mm")
    graph = enumsol.branch_graph(problem, (0, 5))
    graph.save(tmp_path / "g.json")
    graph.proof.save(tmp_path / "g.proof")
    (tmp_path / "points.csv").write_text("alpha,lambda_n_0,lambda_t_0\n1,0,0\n")
    (tmp_path / "answers").mkdir()
    (tmp_path / "answers" / "triangle-3.csv").write_text("node,lambda_n,lambda_t\n0,0,0\n")
    (tmp_path / "link").symlink_to("p.npz")
    os.link(tmp_path / "p.npz", tmp_path / "twin")
    (tmp_path / "notes.txt").write_text("My notes on contact.\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


ROOTS, GRAPH = ("roots", "p.npz", "--alpha", 5), ("graph", "p.npz", "--no-stability", "--from", 0, "--to", 5)
INPUTS = [
    *((*ROOTS, option, "p.npz") for option in ("--json", "--csv", "--report", "--proof")),
    *((*ROOTS, "--json", name) for name in ("./p.npz", "mm/../p.npz", "link", "twin")),
    ("roots", "link", "--alpha", 5, "--json", "p.npz"),
    ("roots", "mm", "--alpha", 5, "--csv", "mm/A.mtx"),
    ("roots", "mm", "--alpha", 5, "--csv", "mm/node_ids.json"),
    *((*GRAPH, option, "p.npz") for option in ("--json", "--csv", "--save", "--graphml", "--proof")),
    ("report", "p.npz", "--no-stability", "--from", 0, "--to", 5, "-o", "p.npz"),
    ("table", "p.npz", "--alphas", "1,2", "--csv", "p.npz"),
    ("history", "p.npz", "--steps", "steps.csv", "--csv", "steps.csv"),
    ("history", "body.toml", "--json", "steps.csv"),
    ("history", "body.toml", "--save", "body.msh"),
    ("solve", "body.msh", *BODY, "--report", "body.msh"),
    ("solve", "body.msh", *BODY, "--output", "body.msh"),
    ("solve", "body.toml", "--alpha", 1, "--json", "body.toml"),
    ("solve", "body.toml", "--alpha", 1, "--json", "body.msh"),
    ("solve", "body.inp", *BODY, "--json", "part.txt"),
    ("follow", "p.npz", "--from", 0, "--to", 5, "--start", 1, "--graph", "g.json", "--csv", "g.json"),
    ("audit", "p.npz", "points.csv", "--graph", "g.json", "--json", "g.json"),
    ("audit", "p.npz", "points.csv", "--graph", "g.json", "--csv", "points.csv"),
    ("fixed-point", "p.npz", "--alpha", 1, "--npz", "p.npz"),
    ("verify", "p.npz", "g.proof", "--json", "g.proof"),
    ("collection", "check", "answers", "--csv", "answers/triangle-3.csv"),
]


def test_what_stdin_reads_is_an_input(place):
    with (place / "points.csv").open() as points:
        done = call("audit", "p.npz", "-", "--graph", "g.json", "--csv", "points.csv", cwd=place, stdin=points)
    assert_refused(done.returncode, done.stdout, done.stderr, "which would replace /dev/stdin (POINTS)")
    assert "alpha,lambda_n_0" in (place / "points.csv").read_text()


def content(folder):
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


@pytest.mark.parametrize("arguments", INPUTS, ids=lambda arguments: f"{arguments[0]} {' '.join(arguments[-2:])}")
def test_no_output_is_an_input(place, capsys, arguments):
    before = content(place)
    assert_refused(*run(capsys, *arguments), f"{arguments[-1]}, which would replace", "expected another file")
    assert content(place) == before


@pytest.mark.parametrize(
    ("first", "second"), [("r.json", "r.json"), ("r.json", "./r.json"), ("old", "old"), ("old", "old-link")]
)
def test_no_output_is_another(place, capsys, first, second):
    (place / "old").write_text("")
    (place / "old-link").symlink_to("old")
    before = content(place)
    outputs = ("--json", first, "--csv", second)
    assert_refused(*run(capsys, *ROOTS, *outputs), f"--csv is {second}", f"--json is {first}", "expected two files")
    assert content(place) == before


def test_files_for_paraview_are_several(place, capsys):
    for name in ("body-0.vtu", "body.pvd"):
        (place / name).write_text("")
        assert_refused(*run(capsys, *ROOTS, "--vtu", "body.vtu", "--json", name), "the same file")


def test_letters_of_another_case(tmp_path, monkeypatch):
    given = [("--json", str(tmp_path / "r.json")), ("--csv", str(tmp_path / "R.json"))]
    check_files([], given)
    monkeypatch.setattr("enumsol.cli.options._folds", lambda folder: True)
    with pytest.raises(enumsol.InvalidArgumentError, match="the same file"):
        check_files([], given)


def test_what_is_no_file_may_be_named_twice(capsys):
    outputs = ("--json", os.devnull, "--csv", os.devnull)
    assert run(capsys, "roots", "gallery:one-node-6.1", "--alpha", 5, "-q", *outputs) == (0, "", "")


def test_a_result_replaces_the_one_before(place, capsys):
    for _ in range(2):
        outputs = ("--json", "r.json", "--csv", "r.csv", "--proof", "r.proof", "--report", "r.html")
        assert run(capsys, *ROOTS, "-q", *outputs) == (0, "", "")


@pytest.mark.parametrize(
    ("command", "option", "kind"),
    [
        (ROOTS, "--proof", "a proof"),
        ((*ROOTS, "--resume"), "--proof", "a proof"),
        (ROOTS, "--report", "an HTML page"),
        (GRAPH, "--proof", "a proof"),
        (GRAPH, "--save", "a saved graph or history"),
        (GRAPH, "--graphml", "a GraphML file"),
        (("report", "p.npz", "--no-stability", "--from", 0, "--to", 5), "--output", "an HTML page"),
        (("history", "p.npz", "--steps", "1"), "--save", "a saved graph or history"),
    ],
)
def test_a_file_of_another_kind_is_not_replaced(place, capsys, command, option, kind):
    before = content(place)
    message = (f"{option} is notes.txt, a file that is not {kind}", "expected a new name", "delete the file first")
    assert_refused(*run(capsys, *command, option, "notes.txt"), *message)
    assert content(place) == before


def test_every_command_checks_its_files():
    from enumsol.cli.app import app
    from enumsol.cli.options import FileCommand

    groups = [app, *(group.typer_instance for group in app.registered_groups)]
    commands = [command for group in groups for command in group.registered_commands]
    assert len(commands) >= 15
    assert all(command.cls is FileCommand for command in commands)
