/* Motions whose teeth may part as Python functions, see module.c and gearstab/response/backlash/follow.py. */

#include "module.h"

enum { FEWEST_POINTS = 16 }; /* of extremes: no fewer than a vector has numbers */

/* Where the motion is: marks (5 + meshes,) of integers, state (1 + D,). */
static void enter(struct where *at, int64_t *marks, double *state) {
    at->period = marks[0], at->cell = marks[1], at->switched = marks[2], at->events = marks[3], at->soon = marks[4];
    at->contact = marks + 5;
    at->begin = state[0], at->y = state + 1;
}

static void leave(const struct where *at, int64_t *marks, double *state) {
    marks[0] = at->period, marks[1] = at->cell, marks[2] = at->switched, marks[3] = at->events, marks[4] = at->soon;
    state[0] = at->begin;
}

/* Numbers: size, width, meshes, functions, cells, order, degree, known, busiest, most at once, fine, most halvings. */
#define MOTION "(sw!m!fc!o!dkbax!h)(..........)[dc2][dcof][dcw][dms][dm2][ikm][dkf+ss]"

FUNCTION(follow, MOTION "r![I*][Ds+][Drd+s][Drof][Dr3][Ir5][Irm]") {
    const Py_ssize_t *n = c->n;
    const double *real = c->real;
    struct motion m = {
        .size = n['s'], .width = n['w'], .meshes = n['m'], .functions = n['f'], .cells = n['c'], .order = n['o'],
        .degree = n['d'], .known = n['k'], .busiest = n['b'], .most_at_once = n['a'], .fine = n['x'],
        .most_halvings = n['h'], .period = real[0], .rate = real[1], .tolerance = real[2], .reach = real[3],
        .penetration = real[4], .rounding = real[5], .grazing = real[6], .at_once = real[7], .largest = real[8],
        .smallest = real[9], .span = array(c, 0), .shape = array(c, 1), .start = array(c, 2), .gauge = array(c, 3),
        .limit = array(c, 4), .contact = array(c, 5), .matrices = array(c, 6)};
    struct run run = {.room = n['r'], .powers = array(c, 9), .shape = array(c, 10), .number = array(c, 11),
                      .label = array(c, 12), .contact = array(c, 13)};
    if (m.size <= m.width || m.degree < 2 || m.degree > MOST_DEGREE || c->view[7].len != 8 * (5 + n['m']))
        return UNFIT;
    struct where at;
    enter(&at, array(c, 7), array(c, 8));
    if (at.cell < 0 || at.cell >= m.cells)
        return UNFIT;
    int how = gearstab_follow(&m, &at, &run);
    leave(&at, array(c, 7), array(c, 8));
    c->answer[0] = how, c->answer[1] = (Py_ssize_t)run.count, c->answers = 2;
    return how < 0;
}

FUNCTION(sampled, "cdsk[dcd+s][ic+]p[dp][Dpk]") {
    struct polynomials all = {.count = c->n['c'], .degree = c->n['d'], .size = c->n['s'], .kept = c->n['k'],
                              .powers = array(c, 0)};
    const int64_t *first = array(c, 1);
    int fit = all.degree >= 0 && all.kept <= all.size;
    for (int64_t i = 0; fit && i <= all.count; i++)
        fit = 0 <= first[i] && first[i] <= c->n['p'];
    if (!fit)
        return UNFIT;
    gearstab_sampled(&all, first, array(c, 2), array(c, 3));
    return 0;
}

FUNCTION(extremes, "cds[dcd+s]p[Dcs][Dcs]") {
    struct polynomials all = {.count = c->n['c'], .degree = c->n['d'], .size = c->n['s'], .kept = c->n['s'],
                              .powers = array(c, 0)};
    if (all.degree < 0 || c->n['p'] < FEWEST_POINTS || c->n['p'] > MOST_POINTS)
        return UNFIT;
    gearstab_extremes(&all, c->n['p'], array(c, 1), array(c, 2));
    return 0;
}
