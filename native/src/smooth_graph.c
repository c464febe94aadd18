/*
 * Smoothing gathered light over the vertices of meshes, no further than its noise and the geometry allow.
 * SPDX-License-Identifier: GPL-3.0-or-later
 */
#include "edge_stops.h"
#include "lights.h"

enum { CHANNELS = 3 };

pl_status pl_smooth_graph(const pl_vertex_graph *graph, const float *values, const float *variances,
                          int32_t stops_on_value, size_t first, size_t count, float *out_values, float *out_variances) {
    for (size_t i = first; i < first + count; ++i) {
        const float *own = values + CHANNELS * i, own_luminance = luminance(own);
        float sums[CHANNELS] = {own[0], own[1], own[2]}, total = 1, variance = variances[i];
        for (int32_t edge = graph->first_edges[i]; edge < graph->first_edges[i + 1]; ++edge) {
            const size_t k = (size_t)graph->neighbours[edge];
            const float *other = values + CHANNELS * k;
            float weight = graph->nearness[edge];
            if (stops_on_value)
                weight *= alike(own_luminance - luminance(other), variances[i], variances[k]);
            for (size_t channel = 0; channel < CHANNELS; ++channel)
                sums[channel] += weight * other[channel];
            variance += weight * weight * variances[k];
            total += weight;
        }
        for (size_t channel = 0; channel < CHANNELS; ++channel)
            out_values[CHANNELS * i + channel] = sums[channel] / total;
        out_variances[i] = variance / (total * total);
    }
    return PL_OK;
}
