/*
 * The door between Python and the kernel: arrays in, GIL off, status to exception. No maths, no allocation of
 * results: addon/core/kernel.py does that. SPDX-License-Identifier: GPL-3.0-or-later
 */
#include "door.h"

/* A capsule keeps what it was made from alive by its context. */
static void drop_parent(PyObject *capsule) { Py_XDECREF((PyObject *)PyCapsule_GetContext(capsule)); }

static void destroy_embree(PyObject *capsule) { pl_embree_close(PyCapsule_GetPointer(capsule, EMBREE)); }

static void destroy_scene(PyObject *capsule) {
    pl_scene_destroy(PyCapsule_GetPointer(capsule, SCENE));
    drop_parent(capsule);
}

static PyObject *open_embree(PyObject *self, PyObject *args) {
    const char *path;
    pl_embree *embree = NULL;
    (void)self;
    if (!PyArg_ParseTuple(args, "s", &path))
        return NULL;
    const pl_status status = pl_embree_open(path, &embree);
    if (status != PL_OK)
        return door_result(status);
    PyObject *capsule = PyCapsule_New(embree, EMBREE, destroy_embree);
    if (!capsule)
        pl_embree_close(embree);
    return capsule;
}

static PyObject *create_scene(PyObject *self, PyObject *args) {
    enum { CLEAR_AT = 2, CLEAR_ARRAYS = 6, ARRAYS = CLEAR_AT + CLEAR_ARRAYS };
    PyObject *parent, *clear, *objects[ARRAYS];
    pl_scene *scene = NULL;
    pl_status status;
    (void)self;
    if (!PyArg_ParseTuple(args, "OOOO", &parent, &objects[0], &objects[1], &clear))
        return NULL;
    const bool is_clear = clear != Py_None;
    if (is_clear && !door_unpack(clear, CLEAR_ARRAYS, objects + CLEAR_AT))
        return NULL;
    const pl_embree *embree = PyCapsule_GetPointer(parent, EMBREE);
    door_array arrays[] = {{"vertices", 'd', 3, -1, false, {0}},
                           {"triangles", 'i', 3, -1, false, {0}},
                           {"transmittance", 'f', 3, AS_MANY_ROWS_AS(1), false, {0}},
                           {"flags", 'B', 1, AS_MANY_ROWS_AS(1), false, {0}},
                           {"maps", 'i', 1, AS_MANY_ROWS_AS(1), false, {0}},
                           {"uvs", 'f', 6, AS_MANY_ROWS_AS(1), false, {0}},
                           {"map_shapes", 'i', 3, -1, false, {0}},
                           {"pixels", 'f', 3, -1, false, {0}}};
    const size_t count = is_clear ? ARRAYS : CLEAR_AT;
    if (!embree || !door_arrays(objects, arrays, count))
        return NULL;
    pl_clear passing = {0};
    if (is_clear)
        passing = (pl_clear){arrays[2].view.buf, arrays[3].view.buf,    arrays[4].view.buf, arrays[5].view.buf,
                             arrays[6].view.buf, door_rows(&arrays[6]), arrays[7].view.buf, door_rows(&arrays[7])};

    Py_BEGIN_ALLOW_THREADS
    status = pl_scene_create(embree, arrays[0].view.buf, door_rows(&arrays[0]), arrays[1].view.buf,
                             door_rows(&arrays[1]), is_clear ? &passing : NULL, &scene);
    Py_END_ALLOW_THREADS

    door_release(arrays, count);
    if (status != PL_OK)
        return door_result(status);
    PyObject *capsule = PyCapsule_New(scene, SCENE, destroy_scene);
    if (capsule)
        PyCapsule_SetContext(capsule, Py_NewRef(parent));
    else
        pl_scene_destroy(scene);
    return capsule;
}

static PyObject *scene_centre(PyObject *self, PyObject *capsule) {
    double centre[3];
    (void)self;
    const pl_scene *scene = PyCapsule_GetPointer(capsule, SCENE);
    if (!scene)
        return NULL;
    pl_scene_centre(scene, centre);
    return Py_BuildValue("(ddd)", centre[0], centre[1], centre[2]);
}

static PyObject *closest_hits(PyObject *self, PyObject *args) {
    PyObject *capsule, *objects[4];
    (void)self;
    if (!PyArg_ParseTuple(args, "OOOOO", &capsule, &objects[0], &objects[1], &objects[2], &objects[3]))
        return NULL;
    const pl_scene *scene = PyCapsule_GetPointer(capsule, SCENE);
    door_array arrays[] = {{"origins", 'd', 3, -1, false, {0}},
                           {"directions", 'f', 3, AS_MANY_ROWS_AS(0), false, {0}},
                           {"out_triangles", 'i', 1, AS_MANY_ROWS_AS(0), true, {0}},
                           {"out_hits", 'f', 3, AS_MANY_ROWS_AS(0), true, {0}}};
    if (!scene || !door_arrays(objects, arrays, 4))
        return NULL;

    Py_BEGIN_ALLOW_THREADS
    pl_closest_hits(scene, arrays[0].view.buf, arrays[1].view.buf, door_rows(&arrays[0]), arrays[2].view.buf,
                    arrays[3].view.buf);
    Py_END_ALLOW_THREADS

    door_release(arrays, 4);
    Py_RETURN_NONE;
}

static PyObject *occluded(PyObject *self, PyObject *args) {
    PyObject *capsule, *objects[3];
    (void)self;
    if (!PyArg_ParseTuple(args, "OOOO", &capsule, &objects[0], &objects[1], &objects[2]))
        return NULL;
    const pl_scene *scene = PyCapsule_GetPointer(capsule, SCENE);
    door_array arrays[] = {{"points_from", 'd', 3, -1, false, {0}},
                           {"points_to", 'd', 3, AS_MANY_ROWS_AS(0), false, {0}},
                           {"out_occluded", 'B', 1, AS_MANY_ROWS_AS(0), true, {0}}};
    if (!scene || !door_arrays(objects, arrays, 3))
        return NULL;

    Py_BEGIN_ALLOW_THREADS
    pl_occluded(scene, arrays[0].view.buf, arrays[1].view.buf, door_rows(&arrays[0]), arrays[2].view.buf);
    Py_END_ALLOW_THREADS

    door_release(arrays, 3);
    Py_RETURN_NONE;
}

static PyObject *rasterise_texels(PyObject *self, PyObject *args) {
    PyObject *objects[4];
    int width, height;
    pl_status status = PL_ERR_ARGUMENT;
    (void)self;
    if (!PyArg_ParseTuple(args, "OiiOOO", &objects[0], &width, &height, &objects[1], &objects[2], &objects[3]))
        return NULL;
    const Py_ssize_t texels = width > 0 && height > 0 ? (Py_ssize_t)width * height : 0;
    door_array arrays[] = {{"uvs", 'f', 6, -1, false, {0}},
                           {"out_triangles", 'i', 1, texels, true, {0}},
                           {"out_distances", 'f', 1, texels, true, {0}},
                           {"out_barycentrics", 'f', 3, texels, true, {0}}};
    if (!door_arrays(objects, arrays, 4))
        return NULL;

    Py_BEGIN_ALLOW_THREADS
    status = pl_rasterise_texels(arrays[0].view.buf, door_rows(&arrays[0]), width, height, arrays[1].view.buf,
                                 arrays[2].view.buf, arrays[3].view.buf);
    Py_END_ALLOW_THREADS

    door_release(arrays, 4);
    return door_result(status);
}

static PyObject *pack_charts(PyObject *self, PyObject *args) {
    PyObject *objects[3];
    Py_ssize_t upright;
    double density;
    int width, block;
    int32_t height = 0;
    pl_status status = PL_ERR_ARGUMENT;
    (void)self;
    if (!PyArg_ParseTuple(args, "OOndiiO", &objects[0], &objects[1], &upright, &density, &width, &block, &objects[2]))
        return NULL;
    door_array arrays[] = {{"uvs", 'd', 6, -1, false, {0}},
                           {"first_triangles", 'i', 1, -1, false, {0}},
                           {"out_places", 'i', 3, -1, true, {0}}};
    if (!door_arrays(objects, arrays, 3))
        return NULL;

    Py_BEGIN_ALLOW_THREADS
    if (upright >= 0 && door_rows(&arrays[1]) == door_rows(&arrays[2]) + 1)
        status = pl_pack_charts(arrays[0].view.buf, door_rows(&arrays[0]), arrays[1].view.buf, door_rows(&arrays[2]),
                                (size_t)upright, density, width, block, arrays[2].view.buf, &height);
    Py_END_ALLOW_THREADS

    door_release(arrays, 3);
    return status == PL_OK ? PyLong_FromLong(height) : door_result(status);
}

static PyMethodDef methods[] = {
    {"open_embree", open_embree, METH_VARARGS, "open_embree(path) -> embree"},
    {"create_scene", create_scene, METH_VARARGS,
     "create_scene(embree, vertices, triangles, (transmittance, flags, maps, uvs, map_shapes, pixels) or None) -> "
     "scene"},
    {"scene_centre", scene_centre, METH_O, "scene_centre(scene) -> (x, y, z)"},
    {"closest_hits", closest_hits, METH_VARARGS, "closest_hits(scene, origins, directions, out_triangles, out_hits)"},
    {"occluded", occluded, METH_VARARGS, "occluded(scene, points_from, points_to, out_occluded)"},
    {"create_patches", door_create_patches, METH_VARARGS,
     "create_patches(apexes, first_rows, first_cells, first_pieces, owners, areas, patch_count) -> patches"},
    {"patch_points", door_patch_points, METH_VARARGS,
     "patch_points(layout, patches, samples, seed, out_triangles, out_barycentrics)"},
    {"sobol_points", door_sobol_points, METH_VARARGS, "sobol_points(first, seed, out_points)"},
    {"form_factors_monte_carlo", door_form_factors_monte_carlo, METH_VARARGS,
     "form_factors_monte_carlo(scene, patches, sides, rays, seed, out_rows)"},
    {"form_factors_hemicube", door_form_factors_hemicube, METH_VARARGS,
     "form_factors_hemicube(scene, patches, sides, resolution, positions, seed, out_rows)"},
    {"openness", door_openness, METH_VARARGS,
     "openness(scene, patches, reaches, first, count, rays, seed, out_openness)"},
    {"shoot", door_shoot, METH_VARARGS,
     "shoot(scene, patches, sides, first_samples, ray_flux, first_rays, first, count, seed, io_received, "
     "io_escaped)"},
    {"gather", door_gather, METH_VARARGS,
     "gather(scene, patches, solution, (uvs, texels, width, reach), lights, receivers, guides, selected, replicates, "
     "first, count, seed, "
     "(io_light, io_luminances)) -> rays"},
    {"learn_guides", door_learn_guides, METH_VARARGS,
     "learn_guides(scene, patches, solution, (uvs, texels, width, reach), lights, receivers, members, first_members, "
     "first, count, rays, seed, "
     "out_moments) -> rays"},
    {"direct", door_direct, METH_VARARGS,
     "direct(scene, lights, receivers, first, count, samples, is_first, seed, out_irradiance, out_variance) -> rays"},
    {"smooth", door_smooth, METH_VARARGS,
     "smooth(grid, width, height, spacing, receivers, values, variances, step, stops_on_value, first_row, "
     "row_count, out_values, out_variances)"},
    {"clamp_outliers", door_clamp_outliers, METH_VARARGS,
     "clamp_outliers(grid, width, height, spacing, receivers, values, variances, first_row, row_count, out_values)"},
    {"smooth_graph", door_smooth_graph, METH_VARARGS,
     "smooth_graph(first_edges, neighbours, nearness, values, variances, stops_on_value, first, count, out_values, "
     "out_variances)"},
    {"rasterise_texels", rasterise_texels, METH_VARARGS,
     "rasterise_texels(uvs, width, height, out_triangles, out_distances, out_barycentrics)"},
    {"pack_charts", pack_charts, METH_VARARGS,
     "pack_charts(uvs, first_triangles, upright, density, width, block, out_places) -> height"},
    {NULL, NULL, 0, NULL},
};

/* The header's numbers that Python needs, under their own names: nobody writes them out a second time. */
static int add_constants(PyObject *module) {
    static const struct {
        const char *name;
        long value;
    } constants[] = {
#define CONSTANT(name) {#name, (long)name}
        CONSTANT(PL_RAYS_STOP),          CONSTANT(PL_RAYS_MISS),       CONSTANT(PL_SHADOWS_MISS),
        CONSTANT(PL_MAP_EXTENDS),        CONSTANT(PL_FRONT_OPEN),      CONSTANT(PL_BACK_OPEN),
        CONSTANT(PL_LIGHT_POINT),        CONSTANT(PL_LIGHT_AREA),      CONSTANT(PL_LIGHT_SUN),
        CONSTANT(PL_LIGHT_MESH),         CONSTANT(PL_LIGHT_FLOATS),    CONSTANT(PL_PROFILE_SIDE),
        CONSTANT(PL_SIDE_EVEN),          CONSTANT(PL_SIDE_MIXED),      CONSTANT(PL_SIDE_LIGHT),
        CONSTANT(PL_GUIDE_CELLS),        CONSTANT(PL_EXACT_TRIANGLES), CONSTANT(PL_MANY_LIGHTS),
        CONSTANT(PL_LARGEST_COORDINATE),
#undef CONSTANT
    };
    for (size_t k = 0; k < sizeof constants / sizeof *constants; ++k)
        if (PyModule_AddIntConstant(module, constants[k].name, constants[k].value) < 0)
            return -1;
    return 0;
}

static PyModuleDef_Slot slots[] = {{Py_mod_exec, (void *)add_constants}, {0, NULL}};

static PyModuleDef definition = {
    .m_base = PyModuleDef_HEAD_INIT,
    .m_name = "_kernel",
    .m_doc = "The door to Patchlight's kernel; use addon.core.kernel.",
    .m_methods = methods,
    .m_slots = slots,
};

PyMODINIT_FUNC PyInit__kernel(void);
PyMODINIT_FUNC PyInit__kernel(void) { return PyModuleDef_Init(&definition); }
