"""The table's open, stick and slip columns and its header "alpha to alpha" say what they are."""

import re

from command_line import run

TABLE = ("table", "gallery:two-node-6.4", "--from", 0, "--to", 10)
CAPTION = "open, stick, slip+, slip-: how many of the roots have a node in that status"


def test_the_columns_are_explained_below_them(capsys):
    _, out, _ = run(capsys, *TABLE, "--samples", 3)
    lines = out.splitlines()
    assert re.split(r"\s+", lines[0].strip())[:2] == ["alpha", "roots"]
    for name in ("open", "stick", "slip+", "slip-"):
        assert name in lines[0].split()
    assert lines[4] == CAPTION
    assert len(lines) == 7  # heading, three rows, caption, blank, closing line


def test_rows_of_several_alphas_say_so(capsys):
    _, out, _ = run(capsys, *TABLE, "--samples", 101)
    lines = out.splitlines()
    assert lines[0].startswith("first alpha last alpha  roots")
    assert "to alpha" not in out
    assert CAPTION in lines
    assert "each row stands for all alphas tried from the first to the last, which have equal counts" in lines
    assert max(map(len, lines)) <= 90


def test_an_empty_table_explains_nothing(capsys, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("enumsol.branches.table.table_row", interrupt)
    status, out, _ = run(capsys, *TABLE, "--samples", 3)
    assert status == 130
    assert out == "\ncomplete: no (interrupted after 0 of 3 alphas)\n"
