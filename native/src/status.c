/* What a status means, in words. SPDX-License-Identifier: GPL-3.0-or-later */
#include "patchlight.h"

const char *pl_status_text(pl_status status) {
    switch (status) {
    case PL_OK:
        return "done";
    case PL_ERR_MEMORY:
        return "out of memory";
    case PL_ERR_ARGUMENT:
        return "an index or a count is out of range";
    case PL_ERR_EMBREE:
        return "Embree 4.4 cannot be opened: its library is missing, or another version";
    }
    return "unknown status";
}
