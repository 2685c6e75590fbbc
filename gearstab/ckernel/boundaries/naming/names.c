/* Which roots (p, q, M) the regions of a row are named after, see boundaries/names. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "kernel.h"

#define REACH 1.3
#define NEARNESS 0.1
#define DISTANCE 0.1
#define TURN 0.5
#define BELOW 1e-9
#define FORBIDDEN -10.0
#define SURE 0.5

#define NEIGHBOURS 8 /* roots on either side, by turn and by place, that a slot may get without a share in them */

struct root {
    int64_t p, q, cycles, rank;
    double place; /* ln of where it lies at epsilon = 0 */
    int class;
};

/* A root that a slot may get. */
struct candidate {
    int64_t root;
    double score;
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
    int64_t class_begin[4];      /* where the roots of each class begin */
    struct candidate *candidate; /* of all slots */
    int64_t *begins;             /* (slots + 1,), where those of a slot begin */
    int64_t candidates, candidate_room, begin_room;
    double *potential, *least; /* (roots + slots,), of the assignment; the last ones stand for no root at all */
    int64_t *match, *way, *touched;
    char *state;
    int64_t column_room, *given, given_room;
};

enum { UNTOUCHED, REACHED, SCANNED };

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
    /* A root whose turn it is lies at its rank: regions that share one have the same counts, and follow each other. */
    for (int64_t k = w->first; k < w->last; k++)
        for (int64_t j = k + 1; w->fixed[k] && j < w->last; j++) {
            int64_t class = class_of(w->leading[k]->p, w->leading[k]->q, w->leading[k]->cycles);
            if (w->all->passed[3 * j + class] > w->all->passed[3 * k + class])
                break;
            if (w->fixed[j] && same(w->leading[k], w->leading[j]))
                w->fixed[k] = w->fixed[j] = 2;
        }
    for (int64_t k = w->first; k < w->last; k++)
        w->fixed[k] = w->fixed[k] == 1;
}

/* Roots by class and place; by modes where these are equal. */
static int compare_roots(const void *one, const void *other) {
    const struct root *a = one, *b = other;
    if (a->class != b->class)
        return a->class < b->class ? -1 : 1;
    if (a->place != b->place)
        return a->place < b->place ? -1 : 1;
    return a->p != b->p ? (a->p < b->p ? -1 : 1) : a->q != b->q ? (a->q < b->q ? -1 : 1) : 0;
}

/* Whether there is such a root; *made is what it is then. */
static int make_root(const struct naming *w, int64_t p, int64_t q, int64_t cycles, struct root *made) {
    double rate = (w->frequency[p] + w->frequency[q]) * w->all->cycles;
    if (!(rate > 0 && cycles > 0))
        return 0;
    *made = (struct root){p, q, cycles, 0, log((double)cycles / rate), class_of(p, q, cycles)};
    return 1;
}

static struct root *find_root(const struct naming *w, int64_t p, int64_t q, int64_t cycles) {
    struct root own;
    if (w->roots == 0 || !make_root(w, p, q, cycles, &own))
        return NULL;
    return bsearch(&own, w->root, (size_t)w->roots, sizeof own, compare_roots);
}

static int add_root(struct naming *w, int64_t p, int64_t q, int64_t cycles) {
    struct root own;
    if (!make_root(w, p, q, cycles, &own))
        return 0;
    if (more(&w->root, &w->root_room, w->roots + 1, sizeof *w->root))
        return -1;
    w->root[w->roots++] = own;
    return 0;
}

/* Sort the roots; each stays once, and those not at all that a region has for sure. */
static void arrange_roots(struct naming *w) {
    int64_t kept = 0;
    qsort(w->root, (size_t)w->roots, sizeof *w->root, compare_roots);
    for (int64_t j = 0; j < w->roots; j++)
        if (kept == 0 || compare_roots(w->root + kept - 1, w->root + j))
            w->root[kept++] = w->root[j];
    w->roots = kept;
    for (int64_t k = w->first; k < w->last; k++) {
        const struct share *lead = w->leading[k];
        struct root *taken = w->fixed[k] ? find_root(w, lead->p, lead->q, lead->cycles) : NULL;
        if (taken)
            taken->rank = -1;
    }
    kept = 0;
    for (int64_t j = 0; j < w->roots; j++)
        if (w->root[j].rank >= 0)
            w->root[kept++] = w->root[j];
    w->roots = kept;
    for (int64_t j = 0, class = 0; class < 4; class++) {
        while (j < w->roots && w->root[j].class < class)
            j++;
        w->class_begin[class] = j;
    }
    for (int64_t j = 0; j < w->roots; j++)
        w->root[j].rank = rank_of(w, w->root[j].p, w->root[j].q, w->root[j].cycles);
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
                if (add_root(w, p, q, cycles))
                    return -1;
        }
    for (int64_t k = w->first; k < w->last; k++)
        for (const struct share *s = w->begin[k]; !w->fixed[k] && s < w->begin[k + 1]; s++)
            if (add_root(w, s->p, s->q, s->cycles))
                return -1;
    arrange_roots(w);
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

#include "assign.h"

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
    int64_t slot = 0;
    for (int64_t k = w->first; k < w->last; k++) {
        const struct share *lead = w->leading[k];
        int64_t begin = kept->count;
        if (more(&kept->name, &kept->room, kept->count + w->slots + 1, sizeof *kept->name))
            return -1;
        for (; !w->fixed[k] && slot < w->slots && w->slot[slot].region == k; slot++) {
            if (w->given[slot] >= w->roots)
                continue;
            const struct root *r = w->root + w->given[slot];
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
    int64_t columns = w->roots + w->slots + 1, rooms[5];
    for (int i = 0; i < 5; i++)
        rooms[i] = w->column_room;
    return more(&w->begins, &w->begin_room, w->slots + 1, sizeof *w->begins) ||
                   more(&w->given, &w->given_room, w->slots + 1, sizeof *w->given) ||
                   more(&w->potential, &rooms[0], columns, sizeof *w->potential) ||
                   more(&w->least, &rooms[1], columns, sizeof *w->least) || more(&w->match, &rooms[2], columns, sizeof *w->match) ||
                   more(&w->way, &rooms[3], columns, sizeof *w->way) ||
                   more(&w->touched, &rooms[4], columns, sizeof *w->touched) ||
                   more(&w->state, &w->column_room, columns, sizeof *w->state)
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
        if (add_roots(w) || add_slots(w) || room_to_assign(w) || weigh(w))
            return -1;
        assign(w);
        if (gearstab_stopped())
            return -1;
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
    for (int64_t first = 0, last; !failed && first < all->count && !gearstab_stopped(); first = last) {
        for (last = first + 1; last < all->count && all->row[last] == all->row[first]; last++)
            ;
        w.first = first, w.last = last;
        w.frequency = all->frequency + all->row[first] * all->n;
        failed = name_row(&w, kept);
    }
    free(merged), free(w.begin), free(w.leading), free(w.fixed), free(w.root), free(w.slot);
    free(w.candidate), free(w.begins), free(w.given), free(w.potential), free(w.least), free(w.match), free(w.way);
    free(w.touched), free(w.state);
    return failed;
}
