/* The program of predictive control for Python. */
#include "horizon/horizon.h"

#include "python/arrays.h"
#include "python/extension.h"

/* Take whole numbers from arguments; return 0 with an exception if one is none. */
static int whole_numbers(PyObject *const *arguments, int count, int *numbers) {
    for (int i = 0; i < count; i++) {
        const long number = PyLong_AsLong(arguments[i]);
        if (number == -1 && PyErr_Occurred()) { return 0; }
        numbers[i] = number < 0 ? -1 : number > 1000000 ? 1000000 : (int)number;
    }
    return 1;
}

enum { STAGES, STATES, CONTROLS, SOFT, SIZES };

/* Take the sizes that a call begins with; return how many numbers of memory they need, -1 with an exception. */
static Py_ssize_t sizes_of(PyObject *const *arguments, Py_ssize_t count, Py_ssize_t wanted, int *sizes) {
    if (count != wanted) {
        PyErr_Format(PyExc_TypeError, "the function takes %zd arguments, got %zd", wanted, count);
        return -1;
    }
    if (!whole_numbers(arguments, SIZES, sizes)) { return -1; }
    const ptrdiff_t size = towline_horizon_size(sizes[STAGES], sizes[STATES], sizes[CONTROLS], sizes[SOFT]);
    if (size == 0) {
        PyErr_SetString(PyExc_ValueError,
                        "stages, states, controls and rows must be whole numbers from 1, or 0, to 1000");
        return -1;
    }
    return size;
}

static towline_horizon horizon_in(const int *sizes, int processor, double *memory) {
    return towline_horizon_in(sizes[STAGES], sizes[STATES], sizes[CONTROLS], sizes[SOFT], processor, memory);
}

TOWLINE_PY(horizon_size) {
    int sizes[SIZES];
    const Py_ssize_t size = sizes_of(arguments, count, SIZES, sizes);
    return size < 0 ? NULL : PyLong_FromSsize_t(size);
}

/* Take arrays of which the first is the memory of a horizon; return 0 with an exception if it has other numbers. */
static int take_memory(arrays *given, PyObject *const *arguments, int wanted, Py_ssize_t size) {
    if (!take(given, arguments, wanted, wanted, 0)) { return 0; }
    if (!has_size(given, 0, size)) {
        PyErr_Format(PyExc_ValueError, "the memory must have %zd numbers, got %zd", size, given->size[0]);
        release(given);
        return 0;
    }
    return 1;
}

TOWLINE_PY(horizon_places) {
    int sizes[SIZES];
    arrays given;
    const Py_ssize_t size = sizes_of(arguments, count, SIZES + 1, sizes);
    if (size < 0 || !take_memory(&given, arguments + SIZES, 1, size)) { return NULL; }
    const double *memory = given.of[0];
    const towline_horizon h = horizon_in(sizes, 0, given.of[0]);
    const struct {
        const char *name;
        const double *at;
    } arrays_of_problem[] = {
        {"H", h.H},
        {"h", h.h},
        {"G", h.G},
        {"c", h.c},
        {"start", h.start},
        {"u_min", h.u_min},
        {"u_max", h.u_max},
        {"E", h.E},
        {"d", h.d},
        {"penalty", h.penalty},
        {"square", h.square},
        {"z", h.at.z},
        {"y", h.at.y},
        {"lower", h.at.multiplier.lower},
        {"upper", h.at.multiplier.upper},
        {"force", h.at.multiplier.row},
    };
    PyObject *places = PyDict_New();
    for (size_t i = 0; places && i < sizeof arrays_of_problem / sizeof *arrays_of_problem; i++) {
        PyObject *place = PyLong_FromSsize_t(arrays_of_problem[i].at - memory);
        if (!place || PyDict_SetItemString(places, arrays_of_problem[i].name, place) < 0) { Py_CLEAR(places); }
        Py_XDECREF(place);
    }
    release(&given);
    return places;
}

TOWLINE_PY(horizon_relative_to) {
    enum { REFERENCE_STATES, REFERENCE_CONTROLS, MEMORY, ARRAYS };
    int whole[SIZES + 1];
    arrays given;
    const Py_ssize_t size = sizes_of(arguments, count, SIZES + 1 + ARRAYS, whole);
    if (size < 0 || !whole_numbers(arguments, SIZES + 1, whole) ||
        !take(&given, arguments + SIZES + 1, ARRAYS, ARRAYS, MEMORY)) {
        return NULL;
    }
    const int N = whole[STAGES];
    const int fits = given.size[MEMORY] == size &&
                     given.size[REFERENCE_STATES] == (Py_ssize_t)(N + 1) * whole[STATES] &&
                     given.size[REFERENCE_CONTROLS] == (Py_ssize_t)N * whole[CONTROLS];
    if (fits) {
        const towline_horizon h = horizon_in(whole, whole[SIZES], given.of[MEMORY]);
        towline_horizon_relative_to(&h, given.of[REFERENCE_STATES], given.of[REFERENCE_CONTROLS]);
    }
    release(&given);
    if (!fits) {
        PyErr_SetString(PyExc_ValueError, "states must be (N + 1, n) and controls (N, m), in the order of rows");
        return NULL;
    }
    Py_RETURN_NONE;
}

TOWLINE_PY(horizon_solve) {
    enum { PROCESSOR = SIZES, BEGINNING, ITERATIONS, WHOLE };
    enum { TOLERANCE = WHOLE, MEMORY, RESIDUALS, ALL };
    int whole[WHOLE];
    arrays given;
    const Py_ssize_t size = sizes_of(arguments, count, ALL, whole);
    if (size < 0 || !whole_numbers(arguments, WHOLE, whole)) { return NULL; }
    const double tolerance = PyFloat_AsDouble(arguments[TOLERANCE]);
    if (PyErr_Occurred() || !take_memory(&given, arguments + MEMORY, ALL - MEMORY, size)) { return NULL; }
    double *residuals = given.of[1];
    towline_horizon_result result = {{0, 0, 0, 0}, 0, 0};
    const int fits = has_size(&given, 1, 4);
    if (fits) {
        Py_BEGIN_ALLOW_THREADS;
        const towline_horizon h = horizon_in(whole, whole[PROCESSOR], given.of[0]);
        result = towline_solve_horizon(&h, (towline_beginning)whole[BEGINNING], tolerance, whole[ITERATIONS]);
        residuals[0] = result.residuals.stationarity;
        residuals[1] = result.residuals.dynamics;
        residuals[2] = result.residuals.complementarity;
        residuals[3] = result.residuals.soft;
        Py_END_ALLOW_THREADS;
    }
    release(&given);
    if (!fits) {
        PyErr_SetString(PyExc_ValueError, "the residuals must be four numbers");
        return NULL;
    }
    return Py_BuildValue("iN", result.iterations, PyBool_FromLong(result.converged));
}
