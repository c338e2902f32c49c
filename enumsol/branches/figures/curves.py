"""Arcs as polygons that lie on them to a tolerance, for plots and reports."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from enumsol.support.arguments import one_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from enumsol.branches.elements import Arc
    from enumsol.roots.local_branch import ContactState
    from enumsol.support.array_types import Floats, Indices


#: Initial number of points, which determine the range of every quantity, and the largest number of points of an arc.
_FIRST, _MOST = 9, 1025


class Curve(NamedTuple):
    """Points along an arc: alphas (k,), lambda and w there (k, 2p), in 3D (k, 3p), and what is drawn (k, columns)."""

    alphas: Floats
    forces: Floats
    moves: Floats
    values: Floats


def curves(
    arcs: Sequence[Arc],
    quantities: str | Sequence[str],
    width: float,
    tolerance: float,
    window: tuple[float, float] | None = None,
    *,
    components: bool = False,
) -> dict[int, Curve]:
    """Points along arcs, by the numbers of the arcs.

    Between neighbouring points the arc is closer to the chord than the tolerance, in every quantity and at every node,
    in a picture whose height is the range of that quantity at that node over all arcs, and whose width is ``width``.
    Near a fold values change like the root of the distance in alpha: points are halved in an angle t with
    alpha = lo + (hi - lo) (1 - cos t) / 2, in which they are smooth there.

    Parameters
    ----------
    arcs : sequence of Arc
        No sheets.
    quantities : names among QUANTITIES, one or several
        Columns of the values in that order.
    width : float
        What alpha is measured by.
    tolerance : float
        Relative to the picture's width and height.
    window : (float, float), optional
        Only the parts of arcs between these alphas; arcs outside are left out.
    components : bool
        All components of forces and displacements are further columns, for users of these: in 3D quantities have the
        lengths of tangential vectors only.
    """
    names = (quantities,) if isinstance(quantities, str) else tuple(quantities)
    low, high = (-np.inf, np.inf) if window is None else window
    ranges = {arc.number: (max(arc.lo, low), min(arc.hi, high)) for arc in arcs}
    # arcs that only touch the window are left out, those that are shorter than rounding are not
    seen = [arc for arc in arcs if ranges[arc.number][0] < ranges[arc.number][1] or low <= arc.lo == arc.hi <= high]
    polygons = [_Polygon(arc, names, ranges[arc.number], components=components) for arc in seen]
    if not polygons:
        return {}
    values = np.concatenate([polygon.curve.values for polygon in polygons])
    height = np.max(values, axis=0) - np.min(values, axis=0)
    # a node at which nothing changes but rounding is not looked at
    height[height <= 1e-12 * np.max(np.abs(values), axis=0)] = np.inf
    for polygon in polygons:
        polygon.refine(width, height, tolerance)
    return {arc.number: polygon.curve for arc, polygon in zip(seen, polygons, strict=True)}


class _Polygon:
    """Points of one arc in the order of the angle t."""

    def __init__(self, arc: Arc, names: tuple[str, ...], ends: tuple[float, float], *, components: bool) -> None:
        self._arc, self._components = arc, components
        self._lo, self._hi = ends
        self._quantities = [QUANTITIES[name] for name in names]
        self._angles = np.linspace(0.0, np.pi, _FIRST)
        self.curve = self._at(self._angles)

    def _at(self, angles: Floats) -> Curve:
        lo, hi = self._lo, self._hi
        alphas = np.clip(lo + 0.5 * (1.0 - np.cos(angles)) * (hi - lo), lo, hi)
        alphas[angles == np.pi] = hi
        # an arc shorter than rounding is a point
        points = [self._arc.state(float(alpha)) for alpha in alphas[: 1 if lo == hi else None]]
        points *= 1 if len(points) == len(alphas) else len(alphas)
        forces, moves = (np.array([point[part] for point in points]) for part in (0, 1))
        values = [columns(item, forces, moves, len(self._arc.statuses)) for item in self._quantities]
        values += [forces, moves] if self._components else []
        return Curve(alphas, forces, moves, np.concatenate(values, axis=1))

    def refine(self, width: float, height: Floats, tolerance: float) -> None:
        """Halve angles until all chords are close."""
        doubtful = np.full(len(self._angles) - 1, self._lo < self._hi)
        while np.any(doubtful) and len(self._angles) < _MOST:
            k = np.flatnonzero(doubtful)
            middle = 0.5 * (self._angles[k] + self._angles[k + 1])
            new = self._at(middle)
            far = self._distance(k, new, width, height) > tolerance
            self._angles = np.insert(self._angles, k + 1, middle)
            self.curve = Curve(*(np.insert(old, k + 1, part, 0) for old, part in zip(self.curve, new, strict=True)))
            # both halves of what was far are looked at again
            place = k + np.arange(len(k))
            doubtful = np.zeros(len(self._angles) - 1, dtype=bool)
            doubtful[place[far]] = doubtful[place[far] + 1] = True

    def _distance(self, k: Indices, new: Curve, width: float, height: Floats) -> Floats:
        """Largest distance, over the columns, of points from the chords k."""
        alphas, values = self.curve.alphas, self.curve.values
        run = (alphas[k + 1] - alphas[k])[:, None] / width
        rise = (values[k + 1] - values[k]) / height
        across = (new.alphas - alphas[k])[:, None] / width
        up = (new.values - values[k]) / height
        length = np.hypot(run, rise)
        off = np.abs(run * up - rise * across)
        return np.asarray(np.max(np.divide(off, length, out=np.hypot(across, up), where=length > 0), axis=1))


def cut_at(curve: Curve, column: int, ends: Sequence[float]) -> list[tuple[Floats, Floats]]:
    """Alphas and values of one column, (k,) each, in the parts of a curve between neighbouring ``ends``, in order."""
    alphas, values = curve.alphas, curve.values[:, column]
    if len(ends) == 2:
        return [(alphas, values)]
    parts = []
    for low, high in pairwise(np.clip(ends, alphas[0], alphas[-1]).tolist()):
        at = np.concatenate([[low], alphas[(low < alphas) & (alphas < high)], [high]])
        parts.append((at, np.interp(at, alphas, values)))
    return parts


class CurvePlace(NamedTuple):
    """The place of an arc among those that look the same in a picture: its rank, and how many there are."""

    rank: int
    among: int
    #: Names the arcs that are drawn side by side.
    group: int


def side_by_side(
    drawn: Mapping[int, Curve], branch_of: Mapping[int, int], column: int, height: float | None = None
) -> dict[int, CurvePlace]:
    """Places of arcs, by their numbers, among those that coincide in one column wherever both are.

    Parameters
    ----------
    drawn : mapping of numbers of arcs to Curve
    branch_of : mapping of numbers of arcs to those of branches
        Arcs of a branch have the same rank as far as possible.
    column : int
        Of the values.
    height : float, optional
        Of the picture; default the range of the values.
    """
    numbers = sorted(drawn, key=lambda arc: (branch_of[arc], arc))
    if not numbers:
        return {}
    alphas = [drawn[arc].alphas for arc in numbers]
    ends = [(a[0], a[-1]) for a in alphas]
    grid = np.linspace(min(lo for lo, _ in ends), max(hi for _, hi in ends), 64)
    grid = np.unique(np.concatenate([grid, [0.5 * (lo + hi) for lo, hi in ends]]))
    table = np.array(
        [
            np.interp(grid, a, drawn[arc].values[:, column], left=np.nan, right=np.nan)
            for arc, a in zip(numbers, alphas, strict=True)
        ]
    )
    # about the width of a line
    near = 4e-3 * (max(float(np.nanmax(table) - np.nanmin(table)), 1e-300) if height is None else height)
    first, last = np.array(ends).T
    # what coincides over less is not seen
    least = 0.015 * (grid[-1] - grid[0])
    ranks, groups = [0] * len(numbers), list(range(len(numbers)))
    usual: dict[int, int] = {}
    for i, arc in enumerate(numbers):
        apart = np.abs(table[:i] - table[i])
        with_both = ~np.isnan(apart)
        long = np.minimum(last[:i], last[i]) - np.maximum(first[:i], first[i]) >= least
        same = np.flatnonzero(long & np.any(with_both, axis=1) & np.all((apart <= near) | ~with_both, axis=1))
        taken = {ranks[j] for j in same}
        wanted = usual.setdefault(branch_of[arc], min(set(range(len(taken) + 1)) - taken))
        ranks[i] = wanted if wanted not in taken else min(set(range(len(taken) + 1)) - taken)
        merged = {groups[j] for j in same}
        groups[: i + 1] = [i if group in merged or k == i else group for k, group in enumerate(groups[: i + 1])]
    count = {group: 1 + max(r for r, g in zip(ranks, groups, strict=True) if g == group) for group in set(groups)}
    alone = {group for group in count if groups.count(group) == 1}
    return {
        arc: CurvePlace(0, 1, group) if group in alone else CurvePlace(rank, count[group], group)
        for arc, rank, group in zip(numbers, ranks, groups, strict=True)
    }


class Quantity(NamedTuple):
    """A quantity of a solution: in words, "force" or "length", and whether it is one of every contact node."""

    name: str
    words: str
    dimension: str
    by_node: bool


#: By their names; the first is drawn when none is asked for.
QUANTITIES = {
    item.name: item
    for item in (
        Quantity("norm", "norm of all contact forces", "force", by_node=False),
        Quantity("sum_n", "sum of normal forces", "force", by_node=False),
        Quantity("sum_t", "sum of tangential forces", "force", by_node=False),
        Quantity("lambda_n", "normal force", "force", by_node=True),
        Quantity("lambda_t", "tangential force", "force", by_node=True),
        Quantity("u_n", "normal displacement", "length", by_node=True),
        Quantity("u_t", "tangential displacement", "length", by_node=True),
    )
}


def quantity_of(name: object) -> Quantity:
    """The quantity of that name.

    Raises
    ------
    InvalidArgumentError
        There is none; the message lists them.
    """
    return QUANTITIES[one_of(name, "quantity", QUANTITIES)]


def columns(quantity: Quantity, forces: Floats, moves: Floats, p: int) -> Floats:
    """Values at solutions of p nodes, shape (..., p), or (..., 1) of an overview.

    lambda and w have shape (..., 2p), or in 3D (..., 3p); then tangential values are lengths of vectors.
    """
    if quantity.name == "norm":
        return np.asarray(np.linalg.norm(forces, axis=-1, keepdims=True))
    part = moves if quantity.dimension == "length" else forces
    if quantity.name.endswith("_n"):
        return part[..., :p] if quantity.by_node else np.sum(part[..., :p], axis=-1, keepdims=True)
    along = part[..., p:].reshape(*part.shape[:-1], -1, p)
    along = along if quantity.by_node else np.sum(along, axis=-1, keepdims=True)
    return along[..., 0, :] if part.shape[-1] == 2 * p else np.asarray(np.linalg.norm(along, axis=-2))


def state_columns(quantity: Quantity, state: ContactState) -> Floats:
    """Values of a quantity at a vertex, or at another state with lambda_n, lambda_t, u_n and u_t; as `columns`."""
    pairs = (state.lambda_n, state.lambda_t), (state.u_n, state.u_t)
    forces, moves = (np.concatenate([normal, along.ravel(order="F")]) for normal, along in pairs)
    return columns(quantity, forces, moves, len(state.statuses))
