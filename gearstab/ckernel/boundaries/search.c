/* All instability boundaries of the rows of a conservative pattern along the period.

   A row is searched window by window: points uniform in the period, about one a collision of multipliers; then the brackets
   between neighbours are refined, all of a window at once, one point a bracket and round, until each holds nothing, an edge
   within the tolerance, or a collision that opens less than the floor. What a bracket holds is said by counts (brackets.c), where
   to look by interpolation (steps.c); only verdicts at points count. */

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "search.h"

#define WINDOW 96         /* points of the scan in a window */
#define COARSEST 6        /* points of a row that has hardly any collisions */
#define STEP 0x1p-24      /* to the second point that tells signs and speeds, relative; and not above this part of the floor: */
#define STEP_OF_FLOOR 0x1p-4
#define APART 4           /* points of a scan from one direct count to the next, n/2 of large systems; a third of a search less */
#define PATIENCE 4        /* rounds of interpolation in which a bracket must halve */
#define ATTEMPTS 4        /* points tried where signs are lost in rounding, before a bracket is left as it is */
#define ACCURATE 0.1      /* part of the tolerance within which Newton's step must end */
#define SMALL 0.26        /* of the spacing: brackets whose counts are unknown are taken at face value below */

struct bracket {
    int left, right, age, failures, smooth;
    double width; /* when the present rounds of interpolation began */
};

/* Samples come in blocks that stay where they are. */
enum { BLOCK = 256 };

struct block {
    struct sample sample[BLOCK];
    struct letter *letter;
    struct gap *gap;
    struct off *off;
};

/* The work on one window of a row. */
struct window {
    const struct order *order;
    void *spectra;
    struct index_room *index;
    int64_t n, row, evaluations;
    double step, spacing;
    struct block **block;
    int blocks, samples;
    struct bracket *open, *next; /* of this round and of the next */
    int opens, nexts, bracket_room;
    struct finding *found;                 /* of the open brackets that ask for a point */
    double *cycle, *angle, *growth, *size; /* points asked for and those a step later */
    int point_room;
    struct item *items;
    int *position;
    double *phase;
    struct edge *edge;
    int64_t edges, edge_room;
};

static struct sample *at(const struct window *w, int i) { return &w->block[i / BLOCK]->sample[i % BLOCK]; }

/* ---- memory; all return 0, or -1 when there is none */
static int grow(void *given, int64_t *room, int64_t needed, size_t size) {
    void **array = given;
    if (needed <= *room)
        return 0;
    int64_t more = needed + needed / 2 + 16;
    void *moved = realloc(*array, (size_t)more * size);
    if (!moved)
        return -1;
    *array = moved;
    *room = more;
    return 0;
}

static void block_free(struct block *block) {
    if (!block)
        return;
    free(block->letter);
    free(block->gap);
    free(block->off);
    free(block);
}

static int block_new(struct window *w) {
    struct block **blocks = realloc(w->block, (size_t)(w->blocks + 1) * sizeof *blocks);
    if (!blocks)
        return -1;
    w->block = blocks;
    struct block *b = w->block[w->blocks] = calloc(1, sizeof *b);
    if (!b)
        return -1;
    size_t n = (size_t)w->n;
    b->letter = malloc(BLOCK * n * sizeof *b->letter);
    b->gap = malloc(BLOCK * (n + 1) * sizeof *b->gap);
    b->off = malloc(BLOCK * n * sizeof *b->off);
    if (!b->letter || !b->gap || !b->off) {
        block_free(b);
        return -1;
    }
    for (size_t i = 0; i < BLOCK; i++) {
        b->sample[i].letter = b->letter + i * n;
        b->sample[i].gap = b->gap + i * (n + 1);
        b->sample[i].off = b->off + i * n;
    }
    w->blocks++;
    return 0;
}

static void window_free(struct window *w) {
    for (int i = 0; i < w->blocks; i++)
        block_free(w->block[i]);
    free(w->block);
    free(w->open), free(w->next), free(w->found);
    free(w->cycle), free(w->angle), free(w->growth), free(w->size);
    free(w->items), free(w->position), free(w->phase);
    index_free(w->index);
    if (w->spectra)
        w->order->level->spectra_free(w->spectra);
}

static int window_new(struct window *w, const struct order *order) {
    *w = (struct window){.order = order, .n = order->exact->n};
    double limit = STEP_OF_FLOOR * order->floor;
    w->step = limit < STEP ? limit : STEP;
    w->spectra = order->level->spectra_new(order->exact);
    w->index = index_new(w->n);
    w->items = malloc(2 * (size_t)w->n * sizeof *w->items);
    w->position = malloc((size_t)w->n * sizeof *w->position);
    w->phase = malloc((size_t)w->n * sizeof *w->phase);
    return w->spectra && w->index && w->items && w->position && w->phase ? 0 : -1;
}

static int room_for_points(struct window *w, int count) {
    if (count <= w->point_room)
        return 0;
    size_t room = (size_t)count + 64;
    free(w->cycle), free(w->angle), free(w->growth), free(w->size);
    w->cycle = malloc(2 * room * sizeof(double));
    w->angle = malloc(2 * room * (size_t)w->n * sizeof(double));
    w->growth = malloc(2 * room * (size_t)w->n * sizeof(double));
    w->size = malloc(2 * room * sizeof(double));
    w->point_room = w->cycle && w->angle && w->growth && w->size ? (int)room : 0;
    return w->point_room ? 0 : -1;
}

static int room_for_brackets(struct window *w, int count) {
    if (count <= w->bracket_room)
        return 0;
    size_t room = (size_t)count + (size_t)count / 2 + 64;
    struct bracket *open = realloc(w->open, room * sizeof *open);
    w->open = open ? open : w->open;
    struct bracket *next = realloc(w->next, room * sizeof *next);
    w->next = next ? next : w->next;
    struct finding *found = realloc(w->found, room * sizeof *found);
    w->found = found ? found : w->found;
    w->bracket_room = open && next && found ? (int)room : w->bracket_room;
    return open && next && found ? 0 : -1;
}

/* ---- points */

/* Samples at the first `count` cycles of w->cycle, from number w->samples on; room_for_points was asked for. */
static int evaluate(struct window *w, int count) {
    double *cycle = w->cycle, *later = cycle + count;
    int64_t n = w->n;
    while (w->blocks * BLOCK < w->samples + count)
        if (block_new(w))
            return -1;
    for (int i = 0; i < count; i++)
        later[i] = cycle[i] * (1.0 + w->step);
    w->order->level->spectra_at(w->spectra, 2 * count, cycle, w->angle, w->growth, w->size);
    for (int i = 0; i < count; i++) {
        struct sample *s = at(w, w->samples + i);
        s->cycle = cycle[i];
        sample_read(s, n, later[i] - cycle[i], w->angle + i * n, w->growth + i * n, w->size[i], w->angle + (count + i) * n,
                    w->growth + (count + i) * n, w->items, w->position);
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
    index_at(w->index, w->order->coarse, w->row, s->cycle, &s->index, &at_minus_one);
    s->indexed = at_minus_one - s->index == signs_below(s, 4.0);
    s->known = s->indexed;
}

static void count_between(struct window *w, struct sample *s, const struct sample *left, const struct sample *right) {
    if (!s->known)
        return;
    int64_t index = left->indexed && right->indexed ? index_between(left, right, s, w->n) : UNSETTLED;
    if (index == UNSETTLED || index == CONTRADICTION) {
        count_directly(w, s);
        return;
    }
    s->index = index;
    s->indexed = 1;
}

/* ---- the scan */

/* Counts of the samples of a scan: directly at some of them, from monotony between. */
static void count_scan(struct window *w, int first, int count) {
    int apart = w->n > 2 * APART ? (int)(w->n / 2) : APART;
    for (int i = 0; i < count; i++)
        if (at(w, first + i)->known && (i % apart == 0 || i == count - 1))
            count_directly(w, at(w, first + i));
    for (int i = 1, before = 0; i < count; i++) {
        struct sample *s = at(w, first + i);
        if (s->known && !s->indexed) {
            int after = i + 1;
            while (after < count - 1 && !at(w, first + after)->indexed)
                after++;
            count_between(w, s, at(w, first + before), at(w, first + after));
        }
        before = s->indexed ? i : before;
    }
}

/* Replace samples that tell nothing by neighbours of theirs. */
static int repair_scan(struct window *w, int first, int count) {
    for (int attempt = 1; attempt < ATTEMPTS; attempt++)
        for (int i = 0; i < count; i++) {
            struct sample *s = at(w, first + i);
            if (usable(s))
                continue;
            int end = i == 0 || i == count - 1;
            double nudge = end ? 1e-11 * s->cycle : 0.07 * w->spacing;
            w->cycle[0] = s->cycle + (i == count - 1 ? -1 : 1) * attempt * nudge;
            int kept = w->samples;
            if (evaluate(w, 1))
                return -1;
            struct sample *again = at(w, kept), old = *s;
            if (again->known)
                count_directly(w, again);
            *s = *again; /* each keeps its own room */
            *again = old;
            w->samples = kept;
        }
    return 0;
}

/* Points uniform between two cycles and the brackets between them. */
static int scan(struct window *w, double first, double last) {
    int count = (int)ceil((last - first) / w->spacing - 1e-9) + 1;
    count = count < 2 ? 2 : count;
    w->samples = w->opens = 0;
    if (room_for_points(w, count) || room_for_brackets(w, count))
        return -1;
    for (int i = 0; i < count; i++)
        w->cycle[i] = i == count - 1 ? last : first + (last - first) * i / (count - 1);
    if (evaluate(w, count))
        return -1;
    count_scan(w, 0, count);
    if (repair_scan(w, 0, count))
        return -1;
    for (int i = 0, before = -1; i < count; i++) {
        if (!usable(at(w, i)))
            continue;
        if (before >= 0)
            w->open[w->opens++] =
                (struct bracket){before, i, 0, 0, 0, at(w, i)->cycle - at(w, before)->cycle};
        before = i;
    }
    return 0;
}

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
    double blur = 2.0 * blurred(left, right, found);
    error = blur > error ? blur : error;
    *edge = (struct edge){.row = w->row, .cycle = cycle, .error = error, .enters = left->stable};
    collisions_of(left->stable ? left : right, w->n, 1, w->phase, edge->passed);
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
    if (width <= (is_edge ? tolerance : w->order->floor * left->cycle) || b->failures >= ATTEMPTS)
        return is_edge ? add_edge(w, b, found, 0.5 * (left->cycle + right->cycle), width) : 0;
    *cycle = somewhere(b, left->cycle, right->cycle);
    if (b->failures > 0 || b->age >= PATIENCE)
        return 1;
    if (found->kind == ENTRANCE || found->kind == EXIT) {
        double distance, edge = edge_between(left, right, found, &distance);
        if (distance < ACCURATE * tolerance) {
            if (!found->doubtful)
                return add_edge(w, b, found, edge, 2.0 * distance);
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
        *part = (struct bracket){side ? point : b->left, side ? b->right : point, b->age + 1, 0, smooth, b->width};
        double width = at(w, part->right)->cycle - at(w, part->left)->cycle;
        if (width < 0.5 * part->width || part->age > PATIENCE)
            part->age = 0, part->width = width;
    }
}

static int refine(struct window *w) {
    while (w->opens > 0) {
        int asking = 0;
        if (room_for_points(w, w->opens) || room_for_brackets(w, 2 * w->opens))
            return -1;
        for (int i = 0; i < w->opens; i++) {
            int more = advance(w, &w->open[i], &w->found[asking], &w->cycle[asking]);
            if (more < 0)
                return -1;
            if (more)
                w->open[asking++] = w->open[i];
        }
        int first = w->samples;
        if (asking && evaluate(w, asking))
            return -1;
        w->nexts = 0;
        for (int i = 0; i < asking; i++) {
            struct bracket *b = &w->open[i];
            struct sample *s = at(w, first + i);
            count_between(w, s, at(w, b->left), at(w, b->right));
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

static const struct sample *outermost(const struct window *w, int count, int last) {
    for (int i = 0; i < count; i++)
        if (usable(at(w, last ? count - 1 - i : i)))
            return at(w, last ? count - 1 - i : i);
    return at(w, 0);
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
    for (double k = 0; k < windows; k++) {
        double first = k == 0 ? start : start + (stop - start) * (k / windows);
        double last = k == windows - 1 ? stop : start + (stop - start) * ((k + 1) / windows);
        if (isfinite(longest))
            w->order->level->spectra_window(w->spectra, first, last);
        if (scan(w, first, last))
            return -1;
        int scanned = w->samples;
        if (k == 0)
            note_end(w, outermost(w, scanned, 0), 0, reach);
        note_end(w, outermost(w, scanned, 1), 1, reach);
        if (refine(w))
            return -1;
    }
    reach->evaluations = w->evaluations;
    return 0;
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
