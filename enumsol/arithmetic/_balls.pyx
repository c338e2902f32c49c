# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Operations on small balls, for `enumsol.arithmetic.balls`: on tiny arrays numpy spends its time on calls, not numbers.

Sums, differences, products and sizes of floats are bit for bit those of the numpy code there, with the same layout in
memory, so that no proof depends on which of the two ran. A product of matrices is summed in the order of the inner
index; the numpy code leaves the order to a library, and its bound covers any. Whatever is not a small array of doubles
is left to the numpy code. The compiler must not fuse products with sums, nor compute with more digits.
"""

from cpython.object cimport PyObject
from libc.math cimport fabs, ldexp
from libc.string cimport memset

cimport numpy as cnp

import numpy as np

cnp.import_array()

cdef extern from *:
    """
    #include <float.h>
    #if defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD != 0
    #error "double arithmetic with more digits than a double has"
    #endif
    #if defined(__FAST_MATH__)
    #error "compiled for arithmetic that is not IEEE's"
    #endif
    typedef char enumsol_double_is_ieee[(DBL_MANT_DIG == 53 && sizeof(double) == 8) ? 1 : -1];
    #define ENUMSOL_VALUE(o) (&((PyFloatObject *)(o))->ob_fval)
    """
    const double *value_of "ENUMSOL_VALUE"(PyObject *o)

cdef extern from "numpy/arrayobject.h":
    object PyArray_NewLikeArray(cnp.ndarray prototype, cnp.NPY_ORDER order, void *descr, int subok)
    bint PyArray_ISNOTSWAPPED(cnp.ndarray array)
    bint PyArray_ISALIGNED(cnp.ndarray array)

cdef enum:
    AXES = 3
    LARGEST = 2048    # numbers in a result beyond which numpy is about as fast
    PRODUCTS = 4096   # products in a product of matrices, likewise

cdef double UNIT = ldexp(1.0, -53), SAFE = 1.0 + ldexp(1.0, -40), TINY = ldexp(1.0, -960)
cdef object FLOAT64 = np.float64


cdef struct View:
    const char *data
    int axes
    cnp.npy_intp shape[AXES]
    cnp.npy_intp step[AXES]   # in bytes; 0 along axes of length one
    int order                 # 1: later axes have smaller steps, -1: an array of two axes with the reverse, 0: neither
    bint repeated             # the same number stands for several


cdef bint _look(object values, View *view):
    """Whether these are doubles in an array with few axes, or one such number; what a loop has to know of them."""
    cdef int k, j
    cdef cnp.ndarray array
    if cnp.PyArray_CheckExact(values):
        array = <cnp.ndarray>values
        view.axes = cnp.PyArray_NDIM(array)
        if (
            cnp.PyArray_TYPE(array) != cnp.NPY_DOUBLE
            or view.axes > AXES
            or not PyArray_ISNOTSWAPPED(array)
            or not PyArray_ISALIGNED(array)
        ):
            return False
        view.data = <const char *>cnp.PyArray_DATA(array)
        view.order = view.repeated = 0
        for k in range(view.axes):
            view.shape[k] = cnp.PyArray_DIM(array, k)
            view.step[k] = 0 if view.shape[k] == 1 else cnp.PyArray_STRIDE(array, k)
            if view.shape[k] == 0 or view.step[k] < 0:
                return False
            if view.shape[k] > 1 and not view.step[k]:
                view.repeated = True
            for j in range(k):
                if view.step[j] and view.step[k]:
                    if view.step[j] >= view.step[k]:
                        view.order = 1
                    elif view.axes == 2:
                        view.order = -1
                    else:
                        return False
        return True
    if type(values) is FLOAT64:
        view.data = <const char *>value_of(<PyObject *>values)
        view.axes = view.order = view.repeated = 0
        return True
    return False


cdef bint _same_shape(const View *one, const View *other) noexcept nogil:
    cdef int k
    if one.axes != other.axes:
        return False
    for k in range(one.axes):
        if one.shape[k] != other.shape[k]:
            return False
    return True


cdef bint _broadcast(View *a, View *b, View *out) noexcept nogil:
    """The shape of a result, with as many axes for both; whether they fit and the result is small."""
    cdef int k, axes = max(a.axes, b.axes)
    cdef cnp.npy_intp size = 1
    _lengthen(a, axes)
    _lengthen(b, axes)
    out.axes = axes
    for k in range(axes):
        if a.shape[k] != b.shape[k] and a.shape[k] != 1 and b.shape[k] != 1:
            return False
        out.shape[k] = max(a.shape[k], b.shape[k])
        size *= out.shape[k]
        if out.shape[k] > LARGEST or size > LARGEST:
            return False
    return True


cdef void _lengthen(View *view, int axes) noexcept nogil:
    """Put axes of length one in front."""
    cdef int k, more = axes - view.axes
    if more:
        for k in range(axes - 1, -1, -1):
            view.shape[k] = view.shape[k - more] if k >= more else 1
            view.step[k] = view.step[k - more] if k >= more else 0


cdef struct Pairs:
    View a, a_rad, b, b_rad, out
    bint reverse              # the first axis of the result has the smallest step


cdef bint _fit(Pair one, Pair other, Pairs *p):
    """Whether the loops can do it, with the layout of the result that numpy gives it."""
    if not (_look(one.mid, &p.a) and _look(one.rad, &p.a_rad) and _same_shape(&p.a, &p.a_rad)):
        return False
    if not (_look(other.mid, &p.b) and _look(other.rad, &p.b_rad) and _same_shape(&p.b, &p.b_rad)):
        return False
    p.reverse = False
    if p.a.order < 0 or p.a_rad.order < 0 or p.b.order < 0 or p.b_rad.order < 0:
        if p.a.order != p.a_rad.order or p.b.order != p.b_rad.order or p.a.axes > 2 or p.b.axes > 2:
            return False
        if p.a.repeated or p.a_rad.repeated or p.b.repeated or p.b_rad.repeated:
            return False
        # what says nothing of an order agrees; among others the usual one wins
        p.reverse = p.a.order <= 0 and p.b.order <= 0
    if not _broadcast(&p.a, &p.b, &p.out):
        return False
    _lengthen(&p.a_rad, p.out.axes)
    _lengthen(&p.b_rad, p.out.axes)
    return True


cdef object _empty(const View *out, bint reverse):
    return cnp.PyArray_EMPTY(out.axes, <cnp.npy_intp *>out.shape, cnp.NPY_DOUBLE, reverse)


ctypedef void (*Row)(
    cnp.npy_intp n,
    const char *a, const char *a_rad, const char *b, const char *b_rad,
    cnp.npy_intp a_step, cnp.npy_intp a_rad_step, cnp.npy_intp b_step, cnp.npy_intp b_rad_step,
    char *mid, char *rad, cnp.npy_intp step) noexcept nogil


cdef void _sums(
    cnp.npy_intp n,
    const char *a, const char *a_rad, const char *b, const char *b_rad,
    cnp.npy_intp a_step, cnp.npy_intp a_rad_step, cnp.npy_intp b_step, cnp.npy_intp b_rad_step,
    char *mid, char *rad, cnp.npy_intp step) noexcept nogil:
    cdef cnp.npy_intp i
    cdef double m
    for i in range(n):
        m = (<const double *>(a + i * a_step))[0] + (<const double *>(b + i * b_step))[0]
        (<double *>(mid + i * step))[0] = m
        (<double *>(rad + i * step))[0] = (
            (<const double *>(a_rad + i * a_rad_step))[0] + (<const double *>(b_rad + i * b_rad_step))[0]
            + 2 * UNIT * fabs(m)
        ) * SAFE + TINY


cdef void _differences(
    cnp.npy_intp n,
    const char *a, const char *a_rad, const char *b, const char *b_rad,
    cnp.npy_intp a_step, cnp.npy_intp a_rad_step, cnp.npy_intp b_step, cnp.npy_intp b_rad_step,
    char *mid, char *rad, cnp.npy_intp step) noexcept nogil:
    cdef cnp.npy_intp i
    cdef double m
    for i in range(n):
        m = (<const double *>(a + i * a_step))[0] - (<const double *>(b + i * b_step))[0]
        (<double *>(mid + i * step))[0] = m
        (<double *>(rad + i * step))[0] = (
            (<const double *>(a_rad + i * a_rad_step))[0] + (<const double *>(b_rad + i * b_rad_step))[0]
            + 2 * UNIT * fabs(m)
        ) * SAFE + TINY


cdef void _products(
    cnp.npy_intp n,
    const char *a, const char *a_rad, const char *b, const char *b_rad,
    cnp.npy_intp a_step, cnp.npy_intp a_rad_step, cnp.npy_intp b_step, cnp.npy_intp b_rad_step,
    char *mid, char *rad, cnp.npy_intp step) noexcept nogil:
    cdef cnp.npy_intp i
    cdef double m, x, y, y_rad
    for i in range(n):
        x = (<const double *>(a + i * a_step))[0]
        y = (<const double *>(b + i * b_step))[0]
        y_rad = (<const double *>(b_rad + i * b_rad_step))[0]
        m = x * y
        (<double *>(mid + i * step))[0] = m
        (<double *>(rad + i * step))[0] = (
            fabs(x) * y_rad + (<const double *>(a_rad + i * a_rad_step))[0] * (fabs(y) + y_rad) + 2 * UNIT * fabs(m)
        ) * SAFE + TINY


cdef object _by_rows(Pair one, Pair other, Row row):
    """Entry by entry; None where that is left to numpy."""
    cdef Pairs p
    cdef object mid, rad
    cdef char *m
    cdef char *r
    cdef cnp.npy_intp i, j, n, step
    cdef cnp.npy_intp first, second, last
    cdef int k
    if not _fit(one, other, &p):
        return None
    mid, rad = _empty(&p.out, p.reverse), _empty(&p.out, p.reverse)
    m, r = <char *>cnp.PyArray_DATA(<cnp.ndarray>mid), <char *>cnp.PyArray_DATA(<cnp.ndarray>rad)
    k = p.out.axes
    n = p.out.shape[k - 1] if k else 1
    if k <= 1:
        row(
            n, p.a.data, p.a_rad.data, p.b.data, p.b_rad.data,
            p.a.step[0] if k else 0, p.a_rad.step[0] if k else 0, p.b.step[0] if k else 0, p.b_rad.step[0] if k else 0,
            m, r, sizeof(double))
        if not k:
            return _pair(type(one), cnp.PyArray_ToScalar(m, mid), cnp.PyArray_ToScalar(r, rad))
        return _pair(type(one), mid, rad)
    step = p.out.shape[0] * <cnp.npy_intp>sizeof(double) if p.reverse else sizeof(double)
    second = sizeof(double) if p.reverse else n * <cnp.npy_intp>sizeof(double)
    first = second * p.out.shape[1]
    last = k - 1
    for i in range(p.out.shape[0] if k == 3 else 1):
        for j in range(p.out.shape[k - 2]):
            row(
                n,
                p.a.data + j * p.a.step[k - 2] + (i * p.a.step[0] if k == 3 else 0),
                p.a_rad.data + j * p.a_rad.step[k - 2] + (i * p.a_rad.step[0] if k == 3 else 0),
                p.b.data + j * p.b.step[k - 2] + (i * p.b.step[0] if k == 3 else 0),
                p.b_rad.data + j * p.b_rad.step[k - 2] + (i * p.b_rad.step[0] if k == 3 else 0),
                p.a.step[last], p.a_rad.step[last], p.b.step[last], p.b_rad.step[last],
                m + j * second + (i * first if k == 3 else 0),
                r + j * second + (i * first if k == 3 else 0),
                step)
    return _pair(type(one), mid, rad)


cdef inline double _at(const View *view, cnp.npy_intp i, cnp.npy_intp j) noexcept nogil:
    return (<const double *>(view.data + i * view.step[0] + j * view.step[1]))[0]


cdef object _matrix_product(Pair one, Pair other):
    """Sums over the inner index in its order; None where that is left to numpy."""
    cdef View a, a_rad, b, b_rad
    cdef object mid, rad
    cdef cnp.npy_intp n, inner, m, i, j, l
    cdef cnp.npy_intp shape[2]
    cdef int axes = 0
    cdef double *out
    cdef double *out_rad
    cdef double x, x_rad, y, y_rad, k, total, spread, across, size
    if not (_look(one.mid, &a) and _look(one.rad, &a_rad) and _same_shape(&a, &a_rad)):
        return None
    if not (_look(other.mid, &b) and _look(other.rad, &b_rad) and _same_shape(&b, &b_rad)):
        return None
    if not (1 <= a.axes <= 2 and 1 <= b.axes <= 2):
        return None
    if a.axes == 2:
        shape[axes] = a.shape[0]
        axes += 1
    else:
        _lengthen(&a, 2)
        _lengthen(&a_rad, 2)
    if b.axes == 2:
        shape[axes] = b.shape[1]
        axes += 1
    else:
        # a column
        b.shape[1], b.step[1], b_rad.step[1] = 1, 0, 0
    n, inner, m = a.shape[0], a.shape[1], b.shape[1]
    if b.shape[0] != inner or m > PRODUCTS or inner > PRODUCTS or n > PRODUCTS or n * m * inner > PRODUCTS:
        return None
    mid = cnp.PyArray_EMPTY(axes, shape, cnp.NPY_DOUBLE, 0)
    rad = cnp.PyArray_EMPTY(axes, shape, cnp.NPY_DOUBLE, 0)
    out, out_rad = <double *>cnp.PyArray_DATA(<cnp.ndarray>mid), <double *>cnp.PyArray_DATA(<cnp.ndarray>rad)
    k = (inner + 4) * UNIT / (1.0 - (inner + 4) * UNIT) * SAFE
    for i in range(n):
        for j in range(m):
            total = spread = across = size = 0.0
            for l in range(inner):
                x, x_rad, y, y_rad = _at(&a, i, l), _at(&a_rad, i, l), _at(&b, l, j), _at(&b_rad, l, j)
                total += x * y
                spread += x_rad * (fabs(y) + y_rad)
                across += fabs(x) * y_rad
                size += fabs(x) * fabs(y)
            out[i * m + j] = total
            out_rad[i * m + j] = (spread + across + k * size) * (1.0 + k) * SAFE + TINY
    if not axes:
        return _pair(type(one), cnp.PyArray_ToScalar(out, mid), cnp.PyArray_ToScalar(out_rad, rad))
    return _pair(type(one), mid, rad)


cdef object _size(Pair one):
    """Bounds of absolute values; None where that is left to numpy."""
    cdef View a, a_rad
    cdef object found
    cdef double *out
    cdef cnp.npy_intp rows, n, i, j
    if not (_look(one.mid, &a) and _look(one.rad, &a_rad) and _same_shape(&a, &a_rad)):
        return None
    if not 1 <= a.axes <= 2 or a.order < 0 or a_rad.order < 0:
        return None
    if a.axes == 2:
        found = cnp.PyArray_EMPTY(2, a.shape, cnp.NPY_DOUBLE, 0)
    else:
        found = cnp.PyArray_EMPTY(1, a.shape, cnp.NPY_DOUBLE, 0)
        _lengthen(&a, 2)
        _lengthen(&a_rad, 2)
    rows, n = a.shape[0], a.shape[1]
    if rows > LARGEST or n > LARGEST or rows * n > LARGEST:
        return None
    out = <double *>cnp.PyArray_DATA(<cnp.ndarray>found)
    for i in range(rows):
        for j in range(n):
            out[i * n + j] = (fabs(_at(&a, i, j)) + _at(&a_rad, i, j)) * SAFE
    return found


cdef inline object _pair(type kind, object mid, object rad):
    cdef Pair made = <Pair>Pair.__new__(kind)
    made.mid, made.rad = mid, rad
    return made


cdef class Pair:
    """What a ball consists of, and its operations; those on other than small arrays of doubles by a subclass."""

    cdef readonly object mid
    cdef readonly object rad

    def __init__(self, mid, rad):
        self.mid, self.rad = mid, rad

    def __add__(self, other):
        cdef object found = _by_rows(self, <Pair>other, _sums) if isinstance(other, Pair) else None
        return self._added(other) if found is None else found

    def __sub__(self, other):
        cdef object found = _by_rows(self, <Pair>other, _differences) if isinstance(other, Pair) else None
        return self._subtracted(other) if found is None else found

    def __mul__(self, other):
        cdef object found = _by_rows(self, <Pair>other, _products) if isinstance(other, Pair) else None
        return self._multiplied(other) if found is None else found

    def __matmul__(self, other):
        cdef object found = _matrix_product(self, <Pair>other) if isinstance(other, Pair) else None
        return self._matrix_multiplied(other) if found is None else found

    def __getitem__(self, item):
        return _pair(type(self), self.mid[item], self.rad[item])

    @property
    def size(self):
        """Largest absolute values."""
        cdef object found = _size(self)
        return self._sized() if found is None else found

    @property
    def T(self):
        """The transpose."""
        return _pair(type(self), self.mid.T, self.rad.T)

    @classmethod
    def exact(cls, mid):
        """No radius."""
        cdef object values, rad
        values = mid if cnp.PyArray_CheckExact(mid) else np.asarray(mid)
        if cnp.PyArray_CheckExact(values) and cnp.PyArray_TYPE(<cnp.ndarray>values) == cnp.NPY_DOUBLE:
            rad = PyArray_NewLikeArray(<cnp.ndarray>values, cnp.NPY_KEEPORDER, NULL, 1)
            memset(cnp.PyArray_DATA(<cnp.ndarray>rad), 0, cnp.PyArray_NBYTES(<cnp.ndarray>rad))
        else:
            rad = np.zeros_like(values)
        return _pair(cls, values, rad)
