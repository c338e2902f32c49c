"""Whether the enumsol that this Python imports was installed from a clean wheel: python tools/check_installed.py.

Its wheel holds no sources of compiled modules, and the compiled modules hold no symbols that only a debugger reads.
"""

from __future__ import annotations

import struct
import sys
from importlib.metadata import distribution
from pathlib import Path

#: What compiled modules are made of; of no use beside them.
SOURCES = (".pyx", ".pxd", ".h", ".c")


def sections(file: Path) -> list[str]:
    """Names of the sections of a 64-bit ELF file; none of any other file."""
    data = file.read_bytes()
    if data[:5] != b"\x7fELF\x02":
        return []
    order = "<" if data[5] == 1 else ">"
    (start,) = struct.unpack_from(f"{order}Q", data, 0x28)
    size, count, names = struct.unpack_from(f"{order}3H", data, 0x3A)
    # a section header begins with the place of its name; 0x18 bytes on it has the place of what it holds
    headers = [start + k * size for k in range(count)]
    (table,) = struct.unpack_from(f"{order}Q", data, headers[names] + 0x18)
    places = [table + struct.unpack_from(f"{order}I", data, header)[0] for header in headers]
    return [data[place : data.index(b"\0", place)].decode() for place in places]


def complaints(files: list[Path]) -> list[str]:
    """What is wrong with the installed files, a line each."""
    found = [f"{file} is a source of a compiled module" for file in files if file.suffix in SOURCES]
    for file in files:
        if file.suffix == ".so":
            spare = [name for name in sections(file) if name == ".symtab" or name.startswith(".debug")]
            found += [f"{file} is not stripped: it has {', '.join(spare)}"] if spare else []
    return found


def main() -> int:
    files = [Path(str(file.locate())) for file in distribution("enumsol").files or ()]
    compiled = [file for file in files if file.suffix in {".so", ".pyd"}]
    found = complaints(files)
    if len(compiled) != 3:
        found.append(f"{len(compiled)} compiled modules are installed; expected 3")
    print("\n".join(found) or f"{len(files)} files, {sum(file.stat().st_size for file in compiled)} bytes compiled")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
