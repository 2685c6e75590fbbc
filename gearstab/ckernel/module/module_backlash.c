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

PyObject *py_follow(PyObject *self, PyObject *arguments) {
    (void)self;
    struct buffers b = {0};
    PyObject *o[MOST_BUFFERS] = {0};
    struct motion m;
    const Py_buffer *view = b.view;
    Py_ssize_t room, n[12];
    if (!PyArg_ParseTuple(arguments, "(nnnnnnnnnnnn)(dddddddddd)OOOOOOOnOOOOOOO", &n[0], &n[1], &n[2], &n[3], &n[4],
                          &n[5], &n[6], &n[7], &n[8], &n[9], &n[10], &n[11], &m.period, &m.rate, &m.tolerance, &m.reach,
                          &m.penetration, &m.rounding, &m.grazing, &m.at_once, &m.largest, &m.smallest, &o[0], &o[1],
                          &o[2], &o[3], &o[4], &o[5], &o[6], &room, &o[7], &o[8], &o[9], &o[10], &o[11], &o[12],
                          &o[13]) ||
        !take(&b, o, "dddddidIDDDDII"))
        return finish(&b, 1, 0);
    m.size = n[0], m.width = n[1], m.meshes = n[2], m.functions = n[3], m.cells = n[4], m.order = n[5], m.degree = n[6];
    m.known = n[7], m.busiest = n[8], m.most_at_once = n[9], m.fine = n[10], m.most_halvings = n[11];
    m.span = view[0].buf, m.shape = view[1].buf, m.start = view[2].buf, m.gauge = view[3].buf, m.limit = view[4].buf;
    m.contact = view[5].buf, m.matrices = view[6].buf;
    int fit = n[1] > 0 && n[0] > n[1] && n[2] > 0 && n[4] > 0 && n[5] > 0 && n[6] > 1 && n[6] <= MOST_DEGREE &&
              n[10] > 0 && room > 0 && FITS(&view[0], 8, n[4], 2) && FITS(&view[1], 8, n[4], n[5], n[3]) &&
              FITS(&view[2], 8, n[4], n[1]) && FITS(&view[3], 8, n[2], n[0]) && FITS(&view[4], 8, n[2], 2) &&
              FITS(&view[5], 8, n[7], n[2]) && FITS(&view[6], 8, n[7], 1 + n[3], n[0], n[0]) &&
              FITS(&view[7], 8, 5 + n[2]) && FITS(&view[8], 8, 1 + n[0]) && FITS(&view[9], 8, room, n[6] + 1, n[0]) &&
              FITS(&view[10], 8, room, n[5], n[3]) && FITS(&view[11], 8, room, NUMBERS) &&
              FITS(&view[12], 8, room, LABELS) && FITS(&view[13], 8, room, n[2]);
    struct where at;
    struct run run = {.room = room, .powers = view[9].buf, .shape = view[10].buf, .number = view[11].buf,
                      .label = view[12].buf, .contact = view[13].buf};
    if (fit) {
        enter(&at, view[7].buf, view[8].buf);
        fit = at.cell >= 0 && at.cell < m.cells;
    }
    int how = 0;
    if (fit) {
        begin_call();
        how = gearstab_follow(&m, &at, &run);
        if (end_call())
            how = -1;
        leave(&at, view[7].buf, view[8].buf);
    }
    if (!fit || how < 0)
        return finish(&b, fit, how < 0);
    release(&b);
    return Py_BuildValue("in", how, (Py_ssize_t)run.count);
}

PyObject *py_sampled(PyObject *self, PyObject *arguments) {
    (void)self;
    struct buffers b = {0};
    PyObject *o[MOST_BUFFERS] = {0};
    const Py_buffer *view = b.view;
    Py_ssize_t count, degree, size, kept, places;
    if (!PyArg_ParseTuple(arguments, "nnnnOOnOO", &count, &degree, &size, &kept, &o[0], &o[1], &places, &o[2],
                          &o[3]) ||
        !take(&b, o, "didD"))
        return finish(&b, 1, 0);
    int fit = degree >= 0 && kept >= 0 && kept <= size && FITS(&view[0], 8, count, degree + 1, size) &&
              FITS(&view[1], 8, count + 1) && FITS(&view[2], 8, places) && FITS(&view[3], 8, places, kept) &&
              indices_within(&view[1], count + 1, (int64_t)places + 1);
    if (fit) {
        struct polynomials all = {.count = count, .degree = degree, .size = size, .kept = kept, .powers = view[0].buf};
        begin_call();
        gearstab_sampled(&all, view[1].buf, view[2].buf, view[3].buf);
        end_call();
    }
    return finish(&b, fit, 0);
}

PyObject *py_extremes(PyObject *self, PyObject *arguments) {
    (void)self;
    struct buffers b = {0};
    PyObject *o[MOST_BUFFERS] = {0};
    const Py_buffer *view = b.view;
    Py_ssize_t count, degree, size, points;
    if (!PyArg_ParseTuple(arguments, "nnnOnOO", &count, &degree, &size, &o[0], &points, &o[1], &o[2]) ||
        !take(&b, o, "dDD"))
        return finish(&b, 1, 0);
    int fit = degree >= 0 && points >= FEWEST_POINTS && points <= MOST_POINTS &&
              FITS(&view[0], 8, count, degree + 1, size) && FITS(&view[1], 8, count, size) && FITS(&view[2], 8, count, size);
    if (fit) {
        struct polynomials all = {.count = count, .degree = degree, .size = size, .kept = size, .powers = view[0].buf};
        begin_call();
        gearstab_extremes(&all, points, view[1].buf, view[2].buf);
        end_call();
    }
    return finish(&b, fit, 0);
}
