# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The exclusion inequality of enumsol.kernel.point in compiled loops, for the search.

Formula and error bounds are those of ``exclusion_margin`` there, which the checker uses; tests compare the two. Sums in
double arithmetic: the a-priori bounds hold for any order of summation and for fused multiply-adds.
"""

from libc.math cimport fabs, isfinite, sqrt

cdef extern from "_dense.h" nogil:
    void matvec "enumsol_matvec"(const double *M, Py_ssize_t rows, Py_ssize_t n, const double *v, double *out)

import numpy as np

from enumsol.arithmetic.balls import ROOT_TINY, SAFE, TINY, UNIT, gamma
from enumsol.kernel.rows import FORBIDDEN, NONNEGATIVE, row_table


cdef class Margins:
    """Exclusion margins on one EnclosedSystem.

    Parameters
    ----------
    system : EnclosedSystem
    """

    cdef Py_ssize_t p
    cdef double[:, ::1] S, inverse
    cdef double[::1] g, g_rad, F, F_rad
    cdef double form_error, smallest, safe, tiny, root_tiny, unit
    cdef signed char[:, ::1] table
    cdef signed char forbidden, nonnegative
    cdef double[:, ::1] work

    def __init__(self, system):
        self.p = system.p
        self.S = np.ascontiguousarray(system.S)
        self.inverse = np.ascontiguousarray(system.inverse)
        self.g = np.array(system.g)
        self.g_rad = np.array(system.g_rad)
        self.F = np.array(system.F)
        self.F_rad = np.array(system.F_rad)
        self.form_error = system.form_error
        self.smallest = system.smallest_eigenvalue
        self.safe, self.tiny, self.root_tiny, self.unit = SAFE, TINY, ROOT_TINY, UNIT
        self.table = np.ascontiguousarray(row_table(), dtype=np.int8)
        self.forbidden, self.nonnegative = FORBIDDEN, NONNEGATIVE
        self.work = np.zeros((9, 2 * system.p))

    def margin(self, codes, Py_ssize_t[::1] rows, double[::1] values):
        """Proven lower bound on the energy over a partial assignment; -inf when the multipliers are not allowed."""
        cdef Py_ssize_t j, i, kind, code, n = 2 * self.p, p = self.p, count = len(rows)
        cdef double v, a, terms, k
        cdef double[::1] y = self.work[0], c = self.work[1], c_rad = self.work[2]
        cdef signed char sign
        terms = gamma(count + 16)
        k = gamma(4 * n + 16)
        self.work[:3, :] = 0.0
        for j in range(count):
            kind, i = rows[j] // p, rows[j] % p
            v = values[j]
            if rows[j] < 0 or kind >= 7 or not isfinite(v):
                return -np.inf
            code = codes[i]
            sign = self.table[7 if code == 6 and self.F[i] == 0.0 else code, kind]
            if sign == self.forbidden or (sign == self.nonnegative and v < 0.0):
                return -np.inf
            a = fabs(v)
            # c_rad first sums the sizes of the terms, weighted by terms
            if kind == 0:
                c[i] += v
                c_rad[i] += terms * a
            elif kind == 1:
                c[p + i] += v
                c_rad[p + i] += terms * a
            elif kind <= 3:
                c[i] += self.F[i] * v
                c[p + i] += -v if kind == 2 else v
                c_rad[i] += (terms * self.F[i] + self.F_rad[i]) * a
                c_rad[p + i] += terms * a
            elif kind == 4:
                y[i] += v
            else:
                y[p + i] += -v if kind == 5 else v
        return self._bound(k)

    cdef double _bound(self, double k) noexcept:
        cdef Py_ssize_t i, n = 2 * self.p
        cdef double[::1] y = self.work[0], c = self.work[1], c_rad = self.work[2], q = self.work[3]
        cdef double[::1] x = self.work[4], Sx = self.work[5], Sy = self.work[6], q_rad = self.work[7]
        cdef double first = 0, cross = 0, y_form = 0, x_form = 0, first_error = 0, cross_error = 0
        cdef double yy = 0, xx = 0, rr = 0, dd = 0, qq = 0, rest, tail, total, error, margin
        for i in range(n):
            c_rad[i] *= self.safe
            q[i] = self.g[i] + c[i]
            q_rad[i] = (self.g_rad[i] + c_rad[i] + 2 * self.unit * fabs(q[i])) * self.safe
        matvec(&self.inverse[0, 0], n, n, &q[0], &x[0])
        matvec(&self.S[0, 0], n, n, &x[0], &Sx[0])
        matvec(&self.S[0, 0], n, n, &y[0], &Sy[0])
        for i in range(n):
            first += y[i] * (self.g[i] - c[i])
            first_error += fabs(y[i]) * (k * (fabs(self.g[i]) + fabs(c[i])) + self.g_rad[i] + c_rad[i])
            cross += x[i] * q[i]
            cross_error += fabs(x[i]) * (k * fabs(q[i]) + q_rad[i])
            y_form += y[i] * Sy[i]
            x_form += x[i] * Sx[i]
            yy += y[i] * y[i]
            xx += x[i] * x[i]
            qq += q[i] * q[i]
            dd += q_rad[i] * q_rad[i]
            rr += (q[i] - Sx[i]) * (q[i] - Sx[i])
        rest = sqrt(rr) + sqrt(dd) + k * sqrt(qq) + self.form_error * sqrt(xx) + self.root_tiny
        rest = rest * (1 + k) * self.safe
        tail = rest * rest / self.smallest
        total = 0.5 * first - 0.25 * y_form - 0.5 * cross + 0.25 * x_form
        error = 0.5 * (first_error + cross_error) + 0.25 * (self.form_error * (yy + xx) + tail)
        error += 8 * self.unit * (fabs(first) + fabs(y_form) + fabs(cross) + fabs(x_form))
        # twice the error: whoever checks the proof adds up in another order, and must find a positive bound too
        margin = total - 2 * error * (1 + k) * self.safe * self.safe - self.tiny
        return margin if isfinite(margin) else -np.inf
