"""Random problems in 3D against Newton's method from many starts: no solution that it finds may be missing.

    python tools/random_in_3d.py 1000 --most 4 --table studies/search_in_3d/results/random.txt

Problem number k has 1 to MOST contact nodes, by k; every third is a body on weak springs (a common motion with a
stiffness of 1e-6 to 1), the others have strongly coupled nodes. A quarter of the searches is as it is; the others go by
the tree, with the forms of theory, section 12.2, from the beginning, and two thirds of these close subtrees by a lone
root. A complete answer must have an index sum of 1; proofs are checked of every tenth problem, and every third with
forms or lone roots. Newton's method and the test of what it finds are those of `tests/helpers/oracles3d.py`. Exit
status 1 if a root is missing, an index sum is wrong or a proof is refused.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pandas as pd

import enumsol

TESTS = Path(__file__).parents[1] / "tests"
#: Seeds of the first problem: not those of the tests.
FIRST = 500_000
COLUMNS = [
    "problems",
    "wrong",
    "roots",
    "with several roots",
    "open",
    "with forms",
    "with lone roots",
    "proofs checked",
]
#: Common motions of all nodes: along the normal and two tangents.
MOTIONS = 3


def on_springs(rng: np.random.Generator, p: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """S, g and F of nodes on a common body on weak springs."""
    X = rng.normal(size=(3 * p, 3 * p))
    together = np.kron(np.eye(MOTIONS), np.ones((p, 1)))
    S = X @ X.T / p + 0.1 * np.eye(3 * p) + together @ together.T / 10 ** rng.uniform(-6, 0)
    load = np.array([1.0, *rng.uniform(-1.0, 1.0, 2)])
    return S, S @ together @ load / p + rng.normal(size=3 * p), 10 ** rng.uniform(-1, 0.7, (p, 1)) * np.ones((p, 2))


def compared(seed: int, given: argparse.Namespace, found: dict[tuple[int, str], Counter[str]]) -> list[str]:
    """What is wrong with the answer to one problem; takes note of it in its row of the table."""
    from oracles3d import newton_set
    from problems3d import from_compliance, random_coupled, unmatched
    from proof_tools import by_forms, records_of
    from trees import by_the_tree, closed_in_the_tree, forms_at_once

    rng = np.random.default_rng(seed)
    p, soft = given.least + seed % (given.most - given.least + 1), seed % 3 == 0
    data = on_springs(rng, p) if soft else random_coupled(rng, p)
    problem = from_compliance(data[0], data[1], (data[2][:, 0], data[2][:, 1]))
    with ExitStack() as stack:
        way = rng.integers(4)
        if way > 0:
            stack.enter_context(by_the_tree() if way == 1 else closed_in_the_tree())
            stack.enter_context(forms_at_once())
        roots = enumsol.enumerate_roots(problem, 0, max_nodes=given.max_nodes)
    records, wrong = records_of(roots.proof)[1:-1], []
    kinds = {record[0] for record in records}
    forms, lone = bool(by_forms(records)), {"b", "a"} <= kinds
    if roots.complete:
        # the stiffness is the inverse of S, rounded: that moves roots by more than the enclosures
        loose = 1e-6 + 1e-11 * float(np.linalg.cond(data[0]))
        missed, _ = unmatched(list(roots), newton_set(*data, given.starts, rng), loose)
        wrong += [f"{len(missed)} roots are missing"] if missed else []
        wrong += [f"the index sum is {roots.index_sum}"] if roots.index_sum not in (1, None) else []
    checked = seed % 10 == 0 or ((forms or lone) and seed % 3 == 1)
    if checked:
        report = enumsol.verify(problem, roots.proof)
        wrong += [] if report.ok and report.complete == roots.complete else [f"its proof is refused: {report}"]
    row = found.setdefault((p, "soft" if soft else "coupled"), Counter())
    counts = (1, bool(wrong), len(roots), len(roots) > 1, not roots.complete, forms, lone, checked)
    row.update(dict(zip(COLUMNS, map(int, counts), strict=True)))
    return wrong


def main() -> int:
    """Run the comparison."""
    sys.path[:0] = [str(TESTS), str(TESTS / "helpers")]
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("count", type=int)
    parser.add_argument("--first", type=int, default=FIRST, help="seed of the first problem")
    parser.add_argument("--least", type=int, default=1, help="least number of contact nodes")
    parser.add_argument("--most", type=int, default=4, help="largest number of contact nodes")
    parser.add_argument("--starts", type=int, default=30, help="of Newton's method")
    parser.add_argument("--max-nodes", type=int, default=5_000)
    parser.add_argument("--table", type=Path)
    given = parser.parse_args()
    found: dict[tuple[int, str], Counter[str]] = {}
    for seed in range(given.first, given.first + given.count):
        wrong = compared(seed, given, found)
        if wrong:
            sys.stderr.write(f"seed {seed}: {'; '.join(wrong)}\n")
    rows = [{"p": p, "kind": kind, **{name: row[name] for name in COLUMNS}} for (p, kind), row in sorted(found.items())]
    table = pd.DataFrame(rows)
    sums = ", ".join(f"{int(table[name].sum())} {name}" for name in COLUMNS)
    text = f"{table.to_string(index=False)}\n{sums}\n"
    sys.stdout.write(text)
    if given.table is not None:
        given.table.parent.mkdir(parents=True, exist_ok=True)
        given.table.write_text(text, encoding="utf-8")
    return int(table["wrong"].sum() > 0)


if __name__ == "__main__":
    sys.exit(main())
