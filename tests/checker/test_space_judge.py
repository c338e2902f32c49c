"""A judge of proofs in 3D that shares no code with the package accepts and refuses what the checker does."""

import ast
from collections import Counter
from fractions import Fraction
from functools import cache
from itertools import product
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
import space_judge
from floating_space import known_body, lying_block
from problems3d import OneNode, degenerate_integers, in_space, random_over_alpha, random_plane_over_alpha
from proof_tools import bytes_of, closed, of_kind, proof_of, put, records_of
from space_graph_proofs import closed_branch
from space_judge_mutants import checked, judged, mutant, mutant_of_graph
from space_proofs import RANDOM, case, random_problem, values_of, with_values

from enumsol import Proof, branch_graph, enumerate_roots, gallery
from enumsol.branches.space.space_graph import ByCurves
from enumsol.search.space import space_references
from enumsol.support.deadlines import Deadline

#: What the checker says of a claim that is true and that its own bounds do not reach.
COARSE = (
    *("what it holds is not proven", "its enclosure does not hold the root"),
    # the root lies beyond the sectors
    *("it holds a root", "it holds no root"),
    *("its multipliers do not exclude it", "its solution is not proven to be the only one"),
    "its root is not proven to be the only one in it",
    *("is not proven to be one from end to end", "it is not proven that all its solutions lie on its curve"),
    *("its roots are not proven to lie in its boxes", "its roots are not proven to be an arc through its box"),
    *("it is not proven to hold no root",),
    *("its box is not proven to hold one solution", "its roots are not proven to lie in its box"),
    *("a place is not proven to be on its curve", "the box of a part of a curve is not proven to hold it"),
    *("the root that was declared is not proven to be the only one in it", "the root that was declared is not proven"),
    "the root that is declared is not proven to be one whose form is definite",
)
BLOCKS = [((1, 1, 1), (2, 1, 1), (2, 1, 2), (3, 2, 2)), (0.3, 0.5, 1.0, 2.0, 3.0)]
WEDGES = [((1, 1, 2), (2, 1, 2)), (0.3, 0.5, 1.0, 1.5, 2.0, 3.0)]
GRAPHS = [
    *(("one node", seed, load) for seed in range(10) for load in (True, False)),
    *(("over alpha", 1, seed) for seed in range(500, 508)),
    *(("plane", 1, seed) for seed in range(6)),
    *(("over alpha", 2, seed) for seed in (115, 100, 119)),
    *(("two nodes", 1.3, 1.6), ("block over alpha", (1, 1, 1)), ("curves cut short", 2, 100)),
]
#: 300 proofs.
ALL = [
    *(("tree", name) for name in (*RANDOM, "end", "one tangent", "small friction")),
    *(("tree", ("block", (2, 1, 2), alpha)) for alpha in (0.5, 1.0, 3.0)),
    *(("random", p, seed) for p in range(1, 5) for seed in range(15)),
    *(("cut short", p, seed) for p in range(2, 5) for seed in range(10)),
    *(("degenerate", seed) for seed in range(45)),
    *(("rest", seed) for seed in range(30)),
    *(("wedge", *rest) for rest in product(*WEDGES)),
    *(("block", *rest) for rest in product(*BLOCKS)),
    *(("held by nothing", seed) for seed in range(100, 140)),
    *(("lying", cells, True, F) for cells in (1, 2) for F in (0.1, 0.2, 0.5, 0.8)),
    *(("lying", 1, False, 0.5, push) for push in (0.0, 0.1)),
    *GRAPHS,
]


@cache
def found(name):
    """Problem, records and bytes of a proof: by certificates where there are some, or by the tree."""
    kind, *rest = name
    if kind == "tree":
        problem, _, records, data = case(*rest)
        return problem, records, data
    proof = graph_of(kind, *rest) if name in GRAPHS else roots_of(kind, *rest)
    return proof[0], records_of(proof[1]), bytes_of(proof[1])


def roots_of(kind, *rest):
    alpha, options = 0.0, {}
    if kind == "random":
        problem = random_problem(*rest)
    elif kind == "cut short":
        problem, options = random_problem(*rest), {"max_nodes": 1 + 4 * rest[1]}
    elif kind == "degenerate":
        problem, options = degenerate_integers(*rest)[0], {"max_nodes": 200}
    elif kind == "rest":
        problem, options = degenerate_integers(*rest, kinds=("rest", "graze", "limit"))[0], {"max_nodes": 200}
    elif kind == "wedge":
        problem, alpha = gallery.wedge3d(*rest[0], friction=rest[1]), 1.0
    elif kind == "block":
        problem, alpha = gallery.block3d(*rest[0]), rest[1]
    elif kind == "lying":
        problem = lying_block(*rest)
    else:
        problem, options = known_body(*rest).problem, {"max_nodes": 200}
    # certificates are tried from the first assignment on
    with patch.object(space_references, "_MANY", 0):
        return problem, enumerate_roots(problem, alpha, **options).proof


def graph_of(kind, *rest):
    interval = 0, 1
    if kind == "curves cut short":
        cover = ByCurves(random_over_alpha(*rest), (Fraction(0), Fraction(1, 64)))
        cover.run(5, Deadline(), None, None)
        return cover.problem, cover.proof()
    if kind == "one node":
        problem = OneNode(*rest).problem
    elif kind == "over alpha":
        problem, interval = random_over_alpha(*rest), (0, 1 if rest[0] == 1 else 1 / 64)
    elif kind == "plane":
        problem = in_space(random_plane_over_alpha(*rest))
    elif kind == "two nodes":
        problem, interval = closed_branch(), rest
    else:
        problem, interval = gallery.block3d(*rest[0]), (0.5, 1)
    return problem, branch_graph(problem, interval, max_nodes=300).proof


QUICK = [
    *(("tree", name) for name in ((1, 22), (2, 0), "end", "one tangent", ("block", (2, 1, 2), 0.5))),
    *(("random", 2, 3), ("random", 3, 4), ("random", 4, 4), ("cut short", 2, 4)),
    *(("degenerate", 1), ("degenerate", 6), ("degenerate", 18), ("rest", 9), ("rest", 11)),
    *(("wedge", (1, 1, 2), 1.0), ("block", (2, 1, 2), 1.0), ("held by nothing", 102), ("held by nothing", 113)),
    *(("lying", 1, False, 0.5, 0.1), ("lying", 2, True, 0.2)),
    *(("plane", 1, 5), ("one node", 5, True), ("curves cut short", 2, 100)),
]


def compare(problem, proof):
    """What both say of a proof, in a few words."""
    report, reasons = checked(problem, proof)
    counts, reason = judged(problem, proof)
    if report and counts:
        for name in counts:
            assert name == "gaps" or counts[name] == getattr(report, name), (name, counts, report)
        return "both accept"
    if report:
        assert reason.startswith("undecided"), (reason, "the checker accepts what the judge refuses")
        return "accepted, and not decided by the judge"
    if not counts:
        return "refused, and not decided by the judge" if reason.startswith("undecided") else "both refuse"
    coarse = [
        text for text in reasons.split("; ") if text.startswith(("leaf", "curve", "a place", "the box", "the root"))
    ]
    assert coarse, (reasons, "refused by the checker for its form")
    assert all(text.endswith(COARSE) for text in coarse), reasons
    return "refused, and true"


def mutants(name, count):
    """Of a proof."""
    _, records, data = found(name)
    rng = np.random.default_rng([len(records), count])
    for _ in range(count):
        yield (mutant_of_graph(rng, records) if name in GRAPHS else mutant(rng, records, data))[0]


@pytest.mark.few(12)
@pytest.mark.parametrize("name", QUICK, ids=str)
def test_the_judge_accepts_what_the_checker_accepts(name):
    problem, _, data = found(name)
    assert compare(problem, Proof(data)) == "both accept"


@pytest.mark.few(3, 8)
@pytest.mark.parametrize("name", QUICK, ids=str)
def test_mutants_are_judged_alike(name):
    told = Counter(compare(found(name)[0], proof) for proof in mutants(name, 5 if name in GRAPHS else 15))
    assert told["both refuse"] > 0
    assert not told["accepted, and not decided by the judge"]


def test_there_are_three_hundred_proofs():
    assert len({str(name) for name in ALL}) == len(ALL) == 300


@pytest.mark.long
@pytest.mark.parametrize("kind", sorted({name[0] for name in ALL}))
def test_three_hundred_proofs_and_three_thousand_mutants(kind):
    """The judge refuses none that the checker accepts; what the checker alone refuses is true.

    It may leave open an "n" in wide sectors of a body that nothing holds and that turns about its only node.
    """
    proofs, changed, names = Counter(), Counter(), [name for name in ALL if name[0] == kind]
    for name in names:
        proofs[compare(found(name)[0], Proof(found(name)[2]))] += 1
        changed.update(compare(found(name)[0], proof) for proof in mutants(name, 10))
    assert proofs == {"both accept": len(names)}
    assert changed["accepted, and not decided by the judge"] <= (2 if kind == "held by nothing" else 0)
    assert changed["both refuse"] > changed["refused, and true"] + changed["refused, and not decided by the judge"]


BORDERS = [
    *((("random", 1, 0), 0), (("plane", 1, 5), 0)),
    *((name, leaf) for name in (("tree", (2, 5)), ("held by nothing", 113)) for leaf in range(3)),
]


@pytest.mark.few(1, 2)
@pytest.mark.parametrize(("name", "leaf"), BORDERS, ids=str)
def test_an_exclusion_at_its_very_border_is_refused(name, leaf):
    """Multipliers times the first float with which they exclude no more, upwards and downwards."""
    problem, records, _ = found(name)
    k = of_kind(records, "x")[leaf]

    def scaled(factor):
        record = records[k]
        for at in range(2, len(record)):
            record = with_values(record, [factor * value for value in values_of(record, at)], at)
        return proof_of(put(records, (k,), record))

    for end in (0.0, 1e9):
        right, wrong = 1.0, end
        if end and judged(problem, scaled(end))[0]:
            continue  # multipliers that contradict each other exclude the better the larger they are
        while (middle := 0.5 * (right + wrong)) not in (right, wrong):
            if judged(problem, scaled(middle))[0]:
                right = middle
            else:
                wrong = middle
        assert checked(problem, scaled(wrong))[0] is None


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
            space_judge.judge_records(problem, closed(put(records, *change)))
        return str(refusal.value)

    assert "there is a solution" in reason((root,), ["n"])
    assert "not in its ball" in reason((root, 1, 0), lambda x: x + 0.1)
    assert "the index" in reason((root, 3), lambda x: -x)
    assert "the margin is -" in reason((excluded,), ["x", [], ""])
    assert "the counts" in reason((-1, "roots"), lambda x: x - 1)
