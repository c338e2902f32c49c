"""The proof of a history: the proofs of its searches, with their starts and what follows them, in one file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from enumsol.proof.reading import rational_text
from enumsol.proof.writer import ProofWriter

if TYPE_CHECKING:
    from enumsol.loading.history_data import HistoryData, Node
    from enumsol.loading.steps import LoadStep
    from enumsol.proof.proof_file import Proof


def history_proof(data: HistoryData) -> Proof | None:
    """The proof; None where a search has none, as in fast and exact arithmetic and after an interruption."""
    if not data.stages or any(stage.roots.proof is None for stage in data.stages):
        return None
    following = _following(data)
    writer = ProofWriter()
    writer.write(
        {
            "format": "enumsol-proof",
            "version": 1,
            "kind": "history",
            "problem": data.problem.fingerprint,
            "p": data.problem.p,
            "steps": [_step_record(step) for step in data.steps],
            "stages": len(data.stages),
        }
    )
    for stage in data.stages:
        start, proof = stage.start, stage.roots.proof
        radius = None if start.radius is None else start.radius.ravel().tolist()
        writer.write(["s", stage.step, start.offset.ravel().tolist(), radius, following[stage.number]])
        assert proof is not None
        for record in proof.records():
            writer.write(record)
    writer.write({"stages": len(data.stages)})
    return writer.close()


def _step_record(step: LoadStep) -> list[Any]:
    load, friction = (None if part is None else part.ravel().tolist() for part in (step.load, step.friction))
    return [rational_text(step.exact_alpha, "alpha"), load, friction]


def _following(data: HistoryData) -> list[list[int]]:
    """For every stage the numbers of the stages that begin where a root of it ends."""
    stage_of: dict[Node, int] = {node: given["stage"] for node, given in data.graph.nodes(data=True) if node[0]}
    found: list[set[int]] = [set() for _ in data.stages]
    for stage, parents in zip(data.stages, data.parents, strict=True):
        for parent in parents:
            found[stage_of[parent]].add(stage.number)
    return [sorted(numbers) for numbers in found]
