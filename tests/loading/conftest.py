"""The wedge that is pushed in, let go and pulled out again."""

import dataclasses

import pytest

import enumsol


@pytest.fixture(scope="session")
def pulled_wedge():
    """A wedge with four contact nodes and friction 1; alpha is its pull."""
    wedge = enumsol.gallery.wedge(2, 2, friction=(1.0, 0.0))
    return dataclasses.replace(wedge, f=0 * wedge.f, load_slope=wedge.f)


@pytest.fixture(scope="session")
def out_again(pulled_wedge):
    """Pushed in, let go, and pulled in two steps."""
    return enumsol.histories(pulled_wedge, [-1, 0, 0.5, 1])
