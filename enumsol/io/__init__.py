"""Contact problems in files: NumPy archives, MatrixMarket directories, fclib HDF5 files; results in VTU for ParaView.

The first three hold the arrays of `ContactProblem` or of `ContactProblem3D` by name. `read_problem` and
`write_problem` choose the format by the path.

``.npz``
    A NumPy archive. ``A``, ``Bn``, ``Bt`` as dense matrices or in sparse parts, and the vector ``f``::

        np.savez("block.npz", A=A, Bn=Bn, Bt=Bt, f=f, gap=gap, friction0=0.3)

    The sparse parts of a matrix are those of `scipy.sparse`: for A (csc or csr) ``A_data``, ``A_indices``,
    ``A_indptr``, ``A_shape`` and ``A_format`` ("csc" or "csr"), and likewise for Bn and Bt.
    Optional are

    - ``friction``: one number, a constant coefficient; or ``friction0`` and ``friction1``: F = friction0 + alpha
      friction1, each a number or a (p,) array, 0 when left out. With none of them F = alpha, as in `ContactProblem`.
    - ``gap``, ``load_slope``, ``slip_offset``, ``coordinates``: as in `ContactProblem`.
    - ``rigid_modes`` (n, r) and ``max_rigid_displacement``, one number: of a body that nothing holds.
    - ``node_ids``: (p,) integers, floats or strings.
    - ``mesh_points`` (N, d), ``mesh_cells`` (M, k) and either ``mesh_motion`` (d N, n; dense or in sparse parts) or
      ``mesh_dofs`` (n,): a `BodyMesh`, or the arguments of ``BodyMesh.of_dofs``, all or none; with it ``mesh_offset``
      (N, d), ``mesh_lame`` (M, 2) or ``mesh_elasticity`` (M, s s), ``mesh_stress`` and ``mesh_stress_slope`` (M, s),
      and in 3D ``mesh_facets`` (k, m) and ``mesh_rows`` (k,).
    - ``enumsol_format``: version of this layout, now 1; taken as 1 when left out.

    Names that begin with an underscore are ignored; any other name is refused, since it may be a misspelt one.
directory
    One MatrixMarket file a name: ``A.mtx``, ``Bn.mtx``, ``Bt.mtx``, ``f.mtx`` and optionally ``gap.mtx``,
    ``friction0.mtx`` and so on, with the names above. Vectors are matrices with one column (or one row), one entry
    stands for all nodes. Labels are in ``node_ids.json``, a list. Files of other kinds are ignored.

In 3D both take ``Bt1`` and ``Bt2`` instead of ``Bt``, which tell a problem in 3D from one in 2D, and optionally

- ``friction``: one number; or ``friction_1`` and ``friction_2``: F1 and F2, each a number or a (p,) array; or
  ``friction_table_slip`` (k,), ``friction_table_1`` and ``friction_table_2``, (k,) or (p, k): a `FrictionTable`. With
  none of them F = 0.5, as in `ContactProblem3D`. A friction given by a callable cannot be written.
- ``friction_slope_1``, ``friction_slope_2``: derivatives with respect to alpha, 0 when left out.
- ``gap``, ``load_slope``, ``slip_offset`` (p, 2), ``coordinates`` (p, 3), ``areas`` (p,), ``node_ids``.
- ``slip_mean_T1``, ``slip_mean_T2``, ``slip_mean_offset``, ``slip_mean_weights``: a `SlipMean`, all or none; like the
  other matrices dense or in sparse parts.

``.h5``, ``.hdf5``
    The format of the Frictional Contact Library (`enumsol.io.array_files`); needs h5py.

``.vtu``
    Displacements, contact forces and stresses of solutions in 2D and 3D, for ParaView: `enumsol.write_vtu`, by meshio.

``.frd``
    The same for CGX, `enumsol.write_frd`; and displacements that CalculiX computed: `enumsol.read_results`.

NumPy archives and MatrixMarket directories give every number back bit by bit. Pickled objects are never loaded.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from enumsol.decks.assembled import (
    AssembledStiffness,
    read_abaqus_stiffness,
    read_ansys_stiffness,
    read_calculix_stiffness,
)
from enumsol.errors import InvalidArgumentError, InvalidProblemError
from enumsol.io import array_files
from enumsol.model.problem import check_is_problem
from enumsol.support.arguments import file_path
from enumsol.support.files import writing
from enumsol.support.messages import about

if TYPE_CHECKING:
    import os
    from pathlib import Path

    from enumsol.model.problem3d import AnyProblem

__all__ = [
    "AssembledStiffness",
    "read_abaqus_stiffness",
    "read_ansys_stiffness",
    "read_calculix_stiffness",
    "read_problem",
    "write_problem",
]

_A_PLACE = "the name of a file or directory"
#: Endings of the files that hold a problem.
SUFFIXES = (".npz", *array_files.FCLIB)
_FORMATS = "a .npz file, a directory of MatrixMarket files, or an fclib file (.h5, .hdf5)"
_READABLE = f"{_FORMATS} (enumsol.fem makes problems of meshes and .toml files)"


def read_problem(path: str | os.PathLike[str]) -> AnyProblem:
    """Contact problem in 2D or 3D from a file or directory; `enumsol.io` describes the formats.

    Parameters
    ----------
    path : str or path-like
        A .npz file, a directory of MatrixMarket files, or an fclib file (.h5, .hdf5).

    Raises
    ------
    InvalidProblemError
        The file does not exist, is no problem file, is damaged, lacks an array or holds one that is not known (the
        closest name is given), or its data are no contact problem. The message begins with the path.
    MissingDependencyError
        An fclib file, and h5py is not installed.

    Examples
    --------
    >>> import enumsol, tempfile
    >>> problem = enumsol.gallery.one_node_triangle()
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     enumsol.write_problem(problem, f"{folder}/triangle.npz")
    ...     enumsol.read_problem(f"{folder}/triangle.npz").fingerprint == problem.fingerprint
    True
    """
    place = file_path(path, "path", _A_PLACE)
    try:
        with about(place, InvalidProblemError):
            return _read(place)
    except OSError as error:
        reason = error.strerror or error
        raise InvalidProblemError(f"{place}: it cannot be read ({reason}); expected a readable place") from error


def write_problem(problem: AnyProblem, path: str | os.PathLike[str]) -> None:
    """Write a contact problem to a file or directory; `enumsol.io` describes the formats.

    An existing file is replaced. In an existing directory the MatrixMarket files of an earlier problem are replaced.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    path : str or path-like
        Ends in .npz, .h5 or .hdf5, or is a directory (made if its name has no suffix).

    Raises
    ------
    InvalidArgumentError
        There can be no such file, or its suffix is not known.
    OutputError
        There is no room for it.
    InvalidProblemError
        The format cannot hold the problem: mixed node labels; friction given by a callable; friction or load that
        depend on alpha, or orthotropic friction (fclib).
    MissingDependencyError
        An fclib file, and h5py is not installed.

    Examples
    --------
    >>> import enumsol, pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:  # MatrixMarket files
    ...     enumsol.write_problem(enumsol.gallery.one_node_triangle(), folder)
    ...     sorted(file.name for file in pathlib.Path(folder).glob("*.mtx"))
    ['A.mtx', 'Bn.mtx', ..., 'slip_offset.mtx']
    """
    given: Any = problem
    check_is_problem(given)
    place = file_path(path, "path", _A_PLACE)
    with writing(place, "path"), about(place, InvalidProblemError):
        _write(problem, place)


def _read(place: Path) -> AnyProblem:
    if place.is_dir():
        return array_files.read_directory(place)
    if not place.exists():
        raise InvalidProblemError(f"there is no such file or directory; expected {_READABLE}")
    if not place.is_file():
        raise InvalidProblemError(f"it is not a regular file; expected {_READABLE}")
    if place.suffix == ".npz":
        return array_files.read_archive(place)
    if place.suffix in array_files.FCLIB:
        return array_files.read_fclib(place)
    if place.suffix == ".mtx":
        raise InvalidProblemError(
            "one MatrixMarket file is not a problem; expected a directory with A.mtx, Bn.mtx and so on"
        )
    found = f"its name ends in {place.suffix!r}" if place.suffix else "its name has no suffix"
    raise InvalidProblemError(f"{found}; expected {_READABLE}")


def _write(problem: AnyProblem, place: Path) -> None:
    if place.is_dir() or not place.suffix:
        array_files.write_directory(problem, place)
    elif place.suffix == ".npz":
        array_files.write_archive(problem, place)
    elif place.suffix in array_files.FCLIB:
        array_files.write_fclib(problem, place)
    else:
        raise InvalidArgumentError(f"{place}: its name ends in {place.suffix!r}; expected {_FORMATS}")
