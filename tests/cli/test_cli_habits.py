"""What all verbs share: --quiet, --json, exit statuses in one table, completion, an estimate of the time left."""

import json
import os
import re
from pathlib import Path

import pytest
from cli.test_cli_solve import BODY, TOML
from cli.test_outputs_that_fail import PRINTING
from command_line import assert_refused, call, printed, run

from enumsol import gallery
from enumsol.cli import main, progress
from enumsol.cli.app import app
from enumsol.cli.common import ExitStatus
from enumsol.cli.graph import build
from enumsol.cli.options import problem_names
from enumsol.cli.progress import Display, remaining
from enumsol.support.deadlines import tell

ROOT = Path(__file__).parents[2]
SQUARE = "gallery:two-node-6.4"
#: A call of every verb, in a folder with the files that it reads.
VERBS = {
    "roots": "gallery:two-node-6.4 --alpha 3.5",
    "solve": "body.toml --alpha 0.5",
    "table": "gallery:two-node-6.4 --alphas 1,3.5",
    "graph": "gallery:two-node-6.4 --from 0 --to 10",
    "report": "gallery:two-node-6.4 --from 0 --to 10 -o page.html",
    "follow": "gallery:two-node-6.4 --from 0 --to 10 --start 3.5",
    "audit": "gallery:two-node-6.4 points.csv --from 0 --to 10",
    "fixed-point": "gallery:two-node-6.4 --alpha 1",
    "history": "gallery:two-node-6.4 --steps 1,0.5",
    "verify": "gallery:two-node-6.4 square.proof",
    "gallery write": "two-node-6.4 square.npz",
    "gallery list": "",
    "collection check": "triangle-3.json",
    "collection export": "collection triangle-3",
    "collection list": "",
}


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "body.msh").write_text(BODY)
    (tmp_path / "body.toml").write_text(TOML)
    (tmp_path / "triangle-3.json").write_text('{"lambda_n": [0], "lambda_t": [0]}')
    assert main(["roots", SQUARE, "--alpha", "3.5", "--proof", "square.proof", "--quiet"]) == 0
    return tmp_path


def registered():
    """The names of all verbs."""
    names = [item.name for item in app.registered_commands]
    return names + [
        f"{group.name} {item.name or item.callback.__name__.strip('_')}"
        for group in app.registered_groups
        for item in group.typer_instance.registered_commands
    ]


def test_every_verb_is_tried_and_shown_in_the_documents():
    """The tests that want a command of each are slow."""
    assert sorted(VERBS) == sorted(registered())
    tried = [[*map(str, command)] for command in PRINTING.values()]
    pages = "".join(page.read_text(encoding="utf-8") for page in (ROOT / "docs").glob("*.md"))
    for name in registered():
        words = name.split()
        assert any(command[: len(words)] == words for command in tried), f"PRINTING has no {name}"
        assert re.search(rf"enumsol {name}\b", pages), f"no page of docs/ shows enumsol {name}"


@pytest.mark.slow
def test_every_verb_can_be_quiet_and_writes_json(here, capsys):
    pytest.importorskip("plotly")
    assert main(f"follow --csv points.csv --quiet {VERBS['follow']}".split()) == 0
    for name, options in VERBS.items():
        command = f"{name} {options}".split()
        status = main([*command, "--json", "result.json"])
        said = capsys.readouterr()
        assert said.out, name
        json.loads((here / "result.json").read_text())
        if name.endswith(" list"):
            continue  # it has nothing to say but its list
        assert main([*command, "--quiet" if len(name) % 2 else "-q"]) == status, name
        assert capsys.readouterr() == ("", ""), name
        assert main(command) == status, name
        assert capsys.readouterr() == said, name  # loud again


def test_json_of_a_proof_and_of_the_gallery(here, capsys):
    found = json.loads(printed(capsys, "verify", SQUARE, "square.proof", "--json", "-"))
    assert (found["ok"], found["complete"], found["alpha"]) == (True, True, 3.5)
    assert found["fingerprint"] == gallery.get("two-node-6.4").build().fingerprint
    listed = json.loads(printed(capsys, "gallery", "list", "--json", "-"))
    assert [entry["name"] for entry in listed] == list(gallery.GALLERY)


def test_quiet_commands_still_say_what_is_wrong(capsys):
    assert_refused(*run(capsys, "roots", "nowhere.npz", "--alpha", 1, "--quiet"), "no such file")


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
    asked = {"_ENUMSOL_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(len(words.split()) - 1)}
    done = call(env={**os.environ, **asked})
    assert set(done.stdout.split()) == expected, done.stderr


def test_files_and_problems_are_completed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("block.npz", "block.txt", "blocks.h5"):
        (tmp_path / name).touch()
    (tmp_path / "block.dir").mkdir()
    files, ours = ["block.dir", "block.npz", "blocks.h5"], [f"block3d-{p}" for p in (4, 9, 16, 100)]
    assert problem_names("block") == [*files, "block-on-table-5", *ours]
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


@pytest.fixture
def clock(monkeypatch):
    """What the timer of a bar shows."""
    clock = [0.0]
    monkeypatch.setattr("enumsol.cli.progress.time.perf_counter", lambda: clock[0])
    return clock


def test_a_bar_goes_on_between_two_reports(clock):
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


def test_what_a_long_call_tells_stands_behind_the_bar_until_the_next_report(clock):
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


@pytest.fixture
def shown(monkeypatch):
    """What is shown by the bar of a terminal, which appears at once."""
    shown = []

    class Bar:
        def update(self, _, completed):
            shown.append(completed)

        start = stop = lambda self: None

    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    monkeypatch.setattr("enumsol.cli.progress._PROGRESS_DELAY", 0.0)
    monkeypatch.setattr("enumsol.cli.progress._progress_bar", lambda *_: (Bar(), 0))
    return shown


def test_what_stands_in_a_bar(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    said = iter(["2 of 8 nodes  1 s", "6 of 8 nodes  3 s"])
    bar, task = progress._progress_bar("searching", lambda: next(said))
    bar.update(task, completed=0.25)
    for text in ("25.00% 2 of 8 nodes  1 s", "75.00% 6 of 8 nodes  3 s"):
        bar.console.print(bar.get_renderable())
        line = capsys.readouterr().err
        assert line.startswith("searching ")
        assert line.rstrip().endswith(text)
        bar.update(task, completed=0.75)


def test_a_bar_appears_although_nothing_is_told(monkeypatch, shown):
    class Now:
        """A timer whose time is over at once."""

        def __init__(self, _, call):
            self.start, self.cancel = call, lambda: None

    monkeypatch.setattr("enumsol.cli.progress.Timer", Now)
    with Display("assembling") as display:
        assert shown == [0.0]
    display._draw()  # by a timer that was late
    assert shown == [0.0]


@pytest.mark.slow
def test_the_bar_of_a_graph_never_falls_back_nor_is_full_before_the_end(monkeypatch, shown):
    stages, show = [], Display.show
    monkeypatch.setattr(
        Display, "show", lambda self, share, note, step: stages.append(note) or show(self, share, note, step)
    )
    build(gallery.taper(4, 4), (0.0, 0.3))
    assert list(dict.fromkeys(stages)) == ["step 1 of 2, search", "step 2 of 2, arcs"]
    assert shown == sorted(shown)
    assert shown[-1] < 1.0
