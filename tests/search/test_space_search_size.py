"""How many nodes the tree in 3D needs: the count is deterministic (studies/search_in_3d_choices)."""

import pytest
from complete import all_roots

import enumsol
from enumsol import gallery

pytestmark = pytest.mark.usefixtures("tree_only")


@pytest.mark.few(0, 1)
@pytest.mark.parametrize(
    ("cells", "F", "most"),
    [
        ((3, 2, 2), 0.3, 300),
        ((4, 2, 2), 0.3, 1_200),  # 862 without slices, which save nodes elsewhere (theory, section 12.2)
        ((4, 2, 2), 0.5, 550),
        ((4, 3, 2), 0.5, 1_200),
        ((5, 4, 2), 1, 500),
    ],
)
def test_blocks_with_many_slipping_nodes(cells, F, most):
    problem = gallery.block3d(*cells)
    roots = all_roots(problem, F)
    assert (len(roots), roots.index_sum) == (1, 1)
    # statuses before sectors, and the most violated node always: 877, 2,891, 2,268, 13,359 and 3,953
    assert roots.stats.nodes <= most
    assert roots.stats.selections <= 30
    assert enumsol.verify(problem, roots.proof)
