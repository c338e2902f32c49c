"""Ways in which an equilibrium goes on when the load changes: the problem of rates (theory, section 15.5)."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError, TooLargeError
from enumsol.roots.stability import Stabilities, displacement
from enumsol.support.array_arguments import vector_of
from enumsol.support.immutable import Sealed
from enumsol.trusted.running_away import positive, rates_in

if TYPE_CHECKING:
    from collections.abc import Iterator

    from enumsol.arithmetic.balls import Ball
    from enumsol.model.problem3d import AnyProblem
    from enumsol.roots.root import Root
    from enumsol.support.array_types import ArrayLike, Floats
    from enumsol.trusted.motions_of_body import Setting

#: Nodes at their limit up to which all ways in which they may slide or stay are tried.
_LARGEST = 14


@dataclass(frozen=True)
class Way(Sealed):
    """A way in which an equilibrium goes on.

    Attributes
    ----------
    slides : tuple of int
        Contact nodes at their limit that slide; the others there stick from now on.
    u : (n,) array
        Rate of the displacement [length / time].
    lambda_n, lambda_t : (p,) arrays; in 3D lambda_t is (p, 2)
        Rates of the contact forces [force / time].

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.get("taper-8").build()
    >>> stuck = enumsol.enumerate_roots(problem, alpha=0.2)[2]
    >>> (way,) = enumsol.rates(problem, stuck, load_rate=problem.f).ways
    >>> way.u.shape, way.lambda_n.shape
    ((50,), (8,))
    """

    slides: tuple[int, ...]
    u: Floats = field(repr=False)
    lambda_n: Floats = field(repr=False)
    lambda_t: Floats = field(repr=False)


@dataclass(frozen=True)
class Rates(Sealed):
    """All ways in which an equilibrium goes on when the load changes.

    Attributes
    ----------
    ways : tuple of Way
        Each is proven.
    complete : bool
        True if it is proven that there are no others.
    reason : str
        Why it is not, or "".

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.get("taper-8").build()
    >>> stuck = enumsol.enumerate_roots(problem, alpha=0.2)[2]
    >>> found = enumsol.rates(problem, stuck, load_rate=problem.f)
    >>> len(found.ways), found.complete, found.jumps
    (1, True, False)
    """

    ways: tuple[Way, ...]
    complete: bool
    reason: str

    @property
    def jumps(self) -> bool:
        """True if it is proven that the equilibrium cannot go on at these rates."""
        return self.complete and not self.ways


def rates(problem: AnyProblem, root: Root, load_rate: ArrayLike) -> Rates:
    """All ways in which an equilibrium goes on when the load changes at a rate; none means that it jumps.

    Nodes that stick below their limit go on sticking, open ones stay open, and those at their limit slide on or stick,
    one by one (theory, section 15.5; in 3D to first order). Coefficients do not change.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    root : Root
        A regular one of ``enumerate_roots(problem, alpha)``, or one at which no node touches without force.
    load_rate : (n,) array_like
        Derivative of the load with respect to time [force / time].

    Raises
    ------
    InvalidArgumentError
        ``root`` or ``load_rate`` cannot be used, friction depends on the solution, or a node touches without force.
    TooLargeError
        So many nodes are at their limit that not all ways can be tried, and no proof says that there is one only.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.get("taper-8").build()
    >>> sliding = enumsol.enumerate_roots(problem, alpha=0.2)[1]
    >>> enumsol.rates(problem, sliding, problem.f).jumps, enumsol.rates(problem, sliding, -problem.f).jumps
    (True, False)
    """
    load = vector_of(load_rate, "load_rate", problem.n)
    asked = Stabilities(problem, sp.eye_array(problem.n, format="csc"))
    asked.check(root)
    if (reason := asked.not_known(root)) is not None:
        return Rates((), complete=False, reason=reason)
    parts = []
    for setting in asked.settings(root, every=True):
        if setting.motions.touching:
            raise InvalidArgumentError("a contact node touches without force at root; expected none that does")
        found = _of_part(setting, load[setting.dofs])
        if isinstance(found, str):
            return Rates((), complete=False, reason=found)
        parts.append([(setting, slides, y) for slides, y in found])
    ways = tuple(_way(problem, load, choice) for choice in itertools.product(*parts))
    return Rates(ways, complete=True, reason="")


def _of_part(setting: Setting, load: Floats) -> list[tuple[tuple[int, ...], Ball]] | str:
    """Ways of one part of the body, or why they are not known: nodes that slide, and rates of forces."""
    stiffness, motions = setting.stiffness, setting.motions
    K, held = stiffness.at(0.0), stiffness.forces(load)
    if K is None or held is None:
        return "the stiffness of the contact nodes at rest is not enclosed"
    found = []
    form = motions.slopes.T @ (K @ motions.moves)
    one_way = positive(form.symmetric) if motions.limits else True
    if not one_way and motions.limits > _LARGEST:
        raise TooLargeError(
            f"{motions.limits} contact nodes are at their limit, and more than one way may go on; "
            f"expected at most {_LARGEST}"
        )
    tried = _pivots(form.mid, -(motions.slopes.mid.T @ held.mid)) if one_way else _all_sets(motions.limits)
    for slides in tried:
        answer, y = rates_in(K, motions, held, slides)
        if answer is None:
            return "a node at its limit may slide or stick, which rounding does not decide"
        if answer:
            found.append((slides, y))
    if one_way and not found:
        return "the only way to go on was not found"
    return found


def _all_sets(count: int) -> Iterator[tuple[int, ...]]:
    """All sets of so many nodes."""
    for size in range(count + 1):
        yield from itertools.combinations(range(count), size)


def _pivots(L: Floats, q: Floats) -> Iterator[tuple[int, ...]]:
    """The set that slides where every principal minor is positive (Murty's least index), one set."""
    chosen = np.zeros(len(q), dtype=bool)
    for _ in range(50 * (len(q) + 1)):
        own = np.flatnonzero(chosen)
        x = np.zeros(len(q))
        if len(own):
            x[own] = np.linalg.solve(L[np.ix_(own, own)], -q[own])
        r = q + L @ x
        wrong = np.flatnonzero(np.where(chosen, x, r) < 0)
        if not len(wrong):
            break
        chosen[wrong[0]] ^= True
    yield tuple(np.flatnonzero(chosen).tolist())


def _way(problem: AnyProblem, load: Floats, parts: tuple[tuple[Setting, tuple[int, ...], Ball], ...]) -> Way:
    """A way to go on, in floats."""
    forces, u, slides = np.zeros(problem.contact_rows.shape[0]), np.zeros(problem.n), []
    for setting, own, y in parts:
        forces[setting.rows] = y.mid
        u[setting.dofs] = displacement(setting, 0.0, load[setting.dofs], y.mid)
        slides += [setting.limits[i] for i in own]
    lambda_t = forces[problem.p :]
    tangential = lambda_t if len(lambda_t) == problem.p else lambda_t.reshape(problem.p, -1, order="F")
    return Way(tuple(sorted(slides)), u, forces[: problem.p], tangential)
