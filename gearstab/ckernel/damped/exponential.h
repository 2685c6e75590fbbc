/* Exponentials of matrices, LANES of them side by side.

   Every lane halves its matrix as often as it needs, so that results do not depend on what else is computed. */

#ifndef GEARSTAB_EXPONENTIAL_H
#define GEARSTAB_EXPONENTIAL_H

enum { MOST_HALVINGS = 1000, LONG = 9 /* halvings from which on a square may overflow, or what decays vanish */ };

/* Lay matrices (count, m, m) side by side, the first once more in lanes that have none, zeros for one that is not finite.
   Returns the lanes of finite ones. */
INLINE mask load_matrices(vec *x, int64_t m, const double *matrix, int64_t count) {
    mask finite = ~(mask){0};
    for (int64_t lane = 0; lane < LANES; lane++)
        for (int64_t i = 0; i < m * m; i++)
            x[i][lane] = matrix[(lane < count ? lane : 0) * m * m + i];
    for (int64_t i = 0; i < m * m; i++)
        finite &= x[i] - x[i] == 0.0;
    for (int64_t i = 0; i < m * m; i++)
        x[i] = choose(finite, x[i], all(0.0));
    return finite;
}

/* result = x y for matrices of vectors. */
INLINE void multiplied(const vec *x, const vec *y, int64_t m, vec *result) {
    for (int64_t i = 0; i < m; i++)
        UNROLLED for (int64_t j = 0; j < m; j++) {
            vec sum = x[i * m] * y[j];
            UNROLLED for (int64_t k = 1; k < m; k++)
                sum += x[i * m + k] * y[k * m + j];
            result[i * m + j] = sum;
        }
}

/* Divide x (m, m) by a power of two near its size and add its exponent: thousands of these sums round nothing. */
INLINE void divide_by_power(vec *x, int64_t m, vec *exponent) {
    vec own = smaller(exponent_of(larger(largest_entry(x, m * m), all(DBL_MIN))), all(1022.0));
    vec shifted = 0x1.8p52 - own, factor = (vec)(((bits)shifted + 1023) << 52);
    *exponent += own;
    for (int64_t i = 0; i < m * m; i++)
        x[i] = x[i] * factor;
}

/* The 1-norm up to which the backward error of twelve terms is below 2^-53 (Al-Mohy & Higham 2011, Table 3.1). */
#define TAYLOR_REACH 0.299

/* 1/k!, up to the degree that REACH belongs to. */
static const double TAYLOR[13] = {1.0,          1.0,           1.0 / 2,        1.0 / 6,         1.0 / 24,
                                  1.0 / 120,    1.0 / 720,     1.0 / 5040,     1.0 / 40320,     1.0 / 362880,
                                  1.0 / 3628800, 1.0 / 39916800, 1.0 / 479001600};

/* How often a (m, m) must be halved. */
INLINE vec halvings(const vec *a, int64_t m) {
    vec size = all(0.0);
    for (int64_t j = 0; j < m; j++) {
        vec sum = magnitude(a[j]);
        for (int64_t i = 1; i < m; i++)
            sum += magnitude(a[i * m + j]);
        size = larger(sum, size);
    }
    vec count = exponent_of(size * (1 / TAYLOR_REACH)) + 1.0;
    return choose(size > TAYLOR_REACH, smaller(count, all(MOST_HALVINGS)), all(0.0));
}

/* e += the terms of a Taylor polynomial from degree `from` on: powers 0 to 3 of a, times a^from. */
INLINE void add_terms(int64_t from, const vec *a, const vec *square, const vec *cube, int64_t m, vec *e) {
    UNROLLED for (int64_t i = 0; i < m * m; i++)
        e[i] += TAYLOR[from + 1] * a[i] + TAYLOR[from + 2] * square[i] + TAYLOR[from + 3] * cube[i];
    UNROLLED for (int64_t i = 0; i < m; i++)
        e[i * (m + 1)] += TAYLOR[from];
}

/* What matrix_exponential does, m a constant where this is inlined. */
INLINE vec matrix_exponential_of_size(vec *a, int64_t m, vec *e, vec *work) {
    vec *square = work, *cube = work + m * m, *fourth = work + 2 * m * m, *other = work + 3 * m * m;
    vec count = halvings(a, m), shifted = 0x1.8p52 - count;
    vec part = (vec)(((bits)shifted + 1023) << 52);
    UNROLLED for (int64_t i = 0; i < m * m; i++)
        a[i] = a[i] * part;
    multiplied(a, a, m, square);
    multiplied(square, a, m, cube);
    multiplied(square, square, m, fourth);
    UNROLLED for (int64_t i = 0; i < m * m; i++)
        e[i] = TAYLOR[12] * fourth[i];
    add_terms(8, a, square, cube, m, e);
    for (int64_t from = 4; from >= 0; from -= 4) {
        multiplied(e, fourth, m, other);
        UNROLLED for (int64_t i = 0; i < m * m; i++)
            e[i] = other[i];
        add_terms(from, a, square, cube, m, e);
    }
    vec exponent = all(0.0);
    for (double done = 0; any(count > done); done++) {
        multiplied(e, e, m, other);
        exponent = choose(count > done, exponent + exponent, exponent);
        UNROLLED for (int64_t i = 0; i < m * m; i++)
            e[i] = choose(count > done, other[i], e[i]);
        if (done >= LONG)
            divide_by_power(e, m, &exponent);
    }
    return LOG_TWO * exponent;
}

/* exp(a) (m, m) divided by exp of what is returned, in e; a is destroyed; work (4, m, m). By scaling and squaring, the
   polynomial by five products (Paterson & Stockmeyer 1973). Compiled once for each small size: a pair of gears, trains of
   two and three coordinates, 1.3 to 1.8 times faster. */
static NOT_INLINED vec matrix_exponential(vec *a, int64_t m, vec *e, vec *work) {
    switch (m) {
    case 2: return matrix_exponential_of_size(a, 2, e, work);
    case 4: return matrix_exponential_of_size(a, 4, e, work);
    case 6: return matrix_exponential_of_size(a, 6, e, work);
    default: return matrix_exponential_of_size(a, m, e, work);
    }
}

static int exponentials(int64_t first, int64_t last, int64_t m, const double *matrix, double *result) {
    void *memory;
    vec *a = vectors(6 * m * m, &memory);
    if (!a)
        return -1;
    vec *e = a + m * m, *work = e + m * m;
    for (int64_t k = first; k < last && !gearstab_stopped(); k += LANES) {
        int64_t count = last - k < LANES ? last - k : LANES;
        mask known = load_matrices(a, m, matrix + k * m * m, count);
        vec exponent = matrix_exponential(a, m, e, work) / LOG_TWO;
        for (int64_t lane = 0; lane < count; lane++)
            for (int64_t i = 0; i < m * m; i++)
                result[(k + lane) * m * m + i] = known[lane] ? ldexp(e[i][lane], (int)rint(exponent[lane])) : NAN;
    }
    free(memory);
    return 0;
}

#endif
