"""Arrays that cannot be written to."""

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
