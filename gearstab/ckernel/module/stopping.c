/* How a call ends before its work is done: by a signal, by another thread, or because its time is up.

   Functions of the kernel ask gearstab_stopped() in their outer loops and return at once if the answer is yes; what they have
   computed by then is thrown away. */

#include <stdatomic.h>
#include <time.h>

#include "module.h"

#define INTERVAL 0.05 /* seconds between two looks at signals, which take the interpreter's lock */
#define LOOK_EVERY 16 /* questions; looking at the clock each time takes a tenth of a map of one coordinate */

static atomic_int stop_all; /* how many times all calls are asked to stop */

/* The call that runs in this thread. */
static _Thread_local struct {
    PyThreadState *thread;
    double next, limit; /* time of the next look; processor time of the end, if any, which outlives the call */
    int limited, stopped, skipped; /* skipped: questions since the last look at the clock */
} call;

static double now(void) {
    struct timespec time;
#ifdef _WIN32
    timespec_get(&time, TIME_UTC);
#else
    clock_gettime(CLOCK_MONOTONIC, &time);
#endif
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

/* Processor time of this thread, where there is a clock for it. */
static double spent(void) {
#ifdef CLOCK_THREAD_CPUTIME_ID
    struct timespec time;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
#else
    return now();
#endif
}

void begin_call(void) {
    call.stopped = call.skipped = 0;
    call.next = now() + INTERVAL;
    call.thread = PyEval_SaveThread();
}

static void raise_stopped(const char *name) {
    PyObject *module = PyImport_ImportModule("gearstab.interrupts"), *type = NULL;
    if (module)
        type = PyObject_GetAttrString(module, name);
    if (type)
        PyErr_SetNone(type);
    Py_XDECREF(type);
    Py_XDECREF(module);
}

int end_call(void) {
    PyEval_RestoreThread(call.thread);
    if (call.stopped && !PyErr_Occurred())
        raise_stopped(call.limited && spent() >= call.limit ? "TimeUp" : "Stopped");
    return call.stopped;
}

/* See kernel.h. */
int gearstab_stopped(void) {
    if (call.stopped || atomic_load_explicit(&stop_all, memory_order_relaxed))
        return call.stopped = 1;
    if (++call.skipped < LOOK_EVERY)
        return 0;
    call.skipped = 0;
    double time = now();
    if (time < call.next)
        return 0;
    call.next = time + INTERVAL;
    if (call.limited && spent() >= call.limit)
        return call.stopped = 1;
    PyEval_RestoreThread(call.thread);
    call.stopped = PyErr_CheckSignals() < 0; /* does nothing outside the main thread */
    call.thread = PyEval_SaveThread();
    return call.stopped;
}

PyObject *py_stop(PyObject *self, PyObject *arguments) {
    (void)self;
    int change;
    if (!PyArg_ParseTuple(arguments, "i", &change))
        return NULL;
    atomic_fetch_add(&stop_all, change);
    Py_RETURN_NONE;
}

PyObject *py_limit(PyObject *self, PyObject *arguments) {
    (void)self;
    double seconds;
    if (!PyArg_ParseTuple(arguments, "d", &seconds))
        return NULL;
    call.limited = seconds < 1e9;
    call.limit = spent() + seconds;
    Py_RETURN_NONE;
}
