"""For which theta a bound of the forces of all roots is narrow (theory, section 14.15); nothing here is trusted."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from enumsol.support.array_types import Floats, Indices
    from enumsol.trusted.space.space_uniqueness import LeafReference

#: What counts as none of something, relative to the largest; of squares.
_NONE, _NONE_SQUARED = 1e-10, 1e-11
#: Steps from the nearest theta to the smallest one, of which none may be longer than one.
_SHARES, _LENGTH = np.linspace(0.0, 1.0, 17), 1.0 - 1e-6


def sole_turns(reference: LeafReference) -> Floats | None:
    """theta that proves a root of a body that nothing holds to be the only one, (m - p,); None where none does."""
    reach = reference.system.reach
    tried = _proposed(reference, np.where(np.isfinite(reach), reach, 1.0))
    return next((turns for turns in tried if reference.is_sole(turns, reach)), None)


def _proposed(reference: LeafReference, weights: Floats) -> Iterator[Floats]:
    """theta with which motions have no part in the bound, as far as there are some, near that of the root; and that."""
    tau, unit, force = reference.system.tau, reference.system.unit, reference.root.y.mid
    p = len(tau)
    nodes = np.empty(len(unit) - p, dtype=np.intp)
    for places in tau.T:
        has = np.flatnonzero(places >= 0)
        nodes[places[has] - p] = has
    factors = 1.0 / unit[p:]
    size = np.maximum(force[nodes], 0.0) * factors
    own = np.where(size > 0, force[p:] / np.where(size > 0, size, 1.0), 0.0)
    with np.errstate(all="ignore"):
        found = _free_of_motions(reference.form.G.mid * weights[:, None], nodes, factors, size, own)
    yield from [turns for turns in (found, own) if turns is not None]


def _free_of_motions(G: Floats, nodes: Indices, factors: Floats, size: Floats, own: Floats) -> Floats | None:
    """theta with G_t (lambda_t - theta lambda_n) = 0, then the least of G D, and then nearest to that of a root."""
    p = G.shape[1] - len(nodes)
    along = G[:, p:] * factors
    try:
        balanced, fixed = _least_squares(along * size / factors, (along * size / factors) @ own)
        # |G D d| where G d = 0, as squares
        across = (np.eye(G.shape[1]) - np.linalg.pinv(G) @ G)[:p, :p]
        square = (along.T @ along) * across[np.ix_(nodes, nodes)]
        sizes, modes = np.linalg.eigh(balanced.T @ square @ balanced)
        free = sizes <= _NONE_SQUARED * np.max(np.diagonal(square), initial=0.0)
        others = modes[:, ~free]
        moved = others @ ((others.T @ (balanced.T @ (square @ fixed))) / sizes[~free])
        fixed, balanced = fixed - balanced @ moved, balanced @ modes[:, free]
        targets = size[:, None] * np.stack([own - fixed, -fixed], axis=1)
        left = np.linalg.lstsq(size[:, None] * balanced, targets, rcond=_NONE)[0]
        near, small = fixed + (balanced @ left).T
    except np.linalg.LinAlgError:
        return None
    for share in _SHARES:
        turns: Floats = near + share * (small - near)
        if np.all(np.bincount(nodes, turns * turns) <= _LENGTH):
            return turns
    return None


def _least_squares(rows: Floats, right: Floats) -> tuple[Floats, Floats]:
    """Columns that rows leave free, and a solution, by least squares."""
    U, sizes, V = np.linalg.svd(rows)
    rank = int(np.count_nonzero(sizes > _NONE * np.max(sizes, initial=0.0)))
    return V[rank:].T, V[:rank].T @ ((U[:, :rank].T @ right) / sizes[:rank])
