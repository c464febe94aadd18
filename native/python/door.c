/* Arguments in, exceptions out. SPDX-License-Identifier: GPL-3.0-or-later */
#include "door.h"

#include <string.h>

static const char *type_name(char format) {
    switch (format) {
    case 'f':
        return "float32";
    case 'd':
        return "float64";
    case 'i':
        return "int32";
    case 'I':
        return "uint32";
    case 'Q':
        return "uint64";
    default:
        return "uint8";
    }
}

/* NumPy spells 64-bit integers 'L' on some systems and 'Q' on others. */
static bool has_format(const Py_buffer *view, char format) {
    const char *found = view->format ? view->format : "B";
    if (format == 'Q')
        return (strcmp(found, "Q") == 0 || strcmp(found, "L") == 0) && view->itemsize == 8;
    if (format == 'i' || format == 'I')
        return view->itemsize == 4 && (found[0] == format || found[0] == (format == 'i' ? 'l' : 'L'));
    return found[0] == format && found[1] == 0;
}

static bool get_array(PyObject *object, const door_array *arrays, door_array *array) {
    const int flags = PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | (array->is_output ? PyBUF_WRITABLE : 0);
    if (PyObject_GetBuffer(object, &array->view, flags) < 0) {
        PyErr_Clear();
        PyErr_Format(PyExc_TypeError, "%s: expected a contiguous%s %s array", array->name,
                     array->is_output ? ", writable" : "", type_name(array->format));
        return false;
    }
    const Py_ssize_t row_size = array->view.itemsize * array->columns;
    if (!has_format(&array->view, array->format) || array->view.len % row_size != 0) {
        PyErr_Format(PyExc_TypeError, "%s: expected %s, %zd a row", array->name, type_name(array->format),
                     array->columns);
        PyBuffer_Release(&array->view);
        return false;
    }
    const Py_ssize_t rows = array->view.len / row_size;
    const Py_ssize_t wanted = array->rows <= -2 ? (Py_ssize_t)door_rows(&arrays[-2 - array->rows]) : array->rows;
    if (wanted >= 0 && rows != wanted) {
        PyErr_Format(PyExc_ValueError, "%s: expected %zd rows, got %zd", array->name, wanted, rows);
        PyBuffer_Release(&array->view);
        return false;
    }
    return true;
}

bool door_arrays(PyObject *const *objects, door_array *arrays, size_t count) {
    for (size_t i = 0; i < count; ++i) {
        if (!get_array(objects[i], arrays, &arrays[i])) {
            door_release(arrays, i);
            return false;
        }
    }
    return true;
}

void door_release(door_array *arrays, size_t count) {
    for (size_t i = 0; i < count; ++i)
        PyBuffer_Release(&arrays[i].view);
}

bool door_unpack(PyObject *tuple, Py_ssize_t count, PyObject **out_objects) {
    if (!PyTuple_Check(tuple) || PyTuple_Size(tuple) != count) {
        PyErr_Format(PyExc_TypeError, "expected a tuple of %zd arrays", count);
        return false;
    }
    for (Py_ssize_t i = 0; i < count; ++i)
        out_objects[i] = PyTuple_GetItem(tuple, i);
    return true;
}

bool door_has_numbers(const door_array *array, size_t count) {
    const size_t found = (size_t)(array->view.len / array->view.itemsize);
    if (found != count)
        PyErr_Format(PyExc_ValueError, "%s: expected %zu numbers, got %zu", array->name, count, found);
    return found == count;
}

const pl_patches *door_patches(const pl_scene *scene, PyObject *capsule) {
    const pl_patches *patches = scene ? PyCapsule_GetPointer(capsule, PATCHES) : NULL;
    if (patches && !pl_patches_fit(patches, scene)) {
        PyErr_SetString(PyExc_ValueError, "patches: cut from another number of triangles than the scene has");
        return NULL;
    }
    return patches;
}

bool door_range_fits(uint64_t first, uint64_t count, uint64_t end) {
    const bool fits = first <= end && count <= end - first;
    if (!fits)
        PyErr_Format(PyExc_ValueError, "first, count: %zu and %zu leave 0 .. %zu", (size_t)first, (size_t)count,
                     (size_t)end);
    return fits;
}

PyObject *door_result(pl_status status) {
    switch (status) {
    case PL_OK:
        Py_RETURN_NONE;
    case PL_ERR_MEMORY:
        return PyErr_NoMemory();
    case PL_ERR_EMBREE:
        PyErr_SetString(PyExc_ImportError, pl_status_text(status));
        return NULL;
    default:
        PyErr_SetString(PyExc_ValueError, pl_status_text(status));
        return NULL;
    }
}
