/* Eigenproblems of many small symmetric matrices, LANES at once: cyclic Jacobi (Golub & Van Loan, 8.5). */

#ifndef GEARSTAB_SYMMETRIC_H
#define GEARSTAB_SYMMETRIC_H

#define MOST_CYCLES 30 /* of rotations; five or six are usual */

/* Diagonalise a (n, n) in place, its rotations collected in v (n, n), whose columns become the eigenvectors. */
static void jacobi(vec *a, vec *v, int64_t n) {
    for (int64_t i = 0; i < n * n; i++)
        v[i] = all(i % (n + 1) == 0);
    for (int cycle = 0; cycle < MOST_CYCLES; cycle++) {
        mask rotated = {0};
        for (int64_t p = 0; p + 1 < n; p++)
            for (int64_t q = p + 1; q < n; q++) {
                vec off = a[p * n + q], app = a[p * n + p], aqq = a[q * n + q];
                /* Relative to the diagonal, so that small eigenvalues of a graded matrix stay right. */
                vec least = 0.25 * DBL_EPSILON * root(magnitude(app)) * root(magnitude(aqq));
                mask acts = magnitude(off) > larger(least, all(DBL_MIN));
                if (!any(acts))
                    continue;
                rotated |= acts;
                vec half = 0.5 * (aqq - app);
                vec divisor = magnitude(half) + root(half * half + off * off);
                vec tangent = with_sign_of(off / choose(acts, divisor, all(1.0)), (vec)((bits)off ^ (bits)half));
                tangent = choose(acts, tangent, all(0.0));
                vec c = 1.0 / root(1.0 + tangent * tangent), s = tangent * c;
                a[p * n + p] = app - tangent * off;
                a[q * n + q] = aqq + tangent * off;
                a[p * n + q] = a[q * n + p] = choose(acts, all(0.0), off);
                for (int64_t i = 0; i < n; i++) {
                    if (i != p && i != q) {
                        vec x = a[i * n + p], y = a[i * n + q];
                        a[p * n + i] = a[i * n + p] = c * x - s * y;
                        a[q * n + i] = a[i * n + q] = s * x + c * y;
                    }
                    vec x = v[i * n + p], y = v[i * n + q];
                    v[i * n + p] = c * x - s * y;
                    v[i * n + q] = s * x + c * y;
                }
            }
        if (!any(rotated))
            return;
    }
}

/* sum += a b with its rounding errors in low: products of halves of 26 bits and two-sums (Dekker 1971, Knuth 1969). */
INLINE void add_exactly(vec a, vec b, vec *sum, vec *low) {
    const uint64_t head = ~UINT64_C(0x7ffffff);
    vec a1 = (vec)((bits)a & head), b1 = (vec)((bits)b & head), a2 = a - a1, b2 = b - b1;
    vec product = a * b;
    vec lost = ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2;
    vec total = *sum + product, part = total - *sum;
    *low += ((*sum - (total - part)) + (product - part)) + lost;
    *sum = total;
}

/* v (n, n) <- v (3 - v^T v)/2, work (2, n, n). Rotations are rounded so that columns grow by some 1e-16, always in the same
   direction, which a product of a thousand changes of modes would sum up. v^T v - 1 is of the size of its own rounding
   errors, which without fused multiply-add have a preferred sign too (measured: 0.05 eps): they are added again. */
static void orthonormalise(vec *v, int64_t n, vec *work) {
    vec *half = work, *old = work + n * n;
    for (int64_t i = 0; i < n * n; i++)
        old[i] = v[i];
    for (int64_t i = 0; i < n; i++)
        for (int64_t j = i; j < n; j++) {
            vec excess = all(i == j ? -1.0 : 0.0), low = all(0.0);
            for (int64_t k = 0; k < n; k++)
                add_exactly(old[k * n + i], old[k * n + j], &excess, &low);
            half[i * n + j] = half[j * n + i] = 0.5 * (excess + low);
        }
    for (int64_t i = 0; i < n; i++)
        for (int64_t j = 0; j < n; j++) {
            vec change = old[i * n] * half[j];
            for (int64_t k = 1; k < n; k++)
                change += old[i * n + k] * half[k * n + j];
            v[i * n + j] = old[i * n + j] - change;
        }
}

/* Sort by ascending eigenvalue: odd-even transposition, alike in all lanes. */
static void sort_by_value(vec *a, vec *v, int64_t n) {
    for (int64_t pass = 0; pass < n; pass++)
        for (int64_t i = pass % 2; i + 1 < n; i += 2) {
            vec *low = a + i * (n + 1), *high = low + n + 1;
            mask swaps = *low > *high;
            vec kept = *low;
            *low = choose(swaps, *high, kept);
            *high = choose(swaps, kept, *high);
            for (int64_t k = 0; k < n; k++) {
                vec *x = v + k * n + i, left = x[0];
                x[0] = choose(swaps, x[1], left);
                x[1] = choose(swaps, left, x[1]);
            }
        }
}

static int symmetric(int64_t first, int64_t last, int64_t n, const double *matrix, double *values, double *vectors_) {
    void *memory;
    vec *a = vectors(4 * n * n, &memory);
    if (!a)
        return -1;
    vec *v = a + n * n, *work = v + n * n;
    for (int64_t k = first; k < last && !gearstab_stopped(); k += LANES) {
        int64_t count = last - k < LANES ? last - k : LANES;
        mask known = load_matrices(a, n, matrix + k * n * n, count);
        jacobi(a, v, n);
        orthonormalise(v, n, work);
        sort_by_value(a, v, n);
        for (int64_t lane = 0; lane < count; lane++) {
            for (int64_t i = 0; i < n; i++)
                values[(k + lane) * n + i] = known[lane] ? a[i * (n + 1)][lane] : NAN;
            for (int64_t i = 0; i < n * n; i++)
                vectors_[(k + lane) * n * n + i] = known[lane] ? v[i][lane] : NAN;
        }
    }
    free(memory);
    return 0;
}

#endif
