/* Complex modes of lightly damped states, from the real ones of their stiffness.

   A state u'' + C u' + K u = 0 with symmetric K and C has the eigenvalues and eigenvectors of (l^2 + l C + K) v = 0. In
   the modes of K, of squared frequencies k_i, mode j with v_j = 1 is the fixed point of

       v_i = -l sum_(k != i) c_ik v_k/(l^2 + l c_ii + k_i),    l = -s/2 + i sqrt(k_j - s^2/4),    s = sum_k c_jk v_k

   which is reached in a few steps where damping is small beside the distances of frequencies. Left eigenvectors come for
   nothing by symmetry: (l v + C v, v) beside (v, l v). It takes a twentieth of the time of NumPy's eig and inv for three
   coordinates, which were a third of a map of 1,000 damped samples a cell. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../kernel.h"

/* Most steps; the change in a step that is rounding, where errors fall to less than a fifth in each. */
enum { STEPS = 30 };
static const double SETTLED = 4e-15, FALLS = 0.2;
/* Identical parts have modes of equal frequency and damping: twins, whose denominators are below the first part of their
   squared frequency. Damping between them below the second part of the largest is that of rounding errors; divided by them it
   would mix twins at random, and left eigenvectors would not be those of the inverse. How far they are is looked at in modes
   nearer than the third part. */
static const double TWINS = 1e-8, UNCOUPLED = 1e-14, NEAR = 1e-4, INVERSE = 1e-12;

typedef struct {
    double re, im;
} number;

static inline number times(number a, number b) { return (number){a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re}; }
static inline number plus(number a, number b) { return (number){a.re + b.re, a.im + b.im}; }
static inline double size(number a) { return fabs(a.re) + fabs(a.im); }

static inline number over(number a, number b) {
    double square = b.re * b.re + b.im * b.im;
    return (number){(a.re * b.re + a.im * b.im) / square, (a.im * b.re - a.re * b.im) / square};
}

/* i sqrt(k - (s/2)^2) - s/2 of k far above |s|^2. */
static inline number root(double k, number s) {
    number half = {0.5 * s.re, 0.5 * s.im}, z = times(half, half);
    double re = k - z.re, im = -z.im, real = sqrt(0.5 * (re + sqrt(re * re + im * im)));
    return (number){-0.5 * im / real - half.re, real - half.im};
}

/* Whether mode j of one state is found: l, v and the last C v; c: the damping in the modes of K. */
static int mode(int64_t j, int64_t n, const double *k, const double *c, number *l, number *v, number *push) {
    double drag = 0.0;
    for (int64_t i = 0; i < n; i++)
        drag = fmax(drag, fabs(c[i * n + i]));
    memset(v, 0, n * sizeof *v);
    v[j].re = 1.0;
    *l = (number){0.0, sqrt(k[j])};
    double last = INFINITY;
    for (int step = 0; step < STEPS; step++) {
        for (int64_t i = 0; i < n; i++) {
            push[i] = (number){0.0, 0.0};
            for (int64_t q = 0; q < n; q++)
                push[i].re += c[i * n + q] * v[q].re, push[i].im += c[i * n + q] * v[q].im;
        }
        number before = *l;
        *l = root(k[j], push[j]);
        double largest = 0.0, change = size((number){l->re - before.re, l->im - before.im}) / size(*l);
        for (int64_t i = 0; i < n; i++) {
            if (i == j)
                continue;
            double own = c[i * n + i];
            number rest = {own * v[i].re - push[i].re, own * v[i].im - push[i].im};
            number below = times(*l, (number){l->re + own, l->im});
            below.re += k[i];
            int twin = size(below) < TWINS * k[j] && size(rest) < UNCOUPLED * drag;
            number next = twin ? (number){0.0, 0.0} : over(times(*l, rest), below);
            double moved = size((number){next.re - v[i].re, next.im - v[i].im});
            change = moved > change || moved != moved ? moved : change;
            v[i] = next;
            largest = size(next) > largest ? size(next) : largest;
        }
        /* So large, it might be another mode. */
        if (largest >= 1.0)
            return 0;
        if (change < SETTLED)
            break;
        /* The first two steps tell nothing yet of how errors fall. */
        if (!(step < 2 || change < FALLS * last || change < 10 * SETTLED) || step == STEPS - 1)
            return 0;
        last = change;
    }
    for (int64_t i = 0; i < n; i++) {
        push[i] = (number){0.0, 0.0};
        for (int64_t q = 0; q < n; q++)
            push[i].re += c[i * n + q] * v[q].re, push[i].im += c[i * n + q] * v[q].im;
    }
    return 1;
}

/* How far row r of y and column s of x are from those of inverse matrices, r and s different. */
static double overlap(int64_t m, const number *y, const number *x, int64_t r, int64_t s) {
    number sum = {0.0, 0.0};
    for (int64_t i = 0; i < m; i++)
        sum = plus(sum, times(y[r * m + i], x[i * m + s]));
    return size(sum);
}

/* Whether the modes of nearly equal frequencies are inverse to each other. */
static int apart(int64_t n, const double *k, const number *y, const number *x) {
    for (int64_t j = 1; j < n; j++)
        for (int64_t i = j - 1; i >= 0 && k[j] - k[i] < NEAR * k[j]; i--)
            if (!(overlap(2 * n, y, x, 2 * i, 2 * j) < INVERSE && overlap(2 * n, y, x, 2 * j, 2 * i) < INVERSE))
                return 0;
    return 1;
}

/* Phi x, of complex x. */
static void turned(int64_t n, const double *shapes, const number *x, number *y) {
    for (int64_t i = 0; i < n; i++) {
        y[i] = (number){0.0, 0.0};
        for (int64_t q = 0; q < n; q++)
            y[i].re += shapes[i * n + q] * x[q].re, y[i].im += shapes[i * n + q] * x[q].im;
    }
}

int gearstab_light_modes(int64_t count, int64_t n, const double *squared, const double *shapes, const double *damping,
                         double *values, double *vectors, double *inverse, int8_t *found) {
    number *v = malloc(4 * n * sizeof *v), *push = v + n, *left = v + 2 * n, *right = v + 3 * n;
    if (!v)
        return 1;
    int64_t m = 2 * n;
    for (int64_t b = 0; b < count && !gearstab_stopped(); b++) {
        const double *k = squared + b * n, *c = damping + b * n * n, *phi = shapes + b * n * n;
        number *value = (number *)values + b * m, *x = (number *)vectors + b * m * m, *y = (number *)inverse + b * m * m;
        found[b] = 1;
        for (int64_t j = 0; found[b] && j < n; j++) {
            number l;
            if (!(k[j] > 0) || !mode(j, n, k, c, &l, v, push)) {
                found[b] = 0;
                break;
            }
            number scale = {0.0, 0.0};
            double length = 0.0;
            for (int64_t i = 0; i < n; i++) {
                number once = times(l, v[i]);
                push[i] = plus(push[i], once);
                scale = plus(scale, times(plus(push[i], once), v[i]));
                length += v[i].re * v[i].re + v[i].im * v[i].im;
            }
            length = sqrt(length * (1 + l.re * l.re + l.im * l.im));
            number factor = over((number){length, 0.0}, scale);
            turned(n, phi, push, left);
            turned(n, phi, v, right);
            value[2 * j] = l, value[2 * j + 1] = (number){l.re, -l.im};
            for (int64_t i = 0; i < m; i++) {
                number column = i < n ? right[i] : times(l, right[i - n]), line = times(left[i], factor);
                column.re /= length, column.im /= length;
                x[i * m + 2 * j] = column, x[i * m + 2 * j + 1] = (number){column.re, -column.im};
                y[2 * j * m + i] = line, y[(2 * j + 1) * m + i] = (number){line.re, -line.im};
            }
        }
        found[b] = found[b] && apart(n, k, y, x);
    }
    free(v);
    return 0;
}
