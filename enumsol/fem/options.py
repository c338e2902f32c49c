"""Options that describe what a mesh stands for, as `mesh_problem` takes them, and pairs of coefficients of friction."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

from enumsol.errors import InvalidArgumentError
from enumsol.fem.mesh_files import read_mesh
from enumsol.model.problem import given_friction, old_friction
from enumsol.support.arguments import shown

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Literal

    from enumsol.support.array_types import ArrayLike

    Names = str | Sequence[str]
    Vectors = Mapping[str, ArrayLike] | None
    Plane = Literal["strain", "stress"]
    Coefficients = float | Mapping[str, float] | None
    Written = Callable[[str, str, str], str]


#: Options that are coefficients of friction along the first axis and along the second.
FRICTION = "friction", "friction_slope", "friction2", "friction2_slope"


@dataclass(frozen=True)
class Options:
    """Options of `mesh_problem`, which says what each stands for."""

    young: float | Mapping[str, float]
    poisson: float | Mapping[str, float]
    contact: Names
    pairs: Sequence[Sequence[Any]]
    plane: Plane | Mapping[str, Plane] | None
    thickness: float | Mapping[str, float]
    friction: Coefficients
    friction_slope: Coefficients
    friction2: Coefficients
    friction2_slope: Coefficients
    axis: ArrayLike | None
    clamp: Names
    symmetry: Names
    displacement: Mapping[str, Sequence[Any]] | None
    spring: Vectors
    load: Vectors
    load_slope: Vectors
    pressure: Mapping[str, float] | None
    pressure_slope: Mapping[str, float] | None
    body_force: ArrayLike | Mapping[str, ArrayLike] | None
    gap: float | Mapping[str, float]
    obstacle: Mapping[str, Sequence[float]] | None
    max_rigid_displacement: float | Literal["auto"] | None
    groups: str | None

    def with_friction_along_axes(self, dimension: int) -> Options:
        """Options without pairs of coefficients, which are those along two axes in 3D, and with a coefficient.

        Raises
        ------
        InvalidArgumentError
            A pair is given where one coefficient is expected.
        """
        F, slope = self.friction, self.friction_slope
        if F is slope is None:
            F, slope = given_friction(None, None)
        given = dict(zip(FRICTION, (F, slope, self.friction2, self.friction2_slope), strict=True))
        return replace(self, **along_axes(dimension, given, _in_python))


def refuse_old_friction(source: object, options: Mapping[str, Any], written: Written) -> Any:
    """Mesh, read only if an option is a pair; pairs in 2D are refused in the words of a file or a command.

    ``written`` is how a number is given for an option and a part, "" for all parts.

    Raises
    ------
    InvalidArgumentError
        The sentence says what to write.
    """
    if not any(map(_is_pair, (own for name in FRICTION for _, own in _by_part(options.get(name))))):
        return source
    mesh = read_mesh(source, options.get("groups"))
    along_axes(mesh.points.shape[1], options, written)
    return mesh


def along_axes(dimension: int, options: Mapping[str, Any], written: Written) -> dict[str, Any]:
    """Options without pairs, which are coefficients along two axes in 3D, and are refused in 2D."""
    found = dict(options)
    for name in FRICTION:
        for part, own in _by_part(options.get(name)):
            if not _is_pair(own) or (dimension == 3 and not name.startswith("friction2")):
                continue
            instead = old_friction(own, *(partial(written, option, str(part)) for option in (name, f"{name}_slope")))
            more = "" if dimension == 3 or name.endswith("_slope") else f": {instead}"
            raise InvalidArgumentError(
                f"{name}{part and f' of {part}'} is the pair {shown(own)}; expected one coefficient{more}"
            )
    pairs = [name for name in FRICTION if any(_is_pair(own) for _, own in _by_part(options.get(name)))]
    if not pairs:
        return found
    second = [name for name in ("friction2", "friction2_slope") if options.get(name) is not None]
    if second:
        raise InvalidArgumentError(f"{pairs[0]} is a pair, and {second[0]} is given; expected one of the two")
    for name in ("friction", "friction_slope"):
        other, value = name.replace("friction", "friction2"), options.get(name)
        if isinstance(value, Mapping):
            both = {part: own if _is_pair(own) else (own, own) for part, own in value.items()}
            found[name], found[other] = ({part: own[k] for part, own in both.items()} for k in (0, 1))
        elif value is not None:
            found[name], found[other] = value if _is_pair(value) else (value, value)
    return found


def _is_pair(value: object) -> bool:
    return isinstance(value, (tuple, list)) and len(value) == 2


def _by_part(value: object) -> list[tuple[Any, Any]]:
    """Values by part, "" for all parts."""
    return list(value.items()) if isinstance(value, Mapping) else [("", value)]


def _in_python(option: str, part: str, number: str) -> str:
    return f'{option}={{"{part}": {number}}}' if part else f"{option}={number}"
