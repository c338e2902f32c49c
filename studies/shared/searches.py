"""The tree search with an engine of one's own, put together from the parts that ``enumerate_roots`` uses."""

from __future__ import annotations

from typing import TYPE_CHECKING

from enumsol.certification.proof import ProofWriter
from enumsol.enumeration.float_selections import SIGN_TOLERANCE
from enumsol.enumeration.tree import SearchLimits, TreeSearch
from enumsol.enumeration.workbench import Workbench

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol import ContactProblem
    from enumsol.condensed import ScaledSystem
    from enumsol.enumeration.relaxation import Engine
    from enumsol.enumeration.tree import SearchOutcome


def search(
    problem: ContactProblem,
    alpha: float,
    make_engine: Callable[[ScaledSystem], Engine],
    arithmetic: str = "fast",
    max_nodes: int | None = None,
) -> SearchOutcome:
    """What the search finds: ``solutions``, ``nodes``, ``qps``, ``stopped`` and so on; no roots are made of it."""
    bench = Workbench(problem, alpha, arithmetic, SIGN_TOLERANCE)
    judge = bench.judge(ProofWriter() if arithmetic == "verified" else None)
    engine = make_engine(bench.scaled)
    return TreeSearch(bench.scaled, judge, engine=engine, limits=SearchLimits(max_nodes=max_nodes)).run()
