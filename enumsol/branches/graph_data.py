"""What a branch graph is made of, and what its file holds (theory, section 7)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from enumsol.branches.claims import Claims, Standing
from enumsol.branches.elements import VertexKind

if TYPE_CHECKING:
    from collections.abc import Callable
    from fractions import Fraction

    from enumsol.branches.elements import Arc, Vertex
    from enumsol.condensation.exact import ExactCondensed
    from enumsol.model.problem import ContactProblem
    from enumsol.proof.proof_file import Proof
    from enumsol.search.interval.subintervals import SearchedPiece


@dataclass(frozen=True)
class GraphStats:
    """What the construction did.

    Attributes
    ----------
    pieces : int
        Parts of the interval that were looked at; each is searched by a tree of its own, closed, or cut in halves.
    closed : int
        Of these, pieces without a tree: one branch is proven to hold all their solutions (theory, section 7.15).
    nodes : int
        Nodes of all trees.
    selections : int
        Complete selections whose arcs were computed.
    search_seconds, seconds : float
        Wall time of the search, and of everything.
    """

    pieces: int = 0
    closed: int = 0
    nodes: int = 0
    selections: int = 0
    search_seconds: float = 0.0
    seconds: float = 0.0


@dataclass(frozen=True)
class GraphData:
    """Vertices and arcs over an interval, and where they come from.

    Attributes
    ----------
    problem : ContactProblem
    exact : ExactCondensed or None
        The condensed problem in rationals, on which the arcs rest; None where they were followed in ball arithmetic.
    interval : (Fraction, Fraction)
    arithmetic : str
    vertices : tuple of Vertex
        In the order of alpha.
    arcs : tuple of Arc
    reasons : tuple of str
        What search and gluing left out or could not decide.
    stats : GraphStats
    pieces : tuple of SearchedPiece
        Not kept in files.
    make_proof : callable or None
        Makes the proof; not kept in files.
    """

    problem: ContactProblem
    exact: ExactCondensed | None
    interval: tuple[Fraction, Fraction]
    arithmetic: str
    vertices: tuple[Vertex, ...]
    arcs: tuple[Arc, ...]
    reasons: tuple[str, ...]
    stats: GraphStats
    pieces: tuple[SearchedPiece, ...] = ()
    make_proof: Callable[[], Proof | None] | None = None

    @cached_property
    def proof(self) -> Proof | None:
        """The proof, made when it is first asked for; None when there is none."""
        return None if self.make_proof is None else self.make_proof()

    @property
    def certified_data(self) -> str:
        """What completeness is about: "problem" (A, Bn, Bt, f as given) or "condensed" (S and g as computed)."""
        return "problem" if self.exact is None or self.exact.condensed_exactly else "condensed"

    @property
    def arcs_by(self) -> str:
        """How arcs were followed: "exact" (functions of alpha in rationals) or "balls"."""
        return "balls" if self.exact is None else "exact"

    @property
    def complete(self) -> bool:
        """Whether it is proven that no solution is missing: proven leaves, nothing undecided, degrees balanced."""
        return self.arithmetic != "fast" and not self.all_reasons

    @cached_property
    def all_reasons(self) -> tuple[str, ...]:
        """Why the graph is not complete: what was left out, and what contradicts the balance of degrees."""
        return (*self.reasons, *self.gaps)

    @cached_property
    def claims(self) -> Claims:
        """What is known about the number of solutions: exact counts, or lower bounds for a graph with gaps."""
        whole = Standing.PROVEN if self.complete else Standing.NOT_PROVEN
        return Claims(self.vertices, self.arcs, self.interval, Standing.INCOMPLETE if self.all_reasons else whole)

    @cached_property
    def gaps(self) -> tuple[str, ...]:
        """Violations of the balance of degrees, and vertices that are not settled (theory, (7.3)).

        Each of them proves that something is missing.
        """
        found, first = [], float(self.interval[0])
        unsettled = sum(v.kind is VertexKind.UNSETTLED for v in self.vertices)
        if unsettled and not self.reasons:
            found.append(f"selections that were not examined hold at {unsettled} of {len(self.vertices)} vertices")
        for v in self.vertices:
            if v.kind is VertexKind.UNSETTLED:
                continue
            if v.index_left is None or v.index_right is None:
                found.append(f"vertex {v.number} at alpha = {v.alpha:.17g}: the degree of an arc is not known")
            elif not v.border and v.index_left != v.index_right:
                found.append(
                    f"vertex {v.number} at alpha = {v.alpha:.17g} ({v.kind}): degrees {v.index_left:+d} from the left "
                    f"and {v.index_right:+d} to the right do not balance"
                )
        start = [v.index_right for v in self.vertices if v.border and v.alpha == first]
        total = sum(k for k in start if k is not None)
        if not self.reasons and None not in start and total != 1:
            found.append(f"the degrees of all arcs at alpha = {first:g} sum to {total:+d} and not to +1")
        return tuple(found)
