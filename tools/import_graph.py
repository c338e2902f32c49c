"""The import graph of a package, read from its source without running it.

Every import counts: those at the top of a module, those under ``if TYPE_CHECKING`` and those inside functions. A *room*
is a module or a package directly below the package (``enumsol.errors``, ``enumsol.search``); an *arrow* joins two rooms
when a module of one imports a module of the other.
"""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

#: Most rooms of one circle among which the order with the fewest arrows up is searched for (2^k sets of rooms).
MOST_ROOMS = 20
_CYTHON_IMPORT = re.compile(r"^\s*(?:from\s+([\w.]+)\s+c?import\s+(.+)|c?import\s+([\w., ]+))$", re.M)


@dataclass(frozen=True, order=True)
class Import:
    """One import statement's arrow between two modules."""

    importer: str
    imported: str
    line: int


def read_imports(source: Path, package: str) -> tuple[dict[str, int], list[Import]]:
    """Lines of code of every module of a package, and the imports between them.

    Parameters
    ----------
    source : directory of the package, for example ``Path("enumsol")``
    package : its name
    """
    texts: dict[str, str] = {}
    found: set[tuple[str, str, str, int]] = set()
    for path in sorted(p for p in source.rglob("*.py*") if p.suffix in (".py", ".pyi", ".pyx")):
        parts = list(path.relative_to(source).with_suffix("").parts)
        module = ".".join([package, *(parts[:-1] if parts[-1] == "__init__" else parts)])
        text = path.read_text(encoding="utf-8")
        texts[module] = texts.get(module, "") + text
        statements = _cython_statements(text) if path.suffix == ".pyx" else _python_statements(text, module)
        found.update((module, base, name, line) for base, name, line in statements)
    imports = {
        Import(importer, imported, line)
        for importer, base, name, line in found
        if (imported := _module_of(base, name, texts)) is not None and imported != importer
    }
    return {module: len(text.splitlines()) for module, text in texts.items()}, sorted(imports)


def _python_statements(text: str, module: str) -> Iterator[tuple[str, str, int]]:
    """(module, name, line) of all imports; the name is empty for ``import module``.

    Relative are those of a package's ``__init__.pyi`` only, which lazy_loader reads.
    """
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, "", node.lineno
        elif isinstance(node, ast.ImportFrom):
            if node.level > 1:
                raise ValueError(f"line {node.lineno} has a relative import; expected absolute ones only")
            base = ".".join(filter(None, (module if node.level else "", node.module)))
            for alias in node.names:
                yield base, alias.name, node.lineno


def _cython_statements(text: str) -> Iterator[tuple[str, str, int]]:
    for match in _CYTHON_IMPORT.finditer(text):
        line = text.count("\n", 0, match.start()) + 1
        base, names, modules = match.groups()
        for item in (modules or names).split(","):
            name = item.split()[0].strip("()")
            yield (name, "", line) if modules else (base, name, line)


def _module_of(base: str, name: str, modules: Mapping[str, object]) -> str | None:
    """The module that ``from base import name`` reaches; None when it is none of the package's."""
    full = f"{base}.{name}" if name else base
    if full in modules:
        return full
    return base if base in modules else None


def room_of(module: str) -> str:
    """The room of a module: its name below the package, cut at the first dot; the package's own ``__init__`` is "."."""
    return [*module.split(".", 2), "."][1]


def room_arrows(imports: Iterable[Import]) -> dict[tuple[str, str], list[Import]]:
    """The arrows between different rooms with the imports behind each."""
    arrows: dict[tuple[str, str], list[Import]] = {}
    for item in imports:
        pair = room_of(item.importer), room_of(item.imported)
        if pair[0] != pair[1]:
            arrows.setdefault(pair, []).append(item)
    return arrows


def circles(pairs: Iterable[tuple[str, str]]) -> list[list[str]]:
    """Sets of two or more nodes that reach each other, the largest first (Tarjan's algorithm, without recursion)."""
    targets: dict[str, list[str]] = {}
    for a, b in pairs:
        targets.setdefault(a, []).append(b)
        targets.setdefault(b, [])
    number: dict[str, int] = {}
    low: dict[str, int] = {}
    waiting: list[str] = []
    found: list[list[str]] = []
    for start, first in targets.items():
        if start in number:
            continue
        work = [(start, iter(first))]
        number[start] = low[start] = len(number)
        waiting.append(start)
        while work:
            node, rest = work[-1]
            target = next(rest, None)
            if target is None:
                work.pop()
                if work:
                    low[work[-1][0]] = min(low[work[-1][0]], low[node])
                if low[node] == number[node]:
                    cut = waiting.index(node)
                    found.append(sorted(waiting[cut:]))
                    del waiting[cut:]
            elif target not in number:
                number[target] = low[target] = len(number)
                waiting.append(target)
                work.append((target, iter(targets[target])))
            elif target in waiting:
                low[node] = min(low[node], number[target])
    return sorted((group for group in found if len(group) > 1), key=lambda group: (-len(group), group))


def upward_arrows(arrows: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
    """The fewest arrows between rooms that must run up, in whatever order the rooms are stacked.

    Only rooms of one circle matter; for each circle the best order is found by dynamic programming over its subsets.

    Raises
    ------
    ValueError
        A circle has more than MOST_ROOMS rooms.
    """
    pairs = sorted(set(arrows))
    up: list[tuple[str, str]] = []
    for group in circles(pairs):
        inside = [(group.index(a), group.index(b)) for a, b in pairs if a in group and b in group]
        up += [(group[a], group[b]) for a, b in _fewest_upward(len(group), inside)]
    return sorted(up)


def _fewest_upward(count: int, arrows: list[tuple[int, int]]) -> list[tuple[int, int]]:
    if count > MOST_ROOMS:
        raise ValueError(f"a circle has {count} rooms; expected at most {MOST_ROOMS}")
    # best[s]: fewest arrows up among the rooms of the set s, stacked from the ground; the last one stacked is above
    best = [0] + [len(arrows) + 1] * ((1 << count) - 1)
    last = [-1] * (1 << count)
    targets = [sum(1 << b for b in {b for a, b in arrows if a == room}) for room in range(count)]
    for chosen in range(1 << count):
        for room in range(count):
            if not chosen >> room & 1:
                cost = best[chosen] + (targets[room] & ~chosen & ~(1 << room)).bit_count()
                if cost < best[chosen | 1 << room]:
                    best[chosen | 1 << room], last[chosen | 1 << room] = cost, room
    place, chosen, height = [0] * count, (1 << count) - 1, count
    while chosen:
        place[last[chosen]], height = height, height - 1
        chosen &= ~(1 << last[chosen])
    return [(a, b) for a, b in arrows if place[a] < place[b]]


def floors(rooms: Iterable[str], arrows: Iterable[tuple[str, str]]) -> dict[str, int]:
    """Floor of every room: 1 on the ground, and above all that it imports, arrows that must run up left out."""
    pairs = set(arrows)
    below: dict[str, list[str]] = {room: [] for room in rooms}
    for a, b in pairs - set(upward_arrows(pairs)):
        below[a].append(b)
    height: dict[str, int] = {}
    while len(height) < len(below):
        for room, targets in below.items():
            if room not in height and all(target in height for target in targets):
                height[room] = 1 + max((height[target] for target in targets), default=0)
    return height


def direct_arrows(arrows: Iterable[tuple[str, str]]) -> set[tuple[str, str]]:
    """The arrows of a graph without circles that do not follow from a way over other nodes."""
    pairs = set(arrows)
    targets: dict[str, set[str]] = {}
    for a, b in pairs:
        targets.setdefault(a, set()).add(b)
    reach: dict[str, set[str]] = {}

    def reached(node: str) -> set[str]:
        if node not in reach:
            below = targets.get(node, set())
            reach[node] = below.union(*(reached(target) for target in below))
        return reach[node]

    return {(a, b) for a, b in pairs if not any(b in reached(other) for other in targets[a])}


def broken_layers(
    imports: Iterable[Import], layers: Sequence[Collection[str]], strangers: Mapping[str, Collection[str]]
) -> list[str]:
    """Imports that a table of layers does not allow, one sentence each.

    Parameters
    ----------
    imports : imports between modules
    layers : the rooms of every layer, from the ground up; a room may import rooms of lower layers only
    strangers : for a room those lower ones that it may not import all the same
    """
    layer = {room: number for number, rooms in enumerate(layers) for room in rooms}
    found = []
    for item in imports:
        above, below = room_of(item.importer), room_of(item.imported)
        if above == below:
            continue
        if layer[below] > layer[above]:
            why = "runs up"
        elif layer[below] == layer[above]:
            why = "runs sideways"
        elif below in strangers.get(above, ()):
            why = f"is not for {above} to make"
        else:
            continue
        found.append(f"{item.importer} line {item.line}: the import of {item.imported} {why}")
    return found
