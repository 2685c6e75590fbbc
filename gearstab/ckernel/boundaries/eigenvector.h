/* Eigenvectors of small real matrices by inverse iteration: complex numbers as pairs, matrices by rows. */

#ifndef GEARSTAB_EIGENVECTOR_H
#define GEARSTAB_EIGENVECTOR_H

/* LU factors of M - lambda, with partial pivoting; a pivot that vanishes is put to the size of rounding. In place of the pivots
   stand their inverses. m = 2n is a constant where this is inlined, as n is below. */
INLINE void factorise(const double *matrix, int64_t m, double re, double im, double *f, int64_t *pivot) {
    double size = 0.0;
    for (int64_t i = 0; i < m * m; i++) {
        int diagonal = i % (m + 1) == 0;
        f[2 * i] = matrix[i] - (diagonal ? re : 0.0), f[2 * i + 1] = diagonal ? -im : 0.0;
        size = fabs(matrix[i]) > size ? fabs(matrix[i]) : size;
    }
#define SQUARE(i, j) (f[2 * ((i) * m + (j))] * f[2 * ((i) * m + (j))] + f[2 * ((i) * m + (j)) + 1] * f[2 * ((i) * m + (j)) + 1])
    for (int64_t k = 0; k < m; k++) {
        int64_t best = k;
        for (int64_t i = k + 1; i < m; i++)
            best = SQUARE(i, k) > SQUARE(best, k) ? i : best;
        pivot[k] = best;
        for (int64_t j = 0; best != k && j < 2 * m; j++) {
            double kept = f[2 * k * m + j];
            f[2 * k * m + j] = f[2 * best * m + j], f[2 * best * m + j] = kept;
        }
        double *top = f + 2 * k * m, square = SQUARE(k, k);
        if (!(square > DBL_EPSILON * DBL_EPSILON * size * size)) {
            top[2 * k] = DBL_EPSILON * size, top[2 * k + 1] = 0.0;
            square = top[2 * k] * top[2 * k];
        }
        top[2 * k] /= square, top[2 * k + 1] /= -square;
        for (int64_t i = k + 1; i < m; i++) {
            double *line = f + 2 * i * m, x = line[2 * k], y = line[2 * k + 1];
            if (x == 0.0 && y == 0.0)
                continue;
            double p = x * top[2 * k] - y * top[2 * k + 1], q = x * top[2 * k + 1] + y * top[2 * k];
            line[2 * k] = p, line[2 * k + 1] = q;
            for (int64_t j = k + 1; j < m; j++) {
                line[2 * j] -= p * top[2 * j] - q * top[2 * j + 1];
                line[2 * j + 1] -= p * top[2 * j + 1] + q * top[2 * j];
            }
        }
    }
#undef SQUARE
}

/* v <- L^-1 P v. */
INLINE void forward(const double *f, const int64_t *pivot, int64_t m, double *v) {
    for (int64_t k = 0; k < m; k++) {
        int64_t other = pivot[k];
        for (int64_t part = 0; part < 2; part++) {
            double kept = v[2 * k + part];
            v[2 * k + part] = v[2 * other + part], v[2 * other + part] = kept;
        }
    }
    for (int64_t i = 0; i < m; i++)
        for (int64_t j = 0; j < i; j++) {
            const double *c = f + 2 * (i * m + j);
            v[2 * i] -= c[0] * v[2 * j] - c[1] * v[2 * j + 1];
            v[2 * i + 1] -= c[0] * v[2 * j + 1] + c[1] * v[2 * j];
        }
}

/* v <- U^-1 v, scaled to a largest entry of 1. */
INLINE void backward(const double *f, int64_t m, double *v) {
    double largest = 0.0;
    for (int64_t i = m - 1; i >= 0; i--) {
        for (int64_t j = i + 1; j < m; j++) {
            const double *c = f + 2 * (i * m + j);
            v[2 * i] -= c[0] * v[2 * j] - c[1] * v[2 * j + 1];
            v[2 * i + 1] -= c[0] * v[2 * j + 1] + c[1] * v[2 * j];
        }
        const double *c = f + 2 * (i * m + i);
        double x = v[2 * i], y = v[2 * i + 1];
        v[2 * i] = x * c[0] - y * c[1], v[2 * i + 1] = x * c[1] + y * c[0];
        largest = fabs(v[2 * i]) > largest ? fabs(v[2 * i]) : largest;
        largest = fabs(v[2 * i + 1]) > largest ? fabs(v[2 * i + 1]) : largest;
    }
    for (int64_t i = 0; i < 2 * m; i++)
        v[i] /= largest;
}

/* The eigenvector (m, 2) of exp(g + i phi) by inverse iteration, of whose rounds each leaves as much of the others as the
   multiplier is wrong by, over its distance from theirs; `which` makes those of equal multipliers differ. What is put in stands
   for L^-1 P of something just as arbitrary (Wilkinson). Room for factors (m, m, 2) and m pivots. */
INLINE void eigenvector(const double *matrix, int64_t m, double g, double phi, int64_t which, double *vector, double *factors,
                        int64_t *pivot) {
    factorise(matrix, m, exp(g) * cos(phi), exp(g) * sin(phi), factors, pivot);
    for (int64_t i = 0; i < m; i++) {
        vector[2 * i] = 1.0 + 0.37 * (double)((i * 5 + which * 3) % 7);
        vector[2 * i + 1] = 0.0;
    }
    backward(factors, m, vector);
    forward(factors, pivot, m, vector);
    backward(factors, m, vector);
}

#endif
