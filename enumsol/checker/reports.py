"""Reports of the checkers: what a proof shows, or why it was refused."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from enumsol.proof.reading import shown_alpha
from enumsol.support.messages import counted, html_lines

#: Failures after which a checker reads no further.
MAX_FAILURES = 20
#: Steps of a history that are printed.
_MOST_STEPS = 30


@dataclass(frozen=True)
class VerificationReport:
    """Result of checking the proof of a root set.

    Attributes
    ----------
    ok : bool
        Every leaf was checked and the counts agree; with ``undecided`` 0 the list of roots is proven complete.
    failures : tuple of str
        Why the proof was refused. The check ends where the records stop making sense, and after MAX_FAILURES.
    roots, families, undecided, leaves : int
        Counts that were checked: isolated roots, families, undecided leaves, all leaves. For a refused proof they only
        show how far the check got.
    data : str
        "problem": the theorem holds for the problem's own matrices; "condensed": for S, g and F as computed.
    alpha : Fraction or None
        The parameter that the proof is about; None when its header cannot be read.
    within : float or None
        Of a body that nothing holds: the bound of its rigid displacement [length], if a leaf rests on it.

    Examples
    --------
    >>> import enumsol
    >>> problem, other = enumsol.gallery.one_node_triangle(), enumsol.gallery.one_node_triangle(f=(1, 2))
    >>> proof = enumsol.enumerate_roots(problem, alpha=5).proof
    >>> enumsol.verify(problem, proof).complete, enumsol.verify(other, proof).complete
    (True, False)
    """

    ok: bool
    failures: tuple[str, ...]
    roots: int
    families: int
    undecided: int
    leaves: int
    data: str
    alpha: Fraction | None
    within: float | None = None

    @property
    def complete(self) -> bool:
        """The proof shows that nothing but the listed roots and families solves the problem."""
        return self.ok and self.undecided == 0

    def _repr_html_(self) -> str:
        return html_lines(repr(self).splitlines())

    def __repr__(self) -> str:
        where = "" if self.alpha is None else f" at alpha = {shown_alpha(self.alpha)}"
        if not self.ok:
            return _refusal(where, self.failures, counted(self.leaves, "leaf", "leaves"))
        return "\n".join(
            (
                f"proof: verified{where}",
                f"  {counted(self.leaves, 'leaf covers', 'leaves cover')} all selections, {self.undecided} of them "
                "undecided",
                f"  {counted(self.roots, 'isolated root')}, {counted(self.families, 'family', 'families')}",
                f"  certified data: {_DATA[self.data]}",
                f"  complete: {'yes' if self.complete else 'no'}{_bound(self.within) if self.complete else ''}",
            )
        )


@dataclass(frozen=True)
class GraphVerificationReport:
    """Result of checking the proof of a branch graph.

    Attributes
    ----------
    ok : bool
        Every solution for every alpha in the interval lies in one of ``selections``.
    failures : tuple of str
        Why the proof was refused. The check ends where the records stop making sense, and after MAX_FAILURES.
    interval : (Fraction, Fraction) or None
    pieces, leaves : int
        For a refused proof they, and the selections, only show how far the check got.
    selections : frozenset of tuples of status codes
    data : str
        "problem": about the problem's own matrices; "condensed": about S and g as computed.
    arcs : int or None
        Arcs of these selections, in 3D those that the proof tells apart on the curves, all of them checked with their
        ends; None where the proof does not hold them.
    open : int
        Short intervals of alpha in which the proof leaves open what some selection does.
    closed : int
        Pieces without a tree: their only branch is proven to hold all solutions.
    within : float or None
        Of a body that nothing holds: all this is about solutions whose rigid displacement is within this bound.
    curves : int or None
        In 3D, where the proof holds no selections: curves of solutions, of which the arcs are.
    """

    ok: bool = False
    failures: tuple[str, ...] = ()
    interval: tuple[Fraction, Fraction] | None = None
    pieces: int = 0
    leaves: int = 0
    selections: frozenset[tuple[int, ...]] = frozenset()
    data: str = "problem"
    arcs: int | None = None
    open: int = 0
    closed: int = 0
    within: float | None = None
    curves: int | None = None

    @property
    def complete(self) -> bool:
        """Every solution for every alpha in the interval lies on one of the arcs, whose ends are joined as proven.

        In 3D on one of the curves.
        """
        return self.ok and (self.arcs is not None or self.curves is not None) and not self.open

    def _repr_html_(self) -> str:
        return html_lines(repr(self).splitlines())

    def __repr__(self) -> str:
        ends = () if self.interval is None else tuple(float(end) for end in self.interval)
        where = f" for alpha in [{ends[0]:g}, {ends[1]:g}]" if ends else ""
        found = f"{counted(self.leaves, 'leaf', 'leaves')} in {counted(self.pieces, 'piece')}"
        if self.closed:
            found += f", {self.closed} of them with one solution, by one certificate"
        if not self.ok:
            return _refusal(where, self.failures, found)
        if self.curves is None:
            found += f"; every solution lies in one of {counted(len(self.selections), 'selection')}"
        return "\n".join(
            (
                f"proof: verified{where}",
                f"  {found}",
                *([] if self.within is None else [f"  within rigid displacements of {self.within:g}"]),
                *self._arcs(ends),
                f"  certified data: {_DATA[self.data]}",
                f"  complete: {'yes' if self.complete else 'no'}",
            )
        )

    def _arcs(self, ends: tuple[float, ...]) -> list[str]:
        if self.curves is not None:
            curves = counted(self.curves, "curve")
            if self.arcs is not None:
                curves = f"{counted(self.arcs, 'arc')} of {curves}"
            if self.complete:
                return [f"  every solution for every alpha in [{ends[0]:g}, {ends[1]:g}] lies on {curves}"]
            return [f"  {curves}; left open in {counted(self.open, 'piece')} of alpha"]
        if self.arcs is None:
            return ["  the proof does not hold their arcs"]
        arcs = counted(self.arcs, "arc")
        if self.complete:
            return [f"  every solution for every alpha in [{ends[0]:g}, {ends[1]:g}] lies on these arcs: {arcs}"]
        return [f"  {arcs}; left open in {counted(self.open, 'short interval')} of alpha"]


@dataclass(frozen=True)
class HistoryVerificationReport:
    """Result of checking the proof of a history.

    Attributes
    ----------
    ok : bool
        Every search was checked, and so was every start that it names.
    failures : tuple of str
        Why the proof was refused.
    steps : int
    stages, roots : tuples of int
        For every step the number of searches, one for each start, and the number of roots that they found.
    complete : bool
        Every step is complete from every start, and every root is followed to the last step.
    unique_until : int
        The last step up to which it is proven that there is one history only.
    within : float or None
        Of a body that nothing holds: the bound of its rigid displacement [length], if a leaf of some search rests on
        it, the least of those of all searches.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.one_node_triangle()
    >>> proof = enumsol.histories(problem, [1, 5]).proof
    >>> enumsol.verify(problem, proof)
    proof: verified for a history of 2 steps
      step 1: 1 root from 1 start
      step 2: 1 root from 1 start
      complete: yes, unique until step 2
    """

    ok: bool
    failures: tuple[str, ...]
    steps: int
    stages: tuple[int, ...]
    roots: tuple[int, ...]
    complete: bool
    unique_until: int
    within: float | None = None

    def _repr_html_(self) -> str:
        return html_lines(repr(self).splitlines())

    def __repr__(self) -> str:
        if not self.ok:
            return _refusal(" for a history", self.failures, counted(sum(self.stages), "search", "searches"))
        rows = [
            f"  step {k}: {counted(roots, 'root')} from {counted(starts, 'start')}"
            for k, (roots, starts) in enumerate(zip(self.roots, self.stages, strict=True), 1)
        ]
        shown = rows if len(rows) <= _MOST_STEPS else [*rows[:_MOST_STEPS], f"  ... {len(rows) - _MOST_STEPS} more"]
        unique = f"unique until step {self.unique_until}" if self.unique_until else "no step is proven to be unique"
        return "\n".join(
            (
                f"proof: verified for a history of {counted(self.steps, 'step')}",
                *shown,
                f"  complete: {'yes' if self.complete else 'no'}, {unique}{_bound(self.within)}",
            )
        )


@dataclass(frozen=True)
class StabilityVerificationReport:
    """Result of checking the proof of which roots run away.

    Attributes
    ----------
    ok : bool
        The proof of the roots holds, and so does what is said of each of them.
    failures : tuple of str
        Why the proof was refused.
    verdicts : tuple of str
        For every root, in the order of the records, "runs away", "does not run away" or "undecided": also where
        bounds do not tell strictly what a contact node does. Empty for a refused proof.
    bounds : tuple of (float, float) or None
        For every root that runs away, bounds of the growth rate of a motion.
    roots : VerificationReport or None
        About the proof of the roots.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.get("taper-8").build()
    >>> proof = enumsol.enumerate_roots(problem, alpha=0.2).stability_proof()
    >>> enumsol.verify(problem, proof)
    proof: verified for the stability of 3 roots at alpha = 0.2
      root 0: does not run away
      root 1: runs away, growing like exp(rho t), rho = 3.42...
      root 2: does not run away
      in all: 1 run away, 2 do not, 0 undecided
      list of roots: complete
      complete: yes
    """

    ok: bool = False
    failures: tuple[str, ...] = ()
    verdicts: tuple[str, ...] = ()
    bounds: tuple[tuple[float, float] | None, ...] = ()
    roots: VerificationReport | None = None

    @property
    def complete(self) -> bool:
        """The roots are all, none of them in a family, and of each it is proven whether it runs away."""
        if not self.ok or self.roots is None or "undecided" in self.verdicts:
            return False
        return self.roots.complete and not self.roots.families

    def _repr_html_(self) -> str:
        return html_lines(repr(self).splitlines())

    def __repr__(self) -> str:
        roots = self.roots
        where = "" if roots is None or roots.alpha is None else f" at alpha = {shown_alpha(roots.alpha)}"
        if not self.ok or roots is None:
            read = "no roots" if roots is None else counted(roots.roots, "root")
            return _refusal(f" for the stability of roots{where}", self.failures, read)
        away = self.verdicts.count("runs away")
        others, unknown = self.verdicts.count("does not run away"), self.verdicts.count("undecided")
        left = "" if not roots.families else f", {counted(roots.families, 'family', 'families')} left out"
        return "\n".join(
            (
                f"proof: verified for the stability of {counted(len(self.verdicts), 'root')}{where}",
                *(f"  root {k}: {self._of(k)}" for k in range(min(len(self.verdicts), _MOST_STEPS))),
                *([f"  ... {len(self.verdicts) - _MOST_STEPS} more"] if len(self.verdicts) > _MOST_STEPS else []),
                f"  in all: {away} run away, {others} do not, {unknown} undecided{left}",
                f"  list of roots: {'complete' if roots.complete else 'not complete'}{_bound(roots.within)}",
                f"  complete: {'yes' if self.complete else 'no'}",
            )
        )

    def _of(self, k: int) -> str:
        """The verdict on a root, with bounds of the growth rate."""
        known = self.bounds[k]
        return self.verdicts[k] + ("" if known is None else f", growing like exp(rho t), rho = {known[0]:.6g}")


#: What the checkers report.
AnyReport = VerificationReport | GraphVerificationReport | HistoryVerificationReport | StabilityVerificationReport

_DATA = {"problem": "A, Bn, Bt, f as given", "condensed": "S and g as computed"}


def _bound(within: float | None) -> str:
    return "" if within is None else f", within rigid displacements of {within:g}"


def _refusal(where: str, failures: tuple[str, ...], read: str) -> str:
    lines = [f"proof: REFUSED{where}", *(f"  failure: {failure}" for failure in failures)]
    return "\n".join([*lines, f"  checked until then: {read}, which show nothing", "  complete: no"])
