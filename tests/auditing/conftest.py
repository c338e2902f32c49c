"""What two files of tests ask about: the branches of the paper's Example 6.1."""

import pytest

from enumsol import branch_graph, gallery


@pytest.fixture(scope="package")
def graph():
    return branch_graph(gallery.get("one-node-6.1").build(), (0.0, 20.0))
