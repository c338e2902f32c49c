# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The exclusion inequalities of enumsol.trusted's point, interval and forms in compiled loops, for the search.

Formulas and error bounds are those of ``margins`` there, which the checker uses; tests compare the two. Sums in double
arithmetic: the a-priori bounds hold for any order of summation and for fused multiply-adds.
"""

from libc.math cimport fabs, isfinite, sqrt

cdef extern from "_dense.h" nogil:
    void matvec "enumsol_matvec"(const double *M, Py_ssize_t rows, Py_ssize_t n, const double *v, double *out)

import numpy as np

from enumsol.arithmetic.balls import ROOT_TINY, SAFE, TINY, UNIT, gamma
from enumsol.trusted.quadratic_forms import QuadraticForm
from enumsol.trusted.over_interval import interval_row_tables
from enumsol.trusted.status_rows import FORBIDDEN, NONNEGATIVE


cdef class Multipliers:
    """Adds up the multipliers of the rows of a partial assignment: y on S lambda - g, c on lambda (see ``margins``)."""

    cdef Py_ssize_t p
    cdef double[::1] low, high, F_rad
    cdef double safe, tiny, root_tiny, unit
    cdef signed char[:, :, ::1] tables
    cdef signed char forbidden, nonnegative
    cdef double[:, ::1] work    # first y, c and the radius of c

    def __init__(self, low, high, F_rad):
        self.p = len(low)
        self.low, self.high = np.array(low), np.array(high)
        self.F_rad = np.where(np.asarray(low) == high, F_rad, 0.0)
        self.safe, self.tiny, self.root_tiny, self.unit = SAFE, TINY, ROOT_TINY, UNIT
        self.tables = np.ascontiguousarray(interval_row_tables(), dtype=np.int8)
        self.forbidden, self.nonnegative = FORBIDDEN, NONNEGATIVE
        self.work = np.zeros((9, 2 * self.p))

    cdef bint _add_up(self, codes, Py_ssize_t[::1] rows, double[::1] values, double terms) except -1:
        """Whether the multipliers are allowed; then they are added up."""
        cdef Py_ssize_t j, i, kind, code, n = 2 * self.p, p = self.p
        cdef double v, a, F
        cdef double[::1] y = self.work[0], c = self.work[1], c_rad = self.work[2]
        cdef signed char sign
        self.work[:3, :] = 0.0
        for j in range(len(rows)):
            kind, i = rows[j] // p, rows[j] % p
            v = values[j]
            if rows[j] < 0 or kind >= 9 or not isfinite(v):
                return False
            code = codes[i]
            F = self.high[i]
            sign = self.tables[self.low[i] != F, 9 if code == 6 and F == 0.0 else code, kind]
            if sign == self.forbidden or (sign == self.nonnegative and v < 0.0):
                return False
            a = fabs(v)
            # c_rad first sums the sizes of the terms, weighted by terms
            if kind == 0:
                c[i] += v
                c_rad[i] += terms * a
            elif kind == 1:
                c[p + i] += v
                c_rad[p + i] += terms * a
            elif kind <= 3:
                c[i] += F * v
                c[p + i] += -v if kind == 2 else v
                c_rad[i] += (terms * F + self.F_rad[i]) * a
                c_rad[p + i] += terms * a
            elif kind == 4:
                y[i] += v
            elif kind <= 6:
                y[p + i] += -v if kind == 5 else v
            else:
                F = self.low[i]
                c[i] -= F * v
                c[p + i] += v if kind == 7 else -v
                c_rad[i] += terms * F * a
                c_rad[p + i] += terms * a
        for i in range(n):
            c_rad[i] *= self.safe
        return True


cdef class Margins(Multipliers):
    """Exclusion margins that hold at all of some EnclosedSystems which differ in g and F only.

    Parameters
    ----------
    ends : sequence of EnclosedSystem
        One for a single alpha or a load that does not vary, otherwise both ends of a piece of the interval.
    low, high : (p,) arrays
        The smallest and the largest friction coefficients; equal where friction is constant.
    """

    cdef double[:, ::1] S, inverse, g, g_rad
    cdef double form_error, smallest
    cdef object ends
    cdef dict sharper

    def __init__(self, ends, low, high):
        first = ends[0]
        self.ends, self.sharper = ends, {}
        super().__init__(low, high, np.max([end.F_rad for end in ends], axis=0))
        self.S = np.ascontiguousarray(first.S)
        self.inverse = np.ascontiguousarray(first.inverse)
        self.g = np.stack([end.g for end in ends])
        self.g_rad = np.stack([end.g_rad for end in ends])
        self.form_error = first.form_error
        self.smallest = first.smallest_eigenvalue

    def margin(self, codes, Py_ssize_t[::1] rows, double[::1] values):
        """Proven lower bound on the energy over a partial assignment; -inf when the multipliers are not allowed."""
        cdef Py_ssize_t j, n = 2 * self.p
        cdef double k = gamma(4 * n + 16), least, bound
        if not self._add_up(codes, rows, values, gamma(len(rows) + 16)):
            return -np.inf
        matvec(&self.S[0, 0], n, n, &self.work[0, 0], &self.work[6, 0])
        least = self._better(0, k)
        for j in range(1, len(self.g)):
            # what no end has proven positive is of no use
            if not least > 0.0:
                break
            bound = self._better(j, k)
            least = bound if bound < least else least
        return least

    cdef double _better(self, Py_ssize_t end, double k) except? -1.0:
        """The larger one of both bounds (see ``energy_bounds``); the second only where it may be positive."""
        cdef double most = 0.0, bound = self._bound(end, k, &most)
        cdef FormMargins form
        if bound > 0.0 or not most > 0.0:
            return bound
        if end not in self.sharper:
            self.sharper[end] = FormMargins(QuadraticForm.energy(self.ends[end]), 2.0)
        form = self.sharper[end]
        form.work[:3, :] = self.work[:3, :]
        form.work[6, :] = self.work[6, :]
        return max(bound, form._bound(k))

    cdef double _bound(self, Py_ssize_t end, double k, double *most) noexcept:
        """The first bound; ``most``: no bound is larger."""
        cdef Py_ssize_t i, n = 2 * self.p
        cdef double[::1] y = self.work[0], c = self.work[1], c_rad = self.work[2], q = self.work[3]
        cdef double[::1] x = self.work[4], Sx = self.work[5], Sy = self.work[6], q_rad = self.work[7]
        cdef double[::1] g = self.g[end], g_rad = self.g_rad[end]
        cdef double first = 0, cross = 0, y_form = 0, x_form = 0, first_error = 0, cross_error = 0
        cdef double yy = 0, xx = 0, rr = 0, dd = 0, qq = 0, rest, tail, total, error, margin
        for i in range(n):
            q[i] = g[i] + c[i]
            q_rad[i] = (g_rad[i] + c_rad[i] + 2 * self.unit * fabs(q[i])) * self.safe
        matvec(&self.inverse[0, 0], n, n, &q[0], &x[0])
        matvec(&self.S[0, 0], n, n, &x[0], &Sx[0])
        for i in range(n):
            first += y[i] * (g[i] - c[i])
            first_error += fabs(y[i]) * (k * (fabs(g[i]) + fabs(c[i])) + g_rad[i] + c_rad[i])
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
        error *= (1 + k) * self.safe * self.safe
        most[0] = total + error
        # twice the error: whoever checks the proof adds up in another order, and must find a positive bound too
        margin = total - 2 * error - self.tiny
        return margin if isfinite(margin) else -np.inf


cdef class FormMargins(Multipliers):
    """Exclusion margins of a form in place of the energy, as ``form_margins`` of enumsol.trusted.quadratic_forms.

    Products with |S| and S_rad are bounded by one of rank one, and x is refined only as long as that helps.

    Parameters
    ----------
    form : EnclosedForm
    errors : float
        How often the error bound is subtracted.
    """

    cdef double[:, ::1] S, H, inverse
    cdef double[::1] g, g_rad, h, h_rad, size
    cdef double reach, spread, constant, constant_rad, form_error, smallest, errors

    def __init__(self, form, double errors):
        system = form.system
        super().__init__(system.F, system.F, system.F_rad)
        self.S, self.H = np.ascontiguousarray(system.S), np.ascontiguousarray(form.H)
        self.inverse = np.ascontiguousarray(form.inverse)
        self.g, self.g_rad, self.h, self.h_rad = system.g.copy(), system.g_rad.copy(), form.h.copy(), form.h_rad.copy()
        size = np.sqrt(np.abs(np.diagonal(system.S)))
        square = np.outer(size, size)
        self.size = size
        self.reach = np.max(np.abs(system.S) / square) * SAFE
        self.spread = np.max(system.S_rad / square) * SAFE
        self.constant, self.constant_rad, self.errors = form.k, form.k_rad, errors
        self.form_error, self.smallest = form.form_error, form.smallest_eigenvalue

    def margin(self, codes, Py_ssize_t[::1] rows, double[::1] values):
        """Proven lower bound on the form over a partial assignment; -inf when the multipliers are not allowed."""
        if not self.smallest > 0.0 or not self._add_up(codes, rows, values, gamma(len(rows) + 16)):
            return -np.inf
        matvec(&self.S[0, 0], 2 * self.p, 2 * self.p, &self.work[0, 0], &self.work[6, 0])
        return self._bound(gamma(8 * self.p + 16))

    cdef double _bound(self, double k) noexcept:
        cdef Py_ssize_t i, n = 2 * self.p
        cdef int refined
        cdef double[::1] y = self.work[0], c = self.work[1], c_rad = self.work[2], v = self.work[3]
        cdef double[::1] x = self.work[4], Hx = self.work[5], Sy = self.work[6], v_rad = self.work[7]
        cdef double[::1] rest = self.work[8]
        cdef double first = 0, cross = 0, x_form = 0, error, off = 0, across = 0
        cdef double weight = 0, xx = 0, vv = 0, rr, dd = 0, norm, tail, total, margin
        for i in range(n):
            weight += fabs(y[i]) * self.size[i]
            first += y[i] * self.g[i]
            off += fabs(y[i]) * (self.g_rad[i] + k * fabs(self.g[i]))
        for i in range(n):
            v[i] = self.h[i] + c[i] + Sy[i]
            v_rad[i] = self.h_rad[i] + c_rad[i] + k * (fabs(self.h[i]) + fabs(c[i]))
            v_rad[i] += (self.spread + k * self.reach) * weight * (1 + k) * self.size[i]
            v_rad[i] *= (1 + k) * self.safe
            vv += v[i] * v[i]
            dd += v_rad[i] * v_rad[i]
        matvec(&self.inverse[0, 0], n, n, &v[0], &x[0])
        for refined in range(4):
            matvec(&self.H[0, 0], n, n, &x[0], &Hx[0])
            rr = 0.0
            for i in range(n):
                rest[i] = v[i] - Hx[i]
                rr += rest[i] * rest[i]
            if rr <= dd or refined == 3:
                break
            matvec(&self.inverse[0, 0], n, n, &rest[0], &Hx[0])
            for i in range(n):
                x[i] += Hx[i]
        for i in range(n):
            xx += x[i] * x[i]
            cross += x[i] * v[i]
            x_form += x[i] * Hx[i]
            across += fabs(x[i]) * (v_rad[i] + k * fabs(v[i]))
        norm = sqrt(rr) + sqrt(dd) + k * sqrt(vv) + self.form_error * sqrt(xx) + self.root_tiny
        norm = norm * (1 + k) * self.safe
        tail = norm * norm / self.smallest
        total = self.constant + first - 0.5 * cross + 0.25 * x_form
        error = self.constant_rad + off + 0.5 * across + 0.25 * (self.form_error * xx + tail)
        error += 8 * self.unit * (fabs(self.constant) + fabs(first) + fabs(cross) + fabs(x_form))
        margin = total - self.errors * error * (1 + k) * self.safe * self.safe - self.tiny
        return margin if isfinite(margin) else -np.inf
