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
    "code lines": 51_637,
    "classes": 585,
    "kinds of records": 18,
    "parameters annotated Any": 106,
    "files": 271,
    "docstrings that begin with a pronoun": 0,
    "class names used twice or more": 0,
}
_NO_CODE = (tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER)
_PRONOUN = re.compile(r"(What|Of|The same|Where|Those|That|As|In which|How|Whether|One)\b")
_WITH_DOCSTRING = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def code_lines(text, tree):
    """Lines that are neither blank nor comments nor docstrings."""
    lines = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in _NO_CODE:
            lines.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(tree):
        if isinstance(node, _WITH_DOCSTRING) and ast.get_docstring(node, clean=False) is not None:
            lines -= set(range(node.body[0].lineno, node.body[0].end_lineno + 1))
    return len(lines)


def _names(nodes):
    return {node.attr if isinstance(node, ast.Attribute) else getattr(node, "id", "") for node in nodes}


def measured(texts):
    """The measures of modules, given by their texts."""
    found = dict.fromkeys(BOUNDS, 0)
    bases, named = {}, Counter()
    for text in texts:
        tree = ast.parse(text)
        found["files"] += 1
        found["code lines"] += code_lines(text, tree)
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                found["classes"] += 1
                named[node.name] += 1
                bases.setdefault(node.name, set()).update(_names(node.bases))
            elif isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
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
    assert list(measured([text]).values()) == [6, 2, 2, 2, 1, 1, 0]
    assert list(measured([text, text]).values()) == [12, 4, 2, 4, 2, 2, 2]
