"""The page of a history: what it says of one that is not complete (a complete one is that of the command)."""

from pages import Reader

from enumsol import gallery, histories, write_report
from enumsol.report import history_page


def test_an_incomplete_history_says_so(tmp_path, monkeypatch):
    """Of three roots of the second step one is followed."""
    monkeypatch.setattr(history_page, "_image", lambda _, words: f"<p>Picture of {words}.</p>")
    problem = gallery.one_node_triangle()
    history = histories(problem, [5, 4], follow="nearest")
    write_report(history, tmp_path / "page.html", units=("N", "mm"))
    page = Reader((tmp_path / "page.html").read_text())
    assert not history.complete
    assert "This history is not complete." in page.text
    assert "these are all histories" not in page.text
    for said in (history.completeness(), *history.reasons, problem.fingerprint, "enumsol verify PROBLEM FILE"):
        assert said in page.text
    for drawn in ("alpha against displacement", "lambda_n against step", "deformed bodies of step 2"):
        assert f"Picture of {drawn}." in page.text
