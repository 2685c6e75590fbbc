/* Products and moduli of multipliers at scattered points of damped patterns, each of a row of its own. */

#ifndef GEARSTAB_SCATTERED_H
#define GEARSTAB_SCATTERED_H

/* The number of points from `first` on, LANES at most, that belong to one row. */
INLINE int64_t together(const int64_t *row, int64_t first, int64_t last) {
    int64_t count = 1;
    while (count < LANES && first + count < last && row[first + count] == row[first])
        count++;
    return count;
}

static int products(const struct damped *pattern, int64_t first, int64_t last, const int64_t *row, const double *cycle,
                    double *matrix, double *scale) {
    const int64_t m = pattern->m;
    void *memory;
    vec *work, *x = damped_room(pattern, 1, &work, &memory);
    if (!x)
        return -1;
    for (int64_t k = first, count; k < last && !gearstab_stopped(); k += count) {
        count = together(row, k, last);
        vec period = pattern->cycles * load_part(cycle + k, 0, count);
        vec taken = propagate_damped(pattern, 0, row[k], period, x, work);
        for (int64_t lane = 0; lane < count; lane++) {
            double *to = matrix + (k + lane) * m * m;
            scale[k + lane] = taken[lane];
            for (int64_t i = 0; i < m; i++)
                for (int64_t j = 0; j < m; j++)
                    to[i * m + j] = x[j * m + i][lane];
        }
    }
    free(memory);
    return 0;
}

/* ln |lambda| of the multipliers of LANES points, descending; x (m, m), work (m + 4, m). */
INLINE void logs_of(const struct damped *pattern, int64_t m, int paired, int64_t r, vec period, int64_t count, vec *x,
                    vec *work, double *logs) {
    vec *real = work + 2 * m, *imaginary = work + 3 * m, scale = propagate_damped(pattern, paired, r, period, x, work);
    normalise(x, m, &scale);
    reduce_to_hessenberg(x, m, work);
    hessenberg_eigenvalues(x, m, real, imaginary);
    for (int64_t i = 0; i < m; i++) {
        vec square = real[i] * real[i] + imaginary[i] * imaginary[i];
        vec value = 0.5 * logarithm(larger(all(DBL_MIN), square)) + scale;
        for (int64_t lane = 0; lane < count; lane++) {
            double *of = logs + lane * m, own = square[lane] == square[lane] ? value[lane] : NAN;
            int64_t place = i;
            for (; place > 0 && !(of[place - 1] >= own); place--)
                of[place] = of[place - 1];
            of[place] = own;
        }
    }
}

static int moduli(const struct damped *pattern, int64_t first, int64_t last, const int64_t *row, const double *cycle,
                  double *logs) {
    const int64_t m = pattern->m;
    void *memory;
    vec *work, *x = damped_room(pattern, 1, &work, &memory);
    if (!x)
        return -1;
    for (int64_t k = first, count; k < last && !gearstab_stopped(); k += count) {
        count = together(row, k, last);
        vec period = pattern->cycles * load_part(cycle + k, 0, count);
        logs_of(pattern, m, goes_in_pairs(pattern, row[k]), row[k], period, count, x, work, logs + k * m);
    }
    free(memory);
    return 0;
}

#endif
