"""Why a compiled module is missing, and what to do about it."""

from __future__ import annotations

import json
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.metadata import distributions
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote, urlsplit

if TYPE_CHECKING:
    from collections.abc import Iterator

#: Suffixes of compiled modules, for any version of Python.
_BINARY = (".so", ".pyd")


def why_missing(module: str, error: ImportError) -> str:
    """Why a compiled module of this package cannot be imported, and what to do, in one clause.

    Python imports the first enumsol that it finds. In a checkout that is the source, where nothing is compiled, even if
    the package is also installed with all of its modules.

    Parameters
    ----------
    module : str
        Its full name, such as ``enumsol.relaxation._active_set``.
    error : ImportError
        What the attempt to import it raised.
    """
    package, *inside = module.split(".")
    place = Path(*inside)
    here = Path(__file__).resolve().parent
    if _built(here / place):
        return f"it is compiled in {here} and cannot be loaded ({' '.join(str(error).split())}; reinstall enumsol)"
    whole = [other for other in _others(package, here) if _built(other / place)]
    if whole:
        return (
            f"enumsol was imported from {here}, where it is not compiled for this Python, and the package in "
            f"{whole[0]} is (start Python in another directory than {here.parent} or with the option -P, or take that "
            "directory off PYTHONPATH)"
        )
    foreign = sorted(file.name for file in (here / place).parent.glob(f"{place.name}.*") if file.suffix in _BINARY)
    if foreign:
        return (
            f"{here} holds it for another Python only ({foreign[0]}, and this one loads {EXTENSION_SUFFIXES[0]}; "
            f"install enumsol with {sys.executable} -m pip)"
        )
    if (here.parent / "pyproject.toml").exists():
        return (
            f"enumsol was imported from its source in {here.parent}, where nothing is compiled (with a C compiler: "
            f"pip install -e {here.parent})"
        )
    return f"{here} was installed without it (install a C compiler and reinstall enumsol to get it)"


def _built(module: Path) -> bool:
    """Whether the module exists in a form that this Python loads."""
    return any(module.with_name(module.name + suffix).is_file() for suffix in EXTENSION_SUFFIXES)


def _others(package: str, here: Path) -> Iterator[Path]:
    """Other directories of the same package, which Python would have imported had it not found this one first."""
    seen = {here}
    for root in _roots(package):
        other = (root / package).resolve()
        if other not in seen and (other / "__init__.py").is_file():
            seen.add(other)
            yield other


def _roots(package: str) -> Iterator[Path]:
    """Where packages may be: on the import path, and where they are installed, in place or not."""
    yield from map(Path, sys.path)
    for installed in distributions(name=package):
        yield Path(str(installed.locate_file("")))
        source = json.loads(installed.read_text("direct_url.json") or "{}")
        if source.get("dir_info", {}).get("editable"):
            yield Path(unquote(urlsplit(source["url"]).path))
