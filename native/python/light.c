/*
 * The part of the door that light at receivers goes through: direct light, guides, gathering, smoothing.
 * SPDX-License-Identifier: GPL-3.0-or-later
 */
#include "door.h"

#include <math.h>

/* The six arrays of a light table, as every function that samples lights takes them. */
#define LIGHT_ARRAYS(at)                                                                                               \
    {"light_kinds", 'i', 1, -1, false, {0}},                                                                           \
        {"light_parameters", 'f', PL_LIGHT_FLOATS, AS_MANY_ROWS_AS(at), false, {0}},                                   \
        {"light_corners", 'f', 9, -1, false, {0}}, {"light_radiances", 'f', 6, AS_MANY_ROWS_AS((at) + 2), false, {0}}, \
        {"light_cumulative", 'f', 1, AS_MANY_ROWS_AS((at) + 2), false, {0}}, {                                         \
        "light_profiles", 'f', PL_PROFILE_SIDE *PL_PROFILE_SIDE, -1, false, {0}                                        \
    }
#define RECEIVER_ARRAYS(at)                                                                                            \
    {"positions", 'd', 3, -1, false, {0}}, {"normals", 'f', 3, AS_MANY_ROWS_AS(at), false, {0}}, {                     \
        "triangle_sides", 'i', 1, AS_MANY_ROWS_AS(at), false, {0}                                                      \
    }
enum { LIGHT_ARRAY_COUNT = 6, RECEIVER_ARRAY_COUNT = 3 };

static pl_lights lights_of(const door_array *arrays) {
    return (pl_lights){arrays[0].view.buf,    arrays[1].view.buf, door_rows(&arrays[0]),
                       arrays[2].view.buf,    arrays[3].view.buf, arrays[4].view.buf,
                       door_rows(&arrays[4]), arrays[5].view.buf, door_rows(&arrays[5])};
}

static pl_receivers receivers_of(const door_array *arrays) {
    return (pl_receivers){arrays[0].view.buf, arrays[1].view.buf, arrays[2].view.buf, door_rows(&arrays[0])};
}

/* What gathering needs of the scene: 2 capsules, then the arrays of the solution, the texels, the lights, the
 * receivers. */
enum {
    SOLUTION_ARRAY_COUNT = 6,
    TEXELS_AT = SOLUTION_ARRAY_COUNT,
    TEXEL_ARRAY_COUNT = 2,
    LIGHTS_AT = TEXELS_AT + TEXEL_ARRAY_COUNT,
    RECEIVERS_AT = LIGHTS_AT + LIGHT_ARRAY_COUNT,
    GATHER_ARRAY_COUNT = RECEIVERS_AT + RECEIVER_ARRAY_COUNT
};
#define GATHER_ARRAYS(sides)                                                                                           \
    {"radiosity", 'f', 3, sides, false, {0}}, {"direct", 'f', 3, sides, false, {0}},                                   \
        {"reflectance", 'f', 3, sides, false, {0}}, {"kinds", 'B', 1, sides, false, {0}},                              \
        {"reaches", 'f', 1, sides, false, {0}}, {"sky", 'f', 3, -1, false, {0}},                                       \
        {"texel_uvs", 'f', 6, -1, false, {0}}, {"texel_light", 'Q', 1, -1, false, {0}}, LIGHT_ARRAYS(LIGHTS_AT),       \
        RECEIVER_ARRAYS(RECEIVERS_AT)

static pl_solution solution_of(const door_array *arrays) {
    const size_t texels = door_rows(&arrays[5]), side = (size_t)(sqrt((double)texels) + 0.5);
    return (pl_solution){arrays[0].view.buf,
                         arrays[1].view.buf,
                         arrays[2].view.buf,
                         arrays[3].view.buf,
                         arrays[4].view.buf,
                         arrays[5].view.buf,
                         side * side == texels ? side : 0};
}

/* `width` 0: no texel has a light of its own yet. */
static pl_texel_light texels_of(const door_array *arrays, int32_t width, float reach) {
    const int32_t height = width > 0 ? (int32_t)(door_rows(&arrays[1]) / (size_t)width) : 0;
    return (pl_texel_light){arrays[0].view.buf, arrays[1].view.buf, width, height, door_rows(&arrays[0]), reach};
}

/* The tuples (solution, lights, receivers) into objects[0 .. GATHER_ARRAY_COUNT); false with an exception. */
static bool unpack_gather(PyObject *const *tuples, PyObject **out_objects) {
    return door_unpack(tuples[0], SOLUTION_ARRAY_COUNT, out_objects) &&
           door_unpack(tuples[1], LIGHT_ARRAY_COUNT, out_objects + LIGHTS_AT) &&
           door_unpack(tuples[2], RECEIVER_ARRAY_COUNT, out_objects + RECEIVERS_AT);
}

/* The arrays as the kernel takes them; `scene` points into the rest. */
typedef struct gather_view {
    pl_solution solution;
    pl_texel_light texels;
    pl_lights lights;
    pl_receivers receivers;
    pl_gather_scene scene;
} gather_view;

static void view_gather(const door_array *arrays, const pl_scene *scene, const pl_patches *patches, int32_t width,
                        float reach, gather_view *out) {
    out->solution = solution_of(arrays);
    out->texels = texels_of(arrays + TEXELS_AT, width, reach);
    out->lights = lights_of(arrays + LIGHTS_AT);
    out->receivers = receivers_of(arrays + RECEIVERS_AT);
    out->scene = (pl_gather_scene){scene, patches, &out->solution, width > 0 ? &out->texels : NULL, &out->lights};
}

PyObject *door_gather(PyObject *self, PyObject *args) {
    enum { GROUPS = GATHER_ARRAY_COUNT, SHARES, SELECTED, LIGHT, LUMINANCES, ARRAYS };
    PyObject *capsules[2], *tuples[3], *guide_arrays, *sums, *objects[ARRAYS];
    pl_gather_rays rays;
    int width;
    float reach;
    uint64_t traced = 0;
    pl_status status;
    (void)self;
    if (!PyArg_ParseTuple(args, "OOO(OOif)OOOOIIIIO", &capsules[0], &capsules[1], &tuples[0], &objects[TEXELS_AT],
                          &objects[TEXELS_AT + 1], &width, &reach, &tuples[1], &tuples[2], &guide_arrays,
                          &objects[SELECTED], &rays.replicates, &rays.first, &rays.count, &rays.seed, &sums))
        return NULL;
    const pl_scene *scene = PyCapsule_GetPointer(capsules[0], SCENE);
    const pl_patches *patches = door_patches(scene, capsules[1]);
    const Py_ssize_t sides = patches ? 2 * (Py_ssize_t)pl_patches_count(patches) : 0;
    door_array arrays[] = {GATHER_ARRAYS(sides),
                           {"guide_groups", 'i', 1, AS_MANY_ROWS_AS(RECEIVERS_AT), false, {0}},
                           {"guide_shares", 'f', PL_GUIDE_CELLS, -1, false, {0}},
                           {"selected", 'I', 1, -1, false, {0}},
                           {"io_light", 'f', 3, AS_MANY_ROWS_AS(RECEIVERS_AT), true, {0}},
                           {"io_luminances", 'f', 1, -1, true, {0}}};
    if (!patches || !unpack_gather(tuples, objects) || !door_unpack(guide_arrays, 2, objects + GROUPS) ||
        !door_unpack(sums, 2, objects + LIGHT) || !door_arrays(objects, arrays, ARRAYS))
        return NULL;
    if (!door_has_numbers(&arrays[LUMINANCES], (size_t)rays.replicates * door_rows(&arrays[RECEIVERS_AT]))) {
        door_release(arrays, ARRAYS);
        return NULL;
    }
    gather_view in;
    view_gather(arrays, scene, patches, width, reach, &in);
    const pl_guides guides = {arrays[GROUPS].view.buf, arrays[SHARES].view.buf, door_rows(&arrays[SHARES])};

    Py_BEGIN_ALLOW_THREADS
    status = pl_gather(&in.scene, &in.receivers, &guides, arrays[SELECTED].view.buf, door_rows(&arrays[SELECTED]), rays,
                       arrays[LIGHT].view.buf, arrays[LUMINANCES].view.buf, &traced);
    Py_END_ALLOW_THREADS

    door_release(arrays, ARRAYS);
    return status == PL_OK ? PyLong_FromUnsignedLongLong(traced) : door_result(status);
}

PyObject *door_learn_guides(PyObject *self, PyObject *args) {
    enum { MEMBERS = GATHER_ARRAY_COUNT, FIRST_MEMBERS, MOMENTS, ARRAYS };
    PyObject *capsules[2], *tuples[3], *objects[ARRAYS];
    Py_ssize_t first, count;
    unsigned rays, seed;
    int width;
    float reach;
    uint64_t traced = 0;
    pl_status status = PL_ERR_ARGUMENT;
    (void)self;
    if (!PyArg_ParseTuple(args, "OOO(OOif)OOOOnnIIO", &capsules[0], &capsules[1], &tuples[0], &objects[TEXELS_AT],
                          &objects[TEXELS_AT + 1], &width, &reach, &tuples[1], &tuples[2], &objects[MEMBERS],
                          &objects[FIRST_MEMBERS], &first, &count, &rays, &seed, &objects[MOMENTS]))
        return NULL;
    const pl_scene *scene = PyCapsule_GetPointer(capsules[0], SCENE);
    const pl_patches *patches = door_patches(scene, capsules[1]);
    const Py_ssize_t sides = patches ? 2 * (Py_ssize_t)pl_patches_count(patches) : 0;
    door_array arrays[] = {GATHER_ARRAYS(sides),
                           {"members", 'I', 1, -1, false, {0}},
                           {"first_members", 'I', 1, -1, false, {0}},
                           {"out_moments", 'f', PL_GUIDE_CELLS, -1, true, {0}}};
    if (!patches || !unpack_gather(tuples, objects) || !door_arrays(objects, arrays, ARRAYS))
        return NULL;
    gather_view in;
    view_gather(arrays, scene, patches, width, reach, &in);
    const uint32_t *starts = arrays[FIRST_MEMBERS].view.buf;
    const size_t groups = door_rows(&arrays[FIRST_MEMBERS]) ? door_rows(&arrays[FIRST_MEMBERS]) - 1 : 0;
    if (!door_range_fits((uint64_t)first, (uint64_t)count,
                         groups < door_rows(&arrays[MOMENTS]) ? groups : door_rows(&arrays[MOMENTS]))) {
        door_release(arrays, ARRAYS);
        return NULL;
    }
    bool fits = true;
    for (Py_ssize_t group = first; fits && group < first + count; ++group)
        fits = starts[group] <= starts[group + 1] && starts[group + 1] <= door_rows(&arrays[MEMBERS]);

    Py_BEGIN_ALLOW_THREADS
    if (fits)
        status = pl_learn_guides(&in.scene, &in.receivers, arrays[MEMBERS].view.buf, arrays[FIRST_MEMBERS].view.buf,
                                 (size_t)first, (size_t)count, rays, seed, arrays[MOMENTS].view.buf, &traced);
    Py_END_ALLOW_THREADS

    door_release(arrays, ARRAYS);
    return status == PL_OK ? PyLong_FromUnsignedLongLong(traced) : door_result(status);
}

PyObject *door_direct(PyObject *self, PyObject *args) {
    enum { RECEIVERS = LIGHT_ARRAY_COUNT, IRRADIANCE = RECEIVERS + RECEIVER_ARRAY_COUNT, VARIANCE, ARRAYS };
    PyObject *capsule, *light_arrays, *receiver_arrays, *objects[ARRAYS];
    Py_ssize_t first, count;
    unsigned samples, seed;
    int is_first;
    uint64_t rays = 0;
    pl_status status;
    (void)self;
    if (!PyArg_ParseTuple(args, "OOOnnIpIOO", &capsule, &light_arrays, &receiver_arrays, &first, &count, &samples,
                          &is_first, &seed, &objects[IRRADIANCE], &objects[VARIANCE]))
        return NULL;
    const pl_scene *scene = PyCapsule_GetPointer(capsule, SCENE);
    door_array arrays[] = {LIGHT_ARRAYS(0),
                           RECEIVER_ARRAYS(RECEIVERS),
                           {"out_irradiance", 'f', 3, AS_MANY_ROWS_AS(RECEIVERS), true, {0}},
                           {"out_variance", 'f', 1, AS_MANY_ROWS_AS(RECEIVERS), true, {0}}};
    if (!scene || !door_unpack(light_arrays, LIGHT_ARRAY_COUNT, objects) ||
        !door_unpack(receiver_arrays, RECEIVER_ARRAY_COUNT, objects + RECEIVERS) ||
        !door_arrays(objects, arrays, ARRAYS))
        return NULL;
    const pl_lights lights = lights_of(arrays);
    const pl_receivers receivers = receivers_of(arrays + RECEIVERS);
    if (!door_range_fits((uint64_t)first, (uint64_t)count, receivers.count)) {
        door_release(arrays, ARRAYS);
        return NULL;
    }

    Py_BEGIN_ALLOW_THREADS
    status = pl_direct(scene, &lights, &receivers, (size_t)first, (size_t)count, samples, is_first, seed,
                       arrays[IRRADIANCE].view.buf, arrays[VARIANCE].view.buf, &rays);
    Py_END_ALLOW_THREADS

    door_release(arrays, ARRAYS);
    return status == PL_OK ? PyLong_FromUnsignedLongLong(rays) : door_result(status);
}

/* Whether all indices are `least` or more and below `end`; an exception names the array where one is not. */
static bool indices_are_valid(const int32_t *indices, size_t count, int32_t least, size_t end, const char *name) {
    for (size_t i = 0; i < count; ++i) {
        if (indices[i] < least || (indices[i] >= 0 && (size_t)indices[i] >= end)) {
            PyErr_Format(PyExc_ValueError, "%s: %d is no index below %zu", name, (int)indices[i], end);
            return false;
        }
    }
    return true;
}

static Py_ssize_t grid_size(const pl_texel_grid *grid) {
    return grid->width > 0 && grid->height > 0 ? (Py_ssize_t)grid->width * grid->height : 0;
}

/* Texels without a receiver have any index below 0. */
static bool grid_is_valid(const pl_texel_grid *grid, size_t receivers) {
    return grid->width >= 0 && grid->height >= 0 &&
           indices_are_valid(grid->receivers, (size_t)grid_size(grid), INT32_MIN, receivers, "grid");
}

/* The grid that stands behind the receivers' arrays, some rows of which a call is for; else all are released. */
static bool grid_fits(door_array *arrays, size_t count, pl_texel_grid *grid, int first_row, int row_count) {
    grid->receivers = arrays[RECEIVER_ARRAY_COUNT].view.buf;
    if (grid_is_valid(grid, receivers_of(arrays).count) &&
        door_range_fits((size_t)first_row, (size_t)row_count, (size_t)grid->height))
        return true;
    if (!PyErr_Occurred())
        PyErr_SetString(PyExc_ValueError, "grid: its size is none");
    door_release(arrays, count);
    return false;
}

PyObject *door_smooth(PyObject *self, PyObject *args) {
    enum { VALUES = RECEIVER_ARRAY_COUNT + 1, VARIANCES, OUT_VALUES, OUT_VARIANCES, ARRAYS };
    PyObject *receiver_arrays, *objects[ARRAYS];
    pl_texel_grid grid;
    int step, stops_on_value, first_row, row_count;
    pl_status status;
    (void)self;
    if (!PyArg_ParseTuple(args, "OiifOOOiiiiOO", &objects[RECEIVER_ARRAY_COUNT], &grid.width, &grid.height,
                          &grid.spacing, &receiver_arrays, &objects[VALUES], &objects[VARIANCES], &step,
                          &stops_on_value, &first_row, &row_count, &objects[OUT_VALUES], &objects[OUT_VARIANCES]))
        return NULL;
    door_array arrays[] = {RECEIVER_ARRAYS(0),
                           {"grid", 'i', 1, grid_size(&grid), false, {0}},
                           {"values", 'f', 3, AS_MANY_ROWS_AS(0), false, {0}},
                           {"variances", 'f', 1, AS_MANY_ROWS_AS(0), false, {0}},
                           {"out_values", 'f', 3, AS_MANY_ROWS_AS(0), true, {0}},
                           {"out_variances", 'f', 1, AS_MANY_ROWS_AS(0), true, {0}}};
    if (!door_unpack(receiver_arrays, RECEIVER_ARRAY_COUNT, objects) || !door_arrays(objects, arrays, ARRAYS) ||
        !grid_fits(arrays, ARRAYS, &grid, first_row, row_count))
        return NULL;
    const pl_receivers receivers = receivers_of(arrays);

    Py_BEGIN_ALLOW_THREADS
    status = pl_smooth(&grid, &receivers, arrays[VALUES].view.buf, arrays[VARIANCES].view.buf, step, stops_on_value,
                       first_row, row_count, arrays[OUT_VALUES].view.buf, arrays[OUT_VARIANCES].view.buf);
    Py_END_ALLOW_THREADS

    door_release(arrays, ARRAYS);
    return door_result(status);
}

PyObject *door_clamp_outliers(PyObject *self, PyObject *args) {
    enum { VALUES = RECEIVER_ARRAY_COUNT + 1, VARIANCES, OUT_VALUES, ARRAYS };
    PyObject *receiver_arrays, *objects[ARRAYS];
    pl_texel_grid grid;
    int first_row, row_count;
    pl_status status;
    (void)self;
    if (!PyArg_ParseTuple(args, "OiifOOOiiO", &objects[RECEIVER_ARRAY_COUNT], &grid.width, &grid.height, &grid.spacing,
                          &receiver_arrays, &objects[VALUES], &objects[VARIANCES], &first_row, &row_count,
                          &objects[OUT_VALUES]))
        return NULL;
    door_array arrays[] = {RECEIVER_ARRAYS(0),
                           {"grid", 'i', 1, grid_size(&grid), false, {0}},
                           {"values", 'f', 3, AS_MANY_ROWS_AS(0), false, {0}},
                           {"variances", 'f', 1, AS_MANY_ROWS_AS(0), false, {0}},
                           {"out_values", 'f', 3, AS_MANY_ROWS_AS(0), true, {0}}};
    if (!door_unpack(receiver_arrays, RECEIVER_ARRAY_COUNT, objects) || !door_arrays(objects, arrays, ARRAYS) ||
        !grid_fits(arrays, ARRAYS, &grid, first_row, row_count))
        return NULL;
    const pl_receivers receivers = receivers_of(arrays);

    Py_BEGIN_ALLOW_THREADS
    status = pl_clamp_outliers(&grid, &receivers, arrays[VALUES].view.buf, arrays[VARIANCES].view.buf, first_row,
                               row_count, arrays[OUT_VALUES].view.buf);
    Py_END_ALLOW_THREADS

    door_release(arrays, ARRAYS);
    return door_result(status);
}

/* Whether the edges of `count` values are runs, one after the other, of `edge_count` in all. */
static bool runs_are_valid(const int32_t *first_edges, size_t count, size_t edge_count) {
    bool is_valid = first_edges[0] == 0 && (size_t)first_edges[count] == edge_count;
    for (size_t i = 0; is_valid && i < count; ++i)
        is_valid = first_edges[i] <= first_edges[i + 1];
    if (!is_valid)
        PyErr_SetString(PyExc_ValueError, "first_edges: they are no runs of the neighbours");
    return is_valid;
}

PyObject *door_smooth_graph(PyObject *self, PyObject *args) {
    enum { FIRST_EDGES, NEIGHBOURS, NEARNESS, VALUES, VARIANCES, OUT_VALUES, OUT_VARIANCES, ARRAYS };
    PyObject *objects[ARRAYS];
    int stops_on_value;
    Py_ssize_t first, count;
    pl_status status;
    (void)self;
    if (!PyArg_ParseTuple(args, "OOOOOinnOO", &objects[FIRST_EDGES], &objects[NEIGHBOURS], &objects[NEARNESS],
                          &objects[VALUES], &objects[VARIANCES], &stops_on_value, &first, &count, &objects[OUT_VALUES],
                          &objects[OUT_VARIANCES]))
        return NULL;
    door_array arrays[] = {{"first_edges", 'i', 1, -1, false, {0}},
                           {"neighbours", 'i', 1, -1, false, {0}},
                           {"nearness", 'f', 1, AS_MANY_ROWS_AS(NEIGHBOURS), false, {0}},
                           {"values", 'f', 3, -1, false, {0}},
                           {"variances", 'f', 1, AS_MANY_ROWS_AS(VALUES), false, {0}},
                           {"out_values", 'f', 3, AS_MANY_ROWS_AS(VALUES), true, {0}},
                           {"out_variances", 'f', 1, AS_MANY_ROWS_AS(VALUES), true, {0}}};
    if (!door_arrays(objects, arrays, ARRAYS))
        return NULL;
    const pl_vertex_graph graph = {arrays[FIRST_EDGES].view.buf, arrays[NEIGHBOURS].view.buf,
                                   arrays[NEARNESS].view.buf};
    const size_t size = door_rows(&arrays[VALUES]), edge_count = door_rows(&arrays[NEIGHBOURS]);
    if (!door_has_numbers(&arrays[FIRST_EDGES], size + 1) || !runs_are_valid(graph.first_edges, size, edge_count) ||
        !indices_are_valid(graph.neighbours, edge_count, 0, size, "neighbours") ||
        !door_range_fits((uint64_t)first, (uint64_t)count, size)) {
        door_release(arrays, ARRAYS);
        return NULL;
    }

    Py_BEGIN_ALLOW_THREADS
    status = pl_smooth_graph(&graph, arrays[VALUES].view.buf, arrays[VARIANCES].view.buf, stops_on_value, (size_t)first,
                             (size_t)count, arrays[OUT_VALUES].view.buf, arrays[OUT_VARIANCES].view.buf);
    Py_END_ALLOW_THREADS

    door_release(arrays, ARRAYS);
    return door_result(status);
}
