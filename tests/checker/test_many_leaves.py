"""A proof with thousands of leaves: leaves checked together must be judged as they were one by one."""

import pytest

from enumsol import enumerate_roots, gallery, verify


@pytest.mark.slow
def test_the_proof_of_many_roots_verifies():
    problem = gallery.chain(7, 0.05)
    roots = enumerate_roots(problem, 5.0)
    assert len(roots) == 3**7
    assert roots.complete
    report = verify(problem, roots.proof)
    assert report.complete, report
    assert report.roots == 3**7
