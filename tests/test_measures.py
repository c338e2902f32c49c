"""The size of the package, in code and in concepts: upper bounds that only fall (CONTRIBUTING, rules of the house)."""

import ast
import io
import re
import tokenize
from collections import Counter

import pytest
from documents import ROOT

#: A change that lowers a measure lowers its bound; one that has to raise it says why in its commit.
BOUNDS = {
    "code lines": 51_639,
    "classes": 585,
    "kinds of records": 18,
    "parameters annotated Any": 106,
    "files": 270,
    "named constants": 446,
    "files over 400 code lines": 0,
    "classes over 250 code lines": 0,
    "functions over 60 code lines": 0,
    "docstrings that begin with a pronoun": 0,
    "class names used twice or more": 0,
}
_NO_CODE = (tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER)
_PRONOUN = re.compile(r"(What|Of|The same|Where|Those|That|As|In which|How|Whether|One)\b")
_CAPITALS = re.compile(r"_?[A-Z][A-Z0-9_]*$")
_WITH_DOCSTRING = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def code_lines(text, tree):
    """Numbers of the lines that are neither blank nor comments nor docstrings."""
    lines = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in _NO_CODE:
            lines.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(tree):
        if isinstance(node, _WITH_DOCSTRING) and ast.get_docstring(node, clean=False) is not None:
            lines -= set(range(node.body[0].lineno, node.body[0].end_lineno + 1))
    return lines


def _is_number(value):
    """Whether an expression is made of numbers: 1e-9, -2, 2.0**-53, (3, 4)."""
    if isinstance(value, ast.Tuple):
        return all(map(_is_number, value.elts)) and len(value.elts) > 0
    if isinstance(value, ast.BinOp):
        return _is_number(value.left) and _is_number(value.right)
    if isinstance(value, ast.UnaryOp):
        return _is_number(value.operand)
    return isinstance(value, ast.Constant) and isinstance(value.value, int | float)


def named_constants(tree):
    """How many numbers have a name of capitals at the top of a module."""
    count = 0
    for node in tree.body:
        targets = getattr(node, "targets", [node.target] if isinstance(node, ast.AnnAssign) and node.value else [])
        for target in targets:
            pairs = [(target, node.value)]
            if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                pairs = zip(target.elts, node.value.elts, strict=True)
            count += sum(
                isinstance(name, ast.Name) and _CAPITALS.match(name.id) is not None and _is_number(value)
                for name, value in pairs
            )
    return count


def _names(nodes):
    return {node.attr if isinstance(node, ast.Attribute) else getattr(node, "id", "") for node in nodes}


def measured(texts):
    """The measures of modules, given by their texts."""
    found = dict.fromkeys(BOUNDS, 0)
    bases, named = {}, Counter()
    for text in texts:
        tree = ast.parse(text)
        found["files"] += 1
        lines = code_lines(text, tree)
        found["code lines"] += len(lines)
        found["files over 400 code lines"] += len(lines) > 400
        found["named constants"] += named_constants(tree)
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                found["classes"] += 1
                found["classes over 250 code lines"] += len(lines & set(range(node.lineno, node.end_lineno + 1))) > 250
                named[node.name] += 1
                bases.setdefault(node.name, set()).update(_names(node.bases))
            elif isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                inside = set(range(node.body[0].lineno, node.end_lineno + 1))
                found["functions over 60 code lines"] += len(lines & inside) > 60
                every = (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)
                found["parameters annotated Any"] += sum(_names([a.annotation]) == {"Any"} for a in every)
                pronoun = _PRONOUN.match(ast.get_docstring(node) or "")
                found["docstrings that begin with a pronoun"] += pronoun is not None
    records = {"Record"}
    while more := {name for name, of in bases.items() if of & records} - records:
        records |= more
    found["kinds of records"] = len(records) - 1
    found["class names used twice or more"] = sum(count > 1 for count in named.values())
    return found


@pytest.fixture(scope="module")
def house():
    return measured(path.read_text(encoding="utf-8") for path in sorted((ROOT / "enumsol").rglob("*.py")))


@pytest.mark.parametrize("measure", BOUNDS)
def test_measures_only_fall(house, measure):
    assert house["files"] > 0
    assert house[measure] <= BOUNDS[measure]


def test_what_is_measured():
    text = '''"""A module."""
# a comment
class Kind(records.Record):
    """A kind."""

    def one(self, a: Any, *, b: Any = 1) -> Any:
        """What it does."""
        return (
            a
        )


class Other(Kind): ...
'''
    expected = dict.fromkeys(BOUNDS, 0) | {
        "code lines": 6,
        "classes": 2,
        "kinds of records": 2,
        "parameters annotated Any": 2,
        "files": 1,
        "docstrings that begin with a pronoun": 1,
    }
    assert measured([text]) == expected
    twice = {name: 2 * count for name, count in expected.items()}
    assert measured([text, text]) == twice | {"kinds of records": 2, "class names used twice or more": 2}


def test_sizes_and_constants_that_are_measured():
    constants = "A, _B = 2.0**-53, (1, -2)\nC: int = 3\nD = some(4)\nlower = 5\nE: float\n"
    assert measured([constants])["named constants"] == 3
    lines = "\n".join(["        x = 0"] * 251)
    found = measured([f"class Large:\n    def long(self):\n{lines}\n"])
    assert found["classes over 250 code lines"] == found["functions over 60 code lines"] == 1
    assert measured(["x = 0\n" * 401])["files over 400 code lines"] == 1
    short = "\n".join(["        x = 0"] * 60)
    found = measured([f"class Small:\n    def short(self):\n{short}\n"])
    assert not any(count for name, count in found.items() if "over" in name)
