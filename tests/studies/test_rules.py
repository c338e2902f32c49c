"""What holds for the sources of all studies: nothing private is used, and README tells every question."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
STUDIES = ROOT / "studies"
SOURCES = sorted(STUDIES.rglob("*.py"))
NAMES = sorted(file.parent.name for file in STUDIES.glob("*/run.py"))
README = (STUDIES / "README.md").read_text(encoding="utf-8")
#: Longest file, and longest function: a screen.
LONGEST_FILE, LONGEST_FUNCTION = 400, 60


def private(name):
    return name.startswith("_") and not (name.startswith("__") and name.endswith("__"))


def uses(tree):
    """Private names that a source imports, takes from anything but ``self``, or names in a string."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            path = (getattr(node, "module", None) or "").split(".")
            for name in (*path, *(part for alias in node.names for part in alias.name.split("."))):
                if private(name):
                    yield f"line {node.lineno}: import of {name}"
        elif isinstance(node, ast.Attribute) and private(node.attr):
            if not (isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")):
                yield f"line {node.lineno}: attribute {node.attr}"
        elif isinstance(node, ast.Attribute) and node.attr == "__dict__":
            yield f"line {node.lineno}: __dict__"
        elif isinstance(node, ast.Constant) and re.search(r"(^|\.)_[A-Za-z]\w*$", str(node.value)):
            yield f"line {node.lineno}: {node.value!r}"


@pytest.mark.parametrize(
    "line",
    [
        "from enumsol.relaxation import _active_set",
        "from enumsol._private import name",
        "import enumsol._private",
        "engine._data = 1",
        "problem.__dict__['condensed'] = 1",
        "patch(tree, '_choose')",
    ],
)
def test_the_rule_about_private_names_is_one(line):
    assert list(uses(ast.parse(line)))
    assert not list(uses(ast.parse("from enumsol.search import tree\nself._data = tree.name\nx.__name__")))


def tree_of(file):
    return ast.parse(file.read_text(encoding="utf-8"))


def test_nothing_private_is_used():
    assert [f"{file.relative_to(STUDIES)}, {use}" for file in SOURCES for use in uses(tree_of(file))] == []


def test_files_and_functions_can_be_read():
    for file in SOURCES:
        assert len(file.read_text(encoding="utf-8").splitlines()) <= LONGEST_FILE, file
        for node in ast.walk(tree_of(file)):
            if isinstance(node, ast.FunctionDef):
                assert node.end_lineno - node.lineno < LONGEST_FUNCTION, (file, node.name)


@pytest.mark.parametrize("name", NAMES)
def test_readme_tells_question_command_and_time(name):
    question = ast.get_docstring(tree_of(STUDIES / name / "run.py")).splitlines()[0]
    assert question.endswith("?")
    (line,) = [line for line in README.splitlines() if line.startswith(f"| [{name}]({name}/) |")]
    cells = [cell.strip() for cell in line.strip("|").split("|")]
    assert cells[1] == question
    assert re.fullmatch(r"\d+ (seconds|minutes?)|half a minute", cells[2])
    results = re.findall(r"\]\((\S+)\)", cells[3])
    assert results
    assert all((STUDIES / file).is_file() for file in results)


def test_readme_names_no_other_study():
    assert re.findall(r"^\| \[(\w+)\]", README, re.MULTILINE) == NAMES


def test_studies_that_are_named_elsewhere_exist():
    for folder in (ROOT / "enumsol", ROOT / "tests", STUDIES):
        for file in (ROOT / "README.md", STUDIES / "README.md", *folder.rglob("*.py")):
            text = file.read_text(encoding="utf-8")
            for name in re.findall(r"(?<![\w/])studies/(\w[\w.]*)", text):
                assert (STUDIES / name.rstrip(".")).exists(), (file, name)
            for name in re.findall(r"python studies ([a-z]\w*)", text):
                assert name in NAMES, (file, name)
