"""Solutions as fixed points of Psi, which of several are reached from where, and its picture (theory, section 11.3)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.fixed_points.state import scaled_unknowns, slips_of
from enumsol.fixed_points.successive import successive_approximations
from enumsol.fixed_points.system import ContactSystem, checked_problem
from enumsol.fixed_points.tresca import node_values, solve_scaled
from enumsol.fixed_points.tresca_newton import TrescaData
from enumsol.support.arguments import alpha_value, positive_integer, positive_number, shown
from enumsol.support.array_arguments import plain_array, real_array
from enumsol.support.keeping import keeping
from enumsol.support.messages import counted
from enumsol.support.plotting import axes_or_none, checked_units, figure_of, in_units, kept, new_figure

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from enumsol.fixed_points.system import Problem
    from enumsol.support.array_types import Alpha, ArrayLike, Floats


#: Most random starts of a table.
MOST_STARTS = 1_000_000


def fixed_point_residual(problem: Problem, root: Any) -> float:
    """How far Psi moves a root, relative to the load [-].

    The largest change of a contact force when the Tresca problem with the root's normal forces as slip bounds, and
    the coefficients at its slips, is solved, with displacements at the root as the body itself has them: what S has
    lost by rounding does not count (theory, (11.12)).

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    root : Root, FixedPoint or other
        With alpha, lambda_n, lambda_t and u_t.

    Raises
    ------
    InvalidArgumentError
        The root has no forces, or belongs to another problem (its arrays have other shapes).
    """
    body = checked_problem(problem)
    if not hasattr(root, "alpha"):
        raise InvalidArgumentError(
            f"root is a {type(root).__name__} without alpha; expected a root of enumerate_roots or a fixed point"
        )
    system = ContactSystem.at(body, root.alpha)
    x = scaled_unknowns(system, root, "root")
    slip = system.scaled(node_values(slips_of(root, body.p, "root"), "slip", body.p), system.length, "slip")
    corrected, _ = system.corrected(x)
    data = TrescaData(corrected, np.maximum(system.split(x)[0], 0.0), system.coefficients(slip))
    image, _, _ = solve_scaled(data, x)
    return float(np.max(np.abs(image - x)[: system.m]))


def is_fixed_point(problem: Problem, root: Any, tolerance: float = 1e-8) -> bool:
    """Whether a root is a fixed point of Psi within a tolerance (theory, section 11.3).

    With coefficients that do not depend on the solution the fixed points are exactly the solutions with Coulomb
    friction; every root of `enumerate_roots` is one.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    root : Root, FixedPoint or other
        With alpha, lambda_n, lambda_t and u_t.
    tolerance : float
        Largest change of a contact force, relative to the load [-].

    Raises
    ------
    InvalidArgumentError
        The root has no forces, or belongs to another problem; the tolerance is not positive.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.one_node_triangle()
    >>> [enumsol.is_fixed_point(problem, root) for root in enumsol.enumerate_roots(problem, 5)]
    [True, True, True]
    """
    tolerance = positive_number(tolerance, "tolerance")
    return fixed_point_residual(problem, root) <= tolerance


def basin_table(
    problem: Problem,
    roots: Sequence[Any],
    starts: int | ArrayLike = 50,
    *,
    seed: int = 0,
    anderson: int = 0,
    tolerance: float = 1e-10,
    max_iterations: int = 1000,
    distance: float = 1e-6,
) -> pd.DataFrame:
    """Which of the roots successive approximations reach, start by start.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    roots : RootSet or sequence of roots at one alpha
    starts : int or (k, p) array_like
        Slip bounds to start from [force], or their number: random ones then, independent at the nodes, with sizes
        log-uniform between 1e-3 and 10 times the largest normal force of all roots; the first start is 0.
    seed : int
        Of the random starts.
    anderson, tolerance, max_iterations
        As in `successive_approximations`.
    distance : float
        A limit counts as a root if no contact force differs by more, relative to the load [-].

    Returns
    -------
    DataFrame
        One row per start: ``start``, ``size`` (mean slip bound), ``outcome``, ``iterations``, ``contraction``, ``root``
        (its number, or <NA>) and ``away`` (distance from the nearest root). ``attrs["never"]`` lists the roots that
        no start reached.

    Raises
    ------
    InvalidArgumentError
        There are no roots, they belong to different alpha, or starts have the wrong shape.
    Interrupted, OutOfMemoryError
        On Ctrl-C, or where the memory does not suffice; ``partial`` is the table so far.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.one_node_triangle()
    >>> roots = enumsol.enumerate_roots(problem, 5)
    >>> table = enumsol.basin_table(problem, roots, starts=[[0.0], [0.1], [1.0], [10.0]])
    >>> table["root"].to_list(), table.attrs["never"]
    ([0, 0, 2, 2], [1])
    """
    import pandas as pd  # for frames only

    body = checked_problem(problem)
    alpha = _common_alpha(roots)
    distance = positive_number(distance, "distance")
    system = ContactSystem.at(body, alpha)
    known = np.array([scaled_unknowns(system, root, f"root {k}") for k, root in enumerate(roots)])[:, : system.m]
    bounds = _starts(starts, seed, roots, body.p)
    rows: list[dict[str, Any]] = []

    def work() -> pd.DataFrame:
        for k, bound in enumerate(bounds):
            found = successive_approximations(body, alpha, bound, tolerance, max_iterations, anderson)
            away = np.max(np.abs(known - scaled_unknowns(system, found)[: system.m]), axis=1)
            nearest = int(np.argmin(away))
            reached = found.converged and away[nearest] <= distance
            rows.append(
                {
                    "start": k,
                    "size": float(np.mean(bound)),
                    "outcome": found.outcome.value,
                    "iterations": found.iterations,
                    "contraction": found.contraction_factor,
                    "root": nearest if reached else pd.NA,
                    "away": float(away[nearest]),
                }
            )
        return table()

    def table() -> pd.DataFrame:
        names = ("start", "size", "outcome", "iterations", "contraction", "root", "away")
        made = pd.DataFrame(rows, columns=names).astype({"root": "Int64"})
        made.attrs["never"] = sorted(set(range(len(roots))) - set(made["root"].dropna().astype(int)))
        return made

    return keeping("basin_table", work, lambda _: table(), lambda made: f" after {len(made)} of {len(bounds)} starts")


def _common_alpha(roots: Sequence[Any]) -> Alpha:
    try:
        alphas = [alpha_value(root.alpha, "alpha of a root") for root in roots]
    except (TypeError, AttributeError):
        raise InvalidArgumentError(
            f"roots is {shown(roots)}; expected a RootSet or a sequence of roots, all at the same alpha"
        ) from None
    if len(set(alphas)) != 1:
        raise InvalidArgumentError(
            f"roots has {counted(len(alphas), 'root')} at {counted(len(set(alphas)), 'alpha')}; expected at least one, "
            "all at the same alpha"
        )
    return alphas[0]


def _starts(starts: int | ArrayLike, seed: int, roots: Sequence[Any], p: int) -> Floats:
    if plain_array(starts, "starts", error=InvalidArgumentError).ndim == 0:
        count = positive_integer(starts, "starts", most=MOST_STARTS)
        size = max(float(np.max(root.lambda_n)) for root in roots) or 1.0
        rng = np.random.default_rng(positive_integer(seed, "seed", least=0))
        scale = size * 10.0 ** rng.uniform(-3.0, 1.0, (count, 1))
        bounds = scale * rng.uniform(0.0, 1.0, (count, p))
        bounds[0] = 0.0
        return bounds
    bounds = real_array(starts, "starts", error=InvalidArgumentError)
    if bounds.ndim != 2 or len(bounds) == 0 or bounds.shape[1] != p:
        raise InvalidArgumentError(
            f"starts has shape {bounds.shape}; expected (k, p) = (k, {p}) with k >= 1, or a number of starts"
        )
    return bounds


_MARKERS = "osD^v<>P*h"
#: Up to as many iterations the axis of iterations is linear.
_LINEAR = 20


def plot_basins(table: pd.DataFrame, ax: Any = None, *, units: tuple[str, str] | None = None, file: Any = None) -> Any:
    """Every start of a `basin_table`: iterations against the mean slip bound, marked by the root that is reached.

    Parameters
    ----------
    table : DataFrame
        Of `basin_table`.
    ax : matplotlib Axes or None
        Draw there; None: in a new figure.
    units : (str, str), optional
        Of forces and of lengths, for the axis.
    file : path, optional
        Save the figure there.

    Returns
    -------
    matplotlib.figure.Figure
        The roots that no start reaches are named in its title. Notebooks show it.

    Raises
    ------
    InvalidArgumentError
        The table was not made by `basin_table`, or ``ax`` is no Axes.
    MissingDependencyError
        matplotlib is not installed.
    """
    missing = {"size", "iterations", "root", "outcome"} - set(getattr(table, "columns", ()))
    if missing:
        raise InvalidArgumentError(f"table lacks {', '.join(sorted(missing))}; expected what basin_table returns")
    if axes_or_none(ax) is None:
        ax = new_figure(figsize=(6.4, 4.2)).subplots()
    from matplotlib.ticker import MaxNLocator  # there, where there are axes

    for root in sorted(table["root"].dropna().astype(int).unique().tolist()):
        rows = table[table["root"] == root]
        style = {"marker": _MARKERS[root % len(_MARKERS)], "color": f"C{root}"}  # the same in every picture
        label = f"root {root}: {counted(len(rows), 'start')}"
        ax.plot(rows["size"], rows["iterations"], ls="", alpha=0.7, label=label, **style)
    lost = table[table["root"].isna()]
    for outcome, rows in lost.groupby("outcome"):
        label = f"no root ({outcome}): {counted(len(rows), 'start')}"
        ax.plot(rows["size"], rows["iterations"], "x", color="black", label=label)
    positive = table["size"][table["size"] > 0]
    # a power of ten, so that no tick comes to lie between 0 and the first one
    ax.set_xscale("symlog", linthresh=10.0 ** math.floor(math.log10(positive.min())) if len(positive) else 1.0)
    if table["iterations"].max() > _LINEAR:
        ax.set_yscale("log")
    else:
        ax.yaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_xlabel(in_units("mean slip bound of the start", "force", checked_units(units) or ("force", "length")))
    ax.set_ylabel("iterations")
    never = table.attrs.get("never", [])
    names = ", ".join(map(str, never))
    ax.set_title(f"never reached: {'roots' if len(never) > 1 else 'root'} {names}" if names else "never reached: none")
    ax.legend()
    return kept(figure_of(ax), file)
