/* Where to look next between two points of a row.

   The edge function of two multipliers that meet is F = (theta_i - theta_j)^2, the square of the distance of the one from the
   mirror image of the other: F = d^2 on the circle, d the gap between two letters (twice the distance to 1 or -1 of one that
   meets its own image), and F = -4 g^2 off it with growth g. It is analytic across the edge, nearly a parabola
   gamma^2 x^2 - 4 b^2 over the whole tongue, so that a cubic through both ends of a bracket, with slopes, tells the edges of
   a tongue from far away. */

#include <math.h>
#include <stddef.h>

#include "search.h"

#define CLOSED 0.4 /* a tongue predicted to be narrower than this part of the floor is enclosed between stable points */
#define BESIDE 0.45
#define SAME_DEPTH 0.005 /* relative errors of F, and of its slope times the width, that confirm a cubic */
#define SAME_SLOPE 0.02
#define CURVED 0.25   /* of a slope: what the curvature may change */
#define UNSURE 0.5    /* of a slope: where that much is in doubt it tells no edge */
#define NARROW_BRACKET 0.05 /* step to the second point over the width of a bracket so narrow that its cubic is exact */
#define AT_ONCE 0.1 /* of the floor: events that are predicted this near to each other are taken for one */
#define ASIDE 0.1 /* of the distance of an edge from the nearer end of its bracket */
#define COUPLED 0x1p-9 /* rho nearer to each other than this are those of like parts, which are not coupled */
#define INSIDE 0.05 /* of the bracket: no proposal for an open one is nearer to its ends */

static struct cubic through(double f, double s, double g, double t) {
    return (struct cubic){f, s, 3.0 * (g - f) - 2.0 * s - t, s + t - 2.0 * (g - f)};
}

/* The same with slopes s and t of the chords from 0 to h and from 1 to 1 + k. */
static struct cubic through_chords(double f, double s, double g, double t, double h, double k) {
    double low = (g - f - s) / (1.0 - h), high = (t - (g - f)) / (1.0 + k), q = (high - low) / (1.0 + k - h);
    double p = low - q * (1.0 + h);
    return (struct cubic){f, g - f - p - q, p, q};
}

static double value(const struct cubic *c, double x) { return c->f + x * (c->s + x * (c->p + x * c->q)); }
static double slope(const struct cubic *c, double x) { return c->s + x * (2.0 * c->p + x * 3.0 * c->q); }

/* The highest local maximum between 0 and 1, and where; minus infinity if there is none. */
double highest(const struct cubic *c, double *place) {
    double d = c->p * c->p - 3.0 * c->s * c->q, top = -INFINITY;
    for (int side = -1; d >= 0.0 && side <= 1; side += 2) {
        double x = c->q != 0.0 ? (-c->p + side * sqrt(d)) / (3.0 * c->q) : c->p != 0.0 ? -0.5 * c->s / c->p : -1.0;
        if (x > 0.0 && x < 1.0 && value(c, x) > top) {
            top = value(c, x);
            *place = x;
        }
    }
    return top;
}

/* The zero between 0 and 1 of a cubic that changes its sign there: Newton, halving where that leaves the bracket. */
static double zero(const struct cubic *c) {
    double low = 0.0, high = 1.0, end = c->f + c->s + c->p + c->q, x = c->f / (c->f - end);
    for (int k = 0; k < 60; k++) {
        double y = value(c, x);
        if (y == 0.0)
            break;
        if ((y > 0.0) == (c->f > 0.0))
            low = x;
        else
            high = x;
        double next = x - y / slope(c, x);
        if (!(next > low && next < high))
            next = 0.5 * (low + high);
        if (fabs(next - x) < 1e-15)
            break;
        x = next;
    }
    return x;
}

/* The slope at an end from that of the chord to its second point and half the curvature: in narrow tongues the step is a good part
   of the way to the other edge. Where a wide bracket says more than that, it knows nothing of the curvature. */
static double at_the_end(double chord, double ahead) { return fabs(ahead) < CURVED * fabs(chord) ? chord - ahead : chord; }

/* The ends of a bracket as the pair sees them that meets in it: F and its slope times the width. */
struct cubic course(const struct sample *left, const struct sample *right, const struct finding *found) {
    double width = right->cycle - left->cycle, f, s, g, t;
    if (left->stable)
        f = left->gap[found->left].square, s = left->gap[found->left].slope;
    else
        f = left->off[found->left].square, s = left->off[found->left].slope;
    if (right->stable)
        g = right->gap[found->right].square, t = right->gap[found->right].slope;
    else
        g = right->off[found->right].square, t = right->off[found->right].slope;
    double h = left->step / width, k = right->step / width;
    if (h > NARROW_BRACKET && fabs(1.0 - h) > NARROW_BRACKET)
        return through_chords(f, s * width, g, t * width, h, k);
    struct cubic c = through(f, s * width, g, t * width);
    double first = c.p * h, last = (c.p + 3.0 * c.q) * k;
    return through(f, at_the_end(s * width, first), g, at_the_end(t * width, last));
}

/* In how much of the period others may come to where the pair is that meets, with this slope of F: the one around gap `own` of a
   stable point, or off the circle as number `own` of an unstable one. A third multiplier comes at its speed, or the pair, whose
   distance is the root of F, reaches it or, elsewhere than at +-1, its mirror image. */
static double clearance(const struct sample *s, int own, double slope) {
    double low = s->stable ? own ? s->letter[own - 1].angle : 0.0 : s->off[own].angle, least = INFINITY, fastest = 0.0;
    double high = s->stable ? own < s->letters ? s->letter[own].angle : PI : low;
    for (int k = 0; k < s->letters; k++)
        if (!s->stable || (k != own - 1 && k != own)) {
            double angle = s->letter[k].angle, distance = angle < low ? low - angle : angle - high;
            least = distance < least ? distance : least;
            fastest = s->letter[k].speed > fastest ? s->letter[k].speed : fastest;
        }
    for (int m = 0; m < s->offs; m++)
        if (m != own && fabs(s->off[m].angle - low) < least)
            least = fabs(s->off[m].angle - low);
    double coming = fastest > 0.0 ? 0.5 * least / fastest : INFINITY;
    if (low > 0.0 && high < PI)
        least = fmin(least, fmin(low, PI - high));
    return fmin(coming, least * least / slope);
}

/* The edge in an ENTRANCE or EXIT, the zero of the cubic, and how far it may be from where the tangent at the nearer end has its
   own: by the square and cubic terms, even where they cancel each other, by what a third multiplier near that end bends, of which
   the cubic knows nothing, and as the tangent is a chord of numbers that are rounded. Once that is little, the edge is wrong by
   less. */
double edge_between(const struct sample *left, const struct sample *right, const struct finding *found, double *moved) {
    struct cubic c = course(left, right, found);
    double width = right->cycle - left->cycle, g = c.f + c.s + c.p + c.q, t = c.s + 2.0 * c.p + 3.0 * c.q;
    double from_left = -c.f / c.s, from_right = g / t; /* both positive, and at most 1, where they mean something */
    from_left = from_left >= 0.0 && from_left < 1.0 ? from_left : 1.0;
    from_right = from_right >= 0.0 && from_right < 1.0 ? from_right : 1.0;
    int near_left = from_left < from_right;
    double x = near_left ? from_left : from_right, slope = fabs(near_left ? c.s : t);
    double bend = (fabs(near_left ? c.p : c.p + 3.0 * c.q) + fabs(c.q)) / slope;
    const struct sample *end = near_left ? left : right;
    bend += width / clearance(end, near_left ? found->left : found->right, slope / width);
    /* What all this may change the slope by, over the slope: the edge is nearer or farther by as much. */
    double doubt = bend * (x + end->step / width) + 4.0 * end->noise * width / (end->step * slope);
    *moved = doubt < UNSURE ? width * x * doubt / (1.0 - doubt) : INFINITY;
    return left->cycle + width * zero(&c);
}

/* The pair off the circle that will be back on it, or was on it, within the least time; NULL if there is none. */
static const struct off *nearest_edge(const struct sample *out) {
    const struct off *best = NULL;
    for (int m = 0; m < out->offs; m++) {
        const struct off *own = out->off + m;
        if (!best || fabs(own->square * best->slope) < fabs(best->square * own->slope))
            best = own;
    }
    return best;
}

/* Whether the pair that is off the circle was taken for two equal rho, see settle_equals of spectra.h. */
static int settled(const struct sample *out, const struct off *off, const struct gap *gap) {
    int equal = 0;
    for (int m = 0; m < out->offs; m++)
        equal += off->place != ELSEWHERE && out->off[m].place == off->place && out->off[m].square == off->square;
    return equal > 1 || (gap && gap->square == 0.0);
}

/* The distance of rho from those of other pairs at a stable point; `own` letters, the nearest to the angle, are its own. */
static double apart_from_others(const struct sample *in, double angle, int own) {
    double least[3] = {INFINITY, INFINITY, INFINITY};
    for (int k = 0; k < in->letters; k++) {
        double distance = 2.0 * fabs(cos(in->letter[k].angle) - cos(angle));
        for (int i = 0; i < 3; i++) {
            double nearer = fmin(distance, least[i]);
            distance = fmax(distance, least[i]), least[i] = nearer;
        }
    }
    return least[own];
}

/* How far rounding errors may have moved an edge, in cycles. All rho are wrong by `noise`, and by three times that where
   angle_of puts them on the rim; near an edge at 1 or -1 F = 4 (2 -+ rho), so that this share of it does not fall with F. Two
   rho of pairs that are coupled are eigenvalues of a 2 x 2 block with entries ~ 2 sin(angle) sqrt(-F) inside the tongue, which
   is wrong by noise, and beside others in a distance d by noise/d: that moves the edge by noise/sin(angle) over the speed at which
   the two approach, at least a turn in a cycle; and the block says nothing at all of an imaginary part below noise,
   F = -(noise/sin(angle))^2, or of one that was taken for rounding errors. Where the angle is so small that this would be more, rho
   tells by being beyond 2, as of a single pair. No error of F moves an edge by more than its root over that speed, F being a
   parabola. */
double blurred(const struct sample *left, const struct sample *right, const struct finding *found) {
    const struct sample *in = left->stable ? left : right, *out = left->stable ? right : left;
    int known = found->left >= 0 && found->right >= 0;
    double noise = in->noise, turn = left->cycle / (2.0 * PI);
    const struct off *off = known ? out->off + (left->stable ? found->right : found->left) : nearest_edge(out);
    if (!off)
        return noise * turn;
    const struct gap *gap = known ? in->gap + (left->stable ? found->left : found->right)
                            : off->place == ELSEWHERE ? NULL : in->gap + (off->place == AT_ONE ? 0 : in->letters);
    int equal = settled(out, off, gap);
    double slope = fabs(off->slope), unseen = noise, moved = noise * turn;
    double apart = apart_from_others(in, off->angle, off->place == ELSEWHERE || equal ? 2 : 1);
    if (in->letters > 3) {
        moved /= fmin(fmax(apart, COUPLED), 1.0);
        if (equal)
            unseen = fmax(noise, fmax(in->taken, out->taken));
    }
    /* At 1 or -1 of the nearest angle at which another pair is. */
    double sine = off->place == ELSEWHERE ? sin(off->angle) : apart < 2.0 ? sqrt(apart - 0.25 * apart * apart) : 1.0;
    double square = sine * sine;
    /* The nearer end, by F over its slope. */
    if (gap && fabs(gap->square) * slope < fabs(off->square * gap->slope))
        slope = fabs(gap->slope);
    double most = 12.0 * (noise + square), least = off->place == ELSEWHERE ? unseen * unseen / square : 12.0 * unseen;
    return moved + fmin(fmin(most / slope, sqrt(most) * turn), moved / sine + fmin(least / slope, sqrt(least) * turn));
}

/* A bracket with one tongue between stable points: its middle, or beside it where it is likely to be closed. */
static double into_tongue(const struct sample *left, const struct sample *right, const struct finding *found, double floor) {
    struct cubic c = course(left, right, found);
    double x = left->cycle, width = right->cycle - x, end = c.s + 2.0 * c.p + 3.0 * c.q;
    if (!(c.s < 0.0 && end > 0.0))
        return NAN;
    /* The lowest point of the cubic. */
    double d = sqrt(c.p * c.p - 3.0 * c.s * c.q), place = c.p > 0.0 ? -c.s / (c.p + d) : (d - c.p) / (3.0 * c.q);
    double lowest = value(&c, place), curvature = c.p + 3.0 * c.q * place;
    double at = x + width * place, least = floor * x;
    if (!(place > 0.0 && place < 1.0))
        return NAN;
    /* F = curvature (x - place)^2 + lowest, of half width sqrt(-lowest/curvature) */
    if (4.0 * width * width * -lowest > CLOSED * CLOSED * least * least * curvature)
        return at;
    double probe = at - x > (BESIDE + 0.01) * least ? at - BESIDE * least : at + BESIDE * least;
    return probe > x && probe < right->cycle ? probe : NAN;
}

/* When the next event after a point (direction 1), or the last before it (-1), would be at present speeds; in cycles. */
static double until_event(const struct sample *s, int direction) {
    double least = INFINITY;
    if (!s->stable) {
        for (int m = 0; m < s->offs; m++) {
            double rise = direction * s->off[m].slope, time = rise > 0.0 ? -s->off[m].square / rise : INFINITY;
            least = time < least ? time : least;
        }
        return least;
    }
    for (int k = 0; k <= s->letters; k++) {
        double fall = -direction * s->gap[k].slope, time = fall > 0.0 ? 2.0 * s->gap[k].square / fall : INFINITY;
        least = time < least ? time : least;
    }
    return least;
}

/* Between what the left end expects as its next event and the right end as its last. Where both mean the same place, as for
   systems of identical parts, whose multipliers meet several at once: beside it, as in into_tongue. */
static double among_several(const struct sample *left, const struct sample *right, double floor) {
    double width = right->cycle - left->cycle, least = floor * left->cycle;
    double a = until_event(left, 1), b = width - until_event(right, -1);
    if (!(a > 0.0 && a < width && b > 0.0 && b < width))
        return NAN;
    double middle = 0.5 * (a + b);
    if (fabs(a - b) < AT_ONCE * least)
        return left->cycle + middle + (middle > (BESIDE + 0.01) * least ? -BESIDE : BESIDE) * least;
    if (a > b)
        return NAN;
    middle = middle < INSIDE * width ? INSIDE * width : middle > (1.0 - INSIDE) * width ? (1.0 - INSIDE) * width : middle;
    return left->cycle + middle;
}

/* How fast the multipliers close in at a stable point that have left the circle elsewhere at an angle. */
static double closing_speed(const struct sample *s, const struct off *off) {
    double nearest[2] = {INFINITY, INFINITY}, speed[2] = {0.0, 0.0};
    for (int k = 0; k < s->letters; k++) {
        const struct letter *l = s->letter + k;
        double distance = fabs(l->angle - off->angle);
        int side = l->sign > 0;
        if (distance < nearest[side])
            nearest[side] = distance, speed[side] = l->speed;
    }
    if (off->place != ELSEWHERE)
        return 2.0 * (nearest[0] < nearest[1] ? speed[0] : speed[1]);
    return speed[0] + speed[1];
}

/* From an unstable point in a tongue that is likely to be narrower than the floor: beside it, towards the stable one. */
static double out_of_tongue(const struct sample *left, const struct sample *right, const struct finding *found, double floor) {
    const struct sample *in = left->stable ? left : right, *out = left->stable ? right : left;
    double width = right->cycle - left->cycle, least = floor * left->cycle;
    if (!out->known)
        return NAN;
    for (int m = 0; m < out->offs; m++) {
        /* F = gamma^2 x^2 - 4 b^2 and its slope tell the width 4 |b|/gamma. */
        double gamma = closing_speed(in, out->off + m);
        if (found->kind != OPEN) {
            struct cubic c = course(left, right, found);
            gamma = sqrt(fabs(2.0 * c.p + 3.0 * c.q) / 2.0) / width;
        }
        double slope = 0.5 * out->off[m].slope / gamma;
        if (!(2.0 * sqrt(slope * slope - out->off[m].square) < CLOSED * least * gamma))
            return NAN;
    }
    double probe = out->cycle + (out == left ? BESIDE : -BESIDE) * least;
    return probe > left->cycle && probe < right->cycle ? probe : NAN;
}

/* Between unstable points: where F comes nearest to 0, if it does, or in the middle. */
static double through_gap(const struct sample *left, const struct sample *right, const struct finding *found) {
    if (found->left < 0)
        return NAN;
    double place;
    struct cubic c = course(left, right, found);
    double top = highest(&c, &place), end = c.f + c.s + c.p + c.q;
    if (!(top > 0.5 * (c.f > end ? c.f : end) && place > INSIDE && place < 1.0 - INSIDE))
        place = 0.5;
    return left->cycle + place * (right->cycle - left->cycle);
}

/* Whether the cubic through both ends, unstable, has foretold what was found between them. Two tongues with a gap between
   them do not look like one from inside: neither the depth nor the slope fits. */
int as_foreseen(const struct sample *left, const struct sample *right, const struct finding *found, const struct sample *between) {
    if (found->left < 0 || left->stable || right->stable || between->stable)
        return 0;
    struct cubic c = course(left, right, found);
    double width = right->cycle - left->cycle, x = (between->cycle - left->cycle) / width;
    double angle = left->off[found->left].angle * (1.0 - x) + right->off[found->right].angle * x, least = INFINITY;
    const struct off *own = 0;
    for (int k = 0; k < between->offs; k++)
        if (between->off[k].place == ELSEWHERE && fabs(between->off[k].angle - angle) < least) {
            own = between->off + k;
            least = fabs(own->angle - angle);
        }
    return own && fabs(own->square - value(&c, x)) < SAME_DEPTH * fabs(own->square) &&
           fabs(own->slope * width - slope(&c, x)) < SAME_SLOPE * fabs(own->square);
}

/* Between a stable point and one with several pairs off the circle: beside the edge of the pair that is off for longest, towards the
   end that is farther, so that the edge is enclosed soon. */
static double beside_edge(const struct sample *left, const struct sample *right, const struct finding *found, double tolerance) {
    struct cubic c = course(left, right, found);
    double width = right->cycle - left->cycle, x = zero(&c), least = 0.4 * tolerance * left->cycle / width;
    return left->cycle + width * (x < 0.5 ? x + ASIDE * x + least : x - ASIDE * (1.0 - x) - least);
}

/* The next point of a bracket whose ends are known; NaN if nothing better than its middle is. */
double propose(const struct sample *left, const struct sample *right, const struct finding *found, double tolerance,
               double floor) {
    double width = right->cycle - left->cycle, least = 0.4 * tolerance * left->cycle;
    if (found->kind == NARROW)
        return into_tongue(left, right, found, floor);
    if (left->stable != right->stable) {
        double beside = out_of_tongue(left, right, found, floor);
        if (!isnan(beside))
            return beside;
    }
    if (found->kind == OPEN && left->stable != right->stable && found->left >= 0 && found->right >= 0)
        return beside_edge(left, right, found, tolerance);
    if (found->kind == OPEN)
        return left->stable || right->stable ? among_several(left, right, floor) : through_gap(left, right, found);
    struct cubic c = course(left, right, found);
    double at = left->cycle + width * zero(&c);
    at = at < left->cycle + least ? left->cycle + least : at;
    return at > right->cycle - least ? right->cycle - least : at;
}
