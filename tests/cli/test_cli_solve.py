"""``enumsol solve``: the same roots from options, from a TOML file, and from what --output wrote; one sentence else."""

import json
import os
import shlex
from inspect import signature
from pathlib import Path

import numpy as np
import pytest
from command_line import assert_refused, printed, run
from refusals import bad_problem
from typer.testing import CliRunner

from enumsol import enumerate_roots, fem, read_problem
from enumsol.cli.app import app
from enumsol.cli.solve import MESH_OPTIONS

BODY = (Path(__file__).parents[1] / "fem" / "meshes" / "block.22.msh").read_text()
OPTIONS = shlex.split("--contact floor --young 2.5 --poisson 0.25 --spring lid=1,0.5 --load lid=0.2,-0.5")
TOML = """mesh = "body.msh"
contact = "floor"
young = 2.5
poisson = 0.25
spring.lid = [1, 0.5]
load.lid = [0.2, -0.5]
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "body.msh").write_text(BODY)
    (tmp_path / "body.toml").write_text(TOML)
    return tmp_path


def test_from_a_mesh_to_the_roots(here, capsys):
    command = ("solve", "body.msh", *OPTIONS, "--alpha", "0.5", "-o", "body.npz", "--json", "r.json")
    status, out, err = run(capsys, *command)
    assert status == 0
    assert "RootSet at alpha = 0.5: 1 root" in out
    assert out.endswith("complete: yes (proven: one solution, by one certificate)\n")
    assert err == "enumsol: note: wrote a problem with 12 degrees of freedom and 3 contact nodes to body.npz\n"
    problem = read_problem("body.npz")
    direct = fem.mesh_problem(
        "body.msh", contact="floor", young=2.5, poisson=0.25, spring={"lid": (1, 0.5)}, load={"lid": (0.2, -0.5)}
    )
    assert problem.fingerprint == direct.fingerprint
    (root,) = enumerate_roots(problem, 0.5)
    assert json.loads((here / "r.json").read_text())["roots"][0]["lambda_n"] == pytest.approx(root.lambda_n.tolist())


UNITS = "forces in kN, displacements in mm"


@pytest.mark.parametrize(
    ("command", "said", "given"),
    [
        ("solve body.toml --alpha 0.5 --report page.html", UNITS, "--units kN,mm"),
        ("roots body.toml --alpha 0.5 --report page.html", UNITS, "--units kN,mm"),
        ("roots body.toml --alpha 0.5 --report page.html", UNITS, 'units = "kN,mm"'),
        ("fixed-point body.toml --alpha 0.5", UNITS, 'units = ["kN", "mm"]'),
        ("history body.toml --steps 0,0.5 --report page.html", "dissipated [kN mm]", 'units = "kN,mm"'),
    ],
)
def test_units_stand_where_forces_and_displacements_do(here, capsys, command, said, given):
    """Of an option, or of a TOML file, which may have a title, too."""
    option = shlex.split(given) if given.startswith("--") else []
    (here / "body.toml").write_text('title = "My <body>"\n' + ("" if option else f"{given}\n") + TOML)
    assert said in printed(capsys, *shlex.split(command), *option)
    if "--report" in command:
        page = (here / "page.html").read_text(encoding="utf-8")
        assert "<title>My &lt;body&gt;" in page
        assert "kN" in page
    assert said not in printed(capsys, *shlex.split(command), "--units", "N,m")


@pytest.mark.parametrize(
    ("line", "said"),
    [("units = 5", "units is 5; expected units of force and length"), ("title = 5", "title is 5; expected a text")],
)
def test_units_and_titles_that_are_none(here, capsys, line, said):
    (here / "body.toml").write_text(f"{line}\n{TOML}")
    assert_refused(*run(capsys, "roots", "body.toml", "--alpha", 0), said)


@pytest.mark.parametrize(
    "command",
    [
        "solve body.toml --alpha 0.5",
        "roots body.toml --alpha 0.5",
        "table body.toml --alphas 0.5",
        "graph body.toml --from 0 --to 1 --no-stability",
        "follow body.toml --from 0 --to 1 --start 0.5",
        "fixed-point body.toml --alpha 0.2",
    ],
)
def test_every_command_takes_the_toml_file(here, capsys, command):
    assert printed(capsys, *command.split())


def test_a_mesh_is_no_problem_yet(here, capsys):
    said = "which enumsol solve body.msh --output FILE.npz or a .toml file makes\n"
    expected = f"enumsol: error: body.msh is a mesh; expected a problem, {said}"
    assert run(capsys, "roots", "body.msh", "--alpha", "0.5") == (2, "", expected)


@pytest.mark.parametrize(
    ("options", "rests"), [((), True), (("--gap", "0.1"), True), (("--gap", "-0.1"), False), (OPTIONS[-2:], False)]
)
def test_a_forgotten_load_is_noted(here, capsys, options, rests):
    status, _, err = run(capsys, "solve", "body.msh", *OPTIONS[:-2], "--friction", "0.5", *options)
    assert status == 0
    assert ("nothing acts on the body" in err) is rests


def test_friction_and_loads_may_depend_on_alpha(here, capsys):
    command = ("solve", "body.msh", *OPTIONS, "--load-slope", "lid=0,-1", "--pressure-slope", "lid=-0.5")
    status, out, _ = run(capsys, *command, "--friction", "0.2", "--friction-slope", "0.3", "-o", "p.npz")
    assert (status, out) == (0, "")  # it depends on alpha and is written only
    problem = read_problem("p.npz")
    assert np.array_equal(problem.affine_friction, [[0.2] * 3, [0.3] * 3])
    assert problem.load_slope.sum() == pytest.approx(-2 + 1)
    out = printed(capsys, "solve", "body.msh", *OPTIONS, "--friction", "0.5")
    assert "RootSet at alpha = 0: 1 root" in out


def test_options_of_supports_and_obstacles(here, capsys):
    supports = "--displacement lid=free,-0.2 --spring lid=0,1 --obstacle plane=0,-0.1,0,1 --gap -0.05 --friction 0.3"
    command = f"solve body.msh --contact floor --young 1 --poisson 0 {supports} --plane stress --body-force 0,-0.01"
    out = printed(capsys, *command.split(), "-o", "p.npz", note="wrote a problem")
    problem = read_problem("p.npz")
    assert problem.gap == pytest.approx([0.05] * 3)
    assert problem.n == 9
    assert "complete: yes" in out


@pytest.mark.few(22)
@pytest.mark.parametrize(
    ("command", "part"),
    [
        ("solve", "missing argument 'MESH'"),
        ("solve body.msh", "error: --young, --poisson, --contact are missing"),
        ("solve body.msh --contact floor --young 2.5", "error: --poisson is missing"),
        ("solve body.msh OPTIONS", "--alpha is missing, on which friction or load depend"),
        ("solve body.msh OPTIONS --contact flor --alpha 1", "no facets named 'flor'; expected one of flo"),
        ("solve body.msh OPTIONS --load lid=1,2 --alpha 1", "--load is given twice for lid"),
        ("solve body.msh OPTIONS --load top --alpha 1", "--load is top; expected NAME=NUMBERS"),
        ("solve body.msh OPTIONS --pressure lid=1,2 --alpha 1", "--pressure is 1,2; expected numbers"),
        ("solve body.msh OPTIONS --pressure lid=x --alpha 1", "--pressure is x; expected numbers"),
        ("solve body.msh OPTIONS --gap nan --alpha 1", "gap is nan; expected a finite number"),
        ("solve body.msh OPTIONS --obstacle wall=1 --alpha 1", "obstacle is 'wall'; expected one of"),
        ("solve body.toml --young 1 --alpha 1", "--young is given beside body.toml, which has all options"),
        ("solve nowhere.msh OPTIONS --alpha 1", "nowhere.msh: there is no such file; expected a mesh with"),
        ("solve nowhere.msh", "nowhere.msh: there is no such file; expected a mesh with"),
        ("solve bdoy.msh OPTIONS", "bdoy.msh: there is no such file; did you mean body.msh"),
        ("solve '' OPTIONS", "MESH is an empty text; expected the name of a mesh file"),
        ("solve folder.msh OPTIONS", "folder.msh: it is a directory; expected a mesh with named parts"),
        ("solve pipe.msh OPTIONS", "pipe.msh: it is not a regular file; expected a mesh with named parts"),
        ("solve dangling.msh OPTIONS", "dangling.msh: there is no such file; expected a mesh with named parts"),
        ("solve p.npz OPTIONS", "p.npz is a problem; expected a mesh (enumsol roots p.npz solves a problem)"),
        ("solve gallery:wedge-8-5", "gallery:wedge-8-5 is a problem; expected a mesh"),
        ("solve pipe.toml", "pipe.toml: it is not a regular file; expected a TOML file of options"),
        ("roots pipe.npz --alpha 1", "pipe.npz: it is not a regular file; expected a .npz file"),
        ("roots pipe.toml --alpha 1", "pipe.toml: it is not a regular file; expected a TOML file of options"),
        ("roots pipe.msh --alpha 1", "pipe.msh is a mesh; expected a problem"),
        ("roots folder.toml --alpha 1", "folder.toml: the directory has no MatrixMarket files; expected A.mtx"),
        ("roots nowhere.h5 --alpha 1", "nowhere.h5: there is no such file or directory; expected a .npz file"),
        ("solve nowhere.toml --alpha 1", "nowhere.toml: there is no such file"),
        ("roots body.tml --alpha 1", "did you mean body.toml?"),
        ("solve body.msh OPTIONS --alpha 1 -o p.txt", "p.txt: its name ends in '.txt'"),
        ("solve body.msh OPTIONS --alpha 1 --proof -", "a proof is a binary file"),
        (
            "solve body.msh --contact floor --young 2.5 --poisson 0.25 --alpha 1",
            "the body is free to move as a rigid body; expected clamp",
        ),
    ],
)
def test_bad_calls_get_one_sentence(here, capsys, command, part):
    for name in ("folder.msh", "folder.toml"):
        (here / name).mkdir()
    for name in ("pipe.msh", "pipe.toml", "pipe.npz"):
        os.mkfifo(here / name)
    (here / "dangling.msh").symlink_to(here / "nothing")
    assert_refused(*run(capsys, *shlex.split(command.replace("OPTIONS", " ".join(OPTIONS)))), part)


PAIR = shlex.split("--young 2.5 --poisson 0.25 --friction 0.3 --clamp roof --clamp floor")


@pytest.fixture
def two_bodies(here):
    """A square on another one, in one file."""
    meshio = pytest.importorskip("meshio")
    points = [[x, y] for y in (0, 1, 1, 2) for x in (0, 1)]
    cells = [("quad", [[0, 1, 3, 2]]), ("quad", [[4, 5, 7, 6]]), ("line", [[0, 1], [2, 3], [4, 5], [6, 7]])]
    tags = {"gmsh:physical": [[1], [2], [1, 2, 3, 4]], "gmsh:geometrical": [[1], [2], [1, 2, 3, 4]]}
    names = {name: np.array([k + 1, 1]) for k, name in enumerate(("floor", "lower", "upper", "roof"))}
    names |= {"pad": np.array([1, 2]), "disc": np.array([2, 2])}
    meshio.write("two.msh", meshio.Mesh(points, cells, cell_data=tags, field_data=names), "gmsh22", binary=False)
    return here


def test_a_pair_is_the_same_by_option_file_and_call(two_bodies, capsys):
    text = (
        "mesh = 'two.msh'\nyoung = 2.5\npoisson = 0.25\nfriction = 0.3\nclamp = ['roof', 'floor']\n"
        "contact_pair = [['upper', 'lower', -0.01]]\n"
    )
    (two_bodies / "two.toml").write_text(text)
    command = ("solve", "two.msh", *PAIR, "--pair", "upper:lower:-0.01", "-o", "two.npz")
    assert "complete: yes (proven" in printed(capsys, *command, note="wrote a problem")
    given = {"friction": 0.3, "clamp": ["roof", "floor"], "pairs": [("upper", "lower", -0.01)]}
    direct = fem.mesh_problem("two.msh", young=2.5, poisson=0.25, **given)
    assert read_problem("two.npz").fingerprint == direct.fingerprint == fem.read_mesh_problem("two.toml").fingerprint
    assert run(capsys, "solve", "two.msh", *PAIR, "--pair", "upper:lower", "--pressure", "right=0")[0] == 2


def test_materials_and_friction_by_part_in_a_file_on_the_command_line_and_in_a_call(two_bodies, capsys):
    text = (
        "mesh = 'two.msh'\nyoung.pad = 5e3\nyoung.disc = 2e5\npoisson.pad = 0.45\npoisson.disc = 0.3\n"
        "thickness.pad = 2.0\nthickness.disc = 1.0\nplane = 'stress'\n"
        "friction.upper = 0.2\nfriction.floor = 0.1\nfriction_slope.floor = 0.5\n"
        "gap.floor = 0.5\nbody_force.disc = [0, -1]\n"
        "centrifugal.disc = [0.1, 0, 0, 0, 0, 0, 1]\ncontact = 'floor'\ncontact_pair = [['upper', 'lower']]\n"
        "clamp = 'roof'\nspring.lower = [1, 1]\n"
    )
    (two_bodies / "two.toml").write_text(text)
    command = (
        "solve two.msh --young pad=5e3 --young disc=2e5 --poisson pad=0.45 --poisson disc=0.3 --thickness pad=2 "
        "--thickness disc=1 --plane stress --friction upper=0.2 --friction floor=0.1 --friction-slope floor=0.5 "
        "--gap floor=0.5 --body-force disc=0,-1 --centrifugal disc=0.1,0,0,0,0,0,1 "
        "--contact floor --pair upper:lower --clamp roof --spring lower=1,1 "
        "-o two.npz"
    )
    printed(capsys, *command.split(), note="wrote a problem")
    direct = fem.mesh_problem(
        "two.msh", young={"pad": 5e3, "disc": 2e5}, poisson={"pad": 0.45, "disc": 0.3},
        thickness={"pad": 2, "disc": 1}, plane="stress", friction={"upper": 0.2, "floor": 0.1},
        friction_slope={"floor": 0.5}, gap={"floor": 0.5}, body_force={"disc": (0, -1)},
        centrifugal={"disc": (0.1, 0, 0, 0, 0, 0, 1)}, contact="floor",
        pairs=[("upper", "lower")], clamp="roof", spring={"lower": (1, 1)},
    )  # fmt: skip
    assert direct.friction.tolist() == [0.1, 0.1, 0.2, 0.2]
    assert direct.friction_slope.tolist() == [0.5, 0.5, 0.0, 0.0]
    assert read_problem("two.npz").fingerprint == direct.fingerprint == fem.read_mesh_problem("two.toml").fingerprint


def test_joints_in_a_file_on_the_command_line_and_in_a_call(two_bodies, capsys):
    text = (
        "mesh = 'two.msh'\nyoung = 2.5\npoisson = 0.25\nfriction = 0.1\ncontact = 'floor'\ntie = [['upper', 'lower']]\n"
        "reference.P = [0.5, 3.0]\nrigid.P = ['roof']\nforce.P = [0.0, -0.1]\nmoment.P = 0.01\nmoment_slope.P = 0.02\n"
        "node_spring.P = [1.0, 0.0, 2.0]\nnode_spring.upper = [0.5, 0.25]\nforce_slope.lower = [0.0, 0.1]\n"
        "transform.lower.rectangular = [1.0, 1.0]\ndisplacement_slope.P = [0.0, 'free', 'free']\n"
        "equations = [{terms = [['P', 'rz', 1.0], ['P', 'y', -2.0]], value = 0.01}]\nbody_force_slope = [0.0, -0.1]\n"
        "max_rigid_displacement = 'auto'\n"
    )
    (two_bodies / "joined.toml").write_text(text)
    command = (
        "solve two.msh --young 2.5 --poisson 0.25 --friction 0.1 --contact floor --tie upper:lower --reference P=0.5,3 "
        "--rigid P=roof --force P=0,-0.1 --moment P=0.01 --moment-slope P=0.02 --node-spring P=1,0,2 "
        "--node-spring upper=0.5,0.25 --force-slope lower=0,0.1 --transform lower=rectangular:1,1 "
        "--displacement-slope P=0,free,free --equations P.rz:1,P.y:-2=0.01 --body-force-slope 0,-0.1 "
        "--max-rigid-displacement auto -o joined.npz"
    )
    printed(capsys, *command.split(), note="wrote a problem")
    direct = fem.mesh_problem(
        "two.msh", young=2.5, poisson=0.25, friction=0.1, contact="floor", tie=[("upper", "lower")],
        reference={"P": (0.5, 3)}, rigid={"P": "roof"}, force={"P": (0, -0.1)}, moment={"P": 0.01},
        moment_slope={"P": 0.02}, node_spring={"P": (1, 0, 2), "upper": (0.5, 0.25)}, force_slope={"lower": (0, 0.1)},
        transform={"lower": {"rectangular": (1, 1)}}, displacement_slope={"P": (0, "free", "free")},
        equations=[{"terms": [("P", "rz", 1), ("P", "y", -2)], "value": 0.01}], body_force_slope=(0, -0.1),
        max_rigid_displacement="auto",
    )  # fmt: skip
    assert read_problem("joined.npz").fingerprint == direct.fingerprint
    assert fem.read_mesh_problem("joined.toml").fingerprint == direct.fingerprint
    out = printed(capsys, "solve", "joined.toml", "--dry-run")
    assert "joints    P: rigid with 2 nodes of roof" in out
    assert "tie upper:lower: 2 nodes" in out
    assert "resultant (0, -0.1)" in out
    wrong = run(capsys, *command.replace("P.rz:1", "rz:1").split())
    assert wrong[0] == 2
    assert "expected NODE.x:NUMBER" in wrong[2]


@pytest.mark.parametrize("toml", [False, True])
def test_what_was_understood(here, capsys, toml):
    command = ("body.toml",) if toml else ("body.msh", *OPTIONS)
    out = printed(capsys, "solve", *command, "--dry-run", "--plot", "scene.png", "--json", "scene.json")
    for line in ("contact   3 contact nodes of floor, gap 0", "lid: 2 facets, length 2; spring, load", "held"):
        assert line in out
    assert (here / "scene.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads((here / "scene.json").read_text()) == {"scene": out.splitlines(), "notes": []}
    assert "RootSet" not in out


def test_a_scene_that_is_no_problem_is_printed_before_it_is_refused(here, capsys):
    status, out, err = run(capsys, "solve", "body.msh", *OPTIONS[:6], "--friction", "0", "--dry-run", "-o", "p.npz")
    assert status == 2
    assert "3 rigid modes that nothing but contact holds" in out
    assert "note      nothing acts on the body" in out
    assert err.startswith("enumsol: error: the body is free to move as a rigid body")
    assert err.endswith("or --max-rigid-displacement, if contact alone is to hold it\n")
    (here / "body.toml").write_text(TOML.replace("spring", "pressure_slope").replace("[1, 0.5]", "1"))
    status, _, err = run(capsys, "roots", "body.toml", "--alpha", "1")
    assert status == 2
    assert err.startswith("enumsol: error: body.toml: the body is free to move")
    assert run(capsys, "solve", "body.toml", "--alpha", "1") == (2, "", err)


def test_notes_and_a_picture_beside_the_roots(here, capsys):
    status, out, err = run(capsys, "solve", "body.msh", *OPTIONS, "--friction", "9", "--plot", "scene.svg")
    assert status in (0, 3)
    assert "RootSet at alpha = 0" in out
    assert err == "enumsol: note: friction is 9; coefficients of friction above 1 are rare\n"
    assert b"<svg" in (here / "scene.svg").read_bytes()
    assert_refused(*run(capsys, "solve", "body.msh", *OPTIONS, "--plot", "scene.txt"), "scene.txt")


def test_commands_say_the_notes_of_a_described_problem(here, capsys):
    """As solve does, whether it is made of options or of a file."""
    (here / "body.toml").write_text(TOML + "friction = 9\n")
    expected = "enumsol: note: friction is 9; coefficients of friction above 1 are rare\n"
    for command in (("roots", "body.toml", "--alpha", "0"), ("solve", "body.toml", "--alpha", "0")):
        _, out, err = run(capsys, *command)
        assert "RootSet at alpha = 0" in out
        assert err == expected


MATERIAL = "--poisson 0 --friction 0 --clamp roof --clamp floor --pair upper:lower"


@pytest.mark.parametrize(
    ("options", "part"),
    [
        (f"{MATERIAL} --young 1 --young 2", "--young is given 2 times; expected one value, or NAME=VALUE each"),
        (f"{MATERIAL} --young pad=1 --young 2", "--young is 2; expected NAME=NUMBERS"),
        (f"{MATERIAL} --young pad=1 --young pad=2", "--young is given twice for pad"),
        (f"{MATERIAL} --young 1 --thickness pad=x", "--thickness is x; expected numbers"),
        ("PAIR --pair upper", "--pair is upper; expected NAME:NAME, or NAME:NAME:GAP"),
        ("PAIR --pair upper:lower:x", "--pair is upper:lower:x; expected numbers such as 0.5"),
        ("PAIR --pair upper:low", "the mesh has no facets named 'low'; expected one of"),
        (
            "PAIR --pair roof:floor",
            "roof of the pair roof:floor has no node that faces a facet of floor along its normal",
        ),
    ],
)
def test_bad_materials_and_pairs_on_the_command_line(two_bodies, capsys, options, part):
    assert_refused(*run(capsys, "solve", "two.msh", *options.replace("PAIR", " ".join(PAIR)).split()), part)


def test_a_pair_is_called_by_one_name_in_a_file(two_bodies):
    (two_bodies / "two.toml").write_text("mesh = 'two.msh'\ncontact_pair = []\npairs = []\n")
    bad_problem("contact_pair and pairs are given; expected only one of them", fem.read_mesh_problem, "two.toml")


def test_help_names_every_option_of_mesh_problem():
    said = CliRunner().invoke(app, ["solve", "--help"], env={"COLUMNS": "200"}).stdout
    names = [name for name in signature(fem.mesh_problem).parameters if name != "mesh"]
    assert [name for name in names if f"--{name.replace('_', '-')} " not in said] == []


def test_every_option_of_mesh_problem_can_be_given():
    taken = [name for name, of in signature(fem.mesh_problem).parameters.items() if of.kind is of.KEYWORD_ONLY]
    assert list(MESH_OPTIONS) == sorted(taken, key=list(MESH_OPTIONS).index)
