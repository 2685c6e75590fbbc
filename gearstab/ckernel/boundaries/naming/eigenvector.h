/* Eigenvectors of small real matrices by inverse iteration, LANES of them at once. */

#ifndef GEARSTAB_EIGENVECTOR_H
#define GEARSTAB_EIGENVECTOR_H

/* A complex number for each lane. */
struct pair {
    vec re, im;
};

INLINE struct pair times(struct pair a, struct pair b) {
    return (struct pair){a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
}

INLINE struct pair less(struct pair a, struct pair b) { return (struct pair){a.re - b.re, a.im - b.im}; }

INLINE vec square_of(struct pair a) { return a.re * a.re + a.im * a.im; }

/* Exchange a and b in some lanes. */
INLINE void exchange(mask where, struct pair *a, struct pair *b) {
    struct pair kept = *a;
    *a = (struct pair){choose(where, b->re, kept.re), choose(where, b->im, kept.im)};
    *b = (struct pair){choose(where, kept.re, b->re), choose(where, kept.im, b->im)};
}

/* Bring the row with the largest entry of column k to its place, in each lane its own, by exchanges with later rows i: lanes
   exchanged[k m + i]. Returns that entry's square. */
INLINE vec choose_pivot(struct pair *f, int64_t m, int64_t k, mask *exchanged) {
    vec best = square_of(f[k * m + k]);
    for (int64_t i = k + 1; i < m; i++) {
        vec own = square_of(f[i * m + k]);
        mask here = exchanged[k * m + i] = own > best;
        best = larger(own, best);
        if (!any(here))
            continue;
        for (int64_t j = 0; j < m; j++)
            exchange(here, f + k * m + j, f + i * m + j);
    }
    return best;
}

/* LU factors f (m, m), by rows, of x - lambda, with partial pivoting; x by columns. A pivot that vanishes is put to the size of
   rounding. In place of the pivots stand their inverses. m = 2n is a constant where this is inlined, as n is below. */
INLINE void factorise(const vec *x, int64_t m, struct pair lambda, struct pair *f, mask *exchanged) {
    vec least = DBL_EPSILON * largest_entry(x, m * m);
    for (int64_t i = 0; i < m; i++)
        for (int64_t j = 0; j < m; j++)
            f[i * m + j] = (struct pair){x[j * m + i], all(0.0)};
    for (int64_t i = 0; i < m; i++)
        f[i * m + i] = less(f[i * m + i], lambda);
    for (int64_t k = 0; k < m; k++) {
        vec square = choose_pivot(f, m, k, exchanged);
        mask fine = square > least * least;
        struct pair *top = f + k * m, own = {choose(fine, top[k].re, least), choose(fine, top[k].im, all(0.0))};
        vec over = 1.0 / larger(square_of(own), all(DBL_MIN));
        top[k] = (struct pair){own.re * over, -(own.im * over)};
        for (int64_t i = k + 1; i < m; i++) {
            struct pair *line = f + i * m, factor = line[k] = times(line[k], top[k]);
            for (int64_t j = k + 1; j < m; j++)
                line[j] = less(line[j], times(factor, top[j]));
        }
    }
}

/* v <- L^-1 P v. */
INLINE void forward(const struct pair *f, const mask *exchanged, int64_t m, struct pair *v) {
    for (int64_t k = 0; k < m; k++)
        for (int64_t i = k + 1; i < m; i++)
            exchange(exchanged[k * m + i], v + k, v + i);
    for (int64_t i = 0; i < m; i++)
        for (int64_t j = 0; j < i; j++)
            v[i] = less(v[i], times(f[i * m + j], v[j]));
}

/* v <- U^-1 v, scaled to a largest entry of 1. */
INLINE void backward(const struct pair *f, int64_t m, struct pair *v) {
    vec largest = all(DBL_MIN);
    for (int64_t i = m - 1; i >= 0; i--) {
        for (int64_t j = i + 1; j < m; j++)
            v[i] = less(v[i], times(f[i * m + j], v[j]));
        v[i] = times(v[i], f[i * m + i]);
        largest = larger(larger(magnitude(v[i].re), magnitude(v[i].im)), largest);
    }
    vec over = 1.0 / largest;
    for (int64_t i = 0; i < m; i++)
        v[i] = (struct pair){v[i].re * over, v[i].im * over};
}

/* The eigenvectors v (m,) of exp(g + i phi) by inverse iteration, of whose rounds each leaves as much of the others as the
   multiplier is wrong by, over its distance from theirs; `which` makes those of equal multipliers differ. What is put in stands
   for L^-1 P of something just as arbitrary (Wilkinson). Room for factors and exchanges (m, m). */
INLINE void eigenvector(const vec *x, int64_t m, vec g, vec phi, const int64_t *which, struct pair *v, struct pair *factors,
                        mask *exchanged) {
    struct pair lambda;
    vec size = exponential(g);
    cosine_sine(phi, all(1.0 / TURN), &lambda.re, &lambda.im);
    factorise(x, m, (struct pair){size * lambda.re, size * lambda.im}, factors, exchanged);
    for (int64_t i = 0; i < m; i++) {
        v[i] = (struct pair){all(0.0), all(0.0)};
        for (int64_t lane = 0; lane < LANES; lane++)
            v[i].re[lane] = 1.0 + 0.37 * (double)((i * 5 + which[lane] * 3) % 7);
    }
    backward(factors, m, v);
    forward(factors, exchanged, m, v);
    backward(factors, m, v);
}

#endif
