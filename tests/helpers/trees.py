"""Searches that go through their tree, also where one certificate would do."""

from contextlib import contextmanager

import pytest

from enumsol.branches.enclosed.single_branches import ClosedPieces
from enumsol.search import fathoming as closing
from enumsol.search.fathoming import Closer
from enumsol.search.reduction import WeightSource
from enumsol.search.space import space_fathoming, space_forms
from enumsol.search.space.known_boxes import KnownBoxes
from enumsol.search.space.space_fathoming import SpaceCloser


@contextmanager
def by_the_tree():
    """In this context that is so."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Closer, "_due", lambda self, nodes: False)
        patch.setattr(SpaceCloser, "whole", lambda self: None)
        patch.setattr(SpaceCloser, "closed", lambda self, codes, relaxation: None)
        patch.setattr(ClosedPieces, "find", lambda self, traced: None)
        yield


@contextmanager
def closed_in_the_tree():
    """In this context no problem in 3D is decided by one certificate before its tree."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SpaceCloser, "whole", lambda self: None)
        yield


@contextmanager
def every_subtree():
    """In this context every subtree in 2D is tried."""
    before = Closer.closed

    def closed(self, codes, relaxation):
        self._alert, self._wait = True, 0
        return before(self, codes, relaxation)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Closer, "closed", closed)
        yield


@contextmanager
def without_boxes():
    """In this context no leaf in 3D is settled by a box that holds one solution."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(KnownBoxes, "holding", lambda self, leaf: None)
        yield


@contextmanager
def above_known_roots():
    """In this context every assignment above the solution that Newton's method finds is tried, in small bodies too."""
    before = Closer.closed
    with pytest.MonkeyPatch.context() as patch:

        def whole(self):
            self._proposed(WeightSource.PLAIN)
            self.known = self._regular

        def closed(self, codes, relaxation):
            self._told = 0
            return before(self, codes, relaxation)

        patch.setattr(Closer, "whole", whole)
        patch.setattr(Closer, "closed", closed)
        patch.setattr(closing, "_FEW", 0)
        yield


@contextmanager
def products_at_once():
    """In this context searches in 3D try forms of products at all assignments of final statuses, and nothing before."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SpaceCloser, "whole", lambda self: None)
        patch.setattr(SpaceCloser, "_alone", lambda self, codes: None)
        patch.setattr(space_fathoming, "_HARD", 0)
        patch.setattr(space_fathoming, "_LONGEST", 0)
        yield


@contextmanager
def forms_at_once():
    """In this context searches in 3D look for a form after one node, and use the best one that there is."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(space_forms, "NODES", 1)
        patch.setattr(space_forms, "_SHARE", 1.0)
        yield
