"""CalculiX: displacements read from its results, equilibria written to `.frd` for CGX, and decks that lead to them."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from enumsol.decks.assembled import SLICES
from enumsol.decks.cards import continued
from enumsol.decks.states import states_of
from enumsol.errors import InvalidArgumentError
from enumsol.fem.meshes import completing
from enumsol.io.vtu import SolvedState, pictures_of
from enumsol.support.arguments import file_path
from enumsol.support.array_types import Floats, Integers
from enumsol.support.files import reading, write_file, writing
from enumsol.support.messages import counted

if TYPE_CHECKING:
    import os

    from enumsol.decks.model import Deck
    from enumsol.decks.states import DeckState
    from enumsol.fem.deck_scenes import DeckModel
    from enumsol.fem.scenes import Scene
    from enumsol.model.mesh import BodyMesh
    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import Mask

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


# -- deck starts -------------------------------------------------------------------------------------------------------
# Decks that lead CalculiX to one of the equilibria: the engineer's own, with steps that hold it there and let it go.
#
# A first step holds the slips of the contact nodes at those of the equilibrium, by equations with a node each, and puts
# its friction forces on these nodes: what the bodies do otherwise is theirs alone, and normal forces come about by
# contact. A second step lets the slips go and takes the forces away, which the friction of the code's law takes over,
# by
# slips that its stiffness of sticking allows. An equilibrium that runs away can be led to, and leaves when it is let
# go.

#: Tangents that move less of the free components of a node are held by supports, and coefficients that are rounding.
_NONE = 1e-9


def write_start(model: DeckModel, root: SolvedState, file: str | os.PathLike[str], *, step: int | None = None) -> None:
    """Write a deck that leads CalculiX to an equilibrium of a step, and lets it go there.

    Its first step ends in the equilibrium, held by its slips, and its second one, at time 2, where the body goes when
    it is let go. An equilibrium that runs away is left then.

    Parameters
    ----------
    model : DeckModel
    root : Root or other state
        A solution of the problem of this step, with u (n,) and lambda_t (p,), in 3D (p, 2).
    file : str or path-like
        Written anew; in the folder of the deck if that includes files.
    step : int or None
        From 1; of a deck with one step that one.

    Raises
    ------
    InvalidArgumentError
        There is no such step, the root is of another problem, the deck has instances, which CalculiX does not know, or
        changes its friction, or the file cannot be written.

    Examples
    --------
    >>> import enumsol
    >>> model = enumsol.read_deck("model.inp")  # doctest: +SKIP
    >>> roots = enumsol.enumerate_roots(model.problem(), 0)  # doctest: +SKIP
    >>> enumsol.write_start(model, roots[0], "start.inp")  # doctest: +SKIP
    """
    place = file_path(file, "file", "a deck")
    scene, deck = model.scene(step), model.deck
    problem = scene.problem()
    if np.shape(root.u) != (problem.n,) or problem.mesh is None:
        raise InvalidArgumentError("root is of another problem; expected one of the step of the deck")
    state = states_of(deck)[(step or 1) - 1]
    moves = problem.mesh.displacements(np.asarray(root.u))
    nodes, equations, slips, forces = _slips(deck, scene, moves, np.asarray(root.lambda_t))
    lines = [*_before_steps(deck, place, step or 1), "*NODE", *(f"{node}, 0., 0., 0." for node in nodes), *equations]
    held = [f"{node}, 1, 1, {_number(value)}" for node, value in zip(nodes, slips, strict=True)]
    pushed = [f"{node}, 1, {_number(value)}" for node, value in zip(nodes, forces, strict=True)]
    supports, loads = _supports(deck, state), _loads(deck, state)
    lines += _step(["*BOUNDARY, OP=NEW", *supports, *held, *loads, *(["*CLOAD", *pushed] if pushed else [])])
    gone = [f"{node}, 1, 0." for node in nodes]
    lines += _step(["*BOUNDARY, OP=NEW", *supports, *(["*CLOAD", *gone] if gone else [])])
    write_file(place, "\n".join([*lines, ""]), "file")


def _number(value: float) -> str:
    """At most twenty characters, as many as CalculiX reads."""
    return f"{value:.12e}"


def _step(acts: list[str]) -> list[str]:
    return ["*STEP, INC=1000", "*STATIC", "0.1, 1.", *acts, "*NODE FILE", "U", "*END STEP"]


def _slips(
    deck: Deck, scene: Scene, moves: Floats, friction: Floats
) -> tuple[list[int], list[str], list[float], list[float]]:
    """Nodes whose displacements are slips of contact nodes, their equations, the slips, and forces on them."""
    nodes: list[int] = []
    equations: list[str] = []
    values: list[float] = []
    mesh, rows, d = scene.mesh, scene.contacts.rows, scene.dimension
    labels = [label if isinstance(label, int) else -1 for label in mesh.node_labels or ()]
    own, moved = _without_completing(scene), np.asarray(rows.means @ moves)
    frames = np.stack(scene.tangents, axis=1)
    along = (-1.0 / SLICES if scene.body.axisymmetric else -1.0) * friction.reshape(len(frames), -1)
    forces: list[float] = []
    first = 1 + int(max(deck.node_labels))
    for k, node in enumerate(rows.nodes):
        free = ~scene.held.fixed[node]
        kept = [j for j in range(d - 1) if np.max(np.abs(frames[k, j][free]), initial=0) > _NONE]
        if not kept or labels[node] < 0:
            continue
        axes, others = frames[k, kept], sp.coo_array(rows.means[[k]] @ own)
        pivots = _pivots(axes, free)
        solved = np.linalg.inv(axes[:, pivots])
        new = [first + len(nodes) + j for j in range(len(kept))]
        for j, pivot in enumerate(pivots):
            terms = {(labels[node], pivot): 1.0}
            for (other, weight), c in itertools.product(zip(others.coords[1], others.data, strict=True), range(d)):
                value = float(solved[j] @ axes[:, c]) * weight
                if abs(value) > _NONE and not (other == node and c in pivots):
                    terms[labels[other], c] = value
            terms |= {(new[i], 0): -float(solved[j, i]) for i in range(len(kept)) if abs(solved[j, i]) > _NONE}
            equations += _equation(terms)
        nodes += new
        values += (axes @ moved[k]).tolist()
        forces += along[k, kept].tolist()
    return nodes, equations, values, forces


def _pivots(axes: Floats, free: Mask) -> list[int]:
    """Components in which a node that is not held there can follow along axes."""
    found: list[int] = []
    left = np.where(free, axes, 0.0)
    for row in range(len(axes)):
        pivot = int(np.argmax(np.abs(left[row])))
        found.append(pivot)
        left = left - np.outer(left[:, pivot] / left[row, pivot], left[row])
    return found


def _without_completing(scene: Scene) -> sp.csr_array:
    """Displacements of all nodes by those of the deck: nodes that complete elements follow these."""
    labels = scene.mesh.node_labels or ()
    count = next((k for k, label in enumerate(labels) if "/" in str(label)), len(labels))
    own = sp.lil_array(sp.eye_array(len(labels)))
    for rows, shares in completing(3, scene.mesh.cells, count) if count < len(labels) else ():
        for nodes in rows:
            own[[nodes[0]]] = 0.0
            own[nodes[0], nodes[1:]] = shares
    return sp.csr_array(own)


def _equation(terms: dict[tuple[int, int], float]) -> list[str]:
    said = [f"{node}, {component + 1}, {_number(value)}" for (node, component), value in terms.items()]
    return ["*EQUATION", str(len(said)), *continued(said, 4)]


def _before_steps(deck: Deck, place: Path, step: int) -> list[str]:
    """Lines of the deck before its first step."""
    if len(deck.instances) > 1:
        raise InvalidArgumentError(f"{deck.path} has instances, which CalculiX does not know; expected a deck without")
    changed = next((own for own in deck.steps[:step] if own.friction), None)
    if changed is not None:
        raise changed.place.refused("the step changes friction; expected one coefficient in all steps")
    text = deck.path.read_text(encoding="latin-1").splitlines()
    ends = [k for k, line in enumerate(text) if line.upper().replace(" ", "").split(",")[0] == "*STEP"]
    includes = any(line.upper().lstrip().startswith("*INCLUDE") for line in text)
    if not ends or (includes and place.resolve().parent != deck.path.resolve().parent):
        raise InvalidArgumentError(
            f"{deck.path} includes {'its steps' if not ends else 'files, which are found from its folder only'}; "
            f"expected {'steps in the deck itself' if not ends else 'a start in this folder'}"
        )
    return text[: ends[0]]


def _supports(deck: Deck, state: DeckState) -> list[str]:
    return [
        f"{deck.node_labels[int(node)]}, {component}, {component}, {_number(value)}"
        for (node, component), value in state.of("BOUNDARY").items()
    ]


def _loads(deck: Deck, state: DeckState) -> list[str]:
    """Cards of the loads and temperatures at the end of the step."""
    nodes, elements = deck.node_labels, deck.element_labels
    forces, pressures, gravity, warm = map(state.of, ("CLOAD", "DLOAD", "GRAV", "TEMPERATURE"))
    cards = {
        "*CLOAD": [f"{nodes[int(node)]}, {component}, {_number(own)}" for (node, component), own in forces.items()],
        "*DLOAD": [
            *(f"{elements[int(row)]}, {label}, {_number(own)}" for (row, label), own in pressures.items()),
            *(f"{of}, GRAV, {_number(own)}, {str(along).replace(' ', ', ')}" for (of, along), own in gravity.items()),
        ],
        "*TEMPERATURE": [f"{nodes[int(node)]}, {_number(own)}" for (node, _), own in warm.items()],
    }
    return [line for card, data in cards.items() if data for line in (card, *data)]
