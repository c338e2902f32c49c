"""The problems that all methods get, and the linear complementarity problem that each of them is."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from enumsol import gallery
from grazing.run import chain, discs
from shared.loads import OBLIQUE, PRESSED, Loaded, block

if TYPE_CHECKING:
    from enumsol.condensation.condensed import ScaledSystem


def named(name: str) -> Loaded:
    """A problem of the gallery at its own alpha."""
    entry = gallery.get(name)
    return Loaded(name, entry.build().p, entry.build, entry.alpha)


def wedge(p: int, alpha: float) -> Loaded:
    """A wedge that is pulled obliquely."""
    return Loaded(f"wedge-{p}, alpha {alpha:g}", p, partial(gallery.wedge, 4, p // 2, OBLIQUE), alpha)


def touching(k: int, *, displaced: bool) -> Loaded:
    """A node that slides, and k that touch without load: at one root up to 4^k selections hold."""
    build = partial(chain, k, slides=True, displaced=displaced)
    return Loaded(f"1 slides, {k} {'graze' if displaced else 'unloaded'}", k + 1, build, 0.0)


def problems(*, smoke: bool) -> list[Loaded]:
    if smoke:
        return [named("two-node-5"), touching(2, displaced=False), wedge(4, 2.2)]
    return [
        named("one-node-6.1"),
        named("two-node-6.4"),
        named("two-node-5"),
        named("chain-4-coupled"),
        *(wedge(p, alpha) for p, alpha in ((4, 2.2), (6, 3.0), (8, 3.0), (10, 2.2), (14, 2.2))),
        named("wedge-8-3"),
        named("wedge-14-3"),
        *(block(p, PRESSED, 1.0) for p in (8, 16, 32)),
        touching(4, displaced=False),
        touching(8, displaced=False),
        touching(8, displaced=True),
        Loaded("6 equal discs, soft", 11, partial(discs, 6, (2.0,), 0.25), 0.0),
    ]


def complementarity(system: ScaledSystem) -> tuple[np.ndarray, np.ndarray]:
    """M and q of w = M z + q with z = (lambda_n, F lambda_n - lambda_t, what slips backward), 3p each.

    The complements of z are -w_n, what slips forward, and F lambda_n + lambda_t.
    """
    p, S, g = system.p, system.S, system.g
    F, eye, none = np.diag(system.F), np.eye(p), np.zeros((p, p))
    nn, nt, tn, tt = S[:p, :p], S[:p, p:], S[p:, :p], S[p:, p:]
    M = np.block([[nn + nt @ F, -nt, none], [-tn - tt @ F, tt, eye], [2 * F, -eye, none]])
    return M, np.concatenate([-g[:p], g[p:], np.zeros(p)])


def forces(system: ScaledSystem, z: np.ndarray) -> np.ndarray:
    """(lambda_n, lambda_t) with units from solutions z (k, 3p) of that problem."""
    n, rest = z[:, : system.p], z[:, system.p : 2 * system.p]
    return np.hstack([n, system.F * n - rest]) * system.force
