/* Propagation over one period in the modal coordinates of the segments, LANES mesh frequencies at once.

   The matrix is held by columns, x[column * 2n + i], i < n positions, then velocities. */

#ifndef GEARSTAB_MODAL_H
#define GEARSTAB_MODAL_H

#define TURN 6.283185307179586 /* 2 pi */
#define MOST_TURNS 0x1p45      /* a phase of more turns has no digit left; such points are doubtful */
#define RESCALE_EVERY 8        /* segments without exponential growth */

enum kind { OSCILLATING, GROWING, FREE };

/* One mode of one segment. */
struct mode {
    double phase;   /* frequency times the segment's part of the period; for a free mode that part alone. Segments that run
                       backwards, as those of a Magnus step may, have a negative one. */
    double frequency, inverse;
    enum kind kind;
};

/* One row of a pattern. */
struct row {
    int64_t n, segments;
    double cycles;
    const struct limits *limits;
    const double *change; /* (S, n, n) */
    struct mode *modes;   /* (S, n) */
    char *steady;         /* (S,), whether all modes of the segment oscillate */
    double highest;       /* the largest phase */
};

/* Room for a row of the pattern; release with row_free. */
INLINE int row_new(struct row *row, const struct conservative *pattern) {
    size_t count = (size_t)pattern->segments;
    row->n = pattern->n;
    row->segments = pattern->segments;
    row->cycles = pattern->cycles;
    row->limits = &pattern->limits;
    row->modes = malloc((count * (size_t)pattern->n + 1) * sizeof *row->modes);
    row->steady = malloc(count + 1);
    return row->modes && row->steady ? 0 : -1;
}

INLINE void row_free(struct row *row) {
    free(row->modes);
    free(row->steady);
}

static void row_set(struct row *row, const struct conservative *pattern, int64_t index) {
    int64_t n = pattern->n;
    row->change = pattern->change + index * pattern->segments * n * n;
    row->highest = 0.0;
    for (int64_t s = 0; s < pattern->segments; s++) {
        double fraction = pattern->fractions[index * pattern->segments + s];
        const double *squared = pattern->squared + (index * pattern->states + pattern->state[s]) * n;
        row->steady[s] = 1;
        for (int64_t i = 0; i < n; i++) {
            struct mode *mode = row->modes + s * n + i;
            mode->frequency = sqrt(fabs(squared[i]));
            mode->inverse = 1.0 / mode->frequency;
            mode->kind = squared[i] > 0 ? OSCILLATING : squared[i] < 0 ? GROWING : FREE;
            mode->phase = mode->kind == FREE ? fraction : mode->frequency * fraction;
            row->steady[s] &= mode->kind == OSCILLATING;
            row->highest = fabs(mode->phase) > row->highest ? fabs(mode->phase) : row->highest;
        }
    }
}

/* The period's length in turns per unit frequency, limited so that phases stay countable. */
INLINE vec period_of(const struct row *row, vec omega) {
    double most = MOST_TURNS / (row->highest + DBL_MIN);
    vec period = row->cycles / omega;
    return smaller(period, all(most < DBL_MAX ? most : DBL_MAX));
}

/* cos(w t), sin(w t)/w and -w sin(w t) of the n modes of a segment, all divided by exp(growth). Without a way of their own for
   steady segments a scan takes 10 to 13 % longer. */
INLINE vec rotation(const struct mode *mode, int64_t n, int steady, vec period, vec *cosine, vec *over, vec *times) {
    vec growth = all(0.0);
    if (steady) {
        for (int64_t i = 0; i < n; i++) {
            vec sine;
            cosine_sine(all(mode[i].phase), period, &cosine[i], &sine);
            over[i] = sine * mode[i].inverse;
            times[i] = sine * -mode[i].frequency;
        }
        return growth;
    }
    for (int64_t i = 0; i < n; i++)
        if (mode[i].kind == GROWING)
            growth = larger(growth, TURN * (fabs(mode[i].phase) * period));
    vec shrink = exponential(-growth);
    for (int64_t i = 0; i < n; i++) {
        if (mode[i].kind == FREE) {
            cosine[i] = shrink;
            over[i] = shrink * (TURN * mode[i].phase * period);
            times[i] = all(0.0);
            continue;
        }
        vec sine;
        if (mode[i].kind == OSCILLATING) {
            cosine_sine(all(mode[i].phase), period, &cosine[i], &sine);
            cosine[i] = cosine[i] * shrink;
            sine = sine * shrink;
            times[i] = sine * -mode[i].frequency;
        } else {
            vec x = TURN * (fabs(mode[i].phase) * period);
            vec up = 0.5 * exponential(x - growth), down = 0.5 * exponential(-x - growth);
            cosine[i] = up + down;
            sine = choose(x < 1.0, shrink * small_sinh(smaller(x, all(1.0))), up - down);
            sine = mode[i].phase < 0 ? -sine : sine;
            times[i] = sine * mode[i].frequency;
        }
        over[i] = sine * mode[i].inverse;
    }
    return growth;
}

INLINE vec largest_entry(const vec *x, int64_t count) {
    vec size = all(0.0);
    for (int64_t k = 0; k < count; k++)
        size = larger(magnitude(x[k]), size);
    return size;
}

/* Divide the lanes that have grown beyond `large`. */
INLINE void scale_down(vec *x, int64_t count, double large, vec *scale) {
    vec size = largest_entry(x, count);
    mask big = size > large;
    if (!any(big))
        return;
    vec factor = choose(big, 1.0 / size, all(1.0));
    *scale = choose(big, *scale + logarithm(size), *scale);
    for (int64_t k = 0; k < count; k++)
        x[k] = x[k] * factor;
}

/* Undo the scaling of lanes that did not need it in the end. */
INLINE void scale_back(vec *x, int64_t count, double large, vec *scale) {
    if (!any(*scale != 0.0))
        return;
    vec size = largest_entry(x, count);
    mask small = (*scale != 0.0) & (*scale + logarithm(size + DBL_MIN) < log(large));
    vec factor = choose(small, exponential(*scale), all(1.0));
    *scale = choose(small, all(0.0), *scale);
    for (int64_t k = 0; k < count; k++)
        x[k] = x[k] * factor;
}

/* The columns b q of four vectors q, b (n, n) the same for all lanes: q and result (4, n). */
static void change_basis(const double *b, int64_t n, const vec *q, vec *const result[4]) {
    int64_t i = 0;
    for (; i + 3 < n; i += 4) {
        const double *b0 = b + i * n, *b1 = b0 + n, *b2 = b1 + n, *b3 = b2 + n;
        for (int part = 0; part < 4; part += 2) {
            const vec *u = q + part * n, *v = u + n;
            vec s0 = b0[0] * u[0], s1 = b1[0] * u[0], s2 = b2[0] * u[0], s3 = b3[0] * u[0];
            vec t0 = b0[0] * v[0], t1 = b1[0] * v[0], t2 = b2[0] * v[0], t3 = b3[0] * v[0];
            for (int64_t j = 1; j < n; j++) {
                vec a = u[j], c = v[j];
                s0 += b0[j] * a, s1 += b1[j] * a, s2 += b2[j] * a, s3 += b3[j] * a;
                t0 += b0[j] * c, t1 += b1[j] * c, t2 += b2[j] * c, t3 += b3[j] * c;
            }
            vec *x = result[part] + i, *y = result[part + 1] + i;
            x[0] = s0, x[1] = s1, x[2] = s2, x[3] = s3;
            y[0] = t0, y[1] = t1, y[2] = t2, y[3] = t3;
        }
    }
    for (; i < n; i++)
        for (int part = 0; part < 4; part++) {
            vec sum = b[i * n] * q[part * n];
            for (int64_t j = 1; j < n; j++)
                sum += b[i * n + j] * q[part * n + j];
            result[part][i] = sum;
        }
}

/* One segment on two columns of the matrix; work (4, n). */
INLINE void advance_pair(int64_t n, const double *change, const vec *cosine, const vec *over, const vec *times,
                         vec *columns, vec *work) {
    vec *const result[4] = {columns, columns + n, columns + 2 * n, columns + 3 * n};
    for (int64_t half = 0; half < 2; half++) {
        vec *position = result[2 * half], *velocity = result[2 * half + 1], *q = work + 2 * half * n;
        for (int64_t i = 0; i < n; i++) {
            vec p = position[i], v = velocity[i];
            q[i] = cosine[i] * p + over[i] * v;
            q[n + i] = times[i] * p + cosine[i] * v;
        }
    }
    change_basis(change, n, work, result);
}

/* The same on one column for n <= 3, a constant where this is inlined; everything stays in registers. A scan that advances
   pairs of columns here too takes 1.1 times as long for 4 segments, and 1.2 times for 16. */
INLINE void advance_column(int64_t n, const double *change, const vec *cosine, const vec *over, const vec *times, vec *x) {
    vec position[3], velocity[3];
    UNROLLED for (int64_t j = 0; j < n; j++) {
        vec p = cosine[j] * x[j] + over[j] * x[n + j], v = times[j] * x[j] + cosine[j] * x[n + j];
        UNROLLED for (int64_t i = 0; i < n; i++) {
            double b = change[i * n + j];
            position[i] = j ? position[i] + b * p : b * p;
            velocity[i] = j ? velocity[i] + b * v : b * v;
        }
    }
    UNROLLED for (int64_t i = 0; i < n; i++)
        x[i] = position[i], x[n + i] = velocity[i];
}

/* The first segment on the unit matrix. */
INLINE void first_segment(int64_t n, const double *change, const vec *cosine, const vec *over, const vec *times, vec *x) {
    for (int64_t j = 0; j < n; j++)
        for (int64_t i = 0; i < n; i++) {
            double b = change ? change[i * n + j] : i == j;
            vec *from_position = x + j * 2 * n + i, *from_velocity = x + (n + j) * 2 * n + i;
            from_position[0] = b * cosine[j], from_position[n] = b * times[j];
            from_velocity[0] = b * over[j], from_velocity[n] = b * cosine[j];
        }
}

/* What propagate does, n a constant where this is inlined. */
INLINE vec propagate_of_size(const struct row *row, int64_t n, vec period, vec *x, vec *work) {
    vec *cosine = work, *over = work + n, *times = work + 2 * n, *pair = work + 3 * n;
    const double *change = row->segments > 1 ? row->change : NULL; /* a single state has a single set of modes */
    vec scale = all(0.0);
    for (int64_t s = 0; s < row->segments; s++) {
        scale += rotation(row->modes + s * n, n, row->steady[s], period, cosine, over, times);
        if (s == 0) {
            first_segment(n, change, cosine, over, times, x);
            continue;
        }
        if (n <= 3)
            UNROLLED for (int64_t column = 0; column < 2 * n; column++)
                advance_column(n, change + s * n * n, cosine, over, times, x + column * 2 * n);
        else
            for (int64_t column = 0; column < n; column++)
                advance_pair(n, change + s * n * n, cosine, over, times, x + column * 4 * n, pair);
        if (n > FEW_COORDINATES && gearstab_stopped())
            break;
        if (s % RESCALE_EVERY == RESCALE_EVERY - 1 || !row->steady[s])
            scale_down(x, 4 * n * n, row->limits->large, &scale);
    }
    scale_back(x, 4 * n * n, row->limits->large, &scale);
    return scale;
}

/* The monodromy matrix times exp(-scale) in the modes of the first segment, x (2n, 2n) by columns; work (7, n). Compiled once
   for each small size: inlined wherever it is called it would take most of the time of a build. */
static NOT_INLINED vec propagate(const struct row *row, vec period, vec *x, vec *work) {
    switch (row->n) {
    case 1: return propagate_of_size(row, 1, period, x, work);
    case 2: return propagate_of_size(row, 2, period, x, work);
    case 3: return propagate_of_size(row, 3, period, x, work);
    default: return propagate_of_size(row, row->n, period, x, work);
    }
}

#endif
