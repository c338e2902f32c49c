"""Without the compiled solver the warning and the errors say where it was sought and what to do."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import enumsol
from enumsol import MissingDependencyError, enumerate_roots, gallery

PACKAGE = Path(enumsol.__file__).parent
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


@pytest.mark.slow
def test_a_checkout_in_which_nothing_is_compiled_says_so(tmp_path):
    """The warning of the search, the errors of the graph and of the engine asked for."""
    checkout = tmp_path / "checkout"
    shutil.copytree(PACKAGE, checkout / "enumsol", ignore=shutil.ignore_patterns("*.so", "*.pyd", "__pycache__"))
    environment = os.environ | {"PYTHONPATH": str(checkout)}
    done = subprocess.run(
        [sys.executable, "-c", CODE], cwd=checkout, env=environment, check=True, capture_output=True, text=True
    )
    lines = done.stdout.splitlines()
    assert len(lines) == 3
    assert lines[0].endswith("; the much slower interior-point solver is used")
    for line in lines:
        assert f"the compiled active-set solver cannot be loaded from {checkout / 'enumsol'} (" in line
        assert "install enumsol with a C compiler" in line
        assert f"start Python in another directory than {checkout}" in line


def test_a_module_that_cannot_be_loaded_says_why(monkeypatch):
    monkeypatch.setitem(sys.modules, "enumsol.relaxation._active_set", None)
    monkeypatch.delattr(sys.modules["enumsol.relaxation"], "_active_set", raising=False)
    with pytest.raises(MissingDependencyError, match=r"cannot be loaded from .*enumsol \(.*halted.*; install"):
        enumerate_roots(gallery.one_node_triangle(), 5.0, "fast", engine="active-set")
