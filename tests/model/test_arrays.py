"""Matrices and arrays are accepted as the numbers that they are, or refused in one sentence."""

import array
import math
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pandas as pd
import pytest
import scipy.sparse as sp
from hypothesis import given, settings, strategies as st
from plain_arrays import BN, BT, DENSE, A, F, problem
from refusals import bad_argument, bad_problem

from enumsol import EnumsolError, fem, gallery, read_problem
from enumsol.support.array_arguments import real_array, real_matrix

FORMATS = ("csr", "csc", "coo", "bsr", "lil", "dok", "dia")
KINDS = [getattr(sp, f"{name}_{kind}") for name in FORMATS for kind in ("array", "matrix")]
LARGE = 2**53 + 1


def refused(pattern, **changes):
    message = str(bad_problem(pattern, problem, **changes))
    assert "expected" in message
    assert next(iter(changes)) in message


# -- sparse matrices -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_every_sparse_format_gives_the_same_problem(kind):
    dense = problem()
    assert problem(A=kind(A)).fingerprint == dense.fingerprint
    assert problem(Bn=kind(BN), Bt=kind(BT)).fingerprint == dense.fingerprint


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("dtype", [np.int8, np.int64, np.uint16, np.float32, bool])
def test_sparse_matrices_of_any_real_type(kind, dtype):
    rows = problem(Bn=kind(BN.astype(dtype)), Bt=kind(BT.astype(dtype)))
    assert rows.fingerprint == problem().fingerprint


@pytest.mark.parametrize("kind", KINDS)
def test_sparse_matrices_that_are_refused(kind):
    refused("A has complex entries", A=kind(A.astype(complex)))
    with np.errstate(invalid="ignore"):
        refused(r"A has the value nan at index \(1, 1\)", A=kind(np.where(np.eye(4) * [0, 1, 0, 0], np.nan, A)))
    refused(r"A has the value \d+ at index \(3, 3\), which float64 would round", A=kind(np.diag([1, 1, 1, LARGE])))


def test_integers_at_one_place_add_up_exactly():
    def placed(*values, dtype=None):
        return sp.coo_array((np.array(values, dtype=dtype), ([0, 0, 1, 2, 3], [0, 0, 1, 2, 3])))

    assert problem(A=placed(100, 100, 1, 1, 1, dtype=np.int8)).A[0, 0] == 200
    refused(r"A has integers at index \(0, 0\) that add up to 2\^53 or more", A=placed(2**53, 1, 1, 1, 1))
    assert problem(A=placed(1, 1, 2**60, 1, 1)).A[1, 1] == 2.0**60
    assert problem(A=placed(*[True] * 5)).A[0, 0] == 1  # as scipy has it


def test_damaged_sparse_matrices_are_refused():
    """scipy would read memory that is not the matrix's."""
    for damage in (
        {"indices": np.array([0, 99, 2, 3], dtype=np.int32)},
        {"indices": np.array([0, -7, 2, 3], dtype=np.int32)},
        {"indptr": np.array([0, 3, 1, 3, 4], dtype=np.int32)},
        {"data": np.ones(2)},
    ):
        matrix = sp.csc_array(np.eye(4))
        for name, part in damage.items():
            setattr(matrix, name, part)
        refused("A is a damaged sparse csc_array", A=matrix)
    coo = sp.coo_array(np.eye(4))
    coo.coords[0][0] = 77
    refused("A is a damaged sparse coo_array", A=coo)


def test_a_sparse_matrix_is_no_vector():
    refused(r"f is not an array of real numbers \(found a sparse csc_array\)", f=sp.csc_array(F[:, None]))
    refused(r"A has 1 dimension\(s\), shape \(4,\); expected a matrix", A=sp.coo_array(F))


# -- numbers that float64 cannot hold --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "value",
    [
        [1, 2, 3, LARGE],
        np.array([1, 2, 3, LARGE]),
        np.array([1, 2, 3, 2**64 - 1], dtype=np.uint64),
        [1.5, 2, 3, LARGE],  # numpy makes floats of all of them
        [np.float64(1.5), 2, 3, np.int64(LARGE)],
        [1, 2, 3, 10**30 + 1],
        [1, 2, 3, 10**400],
        [1, 2, 3, Fraction(1, 3)],
        [1, 2, 3, Decimal("0.1")],
        [1, 2, 3, Decimal("1e4000000")],
        np.array([1, 2, 3, LARGE], dtype=object),
        pd.Series([1, 2, 3, LARGE]),
        pd.Series([1, 2, 3, LARGE], dtype="Int64"),
    ],
)
def test_numbers_that_float64_would_round_are_refused(value):
    refused(r"f has the value .* at index \(3,\), which float64 would round; expected float64 values", f=value)


@pytest.mark.skipif(np.finfo(np.longdouble).nmant < 60, reason="longdouble is float64 here")
def test_digits_of_a_longdouble_are_not_lost():
    third = np.longdouble(1) / 3
    refused(r"f has the value 0\.333.* at index \(1,\), which float64 would round", f=[1, third, 0, 0])
    refused(r"A has the value .* at index \(0, 0\)", A=sp.csc_array(np.diag([third, 1, 1, 1])))
    refused(r"gap has the value", gap=third)
    assert problem(f=F.astype(np.longdouble)).fingerprint == problem().fingerprint
    refused(r"f has the value 1e\+4000 at index \(0,\)", f=np.array(["1e4000", 0, 0, 0], dtype=np.longdouble))


def test_numbers_that_float64_holds_are_taken():
    exact = [2**53 + 2, Fraction(1, 4), Decimal("0.5"), -(2**70)]
    assert problem(f=exact).f.tolist() == [float(x) for x in exact]
    assert problem(f=np.array([2**62, 1, 2, 3])).f[0] == 2.0**62
    assert problem(gap=Fraction(1, 8), friction=Decimal("0.25")).friction.tolist() == [0.25, 0.25]
    refused("friction has the value 1/3, which float64 would round", friction=Fraction(1, 3))
    message = "gap is 1/3, which float64 would round; expected a finite number"
    bad_argument(message, gallery.clamped_block, 1, 1, gap=Fraction(1, 3))


def test_files_are_read_as_exactly(tmp_path):
    for name, bad in (("f", np.array([1, 2, 3, LARGE])), ("gap", np.array("1")), ("f", F.astype(np.longdouble) / 3)):
        np.savez(tmp_path / "p.npz", **(DENSE | {name: bad}))
        bad_problem(rf"p\.npz: {name} (has the value|is not an array of real)", read_problem, tmp_path / "p.npz")


# -- other arrays ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "value",
    [
        F.tolist(),
        tuple(F),
        F.astype(np.float32),
        F.astype(object),
        np.ma.array(F),
        pd.Series(F),
        pd.Series(F, dtype="Float64"),
        array.array("d", F),
        np.asfortranarray(F),
        np.broadcast_to(F, (1, 4))[0],
    ],
)
def test_vectors_of_any_kind_are_read(value):
    assert problem(f=value).fingerprint == problem().fingerprint


@pytest.mark.filterwarnings("ignore:the matrix subclass:PendingDeprecationWarning")
@pytest.mark.parametrize(
    "make",
    [
        np.asmatrix,
        pd.DataFrame,
        np.ma.array,
        lambda x: x.tolist(),
        lambda x: x.astype(object),
        lambda x: pd.DataFrame(x).astype(pd.SparseDtype(float, 0.0)),
        lambda x: [np.array(row) for row in x],
    ],
)
def test_matrices_of_any_kind_are_read(make):
    assert problem(A=make(A), Bn=make(BN), Bt=make(BT)).fingerprint == problem().fingerprint


def test_arrays_of_bool_are_zeros_and_ones():
    assert problem(Bn=BN.astype(bool), Bt=BT.astype(bool)).fingerprint == problem().fingerprint
    refused("gap is True; expected a number", gap=True)
    refused("friction is True; expected a number", friction=True)


MASKED = np.ma.array(F, mask=[False, False, True, False])
NOT_NUMBERS = {
    "complex with nothing imaginary": (F.astype(complex), "complex numbers"),
    "texts": (["1", "2", "3", "4"], "text"),
    "bytes": (b"1234", "bytes"),
    "None inside": ([1.0, None, 2.0, 3.0], r"None at index \(1,\)"),
    "text inside": (np.array([1.0, "x", 2.0, 3.0], dtype=object), r"'x' at index \(1,\)"),
    "masked": (MASKED, "masked values"),
    "masked inside": ([1.0, np.ma.masked, 2.0, 3.0], "masked values"),
    "dates": (np.array(["2020-01-01"] * 4, dtype="datetime64[D]"), "dates"),
    "records": (np.zeros(4, dtype=[("a", float)]), "type .*"),
    "ragged": ([[1.0, 2.0], [3.0]], "rows of different lengths or depths"),
    "deep": ([1.0, [2.0], 3.0, 4.0], "rows of different lengths or depths"),
    "ragged objects": (np.array([[1.0, 2.0], [3.0]], dtype=object), "rows of different lengths or depths"),
    "None": ("None", "text"),
    "generator": ((x for x in F), "generator"),
    "dict": ({0: 1.0}, "dict"),
    "set": ({1.0, 2.0}, "set"),
    "object": (object(), "object"),
}


@pytest.mark.parametrize("case", NOT_NUMBERS)
def test_what_are_no_numbers_gets_one_sentence(case):
    value, found = NOT_NUMBERS[case]
    refused(rf"f is not an array of real numbers \(found {found}\); expected float64 values", f=value)


def test_missing_values_of_pandas_are_refused():
    # given to numpy as objects or as nan, by the version of pandas
    refused(r"f (has the value nan|is not an array of real)", f=pd.Series([1, None, 2, 3], dtype="Int64"))
    refused(r"f (has the value nan|is not an array of real)", f=pd.Series([1, None, 2, 3]))


def test_masked_rows_of_a_list_are_seen():
    rows = [np.ma.array(row, mask=[True, False, False, False]) for row in A]
    refused("A is not an array of real numbers .found masked values.", A=rows)
    assert problem(A=np.ma.array(A, mask=False)).fingerprint == problem().fingerprint


def test_frames_with_integers_and_floats_are_not_rounded():
    frame = pd.DataFrame({0: [LARGE, 0], 1: [0.5, 1.0]})
    bad_problem(r"A has the value 9007199254740993 at index \(0, 0\)", real_matrix, frame, "A")


@pytest.mark.parametrize("value", ["0.5", b"0.5", 1j, np.array("0.5"), np.str_("0.5"), np.datetime64("2020-01-01")])
def test_friction_is_no_text_and_no_complex_number(value):
    refused(r"friction is not an array of real numbers", friction=value)
    refused(r"friction_slope is not an array of real numbers", friction=0.5, friction_slope=value)


@pytest.mark.parametrize("value", [(), (1.0,), [1.0, 2.0, 3.0], np.ones((2, 2))])
def test_friction_of_another_length_is_refused(value):
    shape = str(np.shape(value)).replace("(", r"\(").replace(")", r"\)")
    refused(rf"friction has shape {shape}; expected \(2,\) or a single number", friction=value)


@pytest.mark.parametrize("value", [np.array(0.5), np.float32(0.5), np.float16(0.5), np.array(1, dtype=object), 1])
def test_friction_may_be_a_number_of_any_type(value):
    assert problem(friction=value).friction.tolist() == [float(value)] * 2


def test_gap_is_no_text():
    refused(r"gap is not an array of real numbers \(found text\)", gap="1")
    refused(r"slip_offset is not an array of real numbers \(found text\)", slip_offset=["0", "0"])


@pytest.mark.parametrize("value", ["ab", b"ab", {"a", "b"}, {"a": 1, "b": 2}, 7, [[1], [2]], object()])
def test_node_ids_are_a_sequence_of_labels(value):
    refused("node_ids is .*; expected a sequence of 2 distinct labels", node_ids=value)


@pytest.mark.parametrize(
    ("value", "count", "distinct"), [([], 0, 0), (["a"], 1, 1), (["a", "b", "c"], 3, 3), ([1, 1.0], 2, 1)]
)
def test_node_ids_of_another_number(value, count, distinct):
    refused(f"node_ids has {count} entries, {distinct} distinct; expected 2 distinct labels", node_ids=value)


@pytest.mark.parametrize("shape", [(2,), (4, 2), (2, 3), (0, 2), (2, 2, 1)])
def test_coordinates_of_another_shape(shape):
    refused(r"coordinates has shape .*; expected \(p, 2\) = \(2, 2\)", coordinates=np.zeros(shape))


def test_coordinates_are_finite():
    refused(r"coordinates has the value inf at index \(1, 0\)", coordinates=[[0, 0], [math.inf, 0]])


# -- meshes ----------------------------------------------------------------------------------------------------------

POINTS, TRIANGLES = [[0, 0], [1, 0], [0, 1]], [[0, 1, 2]]
MESH = {
    "points ragged": ({"points": [[0, 0], [1]]}, "points is not an array of real numbers"),
    "points masked": ({"points": np.ma.array(POINTS, mask=True)}, "points is not an array of real numbers"),
    "points huge": ({"points": np.array(POINTS) * 1e200}, r"points has the coordinate 1e\+200, whose square overflows"),
    "points rounded": ({"points": [[0, 0], [LARGE, 0], [0, 1]]}, "points has the value 9007199254740993 at index"),
    "cells ragged": ({"cells": [[0, 1, 2], [0]]}, "cells is not an array of real numbers"),
    "cells floats": ({"cells": [[0.0, 1.0, 2.0]]}, "cells has .* type float64; expected at least one node"),
    "cells masked": ({"cells": np.ma.array(TRIANGLES, mask=True)}, "cells is not an array"),
    "cells huge": ({"cells": [[2**64 - 1] * 3]}, "cells has node numbers from 18446744073709551615"),
    "lame texts": ({"lame": ("1", "1")}, r"lame is \('1', '1'\); expected two finite numbers"),
    "lame complex": ({"lame": (1, 1 + 0j)}, r"lame is \(1, .*; expected two finite numbers"),
}


@pytest.mark.parametrize("case", MESH)
def test_meshes_are_checked_alike(case):
    changes, pattern = MESH[case]
    bad_argument(pattern, fem.stiffness, **({"points": POINTS, "cells": TRIANGLES, "lame": (1, 1)} | changes))


@pytest.mark.parametrize(
    ("build", "pattern"),
    [
        (lambda: gallery.chain(10**5000), "p is <integer of 16610 bits>; expected an integer of at most 1000000"),
        (lambda: gallery.clamped_block(2**53 + 1, 1), "nx is 9007199254740993; expected an integer of at most 10000"),
        (lambda: gallery.clamped_block("2", 1), "nx is '2'; expected an integer of at least 1"),
        (lambda: gallery.clamped_block(2, True), "ny is True; expected an integer of at least 1"),
        (lambda: gallery.clamped_block(2, 2, length="1"), "length is '1'; expected a finite number > 0"),
        (lambda: gallery.get(5), "name is 5; expected a name of the gallery"),
        (lambda: fem.edges_along([[0, 1]]), r"nodes has shape \(1, 2\) and type int64; expected \(k,\) node numbers"),
    ],
)
def test_gallery_arguments(build, pattern):
    bad_argument(pattern, build)


# -- anything at all -------------------------------------------------------------------------------------------------

SCALARS = st.one_of(
    st.none(), st.booleans(), st.integers(), st.integers(-(2**70), 2**70), st.floats(), st.fractions(), st.decimals(),
    st.complex_numbers(), st.text(max_size=3), st.binary(max_size=3), st.just(np.ma.masked),
    st.floats(width=32).map(np.float32), st.integers(0, 2**64 - 1).map(np.uint64),
)  # fmt: skip
NESTED = st.recursive(SCALARS, lambda inner: st.lists(inner, max_size=3) | st.tuples(inner, inner), max_leaves=12)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(NESTED)
def test_any_nested_lists_are_the_numbers_that_they_are_or_refused(value):
    try:
        found = real_array(value, "f")
    except EnumsolError as error:
        assert "\n" not in str(error)  # noqa: PT017 (either is right)
        return
    flat = [value]
    while any(isinstance(item, (list, tuple)) for item in flat):
        flat = [part for item in flat for part in (item if isinstance(item, (list, tuple)) else [item])]
    exact = [Fraction(item.item() if isinstance(item, np.generic) else item) for item in flat]
    assert [Fraction(item) for item in found.ravel().tolist()] == exact
