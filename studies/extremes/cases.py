"""The cases at one alpha: scales, friction, material, geometry, sizes, degeneracies, random mixtures, many roots."""

from __future__ import annotations

from fractions import Fraction
from functools import cache, partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from flint import fmpq

from enumsol import ContactProblem, branch_graph, enumerate_roots, fem, gallery
from extremes.judge import Case
from extremes.transformed import backwards, rescaled

if TYPE_CHECKING:
    from collections.abc import Iterator

SIZES = (1e-12, 1e-6, 1.0, 1e6, 1e12)
#: Small problems with several roots, at the alpha of their gallery entry.
SMALL = ("one-node-6.1", "two-node-6.4", "two-node-5", "wedge-8-3", "wedge-8-5")


def scales() -> Iterator[Case]:
    """Units of stiffness and load, together, per node and per degree of freedom, up to the range of float64."""
    for name in SMALL:
        entry = gallery.get(name)
        base, count = entry.build(), entry.roots
        make = partial(Case, alpha=entry.alpha, expected=count, oracle="exact")
        for stiffness in SIZES:
            for load in SIZES:
                change = partial(rescaled, base, stiffness, load)
                yield make("scales", f"{name}, stiffness {stiffness:g}, load {load:g}", change)
        for size in (1e-250, 1e-100, 1e100, 1e250):
            yield make("scales", f"{name}, load {size:g}", partial(rescaled, base, 1.0, size))
        for size in (1e-150, 1e150):
            yield make("scales", f"{name}, stiffness and load {size:g}", partial(rescaled, base, size, size))
        nodes = np.geomspace(1e-12, 1e12, base.p) if base.p > 1 else [1e12]
        dofs = np.geomspace(1e12, 1e-12, base.n)
        yield make("scales", f"{name}, contact rows 1e-12..1e12", partial(rescaled, base, nodes=nodes))
        yield make("scales", f"{name}, unknowns 1e-12..1e12", partial(rescaled, base, dofs=dofs))
        yield make("scales", f"{name}, all", partial(rescaled, base, 1e12, 1e-12, nodes, dofs))


def alphas() -> Iterator[Case]:
    """Alpha 0 and from 1e-14 to 1e14 on friction and loading paths, floats and fractions."""
    slope = ((0.1, -1.1), (0.2, -0.8))
    loading = partial(gallery.two_node_square, (0.4, 0.2), (1.8, -0.1), friction=4.0, load_slope=slope)
    friction = [gallery.get(name).build for name in ("one-node-6.1", "two-node-5", "clamped-block-8", "wedge-8-3")]
    for k, build in enumerate((*friction, loading)):
        yield Case("alpha", f"problem {k}, alpha 0", build, 0)
        for exponent in (-14, -12, -8, -4, 4, 8, 12, 14):
            yield Case("alpha", f"problem {k}, alpha 1e{exponent}", build, 10.0**exponent)
            yield Case("alpha", f"problem {k}, alpha 10^{exponent}", build, Fraction(10) ** exponent)
    for exponent in (-12, 3, 12):
        yield Case("alpha", f"loading, alpha -1e{exponent}", loading, -(10.0**exponent))


def frictions() -> Iterator[Case]:
    """Friction coefficients of very different size on neighbouring nodes."""
    rng = np.random.default_rng(11)

    def with_friction(base: ContactProblem, F: np.ndarray) -> ContactProblem:
        return ContactProblem(base.A, base.Bn, base.Bt, base.f, gap=base.gap, friction=F)

    for name in ("two-node-5", "chain-2-coupled", "chain-4-coupled"):
        base = gallery.get(name).build()
        for k in range(6):
            F = 10.0 ** rng.uniform(-12, 12, base.p)
            if k % 3 == 2:
                F[0] = 0.0
            yield Case("friction", f"{name}, {k}", partial(with_friction, base, F), 0, oracle="exhaustive")
    for name in ("wedge-8-3", "wedge-8-5", "clamped-block-8"):
        base = gallery.get(name).build()
        for k in range(4):
            F = 10.0 ** rng.uniform(-12, 12, base.p)
            yield Case("friction", f"{name}, {k}", partial(with_friction, base, F), 0)
    for name in ("wedge-14-3", "wedge-20-3", "clamped-block-16", "clamped-block-32", "clamped-block-64"):
        base = gallery.get(name).build()
        F = 10.0 ** rng.uniform(-12, 12, base.p)
        build = partial(with_friction, base, F)
        yield Case("friction", f"{name}, 1e-12..1e12", build, 0, "invariance", partner=backwards)


def _lame(nu: float) -> tuple[float, float]:
    return nu / ((1 + nu) * (1 - 2 * nu)), 0.5 / (1 + nu)


def materials() -> Iterator[Case]:
    """Poisson's ratio up to 0.5 - 1e-9: the stiffness loses as many digits as there are zeros."""
    for distance in (0.2, 1e-2, 1e-4, 1e-6, 1e-8, 1e-9):
        lame, name = _lame(0.5 - distance), f"nu = 0.5 - {distance:g}"
        yield Case("material", f"block 4x2, {name}", partial(gallery.clamped_block, 4, 2, lame=lame))
        yield Case("material", f"wedge 2x3, {name}", partial(gallery.wedge, 2, 3, lame=lame))
        large = {"oracle": "invariance", "partner": backwards}
        yield Case("material", f"block 16x8, {name}", partial(gallery.clamped_block, 16, 8, lame=lame), **large)
        yield Case("material", f"wedge 4x7, {name}", partial(gallery.wedge, 4, 7, lame=lame), **large)


def _mesh_block(x: np.ndarray, y: np.ndarray, friction: float = 1.0) -> ContactProblem:
    """A block on a grid of cells cut in two triangles, clamped at its left side, pressed and dragged at its top."""
    points = np.array([[a, b] for b in y for a in x])
    columns, rows = len(x), len(y)
    corners = [row * columns + k for row in range(rows - 1) for k in range(columns - 1)]
    triangles = [t for c in corners for t in ((c, c + 1, c + columns), (c + 1, c + columns + 1, c + columns))]
    top = [(rows - 1) * columns + k for k in range(columns)]
    return fem.contact_problem(
        points,
        triangles,
        (1.0, 1.0),
        contact=list(range(1, columns)),
        normals=(0.0, -1.0),
        held=[row * columns for row in range(rows)],
        forces=fem.edge_forces(points, list(pairwise(top)), (0.3, -1.0)),
        friction=friction,
    )


def _graded(cells: int, ratio: float) -> np.ndarray:
    """Points of (0, 1) whose cells grow from one end to the other by ``ratio`` in all."""
    widths = np.geomspace(1.0, ratio, cells)
    return np.concatenate([[0.0], np.cumsum(widths) / np.sum(widths)])


def geometries() -> Iterator[Case]:
    """Contact nodes next to each other, graded meshes, slender bodies."""
    for exponent in (2, 4, 6, 8, 9, 10):
        x = np.array([0.0, 0.4, 0.4 + 10.0**-exponent, 0.8, 1.0])
        yield Case("geometry", f"nodes 1e-{exponent} apart", partial(_mesh_block, x, np.array([0.0, 0.5, 1.0])))
    rng = np.random.default_rng(3)
    for exponent in (4, 6, 8, 10):
        rows, X, f = rng.normal(size=(4, 6)), rng.normal(size=(6, 8)), rng.normal(size=6)
        rows[1] = rows[0] + 10.0**-exponent * rows[1]
        rows[3] = rows[2] + 10.0**-exponent * rows[3]
        build = partial(ContactProblem, X @ X.T, rows[:2], rows[2:], f, friction=1.0)
        yield Case("geometry", f"contact rows within 1e-{exponent}", build, 0, "exhaustive")
    for ratio in (1e2, 1e4, 1e6, 1e8):
        for name, x in (("left", _graded(6, ratio)), ("right", 1.0 - _graded(6, ratio)[::-1])):
            build = partial(_mesh_block, x, np.linspace(0.0, 1.0, 3))
            yield Case("geometry", f"grading {ratio:g} to the {name}", build)
        build = partial(_mesh_block, _graded(20, ratio), _graded(8, ratio))
        yield Case("geometry", f"20x8 cells, grading {ratio:g}", build, 1.0, "invariance", partner=backwards)
    for length in (1e-6, 1e-3, 1e3, 1e6):
        yield Case("geometry", f"block of length {length:g}", partial(gallery.clamped_block, 4, 2, length))
    for angle in (1e-6, 1e-2, 79.0):
        yield Case("geometry", f"wedge of {angle:g} degrees", partial(gallery.wedge, 2, 3, half_angle=angle))


def weakly_held() -> Iterator[Case]:
    """Bodies that are almost free to move as rigid ones: springs down to 1e-15 of the body's stiffness."""
    for exponent in (2, 4, 6, 8, 10, 12, 15):
        springs = (10.0**-exponent, 10.0**-exponent)
        name = f"springs 1e-{exponent}"
        yield Case("weakly held", f"wedge 2x3, {name}", partial(gallery.wedge, 2, 3, springs=springs))
        for nx, ny in ((4, 7), (8, 16)) if exponent in (2, 4, 12) else ():
            build = partial(gallery.wedge, nx, ny, springs=springs)
            yield Case("weakly held", f"wedge {nx}x{ny}, {name}", build, 1.0, "invariance", partner=backwards)


def sizes() -> Iterator[Case]:
    """Contact nodes from 1 to 100."""
    twin = {"oracle": "invariance", "partner": backwards}
    for p in (1, 2, 4, 8, 16, 32, 64, 100):
        build = partial(gallery.clamped_block, p, max(p // 2, 1))
        yield Case("size", f"clamped block, p = {p}", build, 3.0, expected=1, **twin)
    for p in (2, 8, 14, 20, 32):
        build = partial(gallery.wedge, 4, p // 2)
        yield Case("size", f"wedge, p = {p}", build, 1.0, expected=3 if p >= 8 else None, **twin)


def _six_three(d: float | Fraction, F0: float = 2.0) -> ContactProblem:
    """The paper's Example 6.3 with the friction at which its two branches meet; f_n = 1 + alpha is off by alpha."""
    del d
    return ContactProblem(
        gallery.one_node_triangle().A, [[1.0, 0.0]], [[0.0, 1.0]], [1.0, -2.0], friction=F0, load_slope=[1.0, 0.0]
    )


def distances() -> Iterator[Case]:
    """Loads and friction at distances 1e0 to 1e-20 from a bifurcation, a fold or a transition, and exactly there."""
    exactly = [Fraction(0)]
    near = [sign * Fraction(1, 10**k) for k in range(21) for sign in (1, -1)]
    for d in exactly + near:
        yield Case("distance", f"load off 6.3 by {float(d):+.0e}", partial(_six_three, d), d, "exhaustive")
        for name, at in (
            ("one-node-6.3", Fraction(2)),
            ("one-node-6.1", Fraction(8, 3)),
            ("two-node-6.4", Fraction(3)),
        ):
            if at + d >= 0:
                build = gallery.get(name).build
                yield Case("distance", f"{name}, alpha = {at} {float(d):+.0e}", build, at + d, "exhaustive")
    for k in range(0, 17, 2):
        for sign in (1, -1):
            f = (1.0 + sign * 10.0**-k, -2.0)
            build = partial(gallery.one_node_triangle, f)
            yield Case("distance", f"f_n = 1 {sign:+d}e-{k}", build, 2, "exhaustive")
    # too large for rationals: where the distance is below the bounds' accuracy this must stay open
    build = partial(gallery.clamped_block, 16, 8)
    at = _change_of_status(build)
    for k in (3, 6, 9, 12, 14, 16, 18):
        alpha = at + Fraction(1, 10**k)
        yield Case("distance", f"block 16x8, change of status + 1e-{k}", build, alpha, "invariance", partner=backwards)
    yield Case("distance", "block 16x8, change of status", build, at, "invariance", partner=backwards)


def _change_of_status(build: partial[ContactProblem]) -> Fraction:
    """An alpha within rounding of one at which the one root changes a status, by bisection."""
    problem = build()

    def statuses(alpha: Fraction) -> object:
        # without a tolerance rounding may leave no root at all right there
        found = enumerate_roots(problem, alpha, "fast", tolerance=0.0)
        return found[0].statuses if len(found) else None

    low, high = Fraction(1, 10), Fraction(2)
    first = statuses(low)
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if statuses(middle) == first else (low, middle)
    return high


@cache
def _critical(name: str, seed: int) -> tuple[ContactProblem, tuple[tuple[str, float, Fraction, Fraction], ...]]:
    """A problem, and its critical alphas: their kind, the nearest float and rationals within 1e-25 on both sides."""
    if name:
        problem = gallery.get(name).build()
    else:
        rng = np.random.default_rng(seed)
        p = 2 + seed % 2
        X = rng.normal(size=(2 * p, 2 * p + 2))
        f = rng.normal(size=2 * p)
        f[:p] += 1.0
        problem = ContactProblem(X @ X.T, np.eye(2 * p)[:p], np.eye(2 * p)[p:], 3 * f)
    graph = branch_graph(problem, (0.0, 20.0), "exact")
    inner = [vertex for vertex in graph.vertices if not vertex.border]
    return problem, tuple((v.kind, v.alpha, *_around(v.exact, v.alpha)) for v in inner)


def _around(exact: Any, alpha: float) -> tuple[Fraction, Fraction]:
    """Rationals below and above an algebraic alpha, at most 1e-25 apart; equal where it is a float."""
    exact.minimal_polynomial()  # finds out whether it is rational
    exact.narrow(fmpq(1, 10**25))
    low, high = exact.enclosure()
    if low == high and low != Fraction(alpha):
        half = Fraction(1, 2 * 10**25)
        return low - half, high + half
    return low, high


def samples() -> Iterator[Case]:
    """A sample at a transition, a fold or a singular selection: the nearest floats, and rationals within 1e-25."""
    sources = [("two-node-6.4", 0), ("two-node-5", 0), ("one-node-6.3", 0)] + [("", seed) for seed in range(8)]
    for name, seed in sources:
        problem, critical = _critical(name, seed)
        for k, (kind, alpha, low, high) in enumerate(critical):
            label = f"{name or f'random {seed}'}, {kind} {k}"
            places = {
                "float": alpha,
                "float before": float(np.nextafter(alpha, -1.0)),
                "float after": float(np.nextafter(alpha, 100.0)),
                "1e-25 before": low,
                "1e-25 after": high,
            }
            for place, value in places.items():
                yield Case("sample", f"{label}, {place}", lambda problem=problem: problem, value, "exhaustive")


def loads() -> Iterator[Case]:
    """No load, grazing contact, gaps and press fits of very different size."""
    for cells in (3, 16):
        build = partial(gallery.clamped_block, cells, 2, traction=(0.0, 0.0))
        yield Case("load", f"no load, block of {cells}", build, 1.0, "exact", 1)
    path = partial(
        ContactProblem, np.eye(2), [[1.0, 0.0]], [[0.0, 1.0]], [1.0, -1.0], friction=0.5, load_slope=[-3.0, 3.0]
    )
    for name, alpha in (
        ("1/3", Fraction(1, 3)),
        ("float 1/3", 1 / 3),
        ("1/3 + 1e-20", Fraction(1, 3) + Fraction(1, 10**20)),
    ):
        yield Case("load", f"no load at {name}", path, alpha, "exhaustive")
    inner = partial(ContactProblem, np.eye(4), [[1.0, 0, 0, 0]], [[0.0, 1, 0, 0]], [0.0, 0.0, 1.0, 2.0], friction=1.0)
    yield Case("load", "load that leaves the contact at rest", inner, 0, "exhaustive")
    for gap in (-1e12, -1.0, -1e-12, -1e-300, 1e-300, 1e-12, 1e-6, 1e12):
        yield Case("load", f"gap {gap:g}", partial(gallery.clamped_block, 4, 2, gap=gap))
        yield Case("load", f"press {-gap:g}", partial(gallery.wedge, 2, 3, press=-gap))
    rng = np.random.default_rng(9)
    base = gallery.clamped_block(4, 2)
    for k in range(12):
        gap = 10.0 ** rng.uniform(-16, 4, 4) * rng.choice([-1.0, 0.0, 1.0], 4)
        offset = 10.0 ** rng.uniform(-16, 2, 4) * rng.choice([-1.0, 0.0, 1.0], 4)
        build = partial(ContactProblem, base.A, base.Bn, base.Bt, base.f, gap, 1.0, None, offset)
        yield Case("load", f"gaps and slip offsets 1e-16..1e4, {k}", build, 0, "exhaustive" if k < 6 else "exact")
    for k, f in enumerate(
        ((0.0, 1.0), (0.0, -1.0), (0.0, 5e-324), (5e-324, 0.0), (1.0, 1e-300), (1.0, 0.0), (-1.0, 0.0))
    ):
        for F in (0.0, 1.0, 1e-300, 1e300):
            build = partial(ContactProblem, np.eye(2), [[1.0, 0.0]], [[0.0, 1.0]], f, friction=F)
            yield Case("load", f"grazing {k}, F = {F:g}", build, 0, "exhaustive")


def mixtures(seeds: range = range(150)) -> Iterator[Case]:
    """Random problems, regular and degenerate, with several of these at once."""
    for seed in seeds:
        yield Case("mixture", f"seed {seed}", partial(mixture, seed), 0, "exhaustive")


def mixture(seed: int) -> ContactProblem:
    """A random problem with p up to 3: small integers or normal variates, scaled at random."""
    rng = np.random.default_rng(seed)
    p = int(rng.integers(1, 4))
    if rng.random() < 0.5:
        X = rng.integers(-1, 2, size=(2 * p, 2 * p))
        A = X @ X.T + np.eye(2 * p) * int(rng.integers(1, 3))
        f, F = rng.integers(-2, 3, size=2 * p).astype(float), rng.integers(0, 4, size=p).astype(float)
    else:
        X = rng.normal(size=(2 * p, 2 * p + int(rng.integers(1, 4))))
        A, f, F = X @ X.T, rng.normal(size=2 * p), 10.0 ** rng.uniform(-1, 1, p)
        f[:p] += 1.0
    if rng.random() < 0.4:
        F = F * 10.0 ** rng.uniform(-12, 12, p)
    gap = 10.0 ** rng.uniform(-14, 6, p) * rng.choice([-1.0, 0.0, 0.0, 1.0], p)
    base = ContactProblem(A, np.eye(2 * p)[:p], np.eye(2 * p)[p:], f, gap=gap, friction=F)
    stiffness, load = 10.0 ** rng.uniform(-12, 12, 2)
    nodes = np.ldexp(1.0, rng.integers(-40, 41, p)) if rng.random() < 0.5 else None
    dofs = np.ldexp(1.0, rng.integers(-20, 21, 2 * p)) if rng.random() < 0.5 else None
    return rescaled(base, stiffness, load, nodes, dofs)


def many_roots() -> Iterator[Case]:
    """Thousands of roots: separate and coupled one-node triangles."""
    for p, coupling in ((6, 0.0), (7, 0.0), (8, 0.0), (6, 0.05), (7, 0.05)):
        name = f"chain of {p}, coupling {coupling:g}"
        yield Case("many roots", name, partial(gallery.chain, p, coupling), 5.0, "closed form", 3**p)


GROUPS = (
    scales,
    alphas,
    frictions,
    materials,
    weakly_held,
    geometries,
    sizes,
    distances,
    samples,
    loads,
    mixtures,
    many_roots,
)
