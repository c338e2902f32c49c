"""The problems of the collection: the index, the problems, their certified solutions and proofs."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.io import read_problem
from enumsol.model.statuses import ContactStatus
from enumsol.proof.proof_file import Proof
from enumsol.support.arguments import entry_named, file_path, shown
from enumsol.support.files import write_files, writing
from enumsol.support.immutable import Sealed
from enumsol.support.messages import counted

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping, Sequence

    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import Floats

#: Where the collection is kept: the index, and the folders of the problems and of what is certified about them.
DATA = Path(__file__).parent / "data"
INDEX, PROBLEMS, CERTIFIED = "index.json", "problems", "certified"
#: Files of every problem, by folder.
_ENDINGS = {PROBLEMS: ("npz", "h5"), CERTIFIED: ("json", "proof")}


@dataclass(frozen=True)
class CertifiedSolutions(Sealed):
    """Certified solutions of a problem of the collection, which has no others.

    Attributes
    ----------
    roots : (k, p, d) array
        Contact forces of the isolated solutions, at every node the normal one first [force].
    statuses : tuple of k tuples of p ContactStatus
    families : tuple of tuples of (v, p, d) arrays
        The connected continua: of each the vertices of the polytopes of which it consists.

    Examples
    --------
    >>> import enumsol
    >>> solutions = enumsol.collection.get("triangle-3").certified()
    >>> solutions.roots[:, 0].round(3).tolist()
    [[0.0, 0.0], [0.333, -1.667], [1.5, -4.0]]
    """

    roots: Floats
    statuses: tuple[tuple[ContactStatus, ...], ...]
    families: tuple[tuple[Floats, ...], ...]


@dataclass(frozen=True)
class CollectionEntry:
    """A problem of the collection, whose friction and load do not depend on alpha.

    Attributes
    ----------
    name : str
        Its identifier, as in ``collection:NAME``; what it stands for never changes.
    summary : str
        What it shows, in a line.
    source : str
        What it was made of, in a line.
    kinds : tuple of str
        Words to choose by: "degenerate", "continuum", "soft", "large", "steel", "random".
    dimension : int
        2 or 3.
    p, n : int
        Numbers of contact nodes and of degrees of freedom.
    friction : (float, float)
        Least and largest coefficient of the nodes.
    roots, families : int
        Numbers of isolated solutions and of continua; there are no others, which is proven.
    degenerate : int
        How many of the isolated solutions have several statuses, or a singular system.
    fingerprint : str
        Of the problem, as in proofs.

    Examples
    --------
    >>> import enumsol
    >>> entry = enumsol.collection.get("wedge-8-5")
    >>> entry.roots, enumsol.verify(entry.problem(), entry.proof()).complete
    (5, True)
    """

    name: str
    summary: str
    source: str
    kinds: tuple[str, ...]
    dimension: int
    p: int
    n: int
    friction: tuple[float, float]
    roots: int
    families: int
    degenerate: int
    fingerprint: str

    def problem(self) -> AnyProblem:
        """The problem."""
        return read_problem(DATA / PROBLEMS / f"{self.name}.npz")

    def proof(self) -> Proof:
        """The proof that ``certified`` lists all solutions, for `enumsol.verify`."""
        return Proof.load(DATA / CERTIFIED / f"{self.name}.proof")

    def certified(self) -> CertifiedSolutions:
        """The list of its solutions, which is complete."""
        found = json.loads((DATA / CERTIFIED / f"{self.name}.json").read_text(encoding="utf-8"))
        roots = [_forces(root["lambda_n"], root["lambda_t"]) for root in found["roots"]]
        return CertifiedSolutions(
            np.array(roots).reshape(-1, self.p, self.dimension),
            tuple(tuple(map(ContactStatus, root["statuses"])) for root in found["roots"]),
            tuple(tuple(np.array(part["vertices"]) for part in family["polytopes"]) for family in found["families"]),
        )

    def solutions_in_words(self) -> str:
        """Its solutions, as in "3 (1 degenerate)" and "2 and 1 continuum"."""
        isolated = f"{self.roots} ({self.degenerate} degenerate)" if self.degenerate else f"{self.roots}"
        continua = counted(self.families, "continuum", "continua")
        if not self.families:
            return isolated
        return f"{isolated} and {continua}" if self.roots else continua

    def friction_in_words(self) -> str:
        """Its coefficients of friction, as in "0.5" and "0 to 0.8"."""
        low, high = self.friction
        return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def _forces(normal: list[float], tangential: list[Any]) -> Floats:
    """Contact forces of all nodes, (p, d), the normal one first."""
    return np.column_stack([np.array(normal), np.array(tangential)])


def get(name: str) -> CollectionEntry:
    """Return the problem of the collection with this name.

    Raises
    ------
    InvalidArgumentError
        There is none; the message lists similar names, or all.

    Examples
    --------
    >>> import enumsol
    >>> entry = enumsol.collection.get("triangle-continuum")
    >>> entry.roots, entry.families
    (0, 1)
    """
    return entry_named(name, COLLECTION, "the collection", "triangle-3")


def export(folder: str | os.PathLike[str], names: Sequence[str] | None = None) -> tuple[CollectionEntry, ...]:
    """Write the collection to a folder, and return what was written.

    Parameters
    ----------
    folder : str or path-like
        It is made in one that exists. In it ``problems`` holds the problems as .npz and as .h5 (fclib), ``certified``
        their solutions as JSON and their proofs, and ``index.json`` lists them. Files of the same names are replaced.
    names : sequence of str, optional
        Only these problems.

    Raises
    ------
    InvalidArgumentError
        There is no problem of that name, or the folder cannot be made.
    OutputError
        There is no space left for it.

    Examples
    --------
    >>> import enumsol, pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     written = enumsol.collection.export(folder, ["triangle-3"])
    ...     sorted(file.name for file in pathlib.Path(folder).rglob("*.*"))
    ['index.json', 'triangle-3.h5', 'triangle-3.json', 'triangle-3.npz', 'triangle-3.proof']
    """
    place = file_path(folder, "folder", "the name of a folder")
    if names is not None and not isinstance(names, (list, tuple)):
        raise InvalidArgumentError(f"names is {shown(names)}; expected a list of names")
    chosen = tuple(COLLECTION.values()) if names is None else tuple(get(name) for name in names)
    with writing(place, "folder"):
        place.mkdir(exist_ok=True)
        for part in _ENDINGS:
            (place / part).mkdir(exist_ok=True)
        for entry in chosen:
            parts = [f"{part}/{entry.name}.{ending}" for part, endings in _ENDINGS.items() for ending in endings]
            write_files({place / file: (DATA / file).read_bytes() for file in parts})
        lines = [line for line in _index_lines() if json.loads(line)["name"] in {entry.name for entry in chosen}]
        write_files({place / INDEX: "[\n" + ",\n".join(lines) + "\n]\n"})
    return chosen


def _index_lines() -> list[str]:
    """The index, a line for every problem."""
    text = (DATA / INDEX).read_text(encoding="utf-8")
    return [line.removesuffix(",") for line in text.splitlines() if line.startswith("{")]


def _entry(line: str) -> CollectionEntry:
    given = json.loads(line)
    values: dict[str, Any] = {name: tuple(v) if isinstance(v, list) else v for name, v in given.items()}
    return CollectionEntry(**values)


#: All problems of the collection, by name.
COLLECTION: Mapping[str, CollectionEntry] = MappingProxyType(
    {entry.name: entry for entry in map(_entry, _index_lines())}
)
