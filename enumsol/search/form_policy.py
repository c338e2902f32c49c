"""When a search turns from the energy to a tighter form (theory, section 5.8).

A form costs as much as hundreds of nodes of the tree, and does not pay everywhere. So a search begins with the energy;
one that is still far from its end after many nodes tries a form at its root, and begins again with it if that is worth
it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from enumsol.proof.compressed_parts import Part, Recorder
from enumsol.relaxation.active_set import ActiveSetEngine, ActiveSetRelaxation, FormEngine

if TYPE_CHECKING:
    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.relaxation.engine import Engine
    from enumsol.search.splitting import ImposedRows
    from enumsol.selections.solution import Codes
    from enumsol.trusted.quadratic_forms import EnclosedForm

    Rows = tuple[list[int], list[int]]

#: Nodes examined with the energy before a form is tried: more than what that costs.
NODES = 1000
#: A form is tried where at least this share of the tree is left.
_LEFT = 0.5
#: Steps of the ascent on trial, and those that follow once it pays.
TRIAL, STEPS = 4, 2
#: A form pays when it closes so much more of the gap at the root, or so many times as much.
MORE, TIMES = 0.1, 3.0


class Forms:
    """The form of one search.

    Parameters
    ----------
    scaled : ScaledSystem
    enclosed : EnclosedSystem
        Balls for the same system.
    """

    def __init__(self, scaled: ScaledSystem, enclosed: EnclosedSystem) -> None:
        self._scaled, self._enclosed = scaled, enclosed
        self._engine: Engine | None = None
        self._form: EnclosedForm | None = None

    @property
    def in_use(self) -> bool:
        """Whether the search goes on with forms."""
        return self._engine is not None

    @property
    def form(self) -> EnclosedForm | None:
        """That form."""
        return self._form

    def due(self, nodes: int, covered: float) -> bool:
        """Whether it is time to try a form."""
        return self.tried(nodes) and covered < 1.0 - _LEFT

    def tried(self, nodes: int) -> bool:
        """Whether a search of so many nodes has tried a form."""
        return nodes >= NODES

    def use(self, engine: Any, form: EnclosedForm | None) -> None:
        """Go on with a form that is known already, or with the energy."""
        if form is not None and form is self._form:
            return
        self._form = form
        usable = form is not None and isinstance(engine, ActiveSetEngine) and form.smallest_eigenvalue > 0
        self._engine = FormEngine(engine, self._scaled, form) if usable and form is not None else None

    def pay(self, engine: Any, codes: Codes, rows: ImposedRows) -> bool:
        """Whether a form at the root of the search is clearly tighter than the energy; if so it is in use."""
        if not isinstance(engine, ActiveSetEngine):
            return False
        form = ascended(self._scaled, self._enclosed, engine, codes, rows.over(codes, range(len(codes))))
        if form is None or not form.smallest_eigenvalue > 0:
            return False
        self._form, self._engine = form, FormEngine(engine, self._scaled, form)
        return True

    @property
    def engine(self) -> Engine:
        """Relaxations with the form of the root."""
        assert self._engine is not None
        return self._engine


def ascended(
    scaled: ScaledSystem, enclosed: EnclosedSystem, engine: ActiveSetEngine, codes: Codes, rows: Rows
) -> EnclosedForm | None:
    """A form that is clearly tighter than the energy over a partial assignment; None: there is none.

    Parameters
    ----------
    scaled : ScaledSystem
    enclosed : EnclosedSystem
        Balls for the same system.
    engine : ActiveSetEngine
        Relaxations with the energy.
    codes : status codes
    rows : numbers and modes of the rows of the assignment
    """
    from enumsol.relaxation.convex_forms import FormAscent

    ascent = FormAscent(scaled, enclosed, engine)
    plain = engine.root(*rows)
    found = ascent.improve(codes, ascent.energy, rows, TRIAL)
    if found is None or not isinstance(plain, ActiveSetRelaxation) or plain.stalled or plain.pruned:
        return None
    if not found[1].pruned:
        before, after = plain.gap_closed(codes), found[1].gap_closed(codes)
        if after < min(before + MORE, TIMES * before):
            return None
        found = ascent.improve(codes, found[0].multipliers, rows, STEPS) or found
    return found[0]


class HeldRecords:
    """Keeps the records of a search that may begin again.

    Parameters
    ----------
    recorder : Recorder
        Takes them when they are released.
    """

    def __init__(self, recorder: Recorder) -> None:
        self.recorder = recorder
        self._records: list[Any] = []

    def write(self, record: Any) -> None:
        """Keep a record."""
        self._records.append(record)

    def add(self, part: Part) -> None:
        """Keep records that were encoded elsewhere."""
        self._records.append(part)

    def release(self) -> None:
        """Hand the records on."""
        for record in self._records:
            if isinstance(record, Part):
                self.recorder.add(record)
            else:
                self.recorder.write(record)
        self._records.clear()

    def drop(self) -> None:
        """Forget the records."""
        self._records.clear()
