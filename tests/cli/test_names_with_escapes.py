"""What a terminal would obey in names from files and arguments is printed as text."""

import io
import json
import subprocess
import sys
import unicodedata

import pytest
from command_line import on_terminal, run

import enumsol
from enumsol import gallery
from enumsol.cli.progress import say
from enumsol.support.messages import visible

RED, TITLE, MIRRORED = "\x1b[31mred\x1b[0m", "\x1b]0;mine\x07", "a\u202eb"
FORGED = "x\ncomplete: yes (proven)"


def harmless(text):
    return all(c == "\n" or unicodedata.category(c) not in ("Cc", "Cf", "Cs", "Zl") for c in text)


def test_visible():
    assert visible("a label, \u00e4 \u00a0 \U0001f600") == "a label, \u00e4 \u00a0 \U0001f600"
    assert visible(RED + TITLE) == r"\x1b[31mred\x1b[0m\x1b]0;mine\x07"
    assert visible(MIRRORED + "\x9b\ud800\n\t\r") == r"a\u202eb\x9b\ud800\n\t\r"
    assert visible("a\nb\tc\x08", keep="\n\t") == "a\nb\tc\\x08"
    assert visible(3) == "3"


@pytest.fixture
def place(tmp_path, monkeypatch):
    problem = gallery.two_node_square().replace(node_ids=[RED + TITLE, FORGED])
    enumsol.write_problem(problem, tmp_path / "p.npz")
    (tmp_path / f"{RED}.npz").write_bytes((tmp_path / "p.npz").read_bytes())
    (tmp_path / f"{RED}.toml").write_text(f'"{RED}" = 1'.replace("\x1b", "\\u001b") + "\n")
    (tmp_path / "points.csv").write_text(f"alpha,{RED}\n1,2\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


COMMANDS = [
    ("roots", "p.npz", "--alpha", "5"),
    ("roots", f"{RED}.npz", "--alpha", "5"),
    ("roots", f"no{RED}.npz", "--alpha", "5"),
    ("roots", "p.npz", "--alpha", RED),
    ("roots", "p.npz", "--alpha", "5", f"--{RED}"),
    (RED,),
    ("graph", "p.npz", "--from", "0", "--to", "4", "--nodes", RED),
    ("fixed-point", "p.npz", "--alpha", "1"),
    ("follow", "p.npz", "--from", "0", "--to", "3", "--start", "1", "--node", MIRRORED),
    ("audit", "p.npz", "points.csv"),
    ("roots", f"{RED}.toml", "--alpha", "1"),
    ("gallery", "write", "one-node-6.1", f"{RED}2.npz"),
]


@pytest.mark.parametrize("arguments", COMMANDS, ids=range(len(COMMANDS)))
def test_nothing_reaches_the_terminal_that_it_obeys(place, capsys, arguments):
    _, out, err = run(capsys, *arguments)
    assert out + err
    assert harmless(out + err), repr(out + err)
    assert (out + err).splitlines().count("complete: yes (proven)") <= 1  # the label does not end the table


def test_labels_are_shown_in_tables(place, capsys):
    out = run(capsys, "roots", "p.npz", "--alpha", "5")[1]
    assert r"\x1b[31mred\x1b[0m" in out
    assert r"x\ncomplete: yes (proven) open" in out


def test_data_for_programs_stay_as_they_are(place, capsys):
    out = run(capsys, "roots", "p.npz", "--alpha", "5", "--csv", "-")[1]
    assert RED in out
    out = run(capsys, "roots", "p.npz", "--alpha", "5", "--json", "-")[1]
    assert json.loads(out)["node_ids"] == [RED + TITLE, FORGED]


@pytest.mark.slow
def test_an_error_on_a_terminal(place):
    with on_terminal("roots", f"no{RED}.npz", "--alpha", "5") as (_, wait_for):
        wait_for(rb"no\x1b[31mred\x1b[0m.npz")


def test_what_the_coding_of_the_output_lacks_is_an_escape(monkeypatch):
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", stream)
    say("\u00e4 \udc80")
    assert stream.buffer.getvalue() == b"\\xe4 \\udc80\n"


@pytest.mark.slow
def test_a_name_that_is_no_text(tmp_path):
    command = [sys.executable.encode(), b"-m", b"enumsol", b"roots", b"\xff.npz", b"--alpha", b"5"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith(b"enumsol: error: \\udcff.npz: there is no such file")


def test_pages_hold_names_as_text(tmp_path):
    name = "</script><script>alert(1)</script>"
    graph = enumsol.branch_graph(gallery.two_node_square().replace(node_ids=[name, "b"]), (0, 4))
    pages = []
    for title in (name, "plain"):
        enumsol.write_report(graph, tmp_path / "page.html", title=title)
        pages.append((tmp_path / "page.html").read_text())
    assert all("<script>alert" not in page for page in pages)
    assert pages[0].count("</script") == pages[1].count("</script")
    assert "alert(1)" in pages[0]
