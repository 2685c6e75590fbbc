/* Which modes and frequencies carry unstable Floquet solutions: the shares of labels.py.

   u(t) = exp((g + i phi) t/T) sum_k c_k exp(2 pi i k t/T) obeys u'' + K_s u = 0 on each segment, so that with w = (phi + 2 pi k
   - i g)/T and the modes V and squared frequencies of its state

       int u exp(-i w t) dt = V (w^2 - squared)^-1 V^T [(u' + i w u) exp(-i w t)]

   between its ends: boundary values are all that is needed, and segments of the same state are summed before the division.
   Harmonics run side by side in vector registers. */

#ifndef GEARSTAB_ACTIONS_H
#define GEARSTAB_ACTIONS_H

#define BAND 1.25  /* harmonics up to this times the largest frequency of any state */
#define LEADING 5 /* parts of each sign that are looked at, */
#define LEAST 1e-3 /* unless they carry less than this of the action of their sign */
#define LARGEST_MATRIX 1e6 /* entries of M above this leave too few digits, as in points.py */

/* A complex number for each lane. */
struct pair {
    vec re, im;
};

INLINE struct pair times(struct pair a, struct pair b) {
    return (struct pair){a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
}

/* Parts of the action: the largest of one sign. */
struct leader {
    double value;
    int64_t mode, harmonic;
};

/* Where a segment begins and the state changes. */
struct change {
    int64_t before, after, segment;
};

/* Room for the points of a pattern. */
struct actors {
    struct spectra *spectra;
    int64_t n, segments, states, most; /* most: room for shares of a point */
    int64_t changes;
    struct change *change; /* ordered by states */
    double *modes;     /* (D, n, n) of the row: from the modes of a state to the mean ones */
    double *matrix;    /* (2n, 2n), row-major */
    double *factors;   /* (2n, 2n, 2), of M - lambda */
    double *vector;    /* (2n, 2), the solution's start */
    double *ends;      /* (S, 2n, 2), u and u' in mean coordinates where a segment begins, without exp((g + i phi) t/T) */
    double *begins;    /* (S,), t/T */
    double highest;    /* of the frequencies of all states of the row */
    struct pair *turn, *step;  /* (S,), exp(-2 pi i k t/T) and what it changes by from LANES harmonics to the next */
    struct pair *rising, *falling, *rise; /* (S,), of the row: turn of k = 0, 1, ... and of k = -1, -2, ..., step upwards */
    struct pair *jump; /* (D, 2n), sums of boundary values */
    struct pair *total; /* (n,) */
    vec *kept;          /* (2n, 2n), the matrices by columns */
    struct share *found;
    int64_t *pivot;
    void *memory, *plain;
};

static void actors_free(struct actors *a) {
    spectra_free(a->spectra);
    free(a->memory);
    free(a->plain);
    free(a->found);
    free(a->change);
}

static int same_states(const struct change *a, const struct change *b) {
    return a->before == b->before && a->after == b->after;
}

/* All changes of state of a period, alike ones together. */
static void order_changes(struct actors *a, const struct conservative *p) {
    for (int64_t s = 0; s < p->segments; s++) {
        struct change own = {p->state[s ? s - 1 : p->segments - 1], p->state[s], s};
        int64_t place = 0;
        if (own.before == own.after)
            continue;
        while (place < a->changes && !same_states(a->change + place, &own))
            place++;
        memmove(a->change + place + 1, a->change + place, (size_t)(a->changes - place) * sizeof own);
        a->change[place] = own;
        a->changes++;
    }
}

static int actors_new(struct actors *a, const struct conservative *exact, const struct conservative *coarse) {
    size_t n = (size_t)exact->n, segments = (size_t)coarse->segments, states = (size_t)coarse->states;
    *a = (struct actors){.n = exact->n, .segments = coarse->segments, .states = coarse->states};
    a->most = LEADING * LEADING * exact->n;
    a->spectra = spectra_new(exact);
    vec *room = vectors((int64_t)(2 * (5 * segments + 2 * states * n + n) + 4 * n * n), &a->memory);
    double *plain = malloc((4 * n * n + 8 * n * n + 4 * n + segments * (4 * n + 1) + 2 * n) * sizeof *plain);
    a->plain = plain;
    a->found = malloc((size_t)a->most * sizeof *a->found);
    a->change = malloc(segments * sizeof *a->change);
    if (!a->spectra || !room || !plain || !a->found || !a->change)
        return -1;
    order_changes(a, coarse);
    a->turn = (struct pair *)room, a->step = a->turn + segments, a->rising = a->step + segments;
    a->falling = a->rising + segments, a->rise = a->falling + segments, a->jump = a->rise + segments;
    a->total = a->jump + 2 * states * n, a->kept = (vec *)(a->total + n);
    a->matrix = plain, a->factors = a->matrix + 4 * n * n, a->vector = a->factors + 8 * n * n;
    a->ends = a->vector + 4 * n, a->begins = a->ends + 4 * n * segments, a->pivot = (int64_t *)(a->begins + segments);
    return 0;
}

/* to (n, 2) = b from, b (n, n). */
INLINE void transformed(const double *b, int64_t n, const double *from, double *to) {
    for (int64_t i = 0; i < n; i++) {
        double x = 0.0, y = 0.0;
        for (int64_t j = 0; j < n; j++)
            x += b[i * n + j] * from[2 * j], y += b[i * n + j] * from[2 * j + 1];
        to[2 * i] = x, to[2 * i + 1] = y;
    }
}

/* What all solutions of a row have in common. */
static void set_row(struct actors *a, const struct conservative *p, int64_t row) {
    double highest = 0.0, begin = 0.0;
    for (int64_t i = 0; i < p->states * a->n; i++)
        highest = fabs(p->squared[row * p->states * a->n + i]) > highest ? fabs(p->squared[row * p->states * a->n + i]) : highest;
    a->highest = sqrt(highest);
    for (int64_t s = 0; s < p->segments; s++) {
        struct pair each = {all(cos(TURN * begin)), all(-sin(TURN * begin))}, now = {all(1.0), all(0.0)};
        for (int64_t lane = 0; lane < LANES; lane++) {
            a->rising[s].re[lane] = now.re[0], a->rising[s].im[lane] = now.im[0];
            now = times(now, each);
            a->falling[s].re[lane] = now.re[0], a->falling[s].im[lane] = -now.im[0];
        }
        a->rise[s] = now;
        a->begins[s] = begin;
        begin += p->fractions[row * p->segments + s];
    }
}

/* u and u' where the segments begin; the start stands in vector, in the modes of the first segment of the exact pattern. */
INLINE void follow(struct actors *a, const struct conservative *p, int64_t row, int64_t n, const double *first, double period,
                   double g, double phi) {
    double *now = a->factors, *next = now + 4 * n; /* the factors are not needed any more */
    transformed(first, n, a->vector, now);
    transformed(first, n, a->vector + 2 * n, now + 2 * n);
    for (int64_t s = 0; s < p->segments; s++) {
        double *end = a->ends + 4 * n * s, begin = a->begins[s], shrink = exp(-g * begin);
        double c = shrink * cos(phi * begin), d = -shrink * sin(phi * begin);
        const double *modes = a->modes + p->state[s] * n * n;
        transformed(modes, n, now, end);
        transformed(modes, n, now + 2 * n, end + 2 * n);
        for (int64_t i = 0; i < 2 * n; i++) {
            double x = end[2 * i], y = end[2 * i + 1];
            end[2 * i] = c * x - d * y, end[2 * i + 1] = c * y + d * x;
        }
        double duration = p->fractions[row * p->segments + s] * period;
        for (int64_t j = 0; j < n; j++) {
            double squared = p->squared[(row * p->states + p->state[s]) * n + j], w = sqrt(fabs(squared)), x = w * duration;
            double cosine, sine; /* of one angle at once */
            if (squared > 0)
                cosine = cos(x), sine = sin(x);
            else
                cosine = cosh(x), sine = sinh(x);
            double over = w > 0 ? sine / w : duration, back = squared > 0 ? -w * sine : w * sine;
            for (int64_t k = 0; k < 2; k++) {
                double u = now[2 * j + k], v = now[2 * (n + j) + k];
                next[2 * j + k] = cosine * u + over * v, next[2 * (n + j) + k] = back * u + cosine * v;
            }
        }
        const double *change = p->change + (row * p->segments + s) * n * n;
        transformed(change, n, next, now);
        transformed(change, n, next + 2 * n, now + 2 * n);
    }
}

/* total (n,) = T c_k of LANES harmonics with frequencies w. */
INLINE void harmonics(struct actors *a, const struct conservative *p, int64_t row, int64_t n, struct pair w) {
    for (int64_t i = 0; i < 2 * n * a->states; i++)
        a->jump[i] = (struct pair){all(0.0), all(0.0)};
    for (int64_t first = 0, last; first < a->changes; first = last) {
        const struct change *own = a->change + first;
        for (last = first + 1; last < a->changes && same_states(own, a->change + last); last++)
            ;
        struct pair *before = a->jump + 2 * n * own->before, *after = a->jump + 2 * n * own->after;
        for (int64_t i = 0; i < 2 * n; i++) {
            struct pair sum = {all(0.0), all(0.0)};
            for (int64_t k = first; k < last; k++) {
                const struct pair *turn = a->turn + a->change[k].segment;
                double x = a->ends[4 * n * a->change[k].segment + 2 * i], y = a->ends[4 * n * a->change[k].segment + 2 * i + 1];
                sum.re += x * turn->re - y * turn->im, sum.im += x * turn->im + y * turn->re;
            }
            before[i].re += sum.re, before[i].im += sum.im;
            after[i].re -= sum.re, after[i].im -= sum.im;
        }
    }
    struct pair square = times(w, w);
    for (int64_t i = 0; i < n; i++)
        a->total[i] = (struct pair){all(0.0), all(0.0)};
    for (int64_t d = 0; d < a->states; d++) {
        const double *modes = a->modes + d * n * n, *squared = p->squared + (row * p->states + d) * n;
        struct pair *jump = a->jump + 2 * n * d;
        for (int64_t i = 0; i < n; i++) { /* u' + i w u */
            struct pair u = times(w, jump[i]);
            jump[i] = (struct pair){jump[n + i].re - u.im, jump[n + i].im + u.re};
        }
        for (int64_t j = 0; j < n; j++) {
            struct pair sum = {all(0.0), all(0.0)};
            for (int64_t i = 0; i < n; i++)
                sum.re += modes[i * n + j] * jump[i].re, sum.im += modes[i * n + j] * jump[i].im;
            vec x = square.re - squared[j], y = square.im, size = larger(x * x + y * y, all(DBL_MIN));
            sum = times(sum, (struct pair){x / size, -y / size});
            for (int64_t i = 0; i < n; i++)
                a->total[i].re += modes[i * n + j] * sum.re, a->total[i].im += modes[i * n + j] * sum.im;
        }
    }
}

/* Keep a part where it belongs among the largest, largest first. */
INLINE void lead(struct leader *leaders, double value, int64_t mode, int64_t harmonic) {
    if (!(value > leaders[LEADING - 1].value))
        return;
    int k = LEADING - 1;
    for (; k > 0 && leaders[k - 1].value < value; k--)
        leaders[k] = leaders[k - 1];
    leaders[k] = (struct leader){value, mode, harmonic};
}

/* Of several solutions the largest share of each root. */
static int64_t keep_share(struct share *found, int64_t count, struct share own) {
    for (int64_t k = 0; k < count; k++)
        if (found[k].p == own.p && found[k].q == own.q && found[k].cycles == own.cycles) {
            found[k].share = own.share > found[k].share ? own.share : found[k].share;
            return count;
        }
    found[count] = own;
    return count + 1;
}

/* Actions of harmonics from, from + by, ... up to a number of them (by = 1 or -1): the leading ones, and sums of each sign. */
INLINE void weigh_side(struct actors *a, const struct conservative *p, int64_t row, int64_t n, double period, double g, double phi,
                       int64_t from, int64_t by, int64_t count, struct leader *up, struct leader *down, vec *sum) {
    vec lowest;
    for (int64_t lane = 0; lane < LANES; lane++)
        lowest[lane] = (phi + TURN * (double)(from + by * lane)) / period;
    for (int64_t first = 0; first < count; first += LANES) {
        struct pair w = {lowest + (double)(by * first) * (TURN / period), all(-g / period)};
        harmonics(a, p, row, n, w);
        for (int64_t i = 0; i < n; i++) {
            vec action = w.re * (a->total[i].re * a->total[i].re + a->total[i].im * a->total[i].im);
            for (int64_t lane = count - first; lane < LANES; lane++)
                action[lane] = 0.0;
            sum[0] += larger(action, all(0.0)), sum[1] += larger(-action, all(0.0));
            if (!any((action > up[LEADING - 1].value) | (-action > down[LEADING - 1].value)))
                continue;
            for (int64_t lane = 0; lane < LANES; lane++)
                lead(action[lane] > 0 ? up : down, fabs(action[lane]), i, from + by * (first + lane));
        }
        for (int64_t s = 0; s < p->segments; s++)
            a->turn[s] = times(a->turn[s], a->step[s]);
    }
}

/* Add the shares of a solution exp((g + i phi) t/T) that has been followed to those of its point; returns how many there are. */
INLINE int64_t weigh(struct actors *a, const struct conservative *p, int64_t row, int64_t n, double period, double g, double phi,
                     int64_t point, int64_t count) {
    int64_t most = (int64_t)ceil(BAND * a->highest * period / TURN) + 1, segments = p->segments;
    struct leader up[LEADING] = {{0}}, down[LEADING] = {{0}};
    vec sums[2] = {all(0.0), all(0.0)};
    double sum[2] = {0.0, 0.0};
    for (int64_t side = 0; side < 2; side++) {
        memcpy(a->turn, side ? a->falling : a->rising, (size_t)segments * sizeof *a->turn);
        memcpy(a->step, a->rise, (size_t)segments * sizeof *a->step);
        for (int64_t s = 0; side && s < segments; s++)
            a->step[s].im = -a->step[s].im;
        weigh_side(a, p, row, n, period, g, phi, -side, side ? -1 : 1, side ? most : most + 1, up, down, sums);
    }
    for (int64_t lane = 0; lane < LANES; lane++)
        sum[0] += sums[0][lane], sum[1] += sums[1][lane];
    for (int i = 0; i < LEADING && up[i].value > LEAST * sum[0]; i++)
        for (int j = 0; j < LEADING && down[j].value > LEAST * sum[1]; j++) {
            double x = up[i].value / sum[0], y = down[j].value / sum[1];
            int ordered = up[i].mode < down[j].mode;
            struct share own = {point, ordered ? up[i].mode : down[j].mode, ordered ? down[j].mode : up[i].mode,
                                up[i].harmonic - down[j].harmonic, x < y ? x : y};
            count = keep_share(a->found, count, own);
        }
    return count;
}

/* Find the solution that grows by exp(g + i phi) a period, and add its shares to the `count` ones of its point. */
INLINE int64_t solution(struct actors *a, const struct conservative *p, int64_t row, int64_t n, const double *first, double period,
                        double g, double phi, int64_t which, int64_t point, int64_t count) {
    eigenvector(a->matrix, 2 * n, g, phi, which, a->vector, a->factors, a->pivot);
    follow(a, p, row, n, first, period, g, phi);
    return weigh(a, p, row, n, period, g, phi, point, count);
}

static int keep_shares(struct shares *kept, const struct share *found, int64_t count) {
    if (kept->count + count > kept->room) {
        int64_t room = 2 * kept->room + count + 1024;
        struct share *moved = realloc(kept->share, (size_t)room * sizeof *moved);
        if (!moved)
            return -1;
        kept->share = moved, kept->room = room;
    }
    memcpy(kept->share + kept->count, found, (size_t)count * sizeof *found);
    kept->count += count;
    return 0;
}

/* The shares at points first..last-1, of rows in ascending order, see kernel.h. */
static int shares(const struct conservative *exact, const struct conservative *coarse, const double *modes,
                  const double *turn, int64_t first, int64_t last, const int64_t *row, const double *cycle,
                  struct shares *kept) {
    struct actors a;
    int failed = actors_new(&a, exact, coarse);
    int64_t n = exact->n, m = 2 * n, before = -1;
    for (int64_t begin = first, end; !failed && begin < last; begin = end) {
        int64_t own = row[begin];
        for (end = begin + 1; end < last && end < begin + LANES && row[end] == own; end++)
            ;
        if (own != before)
            row_set(&a.spectra->row, exact, own), set_row(&a, coarse, own);
        before = own;
        a.modes = (double *)modes + own * coarse->states * n * n;
        struct room *room = &a.spectra->room;
        vec period = exact->cycles * load_part(cycle + begin, 0, end - begin);
        vec scale = propagate(&a.spectra->row, n, period, room->x, room->work), largest = largest_entry(room->x, m * m);
        vec noise = NOISE * larger(largest, all(1.0));
        /* The reduction to rho destroys the matrix. */
        memcpy(a.kept, room->x, (size_t)(m * m) * sizeof *a.kept);
        general_traces(room->x, n, room->real, room->imaginary, room->work);
        for (int64_t lane = 0; !failed && lane < end - begin; lane++) {
            int64_t count = 0;
            for (int64_t i = 0; i < m * m; i++)
                a.matrix[i] = a.kept[i % m * m + i / m][lane];
            double length = TURN * period[lane];
            for (int64_t i = 0; i < n && scale[lane] == 0.0 && largest[lane] < LARGEST_MATRIX; i++) {
                vec growth, angle = angle_of(room->real[i], room->imaginary[i], noise, &growth);
                if (!(growth[lane] > 0.0) || room->imaginary[i][lane] < -noise[lane])
                    continue;
#define SOLUTION(n) solution(&a, coarse, own, n, turn + own * (n) * (n), length, growth[lane], angle[lane], i, begin + lane, count)
                count = n == 1 ? SOLUTION(1) : n == 2 ? SOLUTION(2) : n == 3 ? SOLUTION(3) : SOLUTION(n);
#undef SOLUTION
            }
            failed = keep_shares(kept, a.found, count);
        }
    }
    actors_free(&a);
    return failed;
}

#endif
