/* Verdict and growth of conservative patterns. */

#ifndef GEARSTAB_CONSERVATIVE_H
#define GEARSTAB_CONSERVATIVE_H

/* n > 3: the rounding error of a rho is at most NOISE times the largest entry of W. */
#define NOISE (64 * DBL_EPSILON)
#define BATCH 8 /* vectors of points that go through one step after the other together, 4 to 16 alike; TOGETHER divides it */
#define SURE_GROWTH 1e-3 /* growths below this lose more than 1e-10 as acosh(rho/2) */

/* LANES of count numbers from position k on; what is missing repeats the last. */
INLINE vec load_part(const double *from, int64_t k, int64_t count) {
    if (k + LANES <= count)
        return load(from + k);
    vec value = all(0.0);
    UNROLLED for (int i = 0; i < LANES; i++)
        value[i] = from[k + i < count ? k + i : count - 1];
    return value;
}

INLINE void store_part(double *to, int64_t k, int64_t count, vec value) {
    if (k + LANES <= count)
        store(to + k, value);
    else
        for (int i = 0; k + i < count; i++)
            to[k + i] = value[i];
}

INLINE void store_verdict(int8_t *verdict, int64_t k, int64_t count, struct decision found) {
    mask code = (((mask){0} + DOUBTFUL) & found.doubtful) | (((mask){0} + STABLE) & found.stable & ~found.doubtful);
    bytes narrow = __builtin_convertvector(code, bytes);
    memcpy(verdict + k, &narrow, (size_t)(k + LANES <= count ? LANES : count - k));
}

/* What the points of a row need beside the row: the matrix, and room to reduce it. */
struct room {
    vec *x, *work, *real, *imaginary;
    void *memory;
    struct panels panels; /* without any unless matrices may be interpolated */
};

INLINE int room_new(struct room *room, int64_t n) {
    int64_t matrix = 4 * n * n, work = n * (3 * n + 2) + 7 * n;
    room->x = vectors(matrix + work + 2 * n, &room->memory);
    if (!room->x)
        return -1;
    room->work = room->x + matrix;
    room->real = room->work + work;
    room->imaginary = room->real + n;
    return 0;
}

/* The rho of LANES points from position k on, real and imaginary parts in turn; NaN in lanes that were scaled. */
INLINE void store_traces(double *rho, int64_t n, int64_t k, int64_t points, const vec *real, const vec *imaginary,
                         mask right) {
    for (int64_t lane = 0; lane < LANES && k + lane < points; lane++) {
        double *to = rho + (k + lane) * n * 2;
        for (int64_t i = 0; i < n; i++) {
            to[2 * i] = right[lane] ? real[i][lane] : NAN;
            to[2 * i + 1] = right[lane] ? imaginary[i][lane] : NAN;
        }
    }
}

/* The monodromy matrix of LANES points from position k on, and its scale; where wanted also by how much its rounding errors
   are larger than those of a product. */
INLINE vec matrix_at(const struct row *row, int64_t n, const struct room *room, vec period, int64_t k, int64_t points,
                     double *magnified) {
    vec larger_by = all(1.0), scale = all(0.0);
    int interpolated = interpolate(&room->panels, n, period, room->x, &larger_by);
    if (!interpolated)
        scale = propagate(row, period, room->x, room->work);
    COUNT(interpolated ? INTERPOLATED : PROPAGATED, points - k < LANES ? points - k : LANES);
    if (magnified)
        store_part(magnified, k, points, larger_by);
    return scale;
}

/* Where a row's answers go, (points,) each; what is not wanted is NULL. */
struct answers {
    int8_t *verdict;
    double *growth, *rho, *magnified;
};

/* Coefficients and verdict of LANES points from position k on, n <= 3; those that a stretch leaves in doubt, or all
   without one, are propagated. */
INLINE struct decision decide_few(const struct row *row, int64_t n, const struct room *room, const struct stretch *stretch,
                                  vec asked, int64_t k, int64_t points, const struct answers *to, vec s[3]) {
    struct decision found = {{0}, ~(mask){0}};
    if (stretch) {
        stretch_at(stretch, n, row->cycles / asked, s);
        found = classify(s, n, row->limits, stretch->noise);
        COUNT(INTERPOLATED, points - k < LANES ? points - k : LANES);
        if (!any(found.doubtful))
            return found;
    }
    mask again = found.doubtful;
    vec own[3], scale = matrix_at(row, n, room, period_of(row, asked), k, points, to->magnified);
    coefficients(room->x, n, own);
    struct decision exact = classify(own, n, row->limits, 0.0);
    exact.doubtful |= (scale > 0.0) | ~(row->highest * (row->cycles / asked) < MOST_TURNS);
    if (to->rho) {
        general_traces(room->x, n, room->real, room->imaginary, room->work);
        store_traces(to->rho, n, k, points, room->real, room->imaginary, scale == 0.0);
    }
    for (int64_t e = 0; e < n; e++)
        s[e] = stretch ? choose(again, own[e], s[e]) : own[e];
    found.stable = (again & exact.stable) | (~again & found.stable);
    found.doubtful = again & exact.doubtful;
    return found;
}

/* Points begin..end-1 of a row of n <= 3 coordinates, n a constant where this is inlined; stretch: theirs, or NULL. */
INLINE void scan_points(const struct row *row, int64_t n, const struct room *room, const struct stretch *stretch,
                        int64_t begin, int64_t end, const double *omega, const struct answers *to) {
    vec s[BATCH][3];
    mask unstable[BATCH];
    for (int64_t start = begin; start < end && !gearstab_stopped(); start += BATCH * LANES) {
        int64_t stop = start + BATCH * LANES < end ? start + BATCH * LANES : end;
        for (int64_t k = start, c = 0; k < stop; k += LANES, c++) {
            vec asked = load_part(omega, k, end);
            struct decision found = decide_few(row, n, room, stretch, asked, k, end, to, s[c]);
            unstable[c] = ~(found.stable | found.doubtful);
            store_verdict(to->verdict, k, end, found);
        }
        for (int64_t k = start, c = 0; k < stop; k += LANES, c++) {
            vec value = all(0.0);
            if (any(unstable[c]))
                value = choose(unstable[c], growth_of(s[c], n), value);
            store_part(to->growth, k, end, value);
        }
    }
}

/* A row, stretch by stretch unless the traces of all points are wanted. */
INLINE void scan_row(const struct row *row, int64_t n, const struct room *room, int64_t points, const double *omega,
                     const struct answers *to) {
    struct cut cut;
    cut.count = 1, cut.part[0] = (struct part){0, points, -1};
    if (!to->rho) /* which take a matrix */
        cut_row(&cut, row, n, points, omega);
    for (int64_t k = 0; k < cut.count; k++) {
        const struct part *part = cut.part + k;
        struct stretch stretch;
        int fitted = part->which >= 0 && stretch_set(&stretch, row, n, &cut, part, omega, room->x, room->work);
        scan_points(row, n, room, fitted ? &stretch : NULL, part->begin, part->end, omega, to);
    }
}

static void scan_row_1(const struct row *row, const struct room *room, int64_t points, const double *omega,
                       const struct answers *to) {
    scan_row(row, 1, room, points, omega, to);
}

static void scan_row_2(const struct row *row, const struct room *room, int64_t points, const double *omega,
                       const struct answers *to) {
    scan_row(row, 2, room, points, omega, to);
}

static void scan_row_3(const struct row *row, const struct room *room, int64_t points, const double *omega,
                       const struct answers *to) {
    scan_row(row, 3, room, points, omega, to);
}

/* Stable: all rho real, inside (-2, 2) and too far apart for rounding errors to have parted a pair from the complex
   plane. Unstable: sure growth. All else is left to the eigenvalues of M and the Krein signature (decision.py). */
static struct decision decide(int64_t n, const vec *real, const vec *imaginary, vec size, vec *growth) {
    vec largest = all(0.0), gap = all(DBL_MAX), outside = all(-DBL_MAX), off = all(0.0);
    for (int64_t i = 0; i < n; i++) {
        largest = larger(largest, squared_sinh(real[i], imaginary[i]));
        outside = larger(outside, magnitude(real[i]) - 2.0);
        off = larger(off, magnitude(imaginary[i]));
        for (int64_t j = 0; j < i; j++)
            gap = smaller(gap, magnitude(real[i] - real[j]));
    }
    vec noise = NOISE * size, excess = growth_from(largest);
    struct decision found;
    found.stable = (off == 0.0) & (outside < -100.0 * noise) & (gap * gap > 1000.0 * noise);
    mask unstable = (excess > SURE_GROWTH) & (excess * excess > 100.0 * noise);
    for (int64_t i = 0; i < n; i++) { /* a lane that did not converge, or overflowed */
        mask regular = (real[i] == real[i]) & (imaginary[i] == imaginary[i]);
        found.stable &= regular;
        unstable &= regular;
    }
    found.doubtful = ~(found.stable | unstable);
    *growth = choose(unstable, excess, all(0.0));
    return found;
}

static void scan_row_n(const struct row *row, const struct room *room, int64_t points, const double *omega,
                       const struct answers *to) {
    for (int64_t k = 0; k < points && !gearstab_stopped(); k += LANES) {
        vec asked = load_part(omega, k, points), value;
        vec scale = matrix_at(row, row->n, room, period_of(row, asked), k, points, to->magnified);
        vec size = general_traces(room->x, row->n, room->real, room->imaginary, room->work);
        struct decision found = decide(row->n, room->real, room->imaginary, size, &value);
        found.doubtful |= (scale > 0.0) | ~(row->highest * (row->cycles / asked) < MOST_TURNS);
        store_part(to->growth, k, points, choose(found.doubtful, all(0.0), value));
        store_verdict(to->verdict, k, points, found);
        if (to->rho)
            store_traces(to->rho, row->n, k, points, room->real, room->imaginary, scale == 0.0);
    }
}

static int scan(const struct conservative *pattern, int64_t first, int64_t last, int64_t points, const double *omega,
                int8_t *verdict, double *growth, double *rho, double *magnified) {
    struct row row;
    struct room room = {0};
    int64_t n = pattern->n;
    int failed = row_new(&row, pattern) || room_new(&room, n) || (magnified && panels_new(&room.panels, n, points));
    for (int64_t r = first; !failed && r < last && !gearstab_stopped(); r++) {
        row_set(&row, pattern, r);
        const double *asked = omega + r * points;
        struct answers to = {verdict + r * points, growth + r * points, rho ? rho + r * points * n * 2 : NULL,
                             magnified ? magnified + r * points : NULL};
        if (magnified)
            panels_set(&room.panels, &row, points, asked, room.work);
        switch (n) {
        case 1: scan_row_1(&row, &room, points, asked, &to); break;
        case 2: scan_row_2(&row, &room, points, asked, &to); break;
        case 3: scan_row_3(&row, &room, points, asked, &to); break;
        default: scan_row_n(&row, &room, points, asked, &to);
        }
    }
    panels_free(&room.panels);
    row_free(&row);
    free(room.memory);
    return failed ? -1 : 0;
}

static int monodromy(const struct conservative *pattern, int64_t first, int64_t last, const int64_t *index,
                     const double *omega, double *matrix, double *scale) {
    struct row row;
    struct room room = {0};
    int64_t size = 2 * pattern->n;
    int failed = row_new(&row, pattern) || room_new(&room, pattern->n);
    for (int64_t k = first; !failed && k < last && !gearstab_stopped();) {
        int64_t count = 1; /* the next points of the same row, as many as fit */
        while (count < LANES && k + count < last && index[k + count] == index[k])
            count++;
        row_set(&row, pattern, index[k]);
        vec factor = propagate(&row, period_of(&row, load_part(omega + k, 0, count)), room.x, room.work);
        for (int64_t lane = 0; lane < count; lane++) {
            double *to = matrix + (k + lane) * size * size;
            scale[k + lane] = factor[lane];
            for (int64_t i = 0; i < size; i++)
                for (int64_t j = 0; j < size; j++)
                    to[i * size + j] = room.x[j * size + i][lane];
        }
        k += count;
    }
    row_free(&row);
    free(room.memory);
    return failed ? -1 : 0;
}

static int traces(const struct conservative *pattern, int64_t first, int64_t last, int64_t points, double bound,
                  const double *omega, double *rho) {
    struct row row;
    struct room room = {0};
    int64_t n = pattern->n;
    int failed = row_new(&row, pattern) || room_new(&room, n);
    for (int64_t r = first; !failed && r < last && !gearstab_stopped(); r++) {
        row_set(&row, pattern, r);
        for (int64_t k = 0; k < points && !gearstab_stopped(); k += LANES) {
            vec period = period_of(&row, load_part(omega + r * points, k, points));
            vec scale = propagate(&row, period, room.x, room.work);
            mask right = (scale == 0.0) & (largest_entry(room.x, 4 * n * n) < bound);
            general_traces(room.x, n, room.real, room.imaginary, room.work);
            store_traces(rho + r * points * n * 2, n, k, points, room.real, room.imaginary, right);
        }
    }
    row_free(&row);
    free(room.memory);
    return failed ? -1 : 0;
}

#endif
