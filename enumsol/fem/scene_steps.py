"""Steps of a history of a scene: each gives some of the loads of `mesh_problem` anew."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidArgumentError, InvalidProblemError
from enumsol.fem.conditions import FRICTION, is_pair
from enumsol.fem.mesh_problems import scene_of
from enumsol.loading.steps import LoadStep
from enumsol.support.arguments import alpha_value, shown

if TYPE_CHECKING:
    from enumsol.fem.scenes import Scene
    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import Alpha, Floats

#: Options that a step may give anew.
_LOADS = (
    "displacement",
    "temperature",
    *(
        name + end
        for name in ("load", "pressure", "body_force", "centrifugal", "force", "moment")
        for end in ("", "_slope")
    ),
)


def scene_steps(scene: Scene, steps: Iterable[Mapping[str, Any]]) -> list[LoadStep]:
    """Steps for `histories` on the problem of a scene, each by what it gives anew, as ``[[steps]]`` in a TOML file.

    A step does not build on the step before: what it does not give is as in the scene. By names of parts, it gives
    values of those that it names.

    Parameters
    ----------
    scene : Scene
    steps : sequence of mappings
        Any of ``alpha``; ``friction``, as in `LoadStep`, in 3D also as a pair along both axes, or by names of all
        contact parts; ``displacement`` of nodes without contact that the scene holds; and, as in `mesh_problem`,
        ``temperature``, ``load``, ``pressure``, ``body_force``, ``centrifugal``, ``force`` and ``moment``, the last six
        also with ``_slope``.

    Returns
    -------
    list of LoadStep
        With loads, if a step gives any.

    Raises
    ------
    InvalidArgumentError
        A step is not of that form, or lacks the alpha on which its load depends; or another code made the stiffness.
    InvalidProblemError
        A step changes more than loads, displacements of nodes without contact, and friction.

    Examples
    --------
    >>> import enumsol
    >>> from enumsol import fem
    >>> scene = fem.mesh_scene(
    ...     fem.rectangle(2, 2).parted(), young=2.5, poisson=0.25, contact="bottom", clamp="left", friction=0.5
    ... )
    >>> steps = fem.scene_steps(scene, [{"pressure": {"top": 1}}, {"pressure": {"top": 1}, "force": {"right": (1, 0)}}])
    >>> enumsol.histories(scene.problem(), steps).counts
    (1, 1)
    """
    tables = list(steps)
    if scene.stiffness is not None:
        raise InvalidArgumentError("the stiffness of the scene is of another code; expected its steps in the deck")
    for number, table in enumerate(tables, 1):
        _check(number, table)
    first, loaded = scene.problem(), any(table.keys() & {*_LOADS} for table in tables)
    return [_step(scene, first, number, table, loaded) for number, table in enumerate(tables, 1)]


def refuse_other(first: AnyProblem, other: AnyProblem, step: str, instead: str = "") -> None:
    """Refuse a step to a problem that differs from the first by more than its load and friction.

    Raises
    ------
    InvalidProblemError
        The sentence begins with ``step`` and says what differs.
    """
    what = _differs(first, other)
    if what is not None:
        raise InvalidProblemError(
            f"{step} changes {what}; expected steps that change loads, friction and displacements of nodes without "
            f"contact{instead}"
        )


def _check(number: int, table: object) -> None:
    known = ("alpha", "friction", *_LOADS)
    if not isinstance(table, Mapping):
        raise InvalidArgumentError(f"step {number} is {shown(table)}; expected some of {', '.join(known)}")
    unknown = [str(name) for name in table if name not in known]
    if unknown:
        raise InvalidArgumentError(f"step {number} has {', '.join(unknown)}; expected some of {', '.join(known)}")


def _step(scene: Scene, first: AnyProblem, number: int, table: Mapping[str, Any], loaded: bool) -> LoadStep:
    options, friction = scene.options, table.get("friction")
    given: dict[str, Any] = {name: _given(getattr(options, name), table[name]) for name in _LOADS if name in table}
    along = isinstance(friction, Mapping) or (scene.dimension == 3 and is_pair(friction))
    if along:
        given |= {**dict.fromkeys(FRICTION), "friction": friction}
    try:
        alpha = alpha_value(table["alpha"]) if "alpha" in table else None
        problem = scene_of(scene.mesh, replace(options, **given)).problem() if given else first
        refuse_other(first, problem, "it")
        return LoadStep(alpha, problem.friction if along else friction, _load(problem, alpha) if loaded else None)
    except (InvalidArgumentError, InvalidProblemError) as error:
        raise type(error)(f"step {number}: {error}") from error


def _load(problem: AnyProblem, alpha: Alpha | None) -> Floats:
    if alpha is None and problem.load_slope is not None:
        raise InvalidArgumentError("it has no alpha, on which its load depends; expected one")
    return problem.load_at(0 if alpha is None else alpha)


def _given(own: object, value: object) -> object:
    """An option of a scene with what a step says of it: of the parts that it names, or as a whole."""
    return {**own, **value} if isinstance(own, Mapping) and isinstance(value, Mapping) else value


def _differs(first: AnyProblem, other: AnyProblem) -> str | None:
    """Data that two problems do not share but for load and friction, in words."""
    if first.p != other.p or (first.n == other.n and (first.Bn != other.Bn).nnz):
        return "which pairs are in contact, or what is held"
    if first.n != other.n or (first.A != other.A).nnz:
        return "what is held"
    if np.any(first.gap != other.gap) or np.any(first.slip_offset != other.slip_offset):
        return "the displacement of nodes that are in contact or faced by such"
    return None
