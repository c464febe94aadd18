/* Opening Embree's library at run time. SPDX-License-Identifier: GPL-3.0-or-later */
#include "embree.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#include <windows.h>

static void *open_library(const char *path) {
    return (void *)LoadLibraryExA(path, NULL, LOAD_LIBRARY_SEARCH_DLL_LOAD_DIR | LOAD_LIBRARY_SEARCH_DEFAULT_DIRS);
}
static void *find_symbol(void *library, const char *name) { return (void *)GetProcAddress((HMODULE)library, name); }
#else
#include <dlfcn.h>

static void *open_library(const char *path) { return dlopen(path, RTLD_NOW | RTLD_LOCAL); }
static void *find_symbol(void *library, const char *name) { return dlsym(library, name); }
#endif

/* C has no cast from void * to a function pointer: copy the bytes. */
static int load(pl_embree *embree, const char *name, void *out_function) {
    void *symbol = find_symbol(embree->library, name);
    memcpy(out_function, &symbol, sizeof symbol);
    return symbol != NULL;
}

static int load_functions(pl_embree *embree) {
    return load(embree, "rtcNewDevice", &embree->new_device) &&
           load(embree, "rtcReleaseDevice", &embree->release_device) &&
           load(embree, "rtcGetDeviceProperty", &embree->device_property) &&
           load(embree, "rtcGetDeviceError", &embree->device_error) &&
           load(embree, "rtcNewScene", &embree->new_scene) && load(embree, "rtcReleaseScene", &embree->release_scene) &&
           load(embree, "rtcSetSceneFlags", &embree->set_scene_flags) &&
           load(embree, "rtcSetSceneBuildQuality", &embree->set_scene_quality) &&
           load(embree, "rtcCommitScene", &embree->commit_scene) &&
           load(embree, "rtcNewGeometry", &embree->new_geometry) &&
           load(embree, "rtcReleaseGeometry", &embree->release_geometry) &&
           load(embree, "rtcSetNewGeometryBuffer", &embree->new_buffer) &&
           load(embree, "rtcCommitGeometry", &embree->commit_geometry) &&
           load(embree, "rtcAttachGeometry", &embree->attach_geometry) &&
           load(embree, "rtcIntersect1", &embree->intersect) && load(embree, "rtcOccluded1", &embree->occluded);
}

/* Instruction sets differ in the last places: Embree divides by approximate reciprocals. */
static int is_about(float value, float expected) { return fabsf(value - expected) < 1e-5f; }

/* The hand-made declarations hold if one known ray gives one known hit and writes nothing behind it. */
static int layout_is_as_declared(const pl_embree *embree) {
    static const float corners[9] = {0, 0, 1, 1, 0, 1, 0, 1, 1};
    static const uint32_t indices[3] = {0, 1, 2};
    RTCScene scene = embree->new_scene(embree->device);
    RTCGeometry geometry = embree->new_geometry(embree->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    void *vertex_buffer = embree->new_buffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, 3);
    void *index_buffer = embree->new_buffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, 1);
    if (vertex_buffer && index_buffer) {
        memcpy(vertex_buffer, corners, sizeof corners);
        memcpy(index_buffer, indices, sizeof indices);
    }
    embree->commit_geometry(geometry);
    embree->attach_geometry(scene, geometry);
    embree->release_geometry(geometry);
    embree->commit_scene(scene);

    RTCRayHit rayhit;
    memset(&rayhit, 0, sizeof rayhit);
    rayhit.ray.org_x = 0.25f;
    rayhit.ray.org_y = 0.5f;
    rayhit.ray.dir_z = 1;
    rayhit.ray.tfar = INFINITY;
    rayhit.ray.mask = ~0u;
    rayhit.hit.geomID = rayhit.hit.primID = RTC_INVALID_ID;
    rayhit.hit.padding[0] = 0x12345678u;
    embree->intersect(scene, &rayhit, NULL);
    embree->release_scene(scene);
    return embree->device_error(embree->device) == RTC_ERROR_NONE && vertex_buffer && index_buffer &&
           is_about(rayhit.ray.tfar, 1.0f) && rayhit.hit.primID == 0 && is_about(rayhit.hit.u, 0.25f) &&
           is_about(rayhit.hit.v, 0.5f) && rayhit.hit.Ng_z > 0 && rayhit.hit.padding[0] == 0x12345678u;
}

pl_status pl_embree_open(const char *path, pl_embree **out_embree) {
    pl_embree *embree = calloc(1, sizeof *embree);
    if (!embree)
        return PL_ERR_MEMORY;
    embree->library = open_library(path);
    if (embree->library && load_functions(embree)) {
        embree->device = embree->new_device(NULL);
        if (embree->device && embree->device_property(embree->device, RTC_DEVICE_PROPERTY_VERSION) / 100 == 404 &&
            layout_is_as_declared(embree)) {
            *out_embree = embree;
            return PL_OK;
        }
    }
    pl_embree_close(embree);
    return PL_ERR_EMBREE;
}

void pl_embree_close(pl_embree *embree) {
    if (!embree)
        return;
    if (embree->device)
        embree->release_device(embree->device);
    /* the library stays loaded: its worker threads may still be running in it */
    free(embree);
}
