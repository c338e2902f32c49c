"""Isolated solutions in 3D."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.roots.root import ContactState, Enclosure, node_table, root_heading, root_html

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from enumsol.condensation.condensed import CondensedProblem3D

    Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Root3D(ContactState):
    """An isolated solution in 3D at one alpha.

    Attributes
    ----------
    statuses : tuple of p ContactStatus
        OPEN, STICK or SLIP. A node in contact whose coefficients are both 0 slips wherever u_t is not 0.
    lambda_n, u_n : (p,) arrays
        Normal contact forces [force], and Bn u - gap [length].
    lambda_t, u_t : (p, 2) arrays
        Along the local axes [force, length].
    slip_angle : (p, 2) array
        Bounds of the angle of F u_t in the local axes, the lower one in [-pi, pi); nan where the node does not slip
        against friction [radians].
    index : int or None
        Local degree: the sign of the Jacobian determinant of the normal map (theory, section 12.4).
    regular : bool
        Every condition holds strictly. Otherwise it is the only solution (theory, section 12.6), and ``active`` has for
        every node the statuses that may hold.
    margin : float
        The least slack of the conditions, in scaled units [-].
    enclosure : Enclosure or None
        Proven bounds, with shapes (p, 2) and, of tangential components, (p, 2, 2): lower and upper ones last.

    Examples
    --------
    >>> import enumsol
    >>> root = enumsol.enumerate_roots(enumsol.gallery.one_node_3d(), alpha=0)[0]
    >>> root.statuses, root.lambda_t.shape
    ((ContactStatus.SLIP,), (1, 2))
    """

    slip_angle: Array
    index: int | None
    regular: bool
    margin: float
    enclosure: Enclosure | None = field(repr=False, compare=False)
    _condensed: CondensedProblem3D = field(repr=False, compare=False)

    @property
    def u(self) -> Array:
        """Displacement of all degrees of freedom, shape (n,) [length]; computed at every access."""
        forces = np.concatenate([self.lambda_n, self.lambda_t.ravel(order="F")])
        return self._condensed.displacement(self.alpha, forces)

    def plot(self, ax: Any = None) -> Any:
        """A figure of statuses and directions of slip on the contact surface, drawn in ``ax`` if that is given.

        Raises
        ------
        InvalidArgumentError
            The problem has no coordinates.
        MissingDependencyError
            matplotlib is not installed.
        """
        from enumsol.roots.space_plots import draw_slips  # matplotlib comes with the first picture

        return draw_slips(self, self._condensed.problem, ax)

    @property
    def problem(self) -> Any:
        """The problem that it solves."""
        return self._condensed.problem

    def plot_body(self, ax: Any = None, *, scale: float | None = None) -> Any:
        """The deformed body with contact forces as arrows and contact nodes by status.

        Parameters
        ----------
        ax : matplotlib Axes or None
            Draw there, with ``projection="3d"``; None: in a new figure.
        scale : float, optional
            Displacements are multiplied by it; default so that they can be seen. The title tells it.

        Returns
        -------
        matplotlib.figure.Figure
            Notebooks show it.

        Raises
        ------
        InvalidArgumentError
            The problem has no mesh.
        MissingDependencyError
            matplotlib is not installed.
        """
        from enumsol.roots.body_plots import draw_body  # matplotlib comes with the first picture

        return draw_body(self, self.problem, ax, scale)

    def __repr__(self) -> str:
        return "\n".join([root_heading(self), *node_table(self, self._condensed.problem.node_ids)])

    def _repr_html_(self) -> str:
        return root_html(self, self._condensed.problem.node_ids)
