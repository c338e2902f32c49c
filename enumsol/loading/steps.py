"""The steps of a history: what the load and the friction are at the end of each."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.model.problem import ContactProblem
from enumsol.support.arguments import alpha_value, exact_number, shown
from enumsol.support.array_arguments import plain_array, real_array
from enumsol.support.immutable import Sealed, sealed
from enumsol.support.messages import shortened
from enumsol.support.saved import table_text

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd

    from enumsol.model.problem3d import ContactProblem3D
    from enumsol.support.array_types import Alpha, AlphaLike, ArrayLike, Floats

    Problem = ContactProblem | ContactProblem3D

_EXPECTED = (
    "expected a sequence of alphas, of loads (n,) or of LoadStep, an array of loads (k, n), or a table with the "
    "columns alpha, friction or f0 .. f{last}"
)


@dataclass(frozen=True, eq=False)
class LoadStep(Sealed):
    """The end of one step of a history.

    Attributes
    ----------
    alpha : float, Fraction or None
        The parameter of the problem's own load and friction. None where neither is used.
    friction : float, (p,) array, in 3D also a pair of them, or None
        Coefficients of this step [-]; None: those of the problem at alpha.
    load : (n,) array or None
        The load of this step [force]; None: that of the problem at alpha.

    Raises
    ------
    InvalidArgumentError
        A value is no finite number.

    Examples
    --------
    >>> import enumsol
    >>> enumsol.LoadStep("1/2", friction=0.3)
    LoadStep(alpha=0.5, friction=0.3)
    """

    alpha: Alpha | None = None
    friction: Any = None
    load: Any = None

    def __init__(
        self, alpha: AlphaLike | None = None, friction: ArrayLike | None = None, load: ArrayLike | None = None
    ) -> None:
        values: dict[str, Any] = {
            "alpha": None if alpha is None else alpha_value(alpha),
            "friction": None if friction is None else _array(friction, "friction"),
            "load": None if load is None else _array(load, "load"),
        }
        self.__dict__.update(values)

    def on(self, problem: Problem, number: int) -> LoadStep:
        """Step with arrays of the problem's shapes and with an alpha.

        Raises
        ------
        InvalidArgumentError
            It does not fit the problem; the message has the step's number.
        """
        load, friction, alpha = self.load, self.friction, self.alpha
        if load is not None and load.shape != (problem.n,):
            raise InvalidArgumentError(f"step {number}: load has shape {load.shape}; expected (n,) = ({problem.n},)")
        if friction is not None:
            friction = _coefficients(friction, problem, number)
        moves = load is None and problem.load_slope is not None
        if alpha is None and (moves or (friction is None and np.any(problem.friction_slope))):
            raise InvalidArgumentError(
                f"step {number} has no alpha, on which the problem's friction or load depends; expected one"
            )
        step = LoadStep(alpha, friction, load)
        if friction is None:
            try:
                problem.friction_at(step.exact_alpha)
            except InvalidArgumentError as error:
                raise InvalidArgumentError(f"step {number}: {error}") from None
        return step

    @property
    def exact_alpha(self) -> Fraction:
        """The alpha, 0 where there is none."""
        return Fraction(0 if self.alpha is None else self.alpha)

    def between(self, other: LoadStep, part: Fraction) -> LoadStep:
        """The step on the straight way to another one; both fit one problem."""
        alpha = self.exact_alpha + part * (other.exact_alpha - self.exact_alpha)
        share = float(part)

        def mixed(a: Floats | None, b: Floats | None) -> Floats | None:
            return None if a is None or b is None else (1.0 - share) * a + share * b

        if (self.load is None) != (other.load is None) or (self.friction is None) != (other.friction is None):
            raise InvalidArgumentError(
                "refine is True, and of two steps one has a load or a friction and the other has none; expected both "
                "to have one, or neither"
            )
        both = self.alpha is not None and other.alpha is not None
        return LoadStep(alpha if both else None, mixed(self.friction, other.friction), mixed(self.load, other.load))

    def __repr__(self) -> str:
        parts = [] if self.alpha is None else [f"alpha={float(self.alpha):g}"]
        if self.friction is not None:
            low, high = float(np.min(self.friction)), float(np.max(self.friction))
            parts.append(f"friction={low:g}" if low == high else f"friction in [{low:g}, {high:g}]")
        if self.load is not None:
            parts.append(f"load up to {float(np.max(np.abs(self.load), initial=0.0)):g}")
        return f"LoadStep({', '.join(parts)})"


def way_to(problem: Problem, step: LoadStep) -> tuple[LoadStep, LoadStep]:
    """From where to where the load goes in a first step: from no load, with the friction of the step throughout."""
    load = problem.load_at(step.exact_alpha) if step.load is None else step.load
    start, end = (LoadStep(step.alpha, step.friction, part) for part in (0.0 * load, load))
    return start, end


def steps_of(problem: Problem, steps: object) -> tuple[LoadStep, ...]:
    """The steps that a user gives, fitted to a problem.

    Raises
    ------
    InvalidArgumentError
        They cannot be used.
    """
    expected = _EXPECTED.format(last=problem.n - 1)
    if hasattr(steps, "columns"):
        found = _from_table(problem, cast("pd.DataFrame", steps), expected)
    elif isinstance(steps, (str, bytes, Mapping)) or not isinstance(steps, Iterable):
        raise InvalidArgumentError(f"steps is {shown(steps)}; {expected}")
    else:
        found = [_step(item, k + 1, expected) for k, item in enumerate(steps)]
    if not found:
        raise InvalidArgumentError(f"steps is empty; {expected}")
    return tuple(step.on(problem, k + 1) for k, step in enumerate(found))


def read_steps(file: str | Path) -> pd.DataFrame:
    """The table of steps in a CSV file, its numbers as they stand there.

    Raises
    ------
    InvalidArgumentError
        The file cannot be read.
    """
    import pandas as pd

    try:
        return pd.read_csv(table_text(file), skipinitialspace=True, dtype=str, keep_default_na=False, comment="#")
    except OSError as error:
        raise InvalidArgumentError(f"steps {file} cannot be read ({error.strerror}); expected a CSV file") from error
    except ValueError as error:
        why = shortened(str(error).removeprefix("Error tokenizing data. C error: "))
        raise InvalidArgumentError(f"steps {file} is not a table ({why}); expected a CSV file with a header") from error


def _step(item: ArrayLike | LoadStep, number: int, expected: str) -> LoadStep:
    if isinstance(item, LoadStep):
        return item
    try:
        if isinstance(item, str) or exact_number(item) is not None:
            return LoadStep(alpha_value(item))
        if np.ndim(item) == 1:
            return LoadStep(load=item)
    except InvalidArgumentError as error:
        raise InvalidArgumentError(f"step {number}: {error}") from None
    except (TypeError, ValueError):
        pass
    raise InvalidArgumentError(f"step {number} is {shown(item)}; {expected}")


def _from_table(problem: Problem, table: pd.DataFrame, expected: str) -> list[LoadStep]:
    names = [str(name).strip() for name in table.columns]
    components = [f"f{k}" for k in range(problem.n)]
    loads = [name for name in names if name not in ("alpha", "friction")]
    unknown = [name for name in loads if name not in set(components)]
    if unknown or not names or len(set(names)) < len(names):
        raise InvalidArgumentError(f"steps has the columns {shortened(', '.join(names))}; {expected}")
    found = []
    for k in range(len(table)):
        row = dict(zip(names, table.iloc[k].tolist(), strict=True))
        try:
            given = {name: _cell(row[name], name) for name in ("alpha", "friction") if name in row}
            load = None
            if loads:
                load = problem.load_at(given.get("alpha") or 0) if "alpha" in given else problem.f.copy()
                load[[components.index(name) for name in loads]] = [float(_cell(row[name], name)) for name in loads]
            found.append(LoadStep(**given, load=load))
        except InvalidArgumentError as error:
            raise InvalidArgumentError(f"step {k + 1}: {error}") from None
    return found


def _cell(value: object, name: str) -> Any:
    """A number of a table."""
    return alpha_value(value, name) if name == "alpha" else float(alpha_value(value, name))


def _array(value: ArrayLike, name: str) -> Any:
    if (number := exact_number(value)) is not None:
        return float(number)
    if isinstance(value, tuple):  # a pair of coefficients in 3D, each a number or an array
        value = np.stack(np.broadcast_arrays(*(plain_array(part, name, error=InvalidArgumentError) for part in value)))
        return sealed(real_array(value.T, name, error=InvalidArgumentError))
    return sealed(real_array(value, name, error=InvalidArgumentError))


def _coefficients(friction: object, problem: Problem, number: int) -> Floats:
    wanted = problem.slip_offset.shape
    values = np.asarray(friction, dtype=np.float64)
    if values.shape == (problem.p,) and len(wanted) == 2:
        values = values[:, None]
    try:
        values = np.broadcast_to(values, wanted).copy()
    except ValueError:
        raise InvalidArgumentError(
            f"step {number}: friction has shape {values.shape}; expected a number, or the shape {wanted}"
        ) from None
    if np.any(values < 0):
        raise InvalidArgumentError(f"step {number}: friction is {np.min(values):g}; expected F >= 0")
    return sealed(values)
