/* What every function of the door needs: arguments as checked arrays, statuses as exceptions. SPDX-License-Identifier:
 * GPL-3.0-or-later */
#ifndef PATCHLIGHT_DOOR_H
#define PATCHLIGHT_DOOR_H

#define PY_SSIZE_T_CLEAN
#include <Python.h>

#include "patchlight.h"

#include <stdbool.h>

/* What the capsules hold. */
#define EMBREE "patchlight.embree"
#define SCENE "patchlight.scene"
#define PATCHES "patchlight.patches"

/*
 * One array argument: its name for messages, its type as the buffer protocol spells it ('f' float32, 'd' float64,
 * 'i' int32, 'I' uint32, 'Q' uint64, 'B' uint8), numbers per row, rows expected (-1: any, AS_MANY_ROWS_AS(k): as the
 * k-th array of the list), and whether it is written.
 */
#define AS_MANY_ROWS_AS(k) (-2 - (k))
typedef struct door_array {
    const char *name;
    char format;
    Py_ssize_t columns, rows;
    bool is_output;
    Py_buffer view;
} door_array;

/* Fill `view` of each array from the objects in order; on failure an exception is set and nothing is held. */
bool door_arrays(PyObject *const *objects, door_array *arrays, size_t count);
void door_release(door_array *arrays, size_t count);
static inline size_t door_rows(const door_array *array) {
    return (size_t)(array->view.len / array->view.itemsize / array->columns);
}

/* Items of a tuple argument into out_objects[0 .. count); false with an exception if it is no tuple of that many. */
bool door_unpack(PyObject *tuple, Py_ssize_t count, PyObject **out_objects);

/* Whether an array holds so many numbers; an exception names it where not. */
bool door_has_numbers(const door_array *array, size_t count);

/* Patches that were cut from this scene's triangles; NULL with an exception where they were not. */
const pl_patches *door_patches(const pl_scene *scene, PyObject *capsule);

/* Whether first .. first + count - 1 are within `end`; an exception where not. */
bool door_range_fits(uint64_t first, uint64_t count, uint64_t end);

/* NULL with the exception that the status means; None for PL_OK. */
PyObject *door_result(pl_status status);

/* Functions with a file of their own: patches.c ... */
PyObject *door_create_patches(PyObject *self, PyObject *args);
PyObject *door_patch_points(PyObject *self, PyObject *args);
PyObject *door_sobol_points(PyObject *self, PyObject *args);
PyObject *door_form_factors_monte_carlo(PyObject *self, PyObject *args);
PyObject *door_form_factors_hemicube(PyObject *self, PyObject *args);
PyObject *door_openness(PyObject *self, PyObject *args);
PyObject *door_shoot(PyObject *self, PyObject *args);

/* ... and light.c. */
PyObject *door_learn_guides(PyObject *self, PyObject *args);
PyObject *door_gather(PyObject *self, PyObject *args);
PyObject *door_direct(PyObject *self, PyObject *args);
PyObject *door_smooth(PyObject *self, PyObject *args);
PyObject *door_clamp_outliers(PyObject *self, PyObject *args);
PyObject *door_smooth_graph(PyObject *self, PyObject *args);

#endif
