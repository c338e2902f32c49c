"""RootSet: all solutions at one alpha."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.roots.root import Enclosure, Root, RootFamily, summary
from enumsol.support.arguments import shown
from enumsol.support.immutable import Immutable, Listed, Sealed
from enumsol.support.messages import PRINTED, counted, found_of, html_lines, html_table
from enumsol.support.plotting import checked_units, kept

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd
    import scipy.sparse as sp

    from enumsol.model.mesh import BodyMesh
    from enumsol.model.statuses import ContactStatus
    from enumsol.proof.proof_file import Proof
    from enumsol.roots.stability import Stabilities, Stability
    from enumsol.search.certifiers.protocol import Escalations
    from enumsol.support.array_types import Alpha, ArrayLike, Floats

_PRINTED_REGIONS = 5
_HEADS = ("", "index", "regular", "margin", "max lambda_n", "contact")
#: What the heads mean, below the table.
_EXPLAINED = (
    "index: the sign of a determinant; regular: no node is between two statuses",
    "margin: distance to the next change of status, relative to the largest values",
)
ABOUT_STABILITY = "stability: whether the body can leave it along a straight line, growing (proven where it is decided)"

#: Rotations above this are not small [degrees]: their cosine differs from one by 1.5 percent.
LARGEST_TURN = 10.0


@dataclass(frozen=True)
class Undecided(Sealed):
    """A part of the selections about which it is not known whether it holds roots; in 3D, a region.

    Attributes
    ----------
    statuses : tuple
        Per node a ContactStatus, the string "contact" (in contact, not known how), "open or slip+", "open or slip-", or
        None (nothing known).
    reason : str
        What could not be decided.
    hint : str
        What may help.
    leaves : int
        Number of parts of the search tree. In 3D those that touch are one region: the root that it may hold, or the
        continuum of them, may belong to any (theory, section 12.5).
    slip_angle : (p, 2) array or None
        In 3D: bounds of the angles of F u_t that a root in it has, as in Root; nan where it does not slip.
    bounds : Enclosure or None
        In 3D, arithmetic "verified": proven bounds of the forces and displacements of every root in it, with the shapes
        of Root. None where the search did not get there.

    Examples
    --------
    >>> import enumsol
    >>> roots = enumsol.enumerate_roots(enumsol.gallery.two_node_square(), alpha=3.5, max_nodes=2)
    >>> roots.undecided[0].reason
    'the search was stopped before it got here'

    A node in 3D that slides with any lambda_n from 0 to 1:

    >>> import numpy as np
    >>> A = np.array([[2, 1, 0], [1, 1, 0], [0, 0, 1]])
    >>> problem = enumsol.ContactProblem3D(A, *np.eye(3)[:, None], [1, 1, 0], friction=1)
    >>> region = enumsol.enumerate_roots(problem, alpha=0).undecided[0]
    >>> region.statuses, region.leaves, region.bounds.lambda_n.round(3).tolist()
    ((None,), 4, [[0.0, 1.207]])
    """

    statuses: tuple[ContactStatus | str | None, ...]
    reason: str
    hint: str
    leaves: int = 1
    slip_angle: Floats | None = field(default=None, compare=False)
    bounds: Enclosure | None = field(default=None, repr=False, compare=False)


@dataclass(frozen=True)
class SearchStats:
    """Statistics of an enumeration.

    Attributes
    ----------
    nodes : int
        Partial assignments examined by the tree (0 for the exhaustive method).
    pruned : int
        Partial assignments proven or, in fast arithmetic, computed to hold no solution.
    selections : int
        Complete selections whose linear system was solved.
    qps, fallback_qps : int
        Relaxations solved, and those the fallback solver had to solve.
    seconds : float
        Wall time.
    escalations : Escalations or None
        In verified arithmetic: how many decisions needed which arithmetic.
    presolved : int
        Contact nodes proven open or in contact before the search began to branch on alternatives.
    closed : int
        Partial assignments fathomed by the only solution that they may hold.
    resumed : int
        Nodes of the tree taken from the proof of an earlier search, and proven again. They are not among ``nodes``, but
        their results are among ``pruned``, ``selections`` and ``closed``.
    held, held_open : int
        Nodes that the file of this proof held, and those of them that were undecided there.
    redone : int
        Tasks of an executor that were done again because their worker died.

    Examples
    --------
    >>> import enumsol
    >>> stats = enumsol.enumerate_roots(enumsol.gallery.two_node_square(), alpha=3.5).stats
    >>> stats.nodes >= stats.pruned + stats.selections > 0
    True
    """

    nodes: int = 0
    pruned: int = 0
    selections: int = 0
    qps: int = 0
    fallback_qps: int = 0
    seconds: float = 0.0
    escalations: Escalations | None = None
    presolved: int = 0
    closed: int = 0
    resumed: int = 0
    held: int = 0
    held_open: int = 0
    redone: int = 0


@dataclass(frozen=True)
class RigidBound:
    """Within which rigid displacements the solutions of a body that nothing holds are all of them.

    Attributes
    ----------
    largest : float
        Bound of the components of the rigid displacement [length].
    needed : bool
        Whether anything rests on it. Otherwise there are no other solutions at all. Of a complete search of the tree
        in 2D, up to 250 degrees of freedom and from a slip offset that is known exactly, True says that there are
        solutions at the bound or beyond it; above 24 it says nothing more than that the bound was used where
        ``beyond_limit`` is not None.
    beyond_limit : float or None
        By how much the load exceeds what contact can hold, as a share of itself, as far as floats tell; negative where
        it is held. None unless it is so near to that limit that rounding may decide what solutions there are.

    Examples
    --------
    >>> import enumsol
    >>> enumsol.enumerate_roots(enumsol.gallery.block_on_table(), alpha=0).rigid_bound
    RigidBound(largest=20.0, needed=False, beyond_limit=None)
    """

    largest: float
    needed: bool
    beyond_limit: float | None = None

    @property
    def notes(self) -> tuple[str, ...]:
        """A sentence where the load is at the limit of what contact can hold."""
        if self.beyond_limit is None:
            return ()
        return (
            "as far as floats tell, the load is at the limit of what contact can hold, within "
            f"{max(abs(self.beyond_limit), 1e-16):.0e} of itself: there the body may be free to slide or tilt, and "
            "rounding may decide which solutions there are; change the load or the friction coefficients by more than "
            "that, or hold the body by a spring or a fixed point",
        )

    def words(self) -> str:
        """The end of the line that says whether the list is complete."""
        if self.needed:
            return f"within rigid displacements of {self.largest:g}"
        return "no bound of rigid displacements was needed"


class RootSet(Sequence[Root], Immutable):
    """All solutions at one alpha, as a sequence of the isolated roots in a deterministic order.

    Attributes
    ----------
    alpha : float or Fraction
    families : tuple of RootFamily
    undecided : tuple of Undecided
        Parts of the search without an answer; in 3D regions of leaves that touch.
    complete : bool
        True only when it is proven that nothing else solves the problem.
    arithmetic, method : str
    stopped : str or None
        Why the search ended early, or None.
    at_least : int
        Number of isolated roots and families together if nothing is known to be missing; otherwise a lower bound of it,
        in which roots and families that an undiscovered continuum may connect are counted as one.
    stats : SearchStats
    certified_data : str
        What completeness is about: "problem" (A, Bn, Bt, f as given) or "condensed" (S and g as computed).
    proof : Proof or None
        In verified arithmetic: the proof that ``enumsol.verify`` checks; None when the search was interrupted.
    rigid_bound : RigidBound or None
        Of a body that nothing holds: the bound of the rigid displacement within which all solutions are listed.

    Examples
    --------
    >>> import enumsol
    >>> roots = enumsol.enumerate_roots(enumsol.gallery.two_node_square(), alpha=3.5)
    >>> len(roots), roots.index_sum, roots.complete
    (5, 1, True)
    """

    def __init__(
        self,
        *,
        alpha: Alpha,
        roots: Sequence[Any],
        families: Sequence[RootFamily],
        undecided: Sequence[Undecided],
        arithmetic: str,
        method: str,
        stopped: str | None,
        stats: SearchStats,
        node_ids: tuple[Any, ...],
        at_least: int | None = None,
        certified_data: str = "problem",
        proof: Proof | None = None,
        rigid_bound: RigidBound | None = None,
    ) -> None:
        self.alpha = alpha
        self._roots = Listed(roots, "root")
        self.families = Listed(families, "family", "families")
        self.undecided = Listed(undecided, "undecided part")
        self.arithmetic = arithmetic
        self.method = method
        self.stopped = stopped
        self.stats = stats
        self.at_least = len(self._roots) + len(self.families) if at_least is None else at_least
        self.node_ids = node_ids
        self.certified_data = certified_data
        self.proof = proof
        self.rigid_bound = rigid_bound
        self._found: dict[str, Any] = {}
        self._freeze()

    def stability(self, *, mass: ArrayLike | sp.sparray | sp.spmatrix | None = None) -> tuple[Stability, ...]:
        """Which roots run away, one verdict a root in their order (see `enumsol.stability`).

        Families are not examined: what their nodes do changes from point to point.

        Printed root sets and tables have a column of them from then on, for the last mass that was asked for.

        Parameters
        ----------
        mass : (n, n) array_like or sparse, optional
            By default that of the problem.

        Raises
        ------
        InvalidArgumentError, InvalidProblemError
            As `enumsol.stability`.
        """
        if not len(self):
            self._found["verdicts"] = ()
            return ()
        return self._examined(mass)[1]

    def _examined(self, mass: ArrayLike | sp.sparray | sp.spmatrix | None) -> tuple[Stabilities, tuple[Stability, ...]]:
        """Verdicts and what proves them; for the mass of the problem both are kept."""
        from enumsol.roots.stability import Stabilities  # sparse graphs and solvers come with it

        verdicts, known = self._found.get("own", (None, None)) if mass is None else (None, None)
        asked = Stabilities(self[0].problem, mass, known)
        found = tuple(asked.of(root) for root in self) if verdicts is None else verdicts
        self._found["verdicts"] = found
        if mass is None:
            self._found["own"] = found, asked.known
        return asked, found

    def stability_proof(
        self, path: str | Path | None = None, *, mass: ArrayLike | sp.sparray | sp.spmatrix | None = None
    ) -> Proof:
        """The proof of `stability`, with that of the roots, for ``enumsol.verify(problem, proof)``.

        It confirms verdicts on roots at which every node strictly does what it does; others are undecided in it.

        Parameters
        ----------
        path : path, optional
            Of a file to write; by default the proof is kept in memory.
        mass : (n, n) array_like or sparse, optional
            By default that of the problem; ``enumsol.verify`` takes it, too.

        Raises
        ------
        InvalidArgumentError, InvalidProblemError
            As `enumsol.stability`; there are no roots, or no proof of them; the file cannot be written.

        Examples
        --------
        >>> import enumsol
        >>> problem = enumsol.gallery.get("taper-8").build()
        >>> proof = enumsol.enumerate_roots(problem, alpha=0.2).stability_proof()
        >>> enumsol.verify(problem, proof).verdicts
        ('does not run away', 'runs away', 'does not run away')
        """
        from enumsol.roots.stability import write_proof  # as above

        if not len(self):
            raise InvalidArgumentError("there is no isolated root; expected one whose stability can be proven")
        if self.proof is None:
            raise InvalidArgumentError(
                f"these roots ({self.arithmetic} arithmetic) have no proof; expected those of a search in verified "
                "arithmetic that ran to its end"
            )
        return write_proof(self.proof, self, *self._examined(mass), path)

    @property
    def verdicts(self) -> tuple[Stability, ...] | None:
        """Verdicts that `stability` found last, or None."""
        return self._found.get("verdicts")

    @property
    def complete(self) -> bool:
        """True if completeness is proven: exact arithmetic, nothing undecided, search not cut short."""
        return self.arithmetic != "fast" and self.whole

    @property
    def whole(self) -> bool:
        """True if nothing is known to be missing: the search ran to its end and left nothing undecided."""
        return self.stopped is None and not self.undecided

    @property
    def unique(self) -> bool | None:
        """True if there is one solution, False if not, both proven; None if it stayed open, and in fast arithmetic."""
        if self.arithmetic == "fast":
            return None
        if self.families or self.at_least > 1:
            return False
        return True if self.complete and len(self) == 1 else None

    @property
    def by_one_certificate(self) -> bool:
        """True if a form that is definite proved, without a tree, that there is one solution (theory, section 6.11)."""
        stats = self.stats
        return self.whole and len(self) == 1 and (stats.closed, stats.pruned, stats.selections) == (1, 0, 0)

    @property
    def index_sum(self) -> int | None:
        """Sum of the indices of all roots and families: +1 when nothing is missing; None if one is unknown.

        It is unknown, too, after a search that was cut short or left something undecided. The indices of a body that
        nothing holds may have any sum (theory, section 14.2).
        """
        if not self.whole:
            return None
        indices = [root.index for root in self._roots] + [family.index for family in self.families]
        return None if any(index is None for index in indices) else sum(index for index in indices if index is not None)

    @property
    def adds_up(self) -> bool:
        """True if the sum of the indices, where it is known and the body is held, is +1 (theory, (6.7))."""
        return self.rigid_bound is not None or self.index_sum in (None, 1)

    @property
    def notes(self) -> tuple[str, ...]:
        """Warnings about the roots, each in a sentence: a load at the limit, displacements that are not small.

        They are also printed, and shown in reports.
        """
        return (*(() if self.rigid_bound is None else self.rigid_bound.notes), *far_notes(self._roots))

    def __len__(self) -> int:
        return len(self._roots)

    @overload
    def __getitem__(self, item: int) -> Root: ...
    @overload
    def __getitem__(self, item: slice) -> tuple[Root, ...]: ...
    def __getitem__(self, item: int | slice) -> Root | tuple[Root, ...]:
        return self._roots[item]

    def index(self, root: object = None, start: int = 0, stop: int | None = None) -> int:
        """Position of a root, as that of an item of a list; the topological index is ``index`` of a root.

        Raises
        ------
        InvalidArgumentError
            It is none of these roots.
        """
        for k in range(len(self))[slice(start, stop)]:
            if self._roots[k] is root:
                return k
        raise InvalidArgumentError(
            f"index, the position of a root, is asked of {shown(root)}; expected one of these "
            f"{counted(len(self), 'root')} (for topological indices, roots[0].index or roots.index_sum)"
        )

    def to_frame(self) -> pd.DataFrame:
        """Table with a row per root and node: alpha, root, node, status, forces, displacements, index, regular."""
        import pandas as pd  # slow to import, used here only

        count, p = len(self), len(self.node_ids)
        return pd.DataFrame(
            {
                "alpha": np.repeat(float(self.alpha), count * p),
                "root": np.repeat(np.arange(count), p),
                "node": list(self.node_ids) * count,
                "status": [status.value for root in self for status in root.statuses],
                **{
                    column: values
                    for name in ("lambda_n", "lambda_t", "u_n", "u_t")
                    for column, values in _columns(name, [getattr(root, name) for root in self])
                },
                "index": np.repeat(np.array([root.index for root in self], dtype=object), p),
                "regular": np.repeat(np.array([root.regular for root in self], dtype=bool), p),
                **self._stability_column(p),
            }
        )

    def plot_bodies(
        self, *, scale: float | None = None, units: tuple[str, str] | None = None, file: str | Path | None = None
    ) -> Any:
        """A matplotlib figure of the deformed bodies of the isolated roots, up to 12 of them, side by side.

        Forces are drawn in one scale, and displacements too unless their sizes differ by more than a factor of 8, as
        those of a jammed and of a free body do; each body then has an enlargement of its own, which its title tells.

        Parameters
        ----------
        scale : float, optional
            The displacements of all roots are multiplied by it.
        units : (str, str), optional
            Of forces and of lengths, for the axes and the largest contact force.
        file : path, optional
            Save the figure there.

        Raises
        ------
        InvalidArgumentError
            The problem has no mesh, or there is no isolated root.
        MissingDependencyError
            matplotlib is not installed.
        """
        from enumsol.roots.body_plots import draw_bodies  # matplotlib comes with the first picture

        return kept(draw_bodies(self._roots, scale, checked_units(units)), file)

    @property
    def closing_line(self) -> str:
        """The closing line of the printed table."""
        count = len(self.undecided)
        if self.stopped is not None:
            return f"complete: no ({self.stopped})"
        if self.undecided:
            return f"complete: no ({count} undecided)"
        if not self.complete:
            return f"complete: not proven ({count} undecided)"
        about = "proven" if self.certified_data == "problem" else "proven for S and g as computed"
        how = ": one solution, by one certificate" if self.by_one_certificate else ""
        within = "" if self.rigid_bound is None else f", {self.rigid_bound.words()}"
        return f"complete: yes ({about}{how}{within})"

    def _stability_column(self, p: int) -> dict[str, Any]:
        """Verdicts, if they were asked for."""
        verdicts = self.verdicts
        return {} if verdicts is None else {"stability": np.repeat([found.verdict for found in verdicts], p)}

    def _heading(self) -> str:
        heading = f"RootSet at alpha = {float(self.alpha):g}: {counted(len(self), 'root')}"
        if self.families:
            heading += f", {counted(len(self.families), 'family', 'families')}"
        if not self.whole:
            heading = found_of(heading, self.at_least)
        return f"{heading} ({self.arithmetic}, {self.method})"

    @property
    def _heads(self) -> tuple[str, ...]:
        return (*_HEADS[:-1], "stability", _HEADS[-1]) if self.verdicts is not None else _HEADS

    def _rows(self) -> list[tuple[str, ...]]:
        """Rows printed of the first roots: number, index, whether regular, margin, force, perhaps verdict, statuses."""
        verdicts = self.verdicts
        return [
            (
                str(k),
                "?" if root.index is None else f"{root.index:+d}",
                "yes" if root.regular else "no",
                f"{root.margin:.2e}",
                f"{np.max(root.lambda_n):.5g}",
                *(() if verdicts is None else (verdicts[k].verdict,)),
                summary(root.statuses),
            )
            for k, root in enumerate(self._roots[:PRINTED])
        ]

    def _notes(self) -> list[str]:
        """The lines below the table of roots."""
        lines = []
        if len(self) > PRINTED:
            lines.append(f"   ... {len(self) - PRINTED} more")
        for k, family in enumerate(self.families[:PRINTED]):
            index = "?" if family.index is None else f"{family.index:+d}"
            lines.append(
                f"family {k}: dimension {family.dimension}, {counted(len(family.polytopes), 'polytope')}, "
                f"{counted(len(family.vertices), 'vertex', 'vertices')}, index {index}{_moving(family)}"
            )
        # a search that was cut short leaves many alike
        alike = Counter((item.reason, item.hint) for item in self.undecided)
        lines += [
            f"undecided{f', {count} times' if count > 1 else ''}: {reason} ({hint})"
            for (reason, hint), count in alike.most_common(5)
        ]
        regions = [item for item in self.undecided if item.slip_angle is not None]
        lines += [f"undecided region {k}: {_region(item)}" for k, item in enumerate(regions[:_PRINTED_REGIONS])]
        if len(regions) > _PRINTED_REGIONS:
            lines.append(f"   ... {len(regions) - _PRINTED_REGIONS} more")
        if self.stats.held:
            lines.append(_resumed(self.stats))
        if self.stats.fallback_qps:
            of = counted(self.stats.qps, "relaxation")
            lines.append(f"stalled: {self.stats.fallback_qps} of {of}, solved by a slower solver or not at all")
        lines += [f"note: {note}" for note in self.notes]
        total = self.index_sum
        if self.rigid_bound is not None:
            # nothing that holds the body makes the sum +1
            return [*lines, f"index sum: {'unknown' if total is None else f'{total:+d}'}", self.closing_line]
        # a sum other than +1 proves that something is missing or wrong
        note = "unknown" if total is None else f"{total:+d}" if total == 1 else f"{total:+d} (not +1!)"
        return [*lines, f"index sum: {note}", self.closing_line]

    def __repr__(self) -> str:
        rows = [self._heads, *self._rows()] if len(self) else []
        widths = (6, 5, 7, 9, 12, *(17,) * (len(self._heads) - len(_HEADS)))
        table = [" ".join(f"{c:>{w}}" for c, w in zip(row, widths, strict=False)) + f"  {row[-1]}" for row in rows]
        return "\n".join([self._heading(), *table, *self._explained(), *self._notes()])

    def _explained(self) -> tuple[str, ...]:
        asked = self.verdicts is not None
        left_out = ("families of solutions are not examined for stability",) if asked and self.families else ()
        return (*_EXPLAINED, *((ABOUT_STABILITY,) if asked else ()), *left_out) if len(self) else left_out

    def _repr_html_(self) -> str:
        table = html_table(("root", *self._heads[1:]), self._rows()) if len(self) else ""
        return html_lines([self._heading()]) + table + html_lines([*self._explained(), *self._notes()])


def _moving(family: RootFamily) -> str:
    """Along which rigid modes the body moves within a family, and how far as listed."""
    parts = []
    for mode in family.free_modes:
        values = np.concatenate([part.rigid_coordinates[:, mode] for part in family.polytopes])  # type: ignore[index]
        parts.append(f"mode {mode} (from {np.min(values):.4g} to {np.max(values):.4g})")
    return f"; the body is free to move along {' and '.join(parts)}" if parts else ""


def _region(item: Undecided) -> str:
    """A region of leaves in 3D in words."""
    text = f"{summary(item.statuses)} ({counted(item.leaves, 'leaf', 'leaves')} of the tree)"
    if item.bounds is None:
        return text
    low, high = np.max(item.bounds.lambda_n, axis=0)
    return f"{text}; a root in it has max lambda_n from {low:.5g} to {high:.5g}"


def _columns(name: str, arrays: list[Floats]) -> list[tuple[str, Floats]]:
    """A quantity of all roots as columns of a frame: one, or in 3D one an axis."""
    return by_axis(name, np.concatenate(arrays) if arrays else np.zeros(0))


def by_axis(name: str, values: Floats) -> list[tuple[str, Floats]]:
    """Values of nodes as columns with their names: one, or in 3D one an axis."""
    return [(name, values)] if values.ndim == 1 else [(f"{name}{k + 1}", values[:, k]) for k in range(values.shape[1])]


def _resumed(stats: SearchStats) -> str:
    """Words on how many nodes of its file a search has taken, and why not all of them."""
    left = stats.held - stats.held_open - stats.resumed
    why = [f"{stats.held_open:,} undecided there"] if stats.held_open else []
    why += [f"{left:,} not proven again"] if left > 0 else []
    missing = f" ({', '.join(why)})" if why else ""
    searched = f"{stats.nodes:,} more searched" if stats.nodes else "nothing was left to search"
    return f"resumed: {stats.resumed:,} of {counted(stats.held, 'node')} in the file{missing}, {searched}"


def far_notes(roots: Sequence[Any]) -> list[str]:
    """Notes on roots whose contact nodes move farther than the contact is wide, or turn by several degrees.

    Only bodies of a material in a mesh have notes, for their lengths mean something. A turn is the rotation that all
    contact nodes have in common; for pairs it is that of one side relative to the other.
    """
    problem = roots[0].problem if roots else None
    if problem is None or problem.coordinates is None or problem.mesh is None or not problem.mesh.has_material:
        return []
    places = np.asarray(problem.coordinates)
    places = places - places.mean(axis=0)
    width = float(np.max(np.ptp(places, axis=0)))
    if width == 0:
        return []
    axes = _axes(problem.mesh, problem.contact_rows, problem.p)
    far, turned = {}, {}
    for k, root in enumerate(roots):
        parts = np.column_stack([root.u_n + problem.gap, root.u_t + problem.slip_offset])
        far[k] = float(np.max(np.linalg.norm(parts, axis=1))) / width
        if axes is not None:
            turned[k] = _turn(places, np.einsum("pk,pkd->pd", parts, axes))
    notes = []
    if moved := [k for k, ratio in far.items() if ratio > 1.0]:
        most = max(moved, key=far.__getitem__)
        notes.append(
            f"{_of(moved)} contact nodes farther than the contact is wide, root {most} by {far[most] * width:.3g}, "
            f"which is {far[most]:.3g} times its width: displacements are taken to be small"
        )
    if rolled := [k for k, turn in turned.items() if turn > LARGEST_TURN]:
        most = max(rolled, key=turned.__getitem__)
        notes.append(
            f"{_of(rolled, 'turn')} the contact by more than {LARGEST_TURN:g} degrees, root {most} by "
            f"{turned[most]:.3g}: rotations are taken to be small"
        )
    return notes


def _of(roots: Sequence[int], verb: str = "move") -> str:
    return f"{counted(len(roots), 'root')} {verb}{'s' if len(roots) == 1 else ''}"


def _axes(mesh: BodyMesh, rows: sp.csr_array, p: int) -> Floats | None:
    """Normal and tangents (p, d, d) of the contact nodes in global axes; None where rows stand for patches."""
    if mesh.rows is not None:
        return None
    return np.stack([mesh.directions(rows[k : k + p]) for k in range(0, rows.shape[0], p)], axis=1)


def _turn(places: Floats, moved: Floats) -> float:
    """The rotation (degrees) that displacements (p, d) of places about their mean have in common, by least squares."""
    moved = moved - moved.mean(axis=0)
    if places.shape[1] == 2:
        moment = float(np.sum(places[:, 0] * moved[:, 1] - places[:, 1] * moved[:, 0]))
        return float(np.degrees(abs(moment) / np.sum(places**2)))
    inertia = np.sum(places**2) * np.eye(3) - places.T @ places
    moments = np.sum(np.cross(places, moved), axis=0)
    return float(np.degrees(np.linalg.norm(np.linalg.lstsq(inertia, moments, rcond=1e-9)[0])))
