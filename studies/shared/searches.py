"""The tree search with an engine of one's own, put together from the parts that ``enumerate_roots`` uses."""

from __future__ import annotations

from typing import TYPE_CHECKING

from enumsol.proof.writer import ProofWriter
from enumsol.search.outcome import SearchLimits
from enumsol.search.solvers import Solvers, plane_search
from enumsol.selections.float_selections import SIGN_TOLERANCE

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol import ContactProblem
    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.relaxation.engine import Engine
    from enumsol.search.outcome import SearchOutcome


def search(
    problem: ContactProblem,
    alpha: float,
    make_engine: Callable[[ScaledSystem], Engine],
    arithmetic: str = "fast",
    max_nodes: int | None = None,
) -> SearchOutcome:
    """What the search finds: ``solutions``, ``nodes``, ``qps``, ``stopped`` and so on; no roots are made of it."""
    solvers = Solvers(problem, alpha, arithmetic, SIGN_TOLERANCE)
    certifier = solvers.certifier(ProofWriter() if arithmetic == "verified" else None)
    engine = make_engine(solvers.scaled)
    return plane_search(solvers.scaled, certifier, limits=SearchLimits(max_nodes=max_nodes), engine=engine).run()
