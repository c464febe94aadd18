/*
 * Stands before Embree: passes rays on, keeps copies of them while asked to, and traces the copies again in a bare
 * loop. Linked with Embree itself, which has every other function. SPDX-License-Identifier: GPL-3.0-or-later
 */
#include "embree.h"

#include <dlfcn.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef struct recorded {
    RTCRay ray;
    RTCScene scene;
    int is_shadow_ray;
} recorded;

static void (*intersect)(RTCScene, RTCRayHit *, void *);
static void (*occluded)(RTCScene, RTCRay *, void *);
static recorded *rays;
static size_t count, most;

static void keep(RTCScene scene, const RTCRay *ray, int is_shadow_ray) {
    if (count < most)
        rays[count] = (recorded){*ray, scene, is_shadow_ray};
    count += most > 0;
}

void rtcIntersect1(RTCScene scene, RTCRayHit *rayhit, void *arguments) {
    keep(scene, &rayhit->ray, 0);
    intersect(scene, rayhit, arguments);
}

void rtcOccluded1(RTCScene scene, RTCRay *ray, void *arguments) {
    keep(scene, ray, 1);
    occluded(scene, ray, arguments);
}

/* To be called before anything else; 0 where the library is not Embree. */
int recorder_open(const char *path) {
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    void *symbols[2] = {library ? dlsym(library, "rtcIntersect1") : NULL,
                        library ? dlsym(library, "rtcOccluded1") : NULL};
    memcpy(&intersect, &symbols[0], sizeof intersect);
    memcpy(&occluded, &symbols[1], sizeof occluded);
    return symbols[0] && symbols[1];
}

/* Keep the rays from here on, so many at the most; 0 ends it. */
int recorder_keep(size_t most_rays) {
    most = 0;
    if (most_rays) {
        free(rays);
        rays = malloc(most_rays * sizeof *rays);
        count = 0;
        most = rays ? most_rays : 0;
    }
    return most == most_rays;
}

size_t recorder_count(void) { return count; }

/* Seconds that the kept rays take in a loop of nothing else. */
double recorder_replay(void) {
    struct timespec start, end;
    clock_gettime(CLOCK_MONOTONIC, &start);
    for (size_t i = 0; i < count; ++i) {
        RTCRayHit rayhit = {.ray = rays[i].ray, .hit.geomID = RTC_INVALID_ID};
        if (rays[i].is_shadow_ray)
            occluded(rays[i].scene, &rayhit.ray, NULL);
        else
            intersect(rays[i].scene, &rayhit, NULL);
    }
    clock_gettime(CLOCK_MONOTONIC, &end);
    return (double)(end.tv_sec - start.tv_sec) + 1e-9 * (double)(end.tv_nsec - start.tv_nsec);
}
