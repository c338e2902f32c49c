"""Relaxations, convex QPs in lambda: engines that solve them, as the search sees them, and rows (theory, section 5).

Rows are linear, and imposed by the (partial) status of a contact node.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import scipy.sparse as sp

from enumsol.model.statuses import CONDITIONS, FRICTIONLESS, OPEN, UNDECIDED, RowKind
from enumsol.support.array_types import Codes, Floats, Indices

#: Largest violation of a row (rows of unit length in the norm of S^{-1}) that the QP ignores.
FEASIBILITY_TOLERANCE = 1e-11
#: A leaf is pruned when its energy bound exceeds this; g' S^{-1} g lies in [1, 4), so it is relative to the data.
PRUNE_MARGIN = 1e-9
#: Nodes whose children are bounded before one of them is branched on (measured in studies/branching_rule).
BRANCHING_CANDIDATES = 24


def not_compiled(error: ImportError) -> str:
    """Sentence that the compiled solver cannot be imported, and what to do.

    Python imports the first enumsol that it finds: in a source tree the one there, where nothing may be compiled.
    """
    package = Path(__file__).resolve().parents[1]
    return (
        f"the compiled active-set solver cannot be loaded from {package} ({' '.join(str(error).split())}; install "
        f"enumsol with a C compiler, and start Python in another directory than {package.parent} if it is installed)"
    )


class Relaxation(Protocol):
    """The solved relaxation of one partial assignment."""

    pruned: bool  # the energy bound is above PRUNE_MARGIN: no solution
    stalled: bool  # the engine gave no answer: no conclusion
    bound: float

    @property
    def form(self) -> Any:
        """The form that ``bound`` is about: an EnclosedForm, in 3D a SlipForm; None for the energy."""

    @property
    def forces(self) -> Floats:
        """lambda at the minimiser, shape (2p,), scaled."""

    @property
    def displacements(self) -> Floats:
        """w at the minimiser, shape (2p,), scaled."""

    def at(self, i: int) -> tuple[float, float]:
        """Number i of the forces and of the displacements."""

    def multipliers(self) -> tuple[Indices, Floats]:
        """Rows and their multipliers, which prove ``bound``."""

    def choose(self, codes: Codes) -> int:
        """The contact node to branch on, -1 when all are decided."""

    def forced(self, codes: Codes) -> tuple[int, ...]:
        """Undecided contact nodes with at most one child that no known bound excludes."""

    def child(self, rows: list[int], modes: list[int], *, last: bool) -> Relaxation:
        """The relaxation with further rows switched on; ``last``: this object is not used again."""


class Engine(Protocol):
    """Makes the relaxation at the root of the tree."""

    name: str
    #: Its relaxations solve the children of all nodes before they choose one.
    solves_children: bool

    def root(self, rows: list[int], modes: list[int]) -> Relaxation:
        """The relaxation with the given rows on."""

    def bounding(self, form: Any) -> Engine | None:
        """An engine whose relaxations bound a form, which is convex, in place of the energy; None: it has none."""


INEQUALITY, EQUALITY = 1, 2
_R = RowKind


def status_rows(code: int, *, friction: bool) -> tuple[tuple[RowKind, int], ...]:
    """(kind, mode) of the rows that a node of this code imposes; those of a child extend its parent's."""
    if not friction and code == UNDECIDED:
        return (_R.PENETRATION, INEQUALITY), (_R.NORMAL_FORCE, INEQUALITY), (_R.TANGENTIAL_FORCE, EQUALITY)
    return _STATUS_ROWS[code]


def _rows_of(code: int) -> tuple[tuple[RowKind, int], ...]:
    """The rows of a status; in contact with friction the cone of its parent stands for lambda_n >= 0."""
    equations, inequalities = CONDITIONS[code]
    parent = (_R.PENETRATION,) if code in (OPEN, FRICTIONLESS) else CONDITIONS[UNDECIDED].inequalities
    rows = dict.fromkeys(parent, INEQUALITY)
    rows |= dict.fromkeys(inequalities, INEQUALITY) | dict.fromkeys(equations, EQUALITY)
    if rows.keys() >= {_R.CONE_PLUS, _R.CONE_MINUS}:
        rows.pop(_R.NORMAL_FORCE, None)
    return tuple(rows.items())


_STATUS_ROWS = {code: _rows_of(code) for code in CONDITIONS}


def row_terms(p: int, F: Floats) -> tuple[Indices, Indices, Floats]:
    """All rows as sparse combinations of y = (lambda, w), w of shape (2p,): start, index and value arrays."""
    nodes, one = np.arange(p), np.ones(p)
    cones = np.stack([nodes, p + nodes], axis=1).ravel()
    plus, minus = (np.stack([F, sign * one], axis=1).ravel() for sign in (-1.0, 1.0))
    # lambda_n, lambda_t, both cones, -w_n, w_t, -w_t
    index = np.concatenate([nodes, p + nodes, cones, cones, 2 * p + nodes, 3 * p + nodes, 3 * p + nodes])
    value = np.concatenate([one, one, plus, minus, -one, one, -one])
    lengths = np.repeat([1, 1, 2, 2, 1, 1, 1], p)
    start = np.concatenate([[0], np.cumsum(lengths)])
    return start.astype(np.intp), index.astype(np.intp), value


def row_normals(p: int, F: Floats, S: Floats, numbers: Indices) -> Floats:
    """Gradients by lambda of some rows, one below the other; w = g - S lambda."""
    start, index, value = row_terms(p, F)
    terms = sp.csr_array((value, index, start), shape=(len(start) - 1, 4 * p))[numbers]
    return np.asarray(terms[:, : 2 * p].toarray() - terms[:, 2 * p :] @ S)


def imposed_rows(code: int, *, friction: bool) -> dict[int, int]:
    """Mode of every row that holds in a (partial) status, those implied by others included (see with_implied)."""
    return with_implied(code, status_rows(code, friction=friction))


def with_implied(code: int, rows: Iterable[tuple[int, int]]) -> dict[int, int]:
    """Mode of every row that holds in a (partial) status of these rows, those implied by others included.

    A multiplier of an INEQUALITY must be nonnegative, one of an EQUALITY is free; any other row proves nothing.
    """
    imposed: dict[int, int] = dict.fromkeys((_R.NORMAL_FORCE, _R.CONE_PLUS, _R.CONE_MINUS, _R.PENETRATION), INEQUALITY)
    imposed |= dict(rows)
    if code == OPEN:
        imposed |= dict.fromkeys((_R.CONE_PLUS, _R.CONE_MINUS), EQUALITY)
    return imposed
