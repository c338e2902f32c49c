"""What README shows runs as it stands, and what its comments say comes out."""

import re
import tomllib

import pytest
from documents import ROOT, blocks, follow, write_wedge

import enumsol
from enumsol import gallery

README = ROOT / "README.md"


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """README, followed with a mesh and with the matrices of a gallery's wedge."""
    folder = tmp_path_factory.mktemp("readme")
    write_wedge(folder / "MESH.msh")
    wedge = gallery.get("wedge-14-5").build()
    matrices = {name: getattr(wedge, name).toarray() for name in ("A", "Bn", "Bt")}
    return follow(README, folder, {**matrices, "f": wedge.f, "folder": folder, "__name__": "__main__"})


def test_commands(seen):
    commands = ["roots", "roots", "verify", "solve", "report"]
    assert [command.split()[1] for command, _ in seen["outputs"]] == commands
    for _, text in seen["outputs"]:
        assert "complete: yes" in text


def test_what_the_first_command_prints(seen):
    (printed,) = (text for kind, text in blocks(README) if kind == "text")
    assert seen["outputs"][0][1].endswith(printed)


def test_files(seen):
    expected = {"taper.proof", "roots.proof", "problem.npz", "branches.png", "square.html", "wedge.html"}
    assert {path.name for path in seen["folder"].iterdir() if path.stat().st_size > 1000} >= expected


def test_your_matrices(seen):
    A, Bn, Bt, f = (seen[name] for name in ("A", "Bn", "Bt", "f"))
    roots = enumsol.enumerate_roots(enumsol.ContactProblem(A, Bn, Bt, f, friction=0, friction_slope=1), alpha=2.2)
    assert len(seen["roots"]) == len(roots) == 3
    assert seen["roots"].complete


def test_branches(seen):
    graph = seen["graph"]
    assert (graph.complete, graph.multiplicity_at(3.5), graph.uniqueness_limit) == (True, 5, 3)


def test_links_lead_somewhere():
    links = re.findall(r"\]\(([^)]+)\)", README.read_text(encoding="utf-8"))
    assert len(links) >= 10
    assert [link for link in links if not link.startswith("https://") and not (ROOT / link).exists()] == []


def test_the_two_commands_are_there():
    """One installs and runs the main job, which is run above; the other, for which .ci/run looks, passes the tests."""
    job = next(text for kind, text in blocks(README) if kind == "command")
    install = "    python3 -m venv .venv && .venv/bin/pip install"
    lines = [line for line in README.read_text(encoding="utf-8").splitlines() if line.startswith(install)]
    assert lines == [f"{install} . && .venv/bin/{job}", f'{install} -e ".[test]" && .venv/bin/pytest']


def test_the_front_page_says_what_the_first_screen_says():
    """The site begins as README does: what it finds, for whom, with the command and what it prints."""
    first = (
        README.read_text(encoding="utf-8")
        .partition("Each of the 8 contact nodes")[0]
        .replace("(studies/", "(../studies/")
        .replace("(docs/", "(")
    )
    assert ".venv/bin/enumsol roots" in first
    assert (ROOT / "docs" / "index.md").read_text(encoding="utf-8").startswith(first)


def test_all_pages_count_the_compiled_modules_alike():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    count = ["no", "one", "two", "three", "four"][len(settings["tool"]["setuptools"]["ext-modules"])]
    for page, words in (
        (README, f"compiles {count} small C modules"),
        (ROOT / "CONTRIBUTING.md", f"the {count} compiled modules"),
    ):
        assert words in " ".join(page.read_text(encoding="utf-8").split()), page
