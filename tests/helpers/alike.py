"""Two results of one kind, compared attribute by attribute."""

from operator import attrgetter

import numpy as np
import scipy.sparse as sp


def _pairs(one, two, names):
    for name in names:
        values = (attrgetter(name)(part) for part in (one, two))
        yield name, *(value.toarray() if sp.issparse(value) else value for value in values)


def assert_close(one, two, *names, order=..., **tolerances):
    """Attributes of these names agree within the tolerances of numpy.allclose; those of one are taken in an order."""
    for name, ours, theirs in _pairs(one, two, names):
        assert np.allclose(np.asarray(ours)[order], theirs, **tolerances), name


def assert_same(one, two, *names):
    """Attributes of these names are equal, arrays to the last bit."""
    for name, ours, theirs in _pairs(one, two, names):
        assert _equal(ours, theirs), (name, ours, theirs)


def _equal(ours, theirs):
    if isinstance(ours, tuple) and isinstance(theirs, tuple):
        return len(ours) == len(theirs) and all(map(_equal, ours, theirs))
    return np.array_equal(ours, theirs) if isinstance(ours, np.ndarray) else ours == theirs


def anew(problem, **changes):
    """A problem with other data that shares nothing with this one."""
    return type(problem)(**problem.arguments | changes)
