"""``enumsol history``: steps from a list, a CSV file and a TOML file; its outputs and exit statuses."""

import csv
import json

import meshio
import pytest
from command_line import assert_refused, printed, run
from complete import complete_report

from enumsol import History, Proof, verify, write_problem
from enumsol.report import roots_page

NODE = ("history", "gallery:one-node-6.1")


@pytest.fixture
def wedge(tmp_path, pulled_wedge):
    write_problem(pulled_wedge, tmp_path / "wedge.npz")
    (tmp_path / "steps.csv").write_text("alpha\n-1\n0\n1/2  # pulled\n1\n")
    return tmp_path / "wedge.npz", tmp_path / "steps.csv"


@pytest.mark.slow
def test_everything_is_written(capsys, wedge, tmp_path, pulled_wedge):
    problem, steps = wedge
    files = {name: tmp_path / f"out.{name}" for name in ("proof", "save", "report", "json", "csv")}
    options = [part for name, path in files.items() for part in (f"--{name}", path)]
    out = printed(capsys, "history", problem, "--steps", steps, *options, "--plot", tmp_path / "out.png")
    assert out.splitlines()[0] == "History of 4 steps: 5 histories (verified)"
    assert out.endswith("complete: yes (proven), unique until step 2\n")
    complete_report(pulled_wedge, Proof.load(files["proof"]))
    assert run(capsys, "verify", problem, files["proof"])[0] == 0
    content = json.loads(files["json"].read_text())
    assert (content["histories"], content["complete"]) == ([1, 1, 3, 5], True)
    rows = list(csv.DictReader(files["csv"].read_text().splitlines()))
    assert [row["step"] for row in rows] == list("1233344444")
    loaded = History.load(files["save"], pulled_wedge)
    assert repr(loaded) == out.rstrip("\n")
    assert verify(pulled_wedge, loaded.proof).complete
    page = files["report"].read_text()
    assert "complete: yes (proven), unique until step 2" in page
    assert "└─ 4.4 4 stick" in page
    assert (page.count('data-step="'), page.count("data:image/png")) == (4, 8)
    assert (tmp_path / "out.png").stat().st_size > 10_000


def test_one_node_is_pressed_and_released(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(roots_page, "_image", lambda figure, words: f"<p>Picture of {words}.</p>")
    files = {name: tmp_path / f"out.{name}" for name in ("report", "json", "csv")}
    options = [part for name, path in files.items() for part in (f"--{name}", path)]
    printed(capsys, *NODE, "--steps", "1,1/2", *options, "--arithmetic", "fast", "--title", "Pressed & released")
    content = json.loads(files["json"].read_text())
    assert content["steps"] == ["LoadStep(alpha=1)", "LoadStep(alpha=0.5)"]
    assert (content["arithmetic"], content["complete"], content["unique_until"]) == ("fast", False, 0)
    assert (content["histories"], content["ends"], content["increments"]) == ([1, 1], [[2, 0]], None)
    assert [row["step"] for row in content["roots"]] == [1, 2]
    page = files["report"].read_text()
    assert "Pressed &amp; released" in page
    assert "Nothing is proven: the result rests on floating-point arithmetic." in page
    # four pairs of quantities, and the bodies of each of two steps
    assert page.count("Picture of ") == 6


def test_steps_stand_in_the_toml_file_of_a_mesh(capsys, tmp_path):
    cells = [("quad", [[0, 1, 2, 3]]), ("line", [[0, 1], [2, 3]])]
    mesh = meshio.Mesh([[0, 0], [1, 0], [1, 1], [0, 1]], cells, cell_data={"part": [[0], [1, 2]]})
    mesh.write(tmp_path / "square.vtu")
    text = (
        "mesh = 'square.vtu'\ngroups = 'part'\nyoung = 2.5\npoisson = 0.25\nclamp = '2'\ncontact = '1'\n"
        "load = {'1' = [0.0, -0.2]}\nload_slope = {'1' = [0.3, 0.0]}\nfriction = 0.5\n"
    )
    place = tmp_path / "square.toml"
    place.write_text(text + "steps = [0, 1, '-1/2']\n")
    status, out, _ = run(capsys, "history", place)
    assert (status, "unique until step 3" in out) == (0, True)
    assert run(capsys, "roots", place, "--alpha", 1)[0] == 0
    place.write_text(text + "[[steps]]\nalpha = 0\n[[steps]]\nalpha = 1\nfriction = 0.1\n")
    assert "History of 2 steps" in run(capsys, "history", place)[1]
    place.write_text("steps = 'steps.csv'\n" + text)
    (tmp_path / "steps.csv").write_text("alpha, friction\n0, 0.5\n1, 0.25\n")
    assert "History of 2 steps" in run(capsys, "history", place)[1]
    place.write_text(text + "[[steps]]\nalph = 0\n")
    assert_refused(*run(capsys, "history", place), "step 1 has alph; expected some of alpha, friction, displacement")
    place.write_text(text.replace("load_slope", "force") + "[[steps]]\n[[steps]]\nforce.1 = [0.0, -0.1]\n")
    out = run(capsys, "history", place)[1]
    assert "History of 2 steps: 1 history (verified)" in out
    alone = text.replace("load_slope = {'1' = [0.3, 0.0]}", "force = {'1' = [0.0, -0.1]}")
    (tmp_path / "steps.toml").write_text("[[steps]]\nforce.1 = [0.3, 0.0]\n[[steps]]\n")
    place.write_text(alone)
    assert run(capsys, "history", place, "--steps", tmp_path / "steps.toml")[1] == out
    refusal = "has tables [[steps]], and gallery:one-node-6.1 has no mesh"
    assert_refused(*run(capsys, *NODE, "--steps", tmp_path / "steps.toml"), refusal)
    assert_refused(*run(capsys, *NODE, "--steps", tmp_path / "none.toml"), "none.toml: there is no such file")


def test_what_is_left_open_is_an_exit_status(capsys, wedge):
    problem, steps = wedge
    assert "(not followed)" in printed(capsys, "history", problem, "--steps", steps, "--follow", "nearest", status=3)
    assert run(capsys, "history", problem, "--steps", steps, "--max-branches", 1)[0] == 3
    printed(capsys, *NODE, "--steps", "5,4", "--arithmetic", "fast")
    assert "increments: " in printed(capsys, *NODE, "--steps", "5,4", "--refine")


def test_bad_input_is_one_sentence(capsys, tmp_path):
    assert_refused(*run(capsys, *NODE), "--steps is missing; expected a CSV file")
    (tmp_path / "no.toml").write_text("steps = [1")
    assert_refused(*run(capsys, "history", tmp_path / "no.toml"), "no.toml: it is not a TOML file (")
    assert_refused(*run(capsys, *NODE, "--steps", tmp_path / "no.toml"), "no.toml: it is not a TOML file (")
    (tmp_path / "no.toml").write_text("stps = [1]")
    assert_refused(*run(capsys, "history", tmp_path / "no.toml"), "--steps is missing; expected a CSV file")
    assert_refused(*run(capsys, *NODE, "--steps", tmp_path / "no.toml"), "no.toml has no steps; expected a CSV file")
    assert_refused(*run(capsys, *NODE, "--steps", "1,x"), "step 2: alpha is 'x'")
    assert_refused(*run(capsys, *NODE, "--steps", tmp_path / "none.csv"), "cannot be read")
    table = tmp_path / "steps.csv"
    table.write_text("alpha,load\n1,2\n")
    assert_refused(*run(capsys, *NODE, "--steps", table), "steps has the columns alpha, load")
    assert_refused(*run(capsys, *NODE, "--steps", "1", "--proof", "-"), "--proof is -")
    assert_refused(*run(capsys, *NODE, "--steps", "1", "--proof", tmp_path / "p", "--arithmetic", "fast"), "--proof")
