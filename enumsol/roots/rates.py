"""Ways in which an equilibrium goes on when the load changes: the problem of rates (theory, section 15.5)."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from enumsol.errors import InvalidArgumentError, TooLargeError
from enumsol.model.statuses import ContactStatus
from enumsol.roots.stability import Stabilities, displacement
from enumsol.support.array_arguments import real_array, vector_of
from enumsol.support.immutable import Sealed
from enumsol.trusted.motions_of_body import friction_changes, friction_over
from enumsol.trusted.running_away import Behaviour, positive, rates_in
from enumsol.trusted.status_rows import OPEN, SLIP_MINUS, SLIP_PLUS, STICK

if TYPE_CHECKING:
    from collections.abc import Iterator

    from enumsol.arithmetic.balls import Ball
    from enumsol.model.problem3d import AnyProblem
    from enumsol.roots.root import Root
    from enumsol.support.array_types import ArrayLike, Floats
    from enumsol.trusted.motions_of_body import Setting
    from enumsol.trusted.running_away import Motions

#: Ways in which nodes at their limit and nodes without force may go on, up to which all are tried.
_MOST_WAYS = 2**14


@dataclass(frozen=True)
class Way(Sealed):
    """A way in which an equilibrium goes on.

    Attributes
    ----------
    slides : tuple of int
        Contact nodes that slide, of those at their limit and those that touch without force.
    opens : tuple of int
        Contact nodes that touch without force and open. The others of both kinds stick from now on.
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
    opens: tuple[int, ...]
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


def rates(problem: AnyProblem, root: Root, load_rate: ArrayLike, friction_rate: ArrayLike = 0.0) -> Rates:
    """All ways in which an equilibrium goes on when the load changes at a rate; none means that it jumps.

    Nodes that stick below their limit go on sticking, open ones stay open, those at their limit slide on or stick, and
    those that touch without force open, stick or slip, one by one (theory, section 15.5; in 3D to first order). Over
    alpha the rates are ``problem.load_slope`` and ``problem.affine_friction[1]``.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    root : Root
        One of ``enumerate_roots(problem, alpha)``; in 3D one at which no node touches without force.
    load_rate : (n,) array_like
        Derivative of the load with respect to time [force / time].
    friction_rate : number or (p,) array_like, in 3D also (p, 2)
        Derivatives of the coefficients [1 / time].

    Raises
    ------
    InvalidArgumentError
        ``root`` or a rate cannot be used, friction depends on the solution, or in 3D a node touches without force.
    TooLargeError
        So many nodes are at their limit or without force that not all ways can be tried, and no proof says that there
        is one only.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.get("taper-8").build()
    >>> sliding = enumsol.enumerate_roots(problem, alpha=0.2)[1]
    >>> enumsol.rates(problem, sliding, problem.f).jumps, enumsol.rates(problem, sliding, -problem.f).jumps
    (True, False)
    """
    load, change = vector_of(load_rate, "load_rate", problem.n), _friction_rate(problem, friction_rate)
    asked = Stabilities(problem, at_rest=True)
    asked.check(root)
    F = friction_over(problem, root.alpha, root.alpha)
    loaded = np.array([ContactStatus.OPEN not in active for active in root.active])
    for i, axis in np.argwhere((np.transpose([f.mid for f in F]) == 0) & loaded[:, None] & (change != 0))[:1]:
        raise InvalidArgumentError(
            f"friction_rate is {change[i, axis]:g} at contact node {problem.node_ids[i]}, which is loaded and has no "
            "friction at root; expected 0 there"
        )
    if (reason := asked.not_known(root)) is not None:
        return Rates((), complete=False, reason=reason)
    parts = []
    for setting in asked.settings(root, every=True):
        if asked.body.tangents > 1 and setting.motions.touching:
            raise InvalidArgumentError(
                "a contact node touches without force at root, in 3D, where it may begin to slip in any direction; "
                "expected none that does"
            )
        more = None
        if np.any(change[setting.limits]):
            assert root.enclosure is not None
            more = friction_changes(setting, F, change, root.enclosure.lambda_t.reshape(problem.p, -1, 2))
        found = _of_part(setting, load[setting.dofs], more)
        if isinstance(found, str):
            return Rates((), complete=False, reason=found)
        parts.append([(setting, way, y) for way, y in found])
    ways = tuple(_way(problem, load, choice) for choice in itertools.product(*parts))
    return Rates(ways, complete=True, reason="")


def _friction_rate(problem: AnyProblem, given: ArrayLike) -> Floats:
    """Rates of the coefficients by node and axis, (p, 1) or (p, 2)."""
    rate, axes = real_array(given, "friction_rate", error=InvalidArgumentError), problem.contact_rows.shape[0]
    axes = axes // problem.p - 1
    if rate.shape not in ((), (problem.p,), (problem.p, axes)):
        more = f" or {(problem.p, axes)}" if axes > 1 else ""
        raise InvalidArgumentError(
            f"friction_rate has shape {rate.shape}; expected a number or shape ({problem.p},){more}"
        )
    return np.broadcast_to(rate.reshape(problem.p, -1) if rate.ndim else rate, (problem.p, axes))


def _of_part(setting: Setting, load: Floats, more: Ball | None) -> list[tuple[Behaviour, Ball]] | str:
    """Ways of one part of the body, or why they are not known, with the rates of forces."""
    stiffness, motions = setting.stiffness, setting.motions
    K, held = stiffness.at(0.0), stiffness.forces(load)
    if K is None or held is None:
        return "the stiffness of the contact nodes at rest is not enclosed"
    found = []
    form = motions.slopes.T @ (K @ motions.moves[:, : motions.limits])
    one_way = not motions.touching and (not motions.limits or positive(form.symmetric))
    count = 2**motions.limits * 4 ** len(motions.touching)
    if not one_way and count > _MOST_WAYS:
        raise TooLargeError(
            f"contact nodes at their limit or without force may go on in {count:,} ways, of which several may be true; "
            f"expected at most {_MOST_WAYS:,}"
        )
    r = -(motions.slopes.mid.T @ held.mid) + (0.0 if more is None else more.mid)
    for way in _pivots(form.mid, r) if one_way else _all_ways(motions):
        answer, y = rates_in(K, motions, held, way, more)
        if answer is None:
            return "a node at its limit or without force may go on in two ways, between which rounding does not decide"
        if answer:
            found.append((way, y))
    if one_way and not found:
        return "the only way to go on was not found"
    return found


def _all_ways(motions: Motions) -> Iterator[Behaviour]:
    """All ways in which nodes at their limit and nodes without force may go on."""
    codes = [(OPEN, STICK, SLIP_PLUS, SLIP_MINUS)[: 4 if node.slides else 2] for node in motions.touching]
    for touching in itertools.product(*codes):
        for size in range(motions.limits + 1):
            for slides in itertools.combinations(range(motions.limits), size):
                yield Behaviour(slides, touching)


def _pivots(L: Floats, q: Floats) -> Iterator[Behaviour]:
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
    yield Behaviour(tuple(np.flatnonzero(chosen).tolist()))


def _way(problem: AnyProblem, load: Floats, parts: tuple[tuple[Setting, Behaviour, Ball], ...]) -> Way:
    """A way to go on, in floats."""
    forces, u = np.zeros(problem.contact_rows.shape[0]), np.zeros(problem.n)
    slides: list[int] = []
    opens: list[int] = []
    for setting, way, y in parts:
        forces[setting.rows] = y.mid
        u[setting.dofs] = displacement(setting, 0.0, load[setting.dofs], y.mid)
        slides += [setting.limits[i] for i in way.slides]
        for node, code in zip(setting.touching, way.touching, strict=True):
            opens += [node] if code == OPEN else []
            slides += [node] if code in (SLIP_PLUS, SLIP_MINUS) else []
    lambda_t = forces[problem.p :]
    tangential = lambda_t if len(lambda_t) == problem.p else lambda_t.reshape(problem.p, -1, order="F")
    return Way(tuple(sorted(slides)), tuple(sorted(opens)), u, forces[: problem.p], tangential)
