/* What the parts of the search for instability boundaries agree on: letters.c, brackets.c, search.c. */

#ifndef GEARSTAB_SEARCH_H
#define GEARSTAB_SEARCH_H

#include <stdint.h>

#include "kernel.h"

#define PI 3.141592653589793

/* ---- letters.c: one point of the search */

/* A pair of multipliers exp(+-i angle) on the unit circle, 0 < angle < pi; sign: the Krein sign of exp(i angle), with which
   the angle grows (+1) or falls (-1) as the period grows; speed: |d angle/d cycle|. */
struct letter {
    double angle, speed;
    int sign;
};

/* F and dF/dcycle, see search.c: of two neighbouring letters, of the first and 1, of the last and -1. */
struct gap {
    double square, slope;
};

enum place { AT_ONE, AT_MINUS_ONE, ELSEWHERE };

/* A pair off the circle: on the real axis one pair lambda, 1/lambda, else a quadruple. */
struct off {
    double angle, square, slope;
    enum place place;
};

/* A point. Letters by ascending angle; between them there are gaps 0..letters. known: whether the letters can be relied upon:
   not where M is too large or where signs are lost in rounding. index: N(0), the number of times that a multiplier has passed
   1; indexed: whether it is known. */
struct sample {
    double cycle, step, noise; /* step: to the second point; noise: rounding errors of rho = lambda + 1/lambda */
    double taken; /* imaginary parts of rho that were taken for such errors */
    int64_t index;
    int stable, known, indexed;
    int letters, offs;
    struct letter *letter; /* (n,) */
    struct gap *gap;       /* (n + 1,) */
    struct off *off;       /* (n,) */
};

/* A pair of multipliers as the kernel gives it: the room that sample_read needs. */
struct item {
    double angle, growth;
};

#define UNSETTLED INT64_MIN /* an answer of index_between and index_by_turns */

#define ROUNDING 0x1p-46 /* 64 eps: errors of rho per size of M, see spectra.h */
#define LARGEST 1e6 /* entries of M above this leave less than ten digits to multipliers on the unit circle */

void sample_read(struct sample *sample, int64_t n, double step, const double *angle, const double *growth, double size,
                 const double *later_angle, const double *later_growth, struct item *room, int *position);
int64_t signs_below(const struct sample *sample, double angle);
int64_t index_between(const struct sample *left, const struct sample *right, const struct sample *sample, int64_t n);
int64_t index_after(const struct sample *left, const struct sample *s, int64_t n, double *phase);
int64_t index_by_turns(const struct sample *left, const struct sample *right, const struct sample *sample, int64_t n,
                       double *phase);
void collisions_of(const struct sample *sample, int64_t n, int met, double *phase, int64_t *of_place);

/* ---- brackets.c: what lies between two points */

enum kind { NOTHING, ENTRANCE, EXIT, NARROW, OPEN };

/* kind; left, right: which gap of a stable end, which pair off the circle of an unstable one the finding is about (-1: none);
   doubtful: a third multiplier is near enough for more than one event to be possible. */
struct finding {
    enum kind kind;
    int left, right, doubtful;
};

struct finding compare(const struct sample *left, const struct sample *right, int smooth);

/* ---- steps.c: where to look next */

/* f + s x + p x^2 + q x^3 on 0 <= x <= 1. */
struct cubic {
    double f, s, p, q;
};

struct cubic course(const struct sample *left, const struct sample *right, const struct finding *found);
double highest(const struct cubic *c, double *place);

double propose(const struct sample *left, const struct sample *right, const struct finding *found, double tolerance,
               double floor);
int as_foreseen(const struct sample *left, const struct sample *right, const struct finding *found, const struct sample *between);
double edge_between(const struct sample *left, const struct sample *right, const struct finding *found, double *moved);
double blurred(const struct sample *left, const struct sample *right, const struct finding *found);

#endif
