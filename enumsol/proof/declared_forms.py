"""The forms to which leaves of a proof refer, made of what was declared of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from enumsol.trusted.quadratic_forms import EnclosedForm
from enumsol.trusted.reference import Reference
from enumsol.trusted.status_rows import UNDECIDED

if TYPE_CHECKING:
    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.proof.records import DeclaredForm
    from enumsol.trusted.quadratic_forms import SlipForm
    from enumsol.trusted.space.product_forms import Ellipsoid
    from enumsol.trusted.space.space_uniqueness import LeafReference


def plane_form(system: EnclosedSystem, said: DeclaredForm) -> EnclosedForm | Reference | None:
    """The form of an assignment, or of a root of a body that nothing holds, in 2D; None if that is not definite."""
    if not system.held:
        return Reference.of(system, said.codes, said.numbers, *said.more.tolist())
    with np.errstate(over="ignore", invalid="ignore"):
        return EnclosedForm.of(system, said.codes, said.numbers.reshape(4, -1), float(said.more[0]))


def space_form(system: EnclosedSpace, said: DeclaredForm) -> SlipForm | Ellipsoid | LeafReference | None:
    """The form of the whole tree, the ellipsoid of an assignment, or the form of a root, in 3D; None if not proven.

    Raises
    ------
    ValueError
        A multiplier is not allowed.
    """
    from enumsol.trusted.quadratic_forms import SlipForm
    from enumsol.trusted.space.product_forms import Ellipsoid
    from enumsol.trusted.space.space_uniqueness import LeafReference

    if not system.held:
        return LeafReference.of(system, said.codes, said.numbers, *said.more.tolist())
    if all(code == UNDECIDED for code in said.codes):
        return SlipForm.of(system, said.numbers)
    with np.errstate(over="ignore", invalid="ignore"):
        return Ellipsoid.of(system, said.codes, said.more / system.unit, said.numbers)
