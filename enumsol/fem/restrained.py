"""What holds a body: given displacements and linear equations are eliminated, or set apart at contact nodes.

A contact row needs both components of its node. Where one of them is held at zero, as on a plane of symmetry, it stays
in the problem as a degree of freedom of its own that nothing moves: it is uncoupled from the body, its displacement is
zero in every solution, and so is the tangential force along it. Displacements and temperatures that grow with alpha
leave one degree of freedom that is alpha. All builders of contact problems in 2D and 3D end in `problem_of`.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError
from enumsol.fem.meshes import nodal_vectors, spring_stiffnesses, unit_vectors, vectors_of_all
from enumsol.model.problem import ContactProblem
from enumsol.support.arguments import shown

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from enumsol.model.mesh import BodyMesh
    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import ArrayLike, Floats, Integers, Mask

    Tangents = ArrayLike | tuple[ArrayLike, ArrayLike] | None

#: Components of unit vectors below this are rounding of a right angle, and so are moduli beside the largest.
RIGHT_ANGLE = 1e-9
#: Contact rows depend on each other if the least of their squared singular values is below this share of the largest.
_DEPENDENT = 1e-12


@dataclass(frozen=True)
class Supports:
    """Displacements that are given, by nodes and components.

    Attributes
    ----------
    fixed : (N, dimension) bool array
    values : (N, dimension) array
        Displacements of the fixed components, 0 elsewhere [length].
    slopes : (N, dimension) array
        Their derivatives with respect to alpha.
    mirrored : (N, dimension) bool array
        Components across a plane of symmetry, where that is known.
    """

    fixed: Mask
    values: Floats
    slopes: Floats
    mirrored: Mask

    @classmethod
    def none(cls, shape: tuple[int, ...]) -> Supports:
        """No support of nodes (N, dimension)."""
        return cls(np.zeros(shape, dtype=bool), np.zeros(shape), np.zeros(shape), np.zeros(shape, dtype=bool))


@dataclass(frozen=True)
class ContactRows:
    """Meaning of the p contact rows.

    Attributes
    ----------
    means : (p, N) csr_array
        The displacement of each row as a weighted mean of nodal ones; in pairs less that of what it faces.
    normals : (p, dimension) array
        Of length one.
    apart : (N, dimension) bool array
        Fixed components that stay in the problem.
    nodes : (p,) int array
        The node that each row stands for; none where rows stand for patches.
    kept : (p,) int array
        Which of the nodes that were asked for these are.
    """

    means: sp.csr_array
    normals: Floats
    apart: Mask
    nodes: Integers = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    kept: Integers = field(default_factory=lambda: np.zeros(0, dtype=np.int64))


def movable(nodes: Integers, normals: Floats, supports: Supports, means: sp.csr_array | None = None) -> ContactRows:
    """Contact nodes without those that are held entirely.

    ``means`` (p, N) are the displacements of the rows, relative to what each faces, by nodes; without them those of the
    nodes. A component of a row is held if it is at all of its nodes.

    Raises
    ------
    InvalidArgumentError
        All are held, or one is held in a component that is not perpendicular to its normal, or displaced in one.
    """
    means = means_of_nodes(nodes, len(supports.fixed)) if means is None else means
    fixed = np.asarray(abs(means) @ (~supports.fixed).astype(np.float64)) == 0
    kept = np.flatnonzero(~np.all(fixed, axis=1))
    if not len(kept):
        raise InvalidArgumentError("contact has held nodes only; expected free ones")
    nodes, fixed, normals, means = nodes[kept], fixed[kept], normals[kept], sp.csr_array(means[kept])
    moved = (np.asarray(means @ supports.values) != 0) | (np.asarray(means @ supports.slopes) != 0)
    wrong = np.any(fixed & ((np.abs(normals) > RIGHT_ANGLE) | moved), axis=1)
    if np.any(wrong):
        raise InvalidArgumentError(
            f"contact node {nodes[np.argmax(wrong)]} is held or displaced in some components only, which makes its "
            "rows dependent; expected contact nodes that are free, held entirely, or held at zero across their normal "
            "(by symmetry of a part of the boundary in the plane of symmetry)"
        )
    touched = np.any(fixed, axis=1)
    normals = np.where(fixed, 0.0, normals)
    normals[touched] /= np.linalg.norm(normals[touched], axis=1)[:, None]
    apart = np.zeros_like(supports.fixed)
    apart[nodes] = fixed
    return ContactRows(means, normals, apart, nodes, kept)


def means_of_nodes(nodes: Integers, count: int) -> sp.csr_array:
    """Displacements of these nodes among ``count``, (p, count)."""
    return sp.csr_array((np.ones(len(nodes)), (np.arange(len(nodes)), nodes)), shape=(len(nodes), count))


def check_axes(contact: ContactRows, tangents: tuple[Floats, ...]) -> None:
    """Refuse tangential axes at planes of symmetry that are neither along nor across them."""
    apart = contact.apart[contact.nodes]
    # of rows that stand for patches nothing is held in some components only
    for tangent in tangents if len(apart) else ():
        across = np.linalg.norm(np.where(apart, tangent, 0.0), axis=1)
        oblique = (across > RIGHT_ANGLE) & (np.linalg.norm(np.where(apart, 0.0, tangent), axis=1) > RIGHT_ANGLE)
        if np.any(oblique):
            raise InvalidArgumentError(
                f"axes are oblique to the plane of symmetry at contact node {contact.nodes[np.argmax(oblique)]}; "
                "expected one along it and one across it"
            )


@dataclass(frozen=True)
class Body:
    """A body before its supports, by degrees of freedom, and the supports by nodes.

    Attributes
    ----------
    A, f, load_slope : as in `ContactProblem`
    supports : Supports
    dofs : (N, dimension) int array or None
        The rows of A that the components of the nodes are; None: ``dimension node + component``, first.
    equations : sequence of Equation
        Between rows of A.
    named : callable
        Names of rows of A, for messages.
    warmed : bool
        True if its temperature depends on alpha, which then is a degree of freedom.
    """

    A: sp.csc_array
    f: Floats
    load_slope: Floats | None
    supports: Supports
    dofs: Integers | None = None
    equations: Sequence[Equation] = ()
    named: Callable[[int], str] = "displacement {}".format
    warmed: bool = False

    @classmethod
    def of_nodes(
        cls,
        A: sp.csc_array,
        held: Mask,
        springs: ArrayLike | None,
        forces: ArrayLike | None,
        slope: ArrayLike | None,
    ) -> Body:
        """Body whose components ``held`` (N, dimension) are at rest, with springs and forces on its nodes.

        Raises
        ------
        InvalidArgumentError
            Springs or forces are not of the form of the nodes.
        """
        if springs is not None:
            A = sp.csc_array(A + sp.diags_array(spring_stiffnesses(springs, held.shape).ravel()))
        f = nodal_vectors(forces, "forces", held.shape)
        load_slope = None if slope is None else nodal_vectors(slope, "forces_slope", held.shape)
        return cls(A, f, load_slope, replace(Supports.none(held.shape), fixed=held))

    def by_rows(self, values: Floats | Mask) -> Any:
        """Values of nodes, (N, dimension), by rows of A; 0 for rows of other things."""
        found = np.zeros(len(self.f), dtype=values.dtype)
        found[plain_dofs(values.shape) if self.dofs is None else self.dofs] = values
        return found

    def eliminated(self, apart: Mask) -> Elimination:
        """Elimination of all supports and equations, but for what is set apart.

        Raises
        ------
        InvalidArgumentError
            They contradict each other.
        """
        given = self.supports
        fixed, values, slopes = (self.by_rows(own) for own in (given.fixed, given.values, given.slopes))
        return eliminated(fixed, values, slopes, self.equations, self.by_rows(apart), self.named)


def displacements_along(means: sp.csr_array, directions: Floats, dofs: Integers, count: int) -> sp.csr_array:
    """Components along directions (k, dimension) of the means (k, N) of nodal displacements, by ``count`` rows of A."""
    entries = means.tocoo()
    row, node = entries.coords
    data = entries.data[:, None] * directions[row]
    shape, columns = (means.shape[0], count), dofs[node]
    return sp.csr_array((data.ravel(), (np.repeat(row, dofs.shape[1]), columns.ravel())), shape=shape)


def gathered(cells: Integers, shares: Floats, density: Floats, count: int) -> Floats:
    """Nodal forces (count, dimension): ``shares`` (k, corners) of the densities (k, dimension) on cells."""
    forces = np.zeros((count, density.shape[1]))
    for corner in range(cells.shape[1]):
        np.add.at(forces, cells[:, corner], shares[:, corner, None] * density)
    return forces


def plain_dofs(shape: tuple[int, ...]) -> Integers:
    """Degrees of freedom ``dimension node + component``, of shape (N, dimension)."""
    return np.arange(shape[0] * shape[1]).reshape(shape)


def problem_of(
    body: Body,
    contact: ContactRows,
    axes: tuple[Floats, ...],
    mesh: Callable[[sp.csr_array, Floats], BodyMesh] | None = None,
    modes: Floats | None = None,
    mass: sp.csc_array | None = None,
    **more: Any,
) -> AnyProblem:
    """Problem of a body with these contact rows, by the degrees of freedom that are left, in the order of its rows.

    Parameters
    ----------
    body : Body
    contact : ContactRows
    axes : tuple of one or two (p, dimension) arrays
        Tangents of the contact rows, see `axes_of`.
    mesh : callable or None
        What the problem keeps of its mesh, from the motion of its nodes (d N, n) and given displacements (N, d).
    modes : (m, r) array or None
        Rigid motions that nothing holds, by rows of A.
    mass : (m, m) csc_array or None
        By rows of A.
    **more
        As in `ContactProblem` and `ContactProblem3D`.

    Returns
    -------
    ContactProblem or ContactProblem3D

    Raises
    ------
    InvalidArgumentError
        An axis is oblique to the plane of symmetry on which its node lies, supports and equations contradict each
        other, or contact rows depend on each other by them.
    InvalidProblemError
        The body is free to move as a rigid body, or the data are not admissible.
    """
    check_axes(contact, axes)
    dofs = plain_dofs(body.supports.fixed.shape) if body.dofs is None else body.dofs
    given = body.eliminated(contact.apart)
    T, kept = given.T, np.where(body.by_rows(contact.apart), 0.0, 1.0)[given.left]
    rows = [displacements_along(contact.means, axis, dofs, len(body.f)) for axis in (contact.normals, *axes)]
    if body.equations:
        check_independent(contact, sp.csr_array(sp.vstack(rows) @ T))
    load = body.f - body.A @ given.offset if np.any(given.offset) else body.f
    slope = body.load_slope
    driven = body.warmed or np.any(given.slope)
    if driven:
        follows = followed(sp.csr_array(T @ sp.diags_array(kept)), given.slope, sp.csr_array(sp.vstack(rows)))
        slope = (0.0 if slope is None else slope) - body.A @ follows
    rows = [reduced(own @ T, int(driven)) for own in rows]
    if driven:
        T, kept = sp.csr_array(sp.hstack([T, sp.csr_array(follows[:, None])])), np.append(kept, 0.0)
    A, alone = _alone(body.A, T, kept)
    arrays: tuple[Any, ...] = (A, *rows, kept * (T.T @ load))
    more["load_slope"] = None if slope is None else kept * (T.T @ slope)
    if driven:  # its displacement is alpha
        more["load_slope"][-1] = alone
    more |= _relative(contact, axes, given.offset[dofs], more)
    more["mass"] = None if mass is None else _alone(mass, T, kept)[0]
    more["mesh"] = None if mesh is None else mesh(sp.csr_array(T[dofs.ravel()]), given.offset[dofs])
    more["rigid_modes"] = None if modes is None else np.pad(modes[given.left], ((0, int(driven)), (0, 0)))
    if dofs.shape[1] == 2:
        return ContactProblem(*arrays, **more)
    from enumsol.model.problem3d import ContactProblem3D  # not for problems in 2D

    return ContactProblem3D(*arrays, **more)


def reduced(rows: sp.csr_array, more: int = 0) -> sp.csr_array:
    """Rows without zeros, with so many columns of zeros after the others."""
    rows = sp.csr_array(rows)
    rows.eliminate_zeros()
    rows.resize(rows.shape[0], rows.shape[1] + more)
    return rows


def _alone(A: sp.csc_array, T: sp.csr_array, kept: Floats) -> tuple[sp.csc_array, float]:
    """T' A T with rows and columns where ``kept`` is 0 alone on their diagonals, and the last entry of this."""
    own = sp.csc_array(sp.csc_array(T.T) @ A @ T)
    if np.all(kept):
        return own, 0.0
    coupled, diagonal = sp.diags_array(kept), own.diagonal()
    lone = np.where(kept == 0, np.where(diagonal > 0, diagonal, np.max(diagonal)), 0.0)
    return sp.csc_array(coupled @ own @ coupled + sp.diags_array(lone)), float(lone[-1])


def _relative(contact: ContactRows, axes: tuple[Floats, ...], offset: Floats, more: dict[str, Any]) -> dict[str, Any]:
    """Gaps and slips less what given displacements (N, dimension) make of them."""
    moved = np.asarray(contact.means @ offset)
    if not np.any(moved):
        return {}
    normal, *slips = (np.sum(moved * axis, axis=1) for axis in (contact.normals, *axes))
    slip = slips[0] if len(slips) == 1 else np.stack(slips, axis=1)
    return {
        "gap": np.asarray(more.get("gap", 0.0)) - normal,
        "slip_offset": np.asarray(more.get("slip_offset", 0.0)) - slip,
    }


def check_independent(contact: ContactRows, rows: sp.csr_array) -> None:
    """Refuse contact rows, normal ones before tangential ones, that equations make dependent on each other.

    Raises
    ------
    InvalidArgumentError
        It names a node.
    """
    values, vectors = np.linalg.eigh((rows @ rows.T).toarray())
    if values[0] > _DEPENDENT * values[-1]:
        return
    node = contact.nodes[int(np.argmax(np.abs(vectors[:, 0]))) % len(contact.nodes)]
    raise InvalidArgumentError(
        f"contact node {node} has rows that depend on each other or on those of others, for a displacement across the "
        "axes, an equation, a tie or a rigid part moves them together; expected contact nodes that move on their own "
        "(of a pair, the rigid part as the second)"
    )


def axes_of(tangents: Tangents, normals: Floats) -> tuple[Floats, ...]:
    """Tangents for normals (p, 2) or (p, 3): one (p, 2), or two (p, 3).

    Parameters
    ----------
    tangents : array_like, pair of them, or None
        In 2D (2,) or (p, 2), by default a quarter turn of the normals counterclockwise; in 3D a pair of (3,) or (p, 3),
        by default `default_axes`.

    Raises
    ------
    InvalidArgumentError
        They have the wrong shape or are not perpendicular to the normals and to each other.
    """
    plane = normals.shape[1] == 2
    if tangents is None:
        return (np.stack([-normals[:, 1], normals[:, 0]], axis=1),) if plane else default_axes(normals)
    given: list[Any] = [tangents] if plane else list(tangents) if isinstance(tangents, (tuple, list)) else []
    if len(given) != normals.shape[1] - 1:
        raise InvalidArgumentError(f"tangents is {shown(tangents)}; expected a pair of directions (t1, t2)")
    axes = tuple(unit_vectors(vectors_of_all(axis, "tangents", normals.shape), "tangents") for axis in given)
    skew = np.max([np.abs(np.sum(a * b, axis=1)) for a, b in combinations((*axes, normals), 2)], axis=0)
    if np.any(skew > (1e-12 if plane else 1e-10)):  # but for rounding
        k = int(np.argmax(skew))
        raise InvalidArgumentError(
            f"tangents row {k} is not perpendicular to normals row {k}; expected right angles"
            if plane
            else "tangents are not perpendicular to each other and to the normals"
        )
    return axes


def default_axes(normal: Floats) -> tuple[Floats, Floats]:
    """Axes t1, t2 for normals (p, 3): the x axis projected, or the y axis where the normal is near the x axis."""
    start = np.where(np.abs(normal[:, :1]) > 0.9, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    first = unit_vectors(start - np.sum(start * normal, axis=1)[:, None] * normal, "axes")
    return first, np.cross(normal, first)


# -- constraints -------------------------------------------------------------------------------------------------------
# Linear equations between displacements, solved for some of them, which are thereby eliminated (theory, section 11.9).
#
# Supports are such equations, with one displacement each; so are ties, rigid parts and rollers in oblique planes.

#: Coefficients and right sides below this share of what they are the difference of are rounding. Larger, equations that
#: differ would count as one; smaller, repeated ones as a contradiction.
_ROUNDED = 1e-10
#: An equation is solved for its first displacement unless its coefficient is below this share of the largest.
_SMALL = 0.1


@dataclass(frozen=True)
class Equation:
    """The equation: the sum of coefficients times displacements is value + alpha slope.

    Attributes
    ----------
    dofs : (k,) int array
        Degrees of freedom; it is solved for the first if its coefficient is not small.
    coefficients : (k,) array
    name : str
        What messages call it.
    value, slope : float
        [length].
    """

    dofs: Integers
    coefficients: Floats
    name: str
    value: float = 0.0
    slope: float = 0.0


@dataclass(frozen=True)
class Elimination:
    """Displacements x = T q + offset + alpha slope, where q are those that are left, in their order.

    Attributes
    ----------
    left : (n,) int array
    T : (m, n) csr_array
        Its rows ``left`` are those of the identity.
    offset, slope : (m,) arrays
        [length].
    """

    left: Integers
    T: sp.csr_array
    offset: Floats
    slope: Floats


@dataclass
class _Row:
    """A displacement in terms of others: ``value + alpha slope`` plus ``terms``; of sums, what they are made of.

    ``size`` is the largest of what value and slope are sums of.
    """

    terms: dict[int, float]
    value: float
    slope: float
    size: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        self.size = max(self.size[0], abs(self.value)), max(self.size[1], abs(self.slope))

    def put_in(self, dof: int, other: _Row) -> None:
        """Put another row in for a displacement."""
        factor = self.terms.pop(dof)
        for own, coefficient in other.terms.items():
            total = self.terms.get(own, 0.0) + factor * coefficient
            if abs(total) <= _ROUNDED * abs(factor * coefficient):
                self.terms.pop(own, None)
            else:
                self.terms[own] = total
        self.value += factor * other.value
        self.slope += factor * other.slope
        self.size = max(self.size[0], abs(factor) * other.size[0]), max(self.size[1], abs(factor) * other.size[1])


def eliminated(
    fixed: Mask,
    values: Floats,
    slopes: Floats,
    equations: Sequence[Equation] = (),
    apart: Mask | None = None,
    named: Callable[[int], str] = "displacement {}".format,
) -> Elimination:
    """Elimination of what is fixed, and of one displacement for each of the equations.

    Parameters
    ----------
    fixed : (m,) bool array
        Displacements that are given: values + alpha slopes.
    values, slopes : (m,) arrays
        0 where nothing is fixed [length].
    equations : sequence of Equation
    apart : (m,) bool array or None
        Fixed displacements that are left nevertheless, alone.
    named : callable
        The name of a displacement in messages.

    Raises
    ------
    InvalidArgumentError
        An equation contradicts others; it names both.
    """
    count = len(fixed)
    rows = _solved(fixed, values, slopes, equations, named)
    gone = fixed if apart is None else fixed & ~apart
    solved = np.fromiter(rows, dtype=np.int64, count=len(rows))
    left = np.flatnonzero(~gone)
    offset, slope = np.where(fixed, values, 0.0), np.where(fixed, slopes, 0.0)
    if len(solved):
        left = np.setdiff1d(left, solved, assume_unique=True)
        offset[solved] = [row.value for row in rows.values()]
        slope[solved] = [row.slope for row in rows.values()]
    column = np.full(count, -1)
    column[left] = np.arange(len(left))
    lengths = [len(row.terms) for row in rows.values()]
    others = np.array([dof for row in rows.values() for dof in row.terms], dtype=np.int64)
    data = np.array([value for row in rows.values() for value in row.terms.values()])
    places = (np.concatenate([left, np.repeat(solved, lengths)]), column[np.concatenate([left, others])])
    T = sp.csr_array((np.concatenate([np.ones(len(left)), data]), places), shape=(count, len(left)))
    return Elimination(left, T, offset, slope)


def _solved(
    fixed: Mask, values: Floats, slopes: Floats, equations: Sequence[Equation], named: Callable[[int], str]
) -> dict[int, _Row]:
    """A row for each displacement that an equation is solved for, in those that are left."""
    rows: dict[int, _Row] = {}
    users: defaultdict[int, set[int]] = defaultdict(set)
    for equation in equations:
        own = _Row({}, -equation.value, -equation.slope)
        largest = float(np.max(np.abs(equation.coefficients)))
        for dof, coefficient in zip(equation.dofs.tolist(), equation.coefficients.tolist(), strict=True):
            known = _Row({}, values[dof], slopes[dof]) if fixed[dof] else rows.get(dof, _Row({dof: 1.0}, 0.0, 0.0))
            own.terms[-1] = coefficient  # no displacement has this number
            own.put_in(-1, known)
        terms = {dof: value for dof, value in own.terms.items() if abs(value) > _ROUNDED * largest}
        if not terms:
            if abs(own.value) > _ROUNDED * own.size[0] or abs(own.slope) > _ROUNDED * own.size[1]:
                of = ", ".join(dict.fromkeys(named(dof) for dof in equation.dofs.tolist()[:4]))
                raise InvalidArgumentError(
                    f"{equation.name} contradicts what supports and other equations give for {of}; expected equations "
                    "that hold together"
                )
            continue
        most = _SMALL * max(map(abs, terms.values()))
        pivot = next(dof for dof, value in terms.items() if abs(value) >= most)
        factor = -terms.pop(pivot)
        size = own.size[0] / abs(factor), own.size[1] / abs(factor)
        row = _Row({dof: value / factor for dof, value in terms.items()}, own.value / factor, own.slope / factor, size)
        for user in users.pop(pivot, ()):
            if pivot in rows[user].terms:
                rows[user].put_in(pivot, row)
                for dof in row.terms:
                    users[dof].add(user)
        rows[pivot] = row
        for dof in terms:
            users[dof].add(pivot)
    return rows


def followed(T: sp.csr_array, slope: Floats, rows: sp.csr_array) -> Floats:
    """Displacement that contains ``slope`` and does not move contact rows: slope - T d with rows (slope - T d) = 0.

    Raises
    ------
    InvalidArgumentError
        Contact rows move that nothing free can follow.
    """
    moved = np.asarray(rows @ slope)
    if not np.any(moved):
        return slope
    own = sp.csr_array(rows @ T)
    free = np.asarray(abs(own).sum(axis=1)).ravel() > 0
    if np.any(moved[~free]):
        raise InvalidArgumentError(
            "displacement_slope moves contact nodes in a direction in which nothing can follow them; expected nodes "
            "that contact does not need"
        )
    own = sp.csr_array(own[np.flatnonzero(free)])
    from scipy.sparse.linalg import spsolve  # scipy's solvers come with it

    force: Any = spsolve(sp.csc_array(own @ own.T), moved[free])
    return np.asarray(slope - T @ (own.T @ np.atleast_1d(force)))
