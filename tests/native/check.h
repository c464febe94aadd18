/* An assert that stays in every build and says what it saw. SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef PATCHLIGHT_CHECK_H
#define PATCHLIGHT_CHECK_H

#include <stdio.h>
#include <stdlib.h>

#define CHECK(claim)                                                                                                   \
    do {                                                                                                               \
        if (!(claim)) {                                                                                                \
            fprintf(stderr, "%s:%d: %s: not so: %s\n", __FILE__, __LINE__, __func__, #claim);                          \
            exit(1);                                                                                                   \
        }                                                                                                              \
    } while (0)

#endif
