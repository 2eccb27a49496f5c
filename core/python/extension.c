/*
 * The Python module `towline.core._core`: functions on the memory of arrays. It keeps to Python's limited API of 3.11,
 * so that one wheel serves this version and all later ones.
 */
#include "python/extension.h"

#include "available_wrench/available_wrench.h"
#include "distribution/towline_core.h"
#include "numbers/processor.h"
#include "python/arrays.h"
#include "robot.h"

#define FUNCTION(name, arguments, text) \
    {#name, (PyCFunction)(void (*)(void))towline_py_##name, METH_FASTCALL, #name arguments "\n--\n\n" text},
static PyMethodDef functions[] = {
#include "python/functions.h"
    {"finite", towline_py_finite, METH_O,
     "finite(array)\n--\n\nReturn whether all numbers of an array of float64 in C order are finite."},
    {"extent", towline_py_extent, METH_O,
     "extent(array)\n--\n\nReturn the least and the largest number of an array of finite float64 in C order."},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "_core", "The numeric core of towline, in C.", 0, functions, NULL, NULL, NULL, NULL,
};

PyTypeObject *towline_array_type;
PyObject *towline_float64;

/* Take the types of NumPy if its arrays have the fields of `numpy_array`; return 0 with an exception without NumPy. */
static int take_types(void) {
    PyObject *numpy = PyImport_ImportModule("numpy");
    PyObject *array = numpy ? PyObject_CallMethod(numpy, "zeros", "((ii))", 2, 3) : NULL;
    PyObject *dtype = array ? PyObject_GetAttrString(array, "dtype") : NULL;
    Py_buffer view;
    const int taken = dtype && PyObject_GetBuffer(array, &view, PyBUF_STRIDES | PyBUF_WRITABLE) == 0;
    if (taken) {
        const numpy_array *own = (const void *)array;
        const int flags = C_CONTIGUOUS | WRITEABLE;
        if (own->data == view.buf && own->dimensions == 2 && own->dtype == dtype && (own->flags & flags) == flags &&
            own->shape[0] == 2 && own->shape[1] == 3 && own->strides[0] == view.strides[0] &&
            own->strides[1] == view.strides[1]) {
            towline_array_type = (PyTypeObject *)Py_NewRef((PyObject *)Py_TYPE(array));
            towline_float64 = Py_NewRef(dtype);
        }
        PyBuffer_Release(&view);
    }
    Py_XDECREF(dtype);
    Py_XDECREF(array);
    Py_XDECREF(numpy);
    return taken;
}

PyMODINIT_FUNC PyInit__core(void) {
    PyObject *module = take_types() ? PyModule_Create(&definition) : NULL;
    if (module && (PyModule_AddIntConstant(module, "CABLES", TOWLINE_CABLES) < 0 ||
                   PyModule_AddIntConstant(module, "ROWS", TOWLINE_ROWS) < 0 ||
                   PyModule_AddIntConstant(module, "ROBOT_BYTES", (long)sizeof(towline_robot)) < 0 ||
                   PyModule_AddIntConstant(module, "MARGIN_CABLES", TOWLINE_MARGIN_CABLES) < 0 ||
                   PyModule_AddIntConstant(module, "MOST_CABLES", TOWLINE_MOST_CABLES) < 0 ||
                   PyModule_AddIntConstant(module, "PROCESSOR", towline_processor()) < 0 ||
                   PyModule_AddIntConstant(module, "MOST_CARRIERS", TOWLINE_MOST_CARRIERS) < 0)) {
        Py_DECREF(module);
        return NULL;
    }
    return module;
}
