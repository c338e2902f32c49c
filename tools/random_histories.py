"""Random histories against exhaustive enumeration in rationals, step by step: all paths have to be equal.

    python tools/random_histories.py 2000 --table studies/histories/results/random.txt

Every history has 4 steps and up to 3 contact nodes. The cases, the enumeration and the comparison are those of
`tests/loading/test_random_histories.py`, which runs some of them; the enumeration shares no code with the package. Each
is made in exact and in verified arithmetic. Exit status 1 if any differs.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path

import pandas as pd

TESTS = Path(__file__).parents[1] / "tests"
#: Seeds of the first case: not those of the tests.
FIRST = 10_000
KINDS = ("planted root of index -1", "whole numbers", "planted root of index -1", "pressed")


def main() -> int:
    """Run the comparison."""
    sys.path[:0] = [str(TESTS / "helpers"), str(TESTS / "loading")]
    from test_random_histories import case, compare

    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("count", type=int)
    parser.add_argument("--table", type=Path)
    given = parser.parse_args()
    found: dict[tuple[str, int], Counter[str]] = {}
    for seed in range(FIRST, FIRST + given.count):
        problem, alphas = case(seed, most=3)
        row = found.setdefault((KINDS[seed % len(KINDS)], problem.p), Counter())
        row["histories"] += 1
        try:
            exact, verified = (compare(problem, alphas, arithmetic) for arithmetic in ("exact", "verified"))
        except AssertionError as error:
            row["different"] += 1
            sys.stderr.write(f"seed {seed}: {error}\n")
            continue
        roots = [root for step in range(1, len(alphas) + 1) for root in exact.roots(step)]
        row["roots"] += len(roots)
        row["that branch"] += bool(exact.branchings)
        row["with degenerate roots"] += any(not root.regular for root in roots)
        row["with a continuum"] += not exact.complete
        row["complete in verified arithmetic"] += verified.complete
    columns = ["histories", "different", "roots", "that branch", "with degenerate roots", "with a continuum"]
    columns.append("complete in verified arithmetic")
    table = pd.DataFrame(
        [{"cases": kind, "p": p, **{name: row[name] for name in columns}} for (kind, p), row in sorted(found.items())]
    )
    text = f"{table.to_string(index=False)}\n{given.count} histories, {int(table['different'].sum())} different\n"
    sys.stdout.write(text)
    if given.table is not None:
        given.table.write_text(text, encoding="utf-8")
    return int(table["different"].sum() > 0)


if __name__ == "__main__":
    sys.exit(main())
