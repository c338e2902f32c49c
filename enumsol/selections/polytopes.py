"""Vertices of the polytopes of roots of a singular selection, in any exact ordered field (theory, section 2.4).

A field comes as a function that brings a table of its elements to reduced row echelon form.
"""

from __future__ import annotations

from itertools import combinations
from math import comb
from typing import TYPE_CHECKING, Any

from flint import fmpq

from enumsol.selections.solution import MAX_BASES, VertexLimitError
from enumsol.support.deadlines import look

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    Table = list[list[Any]]
    #: Rows of the reduced row echelon form that are not zero, and their pivot columns.
    Reduction = Callable[[Table], tuple[Table, list[int]]]

Point = tuple[Any, ...]
#: A linear form over lambda and its constant: value = form . lambda + constant.
Form = tuple[list[Any], Any]


def dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    """Inner product; factors that are zero cost nothing."""
    return sum((x * y for x, y in zip(a, b, strict=True) if x != 0 and y != 0), fmpq(0))


def value(form: Form, point: Sequence[Any]) -> Any:
    """A form at a point."""
    return dot(form[0], point) + form[1]


def polytope_vertices(equations: list[Form], inequalities: list[Form], reduce: Reduction) -> list[Point]:
    """Vertices of a bounded polyhedron {equations = 0, inequalities >= 0}; empty when it is.

    Raises
    ------
    VertexLimitError
        More than MAX_BASES bases would have to be tried.
    """
    solved = _affine_solutions(equations, reduce)
    if solved is None:
        return []
    origin, kernel = solved
    rows = _distinct([([dot(form, k) for k in kernel], dot(form, origin) + c) for form, c in inequalities])
    if any(constant < 0 for row, constant in rows if not any(row)):
        return []
    if not kernel:
        return [origin]
    return _corners(origin, kernel, [(row, constant) for row, constant in rows if any(row)], reduce)


def _affine_solutions(equations: list[Form], reduce: Reduction) -> tuple[Point, list[Point]] | None:
    """Solution of the equations and a kernel basis, or None when they contradict each other."""
    size = len(equations[0][0])
    table, pivots = reduce([[*form, -constant] for form, constant in equations])
    if size in pivots:
        return None
    origin = [fmpq(0)] * size
    for row, pivot in zip(table, pivots, strict=True):
        origin[pivot] = row[size]
    kernel = []
    for free in (j for j in range(size) if j not in pivots):
        vector = [fmpq(0)] * size
        vector[free] = fmpq(1)
        for row, pivot in zip(table, pivots, strict=True):
            vector[pivot] = -row[free]
        kernel.append(tuple(vector))
    return tuple(origin), kernel


def _distinct(rows: list[Form]) -> list[Form]:
    """Rows without repetition; every row is divided by the size of its first entry that is not zero."""
    found: list[Form] = []
    for row, constant in rows:
        head = next((v for v in row if v != 0), None)
        if head is None:
            scaled = (row, constant)
        else:
            size = head if head > 0 else -head
            scaled = ([v / size for v in row], constant / size)
        if scaled not in found:
            found.append(scaled)
    return found


def _corners(origin: Point, kernel: list[Point], rows: list[Form], reduce: Reduction) -> list[Point]:
    """Points origin + sum of t_k kernel_k at which as many rows vanish as there are t, and none is negative."""
    size = len(kernel)
    if comb(len(rows), size) > MAX_BASES:
        raise VertexLimitError(
            f"a family of roots has {comb(len(rows), size)} candidate vertices; at most {MAX_BASES} are enumerated"
        )
    found: list[Point] = []
    for basis in combinations(rows, size):
        look()
        table, pivots = reduce([[*row, -constant] for row, constant in basis])
        if pivots != list(range(size)):
            continue
        t = [row[-1] for row in table]
        if all(value(row, t) >= 0 for row in rows):
            point = tuple(o + dot(t, [k[j] for k in kernel]) for j, o in enumerate(origin))
            if point not in found:  # elements of number fields have no hash
                found.append(point)
    return found
