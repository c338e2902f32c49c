"""The deck of a wedge that may hold, and what CalculiX found of it."""

import numpy as np
import pytest

import enumsol
from enumsol.auditing.results import compare_result
from tests.helpers.command_line import run
from tests.helpers.documents import ROOT

FOLDER = ROOT / "studies" / "against_calculix"


@pytest.fixture(scope="module")
def wedge():
    model = enumsol.read_deck(FOLDER / "wedge.inp")
    problem = model.problem()
    return model, problem, enumsol.enumerate_roots(problem, 0)


def test_the_wedge_is_free_slides_or_holds(wedge):
    _, problem, roots = wedge
    assert problem.p == 8
    assert roots.complete
    assert [[str(status) for status in root.statuses] for root in roots] == [
        ["open"] * 8, ["slip-"] * 4 + ["slip+"] * 4, ["stick"] * 8,
    ]  # fmt: skip
    roots.stability()
    assert [verdict.verdict for verdict in roots.verdicts] == ["does not run away", "runs away", "does not run away"]
    # free, it hangs on its springs: a pull of 5e-4 on a stiffness of 0.02
    np.testing.assert_allclose(problem.mesh.displacements(roots[0].u)[:25], [[0, 0.025]] * 25, atol=1e-12)


def test_calculix_found_the_free_one(wedge):
    model, problem, roots = wedge
    result = enumsol.read_results(FOLDER / "results" / "wedge.dat")[-1]
    compared = compare_result(problem, roots, result.on(problem.mesh, model.mesh.node_labels))
    assert compared.found == ("root", 0)
    assert compared.distances["root", 0] < 1e-9
    assert compared.missed == [("root", 1), ("root", 2)]


def test_the_same_on_the_command_line(capsys):
    files = FOLDER / "wedge.inp", FOLDER / "results" / "wedge.dat"
    status, out, _ = run(capsys, "audit", *files)
    assert status == 0
    assert "the result is root 0" in out
    assert "not found: it differs from root 1 by 1958 % and root 2 by 4410 %" in out
