"""The version of this package, read where it is written down and only when it is asked for."""

from __future__ import annotations

import tomllib
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

#: A package without its metadata: copied from somewhere.
_UNKNOWN = "0+unknown"


def find_version() -> str:
    """Version of the modules that are imported.

    In a checkout it stands in pyproject.toml: another version may be installed beside it, and metadata would tell of
    that one.
    """
    try:
        project = tomllib.loads(Path(__file__).parent.with_name("pyproject.toml").read_text(encoding="utf-8"))
        if project["project"]["name"] == "enumsol":
            return str(project["project"]["version"])
    except (OSError, ValueError, KeyError):
        pass  # installed: no such file, or that of something else
    try:
        return version("enumsol")
    except PackageNotFoundError:
        return _UNKNOWN


__version__ = find_version()
