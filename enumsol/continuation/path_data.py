"""Settings of a continuation, and the parts of a path: points, tangents, transition points, and how it ended."""

from __future__ import annotations

from dataclasses import asdict, astuple, dataclass, field, fields
from operator import add
from typing import TYPE_CHECKING, Any

from enumsol.errors import InvalidArgumentError
from enumsol.support.arguments import nonnegative_number, optional_callable, positive_integer, positive_number, shown
from enumsol.support.immutable import Sealed
from enumsol.support.messages import TextEnum

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from enumsol.model.statuses import ContactStatus
    from enumsol.roots.local_branch import LocalBranchTest
    from enumsol.support.array_types import Codes, Floats


@dataclass(frozen=True)
class Tangent(Sealed):
    """A direction in which a solution curve leaves a point.

    Attributes
    ----------
    statuses : tuple of p ContactStatus
        Statuses on the curve.
    dalpha : float
        Derivative of alpha with respect to the arclength; 0 on a vertical segment.
    dlambda : (p, 2) array, in 3D (p, 3)
        Derivatives of (lambda_n, lambda_t) [force].
    orientation : int
        +1 positively oriented (theory, (8.2)), -1 negatively, 0 undecided.
    codes, vector :
        The same in the variables of the continuation.
    """

    statuses: tuple[ContactStatus, ...]
    dalpha: float
    dlambda: Floats
    orientation: int
    codes: Codes
    vector: Floats

    def __repr__(self) -> str:
        names = ", ".join(status.value for status in self.statuses[:8])
        names += ", ..." if len(self.statuses) > 8 else ""
        return f"Tangent(dalpha={self.dalpha:+.3g}, orientation={self.orientation:+d}, [{names}])"


@dataclass(frozen=True, kw_only=True)
class ContinuationOptions:
    """Settings of `follow`; the defaults are those of paper, Section 6.

    Lengths and residuals are without units. Contact forces are measured in the energy norm relative to the load,
    sqrt(lambda' S lambda) / sqrt(g' S^-1 g), which is at most one at every solution, and alpha in units of
    ``alpha_scale``; the arclength is the square root of the sum of both squares. A path therefore does not depend on
    the units of force and length, and not on those of alpha when ``alpha_scale`` is None and the interval is finite.

    Attributes
    ----------
    eps, eps_prime : float
        Convergence of the corrections: norm of H, and length of the last correction.
    h_min, h_max, h_init : float
        Least, largest and initial step length.
    h_inc, h_dec : float
        Factors that lengthen and shorten a step.
    k_max, k_thr : int
        Most corrections in a step; a step with fewer than ``k_thr`` may be followed by a longer one.
    r : float or None
        The parameter of H [force / length]. None: for each node its own stiffness, 1 / sqrt(S_nn S_tt). Solutions do
        not depend on it.
    max_steps : int
        Accepted steps after which to stop.
    alpha_scale : float or None
        Change of alpha that counts as one. None: a twentieth of the interval, which is 1 on the paper's 0 .. 20; 1 for
        an interval that is not finite.
    transition_tolerance : float
        Accuracy to which transition points are located, at most 1e-8: the checks of steps rely on it.
    check_steps : bool
        Accept a step only when its end is the continuation of its start: in the same selection, or behind one located
        change of status. False is the paper's Algorithm 5.1 as printed; with long steps it may jump between branches.
    overshoot : float
        How far outside the interval the path is followed, in case it returns, in the units of alpha.
    choose : callable or None
        Called with the admissible tangents where several continue the path (theory, section 8.8); returns an index.
        None: the one that turns least.

    Examples
    --------
    >>> import enumsol
    >>> options = enumsol.ContinuationOptions(h_max=1.0, max_steps=100)
    >>> options.h_max, options.check_steps
    (1.0, True)
    """

    eps: float = 1e-6
    eps_prime: float = 1e-6
    h_min: float = 1e-5
    h_max: float = 1.0
    h_init: float = 0.05
    h_inc: float = 1.3
    h_dec: float = 0.5
    k_max: int = 10
    k_thr: int = 4
    r: float | None = None
    max_steps: int = 5000
    alpha_scale: float | None = None
    transition_tolerance: float = 1e-10
    check_steps: bool = True
    overshoot: float = 0.0
    choose: Callable[[Sequence[Tangent]], int] | None = None

    def __post_init__(self) -> None:
        lengths = ("eps", "eps_prime", "h_min", "h_max", "h_init", "h_inc", "h_dec", "transition_tolerance")
        for name in (*lengths, *(name for name in ("r", "alpha_scale") if getattr(self, name) is not None)):
            self._set(name, positive_number(getattr(self, name), f"options.{name}"))
        for name in ("k_max", "k_thr", "max_steps"):
            self._set(name, positive_integer(getattr(self, name), f"options.{name}"))
        self._set("overshoot", nonnegative_number(self.overshoot, "options.overshoot"))
        optional_callable(self.choose, "options.choose")
        self._require("check_steps", isinstance(self.check_steps, bool), "True or False")
        self._require("transition_tolerance", self.transition_tolerance <= 1e-8, "at most 1e-8")
        self._require("h_init", self.h_min <= self.h_init <= self.h_max, "h_min <= h_init <= h_max")
        self._require("h_inc", self.h_inc > 1, "a number > 1")
        self._require("h_dec", self.h_dec < 1, "a number between 0 and 1")
        self._require("k_thr", self.k_thr <= self.k_max, "0 < k_thr <= k_max")

    def _set(self, name: str, value: float) -> None:
        """Keep a number as the plain Python type, as files have it."""
        object.__setattr__(self, name, value)

    def _require(self, name: str, holds: bool, expected: str) -> None:
        if not holds:
            raise InvalidArgumentError(f"options.{name} is {shown(getattr(self, name))}; expected {expected}")

    def to_dict(self) -> dict[str, Any]:
        """The settings that can be saved: all but ``choose``."""
        values = asdict(self)
        del values["choose"]
        return values

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> ContinuationOptions:
        """Settings from a saved dictionary; names of other versions are ignored."""
        known = {item.name for item in fields(cls)}
        return cls(**{name: value for name, value in values.items() if name in known})


#: The arrays of a path, one row per point.
ARRAYS = ("alpha", "lambda_n", "lambda_t", "u_n", "u_t", "codes", "steps", "corrections", "arclength")
#: Another one of a body that nothing holds.
RIGID = "rigid_coordinates"


class PointKind(TextEnum):
    """Ways to come to a point of a path; members compare with their texts."""

    START = "start"
    #: An accepted step of the paper's Algorithm 5.1; the others were located.
    STEP = "step"
    TRANSITION = "transition"
    END = "end"


class PathStatus(TextEnum):
    """Why a path ended; members compare with their texts."""

    INTERVAL_LEFT = "interval left"
    CLOSED = "closed"
    #: It arrived at a point that another path has passed.
    VISITED = "visited"
    STEP_LIMIT = "step limit"
    #: A friction coefficient becomes negative.
    FRICTION = "friction"
    #: A body that nothing holds moves as a whole beyond max_rigid_displacement.
    RIGID_BOUND = "rigid bound"
    #: No direction keeps the orientation.
    DEAD_END = "dead end"
    #: No step was accepted, however short.
    STALLED = "stalled"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True)
class PathPoint(Sealed):
    """Point of a path.

    Attributes
    ----------
    alpha : float
    lambda_n, lambda_t, u_n, u_t : (p,) arrays; in 3D lambda_t and u_t are (p, 2)
        As in Root.
    statuses : tuple of p ContactStatus
        The selection on which the path leaves the point.
    kind : PointKind
        "start", "step" (an accepted step of the paper's Algorithm 5.1), "transition" or "end".
    rigid_coordinates : (r,) array or None
        Of a body that nothing holds: q of the rigid displacement N q.
    """

    alpha: float
    lambda_n: Floats
    lambda_t: Floats
    u_n: Floats
    u_t: Floats
    statuses: tuple[ContactStatus, ...]
    kind: PointKind
    rigid_coordinates: Floats | None = None


@dataclass(frozen=True)
class Transition:
    """A point at which the path changes its selection, or in 3D a fold within one.

    Attributes
    ----------
    point : int
        Its index among the points of the path.
    alpha : float
    before, after : tuple of p ContactStatus
    nodes : tuple of int
        Contact nodes (row numbers) whose status changes; none at a fold within a selection.
    dalpha_before, dalpha_after : float
        Derivative of alpha with respect to the arclength on both sides; a change of sign is a fold. Zero, but for
        rounding, at a fold within a selection.
    local_test : LocalBranchTest or None
        Whether a local Lipschitz branch exists there; None when too many selections hold to tell.
    alternatives : tuple of Tangent
        Further directions in which solutions leave the point (paper, Remark 5.1); not kept in files.
    """

    point: int
    alpha: float
    before: tuple[ContactStatus, ...]
    after: tuple[ContactStatus, ...]
    nodes: tuple[int, ...]
    dalpha_before: float
    dalpha_after: float
    local_test: LocalBranchTest | None
    alternatives: tuple[Tangent, ...] = field(default=(), repr=False)


@dataclass(frozen=True)
class PathStats:
    """Statistics of the step control.

    Attributes
    ----------
    accepted : int
        Accepted steps.
    not_converged : int
        Steps rejected because the corrections did not converge.
    refused : int
        Steps rejected because their end was not the continuation of their start.
    corrections : int
        Corrections in all, those of rejected steps included.
    selection_changes : int
        Times that Step 8 changed the selection.
    seconds : float
    """

    accepted: int = 0
    not_converged: int = 0
    refused: int = 0
    corrections: int = 0
    selection_changes: int = 0
    seconds: float = 0.0

    @property
    def rejected(self) -> int:
        """Rejected steps."""
        return self.not_converged + self.refused

    def __add__(self, other: PathStats) -> PathStats:
        return PathStats(*map(add, astuple(self), astuple(other)))
