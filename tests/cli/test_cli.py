import csv
import io
import json
import shlex
import signal
import subprocess
import sys

import numpy as np
import pytest
from command_line import assert_refused, call, on_terminal, printed, run
from helpers.floating_oracle import block_on_table
from plain_arrays import DENSE, A, free_bar
from typer.testing import CliRunner

from enumsol import Proof, gallery, read_problem, verify, write_problem
from enumsol.cli.app import app
from enumsol.relaxation.active_set import ActiveSetEngine

EXAMPLE = ("roots", "gallery:one-node-6.1", "--alpha")


# -- what is printed ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("alpha", "more", "status", "line", "unique"),
    [
        ("1", (), 0, "unique: yes (proven by one certificate)", True),
        ("5", (), 0, "unique: no (two solutions, proven; --unique looks for no more)", False),
        ("5", ("--max-nodes", "1"), 3, "unique: not known (complete: no (stopped after max_nodes = 1 node, ", None),
        ("1", ("--arithmetic", "fast"), 0, "unique: not known (fast arithmetic proves nothing)", None),
    ],
)
def test_is_there_one_solution(alpha, more, status, line, unique, capsys, tmp_path):
    report = tmp_path / "x.json"
    out = printed(capsys, *EXAMPLE, alpha, "--unique", "--json", report, *more, status=status)
    assert out.startswith(line)
    assert len(out.splitlines()) == 1
    assert json.loads(report.read_text())["unique"] is unique


def test_one_solution_or_so_many(capsys):
    assert_refused(*run(capsys, *EXAMPLE, 5, "--unique", "--stop-after", 3), "--stop-after is 3 with --unique")


def test_roots_of_the_first_example(capsys):
    out = printed(capsys, *EXAMPLE, 5)
    assert "3 roots (verified, tree)" in out
    assert "index sum: +1" in out
    assert out.endswith("complete: yes (proven)\n")
    rows = [line.split() for line in out.splitlines()[1:4]]
    assert [row[3] for row in rows] == ["open", "slip-", "stick"]
    assert [float(row[4]) for row in rows] == pytest.approx([0.0, 1 / 3, 1.5], abs=1e-6)
    assert max(map(len, out.splitlines())) <= 90
    # what the heads mean, and where the node is
    assert out.splitlines()[0].endswith("at (x, y)")
    assert all(line.endswith("  (0, 0)") for line in out.splitlines()[1:4])
    for head in ("index: the sign of", "regular: no node", "margin: distance"):
        assert head in out


def test_fast_arithmetic_is_not_proven_but_succeeds(capsys):
    out = printed(capsys, "roots", "gallery:wedge-8-5", "--alpha", 3, "--arithmetic", "fast")
    assert "5 roots (fast, tree)" in out
    assert out.endswith("complete: not proven (0 undecided)\n")


def test_a_fraction_is_exact(capsys):
    # at the fold alpha = 8/3 a second, degenerate root appears; the nearest float64 lies below
    out = printed(capsys, *EXAMPLE, "8/3")
    assert "2 roots" in out
    assert "1    +0      no  0.00e+00" in out
    assert "1 root (" in printed(capsys, *EXAMPLE, repr(8 / 3))


def test_families_are_listed_with_their_vertices(capsys):
    out = printed(capsys, "roots", "gallery:one-node-6.3", "--alpha", 2)
    assert "0 roots, 1 family" in out
    assert "family 0, vertices" in out


def test_large_results_have_no_table_over_nodes(capsys):
    out = printed(capsys, "roots", "gallery:chain-4", "--alpha", 5, "--arithmetic", "fast")
    assert out.startswith("RootSet at alpha = 5: 81 roots")
    assert "... 61 more" in out


@pytest.mark.slow
def test_methods_and_jobs_agree(capsys):
    counts = []
    for options in ((), ("--arithmetic", "fast", "--method", "exhaustive"), ("--jobs", 2), ("--arithmetic", "exact")):
        out = printed(capsys, "roots", "gallery:two-node-5", "--alpha", 5, *options)
        counts.append(out[out.index("RootSet") :].split()[5])
    assert counts == ["5"] * 4
    out = printed(capsys, "roots", "gallery:wedge-20-5", "--alpha", 2.25, "--jobs", 2)
    assert "5 roots (verified, tree)" in out


def test_json_holds_everything(capsys, tmp_path):
    result = json.loads(printed(capsys, *EXAMPLE, 5, "--json", "-"))
    assert (result["alpha"], result["complete"], result["index_sum"]) == (5.0, True, 1)
    found = [(*root["statuses"], root["index"]) for root in result["roots"]]
    assert found == [("open", 1), ("slip-", -1), ("stick", 1)]
    assert result["roots"][1]["lambda_n"] == pytest.approx([1 / 3], rel=1e-12)
    low, high = result["roots"][1]["enclosure"]["lambda_n"][0]
    assert low <= 1 / 3 <= high
    assert result["stats"]["nodes"] > 0
    file = tmp_path / "result.json"
    assert "complete: yes" in printed(capsys, "roots", "gallery:one-node-6.3", "--alpha", "2", "--json", file)
    family = json.loads(file.read_text())["families"][0]
    assert sorted(vertex[0] for vertex in family["polytopes"][0]["vertices"]) == [[0.0, 0.0], [1.0, -2.0]]


def test_csv_has_a_row_a_root_and_node(capsys, tmp_path):
    out = printed(capsys, "roots", "gallery:two-node-5", "--alpha", 5, "--csv", "-")
    rows = list(csv.DictReader(io.StringIO(out)))
    assert len(rows) == 10
    assert {*rows[0]} == {"alpha", "root", "node", "status", "lambda_n", "lambda_t", "u_n", "u_t", "index", "regular"}
    file = tmp_path / "r.csv"
    status, _, err = run(capsys, "roots", "gallery:one-node-6.3", "--alpha", 2, "--csv", file)
    assert status == 0
    assert err == "enumsol: note: the CSV holds the isolated roots only, --json the 1 family too\n"
    assert file.read_text().startswith("alpha,root,node")


def test_a_proof_can_be_written_and_checked(capsys, tmp_path):
    file = tmp_path / "r.proof"
    printed(capsys, "roots", "gallery:two-node-5", "--alpha", 5, "--proof", file)
    assert verify(gallery.get("two-node-5").build(), Proof.load(file)).ok


@pytest.mark.slow
def test_gallery_list_and_write(capsys, tmp_path):
    out = printed(capsys, "gallery", "list")
    assert [line.split()[0] for line in out.splitlines()] == list(gallery.GALLERY)
    file = tmp_path / "p.npz"
    out = printed(capsys, "gallery", "write", "two-node-6.4", file)
    assert out == f"wrote two-node-6.4 to {file}; try: enumsol roots {file} --alpha 3.5\n"
    assert read_problem(file).p == 2
    assert "5 roots" in printed(capsys, "roots", file, "--alpha", 3.5)
    printed(capsys, "gallery", "write", "gallery:two-node-6.4", tmp_path / "market")
    assert (tmp_path / "market" / "A.mtx").exists()


def test_gallery_writes_problems_in_3d(capsys, tmp_path):
    file = tmp_path / "p.npz"
    out = printed(capsys, "gallery", "write", "block3d-4", file)
    assert out == f"wrote block3d-4 to {file}; try: enumsol roots {file} --alpha 0.5\n"
    assert read_problem(file).fingerprint == gallery.get("block3d-4").build().fingerprint
    out = printed(capsys, "gallery", "write", "block3d-100", tmp_path / "large.npz")
    assert "try: enumsol fixed-point" in out
    listed = [" ".join(line.split()[:3]) for line in printed(capsys, "gallery", "list").splitlines()[-10:]]
    assert listed == [
        *("one-node-3d 0 1", "one-node-3d-3 0 3", "block3d-4 0.5 1", "block3d-9 0.5 1", "block3d-16 0.5 1"),
        *("block3d-100 0.5 -", "wedge3d-2-3 1 3", "wedge3d-4-3 1 3", "wedge3d-4-9 3 9", "wedge3d-8-5 2 5"),
    ]


def test_all_solutions_in_3d(capsys, tmp_path):
    proof, table = tmp_path / "node.proof", tmp_path / "node.csv"
    arguments = ("roots", "gallery:one-node-3d-3", "--alpha", 0, "--proof", proof, "--csv", table)
    out = printed(capsys, *arguments)
    assert out.endswith("index sum: +1\ncomplete: yes (proven)\n")
    assert [line.split()[-10] for line in out.splitlines()[1:4]] == ["stick", "slip", "open"]
    heads = table.read_text().splitlines()[0].split(",")
    assert heads[4:10] == ["lambda_n", "lambda_t1", "lambda_t2", "u_n", "u_t1", "u_t2"]
    assert "complete: yes" in printed(capsys, "verify", "gallery:one-node-3d-3", proof)
    slides = json.loads(printed(capsys, "roots", "gallery:one-node-3d-3", "--alpha", 0, "--json", "-"))["roots"][1]
    assert slides["statuses"] == ["slip"]
    low, high = slides["slip_angle"][0]
    assert low < np.arctan2(slides["u_t"][0][1], slides["u_t"][0][0]) < high < low + 1e-6
    assert np.shape(slides["dlambda_dalpha"]) == (1, 3)
    assert "open, stick, slip: how many" in printed(capsys, *TABLE_3D)


TABLE_3D = ("table", "gallery:block3d-4", "--from", 0.5, "--to", 1, "--samples", 2)


@pytest.mark.slow
def test_jobs_in_3d(capsys, tmp_path):
    proof = tmp_path / "block.proof"
    out = printed(capsys, "roots", "gallery:block3d-9", "--alpha", 0.5, "--jobs", 2, "--proof", proof)
    assert out == run(capsys, "roots", "gallery:block3d-9", "--alpha", 0.5)[1]
    printed(capsys, "verify", "gallery:block3d-9", proof)
    assert run(capsys, *TABLE_3D, "--jobs", 2)[:2] == run(capsys, *TABLE_3D)[:2]
    interval = ("--from", 0.5, "--to", 1)
    graphs = [printed(capsys, "graph", "gallery:block3d-4", *interval, *jobs) for jobs in ((), ("--jobs", 2))]
    assert graphs[0] == graphs[1]


def test_help_and_version(capsys):
    for command in ("", "gallery", "--help", "roots -h", "gallery write --help"):
        assert "Usage: enumsol" in printed(capsys, *command.split())
    assert printed(capsys, "--version").startswith("enumsol ")
    # as typer itself runs the application
    result = CliRunner().invoke(app, ["roots", "--help"])
    assert result.exit_code == 0
    for word in ("--alpha", "--arithmetic", "--stop-after", "--max-nodes", "--time-limit", "--json", "130"):
        assert word in result.output


# -- exit statuses -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (("--stop-after", 2), "complete: no (stopped after enough roots"),
        (("--max-nodes", 3), "complete: no (stopped after max_nodes = 3 nodes"),
        (("--time-limit", 1e-9), "complete: no (stopped by the time limit"),
        (("--max-nodes", 3, "--arithmetic", "fast"), "complete: no (stopped after max_nodes = 3 nodes"),
    ],
)
def test_a_search_cut_short_is_status_3(capsys, options, line):
    out = printed(capsys, "roots", "gallery:chain-4", "--alpha", 5, *options, status=3)
    assert out.splitlines()[-1].startswith(line)


def test_statuses_of_the_process(tmp_path):
    done = call("roots", "gallery:one-node-6.1", "--alpha", "5")
    assert (done.returncode, done.stderr) == (0, "")
    cut = call("roots", "gallery:chain-2", "--alpha", "5", "--stop-after", "1", "--json", tmp_path / "r.json")
    assert (cut.returncode, cut.stderr) == (3, "")
    assert json.loads((tmp_path / "r.json").read_text())["complete"] is False
    for option, part in (("--alpha", "the gallery has no problem named 'nothing'"), ("--alfa", "no such")):
        bad = call("roots", "gallery:nothing", option, "5")
        assert_refused(bad.returncode, bad.stdout, bad.stderr, part)


@pytest.mark.slow
def test_a_reader_that_stops_early_does_no_harm():
    command = f"{sys.executable} -m enumsol gallery list | head -1"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, timeout=60, check=False)
    assert done.stderr == ""
    assert done.stdout.startswith("one-node-6.1")


# -- bad input ---------------------------------------------------------------------------------------------------------


#: One of each kind of mistake: their sentences are tested where they come from.
BAD_FILES = {
    "shape": (DENSE | {"A": A[:3]}, "A has shape (3, 4); expected a square matrix"),
    "rigid body": (DENSE | {"A": free_bar(4).toarray()}, "the body is free to move as a rigid body"),
    "NaN": (DENSE | {"gap": np.nan}, "gap has the value nan"),
    "at this alpha": (DENSE | {"friction1": -1.0}, "friction at alpha = 5 is -5 at contact node 0; expected F >= 0"),
    "missing array": ({k: v for k, v in DENSE.items() if k != "Bt"}, "Bt is missing (found A, Bn and f)"),
}


@pytest.mark.parametrize("case", BAD_FILES)
def test_bad_problems_get_one_sentence(capsys, tmp_path, case):
    arrays, part = BAD_FILES[case]
    file = tmp_path / "p.npz"
    np.savez(file, **arrays)
    where = () if "alpha = 5" in part else (f"{file}: ",)
    assert_refused(*run(capsys, "roots", file, "--alpha", 5), part, *where)


@pytest.mark.parametrize(
    ("command", "part"),
    [
        ("roots gallery:chain-2 --alpha nan", "--alpha is 'nan'; expected a finite real number"),
        ("roots gallery:chain-2 --alpha inf", "--alpha is 'inf'; expected a finite real number"),
        ("roots gallery:chain-2 --alpha 1e999", "--alpha is '1e999'; expected a finite real number"),
        (
            "roots gallery:chain-2 --alpha five",
            "--alpha is 'five'; expected a finite real number such as 2.5 or a fraction such as 8/3",
        ),
        ("roots gallery:chain-2 --alpha 1/0", "--alpha is '1/0'; expected a finite real number"),
        ("roots gallery:chain-2 --alpha 1/2/3", "--alpha is '1/2/3'; expected a finite real number"),
        (f"roots gallery:chain-2 --alpha 1{400 * '0'}/3", "expected a finite real number"),
        ("roots gallery:chain-2 --alpha -1", "friction at alpha = -1 is -1 at contact node 0; expected F >= 0"),
        ("roots gallery:chian-2 --alpha 5", "no problem named 'chian-2'; did you mean chain-2"),
        ("gallery write chian-2 p.npz", "no problem named 'chian-2'; did you mean chain-2"),
        ("roots nowhere.npz --alpha 5", "nowhere.npz: there is no such file or directory; expected a .npz file"),
        (f"roots {shlex.quote(__file__)} --alpha 5", "its name ends in '.py'; expected a .npz file"),
        ("gallery write chain-2 p.txt", "p.txt: its name ends in '.txt'; expected a .npz file"),
        ("gallery write chain-2 /no/where.npz", "/no/where.npz cannot be written (No such file or directory)"),
        ("gallery write chain-2 p.h5", "friction or load depends on alpha, which fclib cannot hold"),
        ("roots gallery:chain-2 --alpha 5 --json /no/where", "--json is /no/where, which cannot be"),
        ("roots gallery:chain-2 --alpha 5 --csv /tmp", "--csv is /tmp, a directory; expected"),
        ("roots gallery:chain-2 --alpha 5 --csv - --json -", "--json and --csv are both -"),
        ("roots gallery:chain-2 --alpha 5 --proof -", "a proof is a binary file; expected the name"),
        ("roots gallery:chain-2 --alpha 5 --time-limit -1", "is -1.0; expected a positive number of seconds\n"),
        ("roots gallery:chain-2 --alpha 5 --time-limit soon", "--time-limit is 'soon'; expected a number\n"),
        ("roots gallery:chain-2 --alpha 5 --max-nodes 0", "--max-nodes is '0'; expected at least 1\n"),
        ("roots gallery:chain-2 --alpha 5 --stop-after two", "--stop-after is 'two'; expected a whole number\n"),
        ("roots gallery:chain-2 --alpha 5 --arithmetic sloppy", "--arithmetic is 'sloppy'; expected one of 'verified'"),
        ("roots gallery:chain-2 --alpha 5 --method exhaustive", "for the oracle"),
        ("roots gallery:one-node-3d --alpha 0 --arithmetic exact", "--arithmetic is exact, which problems in 3D"),
        ("roots gallery:one-node-3d --alpha 0 --method exhaustive", "method is"),
        ("roots gallery:chain-2 --alpha 5 --method exhaustive --jobs 2", "expected 1 job"),
        ("roots gallery:clamped-block-16 --alpha 5 --method exhaustive --arithmetic fast", "hours"),
        ("roots gallery:chain-2", "--alpha is missing"),
        ("roots --alpha 5", "missing argument 'PROBLEM'"),
        ("roots gallery:chain-2 --alfa 5", "no such option: --alfa; did you mean --alpha?"),
        ("follow gallery:chain-2 --alpha 5", "no such option: --alpha; expected some of --from, --to, --start"),
        ("roots gallery:chain-2 more --alpha 5", "unexpected extra argument"),
        ("rots", "no such command 'rots'"),
        ("gallery lst", "no such command 'lst'"),
    ],
)
def test_bad_calls_get_one_sentence(capsys, tmp_path, monkeypatch, command, part):
    monkeypatch.chdir(tmp_path)
    assert_refused(*run(capsys, *shlex.split(command)), part)
    assert not any(tmp_path.iterdir())


def test_a_file_that_is_no_problem_file(capsys, tmp_path):
    (tmp_path / "p.proof").touch()
    named = "an fclib file (.h5, .hdf5), a deck (.inp) or a .toml file of a mesh"
    assert_refused(*run(capsys, "roots", tmp_path / "p.proof", "--alpha", 5), "its name ends in '.proof'", named)
    for content in (b"", b"just text", b"PK\x03\x04 and no more", b"\x93NUMPY"):
        file = tmp_path / "p.npz"
        file.write_bytes(content)
        assert_refused(*run(capsys, "roots", file, "--alpha", 5), f"{file}: it is no", "expected")
    expected = "no MatrixMarket files; expected A.mtx, Bn.mtx, Bt.mtx and f.mtx"
    assert_refused(*run(capsys, "roots", tmp_path, "--alpha", 5), expected)


@pytest.mark.filterwarnings("default")
def test_warnings_are_lines_without_source_code(capsys, monkeypatch):
    class Missing(ActiveSetEngine):
        def __init__(self, *_args):
            raise ImportError

    # an installation without the compiled engine
    monkeypatch.setattr("enumsol.search.solvers.ActiveSetEngine", Missing)
    status, out, err = run(capsys, *EXAMPLE, 5, "--arithmetic", "fast")
    assert (status, "3 roots" in out) == (0, True)
    assert err.startswith("enumsol: warning: the compiled active-set solver cannot be loaded")
    assert err.count("\n") == 1


# -- interruption and progress -----------------------------------------------------------------------------------------


@pytest.mark.few(1, 0)
@pytest.mark.parametrize(
    "options",
    [
        ("--arithmetic", "fast"),
        pytest.param(("--arithmetic", "verified"), marks=pytest.mark.slow),
        pytest.param(("--jobs", "2"), marks=pytest.mark.slow),
    ],
)
def test_ctrl_c_prints_what_was_found(tmp_path, options):
    # 3^12 roots take minutes
    file, result = tmp_path / "chain.npz", tmp_path / "result.json"
    write_problem(gallery.chain(12, 0.05), file)
    with on_terminal("roots", file, "--alpha", 5, "--json", result, *options) as (process, wait_for):
        # with jobs no progress comes before the first subtree does
        wait_for(b"nodes")
        process.send_signal(signal.SIGINT)
        out, _ = process.communicate(timeout=120)
    assert process.returncode == 130
    assert out.startswith("RootSet at alpha = 5: ")
    last = out.splitlines()[-1]
    assert last.startswith("complete: no (interrupted after ")
    content = json.loads(result.read_text())
    assert content["complete"] is False
    if "--jobs" not in options:
        assert ": 0 roots" not in out.splitlines()[0]
        assert len(content["roots"]) > 20
        assert "slip-" in out


@pytest.mark.slow
def test_short_searches_show_no_progress():
    with on_terminal(*EXAMPLE, 5) as (process, wait_for):
        out, _ = process.communicate(timeout=60)
        assert process.returncode == 0
        assert "3 roots" in out
        with pytest.raises((AssertionError, OSError)):
            wait_for(b"searching", seconds=0.5)


@pytest.fixture
def proof(capsys, tmp_path):
    printed(capsys, *EXAMPLE, 5, "--proof", tmp_path / "roots.proof")
    return tmp_path / "roots.proof"


def test_verify_accepts_a_proof_and_refuses_it_for_another_problem(capsys, proof):
    out = printed(capsys, "verify", "gallery:one-node-6.1", proof)
    assert "3 isolated roots" in out
    assert "complete: yes" in out
    status, out, _ = run(capsys, "verify", "gallery:one-node-6.2", proof)
    assert (status, "another problem" in out) == (2, True)


def test_verify_says_what_stayed_undecided(capsys, tmp_path):
    proof = tmp_path / "roots.proof"
    printed(capsys, "roots", "gallery:chain-4", "--alpha", 5, "--proof", proof, "--max-nodes", 30, status=3)
    assert "complete: no" in printed(capsys, "verify", "gallery:chain-4", proof, status=3)


def test_verify_refuses_a_damaged_proof(capsys, tmp_path, proof):
    content = bytearray(proof.read_bytes())
    content[len(content) // 2] ^= 1
    proof.write_bytes(content)
    assert_refused(*run(capsys, "verify", "gallery:one-node-6.1", proof), "checksum")
    assert_refused(*run(capsys, "verify", "gallery:one-node-6.1", tmp_path / "missing.proof"), "cannot be read")


# -- bare commands -----------------------------------------------------------------------------------------------------


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("group", [(), ("gallery",)])
def test_it_is_the_help_on_stdout(group):
    bare, asked = call(*group), call(*group, "--help")
    assert (bare.returncode, bare.stderr) == (0, "")
    assert bare.stdout.rstrip() == asked.stdout.rstrip()
    assert "Usage: enumsol" in bare.stdout


# -- names that are misspelt -------------------------------------------------------------------------------------------


def refusal(capsys, name, *parts):
    status, out, err = run(capsys, "roots", name, "--alpha", 1)
    assert_refused(status, out, err, *parts)
    return err


@pytest.mark.parametrize("name", ["wedge-14-5", "Wedge-14-5", "galery:wedge-14-5", "gallery/:wedge-14-5"])
def test_a_gallery_name_without_its_prefix(capsys, name):
    err = refusal(capsys, name, f"{name}: there is no such file or directory; did you mean gallery:wedge-14-5?")
    assert "wedge-14-3" not in err


@pytest.mark.parametrize(("name", "close"), [("wegde-14-5", "wedge-14-5"), ("gallry:two-node-64", "two-node-6.4")])
def test_a_misspelt_one_without_its_prefix(capsys, name, close):
    refusal(capsys, name, f"did you mean gallery:{close}")


def test_a_misspelt_one_with_its_prefix(capsys):
    refusal(capsys, "gallery:wedge-14-6", "no problem named 'wedge-14-6'; did you mean wedge-14-5")
    refusal(capsys, "gallery:WEDGE-14-5", "did you mean wedge-14-5?")


def test_a_misspelt_file_name(capsys, tmp_path):
    write_problem(gallery.one_node_triangle(), tmp_path / "bracket.npz")
    write_problem(gallery.one_node_triangle(), tmp_path / "bracket")
    (tmp_path / "brackte.txt").touch()
    err = refusal(capsys, tmp_path / "brackte.npz", f"did you mean {tmp_path / 'bracket.npz'}")
    assert "brackte.txt" not in err
    refusal(capsys, tmp_path / "brakcet", f"did you mean {tmp_path / 'bracket'}")


@pytest.mark.parametrize("name", ["nowhere.npz", "no/such/directory.npz", "zzzz"])
def test_a_name_close_to_nothing_says_what_is_expected(capsys, name):
    err = refusal(capsys, name, "expected a .npz file, a directory of MatrixMarket files")
    assert "did you mean" not in err


def test_every_verb_that_takes_a_problem(capsys):
    for arguments in (
        ("table", "wedge-14-5", "--alphas", "1"),
        ("graph", "wedge-14-5", "--from", 0, "--to", 1),
        ("follow", "wedge-14-5", "--from", 0, "--to", 1, "--start", 0),
        ("verify", "wedge-14-5", "some.proof"),
    ):
        assert_refused(*run(capsys, *arguments), "did you mean gallery:wedge-14-5?")


def test_a_body_that_is_pulled_off_has_no_solution_and_that_is_all(capsys, tmp_path):
    """The indices of a body that nothing holds need not add up to +1."""
    block = block_on_table()
    write_problem(block.replace(f=-block.f), tmp_path / "lifted.npz")
    page = tmp_path / "page.html"
    assert "index sum: +0" in printed(capsys, "roots", tmp_path / "lifted.npz", "--alpha", 0, "--report", page)
    assert "something is missing" not in page.read_text(encoding="utf-8")
    printed(capsys, "table", tmp_path / "lifted.npz", "--alphas", "0,1")
