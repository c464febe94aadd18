/*
 * The part of the door that patches, and the rays between them, go through: form factors, openness, shooting.
 * SPDX-License-Identifier: GPL-3.0-or-later
 */
#include "door.h"

static void destroy_patches(PyObject *capsule) { pl_patches_destroy(PyCapsule_GetPointer(capsule, PATCHES)); }

PyObject *door_create_patches(PyObject *self, PyObject *args) {
    PyObject *objects[6];
    pl_patches *patches = NULL;
    Py_ssize_t patch_count;
    (void)self;
    if (!PyArg_ParseTuple(args, "OOOOOOn", &objects[0], &objects[1], &objects[2], &objects[3], &objects[4], &objects[5],
                          &patch_count))
        return NULL;
    door_array arrays[] = {{"apexes", 'B', 1, -1, false, {0}},      {"first_rows", 'i', 1, -1, false, {0}},
                           {"first_cells", 'i', 1, -1, false, {0}}, {"first_pieces", 'i', 1, -1, false, {0}},
                           {"owners", 'i', 1, -1, false, {0}},      {"areas", 'f', 1, AS_MANY_ROWS_AS(4), false, {0}}};
    if (!door_arrays(objects, arrays, 6))
        return NULL;
    pl_status status = PL_ERR_ARGUMENT;
    const size_t cell_ends = door_rows(&arrays[3]), owner_count = door_rows(&arrays[4]);
    const int32_t *first_pieces = arrays[3].view.buf;
    if (door_rows(&arrays[1]) == door_rows(&arrays[0]) + 1 && door_rows(&arrays[2]) > 0 && cell_ends > 0 &&
        (!owner_count || (int64_t)owner_count == first_pieces[cell_ends - 1]) && patch_count >= 0) {
        const pl_patch_layout layout = {.apexes = arrays[0].view.buf,
                                        .first_rows = arrays[1].view.buf,
                                        .first_cells = arrays[2].view.buf,
                                        .first_pieces = first_pieces,
                                        .triangle_count = door_rows(&arrays[0]),
                                        .row_count = door_rows(&arrays[2]) - 1,
                                        .cell_count = cell_ends - 1,
                                        .owners = owner_count ? arrays[4].view.buf : NULL,
                                        .areas = arrays[5].view.buf,
                                        .patch_count = (size_t)patch_count};
        status = pl_patches_create(&layout, &patches);
    }
    door_release(arrays, 6);
    if (status != PL_OK)
        return door_result(status);
    PyObject *capsule = PyCapsule_New(patches, PATCHES, destroy_patches);
    if (!capsule)
        pl_patches_destroy(patches);
    return capsule;
}

PyObject *door_patch_points(PyObject *self, PyObject *args) {
    PyObject *capsule, *objects[3];
    unsigned samples, seed;
    pl_status status;
    (void)self;
    if (!PyArg_ParseTuple(args, "OOIIOO", &capsule, &objects[0], &samples, &seed, &objects[1], &objects[2]))
        return NULL;
    const pl_patches *patches = PyCapsule_GetPointer(capsule, PATCHES);
    door_array arrays[] = {{"patches", 'i', 1, -1, false, {0}},
                           {"out_triangles", 'i', 1, -1, true, {0}},
                           {"out_barycentrics", 'f', 3, -1, true, {0}}};
    if (!patches || !door_arrays(objects, arrays, 3))
        return NULL;
    const size_t points = door_rows(&arrays[0]) * samples;
    if (!door_has_numbers(&arrays[1], points) || !door_has_numbers(&arrays[2], 3 * points)) {
        door_release(arrays, 3);
        return NULL;
    }

    Py_BEGIN_ALLOW_THREADS
    status = pl_patch_points(patches, arrays[0].view.buf, door_rows(&arrays[0]), samples, seed, arrays[1].view.buf,
                             arrays[2].view.buf);
    Py_END_ALLOW_THREADS

    door_release(arrays, 3);
    return door_result(status);
}

PyObject *door_sobol_points(PyObject *self, PyObject *args) {
    PyObject *object;
    unsigned first, seed;
    (void)self;
    if (!PyArg_ParseTuple(args, "IIO", &first, &seed, &object))
        return NULL;
    door_array arrays[] = {{"out_points", 'f', 4, -1, true, {0}}};
    if (!door_arrays(&object, arrays, 1))
        return NULL;

    Py_BEGIN_ALLOW_THREADS
    pl_sobol_points(first, door_rows(&arrays[0]), seed, arrays[0].view.buf);
    Py_END_ALLOW_THREADS

    door_release(arrays, 1);
    Py_RETURN_NONE;
}

/* What every form factor estimator takes: the sides that it is for, and their rows. */
#define SIDES_AND_ROWS                                                                                                 \
    {"sides", 'i', 1, -1, false, {0}}, { "out_rows", 'd', 1, -1, true, {0} }

/* Fill SIDES_AND_ROWS; false with an exception, and nothing held, where the rows are not as long as there are sides. */
static bool rows_are_open(const pl_patches *patches, PyObject *const *objects, door_array *arrays) {
    if (!patches || !door_arrays(objects, arrays, 2))
        return false;
    if (door_has_numbers(&arrays[1], door_rows(&arrays[0]) * 2 * pl_patches_count(patches)))
        return true;
    door_release(arrays, 2);
    return false;
}

PyObject *door_form_factors_monte_carlo(PyObject *self, PyObject *args) {
    PyObject *capsules[2], *objects[2];
    unsigned rays, seed;
    pl_status status;
    (void)self;
    if (!PyArg_ParseTuple(args, "OOOIIO", &capsules[0], &capsules[1], &objects[0], &rays, &seed, &objects[1]))
        return NULL;
    const pl_scene *scene = PyCapsule_GetPointer(capsules[0], SCENE);
    const pl_patches *patches = door_patches(scene, capsules[1]);
    door_array arrays[] = {SIDES_AND_ROWS};
    if (!rows_are_open(patches, objects, arrays))
        return NULL;

    Py_BEGIN_ALLOW_THREADS
    status = pl_form_factors_monte_carlo(scene, patches, arrays[0].view.buf, door_rows(&arrays[0]), rays, seed,
                                         arrays[1].view.buf);
    Py_END_ALLOW_THREADS

    door_release(arrays, 2);
    return door_result(status);
}

PyObject *door_form_factors_hemicube(PyObject *self, PyObject *args) {
    PyObject *capsules[2], *objects[2];
    unsigned resolution, positions, seed;
    pl_status status;
    (void)self;
    if (!PyArg_ParseTuple(args, "OOOIIIO", &capsules[0], &capsules[1], &objects[0], &resolution, &positions, &seed,
                          &objects[1]))
        return NULL;
    const pl_scene *scene = PyCapsule_GetPointer(capsules[0], SCENE);
    const pl_patches *patches = door_patches(scene, capsules[1]);
    door_array arrays[] = {SIDES_AND_ROWS};
    if (!rows_are_open(patches, objects, arrays))
        return NULL;

    Py_BEGIN_ALLOW_THREADS
    status = pl_form_factors_hemicube(scene, patches, arrays[0].view.buf, door_rows(&arrays[0]), resolution, positions,
                                      seed, arrays[1].view.buf);
    Py_END_ALLOW_THREADS

    door_release(arrays, 2);
    return door_result(status);
}

PyObject *door_openness(PyObject *self, PyObject *args) {
    PyObject *capsules[2], *objects[2];
    Py_ssize_t first, count;
    unsigned rays, seed;
    (void)self;
    if (!PyArg_ParseTuple(args, "OOOnnIIO", &capsules[0], &capsules[1], &objects[0], &first, &count, &rays, &seed,
                          &objects[1]))
        return NULL;
    const pl_scene *scene = PyCapsule_GetPointer(capsules[0], SCENE);
    const pl_patches *patches = door_patches(scene, capsules[1]);
    const Py_ssize_t sides = patches ? 2 * (Py_ssize_t)pl_patches_count(patches) : 0;
    door_array arrays[] = {{"reaches", 'f', 1, sides, false, {0}}, {"out_openness", 'f', 1, sides, true, {0}}};
    if (!patches || !door_range_fits((size_t)first, (size_t)count, (size_t)sides) || !door_arrays(objects, arrays, 2))
        return NULL;

    Py_BEGIN_ALLOW_THREADS
    pl_openness(scene, patches, arrays[0].view.buf, (size_t)first, (size_t)count, rays, seed, arrays[1].view.buf);
    Py_END_ALLOW_THREADS

    door_release(arrays, 2);
    Py_RETURN_NONE;
}

/* Whether the sides' runs of rays rise from 0 and hold the range asked for; an exception where not. */
static bool rays_are_owned(const uint64_t *first_rays, size_t sides, uint64_t first, uint64_t count) {
    bool rises = first_rays[0] == 0;
    for (size_t side = 0; side < sides; ++side)
        rises &= first_rays[side] <= first_rays[side + 1];
    if (!rises)
        PyErr_SetString(PyExc_ValueError, "first_rays: expected numbers that rise from 0");
    return rises && door_range_fits(first, count, first_rays[sides]);
}

/* Whether all are sides of the patches; an exception where not. */
static bool are_sides(const int32_t *sides, size_t count, size_t side_count) {
    for (size_t i = 0; i < count; ++i)
        if (sides[i] < 0 || (size_t)sides[i] >= side_count) {
            PyErr_SetString(PyExc_ValueError, "sides: an index is out of range");
            return false;
        }
    return true;
}

PyObject *door_shoot(PyObject *self, PyObject *args) {
    PyObject *capsules[2], *objects[6];
    unsigned long long first, count;
    unsigned seed;
    (void)self;
    if (!PyArg_ParseTuple(args, "OOOOOOKKIOO", &capsules[0], &capsules[1], &objects[0], &objects[1], &objects[2],
                          &objects[3], &first, &count, &seed, &objects[4], &objects[5]))
        return NULL;
    const pl_scene *scene = PyCapsule_GetPointer(capsules[0], SCENE);
    const pl_patches *patches = door_patches(scene, capsules[1]);
    const size_t side_count = patches ? 2 * pl_patches_count(patches) : 0;
    door_array arrays[] = {{"sides", 'i', 1, -1, false, {0}},
                           {"first_samples", 'I', 1, AS_MANY_ROWS_AS(0), false, {0}},
                           {"ray_flux", 'Q', 3, AS_MANY_ROWS_AS(0), false, {0}},
                           {"first_rays", 'Q', 1, -1, false, {0}},
                           {"io_received", 'Q', 3, (Py_ssize_t)side_count, true, {0}},
                           {"io_escaped", 'Q', 3, 1, true, {0}}};
    if (!patches || !door_arrays(objects, arrays, 6))
        return NULL;
    const size_t sides = door_rows(&arrays[0]);
    if (!door_has_numbers(&arrays[3], sides + 1) || !are_sides(arrays[0].view.buf, sides, side_count) ||
        !rays_are_owned(arrays[3].view.buf, sides, first, count)) {
        door_release(arrays, 6);
        return NULL;
    }

    Py_BEGIN_ALLOW_THREADS
    pl_shoot(scene, patches, arrays[0].view.buf, sides, arrays[3].view.buf, arrays[1].view.buf, arrays[2].view.buf,
             first, count, seed, arrays[4].view.buf, arrays[5].view.buf);
    Py_END_ALLOW_THREADS

    door_release(arrays, 6);
    Py_RETURN_NONE;
}
