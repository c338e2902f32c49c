"""verify: whether a proof, of a root set, of a branch graph or of a history, holds for a problem.

Which checker reads it depends on the problem and on the header; ``enumsol.checker`` lists what they rest on.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from enumsol.checker.graph_checker import GraphChecker
from enumsol.checker.plane_checker import Checker
from enumsol.model.problem import ContactProblem
from enumsol.proof.proof_file import Proof
from enumsol.support.arguments import instance_of, optional_callable

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol.checker.reports import GraphVerificationReport, HistoryVerificationReport, VerificationReport
    from enumsol.checker.walk import TreeChecker
    from enumsol.model.problem3d import AnyProblem, ContactProblem3D


def verify(
    problem: AnyProblem, proof: Proof, progress: Callable[[int], object] | None = None
) -> VerificationReport | GraphVerificationReport | HistoryVerificationReport:
    """Check a proof, of a root set, of a branch graph or of a history, against a problem.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    proof : Proof
    progress : callable, optional
        Called regularly with the number of leaves checked.

    Returns
    -------
    VerificationReport, GraphVerificationReport or HistoryVerificationReport

    Raises
    ------
    ProofFormatError
        The file is damaged (its checksum does not agree), of another version, or holds no sequence of records. Records
        that make no sense, or prove nothing, make the report refuse the proof.
    InvalidArgumentError
        An argument is of another type.

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
    in_space = _is_in_space(problem)
    if not in_space:
        instance_of(problem, ContactProblem, "problem")
    instance_of(proof, Proof, "proof")
    optional_callable(progress, "progress")
    proof.check_integrity()
    checker: type[TreeChecker] = Checker
    if in_space:
        # with its trusted core, for problems in 3D only
        from enumsol.checker.space_checker import SpaceChecker

        checker = SpaceChecker
    lines = proof.records()
    header = next(lines, None)
    if isinstance(header, dict) and header.get("kind") == "history":
        from enumsol.checker.history_checker import HistoryChecker  # not for other proofs

        return HistoryChecker(problem, header, checker, progress).run(lines)
    if isinstance(header, dict) and header.get("kind") == "graph" and not in_space:
        return GraphChecker(cast("ContactProblem", problem), header, progress).run(lines)
    if isinstance(header, dict) and header.get("kind") == "graph":
        from enumsol.checker.space_graph import SpaceGraphChecker  # for graphs in 3D only

        return SpaceGraphChecker(cast("ContactProblem3D", problem), header, progress).run(lines)
    return checker(problem, progress).run(proof)


def _is_in_space(problem: object) -> bool:
    if isinstance(problem, ContactProblem):
        return False
    from enumsol.model.problem3d import ContactProblem3D

    return isinstance(problem, ContactProblem3D)
