/* Growth of damped patterns: rotations that decay in the real modal coordinates of each state.

   A pair of conjugate eigenvalues a +- ib takes two coordinates, a segment acts on them as e^{at} times a rotation by bt; a
   real eigenvalue takes one. Where states go with the mesh frequency each point has exponentials of its own instead. */

#ifndef GEARSTAB_DAMPED_H
#define GEARSTAB_DAMPED_H

#define MOST_SQUARE 5.0 /* size of matrices, squared: of larger ones too many points would be left to QR */
#define PRODUCTS_OF_EXPONENTIAL 10 /* about, with the one of its segment */

/* What follows segment s of row r, (m, m). */
INLINE const double *change_after(const struct damped *pattern, int64_t m, int64_t r, int64_t s) {
    return pattern->change + (r * pattern->changes + pattern->follows[s]) * m * m;
}

/* e^x for x <= 0, most often near 0: a scan at usual damping takes 7 % longer with the exponential everywhere. */
INLINE vec decay_by(vec x) { return any(x < -0.34) ? exponential(x) : 1.0 + small_expm1(x); }

/* e^{at} cos bt and e^{at} sin bt of the m coordinates in a fraction of the period spent in the state of segment s,
   divided by exp(growth), which is returned. paired: whether they go two by two, a pair of eigenvalues or two real ones. */
INLINE vec decaying_rotation(const struct damped *pattern, int64_t m, int paired, int64_t r, int64_t s, double fraction,
                             vec period, vec *cosine, vec *sine) {
    int64_t at = (r * pattern->states + pattern->state[s]) * m;
    const double *decay = pattern->decay + at, *frequency = pattern->frequency + at;
    double slowest = decay[0];
    UNROLLED for (int64_t i = 1; i < m; i++) /* in a segment that runs backwards: the fastest */
        slowest = (decay[i] > slowest) == (fraction > 0) ? decay[i] : slowest;
    vec time = TURN * fraction * period;
    UNROLLED for (int64_t i = 0; i < m; i++) {
        vec size = decay[i] == slowest ? all(1.0) : decay_by((decay[i] - slowest) * time);
        if (frequency[i] == 0) {
            cosine[i] = size, sine[i] = all(0.0);
            if (!paired)
                continue;
            i++;
            cosine[i] = decay[i] == slowest ? all(1.0) : decay_by((decay[i] - slowest) * time);
        } else {
            cosine_sine(all(frequency[i] * fraction), period, &cosine[i], &sine[i]);
            sine[i] = sine[i] * size;
            cosine[i] = cosine[i] * size;
            i++;
            cosine[i] = cosine[i - 1];
        }
    }
    return slowest * time;
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

/* The same for rotations that act on coordinates two by two. */
INLINE void first_blocks(const double *b, int64_t m, const vec *cosine, const vec *sine, vec *x) {
    UNROLLED for (int64_t j = 0; j < m; j += 2)
        UNROLLED for (int64_t i = 0; i < m; i++) {
            const double *at = b + i * m + j;
            x[j * m + i] = at[0] * cosine[j] - at[1] * sine[j];
            x[(j + 1) * m + i] = at[0] * sine[j] + at[1] * cosine[j + 1];
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

/* result = change (rotation x) for a whole matrix of even m, a constant where this is inlined; the rotation acts on
   coordinates two by two. */
INLINE void advance_blocks(const double *change, int64_t m, const vec *cosine, const vec *sine, vec *x) {
    for (int64_t c = 0; c < m; c += 2) { /* two columns: their sums stay in registers */
        vec sum[2][LARGEST_POWER];
        UNROLLED for (int64_t j = 0; j < m; j += 2) {
            UNROLLED for (int64_t k = 0; k < 2; k++) {
                const vec *column = x + (c + k) * m + j;
                vec first = cosine[j] * column[0] + sine[j] * column[1];
                vec second = cosine[j + 1] * column[1] - sine[j] * column[0];
                UNROLLED for (int64_t i = 0; i < m; i++) {
                    sum[k][i] = j ? sum[k][i] + change[i * m + j] * first : change[i * m + j] * first;
                    sum[k][i] += change[i * m + j + 1] * second;
                }
            }
        }
        UNROLLED for (int64_t k = 0; k < 2; k++)
            UNROLLED for (int64_t i = 0; i < m; i++)
                x[(c + k) * m + i] = sum[k][i];
    }
}

/* Divide x (m, m) by its size and add the logarithm of that to the scale. */
INLINE void normalise(vec *x, int64_t m, vec *scale) {
    vec size = larger(largest_entry(x, m * m), all(DBL_MIN)), factor = 1.0 / size;
    *scale += logarithm(size);
    for (int64_t i = 0; i < m * m; i++)
        x[i] = x[i] * factor;
}

/* The same for generators that go with the mesh frequency; work (7, m, m). Matrices are by columns, so that what is multiplied
   are the transposed ones. */
INLINE vec propagate_generators_of_size(const struct damped *pattern, int64_t m, int64_t r, vec period, vec *x, vec *work) {
    vec scale = all(0.0), omega = pattern->cycles / period, *moving = work, *a = work + m * m, *e = a + m * m;
    for (int64_t i = 0; i < m * m; i++)
        moving[i] = all(0.0);
    for (int64_t k = r * pattern->terms; k < (r + 1) * pattern->terms; k++) {
        const double *law = pattern->law + 3 * k, *b = pattern->by_speed + k * m * m;
        vec speed = law[0] * omega, square = speed * speed, factor = (law[1] == 2 ? square : speed) / (1.0 - law[2] * square);
        UNROLLED for (int64_t i = 0; i < m * m; i++)
            moving[i] += factor * b[i];
    }
    for (int64_t s = 0; s < pattern->segments; s++) {
        const double *own = pattern->generator + (r * pattern->states + pattern->state[s]) * m * m;
        vec time = TURN * pattern->fractions[r * pattern->segments + s] * period;
        UNROLLED for (int64_t i = 0; i < m; i++)
            UNROLLED for (int64_t j = 0; j < m; j++)
                a[j * m + i] = (own[i * m + j] + moving[i * m + j]) * time;
        scale += matrix_exponential(a, m, s ? e : x, e + m * m);
        if (s) {
            multiplied(x, e, m, a);
            UNROLLED for (int64_t i = 0; i < m * m; i++)
                x[i] = a[i];
        }
        if (m > FEW_COORDINATES && gearstab_stopped())
            break;
        if (s % RESCALE_EVERY == RESCALE_EVERY - 1 || s + 1 == pattern->segments)
            normalise(x, m, &scale);
    }
    return scale;
}

static NOT_INLINED vec propagate_generators(const struct damped *pattern, int64_t r, vec period, vec *x, vec *work) {
    switch (pattern->m) {
    case 4: return propagate_generators_of_size(pattern, 4, r, period, x, work);
    case 6: return propagate_generators_of_size(pattern, 6, r, period, x, work);
    default: return propagate_generators_of_size(pattern, pattern->m, r, period, x, work);
    }
}

/* Room for `matrices` of LANES points of a pattern and for work on them; NULL when there is none. */
static vec *damped_room(const struct damped *pattern, int64_t matrices, vec **work, void **memory) {
    int64_t m = pattern->m, more = pattern->generator ? 7 * m * m : m * (m + 4);
    more = more > m * (m + 4) ? more : m * (m + 4);
    vec *x = vectors(matrices * m * m + more, memory);
    *work = x ? x + matrices * m * m : NULL;
    return x;
}

/* What propagate_damped does, m a constant where this is inlined. */
INLINE vec propagate_damped_of_size(const struct damped *pattern, int64_t m, int paired, int64_t r, vec period, vec *x, vec *work) {
    vec scale = all(0.0), *cosine = work, *sine = work + m, *q = work + 2 * m;
    for (int64_t s = 0; s < pattern->segments; s++) {
        const double *frequency = pattern->frequency + (r * pattern->states + pattern->state[s]) * m;
        const double *change = change_after(pattern, m, r, s);
        double fraction = pattern->fractions[r * pattern->segments + s];
        scale += decaying_rotation(pattern, m, paired, r, s, fraction, period, cosine, sine);
        if (s == 0 && paired) {
            first_blocks(change, m, cosine, sine, x);
        } else if (s == 0) {
            first_rotation(change, frequency, m, cosine, sine, x);
        } else if (paired) {
            advance_blocks(change, m, cosine, sine, x);
        } else {
            rotate(frequency, m, cosine, sine, x, q);
            real_change(change, m, m, q, x);
        }
        if (m > FEW_COORDINATES && gearstab_stopped())
            break;
        if (s % RESCALE_EVERY == RESCALE_EVERY - 1 || (!paired && s + 1 == pattern->segments))
            normalise(x, m, &scale);
    }
    return scale;
}

/* One period, x (m, m) by columns, divided by exp(scale); work of damped_room. paired: whether all rotations act on
   coordinates two by two. Compiled once for each small size, as propagate. */
static NOT_INLINED vec propagate_damped(const struct damped *pattern, int paired, int64_t r, vec period, vec *x, vec *work) {
    if (pattern->generator)
        return propagate_generators(pattern, r, period, x, work);
    switch (paired ? pattern->m : 0) {
    case 2: return propagate_damped_of_size(pattern, 2, 1, r, period, x, work);
    case 4: return propagate_damped_of_size(pattern, 4, 1, r, period, x, work);
    case 6: return propagate_damped_of_size(pattern, 6, 1, r, period, x, work);
    default: return propagate_damped_of_size(pattern, pattern->m, 0, r, period, x, work);
    }
}

/* The characteristic polynomial of x (m, m), brought near size 1 first where it is not. */
INLINE void describe(vec *x, int64_t m, struct spectrum *of, vec *scale) {
    of->square = squared_size(x, m);
    if (any((of->square < 0x1p-40) | (of->square > 0x1p40))) {
        normalise(x, m, scale);
        of->square = squared_size(x, m);
    }
    characteristic_polynomial(x, m, of->e);
    of->rounding = ROUNDING;
}

/* propagate_damped and describe where m is 4 or 6 and the rotations go two by two. */
static NOT_INLINED vec describe_period(const struct damped *pattern, int64_t r, vec period, vec *x, vec *work,
                                       struct spectrum *of) {
    vec scale = propagate_damped(pattern, 1, r, period, x, work);
    if (pattern->m == 4)
        describe(x, 4, of, &scale);
    else
        describe(x, 6, of, &scale);
    return scale;
}

/* ---- e_1..e_(m-1) of M exp(rate T) at many mesh frequencies from those at few, see stretches.h; e_m is 1 for the rate that
   makes the determinant 1. They are of exponential type sum over segments and pairs of |fraction frequency| and of how
   much the decay differs from the mean. */

struct fit {
    struct cut cut;
    struct stretch stretch;
    double rate, square; /* of the size, the largest at the nodes */
    double noise;        /* as of classify */
};

INLINE void fit_cut(struct fit *of, const struct damped *pattern, int64_t m, int64_t r, int64_t points, const double *omega) {
    of->cut.type = of->rate = 0.0;
    for (int64_t s = 0; s < pattern->segments; s++) {
        int64_t at = (r * pattern->states + pattern->state[s]) * m;
        double fraction = TURN * pattern->fractions[r * pattern->segments + s], mean = 0.0;
        for (int64_t i = 0; i < m; i++)
            mean += pattern->decay[at + i] / (double)m;
        of->rate -= fraction * mean;
        for (int64_t i = 0; i < m; i++)
            of->cut.type += 0.5 * fabs(fraction) * hypot(pattern->frequency[at + i], pattern->decay[at + i] - mean);
    }
    int64_t segment = pattern->generator ? PRODUCTS_OF_EXPONENTIAL * m * m * m : 12 * m + m * m * (m + 2);
    cut_points(&of->cut, m - 1, pattern->cycles, (double)(pattern->segments * segment + m * m * m), points, omega);
}

/* The polynomials of a part; 0 if they cannot be trusted. */
INLINE int fit_set(struct fit *of, const struct damped *pattern, int64_t m, int64_t r, const struct part *part,
                   const double *omega, vec *x, vec *work) {
    double sample[MOST_FITTED][MOST_NODES], size = 1.0, left = 0.0;
    struct stretch *stretch = &of->stretch;
    double half, longest = stretch_over(stretch, part, pattern->cycles, omega, &half);
    const double *table = table_of(part->which);
    if (!table)
        return 0;
    of->square = 0.0;
    for (int64_t i = 0; i < stretch->nodes; i += LANES) {
        struct spectrum spectrum;
        vec period = periods_of_nodes(stretch, table, half, i);
        vec scale = describe_period(pattern, r, period, x, work, &spectrum);
        vec factor = exponential(scale + of->rate * period), power = factor, square = factor * factor * spectrum.square;
        mask known = square < MOST_SQUARE;
        for (int64_t j = 1; j < m; j++) {
            vec value = spectrum.e[j] * power;
            power = power * factor;
            store(&sample[j - 1][i], value);
            for (int64_t lane = 0; lane < LANES; lane++)
                size = fabs(value[lane]) > size ? fabs(value[lane]) : size;
        }
        if (any(~known))
            return 0;
        for (int64_t lane = 0; lane < LANES; lane++)
            of->square = square[lane] > of->square ? square[lane] : of->square;
    }
    for (int64_t j = 1; j < m; j++) {
        double own = transform(sample[j - 1], table, stretch->nodes, stretch->even[j - 1], stretch->odd[j - 1]);
        left = own > left ? own : left;
    }
    stretch->noise = ROUNDING * (2.0 + of->cut.type * longest / CLEAR_PHASE);
    of->noise = size * (1.0 / 3.0) * (1.0 + of->cut.type * longest / CLEAR_PHASE);
    return left <= LAST_TERMS * size;
}

/* What is known of the matrices at LANES periods of a stretch, times exp(rate T). */
INLINE void fit_at(const struct fit *of, int64_t m, vec period, struct spectrum *found, vec *scale) {
    stretch_at(&of->stretch, m - 1, period, found->e + 1);
    found->e[0] = found->e[m] = all(1.0);
    found->square = all(of->square);
    found->rounding = of->stretch.noise;
    *scale = -of->rate * period;
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
    for (int64_t k = 0; k < points && !gearstab_stopped(); k += LANES) {
        vec period = pattern->cycles / load_part(omega, k, points);
        vec taken = propagate_damped(pattern, 0, r, period, x, work);
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

/* The matrices of lanes whose modulus is not sure go to QR; x (m, m), those of the points from `at` on. */
INLINE void leave_to_qr(struct queue *queue, int64_t m, mask sure, int64_t at, int64_t end, const vec *x, double *growth,
                        vec *work) {
    for (int64_t lane = 0; lane < LANES && at + lane < end; lane++) {
        COUNT(sure[lane] ? SQUARED : LEFT_TO_QR, 1);
        if (sure[lane])
            continue;
        for (int64_t i = 0; i < m * m; i++)
            queue->x[i][queue->length] = x[i][lane];
        queue->point[queue->length++] = at + lane;
        if (queue->length == LANES)
            flush(queue, m, growth, work);
    }
}

/* Where multipliers are inverse in pairs, m = 4 or 6: the value from the polynomial of rho = lambda + 1/lambda, by the rules of
   traces.h; returns where it is sure. Squaring takes four times as long for roots that all lie on one circle. */
INLINE mask decide_pairs(const struct damped *pattern, int64_t m, const struct fit *fit, vec scale, struct spectrum *of) {
    vec factor = exponential(scale), square = factor * factor, s[3];
    s[0] = of->e[1] * factor;
    s[1] = of->e[2] * square - (double)(m / 2);
    s[2] = m == 6 ? of->e[3] * factor * square - 2.0 * s[0] : all(0.0);
    struct decision found = m == 6 ? classify(s, 3, pattern->limits, fit ? fit->noise : 0.0)
                                   : classify(s, 2, pattern->limits, fit ? fit->noise : 0.0);
    mask unstable = ~(found.stable | found.doubtful);
    vec growth = all(0.0);
    if (any(unstable))
        growth = choose(unstable, m == 6 ? growth_of(s, 3) : growth_of(s, 2), growth);
    of->value = growth - scale;
    return ~found.doubtful;
}

/* Points begin..end-1 of a row; small: whether m is 4 or 6, a constant where this is inlined, and the rotations go two by
   two; fit: where these points are interpolated. x (m, m), of BATCH such matrices if small, and work (m + 4, m). */
INLINE void scan_damped_points(const struct damped *pattern, int64_t m, int small, int64_t r, const struct fit *fit,
                               int64_t begin, int64_t end, const double *omega, double *growth, double *scale,
                               struct queue *queue, vec *x, vec *work) {
    struct spectrum spectrum[BATCH];
    const int64_t most = small ? BATCH : 1;
    for (int64_t k = begin; k < end && !gearstab_stopped(); k += most * LANES) {
        int64_t left = (end - k + LANES - 1) / LANES, count = left < most ? left : most;
        for (int64_t c = 0; c < count; c++) {
            vec period = pattern->cycles / load_part(omega, k + c * LANES, end), taken;
            if (fit)
                fit_at(fit, m, period, &spectrum[c], &taken);
            else if (small)
                taken = describe_period(pattern, r, period, x + c * m * m, work, &spectrum[c]);
            else
                taken = propagate_damped(pattern, 0, r, period, x, work);
            store_part(scale, k + c * LANES, end, taken);
        }
        if (small && !pattern->limits) {
            for (int64_t c = count; c % TOGETHER; c++)
                spectrum[c] = spectrum[count - 1];
            for (int64_t c = 0; c < count; c += TOGETHER)
                approximate(spectrum + c, m);
        }
        for (int64_t c = 0; c < count; c++) {
            int64_t at = k + c * LANES;
            vec taken = load_part(scale, at, end);
            mask sure = !small ? (mask){0}
                        : pattern->limits ? decide_pairs(pattern, m, fit, taken, spectrum + c)
                                          : refine(spectrum + c, m);
            vec value = choose(sure, spectrum[c].value, all(0.0));
            if (fit && any(~sure)) { /* QR takes a matrix */
                vec period = pattern->cycles / load_part(omega, at, end);
                vec own = describe_period(pattern, r, period, x + c * m * m, work, &spectrum[c]);
                taken = choose(sure, taken, own);
                store_part(scale, at, end, taken);
            }
            store_part(growth, at, end, taken + value);
            if (any(~sure))
                leave_to_qr(queue, m, sure, at, end, x + c * m * m, growth, work);
            else
                COUNT(SQUARED, end - at < LANES ? end - at : LANES);
        }
    }
    flush(queue, m, growth, work);
}

/* A row, in parts that are interpolated or not. */
INLINE void scan_damped_row(const struct damped *pattern, int64_t m, int small, int64_t r, int64_t points,
                            const double *omega, double *growth, double *scale, struct queue *queue, vec *x, vec *work) {
    struct fit fit;
    fit.cut.count = 1, fit.cut.part[0] = (struct part){0, points, -1};
    if (small)
        fit_cut(&fit, pattern, m, r, points, omega);
    for (int64_t k = 0; k < fit.cut.count; k++) {
        const struct part *part = fit.cut.part + k;
        int fitted = small && part->which >= 0 && fit_set(&fit, pattern, m, r, part, omega, x, work);
        scan_damped_points(pattern, m, small, r, fitted ? &fit : NULL, part->begin, part->end, omega, growth, scale, queue,
                           x, work);
    }
}

/* Whether all pairs of eigenvalues of a row begin at even places, as far as that matters. */
static int goes_in_pairs(const struct damped *pattern, int64_t r) {
    const double *frequency = pattern->frequency + r * pattern->states * pattern->m;
    if (pattern->generator)
        return pattern->m % 2 == 0;
    for (int64_t i = 0; i < pattern->states * pattern->m; i += 2)
        if (i + 1 == pattern->states * pattern->m || (frequency[i] == 0) != (frequency[i + 1] == 0))
            return 0;
    return 1;
}

static int scan_damped(const struct damped *pattern, int64_t first, int64_t last, int64_t points, const double *omega,
                       double *growth, double *scale, double *multipliers) {
    int64_t m = pattern->m, matrices = m > LARGEST_POWER ? 1 : BATCH;
    void *memory;
    vec *work, *x = damped_room(pattern, matrices + 1, &work, &memory);
    if (!x)
        return -1;
    struct queue queue = {.x = x + matrices * m * m};
    for (int64_t r = first; r < last && !gearstab_stopped(); r++) {
        const double *asked = omega + r * points;
        double *value = growth + r * points, *taken = scale + r * points;
        if (multipliers) {
            double *own = multipliers + r * points * m * 2;
            multipliers_row(pattern, m, r, points, asked, value, taken, own, x, work);
            continue;
        }
        switch (goes_in_pairs(pattern, r) ? m : 0) {
        case 4: scan_damped_row(pattern, 4, 1, r, points, asked, value, taken, &queue, x, work); break;
        case 6: scan_damped_row(pattern, 6, 1, r, points, asked, value, taken, &queue, x, work); break;
        default: scan_damped_row(pattern, m, 0, r, points, asked, value, taken, &queue, x, work);
        }
    }
    free(memory);
    return 0;
}

#endif
