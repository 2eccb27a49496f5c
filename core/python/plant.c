/* The plant for Python: runs of many states, sensors, and commands of winches. */
#include "plant/plant.h"

#include "python/arrays.h"
#include "python/extension.h"

/* Read whole numbers, and return 0 with an exception if one is none from 1 to `most`. */
static int whole_number(PyObject *argument, Py_ssize_t most, Py_ssize_t *number) {
    *number = PyLong_AsSsize_t(argument);
    if (*number == -1 && PyErr_Occurred()) { return 0; }
    if (*number < 1 || *number > most) {
        PyErr_Format(PyExc_ValueError, "steps, substeps and keep must be from 1 to %zd, got %zd", most, *number);
        return 0;
    }
    return 1;
}

TOWLINE_PY(run_plant) {
    enum { ROBOT, SETTINGS, STATES, COMMANDS, HISTORY, TENSIONS, MEANS, ARRAYS };
    enum { STEPS = ARRAYS, PERIOD, SUBSTEPS, KEEP, ALL };
    arrays given;
    Py_ssize_t steps, substeps, keep;
    if (count != ALL) {
        PyErr_Format(PyExc_TypeError, "run_plant takes %d arguments, got %zd", (int)ALL, count);
        return NULL;
    }
    const double period = PyFloat_AsDouble(arguments[PERIOD]);
    if ((period == -1 && PyErr_Occurred()) || !whole_number(arguments[STEPS], PTRDIFF_MAX / 2, &steps) ||
        !whole_number(arguments[SUBSTEPS], INT32_MAX, &substeps) ||
        !whole_number(arguments[KEEP], PTRDIFF_MAX / 2, &keep) || !take(&given, arguments, ARRAYS, ARRAYS, HISTORY)) {
        return NULL;
    }
    const towline_robot *robot = robot_of(&given);
    int fits = robot && given.of[SETTINGS] && given.view[SETTINGS].len == (Py_ssize_t)sizeof(towline_plant);
    for (int i = STATES; i < MEANS; i++) { fits = fits && given.of[i]; }
    Py_ssize_t rows = 0, commands = steps;
    if (fits) {
        const Py_ssize_t size = towline_plant_state_size(robot), width = towline_plant_command_size(robot);
        const Py_ssize_t kept = 1 + steps / keep;
        rows = given.size[STATES] / size;
        commands = rows ? given.size[COMMANDS] / width / rows : steps;
        fits = given.size[STATES] == rows * size && given.size[COMMANDS] == rows * commands * width &&
               commands >= steps && (!rows || kept <= PTRDIFF_MAX / rows / (size * DOUBLE)) &&
               given.size[HISTORY] == rows * kept * size && given.size[TENSIONS] == rows * kept * robot->cables &&
               (!given.of[MEANS] || given.size[MEANS] == rows * robot->cables);
    }
    const towline_run run = {rows, commands, steps, keep, (int32_t)substeps, period};
    FINISH(&given, fits,
           towline_plant_run(robot, (const void *)given.of[SETTINGS], &run, given.of[STATES], given.of[COMMANDS],
                             given.of[HISTORY], given.of[TENSIONS], given.of[MEANS]));
}

TOWLINE_PY(sense) {
    enum { ROBOT, STATES, MOTIONS, LENGTHS, ALL };
    arrays given;
    if (!take(&given, arguments, count, ALL, MOTIONS)) { return NULL; }
    const towline_robot *robot = robot_of(&given);
    const Py_ssize_t size = robot ? towline_plant_state_size(robot) : 1, rows = given.size[STATES] / size;
    const int fits = robot && has_size(&given, STATES, rows * size) &&
                     has_size(&given, MOTIONS, rows * 12 * (1 + robot->carriers)) &&
                     has_size(&given, LENGTHS, rows * 2 * robot->cables);
    FINISH(&given, fits, towline_plant_sense(robot, rows, given.of[STATES], given.of[MOTIONS], given.of[LENGTHS]));
}

TOWLINE_PY(winch_forces) {
    enum { ROBOT, SETTINGS, STATES, COMMANDS, ARRAYS, PERIOD = ARRAYS, ALL };
    arrays given;
    if (count != ALL) {
        PyErr_Format(PyExc_TypeError, "winch_forces takes %d arguments, got %zd", (int)ALL, count);
        return NULL;
    }
    const double period = PyFloat_AsDouble(arguments[PERIOD]);
    if ((period == -1 && PyErr_Occurred()) || !take(&given, arguments, ARRAYS, ARRAYS, COMMANDS)) { return NULL; }
    const towline_robot *robot = robot_of(&given);
    int fits = robot && given.of[SETTINGS] && given.view[SETTINGS].len == (Py_ssize_t)sizeof(towline_plant) &&
               given.of[STATES] && given.of[COMMANDS];
    Py_ssize_t rows = 0, each = 1;
    if (fits) {
        const Py_ssize_t size = towline_plant_state_size(robot), width = towline_plant_command_size(robot);
        rows = given.size[STATES] / size;
        each = rows ? given.size[COMMANDS] / width / rows : 1;
        fits = given.size[STATES] == rows * size && given.size[COMMANDS] == rows * each * width && each >= 1;
    }
    FINISH(&given, fits,
           towline_plant_winch_forces(robot, (const void *)given.of[SETTINGS], rows, each, period, given.of[STATES],
                                      given.of[COMMANDS]));
}

TOWLINE_PY(winch_lengths) {
    enum { ROBOT, STATES, LENGTHS, TENSIONS, LAST, COMMANDS, ARRAYS, PERIOD = ARRAYS, ALL };
    arrays given;
    if (count != ALL) {
        PyErr_Format(PyExc_TypeError, "winch_lengths takes %d arguments, got %zd", (int)ALL, count);
        return NULL;
    }
    const double period = PyFloat_AsDouble(arguments[PERIOD]);
    if ((period == -1 && PyErr_Occurred()) || !take(&given, arguments, ARRAYS, ARRAYS, LAST)) { return NULL; }
    const towline_robot *robot = robot_of(&given);
    int fits = robot != NULL;
    for (int i = STATES; i < ARRAYS; i++) { fits = fits && given.of[i]; }
    if (fits) {
        const Py_ssize_t size = towline_plant_state_size(robot), width = towline_plant_command_size(robot);
        const Py_ssize_t rows = given.size[STATES] / size, m = robot->cables;
        const Py_ssize_t per = rows ? given.size[COMMANDS] / rows : width;
        fits = given.size[STATES] == rows * size && given.size[LENGTHS] == rows * 2 * m &&
               given.size[TENSIONS] == rows * m && given.size[LAST] == rows * 2 * m &&
               given.size[COMMANDS] == rows * per && per >= width;
        if (fits) {
            towline_plant_winch_lengths(robot, rows, period, given.of[STATES], given.of[LENGTHS], given.of[TENSIONS],
                                        given.of[LAST], given.of[COMMANDS], per);
        }
    }
    return done(&given, fits);
}
