"""Path: a followed branch, with its plots, files and continuation."""

from __future__ import annotations

from typing import TYPE_CHECKING

from enumsol.continuation.follower import Follower
from enumsol.continuation.path_data import PathData, PathStatus
from enumsol.continuation.path_files import load_path, save_path
from enumsol.continuation.path_plots import draw_path
from enumsol.continuation.start import Start
from enumsol.continuation.tangents import curve_tangent
from enumsol.continuation.transitions import CurvePoint
from enumsol.errors import InvalidArgumentError

if TYPE_CHECKING:
    import os

    from enumsol.continuation.continuation_options import ContinuationOptions
    from enumsol.continuation.parameter_path import SmoothPath
    from enumsol.model.problem import ContactProblem
    from enumsol.model.problem3d import ContactProblem3D
    from enumsol.support.arguments import AlphaLike


class Path(PathData):
    """A followed branch of solutions: a sequence of its points.

    Attributes
    ----------
    alpha : (m,) array
    lambda_n, lambda_t, u_n, u_t : (m, p) arrays; in 3D lambda_t and u_t are (m, p, 2)
    codes : (m, p) array of status codes
        On which the path leaves each point.
    kinds : tuple of m PointKind
        "start", "step", "transition" or "end".
    steps : (m,) array
        Step length that led to the point; 0 where it was located.
    corrections : (m,) array
        Corrections that it took.
    arclength : (m,) array
        Without units, see ContinuationOptions.
    transitions : tuple of Transition
    status : PathStatus
        Why the path ended: "interval left", "closed", "visited", "step limit", "friction", "rigid bound", "dead end",
        "stalled" or "interrupted".
    message : str
        The same as a sentence, with advice.
    orientation : int
        +1 when it was followed in the positive orientation of theory, (8.2), else -1.
    interval : (float, float)
    options : ContinuationOptions
        With the ``alpha_scale`` that was used.
    next_step : float
        Step length with which to go on.
    stats : PathStats
    node_ids : tuple
    rigid_coordinates : (m, r) array or None
        Of a body that nothing holds: q of the rigid displacement N q.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.one_node_triangle()
    >>> path = enumsol.follow(problem, enumsol.newton(problem, 1), interval=(0, 10))
    >>> path.status, float(path.alpha[0]), float(path.alpha[-1])
    ('interval left', 1.0, 10.0)
    """

    plot = draw_path
    save = save_path

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Path:
        """Read a path that `save` wrote.

        Raises
        ------
        InvalidArgumentError
            The file does not hold a path.
        """
        return load_path(cls, path)

    def resume(
        self,
        problem: ContactProblem | ContactProblem3D | None = None,
        *,
        interval: tuple[AlphaLike, AlphaLike] | None = None,
        options: ContinuationOptions | None = None,
        smooth_path: SmoothPath | None = None,
    ) -> Path:
        """The path continued from its end: all its points and the new ones.

        Parameters
        ----------
        problem : ContactProblem, ContactProblem3D or None
            Needed for a path that was loaded from a file.
        interval, options : as in follow
            None: as before. The step length is the one with which the path ended.
        smooth_path : SmoothPath or None
            Needed for a loaded path that was followed along one.

        Raises
        ------
        InvalidArgumentError
            The problem is missing, or the path ended in a way from which it cannot go on.
        """
        body = self._problem if problem is None else problem
        if body is None:
            raise InvalidArgumentError("problem is missing; a path loaded from a file needs it: path.resume(problem)")
        if self.status in (PathStatus.CLOSED, PathStatus.DEAD_END):
            raise InvalidArgumentError(f"the path cannot go on: {self.message}")
        span = self.interval if interval is None else interval
        smooth = self._smooth_path if smooth_path is None else smooth_path
        start = Start(body, self[-1], span, self.options if options is None else options, smooth)
        codes = tuple(int(code) for code in self.codes[-1])
        vector = curve_tangent(start.equation, codes, start.x, self.orientation)
        if vector is None:
            raise InvalidArgumentError(
                "the path ends where its tangent is not unique; start anew with follow(tangent=...)"
            )
        follower = Follower(Path, start, CurvePoint(start.x, codes, vector), self.orientation)
        follower.h = min(max(self.next_step, start.options.h_min), start.options.h_max)
        return self.joined(follower.run())
