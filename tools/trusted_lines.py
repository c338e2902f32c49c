"""What a proof rests on, in lines of code: every module that `enumsol.verify` may load, by rooms.

    python tools/trusted_lines.py [--modules]

Counted are lines that are neither blank nor comments nor docstrings, of all modules that the checkers import, however
indirectly and wherever in a module. With ``--modules`` each of them is listed. numpy, scipy and python-flint come
on top of that; what reader and writer of a proof share is said in docs/trust.md.
"""

from __future__ import annotations

import argparse
import ast
import io
import tokenize
from collections import defaultdict
from pathlib import Path

from import_graph import read_imports

SOURCE = Path(__file__).resolve().parents[1] / "enumsol"
#: Where a verification begins; the others are loaded from inside functions.
CHECKER = "enumsol.checker.verify"
_NO_CODE = (tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER)


def reached(start: str) -> set[str]:
    """Modules that one imports, however indirectly; but for the package itself, of which checkers use nothing."""
    lines, imports = read_imports(SOURCE, "enumsol")
    below = defaultdict(set)
    for item in imports:
        below[item.importer].add(item.imported)
    found, waiting = set[str](), [start]
    while waiting:
        module = waiting.pop()
        if module not in found and module != "enumsol" and module in lines:
            found.add(module)
            waiting += below[module]
    return found


def code_lines(path: Path) -> int:
    """Lines of a module that are neither blank nor comments nor docstrings; of Cython all that are not blank."""
    text = path.read_text()
    if path.suffix == ".pyx":
        return sum(1 for line in text.splitlines() if line.strip())
    lines = set[int]()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in _NO_CODE:
            lines.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)) and ast.get_docstring(node, clean=False):
            first = node.body[0]
            lines -= set(range(first.lineno, (first.end_lineno or first.lineno) + 1))
    return len(lines)


def by_room() -> dict[str, int]:
    """Lines of all modules that a verification may load, by rooms."""
    return {room: sum(modules.values()) for room, modules in counted().items()}


def counted() -> dict[str, dict[str, int]]:
    """Lines of these modules, by rooms and modules."""
    rooms = defaultdict(dict)
    for module in sorted(reached(CHECKER)):
        base = SOURCE.parent.joinpath(*module.split("."))
        places = base.with_suffix(".py"), base / "__init__.py", base.with_suffix(".pyx")
        rooms[module.split(".")[1]][module] = sum(code_lines(file) for file in places if file.exists())
    return rooms


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--modules", action="store_true", help="list each module")
    listed, rooms = parser.parse_args().modules, counted()
    for room, modules in sorted(rooms.items(), key=lambda each: -sum(each[1].values())):
        print(f"{sum(modules.values()):6d}  {room} ({len(modules)} modules)")
        for module, count in modules.items() if listed else ():
            print(f"          {count:6d}  {module}")
    print(f"{sum(by_room().values()):6d}  in all")


if __name__ == "__main__":
    main()
