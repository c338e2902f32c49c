"""The layers of the package: no import runs up, none runs sideways, and no modules import each other in a circle.

Every import counts, those for types only and those inside functions too. docs/architecture.md draws the same table;
``python tools/draw_rooms.py`` prints what the code has.
"""

import re
from pathlib import Path

import pytest
from import_graph import broken_layers, circles, read_imports, room_of

import enumsol

#: Rooms from the ground up ("." is the package's own ``__init__``). A room imports rooms of lower layers only.
LAYERS = (
    ("errors", "_version", "arithmetic"),
    ("support",),
    ("decks",),
    ("condensation",),
    ("model",),
    ("trusted",),
    ("selections",),
    ("relaxation", "proof"),
    ("search", "checker"),
    ("roots",),
    ("continuation", "fixed_points"),
    ("branches",),
    ("auditing", "loading"),
    ("fem",),
    ("io",),
    ("gallery", "report", "collection"),
    (".",),
    ("cli",),
    ("__main__",),
)
#: Rooms that share no more than what both must trust: who finds roots and who checks the proofs of it.
STRANGERS = {
    "checker": {"selections", "relaxation"},
    "roots": {"checker"},
    "branches": {"checker"},
    "continuation": {"checker"},
    "auditing": {"checker", "fixed_points"},
    "loading": {"checker", "fixed_points", "continuation"},
    "fixed_points": {"checker", "search", "relaxation", "roots"},
    "fem": {"checker", "search", "roots", "branches", "continuation"},
    "io": {"checker", "search", "roots", "branches", "continuation"},
    "report": {"checker", "search", "continuation"},
    "gallery": {"checker", "search", "roots", "branches", "continuation"},
    "collection": {"checker", "search", "branches", "continuation", "fem"},
}


@pytest.fixture(scope="module")
def package():
    return read_imports(Path(enumsol.__file__).parent, "enumsol")


def test_every_room_has_its_layer(package):
    lines, _ = package
    rooms = [room for layer in LAYERS for room in layer]
    assert len(rooms) == len(set(rooms))
    assert set(rooms) == {room_of(module) for module in lines}


def test_no_import_breaks_the_layers(package):
    _, imports = package
    assert broken_layers(imports, LAYERS, STRANGERS) == []


def test_no_modules_import_each_other_in_a_circle(package):
    _, imports = package
    assert circles((item.importer, item.imported) for item in imports) == []


def test_the_reading_sees_imports_that_are_known(package):
    lines, imports = package
    seen = {(item.importer, item.imported) for item in imports}
    assert ("enumsol.branches.graph", "enumsol.branches.graph_files") in seen  # inside a function
    assert ("enumsol.errors", "enumsol.roots.root_set") not in seen
    assert ("enumsol.proof.proof_file", "enumsol.errors") in seen
    assert ("enumsol.condensation.condensed", "enumsol.condensation.data") in seen  # for types only
    assert ("enumsol.relaxation._active_set", "enumsol.relaxation.engine") in seen  # in Cython
    assert len(lines) > 100


# -- what the contract would find ----------------------------------------------------------------------------------

GROUND = {"low/__init__.py": "", "low/data.py": "", "high/__init__.py": "", "high/use.py": "", "beside.py": ""}
TABLE = (("low",), ("high", "beside"))


def written(tmp_path, **files):
    for name, text in (GROUND | {name.replace("__", "/") + ".py": text for name, text in files.items()}).items():
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    return read_imports(tmp_path, "house")[1]


@pytest.mark.parametrize(
    "text",
    [
        "import house.high.use",
        "from house.high import use",
        "from house.high.use import anything",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from house.high.use import Name",
        "def lazily():\n    from house.high import use\n    return use",
        "class Holder:\n    def method(self):\n        import house.high.use as use\n        return use",
    ],
)
def test_an_import_upward_is_found_wherever_it_hides(tmp_path, text):
    (sentence,) = broken_layers(written(tmp_path, low__data=text), TABLE, {})
    assert sentence.startswith("house.low.data line ")
    assert sentence.endswith("the import of house.high.use runs up")


def test_an_import_sideways_is_found(tmp_path):
    (sentence,) = broken_layers(written(tmp_path, beside="from house.high.use import name"), TABLE, {})
    assert sentence == "house.beside line 1: the import of house.high.use runs sideways"


def test_an_import_of_a_stranger_is_found(tmp_path):
    imports = written(tmp_path, high__use="from house.low import data")
    assert broken_layers(imports, TABLE, {}) == []
    assert len(broken_layers(imports, TABLE, {"high": {"low"}})) == 1


def test_a_circle_inside_a_room_is_found(tmp_path):
    files = {"high__other": "from house.high.third import name", "high__third": "from house.high.use import name"}
    later = "def later():\n    from house.high import other\n    return other"
    imports = written(tmp_path, high__use=later, **files)
    assert broken_layers(imports, TABLE, {}) == []
    found = circles((item.importer, item.imported) for item in imports)
    assert found == [["house.high.other", "house.high.third", "house.high.use"]]


def test_the_architecture_names_the_rooms_in_this_order():
    text = (Path(__file__).parent.parent / "docs" / "architecture.md").read_text(encoding="utf-8")
    named = re.findall(r"^    (\w+)  ", text, re.MULTILINE)
    layer = {room: number for number, rooms in enumerate(LAYERS) for room in rooms}
    assert sorted(named) == sorted(layer.keys() - {".", "__main__"})
    assert [layer[room] for room in named] == sorted(layer[room] for room in named)


def test_the_files_that_the_architecture_names_are_there():
    root = Path(__file__).parent.parent
    text = (root / "docs" / "architecture.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`((?:enumsol/|tests/)?[\w/]+(?:\.pyx?|/))`", text))
    assert len(named) > 30
    homes = (root, root / "enumsol", root / "enumsol" / "continuation")
    assert [name for name in named if not any((home / name).exists() for home in homes)] == []
