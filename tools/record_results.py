"""Proofs, graphs and printed results of some hundred problems, to see that a change of the code changes none of them.

    python tools/record_results.py DIR            # before the change
    python tools/record_results.py OTHER --vs DIR # after it: lists the files that differ, exit status 1 if any does

Every file holds what one call returns: the bytes of a proof, a printed result, a table. Times are left out. Both
recordings have to be made on one machine with one set of libraries, as the last bits of a number are theirs.
"""

from __future__ import annotations

import argparse
import filecmp
import json
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import enumsol
from enumsol import ContactProblem, gallery

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

_SECONDS = re.compile(r"""seconds"?[=:] ?[0-9.e+-]+|\b[0-9.]+ s\b""")


def _text(*values: Any) -> str:
    return _SECONDS.sub("<time>", "\n".join(str(value) for value in values)) + "\n"


def _random(seed: int, p: int, *, degenerate: bool) -> ContactProblem:
    rng = np.random.default_rng(seed)
    n = 2 * p + seed % 3
    if degenerate:
        B = rng.integers(-1, 2, size=(n, n))
        A, f = B @ B.T + 2 * np.eye(n), rng.integers(-2, 3, size=n).astype(float)
        friction = rng.integers(0, 4, size=p).astype(float)
    else:
        B = rng.normal(size=(n, n + 1))
        A, f, friction = B @ B.T, 3 * rng.normal(size=n), np.exp(rng.uniform(-2, 2, size=p))
    rows = np.eye(n)
    return ContactProblem(0.5 * (A + A.T), rows[:p], rows[p : 2 * p], f, friction=friction, friction_slope=0.25)


def _plane() -> Iterator[tuple[str, ContactProblem, float]]:
    names = ("one-node-6.1", "one-node-6.3", "two-node-6.4", "two-node-6.7-minus", "two-node-5", "clamped-block-8")
    for name in (*names, "wedge-8-3", "wedge-8-5", "chain-2", "chain-4-coupled"):
        entry = gallery.get(name)
        yield name, entry.build(), entry.alpha
    for seed in range(12):
        degenerate = seed % 3 == 0
        yield f"random-{seed}", _random(seed, 1 + seed % 3, degenerate=degenerate), 0.5


def _solids() -> Iterator[tuple[str, enumsol.ContactProblem3D, float]]:
    for name in ("one-node-3d", "one-node-3d-3", "block3d-4", "wedge3d-2-3"):
        entry = gallery.get(name)
        yield name, entry.build(), entry.alpha  # type: ignore[misc]
    for seed in range(4):
        rng = np.random.default_rng(seed)
        p = 1 + seed % 2
        B = rng.normal(size=(3 * p, 3 * p + 2))
        rows = np.eye(3 * p).reshape(3, p, 3 * p)
        problem = enumsol.ContactProblem3D(B @ B.T, *rows, 3 * rng.normal(size=3 * p), friction=0.5 + seed)
        yield f"random-3d-{seed}", problem, 0.0


def _roots(folder: Path, name: str, problem: Any, alpha: float, arithmetic: str = "verified", **options: Any) -> None:
    path = folder / f"{name}.proof" if arithmetic == "verified" else None
    roots = enumsol.enumerate_roots(problem, alpha, arithmetic, proof_path=path, **options)  # type: ignore[call-overload]
    parts = [roots, roots.stats, roots.to_frame().to_csv(), roots.families, roots.undecided]
    parts += [(root, root.u, root.enclosure, root.active) for root in roots]
    if path is not None:
        parts.append(enumsol.verify(problem, enumsol.Proof.load(path)))
        path.write_text(_records(path))
    (folder / f"{name}.{arithmetic}.txt").write_text(_text(*parts))


def _records(path: Path) -> str:
    return "".join(json.dumps(record) + "\n" for record in enumsol.Proof.load(path).records())


def _graph(folder: Path, name: str, problem: ContactProblem) -> None:
    graph = enumsol.branch_graph(problem, (0, 4))
    parts = [graph, graph.stats, graph.to_frame().to_csv(), graph.vertices_frame().to_csv(), graph.claims.steps()]
    parts += [graph.roots_at(alpha) for alpha in (0, 1, 3.5)]
    if graph.proof is not None:
        graph.proof.save(folder / f"{name}.graph.proof")
        parts.append(enumsol.verify(problem, graph.proof))
        (folder / f"{name}.graph.proof").write_text(_records(folder / f"{name}.graph.proof"))
    graph.save(folder / f"{name}.graph.json")
    saved = json.loads((folder / f"{name}.graph.json").read_text())
    (folder / f"{name}.graph.json").write_text(_text(json.dumps(saved, indent=1)))
    (folder / f"{name}.graph.txt").write_text(_text(*parts))


def _paths(folder: Path, name: str, problem: ContactProblem) -> None:
    result = enumsol.follow_all(problem, (0, 4))
    graph = enumsol.branch_graph(problem, (0, 4))
    parts = [result, *result.paths]
    parts += [enumsol.audit(path, graph) for path in result.paths]
    parts += [path.to_frame().to_csv() for path in result.paths]
    (folder / f"{name}.paths.txt").write_text(_text(*parts))


def _fixed_points(folder: Path, name: str, problem: Any, alpha: float) -> None:
    found = enumsol.successive_approximations(problem, alpha)
    parts = [found, found.u, enumsol.lipschitz_estimate(problem, alpha)]
    parts.append(enumsol.solve_tresca(problem, np.full(problem.p, 0.5), alpha))
    (folder / f"{name}.fixed_point.txt").write_text(_text(*parts))


def record(folder: Path, say: Callable[[str], object]) -> None:
    """Write all results into the folder, which is made."""
    folder.mkdir(parents=True)
    for name, problem, alpha in _plane():
        say(name)
        for arithmetic in ("verified", "exact", "fast"):
            if arithmetic != "exact" or problem.A.shape[0] <= 24:
                _roots(folder, name, problem, alpha, arithmetic)
        if problem.p <= 2:
            _roots(folder, f"{name}.all", problem, alpha, "fast", method="exhaustive")
            _paths(folder, name, problem)
        _graph(folder, name, problem)
        _fixed_points(folder, name, problem, alpha)
        table = enumsol.multiplicity_table(problem, (0, 1, 2), arithmetic="fast")
        (folder / f"{name}.table.txt").write_text(_text(table.drop(columns="seconds").to_csv()))
    for name, solid, alpha in _solids():
        say(name)
        _roots(folder, name, solid, alpha)
        _fixed_points(folder, name, solid, alpha)


def main() -> int:
    """Record, and compare; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--vs", type=Path)
    given = parser.parse_args()
    record(given.folder, lambda name: print(name, file=sys.stderr))
    if given.vs is None:
        return 0
    names = sorted({path.name for folder in (given.folder, given.vs) for path in folder.iterdir()})
    _, different, missing = filecmp.cmpfiles(given.folder, given.vs, names, shallow=False)
    print(f"{len(names)} files, different: {different or 'none'}, in one only: {missing or 'none'}")
    return 1 if different or missing else 0


if __name__ == "__main__":
    sys.exit(main())
