"""References: every one to docs/theory.md, to the paper or to a file of the repository leads somewhere."""

import io
import re
import tokenize
import tomllib
from pathlib import Path

import pytest
from references import NUMBER, OWN_REFERENCE, THEORY_REFERENCE, headings, labels

ROOT = Path(__file__).parent.parent
THEORY = (ROOT / "docs" / "theory.md").read_text(encoding="utf-8")
DOCUMENTS = [ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
SOURCES = sorted(
    path
    for folder in ("enumsol", "tests", "studies", "tools")
    for suffix in ("py", "pyx")
    for path in (ROOT / folder).rglob(f"*.{suffix}")
    if path != Path(__file__)
)

THEORY_WORD = re.compile(r"\btheory\b(?!\.md)", re.IGNORECASE)
PAPER_ITEM = re.compile(
    rf"\b(Algorithm|Definition|Theorem|Lemma|Proposition|Remark|Examples?|Sections?) ({NUMBER})"
    rf"(?:(?:, | and | to |-)({NUMBER}))?"
)
#: Where a theorem may come from: the paper, or a work in the theory's list of references.
SOURCE = re.compile(r"(?:\bpaper,|\bpaper's|\bHigham(?: 2002)?,) $")


def paper_items(text):
    """What the table at the end of the theory says about the paper: ("Algorithm", "5.1"), ..."""
    return set(re.findall(rf"^\| (\w+) ({NUMBER}) \|", text, re.MULTILINE))


def statements(text):
    """The numbered statements of a document: ("Theorem", "6.1"), ..., in order."""
    return re.findall(rf"^\*\*(Definition|Theorem|Lemma|Proposition) ({NUMBER})\.?\*\*", text, re.MULTILINE)


SECTIONS, EQUATIONS, PAPER = set(headings(THEORY)), set(labels(THEORY)), paper_items(THEORY)


def unresolved(text, own=None, stated=frozenset()):
    """Complaints about the references in a running text.

    ``own`` are the section numbers of the text itself, if any, and ``stated`` its statements.
    """
    found = []
    left = list(text)
    for word in THEORY_WORD.finditer(text):
        reference = THEORY_REFERENCE.match(text, word.start())
        if reference is None:
            found.append(f"'{text[word.start() : word.start() + 40]}' is no reference")
            continue
        equations = re.findall(r"\((\d+\.\d+)\)", reference[0])
        rest = re.sub(r"\(\d+\.\d+\)", "", reference[0])
        found += [f"theory has no equation ({number})" for number in equations if number not in EQUATIONS]
        found += [f"theory has no section {n}" for n in re.findall(NUMBER, rest) if n not in SECTIONS]
        left[reference.start() : reference.end()] = " " * len(reference[0])
    rest = "".join(left)
    for item in PAPER_ITEM.finditer(rest):
        source = SOURCE.search(rest[: item.start()])
        if source is None and (item[1], item[2]) in stated:
            continue
        if source is None:
            found.append(f"'{item[0]}' does not say of what work")
        elif "paper" in source[0]:
            kind, *numbers = item[1].removesuffix("s"), item[2], item[3]
            found += [f"theory says nothing of paper, {kind} {n}" for n in numbers if n and (kind, n) not in PAPER]
    for section in OWN_REFERENCE.finditer(rest):
        if own is None:
            found.append(f"'{section[0]}' does not say of what document")
        else:
            found += [f"no section {n} here" for n in re.findall(NUMBER, section[0]) if n not in own]
    return found


def joined(text):
    return re.sub(r"\s+", " ", text)


def prose(source):
    """Docstrings and blocks of comments of a Python or Cython source, each as one line."""
    blocks, comment, last, fresh = [], [], -1, True
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            if token.start[0] != last + 1:
                blocks.append(" ".join(comment))
                comment = []
            comment.append(token.string.lstrip("#: "))
            last = token.start[0]
        elif token.type == tokenize.STRING and fresh:
            blocks.append(token.string.strip("\"'"))
        if token.type not in (tokenize.NL, tokenize.COMMENT):
            fresh = token.type in (tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT)
    return [joined(block) for block in (*blocks, " ".join(comment)) if block]


ROOMS = sorted({path.parent for path in SOURCES})


@pytest.mark.few(7)
@pytest.mark.parametrize("room", ROOMS, ids=lambda room: str(room.relative_to(ROOT)))
def test_references_in_sources(room):
    texts = {path: path.read_text(encoding="utf-8") for path in SOURCES if path.parent == room}
    assert [(path, c) for path, text in texts.items() for block in prose(text) for c in unresolved(block)] == []


of_documents = pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))


@of_documents
def test_references_in_documents(path):
    text = path.read_text(encoding="utf-8")
    # a title is no reference, and no more is what the table of the paper's items is about
    body = re.sub(rf"^(#.*|\| \w+ {NUMBER} \|)", "", text, flags=re.MULTILINE)
    assert unresolved(joined(body), own=set(headings(text)), stated=set(statements(text))) == []


@of_documents
def test_equations_referred_to_inside_documents(path):
    text = path.read_text(encoding="utf-8")
    blocks = r"^    [^\n]*$|^```.*?^```|^\$\$$.*?^\$\$$"
    body = THEORY_REFERENCE.sub("", joined(re.sub(blocks, "", text, flags=re.MULTILINE | re.DOTALL)))
    # pairs of data, such as (1.5, -4), have no such form
    assert set(re.findall(r"\((\d+\.\d+)\)", body)) <= set(labels(text))


def test_numbers_of_equations_are_read_from_both_kinds_of_blocks():
    text = "Let\n\n$$\nx = 1\n\\tag{5.1}\n$$\n\nand\n\n    y = 2      (5.2)\n\nby (5.3). $z$ as in (5.4)\n"
    assert labels(text) == ["5.1", "5.2"]


@of_documents
def test_formulas_of_their_own_stand_between_lines(path):
    """Dollars in pairs; a formula's number ends it."""
    text = re.sub(r"^```.*?^```|^    [^\n]*$|`[^`\n]*`", "", path.read_text(encoding="utf-8"), flags=re.M | re.S)
    between = re.split(r"^\$\$$", text, flags=re.MULTILINE)
    assert len(between) % 2 == 1
    assert not any("$$" in part or "\\tag" in part or part.count("$") % 2 for part in between[::2])
    for formula in between[1::2]:
        assert re.fullmatch(r"\n([^\n$]+\n)+?(\\tag\{\d+\.\d+\}\n)?", formula), formula
        assert formula.count("\\tag") <= 1, formula


def test_numbering_of_the_theory():
    tops = [number for number in headings(THEORY) if "." not in number]
    assert tops == [str(k + 1) for k in range(len(tops))]
    # sections 1 to 7 keep their subjects: other texts refer to them
    subjects = ("problem", "selections", "branches", "condensation", "energy", "certificates", "alpha")
    for number, subject in zip(tops, subjects, strict=False):
        assert re.search(rf"^## {number}\. .*{subject}", THEORY, re.MULTILINE | re.IGNORECASE)
    stated = [number for _, number in statements(THEORY)]
    for numbers in (headings(THEORY), labels(THEORY), stated):
        for top in tops:
            inside = [n.split(".")[1] for n in numbers if n.startswith(f"{top}.")]
            assert inside == [str(k + 1) for k in range(len(inside))]
    for part in re.split(r"^## ", THEORY, flags=re.MULTILINE)[1:]:
        numbers = [*labels(part), *(number for _, number in statements(part))]
        assert all(part.startswith(number.split(".")[0] + ".") for number in numbers)


@of_documents
def test_files_named_in_documents_exist(path):
    named = re.findall(r"`((?:enumsol|tests|studies|docs)/[\w./-]*)`", path.read_text(encoding="utf-8"))
    assert [name for name in named if not (ROOT / name).exists()] == []


@pytest.mark.parametrize(
    "text",
    [
        "(theory, section 5)",
        "theory, section 5.2",
        "theory, sections 2, 4 and 6.1",
        "theory, sections 2-5",
        "theory, (6.1)",
        "theory, (6.1) and (6.3)",
        "by theory, section 6.2, (6.3)",
        "Steps 3-6 of the paper's Algorithm 5.1 (paper, Remark 5.1)",
        "the paper's Examples 6.1-6.3",
        "(Higham, Theorem 9.3)",
        "see docs/theory.md",
    ],
)
def test_references_that_resolve(text):
    assert unresolved(text) == []


@pytest.mark.parametrize(
    "text",
    [
        "theory, section 99",
        "theory, section 5.99",
        "theory, sections 5 and 99",
        "theory, (5.99)",
        "theory, (6.1) and (6.99)",
        "theory: equilibrium, Signorini, Coulomb",
        "theory, 4 and 7",
        "(theory, 1-2)",
        "theory section 6",
        "by the theory",
        "Algorithm 5.1",
        "paper, Algorithm 9.9",
        "the paper's Examples 6.1-6.9",
        "(Section 4, Theorem 4.1)",
        "see section 6",
    ],
)
def test_references_that_do_not(text):
    assert unresolved(text) != []


def test_a_broken_reference_in_a_source_is_found():
    source = '"""Title (theory,\nsection 99)."""\n\n#: A number that\n#: theory, (5.99) explains.\nx = "theory"\n'
    complaints = [c for block in prose(source) for c in unresolved(block)]
    assert complaints == ["theory has no section 99", "theory has no equation (5.99)"]


def test_the_map_names_what_there_is():
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    places = re.findall(r"`([a-z_]+(?:/[\w.]*)+)`", text)
    assert len(places) > 100
    assert [place for place in places if not any((ROOT / top / place).exists() for top in ("", "enumsol"))] == []
    sources = "".join(file.read_text(encoding="utf-8") for file in SOURCES)
    classes = re.findall(r"`([A-Z]\w*[a-z]\w*)(?:\.\w+)?`", text)
    assert len(classes) > 40
    assert [
        name for name in classes if not re.search(rf"^ *(class {name}\b|{name}\b.* = )", sources, re.MULTILINE)
    ] == []


def recipes():
    """The recipes of docs/architecture.md and those of CONTRIBUTING.md, by their titles."""
    found = {}
    for place, mark in (("docs/architecture.md", "### "), ("CONTRIBUTING.md", "## Add ")):
        text = (ROOT / place).read_text(encoding="utf-8")
        found |= dict(re.findall(rf"^{mark}(.+)\n((?:(?!#).*\n)*)", text, re.MULTILINE))
    return found


@pytest.mark.parametrize("title", recipes())
def test_names_in_recipes_are_in_the_files_that_these_name(title):
    text = recipes()[title]
    places = [ROOT / name for name in re.findall(r"`((?:enumsol|studies|tests|tools)/[\w./]*)`", text)]
    files = [file for place in places for file in ([place] if place.is_file() else place.rglob("*.py"))]
    sources = "".join(file.read_text(encoding="utf-8") for file in files)
    assert [name for name in re.findall(r"`(\w+)`", text) if not re.search(rf"\b{name}\b", sources)] == []


def test_the_recipes_are_found():
    assert {"A new command", "A new friction law", "a status", "a file format"} <= recipes().keys()


def test_the_citation_names_this_software_and_its_paper():
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    fields = dict(re.findall(r"^(\w[\w-]*): (.+)$", citation, re.MULTILINE))
    assert fields["version"] == project["version"]
    assert fields["license"] == project["license"]
    assert fields["title"].strip('"').lower() == f"{project['name']}: {project['description']}".lower()
    assert "Qualitative analysis of solutions to discrete static contact problems with" in citation
