/* A scan with few points, between which collisions are enclosed (enclose.c): for systems of many coordinates.

   Where that does not succeed, around regions, points lie as densely as in any other scan. */

#ifndef GEARSTAB_SPARSE_H
#define GEARSTAB_SPARSE_H

#include <string.h>

#include "enclose.h"
#include "scan.h"

#define SPARSE_FROM 13 /* coordinates */
#define SPARSE 0.2     /* times n: points of a dense scan that one of a sparse scan stands for; 0.4 takes as long */
#define SPARSEST 30.0  /* such points at most: few enough meetings for enclose() */
#define FILLED 1.5     /* spacings: brackets longer than this get the points of a dense scan */

/* Foresee what lies between nodes i and i + 1, and the lines of all stretches. */
static int add_stretches(struct window *w, int i) {
    const struct sample *left = node_at(w, i), *right = node_at(w, i + 1);
    struct enclosing *e = w->enclosing;
    w->node[i].stretch = w->stretches;
    w->node[i].stretches = 0;
    if (!left->stable || !right->stable || !left->indexed || !right->indexed || !enclose(e, left, right))
        return 0;
    int64_t room = w->line_room;
    if (grow(&w->stretch, &w->stretch_room, w->stretches + e->stretches, sizeof *w->stretch) ||
        grow(&w->line, &w->line_held, (w->stretches + e->stretches) * room, sizeof *w->line))
        return -1;
    for (int k = 0; k < e->stretches; k++, w->stretches++) {
        int lines = lines_of(e, k, w->line + w->stretches * room);
        w->stretch[w->stretches] = (struct stretch){.end = {e->end[2 * k], e->end[2 * k + 1]}, .lines = lines};
    }
    w->node[i].stretches = e->stretches;
    return 0;
}

/* Numbers on the lines of all ends of stretches that are not nodes, in the order of the stretches. */
static int look_at_ends(struct window *w) {
    int64_t room = w->line_room, count = 0;
    if (room_for_ends(w, 2 * w->stretches))
        return -1;
    for (int i = 0; i + 1 < w->nodes; i++)
        for (int k = 0; k < w->node[i].stretches; k++) {
            const struct stretch *own = w->stretch + w->node[i].stretch + k;
            for (int side = k == 0; own->lines && side < 2 - (k + 1 == w->node[i].stretches); side++) {
                w->end_cycle[count] = own->end[side];
                w->end_lines[count] = own->lines;
                memcpy(w->end_line + count++ * room, w->line + (own - w->stretch) * room, (size_t)room * sizeof *w->line);
            }
        }
    w->order->level->spectra_below(w->spectra, count, room, w->end_cycle, w->end_lines, w->end_line, w->below);
    w->evaluations += count;
    return gearstab_stopped() ? -1 : 0;
}

/* Which stretches hold nothing. */
static void prove_stretches(struct window *w) {
    int64_t room = w->line_room, *below = w->below, *of_node = below + w->end_room * room;
    for (int i = 0; i + 1 < w->nodes; i++)
        for (int k = 0; k < w->node[i].stretches; k++) {
            struct stretch *own = w->stretch + w->node[i].stretch + k;
            const double *line = w->line + (own - w->stretch) * room;
            const int64_t *number[2];
            if (!own->lines)
                continue;
            for (int side = 0; side < 2; side++) {
                int at_node = side ? k + 1 == w->node[i].stretches : k == 0;
                number[side] = at_node ? of_node + side * room : below;
                if (at_node)
                    below_lines(node_at(w, i + side), line, own->lines, of_node + side * room);
                else
                    below += room;
            }
            own->proved = nothing_between(number[0], number[1], own->lines, w->n);
        }
}

/* ---- where to look closer */

static int add_point(struct window *w, int sample, double cycle) {
    if (grow(&w->fresh_node, &w->fresh_room, w->fresh_nodes + 1, sizeof *w->fresh_node))
        return -1;
    w->fresh_node[w->fresh_nodes++] = (struct node){.sample = sample, .cycle = cycle};
    return 0;
}

/* What lies up to a cycle after the last point: nothing, or what the points of a dense scan may tell. */
static int close_up(struct window *w, int proved, double from, double to) {
    double apart = APART_EDGES * w->order->floor * from;
    w->fresh_node[w->fresh_nodes - 1].proved = proved;
    for (int i = 0; !proved && to - from > FILLED * w->spacing && i < w->denses; i++)
        if (w->dense[i] > from + apart && w->dense[i] < to - apart && add_point(w, ASKED, w->dense[i]))
            return -1;
    return 0;
}

/* Node i and points up to the next: in the middle of every stretch that holds nothing beside one that may. */
static int divide_node(struct window *w, int i) {
    const struct stretch *stretch = w->stretch + w->node[i].stretch;
    double from = node_at(w, i)->cycle;
    int count = w->node[i].stretches, proved = count > 0;
    if (add_point(w, w->node[i].sample, from))
        return -1;
    for (int k = 0; k < count; k++) {
        int beside = (k > 0 && !stretch[k - 1].proved) || (k + 1 < count && !stretch[k + 1].proved);
        proved &= stretch[k].proved;
        if (!stretch[k].proved || !beside)
            continue;
        double middle = 0.5 * (stretch[k].end[0] + stretch[k].end[1]);
        if (close_up(w, proved, from, middle) || add_point(w, ASKED, middle))
            return -1;
        from = middle, proved = 1;
    }
    return close_up(w, proved, from, node_at(w, i + 1)->cycle);
}

/* All points with those that are still asked for as nodes. */
static int add_asked(struct window *w) {
    int asked = 0, last = w->nodes - 1;
    w->fresh_nodes = 0;
    for (int i = 0; i < last; i++)
        if (divide_node(w, i))
            return -1;
    if (add_point(w, w->node[last].sample, 0.0) || room_for_points(w, w->fresh_nodes))
        return -1;
    for (int i = 0; i < w->fresh_nodes; i++)
        if (w->fresh_node[i].sample == ASKED) {
            w->fresh_node[i].sample = w->samples + asked;
            w->shorter[asked] = 1.0;
            w->cycle[asked++] = w->fresh_node[i].cycle;
        }
    struct node *old = w->node;
    int64_t room = w->node_room;
    w->node = w->fresh_node, w->nodes = w->fresh_nodes, w->node_room = w->fresh_room;
    w->fresh_node = old, w->fresh_room = room;
    return asked ? evaluate(w, asked) : 0;
}

/* Points between two cycles, evenly, and the brackets between them in which something may lie. */
static int scan_sparsely(struct window *w, double first, double last) {
    double apart = w->spacing * fmin(fmax(SPARSE * (double)w->n, 1.0), SPARSEST);
    int count = (int)ceil((last - first) / apart) + 1;
    w->samples = w->stretches = 0;
    w->denses = foresee(w, first, last);
    if (w->denses < 0 || grow(&w->dense, &w->dense_room, w->denses, sizeof *w->dense))
        return -1;
    memcpy(w->dense, w->cycle, (size_t)w->denses * sizeof *w->dense);
    if (room_for_points(w, count))
        return -1;
    for (int i = 0; i < count; i++)
        w->cycle[i] = i == count - 1 ? last : first + (last - first) * i / (count - 1);
    if (add_nodes(w, count))
        return -1;
    count_scan(w, INT_MAX);
    if (repair_scan(w))
        return -1;
    for (int i = 0; i + 1 < count; i++)
        if (add_stretches(w, i))
            return -1;
    if (look_at_ends(w))
        return -1;
    prove_stretches(w);
    if (add_asked(w))
        return -1;
    count_scan(w, INT_MAX);
    return repair_scan(w) || open_brackets(w) ? -1 : 0;
}

#endif
