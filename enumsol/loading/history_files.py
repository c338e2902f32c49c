"""Histories in files: JSON with every number to the last bit, and the proofs of the searches."""

from __future__ import annotations

import base64
import json
from dataclasses import asdict
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.loading.history_data import HistoryData, Refinement
from enumsol.loading.stages import Stage
from enumsol.loading.steps import LoadStep
from enumsol.model.restart import SlipStart, restarted
from enumsol.model.statuses import ContactStatus
from enumsol.proof.proof_file import Proof
from enumsol.roots.root import Enclosure, Polytope, Root, RootFamily
from enumsol.roots.root_set import RootSet, SearchStats, Undecided
from enumsol.support.arguments import file_path
from enumsol.support.files import reading, writing

if TYPE_CHECKING:
    from pathlib import Path

FORMAT, VERSION = "enumsol-history", 1
_ARRAYS = ("lambda_n", "lambda_t", "u_n", "u_t")


def save_history(data: HistoryData, file: str | Path) -> None:
    """Write a history (see History.save)."""
    record = {
        "format": FORMAT,
        "version": VERSION,
        "problem": data.problem.fingerprint,
        "arithmetic": data.arithmetic,
        "steps": [_step(step) for step in data.steps],
        "stages": [_stage(stage) for stage in data.stages],
        "parents": data.parents,
        "followed": sorted(data.followed),
        "reasons": data.reasons,
        "seconds": data.seconds,
        "refinement": None if data.refinement is None else asdict(data.refinement),
    }
    place = file_path(file, "file")
    text = json.dumps(record)
    with writing(place, "file"):
        place.write_text(text, encoding="utf-8")


def load_history(file: str | Path, problem: Any) -> HistoryData:
    """Read what save_history wrote (see History.load).

    Raises
    ------
    InvalidArgumentError
        The file cannot be read, holds something else, or a history of another problem.
    """
    place = file_path(file, "file")
    with reading(place, "a history", "History.save"):
        record = json.loads(place.read_text(encoding="utf-8"))
        if record["format"] != FORMAT or record["version"] != VERSION:
            raise InvalidArgumentError(f"{place} has another format; expected {FORMAT}, version {VERSION}")
        if record["problem"] != problem.fingerprint:
            raise InvalidArgumentError(f"{place} holds a history of another problem (its fingerprint is different)")
        steps = tuple(_read_step(step, problem) for step in record["steps"])
        stages = tuple(_read_stage(k, item, problem, steps, record) for k, item in enumerate(record["stages"]))
        refinement = record["refinement"]
        if refinement is not None:
            refinement = Refinement(**refinement | {"changed_at": tuple(refinement["changed_at"])})
        return HistoryData(
            problem,
            steps,
            record["arithmetic"],
            stages,
            tuple(tuple((a, b) for a, b in parents) for parents in record["parents"]),
            frozenset((a, b) for a, b in record["followed"]),
            tuple(record["reasons"]),
            record["seconds"],
            refinement,
        )


def _step(step: LoadStep) -> dict[str, Any]:
    parts = {name: None if (part := getattr(step, name)) is None else part.tolist() for name in ("friction", "load")}
    return {"alpha": None if step.alpha is None else str(step.exact_alpha), **parts}


def _read_step(record: dict[str, Any], problem: Any) -> LoadStep:
    alpha = None if record["alpha"] is None else Fraction(record["alpha"])
    step = LoadStep(alpha, None if record["friction"] is None else np.array(record["friction"]), record["load"])
    return step.on(problem, 1)


def _stage(stage: Stage) -> dict[str, Any]:
    start, roots = stage.start, stage.roots
    return {
        "step": stage.step,
        "offset": start.offset.tolist(),
        "radius": None if start.radius is None else start.radius.tolist(),
        "exact": None if start.exact is None else [str(value) for value in start.exact],
        "reasons": stage.reasons,
        "alpha": str(Fraction(roots.alpha)),
        "as_float": isinstance(roots.alpha, float),
        "roots": [_root(root) for root in roots],
        "families": [_family(family) for family in roots.families],
        "undecided": [[_names(part.statuses), part.reason, part.hint, part.leaves] for part in roots.undecided],
        "stopped": roots.stopped,
        "at_least": roots.at_least,
        "certified_data": roots.certified_data,
        "stats": {"nodes": roots.stats.nodes, "closed": roots.stats.closed, "seconds": roots.stats.seconds},
        "proof": None if roots.proof is None else base64.b64encode(roots.proof.content()).decode(),
    }


def _read_stage(
    number: int, record: dict[str, Any], problem: Any, steps: tuple[LoadStep, ...], whole: dict[str, Any]
) -> Stage:
    exact = None if record["exact"] is None else tuple(map(Fraction, record["exact"]))
    radius = None if record["radius"] is None else np.array(record["radius"])
    start = SlipStart(np.array(record["offset"]), radius, exact)
    step = steps[record["step"] - 1]
    body = restarted(problem, start, step.load, step.friction)
    alpha = float(Fraction(record["alpha"])) if record["as_float"] else Fraction(record["alpha"])
    proof = None if record["proof"] is None else Proof(base64.b64decode(record["proof"]))
    roots = RootSet(
        alpha=alpha,
        roots=[_read_root(item, alpha, body) for item in record["roots"]],
        families=[_read_family(item, alpha) for item in record["families"]],
        undecided=[Undecided(_statuses(names), *rest) for names, *rest in record["undecided"]],
        arithmetic=whole["arithmetic"],
        method="tree",
        stopped=record["stopped"],
        stats=SearchStats(**record["stats"]),
        node_ids=problem.node_ids,
        at_least=record["at_least"],
        certified_data=record["certified_data"],
        proof=proof,
    )
    return Stage(number, record["step"], start, roots, body, tuple(record["reasons"]))


def _root(root: Root) -> dict[str, Any]:
    bounds = root.enclosure
    return {
        "statuses": _names(root.statuses),
        "active": [sorted(_names(held)) for held in root.active],
        **{name: getattr(root, name).tolist() for name in _ARRAYS},
        "index": root.index,
        "regular": root.regular,
        "margin": root.margin,
        "bounds": None if bounds is None else {name: getattr(bounds, name).tolist() for name in _ARRAYS},
        "slips": None if root.exact_slips is None else [str(value) for value in root.exact_slips],
        "angles": None if root.slip_angle is None else [[float(a).hex() for a in pair] for pair in root.slip_angle],
    }


def _read_root(record: dict[str, Any], alpha: Any, problem: Any) -> Root:
    bounds, slips, angles = (record[name] for name in ("bounds", "slips", "angles"))
    arrays: dict[str, Any] = {name: np.array(record[name], dtype=np.float64) for name in _ARRAYS}
    return Root(
        alpha=alpha,
        statuses=_statuses(record["statuses"]),
        active=tuple(frozenset(_statuses(names)) for names in record["active"]),
        **arrays,
        index=record["index"],
        regular=record["regular"],
        margin=record["margin"],
        enclosure=None if bounds is None else Enclosure(*(np.array(bounds[name]) for name in _ARRAYS)),
        slip_angle=None if angles is None else np.array([[float.fromhex(a) for a in pair] for pair in angles]),
        _condensed=problem.condensed,
        _exact_slips=None if slips is None else tuple(map(Fraction, slips)),
    )


def _family(family: RootFamily) -> dict[str, Any]:
    parts = [[_names(part.statuses), part.vertices.tolist(), part.dimension] for part in family.polytopes]
    return {"polytopes": parts, "index": family.index, "proven": family.vertices_proven}


def _read_family(record: dict[str, Any], alpha: Any) -> RootFamily:
    parts = tuple(Polytope(_statuses(names), np.array(v), dimension) for names, v, dimension in record["polytopes"])
    return RootFamily(alpha, parts, record["index"], vertices_proven=record["proven"])


def _names(statuses: Any) -> list[Any]:
    return [status.value if isinstance(status, ContactStatus) else status for status in statuses]


def _statuses(names: list[Any]) -> tuple[Any, ...]:
    known = {status.value: status for status in ContactStatus}
    return tuple(known.get(name, name) for name in names)
