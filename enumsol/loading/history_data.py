"""What a history found, as plain data: its graph, and what is proven of it.

Its proof is one file: the proofs of its searches, with their starts and what follows them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import networkx as nx

from enumsol.loading.stages import dissipated
from enumsol.proof.reading import rational_text
from enumsol.proof.writer import ProofWriter
from enumsol.support.messages import counted

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from enumsol.loading.stages import Stage
    from enumsol.loading.steps import LoadStep
    from enumsol.proof.proof_file import Proof

#: The number of a step, and of a root in it.
Node = tuple[int, int]
#: Before the first step.
START: Node = (0, 0)


@dataclass(frozen=True)
class Refinement:
    """What halving the increments changed.

    Attributes
    ----------
    halvings : int
        How often the increments were halved.
    settled : bool
        The last halving changed nothing: the statuses along all histories, seen at the given steps, are the same.
    changed_at : tuple of int
        For every halving the first of the given steps up to which the statuses changed; 0 where none did.
    reason : str or None
        Why they were not halved further, if the reason is neither that nothing changed nor the limit.
    """

    halvings: int
    settled: bool
    changed_at: tuple[int, ...]
    reason: str | None = None

    def __str__(self) -> str:
        times = counted(self.halvings, "halving")
        if self.reason is not None:
            return f"not known whether they matter, {times} done: {self.reason}"
        if self.settled:
            first = [step for step in self.changed_at if step]
            earlier = f", which changed until then, from step {min(first)} on" if first else ""
            return f"the last of {times} left the statuses along all histories unchanged{earlier}"
        return f"after {times} the statuses still depend on the increments, from step {self.changed_at[-1]} on"


@dataclass(frozen=True, eq=False)
class HistoryData:
    """What was searched.

    Attributes
    ----------
    problem : ContactProblem or ContactProblem3D
    steps : tuple of LoadStep
    arithmetic : str
    stages : tuple of Stage
        The roots of one step from one start each, step by step.
    parents : tuple of tuples of nodes
        Of every stage the nodes at whose ends it starts; none in the first step.
    followed : frozenset of nodes
        Whose ends start a stage, or were to start one.
    reasons : tuple of str
    seconds : float
    refinement : Refinement or None
    """

    problem: Any
    steps: tuple[LoadStep, ...]
    arithmetic: str
    stages: tuple[Stage, ...]
    parents: tuple[tuple[Node, ...], ...]
    followed: frozenset[Node]
    reasons: tuple[str, ...]
    seconds: float
    refinement: Refinement | None = None

    @cached_property
    def graph(self) -> nx.DiGraph:
        """See History."""
        graph = nx.DiGraph()
        graph.add_node(START, root=None)
        numbers: dict[int, int] = {}
        for stage, parents in zip(self.stages, self.parents, strict=True):
            for root in stage.roots:
                number = numbers.setdefault(stage.step, 0)
                numbers[stage.step] = number + 1
                node = (stage.step, number)
                values = {"stage": stage.number, "statuses": root.statuses, "alpha": float(root.alpha)}
                graph.add_node(node, root=root, dissipated=dissipated(root), **values)
                graph.add_edges_from((parent, node) for parent in parents or (START,))
        return nx.freeze(graph)

    def stages_of(self, step: int) -> tuple[Stage, ...]:
        """The searches of one step, from 1."""
        return tuple(stage for stage in self.stages if stage.step == step)

    def nodes_of(self, step: int) -> tuple[Node, ...]:
        """The nodes of one step."""
        return tuple(node for node in self.graph if node[0] == step and node != START)

    def paths(self) -> Iterator[tuple[Node, ...]]:
        """The histories one by one: the nodes from the first step to an end."""
        pending: list[tuple[Node, ...]] = [(node,) for node in reversed(list(self.graph.successors(START)))]
        while pending:
            path = pending.pop()
            following = list(self.graph.successors(path[-1]))
            if not following:
                yield path
            pending += [(*path, node) for node in reversed(following)]

    @cached_property
    def counts(self) -> tuple[int, ...]:
        """The number of different histories up to every step, from step 1."""
        ways = {START: 1}
        for node in self.graph:
            if node != START:
                ways[node] = sum(ways[before] for before in self.graph.predecessors(node))
        return tuple(sum(ways[node] for node in self.nodes_of(k + 1)) for k in range(len(self.steps)))

    @cached_property
    def dissipated(self) -> Mapping[Node, tuple[float, float]]:
        """The work of friction from the start to every node, least and most over the histories that lead there."""
        work = {START: (0.0, 0.0)}
        for node, given in self.graph.nodes(data=True):
            if node != START:
                before = [work[parent] for parent in self.graph.predecessors(node)]
                own = given["dissipated"]
                work[node] = min(low for low, _ in before) + own, max(high for _, high in before) + own
        return MappingProxyType(work)

    @cached_property
    def unique_until(self) -> int:
        """See History."""
        number = 0
        while number < len(self.steps):
            stages = self.stages_of(number + 1)
            if len(stages) != 1 or stages[0].reasons or stages[0].roots.unique is not True:
                break
            number += 1
        return number

    def completeness(self) -> str:
        """The closing line of the printed history."""
        if self.arithmetic == "fast":
            return "complete: no" if self.reasons else "complete: not proven (fast arithmetic)"
        first = self.stages_of(1)
        if self.unique_until:
            until = f"unique until step {self.unique_until}"
        elif first and first[0].roots.unique is False and len(first[0].roots):
            until = "not unique in step 1"
        else:
            until = "nothing is known to be unique"
        if not self.reasons and (last := self.stages[-1].step) and not self.nodes_of(last):
            until += f"; nothing solves step {last}"
        return f"complete: {'no' if self.reasons else 'yes (proven)'}, {until}{self._within()}"

    def _within(self) -> str:
        """Of a body that nothing holds, within which rigid displacements."""
        bounds = [stage.roots.rigid_bound for stage in self.stages if stage.roots.rigid_bound is not None]
        if not bounds:
            return ""
        return f", {next((bound for bound in bounds if bound.needed), bounds[0]).words()}"


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
