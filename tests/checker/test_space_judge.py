"""A judge of proofs in 3D that shares no code with the package accepts and refuses what the checker does."""

import ast
from collections import Counter
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import space_judge
from effort import some
from problems3d import degenerate_integers
from proof_tools import bytes_of, of_kind, put, records_of
from space_judge_mutants import checked, judged, mutant
from space_proofs import case, random_problem

from enumsol import enumerate_roots, gallery

#: What the checker says of a claim that is true and that its own bounds do not reach.
COARSE = (
    *("what it holds is not proven", "its enclosure does not hold the root", "it holds a root"),
    *("its multipliers do not exclude it", "its solution is not proven to be the only one"),
)


@cache
def found(name):
    """Problem, proof and records of a set of roots: by certificates where there are some, or by the tree."""
    kind, *rest = name
    if kind == "tree":
        problem, _, records, data = case(*rest)
        return problem, records, data
    alpha, options = 0.0, {}
    if kind == "random":
        problem = random_problem(*rest)
    elif kind == "cut short":
        problem, options = random_problem(*rest), {"max_nodes": 1 + 4 * rest[1]}
    elif kind == "degenerate":
        problem, options = degenerate_integers(*rest)[0], {"max_nodes": 300}
    elif kind == "rest":
        problem, options = degenerate_integers(*rest, kinds=("rest", "graze", "limit"))[0], {"max_nodes": 300}
    elif kind == "wedge":
        problem, alpha = gallery.wedge3d(*rest[0], friction=rest[1]), 1.0
    elif kind == "block":
        problem, alpha = gallery.block3d(*rest[0]), rest[1]
    proof = enumerate_roots(problem, alpha, **options).proof
    return problem, records_of(proof), bytes_of(proof)


QUICK = [
    *(("tree", name) for name in ((1, 22), (2, 0), "end", "one tangent", ("block", (2, 1, 2), 0.5))),
    *(("random", 2, 3), ("random", 3, 4), ("random", 4, 4), ("cut short", 2, 4)),
    *(("degenerate", 1), ("degenerate", 6), ("degenerate", 18), ("rest", 9), ("rest", 11)),
    *(("wedge", (1, 1, 2), 1.0), ("block", (2, 1, 2), 1.0)),
]


def compare(problem, proof):
    """What both say of a proof, and a Counter's key for it."""
    report, reasons = checked(problem, proof)
    counts, reason = judged(problem, proof)
    if report and counts:
        assert report.roots == counts["roots"]
        return "both accept"
    assert not report, (reason, "the checker accepts what the judge refuses")
    if not counts:
        return "undecided" if reason.startswith("undecided") else "both refuse"
    coarse = [text for text in reasons.split("; ") if text.startswith("leaf")]
    assert coarse, (reasons, "refused by the checker for its form")
    assert all(text.endswith(COARSE) for text in coarse), reasons
    return "true beyond the checker's bounds"


@pytest.mark.parametrize("name", QUICK, ids=str)
def test_the_judge_accepts_what_the_checker_accepts(name):
    problem, _, data = found(name)
    report, reasons = checked(problem, space_judge_proof(data))
    counts, reason = judged(problem, space_judge_proof(data))
    assert (report is None) == (counts is None), (reasons, reason)
    assert counts["roots"] == report.roots


def space_judge_proof(data):
    from enumsol import Proof

    return Proof(data)


@pytest.mark.few(2, 4)
@pytest.mark.parametrize("name", QUICK, ids=str)
def test_mutants_are_judged_alike(name):
    problem, records, data = found(name)
    rng, told = np.random.default_rng(7), Counter()
    for _ in range(some(15, of=100)):
        told[compare(problem, mutant(rng, records, data)[0])] += 1
    assert told["both refuse"] > 0


def test_the_judge_imports_nothing_of_the_package():
    waiting, seen = ["space_judge"], set()
    while waiting:
        name = waiting.pop()
        file = Path(space_judge.__file__).parent / f"{name}.py"
        if name in seen or not file.is_file():
            assert not name.startswith("enumsol")
            continue
        seen.add(name)
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Import):
                waiting += [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                waiting.append(node.module)
    assert {"space_judge_leaves", "rational_forms"} <= seen


def test_the_judge_sees_wrong_claims():
    """Each by the reason for which it is wrong."""
    problem, records, _ = found(("tree", (2, 0)))
    root, excluded = of_kind(records, "r")[0], of_kind(records, "x")[0]

    def reason(*change):
        with pytest.raises(space_judge.Refused) as refusal:
            space_judge.judge_records(problem, put(records, *change))
        return str(refusal.value)

    assert "there is a solution" in reason((root,), ["n"])
    assert "not in its ball" in reason((root, 1, 0), lambda x: x + 0.1)
    assert "the index" in reason((root, 3), lambda x: -x)
    assert "the margin is -" in reason((excluded,), ["x", [], ""])
    assert "the counts" in reason((-1, "roots"), lambda x: x - 1)
