/* The functions of damped patterns of gearstab.ckernel._kernel; a part of module.c, whose helpers they use. */

#ifndef GEARSTAB_MODULE_DAMPED_H
#define GEARSTAB_MODULE_DAMPED_H

/* The arguments of every function of damped patterns: level, numbers, then the objects of the pattern: decay, frequency, fractions,
   state, follows, change, by_speed, law. With terms >= 0 generators that go with the mesh frequency take the place of change,
   and there are as many of them as states; else there are no terms, by_speed and law are empty. */
#define DAMPED "s(nnnnnnd)OOOOOOOO"
#define DAMPED_ARGUMENTS                                                                                                  \
    &name, &rows, &segments, &states, &changes, &m, &terms, &p.cycles, &o[0], &o[1], &o[2], &o[3], &o[4], &o[5], &o[6],   \
        &o[7]
#define DAMPED_TYPES "dddiiddd"

static int set_damped(struct damped *p, Py_ssize_t rows, Py_ssize_t segments, Py_ssize_t states, Py_ssize_t changes,
                      Py_ssize_t m, Py_ssize_t terms, const Py_buffer *view) {
    p->rows = rows, p->segments = segments, p->states = states, p->changes = changes, p->m = m;
    p->decay = view[0].buf, p->frequency = view[1].buf, p->fractions = view[2].buf;
    p->state = view[3].buf, p->follows = view[4].buf, p->change = view[5].buf;
    p->generator = terms < 0 ? NULL : p->change, p->terms = terms < 0 ? 0 : terms;
    p->by_speed = view[6].buf, p->law = view[7].buf, p->limits = NULL;
    int fit = m > 0 && segments > 0 && FITS(&view[0], 8, rows, states, m) && FITS(&view[1], 8, rows, states, m) &&
              FITS(&view[2], 8, rows, segments) && FITS(&view[3], 8, segments) && FITS(&view[4], 8, segments) &&
              FITS(&view[5], 8, rows, changes, m, m) && FITS(&view[6], 8, rows, p->terms, m, m) &&
              FITS(&view[7], 8, rows, p->terms, 3) && indices_within(&view[3], segments, states) &&
              indices_within(&view[4], segments, changes) && (terms < 0 || changes == states);
    for (int64_t i = 0; fit && terms < 0 && i < rows * states; i++)
        fit = in_pairs(p->frequency + i * m, m);
    return fit;
}

static PyObject *py_scan_damped(PyObject *self, PyObject *arguments) {
    (void)self;
    struct buffers b = {0};
    PyObject *o[MOST_BUFFERS] = {0};
    struct damped p;
    const char *name;
    Py_ssize_t rows, segments, states, changes, m, terms, first, last, points;
    const Py_buffer *view = b.view + 8;
    struct limits limits = {0};
    if (!PyArg_ParseTuple(arguments, DAMPED "nnnOOO|O(ddddd)", DAMPED_ARGUMENTS, &first, &last, &points, &o[8], &o[9],
                          &o[10], &o[11], &limits.edge, &limits.discriminant, &limits.growth, &limits.coefficient,
                          &limits.large) ||
        !take(&b, o, DAMPED_TYPES "dDDZ"))
        return finish(&b, 1, 0);
    const struct level *level = level_named(name);
    int failed = 0, fit = level && set_damped(&p, rows, segments, states, changes, m, terms, b.view) && first >= 0 &&
                          last <= rows && FITS(&view[0], 8, rows, points) && FITS(&view[1], 8, rows, points) &&
                          FITS(&view[2], 8, rows, points) && (view[3].len == 0 || FITS(&view[3], 16, rows, points, m));
    if (fit) {
        p.limits = limits.coefficient > 0.0 ? &limits : NULL;
        begin_call();
        failed = level->scan_damped(&p, first, last, points, view[0].buf, view[1].buf, view[2].buf, wanted(&view[3]));
        end_call();
    }
    return finish(&b, fit, failed);
}

static PyObject *py_moduli(PyObject *self, PyObject *arguments) {
    (void)self;
    struct buffers b = {0};
    PyObject *o[MOST_BUFFERS] = {0};
    struct damped p;
    const char *name;
    Py_ssize_t rows, segments, states, changes, m, terms, first, last, points;
    const Py_buffer *view = b.view + 8;
    if (!PyArg_ParseTuple(arguments, DAMPED "nnnOOO", DAMPED_ARGUMENTS, &first, &last, &points, &o[8], &o[9], &o[10]) ||
        !take(&b, o, DAMPED_TYPES "idD"))
        return finish(&b, 1, 0);
    const struct level *level = level_named(name);
    int failed = 0, fit = level && set_damped(&p, rows, segments, states, changes, m, terms, b.view) && first >= 0 &&
                          last <= points && FITS(&view[0], 8, points) && FITS(&view[1], 8, points) &&
                          FITS(&view[2], 8, points, m) && indices_within(&view[0], points, rows);
    if (fit) {
        begin_call();
        failed = level->moduli(&p, first, last, view[0].buf, view[1].buf, view[2].buf);
        end_call();
    }
    return finish(&b, fit, failed);
}

static PyObject *py_products(PyObject *self, PyObject *arguments) {
    (void)self;
    struct buffers b = {0};
    PyObject *o[MOST_BUFFERS] = {0};
    struct damped p;
    const char *name;
    Py_ssize_t rows, segments, states, changes, m, terms, first, last, points;
    const Py_buffer *view = b.view + 8;
    if (!PyArg_ParseTuple(arguments, DAMPED "nnnOOOO", DAMPED_ARGUMENTS, &first, &last, &points, &o[8], &o[9], &o[10],
                          &o[11]) ||
        !take(&b, o, DAMPED_TYPES "idDD"))
        return finish(&b, 1, 0);
    const struct level *level = level_named(name);
    int failed = 0, fit = level && set_damped(&p, rows, segments, states, changes, m, terms, b.view) && first >= 0 &&
                          last <= points && FITS(&view[0], 8, points) && FITS(&view[1], 8, points) &&
                          FITS(&view[2], 8, points, m, m) && FITS(&view[3], 8, points) && indices_within(&view[0], points, rows);
    if (fit) {
        begin_call();
        failed = level->products(&p, first, last, view[0].buf, view[1].buf, view[2].buf, view[3].buf);
        end_call();
    }
    return finish(&b, fit, failed);
}

static PyObject *py_radii(PyObject *self, PyObject *arguments) {
    (void)self;
    struct buffers b = {0};
    PyObject *o[MOST_BUFFERS] = {0};
    struct damped p;
    struct lyapunov set;
    const char *name;
    Py_ssize_t rows, segments, states, changes, m, terms, first, last, points, bisections, doublings, unknowns;
    const Py_buffer *view = b.view + 8;
    if (!PyArg_ParseTuple(arguments, DAMPED "O(dddddddnnn)nnnOOOO", DAMPED_ARGUMENTS, &o[8], &set.part, &set.longest,
                          &set.pieces, &set.rounding, &set.largest, &set.least, &set.negligible, &bisections, &doublings,
                          &unknowns, &first, &last, &points, &o[9], &o[10], &o[11], &o[12]) ||
        !take(&b, o, DAMPED_TYPES "diddD"))
        return finish(&b, 1, 0);
    const struct level *level = level_named(name);
    set.bisections = bisections, set.doublings = doublings, set.unknowns = unknowns;
    int failed = 0, fit = level && set_damped(&p, rows, segments, states, changes, m, terms, b.view) && terms < 0 && first >= 0 &&
                          last <= points && set.longest > 0 && set.pieces >= 1 && set.pieces < 1e6 &&
                          FITS(&view[0], 8, rows, states, m, m) && FITS(&view[1], 8, points) &&
                          FITS(&view[2], 8, points) && FITS(&view[3], 8, points) && FITS(&view[4], 8, points, 2) &&
                          indices_within(&view[1], points, rows);
    if (fit) {
        begin_call();
        failed = level->radii(&p, view[0].buf, &set, first, last, view[1].buf, view[2].buf, view[3].buf, view[4].buf);
        end_call();
    }
    return finish(&b, fit, failed);
}

static PyObject *py_exponents(PyObject *self, PyObject *arguments) {
    (void)self;
    struct buffers b = {0};
    PyObject *o[MOST_BUFFERS] = {0};
    struct damped p;
    const char *name;
    Py_ssize_t rows, segments, states, changes, m, terms, first, last, points;
    const Py_buffer *view = b.view + 8;
    if (!PyArg_ParseTuple(arguments, DAMPED "nnnOO", DAMPED_ARGUMENTS, &first, &last, &points, &o[8], &o[9]) ||
        !take(&b, o, DAMPED_TYPES "dZ"))
        return finish(&b, 1, 0);
    const struct level *level = level_named(name);
    int failed = 0, fit = level && set_damped(&p, rows, segments, states, changes, m, terms, b.view) && terms < 0 && first >= 0 &&
                          FITS(&view[0], 8, rows, points) && FITS(&view[1], 16, rows, points, m) &&
                          last <= rows * ((points + RUN_OF_POINTS - 1) / RUN_OF_POINTS);
    if (fit) {
        begin_call();
        failed = level->exponents(&p, first, last, points, view[0].buf, view[1].buf);
        end_call();
    }
    return finish(&b, fit, failed);
}

static PyObject *py_graded(PyObject *self, PyObject *arguments) {
    (void)self;
    struct buffers b = {0};
    PyObject *o[MOST_BUFFERS] = {0};
    const char *name;
    Py_ssize_t count, m, first, last, points;
    if (!PyArg_ParseTuple(arguments, "snnnnnOO", &name, &count, &m, &first, &last, &points, &o[0], &o[1]) ||
        !take(&b, o, "dZ"))
        return finish(&b, 1, 0);
    const struct level *level = level_named(name);
    int failed = 0, fit = level && count > 0 && m > 0 && first >= 0 && last <= points &&
                          FITS(&b.view[0], 8, count, points, m, m) && FITS(&b.view[1], 16, points, m);
    if (fit) {
        begin_call();
        failed = level->graded(count, m, first, last, points, b.view[0].buf, b.view[1].buf);
        end_call();
    }
    return finish(&b, fit, failed);
}

static PyObject *py_light_modes(PyObject *self, PyObject *arguments) {
    (void)self;
    struct buffers b = {0};
    PyObject *o[MOST_BUFFERS] = {0};
    Py_ssize_t count, n;
    const Py_buffer *view = b.view;
    if (!PyArg_ParseTuple(arguments, "nnOOOOOOO", &count, &n, &o[0], &o[1], &o[2], &o[3], &o[4], &o[5], &o[6]) ||
        !take(&b, o, "dddZZZB"))
        return finish(&b, 1, 0);
    int failed = 0, fit = n > 0 && FITS(&view[0], 8, count, n) && FITS(&view[1], 8, count, n, n) &&
                          FITS(&view[2], 8, count, n, n) && FITS(&view[3], 16, count, 2, n) &&
                          FITS(&view[4], 16, count, 2, n, 2, n) && FITS(&view[5], 16, count, 2, n, 2, n) &&
                          FITS(&view[6], 1, count);
    if (fit) {
        begin_call();
        failed = gearstab_light_modes(count, n, view[0].buf, view[1].buf, view[2].buf, view[3].buf, view[4].buf,
                                      view[5].buf, view[6].buf);
        end_call();
    }
    return finish(&b, fit, failed);
}

#endif
