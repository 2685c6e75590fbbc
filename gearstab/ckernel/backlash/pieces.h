/* Pieces of a motion as polynomials: gearstab/response/backlash/dynamics.py. */

#ifndef GEARSTAB_PIECES_H
#define GEARSTAB_PIECES_H

/* What a piece is made in: generators (1 or nodes, D, D) by columns, values of the functions (nodes, J), states and their
   rates at the nodes (nodes, D). */
struct pieces {
    double *generator, *value, *state, *rate, *next;
};

/* NaN where one of the two is. */
INLINE double greater(double a, double b) { return a > b || a != a ? a : b; }

/* out = G y, G given by columns. */
INLINE void applied(const double *columns, const double *y, int64_t size, double *restrict out) {
    for (int64_t i = 0; i < size; i++)
        out[i] = 0.0;
    for (int64_t j = 0; j < size; j++) {
        const double *restrict column = columns + j * size, factor = y[j];
        for (int64_t i = 0; i < size; i++)
            out[i] += factor * column[i];
    }
}

/* G = G_0 + sum_j v_j G_j, of the matrices (1 + J, D, D) that belong to a contact. */
static void generator_of(const struct motion *motion, const double *matrices, const double *value, double *found) {
    const int64_t entries = motion->size * motion->size;
    memcpy(found, matrices, (size_t)entries * sizeof *found);
    for (int64_t j = 0; j < motion->functions; j++) {
        const double *restrict part = matrices + (j + 1) * entries, factor = value[j];
        for (int64_t i = 0; i < entries; i++)
            found[i] += factor * part[i];
    }
}

/* The largest sum of magnitudes in a row of a matrix that is given by columns, and at column that in a column; NaN counts as
   largest. */
static double largest_row(const double *columns, int64_t size, double *sums, double *column) {
    double row = *column = 0.0;
    for (int64_t i = 0; i < size; i++)
        sums[i] = 0.0;
    for (int64_t j = 0; j < size; j++) {
        double sum = 0.0;
        for (int64_t i = 0; i < size; i++) {
            double entry = fabs(columns[j * size + i]);
            sum += entry, sums[i] += entry;
        }
        *column = greater(sum, *column);
    }
    for (int64_t i = 0; i < size; i++)
        row = greater(sums[i], row);
    return row;
}

/* Where everything is constant: powers (degree + 1, D) of exp(G t) y over the returned length, as long as |G| allows. */
static double constant_piece(const struct motion *motion, struct pieces *p, const double *y, double longest, double *powers) {
    const int64_t size = motion->size;
    double column, row = largest_row(p->generator, size, p->rate, &column);
    double norm = row < column ? row : column, length = norm > 0 ? motion->reach / norm : INFINITY;
    if (!isfinite(length))
        length = 1.0;
    if (length >= longest)
        length = longest;
    memcpy(powers, y, (size_t)size * sizeof *powers);
    for (int64_t k = 1; k <= motion->degree; k++) {
        double *last = powers + (k - 1) * size, *here = powers + k * size, part = length / (double)k;
        applied(p->generator, last, size, here);
        for (int64_t i = 0; i < size; i++)
            here[i] *= part;
    }
    return length;
}

/* The functions at the nodes of a piece from their Chebyshev coefficients (order, J) on a cell: Clenshaw. */
static void values_at_nodes(const struct motion *motion, int64_t cell, double begin, double length, double *value) {
    const int64_t count = motion->functions, order = motion->order;
    const double *wave = motion->wave + cell * order * count, *span = motion->span + 2 * cell;
    for (int64_t x = 0; x < motion->nodes; x++) {
        double c = 2 * (begin + length * motion->point[x] - span[0]) / (span[1] - span[0]) - 1;
        for (int64_t j = 0; j < count; j++) {
            double last = 0.0, here = 0.0;
            for (int64_t k = order - 1; k > 0; k--) {
                double next = 2 * c * here - last + wave[k * count + j];
                last = here, here = next;
            }
            value[x * count + j] = c * here - last + wave[j];
        }
    }
}

/* out (nodes, D) = table (nodes, nodes) in. */
static void tabulated(const struct motion *motion, const double *table, const double *in, double *restrict out) {
    const int64_t nodes = motion->nodes, size = motion->size;
    memset(out, 0, (size_t)(nodes * size) * sizeof *out);
    for (int64_t x = 0; x < nodes; x++)
        for (int64_t k = 0; k < nodes; k++)
            for (int64_t i = 0; i < size; i++)
                out[x * size + i] += table[x * nodes + k] * in[k * size + i];
}

static double largest_of(const double *values, int64_t count) {
    double largest = 0.0;
    for (int64_t i = 0; i < count; i++)
        largest = greater(fabs(values[i]), largest);
    return largest;
}

/* p->state: y at the nodes, the fixed point of y + int G y. */
static void picard(const struct motion *motion, struct pieces *p, const double *y, double length) {
    const int64_t nodes = motion->nodes, size = motion->size;
    for (int64_t x = 0; x < nodes; x++)
        memcpy(p->state + x * size, y, (size_t)size * sizeof *y);
    for (int64_t sweep = 0; sweep < motion->most_sweeps; sweep++) {
        for (int64_t x = 0; x < nodes; x++)
            applied(p->generator + x * size * size, p->state + x * size, size, p->rate + x * size);
        tabulated(motion, motion->integral, p->rate, p->next);
        double change = 0.0;
        for (int64_t x = 0; x < nodes; x++)
            for (int64_t i = 0; i < size; i++) {
                double *old = p->state + x * size + i, now = y[i] + length * p->next[x * size + i];
                change = greater(fabs(now - *old), change);
                *old = now;
            }
        /* No more than a rounding error of the largest entry. */
        if (change <= 2e-16 * largest_of(p->state, nodes * size))
            break;
    }
}

/* Where functions vary smoothly: the same by Picard iteration, -1 where no piece is short enough for the tolerance. */
static double varying_piece(const struct motion *motion, struct pieces *p, const double *matrices, int64_t cell,
                            double begin, const double *y, double longest, double *powers) {
    const int64_t nodes = motion->nodes, size = motion->size;
    double length = longest;
    for (int64_t halving = 0; halving < motion->most_halvings; halving++) {
        double norm = 0.0, column;
        values_at_nodes(motion, cell, begin, length, p->value);
        for (int64_t x = 0; x < nodes; x++) {
            double *generator = p->generator + x * size * size;
            generator_of(motion, matrices, p->value + x * motion->functions, generator);
            double row = largest_row(generator, size, p->rate, &column);
            norm = greater(row, norm);
        }
        if (norm * length > motion->shorter) {
            /* A little shorter than this size asks for; not by more than a thousand for a spike at one node. */
            double part = 0.9 * motion->shorter / (norm * length);
            length *= part > 1e-3 ? part : 1e-3;
            continue;
        }
        picard(motion, p, y, length);
        tabulated(motion, motion->waves, p->state, p->next);
        if (largest_of(p->next + (nodes - 2) * size, 2 * size) <= motion->tolerance * largest_of(p->next, nodes * size)) {
            tabulated(motion, motion->powers, p->next, powers);
            memcpy(powers, y, (size_t)size * sizeof *y);
            return length;
        }
        length *= 0.5;
    }
    return -1.0;
}

#endif
