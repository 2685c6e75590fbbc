/* Multipliers of a long product A_(F-1) ... A_1 A_0 that is never formed, LANES products in lockstep.

   The periodic QR algorithm (Bojanczyk, Golub & Van Dooren 1992; Kressner 2005, ch. 4): orthogonal changes of basis
   between the factors make all of them upper triangular but the last, which becomes Hessenberg; the double-shift sweeps
   of hessenberg.h then run around the whole period, and a bulge passes from each factor to the next. Multipliers are
   products of the factors' diagonal entries or, in pairs, of their 2 x 2 blocks. What rounding does to each factor is
   eps times its own size, so that the smallest multiplier is as right as the largest one, however far they are apart,
   as long as no single factor is ill-conditioned.

   Factors are row-major and of entries of about one; factor s of `count` lies at x + s m m. As in hessenberg.h only
   what lies in a lane's active block has to be right. */

#ifndef GEARSTAB_PERIODIC_H
#define GEARSTAB_PERIODIC_H

/* Part of the product's first entries below which its last ones do not serve as a shift, and the other way round.
   Without one levels part in at most 36/ln(1/FAINT) = 2 sweeps for each multiplier of the block. */
#define FAINT 1e-8

/* A reflection I - (1, y, z)^T (a, b, c) of three neighbouring coordinates. */
struct turn {
    vec y, z, a, b, c;
};

/* The one that makes (p, q, r) a multiple of its first entry, returned in end; exactly the identity where q = r = 0. */
INLINE struct turn turn_of(vec p, vec q, vec r, vec *end) {
    vec rest = q * q + r * r, size = with_sign_of(root(p * p + rest), p), first = p + size, product = size * first;
    mask acts = (product > DBL_MIN) & (rest > 0.0);
    vec inverse = choose(acts, 1.0 / choose(acts, product, all(1.0)), all(0.0));
    vec over_first = inverse * size, over_size = inverse * first;
    *end = choose(acts, -size, p);
    return (struct turn){q * over_first, r * over_first, first * over_size, q * over_size, r * over_size};
}

/* Rows k.. of a, columns from..to, turned; three: whether there is a row k + 2. */
INLINE void turn_rows(vec *a, int64_t m, int64_t k, int three, int64_t from, int64_t to, const struct turn *by) {
    vec *h0 = a + k * m, *h1 = h0 + m, *h2 = h1 + m;
    for (int64_t j = from; j <= to; j++) {
        vec t = h0[j] + by->y * h1[j];
        if (three)
            t += by->z * h2[j];
        h0[j] -= by->a * t, h1[j] -= by->b * t;
        if (three)
            h2[j] -= by->c * t;
    }
}

/* Columns k.. of a, rows from..to. */
INLINE void turn_columns(vec *a, int64_t m, int64_t k, int three, int64_t from, int64_t to, const struct turn *by) {
    for (int64_t i = from; i <= to; i++) {
        vec *line = a + i * m + k, t = by->a * line[0] + by->b * line[1];
        if (three)
            t += by->c * line[2];
        line[0] -= t, line[1] -= t * by->y;
        if (three)
            line[2] -= t * by->z;
    }
}

/* What becomes of a reflection of coordinates k.. behind the triangular factors: a product of two. */
struct turns {
    struct turn first, second;
    int both;
};

/* A reflection goes on through all triangular factors: each one whose columns it mixes is made triangular again by one
   or two reflections of its rows, which the next factor meets as columns. */
INLINE struct turns pass_triangles(vec *x, int64_t count, int64_t m, int64_t k, int three, int64_t bottom, int64_t top,
                                   struct turn turn) {
    struct turns by = {turn, {{0}, {0}, {0}, {0}, {0}}, 0};
    for (int64_t s = 0; s + 1 < count; s++) {
        vec *a = x + s * m * m, *corner = a + k * (m + 1);
        turn_columns(a, m, k, three, bottom, k + 1 + three, &by.first);
        if (by.both)
            turn_columns(a, m, k + 1, 0, bottom, k + 2, &by.second);
        by.first = turn_of(corner[0], corner[m], three ? corner[2 * m] : all(0.0), &corner[0]);
        corner[m] = all(0.0);
        turn_rows(a, m, k, three, k + 1, top, &by.first);
        if (!three)
            continue;
        corner[2 * m] = all(0.0);
        by.second = turn_of(corner[m + 1], corner[2 * m + 1], all(0.0), &corner[m + 1]);
        corner[2 * m + 1] = all(0.0);
        turn_rows(a, m, k + 1, 0, k + 2, top, &by.second);
        by.both = 1;
    }
    return by;
}

/* The rows that a sweep is about: those of all active blocks, and those of each lane; -1 in lanes that take no part. */
struct range {
    int64_t bottom, top;
    mask low, high;
};

static void include(struct range *range, const struct blocks *block, int lane) {
    int64_t low = block->lowest[lane], high = block->highest[lane];
    range->low[lane] = low, range->high[lane] = high;
    range->bottom = low < range->bottom ? low : range->bottom;
    range->top = high > range->top ? high : range->top;
}

/* One double-shift sweep. */
static void sweep_factors(vec *x, int64_t count, int64_t m, const struct range *range, const vec start[3]) {
    const int64_t bottom = range->bottom, top = range->top;
    vec *h = x + (count - 1) * m * m, end;
    for (int64_t k = bottom; k < top; k++) {
        const mask at = (mask){0} + k;
        mask begins = at == range->low, inside = (at > range->low) & (at < range->high), third = at + 1 < range->high;
        vec p = (vec)((mask)start[0] & begins), q = (vec)((mask)start[1] & begins), r = (vec)((mask)start[2] & begins);
        vec *h0 = h + k * m;
        int three = k + 2 <= top;
        if (k > bottom) {
            p = choose(inside, h0[k - 1], p);
            q = choose(inside, h0[m + k - 1], q);
            if (three)
                r = choose(inside & third, h0[2 * m + k - 1], r);
        }
        struct turn turn = turn_of(p, q, r, &end);
        if (k > bottom) {
            h0[k - 1] = choose(inside, end, h0[k - 1]);
            h0[m + k - 1] = choose(inside, all(0.0), h0[m + k - 1]);
            if (three)
                h0[2 * m + k - 1] = choose(inside & third, all(0.0), h0[2 * m + k - 1]);
        }
        turn_rows(h, m, k, three, k, top, &turn);
        struct turns by = pass_triangles(x, count, m, k, three, bottom, top, turn);
        turn_columns(h, m, k, three, bottom, k + 3 < top ? k + 3 : top, &by.first);
        if (by.both)
            turn_columns(h, m, k + 1, 0, bottom, k + 3 < top ? k + 3 : top, &by.second);
    }
}

/* One sweep without a shift, H = Q R and the product turned by Q. Each reflection is that of two entries of H, before
   its columns are turned: nothing is told by a bulge, which would wash out where rows differ by many powers of ten. */
static void sweep_unshifted(vec *x, int64_t count, int64_t m, const struct range *range) {
    const int64_t bottom = range->bottom, top = range->top;
    vec *h = x + (count - 1) * m * m;
    struct turns by;
    for (int64_t k = bottom; k < top; k++) {
        const mask at = (mask){0} + k, acts = (at >= range->low) & (at < range->high);
        vec *corner = h + k * (m + 1);
        struct turn turn = turn_of(corner[0], choose(acts, corner[m], all(0.0)), all(0.0), &corner[0]);
        corner[m] = choose(acts, all(0.0), corner[m]);
        turn_rows(h, m, k, 0, k + 1, top, &turn);
        if (k > bottom)
            turn_columns(h, m, k - 1, 0, bottom, k, &by.first);
        by = pass_triangles(x, count, m, k, 0, bottom, top, turn);
    }
    turn_columns(h, m, top - 1, 0, bottom, top, &by.first);
}

/* A product of scalars or small matrices: values times 2^exponent. */
struct scaled {
    double value[3];
    int exponent;
};

INLINE void keep_in_range(struct scaled *of, int count) {
    double size = 0.0;
    int exponent;
    UNROLLED for (int i = 0; i < count; i++)
        size = fabs(of->value[i]) > size ? fabs(of->value[i]) : size;
    if ((size > 0x1p-200 && size < 0x1p200) || size == 0 || !isfinite(size))
        return;
    frexp(size, &exponent);
    UNROLLED for (int i = 0; i < count; i++)
        of->value[i] = ldexp(of->value[i], -exponent);
    of->exponent += exponent;
}

#define A(s, i, j) x[((s) * m + (i)) * m + (j)][lane]

/* The product of the triangular factors' 2 x 2 blocks at i: entries (i, i), (i, i + 1), (i + 1, i + 1). */
static struct scaled block_product(const vec *x, int64_t count, int64_t m, int64_t i, int lane) {
    struct scaled u = {{1.0, 0.0, 1.0}, 0};
    for (int64_t s = 0; s + 1 < count; s++) {
        u.value[1] = A(s, i, i) * u.value[1] + A(s, i, i + 1) * u.value[2];
        u.value[0] *= A(s, i, i);
        u.value[2] *= A(s, i + 1, i + 1);
        keep_in_range(&u, 3);
    }
    return u;
}

static void put(double *value, double log, double angle) { value[0] = log, value[1] = angle; }

/* ln lambda of the single multiplier at i. */
static void single_multiplier(const vec *x, int64_t count, int64_t m, int64_t i, int lane, double *value) {
    struct scaled d = {{1.0}, 0};
    for (int64_t s = 0; s < count; s++) {
        d.value[0] *= A(s, i, i);
        keep_in_range(&d, 1);
    }
    put(value, log(fabs(d.value[0])) + LOG_TWO * d.exponent, d.value[0] < 0 ? 0.5 * TURN : 0.0);
}

/* ln lambda of the pair at i and i + 1: the larger of two real ones, or the angle of complex ones, from the product of
   the 2 x 2 blocks, the rest from the product of their determinants, which loses nothing. */
static void pair_of_multipliers(const vec *x, int64_t count, int64_t m, int64_t i, int lane, double *first,
                                double *second) {
    const int64_t end = count - 1;
    struct scaled d = {{1.0}, 0}, u = block_product(x, count, m, i, lane);
    double h00 = A(end, i, i), h01 = A(end, i, i + 1), h10 = A(end, i + 1, i), h11 = A(end, i + 1, i + 1);
    for (int64_t s = 0; s < end; s++) {
        d.value[0] *= A(s, i, i) * A(s, i + 1, i + 1);
        keep_in_range(&d, 1);
    }
    d.value[0] *= h00 * h11 - h01 * h10;
    double a = u.value[0] * h00 + u.value[1] * h10, b = u.value[0] * h01 + u.value[1] * h11, c = u.value[2] * h10;
    double d11 = u.value[2] * h11, half = 0.5 * (a + d11), apart = 0.5 * (a - d11);
    double discriminant = apart * apart + b * c;
    double both = log(fabs(d.value[0])) + LOG_TWO * d.exponent;
    if (discriminant < 0 && d.value[0] > 0) {
        double angle = atan2(sqrt(-discriminant), half);
        put(first, 0.5 * both, angle);
        put(second, 0.5 * both, -angle);
        return;
    }
    double large = half + copysign(discriminant > 0 ? sqrt(discriminant) : 0.0, half);
    double own = log(fabs(large)) + LOG_TWO * u.exponent;
    put(first, own, large < 0 ? 0.5 * TURN : 0.0);
    put(second, both - own, (large < 0) != (d.value[0] < 0) ? 0.5 * TURN : 0.0);
}

/* Split off converged multipliers of one lane until its last block has at least three rows; 0 when all are found. logs
   (LANES, m, 2). */
static int deflate_factors(vec *x, int64_t count, int64_t m, int lane, struct blocks *block, double *logs) {
    const int64_t end = count - 1;
    double *own = logs + lane * m * 2;
    while (block->highest[lane] >= 0) {
        int64_t high = block->highest[lane], low = high;
        for (; low > 0; low--) {
            double size = fabs(A(end, low - 1, low - 1)) + fabs(A(end, low, low));
            if (!(fabs(A(end, low, low - 1)) > DBL_EPSILON * size + NOTHING)) {
                A(end, low, low - 1) = 0.0; /* for good, as of a single matrix */
                break;
            }
        }
        block->lowest[lane] = low;
        if (low < high - 1)
            return 1;
        if (low == high)
            single_multiplier(x, count, m, high, lane, own + 2 * high);
        else
            pair_of_multipliers(x, count, m, low, lane, own + 2 * low, own + 2 * high);
        block->highest[lane] = low - 1;
        block->sweeps[lane] = 0;
    }
    return 0;
}

/* The first column of (P - x)(P - y) of one lane, up to a factor, P the product of all active blocks, x and y the
   eigenvalues of that of the last 2 x 2 blocks; returns 0 where these are so far from the first entries that a shift by
   them would be lost on the way. */
static int first_column_of_product(const vec *x, int64_t count, int64_t m, const struct blocks *block, int lane,
                                    vec column[3]) {
    const int64_t end = count - 1, low = block->lowest[lane], high = block->highest[lane];
    /* What the triangular factors make of the first axis, and of what the whole product makes of it. */
    struct scaled axis = {{1.0}, 0}, w = {{A(end, low, low), A(end, low + 1, low)}, 0};
    for (int64_t s = 0; s < end; s++) {
        axis.value[0] *= A(s, low, low);
        w.value[0] = A(s, low, low) * w.value[0] + A(s, low, low + 1) * w.value[1];
        w.value[1] *= A(s, low + 1, low + 1);
        keep_in_range(&axis, 1);
        keep_in_range(&w, 2);
    }
    struct scaled u = block_product(x, count, m, high - 1, lane);
    double h00 = A(end, high - 1, high - 1), h01 = A(end, high - 1, high);
    double h10 = A(end, high, high - 1), h11 = A(end, high, high);
    if (exceptional(block->sweeps[lane])) {
        double s = fabs(h10) + fabs(A(end, high - 1, high - 2));
        h00 = h11 = h11 + 0.75 * s;
        h01 = -0.4375 * s, h10 = s;
    }
    double first = fabs(axis.value[0]) * (fabs(A(end, low, low)) + fabs(A(end, low + 1, low)));
    double last = fabs(u.value[0]) * (fabs(h00) + fabs(h01));
    last += (fabs(u.value[1]) + fabs(u.value[2])) * (fabs(h10) + fabs(h11));
    last = ldexp(last, u.exponent - axis.exponent);
    if (!(last > FAINT * first && first > FAINT * last))
        return 0;
    double sum = u.value[0] * h00 + u.value[1] * h10 + u.value[2] * h11;
    double product = u.value[0] * u.value[2] * (h00 * h11 - h01 * h10);
    double p = A(end, low, low) * w.value[0] + A(end, low, low + 1) * w.value[1];
    double q = A(end, low + 1, low) * w.value[0] + A(end, low + 1, low + 1) * w.value[1];
    double r = A(end, low + 2, low + 1) * w.value[1];
    double shift = ldexp(sum, u.exponent - w.exponent);
    double other = ldexp(product / axis.value[0], 2 * u.exponent - axis.exponent - w.exponent);
    p += other - shift * A(end, low, low), q -= shift * A(end, low + 1, low);
    double size = fabs(p) + fabs(q) + fabs(r);
    column[0][lane] = p / size, column[1][lane] = q / size, column[2][lane] = r / size;
    return 1;
}

#undef A

/* ln lambda of all multipliers, logs (LANES, m, 2) real and imaginary parts, of x (count, m, m), which is destroyed;
   work (m,). NaN in lanes that do not converge. */
static void periodic_qr(vec *x, int64_t count, int64_t m, vec *work, double *logs) {
    struct blocks block;
    reduce_factors(x, count, m, work);
    for (int lane = 0; lane < LANES; lane++) {
        block.highest[lane] = m - 1;
        block.sweeps[lane] = 0;
    }
    for (;;) {
        struct range shifted = {m, -1, (mask){0} - 1, (mask){0} - 1}, plain = shifted;
        vec start[3] = {all(0.0), all(0.0), all(0.0)};
        for (int lane = 0; lane < LANES; lane++) {
            if (!deflate_factors(x, count, m, lane, &block, logs))
                continue;
            if (block.sweeps[lane]++ >= MOST_SWEEPS + 2 * m) {
                for (int64_t i = 0; i <= block.highest[lane]; i++)
                    put(logs + (lane * m + i) * 2, NAN, NAN);
                block.highest[lane] = -1;
                continue;
            }
            include(first_column_of_product(x, count, m, &block, lane, start) ? &shifted : &plain, &block, lane);
        }
        if ((shifted.top < 0 && plain.top < 0) || gearstab_stopped())
            return;
        if (shifted.top >= 0)
            sweep_factors(x, count, m, &shifted, start);
        if (plain.top >= 0)
            sweep_unshifted(x, count, m, &plain);
    }
}

#endif
