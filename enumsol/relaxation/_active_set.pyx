# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Dual active-set method of Goldfarb and Idnani for a tree of convex quadratic programs.

    minimise  x'S x - c'x    subject to  n_r'x >= b_r  or  n_r'x = b_r   for the rows that are switched on

Rows are sparse combinations of x and of w = w0 + W x. A child of a tree node only switches rows on or turns
inequalities into equalities, so the parent's optimum is dual feasible for the child and every iterate carries
multipliers that prove a lower bound. The method keeps J = L^{-T} Q and R with L L' = 2 S and Q R = L^{-1} N,
N the normals of the active rows, all rows scaled to unit length in the norm of (2 S)^{-1}.
"""

cimport cython
from libc.math cimport HUGE_VAL, cbrt, fabs, fmax, fmin, isfinite, sqrt
from libc.stdlib cimport free, malloc
from libc.string cimport memcpy, memmove, memset

import numpy as np

from enumsol.model.statuses import CONTACT, UNDECIDED
from enumsol.relaxation.engine import FEASIBILITY_TOLERANCE

OPTIMAL = 0
BOUND_EXCEEDED = 1
STALLED = 2

cdef enum:
    POOL = 64  # blocks of memory kept for new states: fresh pages from the system cost more than the copy into them

cdef double LEAST = 1e-3      # part of the gap below which a child's gain makes no difference
cdef double BEYOND = 0.1      # how far to trust what the first dual step of a child leaves to further ones
cdef double LATER = 0.05      # promise of a node in contact, its slip undecided, beside that of an undecided one
cdef double FIRST = 0.25      # and that of an undecided one beside that of a node in contact, in a slow tree
cdef double DEPENDENT = 1e-10  # part of a unit normal outside the span of the active ones, below which it lies in it


cdef extern from "_dense.h" nogil:
    double dot "enumsol_dot"(const double *a, const double *b, Py_ssize_t n)
    void matvec "enumsol_matvec"(const double *M, Py_ssize_t rows, Py_ssize_t n, const double *v, double *out)
    void add_rows "enumsol_add_rows"(const double *M, Py_ssize_t rows, Py_ssize_t n, const double *c, double *out)
    void add_outer "enumsol_add_outer"(
        double t, const double *c, const double *z, Py_ssize_t rows, Py_ssize_t n, double *M)
    void rotate "enumsol_rotate"(double c, double s, double *a, double *b, Py_ssize_t n)
    void solve_upper "enumsol_solve_upper"(
        const double *R, Py_ssize_t n, Py_ssize_t q, const double *b, double *out)


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
        A row whose values are all zero is spare: `put_row` makes one of it.
    """

    cdef readonly Py_ssize_t n, k, m
    cdef object inverse
    cdef double[:, ::1] J0      # rows are the columns of L^{-T}
    cdef double[::1] x0, c
    cdef double[:, ::1] W
    cdef double[::1] w0
    cdef Py_ssize_t[::1] start, index
    cdef double[::1] value, rhs, norm
    cdef double f0
    cdef double *spare[POOL]    # memory of states that are no longer used
    cdef int spares

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
        self.inverse = inverse
        self.value, self.rhs, self.norm = value, rhs, norm
        norm[:] = 1.0
        given = np.unique(np.searchsorted(self.start, np.flatnonzero(value), side="right") - 1)
        if len(given):
            start = np.asarray(row_start)
            counts = np.diff(start)[given]
            entries = np.concatenate([np.arange(start[r], start[r + 1]) for r in given])
            # of x and w, a row each: their normals times L^{-1}
            units = np.vstack([inverse.T, np.asarray(W) @ inverse.T])
            terms = value[entries, None] * units[np.asarray(row_index)[entries]]
            norm[given] = np.linalg.norm(np.add.reduceat(terms, np.cumsum(counts) - counts), axis=1)
            value[entries] /= np.repeat(norm[given], counts)
            rhs[given] /= norm[given]

    def _norm(self, index, value):
        """Length of a row's normal in the norm of (2 S)^{-1}."""
        normal = np.zeros(self.n)
        Wa = np.asarray(self.W)
        for j, v in zip(index, value):
            if j < self.n:
                normal[j] += v
            else:
                normal += v * Wa[j - self.n]
        return np.linalg.norm(self.inverse @ normal)

    def put_row(self, Py_ssize_t r, index, value):
        """Make the row sum value * (x or w) >= 0 of a spare one, which no state may have switched on."""
        cdef Py_ssize_t j, a = self.start[r], room = self.start[r + 1] - self.start[r]
        if r < 0 or r >= self.m or len(index) > room:
            raise IndexError(r)
        norm = self._norm(index, value)
        for j in range(room):
            self.index[a + j] = index[j] if j < len(index) else 0
            self.value[a + j] = value[j] / norm if j < len(index) else 0.0
        self.norm[r] = norm
        self.rhs[r] = 0.0

    def __dealloc__(self):
        while self.spares > 0:
            self.spares -= 1
            free(self.spare[self.spares])

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
        cdef double s
        for j in range(self.start[r], self.start[r + 1]):
            i = self.index[j]
            if i < self.n:
                out[i] += t * self.value[j]
            else:
                s = t * self.value[j]
                add_rows(&self.W[i - self.n, 0], 1, self.n, &s, out)


cdef class BranchingRule:
    """Which contact node a partial assignment is branched on.

    Candidates are the nodes with the largest violation of complementarity at the minimiser. For each child of each of
    them one step of the dual method, without carrying it out, bounds the child's energy from below, and tells what
    further steps may add. The candidate whose children close most of the gap is taken, those rather that are undecided
    altogether, and the first one at once of which all children but one are excluded.

    In a slow tree, where one step closes little of the gap, nodes in contact are taken rather; shares of three children
    are compared with those of two by their geometric means, and only what one step proves is counted.

    Parameters
    ----------
    F : (p,) array
        Friction coefficients.
    slip_rows, slip_modes : (2, p) int arrays
        The row, and its mode, that puts lambda_t on the slip bound in slip+ and in slip-. Other rows are numbered
        kind * p + node as in enumsol.model.statuses.RowKind.
    candidates : int
        How many nodes are looked at.
    slow : bool
        The tree is slow.
    """

    cdef readonly Py_ssize_t p, candidates
    cdef readonly bint slow
    cdef double[::1] F, violation
    cdef Py_ssize_t[:, ::1] slip_row
    cdef signed char[:, ::1] slip_mode
    cdef Py_ssize_t[::1] order
    cdef signed char[::1] codes

    def __init__(self, F, slip_rows, slip_modes, candidates, slow=False):
        self.p = len(F)
        self.candidates = candidates
        self.slow = slow
        self.F = np.ascontiguousarray(F, dtype=np.float64)
        self.slip_row = np.ascontiguousarray(slip_rows, dtype=np.intp)
        self.slip_mode = np.ascontiguousarray(slip_modes, dtype=np.int8)
        self.violation = np.zeros(candidates)
        self.order = np.zeros(candidates, dtype=np.intp)
        self.codes = np.zeros(self.p, dtype=np.int8)

    cdef int take(self, codes) except -1:
        """Keep the codes that are looked at."""
        cdef Py_ssize_t i
        if len(codes) != self.p:
            raise ValueError(f"{len(codes)} codes; expected {self.p}")
        for i in range(self.p):
            self.codes[i] = codes[i]
        return 0


@cython.no_gc_clear
cdef class QPState:
    """One quadratic program of the tree: which rows are on, which are active, and the iterate."""

    cdef QPData data
    cdef double *block          # x, u (n each), w (k), J (n x n), R (n x n), then scratch: d, z, r, normal (n each)
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
    cdef int *on                # rows that are switched on (m)
    cdef int *position          # row that is on -> place in active, or -1 (m)
    cdef signed char *mode      # row -> 0 off, 1 inequality, 2 equality (m)
    cdef signed char *sign      # row -> orientation of an active equality (m)
    cdef Py_ssize_t ons
    cdef Py_ssize_t q
    cdef int pending            # row with a multiplier that is not active yet, or -1
    cdef double pending_u
    cdef double f
    cdef readonly long iterations
    cdef readonly double bound

    def __cinit__(self, QPData data):
        cdef Py_ssize_t n = data.n
        self.data = data
        if data.spares > 0:
            data.spares -= 1
            self.block = data.spare[data.spares]
        else:
            self.block = <double *> malloc((2 * n * n + 6 * n + data.k) * sizeof(double))
        self.active = <int *> malloc((n + 2 * data.m) * sizeof(int))
        self.mode = <signed char *> malloc(2 * data.m + 1)
        if self.block == NULL or self.active == NULL or self.mode == NULL:
            raise MemoryError
        self.x = self.block
        self.u = self.x + n
        self.w = self.u + n
        self.J = self.w + data.k
        self.R = self.J + n * n
        self.d = self.R + n * n
        self.z = self.d + n
        self.r = self.z + n
        self.normal = self.r + n
        self.on = self.active + n
        self.position = self.on + data.m
        self.sign = self.mode + data.m
        memset(self.mode, 0, data.m)

    def __init__(self, QPData data):
        self._restart()
        self.iterations = 0
        self.bound = self.f

    def __dealloc__(self):
        if self.block != NULL and self.data.spares < POOL:
            self.data.spare[self.data.spares] = self.block
            self.data.spares += 1
        else:
            free(self.block)
        free(self.active)
        free(self.mode)

    cdef void _restart(self) noexcept nogil:
        """Unconstrained minimum, nothing active."""
        cdef Py_ssize_t i, n = self.data.n
        memcpy(self.J, &self.data.J0[0, 0], n * n * sizeof(double))
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
        matvec(&self.data.W[0, 0], self.data.k, self.data.n, self.x, self.w)
        for i in range(self.data.k):
            self.w[i] += self.data.w0[i]

    cpdef QPState copy(self):
        """An independent state with the same rows and iterate."""
        cdef Py_ssize_t i, n = self.data.n
        cdef int row
        cdef QPState other = QPState.__new__(QPState, self.data)
        # of R only the triangle of the active rows means something
        memcpy(other.block, self.block, (2 * n + self.data.k + n * n) * sizeof(double))
        for i in range(self.q):
            memcpy(other.R + i * n + i, self.R + i * n + i, (self.q - i) * sizeof(double))
        memcpy(other.active, self.active, self.q * sizeof(int))
        memcpy(other.on, self.on, self.ons * sizeof(int))
        for i in range(self.ons):
            row = self.on[i]
            other.mode[row], other.sign[row], other.position[row] = self.mode[row], self.sign[row], self.position[row]
        other.ons = self.ons
        other.q, other.pending, other.f = self.q, self.pending, self.f
        other.iterations, other.bound = 0, self.bound
        return other

    def child(self, list rows, list modes, bint last, double target, double tolerance, long limit):
        """The state with further rows on, and how `solve` ended there; ``last``: this one is not used again."""
        cdef QPState child = self if last else self.copy()
        child.switch(rows, modes)
        return child, child.solve(target, tolerance, limit)

    cpdef switch(self, list rows, list modes):
        """Switch rows on: mode 1 inequality, 2 equality."""
        cdef Py_ssize_t j
        cdef int row
        for j in range(len(rows)):
            row = rows[j]
            if row < 0 or row >= self.data.m:
                raise IndexError(row)
            if self.mode[row] == 0:
                self.on[self.ons] = row
                self.ons += 1
                self.position[row] = -1
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
        cdef Py_ssize_t j, count = 0
        cdef double u
        cdef int row
        for j in range(self.q):
            count += self.u[j] != 0.0
        count += self.pending >= 0 and self.pending_u != 0.0
        rows, values = np.empty(count, dtype=np.intp), np.empty(count)
        count = 0
        cdef Py_ssize_t[::1] row_of = rows
        cdef double[::1] value_of = values
        for j in range(self.q + (self.pending >= 0)):
            row = self.active[j] if j < self.q else self.pending
            u = self.u[j] if j < self.q else self.pending_u
            if u != 0.0:
                row_of[count] = row
                value_of[count] = u * self.sign[row] / self.data.norm[row]
                count += 1
        return rows, values

    def at(self, Py_ssize_t i):
        """x and w number i."""
        if i < 0 or i >= self.data.k or i >= self.data.n:
            raise IndexError(i)
        return self.x[i], self.w[i]

    cdef double _dual_bound(self) noexcept nogil:
        """Lower bound proven by the current multipliers, computed from them and the data alone."""
        cdef Py_ssize_t j, i, n = self.data.n
        cdef double total = 0.0, t
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
        matvec(&self.data.J0[0, 0], n, n, self.normal, self.z)
        return total - 0.5 * dot(self.z, self.z, n)

    cdef void _project(self, int row, double sgn, Py_ssize_t first) noexcept nogil:
        """d = J'n for the row's normal n, turned by sgn; its components from the first on."""
        cdef Py_ssize_t i, j, at, n = self.data.n
        cdef double t
        cdef bint sparse = True
        for j in range(self.data.start[row], self.data.start[row + 1]):
            sparse = sparse and self.data.index[j] < n
        if not sparse:
            memset(self.normal, 0, n * sizeof(double))
            self.data.add_normal(row, sgn, self.normal)
            matvec(self.J + first * n, n - first, n, self.normal, self.d + first)
            return
        memset(self.d + first, 0, (n - first) * sizeof(double))
        for j in range(self.data.start[row], self.data.start[row + 1]):
            at, t = self.data.index[j], sgn * self.data.value[j]
            for i in range(first, n):
                self.d[i] += t * self.J[i * n + at]

    cdef Py_ssize_t _ratios(self, double *step) noexcept nogil:
        """r = R^{-1} d1; the active inequality whose multiplier vanishes first along r, or -1, and at which step."""
        cdef Py_ssize_t i, l = -1, n = self.data.n, q = self.q
        cdef double t
        step[0] = -1.0
        solve_upper(self.R, n, q, self.d, self.r)
        for i in range(q):
            if self.mode[self.active[i]] == 1 and self.r[i] > 0.0:
                t = self.u[i] / self.r[i]
                if t < 0.0:
                    t = 0.0
                if l < 0 or t < step[0]:
                    step[0] = t
                    l = i
        return l

    def gain(self, int row, int mode):
        """By how much one dual step on a row, imposed in that mode, raises the bound; inf: nothing is feasible."""
        cdef double most
        return self._gain(row, mode, False, &most)

    cdef double _share(self, int row, int mode, double gap, bint quick, double beyond) noexcept nogil:
        """The share of the gap that a row is expected to close; 1 where it is proven to; or, quick, the most."""
        cdef double most = 0.0, proven = fmin(self._gain(row, mode, quick, &most) / gap, 1.0)
        return proven + beyond * (fmin(most / gap, 1.0) - proven)

    cdef double _gain(self, int row, int mode, bint quick, double *most) noexcept nogil:
        """The gain; or, quick, the ``most`` that it can be with further steps: other multipliers left out of account."""
        cdef Py_ssize_t n = self.data.n
        cdef double t, t1, d2, s = self.data.row_at(row, self.x, self.w)
        cdef double sgn = -1.0 if (mode == 2 and s > 0.0) else 1.0
        s = -sgn * s
        if s <= SATISFIED or (self.mode[row] != 0 and self.position[row] >= 0):
            most[0] = 0.0
            return 0.0
        self._project(row, sgn, self.q if quick else 0)
        d2 = dot(self.d + self.q, self.d + self.q, n - self.q)
        most[0] = 0.5 * s * s / d2 if d2 > DEPENDENT * DEPENDENT else HUGE_VAL
        if quick:
            return most[0]
        self._ratios(&t1)
        if d2 <= DEPENDENT * DEPENDENT:
            return t1 * s if t1 >= 0.0 else HUGE_VAL
        t = s / d2
        if 0.0 <= t1 < t:
            t = t1
        return t * (s - 0.5 * t * d2)

    cdef double _promise(
        self, Py_ssize_t i, signed char code, BranchingRule rule, double gap, bint quick) noexcept nogil:
        """How far branching on a contact node closes the gap, by one dual step a child; HUGE_VAL: all but one child.

        A finite promise is less than 1.01.
        """
        cdef Py_ssize_t p = rule.p
        cdef double a, b, slip, beyond = 0.0 if rule.slow else BEYOND
        if code == UNDECIDED_:
            # open: no force; in contact: no gap
            a = self._share(<int> i, 2, gap, quick, beyond)
            if rule.F[i] > 0.0:
                a = fmax(a, self._share(<int> (p + i), 2, gap, quick, beyond))
            b = self._share(<int> (4 * p + i), 2, gap, quick, beyond)
            if a >= 1.0 or b >= 1.0:
                return HUGE_VAL
            return (FIRST if rule.slow else 1.0) * (a + LEAST) * (b + LEAST)
        # stick: no slip; slip: the slip bound is reached, and the slip has its sign
        slip = self._share(<int> (5 * p + i), 2, gap, quick, beyond)
        a = self._share(<int> rule.slip_row[0, i], rule.slip_mode[0, i], gap, quick, beyond)
        b = self._share(<int> rule.slip_row[1, i], rule.slip_mode[1, i], gap, quick, beyond)
        if self.w[p + i] < 0.0:
            a = fmax(a, slip)
        else:
            b = fmax(b, slip)
        if (slip >= 1.0) + (a >= 1.0) + (b >= 1.0) >= 2:
            return HUGE_VAL
        a = (slip + LEAST) * (a + LEAST) * (b + LEAST)
        return cbrt(a * a) if rule.slow else LATER * a

    def forced(self, given, BranchingRule rule, double target):
        """Undecided contact nodes of which one dual step excludes all children but one (see choose)."""
        cdef Py_ssize_t i
        cdef double gap = fmax(target - self.bound, 1e-300)
        rule.take(given)
        cdef signed char[::1] codes = rule.codes
        found = []
        for i in range(rule.p):
            if codes[i] == UNDECIDED_ and self._promise(i, codes[i], rule, gap, False) == HUGE_VAL:
                found.append(i)
        return tuple(found)

    def choose(self, codes, BranchingRule rule, double target):
        """The contact node to branch on, -1 when every node is decided (see BranchingRule).

        Parameters
        ----------
        codes : p status codes
            The partial assignment whose minimiser this state holds.
        rule : BranchingRule
        target : float
            The bound at which a partial assignment is pruned.
        """
        cdef Py_ssize_t best
        rule.take(codes)
        with nogil:
            best = self._choose(rule.codes, rule, target)
        return best

    cdef Py_ssize_t _choose(self, signed char[::1] codes, BranchingRule rule, double target) noexcept nogil:
        cdef Py_ssize_t i, j, k, count = 0, best = -1, p = rule.p
        cdef double slip, value, worth, most = -1.0, gap = fmax(target - self.bound, 1e-300)
        for i in range(p):
            if codes[i] < CONTACT_ or codes[i] > UNDECIDED_:
                continue
            slip = rule.F[i] * self.x[i] * fabs(self.w[p + i]) - self.x[p + i] * self.w[p + i]
            if codes[i] == UNDECIDED_:
                # an undecided node's slip counts double: deciding it now saves the slack that it leaves in the energy
                slip += slip - self.x[i] * self.w[i]
            # insertion among the largest violations
            j = count if count < rule.candidates else count - 1
            if count == rule.candidates and not slip > rule.violation[j]:
                continue
            while j > 0 and rule.violation[j - 1] < slip:
                rule.violation[j], rule.order[j] = rule.violation[j - 1], rule.order[j - 1]
                j -= 1
            rule.violation[j], rule.order[j] = slip, i
            if count < rule.candidates:
                count += 1
        if count == 1 or (count > 0 and rule.candidates == 1):
            return rule.order[0]
        for k in range(count):
            i = rule.order[k]
            worth = fmax(rule.violation[k], 1e-12)
            if rule.slow:
                worth = sqrt(worth)
            if best >= 0:
                # what cannot win is not looked at, or not closely
                if most >= 1.01 * worth:
                    break
                value = self._promise(i, codes[i], rule, gap, True)
                if value != HUGE_VAL and value * worth <= most:
                    continue
            value = self._promise(i, codes[i], rule, gap, False)
            if value == HUGE_VAL:
                return i
            value *= worth
            if value > most:
                most = value
                best = i
        return best

    cdef void _append(self, int row, double u) noexcept nogil:
        """Make a row active, d being J'n of its normal and z = J2 d2: a reflection of the columns from q on."""
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
            for i in range(n):
                self.z[i] -= norm * self.J[q * n + i]
            add_outer(-beta, v + q, self.z, n - q, n, self.J + q * n)
        elif v0 != 0.0:
            for i in range(n):
                self.J[q * n + i] = -self.J[q * n + i]
        self.active[q] = row
        self.position[row] = <int> q
        self.u[q] = u
        self.q = q + 1

    cdef void _drop(self, Py_ssize_t l) noexcept nogil:
        """Take the active row at place l out; Givens rotations restore the triangle, and d = J'n of a normal."""
        cdef Py_ssize_t i, j, n = self.data.n, q = self.q
        cdef double a, b, h, c, s
        self.position[self.active[l]] = -1
        for j in range(l + 1, q):
            self.active[j - 1] = self.active[j]
            self.position[self.active[j - 1]] = <int> (j - 1)
            self.u[j - 1] = self.u[j]
        for i in range(q):
            j = i if i > l + 1 else l + 1
            memmove(self.R + i * n + j - 1, self.R + i * n + j, (q - j) * sizeof(double))
            self.R[i * n + q - 1] = 0.0
        self.u[q - 1] = 0.0
        self.q = q - 1
        for j in range(l, q - 1):
            a = self.R[j * n + j]
            b = self.R[(j + 1) * n + j]
            h = sqrt(a * a + b * b)
            if h == 0.0:
                continue
            c = a / h
            s = b / h
            self.R[j * n + j] = h
            self.R[(j + 1) * n + j] = 0.0
            rotate(c, s, self.R + j * n + j + 1, self.R + (j + 1) * n + j + 1, q - 2 - j)
            rotate(c, s, self.J + j * n, self.J + (j + 1) * n, n)
            a = self.d[j]
            self.d[j] = c * a + s * self.d[j + 1]
            self.d[j + 1] = c * self.d[j + 1] - s * a

    cdef bint _polish(self, double most) noexcept nogil:
        """Project x back on the active rows (rounding drift) where a residual is above ``most``; whether one was."""
        cdef Py_ssize_t i, j, n = self.data.n
        cdef double s, worst = 0.0
        for i in range(self.q):
            self.d[i] = -self.sign[self.active[i]] * self.data.row_at(self.active[i], self.x, self.w)
            worst = fmax(worst, fabs(self.d[i]))
        if worst <= most:
            return False
        # solve R'y = -residual, x += J1 y
        for i in range(self.q):
            s = self.d[i] / self.R[i * n + i]
            self.d[i] = s
            for j in range(i + 1, self.q):
                self.d[j] -= s * self.R[i * n + j]
        add_rows(self.J, self.q, n, self.d, self.x)
        self._update_w()
        return True

    cpdef int solve(self, double target, double tolerance, long limit):
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
        cdef Py_ssize_t i, k, l, n = self.data.n
        cdef int row, polished = 0
        cdef double value, worst, sgn, d2, t, t1, t2, s
        cdef bint full
        # a state that its last child took over has counted those of its parents
        limit += self.iterations
        self.pending = -1
        while True:
            row = -1
            worst = tolerance
            for k in range(self.ons):
                i = self.on[k]
                if self.position[i] >= 0:
                    continue
                value = -self.data.row_at(i, self.x, self.w)
                if self.mode[i] == 2:
                    value = fabs(value)
                # of equals the first row, in whatever order they were switched on
                if value > worst or (value == worst and i < row):
                    worst = value
                    row = <int> i
            if row < 0:
                # drift of the active rows is mended before the answer is given
                if polished < 3 and self._polish(0.1 * tolerance):
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
            self._project(row, sgn, 0)
            while not full:
                self.iterations += 1
                if self.iterations > limit:
                    return STALLED_
                d2 = dot(self.d + self.q, self.d + self.q, n - self.q)
                l = self._ratios(&t1)
                if d2 > DEPENDENT * DEPENDENT:
                    t2 = -s / d2
                    if l >= 0 and t1 < t2:
                        t = t1
                    else:
                        t = t2
                        full = True
                    # x += t z, z = J2 d2
                    memset(self.z, 0, n * sizeof(double))
                    add_rows(self.J + self.q * n, n - self.q, n, self.d + self.q, self.z)
                    add_rows(self.z, 1, n, &t, self.x)
                    self.f += t * d2 * (0.5 * t + self.pending_u)
                    s += t * d2
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
                if not full:
                    self.u[l] = 0.0
                if not isfinite(self.f):
                    return STALLED_
                if s >= 0.0 or full:
                    # on a partial step satisfied by rounding: take it in as it stands
                    s = -0.0
                if self.f - self.pending_u * s > target:
                    self.bound = self._dual_bound()
                    if self.bound > target:
                        return EXCEEDED_
                if full:
                    self._append(row, self.pending_u)
                    self.pending = -1
                else:
                    self._drop(l)
            self._update_w()


cdef int OPTIMAL_ = 0
cdef int EXCEEDED_ = 1
cdef int STALLED_ = 2
cdef signed char CONTACT_ = CONTACT
cdef signed char UNDECIDED_ = UNDECIDED
cdef double SATISFIED = FEASIBILITY_TOLERANCE
