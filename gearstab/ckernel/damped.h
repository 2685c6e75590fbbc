/* Growth of damped patterns: rotations that decay in the real modal coordinates of each state.

   A pair of conjugate eigenvalues a +- ib takes two coordinates, a segment acts on them as e^{at} times a rotation by bt; a
   real eigenvalue takes one. */

#ifndef GEARSTAB_DAMPED_H
#define GEARSTAB_DAMPED_H

/* e^{at} cos bt and e^{at} sin bt of the m coordinates of a segment, divided by exp(growth). */
INLINE vec decaying_rotation(const struct damped *pattern, int64_t r, int64_t s, vec period, vec *cosine, vec *sine) {
    int64_t m = pattern->m, at = (r * pattern->states + pattern->state[s]) * m;
    double fraction = pattern->fractions[r * pattern->segments + s];
    const double *decay = pattern->decay + at, *frequency = pattern->frequency + at;
    double slowest = decay[0];
    for (int64_t i = 1; i < m; i++)
        slowest = decay[i] > slowest ? decay[i] : slowest;
    for (int64_t i = 0; i < m; i++) {
        vec size = decay[i] == slowest ? all(1.0) : exponential((decay[i] - slowest) * TURN * fraction * period);
        if (frequency[i] == 0) {
            cosine[i] = size;
            continue;
        }
        cosine_sine(all(frequency[i] * fraction), period, &cosine[i], &sine[i]);
        cosine[i + 1] = cosine[i] = cosine[i] * size;
        sine[i] = sine[i] * size;
        i++;
    }
    return slowest * TURN * fraction * period;
}

/* result = b q for `columns` vectors of m entries. */
INLINE void real_change(const double *b, int64_t m, int64_t columns, const vec *q, vec *result) {
    int64_t c = 0;
    for (; c + 3 < columns; c += 4) {
        const vec *q0 = q + c * m, *q1 = q0 + m, *q2 = q1 + m, *q3 = q2 + m;
        for (int64_t i = 0; i < m; i++) {
            const double *line = b + i * m;
            vec s0 = line[0] * q0[0], s1 = line[0] * q1[0], s2 = line[0] * q2[0], s3 = line[0] * q3[0];
            for (int64_t j = 1; j < m; j++)
                s0 += line[j] * q0[j], s1 += line[j] * q1[j], s2 += line[j] * q2[j], s3 += line[j] * q3[j];
            vec *to = result + c * m + i;
            to[0] = s0, to[m] = s1, to[2 * m] = s2, to[3 * m] = s3;
        }
    }
    for (; c < columns; c++)
        for (int64_t i = 0; i < m; i++) {
            vec sum = b[i * m] * q[c * m];
            for (int64_t j = 1; j < m; j++)
                sum += b[i * m + j] * q[c * m + j];
            result[c * m + i] = sum;
        }
}

/* One period, x (m, m) by columns, divided by exp(scale); work (m + 2, m). */
INLINE vec propagate_damped(const struct damped *pattern, int64_t r, vec period, vec *x, vec *work) {
    int64_t m = pattern->m;
    vec scale = all(0.0), *cosine = work, *sine = work + m, *q = work + 2 * m;
    for (int64_t i = 0; i < m * m; i++)
        x[i] = all(i % (m + 1) == 0);
    for (int64_t s = 0; s < pattern->segments; s++) {
        scale += decaying_rotation(pattern, r, s, period, cosine, sine);
        const double *frequency = pattern->frequency + (r * pattern->states + pattern->state[s]) * m;
        for (int64_t c = 0; c < m; c++)
            for (int64_t i = 0; i < m; i++) {
                vec *from = x + c * m + i, *to = q + c * m + i;
                if (frequency[i] == 0) {
                    to[0] = cosine[i] * from[0];
                    continue;
                }
                vec a = from[0], b = from[1];
                to[0] = cosine[i] * a + sine[i] * b;
                to[1] = cosine[i] * b - sine[i] * a;
                i++;
            }
        real_change(pattern->change + (r * pattern->segments + s) * m * m, m, m, q, x);
        if (s % RESCALE_EVERY != RESCALE_EVERY - 1 && s + 1 < pattern->segments)
            continue;
        vec size = largest_entry(x, m * m), factor = 1.0 / larger(size, all(DBL_MIN));
        scale += logarithm(larger(size, all(DBL_MIN)));
        for (int64_t i = 0; i < m * m; i++)
            x[i] = x[i] * factor;
    }
    return scale;
}

static int scan_damped(const struct damped *pattern, int64_t first, int64_t last, int64_t points, const double *omega,
                       double *growth, double *scale) {
    int64_t m = pattern->m;
    void *memory;
    vec *x = vectors(m * m + m * (m + 2) + 2 * m, &memory);
    if (!x)
        return -1;
    vec *work = x + m * m, *real = work + m * (m + 2), *imaginary = real + m;
    for (int64_t r = first; r < last; r++)
        for (int64_t k = 0; k < points; k += LANES) {
            vec period = pattern->cycles / load_part(omega + r * points, k, points);
            vec taken = propagate_damped(pattern, r, period, x, work), largest = all(0.0);
            /* The columns are the rows of the transpose, which has the same eigenvalues. */
            reduce_to_hessenberg(x, m, work);
            hessenberg_eigenvalues(x, m, real, imaginary);
            for (int64_t i = 0; i < m; i++)
                largest = larger(largest, real[i] * real[i] + imaginary[i] * imaginary[i]);
            store_part(scale + r * points, k, points, taken);
            store_part(growth + r * points, k, points, taken + 0.5 * logarithm(larger(largest, all(DBL_MIN))));
        }
    free(memory);
    return 0;
}

#endif
