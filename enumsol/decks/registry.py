"""The table of cards: which function reads which card, and which cards change nothing.

A new card is a function with `@card(...)` in one of the modules whose names end in `_cards`.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Collection
from dataclasses import dataclass, field

from enumsol.decks.cards import Card
from enumsol.decks.model import Account, Deck, DeckRegion, Material
from enumsol.decks.steps import Analysis

#: Function that puts a card into the description, and returns what became of it in words; None for no words.
Reader = Callable[["Reading", Card], str | None]


@dataclass(eq=False)
class Reading:
    """A deck while it is read.

    Attributes
    ----------
    deck : Deck
        The description, in which nodes, elements and sets come last.
    ignore : collection of str
        Cards, and types of elements, that are passed over because somebody says so.
    bare : bool
        Read the mesh alone, with what belongs to it, and pass over all other cards.
    region : DeckRegion
        What nodes, elements and sets are put into: the deck itself, a part or an instance.
    top : DeckRegion
        That of the deck itself.
    parts, instances : dict of keys to DeckRegion
    part, instance : str
        Key of the part or the instance that is being read, or "".
    material : Material or None
        The last one, to which what follows belongs.
    """

    deck: Deck
    ignore: Collection[str] = ()
    bare: bool = False
    top: DeckRegion = field(default_factory=DeckRegion)
    parts: dict[str, DeckRegion] = field(default_factory=dict)
    instances: dict[str, DeckRegion] = field(default_factory=dict)
    part: str = ""
    instance: str = ""
    material: Material | None = None

    @property
    def analysis(self) -> Analysis:
        """Description that cards of steps, contacts and constraints are put into."""
        return self.deck.analysis

    @property
    def region(self) -> DeckRegion:
        """Region that nodes, elements and sets are put into."""
        if self.part:
            return self.parts[self.part]
        return self.instances[self.instance] if self.instance else self.top

    def read(self, card: Card) -> None:
        """Put a card into the description.

        Raises
        ------
        InvalidArgumentError
            It is not known, or not as expected.
        """
        name = compact(card.name)
        is_known = any(name in table for table in (CARDS, HARMLESS, REFUSED))
        close = [] if is_known else difflib.get_close_matches(name, CARDS, n=1, cutoff=0.87)
        if self.bare and not any(own in OF_MESH for own in (name, *close)):
            return
        if name in self.ignore:
            self.account(card, "not used, as you say", used=False)
        elif name in CARDS:
            rule = CARDS[name]
            if unknown := [option for option in card.options if compact(option) not in rule.options]:
                known = f"none but {', '.join(sorted(rule.options))}" if rule.options else "none"
                raise card.refused(f"has the option {unknown[0]}, which is not read; expected {known}")
            if (became := rule.read(self, card)) is not None:
                passed = [option for option in card.options if compact(option) in rule.passed]
                said = f"; {', '.join(passed)} {'is' if len(passed) == 1 else 'are'} not used" if passed else ""
                self.account(card, became + said)
        elif name in HARMLESS:
            self.account(card, f"not used: {HARMLESS[name]}", used=False)
        else:
            found, without = REFUSED.get(name, ("is not read, and may change the answer", "to do without it"))
            raise card.refused(
                f"{found}; expected {f'*{close[0]}' if close else 'other cards'}, or "
                f'--ignore {card.name.replace(" ", "")} (in Python ignore=["..."]) {without}'
            )

    def account(self, card: Card, became: str, *, used: bool = True) -> None:
        """Note what became of a card."""
        self.deck.account.append(Account(card.place, card.name, became, used))


@dataclass(frozen=True)
class Rule:
    """A function that reads a card, options that it knows, and those that change nothing."""

    read: Reader
    options: frozenset[str]
    passed: frozenset[str]


#: Cards that are read, by their names without blanks.
CARDS: dict[str, Rule] = {}
#: Cards that change nothing, by their names without blanks, and why.
HARMLESS: dict[str, str] = {}
#: Cards that are refused for a reason, by their names without blanks: what they are, and what it means to ignore them.
REFUSED: dict[str, tuple[str, str]] = {}


def card(name: str, *options: str, unused: Collection[str] = (), of_mesh: bool = False) -> Callable[[Reader], Reader]:
    """Enter a function in the table of cards, with the options that it knows, and those that change nothing."""

    def entered(read: Reader) -> Reader:
        passed = frozenset(map(compact, unused))
        CARDS[compact(name)] = Rule(read, passed.union(map(compact, options)), passed)
        OF_MESH.update([compact(name)] if of_mesh else ())
        return read

    return entered


def harmless(reason: str, *names: str) -> None:
    """Enter cards that change nothing."""
    HARMLESS.update({compact(name): reason for name in names})


#: Cards of either kind that a mesh alone depends on.
OF_MESH: set[str] = set()


def refused(found: str, without: str, *names: str, of_mesh: bool = False) -> None:
    """Enter cards that are refused: what they are, and what leaving them out means."""
    REFUSED.update({compact(name): (found, without) for name in names})
    OF_MESH.update(map(compact, names if of_mesh else ()))


def compact(name: str) -> str:
    """Name of a card or an option as it is compared: CalculiX leaves all blanks out."""
    return name.upper().replace(" ", "").lstrip("*")
