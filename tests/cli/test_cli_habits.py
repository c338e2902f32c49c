"""What all verbs share: --quiet, --json, exit statuses in one table, completion, an estimate of the time left."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from cli.test_cli_solve import BODY, TOML

from enumsol import gallery
from enumsol.cli import main
from enumsol.cli.app import app
from enumsol.cli.common import ExitStatus
from enumsol.cli.graph import build
from enumsol.cli.options import problem_names
from enumsol.cli.progress import Display, remaining
from enumsol.support.deadlines import tell

SQUARE = "gallery:two-node-6.4"


@pytest.fixture
def proof(tmp_path, capsys):
    assert main(["roots", SQUARE, "--alpha", "3.5", "--proof", str(tmp_path / "square.proof")]) == 0
    capsys.readouterr()
    return str(tmp_path / "square.proof")


def verbs(proof, folder):
    (folder / "body.msh").write_text(BODY)
    (folder / "body.toml").write_text(TOML)
    points = str(folder / "points.csv")
    assert main(["follow", SQUARE, "--from", "0", "--to", "10", "--start", "3.5", "--csv", points, "--quiet"]) == 0
    return {
        "roots": ["roots", SQUARE, "--alpha", "3.5"],
        "solve": ["solve", str(folder / "body.toml"), "--alpha", "0.5"],
        "table": ["table", SQUARE, "--alphas", "1,3.5"],
        "graph": ["graph", SQUARE, "--from", "0", "--to", "10"],
        "report": ["report", SQUARE, "--from", "0", "--to", "10", "-o", str(folder / "page.html")],
        "follow": ["follow", SQUARE, "--from", "0", "--to", "10", "--start", "3.5"],
        "audit": ["audit", SQUARE, points, "--from", "0", "--to", "10"],
        "fixed-point": ["fixed-point", SQUARE, "--alpha", "1"],
        "history": ["history", SQUARE, "--steps", "1,0.5"],
        "verify": ["verify", SQUARE, proof],
        "gallery write": ["gallery", "write", "two-node-6.4", str(folder / "square.npz")],
        "gallery list": ["gallery", "list"],
        "collection check": ["collection", "check", answers(folder)],
        "collection export": ["collection", "export", str(folder / "collection"), "triangle-3"],
        "collection list": ["collection", "list"],
    }


def answers(folder):
    file = folder / "triangle-3.json"
    file.write_text('{"lambda_n": [0], "lambda_t": [0]}')
    return str(file)


@pytest.mark.slow
def test_every_verb_can_be_quiet_and_writes_json(proof, tmp_path, capsys):
    pytest.importorskip("plotly")
    commands = verbs(proof, tmp_path)
    names = [item.name for item in app.registered_commands]
    names += [
        f"{group.name} {item.name or item.callback.__name__.strip('_')}"
        for group in app.registered_groups
        for item in group.typer_instance.registered_commands
    ]
    assert sorted(commands) == sorted(names)
    for name, command in commands.items():
        file = tmp_path / "result.json"
        status = main([*command, "--json", str(file)])
        said = capsys.readouterr()
        assert said.out, name
        json.loads(file.read_text())
        if name.endswith(" list"):
            continue  # it has nothing to say but its list
        assert main([*command, "--quiet" if len(name) % 2 else "-q"]) == status, name
        assert capsys.readouterr() == ("", ""), name
        assert main(command) == status, name
        assert capsys.readouterr() == said, name  # loud again


def test_json_of_a_proof_and_of_the_gallery(proof, capsys):
    assert main(["verify", SQUARE, proof, "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["ok"], found["complete"], found["alpha"]) == (True, True, 3.5)
    assert found["fingerprint"] == gallery.get("two-node-6.4").build().fingerprint
    assert main(["gallery", "list", "--json", "-"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert [entry["name"] for entry in listed] == list(gallery.GALLERY)


def test_quiet_commands_still_say_what_is_wrong(capsys):
    assert main(["roots", "nowhere.npz", "--alpha", "1", "--quiet"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert "no such file" in err


def test_the_table_of_exit_statuses_is_complete():
    text = (Path(__file__).parents[2] / "docs" / "command_line.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d+) \| `(\w+)` \|", text, re.MULTILINE)
    assert [(int(number), name) for number, name in rows] == [(status.value, status.name) for status in ExitStatus]


@pytest.mark.few(0, 1)
@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("enumsol re", {"report"}),
        ("enumsol roots wedge-14", {"wedge-14-3", "wedge-14-5"}),
        ("enumsol graph x --arith", {"--arithmetic"}),
    ],
)
def test_completion(words, expected):
    environment = {
        **os.environ,
        "_ENUMSOL_COMPLETE": "complete_bash",
        "COMP_WORDS": words,
        "COMP_CWORD": str(len(words.split()) - 1),
    }
    done = subprocess.run(
        [sys.executable, "-c", "import enumsol.cli; enumsol.cli.main()"],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert set(done.stdout.split()) == expected, done.stderr


def test_files_and_problems_are_completed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("block.npz", "block.txt", "blocks.h5"):
        (tmp_path / name).touch()
    (tmp_path / "block.dir").mkdir()
    assert problem_names("block") == [
        "block.dir",
        "block.npz",
        "blocks.h5",
        "block-on-table-5",
        "block3d-4",
        "block3d-9",
        "block3d-16",
        "block3d-100",
    ]
    assert problem_names("gallery:chain-2") == ["gallery:chain-2", "gallery:chain-2-coupled"]
    assert problem_names("[") == []


@pytest.mark.parametrize(
    ("seconds", "share", "expected"),
    [
        (10, 0.5, ", about 10 s left"),
        (10, 0.01, ""),
        (10, 1.0, ""),
        (60, 0.2, ", about 4 min left"),
        (3600, 0.1, ", about 9 h left"),
    ],
)
def test_the_time_that_is_left(seconds, share, expected):
    assert remaining(seconds, share) == expected


def test_a_bar_goes_on_between_two_reports(monkeypatch):
    clock = [0.0]
    monkeypatch.setattr("enumsol.cli.progress.time.perf_counter", lambda: clock[0])
    display, said = Display("graph"), []
    for now, share, step in ((4.0, 0.5, "search"), (10.0, 1.0, "search"), (12.0, 0.0, "arcs"), (20.0, 0.5, "arcs")):
        clock[0] = now
        display.show(share, step, (step, 0.0, 1.0))
        said.append(display.counts())
    for clock[0] in (25.0, 29.0):
        said.append(display.counts())
    assert said == [
        "search  4 s, about 4 s left of this step",
        "search  10 s",
        "arcs  12 s",
        "arcs  20 s, about 8 s left of this step",
        "arcs  25 s, about 3 s left of this step",
        "arcs  29 s",
    ]


def test_what_a_long_call_tells_stands_behind_the_bar_until_the_next_report(monkeypatch):
    clock = [0.0]
    monkeypatch.setattr("enumsol.cli.progress.time.perf_counter", lambda: clock[0])
    said = []
    with Display("checking", {"leaves": (0.0, 0.5)}) as display:
        tell("factors of A")
        said.append(display.counts())
        tell("columns of S in rationals", 12, 34)
        said.append(display.counts())
        clock[0] = 10.0
        tell("leaves", 2_500, 10_000)
        said.append(display.counts())
        tell("columns of S in rationals", 0, 34)
        said.append(display.counts())
        assert display._completed == 0.125
        display.show(0.5, "nodes 7")
        said.append(display.counts())
    tell("leaves", 1, 1)
    assert display._completed == 0.5
    assert said == [
        "factors of A  0 s",
        "12 of 34 columns of S in rationals  0 s",
        "2,500 of 10,000 leaves  10 s, about 30 s left of this step",
        "2,500 of 10,000 leaves, 0 of 34 columns of S in rationals  10 s, about 30 s left of this step",
        "nodes 7  10 s",
    ]


def test_a_bar_appears_although_nothing_is_told(monkeypatch):
    shown = []

    class Bar:
        def update(self, _, completed):
            shown.append(completed)

        start = stop = lambda self: None

    class Now:
        """A timer whose time is over at once."""

        def __init__(self, _, call):
            self.start, self.cancel = call, lambda: None

    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    monkeypatch.setattr("enumsol.cli.progress._PROGRESS_DELAY", 0.0)
    monkeypatch.setattr("enumsol.cli.progress.Timer", Now)
    monkeypatch.setattr("enumsol.cli.progress._progress_bar", lambda *_: (Bar(), 0))
    with Display("assembling") as display:
        assert shown == [0.0]
    display._draw()  # by a timer that was late
    assert shown == [0.0]


@pytest.mark.slow
def test_the_bar_of_a_graph_never_falls_back_nor_is_full_before_the_end(monkeypatch):
    done, stages = [], []
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    monkeypatch.setattr("enumsol.cli.progress._PROGRESS_DELAY", 0.0)

    class Bar:
        def update(self, _, completed):
            done.append(completed)

        def start(self):
            pass

        stop = start

    monkeypatch.setattr("enumsol.cli.progress._progress_bar", lambda *_: (Bar(), 0))
    monkeypatch.setattr(
        Display,
        "show",
        lambda self, share, note, step, show=Display.show: (stages.append(note), show(self, share, note, step)),
    )
    build(gallery.taper(4, 4), (0.0, 0.3))
    assert list(dict.fromkeys(stages)) == ["step 1 of 2, search", "step 2 of 2, arcs"]
    assert done == sorted(done)
    assert done[-1] < 1.0
