"""Lines of decks as cards: a name, options and lines of data, each with its place.

Upper and lower case, blanks, empty lines, comments (`**`) between any two lines, options that go on in the next line
and `*INCLUDE` are dealt with here, so that nothing else has to. Files that are none, or far too large, are refused.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.support.array_types import Floats, Integers, NDArray
from enumsol.support.deadlines import look, tell
from enumsol.support.files import unreadable
from enumsol.support.messages import counted, shortened, visible

T = TypeVar("T")

#: Bytes of all files of a deck together: larger ones need several times as much memory when they are read.
MOST_BYTES = 1_000_000_000
#: Length of a direction may differ from one by this, and radii of the ends of an arc by this share, by rounding of the
#: numbers in a deck.
ROUNDED = 1e-3
#: Bytes of a line; no program writes lines of more than some hundreds.
LONGEST_LINE = 100_000
#: Files that a deck may include, each time counted, and how deep they may be nested.
MOST_FILES, DEEPEST = 1_000, 20
#: Numbers as both programs read them, the exponents of Fortran among them.
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([EeDd][-+]?\d+)?\Z")
_INTEGER = re.compile(r"[-+]?\d+\Z")
#: Characters of numbers: with these alone Python and both programs read the same.
_OF_NUMBERS = frozenset("0123456789+-.eE, \t")


@dataclass(frozen=True, order=True)
class DeckPlace:
    """A line of a deck, as in "model.inp line 812"."""

    file: str
    line: int

    def __str__(self) -> str:
        return f"{self.file} line {self.line}"

    def refused(self, found: str) -> InvalidArgumentError:
        """Error about what stands here."""
        return InvalidArgumentError(f"{self}: {found}")

    def entry(self, table: Mapping[str, T], name: str, said: str, expected: str = "one of") -> T:
        """The entry of the table that is named here.

        Raises
        ------
        InvalidArgumentError
            There is none; the message begins with what is said, and has the names that there are.
        """
        if name not in table:
            raise self.refused(f"{said}; expected {expected} {', '.join(table) or 'none'}")
        return table[name]


@dataclass(eq=False)
class Card:
    """A keyword of a deck with its options and lines of data.

    Attributes
    ----------
    name : str
        In upper case with single blanks, as in "SOLID SECTION".
    options : dict
        What stands behind the name: names in upper case, values as written; "" for an option without a value.
    place : DeckPlace
    data : list of str
        Lines of data without comments and empty lines, and without blanks at their ends.
    runs : list of (int, DeckPlace)
        Places of the rows of data behind which others follow line by line.
    """

    name: str
    options: dict[str, str]
    place: DeckPlace
    data: list[str] = field(default_factory=list)
    runs: list[tuple[int, DeckPlace]] = field(default_factory=list)

    def at(self, row: int) -> DeckPlace:
        """DeckPlace of a row of the data."""
        first, place = self.runs[bisect_right(self.runs, row, key=lambda run: run[0]) - 1]
        return DeckPlace(place.file, place.line + row - first)

    def refused(self, found: str, row: int | None = None) -> InvalidArgumentError:
        """Error about the card, or about a row of its data: its place, its name and what is wrong with it."""
        return (self.place if row is None else self.at(row)).refused(f"*{self.name} {found}")

    def name_of(self, option: str) -> str:
        """Key of what an option names, "" if there is none (see `key`)."""
        return key(self.options.get(option, ""))

    def needed(self, option: str) -> str:
        """Key of what an option names.

        Raises
        ------
        InvalidArgumentError
            The option is missing.
        """
        if not (named := self.name_of(option)):
            raise self.refused(f"has no {option}; expected {option}=NAME")
        return named

    def new_name(self, table: Collection[str]) -> str:
        """Key of the name of something that no other one in a table has.

        Raises
        ------
        InvalidArgumentError
            There is no name, or it is in the table.
        """
        if (name := self.needed("NAME")) in table:
            raise self.refused(f"is named {name} like another one; expected names that differ")
        return name

    def choice(self, option: str, known: Collection[str], expected: str) -> str:
        """Key of what an option names, one of those that are known.

        Raises
        ------
        InvalidArgumentError
            It is another one.
        """
        if (chosen := self.name_of(option)) not in known:
            raise self.refused(f"has {option}={chosen}; expected {expected}")
        return chosen

    def entries(self, row: int) -> list[str]:
        """Entries of a line of data, without blanks around them and without empty ones at the end."""
        entries = [entry.strip() for entry in self.data[row].split(",")]
        while entries and not entries[-1]:
            entries.pop()
        return entries

    def rows(self) -> Iterator[tuple[int, list[str]]]:
        """Rows of the data, each with its entries."""
        return ((row, self.entries(row)) for row in range(len(self.data)))

    def number(self, entry: str, row: int) -> float:
        """Value of an entry; 0 if it is empty.

        Raises
        ------
        InvalidArgumentError
            It is no number.
        """
        if not entry:
            return 0.0
        if _NUMBER.match(entry):
            value = float(entry.upper().replace("D", "E"))
            if np.isfinite(value):
                return value
        raise self.refused(f"has {shown(entry)}; expected a number", row)

    def integer(self, entry: str, row: int) -> int:
        """Value of an entry as an integer of at most 18 digits.

        Raises
        ------
        InvalidArgumentError
            It is none.
        """
        if _INTEGER.match(entry) and len(entry) <= 18:
            return int(entry)
        raise self.refused(f"has {shown(entry)}; expected an integer", row)

    def components(self, row: int, entries: Sequence[str]) -> tuple[int, ...]:
        """Components from one to another, or one of them.

        Raises
        ------
        InvalidArgumentError
            They are not among 1 to 6.
        """
        ends = [self.integer(entry, row) for entry in entries if entry]
        if not ends or not 1 <= ends[0] <= ends[-1] <= 6:
            given = ", ".join(map(str, ends)) or "none"
            raise self.refused(f"has the components {given}; expected some from 1 to 6", row)
        return tuple(range(ends[0], ends[-1] + 1))

    def numbers(self, row: int, least: int = 0, most: int | None = None) -> list[float]:
        """Numbers in a line of data.

        Raises
        ------
        InvalidArgumentError
            They are too few or too many, or no numbers.
        """
        entries = self.entries(row)
        if len(entries) < least or (most is not None and len(entries) > most):
            expected = f"{least}" if most == least else f"{least} to {most}" if most is not None else f"{least} or more"
            raise self.refused(f"has {counted(len(entries), 'number')} in a line; expected {expected}", row)
        return [self.number(entry, row) for entry in entries]

    def table(self, columns: int) -> Floats:
        """Numbers (k, columns) of all lines of data; what is missing at the end of a line is 0.

        Raises
        ------
        InvalidArgumentError
            An entry is no number, or a line has more.
        """
        lines = [text.rstrip(", \t") for text in self.data]
        counts = {text.count(",") for text in lines}
        if len(counts) == 1 and (width := counts.pop() + 1) <= columns:
            values = _numbers_of(lines, float)
            if values is not None:
                return np.pad(values.reshape(len(lines), width), ((0, 0), (0, columns - width)))
        found = np.zeros((len(lines), columns))
        for row in range(len(lines)):
            own = self.numbers(row, 0, columns)
            found[row, : len(own)] = own
        return found

    def integers(self, width: int) -> Integers:
        """Integers (k, width) of all data, each row of which begins a line and may take several.

        Raises
        ------
        InvalidArgumentError
            An entry is no integer, or rows and lines do not fit together.
        """
        lines = [text.strip(", \t") for text in self.data]
        counts = np.array([text.count(",") + 1 for text in lines], dtype=np.int64)
        ends = np.cumsum(counts)
        if len(ends) and not np.all(counts == width):
            wanted = np.arange(width, ends[-1] + width, width)
            lacking = np.setdiff1d(wanted, ends)
            if len(lacking):
                row = int(np.searchsorted(ends, lacking[0] - width, side="right"))
                stop = min(int(np.searchsorted(ends, lacking[0])), len(lines) - 1)
                count = int(ends[stop] - (ends[row - 1] if row else 0))
                expected = f"expected {width}, its own and those of its nodes"
                raise self.refused(f"has {counted(count, 'number')} for one element; {expected}", row)
        values = _numbers_of(lines, int)
        if values is None:
            every = [self.integer(entry.strip(), row) for row, text in enumerate(lines) for entry in text.split(",")]
            values = np.array(every, dtype=np.int64)
        return np.asarray(values.reshape(-1, width))


def _numbers_of(lines: Sequence[str], kind: type[float] | type[int]) -> NDArray[Any] | None:
    """All numbers of some lines; None if some are not plain ones, and have to be looked at one by one."""
    text = ",".join(lines)
    if not _OF_NUMBERS.issuperset(text):
        return None
    try:
        values = np.array(list(map(kind, text.split(","))), dtype=np.float64 if kind is float else np.int64)
    except (ValueError, OverflowError):
        return None
    return values if np.all(np.isfinite(values)) else None


def continued(entries: Sequence[str], each: int) -> list[str]:
    """Lines of data with so many entries each, all but the last continued."""
    rows = [", ".join(entries[k : k + each]) for k in range(0, len(entries), each)]
    return [*(f"{row}," for row in rows[:-1]), *rows[-1:]]


def key(name: str) -> str:
    """Name as names are compared: in upper case, but as it stands if it is in quotes."""
    name = name.strip()
    return name.strip('"') if name.startswith('"') else name.upper()


def shown(entry: str) -> str:
    """An entry of a deck as messages quote it."""
    return repr(visible(shortened(entry, 60)))


def target_of(entry: str) -> str:
    """A number of a node or an element as it stands, or the key of the name of a set."""
    return entry if is_number(entry) else key(entry)


def is_number(entry: str) -> bool:
    """True for an entry that is the number of a node or an element, and no name."""
    return _INTEGER.match(entry) is not None


def cards_of(path: Path) -> list[Card]:
    """Cards of a deck and of the files that it includes, in their order.

    Raises
    ------
    InvalidArgumentError
        A file cannot be read, is no deck, is too large, includes itself or lies outside of the deck's folder.
    """
    source = _Source(path)
    source.read(path, ())
    return source.cards


@dataclass(eq=False)
class _Source:
    """The files of a deck while they are read."""

    path: Path
    cards: list[Card] = field(default_factory=list)
    files: int = 0
    size: int = 0

    def read(self, path: Path, above: tuple[Path, ...]) -> None:
        lines = self._lines(path)
        above = (*above, path.resolve())
        starred = [k for k, line in enumerate(lines) if line.lstrip()[:1] == "*"]
        self._add_data(path, lines, 0, starred[0] if starred else len(lines))
        begin = 0
        for count, k in enumerate(starred):
            if count % 1_000 == 0:
                look()
                tell(f"lines of {path.name}", k, len(lines))
            text = lines[k].strip()
            if k >= begin and not text.startswith("**"):
                text, begin = _whole(lines, text, k + 1)
                self._begin(DeckPlace(path.name, k + 1), path, text, above)
            begin = max(begin, k + 1)
            self._add_data(path, lines, begin, starred[count + 1] if count + 1 < len(starred) else len(lines))

    def _begin(self, place: DeckPlace, path: Path, text: str, above: tuple[Path, ...]) -> None:
        word, *pairs = text[1:].split(",")
        options = {}
        for pair in pairs:
            name, _, value = pair.partition("=")
            if name.strip():
                options[" ".join(name.upper().split())] = value.strip()
        card = Card(" ".join(word.upper().split()), options, place)
        if card.name != "INCLUDE":
            self.cards.append(card)
        if card.name == "INCLUDE" or options.get("INPUT"):  # cards of Abaqus may have their data in a file
            self.read(self._included(card, path, above), above)
            options.pop("INPUT")

    def _included(self, card: Card, path: Path, above: tuple[Path, ...]) -> Path:
        """File that a card includes."""
        name = card.options.get("INPUT", "").strip("\"'").replace("\\", "/")
        if not name:
            raise card.refused("names no file; expected INPUT=FILE")
        folder = self.path.parent.resolve()
        places = [(base / name).resolve() for base in (path.parent, self.path.parent)]
        place = next((each for each in places if each.exists()), places[0])
        if not place.is_relative_to(folder):
            raise card.refused(f"names {shown(name)}, outside of the folder of the deck; expected a file in it")
        if place in above:
            raise card.refused(f"names {place.name}, which includes it; expected no circles of files")
        if len(above) >= DEEPEST or self.files >= MOST_FILES:
            raise card.refused(
                f"is one too many; expected at most {MOST_FILES} included files, nested at most {DEEPEST} deep"
            )
        if (found := unreadable(place)) is not None:
            raise card.refused(f"names {shown(name)}: {found}; expected a file beside the deck")
        return place

    def _add_data(self, path: Path, lines: list[str], begin: int, end: int) -> None:
        """Lines from one to another as data of the last card."""
        stripped = [line.strip() for line in lines[begin:end]]
        filled = [k for k, line in enumerate(stripped) if line] if "" in stripped else range(len(stripped))
        if not filled:
            return
        if not self.cards:
            place = DeckPlace(path.name, begin + filled[0] + 1)
            raise place.refused(
                f"{shown(stripped[filled[0]])} is no keyword; expected a deck of CalculiX or Abaqus, which begins with "
                "one, such as *NODE"
            )
        card, last = self.cards[-1], -2
        for count, k in enumerate(filled):
            if k != last + 1:
                card.runs.append((len(card.data) + count, DeckPlace(path.name, begin + k + 1)))
            last = k
        card.data += [stripped[k] for k in filled]

    def _lines(self, path: Path) -> list[str]:
        """Lines of a file as text."""
        if (found := unreadable(path)) is not None:
            raise InvalidArgumentError(f"{path}: {found}; expected a deck of CalculiX or Abaqus")
        self.files += 1
        content = bytearray()
        with path.open("rb") as file:
            while piece := file.read(LONGEST_LINE):
                if b"\0" in piece:
                    raise InvalidArgumentError(f"{path}: it is a binary file; expected a deck of CalculiX or Abaqus")
                if len(piece) == LONGEST_LINE and b"\n" not in piece and b"\r" not in piece:
                    raise InvalidArgumentError(
                        f"{path}: line {content.count(10) + 1} has more than {LONGEST_LINE:,} characters; expected a "
                        "deck of CalculiX or Abaqus"
                    )
                content += piece
                self.size += len(piece)
                if self.size > MOST_BYTES:
                    raise InvalidArgumentError(
                        f"{path}: the deck has more than {MOST_BYTES:,} bytes; expected at most so many"
                    )
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = content.decode("latin-1")
        return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def _whole(lines: list[str], text: str, begin: int) -> tuple[str, int]:
    """Keyword with all its options, which go on in the next line behind a comma; and the line behind them.

    A line that begins with no letter is data behind a comma too many.
    """
    k = begin
    while text.endswith(",") and k < len(lines):
        more = lines[k].strip()
        k += 1
        if more.startswith("**"):
            continue
        if not more[:1].isalpha():
            break
        text, begin = text + more, k
    return text, begin
