"""Engines of the relaxation are interchangeable, and their failures lose no root."""

import builtins
import importlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

import clarabel
import numpy as np
import pytest
from compare import differences
from complete import all_roots
from generators import named, random_problem, singular_problem

import enumsol
from enumsol import MissingDependencyError, enumerate_roots, gallery
from enumsol.relaxation import active_set, interior_point as fallback
from enumsol.search.solvers import FastCertifier, plane_search
from enumsol.selections.float_selections import FloatSelections


def problems():
    yield from map(named, ("one-node-6.1", "one-node-6.3", "two-node-5", "wedge-8-3", "wedge-8-5", "chain-4-coupled"))
    rng = np.random.default_rng(3)
    for p in (2, 3, 4, 5):
        yield random_problem(rng, p, planted=1.0), 0.0
    yield singular_problem(rng, 3), 0.0


PROBLEMS = list(problems())


@pytest.mark.parametrize(("problem", "alpha"), PROBLEMS)
def test_clarabel_gives_the_same(problem, alpha):
    own, other = (enumsol.enumerate_roots(problem, alpha, "fast", engine=name) for name in ("active-set", "clarabel"))
    assert not differences(other, own)
    assert (other.index_sum, own.stats.fallback_qps) == (1, 0)


def searched(problem, alpha, **options):
    """Outcome of the fast tree search with an engine that has these options."""
    system = problem.condensed.at(alpha).scaled
    certifier = FastCertifier(FloatSelections(system))
    return plane_search(system, certifier, engine=active_set.ActiveSetEngine(system, **options)).run()


@pytest.mark.parametrize("options", [{"candidates": 1}, {"candidates": 4}, {"candidates": 1000}, {"slow": True}])
@pytest.mark.parametrize("name", ["wedge-8-5", "clamped-block-8"])
def test_options_change_the_tree_and_not_what_is_found(name, options):
    want, found = searched(*named(name)), searched(*named(name), **options)
    assert sorted(s.codes for s in found.solutions) == sorted(s.codes for s in want.solutions)
    assert len(found.solutions) == gallery.get(name).roots


def test_the_energy_is_the_form_that_is_minimised_by_default():
    problem, alpha = named("wedge-8-5")
    system = problem.condensed.at(alpha).scaled
    want = searched(problem, alpha)
    still = np.zeros_like(system.g)
    assert searched(problem, alpha, form=active_set.PieceForm(system.S, system.g, still)).nodes == want.nodes
    # any multiple of the energy bounds it as well; a small one prunes no sooner
    slack = searched(problem, alpha, form=active_set.PieceForm(1e-9 * system.S, 1e-9 * system.g, still))
    assert slack.nodes > want.nodes
    assert sorted(s.codes for s in slack.solutions) == sorted(s.codes for s in want.solutions)


class Failing:
    """Wraps a relaxation's constructor so that it stalls at random nodes."""

    def __init__(self, monkeypatch, cls, share, seed):
        self.rng, self.share, self.count = np.random.default_rng(seed), share, 0
        original = cls.__init__

        def init(relaxed, *args, **kwargs):
            original(relaxed, *args, **kwargs)
            if self.rng.random() < self.share:
                relaxed.stalled, relaxed.pruned = True, False
                self.count += 1

        monkeypatch.setattr(cls, "__init__", init)


@pytest.mark.few(8, 0)
@pytest.mark.parametrize("share", [0.2, 1.0])
@pytest.mark.parametrize(("problem", "alpha"), PROBLEMS)
def test_a_stalling_engine_is_replaced(monkeypatch, problem, alpha, share):
    want = enumsol.enumerate_roots(problem, alpha, "fast")
    failing = Failing(monkeypatch, active_set.ActiveSetRelaxation, share, 1)
    roots = enumsol.enumerate_roots(problem, alpha, "fast")
    assert failing.count > 0
    assert roots.stats.fallback_qps == failing.count
    assert f"stalled: {failing.count} of {roots.stats.qps} relaxation" in repr(roots)
    assert "stalled" not in repr(want)
    assert not differences(roots, want)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("share", [0.2, 0.5])
def test_where_both_fail_the_search_branches_on(monkeypatch, share, seed):
    expected = [enumsol.enumerate_roots(*item, "fast") for item in PROBLEMS]
    Failing(monkeypatch, active_set.ActiveSetRelaxation, share, seed)
    failing = Failing(monkeypatch, fallback._InteriorPointRelaxation, share, seed + 100)
    for item, want in zip(PROBLEMS, expected, strict=True):
        roots = enumsol.enumerate_roots(*item, "fast")
        assert not differences(roots, want)
        assert not roots.undecided
    assert failing.count > 20


def test_without_any_working_engine_it_is_an_exhaustive_search(monkeypatch):
    problem, alpha = gallery.get("two-node-5").build(), 5.0
    want = enumsol.enumerate_roots(problem, alpha, "fast", "exhaustive")
    for cls in (active_set.ActiveSetRelaxation, fallback._InteriorPointRelaxation):
        Failing(monkeypatch, cls, 1.0, 0)
    roots = enumsol.enumerate_roots(problem, alpha, "fast")
    assert not differences(roots, want)
    # two levels a node: open / contact, then stick / slip+ / slip-
    assert (roots.stats.selections, roots.stats.pruned) == (16, 0)


def test_an_interior_point_solver_that_gives_up_concludes_nothing(monkeypatch):
    problem, alpha = gallery.get("two-node-5").build(), 5.0
    want = enumsol.enumerate_roots(problem, alpha, "fast", "exhaustive")
    make = clarabel.DefaultSettings

    def impatient():
        settings = make()
        settings.max_iter = 1
        return settings

    monkeypatch.setattr(clarabel, "DefaultSettings", impatient)
    roots = enumsol.enumerate_roots(problem, alpha, "fast", engine="clarabel")
    assert not differences(roots, want)
    assert (roots.stats.fallback_qps, roots.stats.selections) == (roots.stats.nodes, 16)


@pytest.mark.parametrize("method", ["tree", "exhaustive"])
def test_exact_arithmetic_does_not_believe_a_wrong_pruning(monkeypatch, method):
    # an engine that claims every second node to be empty: the multipliers do not prove it
    problem, alpha = gallery.get("two-node-5").build(), 5.0
    want = enumsol.enumerate_roots(problem, alpha, "exact", "exhaustive")
    rng, original = np.random.default_rng(0), active_set.ActiveSetRelaxation.__init__
    claims = []

    def init(relaxed, *args, **kwargs):
        original(relaxed, *args, **kwargs)
        if not relaxed.pruned and rng.random() < 0.5:
            relaxed.pruned = True
            claims.append(relaxed)

    monkeypatch.setattr(active_set.ActiveSetRelaxation, "__init__", init)
    roots = all_roots(problem, alpha, "exact", method)
    assert not differences(roots, want)
    assert bool(claims) == (method == "tree")


def test_missing_compiled_engine_warns_and_works(monkeypatch):
    real = builtins.__import__

    def without(name, globals=None, locals=None, fromlist=(), level=0):
        if name.startswith("enumsol.relaxation") and "_active_set" in (fromlist or ()):
            raise ImportError(name)
        return real(name, globals, locals, fromlist, level)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.warns(RuntimeWarning, match="compiled active-set solver cannot be loaded"):
        roots = enumsol.enumerate_roots(gallery.one_node_triangle(), 5.0, "fast")
    assert len(roots) == 3
    with pytest.raises(ImportError):
        enumsol.enumerate_roots(gallery.one_node_triangle(), 5.0, "fast", engine="active-set")
    # what README says is not there then
    for needs, call in (
        ("the search in 3D", lambda: enumsol.enumerate_roots(gallery.get("one-node-3d-3").build(), 0)),
        ("branch_graph", lambda: enumsol.branch_graph(gallery.two_node_square(), (0, 10))),
    ):
        with pytest.raises(enumsol.MissingDependencyError, match=f"{needs} needs it, but the compiled active-set"):
            call()


def test_compiled_engine_is_there():
    assert importlib.import_module("enumsol.relaxation._active_set").OPTIMAL == 0


# -- without the compiled module ---------------------------------------------------------------------------------------


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
    options = {"cwd": checkout, "env": os.environ | {"PYTHONPATH": str(checkout)}, "text": True}
    done = subprocess.run([sys.executable, "-c", CODE], check=True, capture_output=True, **options)
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
