/* From event to event: gearstab/response/backlash/follow.py, loop for loop the same. */

#ifndef GEARSTAB_FOLLOW_H
#define GEARSTAB_FOLLOW_H

/* A change of contact: where in the piece, -1 for none, of which mesh, and into what; slope: d/du of its deflection there. */
struct contact_change {
    double u, slope;
    int64_t mesh, following;
    int grazing; /* whether a touch is, before it or without it */
};

static struct contact_change next_change(const struct motion *motion, const double *powers, const int64_t *contact,
                                 int64_t switched) {
    struct contact_change first = {.u = -1.0};
    const int64_t n = motion->degree, size = motion->size;
    for (int64_t mesh = 0; mesh < motion->meshes; mesh++) {
        const double *gauge = motion->gauge + mesh * size, low = motion->limit[2 * mesh], high = motion->limit[2 * mesh + 1];
        const double width = high - low;
        if (!(width > 0))
            continue;
        double deflection[MOST_COEFFICIENTS], distance[MOST_COEFFICIENTS], found[MOST_COEFFICIENTS], sum = 0.0;
        for (int64_t k = 0; k <= n; k++) {
            double value = 0.0;
            for (int64_t i = 0; i < size; i++)
                value += gauge[i] * powers[k * size + i];
            deflection[k] = value, sum += fabs(value);
        }
        /* Apart it may meet the upper flank, then the lower one; in contact it may leave its own. */
        const int64_t apart = contact[mesh] == 0;
        for (int64_t i = 0; i <= apart; i++) {
            const int64_t upper = apart ? i == 0 : contact[mesh] > 0;
            const double limit = upper ? high : low, sign = (upper != 0) == (apart != 0) ? -1.0 : 1.0;
            for (int64_t k = 0; k <= n; k++)
                distance[k] = sign * deflection[k];
            distance[0] -= sign * limit;
            /* A mesh that has just come to this limit is on it; one that came to the other limit is a width away. */
            if (mesh == switched && fabs(distance[0]) <= 0.25 * width)
                distance[0] = 0.0;
            /* No power of u is larger than 1. */
            if (distance[0] - (sum - fabs(deflection[0])) >= motion->grazing * width)
                continue;
            bernstein(distance, n, found);
            if (least_of(found, n + 1) >= motion->grazing * width)
                continue;
            double u = first_below(distance, n, motion->penetration * width + motion->rounding * sum, motion->smallest);
            if (u < 0)
                first.grazing |= nearly_below(distance, n, motion->fine, motion->grazing * width);
            else if (first.u < 0 || u < first.u) {
                double bend;
                first.u = u, first.mesh = mesh, first.following = apart ? (upper ? 1 : -1) : 0;
                first.slope = derivatives(deflection, n, u, &bend);
            }
        }
    }
    return first;
}

/* Among those that are known the position of a contact, -1 if it is not. */
static int64_t known_contact(const struct motion *motion, const int64_t *contact) {
    const size_t length = (size_t)motion->meshes * sizeof *contact;
    for (int64_t k = 0; k < motion->known; k++)
        if (memcmp(motion->contact + k * motion->meshes, contact, length) == 0)
            return k;
    return -1;
}

/* y at the end of a piece. */
static void end_of(const double *powers, int64_t degree, int64_t size, double *y) {
    memset(y, 0, (size_t)size * sizeof *y);
    for (int64_t k = degree; k >= 0; k--)
        for (int64_t i = 0; i < size; i++)
            y[i] += powers[k * size + i];
}

/* On to the next cell; returns 0 where the common period has begun again. */
static int64_t next_cell(const struct motion *motion, struct where *at) {
    const int64_t cell = at->cell = (at->cell + 1) % motion->cells, m = motion->size - motion->width;
    if (cell == 0)
        at->period++, at->events = 0;
    at->begin = motion->span[2 * cell];
    memcpy(at->y + m, motion->start + cell * motion->width, (size_t)motion->width * sizeof *at->y);
    return cell;
}

static int follow_pieces(const struct motion *motion, struct pieces *p, struct where *at, struct run *run) {
    const int64_t size = motion->size, degree = motion->degree, meshes = motion->meshes, constant = motion->order == 1;
    const double *matrices = NULL;
    int64_t fresh = 1, empty = 0; /* whether the generator is not that of this cell and contact; cells without length in a row */
    for (run->count = 0; run->count < run->room && !gearstab_stopped();) {
        const double end = motion->span[2 * at->cell + 1], longest = end - at->begin;
        if (!(longest > 1e-15 * motion->period)) { /* else only rounding is left */
            next_cell(motion, at);
            fresh = 1;
            if (++empty > motion->cells)
                return OUTGROWN; /* no time passes: the period is no number */
            continue;
        }
        empty = 0;
        if (fresh) {
            int64_t k = known_contact(motion, at->contact);
            if (k < 0)
                return UNKNOWN;
            matrices = motion->matrices + k * (1 + motion->functions) * size * size;
            prepare(motion, p, matrices, at->cell);
            fresh = 0;
        }
        double *powers = run->powers + run->count * (degree + 1) * size, *number = run->number + run->count * NUMBERS;
        int64_t *label = run->label + run->count * LABELS, *contact = run->contact + run->count * meshes;
        p->shape = run->shape + run->count * motion->order * motion->functions;
        double length = constant ? constant_piece(motion, p, at->cell, at->y, longest, powers)
                                 : varying_piece(motion, p, matrices, at->cell, at->begin, at->y, longest, powers);
        if (length < 0)
            return ROUGH;
        int last = length >= longest;
        struct contact_change change = next_change(motion, powers, at->contact, at->switched);
        memcpy(contact, at->contact, (size_t)meshes * sizeof *contact);
        double speed = NAN;
        if (change.u >= 0) {
            double scale = 1.0, width = motion->limit[2 * change.mesh + 1] - motion->limit[2 * change.mesh];
            speed = change.slope / length;
            shorten(motion, change.u, p->shape);
            for (int64_t k = 0; k <= degree; k++, scale *= change.u)
                for (int64_t i = 0; i < size; i++)
                    powers[k * size + i] *= scale;
            last = last && change.u == 1.0;
            length *= change.u;
            at->contact[change.mesh] = change.following;
            change.grazing |= fabs(speed) < motion->grazing * motion->rate * width;
            at->events++;
            at->soon = length < motion->at_once * motion->period ? at->soon + 1 : 0;
            fresh = 1;
        }
        at->switched = change.u >= 0 ? change.mesh : -1;
        number[0] = at->begin, number[1] = length, number[2] = speed;
        label[0] = at->period, label[1] = at->cell, label[2] = at->switched;
        label[3] = change.u >= 0 ? change.following : 0, label[4] = change.grazing;
        run->count++;
        if (at->events > motion->busiest || at->soon > motion->most_at_once)
            return CHATTERS;
        end_of(powers, degree, size, at->y);
        if (!(largest_of(at->y, size) < motion->largest))
            return OUTGROWN;
        at->begin = last ? end : at->begin + length;
    }
    return FULL;
}

/* See kernel.h. */
int gearstab_follow(const struct motion *motion, struct where *at, struct run *run) {
    const int64_t size = motion->size, functions = motion->functions;
    const int64_t matrix = motion->order == 1 ? size * size : 0, sums = motion->order == 1 ? 0 : (1 + functions) * size;
    const int64_t applied = motion->order == 1 ? 0 : functions * motion->degree * size;
    double *memory = malloc((size_t)(matrix + sums + applied + size) * sizeof *memory);
    if (!memory)
        return -1;
    struct pieces p = {.generator = memory};
    p.sums = p.generator + matrix, p.applied = p.sums + sums, p.row = p.applied + applied;
    int how = follow_pieces(motion, &p, at, run);
    free(memory);
    return how;
}

#endif
