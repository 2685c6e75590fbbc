/* What the Python module (module/module.c) and the kernel at each level of vector instructions (level_*.c) agree on.

   Arrays are contiguous, row-major, of doubles where nothing else is said; the module has checked their sizes. */

#ifndef GEARSTAB_KERNEL_H
#define GEARSTAB_KERNEL_H

#include <stdint.h>

/* Whether the call is to return early, see module/stopping.c. Asked at least every millisecond or so of work, as
   it looks at the clock once in a while only; after a yes results are not looked at. */
int gearstab_stopped(void);

#define FEW_COORDINATES 12 /* up to so many a period takes milliseconds, even of thousands of segments */

enum verdict { UNSTABLE = 0, STABLE = 1, DOUBTFUL = 2 };

/* Thresholds that decide verdicts; Python gives them: edge, discriminant and growth noise and the largest coefficient
   of decision.py, and c_kernel.LARGE. */
struct limits {
    double edge, discriminant, growth, coefficient, large;
};

/* A conservative pattern: r rows of S segments over D states of n coordinates. */
struct conservative {
    int64_t rows, segments, states, n;
    double cycles;           /* the common period is cycles 2 pi/omega */
    struct limits limits;
    const double *squared;   /* (r, D, n), squared frequencies */
    const double *fractions; /* (r, S), durations as parts of the common period */
    const int64_t *state;    /* (S,) */
    const double *change;    /* (r, S, n, n), V_{s+1}^T V_s */
};

/* A damped pattern of dimension m, see damped.h: in the real modal coordinates of its states, or, with generators that go with
   the mesh frequency, in its own; then decay and frequency only say how fast solutions vary, and nothing changes. */
struct damped {
    int64_t rows, segments, states, changes, m, terms;
    double cycles;
    const double *generator; /* (r, D, m, m) or NULL: A of x' = (A + sum_k f_k B_k) x, f_k = W^p/(1 - a W^2), W = ratio omega */
    const double *by_speed;  /* (r, terms, m, m), B_k */
    const double *law;       /* (r, terms, 3): ratio, p = 1 or 2, a */
    const double *decay;     /* (r, D, m), real parts of the eigenvalues */
    const double *frequency; /* (r, D, m), imaginary parts: of a pair, positive at its first member; 0 for real ones,
                                which come first */
    const double *fractions; /* (r, S) */
    const int64_t *state;    /* (S,) */
    const int64_t *follows;  /* (S,), which change follows each segment */
    const double *change;    /* (r, changes, m, m), from the coordinates of a segment to those of the next */
    const struct limits *limits; /* of verdicts where multipliers are inverse in pairs, as those of gyroscopic systems, else NULL */
};

/* What the search for Lyapunov functions goes by: the names are those of gearstab/floquet/kernel/c_points.py. */
struct lyapunov {
    double part, longest, pieces, rounding, largest, least, negligible;
    int64_t bisections, doublings, unknowns;
    double margin; /* times what bounds the second derivative by a stretching */
};

/* How much of the action of the unstable solutions at a point a root accounts for: modes p <= q and harmonic, see
   boundaries/names. */
struct share {
    int64_t point, p, q, cycles;
    double share;
};

/* What the states of a pattern of D states differ from the mean system by, in `count` orthonormal directions: across
   (r, D, count, n), from the modes of a state to the components of K_s - mean; direction (r, count, n) and mean (r, n), squared
   frequencies, in the modes of the mean system. */
struct acting {
    int64_t count;
    const double *across, *direction, *mean;
};

struct shares {
    struct share *share; /* to be released with free */
    int64_t count, room;
};

/* A point of a pattern's rows, by its row and its mesh frequency. */
struct point {
    int64_t row, at;
};

struct points {
    struct point *point; /* to be released with free */
    int64_t count, room;
};

/* A motion whose teeth may part, of D = size numbers: a state and `width` harmonics of what drives it, whose equations stand
   in gearstab/response/backlash/dynamics.py. A cell is a part of the common period in which all J functions are smooth. */
struct motion {
    int64_t size, width, meshes, functions, cells, order, degree, known;
    int64_t busiest, most_at_once, fine, most_halvings;
    double period, rate, tolerance;
    double reach, penetration, rounding, grazing, at_once, largest, smallest;
    const double *span;     /* (cells, 2), begin and end */
    const double *shape;    /* (cells, order, J), the functions as powers of the part of the cell that has passed */
    const double *start;    /* (cells, width), the harmonics at the beginning */
    const double *gauge;    /* (meshes, D), deflections */
    const double *limit;    /* (meshes, 2), of the play; the same number twice without any */
    const int64_t *contact; /* (known, meshes), contacts with known matrices: 1, 0 or -1 */
    const double *matrices; /* (known, 1 + J, D, D), of a contact what is always there, then what comes with each function;
                               by columns */
};

/* Where a motion is: number of the common period, cell, time in the period, state, contact; the mesh whose contact has just
   changed, or -1; events in this period, and those that came close together. */
struct where {
    int64_t period, cell, switched, events, soon, *contact; /* (meshes,) */
    double begin, *y;                                       /* (D,) */
};

enum { NUMBERS = 3, LABELS = 5 };

/* What there is room for: degrees of polynomials, and points at which their extremes are looked for. */
enum { MOST_DEGREE = 31, MOST_POINTS = 512 };

/* Pieces of a motion between changes, up to `room` of them. */
struct run {
    int64_t count, room;
    double *powers;   /* (room, degree + 1, D), coefficients of powers of u = 0...1 */
    double *shape;    /* (room, order, J), those of the functions */
    double *number;   /* (room, NUMBERS): time of the beginning in the common period, length, speed of the mesh that changes */
    int64_t *label;   /* (room, LABELS): period, cell, mesh that changes or -1, its contact afterwards, whether it is grazing */
    int64_t *contact; /* (room, meshes) */
};

/* Why a run ends: no more room; a contact without known matrices; too many events; beyond double precision; functions too
   rough for the tolerance. */
enum { FULL, UNKNOWN, CHATTERS, OUTGROWN, ROUGH };

/* Polynomials of degree `degree` on [0, 1]: (count, degree + 1, size), coefficients of powers; the first `kept` of each
   group of `size` are of interest. */
struct polynomials {
    int64_t count, degree, size, kept;
    const double *powers;
};

/* Where the points of a pattern's r rows stand in a result that has other rows too, and in which units. */
struct result {
    const double *omega;  /* (r, points) with a stride of points, or (points,) of all rows with a stride of 0 */
    int64_t stride;
    const double *rate;   /* (r,), what a pattern's frequencies and growths are divided by */
    const double *shift;  /* (r,), uniform decay that was taken out, in units of rate */
    const int64_t *place; /* (r,), which row of the result each one is */
    int64_t rows;         /* of the result */
    int8_t *stable;       /* (points, rows) */
    double *growth;       /* (points, rows), growth rate */
};

/* The functions of one level; those that return int return 0, or -1 when there is no memory. */
struct level {
    const char *name;
    /* Rows first..last-1: omega (r, points) -> verdict (r, points), growth = ln max |lambda| (r, points); where wanted
       (not NULL) also rho = lambda + 1/lambda, (r, points, n, 2), NaN where the monodromy matrix had to be scaled. With
       room for it matrices are interpolated where that pays, and magnified (r, points) says by how much their rounding
       errors exceed those of a product. */
    int (*scan)(const struct conservative *pattern, int64_t first, int64_t last, int64_t points, const double *omega,
                int8_t *verdict, double *growth, double *rho, double *magnified);
    /* Rows first..last-1: flags and growth rates in their places in a result, 0 or 1 where the flag is not DOUBTFUL; kept:
       the points in doubt, whose growth rate means nothing. */
    int (*rates)(const struct conservative *pattern, int64_t first, int64_t last, int64_t points,
                 const struct result *to, struct points *kept);
    /* Points first..last-1, each of a row of its own: monodromy matrix times exp(-scale), (points, 2n, 2n). */
    int (*monodromy)(const struct conservative *pattern, int64_t first, int64_t last, const int64_t *row,
                     const double *omega, double *matrix, double *scale);
    /* Rows first..last-1: rho = lambda + 1/lambda, (r, points, n, 2) real and imaginary parts; NaN where an entry of the
       monodromy matrix exceeds the bound. */
    int (*traces)(const struct conservative *pattern, int64_t first, int64_t last, int64_t points, double bound,
                  const double *omega, double *rho);
    /* Rows first..last-1: growth = ln max |lambda| and the scale taken out of the product, (r, points) each; where wanted
       (not NULL) also all multipliers over exp(scale), (r, points, m, 2). */
    int (*scan_damped)(const struct damped *pattern, int64_t first, int64_t last, int64_t points, const double *omega,
                       double *growth, double *scale, double *multipliers);
    /* Multipliers at scattered periods of one row after the other, see spectra.h. new: NULL when there is no memory; row:
       the longest window; window: interpolate within; at: points cycle = 1/omega (count,) -> angle, growth (count, n), size;
       below: points with lines (count,) of `room` angles each -> Morse indices below (count, room), see inertia.h. */
    void *(*spectra_new)(const struct conservative *pattern);
    void (*spectra_free)(void *spectra);
    double (*spectra_row)(void *spectra, int64_t row);
    void (*spectra_window)(void *spectra, double first, double last);
    void (*spectra_at)(void *spectra, int64_t count, const double *cycle, double *angle, double *growth, double *size,
                       double *taken);
    void (*spectra_below)(void *spectra, int64_t count, int64_t room, const double *cycle, const int64_t *lines,
                          const double *angle, int64_t *below);
    /* Points first..last-1, ordered by row: the shares of their unstable solutions. exact gives the matrices, coarse, of the same
       rows, the solutions in between; turn (r, n, n) from the first modes of the exact to those of the coarse pattern. */
    int (*shares)(const struct conservative *exact, const struct conservative *coarse, const struct acting *acting,
                  const double *turn, int64_t first, int64_t last, const int64_t *row, const double *cycle,
                  struct shares *kept);
    /* Symmetric matrices first..last-1 of (count, n, n): eigenvalues (count, n) ascending, columns of eigenvectors. */
    int (*symmetric)(int64_t first, int64_t last, int64_t n, const double *matrix, double *values, double *vectors);
    /* Points first..last-1, each of a row of its own, at cycle = 1/omega: ln |lambda| of all multipliers (points, m),
       descending; NaN where they are not found. */
    int (*moduli)(const struct damped *pattern, int64_t first, int64_t last, const int64_t *row, const double *cycle,
                  double *logs);
    /* The same points: product of all segments times exp(-scale), (points, m, m), in the coordinates of the states. */
    int (*products)(const struct damped *pattern, int64_t first, int64_t last, const int64_t *row, const double *cycle,
                    double *matrix, double *scale);
    /* The same points with the growth = ln max |lambda| of each: by which part all lengths may grow, and shrink, so that no
       multiplier crosses the unit circle, (points, 2); NaN where a multiplier is outside and m is large. weight (r, D, m,
       m): what damping takes from the square of the length. slope (r, D, m, m), bend (r, D), where wanted: how generators
       change, see lyapunov.h. equation (points, 2, m, m), where wanted: X and D of P - X^T P X = D are written, or with
       `reads` P is taken from the place of D. */
    int (*radii)(const struct damped *pattern, const double *weight, const struct lyapunov *settings, const double *slope,
                 const double *bend, int64_t first, int64_t last, const int64_t *row, const double *cycle,
                 const double *growth, double *radius, double *equation, int reads);
    /* Matrices first..last-1 of (count, m, m), of entries of about one: eigenvalues (count, m, 2), NaN where they are not
       found or a matrix is not finite. */
    int (*eigenvalues)(int64_t first, int64_t last, int64_t m, const double *matrix, double *values);
    /* The same matrices, of any size: exp(A) (count, m, m); NaN of one that is not finite. */
    int (*exponentials)(int64_t first, int64_t last, int64_t m, const double *matrix, double *result);
    /* Runs first..last-1 of RUN_OF_POINTS points of a row, row by row: omega (r, points) -> ln lambda of all
       multipliers (r, points, m, 2), however far they are apart; NaN where they are not found. */
    int (*exponents)(const struct damped *pattern, int64_t first, int64_t last, int64_t points, const double *omega,
                     double *logs);
    /* Points first..last-1 of products of factors (count, points, m, m), the first one acting first: ln lambda of all
       eigenvalues (points, m, 2); NaN where they are not found. */
    int (*graded)(int64_t count, int64_t m, int64_t first, int64_t last, int64_t points, const double *factors,
                  double *logs);
};

#define RUN_OF_POINTS 8 /* a thread takes so many of a row, LANES at most: results do not hang on how many there are */

/* An edge of an instability region of a row: where (in 1/omega) and how precisely; enters: from stable to unstable as the
   period grows; passed: collisions before it, or after an exit, at 1, at -1 and elsewhere. Or, with enters BEFORE and AFTER, two
   stable points less than a floor apart with a collision between them. */
enum { BEFORE = 2, AFTER = 3 };

struct edge {
    int64_t row;
    double cycle, error;
    int64_t enters, passed[3];
};

/* A row: monodromy matrices computed, whether both ends of the range are stable, and the collisions passed there: of pairs
   that are off the circle as not met (first) and as met (last). */
struct reach {
    int64_t evaluations, stable[2], passed[2][3];
};

struct order {
    const struct level *level;
    const struct conservative *exact, *coarse; /* that of the matrices, and one with the same rotation counts */
    double tolerance, floor; /* of an edge and of a region, relative */
    double gap;              /* the same of a stable gap between two regions; below the floor collisions are listed as well */
    double density;          /* points of the scan a collision */
};

/* The edges of rows first..last-1 between the cycles start and stop (rows,), see search.c, and what is known of these rows,
   reach (last - first,); *edges is to be released with free. Returns 0, or -1 when there is no memory. */
int gearstab_edges(const struct order *order, int64_t first, int64_t last, const double *start, const double *stop,
                   struct edge **edges, int64_t *count, struct reach *reach);

/* Regions that await their names, ordered by row: where they are, what solutions inside share of, and how many collisions of each
   class lie below and inside them. */
struct regions {
    int64_t count, rows, n, shares;
    double cycles;               /* N */
    const double *frequency;     /* (rows, n), of the mean system, times the unit of cycle */
    const int64_t *row;          /* (count,) */
    const double *cycle;         /* (count,) */
    const int64_t *passed, *meetings; /* (count, 3) */
    const struct share *share;   /* (shares,), ordered by their point, which is the number of a region here */
};

/* A root of a region; of several, the leading one first. */
struct name {
    int64_t region, p, q, cycles;
};

struct names {
    struct name *name; /* to be released with free */
    int64_t count, room;
};

/* Names of all regions, in their order, see names.c. Returns 0, or -1 when there is no memory. */
int gearstab_names(const struct regions *all, struct names *kept);

/* How many points took each way. Only scripts/bench/kernel.py asks, with a build of its own: counting everywhere would cost
   threads a shared line of memory. */
enum path { PROPAGATED, INTERPOLATED, SQUARED, LEFT_TO_QR, SQUARED_TWICE, PATHS };
#ifdef GEARSTAB_COUNT_PATHS
extern int64_t gearstab_paths[PATHS];
#define COUNT(path, points) (gearstab_paths[path] += (points))
#else
#define COUNT(path, points) ((void)0)
#endif

/* Morse indices, see boundaries/index.c. new: room for n coordinates, NULL when there is no memory; at: N(0) and N(pi) of a row
   at a cycle. */
void *gearstab_index_new(int64_t n);
void gearstab_index_free(void *room);
void gearstab_index_at(void *room, const struct conservative *pattern, int64_t row, double cycle, int64_t *at_one,
                       int64_t *at_minus_one);

/* A motion from where it is on, to where a run ends; returns why. See backlash/backlash.c, as the next two. */
int gearstab_follow(const struct motion *motion, struct where *at, struct run *run);
/* Values of the kept polynomials of group s at u[first[s]..first[s + 1] - 1]: state (places, kept). */
void gearstab_sampled(const struct polynomials *all, const int64_t *first, const double *u, double *state);
/* Least and greatest values (count, size) by equally spaced points and the parabolas through three of them. */
void gearstab_extremes(const struct polynomials *all, int64_t points, double *low, double *high);

/* Moved traces and their condition, see undamped/nearest.c. */
void gearstab_trace_change(int64_t count, int64_t n, double weight, const double *fine, const double *coarse,
                           double *change, double *largest);
void gearstab_trace_condition(int64_t count, int64_t n, const double *rho, const double *least, double *moved,
                              double *apart);

/* Eigenvalues (count, 2n), eigenvectors as columns and their inverse (count, 2n, 2n), complex, of lightly damped states, see
   light.c, from the modes of their stiffness: squared (count, n), shapes and, in these modes, damping (count, n, n).
   found (count,): 0 where they mean nothing. Returns 1 where memory ran out. */
int gearstab_light_modes(int64_t count, int64_t n, const double *squared, const double *shapes, const double *damping,
                         double *values, double *vectors, double *inverse, int8_t *found);

extern const struct level gearstab_plain;
extern const struct level gearstab_avx2;
extern const struct level gearstab_avx512;

#endif
