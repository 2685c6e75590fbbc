/* One point of the search: multipliers on the unit circle with Krein signs and speeds, pairs off it, counts.

   Signs and speeds come from the multipliers at a second point, a tiny step later: a multiplier of positive sign has moved
   counterclockwise, one of negative sign clockwise. No eigenvectors are needed, and of two identical pairs, as symmetric
   systems have them, each moves like the other. */

#include <math.h>
#include <stddef.h>

#include "search.h"

#define TIE 1e-12    /* of angles, in the count of collisions: a pair off the circle counts as met */
#define BLUR 1e-4    /* of half turns: far beyond rounding, even where phases near 1 are roots of it */
#define MIRROR 1e-10 /* distance of several real pairs in that count */

enum what { ON, REAL_ONE, REAL_MINUS_ONE, COMPLEX, BROKEN };

/* By angle, and of equal angles by growth, so that the two halves of a quadruple are neighbours. */
static void sort_items(struct item *item, int64_t n, const double *angle, const double *growth) {
    for (int64_t i = 0; i < n; i++) {
        struct item own = {angle[i], growth[i]};
        int64_t j = i;
        for (; j > 0 && (item[j - 1].angle > own.angle || (item[j - 1].angle == own.angle && item[j - 1].growth > own.growth));
             j--)
            item[j] = item[j - 1];
        item[j] = own;
    }
}

static enum what what_is(const struct item *item, int64_t n, int64_t i) {
    if (item[i].growth == 0.0)
        return ON;
    if (item[i].angle == 0.0)
        return REAL_ONE;
    if (item[i].angle == PI)
        return REAL_MINUS_ONE;
    return i + 1 < n && item[i + 1].angle == item[i].angle && item[i + 1].growth == item[i].growth ? COMPLEX : BROKEN;
}

/* F of the pairs i and i + 1; NaN if they are neither two letters nor a quadruple. */
static double square_of_two(const struct item *item, int64_t n, int64_t i) {
    enum what what = what_is(item, n, i);
    if (what == COMPLEX)
        return -4.0 * item[i].growth * item[i].growth;
    if (what != ON || what_is(item, n, i + 1) != ON)
        return NAN;
    double distance = item[i + 1].angle - item[i].angle;
    return distance * distance;
}

/* F of one pair that is about to meet, or has met, its mirror image at 1 or -1. */
static double square_of_one(const struct item *item, int64_t n, int64_t i, enum place place) {
    enum what what = what_is(item, n, i);
    double distance = place == AT_ONE ? item[i].angle : PI - item[i].angle;
    if (what == ON)
        return 4.0 * distance * distance;
    return what == (place == AT_ONE ? REAL_ONE : REAL_MINUS_ONE) ? -4.0 * item[i].growth * item[i].growth : NAN;
}

static double or_zero(double value) { return isnan(value) ? 0.0 : value; }

static void add_letter(struct sample *s, double angle, double velocity) {
    s->letter[s->letters++] = (struct letter){angle, fabs(velocity), velocity > 0 ? 1 : -1};
    s->known &= velocity != 0.0;
}

/* The letters i and, if they leave the circle within the step, i + 1; returns how many were read, 0 if none can be. */
static int read_letters(struct sample *s, const struct item *now, const struct item *later, int64_t n, int64_t i, double step) {
    double angle = now[i].angle;
    enum what then = what_is(later, n, i);
    if (then == ON) {
        add_letter(s, angle, (later[i].angle - angle) / step);
        return 1;
    }
    if (then == COMPLEX && i + 1 < n && what_is(now, n, i + 1) == ON) {
        double distance = now[i + 1].angle - angle, square = distance * distance;
        double slope = (square_of_two(later, n, i) - square) / step, closing = slope / (2.0 * distance);
        double mean = (later[i].angle - angle - 0.5 * distance) / step;
        add_letter(s, angle, mean - 0.5 * closing);
        add_letter(s, now[i + 1].angle, mean + 0.5 * closing);
        return 2;
    }
    if (then == REAL_ONE || then == REAL_MINUS_ONE) {
        enum place place = then == REAL_ONE ? AT_ONE : AT_MINUS_ONE;
        double distance = place == AT_ONE ? angle : PI - angle, square = 4.0 * distance * distance;
        double slope = (square_of_one(later, n, i, place) - square) / step;
        add_letter(s, angle, (place == AT_ONE ? 1.0 : -1.0) * slope / (8.0 * distance));
        return 1;
    }
    return 0;
}

/* F and its slope in all gaps between letters; position (letters,): where the letters stand among the items. */
static void read_gaps(struct sample *s, const struct item *now, const struct item *later, int64_t n, const int *position,
                      double step) {
    for (int k = 0; k <= s->letters; k++) {
        double before, after;
        if (k == 0 || k == s->letters) {
            enum place place = k == 0 ? AT_ONE : AT_MINUS_ONE;
            int64_t at = s->letters == 0 ? -1 : k == 0 ? position[0] : position[k - 1];
            before = at < 0 ? NAN : square_of_one(now, n, at, place);
            after = at < 0 ? NAN : square_of_one(later, n, at, place);
        } else {
            const struct letter *l = s->letter + k - 1;
            int next = position[k] == position[k - 1] + 1;
            before = (l[1].angle - l[0].angle) * (l[1].angle - l[0].angle);
            double distance = later[position[k]].angle - later[position[k - 1]].angle;
            after = next ? square_of_two(later, n, position[k - 1]) : distance * distance;
        }
        s->gap[k] = (struct gap){or_zero(before), or_zero((after - before) / step)};
    }
}

static void add_off(struct sample *s, double angle, double before, double after, enum place place, double step) {
    s->off[s->offs++] = (struct off){angle, before, or_zero((after - before) / step), place};
}

/* Read a point from its pairs of multipliers and those a step later; room for 2 n items and n positions. */
void sample_read(struct sample *s, int64_t n, double step, const double *angle, const double *growth, double size,
                 const double *later_angle, const double *later_growth, struct item *now, int *position) {
    struct item *later = now + n;
    s->step = step;
    s->letters = s->offs = 0;
    s->indexed = 0;
    s->known = s->stable = size < LARGEST;
    s->noise = ROUNDING * (size > 1.0 ? size : 1.0);
    if (!s->known)
        return;
    sort_items(now, n, angle, growth);
    sort_items(later, n, later_angle, later_growth);
    for (int64_t i = 0; i < n; i++)
        s->stable &= now[i].growth == 0.0;
    for (int64_t i = 0; i < n;) {
        enum what what = what_is(now, n, i);
        int read = 1;
        if (what == ON) {
            int first = s->letters;
            read = read_letters(s, now, later, n, i, step);
            for (int k = 0; k < read; k++)
                position[first + k] = (int)(i + k);
        } else if (what == COMPLEX) {
            add_off(s, now[i].angle, square_of_two(now, n, i), square_of_two(later, n, i), ELSEWHERE, step);
            read = 2;
        } else if (what != BROKEN) {
            enum place place = what == REAL_ONE ? AT_ONE : AT_MINUS_ONE;
            add_off(s, now[i].angle, square_of_one(now, n, i, place), square_of_one(later, n, i, place), place, step);
        }
        if (what == BROKEN || read == 0) {
            s->known = 0;
            return;
        }
        i += read;
    }
    read_gaps(s, now, later, n, position, step);
}

/* N(angle) - N(0): each positive letter that is passed takes one away, each negative one adds one. */
int64_t signs_below(const struct sample *s, double angle) {
    int64_t sum = 0;
    for (int k = 0; k < s->letters && s->letter[k].angle <= angle; k++)
        sum -= s->letter[k].sign;
    return sum;
}

/* What N(0) is even or odd with. */
static int64_t parity_of(const struct sample *s, int64_t n) {
    for (int m = 0; m < s->offs; m++)
        n += s->off[m].place == AT_ONE;
    return n;
}

/* N(0) of a point between two others, from N(theta; left) <= N(theta) <= N(theta; right) for all theta and its parity; UNSETTLED if
   several numbers fit, or none. */
int64_t index_between(const struct sample *left, const struct sample *right, const struct sample *s, int64_t n) {
    int64_t low = left->index, high = right->index, l = 0, r = 0, own = 0, parity = parity_of(s, n);
    int i = 0, j = 0, k = 0;
    /* Through all angles: i, j, k letters are passed. */
    while (i < left->letters || j < right->letters || k < s->letters) {
        double a = i < left->letters ? left->letter[i].angle : 4.0;
        double b = j < right->letters ? right->letter[j].angle : 4.0;
        double c = k < s->letters ? s->letter[k].angle : 4.0;
        if (a <= b && a <= c)
            l -= left->letter[i++].sign;
        else if (b <= c)
            r -= right->letter[j++].sign;
        else
            own -= s->letter[k++].sign;
        double passed = a <= b && a <= c ? a : b <= c ? b : c;
        if ((i < left->letters && left->letter[i].angle == passed) || (j < right->letters && right->letter[j].angle == passed) ||
            (k < s->letters && s->letter[k].angle == passed))
            continue;
        low = left->index + l - own > low ? left->index + l - own : low;
        high = right->index + r - own < high ? right->index + r - own : high;
    }
    low += (low - parity) & 1;
    high -= (high - parity) & 1;
    return low == high ? low : UNSETTLED;
}

/* Phases in [0, 2 pi) of the n positive multipliers. Pairs off the circle count as sitting on it at their angle; several on
   the same side of the real axis may still come back as quadruples, at mirrored angles, and are laid out so. */
static void positive_phases(const struct sample *s, double *phase) {
    int count = 0, seen[2] = {0, 0}, of_place[3] = {0, 0, 0};
    for (int k = 0; k < s->letters; k++)
        phase[count++] = s->letter[k].sign > 0 ? s->letter[k].angle : 2.0 * PI - s->letter[k].angle;
    for (int m = 0; m < s->offs; m++)
        of_place[s->off[m].place]++;
    for (int m = 0; m < s->offs; m++) {
        enum place place = s->off[m].place;
        if (place == ELSEWHERE) {
            phase[count++] = s->off[m].angle;
            phase[count++] = 2.0 * PI - s->off[m].angle;
        } else {
            phase[count++] = (place == AT_ONE ? 0.0 : PI) + MIRROR * (seen[place]++ - 0.5 * (of_place[place] - 1));
        }
    }
}

/* The sum of the phases of all positive multipliers with their turns, of which index has counted. */
static double turned(const struct sample *s, int64_t n, int64_t index, double *phase) {
    double sum = PI * (double)(index - n);
    positive_phases(s, phase);
    for (int64_t i = 0; i < n; i++)
        sum += phase[i];
    for (int m = 0; m < s->offs; m++)
        sum += s->off[m].place == AT_ONE ? PI : 0.0;
    return sum;
}

/* The least N(0) of a point after another: the sum of all phases has not fallen. If that of the other is too low by 2k it is
   too low by as much. */
int64_t index_after(const struct sample *left, const struct sample *s, int64_t n, double *phase) {
    double own = turned(s, n, 0, phase), low = turned(left, n, left->index, phase);
    int64_t least = (int64_t)ceil((low - own) / PI - BLUR);
    return least + ((least - parity_of(s, n)) & 1);
}

/* N(0) of a point between two others from the sum of all phases: on the circle each grows, and pairs off it add the same, whatever
   their angle. UNSETTLED if a turn more or less fits as well. phase: room for n numbers. */
int64_t index_by_turns(const struct sample *left, const struct sample *right, const struct sample *s, int64_t n,
                       double *phase) {
    double own = turned(s, n, 0, phase), high = turned(right, n, right->index, phase);
    int64_t least = index_after(left, s, n, phase), most = (int64_t)floor((high - own) / PI + BLUR);
    most -= (most - parity_of(s, n)) & 1;
    return least == most ? least : UNSETTLED;
}

/* Collisions so far at 1, at -1 and elsewhere; of pairs off the circle as met, or not. phase: room for n numbers.

   sum_(i, j) floor((Theta_i + Theta_j)/2 pi) counts those at +-1 once and others twice, see krein.py. All phases together have
   made W = (N(0) - n + real pairs at 1)/2 turns: as many meetings at 1, and one more at -1 for each phase beyond pi. */
void collisions_of(const struct sample *s, int64_t n, int met, double *phase, int64_t *of_place) {
    int64_t outside = 0, winding = s->index - n, beyond = 0, total = 0;
    for (int m = 0; m < s->offs; m++) {
        outside += s->off[m].place == ELSEWHERE ? 2 : 1;
        winding += s->off[m].place == AT_ONE;
    }
    winding /= 2;
    positive_phases(s, phase);
    for (int64_t i = 0; i < n; i++) {
        beyond += phase[i] > PI;
        for (int64_t j = 0; j < n; j++)
            total += (int64_t)floor((phase[i] + phase[j] + TIE) / (2.0 * PI));
    }
    total += 2 * n * winding - (met ? 0 : outside);
    of_place[AT_ONE] = winding;
    of_place[AT_MINUS_ONE] = winding + beyond;
    of_place[ELSEWHERE] = (total - 2 * winding - beyond) / 2;
}
