"""A small problem in 2D as arrays, some of which a test may exchange."""

import numpy as np
import scipy.sparse as sp

from enumsol import ContactProblem

A = np.array([[2.0, -0.5, 0.0, 0.0], [-0.5, 2.0, -0.5, 0.0], [0.0, -0.5, 2.0, -0.5], [0.0, 0.0, -0.5, 2.0]])
BN, BT = np.eye(4)[[0, 2]], np.eye(4)[[1, 3]]
F = np.array([1.0, -2.0, 0.5, 1.0])
DENSE = {"A": A, "Bn": BN, "Bt": BT, "f": F}


def free_bar(n):
    """A bar of n springs in a row: singular, its rigid motion is (1, .., 1)."""
    main = np.full(n, 2.0)
    main[[0, -1]] = 1.0
    return sp.diags_array([-np.ones(n - 1), main, -np.ones(n - 1)], offsets=(-1, 0, 1))


def problem(**changes):
    return ContactProblem(**(DENSE | changes))
