"""Numbers of measurements in the documents are those of the studies' results: they cannot go stale."""

import re

import pandas as pd
import pytest
from documents import ROOT


def table(name):
    return pd.read_csv(ROOT / "studies" / name, dtype=str)


def numbers(column):
    return pd.to_numeric(column)


def largest_of(*names, column="any"):
    found = table("one_certificate/results/largest.csv").set_index("series")
    return numbers(found.loc[list(names), column])


def certified(shape):
    """Problems that one certificate decides, in less than a second: the largest p, the least and the largest F."""
    found = table("one_certificate/results/one_certificate.csv")
    found = found[found["problem"].str.startswith(shape) & (found["certificate"] == "yes")]
    most = numbers(found["p"]).max()
    found = found[numbers(found["p"]) == most]
    assert max(numbers(found["seconds"])) < 1
    return (most, *rounded(numbers(found["F"])))


def nodes_of_wedges(p):
    found = table("one_certificate/results/cost.csv")
    return numbers(found[found["p"] == str(p)]["tree nodes"])


def nodes_of_workers(p):
    found = table("workers/results/workers.csv")
    return numbers(found[found["p"] == str(p)]["nodes"])


def nodes_of_discs(count):
    found = table("discs/results/discs.csv")
    chosen = (found[["unequal", "contacts", "discs"]] == ["weights", "stiff", str(count)]).all(axis=1)
    return numbers(found[chosen]["nodes"])


def wedges_in_3d(p, column):
    found = table("search_in_3d/results/wedges.csv")
    return numbers(found[found["p"] == str(p)][column])


def feet_in_3d(column):
    """Of those that take a tree and were finished, the least and the largest."""
    found = table("search_in_3d/results/feet.csv")
    return rounded(numbers(found[(found["complete"] == "True") & (numbers(found["nodes"]) > 1)][column]))


def rounded(values, digits=2):
    """The least and the largest, to so many digits."""
    return tuple(float(f"{value:.{digits}g}") for value in (min(values), max(values)))


#: A sentence, with a place for each of its numbers, and what they are.
CLAIMS = {
    "blocks in 2D": (r"p = (\d+) in 2D and F from ([\d.]+) to ([\d.]+)", lambda: certified("256x")),
    "blocks in 3D": (r"p = (\d+) in 3D and F from ([\d.]+) to ([\d.]+)", lambda: certified("3D block")),
    "pressed": (r"up to F = (\d+), the largest value tried", lambda: rounded(largest_of("block pressed"))[:1]),
    "dragged": (
        r"up to F = ([\d.]+) to ([\d.]+) for blocks that are dragged",
        lambda: rounded(largest_of("block dragged")),
    ),
    "wedges": (r"up to F = ([\d.]+) to ([\d.]+) for wedges", lambda: rounded(largest_of("wedge", "3D wedge"))),
    "tree, p = 32": (
        r"Wedges take ([\d,]+) to ([\d,]+) nodes of the tree at p = 32",
        lambda: rounded(nodes_of_wedges(32), 1),
    ),
    "tree, p = 48": (r"([\d,]+) at p = 48", lambda: rounded(nodes_of_workers(48))[1:]),
    "tree, p = 64": (r"and ([\d,]+) in half a minute at p = 64", lambda: rounded(nodes_of_workers(64), 3)[1:]),
    "12 discs": (r"12 discs take (\d+) nodes", lambda: rounded(nodes_of_discs(12), 3)[1:]),
    "20 discs": (r"20 discs (\d+) to (\d+)", lambda: rounded(nodes_of_discs(20), 3)),
    "3D wedges, nodes": (
        r"take ([\d,]+) to ([\d,]+) nodes of the tree and \d+ to \d+ s with eight",
        lambda: rounded(wedges_in_3d(8, "nodes")),
    ),
    "3D wedges, time": (
        r"nodes of the tree and (\d+) to (\d+) s with eight",
        lambda: rounded(wedges_in_3d(8, "search s").round()),
    ),
    "3D wedges, p = 12": (
        r"and ([\d,]+) to ([\d,]+) nodes and \d+ to \d+ s with twelve",
        lambda: rounded(wedges_in_3d(12, "nodes")),
    ),
    "3D wedges, p = 12, time": (
        r"nodes and (\d+) to (\d+) s with twelve",
        lambda: rounded(wedges_in_3d(12, "search s").round()),
    ),
    "3D feet": (
        r"with (\d+) to (\d+) contact nodes they take ([\d,]+) to ([\d,]+) nodes of the tree where no certificate",
        lambda: feet_in_3d("p") + feet_in_3d("nodes"),
    ),
}


@pytest.mark.parametrize("claim", CLAIMS)
def test_numbers_are_those_of_the_results(claim):
    pattern, expected = CLAIMS[claim]
    text = " ".join((ROOT / "docs" / "arithmetic.md").read_text(encoding="utf-8").split())
    (found,) = re.finditer(pattern, text)
    assert tuple(float(number.replace(",", "")) for number in found.groups()) == expected()


def test_results_that_the_documents_name_are_there():
    for path in (*(ROOT / "docs").glob("*.md"), ROOT / "README.md"):
        for name in re.findall(r"`(studies/[\w/]+\.csv)`", path.read_text(encoding="utf-8")):
            assert (ROOT / name).is_file(), (path, name)
