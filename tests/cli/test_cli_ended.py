"""Commands that Ctrl-C ends while they load, and that run out of memory."""

import subprocess
import sys

import pytest
from command_line import assert_one_line, printed, run
from interruptions import CtrlC

from enumsol.branches import gluing
from enumsol.search.tree import TreeSearch

#: What the installed command does, with Ctrl-C pressed where a module begins to be loaded.
COMMAND = """
import importlib.abc, sys

class Pressed(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            print("loading", name, flush=True)
            raise KeyboardInterrupt

sys.meta_path.insert(0, Pressed())
sys.argv = [{command!r}, "roots", "gallery:one-node-6.3", "--alpha", "5"]
from enumsol.cli import main
sys.exit(main())
"""


def loaded(module, command="/usr/bin/enumsol"):
    """How the command ends."""
    source = COMMAND.format(module=module, command=command)
    return subprocess.run([sys.executable, "-c", source], capture_output=True, text=True, timeout=120, check=False)


@pytest.mark.parametrize("module", ["lazy_loader", "typer", "enumsol.roots.enumerate"])
def test_ctrl_c_while_modules_are_loaded_needs_no_traceback(module):
    ended = loaded(module)
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, f"loading {module}\n", "")


def test_a_program_that_loads_the_package_hears_of_ctrl_c():
    assert "KeyboardInterrupt" in loaded("lazy_loader", "a_program.py").stderr


def test_what_was_found_is_printed_where_the_memory_does_not_suffice(capsys, monkeypatch):
    examine, left = TreeSearch.examine, iter(range(20))

    def full(search, item):
        if next(left, None) is None:
            raise MemoryError
        return examine(search, item)

    monkeypatch.setattr(TreeSearch, "examine", full)
    status, out, err = run(capsys, "roots", "gallery:wedge-8-5", "--alpha", 2)
    assert status == 71
    assert "complete: no (out of memory after 22 nodes)" in out
    assert_one_line(err, "enumsol roots ran out of memory")


@pytest.mark.parametrize("command", [["roots", "--alpha", "1"], ["graph", "--from", "0", "--to", "1"]])
def test_a_lack_of_memory_is_told_in_one_sentence(capsys, monkeypatch, command):
    def full(*_):
        raise MemoryError

    monkeypatch.setattr("enumsol.cli.common._any_problem", full)
    status, out, err = run(capsys, command[0], "gallery:wedge-8-5", *command[1:])
    assert (status, out) == (71, "")
    assert_one_line(err, "the memory does not suffice")


def test_what_was_found_is_printed_on_ctrl_c_where_the_result_is_put_together(capsys, monkeypatch):
    monkeypatch.setattr(gluing, "make_vertices", CtrlC(then=gluing.make_vertices))
    out = printed(capsys, "graph", "gallery:one-node-6.3", "--from", "0", "--to", "5", status=130)
    assert "complete: no (interrupted after the arcs of 3 of 3 selections)" in out
