"""History: what histories found, the questions it answers, and its files (theory, section 13).

A file is JSON with every number to the last bit, and the proofs of the searches.
"""

from __future__ import annotations

import base64
import json
from dataclasses import asdict, dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.condensation.condensed import condensation_of
from enumsol.errors import InvalidArgumentError
from enumsol.loading import history_data
from enumsol.loading.steps import LoadStep
from enumsol.model.problem import check_is_problem
from enumsol.model.restart import SlipStart, restarted
from enumsol.model.statuses import ContactStatus
from enumsol.proof.proof_file import Proof
from enumsol.roots.root import Enclosure, Polytope, Root, RootFamily, summary
from enumsol.roots.root_set import RigidBound, RootSet, SearchStats, Undecided
from enumsol.support.arguments import file_path, positive_integer, shown
from enumsol.support.files import plain_value, reading, write_file
from enumsol.support.immutable import Listed
from enumsol.support.plotting import checked_units, kept
from enumsol.support.saved import Array, Maybe, check_kind, is_fraction, is_number, json_from

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    import pandas as pd
    import scipy.sparse as sp

    from enumsol.model.problem3d import AnyProblem
    from enumsol.roots.stability import Stability
    from enumsol.support.array_types import Alpha, ArrayLike

FORMAT, VERSION = "enumsol-history", 3
_ARRAYS = ("lambda_n", "lambda_t", "u_n", "u_t")
_BOUNDS = (*_ARRAYS, "rigid_coordinates")
#: What the file holds as it is: of a root, and of the roots of a stage.
_OF_ROOT, _OF_ROOTS = ("index", "regular", "margin"), ("stopped", "at_least", "certified_data")


def save_history(data: history_data.HistoryData, file: str | Path) -> None:
    """Write the history, with the proofs of its searches, as JSON; the problem is not part of the file.

    Raises
    ------
    InvalidArgumentError
        The file cannot be written.
    """
    record = {
        "format": FORMAT,
        "version": VERSION,
        "problem": data.problem.fingerprint,
        "arithmetic": data.arithmetic,
        "steps": [_step(step) for step in data.steps],
        "stages": [_stage(stage) for stage in data.all_stages],
        "parents": data.parents,
        "followed": sorted(data.followed),
        "reasons": data.reasons,
        "seconds": data.seconds,
        "refinement": None if data.refinement is None else asdict(data.refinement),
    }
    write_file(file_path(file, "file"), json.dumps(record, default=plain_value), "file")


def load_history(file: str | Path, problem: AnyProblem) -> History:
    """Read what save_history wrote (see History.load).

    Raises
    ------
    InvalidArgumentError
        The file cannot be read, holds something else, or a history of another problem.
    """
    place = file_path(file, "file")
    with reading(place, "a history", "History.save"):
        record = json_from(place.read_bytes())
        if record["format"] != FORMAT or record["version"] != VERSION:
            raise InvalidArgumentError(f"{place} has another format; expected {FORMAT}, version {VERSION}")
        if record["problem"] != problem.fingerprint:
            raise InvalidArgumentError(f"{place} holds a history of another problem (its fingerprint is different)")
        check_kind(record, _kind(problem, record["steps"]), "history")
        _check_nodes(record)
        steps = tuple(_read_step(step, problem) for step in record["steps"])
        stages = tuple(_read_stage(k, item, problem, steps, record) for k, item in enumerate(record["stages"]))
        refinement = record["refinement"]
        if refinement is not None:
            refinement = history_data.Refinement(**refinement | {"changed_at": tuple(refinement["changed_at"])})
        return History(
            problem,
            steps,
            record["arithmetic"],
            stages,
            tuple(tuple((a, b) for a, b in parents) for parents in record["parents"]),
            frozenset((a, b) for a, b in record["followed"]),
            tuple(record["reasons"]),
            record["seconds"],
            refinement,
        )


def _kind(problem: AnyProblem, steps: Sequence[object]) -> dict[str, Any]:
    """Kinds of what a file holds."""
    p, shape, modes = problem.p, problem.slip_offset.shape, problem.modes.r
    known = {status.value for status in ContactStatus}
    statuses, slips = (known,) * p, Array(*shape)
    vectors = dict(zip(_ARRAYS, (Array(p), slips) * 2, strict=True))
    bounds = dict(zip(_BOUNDS, (*(Array(p, 2), Array(*shape, 2)) * 2, Maybe(Array(modes, 2))), strict=True))
    root = {
        **{"statuses": statuses, "active": ([known],) * p, **vectors},
        **{"index": Maybe(int), "regular": bool, "margin": is_number, "bounds": Maybe(bounds)},
        **{"slips": Maybe([is_fraction]), "angles": Maybe(((str, str),) * p), "rigid": Maybe(Array(modes))},
    }
    part = (statuses, Array(None, p, 2), range(3 * p + 7), Maybe(Array(None, modes)))
    stage = {
        **{"step": range(1, 1 + len(steps)), "offset": slips, "radius": Maybe(slips), "exact": Maybe([is_fraction])},
        **{"reasons": [str], "alpha": is_fraction, "as_float": bool, "roots": [root]},
        "families": [{"polytopes": [part], "index": Maybe(int), "proven": bool}],
        "undecided": [((Maybe(str),) * p, str, str, int)],
        **{"stopped": Maybe(str), "at_least": int, "certified_data": {"problem", "condensed"}},
        **{"bound_needed": Maybe(bool), "beyond_limit": Maybe(is_number)},
        **{"stats": {"nodes": int, "closed": int, "seconds": float}, "proof": Maybe(str)},
    }
    node = (int, int)
    refinement = {"halvings": int, "settled": bool, "changed_at": [int], "reason": Maybe(str)}
    return {
        "arithmetic": {"verified", "exact", "fast"},
        "steps": [
            {
                "alpha": Maybe(is_fraction),
                "friction": Maybe(lambda value: isinstance(value, list)),
                "load": Maybe(Array(problem.n)),
            }
        ],
        **{"stages": [stage], "parents": [[node]], "followed": [node], "reasons": [str]},
        **{"seconds": is_number, "refinement": Maybe(refinement)},
    }


def _check_nodes(record: dict[str, Any]) -> None:
    """Refuse a file that names roots which are not in it, or are of another step than the one before."""
    roots = [0] * (len(record["steps"]) + 1)
    for stage in record["stages"]:
        roots[stage["step"]] += len(stage["roots"])
    parents = [
        (stage["step"] - 1, *node)
        for stage, nodes in zip(record["stages"], record["parents"], strict=True)
        for node in nodes
    ]
    for before, step, root in [*parents, *((step, step, root) for step, root in record["followed"])]:
        if before != step or not 0 < step < len(roots) or root not in range(roots[step]):
            raise ValueError(f"there is no root {step, root} before one that follows it")


def _step(step: LoadStep) -> dict[str, Any]:
    alpha = None if step.alpha is None else step.exact_alpha
    return {"alpha": alpha, "friction": step.friction, "load": step.load}


def _read_step(record: dict[str, Any], problem: AnyProblem) -> LoadStep:
    alpha = None if record["alpha"] is None else Fraction(record["alpha"])
    step = LoadStep(alpha, None if record["friction"] is None else np.array(record["friction"]), record["load"])
    return step.on(problem, 1)


def _stage(stage: history_data.Stage) -> dict[str, Any]:
    start, roots = stage.start, stage.roots
    return {
        "step": stage.step,
        "offset": start.offset,
        "radius": start.radius,
        "exact": start.exact,
        "reasons": stage.reasons,
        "alpha": Fraction(roots.alpha),
        "as_float": isinstance(roots.alpha, float),
        "roots": [_root(root) for root in roots],
        "families": [_family(family) for family in roots.families],
        "undecided": [[part.statuses, part.reason, part.hint, part.leaves] for part in roots.undecided],
        **{name: getattr(roots, name) for name in _OF_ROOTS},
        "bound_needed": None if roots.rigid_bound is None else roots.rigid_bound.needed,
        "beyond_limit": None if roots.rigid_bound is None else roots.rigid_bound.beyond_limit,
        "stats": {"nodes": roots.stats.nodes, "closed": roots.stats.closed, "seconds": roots.stats.seconds},
        "proof": None if roots.proof is None else base64.b64encode(roots.proof.content()).decode(),
    }


def _read_stage(
    number: int, record: dict[str, Any], problem: AnyProblem, steps: tuple[LoadStep, ...], whole: dict[str, Any]
) -> history_data.Stage:
    exact = None if record["exact"] is None else tuple(map(Fraction, record["exact"]))
    radius = None if record["radius"] is None else np.array(record["radius"])
    start = SlipStart(np.array(record["offset"]), radius, exact)
    step = steps[record["step"] - 1]
    body = restarted(problem, start, step.load, step.friction)
    alpha = float(Fraction(record["alpha"])) if record["as_float"] else Fraction(record["alpha"])
    needed, proof = (
        record["bound_needed"],
        None if record["proof"] is None else Proof(base64.b64decode(record["proof"])),
    )
    roots = RootSet(
        alpha=alpha,
        roots=[_read_root(item, alpha, body) for item in record["roots"]],
        families=[_read_family(item, alpha) for item in record["families"]],
        undecided=[Undecided(_statuses(names), *rest) for names, *rest in record["undecided"]],
        arithmetic=whole["arithmetic"],
        method="tree",
        **{name: record[name] for name in _OF_ROOTS},
        stats=SearchStats(**record["stats"]),
        node_ids=problem.node_ids,
        proof=proof,
        rigid_bound=None if needed is None else RigidBound(body.rigid_reach, needed, record["beyond_limit"]),
    )
    return history_data.Stage(number, record["step"], start, roots, body, tuple(record["reasons"]))


def _root(root: Root) -> dict[str, Any]:
    bounds = root.enclosure
    return {
        "statuses": root.statuses,
        "active": [sorted(status.value for status in held) for held in root.active],
        **{name: getattr(root, name) for name in (*_ARRAYS, *_OF_ROOT)},
        "bounds": None if bounds is None else {name: getattr(bounds, name) for name in _BOUNDS},
        "slips": root.exact_slips,
        "angles": None if root.slip_angle is None else [[float(a).hex() for a in pair] for pair in root.slip_angle],
        "rigid": root.rigid_coordinates,
    }


def _read_root(record: dict[str, Any], alpha: Alpha, problem: AnyProblem) -> Root:
    bounds, slips, angles = (record[name] for name in ("bounds", "slips", "angles"))
    arrays = {name: _array(record[name]) for name in _ARRAYS}
    return Root(
        alpha=alpha,
        statuses=_statuses(record["statuses"]),
        active=tuple(frozenset(_statuses(names)) for names in record["active"]),
        **arrays,
        **{name: record[name] for name in _OF_ROOT},
        enclosure=None if bounds is None else Enclosure(**{name: _array(bounds[name]) for name in _BOUNDS}),
        slip_angle=None if angles is None else np.array([[float.fromhex(a) for a in pair] for pair in angles]),
        _condensed=condensation_of(problem),
        _rigid=_array(record["rigid"]),
        _exact_slips=None if slips is None else tuple(map(Fraction, slips)),
    )


def _family(family: RootFamily) -> dict[str, Any]:
    parts = [[part.statuses, part.vertices, part.dimension, part.rigid_coordinates] for part in family.polytopes]
    return {"polytopes": parts, "index": family.index, "proven": family.vertices_proven}


def _array(values: object) -> Any:
    return None if values is None else np.array(values, dtype=np.float64)


def _read_family(record: dict[str, Any], alpha: Alpha) -> RootFamily:
    parts = tuple(
        Polytope(_statuses(names), np.array(vertices), dimension, _array(rigid))
        for names, vertices, dimension, rigid in record["polytopes"]
    )
    return RootFamily(alpha, parts, record["index"], vertices_proven=record["proven"])


def _statuses(names: list[Any]) -> tuple[Any, ...]:
    known = {status.value: status for status in ContactStatus}
    return tuple(known.get(name, name) for name in names)


@dataclass(frozen=True, eq=False, repr=False)
class History(history_data.HistoryData):
    """All histories of solutions that a sequence of loads may leave behind (made by ``histories``).

    A node is a pair (step, root): steps are numbered from 1, the roots of one step from 0. (0, 0) is the start.

    Attributes
    ----------
    problem : ContactProblem or ContactProblem3D
    steps : tuple of LoadStep
    arithmetic : str
    graph : networkx.DiGraph
        Nodes with the attributes root (a `Root`, None at the start), stage, statuses, alpha and dissipated (in the step
        alone); an edge leads from a root to every root of the next step that may follow it. Where several roots leave
        the contact nodes at the same place, they have the same successors, and the graph is no tree.
    reasons : tuple of str
        Why the history is not complete; each names its step.
    refinement : Refinement or None
        What halving the increments changed, if it was requested.

    Examples
    --------
    >>> import enumsol
    >>> history = enumsol.histories(enumsol.gallery.one_node_triangle(), [5, 4])
    >>> history.unique_until, history.counts, len(history.ends), history.complete
    (0, (3, 5), 5, True)
    """

    # -- what is proven --------------------------------------------------------------------------------------------

    @property
    def complete(self) -> bool:
        """True if it is proven that these are all histories: every step complete, every root followed to the end."""
        return self.arithmetic != "fast" and not self.reasons

    proof = property(history_data.history_proof)

    # -- the graph -------------------------------------------------------------------------------------------------

    def root(self, node: history_data.Node) -> Root:
        """The root of a node.

        Raises
        ------
        InvalidArgumentError
            There is no such node.
        """
        if not isinstance(node, tuple) or node not in self.graph or node == history_data.START:
            raise InvalidArgumentError(f"node is {shown(node)}; expected a pair (step, root) of this history")
        found: Root = self.graph.nodes[node]["root"]
        return found

    def roots(self, step: int) -> tuple[Root, ...]:
        """All roots of one step, from 1, of whatever start.

        Raises
        ------
        InvalidArgumentError
            There is no such step.
        """
        number = positive_integer(step, "step", most=len(self.steps))
        return Listed((self.graph.nodes[node]["root"] for node in self.nodes_of(number)), "root")

    @property
    def branchings(self) -> tuple[history_data.Node, ...]:
        """Nodes that more than one root may follow; (0, 0) if the first step has several."""
        return Listed((node for node, degree in self.graph.out_degree() if degree > 1), "branching")

    @property
    def ends(self) -> tuple[history_data.Node, ...]:
        """Nodes that nothing follows: those of the last step, and those after which nothing was searched or found."""
        ends = (node for node, degree in self.graph.out_degree() if degree == 0 and node != history_data.START)
        return Listed(ends, "end")

    def stability(
        self, *, mass: ArrayLike | sp.sparray | sp.spmatrix | None = None
    ) -> Mapping[history_data.Node, Stability]:
        """Which roots run away, by their nodes (see `enumsol.stability`).

        Printed histories, tables and pages say it at every step from then on, for the last mass that was asked for.

        Parameters
        ----------
        mass : (n, n) array_like or sparse, optional
            By default that of the problem.

        Raises
        ------
        InvalidArgumentError, InvalidProblemError
            As `enumsol.stability`.
        """
        for stage in self.all_stages:
            stage.roots.stability(mass=mass)
        return self.verdicts or {}

    # -- results ---------------------------------------------------------------------------------------------------

    def to_frame(self) -> pd.DataFrame:
        """Table with a row per node: step, alpha, root, parents, stage, statuses, index, regular and sums.

        ``lambda_n`` and ``lambda_t`` (in 3D lambda_t1, lambda_t2) are sums over the contact nodes, ``dissipated`` is
        the work of friction in the step, ``dissipated_least`` and ``dissipated_most`` that since the start,
        ``radius`` how far the start of the step may be from its midpoint, and ``followed`` tells whether a next step
        begins here. Once `stability` was asked for, ``stability`` is the verdict.
        """
        verdicts = self.verdicts
        import pandas as pd

        rows = []
        for node in self.graph:
            if node == history_data.START:
                continue
            given, root = self.graph.nodes[node], self.root(node)
            shear = np.sum(root.lambda_t, axis=0)
            names = ["lambda_t"] if root.lambda_t.ndim == 1 else ["lambda_t1", "lambda_t2"]
            rows.append(
                {
                    "step": node[0],
                    "alpha": float(root.alpha),
                    "root": node[1],
                    "parents": tuple(self.graph.predecessors(node)),
                    "stage": given["stage"],
                    "contact": summary(root.statuses),
                    "index": root.index,
                    "regular": root.regular,
                    **({} if verdicts is None else {"stability": verdicts[node].verdict}),
                    "lambda_n": float(np.sum(root.lambda_n)),
                    **dict(zip(names, np.atleast_1d(shear).tolist(), strict=True)),
                    "dissipated": given["dissipated"],
                    "dissipated_least": self.dissipated[node][0],
                    "dissipated_most": self.dissipated[node][1],
                    "radius": self.all_stages[given["stage"]].largest_radius,
                    "followed": node in self.followed,
                }
            )
        return pd.DataFrame(rows).astype({"index": "Int64"}) if rows else pd.DataFrame(rows)

    def plot(
        self,
        x: object = "displacement",
        y: object = "alpha",
        *,
        units: tuple[str, str] | None = None,
        ax: object = None,
        file: str | Path | None = None,
    ) -> Any:
        """A figure of one quantity of the roots against another, a line for every history.

        Points that several histories share are grey; a point is open where the history was not followed, and a rhombus
        where the root is not regular. Ends have their names, and a legend beside the drawing tells the histories apart.

        Parameters
        ----------
        x, y : str or callable
            "step", "alpha", "displacement" (of the loaded degrees of freedom in the direction in which the load
            changes), "lambda_n" or "lambda_t" (sums over the contact nodes; in 3D along the first axis), "dissipated"
            (work of friction since the start), or a function of a `Root`.
        units : (str, str), optional
            Of forces and of lengths, for the axes.
        ax : matplotlib Axes or None
            Draw there; None: in a new figure.
        file : path, optional
            Save the figure there.

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        InvalidArgumentError
            There is no such quantity, or the file cannot be written.
        MissingDependencyError
            matplotlib is not installed.
        """
        from enumsol.loading.figures import draw_history  # matplotlib comes with the first picture

        return kept(draw_history(self, x, y, ax, checked_units(units)), file)

    @classmethod
    def load(cls, file: str | Path, problem: AnyProblem) -> History:
        """Read a history that `save` wrote, of this problem.

        Raises
        ------
        InvalidArgumentError
            The file cannot be read, holds something else, or a history of another problem.
        """
        given: Any = problem
        check_is_problem(given)
        return load_history(file, problem)

    def text(self, units: tuple[str, str] | None = None) -> str:
        """Text that is printed, with units of forces and lengths if they are given."""
        return history_data.history_text(self, checked_units(units))

    save = save_history
    __repr__ = history_data.history_text
    _repr_html_ = history_data.history_html
