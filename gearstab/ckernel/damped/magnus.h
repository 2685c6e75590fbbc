/* Products of exponentials of Magnus steps, and eigenvalues of what they make, LANES of them side by side.

   What gearstab/propagation/magnus.py does, step by step the same: every lane halves its matrix as often as it needs, so that
   results do not depend on what else is computed. */

#ifndef GEARSTAB_MAGNUS_H
#define GEARSTAB_MAGNUS_H

enum { POWERS_OF_STEP = 5, MOST_HALVINGS = 1000 };

#define TAYLOR_REACH 0.299 /* REACH of magnus.py: the 1-norm up to which twelve terms are exact to rounding */

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

/* e = exp(a) (m, m), a is destroyed; work (4, m, m). By scaling and squaring, the polynomial by five products (Paterson &
   Stockmeyer 1973). */
INLINE void matrix_exponential(vec *a, int64_t m, vec *e, vec *work) {
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
    for (double done = 0; any(count > done); done++) {
        multiplied(e, e, m, other);
        UNROLLED for (int64_t i = 0; i < m * m; i++)
            e[i] = choose(count > done, other[i], e[i]);
    }
}

/* x (m, m) after all steps, and the logarithm of what was taken out of it; work (7, m, m). */
INLINE vec magnus_steps(const struct steps *of, int64_t m, vec period, vec *x, vec *work) {
    vec scale = all(0.0), *a = work, *e = work + m * m;
    for (int64_t s = 0; s < of->count && !(s % RESCALE_EVERY == 0 && gearstab_stopped()); s++) {
        const double *c = of->coefficients + s * POWERS_OF_STEP * m * m;
        vec step = of->length[s] * period, taken = of->growth[s] * step;
        UNROLLED for (int64_t i = 0; i < m * m; i++) {
            vec sum = all(c[(POWERS_OF_STEP - 1) * m * m + i]);
            UNROLLED for (int64_t k = POWERS_OF_STEP - 2; k >= 0; k--)
                sum = sum * step + c[k * m * m + i];
            a[i] = sum * step;
        }
        for (int64_t i = 0; i < m; i++)
            a[i * (m + 1)] -= taken;
        matrix_exponential(a, m, e, work + 2 * m * m);
        multiplied(e, x, m, a);
        UNROLLED for (int64_t i = 0; i < m * m; i++)
            x[i] = a[i];
        scale += taken;
        normalise(x, m, &scale);
    }
    return scale;
}

static int magnus(const struct steps *of, int64_t first, int64_t last, const double *period, double *matrix, double *scale) {
    const int64_t m = of->m;
    void *memory;
    vec *x = vectors(7 * m * m, &memory);
    if (!x)
        return -1;
    for (int64_t k = first; k < last && !gearstab_stopped(); k += LANES) {
        int64_t count = last - k < LANES ? last - k : LANES;
        vec asked = load_part(period + k, 0, count), taken;
        for (int64_t lane = 0; lane < LANES; lane++)
            for (int64_t i = 0; i < m * m; i++)
                x[i][lane] = matrix[(k + (lane < count ? lane : 0)) * m * m + i];
        switch (m) {
#define CASE(m) case m: taken = magnus_steps(of, m, asked, x, x + m * m); break;
        CASE(2) CASE(4) CASE(6) /* a pair of gears, trains of two and three coordinates: 1.3 to 1.8 times faster */
#undef CASE
        default: taken = magnus_steps(of, m, asked, x, x + m * m);
        }
        for (int64_t lane = 0; lane < count; lane++) {
            scale[k + lane] += taken[lane];
            for (int64_t i = 0; i < m * m; i++)
                matrix[(k + lane) * m * m + i] = x[i][lane];
        }
    }
    free(memory);
    return 0;
}

static int eigenvalues(int64_t first, int64_t last, int64_t m, const double *matrix, double *values) {
    void *memory;
    vec *x = vectors(m * m + 4 * m, &memory);
    if (!x)
        return -1;
    vec *real = x + m * m, *imaginary = real + m, *work = imaginary + m;
    for (int64_t k = first; k < last && !gearstab_stopped(); k += LANES) {
        int64_t count = last - k < LANES ? last - k : LANES;
        int known[LANES];
        for (int64_t lane = 0; lane < LANES; lane++) {
            const double *own = matrix + (k + (lane < count ? lane : 0)) * m * m;
            known[lane] = 1;
            for (int64_t i = 0; i < m * m; i++)
                known[lane] &= isfinite(own[i]);
            for (int64_t i = 0; i < m * m; i++)
                x[i][lane] = known[lane] ? own[i] : 0.0;
        }
        reduce_to_hessenberg(x, m, work);
        hessenberg_eigenvalues(x, m, real, imaginary);
        for (int64_t lane = 0; lane < count; lane++)
            for (int64_t i = 0; i < m; i++) {
                double *to = values + ((k + lane) * m + i) * 2;
                to[0] = known[lane] ? real[i][lane] : NAN;
                to[1] = known[lane] ? imaginary[i][lane] : NAN;
            }
    }
    free(memory);
    return 0;
}

#endif
