"""``enumsol fixed-point``: what is printed and written, exit statuses, and options that do not go together."""

import json

import command_line
import numpy as np
import pandas as pd
import pytest
from command_line import assert_refused
from helpers.floating_oracle import block_on_table
from interruptions import CtrlC

import enumsol
from enumsol.fixed_points import FixedPoint, successive


def run(capsys, *arguments):
    return command_line.run(capsys, "fixed-point", *arguments)


def printed(capsys, *arguments, **options):
    return command_line.printed(capsys, "fixed-point", *arguments, **options)


def test_a_limit_is_printed(capsys):
    out = printed(capsys, "gallery:one-node-6.1", "--alpha", 5, "--start", 10)
    assert out.startswith("FixedPoint at alpha = 5: converged after 2 iterations")
    assert "stick" in out


def test_3d_with_every_output(capsys, tmp_path):
    files = {name: tmp_path / f"limit.{name}" for name in ("json", "csv", "npz", "vtu")}
    options = [part for name, file in files.items() for part in (f"--{name}", file)]
    assert "converged" in printed(capsys, "gallery:block3d-4", "--alpha", "1/2", *options)
    content = json.loads(files["json"].read_text())
    assert (content["converged"], content["alpha_text"]) == (True, "1/2")
    np.testing.assert_allclose(pd.read_csv(files["csv"])["lambda_n"], content["lambda_n"])
    again = FixedPoint.load(files["npz"], enumsol.gallery.get("block3d-4").build())
    np.testing.assert_allclose(again.lambda_t, content["lambda_t"])
    assert files["vtu"].stat().st_size > 500


def test_a_problem_in_a_file(capsys, tmp_path):
    enumsol.write_problem(enumsol.gallery.one_node_3d(), tmp_path / "node.npz")
    assert "slip" in printed(capsys, tmp_path / "node.npz", "--alpha", 0)


def test_alpha_is_asked_for_where_something_depends_on_it(capsys):
    assert printed(capsys, "gallery:one-node-3d").startswith("FixedPoint at alpha = 0")
    missing = "--alpha is missing, and friction or load of gallery:block3d-4 depends on it"
    assert_refused(*run(capsys, "gallery:block3d-4"), missing)


def test_not_converged_is_status_3(capsys):
    out = printed(capsys, "gallery:one-node-3d", "--alpha", 0, "--max-iterations", 2, status=3)
    assert "not converged within 2 iterations" in out


def test_ctrl_c_prints_the_last_iterate(capsys, monkeypatch):
    monkeypatch.setattr(successive, "solve_scaled", CtrlC(call=3, then=successive.solve_scaled))
    assert "interrupted after 2 iterations" in printed(capsys, "gallery:one-node-3d", "--alpha", 0, status=130)


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("gallery:block3d-4 --alpha x", "--alpha is 'x'"),
        ("gallery:block3d-5 --alpha 1", "did you mean"),
        ("gallery:block3d-4 --alpha -1", "friction F1 at alpha = -1 is -1"),
        ("gallery:block3d-4 --alpha 1 --start -1", "start is -1"),
        ("gallery:one-node-6.1 --alpha 1 --npz -", "--npz is -, but it is a binary file"),
        ("gallery:one-node-6.1 --alpha 1 --vtu -", "--vtu is -, but it is a binary file"),
        ("gallery:one-node-6.1 --alpha 1 --npz /nowhere/x.npz", "--npz is /nowhere/x.npz"),
        ("gallery:block3d-4 --alpha 1 --vtu x.txt", "--vtu is 'x.txt'; expected a name that ends in .vtu"),
    ],
)
def test_bad_input_is_one_sentence(capsys, command, message):
    assert_refused(*run(capsys, *command.split()), message)


def test_a_body_that_nothing_holds(capsys, tmp_path):
    enumsol.write_problem(block_on_table(push=0.5), tmp_path / "rests.npz")
    enumsol.write_problem(block_on_table(push=1.1), tmp_path / "slides.npz")
    found = json.loads(printed(capsys, tmp_path / "rests.npz", "--json", "-"))
    assert np.allclose(found["rigid_coordinates"], 0)
    assert found["free_motion"] is None
    out = printed(capsys, tmp_path / "slides.npz", status=3)
    assert "the load drives it with 0.825" in " ".join(out.split())
