/* Dense kernels of the compiled modules: row-major matrices, rows of n doubles, no aliasing between arguments.
 *
 * With GCC on x86-64 and glibc every kernel is compiled twice and the processor chooses at load time; the order of
 * summation, and whether products are fused, may therefore differ between machines. Callers must not depend on it.
 */
#ifndef ENUMSOL_KERNELS_H
#define ENUMSOL_KERNELS_H

#include <stddef.h>

#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__GLIBC__)
/* Levels and features, never the name of a processor: that is taken on this one only, and not on later ones. */
#if __GNUC__ >= 12
#define ENUMSOL_CLONES __attribute__((unused, target_clones("arch=x86-64-v3", "default")))
#else
#define ENUMSOL_CLONES __attribute__((unused, target_clones("avx2", "default")))
#endif
#elif defined(__GNUC__)
#define ENUMSOL_CLONES __attribute__((unused))
#else
#define ENUMSOL_CLONES
#endif

/* Four sums side by side: what a vector register holds, and what a compiler may not do by itself to a sum. */
#if defined(__GNUC__)
typedef double enumsol_four __attribute__((vector_size(32), aligned(8), may_alias));
#define ENUMSOL_LOAD(pointer) (*(const enumsol_four *)(pointer))
#define ENUMSOL_FOUR 1
#else
#define ENUMSOL_FOUR 0
#endif

/* sum of a_j b_j */
ENUMSOL_CLONES static double enumsol_dot(const double *a, const double *b, ptrdiff_t n)
{
    ptrdiff_t j = 0;
    double sum = 0.0;
#if ENUMSOL_FOUR
    enumsol_four s = {0.0, 0.0, 0.0, 0.0}, t = {0.0, 0.0, 0.0, 0.0};
    for (; j + 8 <= n; j += 8) {
        s += ENUMSOL_LOAD(a + j) * ENUMSOL_LOAD(b + j);
        t += ENUMSOL_LOAD(a + j + 4) * ENUMSOL_LOAD(b + j + 4);
    }
    s += t;
    sum = (s[0] + s[1]) + (s[2] + s[3]);
#endif
    for (; j < n; j++)
        sum += a[j] * b[j];
    return sum;
}

/* out_i = sum over j of M_ij v_j, i < rows */
ENUMSOL_CLONES static void enumsol_matvec(const double *M, ptrdiff_t rows, ptrdiff_t n, const double *v, double *out)
{
    ptrdiff_t i = 0, j;
#if ENUMSOL_FOUR
    for (; i + 4 <= rows; i += 4) {
        const double *a = M + i * n, *b = a + n, *c = b + n, *d = c + n;
        enumsol_four s = {0.0, 0.0, 0.0, 0.0}, t = s, u = s, w = s;
        double s1 = 0.0, t1 = 0.0, u1 = 0.0, w1 = 0.0;
        for (j = 0; j + 4 <= n; j += 4) {
            const enumsol_four x = ENUMSOL_LOAD(v + j);
            s += ENUMSOL_LOAD(a + j) * x;
            t += ENUMSOL_LOAD(b + j) * x;
            u += ENUMSOL_LOAD(c + j) * x;
            w += ENUMSOL_LOAD(d + j) * x;
        }
        for (; j < n; j++) {
            s1 += a[j] * v[j];
            t1 += b[j] * v[j];
            u1 += c[j] * v[j];
            w1 += d[j] * v[j];
        }
        out[i] = ((s[0] + s[1]) + (s[2] + s[3])) + s1;
        out[i + 1] = ((t[0] + t[1]) + (t[2] + t[3])) + t1;
        out[i + 2] = ((u[0] + u[1]) + (u[2] + u[3])) + u1;
        out[i + 3] = ((w[0] + w[1]) + (w[2] + w[3])) + w1;
    }
#endif
    for (; i < rows; i++) {
        double sum = 0.0;
        for (j = 0; j < n; j++)
            sum += M[i * n + j] * v[j];
        out[i] = sum;
    }
}

/* out_j += sum over i of c_i M_ij, i < rows */
ENUMSOL_CLONES static void enumsol_add_rows(const double *M, ptrdiff_t rows, ptrdiff_t n, const double *c, double *out)
{
    ptrdiff_t i = 0, j;
    for (; i + 4 <= rows; i += 4) {
        const double *a = M + i * n, *b = a + n, *d = b + n, *e = d + n;
        const double s = c[i], t = c[i + 1], u = c[i + 2], w = c[i + 3];
        j = 0;
#if ENUMSOL_FOUR
        for (; j + 4 <= n; j += 4)
            *(enumsol_four *)(out + j) += (s * ENUMSOL_LOAD(a + j) + t * ENUMSOL_LOAD(b + j))
                + (u * ENUMSOL_LOAD(d + j) + w * ENUMSOL_LOAD(e + j));
#endif
        for (; j < n; j++)
            out[j] += (s * a[j] + t * b[j]) + (u * d[j] + w * e[j]);
    }
    for (; i < rows; i++)
        for (j = 0; j < n; j++)
            out[j] += c[i] * M[i * n + j];
}

/* M_ij += t c_i z_j, i < rows */
ENUMSOL_CLONES static void enumsol_add_outer(double t, const double *c, const double *z, ptrdiff_t rows, ptrdiff_t n,
                                             double *M)
{
    ptrdiff_t i, j;
    for (i = 0; i < rows; i++) {
        double *row = M + i * n;
        const double s = t * c[i];
        j = 0;
#if ENUMSOL_FOUR
        for (; j + 4 <= n; j += 4)
            *(enumsol_four *)(row + j) += s * ENUMSOL_LOAD(z + j);
#endif
        for (; j < n; j++)
            row[j] += s * z[j];
    }
}

/* (a, b) = (c a + s b, c b - s a) */
ENUMSOL_CLONES static void enumsol_rotate(double c, double s, double *a, double *b, ptrdiff_t n)
{
    ptrdiff_t j = 0;
#if ENUMSOL_FOUR
    for (; j + 4 <= n; j += 4) {
        const enumsol_four x = ENUMSOL_LOAD(a + j), y = ENUMSOL_LOAD(b + j);
        *(enumsol_four *)(a + j) = c * x + s * y;
        *(enumsol_four *)(b + j) = c * y - s * x;
    }
#endif
    for (; j < n; j++) {
        const double x = a[j], y = b[j];
        a[j] = c * x + s * y;
        b[j] = c * y - s * x;
    }
}

/* out = R^-1 b for the upper triangle of order q in the first q rows and columns of R, whose rows are n doubles */
ENUMSOL_CLONES static void enumsol_solve_upper(const double *R, ptrdiff_t n, ptrdiff_t q, const double *b, double *out)
{
    ptrdiff_t i = q, j;
#if ENUMSOL_FOUR
    for (; i >= 4; i -= 4) {
        const double *d = R + (i - 1) * n, *c = d - n, *e = c - n, *a = e - n;
        enumsol_four s = {0.0, 0.0, 0.0, 0.0}, t = s, u = s, w = s;
        double s1 = b[i - 4], t1 = b[i - 3], u1 = b[i - 2], w1 = b[i - 1];
        for (j = i; j + 4 <= q; j += 4) {
            const enumsol_four x = ENUMSOL_LOAD(out + j);
            s += ENUMSOL_LOAD(a + j) * x;
            t += ENUMSOL_LOAD(e + j) * x;
            u += ENUMSOL_LOAD(c + j) * x;
            w += ENUMSOL_LOAD(d + j) * x;
        }
        w1 = (w1 - ((w[0] + w[1]) + (w[2] + w[3]))) / d[i - 1];
        u1 = (u1 - ((u[0] + u[1]) + (u[2] + u[3])) - c[i - 1] * w1) / c[i - 2];
        t1 = (t1 - ((t[0] + t[1]) + (t[2] + t[3])) - (e[i - 1] * w1 + e[i - 2] * u1)) / e[i - 3];
        s1 = (s1 - ((s[0] + s[1]) + (s[2] + s[3])) - ((a[i - 1] * w1 + a[i - 2] * u1) + a[i - 3] * t1)) / a[i - 4];
        out[i - 1] = w1;
        out[i - 2] = u1;
        out[i - 3] = t1;
        out[i - 4] = s1;
    }
#endif
    while (i-- > 0) {
        double sum = b[i];
        for (j = i + 1; j < q; j++)
            sum -= R[i * n + j] * out[j];
        out[i] = sum / R[i * n + i];
    }
}

#endif
