"""A search at one alpha, in 2D and 3D: its parts, its spreading over workers, and its resumption.

Of a body that nothing holds, floats say first whether its load is at the limit of what contact forces can hold (theory,
section 14.12). A search that resumes from the proof of an earlier one, which was stopped or killed, goes through its
records in order. Each leaf is proven again by the certifier, which trusts nothing in the file, and written to the new
proof; what cannot be proven again, was left undecided, or is missing is searched.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.model.statuses import FRICTIONLESS, OPEN, SLIP_MINUS, SLIP_PLUS, STICK
from enumsol.proof import leaves, records
from enumsol.proof.writer import KeptRecords, point_header, unit_exponents
from enumsol.search.certifiers.protocol import NO_BOUND, RecordedBound, Refine, UndecidedPart, Unrecorded
from enumsol.search.nodes import Relaxations, TreeNode
from enumsol.search.parts import Answer, Spread, TreePart
from enumsol.search.tree import REPORT_EVERY, TreeSearch
from enumsol.support.deadlines import within

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from concurrent.futures import Executor

    from enumsol.condensation.enclosure import EnclosedSystem, RigidRows
    from enumsol.model.problem3d import AnyProblem
    from enumsol.proof.writer import BegunProof, Recorder
    from enumsol.relaxation.interior_point import InteriorPointEngine
    from enumsol.search.certifiers.protocol import Bound, Certifier
    from enumsol.search.nodes import Forms, TreeCloser
    from enumsol.search.outcome import SearchLimits, SearchProgress
    from enumsol.search.splitting import Splitting
    from enumsol.support.array_types import Alpha, Codes, Floats


#: A load this near to the limit, relative to itself, counts as one at it: where it is larger, loads for which balls
#: decide count, too; smaller ones are missed where data have been rounded, or directions of friction in 3D are sought.
LIMIT_TOLERANCE = 1e-9
#: Forces that work less than this share along a motion are on the border.
_ACTIVE = 1e-5
_OPTIONS = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}


#: Nodes at the limit of what contact can hold, if no other number of them is given: blocks in 2D with 21 contact
#: nodes take some 1,600, and in 3D with 4 some 1,000; others had not come to an end after 18,000 and 8,000. In 3D an
#: eighth of it, some seconds.
_AT_LIMIT = 2000


@dataclass(frozen=True)
class LoadLimit:
    """A load that is at the limit of what contact forces can hold, up to rounding.

    Among the rigid displacements that no contact forces promote, the load works most along the motion at the limit.

    Attributes
    ----------
    beyond : float
        The work of the load along it, as a share of what the load on the body could do; what is positive, no contact
        forces hold.
    codes : tuple of int, or None
        In 2D the statuses at which nothing opposes this motion: a complete selection, of a family if there is one.
    """

    beyond: float
    codes: Codes | None

    @property
    def nodes(self) -> int:
        """Most nodes of a search at this limit; in 3D no family is known, and nodes cost more."""
        return _AT_LIMIT if self.codes is not None else _AT_LIMIT // 8


def load_limit(problem: AnyProblem, alpha: Alpha) -> LoadLimit | None:
    """The limit that the load of a body that nothing holds is at; None where it is not near one.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    alpha : float or Fraction
    """
    modes, f, p = problem.modes, problem.load_at(alpha), problem.p
    N, f = modes.N / np.max(np.abs(modes.N), axis=0), f / max(float(np.max(np.abs(f))), np.finfo(float).tiny)
    load = N.T @ f
    if np.all(np.abs(load) <= LIMIT_TOLERANCE * (np.abs(N).T @ np.abs(f))):
        return None  # nothing presses the body against its contacts
    with np.errstate(over="ignore", invalid="ignore"):
        G, F = np.asarray(problem.contact_rows @ N).T, problem.friction_at(alpha).reshape(p, -1)
        normals, across = G[:, :p].T, G[:, p:].reshape(len(G), -1, p).transpose(2, 1, 0) * F[:, :, None]
        # how large forces are means nothing
        forces = np.maximum(np.max(np.abs(normals), axis=1), np.max(np.abs(across), axis=(1, 2)))
        unit = np.where(forces > 0, forces, 1.0)
        normals, across = normals / unit[:, None], across / unit[:, None, None]
    if not np.all(np.isfinite(forces)):
        return None
    z = _motion(load / np.max(np.abs(load)), normals, across)
    if z is None:
        return None
    moved = N @ z
    most = np.max(np.abs(moved))
    size = most * np.sum(np.abs(f[np.abs(moved) > LIMIT_TOLERANCE * most]))
    beyond = float(moved @ f / size) if size > 0 else 0.0
    if not abs(beyond) <= LIMIT_TOLERANCE:
        return None
    return LoadLimit(beyond, _codes(normals @ z, across[:, 0] @ z, F[:, 0]) if F.shape[1] == 1 else None)


def _codes(normal: Floats, across: Floats, F: Floats) -> Codes:
    """The statuses of nodes in 2D whose forces do not oppose a motion, by the work of these along it."""
    least = _ACTIVE * max(np.max(np.abs(normal)), np.max(np.abs(across)))
    sliding = np.where(np.abs(across) <= least, STICK, np.where(across > 0, SLIP_PLUS, SLIP_MINUS))
    touching = np.where(F > 0, sliding, FRICTIONLESS)
    return tuple(np.where(normal + np.abs(across) < -least, OPEN, touching).tolist())


def _motion(load: Floats, normals: Floats, across: Floats) -> Floats | None:
    """The motion that no contact forces promote along which the load works most, (r,); None where it is well inside.

    A node's forces are combinations of its row of ``normals``, (p, r), and up to as much in all of its directions of
    ``across``, (p, d, r).
    """
    from scipy.optimize import linprog  # only bodies that nothing holds need it

    _, d, r = across.shape
    angles = 0.25 * np.pi * np.arange(8)  # directions of friction at a node in 3D to begin with
    corners = np.array([[1.0], [-1.0]]) if d == 1 else np.stack([np.cos(angles), np.sin(angles)], axis=1)
    rays = (normals[:, None] + np.einsum("kd,pdr->pkr", corners, across)).reshape(-1, r)
    pressing = normals.sum(axis=0) / max(float(np.max(np.abs(normals.sum(axis=0)))), np.finfo(float).tiny)
    for _ in range(40):
        found = linprog(-load, rays, np.zeros(len(rays)), pressing[None], [-1.0], (None, None), options=_OPTIONS)
        if found.status != 0:
            return None
        z = np.array(found.x)
        if load @ z < -1e-4 * np.max(np.abs(z)):
            return None  # well inside: it needs no other directions
        limits = _at_limit(z, normals, across)
        if d == 1 or not np.any(limits @ z > 1e-13 * np.max(np.abs(rays @ z))):
            break
        rays = np.vstack([rays, limits])
    for _ in range(4):  # the solver is content with seven digits
        limits = _at_limit(z, normals, across)
        work = limits @ z
        tight = np.vstack([limits[np.abs(work) <= _ACTIVE * np.max(np.abs(work))], pressing])
        rest = np.append(np.zeros(len(tight) - 1), -1.0) - tight @ z
        z += np.linalg.lstsq(tight, rest, rcond=1e-9)[0]
    return z


def _at_limit(z: Floats, normals: Floats, across: Floats) -> Floats:
    """Forces at the limit of friction that work most along a motion, (p, r)."""
    work = across @ z
    length = np.linalg.norm(work, axis=1)
    along = work / np.where(length > 0, length, 1.0)[:, None]
    return np.asarray(normals + np.einsum("pd,pdr->pr", along, across))


#: That of the springs of its relaxations (theory, section 14.5).
WEAK = 2.0**-20


def weakly_held(S: Floats, g: Floats, rows: RigidRows, stiffness: float = WEAK) -> tuple[Floats, ...]:
    """S and g with weak springs in place of those that they have; of a body that is held, they themselves."""
    G, h = rows.G.mid, rows.h.mid
    soft = G.T / stiffness
    S = S + soft @ G
    return 0.5 * (S + S.T), g + soft @ h


class SearchSetup(ABC):
    """Base of the solvers of one problem at one alpha in one arithmetic: a search is made of their parts.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    alpha : float or Fraction
    arithmetic : str

    Raises
    ------
    InvalidArgumentError
        Arithmetic is "fast", which has no solver for a body that nothing holds.
    """

    #: Arithmetics for a body that nothing holds.
    _offered = '"verified" or "exact"'
    #: The scaled system: a ScaledSystem, in 3D a SpaceSystem.
    scaled: Any
    _engine: Any

    def __init__(self, problem: AnyProblem, alpha: Alpha, arithmetic: str) -> None:
        if arithmetic == "fast" and not problem.held:
            raise InvalidArgumentError(f'arithmetic is "fast" for a body that nothing holds; expected {self._offered}')
        self.problem: Any = problem
        self.alpha, self.arithmetic = alpha, arithmetic

    def search(
        self,
        certifier: Certifier,
        limits: SearchLimits | None = None,
        progress: Callable[[SearchProgress], object] | None = None,
    ) -> TreeSearch:
        """A search of the tree with a certifier made here."""
        splitting, p = self._splitting(certifier), self.problem.p
        # bounds of bodies that nothing holds are of the energy
        forms = self._forms if self.problem.held else None
        return TreeSearch(
            Relaxations(self._engine, splitting, p, forms, self._fallback),
            certifier,
            limits=limits,
            progress=progress,
            closer=self._closer(certifier),
            known_root=lambda: self.known_root,
        )

    # -- the problem -----------------------------------------------------------------------------------------------

    @property
    def relaxed(self) -> Any:
        """The system that the relaxations are about."""
        return self.scaled

    @property
    @abstractmethod
    def undecidable(self) -> str | None:
        """Reason why nothing can be proven about this problem, or None."""

    @property
    def data(self) -> str:
        """Data that a proof is about: "problem" (the matrices as given) or "condensed" (S and g as computed)."""
        return "problem"

    @property
    def has_solution(self) -> bool:
        """True if there is a solution for certain (theory, sections 6.7 and 12.6)."""
        return bool(self.problem.held)

    @cached_property
    def at_limit(self) -> LoadLimit | None:
        """The limit of what contact can hold, if the load of a body that nothing holds is there."""
        return None if self.problem.held else load_limit(self.problem, self.alpha)

    def unloaded(self) -> bool:
        """True if g = 0 for the data as given, so that only lambda = 0 solves: not of a body that may be moved then."""
        return bool(self.problem.held and self.problem.is_unloaded(self.alpha))

    def proof_header(self) -> dict[str, Any]:
        """First record of a proof (see enumsol.proof.proof_file).

        Raises
        ------
        InvalidArgumentError
            alpha is a fraction of more digits than a proof may hold.
        """
        units = unit_exponents(self.scaled.force, self.scaled.length)
        header = point_header(self.problem, self.alpha, self.data, units, **self._kind)
        return header if self.problem.held else header | {"max_rigid_displacement": self.problem.rigid_reach}

    #: Entries of a proof's header beside those of 2D.
    _kind: dict[str, str] = {}  # noqa: RUF012 (never changed)

    # -- parts of a search -----------------------------------------------------------------------------------------

    @abstractmethod
    def certifier(self, recorder: Recorder | None) -> Certifier:
        """The certifier of this arithmetic, which writes to a recorder."""

    @property
    @abstractmethod
    def enclosed(self) -> Any:
        """Balls for the scaled system; None where there are none."""

    @property
    @abstractmethod
    def limits(self) -> records.Limits:
        """Limits of the records at the root of the tree of a proof."""

    @abstractmethod
    def remake(self) -> Callable[[], SearchSetup]:
        """Makes the same again, also in another process."""

    def fresh(self) -> SearchSetup:
        """Solvers without anything that searches leave behind and others would depend on: these have nothing of it."""
        return self

    @abstractmethod
    def _splitting(self, certifier: Certifier) -> Splitting:
        """Children and rows of partial assignments."""

    @property
    def _fallback(self) -> Callable[[], InteriorPointEngine] | None:
        """Makes a slower engine for relaxations that stall or prove nothing; None where there is none."""
        return None

    @abstractmethod
    def _closer(self, certifier: Certifier) -> TreeCloser | None:
        """Proposals of an only solution of the problem, or of subtrees."""

    @property
    @abstractmethod
    def _forms(self) -> Forms | None:
        """Forms with which a long search may bound in place of the energy."""

    # -- a root without the tree -----------------------------------------------------------------------------------

    @cached_property
    def known_root(self) -> Codes | None:
        """A complete selection proven to hold a strict root or a family, found without the tree; None where none is."""
        certifier = self.certifier(Unrecorded())
        for codes in self._suggested():
            answer = certifier.selection(codes)
            # a degenerate one may belong to others, which only a search tells; those of a family do in any case
            if not isinstance(answer, UndecidedPart | Refine | None) and (
                getattr(answer, "strict", True) or getattr(answer, "dimension", 0)
            ):
                return codes
        return None

    def _suggested(self) -> list[Codes]:
        """Complete selections that may hold a root, as far as floats tell, the likeliest first.

        Of a body that nothing holds, that of a family at the limit, then those on springs, the weakest first.
        """
        suggested, near = list[Any](), None
        # springs by which a solution of a body that nothing holds is approached, relative to its own stiffness
        for stiffness in (0.0,) if self.problem.held else tuple(2.0**-k for k in range(0, 21, 4)):
            found = self._solved(self._on_springs(stiffness), near)
            if found is not None:
                codes, near = found
                suggested = codes + [other for other in suggested if other not in codes]
        limit = self.at_limit
        return suggested if limit is None or limit.codes is None else [limit.codes, *suggested]

    def _on_springs(self, stiffness: float) -> Any:
        """The system on springs, by their stiffness relative to that of the body; of a body that is held, its own."""
        del stiffness
        return self.relaxed

    @abstractmethod
    def _solved(self, system: Any, near: Any) -> tuple[list[Codes], Any] | None:
        """Selections, one of which holds at a solution of a system in floats, and that solution, near another one."""


#: Nodes of a task, and those that are examined here before there are any.
NODES, FIRST = 512, 64


@dataclass(frozen=True)
class _TreeWorker:
    """Solvers in a worker; what follows ``remake`` is that of the search when they were sent."""

    remake: Callable[[], SearchSetup]
    form: Any
    sliding: dict[int, int]
    known: Any
    depth: int

    @cached_property
    def _solvers(self) -> SearchSetup:
        return self.remake()

    def __call__(self, roots: Sequence[TreeNode], nodes: int) -> Answer:
        """Examine so many nodes, until the time is over."""
        solvers, records = self._solvers.fresh(), KeptRecords()
        certifier = solvers.certifier(records)
        certifier.sliding.update(self.sliding)
        search = solvers.search(certifier)
        search.closer.known, search.lookahead.depth = self.known, self.depth
        if search.forms is not None:
            search.forms.use(search.relaxations.engine, self.form)
        left = [item.sent() for item in search.examined(roots, nodes)]
        found = search.outcome, certifier.certified, records.part()
        return Answer(found, search.outcome.nodes, search.covered, left)


class SpreadSearch(Spread):
    """Searches a tree with the help of an executor; its `run` takes the place of the loop of a TreeSearch.

    Parameters
    ----------
    executor : Executor
    solvers : SearchSetup
    search : TreeSearch
    """

    def __init__(self, executor: Executor, solvers: SearchSetup, search: TreeSearch) -> None:
        super().__init__(executor, search, NODES, search.limits.remaining)
        self._search, self._remake = search, solvers.remake()
        self._sent: _TreeWorker | None = None

    def run(self, waiting: Iterable[Any], until: Callable[[], bool] | None = None) -> list[Any]:
        """Examine what waits, the last first; what still waits when it is time to stop."""
        with within(self._search.limits):
            stack = self._parts_of(list(waiting))
            if not self._examine(stack, until):
                self._leave(stack)
        return stack

    def _parts_of(self, waiting: list[Any]) -> list[TreePart]:
        """Parts of what waits, which are these already where the search goes on as before."""
        afresh = not all(isinstance(item, TreePart) for item in waiting)
        if not self._is_current(afresh=afresh):
            self._renew()
        elif not afresh:
            return waiting
        self.cancel()
        items: list[TreeNode] = []
        for item in waiting:
            items += item.roots if isinstance(item, TreePart) else [item]
        left = self._search.left
        return self._begin(self._search.examined(items, FIRST if left is None else min(FIRST, left)))

    def _worker(self) -> _TreeWorker:
        search = self._search
        form = None if search.forms is None else search.forms.form
        sliding, depth = dict(search.certifier.sliding), search.lookahead.depth
        self._sent = _TreeWorker(self._remake, form, sliding, search.closer.known, depth)
        return self._sent

    def _is_current(self, *, afresh: bool) -> bool:
        search, sent = self._search, self._sent
        form = None if search.forms is None else search.forms.form
        as_sent = sent is not None and sent.form is form and sent.depth == search.lookahead.depth
        return as_sent and sent is not None and not (afresh and sent.sliding != search.certifier.sliding)

    def cancel(self) -> None:
        """Cancel what has not begun."""
        self._search.outcome.redone = self._crew.redone
        super().cancel()


class Replay:
    """A search that goes on with an earlier proof.

    Parameters
    ----------
    search : TreeSearch
        Its certifier proves and writes.
    limits : Limits
        Of the records at the root of its tree, without the forms that are declared.
    system : balls for the data, of which forms are made; None where there are none
    """

    def __init__(self, search: TreeSearch, limits: records.Limits, system: EnclosedSystem | None) -> None:
        self._search, self._limits, self._system = search, limits, system
        #: Whether the rule by which the file's tree was branched is still to be found out, from its first branchings.
        self._learning = search.forms is not None and search.lookahead.pays
        self._declared: list[records.DeclaredForm] = []
        #: Forms that were used, the last one last.
        self._used: dict[records.DeclaredForm, Any] = {}
        self._mark = time.perf_counter()

    def run(self, begun: BegunProof, passed: Callable[[], None]) -> None:
        """Take over what holds, and search the rest; a time limit is about what is searched anew.

        ``passed`` is called once all that is proven in the file, and can be followed, has been gone through.
        """
        search = self._search
        needed, search.outcome.held, search.outcome.held_open = begun.extent()
        rest = [search.first()]
        for number, record in enumerate(begun.records() if needed else (), start=1):
            if not rest or not isinstance(record, list) or not record or not self._take(rest, record):
                break
            if number == needed:
                break  # what follows is open, and all of it waits
            if search.outcome.resumed % REPORT_EVERY == 0:
                search.report()
        search.finish()  # the file that is replaced holds what was written after the subtrees that were skipped
        passed()
        if len({self._form_over(item.codes) for item in rest}) > 1:
            while rest:
                self._below(rest.pop())
        elif rest:
            self._below(*rest, trial=search.forms is not None and not search.forms.tried(search.outcome.resumed))
        search.finish()

    def _below(self, *items: TreeNode, trial: bool = False) -> None:
        """Search subtrees, in the place where their records are due."""
        limits = self._search.limits
        if limits.deadline is not None:
            limits.deadline += time.perf_counter() - self._mark
        self._search.below(items, self._form_over(items[-1].codes), trial=trial)
        self._mark = time.perf_counter()

    def _take(self, stack: list[TreeNode], record: list[Any]) -> bool:
        """Take one record; False if it and what follows make no sense."""
        search, learning = self._search, self._learning
        self._learning = False
        if record[0] == records.DeclaredForm.kind:
            try:
                said = records.DeclaredForm.read(record, self._limits)
            except ValueError:
                return False
            # parts of one search declare the same form
            self._declared.append(next((known for known in self._used if known.same(said)), said))
            return True
        item = stack.pop()
        if record[0] != records.Branching.kind:
            if self._proven(item, record):
                search.outcome.resumed += 1
            else:
                self._below(item)
            return True
        try:
            split = records.Branching.covering(record, item.codes, search.splitting.covers)
        except ValueError:
            stack.append(item)
            return False
        self._learning = learning and search.lookahead.learn(item.codes, split.node)
        stack += search.split(item, None, split.node, split.children)
        search.outcome.resumed += 1
        return True

    def _proven(self, item: TreeNode, record: list[Any]) -> bool:
        """True if a leaf is proven again, and written."""
        search = self._search
        try:
            kind = leaves.kind_of(record, self._limits.tree)
            if kind is None:
                return False
            leaf: Any = kind.read(record, replace(self._limits, codes=item.codes, declared=self._declared))
            if isinstance(leaf, leaves.Unbalanced):
                # the certifier finds a direction of its own
                return search.excluded(item, NO_BOUND)
            if isinstance(leaf, leaves.Excluded):
                return search.excluded(item, self._bound(leaf))
            if isinstance(leaf, leaves.Alone) and leaf.strengths is not None:
                return search.alone(item, leaf)
        except ValueError:
            return False
        if isinstance(leaf, leaves.OnlyReference):
            return search.closed(item, None, again=True)
        if leaf.closing:
            return search.closed(item, search.relaxations.energy(item.codes), again=True)
        return leaf.final and search.settled(item)

    def _form_over(self, codes: Codes) -> Any:
        """The form that was used last of those that serve a partial assignment in place of the energy."""
        return next((form for said, form in reversed(self._used.items()) if said.serves(codes)), None)

    def _bound(self, leaf: leaves.Excluded) -> Bound:
        """Bound that is said to exclude a partial assignment; ValueError where its form is not proven."""
        if not isinstance(leaf.by, int):
            return RecordedBound(leaf.rows, leaf.values)
        said = self._declared[-leaf.by]
        form = self._used.pop(said) if said in self._used else self._system and said.form(self._system)
        if form is None:
            raise ValueError("its form is not proven")
        self._used[said] = form
        return RecordedBound(leaf.rows, leaf.values, form)
