/*
 * The few pieces of Embree 4.4's C API that are used, declared by hand: the wheel ships no headers.
 * SPDX-License-Identifier: GPL-3.0-or-later
 */
#ifndef PATCHLIGHT_EMBREE_H
#define PATCHLIGHT_EMBREE_H

#include "patchlight.h"

typedef struct RTCDeviceTy *RTCDevice;
typedef struct RTCSceneTy *RTCScene;
typedef struct RTCGeometryTy *RTCGeometry;

enum {
    RTC_GEOMETRY_TYPE_TRIANGLE = 0,
    RTC_BUFFER_TYPE_INDEX = 0,
    RTC_BUFFER_TYPE_VERTEX = 1,
    RTC_FORMAT_UINT3 = 0x5003,
    RTC_FORMAT_FLOAT3 = 0x9003,
    RTC_SCENE_FLAG_ROBUST = 1 << 2,
    RTC_BUILD_QUALITY_HIGH = 2,
    RTC_DEVICE_PROPERTY_VERSION = 0,
    RTC_ERROR_NONE = 0,
};
#define RTC_INVALID_ID 0xFFFFFFFFu

/* Embree reads rays by aligned loads, which crash where a ray lies on the stack as a float does. */
typedef struct RTCRay {
    _Alignas(16) float org_x;
    float org_y, org_z, tnear;
    float dir_x, dir_y, dir_z, time;
    float tfar;
    uint32_t mask, id, flags;
} RTCRay;

typedef struct RTCHit {
    float Ng_x, Ng_y, Ng_z, u, v;
    uint32_t primID, geomID, instID, instPrimID;
    uint32_t padding[3];
} RTCHit;

typedef struct RTCRayHit {
    RTCRay ray;
    RTCHit hit;
} RTCRayHit;

_Static_assert(sizeof(RTCRay) == 48 && sizeof(RTCRayHit) == 96, "Embree 4.4's ray layout");
_Static_assert(_Alignof(RTCRay) == 16 && _Alignof(RTCRayHit) == 16, "Embree 4.4's ray alignment");

struct pl_embree {
    void *library;
    RTCDevice device;
    RTCDevice (*new_device)(const char *);
    void (*release_device)(RTCDevice);
    long (*device_property)(RTCDevice, int);
    int (*device_error)(RTCDevice); /* the first since it was last asked */
    RTCScene (*new_scene)(RTCDevice);
    void (*release_scene)(RTCScene);
    void (*set_scene_flags)(RTCScene, int);
    void (*set_scene_quality)(RTCScene, int);
    void (*commit_scene)(RTCScene);
    RTCGeometry (*new_geometry)(RTCDevice, int);
    void (*release_geometry)(RTCGeometry);
    void *(*new_buffer)(RTCGeometry, int, unsigned, int, size_t, size_t);
    void (*commit_geometry)(RTCGeometry);
    unsigned (*attach_geometry)(RTCScene, RTCGeometry);
    void (*intersect)(RTCScene, RTCRayHit *, void *);
    void (*occluded)(RTCScene, RTCRay *, void *);
};

#endif
