"""The graph of one problem from balls and from exact algebra, out of one search, and where they differ."""

from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

from enumsol.arithmetic.rationals import rational
from enumsol.branches.enclosed.following import TracedProblem, follow_selections, make_traced
from enumsol.branches.enclosed.joining import EventPlaceKind
from enumsol.branches.gluing import glue
from enumsol.branches.known_selections import KnownSelections
from enumsol.branches.ways import by_algebra
from enumsol.condensation.exact import ExactCondensed


@dataclass
class TwoGraphs:
    """Vertices and arcs of both, what the traced ones are made of, and what each says against its completeness."""

    exact: tuple
    traced: tuple
    joined: object
    doubts: list
    reasons: list

    @property
    def places(self):
        """Those of the traced vertices."""
        return self.joined.places

    @property
    def open(self):
        """Enclosures that the traced graph leaves open, with the selections it names."""
        return [(p.low, p.high, set(p.members)) for p in self.places if p.kind is EventPlaceKind.OPEN]


def two_graphs(problem, interval):
    """Both graphs from one search."""
    a, b = (Fraction(end) for end in interval)
    exact = ExactCondensed.from_problem(problem)
    traced = TracedProblem(problem, (a, b), exact.zero)
    way = by_algebra(problem, (a, b), exact, "verified")
    search = way.begin()
    search.run()
    followed = follow_selections(traced, search.pieces, cut_short=search.stopped is not None)
    known = KnownSelections(exact, rational(a), rational(b), cut_short=False)
    theirs = glue(known, search.selections)[:2]
    ours = make_traced(traced, followed.joined)
    return TwoGraphs(theirs, ours, followed.joined, followed.reasons, known.reasons)


def differences(graphs):
    """Sentences about everything in which the graphs differ although the traced one does not leave it open."""
    assert graphs.reasons == []
    found = []
    partner = _vertices(graphs, found)
    _arcs(graphs, partner, found)
    return found


def _vertices(graphs, found):
    """By the number of a traced vertex that of the exact one, for all that are not open."""
    partner, taken = {}, set()
    for vertex, place in zip(graphs.traced[0], graphs.places, strict=True):
        if place.kind is EventPlaceKind.OPEN:
            continue
        same = [
            other.number
            for other in graphs.exact[0]
            if other.number not in taken and _inside(other, place) and _alike(vertex, other, place)
        ]
        if len(same) != 1:
            found.append(f"{len(same)} exact vertices are {vertex}")
            continue
        other = graphs.exact[0][same[0]]
        if abs(vertex.alpha - other.alpha) > 1e-12 * max(abs(other.alpha), 1e-6):
            found.append(f"{vertex} lies at {vertex.alpha!r}, exactly at {other.alpha!r}")
        for name in ("lambda_n", "lambda_t", "u_n", "u_t"):
            ours, theirs = getattr(vertex, name), getattr(other, name)
            if abs(ours - theirs).max() > 1e-9 * (1.0 + abs(theirs).max()):
                found.append(f"{name} of {vertex} is {ours}, exactly {theirs}")
        partner[vertex.number] = same[0]
        taken.add(same[0])
    for other in graphs.exact[0]:
        # what is left open contains it
        if other.number not in taken and not _open(graphs, set(other.selections), other.exact):
            found.append(f"no traced vertex is {other}")
    return partner


def _alike(vertex, other, place):
    if (vertex.index_left, vertex.index_right) != (other.index_left, other.index_right) or other.family is not None:
        return False
    if place.kind is EventPlaceKind.ORIGIN:
        return vertex.active == other.active
    return (vertex.kind, vertex.border, set(vertex.selections)) == (other.kind, other.border, set(other.selections))


def _inside(vertex, place):
    return _within(vertex.exact, place.low, place.high)


def _within(alpha, low, high):
    """Whether an exact alpha lies in [low, high]."""
    first, last = rational(low), rational(high)
    while alpha.poly is not None and not (first <= alpha.lo and alpha.hi <= last):
        if alpha.hi <= first or last <= alpha.lo:
            return False
        if alpha.hi - alpha.lo < (last - first) / 2**64:
            return True  # at an end, for all that is visible
        alpha.refine()
    return bool(first <= alpha.lo and alpha.hi <= last)


def _open(graphs, selections, alpha):
    return any(selections & members and _within(alpha, low, high) for low, high, members in graphs.open)


def _arcs(graphs, partner, found):
    samples = {}  # of every exact arc the alphas at which it is to be seen
    for arc in graphs.exact[1]:
        tail, head = (graphs.exact[0][v].enclosure for v in (arc.tail, arc.head))
        low, high = tail[1], head[0]
        samples[arc.number] = {arc.sample, *(low + (high - low) * Fraction(k, 16) for k in (1, 8, 15))}
    for arc, joined in zip(graphs.traced[1], graphs.joined.arcs, strict=True):
        low, high = joined.low, joined.high
        if not low < arc.sample < high:
            found.append(f"{arc} is empty")
            continue
        same = [
            other
            for other in graphs.exact[1]
            if set(arc.selections) == set(other.selections)
            and (arc.index, arc.dimension, arc.grazing) == (other.index, other.dimension, other.grazing)
            and partner.get(arc.tail, other.tail) == other.tail
            and partner.get(arc.head, other.head) == other.head
            and graphs.exact[0][other.tail].enclosure[0] <= low
            and high <= graphs.exact[0][other.head].enclosure[1]
        ]
        if len(same) != 1:
            found.append(f"{len(same)} exact arcs are {arc}")
            continue
        other = same[0]
        if arc.statuses != other.statuses and 4 not in arc.selections[0]:
            found.append(f"{arc} is named otherwise than {other}")
        for ours, theirs in zip(arc._values.at(arc.sample), other._values.at(arc.sample), strict=True):
            if abs(ours - theirs).max() > 1e-9 * (1.0 + abs(theirs).max()):
                found.append(f"{arc} has values {ours} at {arc.sample}, exactly {theirs}")
        samples[other.number] -= {alpha for alpha in samples[other.number] if low < alpha < high}
    for arc in graphs.exact[1]:
        for alpha in samples[arc.number]:
            if not any(set(arc.selections) & members and low <= alpha <= high for low, high, members in graphs.open):
                found.append(f"no traced arc is {arc} at {alpha}")


def steps(graphs):
    """Numbers of solutions between critical alphas, for graphs without open places: exact ones and traced ones."""
    found = []
    for vertices, arcs in (graphs.exact, graphs.traced):
        ends = sorted({v.alpha for v in vertices})
        middles = [(x + y) / 2 for x, y in pairwise(ends) if y - x > 1e-9]
        found.append([sum(arc.lo < x < arc.hi for arc in arcs) for x in middles])
    return found
