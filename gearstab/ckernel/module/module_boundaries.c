/* Instability boundaries as Python functions, see module.c. */

#include "module.h"

#include <stdlib.h>

/* Edges and what is known of the rows come as bytes of struct edge and struct reach, because nobody knows before how many
   edges there are. */
PyObject *py_edges(PyObject *self, PyObject *arguments) {
    (void)self;
    struct buffers b = {0};
    PyObject *o[MOST_BUFFERS] = {0}, *result = NULL;
    struct conservative pattern, coarse;
    struct order order = {.exact = &pattern, .coarse = &coarse};
    const char *name;
    Py_ssize_t rows, segments, states, n, more, kinds, first, last;
    if (!PyArg_ParseTuple(arguments, PATTERN "nnOOOOnnddddOO", PATTERN_ARGUMENTS, &more, &kinds, &o[4], &o[5], &o[6], &o[7], &first,
                          &last, &order.tolerance, &order.floor, &order.gap, &order.density, &o[8], &o[9]) ||
        !take(&b, o, PATTERN_TYPES PATTERN_TYPES "dd"))
        return finish(&b, 1, 0);
    order.level = level_named(name);
    coarse = (struct conservative){.cycles = pattern.cycles, .limits = pattern.limits};
    int fit = order.level && set_conservative(&pattern, rows, segments, states, n, b.view) &&
              set_conservative(&coarse, rows, more, kinds, n, b.view + 4) && 0 <= first && first <= last && last <= rows &&
              FITS(&b.view[8], 8, rows) && FITS(&b.view[9], 8, rows) && order.tolerance > 0 && order.floor > 0 && order.gap > 0;
    if (!fit)
        return finish(&b, 0, 0);
    struct edge *edges = NULL;
    struct reach *reach = calloc((size_t)(last - first) + 1, sizeof *reach);
    int64_t count = 0;
    int failed = !reach;
    if (!failed) {
        begin_call();
        failed = gearstab_edges(&order, first, last, b.view[8].buf, b.view[9].buf, &edges, &count, reach);
        failed |= end_call();
    }
    if (!failed)
        result = Py_BuildValue("y#y#", edges ? (const char *)edges : "", (Py_ssize_t)count * (Py_ssize_t)sizeof *edges,
                               (const char *)reach, (last - first) * (Py_ssize_t)sizeof *reach);
    free(edges);
    free(reach);
    if (failed)
        return finish(&b, 1, failed);
    release(&b);
    return result;
}

PyObject *py_shares(PyObject *self, PyObject *arguments) {
    (void)self;
    struct buffers b = {0};
    PyObject *o[MOST_BUFFERS] = {0}, *result = NULL;
    struct conservative pattern, coarse;
    const char *name;
    Py_ssize_t rows, segments, states, n, more, kinds, first, last, points;
    if (!PyArg_ParseTuple(arguments, PATTERN "nnOOOOnnnOOOO", PATTERN_ARGUMENTS, &more, &kinds, &o[4], &o[5], &o[6], &o[7],
                          &first, &last, &points, &o[8], &o[9], &o[10], &o[11]) ||
        !take(&b, o, PATTERN_TYPES PATTERN_TYPES "ddid"))
        return finish(&b, 1, 0);
    const struct level *level = level_named(name);
    coarse = (struct conservative){.cycles = pattern.cycles, .limits = pattern.limits};
    int fit = level && set_conservative(&pattern, rows, segments, states, n, b.view) &&
              set_conservative(&coarse, rows, more, kinds, n, b.view + 4) && 0 <= first && first <= last && last <= points &&
              FITS(&b.view[8], 8, rows, kinds, n, n) && FITS(&b.view[9], 8, rows, n, n) && FITS(&b.view[10], 8, points) &&
              FITS(&b.view[11], 8, points) && indices_within(&b.view[10], points, rows);
    if (!fit)
        return finish(&b, 0, 0);
    struct shares kept = {0};
    int failed;
    begin_call();
    failed = level->shares(&pattern, &coarse, b.view[8].buf, b.view[9].buf, first, last, b.view[10].buf, b.view[11].buf, &kept);
    failed |= end_call();
    if (!failed)
        result = PyByteArray_FromStringAndSize((const char *)kept.share, (Py_ssize_t)kept.count * (Py_ssize_t)sizeof *kept.share);
    free(kept.share);
    if (failed)
        return finish(&b, 1, failed);
    release(&b);
    return result;
}

PyObject *py_names(PyObject *self, PyObject *arguments) {
    (void)self;
    struct buffers b = {0};
    PyObject *o[MOST_BUFFERS] = {0}, *result = NULL;
    struct regions all;
    Py_ssize_t count, rows, n;
    if (!PyArg_ParseTuple(arguments, "nnndOOOOOO", &count, &rows, &n, &all.cycles, &o[0], &o[1], &o[2], &o[3], &o[4], &o[5]) ||
        !take(&b, o, "didiib"))
        return finish(&b, 1, 0);
    all.count = count, all.rows = rows, all.n = n, all.shares = b.view[5].len / (Py_ssize_t)sizeof *all.share;
    all.frequency = b.view[0].buf, all.row = b.view[1].buf, all.cycle = b.view[2].buf;
    all.passed = b.view[3].buf, all.meetings = b.view[4].buf, all.share = b.view[5].buf;
    int fit = n > 0 && FITS(&b.view[0], 8, rows, n) && FITS(&b.view[1], 8, count) && FITS(&b.view[2], 8, count) &&
              FITS(&b.view[3], 8, count, 3) && FITS(&b.view[4], 8, count, 3) &&
              b.view[5].len % (Py_ssize_t)sizeof *all.share == 0 && indices_within(&b.view[1], count, rows);
    for (int64_t i = 0; fit && i < all.shares; i++) /* p and q are indices too */
        fit = 0 <= all.share[i].p && all.share[i].p <= all.share[i].q && all.share[i].q < n;
    if (!fit)
        return finish(&b, 0, 0);
    struct names kept = {0};
    int failed;
    begin_call();
    failed = gearstab_names(&all, &kept);
    failed |= end_call();
    if (!failed)
        result = PyBytes_FromStringAndSize((const char *)kept.name, (Py_ssize_t)kept.count * (Py_ssize_t)sizeof *kept.name);
    free(kept.name);
    if (failed)
        return finish(&b, 1, failed);
    release(&b);
    return result;
}
