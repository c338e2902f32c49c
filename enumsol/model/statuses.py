"""Statuses of a contact node: names, integer codes, and the signs that name a selection (theory, section 2)."""

from __future__ import annotations

import enum
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.support.arguments import shown
from enumsol.support.array_types import Floats, Mask, NDArray


class ContactStatus(enum.Enum):
    """Status of a contact node: it is open, it sticks, or it slips; in 2D in the positive or negative direction.

    Examples
    --------
    >>> import enumsol
    >>> enumsol.ContactStatus("slip+")
    ContactStatus.SLIP_PLUS
    """

    OPEN = "open"
    STICK = "stick"
    SLIP_PLUS = "slip+"
    SLIP_MINUS = "slip-"
    SLIP = "slip"

    def __repr__(self) -> str:
        return f"ContactStatus.{self.name}"

    def __str__(self) -> str:
        return self.value


#: Statuses in the order of their integer codes 0..3; a root at which several hold shows the first.
STATUSES = (ContactStatus.OPEN, ContactStatus.STICK, ContactStatus.SLIP_PLUS, ContactStatus.SLIP_MINUS)
OPEN, STICK, SLIP_PLUS, SLIP_MINUS = range(4)
#: Inside the searches a node with F = 0 that is in contact: lambda_t = 0 and u_t free (theory, section 2.1).
FRICTIONLESS = 4
#: Inside the searches a node whose status is not final: in contact and not known how, and nothing known.
CONTACT, UNDECIDED = 5, 6
#: Slip in any direction in 3D: the sector that is the whole circle (enumsol/model/sectors.py).
SLIP = 9
#: In floats, a condition within this of zero counts as met with equality where the largest forces and displacements are
#: of size one: points are converged to about 1e-12.
STATUS_TOLERANCE = 1e-9
#: A node that is open or slips in one direction (theory, section 6.11).
FORWARD, BACKWARD = 7, 8
SLIDING = {FORWARD: (OPEN, SLIP_PLUS), BACKWARD: (OPEN, SLIP_MINUS)}


def space_status(code: int, u_t: Floats) -> ContactStatus:
    """The status in 3D of a final code, a sector among them; u_t, (2,), names that of a node without friction."""
    if code == OPEN:
        return ContactStatus.OPEN
    if code == STICK or (code == FRICTIONLESS and not np.any(u_t)):
        return ContactStatus.STICK
    return ContactStatus.SLIP


def contact_status(code: int, u_t: float) -> ContactStatus:
    """The status of a final code; the sign of u_t names the slip of a node without friction."""
    if code == FRICTIONLESS:
        return STATUSES[STICK if u_t == 0 else SLIP_PLUS if u_t > 0 else SLIP_MINUS]
    return STATUSES[code]


class RowKind(enum.IntEnum):
    """Rows ``row >= 0`` (or ``= 0``, as an equality) of a contact node; row number = kind * p + node."""

    NORMAL_FORCE = 0  # lambda_n
    TANGENTIAL_FORCE = 1  # lambda_t
    CONE_PLUS = 2  # F lambda_n - lambda_t
    CONE_MINUS = 3  # F lambda_n + lambda_t
    PENETRATION = 4  # -w_n
    SLIP_FORWARD = 5  # w_t
    SLIP_BACKWARD = 6  # -w_t


class Conditions(NamedTuple):
    """Rows that vanish in a status, and rows that are not negative."""

    equations: tuple[RowKind, ...]
    inequalities: tuple[RowKind, ...]


_R = RowKind
#: What every status imposes, final or not (theory, sections 2.1 and 5.2): the one table that the search reads. Other
#: rows follow: lambda_n >= 0 in the cone of a node with friction, and the cone at a slip bound.
CONDITIONS = {
    OPEN: Conditions((_R.NORMAL_FORCE, _R.TANGENTIAL_FORCE), (_R.PENETRATION,)),
    STICK: Conditions((_R.PENETRATION, _R.SLIP_FORWARD), (_R.CONE_PLUS, _R.CONE_MINUS)),
    SLIP_PLUS: Conditions((_R.PENETRATION, _R.CONE_PLUS), (_R.NORMAL_FORCE, _R.SLIP_FORWARD)),
    SLIP_MINUS: Conditions((_R.PENETRATION, _R.CONE_MINUS), (_R.NORMAL_FORCE, _R.SLIP_BACKWARD)),
    FRICTIONLESS: Conditions((_R.PENETRATION, _R.TANGENTIAL_FORCE), (_R.NORMAL_FORCE,)),
    CONTACT: Conditions((_R.PENETRATION,), (_R.CONE_PLUS, _R.CONE_MINUS)),
    UNDECIDED: Conditions((), (_R.PENETRATION, _R.CONE_PLUS, _R.CONE_MINUS)),
    FORWARD: Conditions((_R.CONE_PLUS,), (_R.PENETRATION, _R.CONE_MINUS)),
    BACKWARD: Conditions((_R.CONE_MINUS,), (_R.PENETRATION, _R.CONE_PLUS)),
}
#: The status on the other side of a condition, with the condition that vanishes there too.
ACROSS: dict[tuple[int, int], tuple[tuple[int, int], ...]] = {
    (OPEN, _R.PENETRATION): (
        (SLIP_PLUS, _R.NORMAL_FORCE),
        (SLIP_MINUS, _R.NORMAL_FORCE),
        (FRICTIONLESS, _R.NORMAL_FORCE),
    ),
    (SLIP_PLUS, _R.NORMAL_FORCE): ((OPEN, _R.PENETRATION),),
    (SLIP_MINUS, _R.NORMAL_FORCE): ((OPEN, _R.PENETRATION),),
    (FRICTIONLESS, _R.NORMAL_FORCE): ((OPEN, _R.PENETRATION),),
    (SLIP_PLUS, _R.SLIP_FORWARD): ((STICK, _R.CONE_PLUS),),
    (SLIP_MINUS, _R.SLIP_BACKWARD): ((STICK, _R.CONE_MINUS),),
    (STICK, _R.CONE_PLUS): ((SLIP_PLUS, _R.SLIP_FORWARD),),
    (STICK, _R.CONE_MINUS): ((SLIP_MINUS, _R.SLIP_BACKWARD),),
}
#: Final statuses of a node with friction, and of one without.
FINAL = {True: (OPEN, STICK, SLIP_PLUS, SLIP_MINUS), False: (OPEN, FRICTIONLESS)}
#: Signs of the test functions in the final statuses.
SIGNS = {
    OPEN: (-1, -1, -1),
    STICK: (1, -1, 1),
    SLIP_PLUS: (1, 1, 1),
    SLIP_MINUS: (1, -1, -1),
    FRICTIONLESS: (1, 1, 1),
}


_EQUATIONS = np.array([[kind in CONDITIONS[code].equations for kind in RowKind] for code in SIGNS])
#: Rows that are not negative, by final code and RowKind: lambda_n in every status, as the cone of a sticking node does
#: not imply it where F = 0.
INEQUALITIES = np.array(
    [[kind in (_R.NORMAL_FORCE, *CONDITIONS[code].inequalities) for kind in RowKind] for code in SIGNS]
)


def active_within(rows: Floats, friction: Sequence[bool] | Mask, tolerance: float) -> tuple[frozenset[int], ...]:
    """Per node the final codes whose conditions hold within the tolerance, for values of all rows, shape (7, p)."""
    # products of booleans: whether any row that shall vanish, or hold, does not
    broken = _EQUATIONS @ (np.abs(rows) > tolerance) | INEQUALITIES @ (rows < -tolerance)
    return tuple(
        frozenset(code for code in FINAL[bool(friction[i])] if not column[code])
        for i, column in enumerate(broken.T.tolist())
    )


def sign_array(statuses: Sequence[ContactStatus]) -> NDArray[np.int8]:
    """Signs of the test functions that name the selection of ``statuses``, shape (p, 3) (theory, section 2.1).

    At an open node theta2 = theta3 at a root and their sign does not matter; (-, -, -) is returned.

    Examples
    --------
    >>> import enumsol
    >>> enumsol.sign_array([enumsol.ContactStatus.STICK, enumsol.ContactStatus.SLIP_MINUS]).tolist()
    [[1, -1, 1], [1, -1, -1]]
    """
    try:
        return np.array([SIGNS[STATUSES.index(status)] for status in statuses], dtype=np.int8).reshape(-1, 3)
    except (ValueError, TypeError):
        raise InvalidArgumentError(f"statuses is {shown(statuses)}; expected a sequence of ContactStatus") from None
