"""verify: whether a proof, of a root set, a branch graph, a history or of stability, holds for a problem.

Which checker reads it depends on the problem and on the header; ``enumsol.checker`` lists what they rest on.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from enumsol.checker.graph_checker import GraphChecker
from enumsol.checker.plane_checker import Checker
from enumsol.errors import InvalidArgumentError
from enumsol.model.problem import ContactProblem
from enumsol.proof.proof_file import Proof
from enumsol.support.arguments import instance_of, optional_callable

if TYPE_CHECKING:
    from collections.abc import Callable

    import scipy.sparse as sp

    from enumsol.checker.reports import AnyReport, GraphVerificationReport, VerificationReport
    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import ArrayLike


def verify(
    problem: AnyProblem,
    proof: Proof,
    progress: Callable[[int], object] | None = None,
    *,
    mass: ArrayLike | sp.sparray | sp.spmatrix | None = None,
) -> AnyReport:
    """Check a proof, of a root set, of a branch graph, of a history or of stability, against a problem.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    proof : Proof
    progress : callable, optional
        Called regularly with the number of leaves checked.
    mass : (n, n) array_like or sparse, optional
        For a proof of stability: the mass that it is about, by default that of the problem.

    Returns
    -------
    VerificationReport, GraphVerificationReport, HistoryVerificationReport or StabilityVerificationReport

    Raises
    ------
    ProofFormatError
        The file is damaged (its checksum does not agree), of another version, or holds no sequence of records. Records
        that make no sense, or prove nothing, make the report refuse the proof.
    InvalidArgumentError
        An argument is of another type, or ``mass`` is given with another proof.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.one_node_triangle()
    >>> roots = enumsol.enumerate_roots(problem, alpha=5)
    >>> enumsol.verify(problem, roots.proof)
    proof: verified at alpha = 5.0
      4 leaves cover all selections, 0 of them undecided
      3 isolated roots, 0 families
      certified data: A, Bn, Bt, f as given
      complete: yes
    """
    checker, graph_checker = _checkers(problem)
    instance_of(proof, Proof, "proof")
    optional_callable(progress, "progress")
    proof.check_integrity()
    lines = proof.records()
    header = next(lines, None)
    kind = header.get("kind") if isinstance(header, dict) else None
    if kind == "stability":
        from enumsol.checker.stability_checker import StabilityChecker  # not for other proofs

        return StabilityChecker(problem, header, checker, progress, mass).run(lines)
    if mass is not None:
        raise InvalidArgumentError("mass is given with a proof that says nothing of stability; expected none")
    if kind == "history":
        from enumsol.checker.history_checker import HistoryChecker  # not for other proofs

        return HistoryChecker(problem, header, checker, progress).run(lines)
    report: VerificationReport | GraphVerificationReport
    if kind == "graph":
        report = graph_checker()(problem, progress, header=header).run(lines)
    else:
        report = checker(problem, progress).run(proof.records)
    return report


def _checkers(problem: object) -> tuple[Any, Callable[[], Any]]:
    """The checker of root sets of a problem, and what gives that of its graphs; those in 3D come with their tests."""
    if isinstance(problem, ContactProblem):
        return Checker, lambda: GraphChecker
    from enumsol.model.problem3d import ContactProblem3D

    if not isinstance(problem, ContactProblem3D):
        instance_of(problem, ContactProblem, "problem")
    from enumsol.checker.space_checker import SpaceChecker

    def of_graphs() -> Any:
        from enumsol.checker.space_graph import SpaceGraphChecker

        return SpaceGraphChecker

    return SpaceChecker, of_graphs
