"""Graph proofs for tests of both checkers: the package's and the one in rational arithmetic."""

import functools
from contextlib import contextmanager
from fractions import Fraction
from unittest import mock

import numpy as np
from generators import through_the_unloaded_state
from helpers.floating_bodies import pushed_block
from proof_tools import of_kind, proof_of, records_of
from rational_checker import check_records
from rational_forms import Refused

from enumsol import ContactProblem, branch_graph, gallery, verify
from enumsol.search import interval_tree, nodes as forms


def triangle(**data):
    body = gallery.one_node_triangle()
    return ContactProblem(body.A, body.Bn, body.Bt, data.pop("f", body.f), **data)


def three_with_everything():
    """Gap, press fit, slip offset, a node without friction, load and friction that vary."""
    block = gallery.clamped_block(3, 1)
    rng = np.random.default_rng(5)
    path = {
        "friction": [0.0, 0.2, 0.3],
        "friction_slope": [0.0, 0.5, 1.0],
        "load_slope": 0.1 * rng.normal(size=block.n),
    }
    return ContactProblem(block.A, block.Bn, block.Bt, block.f, [1e-3, -2e-3, 0.0], slip_offset=1e-3, **path)


GRAPHS = {
    "load": lambda: (gallery.get("two-node-6.7-minus").build(), (-3.0, 3.0)),
    "friction": lambda: (gallery.get("two-node-6.4").build(), (0.0, 6.0)),
    "both": lambda: (triangle(f=[1.0, -2.5], load_slope=[0.2, -0.5], friction=0.5, friction_slope=0.7), (0.0, 6.0)),
    "unloaded": through_the_unloaded_state,
    "frictionless": lambda: (triangle(load_slope=[-1.0, 0.5], friction=0.0), (0.0, 4.0)),
    "everything": lambda: (three_with_everything(), (0.0, 3.0)),
    "held by contact": lambda: (pushed_block(2, max_rigid_displacement=1 / 64), (-0.98, 0.98)),
}


@functools.cache
def graph(name):
    problem, interval = GRAPHS[name]()
    made = branch_graph(problem, interval)
    assert made.complete
    return problem, records_of(made.proof), made


@contextmanager
def forms_at_once():
    """Trees over pieces turn to forms after a few nodes, whether they pay or not."""
    with mock.patch.object(interval_tree, "FORM_AFTER", 3), mock.patch.object(forms, "MORE", -np.inf):
        yield


def forms_of_arcs(records):
    """Places of the records that declare forms of arcs."""
    return [k for k in of_kind(records, "q") if isinstance(records[k][1][0], list)]


def accepted(problem, records):
    try:
        check_records(problem, records)
    except Refused:
        return False
    return True


def refused(problem, records):
    """Both checkers refuse."""
    assert not verify(problem, proof_of(records)).ok
    return not accepted(problem, records)


def parts_of(records, *kinds):
    """Box, place in it, beginning and part of every part of these kinds."""
    for k in of_kind(records, "w"):
        begin = records[k][1]
        for i, part in enumerate(records[k][4]):
            if part[0] in kinds:
                yield k, i, begin, part
            begin = part[1]


def without_arcs(records):
    """The proof of a graph that says only where selections may have solutions."""
    *_, footer = records
    first = next(k for k, record in enumerate(records) if "traces" in record)
    return [*records[:first], {key: footer[key] for key in footer if key not in ("traces", "arcs")}]


def cut_in_two(records):
    """The proof of one piece as one that leaves its selections to both halves."""
    arcs = next(k for k, record in enumerate(records) if "traces" in record)
    header, piece, *leaves = records[:arcs]
    a, b = (Fraction(end) for end in piece["piece"])
    middle = str((a + b) / 2)
    changed = [header, piece, *(["p", middle] if leaf == ["s"] else leaf for leaf in leaves)]
    for ends in ([piece["piece"][0], middle], [middle, piece["piece"][1]]):
        changed += [{**piece, "piece": ends}, *([["s"]] * leaves.count(["s"]))]
    return [*changed, *records[arcs:-1], {**records[-1], "pieces": 3}]
