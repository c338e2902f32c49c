"""Relaxations in 3D: rows for slip directions in sectors, made when they are first needed (theory, section 12.2)."""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Self
from weakref import WeakSet

import numpy as np

from enumsol.errors import MissingDependencyError
from enumsol.model.sectors import SECTORS, cut, end_number, middle_number, nearest, start_number, width_level, width_of
from enumsol.model.statuses import CONTACT, OPEN, SLIP_MINUS, SLIP_PLUS, STICK, UNDECIDED
from enumsol.relaxation.engine import EQUALITY, FEASIBILITY_TOLERANCE, INEQUALITY, PRUNE_MARGIN, not_compiled
from enumsol.trusted.space import sector_rows

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from enumsol.condensation.space_condensed import SpaceSystem
    from enumsol.relaxation._active_set import QPData, QPState
    from enumsol.support.array_types import Codes, Floats, Indices
    from enumsol.trusted.space.sector_margins import SlipForm

    Children = dict[tuple[int, ...], "SpaceRelaxation"]


#: A slice is this power of 1/2 of its sector: at first, and at least.
FIRST, THINNEST = 1, 2
#: A leaf whose sectors all have this level or a deeper one is tested before anything is cut off. A sector in which
#: nothing is violated is not cut from this level on: near a degenerate root that would go on for many levels.
NARROW = 8


@dataclass
class Shaving:
    """Knowledge about the sectors at a node of the tree, from it and from those above it.

    Attributes
    ----------
    tried : by contact node and end (0, 1), what the next slice is and log2 of the product of all widths before it
    tested : log2 of the product of all widths when the leaf was tested last
    """

    tried: dict[tuple[int, int], tuple[int, float]] = field(default_factory=dict)
    tested: float = math.inf

    def copy(self) -> Shaving:
        """Copy with which a child begins."""
        return Shaving(dict(self.tried), self.tested)

    def sectors(self, codes: Codes, violated: Sequence[bool]) -> list[int]:
        """Nodes whose sectors may be cut, the widest first; ``violated``, by node, where maximum dissipation is."""
        there = [i for i, code in enumerate(codes) if code > SECTORS]
        nodes = [i for i in there if violated[i] or width_level(codes[i] - SECTORS) < NARROW]
        return sorted(nodes, key=lambda i: -width_of(codes[i] - SECTORS))

    def shares(self, codes: Codes, node: int, end: int) -> Iterator[int]:
        """The slices to be tried at an end of a sector, as numbers of halvings, one after the other."""
        halvings, before = self.tried.get((node, end), (FIRST, math.inf))
        if halvings > THINNEST:
            # tried again once the product of all widths is less than half of what it was
            if before - _size(codes) < 1.0:
                return
            halvings = THINNEST
        yield from range(halvings, THINNEST + 1)

    def note(self, codes: Codes, node: int, end: int, halvings: int, *, excluded: bool) -> None:
        """Take note of what came of a slice: after one that is excluded a wider one is tried, else a thinner one."""
        self.tried[node, end] = (max(halvings - 1, FIRST) if excluded else halvings + 1), _size(codes)

    def leaf_is_due(self, codes: Codes) -> bool:
        """True if a leaf is to be tested now, which is then noted."""
        levels = [width_level(code - SECTORS) for code in codes if code > SECTORS]
        # again when the sectors have become narrower by half a level on average
        if not levels or min(levels) < NARROW or self.tested - _size(codes) < 0.5 * len(levels):
            return False
        self.tested = _size(codes)
        return True


def _size(codes: Codes) -> float:
    """Log2 of the product of the widths of all sectors."""
    return math.fsum(math.log2(width_of(code - SECTORS)) for code in codes if code > SECTORS)


#: Level of the directions on which tangents are put in any case: more of them make every program larger.
COARSE = 3
#: Rounds of tangents where the minimiser leaves the disc.
ROUNDS = 4
#: Sectors of this level and below are halved only where nothing else helps.
_DEEP = 12
#: Violations of maximum dissipation below this do not tell which sector to halve.
_DISSIPATION = 1e-7


class SpaceEngine:
    """Convex quadratic programs of a tree in 3D.

    Every node has slots for rows; row number ``slot * p + node`` belongs to a node, as elsewhere.

    Parameters
    ----------
    system : SpaceSystem
    rows : how many of them a program may have

    Attributes
    ----------
    tangents : list of int
        Number of directions with friction of each node, 0 to 2.
    turning : (p,) array of bool
        Nodes with both.
    first : nodes of which it is decided before all else whether they are open, in this order

    Raises
    ------
    MissingDependencyError
        The compiled solver is not available.
    """

    name = "active-set"
    solves_children = True

    def __init__(self, system: SpaceSystem, rows: int = 24576) -> None:
        try:
            from enumsol.relaxation import _active_set
        except ImportError as error:
            raise MissingDependencyError(f"the search in 3D needs it, but {not_compiled(error)}") from error
        self.system = system
        p = system.p
        self.slots = rows // p
        self._state, self._programs = _active_set.QPState, _active_set.QPData
        self.data = self._bounded(system.S, system.g)
        #: The form that relaxations bound; None for the energy.
        self.form: SlipForm | None = None
        #: This engine and those with the same rows.
        self._sharing = WeakSet([self])
        self._known: list[dict[tuple[int, int], int]] = [{} for _ in range(p)]
        self._imposed: dict[tuple[int, int], tuple[list[int], list[int]]] = {}
        self.tangents = np.sum(system.tau >= 0, axis=1).tolist()
        self.turning = np.all(system.tau >= 0, axis=1)
        nodes = np.flatnonzero(self.turning)
        #: Of the nodes with both tangents: number, places of tau in y, and factors of tau and of the disc's radius.
        self._discs = nodes, system.tau[nodes].T, system.tau_scale[nodes].T, system.disc_scale[nodes] * (1.0 + 1e-3)
        #: Row by number, for multipliers, and what the program's row is of it.
        self.rows: dict[int, sector_rows.Row] = {}
        self.scale, self._unit = np.ones(self.slots * p), system.row_unit.tolist()
        self.limit = 400 + 20 * len(system.g)
        self.first: Sequence[int] = ()
        self.full = False

    def slot(self, row: sector_rows.Row) -> int | None:
        """The slot of a row among those of its node; None when there is no room for it."""
        kind, node, number = row
        known = self._known[node]
        if (kind, number) not in known:
            if len(known) == self.slots:
                self.full = True
                return None
            slot = known[kind, number] = len(known)
            self.rows[slot * self.system.p + node] = row
            self._put(slot * self.system.p + node, row)
        return known[kind, number]

    def _bounded(self, H: Floats, h: Floats) -> QPData:
        """Programs that bound y'H y - h'y, without rows."""
        system, rows = self.system, self.slots * self.system.p
        start, zeros = 3 * np.arange(rows + 1, dtype=np.intp), np.zeros(3 * rows)  # three entries a row
        return self._programs(H, h, -system.S, system.g, start, zeros.astype(np.intp), zeros, zeros[:rows])

    def bounding(self, form: SlipForm) -> SpaceEngine:
        """An engine with the same rows whose relaxations bound a form, which is convex, in place of the energy."""
        other = copy.copy(self)
        other.form, other.data = form, self._bounded(form.H, form.h)
        for place, row in self.rows.items():
            other.data.put_row(place, *self._stored(place, row))
        self._sharing.add(other)
        return other

    def _put(self, place: int, row: sector_rows.Row) -> None:
        """Store a row."""
        indices, values = self._stored(place, row)
        for engine in self._sharing:
            engine.data.put_row(place, indices, values)

    def _stored(self, place: int, row: sector_rows.Row) -> tuple[tuple[int, ...], list[float]]:
        """A row in the units of y and w, scaled so that its largest coefficient stays of size one."""
        indices, coefficients = sector_rows.sector_row_terms(row, self.system.tau, len(self.system.g))
        units = [self._unit[i] for i in indices]
        scale = self.scale[place] = 1.0 / max(units)
        return indices, [value * (unit * scale) for value, unit in zip(coefficients, units, strict=True)]

    def imposed(self, node: int, code: int) -> tuple[list[int], list[int]]:
        """Numbers and modes of the rows that a node imposes in a (partial) status."""
        found = self._imposed.get((node, code))
        if found is None:
            pairs = [(self.slot(row), mode) for row, mode in imposed(self.system.tau, node, code)]
            kept = [(slot * self.system.p + node, mode) for slot, mode in pairs if slot is not None]
            found = self._imposed[node, code] = [row for row, _ in kept], [mode for _, mode in kept]
        return found

    def children(self, node: int, code: int) -> tuple[int, ...]:
        """Codes that together cover a partial status of a node."""
        return sector_rows.sector_children(code, self.tangents[node])

    def outside(self, y: Floats) -> list[tuple[int, float, float]]:
        """Nodes whose tau is clearly outside the disc of radius lambda_n, with its direction."""
        nodes, places, factors, radii = self._discs
        first, second = y[places] * factors
        found = np.flatnonzero(np.hypot(first, second) > y[nodes] * radii + 1e-9)
        return list(zip(nodes[found].tolist(), first[found].tolist(), second[found].tolist(), strict=True))

    def root(self, rows: list[int], modes: list[int]) -> SpaceRelaxation:
        """The relaxation with the given rows on."""
        return SpaceRelaxation(self, self._state(self.data), rows, modes)


def imposed(tau: Indices, node: int, code: int) -> list[tuple[sector_rows.Row, int]]:
    """Rows that a (partial) status of a node imposes, and their modes; those of a child extend its parent's."""
    axes = [k for k in range(2) if tau[node, k] >= 0]
    inequalities: list[sector_rows.Row] = [(sector_rows.FORCE, node, 0)]
    equations: list[sector_rows.Row] = []
    (inequalities if code in (OPEN, UNDECIDED) else equations).append((sector_rows.GAP, node, 0))
    if code == OPEN:
        equations = [(sector_rows.FORCE, node, 0), *((sector_rows.TAU, node, k) for k in axes)]
        return [(inequalities[1], INEQUALITY), *((row, EQUALITY) for row in equations)]
    if len(axes) == 2:
        inequalities += [(sector_rows.TANGENT, node, (1 << COARSE) + k) for k in range(1 << COARSE)]
    elif axes:
        forward = 1 if code == SLIP_PLUS else -1 if code == SLIP_MINUS else 0
        inequalities += [(sector_rows.END, node, sign) for sign in (1, -1) if sign != forward]
        if forward:
            equations.append((sector_rows.END, node, forward))
            inequalities.append((sector_rows.ALONG, node, forward))
    if code == STICK:
        equations += [(sector_rows.SLIP, node, k) for k in axes]
    if code > SECTORS:
        number = code - SECTORS
        inequalities += [
            (sector_rows.TANGENT, node, n) for n in (start_number(number), middle_number(number), end_number(number))
        ]
        inequalities += [(kind, node, number) for kind in (sector_rows.CHORD, sector_rows.LEFT, sector_rows.RIGHT)]
    return [(row, mode) for rows, mode in ((inequalities, INEQUALITY), (equations, EQUALITY)) for row in rows]


class SpaceRelaxation:
    """A solved relaxation, with tangents put where its minimiser left the disc."""

    __slots__ = ("_engine", "_excluded", "_found", "_kept", "_shaving", "_state", "bound", "cut", "pruned", "stalled")

    def __init__(self, engine: SpaceEngine, state: QPState, rows: list[int], modes: list[int]) -> None:
        self._engine, self._state = engine, state
        #: Children solved already, by their rows.
        self._found: Children = {}
        #: Those that are excluded, here or above: their multipliers exclude them below, too.
        self._excluded: Children = {}
        self._shaving = Shaving()
        #: The node whose sector is not halved but cut into these parts, if there is one.
        self.cut: tuple[int, tuple[int, ...]] | None = None
        self._kept: tuple[Floats, Floats, tuple[Indices, Floats]] | None = None
        self._solve(rows, modes)
        for _ in range(ROUNDS):
            if self.pruned or self.stalled:
                break
            rows = self._cuts()
            if not rows:
                break
            self._solve(rows, [INEQUALITY] * len(rows))

    def _solve(self, rows: list[int], modes: list[int]) -> None:
        state = self._state
        state.switch(rows, modes)
        status = state.solve(PRUNE_MARGIN, FEASIBILITY_TOLERANCE, self._engine.limit)
        self.bound: float = state.bound
        self.pruned, self.stalled = status == 1, status == 2

    def _cuts(self) -> list[int]:
        """Rows of tangents at nodes whose tau is outside the disc of radius lambda_n."""
        engine, rows = self._engine, []
        for node, x, y in engine.outside(self.forces):
            slot = engine.slot((sector_rows.TANGENT, node, nearest(x, y, 10)))
            if slot is not None and not self._state.mode_of(slot * engine.system.p + node):
                rows.append(slot * engine.system.p + node)
        return rows

    @property
    def form(self) -> SlipForm | None:
        """The form that ``bound`` is about; None for the energy."""
        return self._engine.form

    @property
    def forces(self) -> Floats:
        """y at the minimiser, shape (m,), scaled."""
        return self._state.x_array if self._kept is None else self._kept[0]

    @property
    def displacements(self) -> Floats:
        """w at the minimiser, shape (m,), scaled."""
        return self._state.w_array if self._kept is None else self._kept[1]

    def at(self, i: int) -> tuple[float, float]:
        """Number i of the forces and of the displacements."""
        return float(self.forces[i]), float(self.displacements[i])

    def multipliers(self) -> tuple[Indices, Floats]:
        """Rows and their multipliers, which prove ``bound``."""
        if self._kept is not None:
            return self._kept[2]
        numbers, values = self._state.multipliers()
        return numbers, values * self._engine.scale[numbers]

    def _released(self) -> SpaceRelaxation:
        """Give away the state that children would start from; what was found is kept."""
        self._kept = self.forces, self.displacements, self.multipliers()
        del self._state
        return self

    def choose(self, codes: Codes) -> int:
        """The node to branch on; -1 when the leaf is to be tested.

        Once all statuses are final, slices are cut off the sectors first, and leaves with narrow sectors are tested.
        """
        self.cut = None
        for node in self._engine.first:
            if codes[node] == UNDECIDED:
                return node
        score = self.violations(codes)
        if not {CONTACT, UNDECIDED} & set(codes):
            if self._shaving.leaf_is_due(codes):
                return -1
            node = self.shaved(codes, (score > 0.0).tolist())
            if node >= 0:
                return node
        return self.most_promising(codes, score)

    def most_promising(self, codes: Codes, score: Floats) -> int:
        """The node with the best children, given its violation of complementarity; -1 where nothing is violated.

        All children of a candidate are solved, where complementarity is violated most first. The first candidate with
        at most one child that is not excluded is taken, or else the one that promises the smallest tree.
        """
        candidates = [node for node in np.argsort(-score, kind="stable").tolist() if score[node] > 0.0]
        for node in candidates:
            if sum(rows not in self._excluded for rows, _ in self._parts(node, codes[node])) <= 1:
                return self._chosen(self.solved_children(node, codes[node]), node)
        best, most = -1, 0.0
        for node in candidates:
            children = self.solved_children(node, codes[node])
            left = np.array([child.bound for child in children.values() if not child.pruned])
            if len(left) <= 1:
                return self._chosen(children, node)
            closed = np.clip((left - self.bound) / max(PRUNE_MARGIN - self.bound, 1e-300), 0.0, 1.0)
            # how much the violation counts, and a child's share of the gap (studies/search_in_3d_choices)
            promise = float(score[node] ** 0.3 / np.sum(np.exp(-4.0 * closed)))
            if not most >= promise:
                best, most = node, promise
        return best

    def shaved(self, codes: Codes, violated: Sequence[bool]) -> int:
        """A node from whose sector slices are cut off that are excluded, or -1; the parts are kept in ``cut``."""
        shaving = self._shaving
        for node in shaving.sectors(codes, violated):
            parts, rest = [], codes[node] - SECTORS
            for end in (0, 1):
                for halvings in shaving.shares(codes, node, end):
                    part, left = cut(rest, end, halvings)
                    rows, modes = self._engine.imposed(node, SECTORS + part)
                    excluded = self._solved({tuple(rows): modes})[tuple(rows)].pruned
                    shaving.note(codes, node, end, halvings, excluded=excluded)
                    if excluded:
                        parts.append(SECTORS + part)
                        rest = left
                        break
            if parts:
                self.cut = node, (*parts, SECTORS + rest)
                return node
        return -1

    def _chosen(self, children: Children, node: int) -> int:
        """Keep the children of a node with at most one that is not excluded."""
        self._found = {rows: child for rows, child in children.items() if not child.pruned}
        return node

    def solved_children(self, node: int, code: int) -> Children:
        """The relaxations of all children of a node, by their rows."""
        return self._solved(dict(self._parts(node, code)))

    def _parts(self, node: int, code: int) -> list[tuple[tuple[int, ...], list[int]]]:
        """Rows of all children of a node, and their modes."""
        parts = [self._engine.imposed(node, child) for child in self._engine.children(node, code)]
        return [(tuple(rows), modes) for rows, modes in parts]

    def _solved(self, parts: dict[tuple[int, ...], list[int]]) -> Children:
        """Children by their rows; those that are excluded are kept for all that lies below."""
        children = {rows: self.child(list(rows), modes, last=False) for rows, modes in parts.items()}
        new = {rows: child for rows, child in children.items() if child.pruned and rows not in self._excluded}
        if new:
            self._excluded = {**self._excluded, **{rows: child._released() for rows, child in new.items()}}
        return children

    def violations(self, codes: Codes) -> Floats:
        """Violation of complementarity at every node that can be branched on; -inf at the others."""
        system, y, w = self._engine.system, self.forces, self.displacements
        array, p = np.array(codes), system.p
        slip = self._dissipation()
        # an undecided node's slip counts double: deciding it now saves the slack that it leaves in the energy
        score = slip + np.where(array == UNDECIDED, slip - y[:p] * w[:p], 0.0)
        levels = np.array([width_level(code - SECTORS) if code > SECTORS else _DEEP for code in codes])
        wide = (levels < _DEEP) & (slip > _DISSIPATION)
        undecided = (array == CONTACT) | (array == UNDECIDED)
        return np.where(undecided, np.maximum(score, _DISSIPATION * _DISSIPATION), np.where(wide, score, -np.inf))

    def _dissipation(self) -> Floats:
        """By how much maximum dissipation is violated at every node: lambda_n |v| - tau . v."""
        system, y = self._engine.system, self.forces
        w = self.displacements
        size = np.linalg.norm(system.slips(w), axis=1) / system.slip_scale
        # the units of tau and v cancel
        return np.asarray(y[: system.p] * size - np.sum(system.tangential(y) * system.tangential(w), axis=1))

    def forced(self, codes: Codes) -> tuple[int, ...]:
        """No node is forced here."""
        return ()

    def child(self, rows: list[int], modes: list[int], *, last: bool) -> SpaceRelaxation:
        """The relaxation with further rows switched on; ``last``: this object is not used again."""
        key = tuple(rows)
        found = self._excluded.get(key) or self._found.pop(key, None)
        if found is None:
            found = type(self)(self._engine, self._state if last else self._state.copy(), rows, modes)
        return found if found.pruned else found.inheriting(self)

    def inheriting(self, other: SpaceRelaxation) -> Self:
        """Itself, with what is known above it, or at the same node of the tree."""
        self._excluded, self._shaving = other._excluded, other._shaving.copy()
        return self
