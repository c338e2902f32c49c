"""Make the collection of certified problems: python tools/make_collection.py [--into FOLDER] [NAME ...].

Every problem is written as .npz and as .h5 (fclib), all its solutions are enumerated, and the proof is verified against
both files before ``index.json`` lists it. A problem whose list of solutions is not complete is refused. With NAMEs only
these are made, and the rest of the index stays. ``--check`` looks whether all solutions are far enough from each other
to be told apart, and ``--table`` prints the table of docs/collection.md.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from collection_recipes import RECIPES

import enumsol
from enumsol.cli import main as command
from enumsol.collection import COLLECTION
from enumsol.collection.comparison import KnownSolutions
from enumsol.collection.entries import CERTIFIED, DATA, INDEX, PROBLEMS

if TYPE_CHECKING:
    from collection_recipes import Recipe

#: Least distance between two solutions, in parts of the size of their forces or displacements.
LEAST_SEPARATION = 1e-3
#: Problems with more degrees of freedom are kept without their meshes.
MOST_DRAWN = 400


def make(recipe: Recipe, folder: Path) -> dict[str, Any]:
    """Write a problem, its solutions and its proof; its entry in the index.

    Raises
    ------
    SystemExit
        Its solutions are not all certified, or are too close to each other.
    """
    problem = recipe.build()
    if problem.n > MOST_DRAWN:
        problem = problem.replace(mesh=None)
    file, foreign = (folder / PROBLEMS / f"{recipe.name}.{ending}" for ending in ("npz", "h5"))
    proof, solutions = (folder / CERTIFIED / f"{recipe.name}.{ending}" for ending in ("proof", "json"))
    for place in (file, proof):
        place.parent.mkdir(parents=True, exist_ok=True)
    enumsol.write_problem(problem, file)
    enumsol.write_problem(problem, foreign)
    outputs = ["--proof", str(proof), "--json", str(solutions), "--quiet"]
    if command(["roots", str(file), "--alpha", "0", *outputs]):
        sys.exit(f"{recipe.name}: the list of solutions is not complete")
    found = without_paths(solutions)
    for place in (file, foreign):
        report = enumsol.verify(enumsol.read_problem(place), enumsol.Proof.load(proof))
        counts = (len(found["roots"]), len(found["families"]))
        if not report.complete or (report.roots, report.families) != counts:
            sys.exit(f"{place}: {report!r}")
    F = problem.friction_at(0)
    return {
        **about(recipe),
        "dimension": problem.contact_rows.shape[0] // problem.p,
        "p": problem.p,
        "n": problem.n,
        "friction": [float(F.min()), float(F.max())],
        "roots": counts[0],
        "families": counts[1],
        "degenerate": sum(not root["regular"] for root in found["roots"]),
        "fingerprint": problem.fingerprint,
    }


def about(recipe: Recipe) -> dict[str, Any]:
    """What the index says of a problem in words."""
    return {
        "name": recipe.name,
        "summary": recipe.summary,
        "source": recipe.source,
        "kinds": list(recipe.kinds),
    }


def without_paths(solutions: Path) -> dict[str, Any]:
    """The solutions, in a file that no longer says where the problem was and how long the search took."""
    found: dict[str, Any] = json.loads(solutions.read_text())
    found["problem"] = f"collection:{solutions.stem}"
    del found["stats"]["seconds"]
    lines = (f"{json.dumps(key)}: {json.dumps(value)}" for key, value in found.items())
    solutions.write_text("{\n" + ",\n".join(lines) + "\n}\n")
    return found


def write_index(entries: list[dict[str, Any]], folder: Path) -> None:
    (folder / INDEX).write_text("[\n" + ",\n".join(map(json.dumps, entries)) + "\n]\n")


def table() -> list[str]:
    """The rows of the table in docs/collection.md."""
    rows = []
    for entry in COLLECTION.values():
        kinds = ", ".join(entry.kinds)
        solutions = entry.solutions_in_words()
        rows.append(
            f"| `{entry.name}` | {entry.dimension} | {entry.p} | {entry.n} | {entry.friction_in_words()} "
            f"| {solutions} | {kinds} | {entry.summary} | {entry.source} |"
        )
    return rows


def check_separations() -> None:
    """Compare the kept solutions with each other, by forces and by displacements.

    Raises
    ------
    InvalidArgumentError
        Some are too close.
    """
    for entry in COLLECTION.values():
        for displacements in (False, True):
            known = KnownSolutions(entry.problem(), entry.certified(), displacements=displacements)
            known.check_apart(LEAST_SEPARATION / 2, entry.name)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--into", type=Path, default=DATA, metavar="FOLDER")
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--table", action="store_true")
    options = parser.parse_args()
    if options.check:
        check_separations()
        return
    if options.table:
        print("\n".join(table()))
        return
    kept = json.loads((options.into / INDEX).read_text()) if options.names else []
    entries = {entry["name"]: entry for entry in kept}
    for recipe in RECIPES:
        if not options.names or recipe.name in options.names:
            entries[recipe.name] = make(recipe, options.into)
            print(*entries[recipe.name].values(), flush=True)
    known = [recipe for recipe in RECIPES if recipe.name in entries]
    write_index([entries[recipe.name] | about(recipe) for recipe in known], options.into)


if __name__ == "__main__":
    main()
