/* The points that a window is scanned at, their counts, and the brackets between them. */

#ifndef GEARSTAB_SCAN_H
#define GEARSTAB_SCAN_H

#include <limits.h>
#include <math.h>

#include "neighbour.h"

#define APART 8    /* points of a scan from one direct count to the next, n/2 of large systems; 4 takes 10 % longer */
#define SHORTENED 4 /* times that the step to the second point is shortened where the two do not fit, */
#define SHORT 0.0625 /* by this */
#define ATTEMPTS 4 /* points tried where signs are lost in rounding, before a bracket is left as it is */

/* ---- points */

/* Sample number w->samples + i from the spectra in these places. */
static void read_point(struct window *w, int i, int then, double cycle, double later) {
    int64_t n = w->n;
    struct sample *s = at(w, w->samples + i);
    s->cycle = cycle, s->taken = w->taken[i];
    sample_read(s, n, later - cycle, w->angle + i * n, w->growth + i * n, w->size[i], w->angle + then * n, w->growth + then * n,
                w->items, w->position);
}

/* Samples at the first `count` cycles of w->cycle, from number w->samples on; room_for_points was asked for. A step that meets
   an event loses the signs. */
static int evaluate(struct window *w, int count) {
    if (gearstab_stopped())
        return -1;
    double *cycle = w->cycle, *later = cycle + count;
    int64_t n = w->n;
    while (w->blocks * BLOCK < w->samples + count)
        if (block_new(w))
            return -1;
    for (int i = 0; i < count; i++)
        later[i] = cycle[i] * (1.0 + w->step * w->shorter[i]);
    w->order->level->spectra_at(w->spectra, 2 * count, cycle, w->angle, w->growth, w->size, w->taken);
    for (int i = 0; i < count; i++)
        w->again[i] = i, read_point(w, i, count + i, cycle[i], later[i]);
    /* Where several pairs leave the circle or come back within a step, as those of nearly identical parts do, a shorter one tells. */
    for (int attempt = 0, left = count; left > 0 && attempt < SHORTENED; attempt++) {
        int again = 0;
        for (int i = 0; i < left; i++) {
            int point = w->again[i];
            const struct sample *s = at(w, w->samples + point);
            if (s->known || !(w->size[point] < LARGEST))
                continue;
            w->again[again] = point;
            later[again++] = s->cycle + SHORT * s->step;
        }
        left = again;
        w->order->level->spectra_at(w->spectra, left, later, w->angle + count * n, w->growth + count * n, w->size + count,
                                    w->taken + count);
        for (int i = 0; i < left; i++)
            read_point(w, w->again[i], count + i, at(w, w->samples + w->again[i])->cycle, later[i]);
    }
    w->samples += count;
    w->evaluations += count;
    return 0;
}

/* Whether a point tells anything: an unstable one whose counts are unknown does. */
static int usable(const struct sample *s) { return s->known || !s->stable; }

/* N(0) along the period itself. N(pi) is a check of all signs. */
static void count_directly(struct window *w, struct sample *s) {
    int64_t at_minus_one;
    gearstab_index_at(w->index, w->order->coarse, w->row, s->cycle, &s->index, &at_minus_one);
    s->indexed = at_minus_one - s->index == signs_below(s, 4.0);
    s->known = s->indexed;
}

static void count_between(struct window *w, struct sample *s, const struct sample *left, const struct sample *right) {
    if (!s->known)
        return;
    int64_t index = UNSETTLED;
    if (left->indexed && right->indexed) {
        index = index_between(left, right, s, w->n);
        index = index == UNSETTLED ? index_by_turns(left, right, s, w->n, w->phase) : index;
    }
    if (index == UNSETTLED) {
        count_directly(w, s);
        return;
    }
    s->index = index;
    s->indexed = 1;
}

/* ---- the scan */

static struct sample *node_at(const struct window *w, int i) { return at(w, w->node[i].sample); }

/* The first `count` points of w->cycle are the nodes. */
static int add_nodes(struct window *w, int count) {
    if (grow(&w->node, &w->node_room, count, sizeof *w->node))
        return -1;
    for (int i = 0; i < count; i++)
        w->node[i] = (struct node){.sample = w->samples + i}, w->shorter[i] = 1.0;
    w->nodes = count;
    return evaluate(w, count);
}

/* N(0) of nodes between two whose own is known: the least that each can be after the one before it, if that leads to the
   last one's. */
static void count_along(struct window *w, int first, int last) {
    const struct sample *before = node_at(w, first), *end = node_at(w, last);
    for (int i = first + 1; i < last; i++)
        if (node_at(w, i)->known) {
            node_at(w, i)->index = index_after(before, node_at(w, i), w->n, w->phase);
            before = node_at(w, i);
        }
    int right = index_after(before, end, w->n, w->phase) == end->index;
    for (int i = first + 1; i < last; i++)
        node_at(w, i)->indexed = right && node_at(w, i)->known;
}

/* Counts of the nodes: directly at some of them, so many apart, from monotony between. The first may be the last one of the
   window before. */
static void count_scan(struct window *w, int apart) {
    struct sample *begin = node_at(w, 0), *end = node_at(w, w->nodes - 1);
    if (begin->known && begin->cycle == w->counted)
        begin->index = w->count, begin->indexed = 1;
    for (int i = 0; i < w->nodes; i++)
        if (node_at(w, i)->known && !node_at(w, i)->indexed && (i % apart == 0 || i == w->nodes - 1))
            count_directly(w, node_at(w, i));
    for (int i = 1, before = 0; i < w->nodes; i++) {
        struct sample *s = node_at(w, i);
        if (s->known && !s->indexed) {
            int after = i + 1;
            while (after < w->nodes - 1 && !node_at(w, after)->indexed)
                after++;
            if (w->n > FEW_COORDINATES && node_at(w, before)->indexed && node_at(w, after)->indexed)
                count_along(w, before, after);
            if (!s->indexed)
                count_between(w, s, node_at(w, before), node_at(w, after));
        }
        before = s->indexed ? i : before;
    }
    w->counted = end->indexed ? end->cycle : 0.0;
    w->count = end->index;
}

/* Replace nodes that tell nothing by neighbours of theirs. */
static int repair_scan(struct window *w) {
    for (int attempt = 1; attempt < ATTEMPTS; attempt++)
        for (int i = 0; i < w->nodes; i++) {
            struct sample *s = node_at(w, i);
            if (usable(s))
                continue;
            int end = i == 0 || i == w->nodes - 1;
            double nudge = end ? 1e-11 * s->cycle : 0.07 * (node_at(w, i + 1)->cycle - s->cycle);
            w->shorter[0] = 1.0;
            w->cycle[0] = s->cycle + (i == w->nodes - 1 ? -1 : 1) * attempt * nudge;
            int kept = w->samples;
            if (evaluate(w, 1))
                return -1;
            struct sample *again = at(w, kept), old = *s;
            if (again->known)
                count_directly(w, again);
            *s = *again; /* each keeps its own room */
            *again = old;
            w->samples = kept;
            w->node[i].proved = 0; /* nor what lies before it, as the point has moved */
            w->node[i > 0 ? i - 1 : 0].proved = 0;
        }
    return 0;
}

/* The brackets between nodes, but for those in which nothing lies. */
static int open_brackets(struct window *w) {
    if (room_for_brackets(w, w->nodes))
        return -1;
    w->opens = 0;
    for (int i = 0, before = -1, proved = 0; i < w->nodes; i++) {
        if (usable(node_at(w, i))) {
            if (before >= 0 && !proved) {
                int left = w->node[before].sample, right = w->node[i].sample;
                double width = at(w, right)->cycle - at(w, left)->cycle;
                w->open[w->opens++] = (struct bracket){left, right, 0, 0, 0, left, right, width};
            }
            before = i, proved = 1;
        }
        proved &= w->node[i].proved;
    }
    return 0;
}

/* Points between two cycles and the brackets between them. */
static int scan(struct window *w, double first, double last) {
    w->samples = 0;
    int count = foresee(w, first, last);
    if (count < 0 || add_nodes(w, count))
        return -1;
    count_scan(w, w->n > 2 * APART ? (int)(w->n / 2) : APART);
    return repair_scan(w) || open_brackets(w) ? -1 : 0;
}

#endif
