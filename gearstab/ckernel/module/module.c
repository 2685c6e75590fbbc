/* gearstab.ckernel._kernel: the compiled kernel as Python functions over contiguous buffers.

   Shapes and meanings stand in kernel.h, the Python side in c_kernel.py and c_boundaries.py of gearstab/floquet/kernel.
   Every function checks that its buffers have the sizes that its numbers promise, releases the interpreter's lock while it
   computes, and runs at the level of vector instructions whose name it is given (see levels()). */

#include "module.h"

static const struct level *const LEVELS[] = {
    &gearstab_plain,
#if defined(__x86_64__)
    &gearstab_avx2,
    &gearstab_avx512,
#endif
};

enum { LEVEL_COUNT = sizeof LEVELS / sizeof *LEVELS };

static int supported(int index) {
#if defined(__x86_64__)
    __builtin_cpu_init();
    if (index == 1)
        return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
    if (index == 2)
        return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
               __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("fma");
#endif
    return index == 0;
}

const struct level *level_named(const char *name) {
    for (int i = 0; i < LEVEL_COUNT; i++)
        if (supported(i) && strcmp(name, LEVELS[i]->name) == 0)
            return LEVELS[i];
    PyErr_Format(PyExc_ValueError, "this processor has no level of vector instructions named %s", name);
    return NULL;
}

/* Whether non-zero frequencies come two by two. */
static int in_pairs(const double *frequency, Py_ssize_t m) {
    Py_ssize_t i = 0;
    while (i < m)
        i += frequency[i] != 0 ? 2 : 1;
    return i == m;
}

static PyObject *py_levels(PyObject *self, PyObject *unused) {
    (void)self, (void)unused;
    PyObject *names = PyList_New(0);
    for (int i = 0; names && i < LEVEL_COUNT; i++) {
        if (!supported(i))
            continue;
        PyObject *name = PyUnicode_FromString(LEVELS[i]->name);
        if (!name || PyList_Append(names, name) < 0)
            Py_CLEAR(names);
        Py_XDECREF(name);
    }
    return names;
}

static PyObject *py_sources(PyObject *self, PyObject *unused) {
    (void)self, (void)unused;
    return PyLong_FromLongLong(GEARSTAB_SOURCES);
}

static PyObject *py_scan(PyObject *self, PyObject *arguments) {
    (void)self;
    struct buffers b = {0};
    PyObject *o[MOST_BUFFERS] = {0};
    struct conservative pattern;
    const char *name;
    Py_ssize_t rows, segments, states, n, first, last, points;
    if (!PyArg_ParseTuple(arguments, PATTERN "nnnOOO|OO", PATTERN_ARGUMENTS, &first, &last, &points, &o[4], &o[5], &o[6],
                          &o[7], &o[8]) ||
        !take(&b, o, PATTERN_TYPES "dBDZD"))
        return finish(&b, 1, 0);
    const struct level *level = level_named(name);
    int failed = 0, fit = level && set_conservative(&pattern, rows, segments, states, n, b.view) && first >= 0 &&
                          last <= rows && FITS(&b.view[4], 8, rows, points) && FITS(&b.view[5], 1, rows, points) &&
                          FITS(&b.view[6], 8, rows, points) &&
                          (b.view[7].len == 0 || FITS(&b.view[7], 16, rows, points, n)) &&
                          (b.view[8].len == 0 || FITS(&b.view[8], 8, rows, points));
    if (fit) {
        begin_call();
        failed = level->scan(&pattern, first, last, points, b.view[4].buf, b.view[5].buf, b.view[6].buf,
                             wanted(&b.view[7]), wanted(&b.view[8]));
        end_call();
    }
    return finish(&b, fit, failed);
}

static PyObject *py_monodromy(PyObject *self, PyObject *arguments) {
    (void)self;
    struct buffers b = {0};
    PyObject *o[MOST_BUFFERS] = {0};
    struct conservative pattern;
    const char *name;
    Py_ssize_t rows, segments, states, n, first, last, points;
    if (!PyArg_ParseTuple(arguments, PATTERN "nnnOOOO", PATTERN_ARGUMENTS, &first, &last, &points, &o[4], &o[5], &o[6],
                          &o[7]) ||
        !take(&b, o, PATTERN_TYPES "idDD"))
        return finish(&b, 1, 0);
    const struct level *level = level_named(name);
    int failed = 0, fit = level && set_conservative(&pattern, rows, segments, states, n, b.view) && first >= 0 &&
                          last <= points && FITS(&b.view[4], 8, points) && FITS(&b.view[5], 8, points) &&
                          FITS(&b.view[6], 8, points, 2, n, 2, n) && FITS(&b.view[7], 8, points) &&
                          indices_within(&b.view[4], points, rows);
    if (fit) {
        begin_call();
        failed = level->monodromy(&pattern, first, last, b.view[4].buf, b.view[5].buf, b.view[6].buf, b.view[7].buf);
        end_call();
    }
    return finish(&b, fit, failed);
}

static PyObject *py_traces(PyObject *self, PyObject *arguments) {
    (void)self;
    struct buffers b = {0};
    PyObject *o[MOST_BUFFERS] = {0};
    struct conservative pattern;
    const char *name;
    Py_ssize_t rows, segments, states, n, first, last, points;
    double bound;
    if (!PyArg_ParseTuple(arguments, PATTERN "nnndOO", PATTERN_ARGUMENTS, &first, &last, &points, &bound, &o[4], &o[5]) ||
        !take(&b, o, PATTERN_TYPES "dZ"))
        return finish(&b, 1, 0);
    const struct level *level = level_named(name);
    int failed = 0, fit = level && set_conservative(&pattern, rows, segments, states, n, b.view) && first >= 0 &&
                          last <= rows && FITS(&b.view[4], 8, rows, points) && FITS(&b.view[5], 16, rows, points, n);
    if (fit) {
        begin_call();
        failed = level->traces(&pattern, first, last, points, bound, b.view[4].buf, b.view[5].buf);
        end_call();
    }
    return finish(&b, fit, failed);
}

#include "module_damped.h"

static PyObject *py_symmetric(PyObject *self, PyObject *arguments) {
    (void)self;
    struct buffers b = {0};
    PyObject *o[MOST_BUFFERS] = {0};
    const char *name;
    Py_ssize_t count, n;
    if (!PyArg_ParseTuple(arguments, "snnOOO", &name, &count, &n, &o[0], &o[1], &o[2]) || !take(&b, o, "dDD"))
        return finish(&b, 1, 0);
    const struct level *level = level_named(name);
    int failed = 0, fit = level && n > 0 && FITS(&b.view[0], 8, count, n, n) && FITS(&b.view[1], 8, count, n) &&
                          FITS(&b.view[2], 8, count, n, n);
    if (fit) {
        begin_call();
        failed = level->symmetric(0, count, n, b.view[0].buf, b.view[1].buf, b.view[2].buf);
        end_call();
    }
    return finish(&b, fit, failed);
}

static PyObject *py_magnus(PyObject *self, PyObject *arguments) {
    (void)self;
    struct buffers b = {0};
    PyObject *o[MOST_BUFFERS] = {0};
    struct steps steps;
    const char *name;
    Py_ssize_t count, m, first, last, points;
    const Py_buffer *view = b.view;
    if (!PyArg_ParseTuple(arguments, "snnOOnnnOOO", &name, &count, &m, &o[0], &o[1], &first, &last, &points, &o[2], &o[3],
                          &o[4]) ||
        !take(&b, o, "dddDD"))
        return finish(&b, 1, 0);
    steps.count = count, steps.m = m;
    steps.coefficients = view[0].buf, steps.length = view[1].buf;
    const struct level *level = level_named(name);
    int failed = 0, fit = level && m > 0 && first >= 0 && last <= points && FITS(&view[0], 8, count, 5, m, m) &&
                          FITS(&view[1], 8, count) && FITS(&view[2], 8, points) && FITS(&view[3], 8, points, m, m) &&
                          FITS(&view[4], 8, points);
    if (fit) {
        begin_call();
        failed = level->magnus(&steps, first, last, view[2].buf, view[3].buf, view[4].buf);
        end_call();
    }
    return finish(&b, fit, failed);
}

static PyObject *py_eigenvalues(PyObject *self, PyObject *arguments) {
    (void)self;
    struct buffers b = {0};
    PyObject *o[MOST_BUFFERS] = {0};
    const char *name;
    Py_ssize_t count, m, first, last;
    if (!PyArg_ParseTuple(arguments, "snnnnOO", &name, &count, &m, &first, &last, &o[0], &o[1]) || !take(&b, o, "dZ"))
        return finish(&b, 1, 0);
    const struct level *level = level_named(name);
    int failed = 0, fit = level && m > 0 && first >= 0 && last <= count && FITS(&b.view[0], 8, count, m, m) &&
                          FITS(&b.view[1], 16, count, m);
    if (fit) {
        begin_call();
        failed = level->eigenvalues(first, last, m, b.view[0].buf, b.view[1].buf);
        end_call();
    }
    return finish(&b, fit, failed);
}

static PyObject *py_trace_change(PyObject *self, PyObject *arguments) {
    (void)self;
    struct buffers b = {0};
    PyObject *o[MOST_BUFFERS] = {0};
    Py_ssize_t count, n;
    double weight;
    if (!PyArg_ParseTuple(arguments, "nndOOOO", &count, &n, &weight, &o[0], &o[1], &o[2], &o[3]) || !take(&b, o, "zzDD"))
        return finish(&b, 1, 0);
    int fit = FITS(&b.view[0], 16, count, n) && FITS(&b.view[1], 16, count, n) && FITS(&b.view[2], 8, count) &&
              FITS(&b.view[3], 8, count);
    if (fit) {
        begin_call();
        gearstab_trace_change(count, n, weight, b.view[0].buf, b.view[1].buf, b.view[2].buf, b.view[3].buf);
        end_call();
    }
    return finish(&b, fit, 0);
}

static PyObject *py_trace_condition(PyObject *self, PyObject *arguments) {
    (void)self;
    struct buffers b = {0};
    PyObject *o[MOST_BUFFERS] = {0};
    Py_ssize_t count, n;
    if (!PyArg_ParseTuple(arguments, "nnOOOO", &count, &n, &o[0], &o[1], &o[2], &o[3]) || !take(&b, o, "zdDD"))
        return finish(&b, 1, 0);
    int fit = FITS(&b.view[0], 16, count, n) && FITS(&b.view[1], 8, count) && FITS(&b.view[2], 8, count) &&
              FITS(&b.view[3], 8, count);
    if (fit) {
        begin_call();
        gearstab_trace_condition(count, n, b.view[0].buf, b.view[1].buf, b.view[2].buf, b.view[3].buf);
        end_call();
    }
    return finish(&b, fit, 0);
}

#ifdef GEARSTAB_COUNT_PATHS
int64_t gearstab_paths[PATHS];

static PyObject *py_paths(PyObject *self, PyObject *unused) {
    (void)self, (void)unused;
    const int64_t *p = gearstab_paths;
    PyObject *counts = Py_BuildValue("{sL sL sL sL sL}", "propagated", p[PROPAGATED], "interpolated", p[INTERPOLATED],
                                     "squared", p[SQUARED], "left to QR", p[LEFT_TO_QR], "squared twice", p[SQUARED_TWICE]);
    memset(gearstab_paths, 0, sizeof gearstab_paths);
    return counts;
}
#endif

static PyMethodDef METHODS[] = {
#ifdef GEARSTAB_COUNT_PATHS
    {"paths", py_paths, METH_NOARGS, "paths(): how many points took each way since the last call."},
#endif
    {"stop", py_stop, METH_VARARGS,
     "stop(change): all calls in all threads return early as long as the sum of the changes is positive."},
    {"limit", py_limit, METH_VARARGS,
     "limit(seconds): calls of this thread return early when it has taken so much processor time; infinite for no limit."},
    {"levels", py_levels, METH_NOARGS, "levels(): names of the levels of vector instructions available, the best last."},
    {"sources", py_sources, METH_NOARGS, "sources(): the first sixty bits of the sources' SHA-256, see setup.py."},
    {"scan", py_scan, METH_VARARGS,
     "scan(level, (rows, segments, states, n, cycles, limits), squared, fractions, state, change, first, last, points, omega, "
     "verdict, growth, rho=, magnified=)"},
    {"rates", py_rates, METH_VARARGS,
     "rates(level, (rows, segments, states, n, cycles, limits), squared, fractions, state, change, first, last, points, all rows, "
     "omega, rate, shift, place, stable, growth) -> bytes of the points in doubt"},
    {"monodromy", py_monodromy, METH_VARARGS,
     "monodromy(level, (rows, segments, states, n, cycles, limits), squared, fractions, state, change, first, last, points, row, "
     "omega, matrix, scale)"},
    {"traces", py_traces, METH_VARARGS,
     "traces(level, (rows, segments, states, n, cycles, limits), squared, fractions, state, change, first, last, points, bound, "
     "omega, rho)"},
    {"scan_damped", py_scan_damped, METH_VARARGS,
     "scan_damped(level, (rows, segments, states, changes, m, terms, cycles), *pattern, first, last, points, omega, growth, "
     "scale, multipliers=, limits=)"},
    {"moduli", py_moduli, METH_VARARGS,
     "moduli(level, (rows, segments, states, changes, m, terms, cycles), *pattern, first, last, points, row, cycle, logs)"},
    {"products", py_products, METH_VARARGS,
     "products(level, (rows, segments, states, changes, m, terms, cycles), *pattern, first, last, points, row, "
     "cycle, matrix, scale)"},
    {"radii", py_radii, METH_VARARGS,
     "radii(level, (rows, segments, states, changes, m, terms, cycles), *pattern, weight, (part, longest, pieces, "
     "rounding, largest, least, negligible, bisections, doublings, unknowns), first, last, "
     "points, row, cycle, growth, radius)"},
    {"exponents", py_exponents, METH_VARARGS,
     "exponents(level, (rows, segments, states, changes, m, terms, cycles), *pattern, first, last, points, omega, logs)"},
    {"graded", py_graded, METH_VARARGS, "graded(level, count, m, first, last, points, factors, logs)"},
    {"light_modes", py_light_modes, METH_VARARGS,
     "light_modes(count, n, squared, shapes, damping, values, vectors, inverse, found)"},
    {"names", py_names, METH_VARARGS,
     "names(regions, rows, n, cycles, frequency, row, cycle, passed, meetings, shares as bytes) -> bytes of names"},
    {"trace_change", py_trace_change, METH_VARARGS, "trace_change(count, n, weight, fine, coarse, change, largest)"},
    {"trace_condition", py_trace_condition, METH_VARARGS, "trace_condition(count, n, rho, least, moved, apart)"},
    {"symmetric", py_symmetric, METH_VARARGS, "symmetric(level, count, n, matrix, values, vectors)"},
    {"magnus", py_magnus, METH_VARARGS,
     "magnus(level, count, m, coefficients, length, first, last, points, period, matrix, scale)"},
    {"eigenvalues", py_eigenvalues, METH_VARARGS, "eigenvalues(level, count, m, first, last, matrix, values)"},
    {"follow", py_follow, METH_VARARGS,
     "follow((size, width, meshes, functions, cells, order, degree, known, busiest, most_at_once, fine, most_halvings), "
     "(period, rate, tolerance, reach, penetration, rounding, grazing, at_once, largest, smallest), "
     "span, shape, start, gauge, limit, contact, matrices, room, marks, state, pieces, "
     "shapes, numbers, labels, contacts) -> why the run ends, pieces"},
    {"sampled", py_sampled, METH_VARARGS, "sampled(count, degree, size, kept, powers, first, places, u, state)"},
    {"extremes", py_extremes, METH_VARARGS, "extremes(count, degree, size, powers, points, low, high)"},
    {"edges", py_edges, METH_VARARGS,
     "edges(level, numbers, squared, fractions, state, change, segments, states, squared, fractions, state, change, first, last, "
     "tolerance, floor, gap, density, start, stop) -> bytes of edges and of what is known of rows first..last-1"},
    {"shares", py_shares, METH_VARARGS,
     "shares(level, numbers, squared, fractions, state, change, segments, states, squared, fractions, state, change, first, "
     "last, points, modes, turn, row, cycle) -> bytes of the shares of points first..last-1"},
    {NULL, NULL, 0, NULL},
};

/* Nothing is shared between calls: no lock and no interpreter has to be alone. The stable interface of old versions does
   not know these slots; there importing the module into a Python without the global lock is not possible anyway. */
static PyModuleDef_Slot SLOTS[] = {
#ifdef Py_mod_multiple_interpreters
    {Py_mod_multiple_interpreters, Py_MOD_PER_INTERPRETER_GIL_SUPPORTED},
#endif
#ifdef Py_mod_gil
    {Py_mod_gil, Py_MOD_GIL_NOT_USED},
#endif
    {0, NULL},
};

static struct PyModuleDef MODULE = {
    PyModuleDef_HEAD_INIT, "_kernel", "The compiled kernel; see gearstab.floquet.kernel.c_kernel.", 0, METHODS, SLOTS, NULL, NULL, NULL,
};

PyMODINIT_FUNC PyInit__kernel(void) { return PyModuleDef_Init(&MODULE); }
