/* Which modes and frequencies carry unstable Floquet solutions: the shares of labels.py.

   u(t) = exp((g + i phi) t/T) sum_k c_k exp(2 pi i k t/T) obeys u'' + K_s u = 0 on each segment, so that with w = (phi + 2 pi k
   - i g)/T and the modes V and squared frequencies of its state

       int u exp(-i w t) dt = V (w^2 - squared)^-1 V^T [(u' + i w u) exp(-i w t)]

   between its ends: boundary values are all that is needed, and segments of the same state are summed before the division.
   Harmonics run side by side in vector registers. */

#ifndef GEARSTAB_ACTIONS_H
#define GEARSTAB_ACTIONS_H

#define BAND 1.5  /* harmonics up to this times the largest frequency of any state */
#define LEADING 5 /* parts of each sign that are looked at */
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

/* Room for the points of a pattern. */
struct actors {
    struct spectra *spectra;
    int64_t n, segments, states, most; /* most: room for shares of a point */
    double *modes;     /* (D, n, n) of the row: from the modes of a state to the mean ones */
    double *matrix;    /* (2n, 2n), row-major */
    double *factors;   /* (2n, 2n, 2), of M - lambda */
    double *vector;    /* (2n, 2), the solution's start */
    double *ends;      /* (S, 2n, 2), u and u' in mean coordinates where a segment begins, without exp((g + i phi) t/T) */
    double *begins;    /* (S,), t/T */
    struct pair *turn, *step; /* (S,), exp(-2 pi i k t/T) and what it changes by from LANES harmonics to the next */
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
}

static int actors_new(struct actors *a, const struct conservative *exact, const struct conservative *coarse) {
    size_t n = (size_t)exact->n, segments = (size_t)coarse->segments, states = (size_t)coarse->states;
    *a = (struct actors){.n = exact->n, .segments = coarse->segments, .states = coarse->states};
    a->most = LEADING * LEADING * exact->n;
    a->spectra = spectra_new(exact);
    vec *room = vectors((int64_t)(2 * (2 * segments + 2 * states * n + n) + 4 * n * n), &a->memory);
    double *plain = malloc((4 * n * n + 8 * n * n + 4 * n + segments * (4 * n + 1) + 2 * n) * sizeof *plain);
    a->plain = plain;
    a->found = malloc((size_t)a->most * sizeof *a->found);
    if (!a->spectra || !room || !plain || !a->found)
        return -1;
    a->turn = (struct pair *)room, a->step = a->turn + segments, a->jump = a->step + segments;
    a->total = a->jump + 2 * states * n, a->kept = (vec *)(a->total + n);
    a->matrix = plain, a->factors = a->matrix + 4 * n * n, a->vector = a->factors + 8 * n * n;
    a->ends = a->vector + 4 * n, a->begins = a->ends + 4 * n * segments, a->pivot = (int64_t *)(a->begins + segments);
    return 0;
}

/* LU factors of M - lambda, with partial pivoting; a pivot that vanishes is put to the size of rounding. */
static void factorise(struct actors *a, double re, double im) {
    int64_t m = 2 * a->n;
    double *f = a->factors, size = 0.0;
    for (int64_t i = 0; i < m * m; i++) {
        int diagonal = i % (m + 1) == 0;
        f[2 * i] = a->matrix[i] - (diagonal ? re : 0.0), f[2 * i + 1] = diagonal ? -im : 0.0;
        size = fabs(a->matrix[i]) > size ? fabs(a->matrix[i]) : size;
    }
#define SQUARE(i, j) (f[2 * ((i) * m + (j))] * f[2 * ((i) * m + (j))] + f[2 * ((i) * m + (j)) + 1] * f[2 * ((i) * m + (j)) + 1])
    for (int64_t k = 0; k < m; k++) {
        int64_t best = k;
        for (int64_t i = k + 1; i < m; i++)
            best = SQUARE(i, k) > SQUARE(best, k) ? i : best;
        a->pivot[k] = best;
        for (int64_t j = 0; best != k && j < 2 * m; j++) {
            double kept = f[2 * k * m + j];
            f[2 * k * m + j] = f[2 * best * m + j], f[2 * best * m + j] = kept;
        }
        double *top = f + 2 * k * m, square = SQUARE(k, k);
        if (!(square > DBL_EPSILON * DBL_EPSILON * size * size)) {
            top[2 * k] = DBL_EPSILON * size, top[2 * k + 1] = 0.0;
            square = top[2 * k] * top[2 * k];
        }
        for (int64_t i = k + 1; i < m; i++) {
            double *line = f + 2 * i * m, x = line[2 * k], y = line[2 * k + 1];
            if (x == 0.0 && y == 0.0)
                continue;
            double p = (x * top[2 * k] + y * top[2 * k + 1]) / square, q = (y * top[2 * k] - x * top[2 * k + 1]) / square;
            line[2 * k] = p, line[2 * k + 1] = q;
            for (int64_t j = k + 1; j < m; j++) {
                line[2 * j] -= p * top[2 * j] - q * top[2 * j + 1];
                line[2 * j + 1] -= p * top[2 * j + 1] + q * top[2 * j];
            }
        }
    }
#undef SQUARE
}

/* vector <- (M - lambda)^-1 vector, scaled to a largest entry of 1. */
static void solve_factorised(const struct actors *a, double *v) {
    int64_t m = 2 * a->n;
    const double *f = a->factors;
    for (int64_t k = 0; k < m; k++) {
        int64_t other = a->pivot[k];
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
    double largest = 0.0;
    for (int64_t i = m - 1; i >= 0; i--) {
        for (int64_t j = i + 1; j < m; j++) {
            const double *c = f + 2 * (i * m + j);
            v[2 * i] -= c[0] * v[2 * j] - c[1] * v[2 * j + 1];
            v[2 * i + 1] -= c[0] * v[2 * j + 1] + c[1] * v[2 * j];
        }
        const double *c = f + 2 * (i * m + i);
        double square = c[0] * c[0] + c[1] * c[1], x = v[2 * i], y = v[2 * i + 1];
        v[2 * i] = (x * c[0] + y * c[1]) / square, v[2 * i + 1] = (y * c[0] - x * c[1]) / square;
        largest = fabs(v[2 * i]) > largest ? fabs(v[2 * i]) : largest;
        largest = fabs(v[2 * i + 1]) > largest ? fabs(v[2 * i + 1]) : largest;
    }
    for (int64_t i = 0; i < 2 * m; i++)
        v[i] /= largest;
}

/* The eigenvector of exp(g + i phi) by inverse iteration; `which` makes those of equal multipliers differ. */
static void eigenvector(struct actors *a, double g, double phi, int64_t which) {
    int64_t m = 2 * a->n;
    factorise(a, exp(g) * cos(phi), exp(g) * sin(phi));
    for (int64_t i = 0; i < m; i++) {
        a->vector[2 * i] = 1.0 + 0.37 * (double)((i * 5 + which * 3) % 7);
        a->vector[2 * i + 1] = 0.0;
    }
    for (int round = 0; round < 3; round++)
        solve_factorised(a, a->vector);
}

/* to (n, 2) = b from, b (n, n). */
static void transformed(const double *b, int64_t n, const double *from, double *to) {
    for (int64_t i = 0; i < n; i++) {
        double x = 0.0, y = 0.0;
        for (int64_t j = 0; j < n; j++)
            x += b[i * n + j] * from[2 * j], y += b[i * n + j] * from[2 * j + 1];
        to[2 * i] = x, to[2 * i + 1] = y;
    }
}

/* u and u' where the segments begin; the start stands in vector, in the modes of the first segment of the exact pattern. */
static void follow(struct actors *a, const struct conservative *p, int64_t row, const double *first, double period, double g,
                   double phi) {
    int64_t n = a->n;
    double *now = a->factors, *next = now + 4 * n, begin = 0.0; /* the factors are not needed any more */
    transformed(first, n, a->vector, now);
    transformed(first, n, a->vector + 2 * n, now + 2 * n);
    for (int64_t s = 0; s < p->segments; s++) {
        double *end = a->ends + 4 * n * s, shrink = exp(-g * begin);
        double c = shrink * cos(phi * begin), d = -shrink * sin(phi * begin);
        const double *modes = a->modes + p->state[s] * n * n;
        transformed(modes, n, now, end);
        transformed(modes, n, now + 2 * n, end + 2 * n);
        for (int64_t i = 0; i < 2 * n; i++) {
            double x = end[2 * i], y = end[2 * i + 1];
            end[2 * i] = c * x - d * y, end[2 * i + 1] = c * y + d * x;
        }
        a->begins[s] = begin;
        double part = p->fractions[row * p->segments + s], duration = part * period;
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
        begin += part;
        const double *change = p->change + (row * p->segments + s) * n * n;
        transformed(change, n, next, now);
        transformed(change, n, next + 2 * n, now + 2 * n);
    }
}

/* total (n,) = T c_k of LANES harmonics with frequencies w. */
INLINE void harmonics(struct actors *a, const struct conservative *p, int64_t row, struct pair w) {
    int64_t n = a->n, segments = a->segments;
    for (int64_t i = 0; i < 2 * n * a->states; i++)
        a->jump[i] = (struct pair){all(0.0), all(0.0)};
    for (int64_t s = 0; s < segments; s++) {
        struct pair *before = a->jump + 2 * n * p->state[s ? s - 1 : segments - 1], *after = a->jump + 2 * n * p->state[s];
        const double *end = a->ends + 4 * n * s;
        if (before == after)
            continue;
        for (int64_t i = 0; i < 2 * n; i++) {
            double x = end[2 * i], y = end[2 * i + 1];
            struct pair value = {x * a->turn[s].re - y * a->turn[s].im, x * a->turn[s].im + y * a->turn[s].re};
            before[i].re += value.re, before[i].im += value.im;
            after[i].re -= value.re, after[i].im -= value.im;
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

/* Add the shares of a solution exp((g + i phi) t/T) that has been followed to those of its point; returns how many there are. */
static int64_t weigh(struct actors *a, const struct conservative *p, int64_t row, double period, double g, double phi,
                     int64_t point, int64_t count) {
    int64_t n = a->n;
    double highest = 0.0, sum[2] = {0.0, 0.0};
    for (int64_t i = 0; i < p->states * n; i++)
        highest = fabs(p->squared[row * p->states * n + i]) > highest ? fabs(p->squared[row * p->states * n + i]) : highest;
    int64_t most = (int64_t)ceil(BAND * sqrt(highest) * period / TURN) + 1;
    struct leader up[LEADING] = {{0}}, down[LEADING] = {{0}};
    for (int64_t s = 0; s < p->segments; s++) { /* sines of two angles, those of the lanes by multiplication */
        double turns = a->begins[s], start = TURN * remainder((double)most * turns, 1.0), one = -TURN * turns;
        struct pair each = {all(cos(one)), all(sin(one))}, now = {all(cos(start)), all(sin(start))};
        for (int64_t lane = 0; lane < LANES; lane++) {
            a->turn[s].re[lane] = now.re[0], a->turn[s].im[lane] = now.im[0];
            now = times(now, each);
        }
        for (int64_t step = 1; step < LANES; step *= 2)
            each = times(each, each);
        a->step[s] = each;
    }
    for (int64_t first = -most; first <= most; first += LANES) {
        struct pair w = {all(0.0), all(-g / period)};
        for (int64_t lane = 0; lane < LANES; lane++)
            w.re[lane] = (phi + TURN * (double)(first + lane)) / period;
        harmonics(a, p, row, w);
        for (int64_t i = 0; i < n; i++) {
            vec action = w.re * (a->total[i].re * a->total[i].re + a->total[i].im * a->total[i].im);
            for (int64_t lane = 0; lane < LANES && first + lane <= most; lane++) {
                sum[action[lane] < 0] += fabs(action[lane]);
                lead(action[lane] > 0 ? up : down, fabs(action[lane]), i, first + lane);
            }
        }
        for (int64_t s = 0; s < p->segments; s++)
            a->turn[s] = times(a->turn[s], a->step[s]);
    }
    for (int i = 0; i < LEADING && up[i].value > 0; i++)
        for (int j = 0; j < LEADING && down[j].value > 0; j++) {
            double x = up[i].value / sum[0], y = down[j].value / sum[1];
            int ordered = up[i].mode < down[j].mode;
            struct share own = {point, ordered ? up[i].mode : down[j].mode, ordered ? down[j].mode : up[i].mode,
                                up[i].harmonic - down[j].harmonic, x < y ? x : y};
            count = keep_share(a->found, count, own);
        }
    return count;
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
            row_set(&a.spectra->row, exact, own);
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
                eigenvector(&a, growth[lane], angle[lane], i);
                follow(&a, coarse, own, turn + own * n * n, length, growth[lane], angle[lane]);
                count = weigh(&a, coarse, own, length, growth[lane], angle[lane], begin + lane, count);
            }
            failed = keep_shares(kept, a.found, count);
        }
    }
    actors_free(&a);
    return failed;
}

#endif
