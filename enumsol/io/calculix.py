"""Results of CalculiX: displacements read from `.frd` and `.dat` files, and equilibria written to `.frd` for CGX."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import cKDTree

from enumsol.errors import InvalidArgumentError
from enumsol.io.vtu import SolvedState, pictures_of
from enumsol.support.arguments import file_path
from enumsol.support.array_types import Floats, Integers
from enumsol.support.files import reading, write_file, writing
from enumsol.support.messages import counted

if TYPE_CHECKING:
    import os

    from enumsol.model.mesh import BodyMesh
    from enumsol.model.problem3d import AnyProblem

#: Of kinds of cells as meshio names them: the number that CGX has for them, and its order of their nodes.
_KINDS: dict[str, tuple[int, list[int]]] = {
    "triangle": (7, [*range(3)]),
    "triangle6": (8, [*range(6)]),
    "quad": (9, [*range(4)]),
    "quad8": (10, [*range(8)]),
    "quad9": (10, [*range(8)]),
    "tetra": (3, [*range(4)]),
    "tetra10": (6, [*range(10)]),
    "hexahedron": (1, [*range(8)]),
    "hexahedron20": (4, [*range(12), *range(16, 20), *range(12, 16)]),
    "hexahedron27": (4, [*range(12), *range(16, 20), *range(12, 16)]),
    "wedge": (2, [*range(6)]),
    "wedge15": (5, [*range(9), *range(12, 15), *range(9, 12)]),
    "wedge18": (5, [*range(9), *range(12, 15), *range(9, 12)]),
}
#: Components of symmetric tensors as CalculiX orders them, in a tensor by rows.
_TENSOR = [0, 4, 8, 1, 5, 6]
#: Numbers that CGX has for scalars, vectors and symmetric tensors, and the places of their components.
_SCALARS, _VECTOR, _SYMMETRIC = 1, 2, 4
_COMPONENTS = {
    _SCALARS: [(0, 0)] * 3,
    _VECTOR: [(1, 0), (2, 0), (3, 0), (0, 0)],
    _SYMMETRIC: [(1, 1), (2, 2), (3, 3), (1, 2), (2, 3), (3, 1)],
}
#: Positions of a node in a file and in the mesh may differ by this part of the extent: files have six digits.
_SAME_PLACE = 1e-4


@dataclass(frozen=True, eq=False)
class NodalResult:
    """Displacements of nodes in a result file.

    Attributes
    ----------
    time : float
        Of the increment.
    numbers : (k,) int array
        Of the nodes in the file.
    displacements : (k, 3) array
        [length]
    points : (k, 3) array or None
        Positions of the nodes; None in a `.dat` file, which has none [length].
    """

    time: float
    numbers: Integers
    displacements: Floats
    points: Floats | None

    def on(self, mesh: BodyMesh, numbers: Sequence[object] | None = None, *, axisymmetric: bool = False) -> Floats:
        """Displacements of the nodes of a mesh, (N, d).

        Nodes are told by ``numbers`` (N,), those of the nodes of the mesh, where the file has these at their places, as
        a `.dat` file is taken to have. Otherwise they are told by their positions: plane bodies are written as one
        layer of solid cells, and a node of the mesh is then the mean of those with its position in the plane, of
        axisymmetric bodies those at its radius. Nodes that the file lacks have NaN, and of nodes that are told by their
        positions those which share theirs, as bodies in contact do.

        Raises
        ------
        InvalidArgumentError
            The file is of another mesh, or has no positions and ``numbers`` is not given.
        """
        if self.points is None and numbers is None:
            raise InvalidArgumentError(
                "a .dat file has no positions of nodes, and the numbers of the nodes are not known; expected "
                "a .frd file, or a deck as the problem"
            )
        found = np.full(mesh.points.shape, np.nan) if numbers is None else self._by_number(mesh, numbers)
        if self.points is not None and _absent(mesh, found):
            found = self._by_place(mesh, axisymmetric)
        if absent := _absent(mesh, found):
            raise InvalidArgumentError(
                f"{absent} of {counted(len(np.unique(mesh.cells)), 'node')} of the problem are not in the file, or "
                "share their positions; expected a result of the same mesh"
            )
        return found

    def _by_number(self, mesh: BodyMesh, numbers: Sequence[object]) -> Floats:
        place = {str(number): row for row, number in enumerate(self.numbers.tolist())}
        rows = np.array([place.get(str(number), -1) for number in numbers])
        found, d = np.full(mesh.points.shape, np.nan), mesh.points.shape[1]
        known = rows >= 0
        if self.points is not None:
            off = np.max(np.abs(self.points[rows, :d] - mesh.points), axis=1)
            known &= not np.any(known & (off > _near(mesh)))  # numbers of another mesh
        found[known] = self.displacements[rows[known], :d]
        return found

    def _by_place(self, mesh: BodyMesh, axisymmetric: bool) -> Floats:
        d = mesh.points.shape[1]
        places, moves = np.asarray(self.points)[:, :d], self.displacements[:, :d]
        if axisymmetric:
            across, (x, _, z) = self.displacements, np.asarray(self.points).T
            radius = np.hypot(x, z)
            outward = np.stack([x, z], axis=1) / np.where(radius == 0, 1.0, radius)[:, None]
            places = np.column_stack([radius, places[:, 1]])
            moves = np.column_stack([np.sum(outward * across[:, [0, 2]], axis=1), moves[:, 1]])
        tree = cKDTree(mesh.points)
        distance, nearest = tree.query(places)
        ours = distance <= _near(mesh)
        count = np.bincount(nearest[ours], minlength=len(mesh.points)).astype(np.float64)
        shared = tree.query(mesh.points, k=2)[0][:, 1] <= _near(mesh)
        found, known = np.full(mesh.points.shape, np.nan), (count > 0) & ~shared
        for k in range(d):
            sums = np.bincount(nearest[ours], moves[ours, k], minlength=len(mesh.points))
            found[known, k] = sums[known] / count[known]
        return found


def _near(mesh: BodyMesh) -> float:
    return _SAME_PLACE * float(np.max(np.ptp(mesh.points, axis=0)))


def _absent(mesh: BodyMesh, found: Floats) -> int:
    """Number of nodes without displacements, if they are more than half of all; else 0."""
    corners = np.unique(mesh.cells)
    absent = int(np.sum(np.isnan(found[corners, 0])))
    return absent if 2 * absent > len(corners) else 0


def read_results(path: str | os.PathLike[str]) -> list[NodalResult]:
    """Displacements of all increments in a result file of CalculiX, in the order of the file.

    Parameters
    ----------
    path : str or path-like
        A `.frd` file (displacements by ``*NODE FILE`` with U), or a `.dat` file (``*NODE PRINT`` with U).

    Raises
    ------
    InvalidArgumentError
        The file cannot be read, is no such file, is binary, or has no displacements. The message begins with the path.

    Examples
    --------
    >>> import enumsol, tempfile
    >>> problem = enumsol.gallery.clamped_block(2, 1)
    >>> roots = enumsol.enumerate_roots(problem, alpha=0.5)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     enumsol.write_frd(problem, roots, f"{folder}/roots.frd")
    ...     [(result.time, result.displacements.shape) for result in enumsol.read_results(f"{folder}/roots.frd")]
    [(1.0, (6, 3))]
    """
    place = file_path(path, "path", "the name of a .frd or .dat file")
    readers = {".frd": _frd, ".dat": _dat}
    if place.suffix.lower() not in readers:
        raise InvalidArgumentError(f"{place} is no result file; expected a name that ends in .frd or .dat")
    try:
        with reading(place, "results", "CalculiX"), place.open(encoding="latin-1") as lines:
            found = list(readers[place.suffix.lower()](lines))
    except InvalidArgumentError as error:
        named = str(error).startswith(str(place))
        raise error if named else InvalidArgumentError(f"{place}: {error}") from error
    if not found:
        output = "*NODE FILE" if place.suffix.lower() == ".frd" else "*NODE PRINT"
        raise InvalidArgumentError(f"{place} has no displacements; expected the output of {output} with U")
    return found


def converged_time(path: str | os.PathLike[str]) -> float | None:
    """Time of the last increment that converged, by the file ``.sta`` that CalculiX writes beside its results.

    None if there is no such file, or none converged. After a run that was broken off the last displacements in a
    ``.frd`` file are those of an increment that did not converge.
    """
    place = file_path(path, "path").with_suffix(".sta")
    if not place.is_file():
        return None
    rows = [line.split() for line in place.read_text(encoding="latin-1").splitlines()]
    done = [row[4] for row in rows if len(row) == 7 and all(word.isdigit() for word in row[:4])]
    return float(done[-1]) if done else None


def _frd(lines: Iterable[str]) -> Iterator[NodalResult]:
    points: dict[int, list[float]] = {}
    time = 0.0
    lines = iter(lines)
    for line in lines:
        if line.startswith("    2C"):
            if line[73:75].strip() not in ("", "0", "1"):
                raise InvalidArgumentError("it is a binary file; expected one in ASCII (*NODE FILE, not *NODE OUTPUT)")
            points = _block(lines)
        elif line.startswith("  100C"):
            time = float(line[12:24])
        elif line.startswith(" -4  DISP"):
            values = _block(lines)
            numbers = np.array(list(values), dtype=np.int64)
            places = np.array([points[number] for number in values]).reshape(-1, 3)
            yield NodalResult(time, numbers, np.array([row[:3] for row in values.values()]).reshape(-1, 3), places)


def _block(lines: Iterator[str]) -> dict[int, list[float]]:
    """Values of nodes up to the end of a block; numbers have columns of 10, or in old files 5."""
    found: dict[int, list[float]] = {}
    for line in lines:
        if line.startswith(" -3"):
            return found
        if line.startswith(" -1"):
            text = line.rstrip("\n")
            wide = 13 if (len(text.rstrip()) - 13) % 12 == 0 else 8
            found[int(text[3:wide])] = [float(text[k : k + 12]) for k in range(wide, len(text.rstrip()), 12)]
    raise InvalidArgumentError("it ends within a block of values; expected a whole file")


def _dat(lines: Iterable[str]) -> Iterator[NodalResult]:
    lines = iter(lines)
    found: dict[float, dict[int, list[float]]] = {}
    for line in lines:
        if not line.strip().startswith("displacements"):
            continue
        time = float(line.split()[-1])
        values = found.setdefault(time, {})
        next(lines, "")
        for row in itertools.takewhile(str.strip, lines):
            number, *components = row.split()
            if components[-1:] == ["L"]:
                raise InvalidArgumentError("its displacements are in local axes; expected *NODE PRINT, GLOBAL=YES")
            values[int(number)] = list(map(float, components))[:3]
    for time, values in found.items():
        yield NodalResult(time, np.array(list(values), dtype=np.int64), np.array(list(values.values())), None)


def write_frd(
    problem: AnyProblem,
    state: SolvedState | Sequence[SolvedState],
    path: str | os.PathLike[str],
    *,
    numbers: Integers | None = None,
) -> None:
    """Write displacements, contact forces and stresses to a `.frd` file for CGX, the viewer of CalculiX.

    Each state of several, such as a RootSet, is a step of the file. Data sets are ``DISP``, ``FORC`` (the contact force
    that acts on the body), ``CONTACT`` (``STATUS``: 0 open, 1 stick, 2 slip+, 3 slip-, in 3D 2 slip, and -1 where there
    is no contact node; ``PRESS``, lambda_n; ``GAP``, the gap that is left), and ``STRESS``, the mean stress of the
    cells around a node.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
        With ``mesh``.
    state : Root, RootSet, FixedPoint, TrescaSolution or other, or a sequence of them
        As in `write_vtu`.
    path : str or path-like
        Ends in .frd; an existing file is replaced.
    numbers : (N,) int array, optional
        Numbers of the nodes; default: from 1 on.

    Raises
    ------
    InvalidArgumentError
        As `write_vtu`, or the problem has no mesh.
    OutputError
        There is no room for it.
    MissingDependencyError
        meshio is not installed.

    Examples
    --------
    >>> import enumsol, pathlib, tempfile
    >>> problem = enumsol.gallery.clamped_block(2, 1)
    >>> roots = enumsol.enumerate_roots(problem, alpha=0.5)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     enumsol.write_frd(problem, roots, f"{folder}/roots.frd")
    ...     len(enumsol.read_results(f"{folder}/roots.frd")) == len(roots)
    True
    """
    place = file_path(path, "path")
    if place.suffix != ".frd":
        raise InvalidArgumentError(f"path is {str(place)!r}; expected a name that ends in .frd")
    if getattr(problem, "mesh", None) is None:
        raise InvalidArgumentError("problem has no mesh; expected one made of a mesh")
    pictures = pictures_of(problem, state, "FRD files")
    lines = _written(pictures, numbers)
    with writing(place, "path"):
        write_file(place, "".join(f"{line}\n" for line in lines).encode("ascii"), "path")


def _written(pictures: list[Any], numbers: Integers | None) -> Iterator[str]:
    body = pictures[0]
    blocks = [(block.type, block.data, k) for k, block in enumerate(body.cells) if _is_body(body, k)]
    used = np.unique(np.concatenate([data[:, _KINDS[kind][1]].ravel() for kind, data, _ in blocks]))
    labels = np.arange(1, len(body.points) + 1) if numbers is None else np.asarray(numbers, dtype=np.int64)
    yield "    1C"
    yield "    1UPGM               enumsol"
    yield f"    2C{len(used):30d}{1:38d}"
    yield from _rows(labels[used], body.points[used])
    yield " -3"
    yield f"    3C{sum(len(data) for _, data, _ in blocks):30d}{1:38d}"
    first = itertools.count(1)
    for kind, data, _ in blocks:
        number, order = _KINDS[kind]
        for cell in labels[data[:, order]].tolist():
            yield f" -1{next(first):10d}{number:5d}{0:5d}{1:5d}"
            for k in range(0, len(cell), 10):
                yield " -2" + "".join(f"{node:10d}" for node in cell[k : k + 10])
    yield " -3"
    for step, picture in enumerate(pictures, start=1):
        for name, kind, parts, values in _sets(picture, blocks, used):
            yield f"    1PSTEP{step:26d}{1:12d}{step:12d}"
            yield f"  100CL{100 + step:5d}{float(step):12.5E}{len(used):12d}{'':20}{0:2d}{step:5d}{1:12d}"
            yield f" -4  {name:8}{len(parts):5d}{1:5d}"
            for k, part in enumerate(parts):
                row, column = _COMPONENTS[kind][k]
                yield f" -5  {part:8}{1:5d}{kind:5d}{row:5d}{column:5d}" + ("" if part != "ALL" else f"{1:5d}ALL")
            yield from _rows(labels[used], values)
            yield " -3"
    yield " 9999"


def _is_body(picture: Any, k: int) -> bool:
    """True if a block of cells is of the body, not the facets of its contact surface."""
    surface = picture.cell_data.get("contact_surface")
    return surface is None or not np.any(surface[k])


def _rows(labels: Integers, values: Floats) -> Iterator[str]:
    for label, row in zip(labels.tolist(), (values + 0.0).tolist(), strict=True):
        yield f" -1{label:10d}" + "".join(f"{value:12.5E}" for value in row)


def _sets(picture: Any, blocks: list[Any], used: Integers) -> Iterator[tuple[str, int, list[str], Floats]]:
    """Data sets of a state: names, kinds, names of the components, values of the nodes that are used."""
    data = picture.point_data
    for name, source in (("DISP", "displacement"), ("FORC", "contact_force")):
        if source in data:
            letter = name[0]
            yield name, _VECTOR, [f"{letter}1", f"{letter}2", f"{letter}3", "ALL"], np.asarray(data[source])[used]
    if "lambda_n" in data and len(data["lambda_n"]) == len(picture.points):
        status = data.get("status", np.full(len(picture.points), np.nan))
        contact = np.column_stack(
            [np.nan_to_num(status, nan=-1.0), *(np.nan_to_num(data[key]) for key in ("lambda_n", "u_n"))]
        )
        contact[:, 2] *= -1.0
        yield "CONTACT", _SCALARS, ["STATUS", "PRESS", "GAP"], contact[used] + 0.0
    if "stress" in picture.cell_data:
        total, count = np.zeros((len(picture.points), 6)), np.zeros(len(picture.points))
        for _, cells, k in blocks:
            values = np.asarray(picture.cell_data["stress"][k])[:, _TENSOR]
            np.add.at(total, cells, values[:, None, :])
            np.add.at(count, cells, 1.0)
        yield "STRESS", _SYMMETRIC, ["SXX", "SYY", "SZZ", "SXY", "SYZ", "SZX"], total[used] / count[used, None]
