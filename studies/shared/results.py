"""One run of a study: its size, its options, and the folder that tables and figures are written to."""

from __future__ import annotations

import csv
from argparse import Namespace
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Run:
    """What ``python studies NAME`` hands to the study's ``main``.

    Attributes
    ----------
    folder : Path
        Where the results are written.
    smoke : bool
        Whether everything is to be done at a size that takes seconds: to see that it works, not to answer the question.
    options : Namespace
        The study's own options on the command line.
    """

    folder: Path
    smoke: bool = False
    options: Namespace = field(default_factory=Namespace)

    def path(self, name: str) -> Path:
        """A file among the results."""
        self.folder.mkdir(parents=True, exist_ok=True)
        return self.folder / name

    def table(self, name: str, rows: list[dict[str, Any]], *notes: str) -> None:
        """Print rows as an aligned table with notes below; keep them as NAME.csv and NAME.txt."""
        columns = list(rows[0])
        text = [[_cell(row[column]) for column in columns] for row in rows]
        widths = [max(map(len, cells)) for cells in zip(columns, *text, strict=True)]
        for line in (columns, *text):
            print("  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)))
        for note in notes:
            print(note)
        with self.path(f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(columns)
            writer.writerows(text)
        if notes:
            self.path(f"{name}.txt").write_text("\n".join(notes) + "\n", encoding="utf-8")

    def figure(self, name: str, figure: Any) -> None:
        """Keep a matplotlib figure as NAME.png."""
        figure.savefig(self.path(f"{name}.png"), dpi=150)


def _cell(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def series(rows: list[dict[str, Any]], name: str) -> str:
    """A column of a table as text."""
    return " ".join(f"{row[name]:.3g}" if isinstance(row[name], float) else str(row[name]) for row in rows)


def yes(fact: object) -> str:
    """A fact in a table."""
    return "yes" if fact else "no"
