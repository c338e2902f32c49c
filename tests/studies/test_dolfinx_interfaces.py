"""``by_dolfinx.py`` against stand-ins for dolfinx 0.5, 0.9 and 0.10 that know only what each of these versions offers.

They assemble nothing: of matrix and load they return given numbers, in an order of nodes that is not that of the mesh.
"""

import runpy
import sys
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest
import scipy.sparse as sp

SCRIPT = Path(__file__).parents[2] / "studies" / "same_body_by_other_codes" / "by_dolfinx.py"
POINTS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
ORDER = [2, 0, 3, 1]  # nodes of the mesh in the order of dolfinx
ELEMENT, STIFFNESS, LOAD = "the element of displacements", np.arange(64.0).reshape(8, 8), np.arange(8.0)


def made(comm, cells, x, element):
    assert cells.dtype == np.int64
    assert np.array_equal(x, POINTS)
    assert element == ("mesh", ELEMENT)
    return "domain"


def create_in_0_5(comm, cells, x, domain, partitioner=None):
    return made(comm, cells, x, domain)


def create_in_0_9(comm, cells, x, e, partitioner=None):
    return made(comm, cells, x, e)


def create_in_0_10(comm, cells, e, x, partitioner=None):
    return made(comm, cells, x, e)


def space(mesh, element):
    assert (mesh, element) == ("domain", ELEMENT)
    places = np.column_stack([POINTS[ORDER], np.zeros(4)])
    return SimpleNamespace(tabulate_dof_coordinates=lambda: places)


def no_blocks(form):
    raise RuntimeError("Block size not yet supported")  # as dolfinx 0.5 says


def no_class(mesh, element):
    raise TypeError("the class is not made of a mesh and an element")


def modules(version):
    """The modules that the script imports."""
    old = version == "0.5"
    parts = sp.csr_array(STIFFNESS)
    petsc = SimpleNamespace(assemble=lambda: None, getValuesCSR=lambda: (parts.indptr, parts.indices, parts.data))
    native = SimpleNamespace(to_scipy=lambda: sp.bsr_array(STIFFNESS, blocksize=(2, 2)))
    create = {"0.5": create_in_0_5, "0.9": create_in_0_9, "0.10": create_in_0_10}[version]
    fem = SimpleNamespace(
        FunctionSpace=space if old else no_class,
        form=lambda form: form,
        Constant=MagicMock(),
        assemble_vector=lambda form: SimpleNamespace(array=LOAD),
        assemble_matrix=no_blocks if old else lambda form: native,
        **({} if old else {"functionspace": space}),
    )
    mesh = SimpleNamespace(
        create_mesh=create, locate_entities_boundary=lambda *_: np.array([1, 0]), meshtags=lambda *_: "tags"
    )
    names = ("Measure", "TrialFunction", "TestFunction", "sym", "grad", "tr", "Identity", "inner", "dx", "triangle")
    ufl = SimpleNamespace(Mesh=lambda element: ("mesh", element), **{name: MagicMock() for name in names})
    basix = SimpleNamespace(ufl=SimpleNamespace(element=lambda *_, shape: ELEMENT))
    if old:
        ufl.VectorElement = lambda *_: ELEMENT
    return {
        "ufl": ufl,
        "dolfinx": SimpleNamespace(fem=fem, mesh=mesh),
        "dolfinx.fem": fem,
        "dolfinx.fem.petsc": SimpleNamespace(assemble_matrix=lambda form: petsc) if old else None,
        "basix": None if old else basix,
        "basix.ufl": None if old else basix.ufl,
        "mpi4py": SimpleNamespace(MPI=MagicMock()),
    }


@pytest.mark.parametrize("version", ["0.5", "0.9", "0.10"])
def test_the_script_asks_only_for_what_the_version_has(tmp_path, monkeypatch, version):
    given = {"points": POINTS, "triangles": np.array([[0, 1, 2], [1, 3, 2]], dtype=np.int32), "lame": [1.0, 1.0]}
    given |= {"contact": [0, 1], "normals": [[0.6, -0.8], [0.0, -1.0]], "spring": 0.1, "traction": [0, 1], "gap": -0.1}
    np.savez(tmp_path / "mesh.npz", **given)
    for name, module in modules(version).items():
        monkeypatch.setitem(sys.modules, name, module)  # None: it cannot be imported
    monkeypatch.setattr(sys, "argv", [str(SCRIPT), str(tmp_path / "mesh.npz"), str(tmp_path / "problem.npz")])
    runpy.run_path(str(SCRIPT))
    with np.load(tmp_path / "problem.npz") as problem:
        A = sp.csr_array((problem["A_data"], problem["A_indices"], problem["A_indptr"]), shape=problem["A_shape"])
        assert str(problem["A_format"]) == "csr"
        assert np.array_equal(A.toarray(), STIFFNESS)
        assert np.array_equal(problem["f"], LOAD)
        # the nodes 0 and 1 of the mesh are the second and the fourth of dolfinx
        assert np.array_equal(problem["Bn"], [[0, 0, 0.6, -0.8, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0, 0.0, -1.0]])
        assert np.array_equal(problem["Bt"], [[0, 0, 0.8, 0.6, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0, 1.0, 0.0]])
