/* Eigenvalues of real Hessenberg matrices, LANES matrices in lockstep.

   Implicit double-shift QR (Francis 1961; Golub & Van Loan, Matrix Computations, 7.5). Every lane has an active block of its
   own, rows lowest..highest; a sweep runs over the union of the blocks and is the identity on lanes outside theirs.
   Only eigenvalues are wanted, so that what lies outside an active block is never used again and need not be right. */

#ifndef GEARSTAB_HESSENBERG_H
#define GEARSTAB_HESSENBERG_H

#define MOST_SWEEPS 100 /* an eigenvalue; two or three are usual */
#define NOTHING 1e-140 /* the square of less underflows; matrices come with entries of about one or more */

/* A reflection I - v beta v^T that makes x (count, stride) a multiple of its first entry; v replaces x[1..], v[0] in first.
   Returns that multiple. */
INLINE vec reflector(vec *x, int64_t count, int64_t stride, vec *first, vec *beta) {
    vec sum = x[0] * x[0];
    for (int64_t i = 1; i < count; i++)
        sum += x[i * stride] * x[i * stride];
    vec size = with_sign_of(root(sum), x[0]);
    *first = x[0] + size;
    vec product = size * *first;
    *beta = choose(product > DBL_MIN, 1.0 / product, all(0.0));
    return choose(product > DBL_MIN, -size, x[0]);
}

/* line <- line (I - beta v v^T), (count,). */
INLINE void reflect_line(vec *line, int64_t count, const vec *v, vec beta) {
    vec sum = all(0.0);
    for (int64_t c = 0; c < count; c++)
        sum += v[c] * line[c];
    sum = sum * beta;
    for (int64_t c = 0; c < count; c++)
        line[c] -= sum * v[c];
}

/* Columns k..k+count-1 of a (m, m), all rows. */
INLINE void reflect_columns(vec *a, int64_t m, int64_t k, int64_t count, const vec *v, vec beta) {
    for (int64_t i = 0; i < m; i++)
        reflect_line(a + i * m + k, count, v, beta);
}

/* Columns that a reflection runs down together: a strip stays in the first cache from the sums to the changes. */
#define STRIP 8

/* A strip (count, width) of rows of length m <- (I - beta v v^T) strip; width a constant where this is inlined. */
INLINE void reflect_strip(vec *strip, int64_t m, int64_t count, int64_t width, const vec *v, vec beta) {
    vec sum[STRIP] = {0};
    for (int64_t i = 0; i < count; i++)
        UNROLLED for (int64_t j = 0; j < width; j++)
            sum[j] += v[i] * strip[i * m + j];
    for (int64_t i = 0; i < count; i++) {
        vec scaled = beta * v[i];
        UNROLLED for (int64_t j = 0; j < width; j++)
            strip[i * m + j] -= scaled * sum[j];
    }
}

/* Rows k..k+count-1 of a (m, m), columns from..m-1. */
static void reflect_rows(vec *a, int64_t m, int64_t k, int64_t count, int64_t from, const vec *v, vec beta) {
    int64_t c = from;
    for (; c + STRIP <= m; c += STRIP)
        reflect_strip(a + k * m + c, m, count, STRIP, v, beta);
    if (c < m)
        reflect_strip(a + k * m + c, m, count, m - c, v, beta);
}

/* Orthogonal reduction of a product of `count` factors x (count, m, m), row-major, the first one acting first: all
   become upper triangular but the last, which becomes Hessenberg. work (m,). */
static void reduce_factors(vec *x, int64_t count, int64_t m, vec *work) {
    vec *v = work, beta;
    for (int64_t j = 0; j + 1 < m && !(m > FEW_COORDINATES && gearstab_stopped()); j++)
        for (int64_t s = 0; s < count; s++) {
            int64_t k = s + 1 < count ? j : j + 1, rows = m - k;
            if (rows < 2)
                continue;
            vec *a = x + s * m * m, *next = s + 1 < count ? a + m * m : x;
            vec end = reflector(a + k * m + j, rows, m, &v[0], &beta);
            a[k * m + j] = end;
            for (int64_t i = 1; i < rows; i++) {
                v[i] = a[(k + i) * m + j];
                a[(k + i) * m + j] = all(0.0);
            }
            reflect_rows(a, m, k, rows, j + 1, v, beta);
            reflect_columns(next, m, k, rows, v, beta);
        }
}

/* The same of a single matrix. */
static void reduce_to_hessenberg(vec *h, int64_t m, vec *work) { reduce_factors(h, 1, m, work); }

/* Eigenvalues of [[a, b], [c, d]] as (real, imaginary) in first and second. */
static void two_by_two(double a, double b, double c, double d, double first[2], double second[2]) {
    double half = 0.5 * (a - d), product = b * c, discriminant = half * half + product;
    first[1] = second[1] = 0.0;
    if (discriminant < 0) {
        first[0] = second[0] = d + half;
        first[1] = sqrt(-discriminant);
        second[1] = -first[1];
        return;
    }
    /* The shift from d that does not cancel; the other root from the product. */
    double far = half + copysign(sqrt(discriminant), half);
    first[0] = d + far;
    second[0] = far != 0 ? d - product / far : d;
}

/* Whether a sweep takes an exceptional shift, to break a cycle. Where all multipliers lie on one circle, as next to no
   damping leaves them, one in ten did not break it in 40 sweeps for a third of the matrices near one of a train; one in
   three does in 30. */
INLINE int exceptional(int sweeps) { return sweeps >= 9 && sweeps % 3 == 0; }

/* The state of the lanes between sweeps. */
struct blocks {
    int64_t lowest[LANES], highest[LANES];
    int sweeps[LANES];
};

/* Split off converged eigenvalues of one lane until its last block has at least three rows; 0 when all are found. */
static int deflate(vec *h, int64_t m, int lane, struct blocks *block, vec *real, vec *imaginary) {
#define H(i, j) h[(i) * m + (j)][lane]
    while (block->highest[lane] >= 0) {
        int64_t high = block->highest[lane], low = high;
        for (; low > 0; low--) {
            double size = fabs(H(low - 1, low - 1)) + fabs(H(low, low));
            if (!(fabs(H(low, low - 1)) > DBL_EPSILON * size + NOTHING)) {
                /* For good: later sweeps leave the rest of this column, and the rows above, as they are. */
                H(low, low - 1) = 0.0;
                break;
            }
        }
        block->lowest[lane] = low;
        if (low < high - 1)
            return 1;
        if (low == high) {
            real[high][lane] = H(high, high);
            imaginary[high][lane] = 0.0;
        } else {
            double first[2], second[2];
            two_by_two(H(low, low), H(low, high), H(high, low), H(high, high), first, second);
            real[low][lane] = first[0], imaginary[low][lane] = first[1];
            real[high][lane] = second[0], imaginary[high][lane] = second[1];
        }
        block->highest[lane] = low - 1;
        block->sweeps[lane] = 0;
    }
    return 0;
}

/* The first column of (H - x)(H - y) of each lane, up to a factor, x and y the eigenvalues of its last 2 x 2 block. */
static void first_columns(const vec *h, int64_t m, const struct blocks *block, vec column[3]) {
    column[0] = column[1] = column[2] = all(0.0);
    for (int lane = 0; lane < LANES; lane++) {
        int64_t low = block->lowest[lane], high = block->highest[lane];
        if (high < 0)
            continue;
        double x = H(high, high), y = H(high - 1, high - 1), w = H(high, high - 1) * H(high - 1, high);
        if (exceptional(block->sweeps[lane])) {
            double s = fabs(H(high, high - 1)) + fabs(H(high - 1, high - 2));
            x = y = x + 0.75 * s;
            w = -0.4375 * s * s;
        }
        double top = H(low, low), next = H(low + 1, low + 1), below = H(low + 1, low);
        column[0][lane] = ((top - x) * (top - y) - w) / below + H(low, low + 1);
        column[1][lane] = (top - x) + (next - y);
        column[2][lane] = H(low + 2, low + 1);
    }
#undef H
}

/* One double-shift QR sweep over rows bottom..top, the union of the active blocks. */
static void sweep(vec *h, int64_t m, int64_t bottom, int64_t top, const struct blocks *block, const vec start[3]) {
    mask low, high;
    for (int lane = 0; lane < LANES; lane++) {
        low[lane] = block->lowest[lane];
        high[lane] = block->highest[lane];
    }
    for (int64_t k = bottom; k < top; k++) {
        const mask at = (mask){0} + k;
        mask begins = at == low, inside = (at > low) & (at < high), third = at + 1 < high;
        vec p = (vec)((mask)start[0] & begins), q = (vec)((mask)start[1] & begins), r = (vec)((mask)start[2] & begins);
        vec *h0 = h + k * m, *h1 = h0 + m, *h2 = h1 + m; /* h2 is not touched where k + 2 > top */
        int three = k + 2 <= top;
        if (k > bottom) {
            p = choose(inside, h0[k - 1], p);
            q = choose(inside, h1[k - 1], q);
            if (three)
                r = choose(inside & third, h2[k - 1], r);
        }
        vec size = with_sign_of(root(p * p + q * q + r * r), p);
        vec first = p + size, product = size * first;
        mask acts = product > DBL_MIN;
        vec inverse = choose(acts, 1.0 / choose(acts, product, all(1.0)), all(0.0));
        if (k > bottom) {
            h0[k - 1] = choose(inside & acts, -size, h0[k - 1]);
            h1[k - 1] = choose(inside, all(0.0), h1[k - 1]);
            if (three)
                h2[k - 1] = choose(inside & third, all(0.0), h2[k - 1]);
        }
        /* I - (1, y, z)^T (a, b, c) */
        vec over_first = inverse * size, over_size = inverse * first;
        vec y = q * over_first, z = r * over_first;
        vec a = first * over_size, b = q * over_size, c = r * over_size;
        if (three) {
            for (int64_t j = k; j <= top; j++) {
                vec t = h0[j] + y * h1[j] + z * h2[j];
                h0[j] -= a * t, h1[j] -= b * t, h2[j] -= c * t;
            }
            int64_t last = k + 3 < top ? k + 3 : top;
            for (int64_t i = bottom; i <= last; i++) {
                vec *line = h + i * m + k;
                vec t = a * line[0] + b * line[1] + c * line[2];
                line[0] -= t, line[1] -= t * y, line[2] -= t * z;
            }
        } else {
            for (int64_t j = k; j <= top; j++) {
                vec t = h0[j] + y * h1[j];
                h0[j] -= a * t, h1[j] -= b * t;
            }
            for (int64_t i = bottom; i <= top; i++) {
                vec *line = h + i * m + k;
                vec t = a * line[0] + b * line[1];
                line[0] -= t, line[1] -= t * y;
            }
        }
    }
}

/* Eigenvalues (m,) of h (m, m), Hessenberg, row-major, destroyed. NaN in lanes that do not converge. */
static void hessenberg_eigenvalues(vec *h, int64_t m, vec *real, vec *imaginary) {
    struct blocks block;
    for (int lane = 0; lane < LANES; lane++) {
        block.highest[lane] = m - 1;
        block.sweeps[lane] = 0;
    }
    for (;;) {
        int64_t bottom = m, top = -1;
        for (int lane = 0; lane < LANES; lane++) {
            if (!deflate(h, m, lane, &block, real, imaginary)) {
                block.lowest[lane] = block.highest[lane] = -1;
                continue;
            }
            if (block.sweeps[lane]++ >= MOST_SWEEPS) {
                for (int64_t i = 0; i <= block.highest[lane]; i++)
                    real[i][lane] = imaginary[i][lane] = NAN;
                block.lowest[lane] = block.highest[lane] = -1;
                continue;
            }
            bottom = block.lowest[lane] < bottom ? block.lowest[lane] : bottom;
            top = block.highest[lane] > top ? block.highest[lane] : top;
        }
        if (top < 0 || (m > FEW_COORDINATES && gearstab_stopped()))
            return;
        vec start[3];
        first_columns(h, m, &block, start);
        sweep(h, m, bottom, top, &block, start);
    }
}

#endif
