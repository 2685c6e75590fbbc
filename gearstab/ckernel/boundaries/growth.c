/* How wide a region may be that two stable points have between them.

   Let all stiffness matrices be positive definite. When the period T gets a positive imaginary part, M(T) contracts the Krein form: the n
   multipliers of positive sign move into the unit circle, the others out of it, and none is on it. The product of those inside has
   no zero, so that S = -i ln of it is analytic in the upper half-plane, with a positive imaginary part: a function of Nevanlinna. On the
   real axis Re S is the sum of the phases of the positive multipliers with all their turns, and Im S the sum L of all growths.
   Where L = 0 at the points x_i, the representation of such functions gives, for divided differences of an order k > 1,

       S[x_0, ..., x_k] = 1/pi int L(x) dx / ((x - x_0) ... (x - x_k)).

   With x_i in pairs, a point and its second one a step later, the denominator is **positive wherever L is not zero**. No growth
   makes up for another, whatever else the multipliers do, and with P the largest denominator between two of the points,

       int L dx over what lies between them  <=  pi P S[x_0, ..., x_k].

   Two multipliers that approach at a speed of 2 v grow by v sqrt(W^2/4 - x^2) in a region of width W, and int L >= pi v W^2/8; so do one
   multiplier and any number of others, as S has a part of its own there. The regions that several collisions open have a width
   of no more than (sum 1/v_j sum v_j W_j^2)^(1/2) together. What lies farther away counts little in a high order: of the bounds by 2, 3 and 4
   points the least is taken. */

#include <math.h>

#include "search.h"

enum { MOST_NODES = 2 * STENCIL };

/* The positive multipliers of a stable point in the order of their phases. */
static void positive(const struct sample *s, struct mover *all) {
    int up = 0, down = s->letters;
    for (int k = 0; k < s->letters; k++) {
        const struct letter *l = s->letter + k;
        all[l->sign > 0 ? up++ : --down] = (struct mover){l->sign > 0 ? l->angle : 2.0 * PI - l->angle, l->speed};
    }
}

/* Whether multipliers of a point may have met by the second one, and have been taken for one another. */
static int met_within_step(const struct sample *s) {
    const struct letter *l = s->letter, *last = l + s->letters - 1;
    int met = (l->sign > 0 && l->angle < s->step * l->speed) || (last->sign < 0 && PI - last->angle < s->step * last->speed);
    for (; l < last; l++)
        met |= l[0].sign < 0 && l[1].sign > 0 && l[1].angle - l[0].angle < s->step * (l[0].speed + l[1].speed);
    return met;
}

/* Re S of a stable point and its speed; errors of the phases are independent of each other. */
static double sum_of_phases(const struct sample *s, double *speed, double *error) {
    double sum = PI * (double)s->index, square = 0.0;
    *speed = 0.0;
    for (int k = 0; k < s->letters; k++) {
        const struct letter *l = s->letter + k;
        double own = fmin(0.5 * s->noise / sin(l->angle), sqrt(s->noise));
        sum += l->sign > 0 ? l->angle : 2.0 * PI - l->angle;
        *speed += l->speed;
        square += own * own;
    }
    *error = sqrt(square);
    return sum;
}

/* Points x of a stencil, from its second one, with S and the errors of S between neighbours; returns how many, and in *own the number
   of the second one, -1 where it or the third one does not serve. */
static int nodes_of(const struct sample *const stencil[STENCIL], int64_t n, double *x, double *s, double *error, int *own) {
    int count = 0;
    double sum = 0.0, blur = 0.0;
    *own = -1;
    for (int k = 0; k < STENCIL; k++) {
        const struct sample *now = stencil[k];
        if (!now || now->letters != n || met_within_step(now)) {
            if (k == 2)
                *own = -1;
            continue;
        }
        double speed, own_blur, own_sum = sum_of_phases(now, &speed, &own_blur);
        if (k == 1)
            *own = count;
        x[count] = now->cycle - stencil[1]->cycle, x[count + 1] = x[count] + now->step;
        if (count > 0) {
            double gap = x[count] - x[count - 1];
            s[count - 1] = (own_sum - sum) / gap, error[count - 1] = (own_blur + blur) / gap;
        }
        s[count] = speed, error[count] = 2.0 * own_blur / now->step;
        sum = own_sum + speed * now->step, blur = own_blur;
        count += 2;
    }
    return count;
}

/* The least bound on int L/pi between the second and the third point of a stencil. */
static double growth_between(const struct sample *const stencil[STENCIL], int64_t n) {
    double x[MOST_NODES], s[MOST_NODES], error[MOST_NODES], best = INFINITY;
    int own, count = nodes_of(stencil, n, x, s, error, &own);
    if (own < 0)
        return INFINITY;
    double width = x[own + 2], inside = 0.25 * (width + stencil[2]->step) * (width + stencil[2]->step);
    for (int order = 2; order < count; order++)
        for (int i = 0; i + order < count; i++) {
            double gap = x[i + order] - x[i], product = inside * inside;
            s[i] = (s[i + 1] - s[i]) / gap, error[i] = (error[i + 1] + error[i]) / gap;
            /* Whole pairs that both ends are among; a sum that is negative tells of an error. */
            if (order % 2 == 0 || i % 2 == 1 || i > own || i + order < own + 3 || s[i] < -error[i])
                continue;
            product *= i < own ? (width - x[i]) * (width - x[i]) : 1.0;
            product *= i + order > own + 3 ? x[i + order] * x[i + order] : 1.0;
            best = fmin(best, (fmax(s[i], 0.0) + error[i]) * product);
        }
    return best;
}

/* Sum of 1/v over all collisions between two stable points. The order of phases tells which is which; each is as slow as it is
   anywhere. */
static double slowness(const struct sample *left, const struct sample *right, int64_t n, struct mover *room) {
    double width = right->cycle - left->cycle, turn = 2.0 * PI, sum = 0.0;
    struct mover *from = room, *to = room + n;
    int64_t turns = (right->index - left->index) / 2;
    positive(left, from);
    positive(right, to);
    for (int64_t i = 0; i < n; i++) {
        struct mover *a = from + i;
        const struct mover *b = to + (i + turns) % n;
        a->until = b->phase + turn * (double)((i + turns) / n);
        a->speed = fmin(fmin(a->speed, b->speed), (a->until - a->phase) / width);
        for (int64_t j = 0; j <= i; j++) {
            double meetings = floor((a->until + from[j].until) / turn) - floor((a->phase + from[j].phase) / turn);
            sum += 2.0 * meetings / (a->speed + from[j].speed);
        }
    }
    return sum;
}

/* The largest width that regions between the second and the third point, stable, can have together; the others may be NULL.
   Room for 2n multipliers. */
double widest_between(const struct sample *const stencil[STENCIL], int64_t n, struct mover *room) {
    double growth = growth_between(stencil, n);
    return isfinite(growth) ? sqrt(8.0 * growth * slowness(stencil[1], stencil[2], n, room)) : INFINITY;
}
