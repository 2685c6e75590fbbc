/* gearstab.ckernel._kernel: the compiled kernel as Python functions over contiguous buffers.

   Shapes and meanings stand in kernel.h, the Python side in gearstab/floquet/kernel/c_kernel.py. Every function checks that its
   buffers have the sizes that its numbers promise, releases the interpreter's lock while it computes, and runs
   at the level of vector instructions whose name it is given (see levels()). */

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <stdlib.h>
#include <string.h>

#include "kernel.h"

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

static const struct level *level_named(const char *name) {
    for (int i = 0; i < LEVEL_COUNT; i++)
        if (supported(i) && strcmp(name, LEVELS[i]->name) == 0)
            return LEVELS[i];
    PyErr_Format(PyExc_ValueError, "this processor has no level of vector instructions named %s", name);
    return NULL;
}

enum { MOST_BUFFERS = 12 };

struct buffers {
    Py_buffer view[MOST_BUFFERS];
};

static void release(struct buffers *buffers) {
    for (int i = 0; i < MOST_BUFFERS; i++)
        PyBuffer_Release(&buffers->view[i]); /* does nothing to a view that was never filled */
}

/* Whether the items of a view are of a type, named as in the struct module and in NumPy: i for int64, b for int8, d for
   double, z for complex double (of which the kernel sees two doubles). */
static int of_type(const Py_buffer *view, char type) {
    const char *format = view->format ? view->format : "B";
    switch (type) {
    case 'i': return view->itemsize == 8 && (strcmp(format, "q") == 0 || strcmp(format, "l") == 0);
    case 'b': return strcmp(format, "b") == 0;
    case 'z': return strcmp(format, "Zd") == 0;
    default: return strcmp(format, "d") == 0;
    }
}

/* The contiguous buffers of some objects, whose types a string gives, capital letters for those that are written to.
   Objects that were not given (NULL) leave their view empty. */
static int take(struct buffers *buffers, PyObject *const *objects, const char *types) {
    for (int i = 0; types[i] && objects[i]; i++) {
        char type = types[i] | 0x20;
        int flags = PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | (type == types[i] ? 0 : PyBUF_WRITABLE);
        if (PyObject_GetBuffer(objects[i], &buffers->view[i], flags) < 0)
            return 0;
        if (!of_type(&buffers->view[i], type)) {
            PyErr_Format(PyExc_TypeError, "array %d has items of type %s instead of %c", i, buffers->view[i].format, type);
            return 0;
        }
    }
    return 1;
}

/* Whether the product of the non-negative dimensions times the item's size is the buffer's length. */
static int fits(const Py_buffer *view, Py_ssize_t item, int dimensions, const Py_ssize_t *shape) {
    Py_ssize_t size = item;
    for (int i = 0; i < dimensions; i++) {
        if (shape[i] < 0 || (shape[i] > 0 && size > PY_SSIZE_T_MAX / shape[i]))
            return 0;
        size *= shape[i];
    }
    return view->len == size;
}

#define FITS(view, item, ...)                                                                                              \
    fits(view, item, (int)(sizeof((Py_ssize_t[]){__VA_ARGS__}) / sizeof(Py_ssize_t)), (Py_ssize_t[]){__VA_ARGS__})

/* A buffer for a result that may be left out by giving an empty one. */
static void *wanted(const Py_buffer *view) { return view->len ? view->buf : NULL; }

static int indices_within(const Py_buffer *view, Py_ssize_t count, int64_t end) {
    const int64_t *index = view->buf;
    for (Py_ssize_t i = 0; i < count; i++)
        if (index[i] < 0 || index[i] >= end)
            return 0;
    return 1;
}

/* Whether non-zero frequencies come two by two. */
static int in_pairs(const double *frequency, Py_ssize_t m) {
    Py_ssize_t i = 0;
    while (i < m)
        i += frequency[i] != 0 ? 2 : 1;
    return i == m;
}

/* The end of every function: an exception when something did not fit or memory ran out, else None. */
static PyObject *finish(struct buffers *buffers, int fit, int failed) {
    release(buffers);
    if (PyErr_Occurred())
        return NULL;
    if (!fit) {
        PyErr_SetString(PyExc_ValueError, "the arrays do not have the shapes they should have");
        return NULL;
    }
    if (failed)
        return PyErr_NoMemory();
    Py_RETURN_NONE;
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

/* The arguments of every function of conservative patterns: level, numbers, then the objects of the pattern. */
#define PATTERN "s(nnnnd(ddddd))OOOO"
#define PATTERN_ARGUMENTS                                                                                                 \
    &name, &rows, &segments, &states, &n, &pattern.cycles, &pattern.limits.edge, &pattern.limits.discriminant,            \
        &pattern.limits.growth, &pattern.limits.coefficient, &pattern.limits.large, &o[0], &o[1], &o[2], &o[3]
#define PATTERN_TYPES "ddid"

static int set_conservative(struct conservative *pattern, Py_ssize_t rows, Py_ssize_t segments, Py_ssize_t states,
                            Py_ssize_t n, const Py_buffer *view) {
    pattern->rows = rows, pattern->segments = segments, pattern->states = states, pattern->n = n;
    pattern->squared = view[0].buf, pattern->fractions = view[1].buf;
    pattern->state = view[2].buf, pattern->change = view[3].buf;
    return n > 0 && segments > 0 && FITS(&view[0], 8, rows, states, n) && FITS(&view[1], 8, rows, segments) &&
           FITS(&view[2], 8, segments) && FITS(&view[3], 8, rows, segments, n, n) &&
           indices_within(&view[2], segments, states);
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
        Py_BEGIN_ALLOW_THREADS
        failed = level->scan(&pattern, first, last, points, b.view[4].buf, b.view[5].buf, b.view[6].buf,
                             wanted(&b.view[7]), wanted(&b.view[8]));
        Py_END_ALLOW_THREADS
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
        Py_BEGIN_ALLOW_THREADS
        failed = level->monodromy(&pattern, first, last, b.view[4].buf, b.view[5].buf, b.view[6].buf, b.view[7].buf);
        Py_END_ALLOW_THREADS
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
        Py_BEGIN_ALLOW_THREADS
        failed = level->traces(&pattern, first, last, points, bound, b.view[4].buf, b.view[5].buf);
        Py_END_ALLOW_THREADS
    }
    return finish(&b, fit, failed);
}

static PyObject *py_scan_damped(PyObject *self, PyObject *arguments) {
    (void)self;
    struct buffers b = {0};
    PyObject *o[MOST_BUFFERS] = {0};
    struct damped p;
    const char *name;
    Py_ssize_t rows, segments, states, m, first, last, points;
    Py_buffer *view = b.view;
    if (!PyArg_ParseTuple(arguments, "s(nnnnd)OOOOOnnnOOO|O", &name, &rows, &segments, &states, &m, &p.cycles, &o[0], &o[1],
                          &o[2], &o[3], &o[4], &first, &last, &points, &o[5], &o[6], &o[7], &o[8]) ||
        !take(&b, o, "dddiddDDZ"))
        return finish(&b, 1, 0);
    const struct level *level = level_named(name);
    p.rows = rows, p.segments = segments, p.states = states, p.m = m;
    p.decay = view[0].buf, p.frequency = view[1].buf, p.fractions = view[2].buf;
    p.state = view[3].buf, p.change = view[4].buf;
    int failed = 0, fit = level && m > 0 && segments > 0 && first >= 0 && last <= rows &&
                          FITS(&view[0], 8, rows, states, m) && FITS(&view[1], 8, rows, states, m) &&
                          FITS(&view[2], 8, rows, segments) && FITS(&view[3], 8, segments) &&
                          FITS(&view[4], 8, rows, segments, m, m) && FITS(&view[5], 8, rows, points) &&
                          FITS(&view[6], 8, rows, points) && FITS(&view[7], 8, rows, points) &&
                          (view[8].len == 0 || FITS(&view[8], 16, rows, points, m)) &&
                          indices_within(&view[3], segments, states);
    for (int64_t i = 0; fit && i < rows * states; i++)
        fit = in_pairs(p.frequency + i * m, m);
    if (fit) {
        Py_BEGIN_ALLOW_THREADS
        failed = level->scan_damped(&p, first, last, points, view[5].buf, view[6].buf, view[7].buf, wanted(&view[8]));
        Py_END_ALLOW_THREADS
    }
    return finish(&b, fit, failed);
}

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
        Py_BEGIN_ALLOW_THREADS
        failed = level->symmetric(0, count, n, b.view[0].buf, b.view[1].buf, b.view[2].buf);
        Py_END_ALLOW_THREADS
    }
    return finish(&b, fit, failed);
}

/* Edges and what is known of the rows come as bytes of struct edge and struct reach, because nobody knows before how many
   edges there are. */
static PyObject *py_edges(PyObject *self, PyObject *arguments) {
    (void)self;
    struct buffers b = {0};
    PyObject *o[MOST_BUFFERS] = {0}, *result = NULL;
    struct conservative pattern, coarse;
    struct order order = {.exact = &pattern, .coarse = &coarse};
    const char *name;
    Py_ssize_t rows, segments, states, n, more, kinds, first, last;
    if (!PyArg_ParseTuple(arguments, PATTERN "nnOOOOnndddOO", PATTERN_ARGUMENTS, &more, &kinds, &o[4], &o[5], &o[6], &o[7], &first,
                          &last, &order.tolerance, &order.floor, &order.density, &o[8], &o[9]) ||
        !take(&b, o, PATTERN_TYPES PATTERN_TYPES "dd"))
        return finish(&b, 1, 0);
    order.level = level_named(name);
    coarse = (struct conservative){.cycles = pattern.cycles, .limits = pattern.limits};
    int fit = order.level && set_conservative(&pattern, rows, segments, states, n, b.view) &&
              set_conservative(&coarse, rows, more, kinds, n, b.view + 4) && 0 <= first && first <= last && last <= rows &&
              FITS(&b.view[8], 8, rows) && FITS(&b.view[9], 8, rows) && order.tolerance > 0 && order.floor > 0;
    if (!fit)
        return finish(&b, 0, 0);
    struct edge *edges = NULL;
    struct reach *reach = calloc((size_t)(last - first) + 1, sizeof *reach);
    int64_t count = 0;
    int failed = !reach;
    if (!failed) {
        Py_BEGIN_ALLOW_THREADS
        failed = gearstab_edges(&order, first, last, b.view[8].buf, b.view[9].buf, &edges, &count, reach);
        Py_END_ALLOW_THREADS
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

static PyObject *py_shares(PyObject *self, PyObject *arguments) {
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
    Py_BEGIN_ALLOW_THREADS
    failed = level->shares(&pattern, &coarse, b.view[8].buf, b.view[9].buf, first, last, b.view[10].buf, b.view[11].buf, &kept);
    Py_END_ALLOW_THREADS
    if (!failed)
        result = PyBytes_FromStringAndSize((const char *)kept.share, (Py_ssize_t)kept.count * (Py_ssize_t)sizeof *kept.share);
    free(kept.share);
    if (failed)
        return finish(&b, 1, failed);
    release(&b);
    return result;
}

static PyObject *py_names(PyObject *self, PyObject *arguments) {
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
    Py_BEGIN_ALLOW_THREADS
    failed = gearstab_names(&all, &kept);
    Py_END_ALLOW_THREADS
    if (!failed)
        result = PyBytes_FromStringAndSize((const char *)kept.name, (Py_ssize_t)kept.count * (Py_ssize_t)sizeof *kept.name);
    free(kept.name);
    if (failed)
        return finish(&b, 1, failed);
    release(&b);
    return result;
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
        Py_BEGIN_ALLOW_THREADS
        gearstab_trace_change(count, n, weight, b.view[0].buf, b.view[1].buf, b.view[2].buf, b.view[3].buf);
        Py_END_ALLOW_THREADS
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
        Py_BEGIN_ALLOW_THREADS
        gearstab_trace_condition(count, n, b.view[0].buf, b.view[1].buf, b.view[2].buf, b.view[3].buf);
        Py_END_ALLOW_THREADS
    }
    return finish(&b, fit, 0);
}

static PyMethodDef METHODS[] = {
    {"levels", py_levels, METH_NOARGS, "levels(): names of the levels of vector instructions available, the best last."},
    {"scan", py_scan, METH_VARARGS,
     "scan(level, (rows, segments, states, n, cycles, limits), squared, fractions, state, change, first, last, points, omega, "
     "verdict, growth, rho=, magnified=)"},
    {"monodromy", py_monodromy, METH_VARARGS,
     "monodromy(level, (rows, segments, states, n, cycles, limits), squared, fractions, state, change, first, last, points, row, "
     "omega, matrix, scale)"},
    {"traces", py_traces, METH_VARARGS,
     "traces(level, (rows, segments, states, n, cycles, limits), squared, fractions, state, change, first, last, points, bound, "
     "omega, rho)"},
    {"scan_damped", py_scan_damped, METH_VARARGS,
     "scan_damped(level, (rows, segments, states, m, cycles), decay, frequency, fractions, state, change, first, last, "
     "points, omega, growth, scale, multipliers=)"},
    {"names", py_names, METH_VARARGS,
     "names(regions, rows, n, cycles, frequency, row, cycle, passed, meetings, shares as bytes) -> bytes of names"},
    {"trace_change", py_trace_change, METH_VARARGS, "trace_change(count, n, weight, fine, coarse, change, largest)"},
    {"trace_condition", py_trace_condition, METH_VARARGS, "trace_condition(count, n, rho, least, moved, apart)"},
    {"symmetric", py_symmetric, METH_VARARGS, "symmetric(level, count, n, matrix, values, vectors)"},
    {"edges", py_edges, METH_VARARGS,
     "edges(level, numbers, squared, fractions, state, change, segments, states, squared, fractions, state, change, first, last, "
     "tolerance, floor, density, start, stop) -> bytes of edges and of what is known of rows first..last-1"},
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
