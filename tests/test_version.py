"""`enumsol.__version__`."""

import runpy
import shutil
import subprocess
import sys
import tomllib
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import pytest
from command_line import run
from test_imports import modules_after

import enumsol
from enumsol import _version

PACKAGE = Path(enumsol.__file__).parent


def version_of(place):
    """What a package in this directory says of itself, in a new process."""
    code = "import enumsol; print(enumsol.__version__, enumsol.__file__)"
    done = subprocess.run([sys.executable, "-c", code], cwd=place, check=True, capture_output=True, text=True)
    found, file = done.stdout.split()
    assert Path(file).is_relative_to(place)
    return found


@pytest.fixture
def copied(tmp_path):
    """The modules that `import enumsol` and its version need, without metadata."""
    for name in ("__init__.py", "__init__.pyi", "_version.py"):
        (tmp_path / "enumsol").mkdir(exist_ok=True)
        shutil.copy(PACKAGE / name, tmp_path / "enumsol" / name)
    return tmp_path


def test_it_is_that_of_the_package():
    written = PACKAGE.with_name("pyproject.toml")
    if written.exists():
        assert enumsol.__version__ == tomllib.loads(written.read_text())["project"]["version"]
    else:
        assert enumsol.__version__ == version("enumsol")


def test_a_checkout_tells_its_own_and_not_that_of_an_installed_one(copied):
    (copied / "pyproject.toml").write_text('[project]\nname = "enumsol"\nversion = "7.8.9"\n')
    assert version_of(copied) == "7.8.9"


@pytest.mark.parametrize("text", ['[project]\nname = "another"\nversion = "7.8.9"\n', "no = toml = at all\n", ""])
def test_a_file_of_something_else_is_not_believed(copied, text):
    (copied / "pyproject.toml").write_text(text)
    assert version_of(copied) != "7.8.9"


def test_without_metadata_it_is_not_known(tmp_path, monkeypatch):
    def missing(name):
        raise PackageNotFoundError(name)

    monkeypatch.setattr(_version, "__file__", str(tmp_path / "enumsol" / "_version.py"))
    assert _version.find_version() != "0+unknown" or not _installed()
    monkeypatch.setattr(_version, "version", missing)
    assert _version.find_version() == "0+unknown"


def _installed():
    try:
        return bool(version("enumsol"))
    except PackageNotFoundError:
        return False


def test_it_is_found_when_it_is_asked_for_and_then_kept():
    needed = {"importlib.metadata", "tomllib", "enumsol._version"}
    before, after = modules_after("import enumsol"), modules_after("import enumsol; enumsol.__version__")
    assert not before & needed
    assert "enumsol._version" in after
    assert not after & {"numpy", "scipy"}


def test_the_command_says_the_same(capsys):
    assert run(capsys, "--version") == (0, f"enumsol {enumsol.__version__}\n", "")


def test_so_does_the_module(capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["enumsol", "--version"])
    with pytest.raises(SystemExit) as ended:
        runpy.run_module("enumsol", run_name="__main__")
    assert (ended.value.code, capsys.readouterr().out) == (0, f"enumsol {enumsol.__version__}\n")
