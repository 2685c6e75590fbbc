/* The work of the search on one window of a row: what it keeps, and the memory for it. */

#ifndef GEARSTAB_WINDOW_H
#define GEARSTAB_WINDOW_H

#include <stdlib.h>

#include "enclose.h"

#define STEP 0x1p-24      /* to the second point that tells signs and speeds, relative; and not above this part of the floor: */
#define STEP_OF_FLOOR 0x1p-4

struct bracket {
    int left, right, age, failures, smooth;
    int before, after; /* the nearest points around it whose counts are known */
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

/* An edge of the row before, its first and second differences from row to row, by how much the row before foresaw it wrongly, and
   for how many rows it has been known. */
struct guess {
    double cycle, first, second, missed;
    int64_t enters, passed[3];
    int age;
};

/* A point of the scan, whether nothing lies between it and the next; the stretches between the two, and their first. */
struct node {
    int sample, proved, stretches, stretch;
    double cycle;
};

enum { ASKED = -1 }; /* sample of a node that is still to be evaluated */

/* Where nothing is foreseen to happen, see enclose.c; how many lines tell whether that is so, and whether it is. */
struct stretch {
    double end[2];
    int lines, proved;
};

/* The work on one window of a row. */
struct window {
    const struct order *order;
    void *spectra, *index;
    int64_t n, row, evaluations;
    double step, spacing;
    struct block **block;
    int blocks, samples;
    struct bracket *open, *next; /* of this round and of the next */
    int opens, nexts, bracket_room;
    struct finding *found;                 /* of the open brackets that ask for a point */
    double *cycle, *angle, *growth, *size, *taken; /* points asked for and those a step later */
    double *shorter;                       /* the step of each point over `step` */
    int *again; /* points whose second one is to be nearer */
    int point_room;
    struct item *items;
    int *position;
    double *phase;
    struct edge *edge;
    int64_t edges, edge_room;
    struct guess *guess, *fresh; /* of the row before, by place; and of this one */
    int64_t guess_room;
    int guesses;
    struct node *node, *fresh_node; /* by cycle */
    int64_t node_room, fresh_room;
    int nodes, fresh_nodes;
    double counted; /* the last node of the window before, and N(0) there; 0 if that is not known */
    int64_t count;
    /* Of sparse scans: */
    struct enclosing *enclosing;
    struct stretch *stretch;
    double *dense, *line; /* the points of a dense scan; of each stretch `line_room` angles, not all of which are used */
    int64_t stretch_room, dense_room, line_held, line_room;
    int denses, stretches;
    double *end_cycle, *end_line; /* ends of stretches to look at, and what is found there */
    int64_t *end_lines, *below;
    int end_room;
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
    free(w->cycle), free(w->angle), free(w->growth), free(w->size), free(w->taken), free(w->shorter), free(w->again);
    free(w->guess), free(w->fresh);
    free(w->items), free(w->position), free(w->phase);
    free(w->node), free(w->fresh_node), free(w->stretch), free(w->dense), free(w->line);
    free(w->end_cycle), free(w->end_line), free(w->end_lines), free(w->below);
    enclosing_free(w->enclosing);
    gearstab_index_free(w->index);
    w->order->level->spectra_free(w->spectra);
}

static int window_new(struct window *w, const struct order *order) {
    *w = (struct window){.order = order, .n = order->exact->n};
    double limit = STEP_OF_FLOOR * order->floor;
    w->step = limit < STEP ? limit : STEP;
    w->spectra = order->level->spectra_new(order->exact);
    w->index = gearstab_index_new(w->n);
    w->items = malloc(2 * (size_t)w->n * sizeof *w->items);
    w->position = malloc((size_t)w->n * sizeof *w->position);
    w->phase = malloc((size_t)w->n * sizeof *w->phase);
    w->line_room = w->n + 3;
    w->enclosing = enclosing_new(w->n, order->floor);
    return w->spectra && w->index && w->items && w->position && w->phase && w->enclosing ? 0 : -1;
}

static int room_for_points(struct window *w, int count) {
    if (count <= w->point_room)
        return 0;
    size_t room = (size_t)count + 64;
    free(w->cycle), free(w->angle), free(w->growth), free(w->size), free(w->taken), free(w->shorter), free(w->again);
    w->again = malloc(room * sizeof(int));
    w->cycle = malloc(2 * room * sizeof(double));
    w->angle = malloc(2 * room * (size_t)w->n * sizeof(double));
    w->growth = malloc(2 * room * (size_t)w->n * sizeof(double));
    w->size = malloc(2 * room * sizeof(double));
    w->taken = malloc(2 * room * sizeof(double));
    w->shorter = malloc(room * sizeof(double));
    int all = w->cycle && w->angle && w->growth && w->size && w->taken && w->shorter && w->again;
    w->point_room = all ? (int)room : 0;
    return w->point_room ? 0 : -1;
}

/* With two more sets of numbers, for points whose multipliers are known. */
static int room_for_ends(struct window *w, int count) {
    if (count <= w->end_room)
        return 0;
    size_t room = (size_t)count + 64, lines = (size_t)w->line_room;
    free(w->end_cycle), free(w->end_line), free(w->end_lines), free(w->below);
    w->end_cycle = malloc(room * sizeof(double));
    w->end_line = malloc(room * lines * sizeof(double));
    w->end_lines = malloc(room * sizeof(int64_t));
    w->below = malloc((room + 2) * lines * sizeof(int64_t));
    w->end_room = w->end_cycle && w->end_line && w->end_lines && w->below ? (int)room : 0;
    return w->end_room ? 0 : -1;
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

#endif
