"""The table of cards: which function reads which card, and which cards change nothing.

A new card is a function with `@card(...)` in one of the modules whose names end in `_cards`.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from enumsol.decks.cards import Card
from enumsol.decks.model import Account, Coupling, Deck, DeckRegion, Material
from enumsol.errors import InvalidArgumentError

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
    changing : str or None
        The interaction that cards which follow it belong to.
    coupling : Coupling or None
        One of which the next card says the kind.
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
    changing: str | None = None
    coupling: Coupling | None = None

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
        known = [own for own, rule in CARDS.items() if rule.options is not None]
        close = [] if name in CARDS else difflib.get_close_matches(name, known, n=1, cutoff=0.87)
        if self.bare and not any(CARDS[own].of_mesh for own in (name, *close) if own in CARDS):
            return
        if name in self.ignore:
            self.account(card, "not used, as you say", used=False)
        elif name in CARDS:
            CARDS[name].apply(self, card)
        else:
            instead = f"*{close[0]}" if close else "other cards"
            raise _refusal(card, "is not read, and may change the answer", "to do without it", instead)

    def account(self, card: Card, became: str, *, used: bool = True) -> None:
        """Note what became of a card."""
        self.deck.account.append(Account(card.place, card.name, became, used))


@dataclass(frozen=True)
class Rule:
    """How a card is read.

    Attributes
    ----------
    read : function
        Puts the card into the description.
    options : set of str or None
        Those that it knows, by their names without blanks; None for any.
    passed : set of str
        Those among them that change nothing.
    refused : mapping of str to str
        Those among them that are refused, and what is expected in their place.
    of_mesh : bool
        Whether a mesh alone depends on the card.
    """

    read: Reader
    options: frozenset[str] | None = None
    passed: frozenset[str] = frozenset()
    refused: Mapping[str, str] = field(default_factory=dict)
    of_mesh: bool = False

    def apply(self, reading: Reading, card: Card) -> None:
        """Check the options of a card, read it and note what became of it."""
        given = {compact(option): option for option in card.options}
        if self.options is not None and (unknown := given.keys() - self.options):
            known = f"none but {', '.join(sorted(self.options))}" if self.options else "none"
            first = next(option for own, option in given.items() if own in unknown)
            raise card.refused(f"has the option {first}, which is not read; expected {known}")
        if (other := next((option for option in self.refused if compact(option) in given), None)) is not None:
            raise card.refused(f"has {other}; expected {self.refused[other]}")
        if (became := self.read(reading, card)) is not None:
            passed = [option for own, option in given.items() if own in self.passed]
            said = f"; {', '.join(passed)} {'is' if len(passed) == 1 else 'are'} not used" if passed else ""
            reading.account(card, became + said)


#: All cards that are known, by their names without blanks.
CARDS: dict[str, Rule] = {}


def card(
    name: str,
    *options: str,
    unused: Collection[str] = (),
    refuses: Mapping[str, str] = MappingProxyType({}),
    of_mesh: bool = False,
) -> Callable[[Reader], Reader]:
    """Enter a function in the table of cards: options that it knows, that change nothing, and that are refused."""

    def entered(read: Reader) -> Reader:
        passed = frozenset(map(compact, unused))
        CARDS[compact(name)] = Rule(read, passed.union(map(compact, (*options, *refuses))), passed, refuses, of_mesh)
        return read

    return entered


def harmless(reason: str, *names: str) -> None:
    """Enter cards that change nothing."""

    def pass_over(reading: Reading, given: Card) -> None:
        reading.account(given, f"not used: {reason}", used=False)

    CARDS.update({compact(name): Rule(pass_over) for name in names})


def refused(found: str, without: str, *names: str, of_mesh: bool = False) -> None:
    """Enter cards that are refused: what they are, and what leaving them out means."""

    def refuse(_: Reading, given: Card) -> None:
        raise _refusal(given, found, without)

    CARDS.update({compact(name): Rule(refuse, of_mesh=of_mesh) for name in names})


def _refusal(card: Card, found: str, without: str, instead: str = "other cards") -> InvalidArgumentError:
    spelled = card.name.replace(" ", "")
    return card.refused(f'{found}; expected {instead}, or --ignore {spelled} (in Python ignore=["..."]) {without}')


def compact(name: str) -> str:
    """Name of a card or an option as it is compared: CalculiX leaves all blanks out."""
    return name.upper().replace(" ", "").lstrip("*")
