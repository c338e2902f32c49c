"""Rigid modes of a body that nothing holds: what they are, how springs hold the body, and how far it may move."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError, InvalidProblemError
from enumsol.support.arguments import positive_number
from enumsol.support.array_arguments import real_array
from enumsol.support.array_types import Floats
from enumsol.support.immutable import Sealed, sealed
from enumsol.support.messages import listed

#: A N is rounding of the user's assembly up to this fraction of |A| |N|; theory, section 14.1, says what is then meant.
MODE_TOLERANCE = 1e-9
#: Modes that have less than this part of the largest share in a displacement are not named.
NAMED = 1e-4


@dataclass(frozen=True, eq=False)
class RigidModes(Sealed):
    """The displacements that a body offers no resistance to (theory, section 14.1).

    Attributes
    ----------
    N : (n, r) array
        A mode in every column.
    held : (r,) int array
        Degrees of freedom of the springs: held there, the body can no longer move as a whole.
    stiffness : (r,) array
        Of the springs [force / length].
    """

    N: Floats
    held: Any
    stiffness: Floats

    @classmethod
    def of(cls, N: object, A: sp.csc_array) -> RigidModes:
        """Modes as they are given, with springs to hold the body; none of a body that is held (N is None).

        Raises
        ------
        InvalidProblemError
            They are no modes of A, or not independent.
        """
        n = A.shape[0]
        if N is None:
            return cls(sealed(np.zeros((n, 0))), sealed(np.zeros(0, dtype=np.intp)), sealed(np.zeros(0)))
        array = real_array(N, "rigid_modes")
        array = array[:, None] if array.ndim == 1 else array
        if array.ndim != 2 or array.shape[0] != n or not 0 < array.shape[1] <= n:
            raise InvalidProblemError(f"rigid_modes has shape {array.shape}; expected (n, r) = ({n}, r), r >= 1")
        modes = sealed(array + 0.0)
        held = _pivots(modes)
        image, size = np.abs(A @ modes).max(axis=0), (abs(A) @ np.abs(modes)).max(axis=0)
        if np.any(image > MODE_TOLERANCE * size):
            mode = int(np.argmax(image > MODE_TOLERANCE * size))
            raise InvalidProblemError(
                f"rigid_modes: column {mode} is not a rigid mode, for max|A N| = {image[mode]:.3g} where max|A| |N| = "
                f"{size[mode]:.3g}; expected A N = 0 within {MODE_TOLERANCE:g} |A| |N|"
            )
        diagonal = A.diagonal()
        largest = float(np.max(np.abs(diagonal)))
        own = diagonal[held]
        return cls(modes, held, np.where(own > 0, own, largest if largest > 0 else 1.0))

    @property
    def r(self) -> int:
        """Number of modes."""
        return int(self.N.shape[1])

    def springs(self) -> sp.csc_array:
        """Springs that hold the body, to be added to A, (n, n); the sum with A is exact."""
        n = len(self.N)
        return sp.csc_array((self.stiffness, (self.held, self.held)), shape=(n, n))

    def reach(self, largest: float) -> Floats:
        """Bounds of the coordinates of a rigid displacement, (r,), none of whose components is above ``largest``.

        Rounded upward from the exact inverse of the modes at the springs.
        """
        from enumsol.arithmetic.rationals import (  # python-flint, not for bodies that are held
            rational_matrix,
            to_fraction,
        )

        if not self.r:
            return np.zeros(0)
        try:
            inverse = rational_matrix(self.N[self.held]).inv().tolist()
        except ZeroDivisionError:
            raise InvalidProblemError("rigid_modes has linearly dependent columns; expected independent ones") from None
        most = [Fraction(largest) * sum(abs(to_fraction(x)) for x in row) for row in inverse]
        nearest = np.array([float(x) for x in most])
        low = [Fraction(x) < exact for x, exact in zip(nearest.tolist(), most, strict=True)]
        return np.where(low, np.nextafter(nearest, np.inf), nearest)


def largest_displacement(value: float | None, modes: RigidModes) -> float | None:
    """The bound of rigid displacements, if it is given.

    Raises
    ------
    InvalidProblemError
        It is no positive number, or given without modes.
    """
    if value is None:
        return None
    if modes.r == 0:
        raise InvalidProblemError("max_rigid_displacement is given without rigid_modes; expected both")
    try:
        return positive_number(value, "max_rigid_displacement")
    except InvalidArgumentError as error:
        raise InvalidProblemError(str(error)) from None


def modes_of(N: Floats, coordinates: Floats) -> str:
    """The rigid modes that a rigid displacement consists of, in words: "rigid mode 0", "rigid modes 0 and 2"."""
    size = np.abs(coordinates) * np.max(np.abs(N), axis=0)
    names = np.flatnonzero(size > NAMED * np.max(size)).tolist()
    return f"rigid mode{'s' if len(names) > 1 else ''} {listed(names)}"


def _pivots(N: Floats) -> Any:
    """Degrees of freedom at which the modes are well told apart, by elimination with complete pivoting.

    Raises
    ------
    InvalidProblemError
        The modes are not independent.
    """
    size = np.max(np.abs(N), axis=0)
    if np.any(size == 0):
        raise InvalidProblemError(f"rigid_modes: column {int(np.argmin(size))} is zero; expected independent columns")
    # elementwise throughout: the same on every machine
    rest, held = N / size, list[int]()
    columns = list(range(N.shape[1]))
    while columns:
        part = np.abs(rest[:, columns])
        row, place = divmod(int(np.argmax(part)), len(columns))
        # pivots of the modes below this fraction of the largest mean dependent modes
        if part[row, place] <= 1e-9:
            raise InvalidProblemError(
                f"rigid_modes has linearly dependent columns ({columns[place]} and others); expected independent ones"
            )
        pivot = columns.pop(place)
        held.append(row)
        for column in columns:
            rest[:, column] -= rest[:, pivot] * (rest[row, column] / rest[row, pivot])
            rest[row, column] = 0.0
    return sealed(np.array(sorted(held), dtype=np.intp))
