"""Line 10: `graph --plot` after a cut does not end in a traceback."""

import pytest
from command_line import run

#: Among them graphs without any arc, with arcs that end in the middle, and with a continuum.
NAMES = ("one-node-6.1", "one-node-6.3", "two-node-6.4", "two-node-6.7-minus", "clamped-block-8")


def draw(capsys, tmp_path, name, *options):
    file = tmp_path / "graph.png"
    status, out, err = run(capsys, "graph", f"gallery:{name}", "--from", 0, "--to", 10, "--plot", file, *options)
    assert err == ""
    assert file.read_bytes().startswith(b"\x89PNG")
    return status, out


@pytest.mark.few(2)
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("nodes", [1, 2, 5, 7])
def test_after_so_many_nodes(capsys, tmp_path, tree_only, name, nodes):
    quantity = "lambda_n" if nodes != 2 else "u_t"
    status, out = draw(capsys, tmp_path, name, "--max-nodes", nodes, "--quantity", quantity)
    assert status == 3
    assert out.splitlines()[-1].startswith(f"complete: no (stopped after max_nodes = {nodes} node")


def test_after_no_time(capsys, tmp_path):
    status, out = draw(capsys, tmp_path, "two-node-6.4", "--time-limit", 1e-9)
    assert status == 3
    assert out.splitlines()[-1].startswith("complete: no (stopped by the time limit")


def test_after_ctrl_c(capsys, tmp_path, monkeypatch):
    calls = []

    def interrupt(*state):
        calls.append(state)
        if len(calls) == 1:
            raise KeyboardInterrupt

    # the first word of progress comes from the search
    monkeypatch.setattr("enumsol.cli.progress.Display.show", interrupt)
    status, out = draw(capsys, tmp_path, "wedge-8-5")
    assert calls
    assert status == 130
    assert out.splitlines()[-1].startswith("complete: no (interrupted after ")
