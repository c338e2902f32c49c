"""Run a study: ``python studies NAME [--smoke] [--results DIR]``; without a name, list the questions."""

from __future__ import annotations

import argparse
import ast
import sys
import tempfile
from importlib import import_module
from pathlib import Path

from shared.results import Run

STUDIES = Path(__file__).parent


def questions() -> dict[str, str]:
    """Name of every study, and the question that its run.py begins with."""
    found = {}
    for file in sorted(STUDIES.glob("*/run.py")):
        text = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8")))
        if text is not None:
            found[file.parent.name] = text.splitlines()[0]
    return found


def main(arguments: list[str]) -> None:
    known = questions()
    name, *rest = arguments or [""]
    if name not in known:
        print("\n".join([__doc__, "", *(f"{study:25}{question}" for study, question in known.items())]))
        sys.exit(f"\nthere is no study {name!r}" if name.strip("-") not in ("", "h", "help") else 0)
    study = import_module(f"{name}.run")
    parser = argparse.ArgumentParser(
        prog=f"python studies {name}", description=study.__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--smoke", action="store_true", help="a size of seconds, with results in a new temporary folder"
    )
    parser.add_argument("--results", type=Path, metavar="DIR", help="folder for the results")
    if hasattr(study, "options"):
        study.options(parser)
    given = parser.parse_args(rest)
    folder = given.results or (Path(tempfile.mkdtemp(prefix=name)) if given.smoke else STUDIES / name / "results")
    study.main(Run(folder, given.smoke, given))


if __name__ == "__main__":
    main(sys.argv[1:])
