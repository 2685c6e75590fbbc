/* Growth of damped patterns: rotations that decay in the real modal coordinates of each state.

   A pair of conjugate eigenvalues a +- ib takes two coordinates, a segment acts on them as e^{at} times a rotation by bt; a
   real eigenvalue takes one. */

#ifndef GEARSTAB_DAMPED_H
#define GEARSTAB_DAMPED_H

/* e^{at} cos bt and e^{at} sin bt of the m coordinates of a segment, divided by exp(growth). */
INLINE vec decaying_rotation(const struct damped *pattern, int64_t m, int64_t r, int64_t s, vec period, vec *cosine,
                             vec *sine) {
    int64_t at = (r * pattern->states + pattern->state[s]) * m;
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
        UNROLLED for (int64_t i = 0; i < m; i++) {
            const double *line = b + i * m;
            vec s0 = line[0] * q0[0], s1 = line[0] * q1[0], s2 = line[0] * q2[0], s3 = line[0] * q3[0];
            UNROLLED for (int64_t j = 1; j < m; j++)
                s0 += line[j] * q0[j], s1 += line[j] * q1[j], s2 += line[j] * q2[j], s3 += line[j] * q3[j];
            vec *to = result + c * m + i;
            to[0] = s0, to[m] = s1, to[2 * m] = s2, to[3 * m] = s3;
        }
    }
    for (; c < columns; c++)
        for (int64_t i = 0; i < m; i++) {
            vec sum = b[i * m] * q[c * m];
            UNROLLED for (int64_t j = 1; j < m; j++)
                sum += b[i * m + j] * q[c * m + j];
            result[c * m + i] = sum;
        }
}

/* The first segment on the unit matrix. */
INLINE void first_rotation(const double *b, const double *frequency, int64_t m, const vec *cosine, const vec *sine, vec *x) {
    for (int64_t c = 0; c < m; c++) {
        int pair = frequency[c] != 0;
        for (int64_t i = 0; i < m; i++) {
            const double *at = b + i * m + c;
            x[c * m + i] = at[0] * cosine[c];
            if (pair) {
                x[c * m + i] -= at[1] * sine[c];
                x[(c + 1) * m + i] = at[0] * sine[c] + at[1] * cosine[c];
            }
        }
        c += pair;
    }
}

/* q = the rotation of a segment on the columns of x. */
INLINE void rotate(const double *frequency, int64_t m, const vec *cosine, const vec *sine, const vec *x, vec *q) {
    for (int64_t i = 0; i < m; i++) {
        vec c = cosine[i], s = sine[i];
        if (frequency[i] == 0) {
            UNROLLED for (int64_t k = i; k < m * m; k += m)
                q[k] = c * x[k];
            continue;
        }
        UNROLLED for (int64_t k = i; k < m * m; k += m) {
            q[k] = c * x[k] + s * x[k + 1];
            q[k + 1] = c * x[k + 1] - s * x[k];
        }
        i++;
    }
}

/* One period, x (m, m) by columns, divided by exp(scale); work (m + 2, m). */
INLINE vec propagate_damped(const struct damped *pattern, int64_t m, int64_t r, vec period, vec *x, vec *work) {
    vec scale = all(0.0), *cosine = work, *sine = work + m, *q = work + 2 * m;
    for (int64_t s = 0; s < pattern->segments; s++) {
        const double *frequency = pattern->frequency + (r * pattern->states + pattern->state[s]) * m;
        const double *change = pattern->change + (r * pattern->segments + s) * m * m;
        scale += decaying_rotation(pattern, m, r, s, period, cosine, sine);
        if (s == 0) {
            first_rotation(change, frequency, m, cosine, sine, x);
        } else {
            rotate(frequency, m, cosine, sine, x, q);
            real_change(change, m, m, q, x);
        }
        if (s % RESCALE_EVERY != RESCALE_EVERY - 1 && s + 1 < pattern->segments)
            continue;
        vec size = larger(largest_entry(x, m * m), all(DBL_MIN)), factor = 1.0 / size;
        scale += logarithm(size);
        for (int64_t i = 0; i < m * m; i++)
            x[i] = x[i] * factor;
    }
    return scale;
}

/* ln max |lambda| of x (m, m), which is destroyed; work (4, m). */
static vec largest_by_qr(vec *x, int64_t m, vec *work) {
    vec *real = work + 2 * m, *imaginary = work + 3 * m, largest = all(0.0);
    reduce_to_hessenberg(x, m, work);
    hessenberg_eigenvalues(x, m, real, imaginary);
    mask known = ~(mask){0};
    for (int64_t i = 0; i < m; i++) {
        vec square = real[i] * real[i] + imaginary[i] * imaginary[i];
        largest = larger(largest, square);
        known &= square == square;
    }
    return choose(known, 0.5 * logarithm(larger(largest, all(DBL_MIN))), all(NAN));
}

/* Matrices of single points that wait until LANES of them fill the QR algorithm. */
struct queue {
    vec *x; /* (m, m) */
    int64_t point[LANES];
    int64_t length;
};

/* Add ln max |lambda| of the waiting matrices to the growth of their points; work (4, m). */
static void flush(struct queue *queue, int64_t m, double *growth, vec *work) {
    if (!queue->length)
        return;
    for (int64_t lane = queue->length; lane < LANES; lane++)
        for (int64_t i = 0; i < m * m; i++)
            queue->x[i][lane] = i % (m + 1) == 0;
    vec value = largest_by_qr(queue->x, m, work);
    for (int64_t lane = 0; lane < queue->length; lane++)
        growth[queue->point[lane]] += value[lane];
    queue->length = 0;
}

/* All multipliers of a row over exp(scale), real and imaginary parts in turn, and the growth from the largest. */
static void multipliers_row(const struct damped *pattern, int64_t m, int64_t r, int64_t points, const double *omega,
                            double *growth, double *scale, double *multipliers, vec *x, vec *work) {
    vec *real = work + 2 * m, *imaginary = work + 3 * m;
    for (int64_t k = 0; k < points; k += LANES) {
        vec period = pattern->cycles / load_part(omega, k, points);
        vec taken = propagate_damped(pattern, m, r, period, x, work);
        vec value = largest_by_qr(x, m, work); /* leaves the eigenvalues in work */
        store_part(scale, k, points, taken);
        store_part(growth, k, points, taken + value);
        for (int64_t lane = 0; lane < LANES && k + lane < points; lane++)
            for (int64_t i = 0; i < m; i++) {
                double *to = multipliers + ((k + lane) * m + i) * 2;
                to[0] = real[i][lane], to[1] = imaginary[i][lane];
            }
    }
}

/* A row, m a constant where this is inlined for small ones; room (m, m) and (m + 4, m). */
INLINE void scan_damped_row(const struct damped *pattern, int64_t m, int64_t r, int64_t points, const double *omega,
                            double *growth, double *scale, struct queue *queue, vec *x, vec *work) {
    for (int64_t k = 0; k < points; k += LANES) {
        vec period = pattern->cycles / load_part(omega, k, points), value = all(0.0);
        vec taken = propagate_damped(pattern, m, r, period, x, work);
        mask sure = {0};
        if (m == 4 || m == 6)
            value = largest_modulus(x, m, &sure);
        store_part(scale, k, points, taken);
        store_part(growth, k, points, taken + choose(sure, value, all(0.0)));
        if (!any(~sure))
            continue;
        for (int64_t lane = 0; lane < LANES && k + lane < points; lane++) {
            if (sure[lane])
                continue;
            for (int64_t i = 0; i < m * m; i++)
                queue->x[i][queue->length] = x[i][lane];
            queue->point[queue->length++] = k + lane;
            if (queue->length == LANES)
                flush(queue, m, growth, work);
        }
    }
    flush(queue, m, growth, work);
}

static int scan_damped(const struct damped *pattern, int64_t first, int64_t last, int64_t points, const double *omega,
                       double *growth, double *scale, double *multipliers) {
    int64_t m = pattern->m;
    void *memory;
    vec *x = vectors(2 * m * m + m * (m + 4), &memory);
    if (!x)
        return -1;
    vec *work = x + 2 * m * m;
    struct queue queue = {.x = x + m * m};
    for (int64_t r = first; r < last; r++) {
        const double *asked = omega + r * points;
        double *value = growth + r * points, *taken = scale + r * points;
        if (multipliers) {
            double *own = multipliers + r * points * m * 2;
            multipliers_row(pattern, m, r, points, asked, value, taken, own, x, work);
            continue;
        }
        switch (m) {
        case 4: scan_damped_row(pattern, 4, r, points, asked, value, taken, &queue, x, work); break;
        case 6: scan_damped_row(pattern, 6, r, points, asked, value, taken, &queue, x, work); break;
        default: scan_damped_row(pattern, m, r, points, asked, value, taken, &queue, x, work);
        }
    }
    free(memory);
    return 0;
}

#endif
