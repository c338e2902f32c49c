"""Boxes that may hold one solution in 3D, and assignments that hold a known one, or none, by forms of products.

See theory, sections 12.7 and 12.11. Nothing here is trusted: ``trusted.space.boxed_solution`` and
``trusted.space.product_forms`` prove what is proposed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg
import scipy.sparse

from enumsol.model.sectors import DEEPEST, SECTORS, cut, level_of, width_of
from enumsol.model.statuses import CONTACT, UNDECIDED
from enumsol.search.space.curve_proposals import ERRORS
from enumsol.support.conic import conic_answer
from enumsol.support.deadlines import look, remaining
from enumsol.trusted.space.boxed_solution import Box, BoxedSolution, BoxProblem, solution_in_box
from enumsol.trusted.space.product_forms import CONE, SIGNED, Ellipsoid, Frame
from enumsol.trusted.space.sector_rows import sector_children
from enumsol.trusted.space.space_uniqueness import moderate_units

if TYPE_CHECKING:
    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.support.array_types import Codes, Floats


#: The radius of the ellipsoid that a program is scaled for should be within this of the one that it finds.
_SCALED, _RESCALINGS = 30.0, 2
#: Rank of the forms up to which a program is begun: beyond, its preparation alone takes more than a second, in which
#: Python hears nothing, and the program minutes.
_HIGHEST = 72
#: A box around an ellipsoid is wider than that by this factor.
_ROOM = 1.01
#: Size of the box that is tried first, by the forces that would hold one node alone, and how often it is halved.
_FIRST, _HALVINGS = 1.0, 24
#: Where rho is tried between compliance and stiffness, as an exponent of the latter.
_SHARES = 0.5, 1.0
#: Seconds that a program takes, by the sixth power of that rank (its matrix has rank^2 rows); measured: 0.13 for 28,
#: 0.7 for 36, 2.7 for 44. One that would take all the time that is left is not begun.
_SECONDS = 4e-10


@dataclass(frozen=True)
class Branched:
    """A node of the tree whose children follow, depth first."""

    node: int
    children: tuple[int, ...]


@dataclass(frozen=True)
class Missed:
    """A leaf without a solution of the ellipsoid."""

    ellipsoid: Ellipsoid


@dataclass(frozen=True)
class Enclosed:
    """A leaf whose ellipsoid lies in the box of a solution."""

    ellipsoid: Ellipsoid
    found: BoxedSolution


class ProductSearch:
    """A tree of its own below an assignment without undecided nodes, whose nodes are bounded by forms of products.

    Parameters
    ----------
    system : EnclosedSpace
    """

    def __init__(self, system: EnclosedSpace) -> None:
        self._system = system
        self._rho, self._tangents = proposed_rho(system), np.sum(system.tau >= 0, axis=1).tolist()
        self._boxes: list[BoxedSolution] = []
        #: A point of the last ellipsoid: what is far from zero is rounded more.
        self._near: Floats | None = None
        #: Programs solved.
        self.programs = 0

    def closed(self, codes: Codes, programs: int) -> list[Branched | Missed | Enclosed] | None:
        """The tree below an assignment, depth first; None where more programs than so many would be needed.

        It is given up at once where the first form cuts nothing off.
        """
        if UNDECIDED in codes or not self._rho:
            return None
        last = self.programs + programs
        tree: list[Branched | Missed | Enclosed] = []
        stack: list[tuple[Codes, Ellipsoid | None, float]] = [(codes, None, 1.0)]
        while stack:
            codes, above, size = stack.pop()
            if above is not None and above.misses(codes):
                tree.append(Missed(above))
                continue
            if self.programs >= last:
                return None
            self.programs += 1
            found = self.best(codes, size)
            if found is not None:
                above, size = found
                if above.empty:
                    tree.append(Missed(above))
                    continue
                boxed = self._boxed(above)
                if boxed is not None:
                    tree.append(Enclosed(above, boxed))
                    continue
                narrowed = self._narrowed(above, tree)
                if narrowed is not None:
                    stack.append((narrowed, above, size))
                    continue
            if not tree:
                # of no use here: the first form cuts nothing off
                return None
            node = self._widest(codes)
            if node < 0:
                return None
            children = sector_children(codes[node], self._tangents[node])
            tree.append(Branched(node, children))
            stack += [((*codes[:node], child, *codes[node + 1 :]), above, size) for child in reversed(children)]
        return tree

    def _boxed(self, ellipsoid: Ellipsoid) -> BoxedSolution | None:
        """The one solution in a box around an ellipsoid, if that is proven."""
        for known in self._boxes:
            if ellipsoid.is_in(known.box, ERRORS):
                return known
        for rho in self._rho:
            box = _box(ellipsoid, rho)
            found = None if box is None else solution_in_box(self._system, box, ERRORS)
            if found is not None and ellipsoid.is_in(found.box, ERRORS):
                self._boxes.append(found)
                return found
        return None

    def _narrowed(self, ellipsoid: Ellipsoid, tree: list[Branched | Missed | Enclosed]) -> Codes | None:
        """The rest that an ellipsoid leaves of an assignment, if that is much less; the tree gets the parts cut off."""
        codes, gain, cuts = list(ellipsoid.codes), 0.0, []
        for i, code in enumerate(codes):
            parts: list[int] = []
            rest = code
            if code == CONTACT:
                children = sector_children(code, self._tangents[i])
                parts = [child for child in children if ellipsoid.node_misses(i, child)]
                if len(parts) != len(children) - 1:
                    continue
                (rest,) = set(children) - set(parts)
            elif code > SECTORS:
                for end in (0, 1):
                    # half of it, a quarter, an eighth
                    for halvings in (1, 2, 3):
                        part, left = cut(rest - SECTORS, end, halvings)
                        if level_of(left) <= DEEPEST and ellipsoid.node_misses(i, SECTORS + part):
                            parts.append(SECTORS + part)
                            rest = SECTORS + left
                            break
            if parts:
                gain += 2.0 if code == CONTACT else float(np.log2(width_of(code - SECTORS) / width_of(rest - SECTORS)))
                cuts.append((i, parts, rest))
        # an ellipsoid has to take a factor of two off the widths of all sectors, or else one is halved
        if gain < 1.0:
            return None
        for i, parts, rest in cuts:
            tree.append(Branched(i, (*parts, rest)))
            tree += [Missed(ellipsoid)] * len(parts)
            codes[i] = rest
        return tuple(codes)

    @staticmethod
    def _widest(codes: Codes) -> int:
        """The node to branch on."""
        widths = [2.0 if c == CONTACT else width_of(c - SECTORS) if c > SECTORS else 0.0 for c in codes]
        node = int(np.argmax(widths))
        return node if widths[node] > 0 else -1

    def best(self, codes: Codes, size: float) -> tuple[Ellipsoid, float] | None:
        """The smallest ellipsoid around all solutions of an assignment, and its size, near a guess of it; or None.

        Lengths are those of y - rho w.
        """
        frame = Frame.of(self._system, codes, np.zeros(len(self._system.g)))
        products = frame.products()
        rows = frame.equations.mid
        norm = np.linalg.norm(rows, axis=1)
        scaled = rows / norm[:, None]
        inside = scipy.linalg.null_space(scaled)
        left, rank = remaining(), inside.shape[1]
        if not products or not 0 < rank <= _HIGHEST or (left is not None and left < _SECONDS * rank**6):
            return None
        away = np.eye(len(self._system.g)) + self._rho[0][:, None] * self._system.S
        U, long, V = np.linalg.svd(away @ inside, full_matrices=False)
        T = inside @ (V.T / long)
        at = -np.linalg.pinv(scaled) @ (frame.rest.mid / norm)
        if self._near is not None:
            at = at + T @ (U.T @ (away @ (self._near - at)))
        values = frame.values.mid + frame.parts.mid @ at
        whole = np.concatenate([frame.parts.mid @ T, values[:, :, None]], axis=2)
        matrices = np.array([whole[i].T @ matrix.mid @ whole[i] for i, matrix, _ in products])
        kinds = [kind for _, _, kind in products]
        for _ in range(_RESCALINGS):
            look()
            found = _solved(matrices, kinds, size)
            if found is None:
                return None
            z, u, least = found
            if least >= 0 or 1 / _SCALED <= (root := np.sqrt(-least)) <= _SCALED:
                break
            size *= float(root)
        centre = at + T @ u
        ellipsoid = Ellipsoid.of(self._system, codes, centre, z, ERRORS)
        if ellipsoid is None:
            return None
        self._near = centre
        return ellipsoid, size * float(np.sqrt(max(-least, 1e-2)))


def _box(ellipsoid: Ellipsoid, rho: Floats) -> Box | None:
    """A box that holds an ellipsoid, for boxes with such a rho."""
    T, system = ellipsoid.T, ellipsoid.frame.system
    with np.errstate(all="ignore"):
        radius = np.linalg.norm(T + rho[:, None] * (system.S @ T), axis=1) * ellipsoid.reach * _ROOM
    if ellipsoid.empty or not np.all(np.isfinite(radius)) or not np.all(radius > 0):
        return None
    return Box.of(system, ellipsoid.frame.centre, radius, rho)


def _solved(matrices: Floats, kinds: list[int], size: float) -> tuple[Floats, Floats, float] | None:
    """Multipliers of the form with curvature one at least that has the largest minimum, where it is, and that minimum.

    u is measured by ``size``, in the minimum as well.
    """
    import clarabel  # takes a while to import

    rank, kind, count = matrices.shape[1] - 1, np.array(kinds), len(kinds)
    signed, triples = np.flatnonzero(kind == SIGNED), np.flatnonzero(kind == CONE)
    scale = np.append(np.full(rank, size), 1.0)
    reduced = -scale[:, None] * matrices * scale
    norm = np.linalg.norm(reduced, axis=(1, 2))
    norm[triples] = np.repeat(np.max(norm[triples].reshape(-1, 3), axis=1), 3)
    reduced = reduced / norm[:, None, None]
    inner, corner = reduced[:, :rank, :rank], np.zeros((rank + 1, rank + 1))
    corner[rank, rank] = 1.0
    # unknowns: the multipliers, and the minimum; whose signs, mean curvature and cones, and what is to be definite;
    # the mean curvature is at most a thousand times the least one
    chosen = -np.eye(count, count + 1)
    flat = np.append(np.trace(inner, axis1=1, axis2=2), 0.0)
    blocks = [
        (np.vstack([chosen[signed], flat]), np.append(np.zeros(len(signed)), 1e3 * rank)),
        (chosen[triples], np.zeros(len(triples))),
        (-np.column_stack([_packed(reduced).T, _packed(-corner)]), np.zeros(len(_packed(corner)))),
        (-np.column_stack([_packed(inner).T, 0.0 * _packed(np.eye(rank))]), -_packed(np.eye(rank))),
    ]
    cones = [clarabel.NonnegativeConeT(len(signed) + 1)] + [clarabel.SecondOrderConeT(3)] * (len(triples) // 3)
    cones += [clarabel.PSDTriangleConeT(rank + 1), clarabel.PSDTriangleConeT(rank)]
    rows, right = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
    goal, none = np.append(np.zeros(count), -1.0), scipy.sparse.csc_matrix((count + 1, count + 1))
    answer = conic_answer((none, goal), (scipy.sparse.csc_matrix(rows), right), cones, len(right) ** 2)
    z = np.array(answer.x)[:count]
    if not np.all(np.isfinite(z)):
        return None
    form = np.tensordot(z, reduced, 1)
    try:
        u = -np.linalg.solve(form[:rank, :rank], form[:rank, rank])
    except np.linalg.LinAlgError:
        return None
    least = float(form[rank, rank] + form[rank, :rank] @ u)
    return (_allowed(z / norm, kinds), size * u, least) if np.isfinite(least) else None


def _allowed(z: Floats, kinds: list[int]) -> Floats:
    """Multipliers moved to where they are allowed."""
    z = np.where(np.array(kinds) == SIGNED, np.maximum(z, 0.0), z)
    first = 0
    while first < len(kinds):
        if kinds[first] == CONE:
            z[first] = max(z[first], np.hypot(z[first + 1], z[first + 2]) * (1 + 1e-12))
            first += 3
        else:
            first += 1
    return z


def _packed(matrices: Floats) -> Floats:
    """Upper triangles by columns, with what is off the diagonal times the root of two."""
    size = matrices.shape[-1]
    column, row = np.tril_indices(size)
    return np.where(row == column, 1.0, np.sqrt(2.0)) * matrices[..., row, column]


def box_around(system: EnclosedSpace, y: Floats) -> Box | None:
    """A box, as large as is found, that seems to hold one solution, near scaled forces y."""
    if not moderate_units(system.unit) or not np.all(np.isfinite(y)):
        return None
    with np.errstate(all="ignore"):
        for rho in proposed_rho(system):
            problem = BoxProblem.of(system, rho)
            centre = None if problem is None else problem.zero(y * system.unit)
            if problem is None or centre is None:
                continue
            near = problem.around(centre)
            radius = np.full(len(y), _FIRST * float(np.max(np.abs(problem.g.mid) / np.diagonal(problem.S.mid))))
            for _ in range(_HALVINGS):
                if near.mapped(radius, 2.0) is not None:
                    return Box.of(system, centre / system.unit, radius / system.unit, rho)
                radius *= 0.5
    return None


def proposed_rho(system: EnclosedSpace) -> list[Floats]:
    """rho, one for lambda_n and one for tau of every node, scaled: between 1 / S_ii and the stiffness S^-1_ii."""
    soft = system.unit**2 / np.diagonal(system.S)
    try:
        stiff = np.diagonal(np.linalg.inv(system.S)) * system.unit**2
    except np.linalg.LinAlgError:
        return []
    found = []
    for share in _SHARES:
        rho = soft ** (1.0 - share) * stiff**share
        for t in system.tau:
            rho[t[t >= 0]] = np.min(rho[t[t >= 0]], initial=np.inf)
        found.append(rho / system.unit**2)
    return found
