"""The discrete contact problem: data, validation and the paths of friction and load over alpha."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidProblemError
from enumsol.model.contact_body import ContactBody, check_signs, span, vector
from enumsol.support.arguments import exact_number, instance_of, shown
from enumsol.support.immutable import sealed

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from enumsol.model.mesh import BodyMesh
    from enumsol.support.array_types import ArrayLike, Floats


class ContactProblem(ContactBody):
    """A linear elastic body on a rigid foundation with Coulomb friction (theory, section 1.1).

    Find u, lambda_n, lambda_t with::

        A u + Bn' lambda_n + Bt' lambda_t = f(alpha)
        lambda_n >= 0,  u_n = Bn u - gap <= 0,  lambda_n u_n = 0
        |lambda_t| <= F lambda_n,  u_t = Bt u - slip_offset
        u_t > 0 => lambda_t = F lambda_n;  u_t < 0 => lambda_t = -F lambda_n

    with F(alpha) = friction + alpha friction_slope and f(alpha) = f + alpha load_slope. The object is immutable: its
    arrays are read-only, and every access to A, Bn or Bt gives a new sparse matrix, made in O(1) on read-only parts.
    ``problem.replace(f=2 * problem.f)`` makes another one, the same but for what is named.

    Data are taken exactly as given: what float64 cannot hold (an integer above 2^53, digits of a longdouble) is
    refused. Sparse matrices may have any format of scipy.sparse; arrays of bool count as 0 and 1.

    Parameters
    ----------
    A : (n, n) array_like or sparse
        Stiffness, symmetric positive definite [force / length]. An asymmetry within 1e-12 max|A| is averaged away.
    Bn, Bt : (p, n) array_like or sparse
        Normal and tangential displacement of the p contact nodes as rows; [Bn; Bt] of full rank.
    f : (n,) array_like
        Load at alpha = 0 [force].
    gap : float or (p,) array_like
        Initial normal gap [length]; negative is a press fit.
    friction, friction_slope : float or (p,) array_like, or None
        Coulomb coefficient at alpha = 0, and its derivative with respect to alpha [-]. One that is not given is 0;
        without both F(alpha) = alpha.
    load_slope : (n,) array_like or None
        Derivative of the load with respect to alpha [force / unit of alpha].
    slip_offset : float or (p,) array_like
        Tangential position from which slip is counted [length].
    node_ids : sequence of length p or None
        Labels of the contact nodes for frames and messages; default 0 .. p-1.
    coordinates : (p, 2) array_like or None
        Positions of the contact nodes, for plots [length].
    mesh : BodyMesh or None
        The mesh the problem was made of, for pictures of deformed bodies; no part of the fingerprint.
    rigid_modes : (n, r) array_like or None
        Of a body that nothing holds: all displacements, one in a column, that A offers no resistance to. A is then
        positive semidefinite and A N = 0 within ``1e-9 |A| |N|`` (theory, section 14). `enumerate_roots`, `is_unique`,
        `multiplicity_table`, `verify`, `newton`, `follow`, in 2D also `branch_graph` and exact `histories` take such a
        body, all else refuses it.
    max_rigid_displacement : float or None
        Solutions are sought whose rigid displacement N q, at the degrees of freedom where it equals u, has no component
        above this [length]. Default: ten times the size of the mesh, or of the contact nodes' ``coordinates``; without
        these a thousand times the largest displacement of a contact node if springs as stiff as the body held it,
        rounded up to a power of two.

    mass : (n, n) array_like or sparse, or None
        Mass, symmetric and positive semidefinite [force time^2 / length]; it says which equilibria run away
        (`stability`) and changes nothing else. Without it that of ``mesh`` with a uniform density.

    Raises
    ------
    InvalidProblemError
        The data cannot be used; the message names the argument, what was found and what was expected.

    Examples
    --------
    >>> import enumsol
    >>> A, Bn, Bt, f = [[2, -1], [-1, 2]], [[1, 0]], [[0, 1]], [1.5, -4]
    >>> enumsol.ContactProblem(A, Bn, Bt, f, friction=0.5, friction_slope=1)
    ContactProblem with 1 contact node
      degrees of freedom  2  (A: 4 nonzeros)
      friction            0.5 + alpha 1
      load                constant,  max |f| = 4
      gap                 0
    """

    def __init__(
        self,
        A: ArrayLike | sp.sparray | sp.spmatrix,
        Bn: ArrayLike | sp.sparray | sp.spmatrix,
        Bt: ArrayLike | sp.sparray | sp.spmatrix,
        f: ArrayLike,
        gap: ArrayLike = 0.0,
        friction: ArrayLike | None = None,
        friction_slope: ArrayLike | None = None,
        load_slope: ArrayLike | None = None,
        slip_offset: ArrayLike = 0.0,
        node_ids: Iterable[object] | None = None,
        coordinates: ArrayLike | None = None,
        mesh: BodyMesh | None = None,
        rigid_modes: ArrayLike | None = None,
        max_rigid_displacement: float | None = None,
        mass: ArrayLike | sp.sparray | sp.spmatrix | None = None,
    ) -> None:
        super().__init__(A, {"Bn": Bn, "Bt": Bt}, f, gap, load_slope, node_ids, coordinates)
        self.friction, self.friction_slope = _friction(*given_friction(friction, friction_slope), self.p)
        self.slip_offset = vector(slip_offset, "slip_offset", self.p, broadcast=True)
        self._complete(mesh, rigid_modes, max_rigid_displacement, mass)

    @property
    def Bt(self) -> sp.csr_array:  # noqa: N802 (the field's letter)
        """Tangential displacement of the contact nodes, sparse (p, n); a new object as A is."""
        return self._rows["Bt"].matrix()

    def at_contact_nodes(self) -> ContactProblem:
        """Body with the displacements of its contact nodes as the only unknowns, n = 2p.

        A is the inverse of the condensed compliance S, so that the solutions are those of this problem up to rounding
        (theory, section 4.1). Exact arithmetic takes at most 250 degrees of freedom: it can decide here what it cannot
        take as given. What is decided is about the rounded matrices. Where two conditions vanish together in this
        problem, as by symmetry, they may do so a little apart in the other. On weak springs rounding counts for
        more: it may move a critical alpha in the sixth digit.

        Raises
        ------
        InvalidProblemError
            The contact rows are not independent beyond rounding.
        NotHeldError
            Nothing but contact holds the body.

        Examples
        --------
        >>> import enumsol
        >>> problem = enumsol.gallery.dovetail()
        >>> small = problem.at_contact_nodes()
        >>> small.n == 2 * problem.p
        True
        >>> (given,), (same,) = (enumsol.enumerate_roots(body, alpha=0.2) for body in (problem, small))
        >>> round(float(same.lambda_n.sum() / given.lambda_n.sum()), 9)
        1.0
        """
        from enumsol.condensation.condensed import cholesky_factor  # as above

        condensed = self.condensed
        cholesky_factor(condensed.balanced)
        scale = condensed.node_scale
        A = np.linalg.inv(condensed.balanced) / scale[:, None] / scale
        offset = np.concatenate([self.gap, self.slip_offset])
        rows = np.eye(2 * self.p)
        return ContactProblem(
            0.5 * (A + A.T),
            rows[: self.p],
            rows[self.p :],
            A @ (condensed.g0 + offset),
            gap=self.gap,
            friction=self.friction,
            friction_slope=self.friction_slope,
            load_slope=None if self.load_slope is None else A @ condensed.g1,
            slip_offset=self.slip_offset,
            node_ids=self.node_ids,
            coordinates=self.coordinates,
        )

    @property
    def affine_friction(self) -> tuple[Floats, Floats]:
        """Coefficients at alpha = 0 and their derivatives, (p,) both."""
        return self.friction, self.friction_slope

    @staticmethod
    def constant_friction(values: Floats) -> dict[str, Any]:
        """The attributes of a problem with coefficients that do not depend on alpha, for ``model.restart``."""
        return {"friction": sealed(values), "friction_slope": sealed(np.zeros_like(values))}

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of all data, as 64 hexadecimal digits; proofs are bound to it."""
        return self._digest(b"enumsol problem 1", self.affine_friction)

    def __repr__(self) -> str:
        slope = f" + alpha {span(self.friction_slope)}" if np.any(self.friction_slope) else ""
        return self._text(f"{span(self.friction)}{slope}")


def given_friction(friction: object, slope: object) -> tuple[Any, Any]:
    """Coefficients and their derivatives: what is not given is 0, and without both F(alpha) = alpha."""
    if friction is None and slope is None:
        return 0.0, 1.0
    return 0.0 if friction is None else friction, 0.0 if slope is None else slope


def old_friction(value: object, written: Callable[[str], str], slope_written: Callable[[str], str]) -> str:
    """Advice for a pair (F0, F1), which once stood for F(alpha) = F0 + alpha F1; "" for anything else.

    ``written`` and ``slope_written`` are how a number is given for the coefficient and for its slope.
    """
    if not isinstance(value, (tuple, list)) or len(value) != 2:
        return ""
    plain = all(exact_number(part) is not None for part in value)
    F0, F1 = (shown(part).removesuffix(".0") for part in value) if plain else ("F0", "F1")
    return f"for F(alpha) = {F0} + {F1} alpha write {written(F0)} and {slope_written(F1)}"


def _friction(friction: object, slope: object, p: int) -> tuple[Floats, Floats]:
    if instead := old_friction(friction, "friction={}".format, "friction_slope={}".format):
        array = ", for coefficients of two contact nodes friction=np.array([...])" if p == 2 else ""
        raise InvalidProblemError(
            f"friction is the pair {shown(friction)}; expected one coefficient, or one for each contact node: "
            f"{instead}{array}"
        )
    F0 = vector(friction, "friction", p, broadcast=True)
    F1 = vector(slope, "friction_slope", p, broadcast=True)
    if not np.any(F1):
        check_signs(F0, range(p))
    return F0, F1


def check_is_problem(problem: object) -> None:
    """Refuse what is no problem, in 2D or in 3D.

    Raises
    ------
    InvalidArgumentError
        It is something else.
    """
    if not isinstance(problem, ContactBody):
        instance_of(problem, ContactProblem, "problem")
