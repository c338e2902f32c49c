"""When a search turns from the energy to tighter forms, and where it looks for new ones (theory, section 5.8).

A form costs as much as a thousand nodes of the tree, and does not pay everywhere. So a search begins with the energy;
one that is still far from its end after many nodes tries a form at its root, and begins again with it if that is worth
it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from enumsol.relaxation.active_set import ActiveSetEngine, ActiveSetRelaxation, FormEngine
from enumsol.statuses import CONTACT, UNDECIDED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.proof.proof_file import Recorder
    from enumsol.relaxation.engine import Engine, Relaxation
    from enumsol.relaxation.forms import FormAscent
    from enumsol.search.splitting import ImposedRows
    from enumsol.selections.solution import Codes

#: Nodes examined with the energy before a form is tried, and the share of the tree that may be left only then.
NODES, _LEFT = 3000, 0.5
#: Steps of the ascent on trial; at the root once it pays, with one more for so many contact nodes; and below.
TRIAL, ROOT, NODES_A_STEP, BELOW = 4, 14, 10, 10
#: A form pays when it closes so much more of the gap at the root, or so many times as much.
MORE, TIMES = 0.1, 3.0
#: A new form is looked for after this share of the contact nodes was decided, unless so few are open.
DEEPER, FEW = 0.32, 8


class Forms:
    """The forms of one search.

    Parameters
    ----------
    scaled : ScaledSystem
    enclosed : EnclosedSystem
        Balls for the same system.
    nodes : int, optional
        Nodes examined with the energy before a form is tried; default NODES.
    """

    def __init__(self, scaled: ScaledSystem, enclosed: EnclosedSystem, nodes: int | None = None) -> None:
        self._scaled, self._enclosed = scaled, enclosed
        self.nodes = NODES if nodes is None else nodes
        self._ascent: FormAscent | None = None
        self._engine: Engine | None = None
        #: Forms made.
        self.made = 0

    @property
    def in_use(self) -> bool:
        """Whether the search goes on with forms."""
        return self._engine is not None

    def due(self, nodes: int, covered: float) -> bool:
        """Whether it is time to try a form."""
        return nodes >= self.nodes and covered < 1.0 - _LEFT

    def pay(self, engine: Any, codes: Codes, rows: ImposedRows) -> bool:
        """Whether a form at the root of the search is clearly tighter than the energy; if so it is in use."""
        if not isinstance(engine, ActiveSetEngine):
            return False
        from enumsol.relaxation.forms import FormAscent

        self._ascent = ascent = FormAscent(self._scaled, self._enclosed, engine)
        imposed = rows.over(codes, range(len(codes)))
        plain = engine.root(*imposed)
        found = ascent.improve(codes, ascent.energy, imposed, TRIAL)
        if found is None or not isinstance(plain, ActiveSetRelaxation) or plain.stalled or plain.pruned:
            return False
        if not found[1].pruned:
            before, after = plain.gap_closed(codes), found[1].gap_closed(codes)
            if after < min(before + MORE, TIMES * before):
                return False
            steps = ROOT + self._scaled.p // NODES_A_STEP
            found = ascent.improve(codes, found[0].multipliers, imposed, steps) or found
        if not found[0].smallest_eigenvalue > 0:
            return False
        self._engine = FormEngine(engine, self._scaled, found[0])
        self.made = 1
        return True

    @property
    def engine(self) -> Engine:
        """Relaxations with the form of the root."""
        assert self._engine is not None
        return self._engine

    def better(self, codes: Codes, relaxation: Relaxation, rows: ImposedRows) -> Relaxation:
        """The relaxation with a new form, where one is due."""
        form = relaxation.form
        if form is None or self._ascent is None:
            return relaxation
        decided = _decided(codes)
        if len(codes) - decided < FEW or decided - _decided(form.codes) < max(FEW, DEEPER * len(codes)):
            return relaxation
        found = self._ascent.improve(codes, form.multipliers, rows.over(codes, range(len(codes))), BELOW)
        self.made += 1
        if found is None or not found[0].smallest_eigenvalue > 0:
            return relaxation
        return found[1]


def _decided(codes: Sequence[int]) -> int:
    return len(codes) - sum(code in (CONTACT, UNDECIDED) for code in codes)


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

    def release(self) -> None:
        """Hand the records on."""
        for record in self._records:
            self.recorder.write(record)
        self._records.clear()

    def drop(self) -> None:
        """Forget the records."""
        self._records.clear()
