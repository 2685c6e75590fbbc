/* What lies between two stable points that many collisions are between, without all multipliers at points in between.

   Where multipliers hardly interact their phases go on as the two points foresee, and so it is known to a part of the floor where
   they collide. Collisions that fall together are enclosed in less than a floor; what is left are stretches between them, in
   which nothing is foreseen to happen. **That is proved** by Morse indices at both ends of each stretch, at a few angles, the
   lines: 1, -1, and one between every two neighbours of different sign. With N as in brackets.c:

   * of n pairs of multipliers as many are on the circle between two lines as N differs by there, at least. If these
     differences add up to n, all are, and neighbours of different sign have a line between them: the point is stable;
   * if N is the same at both ends of a stretch on every line, it is the same all along it, as it never falls. So no multiplier has
     passed a line, and none of those that could collide first has met the other: all of the stretch is stable.

   Of N only N - N_0 is known, see inertia.h, with N_0 the same for all angles: so one line must be where N is known to be the
   same at both points, the anchor. */

#include <math.h>
#include <stdlib.h>

#include "enclose.h"

#define WHOLE 0.9     /* of the floor: the longest interval that collisions are enclosed in */
#define TOGETHER 0.4  /* of the floor: collisions not farther apart than this are enclosed together */
#define CORRECTIONS 3 /* of the time of a collision, from speeds that hardly change */

struct enclosing *enclosing_new(int64_t n, double floor) {
    struct enclosing *e = malloc(sizeof *e);
    struct passer *passer = malloc(2 * (size_t)n * sizeof *passer);
    struct letter *letter = malloc(2 * (size_t)n * sizeof *letter);
    if (!e || !passer || !letter) {
        free(e), free(passer), free(letter);
        return NULL;
    }
    e->n = n, e->floor = floor, e->passer = passer, e->letter = letter;
    return e;
}

void enclosing_free(struct enclosing *e) {
    if (e)
        free(e->passer), free(e->letter);
    free(e);
}

static double turns_of(double phase) { return floor(phase / (2.0 * PI)); }

static int by_value(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* ---- what is foreseen */

static void sort_phases(struct passer *all, int n) {
    for (int i = 1; i < n; i++) {
        struct passer own = all[i];
        int j = i;
        for (; j > 0 && all[j - 1].place > own.place; j--)
            all[j] = all[j - 1];
        all[j] = own;
    }
}

/* The n multipliers of positive sign, where they are after `ahead` at their speeds; moved: by how many turns they passed 1. */
static void foreseen(const struct sample *s, double ahead, struct passer *all) {
    for (int k = 0; k < s->letters; k++) {
        const struct letter *l = s->letter + k;
        double phase = l->sign > 0 ? l->angle : 2.0 * PI - l->angle, turns = turns_of(phase + l->speed * ahead);
        all[k] = (struct passer){.phase = phase, .first = l->speed, .moved = turns,
                                 .place = phase + l->speed * ahead - 2.0 * PI * turns};
    }
    sort_phases(all, s->letters);
}

/* Find each multiplier of the left point at the right one, in the order of the places that their speeds foresee; how many turns
   all of them have made is known. Returns 0 where nothing fits. */
static int follow(struct enclosing *e) {
    struct passer *all = e->passer, *then = all + e->n;
    int n = (int)e->n;
    double width = e->right->cycle - e->left->cycle;
    int64_t turns = (e->right->index - e->left->index) / 2;
    foreseen(e->left, width, all);
    foreseen(e->right, 0.0, then);
    for (int i = 0; i < n; i++)
        turns -= (int64_t)all[i].moved;
    if (turns <= -n || turns >= n)
        return 0;
    for (int i = 0; i < n; i++) {
        int64_t k = i + turns, round = k < 0 ? -1 : k >= n;
        const struct passer *found = then + k - round * n;
        all[i].moved = 2.0 * PI * (all[i].moved + (double)round) + found->phase - all[i].phase;
        all[i].first *= width, all[i].last = found->first * width;
        if (!(all[i].moved > 0.0))
            return 0;
    }
    return 1;
}

/* The phase of a multiplier when a part of the bracket has passed: a cubic. */
static double phase_at(const struct passer *p, double x) {
    double y = 1.0 - x;
    return p->phase + x * (p->moved * x * (1.0 + 2.0 * y) + y * (p->first * y - p->last * x));
}

/* The parts of the bracket after which two multipliers, or one and its image, meet. */
static int meetings_of(struct enclosing *e, const struct passer *p, const struct passer *q) {
    double start = p->phase + q->phase, moved = p->moved + q->moved, turn = 2.0 * PI;
    for (double next = turn * (turns_of(start) + 1.0); next <= start + moved; next += turn) {
        double x = (next - start) / moved;
        for (int k = 0; k < CORRECTIONS; k++)
            x -= (phase_at(p, x) + phase_at(q, x) - next) / moved;
        if (!(x > 0.0 && x < 1.0) || e->meetings == MOST_MEETINGS)
            return 0;
        e->meeting[e->meetings++] = x;
    }
    return 1;
}

/* An angle at which N is the same at both points, one that is a line anyway if possible; 0, or -1 if there is none. */
static int find_anchor(struct enclosing *e) {
    const struct sample *l = e->left, *r = e->right;
    int64_t c = r->index - l->index;
    double before = 0.0, widest = 0.0;
    for (int i = 0, j = 0; i <= l->letters || j <= r->letters;) {
        double a = i < l->letters ? l->letter[i].angle : PI, b = j < r->letters ? r->letter[j].angle : PI;
        double next = a < b ? a : b;
        int at_end = before == 0.0 || next == PI;
        if (c == 0 && (at_end ? PI : next - before) > widest) {
            widest = at_end ? PI : next - before;
            e->anchor = before == 0.0 ? 0.0 : next == PI ? PI : 0.5 * (before + next);
        }
        if (next == PI)
            break;
        c += a <= b ? l->letter[i++].sign : -r->letter[j++].sign;
        before = next;
    }
    return widest > 0.0 ? 0 : -1;
}

/* Cycles at which stretches begin and end, in turn, from the collisions that are foreseen. */
static void cut(struct enclosing *e) {
    double width = e->right->cycle - e->left->cycle, floor_width = e->floor * e->left->cycle, before = 0.0;
    qsort(e->meeting, (size_t)e->meetings, sizeof *e->meeting, by_value);
    e->stretches = 1;
    e->end[0] = e->left->cycle;
    for (int i = 0, j; i < e->meetings; i = j) {
        double first = e->meeting[i] * width;
        for (j = i + 1; j < e->meetings && e->meeting[j] * width - first <= TOGETHER * floor_width; j++)
            ;
        double last = e->meeting[j - 1] * width, after = j < e->meetings ? e->meeting[j] * width : width;
        double aside = 0.5 * (WHOLE * floor_width - (last - first));
        e->end[2 * e->stretches - 1] = e->left->cycle + first - fmin(aside, 0.5 * (first - before));
        e->end[2 * e->stretches] = e->left->cycle + last + fmin(aside, 0.5 * (after - last));
        e->stretches++;
        before = last;
    }
    e->end[2 * e->stretches - 1] = e->right->cycle;
}

/* Foresee what lies between two stable points whose counts are known. Returns 0 where that is not possible. */
int enclose(struct enclosing *e, const struct sample *left, const struct sample *right) {
    e->left = left, e->right = right, e->meetings = 0;
    if (left->letters != e->n || right->letters != e->n || !follow(e) || find_anchor(e) < 0)
        return 0;
    for (int64_t i = 0; i < e->n; i++)
        for (int64_t j = 0; j <= i; j++)
            if (!meetings_of(e, e->passer + i, e->passer + j))
                return 0;
    cut(e);
    return 1;
}

/* ---- lines */

/* Letters (n,) as they are foreseen at a cycle, by angle. */
static void letters_at(const struct enclosing *e, double cycle, struct letter *letter) {
    double x = (cycle - e->left->cycle) / (e->right->cycle - e->left->cycle);
    for (int i = 0; i < e->n; i++) {
        double phase = phase_at(e->passer + i, x), angle = phase - 2.0 * PI * turns_of(phase);
        struct letter own = {angle < PI ? angle : 2.0 * PI - angle, 0.0, angle < PI ? 1 : -1};
        int j = i;
        for (; j > 0 && letter[j - 1].angle > own.angle; j--)
            letter[j] = letter[j - 1];
        letter[j] = own;
    }
}

/* The lines of a stretch, ascending; how many, or 0 if multipliers are foreseen to pass each other in it. Neighbours that move
   apart have their line where they are first, those that approach each other where they are last. */
int lines_of(const struct enclosing *e, int stretch, double *line) {
    struct letter *first = e->letter, *last = first + e->n;
    int count = 0;
    letters_at(e, e->end[2 * stretch], first);
    letters_at(e, e->end[2 * stretch + 1], last);
    line[count++] = 0.0;
    for (int i = 0; i <= e->n; i++) {
        int change = i > 0 && i < e->n && first[i].sign != first[i - 1].sign;
        if (i < e->n && first[i].sign != last[i].sign)
            return 0;
        const struct letter *at = change && first[i].sign > 0 ? first : last;
        double next = i == e->n ? PI : change ? 0.5 * (at[i - 1].angle + at[i].angle) : -1.0;
        if (next < 0.0)
            continue;
        if (e->anchor > line[count - 1] && e->anchor < next)
            line[count++] = e->anchor;
        line[count++] = next;
    }
    return count;
}

/* ---- the proof */

/* How many multipliers are on the circle, at least, by numbers that differ from N on each line by one and the same. */
static int64_t seen(const int64_t *below, int lines) {
    int64_t sum = 0;
    for (int k = 1; k < lines; k++)
        sum += below[k] > below[k - 1] ? below[k] - below[k - 1] : below[k - 1] - below[k];
    return sum;
}

/* Such numbers of a point whose multipliers are known. */
void below_lines(const struct sample *s, const double *line, int lines, int64_t *below) {
    for (int k = 0; k < lines; k++)
        below[k] = s->letters + signs_below(s, line[k]);
}

/* Whether all between two points is stable, from such numbers (negative: not known) at both. */
int nothing_between(const int64_t *first, const int64_t *last, int lines, int64_t n) {
    for (int k = 0; k < lines; k++)
        if (first[k] < 0 || last[k] < 0 || first[k] - last[k] != first[0] - last[0])
            return 0;
    return lines > 0 && seen(first, lines) == n;
}
