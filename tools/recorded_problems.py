"""The problems whose results `record_results.py` records: every kind of data, and what is asked of it.

Public names only, so that the same file also records another checkout. Data are random, drawn from a seed, or small
integers, which are full of coincidences (grazing contact, zero loads, singular selections, continua).
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

import enumsol
from enumsol import ContactProblem, ContactProblem3D, gallery

if TYPE_CHECKING:
    from collections.abc import Callable

#: What is computed of a case: the names of the results and the calls that make them.
Calls = dict[str, "Callable[[], Any]"]
Cases = dict[str, "Callable[[], Calls]"]

SMALL = (
    "one-node-6.1",
    "two-node-6.4",
    "two-node-6.6",
    "two-node-6.7-plus",
    "two-node-5",
    "chain-2",
    "chain-4-coupled",
)
LARGE = (
    *(
        "clamped-block-8",
        "clamped-block-32",
        "wedge-8-3",
        "wedge-8-5",
        "wedge-14-3",
        "wedge-14-5",
        "taper-8",
        "taper-14",
    ),
    *("dovetail-14", "brake-shoe-9", "clip-17", "pressed-rings-16", "lap-joint-9", "chain-4"),
)
SOLIDS = ("one-node-3d", "one-node-3d-3", "block3d-4", "block3d-9", "wedge3d-2-3", "wedge3d-4-3")
GRAPHS = (("one-node-6.1", 0, 6), ("one-node-6.3", 0, 4), ("two-node-6.4", 0, 10), ("two-node-6.7-minus", -1, 3))
LARGE_GRAPHS = (("wedge-8-5", 0, 4), ("taper-8", 0.05, 0.3), ("wedge-14-3", 0.5, 1.5), ("chain-2", 1, 4))
#: Seeds of random problems, most of which have several roots, and of integers, some degenerate.
SEEDS, INTEGER_SEEDS, SOLID_SEEDS, CURVE_SEEDS = (
    (0, 1, 5, 23, 24),
    (0, 1, 16, 23, 26, 56, 62),
    (0, 7, 20, 25),
    (0, 2, 4, 10),
)


def _plane(A: Any, f: Any, p: int, **more: Any) -> ContactProblem:
    rows = np.eye(len(A))
    return ContactProblem(0.5 * (A + A.T), rows[:p], rows[p : 2 * p], f, **more)


def _random(seed: int) -> ContactProblem:
    rng = np.random.default_rng([seed, 48])
    p = 2 + seed % 4
    B = rng.normal(size=(2 * p + 1, 2 * p + 1))
    friction = np.exp(rng.uniform(0, 3, size=p))
    return _plane(B @ B.T, 3 * rng.normal(size=2 * p + 1), p, friction=friction, friction_slope=0.25)


def _integers(seed: int) -> ContactProblem:
    rng = np.random.default_rng([seed, 49])
    p = 1 + seed % 3
    B = rng.integers(-2, 3, size=(2 * p, 2 * p))
    A = B @ B.T + np.eye(2 * p)
    if seed % 2:  # nodes that do not feel each other
        A = A * np.kron(np.ones((2, 2)), np.eye(p))
    return _plane(
        A, rng.integers(-3, 4, size=2 * p).astype(float), p, friction=rng.integers(0, 7, size=p).astype(float)
    )


def _continuum(seed: int) -> ContactProblem:
    """A root in a singular selection: with luck a continuum. Forces, displacements and data are integers."""
    rng = np.random.default_rng([seed, 52])
    p, eye = 2, np.eye(4)
    while True:
        B = rng.integers(-1, 2, size=(4, 4))
        A, F = (B @ B.T + np.eye(4)).astype(float), rng.integers(0, 5, size=p).astype(float)
        closed, slip = rng.integers(0, 2, size=p), rng.integers(-1, 2, size=p)
        normal, stuck = np.flatnonzero(closed), np.flatnonzero((closed == 1) & (slip == 0))
        columns = np.hstack([np.vstack([np.eye(p), np.diag(slip * F)])[:, normal], eye[:, p + stuck]])
        rows = np.concatenate([normal, p + stuck])
        if len(rows) and abs(np.linalg.det(np.linalg.inv(A)[rows] @ columns)) < 1e-12:
            break
    n = closed * rng.integers(0, 3, size=p)
    t = np.where(slip == 0, np.clip(rng.integers(-2, 3, size=p), -F * n, F * n), slip * F * n)
    w = np.concatenate([-(1 - closed), closed * slip * rng.integers(0, 3, size=p)])
    return ContactProblem(A, eye[:p], eye[p:], A @ w + np.concatenate([n, t]), friction=F)


def _odd() -> dict[str, ContactProblem]:
    """Degenerate ones, each of one kind."""
    square, block = gallery.two_node_square(), gallery.clamped_block(4, 2)
    A, Bn, Bt = (matrix.toarray() for matrix in (square.A, square.Bn, square.Bt))
    near = np.array([[1, 0], [1, 2.0**-20]])
    return {
        "zero load": square.replace(f=0 * square.f),
        "grazing": square.replace(f=A @ np.array([0.0, 0.5, -1.0, 0.25])),
        "no friction": square.replace(friction=0.0, friction_slope=0.0),
        "almost one node": ContactProblem(A, near @ Bn, near @ Bt, square.f, friction=2.0),
        "a gap": block.replace(gap=np.linspace(-0.1, 0.1, block.p)),
        "slip offset": block.replace(slip_offset=np.linspace(-0.1, 0.1, block.p)),
        "huge friction": block.replace(friction=50.0, friction_slope=0.0),
    }


def _spatial(S: Any, g: Any, friction: Any, **more: Any) -> ContactProblem3D:
    A, p = np.linalg.inv(S), len(S) // 3
    rows = np.eye(3 * p).reshape(3, p, 3 * p)
    return ContactProblem3D(0.5 * (A + A.T), *rows, A @ g, friction=friction, **more)


def _random_3d(seed: int) -> ContactProblem3D:
    rng = np.random.default_rng([seed, 50])
    p = 1 + seed % 2
    X, F = rng.normal(size=(3 * p, 3 * p)), 10 ** rng.uniform(0, 0.8, (2, p))
    return _spatial(X @ X.T + 0.1 * np.eye(3 * p), 2 * rng.normal(size=3 * p), tuple(F))


def _integers_3d(kind: str) -> ContactProblem3D:
    """A first node that grazes, or just sticks, beside one that sticks, without any rounding."""
    A = 4.0 * np.eye(6) + np.random.default_rng(1).integers(-2, 3, (6, 6)) / 8
    A = 0.5 * (A + A.T)
    lam = np.array([[0.0, 0, 0], [4, 1, -2]]) if kind == "graze" else np.array([[5.0, 3, 4], [4, 1, -2]])
    w = np.array([[0.0, 3, 4], [0, 0, 0]]) if kind == "graze" else np.zeros((2, 3))
    rows = np.eye(6)
    f = A @ np.ravel(w, order="F") + np.ravel(lam, order="F")
    return ContactProblem3D(A, rows[:2], rows[2:4], rows[4:], f, friction=1.0)


def _over_alpha_3d(seed: int) -> ContactProblem3D:
    rng = np.random.default_rng([seed, 51])
    X, F = rng.normal(size=(3, 3)), 10 ** rng.uniform(-0.2, 0.8, 1)
    problem = _spatial(X @ X.T + 0.1 * np.eye(3), rng.normal(size=3), (F, F))
    return problem.replace(load_slope=rng.normal(size=3), friction_slope=(0.5 * F, 0.5 * F))


def _in_space(plane: ContactProblem) -> ContactProblem3D:
    """A problem of one node in the plane, with a second tangent that nothing loads."""
    A, Bn, Bt = (matrix.toarray() for matrix in (plane.A, plane.Bn, plane.Bt))
    n, last = plane.n, np.eye(plane.n + 1)[-1:]
    rows = [np.hstack([matrix, np.zeros((1, 1))]) for matrix in (Bn, Bt)]
    wide = np.block([[A, np.zeros((n, 1))], [np.zeros((1, n)), np.eye(1)]])
    return ContactProblem3D(wide, *rows, last, np.append(plane.f, 0.0), friction=2.0)


def _pushed(nx: int = 2, ny: int = 1) -> ContactProblem:
    """A block on a table that is pushed: it slides at alpha = 1 and at -1."""
    rest, push = (gallery.block_on_table(nx, ny, push=push) for push in (0.0, 1.0))
    return rest.replace(load_slope=push.f - rest.f)


def _roots(problem: Any, alpha: float, *arithmetics: str, **options: Any) -> Calls:
    return {name: partial(enumsol.enumerate_roots, problem, alpha, name, **options) for name in arithmetics}


def _graph(problem: Any, low: float, high: float, arithmetic: str = "verified", **options: Any) -> Calls:
    return {arithmetic: partial(enumsol.branch_graph, problem, (low, high), arithmetic, **options)}


def _history(problem: Any, steps: Any, **options: Any) -> Calls:
    return {"history": partial(enumsol.histories, problem, steps, **options)}


def _follow(problem: Any, low: float, high: float) -> Any:
    return enumsol.follow_all(problem, (low, high))


def _map_rows(problem: ContactProblem, interval: tuple[float, float], over: dict[str, Any]) -> list[Any]:
    found = enumsol.multiplicity_map(problem, interval, over)
    rows = [[row.value, row.between, row.at_alphas, row.exact, row.complete, row.unique] for row in found.rows]
    return [rows, [[fold.alpha for fold in row.folds] for row in found.rows], len(found.curves)]


def _command(*words: str) -> Calls:
    return {"command": lambda: ("command", words)}


def _named(name: str, *arithmetics: str, **options: Any) -> Calls:
    entry = gallery.get(name)
    return _roots(entry.build(), entry.alpha, *arithmetics, **options)


def _plane_cases() -> Cases:
    found: Cases = {}
    every = ("verified", "exact", "fast")
    for names, arithmetics in ((SMALL, every), (LARGE, every[:1])):
        found |= {name: partial(_named, name, *arithmetics) for name in names}
    for name in ("one-node-6.3", "chain-6", "wedge-8-5"):
        found[f"{name}, fast"] = partial(_named, name, "fast")
    found["two-node-6.4, all selections"] = partial(_named, "two-node-6.4", "fast", "exact", method="exhaustive")
    found |= {f"random {k}": lambda k=k: _roots(_random(k), 0, *every) for k in SEEDS}
    found |= {f"integers {k}": lambda k=k: _roots(_integers(k), 0, *every) for k in INTEGER_SEEDS}
    found |= {f"singular selection {k}": lambda k=k: _roots(_continuum(k), 0, *every) for k in range(8)}
    for coupling in (0.0, 0.05):
        chain = partial(gallery.chain, 2, coupling, (1.0, -2.0))
        found[f"continua, {coupling}"] = lambda chain=chain: _roots(chain(), 2, *every)
    found |= {name: lambda name=name: _roots(_odd()[name], 2, *every) for name in _odd()}
    found["stopped wedge"] = partial(_named, "wedge-14-5", "verified", max_nodes=30)
    found["stopped after two"] = partial(_named, "wedge-8-5", "verified", stop_after=2)
    found["stopped continuum"] = lambda: _roots(gallery.chain(2, 0.0, (1.0, -2.0)), 2, "verified", max_nodes=8)

    found["block on a table"] = lambda: _roots(gallery.block_on_table(), 0, *every[:2])
    for push in (1.0, 1.1):
        found[f"block on a table, {push}"] = lambda push=push: _roots(
            gallery.block_on_table(2, 1, push=push), 0, *every[:2]
        )
    return found


def _solid_cases() -> Cases:
    found: Cases = {}
    found["block on a table in 3D"] = lambda: _roots(gallery.block_on_table3d(), 0, "verified")

    found |= {name: partial(_named, name, "verified") for name in SOLIDS}
    found |= {f"random in 3D {k}": lambda k=k: _roots(_random_3d(k), 0, "verified", "fast") for k in SOLID_SEEDS}
    for kind in ("graze", "limit"):
        found[f"{kind} in 3D"] = lambda kind=kind: _roots(_integers_3d(kind), 0, "verified", max_nodes=300)
    found["continuum in 3D"] = lambda: _roots(
        _in_space(gallery.one_node_triangle((1.0, -2.0))), 0, "verified", max_nodes=200
    )
    found["stopped in 3D"] = partial(_named, "wedge3d-4-3", "verified", max_nodes=10)
    return found


def _graph_cases() -> Cases:
    found: Cases = {}

    def graph(name: str, low: float, high: float, arithmetic: str = "verified", **options: Any) -> Calls:
        return _graph(gallery.get(name).build(), low, high, arithmetic, **options)

    for entry in GRAPHS:
        found[f"graph of {entry[0]}"] = lambda entry=entry: (
            graph(*entry) | graph(*entry, "exact") | graph(*entry, "fast")
        )
    found |= {f"graph of {entry[0]}": partial(graph, *entry) for entry in LARGE_GRAPHS}
    found |= {f"graph, random {k}": lambda k=k: _graph(_random(k), 0, 3) for k in SEEDS}
    found |= {
        f"graph, integers {k}": lambda k=k: _graph(_integers(k).replace(friction_slope=1.0), 0, 3)
        for k in INTEGER_SEEDS
    }
    found["graph through zero"] = lambda: _graph(
        gallery.one_node_triangle((0.0, 0.0)).replace(load_slope=[1.5, -4.0], friction=3.0, friction_slope=0.0), -1, 2
    )
    found["stopped graph"] = partial(graph, "wedge-8-5", 0, 4, max_nodes=20)
    found["graph of a pushed block"] = lambda: _graph(_pushed(), 0, 0.9)
    found["graph of a sliding block"] = lambda: _graph(_pushed(), 0, 2, "exact")
    found |= {
        f"graph in 3D, random {k}": lambda k=k: _graph(_over_alpha_3d(k), 0, 1, max_nodes=400) for k in CURVE_SEEDS
    }
    sliding = partial(_spatial, np.diag([1.0, 2.0, 4.0]), np.array([1.0, 3.0, 4.0]), 0.0, friction_slope=1.0)
    found["graph in 3D, from slip to stick"] = lambda: _graph(sliding(), 1.7, 1.9, max_nodes=200)
    return found


def _other_cases() -> Cases:
    found: Cases = {}
    triangle, square = gallery.one_node_triangle, gallery.two_node_square
    cycle = [enumsol.LoadStep(alpha, friction=3.0) for alpha in (0, 1, 0.5, -1, 1)]
    shaken = {"load_slope": [1.0, 0.5], "friction": 3.0, "friction_slope": 0.0}
    found["history of a node"] = lambda: _history(triangle().replace(**shaken), cycle)
    found["history of a node, exact"] = lambda: _history(triangle().replace(**shaken), cycle, arithmetic="exact")
    found["history of friction"] = lambda: _history(square(), [5, 4, 3, 2], refine=True)
    found["history of a wedge"] = lambda: _history(gallery.wedge(4, 4), [0.5, 1, 1.5])
    found["history in 3D"] = lambda: _history(_over_alpha_3d(0), [0, 0.5, 1])
    found["history of a pushed block"] = lambda: _history(_pushed(), [0, 0.5, 0.25], arithmetic="exact")

    found["paths"] = lambda: {"paths": partial(_follow, square(), 0, 6)}
    found["table"] = lambda: {
        "table": lambda: enumsol.multiplicity_table(square(), (1, 3.5, 5)).drop(columns="seconds")
    }
    found["map over the gap"] = lambda: {"map": partial(_map_rows, square(), (0, 5), {"gap": [0, 0.02, 0.1]})}
    for name in ("two-node-6.6", "one-node-3d", "block-on-table-5"):
        entry = gallery.get(name)
        found[f"fixed point of {name}"] = lambda entry=entry: {
            "fixed point": partial(enumsol.successive_approximations, entry.build(), entry.alpha),
            "lipschitz": partial(enumsol.lipschitz_estimate, entry.build(), entry.alpha),
        }

    wedge, two = "gallery:wedge-8-5", "gallery:two-node-6.4"
    for words in (
        ("roots", wedge, "--alpha", "3"),
        ("roots", wedge, "--alpha", "3", "--json", "-"),
        ("roots", wedge, "--alpha", "3", "--csv", "-"),
        ("roots", "gallery:one-node-3d-3", "--alpha", "0", "--json", "-"),
        ("roots", wedge, "--alpha", "1/3", "--unique"),
        ("graph", two, "--from", "0", "--to", "10"),
        ("graph", two, "--from", "0", "--to", "10", "--json", "-"),
        ("table", two, "--from", "0", "--to", "10", "--samples", "6"),
        ("history", "gallery:one-node-6.1", "--steps", "5,4,3"),
        ("fixed-point", two, "--alpha", "1"),
        ("gallery", "list"),
        ("roots", wedge),
        ("roots", "gallery:wedge-8-6", "--alpha", "3"),
    ):
        # whether verdicts are shown without being asked for depends on the clock
        untold = ("--no-stability",) if words[0] == "graph" else ()
        found["enumsol " + " ".join(words)] = partial(_command, *words, *untold)
    return found


def cases() -> Cases:
    """All cases by their names: functions that make the calls."""
    return _plane_cases() | _solid_cases() | _graph_cases() | _other_cases()


def timed() -> dict[str, Callable[[], Any]]:
    """What is timed, by names: functions without arguments, of some seconds at most."""

    def roots(name: str, arithmetic: str = "verified") -> Callable[[], Any]:
        entry = gallery.get(name)
        return lambda: enumsol.enumerate_roots(entry.build(), entry.alpha, arithmetic)

    def graph(problem: Callable[[], Any], low: float, high: float) -> Callable[[], Any]:
        return lambda: enumsol.branch_graph(problem(), (low, high))

    found = {name: roots(name) for name in ("wedge-20-5", "wedge-32-3", "chain-6", "wedge3d-4-9", "wedge3d-8-5")}
    found["chain-6-coupled, exact"] = roots("chain-6-coupled", "exact")
    for name, low, high in (("wedge-14-5", 0, 3), ("clamped-block-64", 0, 1), ("taper-14", 0.1, 0.3)):
        found[f"graph of {name}"] = graph(gallery.get(name).build, low, high)
    found["graph in 3D"] = graph(partial(_over_alpha_3d, 10), 0, 1)
    found["graph of a pushed block"] = graph(partial(_pushed, 6, 2), 0, 0.5)
    block = partial(gallery.clamped_block, 32, 4, 4.0, friction=0.5)
    found["history of a block"] = lambda: enumsol.histories(body := block(), [k * body.f for k in (1, 1.5, 2, 1, -0.5)])
    return found
