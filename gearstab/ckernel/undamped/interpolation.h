/* Monodromy matrices at many mesh frequencies from those at few.

   A product of S exponentials is an entire function of the period T, of exponential type sigma = sum_s |fraction_s| max w_s:
   over an interval of half length h its Chebyshev coefficients fall as (sigma h/2)^k/k!, and with NODES of them nothing is
   left for sigma h <= HALF_PHASE. The periods of a row's points are cut into such panels; one with enough points gets its
   own polynomials, the points of others, and those of a vector that straddles two, are propagated.

   What it is worth: without it floquet.solve on the smooth waves of waveforms/harmonics.yaml, at 1000 mesh frequencies,
   takes 1.18 times the time, and a scan of n = 3 with 16 segments 1.05 times; with 4 segments it would take 0.7 times,
   so that only smooth waves ask for it. scripts/bench/kernel.py prints the share of points. */

#ifndef GEARSTAB_INTERPOLATION_H
#define GEARSTAB_INTERPOLATION_H

#define NODES 32
#define HALF_PHASE 8.0      /* rad: (8/2)^32/32! = 7e-17 */
#define PAYING 64           /* points of a panel from which on it is worth its nodes; 32 and 128 differ by 5 % at most */
#define MOST_GROWN 64.0     /* entries above this spoil the digits of other points of the panel */
#define LEFT_OVER 1e-13     /* of the last coefficients, relative to the largest entry: rounding, or the panel is not used */
#define NO_TERM 1e-18        /* of the largest entry: coefficients below this are those of rounding errors */
#define MOST_BYTES (1 << 28) /* of the polynomials of a row: 256 MB a thread */

struct panel {
    int64_t points;
    double size;         /* the largest entry at the nodes; 0: not used */
    double *coefficient; /* (n^2, NODES, 4): of the next four entries together, NULL where it does not pay */
};

struct panels {
    int64_t count, room, terms; /* coefficients that are not nothing, see terms_of */
    double first, length; /* of the first panel, periods as of period_of */
    double cosine[4 * NODES];
    struct panel *panel; /* (count,) */
    double *coefficient; /* of the panels that pay, one after the other, with room for `held` of them */
    size_t held;
    vec *sample;         /* (NODES / LANES, 4 n^2) */
    const double *balance; /* (2n,), what the coordinates are multiplied by first, or NULL */
    void *memory;
};

/* What every row needs. Room for polynomials is asked for when it is known how many there are, see panels_room. */
static int panels_new(struct panels *panels, int64_t n, int64_t points) {
    panels->room = points / PAYING;
    panels->panel = malloc((size_t)panels->room * sizeof *panels->panel + 1);
    panels->sample = vectors(NODES / LANES * 4 * n * n, &panels->memory);
    for (int k = 0; k < 4 * NODES; k++)
        panels->cosine[k] = cos(TURN * k / (4 * NODES));
    return panels->panel && panels->sample ? 0 : -1;
}

static void panels_free(struct panels *panels) {
    free(panels->panel);
    free(panels->coefficient);
    free(panels->memory);
}

/* Polynomials for the panels with enough points, as far as memory goes: points of others are propagated. */
static void panels_room(struct panels *panels, int64_t n) {
    size_t entries = (size_t)(NODES * 4 * n * n), most = MOST_BYTES / (entries * sizeof(double)), paying = 0, given = 0;
    for (int64_t k = 0; k < panels->count; k++)
        paying += panels->panel[k].points >= PAYING;
    paying = paying < most ? paying : most;
    if (paying > panels->held) {
        free(panels->coefficient);
        panels->coefficient = malloc(paying * entries * sizeof(double));
        panels->held = panels->coefficient ? paying : 0;
    }
    for (int64_t k = 0; k < panels->count && given < panels->held; k++)
        if (panels->panel[k].points >= PAYING)
            panels->panel[k].coefficient = panels->coefficient + given++ * entries;
}

/* The matrix x (2n, 2n), by columns, in coordinates of other units. */
INLINE void rescale(const double *unit, int64_t n, vec *x) {
    for (int64_t j = 0; j < 2 * n; j++)
        for (int64_t i = 0; i < 2 * n; i++)
            x[j * 2 * n + i] = x[j * 2 * n + i] * (unit[i] / unit[j]);
}

/* The polynomials of one panel from its nodes; the largest entry there, or 0 if they cannot be trusted. */
static double panel_fill(struct panels *panels, const struct row *row, int64_t k, vec *work) {
    int64_t entries = 4 * row->n * row->n;
    double *coefficient = panels->panel[k].coefficient, size = 0.0;
    double half = 0.5 * panels->length, middle = panels->first + (2 * k + 1) * half;
    for (int64_t i = 0; i < NODES && !gearstab_stopped(); i += LANES) {
        vec period, *x = panels->sample + i / LANES * entries;
        for (int64_t lane = 0; lane < LANES; lane++)
            period[lane] = middle + half * panels->cosine[2 * (i + lane) + 1];
        vec scale = propagate(row, period, x, work), largest;
        if (panels->balance)
            rescale(panels->balance, row->n, x);
        largest = largest_entry(x, entries);
        for (int64_t lane = 0; lane < LANES; lane++) {
            if (scale[lane] != 0.0 || !(largest[lane] <= MOST_GROWN))
                return 0.0;
            size = largest[lane] > size ? largest[lane] : size;
        }
    }
    double last = 0.0;
    for (int64_t j = 0; j < NODES; j++) {
        vec weight[NODES / LANES];
        for (int64_t i = 0; i < NODES; i++)
            weight[i / LANES][i % LANES] = (j ? 2.0 : 1.0) / NODES * panels->cosine[j * (2 * i + 1) % (4 * NODES)];
        for (int64_t e = 0; e < entries; e++) {
            vec sum = weight[0] * panels->sample[e];
            for (int64_t i = 1; i < NODES / LANES; i++)
                sum += weight[i] * panels->sample[i * entries + e];
            double total = 0.0;
            for (int64_t lane = 0; lane < LANES; lane++)
                total += sum[lane];
            coefficient[(e / 4 * NODES + j) * 4 + e % 4] = total;
            if (j >= NODES - 3)
                last = fabs(total) > last ? fabs(total) : last;
        }
    }
    return last <= LEFT_OVER * size ? size : 0.0;
}

/* Coefficients of a panel that something is left of, for sigma h. */
static int64_t terms_of(double phase) {
    int64_t k = 0;
    for (double left = 1.0; k < NODES && (left > NO_TERM || (double)k < phase); k++)
        left *= 0.5 * phase / (double)(k + 1);
    return k < 2 ? 2 : k;
}

/* Panels for the points of a row; without enough points for them there are none. */
static void panels_set(struct panels *panels, const struct row *row, int64_t points, const double *omega, vec *work) {
    double lowest = DBL_MAX, highest = 0.0, type = 0.0;
    panels->count = 0;
    for (int64_t s = 0; s < row->segments; s++) {
        double most = 0.0;
        for (int64_t i = 0; i < row->n; i++) {
            const struct mode *mode = row->modes + s * row->n + i;
            most = mode->kind != FREE && fabs(mode->phase) > most ? fabs(mode->phase) : most;
        }
        type += TURN * most;
    }
    for (int64_t k = 0; k < points; k++) {
        double period = row->cycles / omega[k];
        lowest = period < lowest ? period : lowest;
        highest = period > highest ? period : highest;
    }
    double count = ceil((highest - lowest) * type / (2.0 * HALF_PHASE)) + 1.0;
    if (!(highest > lowest) || !(count <= (double)panels->room) || !(row->highest * highest < MOST_TURNS))
        return;
    panels->count = (int64_t)count;
    panels->first = lowest;
    panels->length = (highest - lowest) / count;
    panels->terms = terms_of(0.5 * panels->length * type);
    for (int64_t k = 0; k < panels->count; k++)
        panels->panel[k] = (struct panel){0};
    for (int64_t k = 0; k < points; k++) {
        double place = (row->cycles / omega[k] - lowest) / panels->length;
        panels->panel[place < count ? (int64_t)place : panels->count - 1].points++;
    }
    panels_room(panels, row->n);
    for (int64_t k = 0; k < panels->count; k++)
        if (panels->panel[k].coefficient)
            panels->panel[k].size = panel_fill(panels, row, k, work);
}

/* x[e] = sum_j c[j][e] t[j] for four of 4 n^2 entries; twelve at once take 12 to 15 % longer with AVX-512. */
INLINE void combine(const double *c, int64_t terms, const vec *t, vec *x) {
    vec sum[4];
    UNROLLED for (int64_t e = 0; e < 4; e++)
        sum[e] = all(c[e]);
    for (int64_t j = 1; j < terms; j++)
        UNROLLED for (int64_t e = 0; e < 4; e++)
            sum[e] += c[4 * j + e] * t[j];
    UNROLLED for (int64_t e = 0; e < 4; e++)
        x[e] = sum[e];
}

/* Interpolate where all lanes lie in one panel: 1 and x, and by how much the errors of x exceed those of a propagated
   matrix, if so. */
static int interpolate(const struct panels *panels, int64_t n, vec period, vec *x, vec *magnified) {
    if (!panels->count)
        return 0;
    int64_t entries = 4 * n * n, panel = -1;
    for (int64_t lane = 0; lane < LANES; lane++) {
        double place = (period[lane] - panels->first) / panels->length;
        int64_t own = place < (double)panels->count ? (int64_t)place : panels->count - 1;
        if (panel >= 0 && own != panel)
            return 0;
        panel = own;
    }
    if (panels->panel[panel].size == 0.0)
        return 0;
    const double *c = panels->panel[panel].coefficient;
    vec t[NODES], place = 2.0 * ((period - panels->first) / panels->length - (double)panel) - 1.0;
    t[0] = all(1.0), t[1] = place;
    for (int64_t j = 2; j < NODES; j++)
        t[j] = 2.0 * place * t[j - 1] - t[j - 2];
    for (int64_t e = 0; e < entries; e += 4)
        combine(c + e * NODES, panels->terms, t, x + e);
    /* Those of the largest matrix at the nodes, and those of the sums. */
    *magnified = 1.0 + panels->panel[panel].size / larger(largest_entry(x, entries), all(1.0));
    return 1;
}

#endif
