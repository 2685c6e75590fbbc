/* The first time at which a polynomial falls below zero, and whether it nearly does: gearstab/response/backlash/follow.py
   says what is found and why none is missed (Farouki 2012, sections 3.3 and 5). */

#ifndef GEARSTAB_CROSSING_H
#define GEARSTAB_CROSSING_H

enum { MOST_COEFFICIENTS = MOST_DEGREE + 1, MOST_WAITING = 64, MOST_NEWTON = 100 };

/* Of a polynomial on [0, 1] of degree n, from its coefficients of powers: b_j = sum_k binomial(j, k) a_k/binomial(n, k),
   the sums as in Pascal's triangle. */
static void bernstein(const double *powers, int64_t n, double *found) {
    double binomial = 1.0;
    for (int64_t k = 0; k <= n; k++) {
        found[k] = powers[k] / binomial;
        binomial = binomial * (double)(n - k) / (double)(k + 1);
    }
    for (int64_t r = 1; r <= n; r++)
        for (int64_t j = n; j >= r; j--)
            found[j] += found[j - 1];
}

static double least_of(const double *values, int64_t count) {
    double least = values[0];
    for (int64_t i = 1; i < count; i++)
        least = values[i] < least ? values[i] : least;
    return least;
}

/* Bernstein coefficients on both halves: de Casteljau. right: on entry those on the whole. */
static void halve(double *right, int64_t n, double *left) {
    left[0] = right[0];
    for (int64_t r = 1; r <= n; r++) {
        for (int64_t i = 0; i <= n - r; i++)
            right[i] = 0.5 * (right[i] + right[i + 1]);
        left[r] = right[0];
    }
}

static double horner(const double *powers, int64_t n, double u) {
    double value = powers[n];
    for (int64_t k = n - 1; k >= 0; k--)
        value = value * u + powers[k];
    return value;
}

/* The derivative of a polynomial, and at second the one after it. */
static double derivatives(const double *powers, int64_t n, double u, double *second) {
    double first = 0.0, bend = 0.0;
    for (int64_t k = n; k > 0; k--) {
        bend = bend * u + first;
        first = first * u + (double)k * powers[k];
    }
    *second = bend;
    return first;
}

/* The one root between low and high, positive before and negative behind it, to the last digit: Newton's method, halving the
   bracket where that leaves it or is slow. */
static double root_between(const double *powers, int64_t n, double low, double high) {
    if (horner(powers, n, low) <= 0)
        return low;
    if (horner(powers, n, high) >= 0)
        return high;
    double u = 0.5 * (low + high);
    for (int turn = 1; turn <= MOST_NEWTON && high - low > 2 * DBL_EPSILON * high; turn++) {
        double value = horner(powers, n, u), bend;
        if (value == 0)
            return u;
        if (value > 0)
            low = u;
        else
            high = u;
        double next = u - value / derivatives(powers, n, u, &bend);
        if (!(next >= low && next <= high) || turn % 10 == 0)
            next = 0.5 * (low + high);
        if (fabs(next - u) <= DBL_EPSILON * fabs(u))
            return next;
        u = next;
    }
    return u;
}

/* The least u in [0, 1] at which a polynomial of degree n changes from positive to negative, -1 where it does not. tolerance:
   how deep it may dip unnoticed; smallest: intervals that are not divided further. */
static double first_below(const double *powers, int64_t n, double tolerance, double smallest) {
    struct part {
        double low, high, found[MOST_COEFFICIENTS];
    } waiting[MOST_WAITING];
    int64_t count = 1;
    waiting[0].low = 0.0, waiting[0].high = 1.0;
    bernstein(powers, n, waiting[0].found);
    while (count) {
        struct part *part = &waiting[count - 1];
        const double low = part->low, high = part->high, *found = part->found;
        if (least_of(found, n + 1) >= -tolerance) {
            count--;
            continue;
        }
        if (found[0] < -tolerance || high - low < smallest || count == MOST_WAITING)
            return low;
        int64_t changes = 0;
        for (int64_t k = 1; k <= n; k++)
            changes += (found[k] < 0) != (found[k - 1] < 0);
        /* What is zero at the beginning, but for rounding, may rise from there. */
        if (found[0] > tolerance && changes == 1)
            return root_between(powers, n, low, high);
        struct part *before = part + 1; /* the half that is looked at first */
        halve(part->found, n, before->found);
        before->low = low, before->high = part->low = 0.5 * (low + high);
        count++;
    }
    return -1.0;
}

/* Whether a distance has a minimum below the margin in a piece, or where it begins or ends: by the parabola at the least of
   fine + 1 values. */
static int nearly_below(const double *powers, int64_t n, int64_t fine, double margin) {
    int64_t at = 0;
    double least = powers[0];
    for (int64_t i = 1; i <= fine; i++) {
        double value = horner(powers, n, (double)i / (double)fine);
        if (value < least)
            least = value, at = i;
    }
    double bend, slope = derivatives(powers, n, (double)at / (double)fine, &bend);
    return bend > 0 && fabs(slope) <= 2 * bend / (double)fine && least - 0.5 * slope * slope / bend < margin;
}

#endif
