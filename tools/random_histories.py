"""Random histories against exhaustive enumeration in rationals, step by step: all paths have to be equal.

    python tools/random_histories.py 2000 --table studies/histories/results/random.txt
    python tools/random_histories.py 700 --floating --table studies/histories/results/floating.txt

Every history has 4 steps and up to 3 contact nodes, 3 steps if nothing holds the body (``--floating``). The cases, the
enumeration and the comparison are those of `tests/loading/test_random_histories.py` and of
`tests/helpers/floating_histories.py`, of which tests run some; the enumeration shares no code with the package. Each is
made in exact and in verified arithmetic. Exit status 1 if any differs.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import pandas as pd

TESTS = Path(__file__).parents[1] / "tests"
#: Seeds of the first case: not those of the tests.
FIRST = 10_000
KINDS = ("planted root of index -1", "whole numbers", "planted root of index -1", "pressed")
FLOATING = ("truss", "block on a table")


def main() -> int:
    """Run the comparison."""
    sys.path[:0] = [str(TESTS / "helpers"), str(TESTS / "loading")]
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("count", type=int)
    parser.add_argument("--floating", action="store_true")
    parser.add_argument("--table", type=Path)
    given = parser.parse_args()
    found: dict[tuple[str, int], Counter[str]] = {}
    for seed in range(FIRST, FIRST + given.count):
        (kind, problem, steps, made) = (_floating if given.floating else _held)(seed)
        row = found.setdefault((kind, problem.p), Counter())
        row["histories"] += 1
        try:
            exact, verified = made()
        except AssertionError as error:
            row["different"] += 1
            sys.stderr.write(f"seed {seed}: {error}\n")
            continue
        roots = [root for step in range(1, len(steps) + 1) for root in exact.roots(step)]
        row["roots"] += len(roots)
        row["that branch"] += bool(exact.branchings)
        row["with degenerate roots"] += any(not root.regular for root in roots)
        row["with a continuum"] += not exact.complete
        row["that end before"] += exact.complete and not exact.counts[-1]
        row["complete in verified arithmetic"] += verified.complete
    columns = ["histories", "different", "roots", "that branch", "with degenerate roots", "with a continuum"]
    columns += ["that end before"] * given.floating + ["complete in verified arithmetic"]
    table = pd.DataFrame(
        [{"cases": kind, "p": p, **{name: row[name] for name in columns}} for (kind, p), row in sorted(found.items())]
    )
    text = f"{table.to_string(index=False)}\n{given.count} histories, {int(table['different'].sum())} different\n"
    sys.stdout.write(text)
    if given.table is not None:
        given.table.write_text(text, encoding="utf-8")
    return int(table["different"].sum() > 0)


def _held(seed: int) -> tuple[str, Any, Any, Any]:
    """Kind, problem, steps, and what makes and compares the history in exact and verified arithmetic."""
    from test_random_histories import case, compare

    problem, alphas = case(seed, most=3)
    made = lambda: [compare(problem, alphas, arithmetic) for arithmetic in ("exact", "verified")]  # noqa: E731
    return KINDS[seed % len(KINDS)], problem, alphas, made


def _floating(seed: int) -> tuple[str, Any, Any, Any]:
    """The same of a body that nothing holds."""
    from floating_histories import agreed, case

    from enumsol import histories

    problem, steps = case(seed)
    made = lambda: (histories(problem, steps, arithmetic="exact"), agreed(problem, steps))  # noqa: E731
    return FLOATING[seed % 2], problem, steps, made


if __name__ == "__main__":
    sys.exit(main())
