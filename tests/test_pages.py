"""Every page of the documents is followed, and what it says comes out; README and the pages on meshes elsewhere."""

import re
import shutil

import pytest
from documents import DOCUMENTS, ROOT, blocks, follow, runs

import enumsol
from enumsol import fem

DOCS = ROOT / "docs"


def page(name, *files):
    """A fixture: what the page leaves behind, and the folder where it was followed, with files that it needs."""

    @pytest.fixture(scope="module", name=name)
    def followed(tmp_path_factory):
        folder = tmp_path_factory.mktemp(name)
        for file in files:
            shutil.copy(file, folder)
        return {**follow(DOCS / f"{name}.md", folder, {"__name__": "__main__"}), "folder": folder}

    return followed


NAMES = ("branches", "collection", "command_line", "gallery", "histories", "results", "stability", "three_dimensions")
branches, collection, command_line, gallery, histories, results, stability, three_dimensions = map(page, NAMES)
tutorial = page("tutorial")
WEDGE = ROOT / "studies" / "against_calculix"
from_a_deck = page("from_a_deck", WEDGE / "wedge.inp", WEDGE / "results" / "wedge.dat")


def test_no_page_is_forgotten():
    elsewhere = {ROOT / "README.md", DOCS / "index.md", DOCS / "from_a_mesh.md", DOCS / "from_other_codes.md"}
    assert {path for path in DOCUMENTS if runs(path)} == elsewhere | {
        DOCS / f"{name}.md" for name in (*NAMES, "from_a_deck", "tutorial")
    }


def test_blocks_that_are_run_are_found():
    assert [kind for kind, _ in blocks(DOCS / "tutorial.md")].count("command") == 5
    for path in DOCUMENTS:
        text = path.read_text(encoding="utf-8")
        kinds = [kind for kind, _ in blocks(path)]
        assert kinds.count("python") == text.count("```python\n")
        assert kinds.count("command") == len(re.findall(r"^    .*\benumsol [a-z]", text, re.MULTILINE)), path


@pytest.mark.slow
def test_tutorial(tutorial):
    printed = [text for kind, text in blocks(DOCS / "tutorial.md") if kind == "text"]
    outputs = [text for _, text in tutorial["outputs"]]
    assert printed == [outputs[0]]
    assert "one solution below alpha = 1.3726" in outputs[2]
    assert all("complete: yes" in outputs[k] for k in (1, 2, 4))
    assert "every solution for every alpha in [0, 4] lies on these arcs" in outputs[3]
    graph, problem = tutorial["graph"], tutorial["problem"]
    assert [round(fold.alpha, 3) for fold in graph.folds] == [1.373, 3.588]
    assert [graph.multiplicity_at(alpha) for alpha in (1, 2, 3.6)] == [1, 3, 5]
    assert tutorial["limit"] == pytest.approx(1.3726, abs=1e-4)
    assert str(tutorial["jammed"].statuses[0]) == "stick"
    assert problem.fingerprint == enumsol.read_problem(tutorial["folder"] / "wedge.npz").fingerprint
    assert (tutorial["folder"] / "wedge.html").stat().st_size > 100_000


@pytest.mark.slow
def test_the_wedge_of_the_tutorial_is_that_of_its_study(tutorial):
    mesh = fem.trapezoid(6, 4, bottom=1.0, top=1.8, height=1.0).parted()
    acting = {
        "spring": {"top": (0.02, 0.02)},
        "load": {"top": (1e-4, 1e-3)},
        "gap": -5e-4,
        "friction": 0.0,
        "friction_slope": 1.0,
    }
    wedge = fem.mesh_problem(mesh, young=2.5, poisson=0.25, contact=["left", "right"], **acting)
    roots = enumsol.enumerate_roots(wedge, 4)
    assert [root.statuses for root in roots] == [root.statuses for root in tutorial["roots"]]


def test_branches_and_continuation(branches):
    graph, path = branches["graph"], branches["path"]
    assert (graph.complete, graph.multiplicity_at(3.5), graph.uniqueness_limit) == (True, 5, 3)
    assert "of them 3 folds" in str(path)
    assert not branches["report"].complete
    assert branches["everything"].complete
    assert list(branches["table"]["roots"]) == [1, 1, 1]
    assert enumsol.verify(branches["problem"], graph.proof).complete
    assert {path.name for path in branches["folder"].iterdir()} >= {"branches.png", "graph.json", "POINTS.csv"}


@pytest.mark.slow
def test_collection(collection):
    assert (collection["folder"] / "FOLDER" / "problems" / "wedge-8-5.h5").exists()
    printed = dict(collection["outputs"])
    assert "51 problems tried, 51 of them with all" in printed["enumsol collection check FOLDER/certified"]
    assert collection["answer"].converged


@pytest.mark.slow
def test_three_dimensions(three_dimensions):
    assert three_dimensions["limit"].converged
    assert three_dimensions["weakening"].converged
    assert [str(root.statuses[0]) for root in three_dimensions["roots"]] == ["stick", "slip", "open"]
    assert three_dimensions["roots"].complete
    assert (three_dimensions["folder"] / "block.vtu").stat().st_size > 1000
    pictures = {path.name for path in three_dimensions["folder"].glob("wedge*")}
    assert pictures == {"wedge.html", "wedge.pvd", *(f"wedge-{k}.vtu" for k in range(9))}


def test_from_a_deck(from_a_deck):
    shipped = ROOT / "tests" / "decks" / "block_on_base.inp"
    assert (from_a_deck["folder"] / "model.inp").read_text(encoding="utf-8") == shipped.read_text(encoding="utf-8")
    printed = [text for kind, text in blocks(DOCS / "from_a_deck.md") if kind == "text"]
    assert [text for _, text in from_a_deck["outputs"][:2]] == printed[1:]
    told = str(from_a_deck["model"]).splitlines()
    assert all(line in told for line in printed[0].splitlines() if line != "...")
    assert (from_a_deck["history"].complete, len(from_a_deck["roots"])) == (True, 1)


def test_results(results):
    report = results["report"]
    assert (report.roots, report.undecided) == (5, 0)
    assert "complete: yes" in results["outputs"][-1][1]


@pytest.mark.slow
def test_reports(command_line):
    files = {"FILE", "FOLDER", "node.proof", "roots.html", "shoe.proof", "wedge.html", "wedge.proof"}
    assert {path.name for path in command_line["folder"].iterdir()} == files


@pytest.mark.slow
def test_a_cluster(command_line):
    assert len(command_line["spread"]) == 5
    assert command_line["spread"].complete


@pytest.mark.slow
def test_histories(histories):
    assert {path.name for path in histories["folder"].iterdir()} >= {"loop.png", "node.html", "wedge.html", "map.png"}
    assert (histories["history"].complete, histories["found"].complete) == (True, True)
    assert histories["history"].counts == (1, 1, 3, 5)


@pytest.mark.slow
def test_stability(stability):
    printed = [text for kind, text in blocks(DOCS / "stability.md") if kind == "text"]
    # small root sets are printed with their nodes first
    shown = [text for command, text in stability["outputs"] if "proof" not in command and "table" not in command]
    assert printed == [text[max(text.find("RootSet"), 0) :] for text in shown]
    assert [found.verdict for found in stability["verdicts"]] == ["does not run away", "runs away", "does not run away"]
    assert stability["steel"].growth_rates[0] == pytest.approx(40_000, rel=0.01)
    assert (stability["root"].index, stability["mass"][0]) == (1, [3, 1.5])


@pytest.mark.slow
def test_gallery(gallery):
    counts = {"taper": 3, "clip": 3, "off": 1, "rough": 1, "rests": 1, "slides": 0, "wedge": 5, "solid": 3}
    assert all(gallery[name].complete for name in (*counts, "locking"))
    assert {name: len(gallery[name]) for name in counts} == counts
    assert gallery["safe"] == pytest.approx(0.347, abs=5e-4)
    assert gallery["locking"].multiplicity_at(0.4) == 3
    assert gallery["relief"] == pytest.approx(1 / 1.2, rel=1e-4)
    assert {str(status) for status in gallery["joint"].statuses} == {"stick"}
    assert {str(status) for status in gallery["turns"].statuses} <= {"slip+", "slip-"}
    assert gallery["transmitted"] == pytest.approx(1504, abs=1)
    assert max(gallery["square"].steps[2]) == 5
    shown = re.findall(r"\(pictures/(\w+\.png)\)", (DOCS / "gallery.md").read_text(encoding="utf-8"))
    assert len(shown) == 10
    for name in shown:
        assert (DOCS / "pictures" / name).is_file()
        assert (gallery["folder"] / name).stat().st_size > 1000
