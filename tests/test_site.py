"""The site of the documents: README's command builds it without a warning, and its pages need no network."""

import ast
import json
import os
import subprocess
import sys
from importlib.util import find_spec

import pytest
from check_site import complaints, public_names
from documents import ROOT
from references import places

BUILD = 'pip install -e ".[docs]" && python -m sphinx -W docs site/html'
NOTEBOOK = ROOT / "docs" / "notebook.ipynb"
missing = [name for name in ("sphinx", "myst_nb", "furo", "math_core") if find_spec(name) is None]


@pytest.mark.slow
@pytest.mark.skipif(bool(missing), reason=f"not installed: {', '.join(missing)} (the extra docs)")
def test_the_site_is_built(tmp_path):
    """The notebook is run for it, too."""
    assert f"    {BUILD}" in (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    site = tmp_path / "site"
    command = [sys.executable, *BUILD.rpartition("python ")[2].split()[:-1], str(site), "-d", str(tmp_path / "trees")]
    paths = {"PYTHONPATH": str(ROOT), "JUPYTER_RUNTIME_DIR": str(tmp_path), "IPYTHONDIR": str(tmp_path)}
    done = subprocess.run(command, cwd=ROOT, env={**os.environ, **paths}, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert complaints(site) == []
    theory, roots = (site / name for name in ("theory.html", "reference/roots.html"))
    assert theory.read_text(encoding="utf-8").count('id="equation-1.1"') == 1
    assert 'id="equation-6.7"' in theory.read_text(encoding="utf-8")
    assert '<a class="eqno" href="#equation-1.1">(1.1)</a>' in theory.read_text(encoding="utf-8")
    assert 'href="../theory.html#section-5.4"' in roots.read_text(encoding="utf-8")
    notebook = (site / "notebook.html").read_text(encoding="utf-8")
    assert "complete: yes (proven)" in notebook
    assert notebook.count('class="output') >= 8


def test_the_reference_has_every_public_name():
    pages = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "docs" / "reference").glob("*.md"))
    shown = {line.split(":: ")[1] for line in pages.splitlines() if line.startswith(".. auto")}
    assert [name for name in public_names() if name not in shown] == []


def test_the_notebook_is_kept_without_outputs():
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert len(code) >= 8
    assert [cell for cell in code if cell["outputs"] or cell["execution_count"] is not None] == []


@pytest.mark.slow
def test_the_notebook_shows_what_it_says():
    """Its cells as a notebook runs them, without one: the last expression of a cell is shown."""
    names, shown = {}, []
    for cell in json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            *lines, last = ast.parse("".join(cell["source"])).body
            assert isinstance(last, ast.Expr)
            exec(compile(ast.Module(lines, []), "notebook", "exec"), names)
            shown.append(eval(compile(ast.Expression(last.value), "notebook", "eval"), names))
    assert [type(item).__name__ for item in shown] == [
        *("ContactProblem", "RootSet", "Root", "NotebookFigure", "DataFrame", "BranchGraph", "NotebookFigure"),
        *("DataFrame", "AuditReport", "GraphVerificationReport"),
    ]
    assert "complete: yes (proven)" in shown[1]._repr_html_()
    assert shown[3]._repr_png_().startswith(b"\x89PNG")
    assert (shown[8].ok, shown[8].complete, shown[9].complete) == (True, False, True)


def test_what_a_page_loads_is_found(tmp_path):
    (tmp_path / "index.html").write_text(
        '<script src="https://cdn.example/x.js"></script><a href="https://example.org">a link</a><img src="a.png">'
    )
    (tmp_path / "site.css").write_text("@import 'https://fonts.example/f.css'; a { background: url(a.png) }")
    found = [line for line in complaints(tmp_path) if "loads" in line]
    assert found == ["index.html loads https://cdn.example/x.js", "site.css loads https://fonts.example/f.css"]
    assert f"{public_names()[0]} is not in the reference" in complaints(tmp_path)


def test_what_styles_in_a_page_load_is_found(tmp_path):
    (tmp_path / "index.html").write_text(
        "<style>@import 'https://fonts.example/f.css';</style><p style='background: url(//example.org/a.png)'>a</p>"
    )
    found = [line for line in complaints(tmp_path) if "loads" in line]
    assert found == ["index.html loads https://fonts.example/f.css", "index.html loads //example.org/a.png"]


def test_a_link_to_a_formula_that_is_not_there_is_found(tmp_path):
    (tmp_path / "theory.html").write_text("<div id='equation-5.1'></div><a href='#equation-5.2'>(5.2)</a>")
    (tmp_path / "reference").mkdir()
    (tmp_path / "reference" / "roots.html").write_text(
        "<a href='../theory.html#equation-5.1'>(5.1)</a><a href='../theory.html#equation-5.3'>(5.3)</a>"
        "<a href='https://example.org#a'>a</a><a href='roots.html'>here</a><a href='#'>top</a>"
    )
    assert [line for line in complaints(tmp_path) if "has a link" in line] == [
        "reference/roots.html has a link to ../theory.html#equation-5.3, which is not there",
        "theory.html has a link to #equation-5.2, which is not there",
    ]


@pytest.mark.parametrize(
    "left", ["$x$ is", "with \\lambda_n in it", "\\(x\\)", "<div class='math'>\\[x\\]</div>", "&#36;x&#36;"]
)
def test_a_formula_that_is_not_rendered_is_found(left, tmp_path):
    (tmp_path / "index.html").write_text(f"<code>$HOME</code><pre>\\n</pre><p>{left}</p>")
    found = [line for line in complaints(tmp_path) if "formula" in line]
    assert len(found) == 1
    assert found[0].startswith("index.html has a formula that is not rendered: ")


@pytest.mark.parametrize(
    ("text", "page", "linked"),
    [
        ("see (theory, section\n5.4)", "results", {"5.4": "theory#section-5.4"}),
        ("theory, (6.1) and (6.3)", "results", {"(6.1)": "theory#equation-6.1", "(6.3)": "theory#equation-6.3"}),
        ("section 2 here", "proof_format", {"2": "proof_format#section-2"}),
        ("section 2 here", "results", {}),
    ],
)
def test_references_become_links(text, page, linked):
    assert {text[start:end]: f"{target}#{anchor}" for start, end, target, anchor in places(text, page)} == linked
