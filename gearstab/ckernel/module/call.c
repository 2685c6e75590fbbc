/* Arguments of a call read and checked by their description, see module.h, and its results. */

#include "module.h"

#include <ctype.h>
#include <stdlib.h>

static int refuse(PyObject *type, const char *text) {
    PyErr_SetString(type, text);
    return 0;
}

static int misfit(void) { return refuse(PyExc_ValueError, "the arrays do not have the shapes they should have"); }

static int of_type(const Py_buffer *view, char type) {
    const char *format = view->format ? view->format : "B";
    switch (type) {
    case 'i': return view->itemsize == 8 && (strcmp(format, "q") == 0 || strcmp(format, "l") == 0);
    case 'b': return strcmp(format, "b") == 0;
    case 'z': return strcmp(format, "Zd") == 0;
    default: return strcmp(format, "d") == 0;
    }
}

static int take_number(PyObject *item, Py_ssize_t *number) {
    *number = PyNumber_AsSsize_t(item, PyExc_OverflowError);
    return *number != -1 || !PyErr_Occurred();
}

static int take_level(struct call *c, PyObject *item) {
    const char *name = PyUnicode_AsUTF8AndSize(item, NULL);
    return name && (c->level = level_named(name));
}

static int take_array(struct call *c, PyObject *item, const char *token) {
    char type = (char)tolower(token[1]);
    Py_buffer *view = &c->view[c->views];
    if (PyObject_GetBuffer(item, view, PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | (type == token[1] ? 0 : PyBUF_WRITABLE)) < 0)
        return 0;
    if (!of_type(view, type)) {
        PyErr_Format(PyExc_TypeError, "array %d has items of type %s instead of %c", c->views, view->format, type);
        PyBuffer_Release(view);
        return 0;
    }
    c->shape[c->views++] = token + 2;
    return 1;
}

/* Read the arguments of a tuple, up to the end of its description, to which the pointer is moved. */
static int take(struct call *c, PyObject *tuple, const char **description) {
    if (!PyTuple_Check(tuple))
        return refuse(PyExc_TypeError, "a tuple is needed");
    Py_ssize_t i = 0, count = PyTuple_Size(tuple);
    const char *token = *description;
    int fit = 1, optional = 0;
    for (; *token && *token != ')'; token++) {
        if (*token == '|') {
            optional = 1;
            continue;
        }
        if (i == count)
            return optional || refuse(PyExc_TypeError, "an argument is missing");
        PyObject *item = PyTuple_GetItem(tuple, i++);
        if (*token == '@')
            fit = take_level(c, item);
        else if (*token == '.')
            fit = (c->real[c->reals++] = PyFloat_AsDouble(item)) != -1.0 || !PyErr_Occurred();
        else if (*token == '(') {
            token++;
            fit = take(c, item, &token);
        } else if (*token == '[') {
            fit = take_array(c, item, token);
            token = strchr(token, ']');
            token += (token[1] == '<' ? 2 : 0);
            token += (token[1] == '?');
        } else if (*token == ':') {
            PyObject *end = i < count ? PyTuple_GetItem(tuple, i++) : NULL;
            if (!end)
                return refuse(PyExc_TypeError, "an argument is missing");
            fit = take_number(item, &c->first) && take_number(end, &c->last);
            token++;
        } else {
            fit = take_number(item, &c->n[(int)*token]);
            if (fit && token[1] == '!' && c->n[(int)*token++] <= 0)
                return misfit();
        }
        if (!fit)
            return 0;
    }
    *description = token;
    return i == count || refuse(PyExc_TypeError, "too many arguments");
}

static int indices_within(const Py_buffer *view, int64_t end) {
    const int64_t *index = view->buf;
    for (Py_ssize_t i = 0; i < view->len / 8; i++)
        if (index[i] < 0 || index[i] >= end)
            return 0;
    return 1;
}

/* See module.h. */
int fits(const struct call *c, int place, const char *shape) {
    const Py_buffer *view = &c->view[place];
    Py_ssize_t size = view->itemsize;
    for (; *shape && *shape != ']' && *shape != '*'; shape++) {
        Py_ssize_t extent = isdigit((unsigned char)*shape) ? *shape - '0' : c->n[(int)*shape];
        if (shape[1] == '+')
            extent += extent < PY_SSIZE_T_MAX, shape++;
        if (extent < 0 || (extent > 0 && size > PY_SSIZE_T_MAX / extent))
            return 0;
        size *= extent;
    }
    const char *after = *shape == ']' ? shape + 1 : shape;
    if (*shape == '*' || (*after == '?' && view->len == 0))
        return 1;
    return view->len == size && (*after != '<' || indices_within(view, c->n[(int)after[1]]));
}

static int all_fit(const struct call *c, const char *description) {
    for (int i = 0; i < c->views; i++)
        if (!fits(c, i, c->shape[i]))
            return 0;
    const char *part = strchr(description, ':');
    return !part || (0 <= c->first && c->first <= c->last && c->last <= c->n[(int)part[1]]);
}

static PyObject *result(const struct call *c) {
    if (c->answers)
        return Py_BuildValue("nn", c->answer[0], c->answer[1]);
    PyObject *bytes[2] = {NULL, NULL}, *both = NULL;
    for (int i = 0; i < c->results; i++)
        bytes[i] = PyByteArray_FromStringAndSize(c->kept[i] ? c->kept[i] : "", c->size[i]);
    if (c->results == 1)
        return bytes[0];
    if (c->results == 0)
        Py_RETURN_NONE;
    if (bytes[0] && bytes[1])
        both = PyTuple_Pack(2, bytes[0], bytes[1]);
    Py_XDECREF(bytes[0]);
    Py_XDECREF(bytes[1]);
    return both;
}

PyObject *called(PyObject *arguments, const char *description, int (*function)(struct call *)) {
    struct call c = {0};
    const char *end = description;
    PyObject *answer = NULL;
    if (take(&c, arguments, &end) && (all_fit(&c, description) || misfit())) {
        begin_call();
        int status = function(&c), stopped = end_call();
        if (!stopped && status == UNFIT)
            misfit();
        else if (!stopped && status)
            PyErr_NoMemory();
        else if (!stopped)
            answer = result(&c);
    }
    free(c.kept[0]);
    free(c.kept[1]);
    for (int i = 0; i < c.views; i++)
        PyBuffer_Release(&c.view[i]);
    return answer;
}
