"""Comparison of a RootSet with another one or with an oracle; every function returns what differs, or an empty list."""

import numpy as np
from oracles import NAMES
from oracles3d import newton_set
from problems3d import unmatched

from enumsol import enumerate_roots, verify

METHODS = (("fast", "tree"), ("fast", "exhaustive"), ("exact", "tree"), ("exact", "exhaustive"))


def forces(root):
    return np.concatenate([root.lambda_n, root.lambda_t])


def statuses(roots):
    """Set of status tuples (values)."""
    return {tuple(s.value for s in root.statuses) for root in roots}


def differences(one, two, rtol=1e-7):
    """What differs between two root sets of one problem: roots, statuses, active sets, indices, families."""
    out = []
    if len(one) != len(two) or len(one.families) != len(two.families):
        return [f"{len(one)} + {len(one.families)} against {len(two)} + {len(two.families)} roots and families"]
    for k, (a, b) in enumerate(zip(one, two, strict=True)):
        if a.active != b.active or a.statuses != b.statuses or a.index != b.index or a.regular != b.regular:
            out.append(f"root {k}: {a.statuses} {a.index} against {b.statuses} {b.index}")
        size = np.max(np.abs(forces(b)))
        if not np.allclose(forces(a), forces(b), rtol=rtol, atol=1e-2 * rtol * size):
            out.append(f"root {k}: {forces(a)} against {forces(b)}")
    for k, (a, b) in enumerate(zip(one.families, two.families, strict=True)):
        if a.index != b.index or a.dimension != b.dimension or a.vertices.shape != b.vertices.shape:
            out.append(f"family {k}: index {a.index}, {b.index}; {a.vertices.tolist()} against {b.vertices.tolist()}")
        elif not np.allclose(a.vertices, b.vertices, rtol=rtol, atol=1e-2 * rtol * np.max(np.abs(b.vertices))):
            out.append(f"family {k}: {a.vertices.tolist()} against {b.vertices.tolist()}")
    return out


def differences_from_brute_force(roots, found):
    """What differs from the brute-force oracle on a problem whose roots are all regular."""
    want = sorted(found, key=lambda root: [NAMES[code] for code in root.codes])
    if len(roots) != len(want) or roots.families or roots.undecided:
        return [f"{roots!r}\nwhere brute force finds {[root.codes for root in want]}"]
    out = []
    for k, (a, b) in enumerate(zip(roots, want, strict=True)):
        names = tuple(NAMES[code] for code in b.codes)
        if tuple(s.value for s in a.statuses) != names or not a.regular:
            out.append(f"root {k}: {a.statuses}, regular {a.regular}, against {names}")
        if a.index != b.sign:
            out.append(f"root {k}: index {a.index} against {b.sign}")
        if not np.allclose(forces(a), b.forces, rtol=1e-6, atol=1e-8 * np.max(np.abs(b.forces), initial=0.0)):
            out.append(f"root {k}: {forces(a)} against {b.forces}")
    return out


def differences_from_exact(roots, components, indices):
    """What differs from the rational oracle: isolated roots, families, statuses that hold, indices."""
    p = len(roots.node_ids)
    tolerance = 0.0 if roots.arithmetic == "exact" else 1e-9
    isolated = [pair for pair in zip(components, indices, strict=True) if pair[0].dimension == 0]
    continua = [pair for pair in zip(components, indices, strict=True) if pair[0].dimension > 0]
    if len(roots) != len(isolated) or len(roots.families) != len(continua):
        return [f"{roots!r}\nagainst {len(isolated)} roots and {len(continua)} families"]
    out = []
    for root in roots:
        match = [pair for pair in isolated if _near([forces(root)], pair[0].vertices, tolerance)]
        if len(match) != 1:
            out.append(f"no such root: {forces(root)}")
            continue
        active = tuple(frozenset(s.value for s in holds) for holds in root.active)
        if active != match[0][0].active(p) or root.index != match[0][1]:
            out.append(f"{forces(root)}: {active}, {root.index}, against {match[0][0].active(p)}, {match[0][1]}")
    for family in roots.families:
        points = family.vertices.transpose(0, 2, 1).reshape(len(family.vertices), 2 * p)
        match = [pair for pair in continua if _near(points, pair[0].vertices, tolerance)]
        if len(match) != 1:
            out.append(f"no such family: {points.tolist()}")
        elif family.dimension != match[0][0].dimension or family.index != match[0][1]:
            out.append(f"family: dimension {family.dimension}, index {family.index} against {match[0][1]}")
    return out


def assert_as_exhaustive(problem, alpha, roots):
    """A complete and proven list of roots is that of all selections in rationals, which is returned."""
    exact = enumerate_roots(problem, alpha, "exact", "exhaustive")
    assert roots.complete
    assert (len(roots), len(roots.families)) == (len(exact), len(exact.families))
    assert [(root.active, root.index) for root in roots] == [(root.active, root.index) for root in exact]
    assert verify(problem, roots.proof).complete
    return exact


def assert_same_in_space(problem, roots, plain, data, seed):
    """Roots in 3D are those of another search, and all that Newton's method finds for S, g and F; their proof holds."""
    assert roots.complete
    assert plain.complete
    assert (len(roots), roots.index_sum) == (len(plain), 1)
    assert [root.statuses for root in roots] == [root.statuses for root in plain]
    missed, _ = unmatched(list(roots), newton_set(*data, 20, np.random.default_rng(seed)))
    assert not missed
    report = verify(problem, roots.proof)
    assert (report.complete, report.roots) == (True, len(roots)), report


def _near(points, vertices, tolerance):
    """Whether two sets of points agree one to one."""
    exact = np.array(sorted(vertices), dtype=float)
    if len(points) != len(exact):
        return False
    nearest = [int(np.argmin(np.max(np.abs(exact - q), axis=1))) for q in np.asarray(points)]
    scale = tolerance * max(float(np.max(np.abs(exact))), 1.0)
    return sorted(nearest) == list(range(len(exact))) and all(
        np.max(np.abs(exact[k] - q)) <= scale for k, q in zip(nearest, points, strict=True)
    )
