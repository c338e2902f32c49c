"""Trees in 3D of bodies that nothing holds end where only a known root is left."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from floating_space import lying_block
from proof_tools import of_kind, put, records_of, why_refused

import enumsol
from enumsol.search import reference_closer
from enumsol.search.space import space_references


@pytest.fixture(scope="module")
def cube():
    return lying_block(3, guided=True, friction=0.2)


@pytest.fixture
def at_once(monkeypatch):
    """Certificates are tried from the first assignment on, but none for the whole problem."""
    monkeypatch.setattr(space_references, "_MANY", 0)
    monkeypatch.setattr(space_references, "sole_turns", lambda _: None)


def without_certificates(monkeypatch):
    monkeypatch.setattr(reference_closer.ReferenceCloser, "_reference", None)


def test_a_pressed_cube_has_one_root(cube):
    roots = enumsol.enumerate_roots(cube, 0)
    assert roots.complete
    assert not roots.rigid_bound.needed
    assert roots.stats.nodes <= 3 * cube.p**2
    (root,) = roots
    fixed_point = enumsol.successive_approximations(cube, 0)
    assert np.allclose(root.lambda_n, fixed_point.lambda_n, atol=1e-6 * root.lambda_n.max())
    report = enumsol.verify(cube, roots.proof)
    assert report.complete
    assert report.roots == 1
    assert of_kind(records_of(roots.proof), "o")


def test_what_is_said_of_the_root_is_tested(cube):
    records = records_of(enumsol.enumerate_roots(cube, 0).proof)
    (form,), (leaf,) = of_kind(records, "q"), of_kind(records, "o")
    row = records[leaf][2][0]

    def refused(*change):
        return why_refused(cube, put(records, *change))

    assert "is not proven to be the only one" in refused((leaf, 2), [])
    assert "is not proven to be the only one" in refused((leaf, 2, 0), [3, *row[1:]])
    assert "cannot be followed" in refused((leaf, 2, 0), [3, row[1], 5])
    assert "is not proven to be the only one" in refused((leaf, 3), [[row, row, -1.0]])
    assert "whose form is definite" in refused((form, 1, 0), 0)
    assert "whose form is definite" in refused((form, 2, 0), -1.0)
    assert "its enclosure does not hold the root" in refused((form, 4, 0), 2.0)
    assert "its index is wrong" in refused((form, 6), -1)
    assert "the counts at the end" in refused((-1, "roots"), 0)
    assert "its form is not declared" in why_refused(cube, [record for k, record in enumerate(records) if k != form])


def test_it_is_unique(cube):
    assert enumsol.is_unique(cube, 0)


@pytest.mark.slow
def test_without_certificates_the_tree_is_much_larger(cube, monkeypatch):
    without_certificates(monkeypatch)
    roots = enumsol.enumerate_roots(cube, 0, max_nodes=200)
    assert not roots.complete
    assert len(roots) == 1


@pytest.mark.slow
@pytest.mark.usefixtures("at_once")
def test_the_answer_is_that_of_the_tree(monkeypatch):
    """A body whose tree ends without certificates."""
    body = lying_block(1, guided=True, friction=0.2)
    found = enumsol.enumerate_roots(body, 0)
    without_certificates(monkeypatch)
    other = enumsol.enumerate_roots(body, 0)
    assert found.complete
    assert other.complete
    assert len(found) == len(other) == 1
    assert np.allclose(found[0].lambda_n, other[0].lambda_n)
    assert np.allclose(found[0].u_t, other[0].u_t)


@pytest.mark.slow
@pytest.mark.usefixtures("at_once")
def test_several_workers_declare_the_root_as_often_as_they_need():
    body = lying_block(1, guided=False, friction=0.5)
    with ThreadPoolExecutor(2) as executor:
        roots = enumsol.enumerate_roots(body, 0, executor=executor)
    assert roots.complete
    assert len(roots) == 1
    report = enumsol.verify(body, roots.proof)
    assert report.complete
    assert report.roots == 1


@pytest.mark.usefixtures("at_once")
def test_a_search_that_was_stopped_goes_on(tmp_path):
    body, path = lying_block(1, guided=False, friction=0.5), tmp_path / "proof"
    begun = enumsol.enumerate_roots(body, 0, max_nodes=10, proof_path=path)
    assert not begun.complete
    assert len(begun) == 1
    roots = enumsol.enumerate_roots(body, 0, proof_path=path, resume=True)
    assert roots.complete
    assert len(roots) == 1
    assert roots.stats.resumed
    assert of_kind(records_of(roots.proof), "o")
    assert enumsol.verify(body, roots.proof).complete
