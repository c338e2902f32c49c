"""What the package finds for some hundred problems, recorded to see that a change of the code changes none of it.

    python tools/record_results.py                       # compares what it finds now with tools/recordings.json
    python tools/record_results.py --write FILE          # records
    python tools/record_results.py --compare OLD NEW     # prints the differences of two recordings
    python tools/record_results.py --times OLD NEW       # of two interpreters (venvs): CPU times, pair by pair

Recorded are counts, statuses, indices, enclosures, graphs, printed texts and what the checker says; not the bytes of
proofs. Numbers are compared within what they were proven to, so that the order of sums in the linear algebra plays no
part. How many nodes a search took and its CPU time are recorded for information, and not compared. ``--only WORD``
takes the cases whose names contain a word. The exit status is 1 if anything differs.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from math import ceil, inf, isfinite, log10
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from recorded_problems import cases, timed

import enumsol

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

KEPT = Path(__file__).with_name("recordings.json")
#: Numbers that are recorded of an array; of a longer one, some sums.
MOST_NUMBERS = 24
#: Roots of which more than their statuses are recorded.
MOST_ROOTS = 12
#: Numbers of one list, or one array, are equal within this times their size, and printed ones within that.
RELATIVE, PRINTED = 1e-6, 0.02
#: What sets no result apart: times, sizes of searches.
LOOSE = re.compile(
    r"""(?:[0-9.]+\ s\b | \b\d+\ (?=leaves|leaf|relaxation|subtree|selection|piece|times|time|nodes|branchings))""",
    re.VERBOSE,
)
SKIPPED_LINES = ("stalled:", "searched:")
NUMBER = re.compile(r"(?<![\w.])[-+]?(?:\d+\.?\d*(?:e[-+]?\d+)?|inf|nan)(?![\w])", re.IGNORECASE)
#: Keys of JSON that hold times and sizes of searches.
FREE_KEYS = re.compile(
    r"second|nodes$|qps|pruned|selections|pieces|closed|escalations|version|leaves|stats|by_one_certificate|completeness"
)
SHORT = {"open": "o", "stick": "s", "slip+": "+", "slip-": "-", "slip": "l"}


# -- what is recorded of a result --------------------------------------------------------------------------------------


def _numbers(values: Any) -> list[float]:
    """An array to nine digits of its largest number; of a long one sums with and without weights, and the extremes."""
    array = np.ravel(np.asarray(values, dtype=float))
    if array.size > MOST_NUMBERS:
        weights = np.cos(np.arange(array.size))
        array = np.array([array.sum(), weights @ array, weights**2 @ array, array.min(), array.max()])
    size = np.max(np.abs(array[np.isfinite(array)]), initial=0.0)
    digits = 0 if size == 0 else 8 - ceil(log10(size))
    return [round(float(value), digits) + 0.0 for value in array]


def _statuses(statuses: Iterable[Any]) -> str:
    def short(status: Any) -> str:
        if isinstance(status, frozenset):
            return "(" + "".join(sorted(SHORT[str(s)] for s in status)) + ")" if len(status) != 1 else short(*status)
        return SHORT.get(str(status), f"<{status}>")

    return "".join(short(status) for status in statuses)


def _bounds(enclosure: Any) -> dict[str, Any]:
    """The middles of the bounds, and the largest radius relative to the largest number as a power of ten."""
    found: dict[str, Any] = {}
    parts = [np.asarray(getattr(enclosure, name)) for name in ("lambda_n", "lambda_t", "u_n", "u_t")]
    for name, pair in (("forces", parts[:2]), ("displacements", parts[2:])):
        low, high = (np.concatenate([np.ravel(part[..., k]) for part in pair]) for k in (0, 1))
        size, radius = float(np.max(np.abs([low, high]))), float(np.max(high - low)) / 2
        found[name] = _numbers((low + high) / 2)
        found[f"{name} radius"] = ceil(log10(radius / size)) if radius > 0 and size > 0 else -99
    return found


def _root(root: Any) -> dict[str, Any]:
    found = {"active": _statuses(root.active), "index": root.index, "regular": root.regular}
    found |= {"margin": [float(f"{root.margin:.3g}")]}
    if root.enclosure is not None:
        return found | _bounds(root.enclosure)
    forces = np.concatenate([np.ravel(root.lambda_n), np.ravel(root.lambda_t)])
    return found | {"forces": _numbers(forces), "displacements": _numbers([*np.ravel(root.u_n), *np.ravel(root.u_t)])}


def _family(family: Any) -> dict[str, Any]:
    vertices = family.vertices.reshape(len(family.vertices), -1)
    return {
        "index": family.index,
        "polytopes": sorted(
            [_statuses(part.statuses), part.dimension, len(part.vertices)] for part in family.polytopes
        ),
        "proven": family.vertices_proven,
        "from": _numbers(vertices.min(axis=0)),
        "to": _numbers(vertices.max(axis=0)),
    }


def _roots(problem: Any, roots: Any) -> dict[str, Any]:
    found = {
        "complete": roots.complete,
        "at least": roots.at_least,
        "index sum": roots.index_sum,
        "data": roots.certified_data,
        "stopped": None if roots.stopped is None else _text(roots.stopped),
        "undecided": sorted({part.reason for part in roots.undecided}),
        "roots": [_root(root) for root in roots[:MOST_ROOTS]],
        "others": [_statuses(root.active) for root in roots[MOST_ROOTS:]],
        "families": sorted((_family(family) for family in roots.families), key=json.dumps),
        "text": _text(roots),
        "info": {"nodes": roots.stats.nodes, "undecided": len(roots.undecided)},
    }
    return found | _verified(problem, roots.proof)


def _verified(problem: Any, proof: Any) -> dict[str, Any]:
    if proof is None:
        return {}
    report = enumsol.verify(problem, proof)
    return {"verify": [report.complete, len(report.failures), _text(report)]}


def _graph(problem: Any, graph: Any) -> dict[str, Any]:
    at = [v.alpha for v in graph.vertices]
    kinds = [str(v.kind) for v in graph.vertices]
    steps, uniqueness = graph.claims.steps(), graph.claims.uniqueness()
    low, high = graph.interval
    inner = [low + share * (high - low) for share in (0.11, 0.47, 0.83)]
    arcs = [
        [_statuses(a.statuses), [at[a.tail], at[a.head]], kinds[a.tail], kinds[a.head], a.index, a.dimension, a.grazing]
        for a in graph.arcs
    ]
    vertices = [
        [_statuses(v.active), [v.alpha], str(v.kind), v.border, v.index_left, v.index_right, _numbers(v.lambda_n)]
        for v in graph.vertices
    ]
    found = {
        "complete": graph.complete,
        "data": graph.certified_data,
        "arcs": _rounded(sorted(arcs, key=lambda a: (a[0], round(a[1][0], 6)))),
        "vertices": _rounded(sorted(vertices, key=lambda v: (v[0], round(v[1][0], 6)))),
        "branches": sorted([len(b.arcs), str(b.shape) if hasattr(b, "shape") else ""] for b in graph.branches),
        "components": len(graph.components),
        "steps": [_numbers(steps.alphas), list(steps.at), list(steps.between), steps.exact],
        "unique": [uniqueness.limit, uniqueness.throughout],
        "open": [_numbers(pair) for pair in graph.open_ranges],
        "reasons": [_text(reason) for reason in graph.reasons],
        "at": [[_multiplicity(graph, alpha), len(graph.roots_at(alpha))] for alpha in inner],
        "text": _text(graph),
        "info": {"nodes": graph.stats.nodes},
    }
    return found | _verified(problem, graph.proof)


def _multiplicity(graph: Any, alpha: float) -> int | None:
    try:
        return int(graph.multiplicity_at(alpha))
    except enumsol.IncompleteGraphError:
        return None


def _history(problem: Any, history: Any) -> dict[str, Any]:
    found = {
        "complete": history.complete,
        "counts": list(history.counts),
        "unique until": history.unique_until,
        "steps": [[_root(root) for root in history.roots(k)] for k in range(1, len(history.counts) + 1)],
        "text": _text(history),
    }
    return found | _verified(problem, history.proof)


def _paths(found: Any) -> dict[str, Any]:
    ends = [[str(path.status), _numbers([path.alpha[0], path.alpha[-1]])] for path in found.paths]
    return {"paths": len(found.paths), "ends": ends, "text": _text(found)}


def _command(words: tuple[str, ...]) -> dict[str, Any]:
    """What a command prints, and its exit status."""
    command = [sys.executable, "-m", "enumsol", *words]
    environment = os.environ | {"COLUMNS": "100", "NO_COLOR": "1"}
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(command, capture_output=True, text=True, cwd=folder, env=environment, check=False)
    out: Any = _rounded(_plain(json.loads(done.stdout))) if "--json" in words else _text(done.stdout)
    return {"status": done.returncode, "out": out, "errors": _text(done.stderr)}


def _plain(value: Any) -> Any:
    """What JSON says of a result, without times, sizes of searches and what is long."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items() if not FREE_KEYS.search(key)}
    if isinstance(value, list):
        return [_plain(item) for item in value]
    return value


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.10g}") + 0.0
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    return [_rounded(item) for item in value] if isinstance(value, (list, tuple)) else value


def _text(value: Any) -> list[str] | str:
    lines = [LOOSE.sub("# ", line.rstrip()) for line in str(value).splitlines()]
    # how the search went, not what it found
    lines = [
        line.replace(": one solution, by one certificate", "").replace("# leaf covers", "# leaves cover")
        for line in lines
    ]
    kept = [re.sub(r" {2,}", "  ", line) for line in lines if line.strip() and not line.startswith(SKIPPED_LINES)]
    return kept[0] if len(kept) == 1 else kept


def recorded(problem: Any, result: Any) -> dict[str, Any]:
    """What is recorded of a result."""
    if isinstance(result, tuple) and result[0] == "command":
        return _command(result[1])
    if isinstance(result, enumsol.RootSet):
        return _roots(problem, result)
    if isinstance(result, enumsol.BranchGraph):
        return _graph(problem, result)
    if isinstance(result, enumsol.History):
        return _history(problem, result)
    if hasattr(result, "paths"):
        return _paths(result)
    return {"value": _rounded(result)} if isinstance(result, list) else {"text": _text(result)}


def record(name: str) -> dict[str, Any]:
    """All results of one case; ``cpu`` is for information."""
    found: dict[str, Any] = {}
    for label, call in cases()[name]().items():
        problem = getattr(call, "args", (None,))[0]
        begun = time.process_time()
        try:
            result = call()
        except enumsol.EnumsolError as error:
            found[label] = {type(error).__name__: _text(error)}
            continue
        cpu = time.process_time() - begun
        found[label] = recorded(problem, result) | {"cpu": round(cpu, 2)}
    return json.loads(json.dumps(found, default=str))


# -- what differs ------------------------------------------------------------------------------------------------------


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _close(one: list[float], other: list[float], relative: float, absolute: float) -> bool:
    """Equal within a share of the largest one."""
    size = max((abs(value) for value in one if isfinite(value)), default=0.0)
    pairs = zip(one, other, strict=True)
    return all(a == b or str(a) == str(b) or abs(a - b) <= relative * size + absolute for a, b in pairs)


def _same_text(one: str, other: str) -> bool:
    """Equal up to the last digits of numbers that are no integers."""
    if NUMBER.sub("#", one).split() != NUMBER.sub("#", other).split():
        return False
    for a, b in zip(NUMBER.findall(one), NUMBER.findall(other), strict=True):
        whole = a.lstrip("+-").isdigit() and b.lstrip("+-").isdigit()
        if int(a) != int(b) if whole else not _close([float(a)], [float(b)], PRINTED, 1e-8):
            return False
    return True


def differences(old: Any, new: Any, where: str = "") -> Iterator[str]:
    """Sentences about what differs of two recordings."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in sorted(old.keys() | new.keys()):
            place = f"{where} / {key}" if where else key
            if key in ("info", "cpu"):
                continue
            if key not in old or key not in new:
                yield f"{place}: only in the {'new' if key in new else 'old'} one"
            elif key.endswith("radius"):
                if new[key] > old[key] + 1:
                    yield f"{place}: 1e{old[key]} became 1e{new[key]}"
            elif key == "margin" and isinstance(old[key], list):
                if not _close(old[key], new[key], PRINTED, 1e-9):
                    yield f"{place}: {old[key][0]} became {new[key][0]}"
            else:
                yield from differences(old[key], new[key], place)
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        if all(_is_number(value) for value in (*old, *new)) and any(isinstance(v, float) for v in (*old, *new)):
            if not _close(old, new, RELATIVE, 1e-12):
                yield f"{where}: {_short(old)} became {_short(new)}"
            return
        for k, (a, b) in enumerate(zip(old, new, strict=True)):
            yield from differences(a, b, f"{where}[{k}]")
    elif isinstance(old, str) and isinstance(new, str):
        if not _same_text(old, new):
            yield f"{where}: {_short(old)} became {_short(new)}"
    elif isinstance(old, float) and _is_number(new):
        if not _close([old], [new], RELATIVE, 1e-9):
            yield f"{where}: {old} became {new}"
    elif old != new:
        yield f"{where}: {_short(old)} became {_short(new)}"


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 300 else f"{text[:300]} ..."


# -- times -------------------------------------------------------------------------------------------------------------


def times(old: str, new: str, rounds: int) -> None:
    """Print CPU times of some cases by two interpreters in turn: medians, and the median of the ratios of pairs.

    Modules that a case imports belong to it, but as they are once installed, compiled: a first pair is not counted.
    """
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    for name in timed():
        pairs = []
        for k in range(-1, rounds):
            taken = {}
            for python in (old, new) if k % 2 else (new, old):
                command = [python, str(Path(__file__).resolve()), "--cpu", name]
                done = subprocess.run(command, capture_output=True, text=True, cwd="/", check=True, env=environment)
                taken[python] = float(done.stdout)
            if k >= 0:
                pairs.append((taken[old], taken[new]))
        before, after = (statistics.median(column) for column in zip(*pairs, strict=True))
        ratio = statistics.median(b / a if a else inf for a, b in pairs)
        print(f"{name:32} {before:8.2f} s {after:8.2f} s  ratio {ratio:5.2f}", flush=True)


def main() -> int:
    """Record, compare or measure; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", type=Path, metavar="FILE")
    parser.add_argument("--compare", nargs=2, type=Path, metavar=("OLD", "NEW"))
    parser.add_argument("--times", nargs=2, metavar=("OLD", "NEW"), help="two interpreters")
    parser.add_argument("--rounds", type=int, default=5, help="pairs of times (default 5)")
    parser.add_argument("--only", default="", metavar="WORD")
    parser.add_argument("--cpu", metavar="CASE", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.cpu is not None:
        call = timed()[given.cpu]
        begun = time.process_time()
        call()
        print(time.process_time() - begun)
        return 0
    if given.times is not None:
        # not resolved: the link in an environment is what makes it that environment
        times(*map(os.path.abspath, given.times), given.rounds)
        return 0
    if given.compare is not None:
        old, new = (json.loads(path.read_text(encoding="utf-8")) for path in given.compare)
    else:
        names = [name for name in cases() if given.only in name]
        new = {}
        for name in names:
            print(name, file=sys.stderr, flush=True)
            new[name] = record(name)
        if given.write is not None:
            lines = (f"{json.dumps(name)}:{json.dumps(new[name], separators=(',', ':'))}" for name in new)
            given.write.write_text("{" + ",\n".join(lines) + "}\n", encoding="utf-8")
            return 0
        kept = json.loads(KEPT.read_text(encoding="utf-8"))
        old = {name: kept[name] for name in kept if given.only in name}
    found = list(differences(old, new))
    print("\n".join([*found, f"{len(found)} differences in {len(old)} cases"]))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
