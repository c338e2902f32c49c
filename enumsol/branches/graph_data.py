"""What a branch graph is made of, and what its file holds (theory, section 7)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fractions import Fraction

    from enumsol.branches.elements import Arc, Vertex
    from enumsol.condensation.exact import ExactPath
    from enumsol.problem import ContactProblem
    from enumsol.proof.proof_file import Proof
    from enumsol.search.interval import SearchedPiece


@dataclass(frozen=True)
class GraphStats:
    """What the construction did.

    Attributes
    ----------
    pieces : int
        Parts of the interval, each searched by a tree of its own.
    nodes : int
        Nodes of all trees.
    selections : int
        Complete selections whose arcs were computed.
    search_seconds, seconds : float
        Wall time of the search, and of all.
    """

    pieces: int = 0
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
    path : ExactPath
        The condensed problem in rationals, on which the arcs rest.
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
    proof : Proof or None
        Not kept in files.
    """

    problem: ContactProblem
    path: ExactPath
    interval: tuple[Fraction, Fraction]
    arithmetic: str
    vertices: tuple[Vertex, ...]
    arcs: tuple[Arc, ...]
    reasons: tuple[str, ...]
    stats: GraphStats
    pieces: tuple[SearchedPiece, ...] = ()
    proof: Proof | None = None

    @cached_property
    def imbalances(self) -> tuple[str, ...]:
        """Violations of the balance of degrees (theory, section 7); each proves that something is missing."""
        found, first = [], float(self.interval[0])
        for v in self.vertices:
            if v.index_left is None or v.index_right is None:
                found.append(f"vertex {v.number} at alpha = {v.alpha:.17g}: the degree of an arc is not known")
            elif not v.border and v.index_left != v.index_right:
                found.append(
                    f"vertex {v.number} at alpha = {v.alpha:.17g} ({v.kind}): degrees {v.index_left:+d} from the left "
                    f"and {v.index_right:+d} to the right do not balance"
                )
        start = [v.index_right for v in self.vertices if v.border and v.alpha == first]
        if None not in start and (total := sum(k for k in start if k is not None)) != 1:
            found.append(f"the degrees of all arcs at alpha = {first:g} sum to {total:+d} and not to +1")
        return tuple(found)
