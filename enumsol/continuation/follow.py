"""Piecewise smooth Moore-Penrose continuation (theory, section 8): one branch of solutions from a start."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from enumsol.continuation.follower import Follower
from enumsol.continuation.path import Path
from enumsol.continuation.start import Start
from enumsol.continuation.tangents import Tangent, admissible_tangents
from enumsol.continuation.transitions import ACTIVE_TOLERANCE, TangentPoint
from enumsol.errors import InvalidArgumentError
from enumsol.support.arguments import direction_value, row_number, shown

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.continuation.continuation_options import ContinuationOptions
    from enumsol.continuation.parameter_path import SmoothPath
    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import AlphaLike


class AmbiguousStart(InvalidArgumentError):  # noqa: N818 (reads as a state of the start)
    """The direction does not single out one tangent at the start; ``tangents`` lists all that are admissible.

    Attributes
    ----------
    tangents : tuple of Tangent
        Pass the index of one of them as ``tangent=`` to `follow`.
    """

    def __init__(self, message: str, tangents: Sequence[Any]) -> None:
        super().__init__(message)
        self.tangents = tuple(tangents)


def follow(
    problem: AnyProblem,
    start: Any,
    direction: int = +1,
    interval: tuple[AlphaLike, AlphaLike] | None = None,
    options: ContinuationOptions | None = None,
    smooth_path: SmoothPath | None = None,
    *,
    tangent: int | None = None,
    visited: Sequence[Path] = (),
) -> Path:
    """The branch of solutions through a start, in one direction, by the paper's Algorithm 5.1.

    Predictions along the tangent are corrected by the piecewise smooth Moore-Penrose method. When corrections fail even
    for the shortest step, the selection is changed at the test function that vanishes next (Step 8). Transition points
    are located by the sign changes of the test functions. With ``options.check_steps`` every step is accepted only as
    the proven-in-floats continuation of the one before, so that long steps cannot jump to another branch unnoticed.

    Works on the problem condensed to its contact nodes: A is factorised once for 2p + a few right-hand sides, a
    correction costs one dense solve of size 2p + 1 (3p in place of 2p in 3D). The arclength is defined in
    ContinuationOptions. In 3D a slipping node keeps its status whatever the direction, and a path may turn back while
    all statuses stay the same: such folds are located and are among ``path.transitions`` (theory, section 8.12).

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    start : Root, PathPoint, or tuple (alpha, lambda_n, lambda_t)
        A root, for example of enumerate_roots, newton or ``graph.starting_points()``. Of a body that nothing holds the
        tuple is (alpha, lambda_n, lambda_t, rigid_coordinates); its path ends where ``max_rigid_displacement`` does.
    direction : {+1, -1}
        +1 is the positively oriented tangent (theory, (8.2)); alpha then increases where the root's index is +1.
    interval : pair of alphas or None
        Range of alpha; infinite ends are allowed. None: all alpha with F >= 0.
    options : ContinuationOptions or None
    smooth_path : SmoothPath or None
        Friction and load that are not affine in alpha.
    tangent : int or None
        Index into `start_tangents` of the direction to take, at a start where several are admissible.
    visited : sequence of Path
        The path ends where it arrives at one of them.

    Returns
    -------
    Path
        Its ``status`` and ``message`` say why it ended.

    Raises
    ------
    AmbiguousStart
        Several tangents, or none, have the asked orientation at a degenerate start; the error lists them.
    InvalidArgumentError
        The start is not a root or an argument is out of range.
    NotHeldError
        Some rigid displacement of a body that nothing holds moves no contact node.
    Interrupted, OutOfMemoryError
        On Ctrl-C, or where the memory does not suffice; ``partial`` holds the path so far.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.one_node_triangle()
    >>> stick = enumsol.enumerate_roots(problem, alpha=5)[2]
    >>> path = enumsol.follow(problem, stick, direction=-1, interval=(0, 10))
    >>> [(item.before[0].value, item.after[0].value, round(item.alpha, 6)) for item in path.folds]
    [('stick', 'slip-', 2.666667)]
    """
    direction = direction_value(direction)
    if not isinstance(visited, (list, tuple)) or not all(isinstance(path, Path) for path in visited):
        raise InvalidArgumentError(f"visited is {shown(visited)}; expected a list of Path")
    first = Start(problem, start, interval, options, smooth_path)
    chosen = _choose(first, direction, tangent)
    point = TangentPoint(first.x, chosen.codes, chosen.vector)
    sign = chosen.orientation or direction
    return Follower(Path, first, point, sign, visited).run()


def start_tangents(
    problem: AnyProblem,
    start: Any,
    interval: tuple[AlphaLike, AlphaLike] | None = None,
    options: ContinuationOptions | None = None,
    smooth_path: SmoothPath | None = None,
) -> tuple[Tangent, ...]:
    """All tangents along which solutions leave a root, in the order of their selections (paper, Remark 5.1).

    Two at a regular root and at an ordinary transition point; more at a bifurcation point. ``tangent=k`` of `follow`
    takes the k-th. Parameters are those of `follow`.
    """
    first = Start(problem, start, interval, options, smooth_path)
    return admissible_tangents(first.equation, first.x, ACTIVE_TOLERANCE)


def _choose(first: Start, direction: int, index: int | None) -> Tangent:
    tangents = admissible_tangents(first.equation, first.x, ACTIVE_TOLERANCE)
    if index is not None:
        count = len(tangents)
        return tangents[row_number(index, "tangent", count, f"an index below {count} of start_tangents")]
    fitting = [t for t in tangents if t.orientation == direction]
    if len(fitting) != 1:
        listing = "; ".join(f"{k}: {t!r}" for k, t in enumerate(tangents)) or "none"
        raise AmbiguousStart(
            f"at the start {len(fitting)} of {len(tangents)} admissible tangents have orientation {direction:+d}; "
            f"expected one; choose with tangent=k among {listing}",
            tangents,
        )
    return fitting[0]
