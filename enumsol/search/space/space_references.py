"""Where a known root of a body in 3D that nothing holds is the only one (theory, sections 14.11 and 14.15).

Nothing here is trusted: the certifier proves what is proposed, or the tree is searched.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import nnls

from enumsol.model.sectors import SECTORS
from enumsol.model.statuses import OPEN, SLIP_MINUS, SLIP_PLUS, STICK
from enumsol.proof.leaves import OnlyReference
from enumsol.search.reference_closer import ReferenceCloser
from enumsol.search.space.space_fathoming import DefiniteForm
from enumsol.trusted.space.sector_rows import ALONG, GAP, LEFT, RIGHT, SLIP

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from enumsol.condensation.space_condensed import EnclosedSpace, SpaceSystem
    from enumsol.relaxation.space_relaxation import SpaceEngine
    from enumsol.search.certifiers.protocol import Certifier
    from enumsol.support.array_types import Codes, Floats, Indices
    from enumsol.trusted.space.leaves import SpaceRoot
    from enumsol.trusted.space.sector_rows import Row
    from enumsol.trusted.space.space_uniqueness import LeafReference

#: Eigenvalues of the small matrix, relative to its largest one, that count as none; what of rows counts as none.
_NONE, _NOTHING = 1e-9, 1e-8
#: Factors of products that are tried, relative to the compliance.
_FACTORS = np.geomspace(2.0**-8, 2.0**8, 9)
#: Contact nodes from which a root is sought before the tree; of fewer, assignments that are met before that.
_MANY, _EASY = 8, 32


def space_closer(certifier: Certifier, engine: SpaceEngine, root: Callable[[], Codes | None]) -> ReferenceCloser:
    """A closer that ends the tree where only a root is left; none if not even its own statuses leave it alone.

    Parameters
    ----------
    certifier : Certifier
    engine : SpaceEngine
        Of the relaxations, which decides first whether some nodes are open.
    root : callable giving the codes of a leaf with a strict root, or None
    """
    sole: Floats | None = None

    def worth(found: LeafReference) -> bool:
        nonlocal sole
        own = proposed(found, found.selection)
        if not found.is_only_root(found.selection, own.rows, own.products, found.system.reach):
            return False
        sole = sole_turns(found)
        engine.first = _far_apart(found)
        return True

    def pause(vain: int) -> int:
        # one more assignment passes for so many tries in vain, and no more than so many
        return min(vain // 16, 7)

    easy = 0 if engine.system.p >= _MANY else _EASY

    def whole_or_below(found: LeafReference, codes: Codes) -> OnlyReference:
        return proposed(found, codes) if sole is None else OnlyReference(1, [], [], turns=sole)

    return ReferenceCloser(certifier, root, whole_or_below, worth=worth, pause=pause, easy=easy)


def _far_apart(reference: LeafReference) -> list[int]:
    """Contact nodes, one more than it takes to hold the body against the foundation, far from each other."""
    normals = reference.system.rows.G.mid[:, : len(reference.selection)].T
    pressed, found = [i for i, code in enumerate(reference.selection) if code != OPEN], list[int]()
    # their squares would be singular otherwise
    M = 1e-3 * np.eye(normals.shape[1])
    for _ in range(min(int(np.linalg.matrix_rank(normals[pressed])) + 1, len(pressed))):
        left = [i for i in pressed if i not in found]
        gain = np.einsum("ij,ij->i", normals[left], np.linalg.solve(M, normals[left].T).T)
        found.append(left[int(np.argmax(gain))])
        M += np.outer(normals[found[-1]], normals[found[-1]])
    return found


def proposed(reference: LeafReference, codes: Codes) -> OnlyReference:
    """All equations of an assignment, and products of rows of its sectors where they are needed."""
    kinds = [(GAP, 0), (SLIP, 0), (SLIP, 1)]
    has = reference.system.tau >= 0
    rows = [
        (kind, i, k)
        for kind, k in kinds
        for i in range(len(codes))
        if (kind == GAP or has[i, k]) and reference.is_equation(codes, (kind, i, k))
    ]
    M = reference.form.small_matrix(reference.rows(rows), reference.rows([]), []).mid
    sizes, modes = np.linalg.eigh(M)
    left = modes[:, sizes <= _NONE * np.max(np.abs(sizes), initial=0.0)]
    tight = _tight(reference, codes) if left.shape[1] else []
    if not tight:
        return OnlyReference(1, rows, [])
    coefficients = reference.rows(tight).mid
    coefficients = coefficients / np.linalg.norm(coefficients, axis=1, keepdims=True)
    factors = _balanced(coefficients @ reference.system.rows.G.mid.T @ left)
    if factors is None:
        return OnlyReference(1, rows, [])
    used = np.flatnonzero(factors > 0)
    chosen = [tight[k] for k in used]
    return OnlyReference(1, rows, _products(reference, rows, chosen, factors[used]))


def _tight(reference: LeafReference, codes: Codes) -> list[Row]:
    """Rows of the slips of an assignment that are nonnegative below it and not positive at the root."""
    rows = [(kind, i, code - SECTORS) for i, code in enumerate(codes) if code > SECTORS for kind in (LEFT, RIGHT)]
    signs = {SLIP_PLUS: 1, SLIP_MINUS: -1}
    rows += [(ALONG, i, signs[code]) for i, code in enumerate(codes) if code in signs]
    return [row for row in rows if reference.is_tight(codes, row)]


def _balanced(R: Floats) -> Floats | None:
    """y >= 0 with R'y = 0, (k,), where the rows that y uses leave no mode free; None where none was found."""
    size = np.linalg.norm(R, axis=0)
    if not np.all(size > _NOTHING):
        return None
    R = R / size
    y, _ = nnls(np.vstack([R.T, np.ones(len(R))]), np.append(np.zeros(R.shape[1]), 1.0))
    y = np.where(y > _NOTHING, y, 0.0)
    used = R[y > 0]
    if not np.any(y > 0) or np.linalg.norm(R.T @ y) > _NOTHING * np.sum(y):
        return None
    return y / np.linalg.norm(used, 2) if np.linalg.matrix_rank(used, tol=_NOTHING) == R.shape[1] else None


def _products(reference: LeafReference, rows: list[Row], tight: list[Row], y: Floats) -> list[tuple[Row, Row, float]]:
    """The products of tight rows with the factors z y_k y_l, z being best; none where it does not help."""
    coefficients = reference.rows(tight)
    y = y / np.linalg.norm(coefficients.mid, axis=1)
    M = reference.form.small_matrix(reference.rows(rows), coefficients, []).mid
    Z, k = np.zeros_like(M), len(M) - len(y)
    Z[k:, k:] = 0.5 * (np.outer(y, y) - np.diag(y * y))
    least = np.linalg.eigvalsh(M - _FACTORS[:, None, None] * Z)[:, 0]
    z = float(_FACTORS[np.argmax(least)])
    if not np.max(least) > _NONE * np.max(np.abs(M)):
        return []
    return [(tight[a], tight[b], float(z * y[a] * y[b])) for a in range(len(y)) for b in range(a)]


def reference_numbers(
    system: SpaceSystem, enclosed: EnclosedSpace, root: SpaceRoot, leaf: Codes
) -> Iterator[tuple[Floats, float, float]]:
    """Numbers, balance and share of forms that may be definite, as ``LeafReference.of`` takes them."""
    tau, p, unit = enclosed.tau, len(enclosed.tau), enclosed.unit
    y, w, code = root.y.mid, root.w.mid, np.array(leaf)
    force, slip = (np.where(tau >= 0, part, 0.0) for part in (y[tau] * unit[tau], w[tau] / unit[tau]))
    apart, size = code == OPEN, np.linalg.norm(slip, axis=1)
    # of open nodes as much of the slip as half of their gap does not serve for
    need = np.maximum(1.0 + 0.5 * w[:p] / np.where(size > 0, size, np.inf), 0.0)
    length = np.where(code == STICK, y[:p], np.linalg.norm(force, axis=1))
    divisor = np.where(length > 0, length, np.inf)
    theta = np.where(
        apart[:, None], slip * (need / np.where(size > 0, size, np.inf))[:, None], force / divisor[:, None]
    )
    scale, found = float(np.max(np.abs(enclosed.S))), None
    # weights of |G d|^2
    for balance in (scale, 1024.0 * scale):
        held = np.sqrt(balance) * enclosed.rows.G.mid
        form = DefiniteForm(replace(system, S=enclosed.S, g=enclosed.g), [theta], apart, np.zeros(p), held=held)
        for better in (False, True):
            found = form.best(1e-9, better=better)
            if found is not None:
                mu, kappa, nu = found
                numbers = np.concatenate([mu, kappa, np.zeros(p), nu[tau >= 0], theta[tau >= 0]])
                yield numbers, balance, float(np.mean(mu))
                break


# -- theta for which a bound of the forces of all roots is narrow (theory, section 14.15) ------------------------------

#: What counts as none of something where theta is sought, relative to the largest; of squares.
_NO_PART, _NO_PART_SQUARED = 1e-10, 1e-11
#: Steps from the nearest theta to the smallest one, of which none may be longer than one.
_SHARES, _LENGTH = np.linspace(0.0, 1.0, 17), 1.0 - 1e-6


def sole_turns(reference: LeafReference) -> Floats | None:
    """theta that proves a root of a body that nothing holds to be the only one, (m - p,); None where none does."""
    reach = reference.system.reach
    tried = _proposed_turns(reference, np.where(np.isfinite(reach), reach, 1.0))
    return next((turns for turns in tried if reference.is_sole(turns, reach)), None)


def _proposed_turns(reference: LeafReference, weights: Floats) -> Iterator[Floats]:
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
        free = sizes <= _NO_PART_SQUARED * np.max(np.diagonal(square), initial=0.0)
        others = modes[:, ~free]
        moved = others @ ((others.T @ (balanced.T @ (square @ fixed))) / sizes[~free])
        fixed, balanced = fixed - balanced @ moved, balanced @ modes[:, free]
        targets = size[:, None] * np.stack([own - fixed, -fixed], axis=1)
        left = np.linalg.lstsq(size[:, None] * balanced, targets, rcond=_NO_PART)[0]
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
    rank = int(np.count_nonzero(sizes > _NO_PART * np.max(sizes, initial=0.0)))
    return V[rank:].T, V[:rank].T @ ((U[:, :rank].T @ right) / sizes[:rank])
