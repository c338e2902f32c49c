"""Reading of decks: every card of a file goes to the function that the table of cards has for it."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

# the modules that fill the table of cards
from enumsol.decks import constraint_cards, contact_cards, making_cards, material_cards, mesh_cards, step_cards  # noqa: F401
from enumsol.decks.assembly import put_together
from enumsol.decks.cards import cards_of
from enumsol.decks.model import Deck
from enumsol.decks.registry import Reading, compact


def described(path: Path, *, ignore: Collection[str] = (), bare: bool = False) -> Deck:
    r"""Description of a deck.

    Parameters
    ----------
    path : Path
    ignore : collection of str
        Names of cards and of types of elements that are passed over.
    bare : bool
        Read the mesh alone: cards of loads, materials, contact and the like are not looked at.

    Raises
    ------
    InvalidArgumentError
        The deck cannot be read as a whole; it says why, with file and line.

    Examples
    --------
    >>> import pathlib
    >>> from enumsol.decks.reading import described
    >>> nodes = "1, 0., 0.\n2, 1., 0.\n3, 1., 1.\n"
    >>> _ = pathlib.Path("corner.inp").write_text(f"*NODE\n{nodes}*ELEMENT, TYPE=CPS3, ELSET=ALL\n7, 1, 2, 3\n")
    >>> deck = described(pathlib.Path("corner.inp"))
    >>> deck.element_sets, [entry.became for entry in deck.account]
    ({'ALL': array([0])}, ['3 nodes', '1 element of type CPS3'])
    """
    reading = Reading(Deck(path), frozenset(map(compact, ignore)), bare)
    for each in cards_of(path):
        reading.read(each)
    return put_together(reading)
