"""The data flow is one way: a module imports only its own stage and the stages before it."""

import ast
from functools import cache
from pathlib import Path

import pytest

ORDER = [
    *"errors progress arrays plugins runtime files text machine job kernels tool mesh surface".split(),
    *"workholding setup levels material mechanics planning nc verify report".split(),
    *"machining second_clamping pipeline simulation finishing batch cli".split(),
    "wheels",
    "__main__",
]
ROOMS = {
    "runtime": "threads loading compiling timing own_files staging worker".split(),
    "surface": [
        *"basis tmesh query tessellation refinement tspline fitting skinning".split(),
        *"growth files part_surface".split(),
    ],
    "levels": [
        *"problem program solvers certificates measure sequences closed_morph".split(),
        *"open_morph job_levels".split(),
    ],
    "mechanics": "beam edges loads result".split(),
    "planning": [
        *"motion_time spacing patterns contacts layers scene collision axes link_space links".split(),
        *"oriented_path estimate stump blank post_length parting neck chosen_cutters rest_machining levels".split(),
        "surface_paths",
    ],
    "batch": "run cluster".split(),
    "wheels": "wheel tables channels proof results blading commands".split(),
    "verify": "gouge readback sweeping findings clearances removal control proof".split(),
    "report": [
        *"warnings stage_reports typed tables summary pictures page sheet machine_picture kept".split(),
        *"outputs".split(),
    ],
}
"""The order of the modules and sub-packages inside a stage."""
ROOT = Path(__file__).parents[1] / "bonecam"
MODULES = sorted(path for path in ROOT.rglob("*.py") if path != ROOT / "__init__.py")

DOORS = {
    "osqp": {"levels/solvers/osqp.py"},
    "fcl": {"planning/collision.py"},
    "matplotlib": {"report/pictures.py", "report/machine_picture.py", "wheels/results.py"},
    "contourpy": {"wheels/channels.py"},
    "numba": {"kernels", "runtime/compiling.py"},
    "open3d": {"mesh/distance.py", "mesh/triangle_mesh.py"},
    "OCP": {"mesh/files/cad.py"},
    "pymeshlab": {"mesh/meshlab.py"},
    "pydantic": {"text/record.py", "nc/schema.py", "machine/machine_file.py"},
    "distributed": {"batch/cluster.py"},
    "filelock": {"runtime/own_files.py"},
    "SimpleITK": {"mesh/files/label_map.py"},
    "meshio": {"mesh/files/vtk.py"},
    "re2": {"text/pattern.py"},
    "ezdxf": {"mesh/files/polyhedra.py"},
    "plyfile": {"mesh/files/polygons.py"},
}


def stage_of(path: Path) -> str:
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


STAGES = sorted({stage_of(path) for path in MODULES})


@cache
def nodes_of(path: Path) -> tuple[ast.AST, ...]:
    """All nodes of a module's syntax."""
    return tuple(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))


@cache
def imports_of(path: Path) -> list[str]:
    names = []
    for node in nodes_of(path):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names += [node.module or ""] + [
                f"{node.module}.{alias.name}" for alias in node.names if node.module == "bonecam"
            ]
    return names


def imported(stage: str) -> list[tuple[Path, str]]:
    """The modules of a stage and what they import."""
    return [(path, name) for path in MODULES if stage_of(path) == stage for name in imports_of(path)]


@pytest.mark.parametrize("stage", STAGES)
def test_imports_follow_the_flow(stage):
    rank = ORDER.index(stage)
    for path, name in imported(stage):
        parts = name.split(".")
        if parts[0] == "bonecam" and len(parts) > 1:
            assert ORDER.index(parts[1]) <= rank, f"{path}: {name} comes after {stage}"


@pytest.mark.parametrize("stage", ROOMS)
def test_imports_inside_a_stage_follow_the_order_of_its_rooms(stage):
    rooms = ROOMS[stage]
    for path in (ROOT / stage).rglob("*.py"):
        room = path.relative_to(ROOT / stage).parts[0].removesuffix(".py")
        if room == "__init__":
            continue
        for name in imports_of(path):
            parts = name.split(".")
            if parts[:2] == ["bonecam", stage] and len(parts) > 2:
                assert rooms.index(parts[2]) <= rooms.index(room), f"{name} comes after {stage}/{room}"


@pytest.mark.parametrize("stage", STAGES)
def test_libraries_come_in_by_one_door(stage):
    for path, name in imported(stage):
        place = str(path.relative_to(ROOT))
        doors = DOORS.get(name.split(".")[0])
        is_door = doors is None or any(f"{place}/".startswith(f"{door}/") for door in doors)
        assert is_door, f"{place} imports {name}"


NAMES = {
    ".".join(("bonecam", *path.relative_to(ROOT).with_suffix("").parts)): path
    for path in MODULES
    if path.name != "__init__.py"
}


def runtime_imports(path: Path) -> set[str]:
    """Modules of the package that a module imports, in functions too, but not for the type checker alone."""
    for_types = {
        inner
        for node in nodes_of(path)
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
        for inner in ast.walk(node)
    }
    found = set()
    for node in nodes_of(path):
        if node in for_types:
            continue
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {str(node.module), *(f"{node.module}.{alias.name}" for alias in node.names)}
    return found & NAMES.keys()


def test_no_import_goes_in_a_circle():
    left = {name: runtime_imports(path) for name, path in NAMES.items()}
    while free := [name for name, needed in left.items() if not needed & left.keys()]:
        for name in free:
            del left[name]
    assert not left, f"these import each other, or what does: {sorted(left)}"


TESTS = sorted((ROOT.parent / "tests").rglob("*.py"))


def test_no_test_imports_another_test_module():
    modules = {path.stem for path in TESTS if path.parent.name not in ("figures", "checking")} - {"conftest"}
    for path in TESTS:
        taken = {name.split(".")[0] for name in imports_of(path)}
        assert not taken & (modules | {"conftest", "tests"}), f"{path} imports {taken & modules}"
