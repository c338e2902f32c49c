"""What notebooks show: tables that are short and in which every text is escaped."""

from html.parser import HTMLParser

import pytest

import enumsol
from enumsol import branch_graph, enumerate_roots, gallery
from enumsol.support.messages import html_lines, html_table


class Cells(HTMLParser):
    """Elements and texts of a piece of HTML; complains about what is not closed."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.cells = [], [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)
        self.tags.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.cells.append(data)


def test_texts_are_escaped():
    cells = Cells(html_lines(["a < b & c"]) + html_table(["<i>"], [["<script>x</script>", 3]]))
    assert cells.cells == ["a < b & c", "<i>", "<script>x</script>", "3"]
    assert "script" not in cells.tags


def test_roots_and_root_sets():
    square = gallery.two_node_square()
    labels = ["<script>x</script>", "b"]
    problem = enumsol.ContactProblem(square.A, square.Bn, square.Bt, square.f, node_ids=labels)
    roots = enumerate_roots(problem, 3.5)
    cells = Cells(roots._repr_html_())
    assert cells.tags.count("tr") == 6
    assert cells.cells[0] == repr(roots).splitlines()[0]
    assert cells.cells[-2:] == ["index sum: +1", "complete: yes (proven)"]
    one = Cells(roots[1]._repr_html_())
    assert set(labels) <= set(one.cells)
    assert "script" not in one.tags
    assert one.tags.count("tr") == 3
    for text in repr(roots[1]).split()[-5:]:
        assert text in one.cells


def test_a_family():
    family = enumerate_roots(gallery.get("one-node-6.3").build(), 2).families[0]
    cells = Cells(family._repr_html_())
    assert cells.cells[0] == "RootFamily at alpha = 2: index +1, dimension 1"
    assert cells.cells[-5:] == ["0", "1", "2", "1", "slip-"]


def test_many_nodes_and_many_roots_are_cut():
    roots = enumerate_roots(gallery.chain(4), 5.0)
    cells = Cells(roots._repr_html_())
    assert cells.tags.count("tr") == 21
    assert any("61 more" in text for text in cells.cells)
    block = enumerate_roots(gallery.clamped_block(24, 2), 3.0)[0]
    assert Cells(block._repr_html_()).tags.count("tr") == 21
    assert "... 4 more nodes" in block._repr_html_()
    space = enumerate_roots(gallery.get("one-node-3d-3").build(), 0)
    assert "lambda_t2" in Cells(space[1]._repr_html_()).cells


@pytest.mark.parametrize("nodes", [None, 3])
def test_graphs_and_proofs(nodes):
    problem = gallery.two_node_square()
    graph = branch_graph(problem, (0, 10), max_nodes=nodes)
    cells = Cells(graph._repr_html_())
    assert cells.cells[-1] == graph.completeness()
    assert cells.tags.count("tr") == (1 + len(graph.branches) if graph.branches else 0)
    if nodes is None:
        assert Cells(graph.proof._repr_html_()).cells == [repr(graph.proof)]
        report = enumsol.verify(problem, graph.proof)
        assert Cells(report._repr_html_()).cells == repr(report).splitlines()
    roots = enumerate_roots(problem, 3.5, max_nodes=nodes)
    report = enumsol.verify(problem, roots.proof)
    assert Cells(report._repr_html_()).cells == repr(report).splitlines()
