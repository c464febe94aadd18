"""How much chance tests take: a quick share of their random examples in `make test`, all of them in `make fuzz`."""

import os

from hypothesis import HealthCheck, settings

# scenes are slow to make and baked whole: time is bounded by the watchdog of the tests, not per example
COMMON = {
    "deadline": None,
    "print_blob": True,
    "suppress_health_check": [HealthCheck.too_slow, HealthCheck.data_too_large],
}
settings.register_profile("quick", max_examples=200, derandomize=True, **COMMON)
settings.register_profile("fuzz", max_examples=10_000, **COMMON)
settings.load_profile(os.environ.get("PATCHLIGHT_EXAMPLES", "quick"))
