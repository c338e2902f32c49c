"""Set-up of the whole suite."""

import signal

import numpy as np
import pytest

# a suite started in the background inherits an ignored SIGINT, and so would the programs whose Ctrl-C is tested
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture
def rng():
    return np.random.default_rng(20121)
