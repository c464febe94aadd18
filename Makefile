# make bake   set everything up, bake the demo, say where the pictures are
# make test   set everything up, run the tests
# make fuzz   ten thousand random scenes baked whole (a quarter of an hour), and random calls of the kernel
# make sanitize  the core's and the physics' tests over a kernel with address and undefined-behaviour checks
# make test-window BLENDER=blender  the extension's zip in a real window of Blender: Bake pressed, watched, shown, undone, cancelled
# make bench  speed against error on exact scenes, quick settings: a table, and JSON and plots in out/bench
# make bench-cycles SCENE=S.blend REFERENCE=S.npz  seconds and error beside Cycles' own bake of the same texels
# make bench-rays SCENE=S.blend  our kernels' rays per second against a bare loop over the same rays
# make bench-size  time and memory of bakes against triangles, texels and threads; half an hour
# make check  linters, formatters, C tests under sanitizers
# make zip    the Blender extension, one zip per platform, validated
# make clean  remove what these made (.venv stays; `make distclean` removes it too)

PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
BIN := $(VENV)/bin
OUT := out
BUILD := build

KERNEL := addon/core/_kernel.abi3.so
KERNEL_SOURCES := $(wildcard native/src/*.c)
DOOR_SOURCES := $(wildcard native/python/*.c)
KERNEL_HEADERS := $(wildcard native/include/*.h native/src/*.h native/python/*.h)
C_FILES := $(KERNEL_SOURCES) $(DOOR_SOURCES) $(KERNEL_HEADERS) $(wildcard tests/native/*.[ch] tests/bench/*.c)

WARNINGS := -Wall -Wextra -Wshadow -Wconversion -Wstrict-prototypes -Werror
SANITIZE := -std=c11 -O1 -g -ffp-contract=off -fno-omit-frame-pointer -fsanitize=address,undefined -fno-sanitize-recover=all
C_TESTS := $(patsubst tests/native/%.c,$(BUILD)/native/%,$(wildcard tests/native/test_*.c))

.PHONY: bake test test-window bench bench-cycles bench-rays bench-size fuzz sanitize check lint native-tests kernel zip format clean distclean
.DELETE_ON_ERROR:

# ---- set-up: each stamp is newer than what it was made from ----

$(VENV)/.made:
	@test -n "$(PYTHON)" || { echo "Python 3.11 not found: install python3.11, or say PYTHON=/path/to/python3.11"; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' || \
	    { echo "bpy 4.5 needs exactly Python 3.11 and $(PYTHON) is another: say PYTHON=/path/to/python3.11"; exit 1; }
	@command -v $(CC) >/dev/null || { echo "no C compiler: install one (cc), or say CC=/path/to/compiler"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	@touch $@

# setuptools stays in the venv so that `make kernel` compiles without pip and without a network
$(VENV)/.installed: $(VENV)/.made pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check "setuptools>=77,<85"
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-build-isolation --editable ".[bpy,dev]"
	@touch $@

$(KERNEL): $(KERNEL_SOURCES) $(DOOR_SOURCES) $(KERNEL_HEADERS) | $(VENV)/.installed
	$(BIN)/python -W ignore -c "import setuptools; setuptools.setup()" --quiet build_ext --inplace --force
	@touch $@

kernel: $(VENV)/.installed $(KERNEL)

# ---- the two commands ----

DEMOS := room cornell
# minutes on any machine rather than the best there is; BAKE_OPTIONS= on the command line bakes with the defaults
BAKE_OPTIONS := --texels 262144 --error 0.035 --time-limit 90

bake: kernel
	$(BIN)/patchlight demo $(OUT)
	@set -e; for demo in $(DEMOS); do \
	    $(BIN)/patchlight bake $(OUT)/$$demo.blend --output $(OUT)/$${demo}_baked.blend --report $(OUT)/$$demo.json \
	        --exr $(OUT) $(BAKE_OPTIONS); \
	    $(BIN)/patchlight picture $(OUT)/$${demo}_baked.blend $(OUT)/$$demo.png --lightmap $(OUT)/$${demo}_lightmap.png; \
	done
	@echo; echo "Pictures lit by nothing but the bake, and the lightmaps they show:"
	@for demo in $(DEMOS); do echo "  $(OUT)/$$demo.png   $(OUT)/$${demo}_lightmap.png"; done

# in up to four processes: most of what a test does has one thread
test: kernel
	$(BIN)/python -m pytest --numprocesses auto --maxprocesses 4 --dist worksteal

# BENCH_OPTIONS= on the command line measures with the whole range of settings, which takes minutes
BENCH_OPTIONS := --quick
bench: kernel
	$(BIN)/patchlight bench --out $(OUT)/bench $(BENCH_OPTIONS)

# CYCLES_OPTIONS= says which errors and samples, see tests/bench/beside_cycles.py
bench-cycles: kernel
	$(BIN)/python tests/bench/beside_cycles.py $(SCENE) $(REFERENCE) --out $(OUT)/bench $(CYCLES_OPTIONS)

bench-rays: kernel
	$(BIN)/python tests/bench/embree_rate.py $(SCENE)

bench-size: kernel
	$(BIN)/python tests/bench/size.py --out $(OUT)/bench $(SIZE_OPTIONS)

# every example is new at each run; what fails is printed with how to repeat it
EXAMPLES := 10000
fuzz: kernel
	PATCHLIGHT_EXAMPLES=$(EXAMPLES) $(BIN)/python -m pytest --capture=no --hypothesis-show-statistics tests/core/test_random_*.py

# ---- checks ----

check: lint native-tests

lint: $(VENV)/.installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(if $(C_FILES),$(BIN)/clang-format --dry-run -Werror $(C_FILES))
	$(CC) -std=c11 -O3 -fsyntax-only -fvisibility=hidden $(WARNINGS) -DPy_LIMITED_API=0x030B0000 -Inative/include \
	    -isystem $(shell $(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("include"))' 2>/dev/null) \
	    $(KERNEL_SOURCES) $(DOOR_SOURCES)

# A C test is a program of plain asserts, linked with the whole kernel; it finds Embree by the environment.
$(BUILD)/native/%: tests/native/%.c $(KERNEL_SOURCES) $(KERNEL_HEADERS) $(wildcard tests/native/*.h)
	@mkdir -p $(@D)
	$(CC) $(SANITIZE) $(WARNINGS) -Inative/include -Inative/src $(filter %.c,$^) -o $@ -lm -ldl

# Leaks are not looked for: Embree and TBB keep their thread pools until the process ends.
native-tests: $(C_TESTS) | $(VENV)/.installed
	@embree=$$($(BIN)/python -c "$(FIND_EMBREE)"); \
	for test in $(C_TESTS); do \
	    echo "$$test"; ASAN_OPTIONS=detect_leaks=0 PATCHLIGHT_EMBREE="$$embree" $$test || exit 1; \
	done
FIND_EMBREE := import glob, importlib.util as u, pathlib as p; \
    print(glob.glob(str(p.Path(u.find_spec('embreex').origin).parents[1] / 'embreex.libs' / 'libembree4*'))[0])

# The same door as in the product, but built apart from it: tests/conftest.py loads it in the other's place.
SANITIZED := $(BUILD)/sanitized/_kernel.abi3.so
$(SANITIZED): $(KERNEL_SOURCES) $(DOOR_SOURCES) $(KERNEL_HEADERS) | $(VENV)/.installed
	@mkdir -p $(@D)
	$(CC) $(SANITIZE) -fsanitize=float-cast-overflow -fPIC -shared -fvisibility=hidden -DPy_LIMITED_API=0x030B0000 \
	    -Inative/include -Inative/src -isystem $$($(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("include"))') \
	    $(KERNEL_SOURCES) $(DOOR_SOURCES) -o $@ -lm -ldl

# Python itself is not built for it, so the sanitizer's library comes first by hand, and C++'s next, or what matplotlib
# throws is not caught; Python frees nothing at its end.
sanitize: kernel $(SANITIZED)
	LD_PRELOAD="$$($(CC) -print-file-name=libasan.so) $$($(CC) -print-file-name=libstdc++.so.6)" \
	    ASAN_OPTIONS=detect_leaks=0:halt_on_error=1:quarantine_size_mb=16 UBSAN_OPTIONS=print_stacktrace=1 \
	    PYTHONMALLOC=malloc PATCHLIGHT_TEST_KERNEL=$(SANITIZED) \
	    $(BIN)/python -m pytest --capture=no tests/core tests/physics

# Zig's C compiler makes the kernels of all platforms here; it is needed for nothing else.
$(VENV)/.zig: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check ziglang==0.14.1
	@touch $@

# Another compiler lays out the kernel otherwise: it is tried by the tests that use most of it.
ZIPPED := $(abspath $(BUILD))/extension-linux-x64/addon/core/_kernel.abi3.so
zip: kernel $(VENV)/.zig
	$(BIN)/python native/build.py
ifeq ($(shell uname -sm),Linux x86_64)
	PATCHLIGHT_TEST_KERNEL=$(ZIPPED) $(BIN)/python -m pytest -q tests/core/test_kernel.py tests/core/test_bake.py
endif

# on a machine without a screen Xvfb stands in for one
test-window: kernel $(VENV)/.zig
	@test -n "$(BLENDER)" || { echo "say BLENDER=/path/to/blender"; exit 1; }
	mkdir -p $(OUT)/window/profile
	ZIP=$$($(BIN)/python native/build.py linux-x64 --output $(CURDIR)/$(OUT)/window) && \
	    BLENDER_USER_RESOURCES=$(CURDIR)/$(OUT)/window/profile $(if $(DISPLAY),,xvfb-run -a) $(BLENDER) --factory-startup \
	    --enable-event-simulate --python tests/window/press_bake.py -- $$ZIP

format: $(VENV)/.installed
	$(BIN)/ruff check --fix-only .
	$(BIN)/ruff format .
	$(BIN)/clang-format -i $(C_FILES)

clean:
	rm -rf $(BUILD) $(OUT) dist *.egg-info $(KERNEL) .pytest_cache .ruff_cache .hypothesis
	find addon tests native -name __pycache__ -prune -exec rm -rf {} +

distclean: clean
	rm -rf $(VENV) wheels
