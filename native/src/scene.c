/* The scene's BVHs, and the rays through them. SPDX-License-Identifier: GPL-3.0-or-later */
#include "clear.h"

#include <stdlib.h>
#include <string.h>

enum { SOME_PASS = PL_RAYS_MISS | PL_SHADOWS_MISS | PL_FRONT_OPEN | PL_BACK_OPEN };

static bool is_clear(const pl_scene *scene, size_t triangle) {
    if (!scene->clear.transmittance)
        return false;
    const float *t = scene->clear.transmittance + 3 * triangle;
    return t[0] > 0 || t[1] > 0 || t[2] > 0 || scene->clear.flags[triangle] & SOME_PASS;
}

static void recentre(pl_scene *scene, const double *vertices) {
    double low[3] = {0, 0, 0}, high[3] = {0, 0, 0};
    for (size_t i = 0; i < scene->vertex_count; ++i) {
        for (int k = 0; k < 3; ++k) {
            const double x = vertices[3 * i + (size_t)k];
            low[k] = i == 0 ? x : fmin(low[k], x);
            high[k] = i == 0 ? x : fmax(high[k], x);
        }
    }
    for (int k = 0; k < 3; ++k)
        scene->centre[k] = 0.5 * (low[k] + high[k]);
    for (size_t i = 0; i < 3 * scene->vertex_count; ++i)
        scene->vertices[i] = (float)(vertices[i] - scene->centre[i % 3]);
    scene->reach = (float)(0.5 * fmax(fmax(high[0] - low[0], high[1] - low[1]), high[2] - low[2]));
}

/* Whether a triangle's corners lie on a line to within their rounding: such a one must never be hit. */
static bool is_degenerate(const pl_scene *scene, int32_t triangle) {
    const vec3 a = scene_vertex(scene, triangle, 0);
    const vec3 ab = vec3_sub(scene_vertex(scene, triangle, 1), a), ac = vec3_sub(scene_vertex(scene, triangle, 2), a);
    return vec3_length(vec3_cross(ab, ac)) <= 2.4e-7f * vec3_length(ab) * vec3_length(ac);
}

/* One BVH over the triangles that are clear, or over those that are not. */
static pl_status build_layer(pl_scene *scene, bool clear, pl_layer *out_layer) {
    const pl_embree *embree = scene->embree;
    pl_status status = PL_ERR_MEMORY;
    size_t count = 0;
    RTCGeometry geometry = NULL;

    for (size_t t = 0; t < scene->triangle_count; ++t)
        count += is_clear(scene, t) == clear;
    out_layer->bvh = embree->new_scene(embree->device);
    out_layer->triangles = malloc(sizeof(int32_t) * (count + 1));
    if (!out_layer->bvh || !out_layer->triangles)
        goto done;
    /* robust: a ray through an edge shared by two triangles meets one of them */
    embree->set_scene_flags(out_layer->bvh, RTC_SCENE_FLAG_ROBUST);
    embree->set_scene_quality(out_layer->bvh, RTC_BUILD_QUALITY_HIGH);

    if (count) {
        geometry = embree->new_geometry(embree->device, RTC_GEOMETRY_TYPE_TRIANGLE);
        float *vertex_buffer = embree->new_buffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                  3 * sizeof(float), scene->vertex_count);
        uint32_t *index_buffer =
            embree->new_buffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(uint32_t), count);
        if (!vertex_buffer || !index_buffer)
            goto done;
        memcpy(vertex_buffer, scene->vertices, 3 * sizeof(float) * scene->vertex_count);
        size_t k = 0;
        for (size_t t = 0; t < scene->triangle_count; ++t) {
            if (is_clear(scene, t) != clear)
                continue;
            memcpy(index_buffer + 3 * k, scene->indices + 3 * t, 3 * sizeof(uint32_t));
            if (is_degenerate(scene, (int32_t)t))
                index_buffer[3 * k + 1] = index_buffer[3 * k + 2] = index_buffer[3 * k];
            out_layer->triangles[k++] = (int32_t)t;
        }
        embree->commit_geometry(geometry);
        embree->attach_geometry(out_layer->bvh, geometry);
    }
    embree->commit_scene(out_layer->bvh);
    /* all that can fail with arrays that were checked is memory; of a tree that was not built no ray would say so */
    if (embree->device_error(embree->device) == RTC_ERROR_NONE)
        status = PL_OK;
done:
    if (geometry)
        embree->release_geometry(geometry);
    return status;
}

static bool indices_are_in_range(const int32_t *triangles, size_t triangle_count, size_t vertex_count) {
    for (size_t i = 0; i < 3 * triangle_count; ++i)
        if (triangles[i] < 0 || (size_t)triangles[i] >= vertex_count)
            return false;
    return true;
}

/* What is farther away, or not a number, would overflow as rays square distances. */
static bool coordinates_are_in_range(const double *vertices, size_t vertex_count) {
    for (size_t i = 0; i < 3 * vertex_count; ++i)
        if (!(fabs(vertices[i]) <= PL_LARGEST_COORDINATE))
            return false;
    return true;
}

void *copy_of(const void *bytes, size_t size) {
    void *copy = malloc(size ? size : 1);
    if (copy && size)
        memcpy(copy, bytes, size);
    return copy;
}

pl_status pl_scene_create(const pl_embree *embree, const double *vertices, size_t vertex_count,
                          const int32_t *triangles, size_t triangle_count, const pl_clear *clear,
                          pl_scene **out_scene) {
    if (!indices_are_in_range(triangles, triangle_count, vertex_count) ||
        !coordinates_are_in_range(vertices, vertex_count))
        return PL_ERR_ARGUMENT;
    pl_status status = PL_ERR_MEMORY;
    pl_scene *scene = calloc(1, sizeof *scene);
    if (!scene)
        return PL_ERR_MEMORY;
    scene->embree = embree;
    scene->vertex_count = vertex_count;
    scene->triangle_count = triangle_count;
    scene->vertices = malloc(3 * sizeof(float) * (vertex_count + 1));
    scene->indices = copy_of(triangles, 3 * sizeof(int32_t) * triangle_count);
    if (!scene->vertices || !scene->indices)
        goto done;
    recentre(scene, vertices);
    status = clear ? clear_copy(clear, triangle_count, &scene->clear) : PL_OK;
    if (status == PL_OK)
        status = build_layer(scene, false, &scene->opaque);
    if (status == PL_OK && clear)
        status = build_layer(scene, true, &scene->clear_layer);
done:
    if (status == PL_OK)
        *out_scene = scene;
    else
        pl_scene_destroy(scene);
    return status;
}

static void destroy_layer(const pl_scene *scene, pl_layer *layer) {
    if (layer->bvh)
        scene->embree->release_scene(layer->bvh);
    free(layer->triangles);
}

void pl_scene_destroy(pl_scene *scene) {
    if (!scene)
        return;
    destroy_layer(scene, &scene->opaque);
    destroy_layer(scene, &scene->clear_layer);
    clear_destroy(&scene->clear);
    free(scene->vertices);
    free(scene->indices);
    free(scene);
}

void pl_scene_centre(const pl_scene *scene, double out_centre[3]) {
    memcpy(out_centre, scene->centre, sizeof scene->centre);
}

static RTCRay ray_along(vec3 origin, vec3 direction, float near, float far) {
    return (RTCRay){.org_x = origin.x,
                    .org_y = origin.y,
                    .org_z = origin.z,
                    .tnear = near,
                    .dir_x = direction.x,
                    .dir_y = direction.y,
                    .dir_z = direction.z,
                    .tfar = far,
                    .mask = ~0u};
}

static pl_hit layer_hit(const pl_scene *scene, const pl_layer *layer, vec3 origin, vec3 direction, float near,
                        float far) {
    RTCRayHit rayhit;
    rayhit.ray = ray_along(origin, direction, near, far);
    rayhit.hit.geomID = RTC_INVALID_ID;
    scene->embree->intersect(layer->bvh, &rayhit, NULL);
    if (rayhit.hit.geomID == RTC_INVALID_ID)
        return (pl_hit){.triangle = -1, .distance = far};
    const float facing = rayhit.hit.Ng_x * direction.x + rayhit.hit.Ng_y * direction.y + rayhit.hit.Ng_z * direction.z;
    return (pl_hit){.triangle = layer->triangles[rayhit.hit.primID],
                    .u = rayhit.hit.u,
                    .v = rayhit.hit.v,
                    .distance = rayhit.ray.tfar,
                    .is_back = facing > 0};
}

pl_hit opaque_hit(const pl_scene *scene, vec3 origin, vec3 direction, float near) {
    return layer_hit(scene, &scene->opaque, origin, direction, near, INFINITY);
}

/* Of a hit on an edge, to within the rounding of a hit from a hundred times the triangle's size. */
static bool is_at_edge(const pl_hit *hit) {
    return lesser(lesser(hit->u, hit->v), 1 - hit->u - hit->v) < 1.52587890625e-5f;
}

pl_hit closest_hit(const pl_scene *scene, vec3 origin, vec3 direction, float near) {
    const pl_hit hit = opaque_hit(scene, origin, direction, near);
    return hit.triangle >= 0 && is_at_edge(&hit) ? hit_at_edge(scene, origin, direction, near, hit) : hit;
}

bool is_occluded(const pl_scene *scene, vec3 origin, vec3 direction, float far) {
    RTCRay ray = ray_along(origin, direction, 0, far);
    scene->embree->occluded(scene->opaque.bvh, &ray, NULL);
    return ray.tfar < 0;
}

pl_hit clear_hit(const pl_scene *scene, vec3 origin, vec3 direction, float near, float far) {
    return layer_hit(scene, &scene->clear_layer, origin, direction, near, far);
}

static vec3 recentred(const pl_scene *scene, const double *p) {
    return (vec3){(float)(p[0] - scene->centre[0]), (float)(p[1] - scene->centre[1]), (float)(p[2] - scene->centre[2])};
}

void pl_closest_hits(const pl_scene *scene, const double *origins, const float *directions, size_t count,
                     int32_t *out_triangles, float *out_hits) {
    for (size_t i = 0; i < count; ++i) {
        const pl_hit hit = closest_hit(scene, recentred(scene, origins + 3 * i), vec3_from(directions + 3 * i), 0);
        out_triangles[i] = hit.triangle;
        out_hits[3 * i] = hit.u;
        out_hits[3 * i + 1] = hit.v;
        out_hits[3 * i + 2] = hit.distance;
    }
}

void pl_occluded(const pl_scene *scene, const double *from, const double *to, size_t count, uint8_t *out_occluded) {
    for (size_t i = 0; i < count; ++i) {
        const vec3 origin = recentred(scene, from + 3 * i);
        const vec3 direction = vec3_sub(recentred(scene, to + 3 * i), origin);
        out_occluded[i] = is_occluded(scene, origin, direction, 1);
    }
}
