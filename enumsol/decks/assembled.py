"""Stiffness matrices that CalculiX, Abaqus and Ansys assembled, with the node and direction of every row."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError
from enumsol.support.arguments import file_path
from enumsol.support.array_types import Floats
from enumsol.support.files import reading
from enumsol.support.messages import listed

if TYPE_CHECKING:
    import os

    Name = tuple[int, int]

#: Directions of displacements as Ansys labels them.
_LABELS = {"UX": 1, "UY": 2, "UZ": 3}
#: An axisymmetric body is a slice of two degrees to CalculiX: so many make the whole.
SLICES = 180.0


@dataclass(frozen=True, eq=False)
class AssembledStiffness:
    """Stiffness matrix of the free degrees of freedom of a model in another code.

    Attributes
    ----------
    A : (n, n) csc_array
        [force / length]
    names : tuple of n (int, int)
        The node and the direction (1, 2, 3) of every row.
    """

    A: sp.csc_array
    names: tuple[Name, ...]

    @cached_property
    def places(self) -> dict[Name, int]:
        """Row of every (node, direction)."""
        return {name: row for row, name in enumerate(self.names)}

    def displacements(self, nodes: Sequence[int], axes: Any) -> sp.csr_array:
        """Rows that give the displacements of nodes along an axis each, (k, n): Bn, Bt or Bt1 and Bt2.

        Parameters
        ----------
        nodes : sequence of k int
        axes : (d,) or (k, d) array_like
            The direction of all nodes, or of each.

        Raises
        ------
        InvalidArgumentError
            A node has no row in a direction in which its axis has a component, as if it were held.
        """
        along = np.broadcast_to(np.asarray(axes, dtype=np.float64), (len(nodes), np.shape(axes)[-1]))
        entries = [
            (row, self._place(int(node), direction + 1), float(value))
            for row, node in enumerate(nodes)
            for direction, value in enumerate(along[row])
            if value != 0
        ]
        rows, columns, values = zip(*entries, strict=True) if entries else ((), (), ())
        return sp.csr_array((values, (rows, columns)), shape=(len(nodes), len(self.names)), dtype=np.float64)

    def forces(self, given: Iterable[tuple[int, int, float]]) -> Floats:
        """Load f (n,) of nodal forces (node, direction, force); those on held degrees of freedom do nothing [force]."""
        f = np.zeros(len(self.names))
        for node, direction, force in given:
            row = self.places.get((int(node), int(direction)))
            if row is not None:
                f[row] += force
        return f

    def _place(self, node: int, direction: int) -> int:
        row = self.places.get((node, direction))
        if row is None:
            raise InvalidArgumentError(
                f"node {node} has no free displacement in direction {direction}; expected nodes "
                "of the model that are not held"
            )
        return row


def read_calculix_stiffness(job: str | os.PathLike[str], *, plane: bool = False) -> AssembledStiffness:
    r"""Matrix that a step ``*FREQUENCY, SOLVER=MATRIXSTORAGE`` of CalculiX has written.

    Parameters
    ----------
    job : str or path-like
        Name of the job, without an ending: ``job.sti`` has a line "row column value" for each entry of one triangle,
        ``job.dof`` the node and the direction of each row, such as 12.3.
    plane : bool
        The model is plane: what moves in direction 3 belongs to the thickness of elements, to which CalculiX may give
        one name twice, and gets the nodes -1, -2, ...

    Raises
    ------
    InvalidArgumentError
        A file cannot be read, or is not of that form.

    Examples
    --------
    >>> import enumsol.io, pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = pathlib.Path(folder, "bar.sti").write_text("1 1 2.0\n1 2 -1.0\n2 2 1.0\n")
    ...     _ = pathlib.Path(folder, "bar.dof").write_text("1.1\n2.1\n")
    ...     bar = enumsol.io.read_calculix_stiffness(f"{folder}/bar")
    >>> bar.A.toarray().tolist(), bar.names
    ([[2.0, -1.0], [-1.0, 1.0]], ((1, 1), (2, 1)))
    """
    place = file_path(job, "job", "the name of a job of CalculiX")
    with reading(place.with_name(f"{place.name}.sti"), "a stiffness matrix", "CalculiX"):
        table = np.loadtxt(place.with_name(f"{place.name}.sti"), ndmin=2)
        rows, columns, values = table[:, 0].astype(np.int64) - 1, table[:, 1].astype(np.int64) - 1, table[:, 2]
    with reading(place.with_name(f"{place.name}.dof"), "degrees of freedom", "CalculiX"):
        names = [_name(*line.split(".")) for line in place.with_name(f"{place.name}.dof").read_text().split()]
    if plane:
        names = [(node, axis) if axis < 3 else (-1 - row, axis) for row, (node, axis) in enumerate(names)]
    return _stiffness(place, rows, columns, values, names)


def read_abaqus_stiffness(file: str | os.PathLike[str], held: Iterable[int] = ()) -> AssembledStiffness:
    r"""Matrix that ``*MATRIX OUTPUT, STIFFNESS, FORMAT=MATRIX INPUT`` of Abaqus has written.

    Parameters
    ----------
    file : str or path-like
        Such as ``job_STIF1.mtx``; a line is "node, direction, node, direction, value", of one triangle.
    held : iterable of int
        Nodes that the model holds, whose rows are dropped. They may be in the file with a large number on the diagonal.

    Raises
    ------
    InvalidArgumentError
        The file cannot be read, or is not of that form.

    Examples
    --------
    >>> import enumsol.io, pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = pathlib.Path(folder, "bar_STIF1.mtx").write_text("1,1,1,1,1e36\n2,1,1,1,-1.\n2,1,2,1,1.\n")
    ...     bar = enumsol.io.read_abaqus_stiffness(f"{folder}/bar_STIF1.mtx", held=[1])
    >>> bar.A.toarray().tolist(), bar.names
    ([[1.0]], ((2, 1),))
    """
    place = file_path(file, "file", "a matrix of Abaqus")
    with reading(place, "a stiffness matrix", "Abaqus"):
        table = np.loadtxt(place, delimiter=",", comments="*", ndmin=2)
        ends = [[_name(*pair) for pair in table[:, k : k + 2].astype(np.int64).tolist()] for k in (0, 2)]
        values = table[:, 4]
    names = sorted({*ends[0], *ends[1]})
    number = {name: k for k, name in enumerate(names)}
    rows, columns = (np.array([number[name] for name in end]) for end in ends)
    return _stiffness(place, rows, columns, values, names, held)


def read_ansys_stiffness(matrix: str | os.PathLike[str], mapping: str | os.PathLike[str]) -> AssembledStiffness:
    r"""Matrix that ``*EXPORT,K,MMF`` of Ansys has written, with the mapping of ``HBMAT``.

    Parameters
    ----------
    matrix : str or path-like
        In MatrixMarket format.
    mapping : str or path-like
        Its lines have the number of an equation, its node and the label of the direction.

    Raises
    ------
    InvalidArgumentError
        A file cannot be read, or is not of that form.

    Examples
    --------
    >>> import enumsol.io, pathlib, scipy.io, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     scipy.io.mmwrite(f"{folder}/bar.mtx", [[2.0, -1.0], [-1.0, 1.0]])
    ...     _ = pathlib.Path(folder, "bar.mapping").write_text("Matrix  Node  Dof\n 1 7 UX\n 2 8 UX\n")
    ...     bar = enumsol.io.read_ansys_stiffness(f"{folder}/bar.mtx", f"{folder}/bar.mapping")
    >>> bar.A.toarray().tolist(), bar.names
    ([[2.0, -1.0], [-1.0, 1.0]], ((7, 1), (8, 1)))
    """
    from scipy.io import mmread  # seldom needed

    place, names_file = file_path(matrix, "matrix", "a MatrixMarket file"), file_path(mapping, "mapping")
    with reading(place, "a stiffness matrix", "Ansys"):
        K = sp.coo_array(mmread(place))
    with reading(names_file, "a mapping of degrees of freedom", "Ansys"):
        lines = [line.split() for line in names_file.read_text().splitlines()]
        names = [_name(words[1], _LABELS[words[2]]) for words in lines if len(words) == 3 and words[2] in _LABELS]
    return _stiffness(place, K.row, K.col, K.data, names)


def _name(node: str | int, direction: str | int) -> Name:
    return int(node), int(direction)


def _stiffness(
    place: Path, rows: Any, columns: Any, values: Floats, names: list[Name], held: Iterable[int] = ()
) -> AssembledStiffness:
    """Matrix of entries of one triangle or of both, without the rows of held nodes."""
    n, out = len(names), set(held)
    repeated = {name for name, times in Counter(names).items() if times > 1}
    largest = max(int(np.max(rows, initial=-1)), int(np.max(columns, initial=-1)))
    if largest >= n or repeated:
        what = f"{listed(sorted(repeated))} twice" if repeated else f"{n} rows by name"
        raise InvalidArgumentError(f"{place} has {largest + 1} rows and {what}; expected one name for each row")
    A = sp.csc_array((values, (rows, columns)), shape=(n, n))
    if sp.triu(A, 1).nnz == 0 or sp.tril(A, -1).nnz == 0:
        A = A + A.T - sp.diags_array(A.diagonal())
    free = [k for k, (node, _) in enumerate(names) if node not in out]
    return AssembledStiffness(sp.csc_array(sp.csc_array(A)[free][:, free]), tuple(names[k] for k in free))
