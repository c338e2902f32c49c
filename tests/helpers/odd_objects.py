"""Things that somebody may pass as an argument, by accident or to see what happens."""

import array
import datetime
import decimal
import fractions
import math
import pathlib
import types
import warnings

import numpy as np
import pandas as pd
import scipy.sparse as sp

from enumsol import gallery


class _Hostile:
    """Raises wherever it is asked for something."""

    def __float__(self):
        raise ValueError("no number")

    def __len__(self):
        raise TypeError("no length")

    def __iter__(self):
        raise TypeError("no items")

    def __array__(self, *args, **kwargs):
        raise ValueError("no array")


class _Labelled:
    """Has the attributes of what is expected, with nothing sensible in them."""

    alpha = lambda_n = lambda_t = shape = dtype = data = problem = arcs = vertices = "?"


def _recursive():
    items = [1.0]
    items.append(items)
    return items


def _matrix():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PendingDeprecationWarning)
        return np.asmatrix([[1.0, 2.0]])


#: Name and maker, so that nothing is shared between two calls.
ODD = {
    "None": lambda: None,
    "True": lambda: True,
    "numpy True": lambda: np.True_,
    "0": lambda: 0,
    "1": lambda: 1,
    "-1": lambda: -1,
    "0.5": lambda: 0.5,
    "nan": lambda: math.nan,
    "inf": lambda: math.inf,
    "largest float": lambda: 1.7e308,
    "least float": lambda: 5e-324,
    "complex": lambda: 1j,
    "real complex": lambda: 1 + 0j,
    "2^53 + 1": lambda: 2**53 + 1,
    "10^400": lambda: 10**400,
    "10^5000": lambda: 10**5000,
    "1/3": lambda: fractions.Fraction(1, 3),
    "10^-400": lambda: fractions.Fraction(1, 10**400),
    "decimal": lambda: decimal.Decimal("0.1"),
    "huge decimal": lambda: decimal.Decimal("1e4000000"),
    "decimal nan": lambda: decimal.Decimal("sNaN"),
    "text of a number": lambda: "0.5",
    "text of a fraction": lambda: "8/3",
    "text of a huge number": lambda: "1e4000000",
    "text of a tiny number": lambda: "1e-400",
    "text": lambda: "five",
    "empty text": lambda: "",
    "null character": lambda: "a\0b",
    "half a character": lambda: "a\ud800",
    "bytes": lambda: b"1",
    "bytearray": lambda: bytearray(b"12"),
    "empty list": list,
    "list": lambda: [1.0],
    "ragged list": lambda: [[1.0, 2.0], [3.0]],
    "list of texts": lambda: ["1", "2"],
    "list with None": lambda: [1.0, None],
    "list that holds itself": _recursive,
    "list with a masked value": lambda: [1.0, np.ma.masked],
    "empty tuple": tuple,
    "pair": lambda: (0.0, 1.0),
    "pair of texts": lambda: ("0", "8/3"),
    "triple": lambda: (0.0, 1.0, 2.0),
    "dict": lambda: {"a": 1.0},
    "set": lambda: {0.0, 1.0},
    "generator": lambda: (x for x in (0.0, 1.0)),
    "range": lambda: range(2),
    "object": object,
    "class": lambda: int,
    "module": lambda: types,
    "function": lambda: lambda *args: None,
    "path": lambda: pathlib.Path("/dev/null/at/all"),
    "slice": lambda: slice(1),
    "Ellipsis": lambda: ...,
    "exception": lambda: ValueError("x"),
    "hostile": _Hostile,
    "labelled": _Labelled,
    "date": lambda: datetime.date(2020, 1, 1),
    "memoryview": lambda: memoryview(b"12"),
    "array.array": lambda: array.array("d", [1.0, 2.0]),
    "float32": lambda: np.float32(0.1),
    "float16": lambda: np.float16(0.1),
    "longdouble": lambda: np.longdouble("0.1"),
    "int8": lambda: np.int8(1),
    "datetime64": lambda: np.datetime64("2020-01-01"),
    "0-d array": lambda: np.array(0.5),
    "0-d array of text": lambda: np.array("8/3"),
    "0-d object array": lambda: np.array(None),
    "array of one": lambda: np.array([0.5]),
    "array of two": lambda: np.array([0.0, 1.0]),
    "matrix of one": lambda: np.array([[1.0]]),
    "empty array": lambda: np.zeros(0),
    "empty matrix": lambda: np.zeros((0, 0)),
    "3-d array": lambda: np.ones((1, 1, 1)),
    "array with nan": lambda: np.array([1.0, math.nan]),
    "complex array": lambda: np.array([1.0 + 0j, 2.0]),
    "bool array": lambda: np.array([True, False]),
    "text array": lambda: np.array(["1.0", "2.0"]),
    "object array": lambda: np.array([1, fractions.Fraction(1, 3)], dtype=object),
    "large integers": lambda: np.array([2**53 + 1, 2**62 + 1]),
    "unsigned integers": lambda: np.array([2**64 - 1], dtype=np.uint64),
    "longdouble array": lambda: np.array(["0.1", "1e4000"], dtype=np.longdouble),
    "masked array": lambda: np.ma.array([1.0, 2.0], mask=[True, False]),
    "unmasked masked array": lambda: np.ma.array([1.0, 2.0]),
    "masked": lambda: np.ma.masked,
    "np.matrix": _matrix,
    "records": lambda: np.zeros(2, dtype=[("a", float)]),
    "Series": lambda: pd.Series([0.0, 1.0]),
    "nullable Series": lambda: pd.Series([1, None], dtype="Int64"),
    "Series of texts": lambda: pd.Series(["a", "b"]),
    "DataFrame": lambda: pd.DataFrame({"alpha": [0.0, 1.0], "b": [1, 2]}),
    "NA": lambda: pd.NA,
    "Timestamp": lambda: pd.Timestamp("2020-01-01"),
    "Interval": lambda: pd.Interval(0.0, 1.0),
    "csr": lambda: sp.csr_array(np.eye(2)),
    "dok": lambda: sp.dok_array(np.eye(2)),
    "lil matrix": lambda: sp.lil_matrix(np.eye(2)),
    "sparse complex": lambda: sp.csc_array(np.eye(2) * 1j),
    "sparse vector": lambda: sp.coo_array(np.ones(2)),
    "problem": gallery.one_node_triangle,
}

#: Kinds that can be called.
CALLABLE = ("class", "function")
