/* The functions of damped patterns of gearstab.ckernel._kernel, see module.c. */

#include "module.h"

/* Rows, segments, states, changes, m, terms and cycles, then decay, frequency, fractions, state, follows, change, by_speed, law.
   With terms >= 0 generators that go with the mesh frequency take the place of change, and there are as many of them as
   states; else there are no terms, by_speed and law are empty. */
#define DAMPED "@(rg!scm!t.)[drsm][drsm][drg][ig]<s[ig]<c[drcmm][d*][d*]"

/* Whether non-zero frequencies come two by two. */
static int in_pairs(const double *frequency, Py_ssize_t m) {
    Py_ssize_t i = 0;
    while (i < m)
        i += frequency[i] != 0 ? 2 : 1;
    return i == m;
}

/* Fill in the pattern, or return 0 where its parts do not agree. */
static int damped(struct call *c, struct damped *p) {
    int follows = c->n['t'] >= 0;
    c->n['t'] = follows ? c->n['t'] : 0;
    Py_ssize_t rows = c->n['r'], states = c->n['s'], m = c->n['m'];
    *p = (struct damped){
        .rows = rows, .segments = c->n['g'], .states = states, .changes = c->n['c'], .m = m, .terms = c->n['t'],
        .cycles = c->real[0], .decay = array(c, 0), .frequency = array(c, 1), .fractions = array(c, 2),
        .state = array(c, 3), .follows = array(c, 4), .change = array(c, 5), .by_speed = array(c, 6), .law = array(c, 7)};
    p->generator = follows ? p->change : NULL;
    int fit = fits(c, 6, "rtmm") && fits(c, 7, "rt3") && (!follows || p->changes == p->states);
    for (int64_t i = 0; fit && !follows && i < rows * states; i++)
        fit = in_pairs(p->frequency + i * m, m);
    return fit;
}

FUNCTION(scan_damped, DAMPED ":rp[drp][Drp][Drp]|[Zrpm]?(.....)") {
    struct damped p;
    struct limits limits = {.edge = c->real[1], .discriminant = c->real[2], .growth = c->real[3],
                            .coefficient = c->real[4], .large = c->real[5]};
    if (!damped(c, &p))
        return UNFIT;
    p.limits = limits.coefficient > 0.0 ? &limits : NULL;
    return c->level->scan_damped(&p, c->first, c->last, c->n['p'], array(c, 8), array(c, 9), array(c, 10), wanted(c, 11));
}

FUNCTION(moduli, DAMPED ":pp[ip]<r[dp][Dpm]") {
    struct damped p;
    if (!damped(c, &p))
        return UNFIT;
    return c->level->moduli(&p, c->first, c->last, array(c, 8), array(c, 9), array(c, 10));
}

FUNCTION(products, DAMPED ":pp[ip]<r[dp][Dpmm][Dp]") {
    struct damped p;
    if (!damped(c, &p))
        return UNFIT;
    return c->level->products(&p, c->first, c->last, array(c, 8), array(c, 9), array(c, 10), array(c, 11));
}

FUNCTION(radii, DAMPED "[drsmm](.......xyz.)[drsmm]?[drs]?:pp[ip]<r[dp][dp][Dp2][Dp2mm]?w") {
    struct damped p;
    struct lyapunov set = {.part = c->real[1], .longest = c->real[2], .pieces = c->real[3], .rounding = c->real[4],
                           .largest = c->real[5], .least = c->real[6], .negligible = c->real[7], .margin = c->real[8],
                           .bisections = c->n['x'], .doublings = c->n['y'], .unknowns = c->n['z']};
    if (!damped(c, &p) || p.generator || !(set.longest > 0 && set.pieces >= 1 && set.pieces < 1e6))
        return UNFIT;
    if (!wanted(c, 9) != !wanted(c, 10))
        return UNFIT;
    return c->level->radii(&p, array(c, 8), &set, wanted(c, 9), wanted(c, 10), c->first, c->last, array(c, 11), array(c, 12),
                           array(c, 13), array(c, 14), wanted(c, 15), c->n['w'] != 0);
}

/* A part of the runs of points, see kernel.h. */
FUNCTION(exponents, DAMPED "abp[drp][Zrpm]") {
    struct damped p;
    int64_t first = c->n['a'], last = c->n['b'], runs = (c->n['p'] + RUN_OF_POINTS - 1) / RUN_OF_POINTS;
    if (!damped(c, &p) || p.generator || first < 0 || last > p.rows * runs)
        return UNFIT;
    return c->level->exponents(&p, first, last, c->n['p'], array(c, 8), array(c, 9));
}
