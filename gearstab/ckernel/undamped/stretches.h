/* Coefficients s1..sn of the polynomial of rho at many mesh frequencies from those at few, n <= 3.

   They are entire functions of the period T, of exponential type sigma = sum of |fraction w| over segments and modes at most:
   over an interval of half length h the Chebyshev coefficients fall as (sigma h/2)^k/k!. A row is cut into parts by its
   periods; in those with many more points than nodes, stretches, a point costs a sum of some tens of terms, whatever the
   number of segments. Others are propagated, as are points of a stretch whose verdict could depend on the errors of
   interpolation: verdicts are those of propagation. How a row is cut depends on the row alone.

   What it is worth, in ns a point with AVX-512 (AVX2), rows of 100, 400 and 1000 points over a range of 1 to 20:
   R = 1, 4 segments:     propagated 50, 46, 45 (60, 59, 57), so 41, 23, 19 (54, 35, 27);
   R = 3/5, 16 segments:  propagated 169, 161, 157 (215, 206, 203), so 137, 73, 51 (177, 94, 66);
   R = 9/10, 38 segments: propagated 408, 371, 368 (486, 466, 469), so 405, 206, 138 (482, 253, 173). */

#ifndef GEARSTAB_STRETCHES_H
#define GEARSTAB_STRETCHES_H

#define MOST_NODES 128
#define MOST_FITTED 5      /* functions of a stretch */
#define CELL 16.0          /* rad, sigma times the length of a cell of a row */
#define FURTHEST 1000.0    /* rad, sigma T from which on all is propagated: nodes are rounded, which adds 1e-13 there */
#define CLEAR_PHASE 100.0  /* rad, sigma T at which that adds as much as propagation does, 1e-14 */
#define MOST_CELLS 63      /* FURTHEST / CELL */
#define MOST_TOLERATED 1e3 /* coefficients; of larger ones the errors would be too large for other points of the stretch */
#define LAST_TERMS 3e-14   /* of a polynomial, relative to the largest value at the nodes: more, and it is not trusted */
#define CAUTION 1.2        /* what a stretch costs beyond its operations: partly filled vectors, points in doubt */
#define FEWEST 64          /* points of a row from which on stretches are looked for */

/* Sizes of polynomials: nodes and cells of the row that they span; the error of the interpolation, 2 J_nodes(half the phase
   of the cells), is below 2e-16. */
static const struct {
    int64_t nodes, cells;
} SIZES[] = {{32, 1}, {48, 2}, {64, 3}, {96, 6}, {128, 9}};

enum { SIZE_COUNT = sizeof SIZES / sizeof *SIZES };

/* Polynomials over an interval of periods: the sum over k < nodes/2 of (even_k + x odd_k) T_k(2 x^2 - 1), |x| <= 1. */
struct stretch {
    int64_t nodes;
    double middle, inverse; /* of the half length */
    double noise;           /* errors in units of those that propagation leaves on coefficients of one */
    double even[MOST_FITTED][MOST_NODES / 2], odd[MOST_FITTED][MOST_NODES / 2];
};

/* For a size: cosines of (2 i + 1) pi/(2 nodes), i < nodes/2, times 0, 2, 4.. and then times 1, 3, 5.., 2/nodes times (1/nodes
   times for 0). They are computed once; NULL when there is no memory. */
static const double *table_of(int64_t which) {
    static double *known;
    double *found = __atomic_load_n(&known, __ATOMIC_ACQUIRE), cosine[4 * MOST_NODES];
    int64_t total = 0, begin = 0;
    for (int k = 0; k < SIZE_COUNT; k++) {
        begin += k < which ? SIZES[k].nodes * SIZES[k].nodes / 2 : 0;
        total += SIZES[k].nodes * SIZES[k].nodes / 2;
    }
    if (found)
        return found + begin;
    double *made = malloc((size_t)total * sizeof(double)), *next = made;
    for (int k = 0; made && k < SIZE_COUNT; k++) {
        int64_t nodes = SIZES[k].nodes, half = nodes / 2;
        for (int64_t i = 0; i < 4 * nodes; i++)
            cosine[i] = cos(TURN * (double)i / (double)(4 * nodes));
        for (int64_t i = 0; i < half; i++)
            for (int64_t j = 0; j < nodes; j++) {
                int64_t times = j < half ? 2 * j : 2 * (j - half) + 1;
                *next++ = (j ? 2.0 : 1.0) / (double)nodes * cosine[(2 * i + 1) * times % (4 * nodes)];
            }
    }
    if (made && !__atomic_compare_exchange_n(&known, &found, made, 0, __ATOMIC_ACQ_REL, __ATOMIC_ACQUIRE))
        free(made); /* another thread was first */
    else
        found = made;
    return found ? found + begin : NULL;
}

/* Node i of `nodes`, cos((2 i + 1) pi/(2 nodes)). */
INLINE double node(const double *table, int64_t nodes, int64_t i) {
    int64_t mirror = nodes - 1 - i;
    double half = 0.5 * (double)nodes;
    return i < mirror ? half * table[i * nodes + nodes / 2] : -half * table[mirror * nodes + nodes / 2];
}

/* From samples of a function at the nodes to its polynomial; returns the size of the last coefficients. */
INLINE double transform(const double *sample, const double *table, int64_t nodes, double *even, double *odd) {
    vec sum[MOST_NODES / LANES];
    int64_t half = nodes / 2, length = nodes / LANES;
    for (int64_t j = 0; j < length; j++)
        sum[j] = all(0.0);
    for (int64_t i = 0; i < half; i++) {
        double both = sample[i] + sample[nodes - 1 - i], difference = sample[i] - sample[nodes - 1 - i];
        for (int64_t j = 0; j < length / 2; j++) {
            sum[j] += both * load(table + i * nodes + j * LANES);
            sum[length / 2 + j] += difference * load(table + i * nodes + half + j * LANES);
        }
    }
    for (int64_t j = 0; j < length / 2; j++) {
        store(even + j * LANES, sum[j]);
        store(odd + j * LANES, sum[length / 2 + j]);
    }
    double last = fabs(even[half - 1]) + fabs(odd[half - 1]);
    /* x T_k(2 x^2 - 1) = (T_(2 k + 1) + T_(2 k - 1))/2 */
    odd[half - 1] = 2.0 * odd[half - 1];
    for (int64_t k = half - 2; k > 0; k--)
        odd[k] = 2.0 * odd[k] - odd[k + 1];
    odd[0] -= 0.5 * odd[1];
    return last;
}

/* The coefficients at LANES periods of a stretch. */
INLINE void stretch_at(const struct stretch *of, int64_t n, vec period, vec *s) {
    vec x = (period - of->middle) * of->inverse, y = 2.0 * x * x - 1.0, twice = y + y;
    vec before = all(1.0), t = y, even[MOST_FITTED], odd[MOST_FITTED];
    UNROLLED for (int64_t e = 0; e < n; e++) {
        even[e] = of->even[e][0] + of->even[e][1] * t;
        odd[e] = of->odd[e][0] + of->odd[e][1] * t;
    }
    for (int64_t k = 2; k < of->nodes / 2; k++) {
        vec next = twice * t - before;
        before = t, t = next;
        UNROLLED for (int64_t e = 0; e < n; e++) {
            even[e] += of->even[e][k] * t;
            odd[e] += of->odd[e][k] * t;
        }
    }
    UNROLLED for (int64_t e = 0; e < n; e++)
        s[e] = even[e] + x * odd[e];
}

/* Points of a row that go together: which polynomial, -1 for none. */
struct part {
    int64_t begin, end, which;
};

/* A row cut into parts. */
struct cut {
    double type; /* sigma */
    int64_t count;
    struct part part[MOST_CELLS + 1];
};

/* 1 where the mesh frequencies grow along the row, -1 where they fall, else 0. */
INLINE int direction(int64_t points, const double *omega) {
    int64_t up = 0, down = 0;
    if (points < FEWEST)
        return 0;
    for (int64_t k = 0; k + 1 < points; k++) {
        up += omega[k] < omega[k + 1];
        down += omega[k] > omega[k + 1];
    }
    if (!(omega[0] > 0.0 && omega[0] < DBL_MAX && omega[points - 1] > 0.0 && omega[points - 1] < DBL_MAX))
        return 0;
    return up == points - 1 ? 1 : down == points - 1 ? -1 : 0;
}

/* How many of the points are above a mesh frequency. */
INLINE int64_t above(int64_t points, const double *omega, int grows, double least) {
    int64_t low = 0, high = points;
    while (low < high) {
        int64_t middle = low + (high - low) / 2;
        if ((omega[middle] > least) == !grows)
            low = middle + 1;
        else
            high = middle;
    }
    return grows ? points - low : low;
}

/* Add a part before those of the cut, or to the next one if both are propagated. */
INLINE void put_before(struct cut *of, struct part part) {
    struct part *next = of->count ? of->part + of->count - 1 : NULL;
    if (next && next->which < 0 && part.which < 0)
        next->begin = part.begin;
    else
        of->part[of->count++] = part;
}

/* The cheapest way through cells: `passed` points before the end of each, propagation in operations a point. */
INLINE void cut_cells(struct cut *of, int64_t n, int64_t cells, const int64_t *passed, double propagation) {
    double cost[MOST_CELLS + 1] = {0.0}; /* up to the end of each cell */
    struct part last[MOST_CELLS + 1];    /* that ends there, begin as a number of cells */
    for (int64_t c = 1; c <= cells; c++) {
        cost[c] = cost[c - 1] + (double)(passed[c] - passed[c - 1]) * propagation;
        last[c] = (struct part){c - 1, c, -1};
        for (int64_t k = 0; k < SIZE_COUNT && SIZES[k].cells <= c; k++) {
            int64_t begin = c - SIZES[k].cells, nodes = SIZES[k].nodes;
            double own = (double)(passed[c] - passed[begin]) * 0.5 * (double)(nodes * (1 + 2 * n));
            own = cost[begin] + CAUTION * (own + (double)nodes * (propagation + 0.5 * (double)(nodes * n)));
            if (own < cost[c])
                cost[c] = own, last[c].begin = begin, last[c].which = k;
        }
    }
    for (int64_t c = cells; c > 0; c = last[c].begin)
        put_before(of, (struct part){passed[last[c].begin], passed[c], last[c].which});
}

/* A row of `fitted` functions of type of->type. */
INLINE void cut_points(struct cut *of, int64_t fitted, double cycles, double propagation, int64_t points, const double *omega) {
    int64_t passed[MOST_CELLS + 1] = {0}, cells = 0;
    int grows = direction(points, omega);
    of->count = 1, of->part[0] = (struct part){0, points, -1};
    if (!grows || of->type == 0.0)
        return;
    double first = cycles / omega[grows > 0 ? points - 1 : 0], length = CELL / of->type;
    for (; passed[cells] < points && of->type * first + (double)(cells + 1) * CELL < FURTHEST; cells++)
        passed[cells + 1] = above(points, omega, grows > 0, cycles / (first + (double)(cells + 1) * length));
    of->part[0].begin = passed[cells], of->count = passed[cells] < points;
    cut_cells(of, fitted, cells, passed, propagation);
    for (int64_t k = 0; k < of->count && grows > 0; k++) /* the first of the periods come last */
        of->part[k] = (struct part){points - of->part[k].end, points - of->part[k].begin, of->part[k].which};
}

INLINE void cut_row(struct cut *of, const struct row *row, int64_t n, int64_t points, const double *omega) {
    of->type = 0.0;
    for (int64_t k = 0; k < row->segments * n; k++)
        of->type += row->modes[k].kind == FREE ? 0.0 : TURN * fabs(row->modes[k].phase);
    /* Rotations, then columns, whose halves are turned before the basis changes. */
    cut_points(of, n, row->cycles, (double)(row->segments * (20 * n + 2 * n * (4 * n + 2 * n * n))), points, omega);
}

/* Begin a stretch over a part of a row: its interval of periods, whose longest is returned. */
INLINE double stretch_over(struct stretch *of, const struct part *part, double cycles, const double *omega, double *half) {
    double one = cycles / omega[part->begin], other = cycles / omega[part->end - 1];
    double longest = one > other ? one : other, shortest = one > other ? other : one;
    *half = 0.5 * (longest - shortest);
    of->nodes = SIZES[part->which].nodes;
    of->middle = 0.5 * (shortest + longest), of->inverse = 1.0 / *half;
    return longest;
}

/* LANES periods of a stretch from node i on. */
INLINE vec periods_of_nodes(const struct stretch *of, const double *table, double half, int64_t i) {
    vec period = all(0.0);
    for (int64_t lane = 0; lane < LANES; lane++)
        period[lane] = of->middle + half * node(table, of->nodes, i + lane);
    return period;
}

/* The polynomials of a part of a row; 0 if they cannot be trusted. */
INLINE int stretch_set(struct stretch *of, const struct row *row, int64_t n, const struct cut *cut, const struct part *part,
                       const double *omega, vec *x, vec *work) {
    double sample[3][MOST_NODES], size = 1.0, left = 0.0;
    double half, longest = stretch_over(of, part, row->cycles, omega, &half);
    const double *table = table_of(part->which);
    if (!table)
        return 0;
    for (int64_t i = 0; i < of->nodes; i += LANES) {
        vec s[3], period = periods_of_nodes(of, table, half, i);
        vec scale = propagate(row, period, x, work), largest = all(0.0);
        coefficients(x, n, s);
        mask known = scale == 0.0;
        for (int64_t e = 0; e < n; e++) {
            largest = larger(magnitude(s[e]), largest);
            known &= magnitude(s[e]) < MOST_TOLERATED;
            store(&sample[e][i], s[e]);
        }
        if (any(~known)) /* most often where the period is longest, at the first nodes */
            return 0;
        for (int64_t lane = 0; lane < LANES; lane++)
            size = largest[lane] > size ? largest[lane] : size;
    }
    for (int64_t e = 0; e < n; e++) {
        double own = transform(sample[e], table, of->nodes, of->even[e], of->odd[e]);
        left = own > left ? own : left;
    }
    of->noise = size * (1.0 / 3.0) * (1.0 + cut->type * longest / CLEAR_PHASE);
    return left <= LAST_TERMS * size;
}

#endif
