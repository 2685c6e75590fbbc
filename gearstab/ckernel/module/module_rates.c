/* Flags and growth rates as a Python function, see module.c. */

#include "module.h"

#include <stdlib.h>

/* Points in doubt come as bytes of struct point, because nobody knows before how many there are. */
PyObject *py_rates(PyObject *self, PyObject *arguments) {
    (void)self;
    struct buffers b = {0};
    PyObject *o[MOST_BUFFERS] = {0}, *result = NULL;
    struct conservative pattern;
    const char *name;
    const Py_buffer *view = b.view;
    Py_ssize_t rows, segments, states, n, first, last, points, all;
    if (!PyArg_ParseTuple(arguments, PATTERN "nnnnOOOOOO", PATTERN_ARGUMENTS, &first, &last, &points, &all, &o[4], &o[5],
                          &o[6], &o[7], &o[8], &o[9]) ||
        !take(&b, o, PATTERN_TYPES "dddiBD"))
        return finish(&b, 1, 0);
    const struct level *level = level_named(name);
    int shared = FITS(&view[4], 8, points);
    int fit = level && set_conservative(&pattern, rows, segments, states, n, view) && 0 <= first && first <= last &&
              last <= rows && (shared || FITS(&view[4], 8, rows, points)) && FITS(&view[5], 8, rows) &&
              FITS(&view[6], 8, rows) && FITS(&view[7], 8, rows) && FITS(&view[8], 1, points, all) &&
              FITS(&view[9], 8, points, all) && indices_within(&view[7], rows, all);
    if (!fit)
        return finish(&b, 0, 0);
    struct result to = {.omega = view[4].buf, .stride = shared ? 0 : points, .rate = view[5].buf, .shift = view[6].buf,
                        .place = view[7].buf, .rows = all, .stable = view[8].buf, .growth = view[9].buf};
    struct points kept = {0};
    int failed;
    begin_call();
    failed = level->rates(&pattern, first, last, points, &to, &kept);
    failed |= end_call();
    if (!failed)
        result = PyBytes_FromStringAndSize((const char *)kept.point, (Py_ssize_t)kept.count * (Py_ssize_t)sizeof *kept.point);
    free(kept.point);
    if (failed)
        return finish(&b, 1, failed);
    release(&b);
    return result;
}
