"""An unknown name close to a gallery name says which."""

import pytest
from command_line import assert_refused, run

from enumsol import gallery, write_problem


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
