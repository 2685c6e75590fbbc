/* ln lambda of all multipliers of damped patterns and of given factors, none lost to rounding, see periodic.h.

   A period is cut into as few factors as may be, each the explicit product of the segments, or parts of segments, in
   which growth and decay differ by little. One factor is the usual case, and the QR algorithm the usual one. Where
   multipliers turn out to be further apart than damping alone tells, as those of instabilities over long periods, it is
   cut again. */

#ifndef GEARSTAB_EXPONENTS_H
#define GEARSTAB_EXPONENTS_H

#define FACTOR_SPREAD 3.0 /* growth and decay in a factor differ by e^3 at most, which costs one digit and a little */
#define ALLOWANCE 1.5     /* for multipliers that are further apart than the growth and decay of the states */
#define SLIVER 1e-9       /* of a factor: a shorter rest goes with it */
#define MOST_VECTORS (INT64_C(1) << 22) /* in all factors, 256 MB; points that need more have no result here */

/* Room for factors, which grows as they are needed. */
struct factor_room {
    int64_t factors;
    void *memory;
    vec *x, *work; /* (factors, m, m), (m + 2, m) */
    double *logs;  /* (LANES, m, 2) */
};

/* Returns 0, or -1 when there is no memory. */
static int factor_room_for(struct factor_room *room, int64_t factors, int64_t m) {
    if (factors <= room->factors)
        return 0;
    free(room->memory);
    room->factors = factors;
    room->work = vectors((factors + 1) * m * m + 4 * m, &room->memory);
    if (!room->work)
        return -1;
    room->logs = (double *)(room->work + (m + 2) * m);
    room->x = room->work + (m + 4) * m;
    return 0;
}

/* How much growth and decay differ in each segment of a row (S,), over the period, and in all of them. */
static double spread_of(const struct damped *pattern, int64_t r, double *spread) {
    double total = 0.0;
    for (int64_t s = 0; s < pattern->segments; s++) {
        const double *decay = pattern->decay + (r * pattern->states + pattern->state[s]) * pattern->m;
        double most = decay[0], least = decay[0];
        for (int64_t i = 1; i < pattern->m; i++) {
            most = decay[i] > most ? decay[i] : most;
            least = decay[i] < least ? decay[i] : least;
        }
        spread[s] = TURN * fabs(pattern->fractions[r * pattern->segments + s]) * (most - least);
        total += spread[s];
    }
    return total;
}

/* The periods of LANES points of a row as up to `count` factors, by equal shares of the weight (S,) of the segments;
   returns how many, and where the first of them is. Columns are stored as rows, so that these are the transposed
   factors, the last first, of the same multipliers. */
INLINE int64_t damped_factors(const struct damped *pattern, int64_t m, int64_t r, const double *weight, int64_t count,
                              vec period, const struct factor_room *room, vec **first, vec *scale) {
    vec *cosine = room->work, *sine = cosine + m, *q = sine + m, *x = room->x + (count - 1) * m * m;
    vec exponent = all(0.0);
    double share = 0.0, left;
    int64_t begun = 1, products = 0;
    for (int64_t s = 0; s < pattern->segments; s++)
        share += weight[s] / (double)count;
    left = share;
    for (int64_t s = 0; s < pattern->segments; s++) {
        const double *frequency = pattern->frequency + (r * pattern->states + pattern->state[s]) * m;
        const double fraction = pattern->fractions[r * pattern->segments + s], *change = change_after(pattern, m, r, s);
        double rest = 1.0;
        if (gearstab_stopped())
            break;
        for (int closes = 1; closes;) {
            closes = begun < count && rest * weight[s] > left + SLIVER * share;
            double part = closes ? left / weight[s] : rest;
            *scale += decaying_rotation(pattern, m, 0, r, s, part * fraction, period, cosine, sine);
            rest -= part, left -= part * weight[s];
            if (!products && !closes) {
                first_rotation(change, frequency, m, cosine, sine, x);
            } else {
                for (int64_t i = 0; !products && i < m * m; i++)
                    x[i] = all(i % (m + 1) == 0);
                rotate(frequency, m, cosine, sine, x, q);
                if (closes)
                    memcpy(x, q, m * m * sizeof *x);
                else
                    real_change(change, m, m, q, x);
            }
            if (closes || ++products % RESCALE_EVERY == 0 || s + 1 == pattern->segments)
                divide_by_power(x, m, &exponent);
            if (closes)
                x -= m * m, begun++, left = share, products = 0;
        }
    }
    *scale += LOG_TWO * exponent;
    *first = x;
    return begun;
}

/* How far the multipliers of some lanes are apart, logs (LANES, m, 2). */
static double spread_of_logs(const double *logs, int64_t m, int64_t lanes) {
    double widest = 0.0;
    for (int64_t lane = 0; lane < lanes; lane++) {
        double most = -INFINITY, least = INFINITY;
        for (int64_t i = 0; i < m; i++) {
            double own = logs[(lane * m + i) * 2];
            most = own > most ? own : most;
            least = own < least ? own : least;
        }
        widest = most - least > widest ? most - least : widest;
    }
    return widest;
}

static void store_logs(const double *logs, vec scale, int64_t m, int64_t lanes, double *to) {
    for (int64_t lane = 0; lane < lanes; lane++)
        for (int64_t i = 0; i < m; i++) {
            to[(lane * m + i) * 2] = logs[(lane * m + i) * 2] + scale[lane];
            to[(lane * m + i) * 2 + 1] = logs[(lane * m + i) * 2 + 1];
        }
}

/* ln lambda of `lanes` points of a row, spread (2, S) as of spread_of; NaN where too many factors would be needed. */
static int exponents_of(const struct damped *pattern, int64_t m, int64_t r, double *spread, double total, vec period,
                        int64_t lanes, struct factor_room *room, double *logs) {
    double longest = period[0], more = 0.0, *weight = spread + pattern->segments;
    for (int64_t lane = 1; lane < lanes; lane++)
        longest = period[lane] > longest ? period[lane] : longest;
    for (;;) {
        double needed = ceil((total * longest + more) / FACTOR_SPREAD);
        if (!(needed * (double)(m * m) < MOST_VECTORS)) {
            for (int64_t i = 0; i < lanes * m * 2; i++)
                logs[i] = NAN;
            return 0;
        }
        int64_t count = needed > 1 ? (int64_t)needed : 1;
        if (factor_room_for(room, count, m) < 0)
            return -1;
        for (int64_t s = 0; s < pattern->segments; s++)
            weight[s] = spread[s] * longest + more * fabs(pattern->fractions[r * pattern->segments + s]);
        vec scale = all(0.0), *first;
        count = damped_factors(pattern, m, r, weight, count, period, room, &first, &scale);
        periodic_qr(first, count, m, room->work, room->logs);
        double apart = spread_of_logs(room->logs, m, lanes), known = ALLOWANCE * FACTOR_SPREAD * (double)count;
        if (apart <= known || gearstab_stopped()) {
            store_logs(room->logs, scale, m, lanes, logs);
            return 0;
        }
        more = (apart > 2.0 * known ? apart : 2.0 * known);
    }
}

/* Runs first..last-1 of RUN_OF_POINTS points of a row, one row after the other: omega (r, points) -> logs (r, points,
   m, 2). */
static int exponents(const struct damped *pattern, int64_t first, int64_t last, int64_t points, const double *omega,
                     double *logs) {
    const int64_t m = pattern->m, runs = (points + RUN_OF_POINTS - 1) / RUN_OF_POINTS;
    struct factor_room room = {0};
    double *spread = malloc((size_t)(2 * pattern->segments) * sizeof *spread), total = 0.0;
    int failed = spread ? 0 : -1;
    for (int64_t run = first, known = -1; !failed && run < last && !gearstab_stopped(); run++) {
        int64_t r = run / runs, begin = run % runs * RUN_OF_POINTS;
        int64_t end = begin + RUN_OF_POINTS < points ? begin + RUN_OF_POINTS : points;
        if (r != known)
            total = spread_of(pattern, known = r, spread);
        for (int64_t k = begin; !failed && k < end; k += LANES) {
            vec period = pattern->cycles / load_part(omega + r * points, k, end);
            failed = exponents_of(pattern, m, r, spread, total, period, end - k < LANES ? end - k : LANES, &room,
                                  logs + (r * points + k) * m * 2);
        }
    }
    free(room.memory);
    free(spread);
    return failed;
}

/* Points first..last-1 of given factors (count, points, m, m): ln lambda of their products, logs (points, m, 2). */
static int graded(int64_t count, int64_t m, int64_t first, int64_t last, int64_t points, const double *factors,
                  double *logs) {
    struct factor_room room = {0};
    if (factor_room_for(&room, count, m) < 0)
        return -1;
    for (int64_t k = first; k < last && !gearstab_stopped(); k += LANES) {
        int64_t lanes = last - k < LANES ? last - k : LANES;
        vec exponent = all(0.0);
        for (int64_t s = 0; s < count; s++) {
            vec *x = room.x + s * m * m;
            for (int64_t lane = 0; lane < LANES; lane++) {
                const double *own = factors + (s * points + k + (lane < lanes ? lane : 0)) * m * m;
                for (int64_t i = 0; i < m * m; i++)
                    x[i][lane] = own[i];
            }
            divide_by_power(x, m, &exponent);
        }
        periodic_qr(room.x, count, m, room.work, room.logs);
        store_logs(room.logs, LOG_TWO * exponent, m, lanes, logs + k * m * 2);
    }
    free(room.memory);
    return 0;
}

#endif
