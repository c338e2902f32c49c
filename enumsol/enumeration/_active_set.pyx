# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Dual active-set method of Goldfarb and Idnani for a tree of convex quadratic programs.

    minimise  x'S x - c'x    subject to  n_r'x >= b_r  or  n_r'x = b_r   for the rows that are switched on

Rows are sparse combinations of x and of w = w0 + W x. A child of a tree node only switches rows on or turns
inequalities into equalities, so the parent's optimum is dual feasible for the child and every iterate carries
multipliers that prove a lower bound. The method keeps J = L^{-T} Q and R with L L' = 2 S and Q R = L^{-1} N,
N the normals of the active rows, all rows scaled to unit length in the norm of (2 S)^{-1}.
"""

from libc.math cimport fabs, hypot, isfinite, sqrt
from libc.stdlib cimport free, malloc
from libc.string cimport memcpy, memset

import numpy as np

OPTIMAL = 0
BOUND_EXCEEDED = 1
STALLED = 2

cdef double DEPENDENT = 1e-10  # part of a unit normal outside the span of the active ones, below which it lies in it


cdef inline double dot(const double *a, const double *b, Py_ssize_t n) noexcept nogil:
    cdef double s0 = 0.0, s1 = 0.0, s2 = 0.0, s3 = 0.0
    cdef Py_ssize_t i = 0
    while i + 4 <= n:
        s0 += a[i] * b[i]
        s1 += a[i + 1] * b[i + 1]
        s2 += a[i + 2] * b[i + 2]
        s3 += a[i + 3] * b[i + 3]
        i += 4
    while i < n:
        s0 += a[i] * b[i]
        i += 1
    return (s0 + s1) + (s2 + s3)


cdef inline void axpy(double t, const double *a, double *y, Py_ssize_t n) noexcept nogil:
    cdef Py_ssize_t i
    for i in range(n):
        y[i] += t * a[i]


cdef class QPData:
    """Constant data of all quadratic programs of one tree (see the module's docstring).

    Parameters
    ----------
    S : (n, n) array, symmetric positive definite
    c : (n,) array
    W : (k, n) array
    w0 : (k,) array
    row_start : (m + 1,) int array
    row_index : int array; an index below n means x, otherwise w
    row_value, row_rhs : float arrays
    """

    cdef readonly Py_ssize_t n, k, m
    cdef double[:, ::1] J0      # rows are the columns of L^{-T}
    cdef double[::1] x0, c
    cdef double[:, ::1] W
    cdef double[::1] w0
    cdef Py_ssize_t[::1] start, index
    cdef double[::1] value, rhs, norm
    cdef double f0

    def __init__(self, S, c, W, w0, row_start, row_index, row_value, row_rhs):
        self.n = len(c)
        self.k = len(w0)
        self.m = len(row_rhs)
        L = np.linalg.cholesky(2.0 * np.asarray(S))
        inverse = np.linalg.solve(L, np.eye(self.n))
        # column j of L^{-T} is row j of L^{-1}
        self.J0 = np.ascontiguousarray(inverse)
        half = inverse @ np.asarray(c)
        self.x0 = np.ascontiguousarray(inverse.T @ half)
        self.f0 = -0.5 * float(half @ half)
        self.c = np.ascontiguousarray(c, dtype=np.float64)
        self.W = np.ascontiguousarray(W, dtype=np.float64)
        self.w0 = np.ascontiguousarray(w0, dtype=np.float64)
        self.start = np.ascontiguousarray(row_start, dtype=np.intp)
        self.index = np.ascontiguousarray(row_index, dtype=np.intp)
        value = np.array(row_value, dtype=np.float64)
        rhs = np.array(row_rhs, dtype=np.float64)
        norm = np.empty(self.m)
        Wa = np.asarray(self.W)
        for r in range(self.m):
            a, b = row_start[r], row_start[r + 1]
            normal = np.zeros(self.n)
            for j in range(a, b):
                if row_index[j] < self.n:
                    normal[row_index[j]] += value[j]
                else:
                    normal += value[j] * Wa[row_index[j] - self.n]
            norm[r] = np.linalg.norm(inverse @ normal)
            value[a:b] /= norm[r]
            rhs[r] /= norm[r]
        self.value, self.rhs, self.norm = value, rhs, norm

    cdef inline double row_at(self, Py_ssize_t r, const double *x, const double *w) noexcept nogil:
        cdef double s = -self.rhs[r]
        cdef Py_ssize_t j, i
        for j in range(self.start[r], self.start[r + 1]):
            i = self.index[j]
            if i < self.n:
                s += self.value[j] * x[i]
            else:
                s += self.value[j] * w[i - self.n]
        return s

    cdef inline double offset(self, Py_ssize_t r) noexcept nogil:
        """b_r of the row written as n_r'x - b_r, with the constant part of w moved over."""
        cdef double s = self.rhs[r]
        cdef Py_ssize_t j
        for j in range(self.start[r], self.start[r + 1]):
            if self.index[j] >= self.n:
                s -= self.value[j] * self.w0[self.index[j] - self.n]
        return s

    cdef void add_normal(self, Py_ssize_t r, double t, double *out) noexcept nogil:
        """out += t * n_r."""
        cdef Py_ssize_t j, i
        for j in range(self.start[r], self.start[r + 1]):
            i = self.index[j]
            if i < self.n:
                out[i] += t * self.value[j]
            else:
                axpy(t * self.value[j], &self.W[i - self.n, 0], out, self.n)


cdef class QPState:
    """One quadratic program of the tree: which rows are on, which are active, and the iterate."""

    cdef QPData data
    cdef double *block          # J (n x n), R (n x n), x, u, d, z, r, normal (n each), w (k)
    cdef double *J
    cdef double *R
    cdef double *x
    cdef double *u
    cdef double *d
    cdef double *z
    cdef double *r
    cdef double *normal
    cdef double *w
    cdef int *active            # rows in the order in which they are active (n)
    cdef int *position          # row -> place in active, or -1 (m)
    cdef signed char *mode      # row -> 0 off, 1 inequality, 2 equality (m)
    cdef signed char *sign      # row -> orientation of an active equality (m)
    cdef Py_ssize_t q, size
    cdef int pending            # row with a multiplier that is not active yet, or -1
    cdef double pending_u
    cdef double f
    cdef readonly long iterations
    cdef readonly double bound

    def __cinit__(self, QPData data):
        cdef Py_ssize_t n = data.n
        self.data = data
        self.size = 2 * n * n + 6 * n + data.k
        self.block = <double *> malloc(self.size * sizeof(double))
        self.active = <int *> malloc((n + data.m) * sizeof(int))
        self.mode = <signed char *> malloc(2 * data.m + 1)
        if self.block == NULL or self.active == NULL or self.mode == NULL:
            raise MemoryError
        self.J = self.block
        self.R = self.J + n * n
        self.x = self.R + n * n
        self.u = self.x + n
        self.d = self.u + n
        self.z = self.d + n
        self.r = self.z + n
        self.normal = self.r + n
        self.w = self.normal + n
        self.position = self.active + n
        self.sign = self.mode + data.m

    def __init__(self, QPData data):
        cdef Py_ssize_t i
        memset(self.mode, 0, 2 * data.m)
        for i in range(data.m):
            self.position[i] = -1
        self._restart()
        self.iterations = 0
        self.bound = self.f

    def __dealloc__(self):
        free(self.block)
        free(self.active)
        free(self.mode)

    cdef void _restart(self) noexcept nogil:
        """Unconstrained minimum, nothing active."""
        cdef Py_ssize_t i, n = self.data.n
        memcpy(self.J, &self.data.J0[0, 0], n * n * sizeof(double))
        memset(self.R, 0, n * n * sizeof(double))
        memset(self.u, 0, n * sizeof(double))
        memcpy(self.x, &self.data.x0[0], n * sizeof(double))
        for i in range(self.q):
            self.position[self.active[i]] = -1
        self.q = 0
        self.pending = -1
        self.f = self.data.f0
        self._update_w()

    cdef void _update_w(self) noexcept nogil:
        cdef Py_ssize_t i
        for i in range(self.data.k):
            self.w[i] = self.data.w0[i] + dot(&self.data.W[i, 0], self.x, self.data.n)

    def copy(self):
        """An independent state with the same rows and iterate."""
        cdef QPState other = QPState.__new__(QPState, self.data)
        memcpy(other.block, self.block, self.size * sizeof(double))
        memcpy(other.active, self.active, (self.data.n + self.data.m) * sizeof(int))
        memcpy(other.mode, self.mode, 2 * self.data.m)
        other.q, other.pending, other.f = self.q, self.pending, self.f
        other.iterations, other.bound = 0, self.bound
        return other

    def switch(self, rows, modes):
        """Switch rows on: mode 1 inequality, 2 equality."""
        cdef Py_ssize_t j
        cdef int row
        for j in range(len(rows)):
            row = rows[j]
            if row < 0 or row >= self.data.m:
                raise IndexError(row)
            self.mode[row] = modes[j]

    def mode_of(self, int row):
        """Mode of a row: 0 off, 1 inequality, 2 equality."""
        return self.mode[row]

    @property
    def x_array(self):
        """The iterate x, shape (n,)."""
        return np.array(<double[:self.data.n]> self.x)

    @property
    def w_array(self):
        """w at the iterate, shape (k,)."""
        return np.array(<double[:self.data.k]> self.w)

    def multipliers(self):
        """Rows and multipliers, in the scaling of the rows as given: min e >= bound is proven by them."""
        cdef Py_ssize_t j
        cdef int row
        rows, values = [], []
        for j in range(self.q):
            row = self.active[j]
            rows.append(row)
            values.append(self.u[j] * self.sign[row] / self.data.norm[row])
        if self.pending >= 0 and self.pending_u != 0.0:
            row = self.pending
            rows.append(row)
            values.append(self.pending_u * self.sign[row] / self.data.norm[row])
        return np.array(rows, dtype=np.intp), np.array(values)

    cdef double _dual_bound(self) noexcept nogil:
        """Lower bound proven by the current multipliers, computed from them and the data alone."""
        cdef Py_ssize_t j, i, n = self.data.n
        cdef double total = 0.0, t, s
        cdef int row
        for i in range(n):
            self.normal[i] = self.data.c[i]
        for j in range(self.q + 1):
            if j < self.q:
                row = self.active[j]
                t = self.u[j]
                if self.mode[row] == 1 and t < 0.0:
                    t = 0.0
            elif self.pending >= 0:
                row = self.pending
                t = self.pending_u
            else:
                break
            t *= self.sign[row]
            self.data.add_normal(row, t, self.normal)
            total += t * self.data.offset(row)
        s = 0.0
        for i in range(n):
            t = dot(&self.data.J0[i, 0], self.normal, n)
            s += t * t
        return total - 0.5 * s

    cdef double _direction(self, int row, double sgn) noexcept nogil:
        """d = J'n, z = J2 d2, r = R^{-1} d1 for the row's normal; returns |d2|^2."""
        cdef Py_ssize_t i, j, n = self.data.n, q = self.q
        cdef double s, d2 = 0.0
        memset(self.normal, 0, n * sizeof(double))
        self.data.add_normal(row, sgn, self.normal)
        for i in range(n):
            self.d[i] = dot(self.J + i * n, self.normal, n)
        memset(self.z, 0, n * sizeof(double))
        for i in range(q, n):
            d2 += self.d[i] * self.d[i]
            axpy(self.d[i], self.J + i * n, self.z, n)
        for i in range(q - 1, -1, -1):
            s = self.d[i]
            for j in range(i + 1, q):
                s -= self.R[i * n + j] * self.r[j]
            self.r[i] = s / self.R[i * n + i]
        return d2

    cdef void _append(self, int row, double u) noexcept nogil:
        """Make a row active, d being J'n of its normal: a Householder reflection of the columns from q on."""
        cdef Py_ssize_t i, n = self.data.n, q = self.q
        cdef double norm = 0.0, beta, v0
        cdef double *v = self.d
        for i in range(q, n):
            norm += v[i] * v[i]
        norm = sqrt(norm)
        if v[q] > 0.0:
            norm = -norm
        for i in range(q):
            self.R[i * n + q] = v[i]
        self.R[q * n + q] = norm
        v0 = v[q] - norm
        if v0 != 0.0 and q + 1 < n:
            beta = -1.0 / (norm * v0)
            v[q] = v0
            memset(self.z, 0, n * sizeof(double))
            for i in range(q, n):
                axpy(v[i], self.J + i * n, self.z, n)
            for i in range(q, n):
                axpy(-beta * v[i], self.z, self.J + i * n, n)
        elif v0 != 0.0:
            for i in range(n):
                self.J[q * n + i] = -self.J[q * n + i]
        self.active[q] = row
        self.position[row] = <int> q
        self.u[q] = u
        self.q = q + 1

    cdef void _drop(self, Py_ssize_t l) noexcept nogil:
        """Take the active row at place l out; Givens rotations restore the triangle."""
        cdef Py_ssize_t i, j, n = self.data.n, q = self.q
        cdef double a, b, h, c, s, t
        cdef double *Ja
        cdef double *Jb
        self.position[self.active[l]] = -1
        for j in range(l + 1, q):
            self.active[j - 1] = self.active[j]
            self.position[self.active[j - 1]] = <int> (j - 1)
            self.u[j - 1] = self.u[j]
            for i in range(j + 1):
                self.R[i * n + j - 1] = self.R[i * n + j]
        for i in range(q):
            self.R[i * n + q - 1] = 0.0
        self.u[q - 1] = 0.0
        self.q = q - 1
        for j in range(l, q - 1):
            a = self.R[j * n + j]
            b = self.R[(j + 1) * n + j]
            h = hypot(a, b)
            if h == 0.0:
                continue
            c = a / h
            s = b / h
            self.R[j * n + j] = h
            self.R[(j + 1) * n + j] = 0.0
            for i in range(j + 1, q - 1):
                t = self.R[j * n + i]
                self.R[j * n + i] = c * t + s * self.R[(j + 1) * n + i]
                self.R[(j + 1) * n + i] = -s * t + c * self.R[(j + 1) * n + i]
            Ja = self.J + j * n
            Jb = self.J + (j + 1) * n
            for i in range(n):
                t = Ja[i]
                Ja[i] = c * t + s * Jb[i]
                Jb[i] = -s * t + c * Jb[i]

    cdef double _polish(self) noexcept nogil:
        """Project x back on the active rows (rounding drift); returns the largest residual found before."""
        cdef Py_ssize_t i, j, n = self.data.n
        cdef double s, worst = 0.0
        # solve R'y = residual, x -= J1 y
        for i in range(self.q):
            s = self.sign[self.active[i]] * self.data.row_at(self.active[i], self.x, self.w)
            if fabs(s) > worst:
                worst = fabs(s)
            for j in range(i):
                s -= self.R[j * n + i] * self.d[j]
            self.d[i] = s / self.R[i * n + i]
        if worst > 0.0:
            for i in range(self.q):
                axpy(-self.d[i], self.J + i * n, self.x, n)
            self._update_w()
        return worst

    def solve(self, double target, double tolerance, long limit):
        """Run the dual method.

        Parameters
        ----------
        target : float
            Stop with BOUND_EXCEEDED as soon as the dual bound is above this.
        tolerance : float
            Largest violation of a row, in the rows' unit scaling, that counts as none.
        limit : int
            Iterations after which the state is STALLED.

        Returns
        -------
        int
            OPTIMAL (x is the minimiser and ``bound`` its value), BOUND_EXCEEDED (an infeasible program ends so
            too, by a step along its ray) or STALLED.
        """
        cdef int status
        with nogil:
            status = self._solve(target, tolerance, limit)
        return status

    cdef int _solve(self, double target, double tolerance, long limit) noexcept nogil:
        cdef Py_ssize_t i, l, n = self.data.n
        cdef int row, polished = 0
        cdef double value, worst, sgn, d2, t, t1, t2, s
        cdef bint full
        self.pending = -1
        while True:
            row = -1
            worst = tolerance
            for i in range(self.data.m):
                if self.mode[i] == 0 or self.position[i] >= 0:
                    continue
                value = -self.data.row_at(i, self.x, self.w)
                if self.mode[i] == 2:
                    value = fabs(value)
                if value > worst:
                    worst = value
                    row = <int> i
            if row < 0:
                # drift of the active rows is mended before the answer is given
                if polished < 3 and self._polish() > 0.1 * tolerance:
                    polished += 1
                    continue
                if polished >= 3:
                    return STALLED_
                self.bound = self._dual_bound()
                return STALLED_ if not isfinite(self.bound) else (EXCEEDED_ if self.bound > target else OPTIMAL_)
            value = self.data.row_at(row, self.x, self.w)
            sgn = -1.0 if (self.mode[row] == 2 and value > 0.0) else 1.0
            self.sign[row] = <signed char> sgn
            s = sgn * value
            self.pending = row
            self.pending_u = 0.0
            full = False
            while not full:
                self.iterations += 1
                if self.iterations > limit:
                    return STALLED_
                d2 = self._direction(row, sgn)
                t1 = -1.0
                l = -1
                for i in range(self.q):
                    if self.mode[self.active[i]] == 1 and self.r[i] > 0.0:
                        t = self.u[i] / self.r[i]
                        if t < 0.0:
                            t = 0.0
                        if l < 0 or t < t1:
                            t1 = t
                            l = i
                if d2 > DEPENDENT * DEPENDENT:
                    t2 = -s / d2
                    if l >= 0 and t1 < t2:
                        t = t1
                    else:
                        t = t2
                        full = True
                    axpy(t, self.z, self.x, n)
                    self.f += t * d2 * (0.5 * t + self.pending_u)
                elif l < 0:
                    # infeasible: along the ray the bound grows at the rate -s
                    t = 2.0 * (fabs(target) + fabs(self.data.f0)) / -s
                    for i in range(self.q):
                        self.u[i] -= t * self.r[i]
                    self.pending_u += t
                    self.bound = self._dual_bound()
                    return EXCEEDED_ if self.bound > target else STALLED_
                else:
                    t = t1
                for i in range(self.q):
                    self.u[i] -= t * self.r[i]
                    if self.mode[self.active[i]] == 1 and self.u[i] < 0.0:
                        self.u[i] = 0.0
                self.pending_u += t
                if not isfinite(self.f):
                    return STALLED_
                if full:
                    self._append(row, self.pending_u)
                    self.pending = -1
                    self._update_w()
                else:
                    self._drop(l)
                    self._update_w()
                    s = sgn * self.data.row_at(row, self.x, self.w)
                    if s >= 0.0:
                        # satisfied by rounding on a partial step: take it in as it stands
                        s = -0.0
                if self.f - (0.0 if full else self.pending_u * s) > target:
                    self.bound = self._dual_bound()
                    if self.bound > target:
                        return EXCEEDED_


cdef int OPTIMAL_ = 0
cdef int EXCEEDED_ = 1
cdef int STALLED_ = 2
