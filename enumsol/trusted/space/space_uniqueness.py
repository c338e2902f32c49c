"""The trusted test in 3D that a problem, or an assignment, has one solution only, which is enclosed.

A solution that is known well enough is the only one where a matrix is positive definite. That there is one follows from
the degree. It is enclosed by a leaf, where it is regular, or by a point near it, whatever statuses hold there. Below an
assignment the matrix has to be definite on the subspace of its equations (theory, section 12.6). Over a piece of alpha
the solution is known from a curve of solutions (theory, section 12.9).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, upper_norm
from enumsol.model.sectors import DEEPEST, SECTORS, is_sector, level_of
from enumsol.trusted.space.force_bound import ForceBound
from enumsol.trusted.space.leaves import SpaceRoot, settle
from enumsol.trusted.space.sector_rows import (
    ALONG,
    CONTACT,
    FREE,
    FRICTIONLESS,
    GAP,
    LEFT,
    NONNEGATIVE,
    OPEN,
    RIGHT,
    SLIP,
    SLIP_MINUS,
    SLIP_PLUS,
    STICK,
    UNDECIDED,
    Row,
    row_sign,
    sector_row_terms,
)
from enumsol.trusted.uniqueness_forms import Multipliers, RootForm, RootReference, UniqueForm

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from fractions import Fraction
    from typing import Self

    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.support.array_types import Codes, Floats, Mask
    from enumsol.trusted.space.curve_runs import CurveParts


#: Directions whose squared length is as near to one stand for the direction of length one.
_UNIT_LENGTH = 2.0**-40
#: Units of tau beyond this, or below its inverse, are left to the tree: nothing here underflows with others.
LARGEST_UNIT = 2.0**128
#: Weights of equations that are tried, by the largest entry of S.
EQUATION_WEIGHTS = 16.0, 1024.0


@dataclass(frozen=True)
class LooseSolution:
    """One solution of a problem, or its only one, as balls; its statuses need not be known.

    Attributes
    ----------
    y, w : Ball of shape (m,)
        Forces (lambda_n, tau) and displacements, scaled; without radius where they are 0 for certain.
    open, stick, slip : (p,) bool arrays
        Statuses that may hold; of nodes without friction that may touch both of the last two.
    index : int
        Its degree.
    """

    y: Ball
    w: Ball
    open: Mask
    stick: Mask
    slip: Mask
    index: int

    def certain(self, rubs: Mask) -> tuple[int, ...] | None:
        """Open, stick or contact (slip, or no friction) of every node; None where one is not certain."""
        several = self.open & (self.stick | self.slip) | rubs & self.stick & self.slip
        codes = np.where(self.open, OPEN, np.where(rubs & self.stick, STICK, CONTACT))
        return None if np.any(several) else tuple(codes.tolist())

    @classmethod
    def of(cls, system: EnclosedSpace, y: Ball, w: Ball, index: int, **more: Any) -> Self:
        """By the statuses that may hold within balls; what vanishes by those that hold for certain is put to 0."""
        p = len(system.tau)
        touch = w.mid[:p] + w.rad[:p] >= 0
        loose = y.mid[:p] - y.rad[:p] <= 0
        w.mid[:p], w.rad[:p] = np.where(loose, w.mid[:p], 0.0), np.where(loose, w.rad[:p], 0.0)
        stick, slip = touch.copy(), touch.copy()
        for i, places in enumerate(system.tau):
            t = places[places >= 0]
            if not len(t):
                continue
            scale = system.unit[t] * system.disc_scale[i]
            tau = upper_norm((np.abs(y.mid[t]) + y.rad[t]) * scale * SAFE + TINY)
            if tau < (y.mid[i] - y.rad[i]) * system.disc_scale[i] / SAFE:
                slip[i] = False
                w.mid[t], w.rad[t] = 0.0, 0.0
            stick[i] &= bool(np.all(np.abs(w.mid[t]) <= w.rad[t]))
        return cls(y, w, loose, stick, slip, index, **more)


def displacements(system: EnclosedSpace, y: Ball) -> Ball:
    """w = g - S y."""
    return Ball(system.g, system.g_rad) - (Ball(system.S, system.S_rad) @ y[:, None])[:, 0]


def only_solution_in_space(
    system: EnclosedSpace, numbers: Floats, normal: Floats, errors: float = 1.0
) -> LooseSolution | None:
    """The only solution near a point, or None where that is not proven.

    Parameters
    ----------
    system : EnclosedSpace
    numbers : see ``SpaceWeights.of``
    normal : (p,) array, lambda_n of the point, scaled; what is negative counts as 0
    errors : what is not known of theta counts as often: 1 proves, a writer of proofs takes more, so that a checker,
        which rounds otherwise, comes to the same answer

    Raises
    ------
    NotEnclosedError
        S is not proven positive definite.
    """
    with np.errstate(all="ignore"):
        weights = SpaceWeights.of(system, numbers)
        return None if weights is None else _enclosed(system, weights, normal, errors)


def lone_root(
    system: EnclosedSpace, codes: Sequence[int], numbers: Floats, leaf: Sequence[int], errors: float = 1.0
) -> SpaceRoot | None:
    """The regular root of a leaf, if it is proven that no other solution has the statuses of an assignment.

    Parameters
    ----------
    system : EnclosedSpace
    codes : (partial) status codes of the assignment; a sector counts as contact
    numbers, errors : as for ``only_solution_in_space``
    leaf : codes of the leaf, whose statuses the assignment allows

    Raises
    ------
    NotEnclosedError
        S is not proven positive definite.
    """
    if not is_complete(system, leaf) or not all(map(_allows, codes, leaf)):
        return None
    with np.errstate(all="ignore"):
        weights, root = SpaceWeights.of(system, numbers), None
        if weights is None:
            return None
        for rows in equations_tried(system, codes):
            form = weights.form(system, rows)
            root = settle(system, leaf) if form is not None and root is None else root
            # the degree of a problem is +1
            if form is None or not isinstance(root, SpaceRoot) or (rows is None and root.index != 1):
                continue
            if form.serves(weights.distances(system, root.y, root.w), errors):
                return root
    return None


def _allows(code: int, final: int) -> bool:
    if code == UNDECIDED:
        return True
    if code == CONTACT or code > SECTORS:
        return final != OPEN
    return final == code


def equations(system: EnclosedSpace, codes: Sequence[int], weight: float) -> Ball:
    """Rows a with a d = 0 for the difference d of two solutions with these statuses, as balls, each with a weight.

    d is zero at open nodes, S d in the normal direction of nodes in contact, and in both others where nodes stick.
    """
    held = list[int]()
    separate = list[int]()
    for i, (code, tau) in enumerate(zip(codes, system.tau.tolist(), strict=True)):
        own = [t for t in tau if t >= 0]
        if code == OPEN:
            separate += [i, *own]
        elif code != UNDECIDED:
            held += [i, *own] if code == STICK else [i]
    # any numbers are weights
    weight = float(np.sqrt(weight * np.max(np.abs(system.S))))
    factor = weight / np.linalg.norm(system.S[held], axis=1, keepdims=True)
    rows = Ball(system.S[held], system.S_rad[held]) * Ball.exact(factor)
    return Ball.joined(rows, Ball.exact(weight * np.eye(len(system.g))[separate]))


def equations_tried(system: EnclosedSpace, codes: Sequence[int]) -> Iterator[Ball | None]:
    """Rows of ``equations``, with every weight that is tried; None where no status is assigned."""
    if all(code == UNDECIDED for code in codes):
        yield None
    else:
        yield from (equations(system, codes, weight) for weight in EQUATION_WEIGHTS)


def is_complete(system: EnclosedSpace, codes: Sequence[int]) -> bool:
    """True if every node has a final code that it can have."""
    tangents = np.sum(system.tau >= 0, axis=1).tolist()
    return len(codes) == len(tangents) and all(map(_is_final, codes, tangents))


def _is_final(code: int, tangents: int) -> bool:
    if tangents == 2 and code > SECTORS:
        return is_sector(code - SECTORS) and level_of(code - SECTORS) <= DEEPEST + 1
    return code in ((OPEN, FRICTIONLESS), (OPEN, STICK, SLIP_PLUS, SLIP_MINUS), (OPEN, STICK))[tangents]


@dataclass(frozen=True)
class SpaceWeights:
    """The numbers of the form of theory, (6.9), node by node.

    Where there is no tau, components are 0.

    Attributes
    ----------
    mu, kappa, wide : (p,) arrays
        ``wide`` is positive where the form serves any theta.
    nu, theta : (p, 2) arrays
    off : (p, 2) array
        theta stands for one whose components are no farther away: where ``whole``, for that of length one.
    whole : (p,) bool array
    """

    mu: Floats
    kappa: Floats
    wide: Floats
    nu: Floats
    theta: Floats
    off: Floats
    whole: Mask

    @classmethod
    def of(cls, system: EnclosedSpace, numbers: Floats) -> SpaceWeights | None:
        """From one array: mu, kappa and wide of all nodes, then nu and theta of all tau, in the order of y.

        mu and kappa are positive, wide is not negative, |nu| <= mu, |theta| <= 1, and theta = 0 where wide is positive.
        None where this is not so.
        """
        p, m = len(system.tau), len(system.g)
        if numbers.shape != (p + 2 * m,) or not np.all(np.isfinite(numbers)):
            return None
        (mu, kappa, wide), pairs = numbers[: 3 * p].reshape(3, p), numbers[3 * p :].reshape(2, m - p)
        place = np.where(system.tau >= 0, system.tau - p, m - p)
        nu, theta = (np.append(pair, 0.0)[place] for pair in pairs)
        square = np.sum(theta * theta, axis=1)
        whole = np.abs(square - 1.0) < _UNIT_LENGTH
        wrong = (mu <= 0) | (kappa <= 0) | (wide < 0) | (upper_norm(nu, axis=1) > mu)
        wrong |= ~whole & (square > 1.0 - _UNIT_LENGTH)
        wrong |= (wide > 0) & (np.any(theta != 0, axis=1) | np.all(system.tau < 0, axis=1))
        # | |theta| - 1 | <= | |theta|^2 - 1 |
        off = np.where(whole, (np.abs(square - 1.0) + 8 * UNIT) * SAFE, 0.0)[:, None] * (system.tau >= 0)
        return None if np.any(wrong) else cls(mu, kappa, wide, nu, theta, off, whole)

    @property
    def psi(self) -> Ball:
        """theta, (p, 2), with that of length one for which it stands."""
        return Ball(self.theta, self.off)

    def multipliers(self, system: EnclosedSpace) -> Multipliers:
        """D of all nodes."""
        return _multipliers(system, self.mu, self.kappa, self.nu, self.psi)

    def form(self, system: EnclosedSpace, held: Ball | None = None) -> UniqueForm | None:
        """Q of theory, (6.9); None where it is not proven definite, or not with the squares of some rows."""
        if not (system.smallest_eigenvalue > 0 and in_range(system)):
            return None
        S, wide = Ball(system.S, system.S_rad), self.wide > 0
        return UniqueForm.of(S, self.multipliers(system), np.where(wide, 1.0, 0.0), self.wide, held)

    def gaps_serve(self, system: EnclosedSpace, w: Ball) -> Mask:
        """Mask of nodes without load whose theta serves for all w in a ball, by their gaps (theory, (6.8))."""
        unit, p, ones = system.tau_units, len(self.mu), Ball.exact(np.ones(len(self.mu)))
        slip = Ball(system.tangential(w.mid) / unit, system.tangential(w.rad) / unit * SAFE + TINY)
        return _gaps_serve(self, ones.mid, self.psi, ones, (-(w.mid[:p] + w.rad[:p]), slip))

    def distances(self, system: EnclosedSpace, y: Ball, w: Ball) -> Floats:
        """Upper bounds of distances of theta from one that serves a solution in balls, (p,); infinite where open."""
        p, has, unit = len(self.mu), system.tau >= 0, system.tau_units
        scale = system.slip_scale[:, None] / unit
        v, v_rad = system.tangential(w.mid) * scale, system.tangential(w.rad) * scale * SAFE + TINY
        length, away = np.linalg.norm(v, axis=1), upper_norm(v_rad, axis=1)
        # it slides, in a direction that is off by 2 away / length at most
        slides = length * (1.0 - 32 * UNIT) > away * SAFE
        divisor = np.where(slides, length, 1.0)
        apart = np.linalg.norm(v / divisor[:, None] - self.theta, axis=1)
        apart = (apart + np.where(np.all(has, axis=1), 2.0 * away / divisor, 0.0)) * SAFE + 32 * UNIT
        off, low, most = np.where(slides, apart, np.inf), (y.mid[:p] - y.rad[:p]) / SAFE, system.disc_scale
        # |tau / lambda_n - theta| = |tau - theta lambda_n| / lambda_n
        scale, loaded = unit * most[:, None], low > 0
        tau = Ball(system.tangential(y.mid) * scale, system.tangential(y.rad) * scale * SAFE + TINY)
        left = tau - Ball.exact(self.theta) * Ball(y.mid[:p] * most, y.rad[:p] * most)[:, None]
        apart = upper_norm(left.size + TINY, axis=1) / (np.where(loaded, low, 1.0) * most) * SAFE * SAFE
        off = np.where(loaded, np.minimum(off, apart), off)
        return np.where(~np.any(has, axis=1) | (self.wide > 0) | self.gaps_serve(system, w), 0.0, off)


def _multipliers(system: EnclosedSpace, mu: Floats, kappa: Floats, nu: Floats, psi: Ball) -> Multipliers:
    """D of all nodes, psi being theta times the radii of the discs."""
    # units are powers of two: what is rounded is less than TINY
    unit, known = system.tau_units, (psi.mid == 0) & (psi.rad == 0)
    turn = Ball(psi.mid / unit, np.where(known, 0.0, psi.rad / unit * SAFE + TINY))
    return Multipliers(system.tau, mu, kappa, turn, Ball(nu * unit, np.where(nu == 0, 0.0, TINY)), unit)


def _gaps_serve(
    numbers: SpaceWeights | PieceWeights, scale: Floats, psi: Ball, r: Ball, moved: tuple[Floats, Ball]
) -> Mask:
    """Mask of nodes whose gap lets psi itself serve: (mu - r |nu|) |w_n| >= kappa (r |v| - psi . v).

    Parameters
    ----------
    scale : (p,) array, by which slips are multiplied
    psi, r : Balls of shapes (..., p, 2) and (..., p), |psi| being at most r
    moved : bounds of -w_n from below, (..., p), and slips, (..., p, 2)
    """
    gap, slip = moved
    gap, length, along = np.maximum(gap, 0.0) / SAFE, upper_norm(slip.size, axis=-1), psi * slip
    ahead = along[..., 0] + along[..., 1]
    needed = r.size * length * SAFE - (ahead.mid - ahead.rad * SAFE) + 16 * UNIT * (r.size * length + ahead.size)
    room = numbers.mu - upper_norm(numbers.nu, axis=1) * r.size * SAFE - 4 * UNIT * numbers.mu
    needed = numbers.kappa * scale * needed * SAFE * SAFE + TINY
    return np.asarray((gap > 0) & (room > 0) & (room * gap / SAFE >= needed))


def moderate_units(unit: Floats) -> bool:
    """True if nothing underflows with these units of tau."""
    return bool(np.max(np.maximum(unit, 1.0 / unit)) <= LARGEST_UNIT)


def in_range(system: EnclosedSpace) -> bool:
    """True if nothing underflows with units of tau, and the discs have the radius one."""
    discs = system.discs
    return moderate_units(system.unit) and bool(np.all((discs.mid == 1.0) & (discs.rad == 0)))


def _enclosed(system: EnclosedSpace, numbers: SpaceWeights, normal: Floats, errors: float) -> LooseSolution | None:
    """The only solution by its distance from a point, None where it is not proven to be the only one."""
    tau, p, form = system.tau, len(system.tau), numbers.form(system)
    n = np.maximum(normal, 0.0)
    if form is None or n.shape != (p,) or not np.all(np.isfinite(n)):
        return None
    y, turn = Ball(np.zeros(len(system.g)), np.zeros(len(system.g))), form.numbers.turn
    y.mid[:p] = n
    for k in range(2):
        has = (tau[:, k] >= 0) & (n > 0)
        y[tau[has, k]] = Ball.exact(n[has]) * turn[has, k]
    change = _change(system, numbers, turn, n, displacements(system, y))
    reach = form.numbers.moved(change) / form.least * SAFE
    if not np.isfinite(reach):
        return None
    y = Ball(y.mid, (y.rad + reach) * SAFE)
    w = displacements(system, y)
    # open at every solution
    for i in np.flatnonzero((n == 0) & (w.mid[:p] + w.rad[:p] < 0)):
        y.rad[[i, *tau[i][tau[i] >= 0]]] = 0.0
    w = displacements(system, y)
    alone = form.serves(numbers.distances(system, y, w), errors)
    return LooseSolution.of(system, y, w, 1) if alone else None


def _change(system: EnclosedSpace, numbers: SpaceWeights, turn: Ball, n: Floats, w: Ball) -> Floats:
    """Bound of the change of the load, row by row, that makes a point with these lambda_n a solution."""
    p, change, apart, serves = len(n), w.size.copy(), n == 0, numbers.gaps_serve(system, w)
    change[:p][apart] = np.maximum(w.mid[:p] + w.rad[:p], 0.0)[apart] * SAFE
    for i, places in enumerate(system.tau):
        t = places[places >= 0]
        if numbers.whole[i]:
            # v along theta
            unit, theta = system.unit[t], turn[i][places >= 0]
            along = max(float(numbers.theta[i][places >= 0] @ (w.mid[t] / unit)), 0.0)
            change[t] = (w[t] - theta * Ball.exact(along * unit * unit)).size
        elif apart[i] and serves[i]:
            change[t] = 0.0
    return change


# -- over a piece of alpha --------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class PieceWeights:
    """The numbers of the form over a piece, node by node.

    Where there is no tau, components are 0.

    Attributes
    ----------
    mu, kappa : (p,) arrays
        Positive, with |nu| <= mu over the radius of every disc.
    nu : (p, 2) array
    thetas : pair of (p, 2) arrays
        At both ends of the piece; times the radii of the discs there they are psi, which is affine between.
    """

    mu: Floats
    kappa: Floats
    nu: Floats
    thetas: tuple[Floats, Floats]

    @classmethod
    def of(cls, system: EnclosedSpace, numbers: Floats) -> PieceWeights | None:
        """From one array: mu and kappa of all nodes, then nu and both thetas of all tau, in the order of y; or None."""
        p, m = len(system.tau), len(system.g)
        if numbers.shape != (2 * p + 3 * (m - p),) or not np.all(np.isfinite(numbers)):
            return None
        (mu, kappa), vectors = numbers[: 2 * p].reshape(2, p), numbers[2 * p :].reshape(3, m - p)
        place = np.where(system.tau >= 0, system.tau - p, m - p)
        nu, low, high = (np.append(vector, 0.0)[place] for vector in vectors)
        with np.errstate(over="ignore", invalid="ignore"):
            right = (mu > 0) & (kappa > 0) & (upper_norm(nu, axis=1) * system.largest_discs * SAFE <= mu)
        return cls(mu, kappa, nu, (low, high)) if np.all(right) else None

    def multipliers(self, system: EnclosedSpace, psi: Ball) -> Multipliers:
        """D of all nodes at an end of the piece."""
        return _multipliers(system, self.mu, self.kappa, self.nu, psi)


def only_on_curve(
    system: EnclosedSpace,
    piece: tuple[Fraction, Fraction],
    codes: Sequence[int],
    numbers: Floats,
    parts: CurveParts,
    errors: float = 1.0,
) -> bool:
    """True if all solutions over a piece with the statuses of an assignment are those of a curve.

    Parameters
    ----------
    system : EnclosedSpace
        Over the piece.
    piece : its ends
    codes : (partial) status codes; a sector counts as contact
    numbers : see ``PieceWeights.of``
    parts : of a curve that has a solution at every alpha of the piece
    errors : what is not known of theta counts as often: 1 proves, a writer of proofs takes more
    """
    weights = PieceWeights.of(system, numbers)
    if weights is None or not len(parts.alpha.mid) or not parts.allowed(codes):
        return False
    if not float(piece[1] - piece[0]) > TINY:
        return False
    if not moderate_units(system.unit):
        return False
    with np.errstate(all="ignore"):
        # psi at both ends of the piece, between which the form is between those of both
        psi = [_times(theta, discs) for theta, discs in zip(weights.thetas, system.end_discs, strict=True)]
        off, S = how_far_off(system, piece, weights, psi, parts) * (errors * SAFE), Ball(system.S, system.S_rad)
        ends = [weights.multipliers(system, end) for end in psi]
        lost = np.where(off > 0, weights.kappa * off * ends[0].slip_sizes(S) + TINY, 0.0)
        if not np.all(np.isfinite(lost)):
            return False
        return any(
            all(UniqueForm.of(S, end, off, lost, rows) is not None for end in ends)
            for rows in equations_tried(system, codes)
        )


def _times(theta: Floats, discs: Ball) -> Ball:
    return Ball.exact(theta) * Ball(discs.mid[:, None], discs.rad[:, None])


def _shares(piece: tuple[Fraction, Fraction], alpha: Ball) -> Ball:
    """Places of alphas in a piece, from -1 to 1."""
    middle, half = (piece[0] + piece[1]) / 2, (piece[1] - piece[0]) / 2
    near, inverse = float(middle), 1.0 / float(half)
    # rounded to nearest
    factor = Ball(np.array(inverse), np.array(4 * UNIT * inverse))
    share = (alpha - Ball(np.array(near), np.array(UNIT * abs(near) + TINY))) * factor
    low, high = np.maximum(share.mid - share.rad * SAFE, -1.0), np.minimum(share.mid + share.rad * SAFE, 1.0)
    return Ball(0.5 * (low + high), (0.5 * np.maximum(high - low, 0.0) + 4 * UNIT) * SAFE)


def how_far_off(
    system: EnclosedSpace,
    piece: tuple[Fraction, Fraction],
    weights: PieceWeights,
    psi: Sequence[Ball],
    parts: CurveParts,
) -> Floats:
    """Bound of the distance of psi from r theta with a theta that serves the curve's solution, (p,), at all alphas.

    Where nothing better is known |theta| <= 1.
    """
    rubs, shares = np.any(system.tau >= 0, axis=1), _shares(piece, parts.alpha)
    half = Ball.exact(np.array(0.5))
    middle, change = (psi[0] + psi[1]) * half, (psi[1] - psi[0]) * half
    at = Ball(middle.mid[None], middle.rad[None]) + shares[:, None, None] * change
    reference = system.references
    inverse = 1.0 / reference
    r = parts.F * Ball(inverse, np.where(rubs, 2 * UNIT * inverse, 0.0))
    theta, far = parts.thetas
    apart = upper_norm((Ball.exact(theta) * r[:, :, None] - at).size, axis=2) + r.size * far
    unknown = upper_norm(at.size, axis=2) + r.size
    off = np.minimum(np.where(np.isfinite(apart), apart, np.inf), unknown) * SAFE * SAFE
    inside = np.all([upper_norm(theta, axis=1) <= 1.0 for theta in weights.thetas], axis=0)
    normal, slip = parts.slips
    gap = np.where(parts.open, -(normal.mid + normal.rad * SAFE), 0.0)
    off = np.where(inside & _gaps_serve(weights, reference, at, r, (gap, slip)), 0.0, off)
    return np.where(rubs, np.max(off, axis=0), 0.0)


@dataclass(frozen=True)
class LeafReference(RootReference[Row]):
    """The strict root of a leaf, and its form."""

    system: EnclosedSpace
    root: SpaceRoot

    @classmethod
    def of(cls, system: EnclosedSpace, leaf: Codes, numbers: Floats, balance: float, share: float) -> Self | None:
        """None where the leaf holds no strict root, or its form is not proven definite where G d = 0.

        Parameters
        ----------
        system : EnclosedSpace
        leaf : final codes
        numbers : see ``SpaceWeights.of``; no node serves any theta
        balance : factor of |G d|^2
        share : c of theory, section 14.11
        """
        if not (0 <= balance < np.inf and abs(share) < np.inf) or not is_complete(system, leaf):
            return None
        with np.errstate(all="ignore"):
            weights = SpaceWeights.of(system, numbers)
            if weights is None or np.any(weights.wide > 0) or not in_range(system):
                return None
            root = settle(system, leaf)
            if not isinstance(root, SpaceRoot):
                return None
            off, loaded = weights.distances(system, root.y, root.w), (root.y, np.array(leaf) != OPEN)
            form = RootForm.of(
                Ball(system.S, system.S_rad), system.rows.G, weights.multipliers(system), off, loaded, balance, share
            )
        return None if form is None else cls(system, tuple(leaf), form, root)

    def _turning(self, turns: Floats) -> SpaceWeights | None:
        p, m = len(self.system.tau), len(self.system.g)
        numbers = np.concatenate([np.ones(2 * p), np.zeros(m), turns])
        return SpaceWeights.of(self.system, numbers) if turns.shape == (m - p,) else None

    def is_sole(self, turns: Floats, reach: Floats) -> bool:
        """True if this is the only root with |q| within reach, as what is in contact sticks (theory, section 14.15).

        Parameters
        ----------
        turns : (m - p,) array
            theta of all tau, for the multipliers mu = kappa = 1 and nu = 0.
        reach : (r,) array, may be infinite
        """
        weights, system = self._turning(turns), self.system
        slips = ~np.isin(self.selection, (OPEN, STICK)) & np.any(system.tau >= 0, axis=1)
        if weights is None or np.any(slips):
            return False
        with np.errstate(all="ignore"):
            body, root = (self.form.S, self.form.G), (self.root.y, self.root.w)
            within = ForceBound.of(body, weights.multipliers(system), root, reach)
            cost = None if within is None else self._costs_of_changes(weights, within)
            if within is None or cost is None:
                return False
            return self.form.is_sole(cost, within.least, within.left, within.farthest)

    def _costs_of_changes(self, weights: SpaceWeights, within: ForceBound) -> Floats | None:
        """Least costs of changes of w, (m,), of a root without slip; None where one may be nothing."""
        cost, system = np.zeros(len(self.system.g)), self.system
        serves = weights.gaps_serve(system, self.root.w)
        for i, (code, places) in enumerate(zip(self.selection, system.tau, strict=True)):
            t = places[places >= 0]
            if code == OPEN:
                if len(t) and not serves[i]:
                    return None
                continue
            cost[i] = max(float(self.root.y.mid[i] - self.root.y.rad[i]) / SAFE, 0.0)
            if len(t):
                held = within.holds_by(i)
                if not held > 0:
                    return None
                cost[t] = held / system.unit[t] / SAFE
        return cost

    def allow(self, codes: Sequence[int], rows: Sequence[Row], tight: Sequence[Row]) -> bool:
        """True if the first rows are equations, and the others nonnegative but not positive at the root.

        Raises
        ------
        ValueError
            A node has no such row.
        """
        for row in (*rows, *tight):
            sector_row_terms(row, self.system.tau, len(self.system.g))
        return all(self.is_equation(codes, row) for row in rows) and all(self.is_tight(codes, row) for row in tight)

    def is_equation(self, codes: Sequence[int], row: Row) -> bool:
        """True if a row on displacements vanishes below an assignment and at the root."""
        node = row[1]
        return row[0] in (GAP, SLIP) and row_sign(codes[node], row) == row_sign(self.selection[node], row) == FREE

    def is_tight(self, codes: Sequence[int], row: Row) -> bool:
        """True if a row on displacements is nonnegative below an assignment, and not positive at the root."""
        kind, node, _ = row
        if kind not in (GAP, ALONG, LEFT, RIGHT) or row_sign(codes[node], row) not in (NONNEGATIVE, FREE):
            return False
        code = self.selection[node]
        if code == STICK or (kind == GAP and code != OPEN):
            return True
        with np.errstate(all="ignore"):
            found = self.rows([row]) @ self.root.w[:, None]
        return bool(found.high[0, 0] <= 0)

    def rows(self, rows: Sequence[Row]) -> Ball:
        """Rows as coefficients of w.

        Raises
        ------
        ValueError
            A node has no such row.
        """
        size, unit = len(self.system.g), self.system.row_unit
        found = Ball.exact(np.zeros((len(rows), size)))
        for k, row in enumerate(rows):
            for i, coefficient in zip(*sector_row_terms(row, self.system.tau, size), strict=True):
                found.mid[k, i - size] = coefficient * unit[i]
                # a power of two; those of directions are rounded
                found.rad[k, i - size] = 0.0 if row[0] in (GAP, SLIP, ALONG) else UNIT * abs(found.mid[k, i - size])
        found.rad[:] = np.where(found.rad > 0, found.rad * SAFE + TINY, 0.0)
        return found
