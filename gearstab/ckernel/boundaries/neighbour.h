/* Where a row's points begin: at the edges of the rows before, carried on.

   Rows that follow each other mostly differ by a step of one parameter, over which edges move smoothly. They are known by their
   numbers of collisions, so that a region that opens or closes does not mislead the others; and only points are guessed: what
   lies between two of them is counted as ever. A search of 101 rows takes 15 to 17 % fewer points. */

#ifndef GEARSTAB_NEIGHBOUR_H
#define GEARSTAB_NEIGHBOUR_H

#include <math.h>

#include "window.h"

#define INSIDE 2.0      /* of what the row before missed its edge by: a point in a region tells more than two around it */
#define APART_EDGES 4.0 /* floors: nodes are no nearer to each other */

/* Collisions before an edge, in the order of edges: an exit comes before the entrance that follows. */
static int64_t place_among(const struct guess *g) { return 2 * (g->passed[0] + g->passed[1] + g->passed[2]) + g->enters; }

static int same_edge(const struct guess *a, const struct guess *b) {
    return a->enters == b->enters && a->passed[0] == b->passed[0] && a->passed[1] == b->passed[1] && a->passed[2] == b->passed[2];
}

static int by_cycle(const void *a, const void *b) {
    double x = ((const struct edge *)a)->cycle, y = ((const struct edge *)b)->cycle;
    return (x > y) - (x < y);
}

/* Sort the edges of a row, those from number `begin` on, and keep them with their differences from those of the row before. */
static int learn(struct window *w, int64_t begin) {
    int count = (int)(w->edges - begin);
    int64_t room = w->guess_room;
    if (grow(&w->fresh, &room, count, sizeof *w->fresh) || grow(&w->guess, &w->guess_room, count, sizeof *w->guess))
        return -1;
    if (count)
        qsort(w->edge + begin, (size_t)count, sizeof *w->edge, by_cycle);
    for (int i = 0; i < count; i++) {
        const struct edge *e = &w->edge[begin + i];
        w->fresh[i] = (struct guess){.cycle = e->cycle, .enters = e->enters, .passed = {e->passed[0], e->passed[1], e->passed[2]}};
    }
    for (int i = 0, j = 0; i < count; i++) {
        struct guess *own = &w->fresh[i];
        while (j < w->guesses && place_among(&w->guess[j]) < place_among(own))
            j++;
        if (j == w->guesses || !same_edge(&w->guess[j], own))
            continue;
        own->age = w->guess[j].age + 1;
        own->first = own->cycle - w->guess[j].cycle;
        own->second = w->guess[j].age > 0 ? own->first - w->guess[j].first : 0.0;
        own->missed = fabs(own->second - w->guess[j].second);
    }
    struct guess *old = w->guess;
    w->guess = w->fresh, w->fresh = old, w->guesses = count;
    return 0;
}

/* Points after `from` up to `to`, evenly, w->spacing apart or less, in at least so many parts. */
static int fill(struct window *w, int count, double from, double to, int least) {
    int parts = (int)ceil((to - from) / w->spacing - 1e-9);
    parts = parts < least ? least : parts;
    for (int k = 1; k <= parts; k++)
        w->cycle[count++] = k == parts ? to : from + (to - from) * k / parts;
    return count;
}

/* Points between two cycles, both among them: at foreseen edges, between regions, and nowhere farther apart than w->spacing.
   Returns how many, or -1. */
static int foresee(struct window *w, double first, double last) {
    double before = first, apart = APART_EDGES * w->order->floor * first;
    int count = 0, enters = 0;
    if (room_for_points(w, 3 * w->guesses + (int)((last - first) / w->spacing) + 8))
        return -1;
    w->cycle[count++] = first;
    for (int i = 0; i < w->guesses; i++) {
        const struct guess *g = &w->guess[i];
        double place = g->cycle + g->first + g->second + (g->enters ? INSIDE : -INSIDE) * g->missed;
        if (place < before + apart || place > last - apart)
            continue;
        count = fill(w, count, before, place, g->enters ? 2 : 1);
        before = place, enters = g->enters;
    }
    return fill(w, count, before, last, w->guesses && !enters ? 2 : 1);
}

#endif
