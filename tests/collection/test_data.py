"""What the collection holds: its counts against exhaustive enumeration, its proofs, its files, and how it was made."""

import json
from pathlib import Path

import collection_recipes
import make_collection
import numpy as np
import pytest
from complete import complete_report
from oracles import exact_solutions
from oracles3d import violation

import enumsol
from enumsol.collection import COLLECTION, get
from enumsol.collection.entries import DATA

ROOT = Path(__file__).parents[2]
NAMES = tuple(COLLECTION)
RECIPES = {recipe.name: recipe for recipe in collection_recipes.RECIPES}
#: The proofs that take longer than a tenth of a second.
LONG = {"wedge-20-5", "wedge-14-5", "wedge-14-soft", "wedge-3d-8-5", "wedge-3d-8-9", "wedge-3d-8-soft", "box-3d-9-soft"}
#: Isolated solutions and continua that follow from the closed form of one node, or products of it.
CLOSED = {
    "triangle-3": (3, 0),
    "triangle-1": (1, 0),
    "triangle-fold": (2, 0),
    "triangle-continuum": (0, 1),
    "two-continua": (0, 1),
    "continuum-and-three": (0, 3),
    "fold-and-three": (6, 0),
    "chain-2": (9, 0),
    "chain-4": (81, 0),
}


def test_the_collection_is_what_it_says_it_is():
    assert list(RECIPES) == list(NAMES)
    assert len(NAMES) >= 40
    assert {entry.dimension for entry in COLLECTION.values()} == {2, 3}
    kinds = {kind for entry in COLLECTION.values() for kind in entry.kinds}
    assert kinds == {"degenerate", "continuum", "soft", "large", "steel", "random"}
    for entry in COLLECTION.values():
        recipe = RECIPES[entry.name]
        assert (entry.summary, entry.source, entry.kinds) == (recipe.summary, recipe.source, recipe.kinds)
        assert ("degenerate" in entry.kinds) == (entry.degenerate > 0)
        assert ("continuum" in entry.kinds) == (entry.families > 0)
    assert {name: (get(name).roots, get(name).families) for name in CLOSED} == CLOSED


def test_the_files_are_those_of_the_index_and_small():
    files = {file.relative_to(DATA).as_posix() for file in DATA.rglob("*") if file.is_file()}
    parts = (("problems", "npz"), ("problems", "h5"), ("certified", "json"), ("certified", "proof"))
    assert files == {"index.json", *(f"{folder}/{name}.{ending}" for name in NAMES for folder, ending in parts)}
    assert sum((DATA / file).stat().st_size for file in files) < 5e6


@pytest.mark.few(8, 22)
@pytest.mark.parametrize("name", NAMES)
def test_both_files_hold_the_problem_and_the_counts_are_those_listed(name):
    entry = get(name)
    pytest.importorskip("h5py")
    problems = entry.problem(), enumsol.read_problem(DATA / "problems" / f"{name}.h5")
    assert [problem.fingerprint for problem in problems] == [entry.fingerprint] * 2
    certified = entry.certified()
    assert certified.roots.shape == (entry.roots, entry.p, entry.dimension)
    assert len(certified.families) == entry.families
    listed = json.loads((DATA / "certified" / f"{name}.json").read_text(encoding="utf-8"))
    assert (listed["complete"], listed["undecided"], listed["problem"]) == (True, [], f"collection:{name}")
    assert sum(not root["regular"] for root in listed["roots"]) == entry.degenerate


@pytest.mark.few(0, 10)
@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] if n in LONG else []) for n in NAMES[::3]])
def test_proofs_hold(name):
    entry = get(name)
    report = complete_report(entry.problem(), entry.proof())
    assert (report.alpha, report.roots, report.families) == (0, entry.roots, entry.families)


@pytest.mark.few(0, 8)
@pytest.mark.parametrize("name", [name for k, name in enumerate(NAMES) if k % 3])
def test_all_other_proofs_hold(name):
    test_proofs_hold(name)


@pytest.mark.few(8, 16)
@pytest.mark.parametrize("name", NAMES)
def test_a_problem_can_be_made_again(name):
    """Up to rounding, which differs from processor to processor."""
    made, kept = RECIPES[name].build(), get(name).problem()
    for array in ("A", "contact_rows", "f", "gap", "slip_offset"):
        one, other = (getattr(problem, array) for problem in (made, kept))
        dense = [matrix.toarray() if hasattr(matrix, "toarray") else matrix for matrix in (one, other)]
        assert np.allclose(*dense, rtol=0, atol=1e-13 * np.max(np.abs(dense[1]), initial=0.0)), array
    assert np.array_equal(made.friction_at(0), kept.friction_at(0))


@pytest.mark.slow
def test_a_small_part_is_made_to_the_same(tmp_path, monkeypatch, capsys):
    names = ["triangle-3", "continuum-and-three", "wedge-8-5", "node-3d-3", "random-3-34"]
    (tmp_path / "index.json").write_text("[]")
    monkeypatch.setattr("sys.argv", ["make_collection.py", "--into", str(tmp_path), *names])
    make_collection.main()
    made = {entry["name"]: entry for entry in json.loads((tmp_path / "index.json").read_text())}
    for name in names:
        kept, forces = get(name), [np.ravel(part) for part in get(name).certified().roots]
        keys = ("roots", "families", "degenerate")
        assert {key: made[name][key] for key in keys} == {key: getattr(kept, key) for key in keys}
        found = json.loads((tmp_path / "certified" / f"{name}.json").read_text())["roots"]
        again = [np.column_stack([root["lambda_n"], root["lambda_t"]]).ravel() for root in found]
        assert np.allclose(again, forces, rtol=0, atol=1e-9 * np.max(np.abs(forces), initial=1e-9))


@pytest.mark.few(6)
@pytest.mark.parametrize("name", [name for name in NAMES if get(name).dimension == 2 and get(name).p <= 3])
def test_solutions_in_the_plane_are_those_of_rational_enumeration(name):
    """All 4^p selections, in rationals, by code that shares nothing with enumsol."""
    entry, certified = get(name), get(name).certified()
    components = exact_solutions(entry.problem(), 0)
    size = max(abs(float(x)) for component in components for v in component.vertices for x in v) or 1.0
    isolated = [component for component in components if component.dimension == 0]
    assert (len(isolated), len(components)) == (entry.roots, entry.roots + entry.families)
    for root in certified.roots:
        assert min(component.distance(root.T.ravel()) for component in isolated) < 1e-12 * size
    for family in certified.families:
        listed = {tuple(np.round(vertex.T.ravel() / size, 9) + 0.0) for part in family for vertex in part}
        exact = [{tuple(np.round(np.array(v, float) / size, 9) + 0.0) for v in c.vertices} for c in components]
        assert listed in exact


@pytest.mark.parametrize("name", [name for name in NAMES if get(name).dimension == 3 and get(name).p <= 9])
def test_solutions_in_space_solve_the_problem(name):
    entry = get(name)
    problem = entry.problem()
    A, B = problem.A.toarray(), problem.contact_rows.toarray()
    X = np.linalg.solve(A, np.column_stack([B.T, problem.f]))
    S, g = B @ X[:, :-1], B @ X[:, -1] - np.concatenate([problem.gap, problem.slip_offset.T.ravel()])
    for root in entry.certified().roots:
        assert violation(S, g, problem.friction_at(0), root.T.ravel()) < 1e-8


def test_the_documents_show_the_collection():
    text = (ROOT / "docs" / "collection.md").read_text(encoding="utf-8")
    rows = [line for line in text.splitlines() if line.startswith("| `") and line.count("|") > 8]
    assert rows == make_collection.table()
    assert f"{len(NAMES)} contact problems" in text


@pytest.mark.long
def test_all_solutions_can_be_told_apart():
    make_collection.check_separations()
