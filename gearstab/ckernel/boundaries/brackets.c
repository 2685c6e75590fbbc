/* What lies between two points of a row: the counts of krein.py, read gap by gap.

   For each angle theta, N(theta) counts how often a multiplier has passed exp(i theta) since the period was zero: upwards if
   its Krein sign is positive, downwards if negative. It never falls. On the circle between 1 and -1 it is

       N(theta) = N(0) - (positive letters below theta) + (negative letters below theta),

   and c(theta) = N(theta; right) - N(theta; left) is the number of passages in between. A collision of two neighbours,
   the lower one positive at angle a and the upper one negative at b, moves the one from a up and the other from b down until they
   meet: **the first collision after the left point needs c >= 1 in all of (a, b)**, in (0, b) for a negative first letter
   that meets its image at 1, in (a, pi) for a positive last one. And backwards in time from the right point likewise, with the
   signs exchanged. Hence

   * two stable points with a theta in every such gap where c = 0 have nothing but stable points between them. This is a proof,
     for any number of coordinates: no pair can overtake a third multiplier unseen, because there is no first collision;
   * a single gap with c >= 1 tells which pair meets first, so that one edge, or one tongue, lies between two points;
   * at +-1 the real pairs are counted by the parity of N(0) and N(pi): an edge there is proved, and so is an interval without
     stable points.
   * A quadruple can be back on the circle only at an angle where c >= 1, apart from the passages of its own collision: there
     its two multipliers move on. Elsewhere nothing can return, and an unstable interval is one. That this angle stays
     near the angles seen at both points is all that is assumed; where a third multiplier passes just there, the bracket is doubtful. */

#include <math.h>

#include "search.h"

#define AROUND 0.25 /* part of the angles seen by which a quadruple may leave their range between two points */
#define ALIKE 1e-3  /* relative difference of F of identical pairs */
#define TWINS 0.5   /* the same of pairs that leave the circle almost together */
#define RISE 0.5    /* F of a quadruple that comes this near to 0 between two points, as part of the smaller end, may be back */

/* Least and largest N over an open range of angles; `with_one`: and at angle 0. */
static void range_of(const struct sample *s, double low, double high, int with_one, int64_t *least, int64_t *most) {
    int64_t n = s->index;
    int k = 0;
    if (!with_one)
        for (; k < s->letters && s->letter[k].angle <= low; k++)
            n -= s->letter[k].sign;
    *least = *most = n;
    for (; k < s->letters && s->letter[k].angle < high; k++) {
        n -= s->letter[k].sign;
        *least = n < *least ? n : *least;
        *most = n > *most ? n : *most;
    }
}

/* The ends of gap k. */
static double lower_end(const struct sample *s, int k) { return k == 0 ? 0.0 : s->letter[k - 1].angle; }
static double upper_end(const struct sample *s, int k) { return k == s->letters ? PI : s->letter[k].angle; }

/* Whether the neighbours of gap k approach each other as time runs forwards (+1) or backwards (-1). */
static int closing(const struct sample *s, int k, int direction) {
    return (k == 0 || s->letter[k - 1].sign == direction) && (k == s->letters || s->letter[k].sign == -direction);
}

/* The gaps of `from` in which the first collision towards `to` may be; how many, and one of them. */
static int first_collisions(const struct sample *from, const struct sample *to, int direction, int *gap) {
    int count = 0;
    int64_t n = from->index;
    if (from->letters == 0)
        return 0;
    for (int k = 0; k <= from->letters; k++) {
        if (k > 0)
            n -= from->letter[k - 1].sign;
        if (!closing(from, k, direction))
            continue;
        int64_t least, most;
        range_of(to, lower_end(from, k), upper_end(from, k), k == 0, &least, &most);
        if (direction > 0 ? least - n >= 1 : n - most >= 1) {
            *gap = k;
            count++;
        }
    }
    return count;
}

static enum place place_of(const struct sample *s, int gap) {
    return gap == 0 ? AT_ONE : gap == s->letters ? AT_MINUS_ONE : ELSEWHERE;
}

struct range {
    double low, high;
};

static int within(double angle, struct range range) { return angle >= range.low && angle < range.high; }

/* Whether, apart from one passage in each of two ranges, c >= 1 somewhere between two angles. */
static int swept(const struct sample *left, const struct sample *right, struct range where, struct range first,
                 struct range second) {
    double edge[4] = {first.low, first.high, second.low, second.high}, angle = where.low;
    int i = 0, j = 0;
    int64_t c = right->index - left->index;
    while (angle < where.high) {
        for (; i < left->letters && left->letter[i].angle <= angle; i++)
            c += left->letter[i].sign;
        for (; j < right->letters && right->letter[j].angle <= angle; j++)
            c -= right->letter[j].sign;
        if (c - within(angle, first) - within(angle, second) >= 1)
            return 1;
        double next = where.high;
        next = i < left->letters && left->letter[i].angle < next ? left->letter[i].angle : next;
        next = j < right->letters && right->letter[j].angle < next ? right->letter[j].angle : next;
        for (int k = 0; k < 4; k++)
            next = edge[k] > angle && edge[k] < next ? edge[k] : next;
        angle = next;
    }
    return 0;
}

static const struct range NOWHERE = {9.0, 9.0};

static struct range gap_range(const struct sample *s, int gap) {
    return (struct range){lower_end(s, gap), upper_end(s, gap)};
}

static struct range hull(struct range a, struct range b) {
    struct range h = {a.low < b.low ? a.low : b.low, a.high > b.high ? a.high : b.high};
    double margin = AROUND * (h.high - h.low);
    return (struct range){h.low - margin, h.high + margin};
}

/* The pair off the circle at a place whose angle is nearest to a range; -1 if there is none. */
static int nearest_off(const struct sample *s, enum place place, struct range range) {
    int best = -1;
    double least = INFINITY, middle = 0.5 * (range.low + range.high);
    for (int m = 0; m < s->offs; m++) {
        double distance = fabs(s->off[m].angle - middle);
        if (s->off[m].place == place && distance < least)
            least = distance, best = m;
    }
    return best;
}

static struct range off_range(const struct off *off) { return (struct range){off->angle, off->angle}; }

static int count_off(const struct sample *s, enum place place) {
    int count = 0;
    for (int m = 0; m < s->offs; m++)
        count += s->off[m].place == place;
    return count;
}

/* The pair at another point that a quadruple, or one of two real pairs, has become: the nearest in angle of its like; -1 if
   there is none. */
static int successor(const struct off *off, const struct sample *s) {
    int best = -1;
    double least = INFINITY;
    for (int m = 0; m < s->offs; m++) {
        double distance = fabs(s->off[m].angle - off->angle);
        if (distance < least && (s->off[m].place == ELSEWHERE || count_off(s, s->off[m].place) % 2 == 0))
            least = distance, best = m;
    }
    return best;
}

/* Whether a pair that is off the circle at both points stays so; if not, the quadruples that a closer look would have to be
   taken at. */
static int stays_off(const struct sample *left, const struct sample *right, int smooth, struct finding *found) {
    double deepest = 0.0;
    if (count_off(left, AT_ONE) % 2 == 1 && left->index == right->index)
        return 1;
    if (count_off(left, AT_MINUS_ONE) % 2 == 1 && left->index + signs_below(left, PI) == right->index + signs_below(right, PI))
        return 1;
    for (int m = 0; m < left->offs; m++) {
        const struct off *a = left->off + m;
        if (a->place != ELSEWHERE && count_off(left, a->place) % 2 == 1)
            continue;
        int k = successor(a, right);
        if (k < 0)
            continue;
        const struct off *b = right->off + k;
        if (!swept(left, right, hull(off_range(a), off_range(b)), NOWHERE, NOWHERE))
            return 1;
        if (a->place != ELSEWHERE || b->place != ELSEWHERE)
            continue;
        struct finding own = {OPEN, m, k, 0};
        double place;
        if (smooth) {
            struct cubic c = course(left, right, &own);
            if (!(highest(&c, &place) > RISE * (a->square > b->square ? a->square : b->square)))
                return 1;
        }
        if (a->square + b->square < deepest) {
            deepest = a->square + b->square;
            *found = own;
        }
    }
    return 0;
}

/* How often a multiplier passes the place in between, for the real axis. */
static int64_t passages(const struct sample *left, const struct sample *right, enum place place) {
    double angle = place == AT_ONE ? -1.0 : PI;
    return right->index + signs_below(right, angle) - left->index - signs_below(left, angle);
}

/* Whether the letters of a stable point are those of another without the two around a gap; n letters. */
static int same_but_for(const struct sample *in, int gap, const struct sample *out) {
    if (out->letters != in->letters - 2)
        return 0;
    for (int k = 0; k < out->letters; k++)
        if (out->letter[k].sign != in->letter[k < gap - 1 ? k : k + 2].sign)
            return 0;
    return 1;
}

/* Whether all pairs off the circle are as one, as in systems of identical parts, but for a part of F. */
static int all_alike(const struct sample *s, double but_for) {
    for (int m = 1; m < s->offs; m++)
        if (s->off[m].place != s->off[0].place || fabs(s->off[m].square - s->off[0].square) > but_for * fabs(s->off[0].square))
            return 0;
    return 1;
}

/* The pair off the circle that is back on it last, at its speed, as time runs forwards (+1) or backwards (-1). */
static int last_back(const struct sample *s, int direction) {
    int best = 0;
    for (int m = 1; m < s->offs; m++) {
        const struct off *own = s->off + m, *other = s->off + best;
        if (own->square * other->slope * direction < other->square * own->slope * direction)
            best = m;
    }
    return best;
}

/* Whether one end of an unstable interval is all that lies between a stable point and one off the circle. */
static int single_edge(const struct sample *in, int gap, const struct sample *out, int64_t passed) {
    enum place place = place_of(in, gap);
    if (place != ELSEWHERE)
        return passed == 1 && count_off(out, place) % 2 == 1;
    return out->offs == 1 ? same_but_for(in, gap, out) : all_alike(out, ALIKE);
}

/* What lies between two points that are known and whose counts are. */
struct finding compare(const struct sample *left, const struct sample *right, int smooth) {
    struct finding found = {OPEN, -1, -1, 0};
    if (!left->stable && !right->stable) {
        found.kind = stays_off(left, right, smooth, &found) ? NOTHING : OPEN;
        return found;
    }
    int forwards = first_collisions(left, right, 1, &found.left);
    int backwards = first_collisions(right, left, -1, &found.right);
    if (left->stable && right->stable) {
        if (forwards == 0 && backwards == 0)
            found.kind = NOTHING;
        else if (forwards == 1 && backwards == 1) {
            struct range a = gap_range(left, found.left), b = gap_range(right, found.right);
            enum place place = place_of(left, found.left);
            if (place == place_of(right, found.right) && (place == ELSEWHERE || passages(left, right, place) == 2)) {
                found.kind = NARROW;
                found.doubtful = place == ELSEWHERE && swept(left, right, hull(a, b), a, b);
            }
        }
        return found;
    }
    const struct sample *out = left->stable ? right : left, *in = left->stable ? left : right;
    int gap = left->stable ? found.left : found.right, *of_out = left->stable ? &found.right : &found.left;
    *of_out = -1;
    if (left->stable ? forwards == 1 && backwards == 0 : forwards == 0 && backwards == 1) {
        struct range own = gap_range(in, gap);
        enum place place = place_of(in, gap);
        int off = nearest_off(out, place, own);
        if (off >= 0 && single_edge(in, gap, out, passages(left, right, place))) {
            found.kind = left->stable ? ENTRANCE : EXIT;
            *of_out = off;
            /* Pairs that are almost alike leave the circle one after the other: one of them, from inside, does not tell the edge. */
            found.doubtful = place == ELSEWHERE &&
                             (out->offs > 1 || swept(left, right, hull(own, off_range(out->off + off)), own, NOWHERE));
        } else if (off >= 0 && out->offs > 1 && place == ELSEWHERE && all_alike(out, TWINS))
            *of_out = last_back(out, left->stable ? -1 : 1); /* a hint for where to look */
    }
    return found;
}
