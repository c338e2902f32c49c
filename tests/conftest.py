"""Set-up of the whole suite."""

import os
import signal
from collections import defaultdict

# two workers on two cores, each with a thread for every core, would wait for each other; read when numpy is loaded
os.environ.setdefault("OMP_NUM_THREADS", "1")

import effort
import numpy as np
import pytest
from alike import anew
from trees import by_the_tree, without_boxes

from enumsol import gallery
from enumsol.condensation.enclosure import CondensedEnclosure

# a suite started in the background inherits an ignored SIGINT, and so would the programs whose Ctrl-C is tested
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_configure(config):
    effort.thorough = "not long" not in config.option.markexpr


@pytest.fixture
def rng():
    return np.random.default_rng(20121)


@pytest.fixture(scope="module")
def wedge():
    """A wedge with eight contact nodes, and an alpha at which it has five roots."""
    entry = gallery.get("wedge-8-5")
    return entry.build(), entry.alpha


@pytest.fixture(scope="session")
def pulled_wedge():
    """A wedge with four contact nodes and friction 1; alpha is its pull."""
    wedge = gallery.wedge(2, 2, friction=1.0)
    return anew(wedge, f=0 * wedge.f, load_slope=wedge.f)


@pytest.fixture
def tree_only():
    """Searches go through their tree, also where one certificate would do."""
    with by_the_tree():
        yield


@pytest.fixture
def no_boxes():
    """In 3D, leaves near degenerate roots stay open."""
    with without_boxes():
        yield


@pytest.fixture
def enclosed_once(monkeypatch):
    """Many proofs of one problem are checked: its S and g, over a third of the work, are enclosed once a test."""
    enclose, known = CondensedEnclosure.from_problem, {}

    def from_problem(problem, products=None):
        if problem not in known:
            known[problem] = enclose(problem, products)
        return known[problem]

    monkeypatch.setattr(CondensedEnclosure, "from_problem", staticmethod(from_problem))


def spread(items, count):
    """So many of the items, at even distances."""
    return [items[len(items) * k // count] for k in range(min(count, len(items)))]


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """What is slow or long; coverage is not measured in that, which the tracer would slow down several times."""
    cases = defaultdict(list)
    for item in items:
        if item.get_closest_marker("few"):
            cases[item.parent, item.originalname].append(item)
    for found in cases.values():
        quick, slow = (*found[0].get_closest_marker("few").args, len(found))[:2]
        for item in set(found) - set(spread(found, quick)):
            item.add_marker("slow")
        others = [item for item in found if item.get_closest_marker("slow")]
        for item in set(others) - set(spread(others, slow)):
            item.add_marker("long")
    if config.pluginmanager.hasplugin("_cov"):
        for item in items:
            if item.get_closest_marker("slow") or item.get_closest_marker("long"):
                item.add_marker("no_cover")
