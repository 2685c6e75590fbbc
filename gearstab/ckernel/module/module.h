/* What the parts of the Python module share: buffers of arrays and their checks. */

#ifndef GEARSTAB_MODULE_H
#define GEARSTAB_MODULE_H

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <string.h>

#include "kernel.h"

const struct level *level_named(const char *name);

/* stopping.c: the lock of the interpreter is released between begin_call and end_call, which says whether the call was stopped
   and raises an exception if so. */
void begin_call(void);
int end_call(void);
PyObject *py_stop(PyObject *self, PyObject *arguments);
PyObject *py_limit(PyObject *self, PyObject *arguments);

/* module_rates.c */
PyObject *py_rates(PyObject *self, PyObject *arguments);

/* module_boundaries.c */
PyObject *py_edges(PyObject *self, PyObject *arguments);
PyObject *py_shares(PyObject *self, PyObject *arguments);
PyObject *py_names(PyObject *self, PyObject *arguments);

/* module_backlash.c */
PyObject *py_follow(PyObject *self, PyObject *arguments);
PyObject *py_sampled(PyObject *self, PyObject *arguments);
PyObject *py_extremes(PyObject *self, PyObject *arguments);

enum { MOST_BUFFERS = 14 };

struct buffers {
    Py_buffer view[MOST_BUFFERS];
};

static inline void release(struct buffers *buffers) {
    for (int i = 0; i < MOST_BUFFERS; i++)
        PyBuffer_Release(&buffers->view[i]); /* does nothing to a view that was never filled */
}

/* Whether the items of a view are of a type, named as in the struct module and in NumPy: i for int64, b for int8, d for
   double, z for complex double (of which the kernel sees two doubles). */
static inline int of_type(const Py_buffer *view, char type) {
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
static inline int take(struct buffers *buffers, PyObject *const *objects, const char *types) {
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
static inline int fits(const Py_buffer *view, Py_ssize_t item, int dimensions, const Py_ssize_t *shape) {
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
static inline void *wanted(const Py_buffer *view) { return view->len ? view->buf : NULL; }

static inline int indices_within(const Py_buffer *view, Py_ssize_t count, int64_t end) {
    const int64_t *index = view->buf;
    for (Py_ssize_t i = 0; i < count; i++)
        if (index[i] < 0 || index[i] >= end)
            return 0;
    return 1;
}

/* The end of every function: an exception when something did not fit or memory ran out, else None. */
static inline PyObject *finish(struct buffers *buffers, int fit, int failed) {
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

/* The arguments of every function of conservative patterns: level, numbers, then the objects of the pattern. */
#define PATTERN "s(nnnnd(ddddd))OOOO"
#define PATTERN_ARGUMENTS                                                                                                 \
    &name, &rows, &segments, &states, &n, &pattern.cycles, &pattern.limits.edge, &pattern.limits.discriminant,            \
        &pattern.limits.growth, &pattern.limits.coefficient, &pattern.limits.large, &o[0], &o[1], &o[2], &o[3]
#define PATTERN_TYPES "ddid"

static inline int set_conservative(struct conservative *pattern, Py_ssize_t rows, Py_ssize_t segments, Py_ssize_t states,
                            Py_ssize_t n, const Py_buffer *view) {
    pattern->rows = rows, pattern->segments = segments, pattern->states = states, pattern->n = n;
    pattern->squared = view[0].buf, pattern->fractions = view[1].buf;
    pattern->state = view[2].buf, pattern->change = view[3].buf;
    return n > 0 && segments > 0 && FITS(&view[0], 8, rows, states, n) && FITS(&view[1], 8, rows, segments) &&
           FITS(&view[2], 8, segments) && FITS(&view[3], 8, rows, segments, n, n) &&
           indices_within(&view[2], segments, states);
}

#endif
