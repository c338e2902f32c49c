"""What the check says of answers that are right, inaccurate, repeated, missing or wrong, in every format."""

import json
import re

import numpy as np
import pytest
from command_line import assert_refused, printed, run
from refusals import bad_argument

import enumsol
from enumsol import collection
from enumsol.auditing.results import hull_distance

WEDGE, NODE, SEGMENT = (collection.get(name) for name in ("wedge-8-5", "node-3d-3", "triangle-continuum"))
ROOTS = WEDGE.certified().roots


def written(folder, name="wedge-8-5.npz", roots=ROOTS, **arrays):
    """A folder with a file of forces (k, p, d), or of the arrays."""
    t = roots[:, :, 1] if roots.shape[2] == 2 else roots[:, :, 1:]
    np.savez(folder / name, **(arrays or {"lambda_n": roots[:, :, 0], "lambda_t": t}))
    return folder


def checked(folder, **options):
    (report,) = collection.check(folder, **options).problems
    return report


def test_all_solutions_in_any_order_are_all_found(tmp_path):
    report = checked(written(tmp_path, roots=ROOTS[[3, 0, 4, 1, 2]]))
    assert report.ok
    assert report.found_roots == (0, 1, 2, 3, 4)
    assert [answer.nearest for answer in report.answers] == [("root", k) for k in (3, 0, 4, 1, 2)]
    assert (report.missed_roots, report.spurious, report.repeated) == ((), (), 0)


def test_inaccurate_answers_are_found_up_to_the_tolerance(tmp_path):
    size = np.max(np.abs(ROOTS))
    off = ROOTS.copy()
    off[:, 2, 1] += size * np.array([0.0, 0.9e-4, -0.9e-4, 1.1e-4, -1.1e-4])
    report = checked(written(tmp_path, roots=off))
    assert report.found_roots == (0, 1, 2)
    assert [answer.row for answer in report.spurious] == [3, 4]
    distances = [answer.distance for answer in report.answers]
    assert distances == pytest.approx([0, 0.9e-4, 0.9e-4, 1.1e-4, 1.1e-4], abs=1e-9)
    assert checked(tmp_path, tolerance=1.2e-4).ok
    assert checked(tmp_path, tolerance=1e-6).found_roots == (0,)


def test_missing_and_repeated_answers_are_counted(tmp_path):
    report = checked(written(tmp_path, roots=ROOTS[[1, 1, 4, 1]]))
    assert (report.found_roots, report.missed_roots, report.repeated, report.ok) == ((1, 4), (0, 2, 3), 2, False)
    assert report.spurious == ()
    nothing = checked(written(tmp_path, roots=ROOTS[:0]))
    assert (nothing.missed_roots, nothing.answers) == ((0, 1, 2, 3, 4), ())


def test_wrong_answers_are_none_and_it_is_said_why(tmp_path):
    wrong = ROOTS[[0, 0, 0, 4]].copy()
    wrong[0] = -ROOTS[3]  # pulls
    wrong[1] = np.nan
    wrong[2] = (ROOTS[3] + ROOTS[4]) / 2  # between two solutions
    wrong[3, :, 1] = 9 * wrong[3, :, 0]  # beyond the cone of friction
    report = checked(written(tmp_path, roots=wrong))
    assert (len(report.spurious), report.ok) == (4, False)
    reasons = [answer.reason for answer in report.answers]
    assert reasons[1] == "not all of its values are finite"
    assert report.answers[1].nearest is None
    assert all(reason.startswith("its largest residual is ") for k, reason in enumerate(reasons) if k != 1)
    assert report.missed_roots == (0, 1, 2, 3, 4)


def test_the_largest_residual_is_named(tmp_path):
    """One node that is pressed onto the floor, without a force: it goes through the floor."""
    np.savez(tmp_path / "triangle-1.npz", lambda_n=[0.0], lambda_t=[0.0])
    assert checked(tmp_path).answers[0].reason == "its largest residual is 6.5e-01 (penetration)"


def test_of_one_node_every_other_force_is_none(tmp_path):
    """The closed form: open, (1/3, -5/3) and (3/2, -4) are all solutions."""
    forces = [(0, 0), (1 / 3, -5 / 3), (1.5, -4), (1.5, -4.001), (0.2, -1.0), (1.0, 0.0)]
    normal, tangential = np.array(forces).T[:, :, None]
    np.savez(tmp_path / "triangle-3.npz", lambda_n=normal, lambda_t=tangential)
    answers = checked(tmp_path).answers
    assert [answer.found for answer in answers] == [True] * 3 + [False] * 3


# -- continua ----------------------------------------------------------------------------------------------------------


def test_any_point_of_a_continuum_finds_it_and_points_beside_it_are_none(tmp_path):
    """All (x, -2 x) with 0 <= x <= 1."""
    x = np.array([0.0, 0.3, 1.0, 1.01, 0.5])
    forces = np.stack([x, -2 * x + [0, 0, 0, 0, 1e-2]], axis=1)[:, None]
    report = checked(written(tmp_path, "triangle-continuum.npz", forces))
    assert [answer.found for answer in report.answers] == [True, True, True, False, False]
    assert (report.found_families, report.missed_families, report.repeated) == ((0,), (), 0)
    missed = checked(written(tmp_path, "triangle-continuum.npz", forces[3:]))
    assert (missed.found_families, missed.missed_families) == ((), (0,))


def test_a_square_of_solutions_and_three_segments(tmp_path):
    inside = np.array([[[0.2, -0.4], [0.9, -1.8]], [[0.2, -0.4], [0.9, -1.7]]])
    assert [a.found for a in checked(written(tmp_path, "two-continua.npz", inside)).answers] == [True, False]
    middle = np.array([[[0.5, -1.0], [0.0, 0.0]], [[0.5, -1.0], [1.5, -4.0]]])
    three = checked(written(tmp_path, "continuum-and-three.npz", middle) / "continuum-and-three.npz")
    assert (len(three.found_families), len(three.missed_families)) == (2, 1)


def test_distances_of_hulls_are_those_of_a_search():
    rng, (x, y) = np.random.default_rng(3), np.meshgrid(*[np.linspace(0, 1, 301)] * 2)
    for _ in range(10):
        a, b, c, d = rng.normal(size=(4, 3))
        first, second = (p + t[..., None] * (q - p) for p, q, t in ((a, b, x), (c, d, y)))
        step = (np.max(np.abs(b - a)) + np.max(np.abs(d - c))) / 300
        assert hull_distance(a[None], c[None]) == pytest.approx(np.max(np.abs(a - c)))
        to_segment = np.min(np.max(np.abs(a - second), axis=-1))
        assert to_segment - step <= hull_distance(a[None], np.array([c, d])) <= to_segment + 1e-9
        of_segments = np.min(np.max(np.abs(first - second), axis=-1))
        assert of_segments - step <= hull_distance(np.array([a, b]), np.array([c, d])) <= of_segments + 1e-9
    square = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    assert hull_distance(np.array([[0.5, 0.75, 0.25]]), square) == pytest.approx(0.25)


# -- formats -----------------------------------------------------------------------------------------------------------


def as_object(roots):
    return {"lambda_n": roots[..., 0].tolist(), "lambda_t": tangential(roots)}


def as_json(place, roots):
    place.with_suffix(".json").write_text(json.dumps(as_object(roots)))


def as_list(place, roots):
    place.with_suffix(".json").write_text(json.dumps([as_object(root) for root in roots]))


def as_csv(place, roots):
    names = ["lambda_t"] if roots.shape[2] == 2 else ["lambda_t1", "lambda_t2"]
    lines = [",".join(["node", "solution", "lambda_n", *names])]
    for node in reversed(range(roots.shape[1])):
        lines += [",".join(map(repr, [node, k, *map(float, root[node])])) for k, root in enumerate(roots)]
    place.with_suffix(".csv").write_text("\n".join(lines))


def as_reactions(place, roots):
    np.savez(place.with_suffix(".npz"), r=roots.reshape(len(roots), -1))


def as_displacements(place, roots):
    problem = collection.get(place.name).problem()
    A, B = problem.A.toarray(), problem.contact_rows.toarray()
    u = [np.linalg.solve(A, problem.f - B.T @ root.T.ravel()) for root in roots]
    np.savez(place.with_suffix(".npz"), u=u)


def as_solutions_of_fclib(place, roots):
    """What fclib_write_solution adds to a file that holds the problem: one solution each."""
    h5py = pytest.importorskip("h5py")
    for k, root in enumerate(roots):
        file = place.with_name(f"{place.name}.{k}.h5")
        enumsol.write_problem(collection.get(place.name).problem(), file)
        with h5py.File(file, "a") as content:
            content.create_group("solution")["r"] = root.ravel()


def tangential(roots):
    return (roots[..., 1] if roots.shape[-1] == 2 else roots[..., 1:]).tolist()


FORMATS = (as_json, as_list, as_csv, as_reactions, as_displacements, as_solutions_of_fclib)


@pytest.mark.parametrize("write", FORMATS, ids=lambda write: write.__name__)
@pytest.mark.parametrize("entry", [WEDGE, NODE], ids=lambda entry: entry.name)
def test_every_format_says_the_same(tmp_path, write, entry):
    roots = entry.certified().roots
    wrong = np.concatenate([roots[1:], 1.01 * roots[-2:-1]])
    write(tmp_path / entry.name, wrong)
    report = checked(tmp_path)
    assert (report.missed_roots, report.found_roots) == ((0,), tuple(range(1, entry.roots)))
    (answer,) = report.spurious
    assert 1e-3 < answer.distance < 1


def test_one_solution_needs_no_further_dimension(tmp_path):
    written(tmp_path, lambda_n=ROOTS[2, :, 0], lambda_t=ROOTS[2, :, 1])
    assert checked(tmp_path).found_roots == (2,)


def test_displacements_are_measured_by_those_of_the_solution_itself(tmp_path):
    """On soft springs the free body moves 100 times as far as the jammed one."""
    entry = collection.get("wedge-8-soft")
    as_displacements(tmp_path / entry.name, entry.certified().roots)
    u = np.load(tmp_path / "wedge-8-soft.npz")["u"]
    assert np.max(np.abs(u[0])) > 100 * np.max(np.abs(u[4]))
    u[0] *= 1 + 2e-4
    u[4] *= 1 + 2e-4
    np.savez(tmp_path / "wedge-8-soft.npz", u=u)
    assert [answer.found for answer in checked(tmp_path).answers] == [False, True, True, True, False]


@pytest.mark.parametrize("entry", [WEDGE, NODE, SEGMENT], ids=lambda entry: entry.name)
def test_what_this_package_writes_is_read(tmp_path, capsys, entry):
    command = ("roots", f"collection:{entry.name}", "--alpha", 0, "--quiet")
    assert run(capsys, *command, "--json", tmp_path / f"{entry.name}.json")[0] == 0
    assert checked(tmp_path).ok
    if entry.roots:
        assert run(capsys, *command, "--csv", tmp_path / f"{entry.name}.csv")[0] == 0
        assert checked(tmp_path / f"{entry.name}.csv").ok
    assert run(capsys, "fixed-point", *command[1:], "--json", tmp_path / f"{entry.name}.json")[0] == 0
    assert checked(tmp_path / f"{entry.name}.json").spurious == ()


def test_several_files_of_a_problem_are_taken_together(tmp_path):
    written(tmp_path, "wedge-8-5.newton.npz", ROOTS[:2])
    written(tmp_path, "wedge-8-5.other.npz", ROOTS[1:4])
    report = checked(tmp_path)
    assert (report.found_roots, report.missed_roots, report.repeated) == ((0, 1, 2, 3), (4,), 1)


def test_files_of_problems_are_no_answers(tmp_path):
    pytest.importorskip("h5py")
    collection.export(tmp_path, ["wedge-8-5", "node-3d-3"])
    written(tmp_path / "problems", "node-3d-3.mine.npz", NODE.certified().roots)
    report = collection.check(tmp_path / "problems")
    assert [problem.entry.name for problem in report.problems] == ["node-3d-3"]
    assert report.ok
    assert len(report.not_tried) == len(collection.COLLECTION) - 1
    bad_argument("there are none in it", collection.check, tmp_path / "problems" / "wedge-8-5.h5")


# -- the command, and refusals -----------------------------------------------------------------------------------------


def test_the_command_reports_and_ends_with_a_status(tmp_path, capsys):
    assert run(capsys, "collection", "check", written(tmp_path))[0] == 0
    written(tmp_path, roots=np.concatenate([ROOTS[:1], 2 * ROOTS[1:2]]))
    status, out, err = run(capsys, "collection", "check", tmp_path, "--csv", tmp_path / "table.txt")
    assert (status, err) == (3, "")
    assert "wedge-8-5: missed root 3 (" in out
    assert "wedge-8-5: answer 1 of wedge-8-5.npz is not a solution: the nearest is root " in out
    assert out.splitlines()[1].split() == ["wedge-8-5", "5", "2", "1", "4", "1", "0"]
    assert len((tmp_path / "table.txt").read_text().splitlines()) == 3
    status, out, _ = run(capsys, "collection", "check", tmp_path, "--json", "-")
    found = json.loads(out)
    assert (status, found["ok"], found["problems"][0]["missed_roots"]) == (3, False, [1, 2, 3, 4])
    assert [answer["found"] for answer in found["problems"][0]["answers"]] == [True, False]


@pytest.mark.slow
def test_the_list_and_the_export(tmp_path, capsys):
    out = printed(capsys, "collection", "list")
    assert [line.split()[0] for line in out.splitlines()] == list(collection.COLLECTION)
    _, out, _ = run(capsys, "collection", "list", "--json", "-")
    assert [entry["roots"] for entry in json.loads(out)] == [e.roots for e in collection.COLLECTION.values()]
    place = tmp_path / "all of it"
    out = printed(capsys, "collection", "export", place)
    assert out.startswith(f"wrote {len(collection.COLLECTION)} problems to ")
    assert len(list(place.rglob("*.*"))) == 4 * len(collection.COLLECTION) + 1
    assert len(json.loads((place / "index.json").read_text())) == len(collection.COLLECTION)
    proof = place / "certified" / "node-3d-3.proof"
    assert run(capsys, "verify", place / "problems" / "node-3d-3.npz", proof)[0] == 0
    assert run(capsys, "verify", "collection:node-3d-3", proof)[0] == 0
    assert run(capsys, "verify", "collection:node-3d-1", proof)[0] == 2


def test_one_problem_is_listed_and_written(tmp_path, capsys):
    found = json.loads(printed(capsys, "collection", "list", "--json", "-"))
    assert [entry["roots"] for entry in found] == [entry.roots for entry in collection.COLLECTION.values()]
    lines = printed(capsys, "collection", "list").splitlines()
    assert [line.split()[0] for line in lines] == list(collection.COLLECTION)
    out = printed(capsys, "collection", "export", tmp_path, "collection:node-3d-3", "--json", tmp_path / "said.json")
    assert out.startswith(f"wrote 1 problem to {tmp_path}/problems, ")
    assert json.loads((tmp_path / "said.json").read_text()) == {"folder": str(tmp_path), "names": ["node-3d-3"]}
    assert {path.name for path in tmp_path.rglob("node-3d-3.*")} == {
        f"node-3d-3.{x}" for x in ("npz", "h5", "json", "proof")
    }


@pytest.mark.parametrize("width", [60, 200])
def test_at_a_terminal_the_list_is_a_table_that_is_no_wider(capsys, monkeypatch, width):
    monkeypatch.setenv("COLUMNS", str(width))
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    lines = [re.sub(r"\x1b\[[0-9;]*m", "", line) for line in printed(capsys, "collection", "list").splitlines()]
    assert max(map(len, lines)) <= width
    names = [line.split()[0] for line in lines if line and not line.startswith(" ")]
    assert names[: len(collection.COLLECTION) + 1] == ["NAME", *collection.COLLECTION]
    words = "".join(" ".join(lines).split())
    assert words.endswith("Writethemalltoafolder:enumsolcollectionexportFOLDER")


TWO_AND_THREE = {"lambda_n": np.zeros((2, 8)), "lambda_t": np.zeros((3, 8))}


@pytest.mark.parametrize(
    ("name", "arrays", "message"),
    [
        ("wedge-9-5", {"r": np.zeros(16)}, "the collection has no problem named 'wedge-9-5'; did you mean wedge-8-5"),
        ("wedge-8-5", {"r": np.zeros(15)}, r"r has shape \(15,\); expected \(k, 16\) for k .* p = 8 contact"),
        ("wedge-8-5", {"u": np.zeros((2, 49))}, r"u has shape \(2, 49\); expected \(k, 50\)"),
        ("wedge-8-5", {"lambda_n": np.zeros(8)}, r"it holds lambda_n; expected lambda_n and lambda_t, or r, or u"),
        ("wedge-8-5", TWO_AND_THREE, "lambda_n holds 2 solutions and lambda_t 3; expected the same number"),
        ("node-3d-3", {"lambda_n": [[0]], "lambda_t": [[0]]}, r"lambda_t has shape \(1, 1\); expected \(k, 1, 2\)"),
        ("wedge-8-5", {"r": np.array(["a"] * 16)}, r"r is not an array of real numbers \(found text\)"),
    ],
)
def test_what_does_not_fit_is_refused_in_a_sentence(tmp_path, name, arrays, message):
    said = str(bad_argument(message, collection.check, written(tmp_path, f"{name}.npz", **arrays)))
    assert said.startswith(str(tmp_path / f"{name}.npz"))


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("wedge-8-5.csv", "node,lambda_n,lambda_t\n0,1,1\n0,1,1\n", r"has the nodes \[0, 0\]; expected the rows of Bn"),
        ("wedge-8-5.csv", "lambda_n,lambda_t\n1,1\n", r"the column node is missing \(found lambda_n, lambda_t\)"),
        ("wedge-8-5.csv", "node,lambda_n,lambda_t\n0,1,1\n", r"lambda_n has shape \(1, 1\); expected \(k, 8\)"),
        ("wedge-8-5.json", "[1, 2]", r"it holds no object and no list of objects"),
        ("wedge-8-5.json", "{", r"does not hold solutions"),
        ("wedge-8-5.npz", "text", r"does not hold solutions"),
        ("wedge-8-5.h5", "text", r"cannot be read|does not hold solutions"),
        ("readme.txt", "text", r"there are none in it; expected files NAME\.npz, NAME\.json"),
    ],
)
def test_damaged_files_are_refused_in_a_sentence(tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    bad_argument(message, collection.check, tmp_path)


def test_places_names_and_tolerances_are_refused_in_a_sentence(tmp_path, capsys):
    assert_refused(*run(capsys, "collection", "check", tmp_path / "none"), "there is no such file")
    assert_refused(*run(capsys, "collection", "export", tmp_path, "wedge"), "no problem named 'wedge'; did you mean")
    assert_refused(*run(capsys, "roots", "collection:wedge-9-5", "--alpha", 0), "did you mean wedge-8-5")
    (tmp_path / "file").touch()
    assert_refused(*run(capsys, "collection", "export", tmp_path / "file"), "cannot be written")
    written(tmp_path)
    assert_refused(*run(capsys, "collection", "check", tmp_path, "--tolerance", 0.5), "tolerance is 0.5, but root ")
    assert_refused(*run(capsys, "collection", "check", tmp_path, "--tolerance", 0), "tolerance is 0")
    bad_argument("names is 'wedge-8-5'; expected a list of names", collection.export, tmp_path, "wedge-8-5")
    bad_argument("name is 3; expected a name of the collection", collection.get, 3)
