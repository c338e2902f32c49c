"""Roots, families of roots and the set of all of them at one alpha."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from enumsol.roots.local_branch import branch_test
from enumsol.sealed import Immutable, Sealed, sealed
from enumsol.statuses import ContactStatus, sign_array

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

    from enumsol.checks import Alpha
    from enumsol.condensation.condensed import CondensedProblem
    from enumsol.proof.proof_file import Proof
    from enumsol.roots.linearisation import SelectionTangent
    from enumsol.roots.local_branch import LocalBranchTest
    from enumsol.roots.slip_signs import SlipSigns
    from enumsol.search.certifiers.verified import Escalations

_PRINTED_ROOTS = 20
#: Contact nodes of a printed root; of larger ones the first are shown.
_PRINTED_NODES = 20


@dataclass(frozen=True)
class Enclosure(Sealed):
    """Proven bounds of a root's forces and displacements.

    Attributes
    ----------
    lambda_n, lambda_t : (p, 2) arrays
        Lower and upper bounds [force].
    u_n, u_t : (p, 2) arrays
        Lower and upper bounds of u_n = Bn u - gap and u_t = Bt u - slip_offset [length].

    Examples
    --------
    >>> import enumsol
    >>> root = enumsol.enumerate_roots(enumsol.gallery.one_node_triangle(), alpha=5)[1]  # lambda_n = 1 / 3
    >>> low, high = root.enclosure.lambda_n[0]
    >>> bool(low < 1 / 3 < high < low + 1e-12)
    True
    """

    lambda_n: NDArray[np.float64]
    lambda_t: NDArray[np.float64]
    u_n: NDArray[np.float64]
    u_t: NDArray[np.float64]


@dataclass(frozen=True)
class Root(Sealed):
    """An isolated solution at one alpha.

    Attributes
    ----------
    alpha : float or Fraction
    statuses : tuple of p ContactStatus
        Where several hold, the first of OPEN, STICK, SLIP_PLUS, SLIP_MINUS. At a node with F = 0 in contact the sign
        of u_t names it: in verified and exact arithmetic that of the enclosure, or in rationals.
    active : tuple of p frozensets of ContactStatus
        All statuses that hold at the node; at a node with F = 0 in contact, all that the sign of u_t does not exclude
        (of a body too large for rationals, n > 250, the enclosure of u_t may hold zero and leave the sign open).
    lambda_n, lambda_t : (p,) arrays
        Contact forces on the nodes (nodal forces, not pressures) [force].
    u_n, u_t : (p,) arrays
        Bn u - gap <= 0 and Bt u - slip_offset [length].
    index : int or None
        Local degree (theory, section 6.7): sign det of the selection at a regular root. It says nothing about physical
        stability. None when it could not be found within the limits of the local analysis.
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

    alpha: Alpha
    statuses: tuple[ContactStatus, ...]
    active: tuple[frozenset[ContactStatus], ...]
    lambda_n: NDArray[np.float64]
    lambda_t: NDArray[np.float64]
    u_n: NDArray[np.float64]
    u_t: NDArray[np.float64]
    index: int | None
    regular: bool
    margin: float
    enclosure: Enclosure | None = field(repr=False, compare=False)
    _condensed: CondensedProblem = field(repr=False, compare=False)
    _tangent: SelectionTangent | None = field(repr=False, compare=False)
    _slips: SlipSigns | None = field(repr=False, compare=False, default=None)

    @cached_property
    def condition(self) -> float:
        """Condition number of the selection's matrix after scaling; infinite unless the root is regular."""
        return np.inf if self._tangent is None else self._tangent.condition()

    @cached_property
    def dlambda_dalpha(self) -> NDArray[np.float64] | None:
        """Derivatives of (lambda_n, lambda_t) along the branch, shape (p, 2); None unless the root is regular."""
        derivative = None if self._tangent is None else self._tangent.derivative()
        return None if derivative is None else sealed(derivative)

    @property
    def u(self) -> NDArray[np.float64]:
        """Displacement of all degrees of freedom, shape (n,) [length]; computed at every access."""
        return self._condensed.displacement(self.alpha, np.concatenate([self.lambda_n, self.lambda_t]))

    def local_branch_test(self) -> LocalBranchTest:
        """Whether a local Lipschitz branch of solutions passes through the root (theory, section 3.2).

        Its ``exists`` is True when the determinants of all selections that hold at the root have one and the same
        sign; ``differing`` names those that break this. A regular root always has such a branch. ``premise`` tells
        whether F > 0 at every node, without which the branch in the load need not be one in F.

        Raises
        ------
        TooLargeError
            Too many selections hold at the root to examine each of them.
        """
        return branch_test(self._condensed, self)

    def _slip_sign(self, node: int) -> int:
        sign = None if self._slips is None else self._slips.sign(node)
        return int(np.sign(self.u_t[node])) if sign is None else sign

    @property
    def signs(self) -> NDArray[np.int8]:
        """Signs of the test functions at the root, shape (p, 3); 0 where a test function vanishes.

        At an open node theta2 and theta3 have the sign of u_t. In verified and exact arithmetic it follows from the
        enclosure or from rationals; of a body too large for these (n > 250) whose enclosure holds zero, it is that of
        the computed value.
        """
        signs = sign_array(self.statuses)
        for i, holds in enumerate(self.active):
            if ContactStatus.OPEN in holds:
                signs[i, 0] = 0 if len(holds) > 1 else -1
                signs[i, 1:] = self._slip_sign(i)
            else:
                if ContactStatus.SLIP_PLUS in holds and ContactStatus.STICK in holds:
                    signs[i, 1] = 0
                if ContactStatus.SLIP_MINUS in holds and ContactStatus.STICK in holds:
                    signs[i, 2] = 0
        return signs

    def __repr__(self) -> str:
        index = "?" if self.index is None else f"{self.index:+d}"
        regular = "regular" if self.regular else "not regular"
        labels = self._condensed.problem.node_ids
        shown = min(len(labels), _PRINTED_NODES)
        width = max(4, *(len(str(label)) for label in labels[:shown]))
        lines = [
            f"Root at alpha = {float(self.alpha):g}: index {index}, {regular}, margin {self.margin:.2e}",
            node_heading(width),
            *(node_line(self, i, labels[i], width) for i in range(shown)),
        ]
        if shown < len(labels):
            lines.append(f"... {len(labels) - shown} more nodes; all of them: {summary(self.statuses)}")
        return "\n".join(lines)


@dataclass(frozen=True)
class Polytope(Sealed):
    """A convex set of roots in one selection.

    Attributes
    ----------
    statuses : tuple of p ContactStatus
    vertices : (k, p, 2) array
        (lambda_n, lambda_t) at every vertex [force].
    dimension : int

    Examples
    --------
    >>> import enumsol
    >>> roots = enumsol.enumerate_roots(enumsol.gallery.one_node_triangle(f=(1, -2)), alpha=2)
    >>> segment = roots.families[0].polytopes[0]
    >>> segment.dimension, segment.vertices.tolist()
    (1, [[[0.0, 0.0]], [[1.0, -2.0]]])
    """

    statuses: tuple[ContactStatus, ...]
    vertices: NDArray[np.float64]
    dimension: int


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
    def vertices(self) -> NDArray[np.float64]:
        """All vertices, shape (k, p, 2), without repetition, in lexical order."""
        return sealed(np.unique(np.concatenate([part.vertices for part in self.polytopes]), axis=0))


@dataclass(frozen=True)
class Undecided:
    """A part of the selections about which nothing was proven.

    Attributes
    ----------
    statuses : tuple
        Per node a ContactStatus, the string "contact" (in contact, not known how) or None (nothing known).
    reason : str
        What could not be decided.
    hint : str
        What may help.

    Examples
    --------
    >>> import enumsol
    >>> roots = enumsol.enumerate_roots(enumsol.gallery.two_node_square(), alpha=3.5, max_nodes=2)
    >>> roots.undecided[0].reason
    'the search was stopped before it came here'
    """

    statuses: tuple[ContactStatus | str | None, ...]
    reason: str
    hint: str


@dataclass(frozen=True)
class SearchStats:
    """What the enumeration did.

    Attributes
    ----------
    nodes : int
        Partial assignments examined by the tree (0 for the exhaustive method).
    pruned : int
        Partial assignments proven or, in fast arithmetic, computed to hold no solution.
    selections : int
        Complete selections whose linear system was solved.
    qps, fallback_qps : int
        Relaxations solved, and those the fallback solver had to solve.
    seconds : float
        Wall time.
    escalations : Escalations or None
        In verified arithmetic: how many decisions needed which arithmetic.
    presolved : int
        Contact nodes proven open or in contact before the search began to branch on alternatives.

    Examples
    --------
    >>> import enumsol
    >>> stats = enumsol.enumerate_roots(enumsol.gallery.two_node_square(), alpha=3.5).stats
    >>> stats.nodes >= stats.pruned + stats.selections > 0
    True
    """

    nodes: int = 0
    pruned: int = 0
    selections: int = 0
    qps: int = 0
    fallback_qps: int = 0
    seconds: float = 0.0
    escalations: Escalations | None = None
    presolved: int = 0


class RootSet(Sequence[Root], Immutable):
    """All solutions at one alpha, as a sequence of the isolated roots in a deterministic order.

    Attributes
    ----------
    alpha : float or Fraction
    families : tuple of RootFamily
    undecided : tuple of Undecided
    complete : bool
        True only when it is proven that nothing else solves the problem.
    arithmetic, method : str
    stopped : str or None
        Why the search ended early, or None.
    at_least : int
        Number of isolated roots and families together if nothing is known to be missing; otherwise a lower bound of it,
        in which roots and families that a continuum not found may join are counted as one.
    stats : SearchStats
    certified_data : str
        What completeness is about: "problem" (A, Bn, Bt, f as given) or "condensed" (S and g as computed).
    proof : Proof or None
        In verified arithmetic: the proof that ``enumsol.verify`` checks; None when the search was interrupted.

    Examples
    --------
    >>> import enumsol
    >>> roots = enumsol.enumerate_roots(enumsol.gallery.two_node_square(), alpha=3.5)
    >>> len(roots), roots.index_sum, roots.complete
    (5, 1, True)
    """

    def __init__(
        self,
        *,
        alpha: Alpha,
        roots: Sequence[Root],
        families: Sequence[RootFamily],
        undecided: Sequence[Undecided],
        arithmetic: str,
        method: str,
        stopped: str | None,
        stats: SearchStats,
        node_ids: tuple[Any, ...],
        at_least: int | None = None,
        certified_data: str = "problem",
        proof: Proof | None = None,
    ) -> None:
        self.alpha = alpha
        self._roots = tuple(roots)
        self.families = tuple(families)
        self.undecided = tuple(undecided)
        self.arithmetic = arithmetic
        self.method = method
        self.stopped = stopped
        self.stats = stats
        self.at_least = len(self._roots) + len(self.families) if at_least is None else at_least
        self.node_ids = node_ids
        self.certified_data = certified_data
        self.proof = proof
        self._freeze()

    @property
    def complete(self) -> bool:
        """Whether completeness is proven: exact arithmetic, nothing undecided, search not cut short."""
        return self.arithmetic != "fast" and self.whole

    @property
    def whole(self) -> bool:
        """Whether nothing is known to be missing: the search ran to its end and left nothing undecided."""
        return self.stopped is None and not self.undecided

    @property
    def index_sum(self) -> int | None:
        """Sum of the indices of all roots and families: +1 when nothing is missing; None if one is unknown.

        It is unknown, too, after a search that was cut short or left something undecided.
        """
        if not self.whole:
            return None
        indices = [root.index for root in self._roots] + [family.index for family in self.families]
        return None if any(index is None for index in indices) else sum(index for index in indices if index is not None)

    def __len__(self) -> int:
        return len(self._roots)

    @overload
    def __getitem__(self, item: int) -> Root: ...
    @overload
    def __getitem__(self, item: slice) -> tuple[Root, ...]: ...
    def __getitem__(self, item: int | slice) -> Root | tuple[Root, ...]:
        return self._roots[item]

    def to_frame(self) -> pd.DataFrame:
        """One row a root and contact node: alpha, root, node, status, lambda_n, lambda_t, u_n, u_t, index, regular."""
        import pandas as pd  # slow to import, used here only

        count, p = len(self), len(self.node_ids)
        return pd.DataFrame(
            {
                "alpha": np.repeat(float(self.alpha), count * p),
                "root": np.repeat(np.arange(count), p),
                "node": list(self.node_ids) * count,
                "status": [status.value for root in self for status in root.statuses],
                **{
                    name: np.concatenate([getattr(root, name) for root in self]) if count else np.zeros(0)
                    for name in ("lambda_n", "lambda_t", "u_n", "u_t")
                },
                "index": np.repeat(np.array([root.index for root in self], dtype=object), p),
                "regular": np.repeat(np.array([root.regular for root in self], dtype=bool), p),
            }
        )

    def completeness(self) -> str:
        """The closing line of the printed table."""
        count = len(self.undecided)
        if self.stopped is not None:
            return f"complete: no ({self.stopped})"
        if self.undecided:
            return f"complete: no ({count} undecided)"
        if not self.complete:
            return f"complete: not proven ({count} undecided)"
        about = "" if self.certified_data == "problem" else " for S and g as computed"
        return f"complete: yes (proven{about})"

    def __repr__(self) -> str:
        heading = f"RootSet at alpha = {float(self.alpha):g}: {_count(len(self), 'root')}"
        if self.families:
            heading += f", {_count(len(self.families), 'family', 'families')}"
        if not self.whole:
            heading += f" found, at least {self.at_least} in all"
        lines = [f"{heading} ({self.arithmetic}, {self.method})"]
        if len(self):
            lines.append(f"{'':>6} {'index':>5} {'regular':>7} {'margin':>9} {'max lambda_n':>12}  contact")
        for k, root in enumerate(self._roots[:_PRINTED_ROOTS]):
            index = "?" if root.index is None else f"{root.index:+d}"
            lines.append(
                f"{k:>6} {index:>5} {'yes' if root.regular else 'no':>7} {root.margin:>9.2e} "
                f"{np.max(root.lambda_n):>12.5g}  {summary(root.statuses)}"
            )
        if len(self) > _PRINTED_ROOTS:
            lines.append(f"   ... {len(self) - _PRINTED_ROOTS} more")
        for k, family in enumerate(self.families[:_PRINTED_ROOTS]):
            index = "?" if family.index is None else f"{family.index:+d}"
            lines.append(
                f"family {k}: dimension {family.dimension}, {_count(len(family.polytopes), 'polytope')}, "
                f"{_count(len(family.vertices), 'vertex', 'vertices')}, index {index}"
            )
        # a search that was cut short leaves many alike
        alike = Counter((item.reason, item.hint) for item in self.undecided)
        lines += [f"undecided, {count} times: {reason} ({hint})" for (reason, hint), count in alike.most_common(5)]
        total = self.index_sum
        # a sum other than +1 proves that something is missing or wrong
        note = "unknown" if total is None else f"{total:+d}" if total == 1 else f"{total:+d} (not +1!)"
        lines.append(f"index sum: {note}")
        lines.append(self.completeness())
        return "\n".join(lines)


def node_heading(width: int) -> str:
    """The heading of lines over contact nodes, whose labels take that width."""
    return f"{'node':>{width}} {'status':<7} {'lambda_n':>12} {'lambda_t':>12} {'u_n':>12} {'u_t':>12}"


def node_line(root: Root, i: int, label: object, width: int) -> str:
    """Status, forces and displacements of a contact node, below `node_heading`."""
    numbers = (root.lambda_n[i], root.lambda_t[i], root.u_n[i], root.u_t[i])
    # + 0.0 turns a negative zero, which means nothing to a reader, into zero
    text = " ".join(f"{number + 0.0:>12.6g}" for number in numbers)
    return f"{label!s:>{width}} {root.statuses[i].value:<7} {text}"


def _count(number: int, singular: str, plural: str | None = None) -> str:
    return f"{number} {singular if number == 1 else plural or singular + 's'}"


def summary(statuses: Sequence[ContactStatus]) -> str:
    """Runs of equal statuses as text: ``3 open, 2 stick, 1 slip+``."""
    parts: list[str] = []
    run = 0
    for k, status in enumerate(statuses):
        run += 1
        if k + 1 == len(statuses) or statuses[k + 1] is not status:
            parts.append(f"{run} {status.value}" if len(statuses) > 1 else status.value)
            run = 0
    text = ", ".join(parts)
    return text if len(text) <= 60 else text[:57] + "..."
