/* gearstab.ckernel._kernel: the compiled kernel as Python functions over contiguous buffers.

   Shapes and meanings stand in kernel.h, the Python side in c_kernel.py and c_boundaries.py of gearstab/floquet/kernel.
   Every function describes its arguments (see module.h), of which it is checked that buffers have the sizes that the numbers
   promise; it computes without the interpreter's lock, at the level of vector instructions whose name it is given (see levels()). */

#include <stdatomic.h>

#include "module.h"

#if defined(__x86_64__)
#include <cpuid.h>
#endif

static const struct level *const LEVELS[] = {
    &gearstab_plain,
#if defined(__x86_64__)
    &gearstab_avx2,
    &gearstab_avx512,
#endif
};

enum { LEVEL_COUNT = sizeof LEVELS / sizeof *LEVELS };

/* What the processor can do, and the system keeps between processes, asked of the processor itself: the answer of
   __builtin_cpu_supports is always no where the compiler is that of zig. */
static int answered(int index) {
#if defined(__x86_64__)
    enum { FUSED = 1 << 12, KEEPS = 1 << 27, AVX = 1 << 28, AVX2 = 1 << 5, AVX512F = 1 << 16, AVX512DQ = 1 << 17 };
    const unsigned avx512vl = 1u << 31, basic = FUSED | KEEPS | AVX;
    unsigned a, b, c, d, more, kept, unused;
    if (index > 0) {
        if (!__get_cpuid(1, &a, &b, &c, &d) || (c & basic) != basic || !__get_cpuid_count(7, 0, &a, &more, &c, &d))
            return 0;
        __asm__("xgetbv" : "=a"(kept), "=d"(unused) : "c"(0));
        if (index == 1)
            return (kept & 0x6) == 0x6 && (more & AVX2);
        return (kept & 0xe6) == 0xe6 && (more & AVX512F) && (more & AVX512DQ) && (more & avx512vl);
    }
#endif
    return index == 0;
}

/* The same, asked once: virtual machines take their time, a fiftieth of small calls. */
static int supported(int index) {
    static atomic_int known[LEVEL_COUNT]; /* 0 at first, then 1 for no, 2 for yes */
    if (!atomic_load(&known[index]))
        atomic_store(&known[index], 1 + answered(index));
    return atomic_load(&known[index]) - 1;
}

const struct level *level_named(const char *name) {
    for (int i = 0; i < LEVEL_COUNT; i++)
        if (supported(i) && strcmp(name, LEVELS[i]->name) == 0)
            return LEVELS[i];
    PyErr_Format(PyExc_ValueError, "this processor has no level of vector instructions named %s", name);
    return NULL;
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

FUNCTION(symmetric, "@cn![dcnn][Dcn][Dcnn]") {
    return c->level->symmetric(0, c->n['c'], c->n['n'], array(c, 0), array(c, 1), array(c, 2));
}

FUNCTION(eigenvalues, "@cm!:c[dcmm][Zcm]") {
    return c->level->eigenvalues(c->first, c->last, c->n['m'], array(c, 0), array(c, 1));
}

FUNCTION(exponentials, "@cm!:c[dcmm][Dcmm]") {
    return c->level->exponentials(c->first, c->last, c->n['m'], array(c, 0), array(c, 1));
}

FUNCTION(graded, "@c!m!:pp[dcpmm][Zpm]") {
    return c->level->graded(c->n['c'], c->n['m'], c->first, c->last, c->n['p'], array(c, 0), array(c, 1));
}

FUNCTION(light_modes, "cn![dcn][dcnn][dcnn][Zc2n][Zc2n2n][Zc2n2n][Bc]") {
    return gearstab_light_modes(c->n['c'], c->n['n'], array(c, 0), array(c, 1), array(c, 2), array(c, 3), array(c, 4),
                                array(c, 5), array(c, 6));
}

FUNCTION(trace_change, "cn.[zcn][zcn][Dc][Dc]") {
    gearstab_trace_change(c->n['c'], c->n['n'], c->real[0], array(c, 0), array(c, 1), array(c, 2), array(c, 3));
    return 0;
}

FUNCTION(trace_condition, "cn[zcn][dc][Dc][Dc]") {
    gearstab_trace_condition(c->n['c'], c->n['n'], array(c, 0), array(c, 1), array(c, 2), array(c, 3));
    return 0;
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

#define DECLARED(name) PyObject *py_##name(PyObject *self, PyObject *arguments);
DECLARED(scan) DECLARED(rates) DECLARED(monodromy) DECLARED(traces) DECLARED(scan_damped) DECLARED(moduli)
DECLARED(products) DECLARED(radii) DECLARED(exponents) DECLARED(names) DECLARED(follow) DECLARED(sampled)
DECLARED(extremes) DECLARED(edges) DECLARED(shares) DECLARED(below)

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
    {"below", py_below, METH_VARARGS,
     "below(level, (rows, segments, states, n, cycles, limits), squared, fractions, state, change, first, last, points, lines, "
     "cycle, angle, below)"},
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
    {"eigenvalues", py_eigenvalues, METH_VARARGS, "eigenvalues(level, count, m, first, last, matrix, values)"},
    {"exponentials", py_exponentials, METH_VARARGS, "exponentials(level, count, m, first, last, matrix, result)"},
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
     "last, points, directions, across, direction, mean, turn, row, cycle) -> bytes of the shares of points first..last-1"},
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
