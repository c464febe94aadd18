/* Sobol's sequence. SPDX-License-Identifier: GPL-3.0-or-later */
#include "sampling.h"

#include "patchlight.h"

/*
 * Direction numbers of dimensions 2 and 3 with their bits reversed, so that scrambling needs no reversal
 * first: bit k of the index switches column k.
 */
enum { DIMENSIONS = 4, BITS = 32 };
static const uint32_t directions[DIMENSIONS - 2][BITS] = {
    {0x00000001u, 0x00000003u, 0x00000006u, 0x00000009u, 0x00000017u, 0x0000003au, 0x00000071u, 0x000000a3u,
     0x00000116u, 0x00000339u, 0x00000677u, 0x000009aau, 0x00001601u, 0x00003903u, 0x00007706u, 0x0000aa09u,
     0x00010117u, 0x0003033au, 0x00060671u, 0x000909a3u, 0x00171616u, 0x003a3939u, 0x00717777u, 0x00a3aaaau,
     0x01170001u, 0x033a0003u, 0x06710006u, 0x09a30009u, 0x16160017u, 0x3939003au, 0x77770071u, 0xaaaa00a3u},
    {0x00000001u, 0x00000003u, 0x00000004u, 0x0000000au, 0x0000001fu, 0x0000002eu, 0x00000045u, 0x000000c9u,
     0x0000011bu, 0x000002a4u, 0x0000079au, 0x00000b67u, 0x0000101eu, 0x0000302du, 0x00004041u, 0x0000a0c3u,
     0x0001f104u, 0x0002e28au, 0x000457dfu, 0x000c9baeu, 0x0011a105u, 0x002a7289u, 0x0079e7dbu, 0x00b6dba4u,
     0x0100011au, 0x030002a7u, 0x0400079eu, 0x0a000b6du, 0x1f001001u, 0x2e003003u, 0x45004004u, 0xc900a00au},
};

uint32_t sobol_by_columns(uint32_t index, int dimension) {
    uint32_t point = 0;
    for (int k = 0; index; ++k, index >>= 1)
        if (index & 1u)
            point ^= directions[dimension - 2][k];
    return point;
}

void pl_sobol_points(uint32_t first, size_t count, uint32_t seed, float *out_points) {
    for (size_t i = 0; i < count; ++i)
        for (int dimension = 0; dimension < DIMENSIONS; ++dimension)
            out_points[DIMENSIONS * i + (size_t)dimension] = sobol(first + (uint32_t)i, dimension, seed);
}
