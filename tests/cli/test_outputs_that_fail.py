"""`> /dev/full` and a closed pipe give one line, at every verb and every output option."""

import json
import os
import subprocess
import sys
from itertools import product
from pathlib import Path

import pandas as pd
import pytest
from command_line import assert_one_line, run
from refusals import refusal

import enumsol
from enumsol import gallery
from enumsol.cli.app import app
from enumsol.cli.output import deliver
from enumsol.cli.progress import guarded_streams

FULL = "/dev/full"
GALLERY = "gallery:one-node-6.1"
MESH = Path(__file__).parents[1] / "fem" / "meshes" / "block.22.msh"
pytestmark = pytest.mark.skipif(not os.path.exists(FULL), reason="this system has no device that is always full")


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A directory with a graph, a proof and points of the problem, and names of figures that lead to a full disk."""
    place = tmp_path_factory.mktemp("outputs")
    graph = enumsol.branch_graph(gallery.get("one-node-6.1").build(), (0.0, 5.0))
    graph.save(place / "graph.json")
    graph.proof.save(place / "graph.proof")
    path = enumsol.follow(graph.problem, graph.starting_points()[0], interval=(0.0, 5.0))
    path.to_frame().to_csv(place / "points.csv", index=False)
    (place / "triangle-3.csv").write_text("node,lambda_n,lambda_t\n0,0,0\n")
    (place / "directory").mkdir()
    for name in ("full.png", "full.pdf", "full.svg", "full.npz", "full.h5", "directory/A.mtx"):
        (place / name).symlink_to(FULL)
    return place


def enumsol_command(place, *arguments, **streams):
    """The command in a process of its own; streams that are not given are read to their ends."""
    options = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **streams}
    command = [sys.executable, "-m", "enumsol", *map(str, arguments)]
    return subprocess.run(command, cwd=place, text=True, check=False, timeout=300, **options)


#: What each verb prints; ``--json`` and ``--csv`` are written in one place for all of them.
PRINTING = {
    "nothing": (),
    "help": ("--help",),
    "version": ("--version",),
    "roots": ("roots", GALLERY, "--alpha", 5),
    "roots json": ("roots", GALLERY, "--alpha", 5, "--json", "-"),
    "roots csv": ("roots", GALLERY, "--alpha", 5, "--csv", "-"),
    "solve dry run": ("solve", MESH, "--contact", "floor", "--young", 1, "--poisson", 0, "--clamp", "lid", "--dry-run"),
    "table": ("table", GALLERY, "--alphas", "1,2"),
    "graph": ("graph", GALLERY, "--no-stability", "--from", 0, "--to", 5),
    "graph json": ("graph", GALLERY, "--no-stability", "--from", 0, "--to", 5, "--json", "-"),
    "report": ("report", GALLERY, "--no-stability", "--from", 0, "--to", 5, "-o", "page.html"),
    "follow": ("follow", GALLERY, "--from", 0, "--to", 5, "--start", 1),
    "audit": ("audit", GALLERY, "points.csv", "--graph", "graph.json"),
    "fixed-point": ("fixed-point", GALLERY, "--alpha", 1),
    "history": ("history", GALLERY, "--steps", "1,0.5"),
    "verify": ("verify", GALLERY, "graph.proof"),
    "gallery": ("gallery",),
    "gallery list": ("gallery", "list"),
    "gallery write": ("gallery", "write", "one-node-6.1", "problem.npz"),
    "collection list": ("collection", "list"),
    "collection export": ("collection", "export", "exported", "triangle-3"),
    "collection check": ("collection", "check", "triangle-3.csv"),
}


#: Runs each command in a process of its own, once for each kind of stdout. It begins with the libraries loaded that the
#: commands import, and ends as any process does.
DRIVER = """
import contextlib, gc, io, json, os, sys
import enumsol, pandas
from enumsol.cli import main

enumsol.branch_graph, enumsol.follow, enumsol.verify
with contextlib.redirect_stdout(io.StringIO()):
    main(["--help"])
    for verb in ("roots --alpha 5", "table --alphas 1", "report --from 0 --to 1 -o page.html", "fixed-point --alpha 1"):
        name, *options = verb.split()
        main([name, "gallery:one-node-6.1", *options])
commands = json.loads(sys.argv[1])
gc.freeze()  # or every process would touch, and so copy, all objects when it ends
for where, name, arguments in commands:
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        break
    os.close(writing)
    with open(reading) as errors:
        said = errors.read()
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    sys.stdout.write(json.dumps([where, name, status, said]) + chr(10))
    sys.stdout.flush()
else:
    sys.exit()
os.dup2(writing, 2)
if where == "full":
    os.dup2(os.open("/dev/full", os.O_WRONLY), 1)
else:
    unread, written = os.pipe()
    os.close(unread)
    os.dup2(written, 1)
sys.exit(main(arguments))
"""


@pytest.fixture(scope="module")
def outcomes(place):
    """Statuses and what stderr got, by kind of stdout and name of the command."""
    commands = [
        (where, name, [str(part) for part in arguments])
        for where, (name, arguments) in product(("full", "unread"), PRINTING.items())
    ]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", DRIVER, json.dumps(commands)], cwd=place, env=environment, text=True,
        check=True, capture_output=True, timeout=600,
    )  # fmt: skip
    return {(where, name): (status, said) for where, name, status, said in map(json.loads, done.stdout.splitlines())}


@pytest.mark.slow
@pytest.mark.parametrize("name", PRINTING)
@pytest.mark.parametrize(
    ("where", "said", "status"),
    [
        ("full", "stdout cannot be written (No space left on device)", 74),
        ("unread", "stdout was closed by its reader", 141),
    ],
)
def test_stdout_on_a_full_disk_or_that_nobody_reads(outcomes, where, said, status, name):
    ended, err = outcomes[where, name]
    assert_one_line(err, said)
    assert ended == status


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", ["help", "roots csv"])
def test_stdout_on_a_full_disk_from_a_shell(place, name):
    with open(FULL, "w") as full:
        done = enumsol_command(place, *PRINTING[name], stdout=full)
    assert_one_line(done.stderr, "stdout cannot be written (No space left on device)")
    assert done.returncode == 74


@pytest.mark.parametrize("binary", [False, True])
def test_a_stream_that_failed_says_so_of_all_that_follows_but_not_at_exit(monkeypatch, binary):
    # as at exit, what is left in the buffer is written when the file is closed
    with open(FULL, "w") as full:
        monkeypatch.setattr(sys, "stdout", full)
        with guarded_streams():
            stream, text = (sys.stdout.buffer, b"text") if binary else (sys.stdout, "text")
            assert stream.write(text[:0]) == 0
            assert stream.write(text) == len(text)
            for call in (stream.flush, lambda: stream.write(text), lambda: stream.write(text)):
                refusal(enumsol.OutputError, r"stdout cannot be written \(No space left on device\)", call)


def test_a_stream_that_nobody_reads_any_more(monkeypatch):
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w", buffering=1) as unread:
        monkeypatch.setattr(sys, "stdout", unread)
        with guarded_streams():
            message = "stdout was closed by its reader before everything was written"
            refusal(enumsol.OutputError, message, sys.stdout.write, "a line" + os.linesep)


def test_nothing_is_said_of_a_full_stderr(monkeypatch):
    with open(FULL, "w", buffering=1) as full:
        monkeypatch.setattr(sys, "stderr", full)
        with guarded_streams():
            assert [sys.stderr.write(text) for text in ("one" + os.linesep, "two")] == [4, 3]
            sys.stderr.flush()


def closing(*streams):
    """For a new process: some of its streams are closed before it begins."""

    def close():
        for stream in streams:
            os.close(stream)

    return {"preexec_fn": close, **{name: None for k, name in ((1, "stdout"), (2, "stderr")) if k in streams}}


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", ["nothing", "roots", "roots json", "gallery list"])
def test_stdout_that_was_closed(place, name):
    done = enumsol_command(place, *PRINTING[name], **closing(1))
    assert_one_line(done.stderr, "stdout is closed")
    assert done.returncode == 74


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", ["help", "roots", "graph", "verify"])
def test_stderr_that_was_closed_or_is_full_is_not_missed(place, name):
    expected = enumsol_command(place, *PRINTING[name])
    without = enumsol_command(place, *PRINTING[name], **closing(2))
    with open(FULL, "w") as full:
        on_full = enumsol_command(place, *PRINTING[name], stderr=full)
    assert (without.returncode, on_full.returncode) == (expected.returncode,) * 2
    lines = [[x for x in run.stdout.splitlines() if "seconds" not in x] for run in (expected, without, on_full)]
    assert lines[0] == lines[1] == lines[2]


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("arguments", [("rots",), ("roots", "gallery:nothing", "--alpha", 5)])
def test_a_mistake_keeps_its_status_when_there_is_nowhere_to_tell_it(place, arguments):
    with open(FULL, "w") as full:
        assert enumsol_command(place, *arguments, stdout=full, stderr=full).returncode == 2
    assert enumsol_command(place, *arguments, **closing(1, 2)).returncode == 2


#: Every option that writes a file, at every verb that has it.
WRITING = [
    (verb, option, file)
    for verb, options in (
        ("roots", ("--json", "--csv", "--proof")),
        ("table", ("--json", "--csv")),
        ("graph", ("--json", "--csv", "--proof", "--save", "--graphml", "--plot")),
        ("follow", ("--json", "--csv", "--plot")),
        ("audit", ("--json", "--csv")),
    )
    for option in options
    for file in (("full.png", "full.pdf", "full.svg") if option == "--plot" else (FULL,))
]


@pytest.mark.few(4, 3)
@pytest.mark.parametrize(("verb", "option", "file"), WRITING)
def test_a_file_on_a_full_disk(place, capsys, monkeypatch, verb, option, file):
    monkeypatch.chdir(place)
    _, expected, _ = run(capsys, *PRINTING[verb])
    status, out, err = run(capsys, *PRINTING[verb], option, file)
    assert_one_line(err, f"{file} cannot be written", "(No space left on device)")
    assert status == 74
    # the result was printed all the same
    assert out.splitlines()[-1] == expected.splitlines()[-1]


@pytest.mark.parametrize("file", ["full.npz", "directory"])
def test_gallery_write_on_a_full_disk(place, capsys, monkeypatch, file):
    monkeypatch.chdir(place)
    status, out, err = run(capsys, "gallery", "write", "one-node-6.1", file)
    assert_one_line(err, f"path {file} cannot be written (No space left on device)")
    assert (status, out) == (74, "")


def test_an_fclib_file_on_a_full_disk(place):
    pytest.importorskip("h5py")
    problem, message = gallery.one_node_triangle(), r"full\.h5 cannot be written \(No space left on device\)"
    problem = problem.replace(friction=0.3, friction_slope=0)
    refusal(enumsol.OutputError, message, enumsol.write_problem, problem, place / "full.h5")


@pytest.mark.slow
def test_one_output_that_fails_keeps_no_other_back(place, tmp_path):
    good = {name: tmp_path / f"graph.{name}" for name in ("csv", "graphml", "proof", "png")}
    with open(FULL, "w") as full:
        done = enumsol_command(
            place,
            *(*PRINTING["graph"], "--json", FULL, "--csv", good["csv"], "--save", "full.png"),
            *("--graphml", good["graphml"], "--proof", good["proof"], "--plot", good["png"]),
            stdout=full,
        )
    assert done.returncode == 74
    assert_one_line(done.stderr, "stdout cannot be written", f"{FULL} cannot be written", "full.png cannot be written")
    assert all(file.stat().st_size > 0 for file in good.values())


def test_a_place_that_is_gone_after_the_search_keeps_no_other_back(tmp_path):
    file, gone = tmp_path / "r.csv", tmp_path / "gone" / "r.json"
    made = {"text": lambda: "", "content": lambda: "{}", "frame": pd.DataFrame}
    message = r"gone/r\.json cannot be written"
    refusal(enumsol.OutputError, message, deliver, json_file=str(gone), csv_file=str(file), **made)
    assert file.exists()


def test_all_places_that_are_gone_are_named(tmp_path):
    files = [str(tmp_path / "gone" / name) for name in ("r.json", "r.csv")]
    made = {"text": lambda: "", "content": lambda: "{}", "frame": pd.DataFrame}
    message = r"gone/r\.json cannot be written .*; .*gone/r\.csv cannot be written"
    refusal(enumsol.OutputError, message, deliver, json_file=files[0], csv_file=files[1], **made)


@pytest.mark.slow
def test_json_is_written_when_nobody_reads_stdout(place, tmp_path):
    reading, writing = os.pipe()
    os.close(reading)
    done = enumsol_command(place, *PRINTING["roots"], "--json", tmp_path / "r.json", stdout=writing)
    os.close(writing)
    assert done.returncode == 141
    assert json.loads((tmp_path / "r.json").read_text())["complete"] is True


def test_a_proof_that_has_no_room_leaves_the_roots():
    entry, message = gallery.get("wedge-8-5"), "proof_path /dev/full cannot be written to the end"
    call = (enumsol.enumerate_roots, entry.build(), entry.alpha)
    partial = refusal(enumsol.OutputError, message, *call, proof_path=FULL).partial
    assert (len(partial), partial.complete, partial.proof) == (entry.roots, True, None)


def test_statuses_are_documented(capsys):
    for verb in (command.name for command in app.registered_commands):
        text = " ".join(run(capsys, verb, "--help")[1].split())
        if "Exit status: as enumsol" not in text:
            assert "74 if" in text, verb
            assert "141 if the program that read it has ended" in text, verb
