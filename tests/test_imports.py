"""What a scene makes the program load and keep: libraries and memory follow from what is asked, and no more."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import enumsol
from enumsol.condensation.factorization import Factorization

#: Modules that are reached as attributes.
MODULES = [name for name in enumsol.__all__ if type(getattr(enumsol, name)) is type(enumsol)]
#: Libraries that only some problems, results or commands need.
RARE = {"flint", "networkx", "pandas", "matplotlib", "plotly", "cvxpy", "skfem", "typer", "rich", "scipy.optimize"}
RARE |= {"h5py", "meshio"}
GENERIC = "import enumsol; problem = enumsol.gallery.{problem}; roots = enumsol.enumerate_roots(problem, {alpha}); "


def modules_after(code):
    """Modules in a new process after the code."""
    ending = "; import sys, json; print(json.dumps(sorted(sys.modules)), file=sys.__stdout__)"
    done = subprocess.run([sys.executable, "-c", code + ending], check=True, capture_output=True, text=True)
    return set(json.loads(done.stdout.splitlines()[-1]))


def test_importing_loads_no_library():
    assert not modules_after("import enumsol") & (RARE | {"numpy", "scipy"})


def test_a_problem_loads_sparse_matrices_and_nothing_rare():
    modules = modules_after("import enumsol; enumsol.ContactProblem")
    assert "scipy.sparse" in modules
    assert not modules & RARE
    assert "scipy.sparse.linalg" not in modules


@pytest.mark.few(0, 1)
@pytest.mark.parametrize(
    ("problem", "alpha", "roots"),
    [
        ("one_node_triangle()", 5.0, 3),
        ("two_node_square()", 3.5, 5),
        ("chain(3)", 5.0, 27),
        ("wedge(4, 7, (4e-4, 1e-3))", 2.2, 5),
    ],
)
def test_no_rational_arithmetic_where_intervals_decide(problem, alpha, roots):
    """Proving and checking the proof: flint stays out. (scikit-fem makes the mesh of the wedge.)"""
    code = GENERIC.format(problem=problem, alpha=alpha)
    code += f"assert roots.complete and len(roots) == {roots}; assert enumsol.verify(problem, roots.proof).complete"
    modules = modules_after(code)
    assert "enumsol.search.certifiers.verified" in modules
    assert not modules & (RARE - {"skfem"} if "wedge" in problem else RARE)


@pytest.mark.slow
def test_rational_arithmetic_where_a_sign_is_zero():
    assert "flint" in modules_after("import enumsol; enumsol.enumerate_roots(enumsol.gallery.one_node_triangle(), 8/3)")


def test_a_search_does_not_load_the_checker():
    modules = modules_after(GENERIC.format(problem="one_node_triangle()", alpha=5.0) + "pass")
    assert not modules & {"enumsol.checker.verify", "enumsol.io", "enumsol.branches", "enumsol.continuation"}


@pytest.mark.slow
def test_a_problem_in_2d_loads_nothing_of_3d(tmp_path):
    code = "from concurrent.futures import ThreadPoolExecutor\nimport enumsol\nfrom enumsol import fem\n"
    code += "problem = enumsol.gallery.two_node_square()\nwith ThreadPoolExecutor(2) as executor:\n"
    code += "    roots = enumsol.enumerate_roots(problem, 3.5, executor=executor)\n"
    code += "assert enumsol.verify(problem, roots.proof).complete and len(enumsol.multiplicity_table(problem, [1]))\n"
    code += f"file = {str(tmp_path / 'p.npz')!r}\nenumsol.write_problem(problem, file)\nenumsol.read_problem(file)\n"
    code += "enumsol.gallery.get('wedge-8-5').build()\n0"
    loaded = modules_after(code)
    assert "meshio" not in loaded
    modules = {name.removeprefix("enumsol.") for name in loaded if name.startswith("enumsol.")}
    assert {"search.parts", "search.solvers", "roots.enumeration"} <= modules
    of_space = {"model.sectors", "model.problem3d"}
    assert all((Path(enumsol.__file__).parent / f"{name.replace(chr(46), chr(47))}.py").exists() for name in of_space)
    assert not modules & of_space
    assert not [name for name in modules if "space" in name or "3d" in name or name.startswith(("fem.so", "fem.su"))]


@pytest.mark.slow
def test_a_branch_graph_loads_algebra_and_graphs_only():
    code = "import enumsol; graph = enumsol.branch_graph(enumsol.gallery.two_node_square(), (0.0, 10.0)); "
    modules = modules_after(code + "assert graph.complete")
    assert modules >= {"flint", "networkx"}
    assert not modules & (RARE - {"flint", "networkx"})


@pytest.mark.slow
def test_continuation_loads_no_graph():
    code = "import enumsol; problem = enumsol.gallery.one_node_triangle(); "
    code += "enumsol.follow(problem, enumsol.newton(problem, 1.0), interval=(0.0, 4.0))"
    assert not modules_after(code) & RARE


def test_help_loads_neither_numpy_nor_scipy():
    code = "import io, contextlib, enumsol.cli as cli\nwith contextlib.redirect_stdout(io.StringIO()): cli.main({0})\n0"
    for arguments in (["--help"], ["roots", "--help"], ["--version"]):
        assert not modules_after(code.format(arguments)) & {"numpy", "scipy", "flint", "networkx"}
    assert not modules_after(code.format(["gallery", "list"])) & (RARE - {"typer", "rich"} | {"scipy.sparse.linalg"})


def test_every_public_name_is_found():
    for name in enumsol.__all__:
        assert getattr(enumsol, name) is not None
    assert dir(enumsol) == enumsol.__all__
    assert {"enumerate_roots", "branch_graph", "gallery", "__version__"} < set(enumsol.__all__)


@pytest.mark.few(7, 5)
@pytest.mark.parametrize("name", MODULES)
def test_modules_are_attributes_after_a_plain_import(name):
    assert f"enumsol.{name}" in modules_after(f"import enumsol; enumsol.{name}")


def test_an_unknown_name_is_refused():
    with pytest.raises(AttributeError, match="enumsol attribute enumerate_root"):
        enumsol.enumerate_root  # noqa: B018  # looking it up is the test


def test_the_factorization_keeps_no_copy_of_its_factors():
    problem = enumsol.gallery.clamped_block(8, 4)
    factorization = problem.factorization
    assert factorization._lu.nnz > problem.A.nnz
    assert factorization._lu.L.nnz == factorization._lu.U.nnz == 0
    # and works as before, however often it is checked
    factorization.check_positive_definite()
    x = factorization.solve(problem.f)
    assert np.allclose(problem.A @ x, problem.f)
    assert np.array_equal(x, Factorization(problem.A).solve(problem.f))


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the peak is read from /proc")
def test_nothing_of_size_n_by_n_is_dense():
    code = (
        "import enumsol, re, pathlib; problem = enumsol.gallery.clamped_block(100, 99, contact=10); "
        "assert problem.n == 20_000; assert enumsol.enumerate_roots(problem, 1.0).complete; "
        r"status = pathlib.Path('/proc/self/status').read_text(); peak = re.search(r'VmHWM:\s+(\d+) kB', status)[1]; "
        "print(int(peak) * 1024)"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert int(done.stdout) < 0.15 * 8 * 20_000**2


# -- names that do not exist -------------------------------------------------------------------------------------------


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
