"""Random bodies that nothing holds against exhaustive enumeration in rationals: all solutions have to be equal.

    python tools/random_floating_bodies.py 5000 --table studies/floating_bodies/results/random.txt

The bodies, the enumeration and the comparison are those of `tests/roots/test_floating_bodies.py`, which runs some of
them: trusses of up to four nodes, or two of them, with one to six rigid modes and up to three contact nodes. The
enumeration uses A itself, its unknowns are u and the forces, and it shares no code with the package. Every body is
solved in exact arithmetic, and in verified arithmetic with its proof read by the checker. Exit status 1 if any differs.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path

import pandas as pd

TESTS = Path(__file__).parents[1] / "tests"
#: Seeds of the first body: not those of the tests.
FIRST = 20_000
ALPHAS = (0, 0.25, 0.5)


COLUMNS = ["bodies", "different", "roots", "with several roots", "with a continuum", "without a solution"]


def text_of(found: dict[tuple[int, int], Counter[str]]) -> str:
    """The table of what was compared so far."""
    rows = [{"p": p, "modes": r, **{name: row[name] for name in COLUMNS}} for (p, r), row in sorted(found.items())]
    table = pd.DataFrame(rows)
    sums = ", ".join(f"{int(table[name].sum())} {name}" for name in COLUMNS)
    return f"{table.to_string(index=False)}\n{sums}\n"


def main() -> int:
    """Run the comparison."""
    sys.path[:0] = [str(TESTS), str(TESTS / "helpers"), str(TESTS / "roots")]
    from helpers.floating_oracle import Oracle, random_body
    from test_floating_bodies import difference_from_oracle

    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("count", type=int)
    parser.add_argument("--first", type=int, default=FIRST, help="seed of the first body")
    parser.add_argument("--table", type=Path)
    given = parser.parse_args()
    found: dict[tuple[int, int], Counter[str]] = {}
    for seed in range(given.first, given.first + given.count):
        problem, alpha = random_body(seed), ALPHAS[seed % len(ALPHAS)]
        oracle = Oracle(problem, alpha)
        row = found.setdefault((problem.p, problem.modes.r), Counter())
        row["bodies"] += 1
        row["roots"] += len(oracle.points)
        row["with several roots"] += len(oracle.points) > 1
        row["with a continuum"] += oracle.families > 0
        row["without a solution"] += not oracle.points and not oracle.families
        for arithmetic in ("verified", "exact"):
            said = difference_from_oracle(problem, alpha, arithmetic, oracle)
            if said is not None:
                row["different"] += 1
                sys.stderr.write(f"seed {seed}, {arithmetic}: {said}\n")
        if given.table is not None and seed % 100 == 99:
            given.table.write_text(text_of(found), encoding="utf-8")
    text = text_of(found)
    sys.stdout.write(text)
    if given.table is not None:
        given.table.write_text(text, encoding="utf-8")
    return int(any(row["different"] for row in found.values()))


if __name__ == "__main__":
    sys.exit(main())
