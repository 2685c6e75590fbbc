/* Which roots (p, q, M) the regions of a row are named after, see labels.py: assign() and what it calls. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "kernel.h"

/* The same as in labels.py. */
#define REACH 1.3
#define NEARNESS 0.1
#define DISTANCE 0.1
#define TURN 0.5
#define BELOW 1e-9
#define FORBIDDEN -10.0
#define SURE 0.5

struct root {
    int64_t p, q, cycles, rank;
    double place; /* ln of where it lies at epsilon = 0 */
};

/* A root that a region must have: its class, and how many of that class the region has before. */
struct slot {
    int64_t region;
    int class;
    int64_t number;
};

/* The work on one row; arrays grow as they are needed. */
struct naming {
    const struct regions *all;
    const double *frequency;      /* (n,) of the row */
    int64_t first, last;          /* its regions */
    const struct share **begin;   /* (regions + 1,), shares by region */
    const struct share **leading; /* (regions,), NULL where there is none */
    char *fixed;                  /* (regions,) */
    struct root *root;
    struct slot *slot;
    int64_t roots, root_room, slots, slot_room;
    double *score;                     /* (slots, roots + slots) */
    double *price, *potential, *least; /* of the assignment */
    int64_t *match, *way;
    char *used;
    int64_t score_room, column_room;
};

static int more(void *given, int64_t *room, int64_t needed, size_t size) {
    void **array = given;
    if (needed <= *room)
        return 0;
    int64_t wanted = needed + needed / 2 + 64;
    void *moved = realloc(*array, (size_t)wanted * size);
    if (!moved)
        return -1;
    *array = moved, *room = wanted;
    return 0;
}

static int class_of(int64_t p, int64_t q, int64_t cycles) { return p != q ? 2 : cycles % 2 != 0; }

static int same(const struct share *a, const struct share *b) {
    return a->p == b->p && a->q == b->q && a->cycles == b->cycles;
}

/* The classes of a region: those of its meetings, else that of its leading solution; how many (and the only one). */
static int64_t meetings_of(const struct naming *w, int64_t region, int *class) {
    const int64_t *own = w->all->meetings + 3 * region;
    int64_t count = own[0] + own[1] + own[2];
    *class = own[0] ? 0 : own[1] ? 1 : 2;
    const struct share *lead = w->leading[region];
    if (count == 0 && lead) {
        *class = class_of(lead->p, lead->q, lead->cycles);
        return 1;
    }
    return count;
}

/* How many roots of the same class lie below one since T = 0. */
static int64_t rank_of(const struct naming *w, int64_t p, int64_t q, int64_t cycles) {
    int64_t n = w->all->n, count = 0;
    double scale = (double)cycles / (w->frequency[p] + w->frequency[q]);
    int class = class_of(p, q, cycles);
    for (int64_t i = 0; i < n; i++) {
        if (class < 2)
            count += (int64_t)floor(w->frequency[i] * scale + 0.5 * class - BELOW);
        for (int64_t j = i + 1; class == 2 && j < n; j++)
            count += (int64_t)floor((w->frequency[i] + w->frequency[j]) * scale - BELOW);
    }
    return count;
}

/* The largest share of each region of the row, and which of them settle its name: more than half of the action, of the class
   of its only meeting, whose turn it is, and no other region's too. */
static void settle(struct naming *w) {
    for (int64_t k = w->first; k < w->last; k++) {
        w->leading[k] = NULL;
        for (const struct share *s = w->begin[k]; s < w->begin[k + 1]; s++)
            if (!w->leading[k] || s->share > w->leading[k]->share)
                w->leading[k] = s;
    }
    for (int64_t k = w->first; k < w->last; k++) {
        const struct share *lead = w->leading[k];
        int class;
        w->fixed[k] = meetings_of(w, k, &class) == 1 && lead && class == class_of(lead->p, lead->q, lead->cycles) &&
                      lead->share > SURE && w->frequency[lead->p] + w->frequency[lead->q] > 0 &&
                      rank_of(w, lead->p, lead->q, lead->cycles) == w->all->passed[3 * k + class];
    }
    for (int64_t k = w->first; k < w->last; k++)
        for (int64_t j = k + 1; w->fixed[k] && j < w->last; j++)
            if (w->fixed[j] && same(w->leading[k], w->leading[j]))
                w->fixed[k] = w->fixed[j] = 2;
    for (int64_t k = w->first; k < w->last; k++)
        w->fixed[k] = w->fixed[k] == 1;
}

/* Add a root that no region has for sure; nothing happens if it is there, or cannot be. */
static int add_root(struct naming *w, int64_t p, int64_t q, int64_t cycles, int look) {
    struct share own = {0, p, q, cycles, 0};
    double rate = (w->frequency[p] + w->frequency[q]) * w->all->cycles;
    if (!(rate > 0))
        return 0;
    for (int64_t k = w->first; k < w->last; k++)
        if (w->fixed[k] && same(w->leading[k], &own))
            return 0;
    for (int64_t i = 0; look && i < w->roots; i++)
        if (w->root[i].p == p && w->root[i].q == q && w->root[i].cycles == cycles)
            return 0;
    if (more(&w->root, &w->root_room, w->roots + 1, sizeof *w->root))
        return -1;
    w->root[w->roots++] = (struct root){p, q, cycles, rank_of(w, p, q, cycles), log((double)cycles / rate)};
    return 0;
}

/* All roots near the regions that are left, and all with a share in them. */
static int add_roots(struct naming *w) {
    double low = INFINITY, high = 0.0;
    w->roots = 0;
    for (int64_t k = w->first; k < w->last; k++)
        if (!w->fixed[k]) {
            low = w->all->cycle[k] < low ? w->all->cycle[k] : low;
            high = w->all->cycle[k] > high ? w->all->cycle[k] : high;
        }
    for (int64_t p = 0; p < w->all->n; p++)
        for (int64_t q = p; q < w->all->n; q++) {
            double rate = (w->frequency[p] + w->frequency[q]) * w->all->cycles;
            int64_t from = (int64_t)(low / REACH * rate), to = (int64_t)(high * REACH * rate) + 1;
            for (int64_t cycles = from > 1 ? from : 1; rate > 0 && cycles <= to; cycles++)
                if (add_root(w, p, q, cycles, 0))
                    return -1;
        }
    for (int64_t k = w->first; k < w->last; k++)
        for (const struct share *s = w->begin[k]; !w->fixed[k] && s < w->begin[k + 1]; s++)
            if (s->cycles > 0 && add_root(w, s->p, s->q, s->cycles, 1))
                return -1;
    return 0;
}

static int add_slots(struct naming *w) {
    w->slots = 0;
    for (int64_t k = w->first; k < w->last; k++) {
        int only;
        if (w->fixed[k])
            continue;
        int64_t count = meetings_of(w, k, &only);
        for (int class = 0; class < 3; class++) {
            int64_t own = count == 1 ? class == only : w->all->meetings[3 * k + class];
            for (int64_t number = 0; number < own; number++) {
                if (more(&w->slot, &w->slot_room, w->slots + 1, sizeof *w->slot))
                    return -1;
                w->slot[w->slots++] = (struct slot){k, class, number};
            }
        }
    }
    return 0;
}

/* exp(-x), 0 where that is nothing. */
static double fading(double x) { return x < 40.0 ? exp(-x) : 0.0; }

/* score (slots, roots + slots): the last columns stand for no root at all. */
static void weigh(struct naming *w) {
    int64_t columns = w->roots + w->slots;
    for (int64_t i = 0; i < w->slots; i++) {
        const struct slot *s = w->slot + i;
        double place = log(w->all->cycle[s->region]), *score = w->score + i * columns;
        int64_t turn = w->all->passed[3 * s->region + s->class] + s->number;
        for (int64_t j = 0; j < columns; j++) {
            const struct root *r = w->root + (j < w->roots ? j : 0);
            score[j] = FORBIDDEN;
            if (j < w->roots && class_of(r->p, r->q, r->cycles) == s->class)
                score[j] = NEARNESS * fading(fabs(r->place - place) / DISTANCE) +
                           TURN * fading(fabs((double)(r->rank - turn)));
        }
        for (const struct share *own = w->begin[s->region]; own < w->begin[s->region + 1]; own++)
            for (int64_t j = 0; j < w->roots; j++) {
                const struct root *r = w->root + j;
                if (r->p == own->p && r->q == own->q && r->cycles == own->cycles && score[j] > FORBIDDEN)
                    score[j] += own->share;
            }
    }
}

/* The assignment of roots to slots with the largest total score (Kuhn 1955, in the form of shortest augmenting paths with
   potentials: Jonker & Volgenant 1987); match (columns + 1,) says which slot, from 1, a column, from 1, belongs to; 0: none. */
static void assign(struct naming *w) {
    int64_t columns = w->roots + w->slots;
    memset(w->price, 0, (size_t)(w->slots + 1) * sizeof *w->price);
    memset(w->potential, 0, (size_t)(columns + 1) * sizeof *w->potential);
    memset(w->match, 0, (size_t)(columns + 1) * sizeof *w->match);
    for (int64_t i = 1; i <= w->slots; i++) {
        int64_t at = 0;
        w->match[0] = i;
        for (int64_t j = 0; j <= columns; j++)
            w->least[j] = INFINITY, w->used[j] = 0;
        do {
            w->used[at] = 1;
            int64_t slot = w->match[at], next = 0;
            double delta = INFINITY;
            for (int64_t j = 1; j <= columns; j++) {
                if (w->used[j])
                    continue;
                double cost = -w->score[(slot - 1) * columns + j - 1] - w->price[slot] - w->potential[j];
                if (cost < w->least[j])
                    w->least[j] = cost, w->way[j] = at;
                if (w->least[j] < delta)
                    delta = w->least[j], next = j;
            }
            for (int64_t j = 0; j <= columns; j++) {
                if (w->used[j])
                    w->price[w->match[j]] += delta, w->potential[j] -= delta;
                else
                    w->least[j] -= delta;
            }
            at = next;
        } while (w->match[at] != 0);
        while (at) {
            int64_t back = w->way[at];
            w->match[at] = w->match[back];
            at = back;
        }
    }
}

static double share_of(const struct naming *w, int64_t region, const struct name *name) {
    for (const struct share *s = w->begin[region]; s < w->begin[region + 1]; s++)
        if (s->p == name->p && s->q == name->q && s->cycles == name->cycles)
            return s->share;
    return 0.0;
}

/* Whether a name comes before another of its region: by share to three digits, then by root. */
static int before(const struct naming *w, const struct name *a, const struct name *b) {
    double x = nearbyint(1e3 * share_of(w, a->region, a)), y = nearbyint(1e3 * share_of(w, b->region, b));
    if (x != y)
        return x > y;
    return a->p != b->p ? a->p < b->p : a->q != b->q ? a->q < b->q : a->cycles < b->cycles;
}

/* The root nearest to a region that has none. */
static const struct root *nearest(const struct naming *w, int64_t region) {
    const struct root *best = NULL;
    double place = log(w->all->cycle[region]);
    for (int64_t j = 0; j < w->roots; j++)
        if (!best || fabs(w->root[j].place - place) < fabs(best->place - place))
            best = w->root + j;
    return best;
}

static int keep_names(struct naming *w, struct names *kept) {
    for (int64_t k = w->first; k < w->last; k++) {
        const struct share *lead = w->leading[k];
        int64_t begin = kept->count;
        if (more(&kept->name, &kept->room, kept->count + w->slots + 1, sizeof *kept->name))
            return -1;
        for (int64_t j = 0; !w->fixed[k] && j < w->roots; j++) {
            const struct root *r = w->root + j;
            int64_t i = w->slots ? w->match[j + 1] - 1 : -1;
            if (i < 0 || w->slot[i].region != k || !(w->score[i * (w->roots + w->slots) + j] > FORBIDDEN))
                continue;
            struct name own = {k, r->p, r->q, r->cycles};
            int64_t at = kept->count++;
            for (; at > begin && before(w, &own, kept->name + at - 1); at--)
                kept->name[at] = kept->name[at - 1];
            kept->name[at] = own;
        }
        if (kept->count > begin)
            continue;
        const struct root *r = lead ? NULL : nearest(w, k);
        if (lead)
            kept->name[kept->count++] = (struct name){k, lead->p, lead->q, lead->cycles};
        else if (r)
            kept->name[kept->count++] = (struct name){k, r->p, r->q, r->cycles};
    }
    return 0;
}

static int room_to_assign(struct naming *w) {
    int64_t columns = w->roots + w->slots + 1, rooms[6];
    if (more(&w->score, &w->score_room, w->slots * columns, sizeof *w->score))
        return -1;
    for (int i = 0; i < 6; i++)
        rooms[i] = w->column_room;
    return more(&w->price, &rooms[0], columns, sizeof *w->price) || more(&w->potential, &rooms[1], columns, sizeof *w->potential) ||
           more(&w->least, &rooms[2], columns, sizeof *w->least) || more(&w->match, &rooms[3], columns, sizeof *w->match) ||
           more(&w->way, &rooms[4], columns, sizeof *w->way) || more(&w->used, &w->column_room, columns, sizeof *w->used)
               ? -1
               : 0;
}

static int name_row(struct naming *w, struct names *kept) {
    int64_t left = 0;
    settle(w);
    for (int64_t k = w->first; k < w->last; k++)
        left += !w->fixed[k];
    w->roots = w->slots = 0;
    if (left > 0) {
        if (add_roots(w) || add_slots(w) || room_to_assign(w))
            return -1;
        weigh(w);
        assign(w);
    }
    return keep_names(w, kept);
}

/* The shares by region, of several points the largest of each root. */
static void merge(const struct regions *all, struct share *merged, const struct share **begin) {
    struct share *end = merged;
    const struct share *at = all->share, *last = all->share + all->shares;
    for (int64_t k = 0; k < all->count; k++) {
        begin[k] = end;
        for (; at < last && at->point <= k; at++) {
            struct share *own = merged + (begin[k] - merged);
            while (own < end && !same(own, at))
                own++;
            if (own == end)
                *end++ = *at;
            else if (at->share > own->share)
                own->share = at->share;
        }
    }
    begin[all->count] = end;
}

/* Names of all regions, by region; see kernel.h. */
int gearstab_names(const struct regions *all, struct names *kept) {
    size_t count = (size_t)all->count + 1;
    struct naming w = {.all = all};
    w.begin = malloc(count * sizeof *w.begin), w.leading = malloc(count * sizeof *w.leading), w.fixed = malloc(count);
    int failed = w.begin && w.leading && w.fixed ? 0 : -1;
    struct share *merged = malloc(((size_t)all->shares + 1) * sizeof *merged);
    failed |= merged ? 0 : -1;
    if (!failed)
        merge(all, merged, w.begin);
    for (int64_t first = 0, last; !failed && first < all->count; first = last) {
        for (last = first + 1; last < all->count && all->row[last] == all->row[first]; last++)
            ;
        w.first = first, w.last = last;
        w.frequency = all->frequency + all->row[first] * all->n;
        failed = name_row(&w, kept);
    }
    free(merged), free(w.begin), free(w.leading), free(w.fixed), free(w.root), free(w.slot), free(w.score);
    free(w.price), free(w.potential), free(w.least), free(w.match), free(w.way), free(w.used);
    return failed;
}
