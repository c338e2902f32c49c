"""Statuses of a contact node: names, integer codes, and the signs that name a selection (theory, section 2)."""

from __future__ import annotations

import enum
from typing import TYPE_CHECKING

import numpy as np

from enumsol.checks import shown
from enumsol.errors import InvalidArgumentError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


class ContactStatus(enum.Enum):
    """What a contact node does: it is open, it sticks, or it slips; in 2D in the positive or negative direction.

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


def contact_status(code: int, u_t: float) -> ContactStatus:
    """The status of a final code; the sign of u_t names the slip of a node without friction."""
    if code == FRICTIONLESS:
        return STATUSES[STICK if u_t == 0 else SLIP_PLUS if u_t > 0 else SLIP_MINUS]
    return STATUSES[code]


_SIGNS = {
    ContactStatus.OPEN: (-1, -1, -1),
    ContactStatus.STICK: (1, -1, 1),
    ContactStatus.SLIP_PLUS: (1, 1, 1),
    ContactStatus.SLIP_MINUS: (1, -1, -1),
}


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
        return np.array([_SIGNS[status] for status in statuses], dtype=np.int8).reshape(-1, 3)
    except (KeyError, TypeError):
        raise InvalidArgumentError(f"statuses is {shown(statuses)}; expected a sequence of ContactStatus") from None
