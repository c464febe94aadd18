"""How much chance tests take, and which kernel: by what `make test`, `make fuzz` and `make sanitize` set."""

import importlib.machinery
import importlib.util
import os
import sys

from hypothesis import HealthCheck, settings

# scenes are slow to make and baked whole: time is bounded by the watchdog of the tests, not per example
COMMON = {
    "deadline": None,
    "print_blob": True,
    "suppress_health_check": [HealthCheck.too_slow, HealthCheck.data_too_large],
}
settings.register_profile("quick", max_examples=150, derandomize=True, **COMMON)
settings.register_profile("fuzz", max_examples=int(os.environ.get("PATCHLIGHT_EXAMPLES", "1")), **COMMON)
settings.load_profile("fuzz" if "PATCHLIGHT_EXAMPLES" in os.environ else "quick")


def pytest_configure():
    """Keep the terminal for what a watchdog has to say: pytest takes standard error away from tests."""
    os.environ["PATCHLIGHT_TEST_STDERR"] = str(os.dup(2))


def load_kernel(path):
    """Put another build of the kernel in the place of the product's, before anything imports it."""
    name = "addon.core._kernel"
    loader = importlib.machinery.ExtensionFileLoader(name, path)
    spec = importlib.util.spec_from_file_location(name, path, loader=loader)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    loader.exec_module(module)


if "PATCHLIGHT_TEST_KERNEL" in os.environ:
    load_kernel(os.path.abspath(os.environ["PATCHLIGHT_TEST_KERNEL"]))
