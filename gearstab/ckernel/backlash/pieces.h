/* Pieces of a motion as polynomials: gearstab/response/backlash/dynamics.py. */

#ifndef GEARSTAB_PIECES_H
#define GEARSTAB_PIECES_H

/* What a piece is made in. generator (D, D), by columns, where everything is constant. Else sums (1 + J, D), of magnitudes in
   the rows of what is always there and of what comes with a function; applied (J, degree, D), what comes with a function times
   the coefficients of y. shape (order, J): the functions on the piece as powers of u. row (D,): for sums. */
struct pieces {
    double *generator, *sums, *shape, *applied, *row;
};

/* NaN where one of the two is. */
INLINE double greater(double a, double b) { return a > b || a != a ? a : b; }

/* out += factor G y, G given by columns. */
INLINE void add_product(const double *columns, const double *y, double factor, int64_t size, double *restrict out) {
    for (int64_t j = 0; j < size; j++) {
        const double *restrict column = columns + j * size, part = factor * y[j];
        for (int64_t i = 0; i < size; i++)
            out[i] += part * column[i];
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

/* sums (D,) += the magnitudes in every row of a matrix that is given by columns; returns the largest sum in a column. */
static double magnitudes(const double *columns, int64_t size, double *sums) {
    double largest = 0.0;
    for (int64_t j = 0; j < size; j++) {
        double sum = 0.0;
        for (int64_t i = 0; i < size; i++) {
            double entry = fabs(columns[j * size + i]);
            sum += entry, sums[i] += entry;
        }
        largest = greater(sum, largest);
    }
    return largest;
}

static double largest_of(const double *values, int64_t count) {
    double largest = 0.0;
    for (int64_t i = 0; i < count; i++)
        largest = greater(fabs(values[i]), largest);
    return largest;
}

/* What a contact with other matrices, or another cell, needs to know. */
static void prepare(const struct motion *motion, struct pieces *p, const double *matrices, int64_t cell) {
    const int64_t size = motion->size;
    if (motion->order == 1) {
        generator_of(motion, matrices, motion->shape + cell * motion->functions, p->generator);
        return;
    }
    for (int64_t j = 0; j <= motion->functions; j++) {
        memset(p->sums + j * size, 0, (size_t)size * sizeof *p->sums);
        magnitudes(matrices + j * size * size, size, p->sums + j * size);
    }
}

/* A length over which |G| is no more than `reach`. */
static double reached(const struct motion *motion, double norm) {
    double length = norm > 0 ? motion->reach / norm : INFINITY;
    return isfinite(length) ? length : 1.0;
}

/* Where everything is constant: powers (degree + 1, D) of exp(G t) y over the returned length. */
static double constant_piece(const struct motion *motion, struct pieces *p, int64_t cell, const double *y, double longest,
                             double *powers) {
    const int64_t size = motion->size;
    memcpy(p->shape, motion->shape + cell * motion->functions, (size_t)motion->functions * sizeof *p->shape);
    memset(p->row, 0, (size_t)size * sizeof *p->row);
    double column = magnitudes(p->generator, size, p->row), row = largest_of(p->row, size);
    double length = reached(motion, row < column ? row : column);
    length = length < longest ? length : longest;
    memset(powers, 0, (size_t)((motion->degree + 1) * size) * sizeof *powers);
    memcpy(powers, y, (size_t)size * sizeof *powers);
    for (int64_t k = 1; k <= motion->degree; k++)
        add_product(p->generator, powers + (k - 1) * size, length / (double)k, size, powers + k * size);
    return length;
}

/* The functions from `begin` to the end of a cell, as powers of u = 0...1 (order, J); on the cell motion->shape has them. */
static void shifted(const struct motion *motion, int64_t cell, double begin, double *shape) {
    const int64_t order = motion->order, count = motion->functions;
    const double *span = motion->span + 2 * cell, whole = span[1] - span[0];
    const double at = (begin - span[0]) / whole, part = (span[1] - begin) / whole;
    memcpy(shape, motion->shape + cell * order * count, (size_t)(order * count) * sizeof *shape);
    for (int64_t r = 0; r < order; r++)
        for (int64_t i = order - 2; i >= r; i--)
            for (int64_t j = 0; j < count; j++)
                shape[i * count + j] += at * shape[(i + 1) * count + j];
    double scale = 1.0;
    for (int64_t i = 0; i < order; i++, scale *= part)
        for (int64_t j = 0; j < count; j++)
            shape[i * count + j] *= scale;
}

/* Its beginning, up to u = part. */
static void shorten(const struct motion *motion, double part, double *shape) {
    double scale = 1.0;
    for (int64_t i = 0; i < motion->order; i++, scale *= part)
        for (int64_t j = 0; j < motion->functions; j++)
            shape[i * motion->functions + j] *= scale;
}

/* An upper bound of |G| on the piece, by its rows. */
static double bound(const struct motion *motion, struct pieces *p) {
    const int64_t size = motion->size;
    memcpy(p->row, p->sums, (size_t)size * sizeof *p->row);
    for (int64_t j = 0; j < motion->functions; j++) {
        double most = 0.0;
        for (int64_t i = 0; i < motion->order; i++)
            most += fabs(p->shape[i * motion->functions + j]);
        for (int64_t i = 0; i < size; i++)
            p->row[i] += most * p->sums[(j + 1) * size + i];
    }
    return largest_of(p->row, size);
}

/* Where functions vary smoothly: powers (degree + 1, D) of the solution of y' = G(u) y over the returned length by the
   recurrence of its coefficients; -1 where no piece is short enough for the tolerance. */
static double varying_piece(const struct motion *motion, struct pieces *p, const double *matrices, int64_t cell,
                            double begin, const double *y, double longest, double *powers) {
    const int64_t size = motion->size, degree = motion->degree, functions = motion->functions;
    shifted(motion, cell, begin, p->shape);
    double length = reached(motion, bound(motion, p));
    if (length < longest)
        shorten(motion, length / longest, p->shape);
    else
        length = longest;
    for (int64_t halving = 0; halving < motion->most_halvings; halving++) {
        memset(powers, 0, (size_t)((degree + 1) * size) * sizeof *powers);
        memcpy(powers, y, (size_t)size * sizeof *powers);
        for (int64_t k = 0; k < degree; k++) {
            double *next = powers + (k + 1) * size;
            add_product(matrices, powers + k * size, 1.0, size, next);
            for (int64_t j = 0; j < functions; j++) {
                double *applied = p->applied + j * degree * size;
                memset(applied + k * size, 0, (size_t)size * sizeof *applied);
                add_product(matrices + (j + 1) * size * size, powers + k * size, 1.0, size, applied + k * size);
                for (int64_t i = 0; i <= k && i < motion->order; i++) {
                    const double factor = p->shape[i * functions + j];
                    for (int64_t x = 0; x < size; x++)
                        next[x] += factor * applied[(k - i) * size + x];
                }
            }
            for (int64_t x = 0; x < size; x++)
                next[x] *= length / (double)(k + 1);
        }
        if (largest_of(powers + (degree - 1) * size, 2 * size) <= motion->tolerance * largest_of(powers, (degree + 1) * size))
            return length;
        length *= 0.5;
        shorten(motion, 0.5, p->shape);
    }
    return -1.0;
}

#endif
