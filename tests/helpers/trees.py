"""Searches that go through their tree, also where one certificate would do."""

from contextlib import contextmanager

import pytest

from enumsol.branches.enclosed.single_branches import ClosedPieces
from enumsol.search import fathoming as closing
from enumsol.search.fathoming import Closer
from enumsol.search.reduction import WeightSource
from enumsol.search.space import space_search
from enumsol.search.space.open_leaves import KnownBoxes
from enumsol.search.space.space_fathoming import SpaceCloser


@contextmanager
def _with(*changes):
    """A context in which owners have other attributes: (owner, name, value)."""
    with pytest.MonkeyPatch.context() as patch:
        for change in changes:
            patch.setattr(*change)
        yield


def _nothing(*_, **__):
    """Takes the place of methods that prove something."""


def by_the_tree():
    """In this context that is so."""
    nothing = ((SpaceCloser, "whole"), (SpaceCloser, "closed"), (ClosedPieces, "find"))
    return _with((Closer, "_due", lambda self, nodes: False), *((*place, _nothing) for place in nothing))


def closed_in_the_tree():
    """In this context no problem in 3D is decided by one certificate before its tree."""
    return _with((SpaceCloser, "whole", _nothing))


def every_subtree():
    """In this context every subtree in 2D is tried."""
    before = Closer.closed

    def closed(self, codes, relaxation):
        self._alert, self._wait = True, 0
        return before(self, codes, relaxation)

    return _with((Closer, "closed", closed))


def without_boxes():
    """In this context no leaf in 3D is settled by a box that holds one solution."""
    return _with((KnownBoxes, "holding", _nothing))


def above_known_roots():
    """In this context every assignment above the solution that Newton's method finds is tried, in small bodies too."""
    before = Closer.closed

    def whole(self):
        self._proposed(WeightSource.PLAIN)
        self.known = self._regular

    def closed(self, codes, relaxation):
        self._told = 0
        return before(self, codes, relaxation)

    return _with((Closer, "whole", whole), (Closer, "closed", closed), (closing, "_FEW", 0))


def forms_at_once():
    """In this context searches in 3D look for a form after one node, and use the best one that there is."""
    return _with((space_search, "NODES", 1), (space_search, "_SHARE", 1.0))
