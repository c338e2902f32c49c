"""An attribute that does not exist is an error for mypy (`enumsol.enumerate_root`)."""

import subprocess
import sys
from pathlib import Path

import pytest

import enumsol

#: Of the package mypy reads no more than where names are looked for; what these are imported from is checked by itself.
CONFIG = """[mypy]
ignore_missing_imports = True
follow_imports = skip
[mypy-enumsol,enumsol.branches,enumsol.continuation,enumsol.errors]
follow_imports = silent
"""
PACKAGE = Path(enumsol.__file__).parent


@pytest.fixture(scope="module")
def complaints(tmp_path_factory):
    """What mypy says of every line of a program: the numbers of its lines and the messages."""
    place = tmp_path_factory.mktemp("types")
    lines = ["import enumsol", *WRONG, *(f"enumsol.{name}" for name in right())]
    file = place / "program.py"
    file.write_text("\n".join(lines) + "\n")
    (place / "mypy.ini").write_text(CONFIG)
    # beside the program lies the package under test, however it was installed
    (place / "enumsol").symlink_to(PACKAGE)
    command = [sys.executable, "-m", "mypy", "--config-file", "mypy.ini", file.name]
    done = subprocess.run(command, cwd=place, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1), done.stdout + done.stderr
    found = {}
    for line in done.stdout.splitlines():
        if line.startswith("program.py:"):
            _, number, kind, message = line.split(":", 3)
            assert kind.strip() in ("error", "note")
            found[lines[int(number) - 1]] = message
    return found


WRONG = (
    "enumsol.enumerate_root",
    "enumsol.branch_grap(None)",
    "enumsol.branches.branch_grap",
    "enumsol.continuation.folow",
    "enumsol.errors.NoSuchError",
)


def right():
    """Everything that is there."""
    return sorted({*enumsol.__all__, "branches.Arc", "branches.branch_graph"})


@pytest.mark.slow
@pytest.mark.parametrize("line", WRONG)
def test_what_does_not_exist_is_an_error(complaints, line):
    assert "has no attribute" in complaints[line]


@pytest.mark.slow
def test_a_name_that_is_close_is_suggested(complaints):
    assert '"enumerate_roots"' in complaints["enumsol.enumerate_root"]


@pytest.mark.slow
def test_what_exists_is_none(complaints):
    assert set(complaints) == set(WRONG)


def test_no_module_takes_any_name_for_its_own():
    """A ``__getattr__`` of a module is hidden from type checkers by a stub, wherever there is one."""
    found = 0
    for file in PACKAGE.rglob("*.py"):
        text = file.read_text()
        assert "\ndef __getattr__" not in text, file
        if "__getattr__, __dir__, __all__ = " in text:
            assert file.with_suffix(".pyi").exists(), file
            found += 1
    assert found >= 3
