"""Problems at a known distance from a degeneracy, with their exact answers.

Two kinds of degeneracy. In "alpha" the exact branch graph gives the values at which statuses change (transitions,
folds, bifurcations, continua), as algebraic numbers; alpha is put at a chosen distance from one of them, as a rational
number, so that the distance is right however small it is. In "two nodes" the rows of one contact node are moved
towards those of another: the distance is theirs, and the condition of S grows like its inverse square.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, partial
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from flint import fmpq

from enumsol import ContactProblem, InvalidProblemError, branch_graph, enumerate_roots, gallery
from enumsol.arithmetic.algebraic import merge
from shared.random_paths import integer_path, random_path

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from enumsol import BranchGraph, RootSet

#: Distances, the last one exactly on the degeneracy.
DISTANCES = (*(Fraction(1, 10**k) for k in range(17)), Fraction(0))
#: Distances of the two contact nodes. Soon below 1e-6 float64 takes S for singular and the program refuses the problem.
NODE_DISTANCES = DISTANCES[:7]
SMOKE_DISTANCES, SMOKE_NODE_DISTANCES = (*DISTANCES[:15:7], Fraction(0)), (DISTANCES[0], DISTANCES[6])
#: An irrational critical alpha is known to this width, far below the smallest distance.
WIDTH = fmpq(1, 2**90)
#: Critical alphas tried on one path.
EVENTS_PER_PATH = 4
RAREST = ("family", "bifurcation", "touch", "point", "sheet", "fold", "transition")
#: Degrees of freedom of a separate spring body that makes a small problem too large for rational arithmetic.
PADDING = 251
#: Values of alpha for problems with two close nodes, as parts of the interval.
PLACES = (0.236068, 0.5, 0.618034, 0.854102)


class Scene:
    """A problem over an interval of alpha, its exact branch graph, and the variants of it that settings need.

    ``events`` is the number of critical alphas that are tried, those of the rarest kinds first.
    """

    def __init__(
        self, name: str, problem: ContactProblem, interval: tuple[float, float], events: int = EVENTS_PER_PATH
    ) -> None:
        self.name, self.problem, self.interval, self.events = name, problem, interval, events

    @cached_property
    def graph(self) -> BranchGraph:
        """The branch graph in rational arithmetic."""
        return branch_graph(self.problem, self.interval, "exact")

    @cached_property
    def single(self) -> ContactProblem:
        """The problem with S and g condensed in float32 from data rounded to float32."""
        return in_single(self.problem)

    @cached_property
    def padded(self) -> ContactProblem:
        """The problem beside springs that touch nothing: same S and g, too many degrees of freedom for rationals."""
        return padded(self.problem, PADDING)


@dataclass(frozen=True)
class Case:
    """A scene at one alpha, at a known distance from a degeneracy, and all its solutions."""

    scene: Scene
    alpha: Fraction
    distance: Fraction
    degeneracy: str
    kind: str
    exact: RootSet

    @property
    def load(self) -> NDArray[np.float64]:
        """Load at alpha."""
        return self.scene.problem.load_at(self.alpha)


def padded(problem: ContactProblem, count: int) -> ContactProblem:
    """The problem with so many more degrees of freedom, each held by a spring of its own and not loaded."""

    def wider(B: sp.csr_array) -> sp.csr_array:
        return sp.hstack([B, sp.csr_array((problem.p, count))], format="csr")

    A = sp.block_diag([problem.A, sp.eye_array(count)], format="csc")
    zeros = np.zeros(count)
    slope = None if problem.load_slope is None else np.concatenate([problem.load_slope, zeros])
    f, gap, offset = np.concatenate([problem.f, zeros]), problem.gap, problem.slip_offset
    return ContactProblem(A, wider(problem.Bn), wider(problem.Bt), f, gap, *problem.affine_friction, slope, offset)


def in_single(problem: ContactProblem) -> ContactProblem:
    """A problem in the forces alone whose condensed data are S, g0 and g1 in float32 arithmetic from float32 data.

    Its stiffness is the inverse of that S in float64, which differs from it by far less than float32 can tell.

    Raises
    ------
    InvalidProblemError
        That S is not positive definite.
    """
    A = problem.A.toarray().astype(np.float32)
    B = np.vstack([problem.Bn.toarray(), problem.Bt.toarray()]).astype(np.float32)
    offset = np.concatenate([problem.gap, problem.slip_offset]).astype(np.float32)
    slope = np.zeros(problem.n) if problem.load_slope is None else problem.load_slope
    S = B @ np.linalg.solve(A, B.T)
    g0 = B @ np.linalg.solve(A, problem.f.astype(np.float32)) - offset
    g1 = B @ np.linalg.solve(A, slope.astype(np.float32))
    S = (0.5 * (S + S.T)).astype(float)
    try:
        np.linalg.cholesky(S)
        K = np.linalg.inv(S)
    except np.linalg.LinAlgError as error:
        raise InvalidProblemError("S in float32 is not positive definite") from error
    K = 0.5 * (K + K.T)
    eye = np.eye(2 * problem.p)
    rows = eye[: problem.p], eye[problem.p :]
    return ContactProblem(
        K, *rows, K @ g0, friction=problem.friction, friction_slope=problem.friction_slope, load_slope=K @ g1
    )


# -- scenes --------------------------------------------------------------------------------------------------------


def one_node(f: tuple[float, float], slope: tuple[float, float], F: float) -> ContactProblem:
    """One node with a loading path; F = 2 and f along (1, -2) make a continuum."""
    return ContactProblem([[2, -1], [-1, 2]], [[1, 0]], [[0, 1]], f, friction=F, load_slope=slope)


def planted_family(seed: int, p: int) -> ContactProblem:
    """Small integer data with a continuum of solutions at alpha = 0 of a loading path, found by trial."""
    rng = np.random.default_rng([seed, p, 7])
    while True:
        X = rng.integers(-1, 2, size=(2 * p, 2 * p))
        A = X @ X.T + np.eye(2 * p) * int(rng.integers(1, 3))
        F = rng.integers(1, 5, size=p).astype(float)
        slip = rng.integers(-1, 2, size=p)
        # every node is in contact: it slips to a side, or sticks and brings a column and a row of its own
        stick = np.flatnonzero(slip == 0)
        columns = np.hstack([np.vstack([np.eye(p), np.diag(slip * F)]), np.eye(2 * p)[:, p + stick]])
        rows = np.concatenate([np.arange(p), p + stick])
        if abs(np.linalg.det(np.linalg.inv(A)[rows] @ columns)) > 1e-12:
            continue
        n = rng.integers(1, 3, size=p)
        w = np.concatenate([np.zeros(p), rng.integers(1, 3, size=p) * slip])
        f = A @ w + np.concatenate([n, slip * F * n])
        eye = np.eye(2 * p)
        problem = ContactProblem(
            A, eye[:p], eye[p:], f, friction=F, load_slope=rng.integers(-2, 3, size=2 * p).astype(float)
        )
        if enumerate_roots(problem, 0, "exact").families:
            return problem


def scenes(*, smoke: bool = False) -> Iterator[Scene]:
    """Gallery, hand-made, random and integer paths with p = 1 to 4, and a wedge with p = 8; one of each when smoke."""
    if smoke:
        yield Scene("one-node-6.1", gallery.get("one-node-6.1").build(), (0.0, 10.0))
        yield Scene("planted 0, p = 1", planted_family(0, 1), (-3.0, 3.0))
        yield from islice(eventful("integer, p = 1", partial(integer_path, p=1)), 1)
    else:
        yield from known_scenes()
        yield from random_scenes()


def known_scenes() -> Iterator[Scene]:
    """Problems of the gallery, and two loads made to lead through a continuum and a fold."""
    for name in ("one-node-6.1", "one-node-6.2", "one-node-6.3", "one-node-6.3-perturbed"):
        yield Scene(name, gallery.get(name).build(), (0.0, 10.0))
    for name in ("two-node-6.4", "two-node-6.5", "two-node-6.6", "two-node-5", "chain-2", "chain-2-coupled"):
        yield Scene(name, gallery.get(name).build(), (0.0, 10.0))
    for name in ("two-node-6.7-minus", "two-node-6.7-plus"):
        yield Scene(name, gallery.get(name).build(), (-3.0, 3.0))
    # dear in rationals: few events
    yield Scene("chain-4-coupled", gallery.get("chain-4-coupled").build(), (0.0, 10.0), events=1)
    yield Scene("wedge-8-5", gallery.get("wedge-8-5").build(), (1.0, 4.0), events=2)
    yield Scene("chain-2 at a continuum", gallery.chain(2, f=(1, -2)), (0.0, 10.0))
    yield Scene("chain-2-coupled at a continuum", gallery.chain(2, 0.125, f=(1, -2)), (0.0, 10.0))
    yield Scene("one node, load through a continuum", one_node((1, -3), (0, 1), 2), (-3.0, 3.0))
    yield Scene("one node, load through a fold", one_node((1, -4), (1, 1), 3), (-3.0, 3.0))


def random_scenes() -> Iterator[Scene]:
    """Planted continua, random paths and integer paths."""
    for p, seeds in ((1, 2), (2, 5), (3, 4)):
        for seed in range(seeds):
            yield Scene(f"planted {seed}, p = {p}", planted_family(seed, p), (-3.0, 3.0))
    for p, count in ((1, 3), (2, 4), (3, 4), (4, 4)):
        for loading in (False, True):
            build = partial(random_path, p=p, loading=loading)
            kind = "loading" if loading else "friction"
            yield from islice(eventful(f"random {kind}, p = {p}", build), count)
    for p, count in ((1, 2), (2, 4), (3, 4)):
        yield from islice(eventful(f"integer, p = {p}", partial(integer_path, p=p)), count)


def eventful(name: str, build: partial[tuple[ContactProblem, tuple[float, float]]]) -> Iterator[Scene]:
    """Random scenes on whose way statuses change."""
    for seed in range(1000):
        scene = Scene(f"{name}, seed {seed}", *build(seed))
        if any(not vertex.border for vertex in scene.graph.vertices):
            yield scene


# -- cases ---------------------------------------------------------------------------------------------------------


def cases(*, smoke: bool = False) -> Iterator[Case]:
    """All cases: scenes near their events, then two close nodes."""
    for scene in scenes(smoke=smoke):
        yield from near_events(scene, SMOKE_DISTANCES if smoke else DISTANCES)
    yield from close_nodes((2,), 1, SMOKE_NODE_DISTANCES) if smoke else close_nodes((2, 3, 4), 3, NODE_DISTANCES)


def near_events(scene: Scene, distances: Sequence[Fraction]) -> Iterator[Case]:
    """The scene at all distances from some of its events, on both sides, where no other event is as near."""
    events = events_of(scene.graph)
    low, high = scene.graph.exact_interval
    chosen = sorted(events, key=lambda event: RAREST.index(event[1]))[: scene.events]
    for centre, kind, is_rational in chosen:
        others = [other for other, *_ in events if other != centre]
        unit = max(Fraction(1), abs(centre))
        for distance in distances:
            if distance == 0 and not is_rational:
                continue
            for side in (-1, 1) if distance else (0,):
                alpha = centre + side * distance * unit
                if low < alpha < high and all(abs(alpha - other) > distance * unit for other in others):
                    exact = enumerate_roots(scene.problem, alpha, "exact")
                    # on a grazing arc or a sheet every alpha is degenerate
                    if distance == 0 or (all(root.regular for root in exact) and not exact.families):
                        yield Case(scene, alpha, distance, "alpha", kind, exact)


def events_of(graph: BranchGraph) -> list[tuple[Fraction, str, bool]]:
    """(alpha, rarest kind there, whether alpha is rational) of all critical alphas inside the interval."""
    inner = [v for v in graph.vertices if not v.border]
    found = []
    for group in merge([v.exact for v in inner]):
        kinds = [v.kind for v in inner if any(v.exact is number for number in group)]
        number = group[0]
        number.minimal_polynomial()  # finds out whether it is rational
        number.narrow(WIDTH)
        lo, hi = number.enclosure()
        found.append(((lo + hi) / 2, min(kinds, key=RAREST.index), number.is_rational))
    return found


def close_nodes(sizes: Sequence[int], seeds: int, distances: Sequence[Fraction]) -> Iterator[Case]:
    """Random problems two of whose nodes are nearly the same, the distance of their rows being given."""
    for p in sizes:
        for loading in (False, True):
            for seed in range(seeds):
                problem, interval = random_path(seed, p, loading=loading)
                for distance in distances:
                    yield from at_places(with_close_nodes(problem, float(distance)), interval, distance)


def with_close_nodes(problem: ContactProblem, distance: float) -> ContactProblem:
    rows = [np.array(B.toarray()) for B in (problem.Bn, problem.Bt)]
    for B in rows:
        B[1] = B[0] + distance * B[1]
    return ContactProblem(
        problem.A,
        *rows,
        problem.f,
        friction=problem.friction,
        friction_slope=problem.friction_slope,
        load_slope=problem.load_slope,
    )


def at_places(problem: ContactProblem, interval: tuple[float, float], distance: Fraction) -> Iterator[Case]:
    scene = Scene(f"two nodes {float(distance):g} apart", problem, interval)
    for place in PLACES:
        alpha = Fraction(interval[0] + place * (interval[1] - interval[0]))
        exact = enumerate_roots(problem, alpha, "exact")
        yield Case(scene, alpha, distance, "two nodes", "close nodes", exact)
