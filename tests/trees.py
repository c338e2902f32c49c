"""Searches that go through their tree, also where one certificate would do."""

from contextlib import contextmanager

import pytest

from enumsol.branches.closed_pieces import ClosedPieces
from enumsol.search.closing import Closer
from enumsol.search.space_closing import SpaceCloser


@contextmanager
def by_the_tree():
    """In this context that is so."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Closer, "_due", lambda self, nodes: False)
        patch.setattr(SpaceCloser, "whole", lambda self: None)
        patch.setattr(ClosedPieces, "find", lambda self, traced: None)
        yield
