"""A small problem in 2D as arrays, some of which a test may exchange."""

import numpy as np

from enumsol import ContactProblem

A = np.array([[2.0, -0.5, 0.0, 0.0], [-0.5, 2.0, -0.5, 0.0], [0.0, -0.5, 2.0, -0.5], [0.0, 0.0, -0.5, 2.0]])
BN, BT = np.eye(4)[[0, 2]], np.eye(4)[[1, 3]]
F = np.array([1.0, -2.0, 0.5, 1.0])
DENSE = {"A": A, "Bn": BN, "Bt": BT, "f": F}


def problem(**changes):
    return ContactProblem(**(DENSE | changes))
