"""The wedge that is pushed in, let go and pulled out again."""

import pytest

import enumsol


@pytest.fixture(scope="session")
def out_again(pulled_wedge):
    """Pushed in, let go, and pulled in two steps."""
    return enumsol.histories(pulled_wedge, [-1, 0, 0.5, 1])
