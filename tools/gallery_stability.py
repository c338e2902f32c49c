"""Which roots of the gallery run away: a table of docs/stability.md.

    python tools/gallery_stability.py [NAME ...]

Problems without a mesh have a mass of one at every degree of freedom.
"""

from __future__ import annotations

import sys
from itertools import groupby

import numpy as np

import enumsol
from enumsol import gallery

#: Left out are large bodies and chains; the displacements of one-node-3d have no meaning, and so no mass.
LEFT_OUT = (
    "one-node-3d",
    "chain-4",
    "chain-6",
    "chain-8",
    "-32",
    "-64",
    "-100",
    "block3d-9",
    "block3d-16",
    "wedge3d-8",
)
NAMES = tuple(
    name for name, entry in gallery.GALLERY.items() if entry.roots and not any(part in name for part in LEFT_OUT)
)


def rows(name: str) -> list[tuple[str, ...]]:
    """Name, number, statuses, index, verdict and growth rates of every root of a problem."""
    entry = gallery.get(name)
    problem = entry.build()
    roots = enumsol.enumerate_roots(problem, entry.alpha)
    mass = None if problem.mesh is not None else np.eye(problem.n)
    verdicts = roots.stability(mass=mass)
    return [
        (
            name if not k else "",
            str(k),
            _counts(root),
            "?" if root.index is None else f"{root.index:+d}",
            found.verdict,
            ", ".join(f"{rate:.4g}" for rate in found.growth_rates),
        )
        for k, (root, found) in enumerate(zip(roots, verdicts, strict=True))
    ]


def _counts(root: enumsol.Root) -> str:
    """How many nodes have each status."""
    words = sorted(str(status) for status in root.statuses)
    return ", ".join(f"{len(list(own))} {word}" for word, own in groupby(words))


def main(names: tuple[str, ...]) -> None:
    print("| Problem | root | contact | index | verdict | growth rates |")
    print("|---|---|---|---|---|---|")
    for name in names:
        for row in rows(name):
            print(f"| {' | '.join(row)} |".replace("|  |", "| |"), flush=True)


if __name__ == "__main__":
    main(tuple(sys.argv[1:]) or NAMES)
