"""What a mesh and its options describe: bodies, supports, loads and contacts, as arrays by nodes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError
from enumsol.fem import conditions
from enumsol.fem.bases import NodalBasis
from enumsol.fem.contacts import Contacts, Group
from enumsol.fem.meshes import PartedMesh
from enumsol.fem.options import FRICTION, Options
from enumsol.model.problem import given_friction
from enumsol.support.arguments import finite_number

if TYPE_CHECKING:
    from enumsol.fem.options import Coefficients
    from enumsol.support.array_types import Floats

#: Options that say what a part of the boundary is for.
_USES = ("contact", "clamp", "symmetry", "displacement", "spring", "load", "load_slope", "pressure", "pressure_slope")


@dataclass(frozen=True)
class SceneData:
    """Data of a scene, which are checked, printed, drawn and made a problem of.

    Attributes
    ----------
    mesh : PartedMesh
    options : Options
    body : NodalBasis
    held : Held
    contacts : Contacts
    forces, slope : (N, d) arrays
        On all nodes, and their derivatives with respect to alpha [force].
    springs : (d N, d N) csc_array
    lame : (2,) or (M, 2) array
    pieces : list of BodyPiece
        The connected bodies.
    """

    mesh: PartedMesh
    options: Options
    body: NodalBasis
    held: conditions.Held
    contacts: Contacts
    forces: Floats
    slope: Floats
    springs: sp.csc_array
    lame: Floats
    pieces: list[conditions.BodyPiece]

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return int(self.mesh.points.shape[1])

    @cached_property
    def gaps(self) -> Floats:
        """Gaps of the contact nodes, (p,) [length]."""
        return self.contacts.gaps + of_rows(self.options.gap, "gap", self.contacts.parts, finite_number, 0.0)

    @cached_property
    def coefficients(self) -> dict[str, Any]:
        """Coefficients of friction and their slopes, as arguments of the problem."""
        options = self.options
        F, slope = self._along("friction", options.friction, options.friction_slope)
        second = [name for name in FRICTION[2:] if getattr(options, name) is not None]
        if self.dimension == 2:
            if second:
                raise InvalidArgumentError(
                    f"{second[0]} is given for a plane body, which has one tangent; expected it in 3D"
                )
            return {"friction": F, "friction_slope": slope}
        F2, slope2 = (F, slope)
        if second:
            F2, slope2 = self._along("friction2", options.friction2, options.friction2_slope)
        return {"friction": (F, F2), "friction_slope": (slope, slope2)}

    def _along(self, name: str, friction: Coefficients, friction_slope: Coefficients) -> tuple[Floats, Floats]:
        """Coefficients along one axis, and their slopes, of all contact nodes."""
        F, slope = given_friction(friction, friction_slope)
        other = None if friction is None else 0.0
        parts = self.contacts.parts
        return of_rows(F, name, parts, finite_number), of_rows(slope, f"{name}_slope", parts, finite_number, other)

    @property
    def gaps_of_groups(self) -> list[tuple[Group, Floats]]:
        """The groups of contact nodes, each with the gaps of its own."""
        groups = self.contacts.groups
        return list(zip(groups, np.split(self.gaps, np.cumsum([group.count for group in groups])[:-1]), strict=True))

    @cached_property
    def hold(self) -> sp.csc_array:
        """A stiffness of supports and springs, (d N, d N)."""
        return conditions.holding(self.held.supports, self.springs)

    def uses(self, part: str) -> list[str]:
        """What the options say of a part of the boundary."""
        found = [name for name in _USES if part in _names(getattr(self.options, name))]
        pairs = [group.pair for group in self.contacts.groups if group.pair is not None]
        found += [f"contact nodes of the pair {pair}" for pair in pairs if part == pair.slave]
        return found + [f"facets of the pair {pair}" for pair in pairs if part == pair.master]


def _names(value: str | Iterable[str] | None) -> Sequence[str]:
    """The parts that an option names."""
    return [value] if isinstance(value, str) else () if value is None else list(value)


def of_rows(
    value: object, name: str, parts: Sequence[str], read: Callable[[Any, str], Any], other: object = None
) -> Floats:
    """A value of all contact nodes, or (p, ...) by the names of the parts of the boundary that they belong to.

    ``other`` is that of parts that are not named; None: all have to be.

    Raises
    ------
    InvalidArgumentError
        It is not that, or a name is none of the parts.
    """
    if not isinstance(value, Mapping):
        return np.array(read(value, name))
    given = {part: read(own, f"{name} of {part}") for part, own in conditions.by_part(value, name).items()}
    present = list(dict.fromkeys(parts))
    for part in given:
        if part not in present:
            raise InvalidArgumentError(
                f"{name} is given for {part}, which has no contact nodes; expected some of {', '.join(present)}"
            )
    missing = [part for part in present if part not in given]
    if missing and other is None:
        raise InvalidArgumentError(f"{name} is not given for {', '.join(missing)}; expected it for all contact parts")
    return np.array([given.get(part, other) for part in parts])
