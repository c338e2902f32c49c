"""Ties, rigid parts, couplings, equations and springs between nodes: options of scenes that join displacements.

Reference points have displacements and rotations of their own, whose numbers come after those of the nodes. Rotations
are counted as the length by which they move what is as far away as the extent of the mesh.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError
from enumsol.fem.conditions import by_part, displacements_of, fix, frames_of, names_of
from enumsol.fem.contacts import PairOfParts, facing, facing_normals
from enumsol.fem.restrained import Equation, eliminated
from enumsol.model.mesh import assembled
from enumsol.support.arguments import finite_number, shown
from enumsol.support.array_arguments import short_vector

if TYPE_CHECKING:
    from enumsol.fem.bases import NodalBasis
    from enumsol.fem.conditions import Options
    from enumsol.fem.meshes import PartedMesh
    from enumsol.fem.restrained import Supports
    from enumsol.support.array_types import Floats, Integers, NDArray

#: Names of the components of a reference point, by dimension; those of nodes come first.
COMPONENTS = {2: ("x", "y", "rz"), 3: ("x", "y", "z", "rx", "ry", "rz")}
#: A direction whose largest component is this near to one is along an axis, but for rounding.
_ALONG = 1.0 - 1e-12
#: Nodes of a coupling whose moments of inertia are below this share of the largest leave a rotation undetermined.
_ON_A_LINE = 1e-9


@dataclass(eq=False)
class Joints:
    """Reference points and joints of a scene: numbers of all displacements, components of nodes, then of these points.

    Attributes
    ----------
    points : (N, d) array
        Of the nodes [length].
    places : mapping of names to (d,) arrays
        Of the reference points [length].
    forces, slope : arrays
        On reference points, and their derivatives with respect to alpha [force].
    springs : csc_array
        Stiffness of springs at nodes and reference points, of all displacements [force / length].
    equations : list of Equation
    said : list of str
        What is joined, a line each.
    notes : list of str
    """

    points: Floats
    places: Mapping[str, Floats]
    forces: Floats
    slope: Floats
    springs: sp.csc_array
    equations: list[Equation] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @classmethod
    def of(cls, mesh: PartedMesh, given: object) -> Joints:
        """Reference points by their names, which join nothing yet.

        Raises
        ------
        InvalidArgumentError
            One is not a position, or is called as a part is.
        """
        places = {}
        for name, place in by_part(given, "reference").items():
            if name in mesh.facets or name in mesh.node_sets:
                raise InvalidArgumentError(
                    f"reference {name} is called as a part of the mesh is; expected a name of its own"
                )
            places[name] = short_vector(place, f"reference {name}", mesh.points.shape[1])
        more = len(places) * len(COMPONENTS[mesh.points.shape[1]])
        count = mesh.points.size + more
        return cls(mesh.points, places, np.zeros(more), np.zeros(more), sp.csc_array((count, count)))

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return int(self.points.shape[1])

    @property
    def each(self) -> int:
        """Number of displacements and rotations of a reference point."""
        return len(COMPONENTS[self.dimension])

    @property
    def count(self) -> int:
        """Number of all displacements."""
        return self.points.size + self.each * len(self.places)

    @property
    def length(self) -> float:
        """The extent of the mesh [length]."""
        return float(np.max(np.ptp(self.points, axis=0)))

    def dofs(self, name: str) -> Integers:
        """Numbers of the displacements of a reference point.

        Raises
        ------
        InvalidArgumentError
            There is none of this name.
        """
        if name not in self.places:
            known = ", ".join(self.places) or "none"
            raise InvalidArgumentError(f"there is no reference point named {shown(name)}; expected one of {known}")
        return self.points.size + self.each * [*self.places].index(name) + np.arange(self.each)

    def named(self, dof: int) -> str:
        """Words for a displacement."""
        node, component = divmod(dof, self.dimension)
        if dof < self.points.size:
            return f"node {node} in {'xyz'[component]}"
        row, component = divmod(dof - self.points.size, self.each)
        return f"{[*self.places][row]} in {COMPONENTS[self.dimension][component]}"

    def motions(self, name: str, nodes: Integers) -> Floats:
        """Displacements (k, d, r) of nodes that the displacements and rotations of a reference point would be."""
        offset = (self.points[nodes] - self.places[name]) / self.length
        d = self.dimension
        moved = np.tile(np.eye(d), (len(nodes), 1, 1))
        if d == 2:
            return np.concatenate([moved, np.stack([-offset[:, 1], offset[:, 0]], axis=1)[:, :, None]], axis=2)
        return np.concatenate([moved, np.stack([np.cross(axis, offset) for axis in np.eye(3)], axis=2)], axis=2)

    @property
    def rows(self) -> sp.csr_array:
        """Equations as rows of length one, (k, m)."""
        data = [own.coefficients / np.linalg.norm(own.coefficients) for own in self.equations]
        starts = np.cumsum([0, *map(len, data)])
        columns = np.concatenate([np.zeros(0, dtype=np.int64), *(own.dofs for own in self.equations)])
        entries = (np.concatenate([np.zeros(0), *data]), columns, starts)
        return sp.csr_array(entries, shape=(len(self.equations), self.count))

    def padded(self, K: sp.csc_array) -> sp.csc_array:
        """A matrix of the nodes, with zeros for reference points."""
        return resized(K, self.count)


def resized(K: sp.csc_array, count: int) -> sp.csc_array:
    """A square matrix with rows and columns of zeros behind its own, (count, count)."""
    other = sp.csc_array(K, copy=True)
    other.resize(count, count)
    return other


def joints_of(body: NodalBasis, mesh: PartedMesh, options: Options, held: Supports) -> Joints:
    """Joints that the options describe; what they fix along axes is added to ``held``.

    Raises
    ------
    InvalidArgumentError
        An option is not of its form or names what does not exist, nodes of a tie face nothing, or a coupling does not
        determine a rotation.
    """
    found = Joints.of(mesh, options.reference)
    found.springs = _node_springs(mesh, found, options)
    _join_parts(body, mesh, options, found)
    for pair in options.tie:
        _tie(body, mesh, pair, found)
    _hold_references(options, found)
    _hold_along(mesh, options, held, found)
    for row, value in enumerate(options.equations):
        _equation(mesh, value, f"equations row {row}", held, found)
    for target, slope in ((found.forces, ""), (found.slope, "_slope")):
        _push_references(options, found, target, slope)
    _hold_unused(found)
    _settle(held, found)
    return found


def _join_parts(body: NodalBasis, mesh: PartedMesh, options: Options, found: Joints) -> None:
    for what in ("rigid", "coupling"):
        for name, value in by_part(getattr(options, what), what).items():
            dofs, parts = found.dofs(name), names_of(value, f"{what} of {name}")
            nodes = np.unique(np.concatenate([mesh.nodes(part) for part in parts]))
            rigid = [1] if body.axisymmetric else [*range(found.each)]  # of a body of revolution along the axis
            dofs, motions = dofs[rigid], found.motions(name, nodes)[:, :, rigid]
            if what == "rigid":
                of_nodes = nodes[:, None] * found.dimension + np.arange(found.dimension)
                found.equations.extend(
                    Equation(np.append(of_nodes[k, i], dofs), np.append(1.0, -motions[k, i]), f"the rigid part {name}")
                    for k, i in np.ndindex(of_nodes.shape)
                )
            else:
                weights = _weights(body, mesh, parts)[nodes]
                found.equations.extend(_spread(name, dofs, nodes, weights, motions))
            found.said.append(f"{name}: {what} with {len(nodes)} nodes of {', '.join(parts)}")


def _weights(body: NodalBasis, mesh: PartedMesh, parts: list[str]) -> Floats:
    """Shares of nodes in what acts on a coupling, (N,): their areas, or the same of all nodes of a set."""
    total = np.zeros(len(mesh.points))
    for part in parts:
        if part in mesh.facets:
            total += body.on_part(mesh.part(part), part, lambda _: 1.0)[:, 0]
        else:
            total[mesh.nodes(part)] += 1.0
    return total


def _spread(name: str, dofs: Integers, nodes: Integers, weights: Floats, motions: Floats) -> list[Equation]:
    """Equations that a reference point moves as the nodes do in the mean: as the nearest rigid motion, by weights."""
    moments = np.einsum("k,kir,kis->rs", weights, motions, motions)
    scale = np.sqrt(np.diagonal(moments))
    if np.min(scale) <= 0 or np.linalg.eigvalsh(moments / scale / scale[:, None])[0] <= _ON_A_LINE:
        raise InvalidArgumentError(
            f"coupling of {name} has nodes at one point or on one line, which determine no rotation; expected nodes "
            "that do not lie on a line (in 2D two)"
        )
    fit = np.linalg.solve(moments, np.einsum("k,kir->rki", weights, motions).reshape(len(dofs), -1))
    d = motions.shape[1]
    of_nodes = (nodes[:, None] * d + np.arange(d)).ravel()
    return [
        Equation(np.append(dof, of_nodes), np.append(1.0, -row), f"the coupling {name}")
        for dof, row in zip(dofs, fit, strict=True)
    ]


def _tie(body: NodalBasis, mesh: PartedMesh, value: Any, found: Joints) -> None:
    pair = PairOfParts.of(value, "tie")
    nodes, normals = facing_normals(body, mesh, pair)
    apart = ~np.isin(nodes, mesh.nodes(pair.master))
    nodes, normals = nodes[apart], normals[apart]
    met, weights, gaps = facing(body, mesh, nodes, normals, pair.master)
    near = np.ones(len(gaps), dtype=bool) if pair.gap is None else np.abs(gaps) <= pair.gap
    if not np.any(near):
        raise InvalidArgumentError(
            f"{pair.slave} of the tie {pair} has no node that faces a facet of {pair.master}"
            f"{'' if pair.gap is None else f' within {pair.gap:g}'}; expected parts that lie on each other"
        )
    tied, d = nodes[met][near], mesh.points.shape[1]
    for node, row in zip(tied, np.flatnonzero(near), strict=True):
        ends = slice(weights.indptr[row], weights.indptr[row + 1])
        for i in range(d):
            dofs = np.append(node, weights.indices[ends]) * d + i
            name = f"the tie {pair} at node {node}"
            found.equations.append(Equation(dofs, np.append(1.0, -weights.data[ends]), name))
    found.said.append(f"tie {pair}: {len(tied)} nodes")
    if len(tied) < len(nodes):
        found.notes.append(
            f"{len(nodes) - len(tied)} of {len(nodes)} nodes of {pair.slave} face nothing of {pair.master} and are not "
            "tied"
        )


def _hold_references(options: Options, found: Joints) -> None:
    """Supports and given displacements of reference points."""
    for name in (name for name in names_of(options.clamp, "clamp") if name in found.places):
        found.equations.extend(Equation(found.dofs(name)[[k]], np.ones(1), f"clamp {name}") for k in range(found.each))
    for name, given in displacements_of(options, found.dimension, found.places).items():
        for component, (value, slope) in given.items() if name in found.places else ():
            scale = 1.0 if component < found.dimension else found.length
            own = Equation(found.dofs(name)[[component]], np.ones(1), f"displacement of {name}", value * scale)
            found.equations.append(replace(own, slope=slope * scale))


def _hold_along(mesh: PartedMesh, options: Options, held: Supports, found: Joints) -> None:
    """Displacements that are given along axes of nodes that are not x, y and z, by equations."""
    frames, d = frames_of(mesh, options.transform), mesh.points.shape[1]
    for part, given in displacements_of(options, d, found.places).items():
        if part in found.places:
            continue
        for node in mesh.nodes(part)[frames.own[mesh.nodes(part)]]:
            name = f"displacement of {part} at node {node}"
            every = np.array([given.get(i, (0.0, 0.0)) for i in range(d)]) if len(given) == d else None
            for i, (value, slope) in given.items():
                axis = frames.axes[node, i]
                along = int(np.argmax(np.abs(axis)))
                if every is not None:
                    fix(held, part, np.array([node]), i, *(frames.axes[node].T @ every)[i])
                elif abs(axis[along]) >= _ALONG:
                    sign = np.sign(axis[along])
                    fix(held, part, np.array([node]), along, sign * value, sign * slope)
                else:
                    found.equations.append(Equation(node * d + np.arange(d), axis, name, value, slope))


def _hold_unused(found: Joints) -> None:
    """Hold rotations of reference points that move nothing, as those of a point that equations alone join to nodes.

    Raises
    ------
    InvalidArgumentError
        A force or a moment acts on one, or a point is joined to nothing.
    """
    joining = [own for own in found.equations if len(own.dofs) > 1]
    used = np.zeros(found.count, dtype=bool)
    for own in joining:
        used[own.dofs[own.coefficients != 0]] = True
    for name in found.places:
        dofs = found.dofs(name)
        if not np.any(used[dofs]):
            raise InvalidArgumentError(
                f"reference {name} is joined to no part; expected rigid or coupling for it, or equations that name it"
            )
        for dof in dofs[~used[dofs]]:
            row = dof - found.points.size
            if found.forces[row] or found.slope[row]:
                raise InvalidArgumentError(
                    f"a force or moment acts on {found.named(int(dof))}, which moves nothing; expected one that does"
                )
            found.equations.append(Equation(np.array([dof]), np.ones(1), f"what {name} moves"))


def _settle(held: Supports, found: Joints) -> None:
    """Hold the components of nodes to which equations leave nothing free, as supports do."""
    if not found.equations:
        return
    more = np.zeros(found.count - held.fixed.size)
    fixed = np.append(held.fixed, more > 0)
    values, slopes = np.append(held.values, more), np.append(held.slopes, more)
    given = eliminated(fixed, values, slopes, found.equations, named=found.named)
    lone = (np.diff(given.T.indptr) == 0)[: held.fixed.size].reshape(held.fixed.shape) & ~held.fixed
    for target, own in ((held.values, given.offset), (held.slopes, given.slope)):
        target[lone] = own[: held.fixed.size].reshape(held.fixed.shape)[lone]
    held.fixed[lone] = True


def _equation(mesh: PartedMesh, value: object, name: str, held: Supports, found: Joints) -> None:
    """An equation between displacements, or a support if it has one."""
    entry: Mapping[str, Any] = value if isinstance(value, Mapping) else {}
    if not isinstance(entry.get("terms"), (list, tuple)) or not entry["terms"] or entry.keys() - _KEYS:
        raise InvalidArgumentError(
            f"{name} is {shown(value)}; expected terms, a list of [node, component, coefficient], and value or slope"
        )
    dofs, coefficients = zip(*(_term(mesh, found, term, name) for term in entry["terms"]), strict=True)
    right, slope = (finite_number(entry.get(key, 0.0), f"{key} of {name}") for key in ("value", "slope"))
    if len(dofs) == 1 and dofs[0] < mesh.points.size:
        node, component = divmod(dofs[0], mesh.points.shape[1])
        fix(held, name, np.array([node]), component, right / coefficients[0], slope / coefficients[0])
    else:
        found.equations.append(Equation(np.array(dofs), np.array(coefficients), name, right, slope))
    if not found.said or not found.said[-1].startswith("equations"):
        found.said.append("equations")


_KEYS = {"terms", "value", "slope"}


def _term(mesh: PartedMesh, found: Joints, term: object, name: str) -> tuple[int, float]:
    """The number of a displacement, and its coefficient."""
    if not isinstance(term, (list, tuple)) or len(term) != 3:
        raise InvalidArgumentError(f"{name} has the term {shown(term)}; expected [node, component, coefficient]")
    node, component, value = term
    coefficient = finite_number(value, f"a coefficient of {name}")
    if coefficient == 0:
        raise InvalidArgumentError(f"{name} has the coefficient 0; expected another number")
    names, d = COMPONENTS[found.dimension], found.dimension
    of_point = isinstance(node, str) and node in found.places
    if component not in (own := names if of_point else names[:d]):
        raise InvalidArgumentError(f"{name} has the component {shown(component)}; expected one of {', '.join(own)}")
    k = names.index(component)
    if of_point:
        return int(found.dofs(node)[k]), coefficient / (1.0 if k < d else found.length)
    return d * _node(mesh, node, name) + k, coefficient


def _node(mesh: PartedMesh, node: object, name: str) -> int:
    """A node by its number, or by the name of a set of one."""
    if isinstance(node, str) and node.isdigit() and node not in mesh.node_sets:
        node = int(node)
    if isinstance(node, str):
        nodes = mesh.nodes(node)
        if len(nodes) != 1:
            raise InvalidArgumentError(f"{name} names {node}, which has {len(nodes)} nodes; expected one node")
        return int(nodes[0])
    if isinstance(node, (bool, float)) or not isinstance(node, (int, np.integer)) or not 0 <= node < len(mesh.points):
        raise InvalidArgumentError(
            f"{name} has the node {shown(node)}; expected the name of a set of one node, or a number in "
            f"0 .. {len(mesh.points) - 1}"
        )
    return int(node)


def _node_springs(mesh: PartedMesh, found: Joints, options: Options) -> sp.csc_array:
    """Stiffness of springs from each node of a part to the ground, or between two nodes."""
    frames, d = frames_of(mesh, options.transform), found.dimension
    parts: list[tuple[Integers, Floats]] = []

    def add(dofs: Integers, K: NDArray[Any]) -> None:
        parts.append((dofs[None], K[None]))

    for name, value in by_part(options.node_spring, "node_spring").items():
        ends = name.split(":") if name not in mesh.facets and name not in mesh.node_sets else [name]
        what = f"node_spring of {name}"
        stiffness = np.diag(_stiffness(value, what, found.each if name in found.places else d, len(ends) == 2))
        if name in found.places:
            turned = np.where(np.arange(found.each) < d, 1.0, found.length)
            add(found.dofs(name), stiffness / turned / turned[:, None])
        elif len(ends) == 2:
            one, two = (_node(mesh, end, what) for end in ends)
            if np.ndim(value) == 0:
                along = mesh.points[two] - mesh.points[one]
                if not np.any(along):
                    raise InvalidArgumentError(f"{what} joins nodes at one place; expected stiffnesses in x, y (and z)")
                along = along / np.linalg.norm(along)
                stiffness = stiffness[0, 0] * np.outer(along, along)
            both = np.append(one * d + np.arange(d), two * d + np.arange(d))
            add(both, np.kron([[1.0, -1.0], [-1.0, 1.0]], stiffness))
        else:
            for node in mesh.nodes(name):
                add(node * d + np.arange(d), frames.axes[node].T @ stiffness @ frames.axes[node])
    return assembled(parts, found.count)


def _stiffness(value: Any, name: str, count: int, axial: bool) -> Floats:
    """Stiffnesses of a spring, (count,), or of one along the line between two nodes, (1,)."""
    own = np.array([finite_number(value, name)]) if axial and np.ndim(value) == 0 else short_vector(value, name, count)
    if np.min(own) < 0:
        raise InvalidArgumentError(f"{name} is {shown(value)}; expected stiffnesses >= 0")
    return own


def _push_references(options: Options, found: Joints, target: Floats, slope: str) -> None:
    """Forces and moments on reference points, added to ``target``."""
    d = found.dimension
    for name, value in by_part(getattr(options, f"force{slope}"), f"force{slope}").items():
        if name in found.places:
            target[found.dofs(name)[:d] - found.points.size] += short_vector(value, f"force{slope} of {name}", d)
    for name, value in by_part(getattr(options, f"moment{slope}"), f"moment{slope}").items():
        dofs, what = found.dofs(name)[d:] - found.points.size, f"moment{slope} of {name}"
        one = [finite_number(value, what)] if d == 2 and np.ndim(value) == 0 else value
        target[dofs] += short_vector(one, what, len(dofs)) / found.length
