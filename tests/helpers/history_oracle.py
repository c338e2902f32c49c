"""Histories by exhaustive enumeration in rationals, step by step; it shares no code with enumsol."""

from dataclasses import dataclass
from fractions import Fraction

from oracles import exact_condense, solutions_of


@dataclass(frozen=True)
class ExactNode:
    """A root of one step: from where slip was counted, its forces, and where it leaves the nodes."""

    start: tuple
    forces: tuple
    end: tuple


def exact_history(problem, alphas):
    """For every step its roots as ExactNodes, and whether some start of it has a continuum of solutions."""
    p = problem.p
    starts, steps = {tuple(Fraction(v) for v in problem.slip_offset)}, []
    for alpha in alphas:
        S, g, F = exact_condense(problem, alpha)
        free = [a + Fraction(b) for a, b in zip(g[p:], problem.slip_offset, strict=True)]
        nodes, continuum = set(), False
        for start in starts:
            moved = g[:p] + [a - b for a, b in zip(free, start, strict=True)]
            for component in solutions_of(S, moved, F):
                if component.dimension:
                    continuum = True
                    continue
                point = component.parts[0][1][0]
                end = tuple(f - sum(s * x for s, x in zip(S[p + i], point, strict=True)) for i, f in enumerate(free))
                nodes.add(ExactNode(start, point, end))
        steps.append((nodes, continuum))
        starts = {node.end for node in nodes}
    return steps
