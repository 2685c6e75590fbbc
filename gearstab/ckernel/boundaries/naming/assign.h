/* Which slot of a row gets which root: candidates with their scores, and the assignment with the largest total.

   A part of names.c, whose records it works on: what is scored says boundaries/names. */

#ifndef GEARSTAB_ASSIGN_H
#define GEARSTAB_ASSIGN_H

/* exp(-x), 0 where that is nothing. */
static double fading(double x) { return x < 40.0 ? exp(-x) : 0.0; }

static int add_candidate(struct naming *w, int64_t slot, int64_t root, double share) {
    const struct slot *s = w->slot + slot;
    const struct root *r = w->root + root;
    for (int64_t i = w->begins[slot]; i < w->candidates; i++)
        if (w->candidate[i].root == root) {
            w->candidate[i].score += share;
            return 0;
        }
    if (more(&w->candidate, &w->candidate_room, w->candidates + 1, sizeof *w->candidate))
        return -1;
    int64_t turn = w->all->passed[3 * s->region + s->class] + s->number;
    w->candidate[w->candidates++] = (struct candidate){
        root, share + NEARNESS * fading(fabs(r->place - log(w->all->cycle[s->region])) / DISTANCE) +
                  TURN * fading(fabs((double)(r->rank - turn)))};
    return 0;
}

/* The first root of a class from a rank on, or from a place on. */
static int64_t first_of(const struct naming *w, int class, int64_t rank, double place) {
    int64_t low = w->class_begin[class], high = w->class_begin[class + 1];
    while (low < high) {
        int64_t middle = low + (high - low) / 2;
        if (w->root[middle].rank < rank || w->root[middle].place < place)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* What each slot may get: a little for a root that is near, something for one whose turn it is by the counts, and its share.
   Farther ones would add nothing: score fades with both distances. */
static int weigh(struct naming *w) {
    w->candidates = 0;
    for (int64_t i = 0; i < w->slots; i++) {
        const struct slot *s = w->slot + i;
        w->begins[i] = w->candidates;
        int64_t turn = w->all->passed[3 * s->region + s->class] + s->number;
        int64_t middle[2] = {first_of(w, s->class, turn, -INFINITY),
                             first_of(w, s->class, INT64_MIN, log(w->all->cycle[s->region]))};
        for (int side = 0; side < 2; side++)
            for (int64_t j = middle[side] - NEIGHBOURS; j < middle[side] + NEIGHBOURS; j++)
                if (j >= w->class_begin[s->class] && j < w->class_begin[s->class + 1] && add_candidate(w, i, j, 0.0))
                    return -1;
        for (const struct share *own = w->begin[s->region]; own < w->begin[s->region + 1]; own++) {
            const struct root *r = find_root(w, own->p, own->q, own->cycles);
            if (r && r->class == s->class && add_candidate(w, i, r - w->root, own->share))
                return -1;
        }
    }
    w->begins[w->slots] = w->candidates;
    return 0;
}

/* Reach a column by way of slot i, at this cost more than the potentials; it joins those that were touched. */
static void reach(struct naming *w, int64_t column, double cost, int64_t slot, int64_t *count) {
    if (w->state[column] == SCANNED || (w->state[column] == REACHED && !(cost < w->least[column])))
        return;
    if (w->state[column] == UNTOUCHED)
        w->touched[(*count)++] = column;
    w->state[column] = REACHED, w->least[column] = cost, w->way[column] = slot;
}

static void reach_all(struct naming *w, int64_t slot, double before, int64_t *count) {
    for (int64_t c = w->begins[slot]; c < w->begins[slot + 1]; c++) {
        int64_t column = w->candidate[c].root;
        reach(w, column, before - w->candidate[c].score - w->potential[column], slot, count);
    }
    reach(w, w->roots + slot, before - FORBIDDEN - w->potential[w->roots + slot], slot, count);
}

static double cost_of(const struct naming *w, int64_t slot, int64_t column) {
    for (int64_t c = w->begins[slot]; c < w->begins[slot + 1]; c++)
        if (w->candidate[c].root == column)
            return -w->candidate[c].score;
    return -FORBIDDEN;
}

/* The assignment of roots to slots with the largest total score, by shortest augmenting paths in the sparse matrix of candidates
   (Jonker & Volgenant 1987); given (slots,) is the column of each slot, match (columns,) the slot of each, or -1. */
static void assign(struct naming *w) {
    int64_t columns = w->roots + w->slots;
    for (int64_t j = 0; j < columns; j++)
        w->potential[j] = 0.0, w->match[j] = -1, w->state[j] = UNTOUCHED;
    for (int64_t i = 0; i < w->slots && !gearstab_stopped(); i++) {
        int64_t count = 0, end = -1, slot = i;
        double shortest = 0.0;
        w->given[i] = -1;
        for (reach_all(w, i, 0.0, &count);; reach_all(w, slot, shortest - cost_of(w, slot, end) + w->potential[end], &count)) {
            end = -1;
            for (int64_t k = 0; k < count; k++)
                if (w->state[w->touched[k]] == REACHED && (end < 0 || w->least[w->touched[k]] < w->least[end]))
                    end = w->touched[k];
            shortest = w->least[end];
            slot = w->match[end];
            if (slot < 0)
                break;
            w->state[end] = SCANNED;
        }
        for (int64_t k = 0; k < count; k++) {
            int64_t j = w->touched[k];
            w->potential[j] += w->state[j] == SCANNED ? w->least[j] - shortest : 0.0;
            w->state[j] = UNTOUCHED;
        }
        do { /* each slot on the way takes the column that it was reached by, and leaves its own to the one before */
            slot = w->way[end];
            int64_t left = w->given[slot];
            w->match[end] = slot, w->given[slot] = end;
            end = left;
        } while (slot != i);
    }
}

#endif
