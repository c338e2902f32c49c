"""The ascent that finds forms in 3D (theory, section 12.2)."""

import numpy as np
import pytest
from problems3d import from_compliance

from enumsol.model.statuses import UNDECIDED
from enumsol.relaxation.space_convex_forms import SpaceFormAscent
from enumsol.search.space.space_setup import SpaceSolvers


def begun(seed, p=2):
    """Solvers, an ascent, and the rows of the root of the tree."""
    rng = np.random.default_rng(seed)
    X, F = rng.normal(size=(3 * p, 3 * p)), rng.uniform(0.3, 1.0, (p, 2))
    S, g = X @ X.T + np.eye(3 * p), np.concatenate([rng.uniform(0.5, 1.0, p), rng.normal(size=2 * p)])
    F[0, 1] = 0.0 if seed % 2 else F[0, 1]
    solvers = SpaceSolvers(from_compliance(S, g, (F[:, 0], F[:, 1])), 0.0, "verified")
    search = solvers.search(solvers.certifier(None))
    rows = search._rows.over((UNDECIDED,) * p, range(p))
    return solvers, SpaceFormAscent(search.engine, solvers.enclosed), rows


@pytest.mark.parametrize("seed", range(2))
def test_derivatives_are_those_of_what_is_maximised(seed):
    solvers, ascent, rows = begun(seed)
    p, size, rng = 2, len(solvers.system.g), np.random.default_rng(seed)
    numbers = np.concatenate([rng.uniform(0.9, 1.1, 2 * p), rng.uniform(-0.1, 0.1, size - p)])
    live, shares, scale = ascent._live, ascent._shares, 3.0

    def value(numbers):
        found = ascent._candidate(numbers, rows)
        return scale * found.relaxation.bound + 2.0 * np.sum(np.log(np.diagonal(found.factor)))

    def derivatives(numbers):
        found = ascent._candidate(numbers, rows)
        normals, forces = ascent._normals(found.relaxation), found.relaxation.forces
        one, two = ascent._products.derivatives(found.form.H, found.factor, forces, scale, normals, np.eye(size))
        return shares @ one, shares @ two @ shares.T

    gradient, hessian = derivatives(numbers)
    for place, step in enumerate(1e-6 * np.eye(size + p)[live]):
        assert gradient[place] == pytest.approx((value(numbers + step) - value(numbers - step)) / 2e-6, abs=1e-5)
        change = (derivatives(numbers + step)[0] - derivatives(numbers - step)[0]) / 2e-6
        assert -hessian[place] == pytest.approx(change, rel=1e-3, abs=1e-3)


@pytest.mark.parametrize("seed", range(2))
def test_the_form_is_convex_tighter_than_the_energy_and_of_its_curvature(seed):
    solvers, ascent, rows = begun(seed)
    form, relaxation = ascent.ascended(rows)
    assert form.smallest_eigenvalue > 0
    curvatures = np.linalg.eigvals(np.linalg.solve(solvers.system.S, form.H)).real
    assert np.mean(curvatures) == pytest.approx(1.0)
    plain = ascent._engine.root(*rows)
    assert relaxation.pruned or relaxation.bound > plain.bound
