"""Part F, line 11: without the compiled modules the warning says what is the case and what to do.

A checkout in which nothing is compiled hides the installed package from a Python that is started in it.
"""

import json
import os
import shutil
import subprocess
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

import pytest

import enumsol
from enumsol import MissingDependencyError, enumerate_roots, gallery
from enumsol.support import compiled

PACKAGE = Path(enumsol.__file__).parent
MODULE = "enumsol.relaxation._active_set"
PLACE = Path("enumsol", "relaxation")
BUILT = f"_active_set{EXTENSION_SUFFIXES[0]}"
CODE = """
import sys, warnings
from pathlib import Path
import enumsol
assert Path(enumsol.__file__).parent.parent == Path.cwd(), enumsol.__file__
problem = enumsol.gallery.one_node_triangle()
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    assert len(enumsol.enumerate_roots(problem, 5.0, "fast")) == 3
print(*(str(item.message) for item in caught), sep="\\n")
for call, argument, options in (
    (enumsol.branch_graph, (0, 1), {}),
    (enumsol.enumerate_roots, 1, {"engine": "active-set"}),
):
    try:
        call(problem, argument, **options)
    except enumsol.MissingDependencyError as error:
        print(error)
"""


@pytest.fixture
def checkout(tmp_path):
    """The source of the package as it is in a new clone."""
    root = tmp_path / "checkout"
    shutil.copytree(PACKAGE, root / "enumsol", ignore=shutil.ignore_patterns("*.so", "*.pyd", "__pycache__"))
    (root / "pyproject.toml").touch()
    return root


def whole_package(root):
    """What Python needs to see to find a package with its compiled module."""
    (root / PLACE).mkdir(parents=True)
    (root / "enumsol" / "__init__.py").touch()
    (root / PLACE / BUILT).touch()
    return root


def run_in(checkout, *path):
    """Lines printed by a Python that is started in the checkout and searches ``path`` next."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, path))}
    done = subprocess.run(
        [sys.executable, "-c", CODE], cwd=checkout, env=environment, check=True, capture_output=True, text=True
    )
    return done.stdout.splitlines()


def assert_sentences(lines, *parts):
    # the warning of the search, the errors of the graph and of the engine asked for
    assert len(lines) == 3
    assert lines[0].startswith("the compiled active-set solver is not available: ")
    assert lines[0].endswith("; the much slower interior-point solver is used")
    for line in lines:
        for part in parts:
            assert part in line
        assert "install a C compiler" not in line


def test_a_checkout_that_hides_the_installed_package_says_so(checkout, tmp_path):
    site = whole_package(tmp_path / "site")
    assert_sentences(
        run_in(checkout, site),
        f"enumsol was imported from {checkout / 'enumsol'}, where it is not compiled for this Python",
        f"the package in {site / 'enumsol'} is",
        f"start Python in another directory than {checkout} or with the option -P",
    )


def test_a_package_installed_in_place_is_found_by_its_metadata(checkout, tmp_path):
    """pip install -e leaves no directory of that name on the path, only a note of where it is."""
    other = whole_package(tmp_path / "my sources")
    notes = tmp_path / "site" / "enumsol-0.1.0.dist-info"
    notes.mkdir(parents=True)
    (notes / "METADATA").write_text("Metadata-Version: 2.1\nName: enumsol\nVersion: 0.1.0\n")
    (notes / "direct_url.json").write_text(json.dumps({"url": other.as_uri(), "dir_info": {"editable": True}}))
    assert_sentences(run_in(checkout, notes.parent), f"the package in {other / 'enumsol'} is")


@pytest.fixture
def place(tmp_path, monkeypatch):
    """The package as if imported from an empty directory, with no other one anywhere."""
    (tmp_path / PLACE).mkdir(parents=True)
    monkeypatch.setattr(compiled, "__file__", str(tmp_path / "enumsol" / "compiled.py"))
    monkeypatch.setattr(compiled, "_roots", lambda package: iter([tmp_path, tmp_path / package]))
    return tmp_path


def reason():
    text = compiled.why_missing(MODULE, ImportError("undefined symbol:\n  exp"))
    assert "\n" not in text
    return text


def test_a_checkout_alone_says_how_to_compile_it(place):
    (place / "pyproject.toml").touch()
    assert reason() == (
        f"enumsol was imported from its source in {place}, where nothing is compiled "
        f"(with a C compiler: pip install -e {place})"
    )


def test_an_installation_without_a_compiler_asks_for_one(place):
    assert f"{place / 'enumsol'} was installed without it (install a C compiler and reinstall enumsol" in reason()


def test_a_module_of_another_python_is_named(place):
    (place / PLACE / "_active_set.cpython-27-none.so").touch()
    assert "for another Python only (_active_set.cpython-27-none.so" in reason()
    assert EXTENSION_SUFFIXES[0] in reason()


def test_a_module_that_cannot_be_loaded_says_why(place):
    (place / PLACE / BUILT).touch()
    assert f"is compiled in {place / 'enumsol'} and cannot be loaded (undefined symbol: exp;" in reason()


def test_an_engine_that_was_asked_for_is_an_error_of_ours(monkeypatch):
    monkeypatch.setitem(sys.modules, MODULE, None)
    monkeypatch.delattr(sys.modules["enumsol.relaxation"], "_active_set", raising=False)
    with pytest.raises(MissingDependencyError, match="cannot be loaded"):
        enumerate_roots(gallery.one_node_triangle(), 5.0, "fast", engine="active-set")
