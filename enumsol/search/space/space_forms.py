"""When a search in 3D turns from the energy to a form that knows where the body slides (theory, section 12.2).

Nothing here is trusted: a form is proven convex before anything is concluded from it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from enumsol.relaxation.space_convex_forms import SpaceFormAscent

if TYPE_CHECKING:
    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.relaxation.space_relaxation import SpaceEngine
    from enumsol.search.splitting import ImposedRows
    from enumsol.support.array_types import Codes
    from enumsol.trusted.space.slip_forms import SlipForm

#: Nodes examined with the energy before a form is tried, and the share of the tree that is left then.
NODES, _LEFT = 256, 0.5
#: A form is used where it leaves no more than this share of the gap to the pruning bound at the root of the tree.
_SHARE = 0.25


class SpaceForms:
    """The form of one search.

    Parameters
    ----------
    enclosed : EnclosedSpace
        Balls for its system.
    """

    def __init__(self, enclosed: EnclosedSpace) -> None:
        self._enclosed = enclosed
        #: Relaxations with the form in use, and that form; None for the energy.
        self.engine: SpaceEngine | None = None
        self.form: SlipForm | None = None

    def due(self, nodes: int, covered: float) -> bool:
        """Whether it is time to try a form."""
        return self.tried(nodes) and covered < 1.0 - _LEFT

    def tried(self, nodes: int) -> bool:
        """Whether a search of so many nodes has tried a form."""
        return nodes >= NODES

    def use(self, engine: SpaceEngine, form: SlipForm | None) -> None:
        """Go on with a form that is known already, or with the energy."""
        if form is not None and form is self.form:
            return
        convex = form is not None and form.smallest_eigenvalue > 0
        self.form = form
        self.engine = engine.bounding(form) if form is not None and convex else None

    def pay(self, engine: SpaceEngine, codes: Codes, rows: ImposedRows) -> bool:
        """Whether a form at the root of the search is clearly tighter than the energy; if so it is in use."""
        imposed = rows.over(codes, range(len(codes)))
        plain = engine.root(*imposed)
        if plain.stalled or plain.pruned:
            return False
        found = SpaceFormAscent(engine, self._enclosed).ascended(imposed)
        if found is None or not found[0].smallest_eigenvalue > 0 or not found[1].bound > _SHARE * plain.bound:
            return False
        self.use(engine, found[0])
        return True
