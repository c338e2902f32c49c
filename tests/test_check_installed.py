"""What .ci/run says of an installed wheel: sources of compiled modules and symbols that were left in are found."""

import struct

import pytest
from check_installed import complaints, sections
from documents import ROOT


def elf(*names):
    """A 64-bit little-endian ELF file of empty sections with these names; the last one holds the names."""
    table = b"\0".join(name.encode() for name in names) + b"\0"
    headers = b""
    for name in names:
        place = table.index(name.encode() + b"\0")
        headers += struct.pack("<IIQQQQIIQQ", place, 0, 0, 0, 64, len(table), 0, 0, 0, 0)
    head = b"\x7fELF\x02\x01".ljust(40, b"\0") + struct.pack("<QI6H", 64 + len(table), 0, 64, 0, 0, 64, len(names), 0)
    head = head[:-2] + struct.pack("<H", len(names) - 1)
    return head + table + headers


@pytest.mark.parametrize(
    ("names", "left"),
    [
        ((".text", ".dynsym", ".shstrtab"), ""),
        ((".text", ".symtab", ".debug_info", ".shstrtab"), ".symtab, .debug_info"),
    ],
)
def test_symbols_left_in_a_compiled_module_are_found(tmp_path, names, left):
    file = tmp_path / "module.so"
    file.write_bytes(elf(*names))
    assert sections(file) == list(names)
    assert complaints([file]) == ([f"{file} is not stripped: it has {left}"] if left else [])


def test_sources_of_compiled_modules_are_found(tmp_path):
    files = [tmp_path / name for name in ("a.py", "a.pyx", "a.pyi", "a.h", "py.typed")]
    assert [line.split(" ")[0] for line in complaints(files)] == [str(files[1]), str(files[3])]


def test_a_file_of_another_system_has_no_sections(tmp_path):
    file = tmp_path / "module.so"
    file.write_bytes(b"\xcf\xfa\xed\xfe" + bytes(100))
    assert sections(file) == []


def test_a_source_distribution_holds_every_folder_and_document():
    words = (ROOT / "MANIFEST.in").read_text(encoding="utf-8").split()
    made = {"enumsol", "build", "dist", "site"}
    folders = {path.name for path in ROOT.iterdir() if path.is_dir() and not path.name.startswith((".", "_"))}
    assert {name for name in folders - made if not name.endswith(".egg-info")} == {"docs", "studies", "tests", "tools"}
    assert set(words) >= {"docs", "studies", "tests", "tools", ".ci"}
    # README, licence and pyproject.toml come by themselves
    documents = {path.name for path in ROOT.iterdir() if path.suffix in {".md", ".cff"}} - {"README.md"}
    assert set(words) >= documents
