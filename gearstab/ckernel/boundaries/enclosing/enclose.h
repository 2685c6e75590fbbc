/* Stretches between two points of the search without a collision, see enclose.c. */

#ifndef GEARSTAB_ENCLOSE_H
#define GEARSTAB_ENCLOSE_H

#include "search.h"

enum { MOST_MEETINGS = 256 }; /* between two points: brackets with more are cut in another way */

/* A multiplier of positive sign between two points: its phase at the first, how far it moves, its speeds at the first and at the
   last, per bracket; place: to sort by. */
struct passer {
    double phase, moved, first, last, place;
};

/* A bracket; end (2 stretches,): where its stretches begin and end. */
struct enclosing {
    int64_t n;
    double floor;
    const struct sample *left, *right;
    struct passer *passer; /* (2n,) */
    struct letter *letter; /* (2n,) */
    double anchor, meeting[MOST_MEETINGS], end[2 * MOST_MEETINGS + 2];
    int meetings, stretches;
};

struct enclosing *enclosing_new(int64_t n, double floor);
void enclosing_free(struct enclosing *e);
int enclose(struct enclosing *e, const struct sample *left, const struct sample *right);
int lines_of(const struct enclosing *e, int stretch, double *line);
void below_lines(const struct sample *s, const double *line, int lines, int64_t *below);
int nothing_between(const int64_t *first, const int64_t *last, int lines, int64_t n);

#endif
