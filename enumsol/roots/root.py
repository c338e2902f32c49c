"""Isolated solutions and families of them at one alpha."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.model.statuses import ContactStatus, sign_array
from enumsol.roots.local_branch import ContactState, LocalBranchTest, branch_test
from enumsol.support.immutable import Sealed, sealed
from enumsol.support.messages import PRINTED, html_lines, html_table, visible
from enumsol.support.plotting import checked_units, kept

if TYPE_CHECKING:
    from collections.abc import Sequence
    from fractions import Fraction
    from pathlib import Path

    from enumsol.condensation.condensed import CondensedProblem
    from enumsol.roots.local_branch import SelectionTangent, SlipSigns
    from enumsol.support.array_types import Alpha, Floats, NDArray


@dataclass(frozen=True)
class Enclosure(Sealed):
    """Proven bounds of a root's forces and displacements.

    Attributes
    ----------
    lambda_n, lambda_t : (p, 2) arrays
        Lower and upper bounds [force]; in 3D those of lambda_t have the shape (p, 2, 2), the bounds last.
    u_n, u_t : arrays of the same shapes
        Lower and upper bounds of u_n = Bn u - gap and u_t = Bt u - slip_offset [length].
    rigid_coordinates : (r, 2) array or None
        Of a body that nothing holds, those of the coordinates q of its rigid displacement.

    Examples
    --------
    >>> import enumsol
    >>> root = enumsol.enumerate_roots(enumsol.gallery.one_node_triangle(), alpha=5)[1]  # lambda_n = 1 / 3
    >>> low, high = root.enclosure.lambda_n[0]
    >>> bool(low < 1 / 3 < high < low + 1e-12)
    True
    """

    lambda_n: Floats
    lambda_t: Floats
    u_n: Floats
    u_t: Floats
    rigid_coordinates: Floats | None = None


@dataclass(frozen=True, kw_only=True)
class Root(ContactState):
    """An isolated solution at one alpha, in 2D or 3D: a ContactState with its index.

    At a node with F = 0 in contact the sign of u_t names its status: in verified and exact arithmetic that of the
    enclosure, or in rationals. ``active`` then holds all names that this sign does not exclude (of a body too large for
    rationals, n > 250, the enclosure of u_t may hold zero and leave the sign open).

    A root at which more than one status may hold, of a body too large for rationals or where they do not apply, may be
    known by its enclosure only (theory, sections 6.11 and 14.9): it exists and is the only one there, and ``active``
    holds all statuses that its enclosure does not exclude. In 3D a root that is not regular is known as the only
    solution (theory, section 12.6), and a node in contact whose coefficients are both 0 slips wherever u_t is not 0.

    Attributes
    ----------
    alpha : float or Fraction
    statuses, active : tuples of p ContactStatus, and of p frozensets of them
        The first and all that hold at every node.
    lambda_n, lambda_t, u_n, u_t : (p,) arrays; in 3D lambda_t and u_t are (p, 2)
        Contact forces [force], Bn u - gap and Bt u - slip_offset [length]; see ContactState.
    slip_angle : (p, 2) array or None
        In 3D, bounds of the angle of F u_t in the local axes, the lower one in [-pi, pi); nan where the node does not
        slip against friction [radians].
    index : int or None
        Local degree (theory, section 6.7): sign det of the selection at a regular root, in 3D of the Jacobian of the
        normal map (theory, section 12.4). It says nothing about physical stability. None when it could not be found
        within the limits of the local analysis.
    regular : bool
        Exactly one status holds at every node, strictly, and the selection is not singular.
    enclosure : Enclosure or None
        Proven bounds, in verified and exact arithmetic.
    margin : float
        Distance to the next change of status, the least slack of the conditions that hold [-]: forces measured by
        their largest possible values at a solution, displacements likewise. 0 at a degenerate root.

    Examples
    --------
    >>> import enumsol
    >>> roots = enumsol.enumerate_roots(enumsol.gallery.one_node_triangle(), alpha=5)
    >>> roots[2]
    Root at alpha = 5: index +1, regular, margin 2.70e-01
    node status      lambda_n     lambda_t          u_n          u_t
       0 stick            1.5           -4            0            0
    """

    index: int | None
    regular: bool
    margin: float
    enclosure: Enclosure | None = field(repr=False, compare=False)
    _condensed: CondensedProblem = field(repr=False, compare=False)
    slip_angle: Floats | None = field(default=None, compare=False)
    _tangent: SelectionTangent | None = field(repr=False, compare=False, default=None)
    _slips: SlipSigns | None = field(repr=False, compare=False, default=None)
    _exact_slips: tuple[Fraction, ...] | None = field(repr=False, compare=False, default=None)
    _rigid: Floats | None = field(repr=False, compare=False, default=None)

    @cached_property
    def condition(self) -> float:
        """In 2D, the condition number of the selection's matrix after scaling; infinite unless the root is regular.

        Raises
        ------
        InvalidArgumentError
            The problem is one in 3D.
        """
        self._in_2d("condition")
        return np.inf if self._tangent is None else self._tangent.condition()

    @cached_property
    def dlambda_dalpha(self) -> Floats | None:
        """Derivatives of (lambda_n, lambda_t) along the branch, shape (p, 2), in 3D (p, 3).

        None unless the root is regular, and where a node that rests has F = 0 but not beside this alpha.
        """
        return self._rates[0]

    @cached_property
    def du_dalpha(self) -> Floats | None:
        """Derivatives of (u_n, u_t) along the branch, shape (p, 2), in 3D (p, 3) [length]; None as above."""
        return self._rates[1]

    @property
    def u(self) -> Floats:
        """Displacement of all degrees of freedom, shape (n,) [length]; computed at every access."""
        forces = np.concatenate([self.lambda_n, self.lambda_t.ravel(order="F")])
        u, rigid = self._condensed.displacement(self.alpha, forces), self.rigid_displacement
        return u if rigid is None else u + rigid

    @property
    def rigid_coordinates(self) -> Floats | None:
        """Coordinates q of the rigid displacement N q, shape (r,); None if the body is held."""
        return self._rigid

    @property
    def rigid_displacement(self) -> Floats | None:
        """Rigid displacement N q of the body as a whole, shape (n,) [length]; None if it is held.

        It is the rigid displacement that equals u at r degrees of freedom, where theory, section 14.1, has the body on
        springs.
        """
        return None if self._rigid is None else np.asarray(self.problem.rigid_modes @ self._rigid)

    def local_branch_test(self) -> LocalBranchTest:
        """Test of the existence of a local Lipschitz branch of solutions through the root (theory, section 3.2).

        Its ``exists`` is True when the determinants of all selections that hold at the root have one and the same
        sign; ``differing`` names those that break this. A regular root always has such a branch. ``premise`` tells
        whether F > 0 at every node, without which the branch in the load need not be one in F.

        Raises
        ------
        TooLargeError
            Too many selections hold at the root to examine each of them; in 3D, a node touches without load and rests,
            so that all directions of slip hold there.
        NotHeldError
            Some rigid displacement of a body that nothing holds moves no contact node.
        InvalidArgumentError
            Friction depends on the solution.
        """
        return branch_test(self._condensed, self.problem.affine_friction, self)

    @property
    def exact_slips(self) -> tuple[Fraction, ...] | None:
        """In 2D and where arithmetic is exact, u_t without rounding, p rationals; otherwise None."""
        return self._exact_slips

    @property
    def problem(self) -> Any:
        """The problem that it solves."""
        return self._condensed.problem

    def plot(self, ax: object = None, *, units: tuple[str, str] | None = None, file: str | Path | None = None) -> Any:
        """The deformed body; in 3D also statuses and directions of slip on the contact surface.

        Parameters
        ----------
        ax : matplotlib Axes or None
            In 3D plane ones: the contact surface alone is drawn there. None: all in a new figure.
        units : (str, str), optional
            Of forces and of lengths, for the axes and the largest contact force.
        file : path, optional
            Save the figure there.

        Returns
        -------
        matplotlib.figure.Figure
            Notebooks show it.

        Raises
        ------
        InvalidArgumentError
            The problem has no mesh, or in 3D no coordinates.
        MissingDependencyError
            matplotlib is not installed.
        """
        if self.lambda_t.ndim == 1:
            return self.plot_body(ax, units=units, file=file)
        from enumsol.roots.body_plots import draw_root  # matplotlib comes with the first picture

        return kept(draw_root(self, self.problem, ax, checked_units(units)), file)

    def plot_body(
        self,
        ax: object = None,
        *,
        scale: float | None = None,
        units: tuple[str, str] | None = None,
        file: str | Path | None = None,
    ) -> Any:
        """The deformed body with contact forces as arrows and contact nodes by status; in 3D also directions of slip.

        Parameters
        ----------
        ax : matplotlib Axes or None
            Draw there, in 3D with ``projection="3d"``; None: in a new figure.
        scale : float, optional
            Displacements are multiplied by it; default so that they can be seen. The title tells it.
        units : (str, str), optional
            Of forces and of lengths, for the axes and the largest contact force.
        file : path, optional
            Save the figure there.

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

        return kept(draw_body(self, self.problem, ax, scale, checked_units(units)), file)

    def _in_2d(self, name: str) -> None:
        """Refuse what roots in 3D do not have."""
        if self.lambda_t.ndim == 2:
            raise InvalidArgumentError(f"{name} is asked of a root in 3D; expected one in 2D")

    @property
    def _rates(self) -> tuple[Floats, ...] | tuple[None, None]:
        """Derivatives of forces and of displacements with respect to alpha."""
        rates = None if self._tangent is None else self._tangent.rates
        return (None, None) if rates is None else tuple(map(sealed, rates))

    def _slip_sign(self, node: int) -> int:
        sign = None if self._slips is None else self._slips.sign(node)
        return int(np.sign(self.u_t[node])) if sign is None else sign

    @property
    def signs(self) -> NDArray[np.int8]:
        """In 2D, signs of the test functions at the root, shape (p, 3); 0 where a test function vanishes.

        At an open node theta2 and theta3 have the sign of u_t. In verified and exact arithmetic it follows from the
        enclosure or from rationals; of a body too large for these (n > 250) whose enclosure holds zero, it is that of
        the computed value.

        Raises
        ------
        InvalidArgumentError
            The problem is one in 3D.
        """
        self._in_2d("signs")
        signs = sign_array(self.statuses)
        for i, holds in enumerate(self.active):
            if ContactStatus.OPEN in holds:
                signs[i, 0] = 0 if len(holds) > 1 else -1
                signs[i, 1:] = self._slip_sign(i)
            else:
                for k, slip in enumerate((ContactStatus.SLIP_PLUS, ContactStatus.SLIP_MINUS), start=1):
                    if holds >= {slip, ContactStatus.STICK}:
                        signs[i, k] = 0
        return signs

    def __repr__(self) -> str:
        return "\n".join([root_heading(self), *node_table(self, self.problem.node_ids, self.problem.coordinates)])

    def _repr_html_(self) -> str:
        return root_html(self, self.problem.node_ids, self.problem.coordinates)


@dataclass(frozen=True)
class Polytope(Sealed):
    """A convex set of roots in one selection.

    Attributes
    ----------
    statuses : tuple of p ContactStatus
    vertices : (k, p, 2) array
        (lambda_n, lambda_t) at every vertex [force].
    dimension : int
    rigid_coordinates : (k, r) array or None
        Of a body that nothing holds: q of the rigid displacement N q at every vertex.

    Examples
    --------
    >>> import enumsol
    >>> roots = enumsol.enumerate_roots(enumsol.gallery.one_node_triangle(f=(1, -2)), alpha=2)
    >>> segment = roots.families[0].polytopes[0]
    >>> segment.dimension, segment.vertices.tolist()
    (1, [[[0.0, 0.0]], [[1.0, -2.0]]])
    """

    statuses: tuple[ContactStatus, ...]
    vertices: Floats
    dimension: int
    rigid_coordinates: Floats | None = None

    @property
    def coordinates(self) -> Floats:
        """Every vertex in a row, (k, 2p + r): lambda_n and lambda_t node by node, then the rigid displacement."""
        forces = self.vertices.reshape(len(self.vertices), -1)
        return forces if self.rigid_coordinates is None else np.hstack([forces, self.rigid_coordinates])


@dataclass(frozen=True)
class RootFamily:
    """A connected continuum of solutions at one alpha: a union of polytopes.

    Attributes
    ----------
    alpha : float or Fraction
    polytopes : tuple of Polytope
        The maximal ones.
    index : int or None
        Local degree of the whole family; None when it could not be found within the limits.
    vertices_proven : bool
        The lists of vertices were found in rational arithmetic.

    Examples
    --------
    >>> import enumsol
    >>> family = enumsol.enumerate_roots(enumsol.gallery.one_node_triangle(f=(1, -2)), alpha=2).families[0]
    >>> len(family.polytopes), family.index
    (1, 1)
    """

    alpha: Alpha
    polytopes: tuple[Polytope, ...]
    index: int | None
    vertices_proven: bool

    @property
    def dimension(self) -> int:
        """Largest dimension of its polytopes."""
        return max(part.dimension for part in self.polytopes)

    @cached_property
    def free_modes(self) -> tuple[int, ...]:
        """Rigid modes, by their columns in ``rigid_modes``, along which the body moves within the family."""
        parts = [part.rigid_coordinates for part in self.polytopes if part.rigid_coordinates is not None]
        if not parts:
            return ()
        return tuple(np.flatnonzero(np.ptp(np.concatenate(parts), axis=0) > 0).tolist())

    @cached_property
    def vertices(self) -> Floats:
        """All vertices, shape (k, p, 2), without repetition, in lexical order."""
        return sealed(np.unique(np.concatenate([part.vertices for part in self.polytopes]), axis=0))

    def _repr_html_(self) -> str:
        index = "unknown" if self.index is None else f"{self.index:+d}"
        heading = f"RootFamily at alpha = {float(self.alpha):g}: index {index}, dimension {self.dimension}"
        rows = [
            (k, part.dimension, len(part.vertices), f"{np.max(part.vertices[..., 0]):.6g}", summary(part.statuses))
            for k, part in enumerate(self.polytopes)
        ]
        heads = ("polytope", "dimension", "vertices", "largest lambda_n", "contact")
        return html_lines([heading]) + html_table(heads, rows[:PRINTED])


def root_heading(root: Root) -> str:
    """The first line of a printed root."""
    index = "?" if root.index is None else f"{root.index:+d}"
    regular = "regular" if root.regular else "not regular"
    return f"Root at alpha = {float(root.alpha):g}: index {index}, {regular}, margin {root.margin:.2e}"


def root_html(root: Root, labels: tuple[Any, ...], places: Floats | None = None) -> str:
    """A root in a notebook: its heading, and a table over the contact nodes; of many the first."""
    shown = min(len(labels), PRINTED)
    heads = _node_heads(1 if root.lambda_t.ndim == 1 else 2)
    rows = [
        (labels[i], root.statuses[i].value, *(f"{x:.6g}" for x in _node_numbers(root, i)), *_place(places, i))
        for i in range(shown)
    ]
    more = [f"... {len(labels) - shown} more nodes; all of them: {summary(root.statuses)}"]
    return (
        html_lines([root_heading(root)])
        + html_table(("node", "status", *heads, *_places_head(places)), rows)
        + html_lines(more if shown < len(labels) else [])
    )


def node_table(state: ContactState, labels: tuple[Any, ...], places: Floats | None = None) -> list[str]:
    """Lines of a table over the contact nodes, with their places if these are known; of many the first."""
    shown = min(len(labels), PRINTED)
    width = max(4, *(len(visible(label)) for label in labels[:shown]))
    lines = [
        node_heading(width, 1 if state.lambda_t.ndim == 1 else 2, places),
        *(node_line(state, i, labels[i], width, places) for i in range(shown)),
    ]
    if shown < len(labels):
        lines.append(f"... {len(labels) - shown} more nodes; all of them: {summary(state.statuses)}")
    return lines


def node_heading(width: int, tangents: int = 1, places: Floats | None = None) -> str:
    """The heading of lines over contact nodes, whose labels take that width."""
    names = " ".join(f"{name:>12}" for name in _node_heads(tangents))
    return "  ".join([f"{'node':>{width}} {'status':<7} {names}", *_places_head(places)])


def _places_head(places: Floats | None) -> tuple[str, ...]:
    return () if places is None else (f"at ({', '.join('xyz'[: places.shape[1]])})",)


def _place(places: Floats | None, i: int) -> tuple[str, ...]:
    """Place of a contact node in the body, if it is known."""
    return () if places is None else (f"({', '.join(f'{x + 0.0:.4g}' for x in places[i])})",)


def _node_heads(tangents: int) -> list[str]:
    across = [[name] if tangents == 1 else [f"{name}1", f"{name}2"] for name in ("lambda_t", "u_t")]
    return ["lambda_n", *across[0], "u_n", *across[1]]


def node_line(state: ContactState, i: int, label: object, width: int, places: Floats | None = None) -> str:
    """Status, forces and displacements of a contact node, and where it is, below `node_heading`."""
    text = " ".join(f"{number:>12.6g}" for number in _node_numbers(state, i))
    return "  ".join([f"{visible(label):>{width}} {state.statuses[i].value:<7} {text}", *_place(places, i)])


def _node_numbers(state: ContactState, i: int) -> list[float]:
    numbers = [state.lambda_n[i], *np.ravel(state.lambda_t[i]), state.u_n[i], *np.ravel(state.u_t[i])]
    # + 0.0 turns a negative zero, which means nothing to a reader, into zero
    return [float(number) + 0.0 for number in numbers]


def summary(statuses: Sequence[ContactStatus | str | None]) -> str:
    """Runs of equal statuses as text: ``3 open, 2 stick, 1 slip+``; of nodes of which nothing is known ``1 any``."""
    names = ["any" if status is None else status if isinstance(status, str) else status.value for status in statuses]
    parts: list[str] = []
    run = 0
    for k, name in enumerate(names):
        run += 1
        if k + 1 == len(names) or names[k + 1] != name:
            parts.append(f"{run} {name}" if len(names) > 1 else name)
            run = 0
    text = ", ".join(parts)
    return text if len(text) <= 60 else text[:57] + "..."
