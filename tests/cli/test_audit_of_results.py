"""``enumsol audit PROBLEM RESULT``: which of the roots a result file of another solver is."""

import json

import pytest

import enumsol
from tests.helpers.command_line import printed, run


def test_each_root_is_recognised_in_its_own_file(tmp_path, capsys):
    entry = enumsol.gallery.get("wedge-8-3")
    problem = entry.build()
    roots = enumsol.enumerate_roots(problem, entry.alpha)
    for k, root in enumerate(roots):
        enumsol.write_frd(problem, root, tmp_path / "one.frd")
        out = printed(capsys, "audit", "gallery:wedge-8-3", tmp_path / "one.frd", "--alpha", entry.alpha)
        assert f"one.frd at time 1: the result is root {k}: it differs by" in out
        assert "3 solutions, all that there are (proven)" in out


def test_a_result_that_is_none_has_status_3(tmp_path, capsys):
    entry = enumsol.gallery.get("wedge-8-3")
    problem = entry.build()
    root = enumsol.enumerate_roots(problem, entry.alpha)[0]

    class Twice:
        u, lambda_n, lambda_t, u_n, u_t = 2 * root.u, root.lambda_n, root.lambda_t, root.u_n, root.u_t

    enumsol.write_frd(problem, Twice(), tmp_path / "two.frd")
    arguments = ("audit", "gallery:wedge-8-3", tmp_path / "two.frd", "--alpha", entry.alpha, "--json", "-")
    status, out, _ = run(capsys, *arguments)
    assert status == 3
    assert json.loads(out)["found"] is None


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--csv", "-"], "is a result; expected no --csv"),
        (["--from", "0"], "is a result; expected no --csv, --graph, --from or --to with it"),
    ],
)
def test_options_of_points_are_refused(tmp_path, capsys, more, message):
    (tmp_path / "x.frd").write_text("")
    status, _, error = run(capsys, "audit", "gallery:wedge-8-3", tmp_path / "x.frd", *more)
    assert status == 2
    assert message in error
