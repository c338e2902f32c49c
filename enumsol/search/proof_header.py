"""What the first record of a proof says of its problem, in 2D and 3D alike (docs/proof_format.md)."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.proof.reading import rational_text

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from enumsol.model.problem import ContactProblem
    from enumsol.model.problem3d import ContactProblem3D
    from enumsol.support.arguments import Alpha


def point_header(
    problem: ContactProblem | ContactProblem3D, alpha: Alpha, data: str, units: dict[str, list[int]], **kind: str
) -> dict[str, Any]:
    """The header of a proof at one alpha.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    alpha : float or Fraction
    data : what is certified, "problem" or "condensed"
    units : see ``unit_exponents``
    kind : ``kind="space"`` in 3D

    Raises
    ------
    InvalidArgumentError
        alpha is a fraction of more digits than a proof may hold.
    """
    return {
        "format": "enumsol-proof",
        "version": 1,
        **kind,
        "problem": problem.fingerprint,
        "alpha": rational_text(Fraction(alpha), "alpha"),
        "p": problem.p,
        "data": data,
        **units,
    }


def unit_exponents(force: NDArray[np.float64], length: NDArray[np.float64]) -> dict[str, list[int]]:
    """Binary exponents of the units of forces and displacements, powers of two."""
    return {name: (np.frexp(units)[1] - 1).tolist() for name, units in (("force", force), ("length", length))}
