/* What the parts of the Python module share: calls, whose arguments a string describes, and their results. */

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

enum { MOST_VIEWS = 16, MOST_REALS = 16, LETTERS = 128 };

/* A call: its arguments, by kind, and what its function gives back. */
struct call {
    const struct level *level;
    Py_ssize_t n[LETTERS]; /* whole numbers by their letters */
    Py_ssize_t first, last;
    double real[MOST_REALS];
    Py_buffer view[MOST_VIEWS];
    const char *shape[MOST_VIEWS]; /* of each view, the part of the description after its type */
    int reals, views;
    void *kept[2]; /* results whose size nobody knows before; taken as bytes and released with free */
    Py_ssize_t size[2];
    Py_ssize_t answer[2]; /* or numbers */
    int results, answers; /* how many there are of either */
};

/* Arguments are described by a token each:

     @      the level of vector instructions, by its name
     a..z   a whole number, kept under its letter; followed by ! it must be positive
     :x     two whole numbers, first and last of a part of 0..x
     .      any number
     (..)   a tuple
     [dxy]  a contiguous array: its type of items (i for int64, b for int8, d for double, z for complex double, of which the
            kernel sees two doubles; capitals for those that are written to), then its dimensions: letters of numbers or digits, with
            + for one more; * where the function asks for the dimensions itself, by fits(). Followed by <x: its items are
            indices below x; by ?: it may be empty
     |      what follows may be left out

   The function is called when all fits, without the lock of the interpreter. It returns 0, UNFIT for arguments whose
   sizes do not agree after all, or another number when there is no memory. */
enum { UNFIT = -100 };

PyObject *called(PyObject *arguments, const char *description, int (*function)(struct call *));

/* Whether an array has the dimensions of a shape, written as above. */
int fits(const struct call *c, int place, const char *shape);

#define FUNCTION(name, description)                                                                                        \
    static int run_##name(struct call *c);                                                                                 \
    PyObject *py_##name(PyObject *self, PyObject *arguments) {                                                             \
        (void)self;                                                                                                        \
        return called(arguments, description, run_##name);                                                                 \
    }                                                                                                                      \
    static int run_##name(struct call *c)

/* The memory of a view; that of a result that is not wanted if it is empty: NULL. */
static inline void *array(const struct call *c, int place) { return c->view[place].buf; }
static inline void *wanted(const struct call *c, int place) { return c->view[place].len ? c->view[place].buf : NULL; }

/* Give memory back as a result, of so many items. */
static inline void give(struct call *c, void *memory, int64_t count, size_t item) {
    c->kept[c->results] = memory;
    c->size[c->results++] = (Py_ssize_t)count * (Py_ssize_t)item;
}

/* A conservative pattern: rows, segments, states, n, cycles and limits, then squared, fractions, state, change. */
#define CONSERVATIVE "@(rg!sn!.(.....))[drsn][drg][ig]<s[drgnn]"

static inline struct conservative conservative(const struct call *c) {
    return (struct conservative){
        .rows = c->n['r'], .segments = c->n['g'], .states = c->n['s'], .n = c->n['n'], .cycles = c->real[0],
        .limits = {.edge = c->real[1], .discriminant = c->real[2], .growth = c->real[3], .coefficient = c->real[4],
                   .large = c->real[5]},
        .squared = array(c, 0), .fractions = array(c, 1), .state = array(c, 2), .change = array(c, 3)};
}

/* Another one of the same rows, cycles and limits: segments and states, then the same arrays. */
#define COARSE "h!k[drkn][drh][ih]<k[drhnn]"

static inline struct conservative coarse(const struct call *c) {
    struct conservative pattern = conservative(c);
    pattern.segments = c->n['h'], pattern.states = c->n['k'];
    pattern.squared = array(c, 4), pattern.fractions = array(c, 5), pattern.state = array(c, 6), pattern.change = array(c, 7);
    return pattern;
}

#endif
