"""Arcs as polygons that lie on them to a tolerance, for plots."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from enumsol.branches.elements import Arc

    Vector = NDArray[np.float64]
    Matrix = NDArray[np.float64]
    #: Alphas along an arc, shape (k,), and a quantity at all nodes there, shape (k, p).
    Curve = tuple[Vector, Matrix]

#: Points at first, by which the range of every quantity is told, and most points of an arc.
_FIRST, _MOST = 9, 1025


def curves(arcs: Sequence[Arc], quantity: str, width: float, tolerance: float) -> dict[int, Curve]:
    """Alphas and values along arcs, by the numbers of the arcs.

    Between neighbouring points the arc is closer to the chord than the tolerance, for every node, in a picture whose
    height is the range of the quantity at that node over all arcs, and whose width is ``width``. Near a fold values
    change like the root of the distance in alpha: points are halved in an angle t with alpha = lo + (hi - lo) (1 - cos
    t) / 2, in which they are smooth there.

    Parameters
    ----------
    arcs : sequence of Arc
    quantity : {"lambda_n", "lambda_t", "u_n", "u_t"}
    width : float
        What alpha is measured by.
    tolerance : float
        Relative to the picture's width and height.
    """
    polygons = [_Polygon(arc, quantity) for arc in arcs]
    if not polygons:
        return {}
    values = np.concatenate([polygon.values for polygon in polygons])
    height = np.max(values, axis=0) - np.min(values, axis=0)
    # a node at which nothing changes but rounding is not looked at
    height[height <= 1e-12 * np.max(np.abs(values), axis=0)] = np.inf
    for polygon in polygons:
        polygon.refine(width, height, tolerance)
    return {arc.number: (polygon.alphas, polygon.values) for arc, polygon in zip(arcs, polygons, strict=True)}


class _Polygon:
    """Points of one arc in the order of the angle t."""

    def __init__(self, arc: Arc, quantity: str) -> None:
        self._arc = arc
        self._evaluate: Callable[[float], tuple[Vector, Vector]]
        self._evaluate = arc.values if quantity.startswith("lambda") else arc.displacements
        self._part = 0 if quantity.endswith("_n") else 1
        self._angles = np.linspace(0.0, np.pi, _FIRST)
        self.alphas, self.values = self._at(self._angles)

    def _at(self, angles: Vector) -> Curve:
        arc = self._arc
        alphas = np.clip(arc.lo + 0.5 * (1.0 - np.cos(angles)) * (arc.hi - arc.lo), arc.lo, arc.hi)
        alphas[angles == np.pi] = arc.hi
        return alphas, np.array([self._evaluate(float(alpha))[self._part] for alpha in alphas])

    def refine(self, width: float, height: Vector, tolerance: float) -> None:
        """Halve angles until all chords are close."""
        doubtful = np.ones(len(self._angles) - 1, dtype=bool)
        while np.any(doubtful) and len(self._angles) < _MOST:
            k = np.flatnonzero(doubtful)
            middle = 0.5 * (self._angles[k] + self._angles[k + 1])
            alphas, values = self._at(middle)
            far = self._distance(k, alphas, values, width, height) > tolerance
            self._angles = np.insert(self._angles, k + 1, middle)
            self.alphas, self.values = np.insert(self.alphas, k + 1, alphas), np.insert(self.values, k + 1, values, 0)
            # both halves of what was far are looked at again
            place = k + np.arange(len(k))
            doubtful = np.zeros(len(self._angles) - 1, dtype=bool)
            doubtful[place[far]] = doubtful[place[far] + 1] = True

    def _distance(self, k: NDArray[np.intp], alphas: Vector, values: Matrix, width: float, height: Vector) -> Vector:
        """Largest distance, over the nodes, of points from the chords k."""
        run = (self.alphas[k + 1] - self.alphas[k])[:, None] / width
        rise = (self.values[k + 1] - self.values[k]) / height
        across = (alphas - self.alphas[k])[:, None] / width
        up = (values - self.values[k]) / height
        length = np.hypot(run, rise)
        off = np.abs(run * up - rise * across)
        return np.asarray(np.max(np.divide(off, length, out=np.hypot(across, up), where=length > 0), axis=1))
