/* Values and extremes of many polynomials on [0, 1], given by their coefficients of powers; see kernel.h. */

#ifndef GEARSTAB_POLYNOMIALS_H
#define GEARSTAB_POLYNOMIALS_H

enum { SIDE_BY_SIDE = 4 };

/* Values at SIDE_BY_SIDE vectors of places; coefficients are stride apart. */
INLINE void side_by_side(const double *powers, int64_t stride, int64_t degree, const double *u, double *value) {
    vec at[SIDE_BY_SIDE], sum[SIDE_BY_SIDE];
    UNROLLED for (int v = 0; v < SIDE_BY_SIDE; v++)
        at[v] = load(u + v * LANES), sum[v] = all(powers[degree * stride]);
    for (int64_t k = degree - 1; k >= 0; k--) {
        vec next = all(powers[k * stride]);
        UNROLLED for (int v = 0; v < SIDE_BY_SIDE; v++)
            sum[v] = sum[v] * at[v] + next;
    }
    UNROLLED for (int v = 0; v < SIDE_BY_SIDE; v++)
        store(value + v * LANES, sum[v]);
}

void gearstab_sampled(const struct polynomials *all, const int64_t *first, const double *u, double *state) {
    enum { BLOCK = SIDE_BY_SIDE * LANES };
    for (int64_t s = 0; s < all->count && !gearstab_stopped(); s++) {
        const double *powers = all->powers + s * (all->degree + 1) * all->size;
        for (int64_t k = first[s]; k < first[s + 1]; k += BLOCK) {
            int64_t count = first[s + 1] - k < BLOCK ? first[s + 1] - k : BLOCK;
            double at[BLOCK] = {0}, value[BLOCK];
            memcpy(at, u + k, (size_t)count * sizeof *at);
            for (int64_t i = 0; i < all->kept; i++) {
                side_by_side(powers + i, all->size, all->degree, at, value);
                for (int64_t x = 0; x < count; x++)
                    state[(k + x) * all->kept + i] = value[x];
            }
        }
    }
}

/* The greatest value of a function that is given at equally spaced points: of the parabola through the largest one and its two
   neighbours. */
static double greatest(const double *f, int64_t points) {
    vec most = load(f);
    int64_t i = LANES;
    for (; i + LANES <= points; i += LANES)
        most = larger(most, load(f + i));
    double largest = most[0];
    for (int lane = 1; lane < LANES; lane++)
        largest = most[lane] > largest ? most[lane] : largest;
    for (; i < points; i++)
        largest = f[i] > largest ? f[i] : largest;
    int64_t at = 1;
    if (f[0] != largest)
        while (at < points - 2 && f[at] != largest)
            at++;
    double bend = 2 * f[at] - f[at - 1] - f[at + 1], slope = 0.5 * (f[at + 1] - f[at - 1]);
    double rise = bend > 0 && fabs(slope) <= bend ? 0.5 * slope * slope / bend : 0.0;
    return f[at] + rise > largest ? f[at] + rise : largest;
}

void gearstab_extremes(const struct polynomials *all, int64_t points, double *low, double *high) {
    enum { BLOCK = SIDE_BY_SIDE * LANES };
    double u[MOST_POINTS + BLOCK], value[MOST_POINTS + BLOCK];
    for (int64_t i = 0; i < points + BLOCK; i++)
        u[i] = (double)i / (double)(points - 1);
    for (int64_t s = 0; s < all->count && !gearstab_stopped(); s++)
        for (int64_t i = 0; i < all->size; i++) {
            const double *powers = all->powers + s * (all->degree + 1) * all->size + i;
            for (int64_t k = 0; k < points; k += BLOCK)
                side_by_side(powers, all->size, all->degree, u + k, value + k);
            high[s * all->size + i] = greatest(value, points);
            for (int64_t k = 0; k < points; k++)
                value[k] = -value[k];
            low[s * all->size + i] = -greatest(value, points);
        }
}

#endif
