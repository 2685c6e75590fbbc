/* Which modes and frequencies carry unstable Floquet solutions: the shares of boundaries/names.

   u(t) = exp((g + i phi) t/T) sum_k c_k exp(2 pi i k t/T) obeys u'' + K_s u = 0 on each segment, so that with w = (phi + 2 pi k
   - i g)/T and the modes V and squared frequencies of its state

       int u exp(-i w t) dt = V (w^2 - squared)^-1 V^T [(u' + i w u) exp(-i w t)]

   between its ends: boundary values are all that is needed, and segments of the same state are summed before the division. In the
   modes of the mean system, with squared frequencies m,

       T (w^2 - m) c_k = sum over states of (K_s - m) int u exp(-i w t) dt,

   in which K_s - m has no more than the few directions that the meshes act in. Points of a row run side by side in vector
   registers. */

#ifndef GEARSTAB_ACTIONS_H
#define GEARSTAB_ACTIONS_H

#define BAND 1.25  /* harmonics up to this times the largest frequency of any state */
#define LEADING 5 /* parts of each sign that are looked at, */
#define LEAST 1e-3 /* unless they carry less than this of the action of their sign */
#define EQUAL 1e-9 /* relative difference of squared frequencies of modes that are alike */
#define LARGEST_MATRIX 1e6 /* entries of M above this leave too few digits, as in points.py */

/* Parts of the action of one sign: the largest ones, and which they are: harmonic times n plus mode. */
struct leader {
    vec value, part;
};

/* Two jumps of K: at the beginnings of which segments a state is left, and entered. */
struct change {
    int64_t left, entered;
};

/* Room for LANES points of a pattern. */
struct actors {
    struct spectra *spectra;
    struct row row; /* of the coarse pattern */
    int64_t n, segments, states, directions, most; /* most: room for shares of a point */
    int64_t *alike;        /* (n,), the first mode of the same frequency in the mean system */
    struct change *change; /* by states, */
    int64_t *changes;      /* (D + 1,), where those of a state begin */
    const double *across, *direction, *mean; /* of the row, see struct acting */
    double *begins;    /* (S,), t/T */
    double *turn, *step; /* (S, 2), exp(-2 pi i k t/T), and what it changes by from one harmonic to the next */
    double highest;    /* of the frequencies of all states of the row */
    struct pair *factors; /* (2n, 2n), of M - lambda, */
    mask *exchanged;      /* (2n, 2n), and their rows */
    struct pair *start, *now, *next; /* (2n,), u and u' */
    struct pair *ends;  /* (S, 2, 2n), u and u' where a segment begins in the modes of its state and of the one before, without
                           exp((g + i phi) t/T) */
    struct pair *jump;  /* (2, n), sums of boundary values of a state for two harmonics, k and -k, in its modes */
    struct pair *force; /* (2, directions), what follows of all states, */
    struct pair *total; /* (2, n), and of the directions */
    vec *growth, *angle; /* (n,), of the multipliers */
    vec *wave;          /* (3, n), cos, sin/w, -w sin of a segment */
    vec *kept;          /* (2n, 2n), the matrices by columns */
    struct share *found; /* (LANES, most) */
    void *memory, *plain;
};

static void actors_free(struct actors *a) {
    spectra_free(a->spectra);
    row_free(&a->row);
    free(a->memory);
    free(a->plain);
    free(a->found);
    free(a->change);
    free(a->alike);
}

/* All changes of state of a period: each state is left as often as it is entered. */
static void order_changes(struct actors *a, const struct conservative *p) {
    int64_t count = 0;
    for (int64_t d = 0; d < p->states; d++) {
        int64_t left = count, entered = count;
        a->changes[d] = count;
        for (int64_t s = 0; s < p->segments; s++) {
            int64_t before = p->state[s ? s - 1 : p->segments - 1], after = p->state[s];
            if (before != after && before == d)
                a->change[left++].left = s;
            if (before != after && after == d)
                a->change[entered++].entered = s;
        }
        count = left;
    }
    a->changes[p->states] = count;
}

/* The first mode of the same frequency of each (n,), from squared frequencies that ascend; returns how many are alike at most. */
static int64_t find_alike(const double *squared, int64_t n, int64_t *alike) {
    int64_t largest = 1;
    for (int64_t i = 0; i < n; i++) {
        alike[i] = i && fabs(squared[i] - squared[i - 1]) <= EQUAL * fabs(squared[i]) ? alike[i - 1] : i;
        largest = i - alike[i] + 1 > largest ? i - alike[i] + 1 : largest;
    }
    return largest;
}

/* Room for the shares of a point: pairs of leading parts, each of modes that are alike in any row, of n solutions. */
static int64_t most_shares(struct actors *a, const struct conservative *p, const double *mean) {
    int64_t largest = 1;
    for (int64_t row = 0; a->alike && row < p->rows; row++) {
        int64_t own = find_alike(mean + row * a->n, a->n, a->alike);
        largest = own > largest ? own : largest;
    }
    return LEADING * LEADING * largest * largest * a->n;
}

static int actors_new(struct actors *a, const struct conservative *exact, const struct conservative *coarse,
                      const struct acting *acting) {
    size_t n = (size_t)exact->n, segments = (size_t)coarse->segments, states = (size_t)coarse->states;
    int64_t directions = acting->count;
    *a = (struct actors){.n = exact->n, .segments = coarse->segments, .states = coarse->states, .directions = directions};
    a->alike = malloc(n * sizeof *a->alike);
    a->most = most_shares(a, coarse, acting->mean);
    a->spectra = spectra_new(exact);
    vec *room = vectors((int64_t)(2 * (2 * n * (5 + 2 * segments)) + 5 * n + 16 * n * n) + 4 * directions, &a->memory);
    double *plain = malloc((5 * segments + states + 1) * sizeof *plain);
    a->plain = plain;
    a->found = malloc(LANES * (size_t)a->most * sizeof *a->found);
    a->change = malloc(segments * sizeof *a->change);
    if (row_new(&a->row, coarse) || !a->spectra || !room || !plain || !a->found || !a->change || !a->alike)
        return -1;
    a->start = (struct pair *)room, a->now = a->start + 2 * n, a->next = a->now + 2 * n, a->ends = a->next + 2 * n;
    a->jump = a->ends + 4 * n * segments, a->total = a->jump + 2 * n;
    a->force = a->total + 2 * n, a->growth = (vec *)(a->force + 2 * directions), a->angle = a->growth + n;
    a->wave = a->angle + n, a->kept = a->wave + 3 * n;
    a->factors = (struct pair *)(a->kept + 4 * n * n), a->exchanged = (mask *)(a->factors + 4 * n * n);
    a->begins = plain, a->turn = a->begins + segments, a->step = a->turn + 2 * segments;
    a->changes = (int64_t *)(a->step + 2 * segments);
    order_changes(a, coarse);
    return 0;
}

/* What all solutions of a row have in common. */
static void set_row(struct actors *a, const struct conservative *p, const struct acting *acting, int64_t row) {
    double highest = 0.0, begin = 0.0;
    int64_t forces = acting->count * a->n;
    row_set(&a->row, p, row);
    a->across = acting->across + row * p->states * forces;
    a->direction = acting->direction + row * forces, a->mean = acting->mean + row * a->n;
    find_alike(a->mean, a->n, a->alike);
    for (int64_t i = 0; i < p->states * a->n; i++)
        highest = fabs(p->squared[row * p->states * a->n + i]) > highest ? fabs(p->squared[row * p->states * a->n + i]) : highest;
    a->highest = sqrt(highest);
    for (int64_t s = 0; s < p->segments; s++) {
        a->step[2 * s] = cos(TURN * begin), a->step[2 * s + 1] = -sin(TURN * begin);
        a->begins[s] = begin;
        begin += p->fractions[row * p->segments + s];
    }
}

/* to (n,) = b from, b (n, n). */
INLINE void transformed(const double *b, int64_t n, const struct pair *from, struct pair *to) {
    for (int64_t i = 0; i < n; i++) {
        struct pair sum = {all(0.0), all(0.0)};
        for (int64_t j = 0; j < n; j++)
            sum.re += b[i * n + j] * from[j].re, sum.im += b[i * n + j] * from[j].im;
        to[i] = sum;
    }
}

/* to (2n,) = exp(-(g + i phi) t/T) from, t/T = begin. */
INLINE void faded(double begin, int64_t n, vec g, vec phi, const struct pair *from, struct pair *to) {
    struct pair fade;
    cosine_sine(all(begin), phi * (1.0 / TURN), &fade.re, &fade.im);
    vec shrink = exponential(-begin * g);
    fade = (struct pair){fade.re * shrink, -(fade.im * shrink)};
    for (int64_t i = 0; i < 2 * n; i++)
        to[i] = times(from[i], fade);
}

/* u and u' where the segments begin; the start stands in the modes of the first segment of the exact pattern. turns: the period
   in turns per unit frequency. */
INLINE void follow(struct actors *a, const struct conservative *p, int64_t n, const double *first, vec turns, vec g, vec phi) {
    struct pair *now = a->now, *next = a->next;
    vec *cosine = a->wave, *over = cosine + n, *back = over + n;
    transformed(first, n, a->start, now);
    transformed(first, n, a->start + n, now + n);
    for (int64_t s = 0; s < p->segments; s++) {
        const double *change = a->row.change + s * n * n;
        int last = s + 1 == p->segments;
        faded(a->begins[s], n, g, phi, now, a->ends + 4 * n * s);
        vec growth = rotation(a->row.modes + s * n, n, a->row.steady[s], turns, cosine, over, back);
        for (int64_t i = 0; !a->row.steady[s] && i < 3 * n; i++)
            cosine[i] = cosine[i] * exponential(growth); /* all three of each mode */
        for (int64_t j = 0; j < n; j++) {
            struct pair u = now[j], v = now[n + j];
            next[j] = (struct pair){cosine[j] * u.re + over[j] * v.re, cosine[j] * u.im + over[j] * v.im};
            next[n + j] = (struct pair){back[j] * u.re + cosine[j] * v.re, back[j] * u.im + cosine[j] * v.im};
        }
        faded(last ? 1.0 : a->begins[s + 1], n, g, phi, next, a->ends + 4 * n * (last ? 0 : s + 1) + 2 * n);
        transformed(change, n, next, now);
        transformed(change, n, next + n, now + n);
    }
}

/* Sums (2, n) of u' + i w u at the changes of a state, with the factors of harmonics k and -k, which are conjugates; w (2,). */
INLINE void sum_jumps(struct actors *a, int64_t n, int64_t state, const struct pair *w) {
    for (int64_t i = 0; i < n; i++) {
        struct pair re[2], im[2]; /* of u and u', with the two parts of the factors */
        for (int part = 0; part < 2; part++) {
            struct pair of_re = {all(0.0), all(0.0)}, of_im = of_re;
            for (int64_t k = a->changes[state]; k < a->changes[state + 1]; k++) {
                struct change own = a->change[k];
                const struct pair *left = a->ends + 4 * n * own.left + 2 * n + part * n + i;
                const struct pair *entered = a->ends + 4 * n * own.entered + part * n + i;
                const double *to = a->turn + 2 * own.left, *from = a->turn + 2 * own.entered;
                of_re.re += to[0] * left->re, of_re.im += to[0] * left->im;
                of_im.re += to[1] * left->re, of_im.im += to[1] * left->im;
                of_re.re -= from[0] * entered->re, of_re.im -= from[0] * entered->im;
                of_im.re -= from[1] * entered->re, of_im.im -= from[1] * entered->im;
            }
            re[part] = of_re, im[part] = of_im;
        }
        for (int side = 0; side < 2; side++) {
            double sign = side ? -1.0 : 1.0;
            struct pair u = times(w[side], (struct pair){re[0].re - sign * im[0].im, re[0].im + sign * im[0].re});
            vec x = re[1].re - sign * im[1].im, y = re[1].im + sign * im[1].re;
            a->jump[side * n + i] = (struct pair){x - u.im, y + u.re};
        }
    }
}

/* Divided by w^2 - squared. */
INLINE struct pair responding(struct pair from, struct pair square, double squared) {
    vec x = square.re - squared, y = square.im, over = 1.0 / larger(x * x + y * y, all(DBL_MIN));
    return times(from, (struct pair){x * over, -y * over});
}

/* total (2, n) = T c_k of two harmonics k and -k with frequencies w (2,). */
INLINE void amplitudes(struct actors *a, const struct conservative *p, int64_t row, int64_t n, const struct pair *w) {
    const struct pair zero = {all(0.0), all(0.0)}, square[2] = {times(w[0], w[0]), times(w[1], w[1])};
    int64_t count = a->directions;
    for (int64_t m = 0; m < 2 * count; m++)
        a->force[m] = zero;
    for (int64_t d = 0; d < a->states; d++) {
        const double *across = a->across + d * count * n, *squared = p->squared + (row * p->states + d) * n;
        sum_jumps(a, n, d, w);
        for (int64_t i = 0; i < 2 * n; i++)
            a->jump[i] = responding(a->jump[i], square[i / n], squared[i % n]);
        for (int64_t m = 0; m < count; m++) {
            struct pair plus = a->force[m], minus = a->force[count + m];
            for (int64_t j = 0; j < n; j++) {
                vec part = all(across[m * n + j]);
                plus.re += part * a->jump[j].re, plus.im += part * a->jump[j].im;
                minus.re += part * a->jump[n + j].re, minus.im += part * a->jump[n + j].im;
            }
            a->force[m] = plus, a->force[count + m] = minus;
        }
    }
    for (int64_t side = 0; side < 2; side++)
        for (int64_t i = 0; i < n; i++) {
            struct pair sum = zero;
            for (int64_t m = 0; m < count; m++) {
                vec part = all(a->direction[m * n + i]);
                sum.re += part * a->force[side * count + m].re, sum.im += part * a->force[side * count + m].im;
            }
            a->total[side * n + i] = responding(sum, square[side], a->mean[i]);
        }
}

/* Keep parts where they belong among the largest, largest first. */
INLINE void lead(struct leader *leaders, vec value, vec part) {
    if (!any(value > leaders[LEADING - 1].value))
        return;
    for (int k = 0; k < LEADING; k++) {
        struct leader own = leaders[k];
        mask above = value > own.value;
        leaders[k] = (struct leader){choose(above, value, own.value), choose(above, part, own.part)};
        value = choose(above, own.value, value), part = choose(above, own.part, part);
    }
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

/* A leading part of a lane: its part of the action of its sign. */
struct weighed {
    double share;
    int64_t mode, harmonic;
};

static int leading_parts(struct weighed *parts, int64_t n, int64_t lane, const struct leader *leaders, double sum) {
    int count = 0;
    for (; count < LEADING && leaders[count].value[lane] > LEAST * sum; count++) {
        int64_t number = (int64_t)leaders[count].part[lane], mode = (number % n + n) % n;
        parts[count] = (struct weighed){leaders[count].value[lane] / sum, mode, (number - mode) / n};
    }
    return count;
}

/* Pair the leading parts of both signs in a lane; returns how many shares its point has then. Modes that are alike have all that
   any of them has: which of several solutions is whose is a matter of rounding. */
static int64_t pair_parts(struct share *found, int64_t count, int64_t n, const int64_t *alike, int64_t lane,
                          const struct leader *up, const struct leader *down, const vec *sum, int64_t point) {
    struct weighed plus[LEADING], minus[LEADING];
    int ups = leading_parts(plus, n, lane, up, sum[0][lane]), downs = leading_parts(minus, n, lane, down, sum[1][lane]);
    for (struct weighed *x = plus; x < plus + ups; x++)
        for (struct weighed *y = minus; y < minus + downs; y++)
            for (int64_t i = x->mode; i < n && alike[i] == x->mode; i++)
                for (int64_t j = y->mode; j < n && alike[j] == y->mode; j++) {
                    double share = x->share < y->share ? x->share : y->share;
                    struct share own = {point, i < j ? i : j, i < j ? j : i, x->harmonic - y->harmonic, share};
                    count = keep_share(found, count, own);
                }
    return count;
}

/* The largest actions of both signs, and their sums, of solutions exp((g + i phi) t/T) that have been followed. */
INLINE void weigh(struct actors *a, const struct conservative *p, int64_t row, int64_t n, vec turns, vec g, vec phi,
                  struct leader *up, struct leader *down, vec *sum) {
    vec most = BAND * a->highest * turns + 1.0, over = 1.0 / (TURN * turns);
    for (int i = 0; i < LEADING; i++)
        up[i] = down[i] = (struct leader){all(0.0), all(0.0)};
    sum[0] = sum[1] = all(0.0);
    for (int64_t s = 0; s < a->segments; s++)
        a->turn[2 * s] = 1.0, a->turn[2 * s + 1] = 0.0;
    for (int64_t k = 0; any((double)(k - 1) < most); k++) {
        mask within = (double)(k - 1) < most;
        vec turned = all(TURN * (double)k);
        struct pair w[2] = {{(phi + turned) * over, -g * over}, {(phi - turned) * over, -g * over}};
        amplitudes(a, p, row, n, w);
        for (int64_t side = 0; side < (k ? 2 : 1); side++) {
            int64_t harmonic = side ? -k : k;
            vec action = all(0.0);
            for (int64_t i = 0; i < n; i++) {
                struct pair c = a->total[side * n + i];
                action += choose(within, w[side].re * (c.re * c.re + c.im * c.im), all(0.0));
                if (i + 1 < n && a->alike[i + 1] == a->alike[i])
                    continue;
                sum[0] += larger(action, all(0.0)), sum[1] += larger(-action, all(0.0));
                vec part = all((double)(harmonic * n + a->alike[i]));
                lead(up, action, part), lead(down, -action, part);
                action = all(0.0);
            }
        }
        for (int64_t s = 0; s < a->segments; s++) {
            double *now = a->turn + 2 * s, *by = a->step + 2 * s, re = now[0] * by[0] - now[1] * by[1];
            now[1] = now[0] * by[1] + now[1] * by[0], now[0] = re;
        }
    }
}

/* Find the solutions with the multipliers of these numbers and add their shares to those of each lane; of lanes that have no more,
   numbers from n on, any solution is followed and left. */
INLINE void solutions(struct actors *a, const struct conservative *p, int64_t row, int64_t n, const double *first, vec turns,
                      const int64_t *which, int64_t begin, int64_t *counts) {
    vec g = all(0.0), phi = all(0.0), sum[2];
    struct leader up[LEADING], down[LEADING];
    for (int64_t lane = 0; lane < LANES; lane++)
        g[lane] = a->growth[which[lane] % n][lane], phi[lane] = a->angle[which[lane] % n][lane];
    eigenvector(a->kept, 2 * n, g, phi, which, a->start, a->factors, a->exchanged);
    follow(a, p, n, first, turns, g, phi);
    weigh(a, p, row, n, turns, g, phi, up, down, sum);
    for (int64_t lane = 0; lane < LANES; lane++)
        if (which[lane] < n)
            counts[lane] = pair_parts(a->found + lane * a->most, counts[lane], n, a->alike, lane, up, down, sum, begin + lane);
}

static int keep_shares(struct shares *kept, const struct share *found, int64_t count) {
    if (count == 0)
        return 0; /* there may be no room yet */
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

/* Angles and growth of the multipliers of LANES points, the first `count` of which are asked for; growth 0 where none is
   looked for. Of a pair, its mirror images and its complex conjugates one is enough. */
static void multipliers(struct actors *a, vec turns, int64_t count) {
    struct room *room = &a->spectra->room;
    int64_t n = a->n, m = 2 * n;
    vec scale = propagate(&a->spectra->row, turns, room->x, room->work), largest = largest_entry(room->x, m * m);
    vec noise = NOISE * larger(largest, all(1.0));
    mask asked = (scale == 0.0) & (largest < LARGEST_MATRIX);
    for (int64_t lane = count; lane < LANES; lane++)
        asked[lane] = 0;
    /* The reduction to rho destroys the matrix. */
    memcpy(a->kept, room->x, (size_t)(m * m) * sizeof *a->kept);
    traces_of(room->x, n, room->real, room->imaginary, room->work);
    for (int64_t i = 0; i < n; i++) {
        a->angle[i] = angle_of(room->real[i], room->imaginary[i], noise, &a->growth[i]);
        a->growth[i] = choose(asked & (room->imaginary[i] >= -noise), a->growth[i], all(0.0));
    }
}

/* The next multiplier off the circle of each lane after the one in `which`, n or more where there is none; whether there is any. */
static int next_multipliers(const struct actors *a, int64_t *which) {
    int found = 0;
    for (int64_t lane = 0; lane < LANES; lane++) {
        do
            which[lane]++;
        while (which[lane] < a->n && !(a->growth[which[lane]][lane] > 0.0));
        found |= which[lane] < a->n;
    }
    return found;
}

/* The shares at points first..last-1, of rows in ascending order, see kernel.h. */
static int shares(const struct conservative *exact, const struct conservative *coarse, const struct acting *acting,
                  const double *turn, int64_t first, int64_t last, const int64_t *row, const double *cycle,
                  struct shares *kept) {
    struct actors a;
    int failed = actors_new(&a, exact, coarse, acting);
    int64_t n = exact->n, before = -1;
    for (int64_t begin = first, end; !failed && begin < last && !gearstab_stopped(); begin = end) {
        int64_t own = row[begin], counts[LANES] = {0}, which[LANES];
        for (end = begin + 1; end < last && end < begin + LANES && row[end] == own; end++)
            ;
        if (own != before)
            row_set(&a.spectra->row, exact, own), set_row(&a, coarse, acting, own);
        before = own;
        vec turns = exact->cycles * load_part(cycle + begin, 0, end - begin);
        multipliers(&a, turns, end - begin);
        for (int64_t lane = 0; lane < LANES; lane++)
            which[lane] = -1;
        while (next_multipliers(&a, which) && !gearstab_stopped())
            solutions(&a, coarse, own, n, turn + own * n * n, turns, which, begin, counts);
        for (int64_t lane = 0; !failed && lane < end - begin; lane++)
            failed = keep_shares(kept, a.found + lane * a.most, counts[lane]);
    }
    actors_free(&a);
    return failed;
}

#endif
