"""What the package finds is what tools/recordings.json holds, and a difference of two recordings is seen."""

import copy
import json

import pytest
from record_results import KEPT, differences, record
from recorded_problems import cases

RECORDED = json.loads(KEPT.read_text(encoding="utf-8"))
#: The others are long.
QUICK = ("two-node-6.4", "singular selection 0", "one-node-3d-3", "graph of one-node-6.3", "history of friction")


def test_every_case_is_recorded():
    assert set(RECORDED) == set(cases())
    assert KEPT.stat().st_size < 300_000


@pytest.mark.parametrize("name", [pytest.param(n, marks=() if n in QUICK else pytest.mark.long) for n in cases()])
def test_results_are_those_recorded(name):
    assert list(differences({name: RECORDED[name]}, {name: record(name)})) == []


def test_another_count_number_or_word_is_a_difference():
    old = RECORDED["two-node-6.4"]["verified"]
    for key, value in (("at least", 6), ("complete", False), ("index sum", None)):
        assert len(list(differences(old, old | {key: value}))) == 1
    new = copy.deepcopy(old)
    new["roots"][0]["displacements"][0] *= 1.001
    new["roots"][1]["active"] = "ss"
    new["roots"][2]["forces radius"] += 2
    new["text"][0] = new["text"][0].replace("5 roots", "6 roots")
    del new["roots"][3]["regular"]
    found = list(differences(old, new))
    assert len(found) == 5
    assert any("only in the old one" in line for line in found)
    assert list(differences(old, old | {"roots": old["roots"][1:]}))


def test_last_digits_sizes_of_searches_and_times_are_none():
    old = RECORDED["two-node-6.4"]["verified"]
    new = copy.deepcopy(old) | {"cpu": 1e3, "info": {"nodes": 7}}
    for root in new["roots"]:
        root["displacements"] = [value * (1 + 1e-9) for value in root["displacements"]]
        root["margin"] = [value * 1.001 for value in root["margin"]]
        root["forces radius"] -= 1
    new["text"] = [line.replace("e-01", "1e-01") for line in new["text"]]
    assert list(differences(old, new)) == []
