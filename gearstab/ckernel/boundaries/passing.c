/* Which collisions between two stable points may open a region that is wider than the floor.

   Multipliers that meet and do not interact pass each other at constant speed. A pair with F = gamma^2 (x^2 - b^2), steps.c, whose
   region has the half-width b, is faster than that wherever it is seen from outside: with x = -a at the left point and c at the
   right one, w = a + c, each of the two is ahead of the mean speed in between by

       gamma b^2 w/(4 a^2 c) on the left and gamma b^2 w/(4 a c^2) on the right.

   Collisions of a multiplier add to each other, as all of them speed it up. What slows it down is another one of its own sign
   nearby, and that changes the two speeds in opposite directions long before it makes up for the sum. Hence a collision opens
   less than b where **one** of its two multipliers keeps its speed at both points better than that: of the many that an elastic
   ring has, nearly all do, and a collision of such a one with any other is none to look at. */

#include <math.h>

#include "search.h"

#define CLOSED 0.4 /* of the floor: the region that would show; one of the floor shows six times as much */

static int by_phase(const struct passer *all, const int *order, int a, int b) { return all[order[a]].at < all[order[b]].at; }

/* order (n,), sorted by `at`; few are out of place. */
static void sort_order(const struct passer *all, int *order, int n) {
    for (int i = 0; i < n; i++)
        order[i] = i;
    for (int i = 1; i < n; i++)
        for (int j = i; j > 0 && by_phase(all, order, j, j - 1); j--) {
            int own = order[j];
            order[j] = order[j - 1], order[j - 1] = own;
        }
}

/* The n positive multipliers of a stable point. */
static void positive(const struct sample *s, struct passer *all) {
    for (int k = 0; k < s->letters; k++) {
        const struct letter *l = s->letter + k;
        all[k] = (struct passer){.phase = l->sign > 0 ? l->angle : 2.0 * PI - l->angle, .speed = l->speed};
        all[k].at = all[k].phase;
    }
}

/* Find each multiplier of the left point, foreseen at its speed, at the right one, in the order of their phases; how many turns all of
   them have made is known. Returns 0 where nothing fits. */
static int follow(const struct sample *left, const struct sample *right, int n, struct passer *all, int *order) {
    struct passer *then = all + n;
    double width = right->cycle - left->cycle;
    int64_t turns = (right->index - left->index) / 2;
    positive(left, all);
    positive(right, then);
    for (int i = 0; i < n; i++) {
        double ahead = all[i].phase + all[i].speed * width, whole = floor(ahead / (2.0 * PI));
        all[i].at = ahead - 2.0 * PI * whole;
        all[i].moved = 2.0 * PI * whole;
        turns -= (int64_t)whole;
    }
    if (turns <= -n || turns >= n)
        return 0;
    sort_order(all, order, n);
    sort_order(then, order + n, n);
    for (int i = 0; i < n; i++) {
        int64_t k = i + turns, round = k < 0 ? -1 : k >= n;
        struct passer *own = all + order[i];
        const struct passer *found = then + order[n + k - round * n];
        own->moved += found->phase + 2.0 * PI * (double)round - own->phase;
        if (!(own->moved > 0.0))
            return 0;
        double mean = own->moved / width;
        own->left = fabs(own->speed - mean) + 2.0 * left->noise / left->step;
        own->right = fabs(found->speed - mean) + 2.0 * right->noise / right->step;
    }
    return 1;
}

/* How many collisions between two stable points, n letters each, may open a region above the floor, -1 if that is not known; and
   where the first and the last of them are. room: for 2n multipliers; order: for 2n numbers. */
int wide_collisions(const struct sample *left, const struct sample *right, int64_t n, double floor_width, struct passer *room,
                    int *order, double *first, double *last) {
    double width = right->cycle - left->cycle, half = 0.5 * CLOSED * floor_width * left->cycle, turn = 2.0 * PI;
    int count = 0;
    if (left->letters != n || right->letters != n || !follow(left, right, (int)n, room, order))
        return -1;
    *first = INFINITY, *last = -INFINITY;
    for (int64_t i = 0; i < n; i++)
        for (int64_t j = 0; j <= i; j++) {
            const struct passer *p = room + i, *q = room + j;
            double start = p->phase + q->phase, moved = p->moved + q->moved;
            for (double next = turn * (floor(start / turn) + 1.0); next <= start + moved; next += turn) {
                double a = width * (next - start) / moved, c = width - a;
                double shown = 0.25 * moved * half * half / (a * c), from_left = shown / a, from_right = shown / c;
                if ((p->left < from_left && p->right < from_right) || (q->left < from_left && q->right < from_right))
                    continue;
                count++;
                *first = fmin(*first, left->cycle + a);
                *last = fmax(*last, left->cycle + a);
            }
        }
    return count;
}
