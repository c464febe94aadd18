"""The tree is a test: imports go one way, and Blender stays out of the core."""

import ast
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
ADDON = ROOT / "addon"

# what the modules of each room may import from the package; the files at the top may import from every room
MAY_IMPORT = {"ui": {"ui", "blender", "core"}, "blender": {"blender", "core"}, "core": {"core"}}
# a module of core imports only from those to the left of it
CORE_ORDER = (
    *("ranges", "settings", "environment", "scene", "luminance", "triangles", "shading_normals", "sound_faces"),
    *("workers", "kernel"),
    *("textures", "emitters", "sky"),
    *("relative", "z_order"),
    *("report", "patches", "parted", "joined"),
    *("polygon", "quadrature", "lambert", "contour", "kinks", "visibility", "analytic", "bodies", "closed_forms"),
    *("transport", "aimed", "hemicube", "sampled", "estimators", "exchange", "solver", "dense"),
    *("cases", "case_scene", "case_factors", "case_solutions", "case_spheres", "shipped_cases", "verify"),
    *("conjugate_gradient", "progressive", "stochastic", "receivers", "texel_light"),
    *("patch_solution", "seen_light", "guides", "gather_sums"),
    *("vertex_graph", "vertices"),
    *("patch_light", "decomposition", "choose", "laws", "radiosity"),
    *("charts", "copies", "blocks", "cut", "flatten", "packing", "unwrap", "texels"),
    *("lookup", "seams", "find_seams", "gaps", "smoothing", "probes"),
    *(
        "effort",
        "denoiser",
        "denoising",
        "allocation",
        "direct_light",
        "gather_job",
        "measuring",
        "passes",
        "gather",
        "backs",
        "lightmap",
        "findings",
        "bake",
    ),
    *("peak_memory", "bench_row", "bench_cube", "bench_scenes", "bench_peers", "bench_factors", "bench_light", "bench"),
    "bench_plot",
)
# and so does a file at the top
TOP_ORDER = ("progress", "in_blender", "cli_bake", "cli_bench", "cli", "registration")
BLENDER = {"bpy", "bmesh", "mathutils", "bpy_extras", "gpu", "idprop"}


def modules(room):
    return sorted((ADDON / room).glob("*.py"))


def imports(path):
    """(level, dotted module, name) of every import in a file; of ``from .x import y`` (1, "x", "y")."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from ((0, alias.name, "") for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from ((node.level, node.module or "", alias.name) for alias in node.names)


def rooms_imported(path):
    for level, module, name in imports(path):
        if level == 2:
            yield (module or name).split(".")[0]


@pytest.mark.parametrize("room", MAY_IMPORT)
def test_rooms_import_downwards(room):
    for path in modules(room):
        seen = {name for name in rooms_imported(path) if (ADDON / name).is_dir()} | {room}
        assert seen <= MAY_IMPORT[room], f"{path.name} imports from {seen - MAY_IMPORT[room]}"


@pytest.mark.parametrize("room", MAY_IMPORT)
def test_rooms_import_nothing_from_the_top(room):
    for path in modules(room):
        seen = {name for name in rooms_imported(path) if not (ADDON / name).is_dir()}
        assert not seen, f"{path.name} imports {seen} of the top"
        assert not [level for level, *_ in imports(path) if level > 2], f"{path.name} reaches out of addon/"


def test_the_core_imports_in_its_own_order():
    for path in modules("core"):
        if path.stem == "__init__":
            continue
        assert path.stem in CORE_ORDER, f"core/{path.name} is not in CORE_ORDER: give it its place"
        before = {*CORE_ORDER[: CORE_ORDER.index(path.stem)], *(["_kernel"] if path.stem == "kernel" else [])}
        seen = {(module or name).split(".")[0] for level, module, name in imports(path) if level == 1}
        assert seen <= before, f"core/{path.name} imports {seen - before}"


def test_the_files_at_the_top_import_in_their_own_order():
    for path in sorted(ADDON.glob("*.py")):
        if path.stem == "__init__":
            continue
        assert path.stem in TOP_ORDER, f"{path.name} is not in TOP_ORDER: give it its place"
        seen = {(module or name).split(".")[0] for level, module, name in imports(path) if level == 1}
        files = {name for name in seen if not (ADDON / name).is_dir()}
        assert files <= set(TOP_ORDER[: TOP_ORDER.index(path.stem)]), f"{path.name} imports {files}"


def test_the_core_knows_nothing_of_blender():
    for path in modules("core"):
        seen = {module.split(".")[0] for level, module, _ in imports(path) if level == 0}
        assert not seen & BLENDER, f"core/{path.name} imports {seen & BLENDER}"


def test_imports_inside_the_package_are_relative():
    # the package is called bl_ext.<repository>.patchlight.addon in Blender, patchlight with pip, addon in tests
    for path in ADDON.rglob("*.py"):
        absolute = {module.split(".")[0] for level, module, _ in imports(path) if level == 0}
        assert not absolute & {"addon", "patchlight"}, path.name


def test_the_root_can_be_imported_without_blender():
    tree = ast.parse((ROOT / "__init__.py").read_text())
    assert not [node for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom)]


def test_pip_compiles_every_c_file():
    extension = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["ext-modules"][0]
    folders = (ROOT / "native" / "src", ROOT / "native" / "python")
    found = {path.relative_to(ROOT).as_posix() for folder in folders for path in folder.glob("*.c")}
    assert set(extension["sources"]) == found


def test_extension_and_pip_package_have_one_version():
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text())
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert manifest["version"] == project["version"]
    pinned = dict(name.split("==") for name in project["dependencies"] if "==" in name)
    assert {tuple(Path(wheel).name.split("-")[:2]) for wheel in manifest["wheels"]} == set(pinned.items())
