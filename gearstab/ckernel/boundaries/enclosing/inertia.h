/* How many multipliers pass an angle theta of the unit circle between two periods, without eigenvalues.

   With M = [[A, B], [C, D]] the Morse index of krein.py is N(theta) = N_0 + s(S(theta)), s the number of negative eigenvalues of

       S(theta) = B^-1 A + D B^-1 - exp(i theta) B^-1 - exp(-i theta) B^-T,

   where N_0, the index with both ends held, is the same for all theta. A Hermitian matrix of n rows has its signs counted in
   n^3/6 complex operations, so that a few angles cost less than the multipliers.

   Nothing is pivoted. What that may spoil is seen: B^-1 A is symmetric, and the squares that are taken off the diagonal of S
   say how much larger than S its rounding errors may have become. */

#ifndef GEARSTAB_INERTIA_H
#define GEARSTAB_INERTIA_H

#define ASYMMETRIC 1e-9 /* of B^-1 A, over its largest entry */
#define GROWN 1e6       /* entries of S above this are not trusted: pairs 1e-6 rad apart are to be told by the signs of S */
#define WIDTH 4         /* columns that are summed together in registers */

/* from (rows, stride), its columns begin..begin+width-1: to[i] -= sum_k<last a[k step] from[k]. */
INLINE void take_off(const vec *a, int64_t step, int64_t last, const vec *from, int64_t stride, int64_t width, vec *to) {
    vec sum[WIDTH];
    UNROLLED for (int64_t u = 0; u < width; u++)
        sum[u] = to[u];
    for (int64_t k = 0; k < last; k++) {
        vec factor = a[k * step];
        UNROLLED for (int64_t u = 0; u < width; u++)
            sum[u] -= factor * from[k * stride + u];
    }
    UNROLLED for (int64_t u = 0; u < width; u++)
        to[u] = sum[u];
}

/* L and U of f (n, n), by rows, in its place, with the inverse of what stands on the diagonal. */
static void factors_of(vec *f, int64_t n) {
    for (int64_t k = 0; k < n; k++) {
        vec pivot = f[k * n + k], inverse = 1.0 / choose(pivot == 0.0, all(DBL_MIN), pivot);
        f[k * n + k] = inverse;
        for (int64_t i = k + 1; i < n; i++) {
            vec factor = f[i * n + k] = f[i * n + k] * inverse;
            for (int64_t j = k + 1; j < n; j++)
                f[i * n + j] -= factor * f[k * n + j];
        }
    }
}

/* Columns of r (n, stride) by those of f^-1 r, f being factors. */
INLINE void solve_columns(const vec *f, int64_t n, vec *r, int64_t stride, int64_t width) {
    for (int64_t i = 1; i < n; i++)
        take_off(f + i * n, 1, i, r, stride, width, r + i * stride);
    for (int64_t i = n - 1; i >= 0; i--) {
        take_off(f + i * n + i + 1, 1, n - 1 - i, r + (i + 1) * stride, stride, width, r + i * stride);
        UNROLLED for (int64_t u = 0; u < width; u++)
            r[i * stride + u] = r[i * stride + u] * f[i * n + i];
    }
}

/* Above the diagonal of k (n, n), and on it, B^-1 A + D B^-1, above that of r (n, 2n) the symmetric part of B^-1 times 2 and below
   it the skew one, from M in x (2n, 2n) by columns; returns where all can be trusted. */
static mask held_form(const vec *x, int64_t n, vec *k, vec *r) {
    int64_t m = 2 * n, j = 0;
    for (int64_t i = 0; i < n; i++)
        for (int64_t c = 0; c < n; c++) {
            k[i * n + c] = x[(n + c) * m + i];
            r[i * m + c] = all(i == c);
            r[i * m + n + c] = x[c * m + i];
        }
    factors_of(k, n);
    for (; j + WIDTH <= m; j += WIDTH)
        solve_columns(k, n, r + j, m, WIDTH);
    for (; j < m; j++)
        solve_columns(k, n, r + j, m, 1);
    vec size = all(0.0), apart = all(0.0);
    for (int64_t i = 0; i < n; i++)
        for (int64_t c = i; c < n; c++) {
            vec value = r[i * m + n + c], image = r[c * m + n + i];
            size = larger(larger(magnitude(value), magnitude(r[i * m + c])), size);
            apart = larger(magnitude(value - image), apart);
            k[i * n + c] = -0.5 * (value + image);
        }
    for (int64_t i = 0; i < n; i++) {
        int64_t c = i; /* -D B^-1, D[i][l] = x[(n + l) m + n + i] */
        for (; c + WIDTH <= n; c += WIDTH)
            take_off(x + n * m + n + i, m, n, r + c, m, WIDTH, k + i * n + c);
        for (; c < n; c++)
            take_off(x + n * m + n + i, m, n, r + c, m, 1, k + i * n + c);
    }
    for (int64_t i = 0; i < n; i++)
        for (int64_t c = i; c < n; c++) {
            vec value = r[i * m + c], image = r[c * m + i];
            k[i * n + c] = -k[i * n + c];
            r[c * m + i] = value - image;
            r[i * m + c] = value + image;
        }
    return (size < GROWN) & (apart < ASYMMETRIC * size);
}

/* Row i of re + i im (n, n), columns from j on, less what rows above take off; their multiples stand in its first i places. */
INLINE void take_rows(vec *re, vec *im, int64_t n, int64_t i, int64_t j, int64_t width) {
    vec a[WIDTH], b[WIDTH];
    UNROLLED for (int64_t u = 0; u < width; u++)
        a[u] = re[i * n + j + u], b[u] = im[i * n + j + u];
    for (int64_t k = 0; k < i; k++) {
        vec x = re[i * n + k], y = im[i * n + k];
        const vec *c = re + k * n + j, *d = im + k * n + j;
        UNROLLED for (int64_t u = 0; u < width; u++) {
            a[u] -= x * c[u], b[u] -= x * d[u];
            a[u] -= y * d[u], b[u] += y * c[u];
        }
    }
    UNROLLED for (int64_t u = 0; u < width; u++)
        re[i * n + j + u] = a[u], im[i * n + j + u] = b[u];
}

/* The number of negative eigenvalues of a Hermitian matrix, by the pivots of L D L^H (Sylvester's law of inertia), above whose
   diagonal it is given, and on it; *size: the largest that was taken off. */
static vec negative_of(vec *re, vec *im, int64_t n, vec *size) {
    vec count = all(0.0);
    *size = all(0.0);
    for (int64_t i = 0; i < n; i++) {
        int64_t j = i;
        for (; j + WIDTH <= n; j += WIDTH)
            take_rows(re, im, n, i, j, WIDTH);
        switch (n - j) {
        case 3: take_rows(re, im, n, i, j, 3); break;
        case 2: take_rows(re, im, n, i, j, 2); break;
        case 1: take_rows(re, im, n, i, j, 1); break;
        default: break;
        }
        vec pivot = re[i * n + i], inverse = 1.0 / choose(pivot == 0.0, all(DBL_MIN), pivot);
        count += choose(pivot < 0.0, all(1.0), all(0.0));
        for (j = i + 1; j < n; j++) {
            vec a = re[i * n + j], b = im[i * n + j];
            re[j * n + i] = a * inverse, im[j * n + i] = b * inverse;
            *size = larger((a * a + b * b) * magnitude(inverse), *size);
        }
    }
    return count;
}

/* S of an angle in each lane from what held_form leaves. */
static void form_at(const vec *k, const vec *r, int64_t n, vec angle, vec *re, vec *im) {
    vec cosine, sine;
    cosine_sine(angle, all(1.0 / TURN), &cosine, &sine);
    for (int64_t i = 0; i < n; i++) {
        re[i * n + i] = k[i * n + i] - cosine * r[2 * i * n + i];
        im[i * n + i] = all(0.0);
        for (int64_t j = i + 1; j < n; j++) {
            re[i * n + j] = k[i * n + j] - cosine * r[2 * i * n + j];
            im[i * n + j] = -sine * r[2 * j * n + i];
        }
    }
}

#endif
