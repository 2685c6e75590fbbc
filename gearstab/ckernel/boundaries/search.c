/* All instability boundaries of the rows of a conservative pattern along the period.

   A row is searched window by window: points uniform in the period, about one for four collisions of multipliers (of many coordinates
   fewer, with proofs of what lies between them, sparse.h); then the brackets
   between neighbours are refined, all of a window at once, one point a bracket and round, until each holds nothing, an edge
   within the tolerance, or a collision that opens less than the floor. What a bracket holds is said by counts (brackets.c), where
   to look by interpolation (steps.c); only verdicts at points count. */

#include <math.h>
#include <stdlib.h>

#include "sparse.h"

#define WINDOW 96         /* points of the scan in a window */
#define COARSEST 6        /* points of a row that has hardly any collisions */
#define SHORTER 2         /* binary digits by which the step to the second point shrinks with every attempt, see evaluate */
#define PATIENCE 4        /* rounds of interpolation in which a bracket must halve */
#define ACCURATE 0.1      /* part of the tolerance by which the curvature may move an edge that is taken */
#define SMALL 0.26        /* of the spacing: brackets whose counts are unknown are taken at face value below */

/* ---- refinement */

/* What a bracket holds; where counts are unknown (strong growth) it is halved, and then taken at face value. */
static struct finding classify(const struct window *w, const struct bracket *b) {
    const struct sample *left = at(w, b->left), *right = at(w, b->right);
    if (left->indexed && right->indexed)
        return compare(left, right, b->smooth);
    struct finding found = {OPEN, -1, -1, 0};
    if (!left->stable && !right->stable && right->cycle - left->cycle < SMALL * w->spacing)
        found.kind = NOTHING;
    return found;
}

static int add_edge(struct window *w, const struct bracket *b, const struct finding *found, double cycle, double error) {
    const struct sample *left = at(w, b->left), *right = at(w, b->right);
    if (grow(&w->edge, &w->edge_room, w->edges + 1, sizeof *w->edge))
        return -1;
    struct edge *edge = &w->edge[w->edges++];
    /* Verdicts at the ends of the bracket are wrong by as much. */
    error += 2.0 * blurred(left, right, found);
    *edge = (struct edge){.row = w->row, .cycle = cycle, .error = error, .enters = left->stable};
    collisions_of(left->stable ? left : right, w->n, 1, w->phase, edge->passed);
    return 0;
}

/* List two stable points between which there are collisions. */
static int add_collision(struct window *w, const struct sample *left, const struct sample *right) {
    if (!left->indexed || !right->indexed || compare(left, right, 0).kind == NOTHING)
        return 0;
    for (int side = 0; side < 2; side++) {
        const struct sample *s = side ? right : left;
        if (grow(&w->edge, &w->edge_room, w->edges + 1, sizeof *w->edge))
            return -1;
        struct edge *edge = &w->edge[w->edges++];
        *edge = (struct edge){.row = w->row, .cycle = s->cycle, .enters = side ? AFTER : BEFORE};
        collisions_of(s, w->n, 1, w->phase, edge->passed);
    }
    return 0;
}

/* A point of a bracket at a part of its width that differs from attempt to attempt. */
static double somewhere(const struct bracket *b, double left, double right) {
    double part = 0.5 + 0.11 * b->failures * (b->failures % 2 ? 1 : -1);
    return left + part * (right - left);
}

/* Finish a bracket (0 is returned), or put the point that it asks for into *cycle (1), or fail (-1). */
static int advance(struct window *w, const struct bracket *b, struct finding *found, double *cycle) {
    const struct sample *left = at(w, b->left), *right = at(w, b->right);
    double width = right->cycle - left->cycle, tolerance = w->order->tolerance * left->cycle;
    int is_edge = left->stable != right->stable;
    *found = classify(w, b);
    if (found->kind == NOTHING)
        return 0;
    double least = is_edge ? tolerance : (left->stable ? w->order->floor : w->order->gap) * left->cycle;
    if (width <= least || b->failures >= ATTEMPTS)
        return is_edge ? add_edge(w, b, found, 0.5 * (left->cycle + right->cycle), width) : 0;
    *cycle = somewhere(b, left->cycle, right->cycle);
    if (b->failures > 0 || b->age >= PATIENCE)
        return 1;
    if (found->kind == ENTRANCE || found->kind == EXIT) {
        double moved, edge = edge_between(left, right, found, &moved);
        if (moved < ACCURATE * tolerance) {
            if (!found->doubtful)
                return add_edge(w, b, found, edge, 2.0 * moved);
            /* Enclose it, so that the counts can exclude everything else. */
            int near_left = edge - left->cycle < right->cycle - edge;
            double beyond = near_left ? edge + ldexp(0.4 * tolerance, b->age) : edge - ldexp(0.4 * tolerance, b->age);
            *cycle = beyond > left->cycle && beyond < right->cycle ? beyond : *cycle;
            return 1;
        }
    }
    double proposed = propose(left, right, found, w->order->tolerance, w->order->floor);
    *cycle = proposed > left->cycle && proposed < right->cycle ? proposed : *cycle;
    return 1;
}

/* The brackets on both sides of a new point. */
static void divide(struct window *w, const struct bracket *b, int point, int smooth) {
    for (int side = 0; side < 2; side++) {
        struct bracket *part = &w->next[w->nexts++];
        *part = (struct bracket){side ? point : b->left, side ? b->right : point, b->age + 1, 0, smooth,
                                 b->before, b->after, b->width};
        if (at(w, point)->indexed)
            *(side ? &part->before : &part->after) = point;
        double width = at(w, part->right)->cycle - at(w, part->left)->cycle;
        if (width < 0.5 * part->width || part->age > PATIENCE)
            part->age = 0, part->width = width;
    }
}

/* Leave out what lies between two stable points less than a floor apart: a tongue in there is narrower still. */
static int leave_narrow(struct window *w) {
    int kept = 0;
    for (int i = 0, end; i < w->opens; i = end) {
        const struct sample *first = at(w, w->open[i].left);
        end = i + 1;
        if (first->stable)
            while (!at(w, w->open[end - 1].right)->stable && end < w->opens && w->open[end].left == w->open[end - 1].right)
                end++;
        const struct sample *last = at(w, w->open[end - 1].right);
        if (first->stable && last->stable && last->cycle - first->cycle <= w->order->floor * first->cycle) {
            if (w->order->gap < w->order->floor && add_collision(w, first, last))
                return -1;
            continue;
        }
        for (int k = i; k < end; k++)
            w->open[kept++] = w->open[k];
    }
    w->opens = kept;
    return 0;
}

static int refine(struct window *w) {
    while (w->opens > 0) {
        int asking = 0;
        if (leave_narrow(w) || room_for_points(w, w->opens) || room_for_brackets(w, 2 * w->opens))
            return -1;
        for (int i = 0; i < w->opens; i++) {
            int more = advance(w, &w->open[i], &w->found[asking], &w->cycle[asking]);
            if (more < 0)
                return -1;
            if (more) {
                w->shorter[asking] = ldexp(1.0, -SHORTER * w->open[i].failures);
                w->open[asking++] = w->open[i];
            }
        }
        int first = w->samples;
        if (asking && evaluate(w, asking))
            return -1;
        w->nexts = 0;
        for (int i = 0; i < asking; i++) {
            struct bracket *b = &w->open[i];
            struct sample *s = at(w, first + i);
            count_between(w, s, at(w, b->before), at(w, b->after));
            if (usable(s)) {
                int smooth = w->found[i].kind == OPEN && as_foreseen(at(w, b->left), at(w, b->right), &w->found[i], s);
                divide(w, b, first + i, smooth);
            } else {
                b->failures++;
                w->next[w->nexts++] = *b;
            }
        }
        struct bracket *kept = w->open;
        w->open = w->next, w->opens = w->nexts, w->next = kept;
    }
    return 0;
}

/* ---- rows */

/* How many collisions lie between two cycles, about: pairs p <= q meet every (w_p + w_q) T = 2 pi. */
static double collisions_expected(const struct order *order, int64_t row, double length) {
    const struct conservative *p = order->coarse;
    double sum = 0.0;
    for (int64_t i = 0; i < p->states * p->n; i++) {
        double squared = p->squared[row * p->states * p->n + i];
        sum += squared > 0.0 ? sqrt(squared) : 0.0;
    }
    return (double)(p->n + 1) * sum / (double)p->states * p->cycles * length;
}

static void note_end(struct window *w, const struct sample *s, int last, struct reach *reach) {
    reach->stable[last] = s->stable;
    if (s->indexed)
        collisions_of(s, w->n, last, w->phase, reach->passed[last]);
}

static const struct sample *outermost(const struct window *w, int last) {
    for (int i = 0; i < w->nodes; i++)
        if (usable(node_at(w, last ? w->nodes - 1 - i : i)))
            return node_at(w, last ? w->nodes - 1 - i : i);
    return node_at(w, 0);
}

static int search_row(struct window *w, int64_t row, double start, double stop, struct reach *reach) {
    double longest = w->order->level->spectra_row(w->spectra, row);
    double expected = w->order->density * collisions_expected(w->order, row, stop - start);
    expected = expected < COARSEST ? COARSEST : expected;
    double windows = ceil(expected / WINDOW), shortest = ceil((stop - start) / longest);
    windows = shortest > windows ? shortest : windows;
    w->row = row;
    w->spacing = (stop - start) / (ceil(expected) - 1.0);
    w->evaluations = 0;
    w->counted = 0.0;
    int64_t begin = w->edges;
    int sparse = w->n >= SPARSE_FROM && w->order->gap >= w->order->floor; /* else all collisions are listed */
    for (double k = 0; k < windows; k++) {
        double first = k == 0 ? start : start + (stop - start) * (k / windows);
        double last = k == windows - 1 ? stop : start + (stop - start) * ((k + 1) / windows);
        if (isfinite(longest))
            w->order->level->spectra_window(w->spectra, first, last);
        if (sparse ? scan_sparsely(w, first, last) : scan(w, first, last))
            return -1;
        if (k == 0)
            note_end(w, outermost(w, 0), 0, reach);
        note_end(w, outermost(w, 1), 1, reach);
        if (refine(w))
            return -1;
    }
    reach->evaluations = w->evaluations;
    return learn(w, begin);
}

/* The edges of rows first..last-1; see kernel.h. */
int gearstab_edges(const struct order *order, int64_t first, int64_t last, const double *start, const double *stop,
                   struct edge **edges, int64_t *count, struct reach *reach) {
    struct window w;
    int failed = window_new(&w, order);
    for (int64_t row = first; !failed && row < last; row++)
        failed = search_row(&w, row, start[row], stop[row], &reach[row - first]);
    window_free(&w);
    *edges = w.edge;
    *count = w.edges;
    if (failed) {
        free(w.edge);
        *edges = NULL;
    }
    return failed ? -1 : 0;
}
