/* The Morse indices of a period, see gearstab/floquet/boundaries/counting/krein.py, which says what they are and where they come from.

   Whole numbers of the path of matrices over the period, which the monodromy matrix alone cannot give. They are asked for at
   a few points only (between two of them they follow from monotony, see letters.c), so that one point at a time does. */

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "kernel.h"

#define LONGEST 300.0 /* hyperbolic angles are cut here, far beyond what the caller looks at and far from overflow */

struct index_room {
    int64_t n;
    double *x, *old, *left, *right, *rotation;
    void *memory;
};

void *gearstab_index_new(int64_t n) {
    struct index_room *room = malloc(sizeof *room);
    size_t square = (size_t)(n * n);
    double *memory = malloc((4 * square + 4 * square + 2 * square + 2 * square + 3 * (size_t)n) * sizeof(double));
    if (!room || !memory) {
        free(room);
        free(memory);
        return NULL;
    }
    *room = (struct index_room){n, memory, memory + 4 * square, memory + 8 * square, memory + 10 * square,
                                memory + 12 * square, memory};
    return room;
}

void gearstab_index_free(void *given) {
    struct index_room *room = given;
    if (room)
        free(room->memory);
    free(room);
}

/* left (n, n) is factorised, right (n, columns) becomes left^-1 right: elimination with partial pivoting. */
static void solve_for(double *left, double *right, int64_t n, int64_t columns) {
    for (int64_t k = 0; k < n; k++) {
        int64_t best = k;
        for (int64_t i = k + 1; i < n; i++)
            best = fabs(left[i * n + k]) > fabs(left[best * n + k]) ? i : best;
        if (best != k) {
            for (int64_t j = k; j < n; j++) {
                double kept = left[k * n + j];
                left[k * n + j] = left[best * n + j], left[best * n + j] = kept;
            }
            for (int64_t j = 0; j < columns; j++) {
                double kept = right[k * columns + j];
                right[k * columns + j] = right[best * columns + j], right[best * columns + j] = kept;
            }
        }
        double pivot = left[k * n + k];
        pivot = left[k * n + k] = pivot == 0.0 ? DBL_MIN : pivot;
        for (int64_t i = k + 1; i < n; i++) {
            double factor = left[i * n + k] / pivot;
            if (factor == 0.0)
                continue;
            for (int64_t j = k + 1; j < n; j++)
                left[i * n + j] -= factor * left[k * n + j];
            for (int64_t j = 0; j < columns; j++)
                right[i * columns + j] -= factor * right[k * columns + j];
        }
    }
    for (int64_t k = n - 1; k >= 0; k--) {
        for (int64_t i = k + 1; i < n; i++)
            for (int64_t j = 0; j < columns; j++)
                right[k * columns + j] -= left[k * n + i] * right[i * columns + j];
        for (int64_t j = 0; j < columns; j++)
            right[k * columns + j] /= left[k * n + k];
    }
}

/* The number of negative eigenvalues of the symmetric part of a (n, n), destroyed, by pivots of L D L^T (Sylvester's law of
   inertia). Without pivoting: a tiny pivot spoils the factors but not the signs, unless it is zero to rounding. */
static int64_t negative(double *a, int64_t n) {
    int64_t count = 0;
    for (int64_t i = 0; i < n; i++)
        for (int64_t j = 0; j < i; j++)
            a[j * n + i] = 0.5 * (a[i * n + j] + a[j * n + i]);
    for (int64_t k = 0; k < n; k++) {
        const double *row = a + k * n;
        double pivot = row[k] == 0.0 ? DBL_MIN : row[k];
        count += pivot < 0.0;
        for (int64_t i = k + 1; i < n; i++) {
            double factor = row[i] / pivot;
            for (int64_t j = i; j < n; j++)
                a[i * n + j] -= factor * row[j];
        }
    }
    return count;
}

/* cos w t, sin(w t)/w, -w sin(w t) of a segment (3, n); returns the sum of floor(w t/pi). */
static int64_t turn_by(const double *squared, double duration, int64_t n, double *rotation) {
    int64_t turns = 0;
    for (int64_t i = 0; i < n; i++) {
        double w = sqrt(fabs(squared[i])), angle = w * duration;
        if (squared[i] > 0) {
            turns += (int64_t)floor(angle / M_PI);
            rotation[i] = cos(angle);
            rotation[n + i] = sin(angle) / w;
            rotation[2 * n + i] = -w * sin(angle);
        } else if (squared[i] < 0) {
            angle = angle < LONGEST ? angle : LONGEST;
            rotation[i] = cosh(angle);
            rotation[n + i] = sinh(angle) / w;
            rotation[2 * n + i] = w * sinh(angle);
        } else {
            rotation[i] = 1.0, rotation[n + i] = duration, rotation[2 * n + i] = 0.0;
        }
    }
    return turns;
}

/* x (2n, 2n), row-major, advanced by a segment. */
static void carry(struct index_room *room, const double *change) {
    int64_t n = room->n, m = 2 * n;
    double *x = room->x, *old = room->old;
    const double *cosine = room->rotation, *over = cosine + n, *times = over + n;
    for (int64_t i = 0; i < n; i++)
        for (int64_t j = 0; j < m; j++) {
            double p = x[i * m + j], v = x[(n + i) * m + j];
            old[i * m + j] = cosine[i] * p + over[i] * v;
            old[(n + i) * m + j] = times[i] * p + cosine[i] * v;
        }
    if (!change) {
        memcpy(x, old, (size_t)(m * m) * sizeof(double));
        return;
    }
    memset(x, 0, (size_t)(m * m) * sizeof(double));
    for (int64_t half = 0; half < 2; half++)
        for (int64_t i = 0; i < n; i++)
            for (int64_t k = 0; k < n; k++) {
                double b = change[i * n + k];
                const double *from = old + (half * n + k) * m;
                double *to = x + (half * n + i) * m;
                for (int64_t j = 0; j < m; j++)
                    to[j] += b * from[j];
            }
}

/* D B^-1 + cot of the next segment has as many negative eigenvalues as conjugate points are gained at this jump. */
static int64_t at_jump(struct index_room *room) {
    int64_t n = room->n, m = 2 * n;
    double *left = room->left, *right = room->right;
    const double *cosine = room->rotation, *over = cosine + n;
    for (int64_t i = 0; i < n; i++)
        for (int64_t j = 0; j < n; j++) {
            left[i * n + j] = room->x[j * m + n + i];
            right[i * n + j] = room->x[(n + j) * m + n + i];
        }
    solve_for(left, right, n, n);
    for (int64_t i = 0; i < n; i++)
        right[i * n + i] += cosine[i] / over[i];
    return negative(right, n);
}

/* N(0) and N(pi) from the matrix of the whole period and the count so far. */
static void at_end(struct index_room *room, int64_t so_far, int64_t *at_one, int64_t *at_minus_one) {
    int64_t n = room->n, m = 2 * n;
    double *b = room->left, *both = b + n * n, *inverse = room->right, *work = room->old;
    const double *x = room->x;
    for (int64_t i = 0; i < n; i++)
        for (int64_t j = 0; j < n; j++) {
            b[i * n + j] = x[i * m + n + j];
            inverse[i * m + j] = i == j;
            inverse[i * m + n + j] = x[i * m + j];
        }
    solve_for(b, inverse, n, m);
    for (int64_t i = 0; i < n; i++)
        for (int64_t j = 0; j < n; j++) {
            double sum = inverse[i * m + n + j];
            for (int64_t k = 0; k < n; k++)
                sum += x[(n + i) * m + n + k] * inverse[k * m + j];
            both[i * n + j] = sum;
        }
    for (int side = 0; side < 2; side++) {
        double sign = side ? 1.0 : -1.0;
        for (int64_t i = 0; i < n; i++)
            for (int64_t j = 0; j < n; j++)
                work[i * n + j] = both[i * n + j] + sign * (inverse[i * m + j] + inverse[j * m + i]);
        *(side ? at_minus_one : at_one) = so_far + negative(work, n);
    }
}

/* N(0) and N(pi) of a row at one cycle. */
void gearstab_index_at(void *given, const struct conservative *p, int64_t row, double cycle, int64_t *at_one,
                     int64_t *at_minus_one) {
    struct index_room *room = given;
    int64_t n = p->n, count = 0;
    double period = 2.0 * M_PI * p->cycles * cycle;
    for (int64_t i = 0; i < 4 * n * n; i++)
        room->x[i] = i % (2 * n + 1) == 0;
    for (int64_t s = 0; s < p->segments && !(n > FEW_COORDINATES && gearstab_stopped()); s++) {
        const double *squared = p->squared + (row * p->states + p->state[s]) * n;
        count += turn_by(squared, period * p->fractions[row * p->segments + s], n, room->rotation);
        if (s > 0)
            count += at_jump(room);
        carry(room, p->segments > 1 ? p->change + (row * p->segments + s) * n * n : NULL);
    }
    at_end(room, count, at_one, at_minus_one);
}
