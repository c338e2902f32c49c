"""Arrays that cannot be written to."""

from collections.abc import Mapping

import numpy as np
import pytest


def assert_locked(array):
    with pytest.raises(ValueError, match="read-only"):
        array[...] = 0
    for locked in (array, array[...], array.view(), array.T):
        with pytest.raises(ValueError, match="cannot set WRITEABLE"):
            locked.setflags(write=True)
    if isinstance(array.base, np.ndarray):
        assert_locked(array.base)


def reachable(value, path, seen=None):
    """Arrays that can be reached by attributes and items, with the way to each."""
    seen = set() if seen is None else seen
    if id(value) in seen:
        return
    seen.add(id(value))
    if isinstance(value, np.ndarray):
        yield path, value
    elif isinstance(value, (tuple, list, frozenset)):
        for k, item in enumerate(value):
            yield from reachable(item, f"{path}[{k}]", seen)
    elif isinstance(value, Mapping):
        for key, item in value.items():
            yield from reachable(item, f"{path}[{key}]", seen)
    elif type(value).__module__.startswith("enumsol."):
        for name, item in getattr(value, "__dict__", {}).items():
            if name != "_tangent":  # how to compute the derivative, in floats: its solver is working memory
                yield from reachable(item, f"{path}.{name}", seen)
