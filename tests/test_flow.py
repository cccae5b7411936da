"""The data flow is one way: a module imports only its own stage and the stages before it."""

import ast
from pathlib import Path

import pytest

ORDER = [
    *"errors progress timing arrays threads files job kernels mesh setup surface levels toolpath orientation nc verify".split(),
    *"outputs pipeline filters batch cli __main__".split(),
]
ROOMS = {
    "surface": "basis tmesh query tessellation refinement tspline rows_to_general fitting skinning files part_surface".split(),
    "toolpath": "ball_depth cutter path gouge material scallop sampling spacing zigzag".split(),
    "orientation": [
        *"limits interpolation collision lead singularity admissible tool_axes links".split(),
        *"oriented_path level_paths".split(),
    ],
    "verify": "gouge readback proof report pictures".split(),
}
"""The order of the modules and sub-packages inside a stage."""
ROOT = Path(__file__).parents[1] / "bonecam"
MODULES = sorted(path for path in ROOT.rglob("*.py") if path != ROOT / "__init__.py")

DOORS = {
    "osqp": {"levels/solvers/osqp.py"},
    "clarabel": {"levels/solvers/clarabel.py"},
    "fcl": {"orientation/collision/fcl_model.py"},
    "matplotlib": {"verify/pictures"},
    "numba": {"kernels"},
    "open3d": {"mesh/distance.py"},
    "OCP": {"mesh/files/opencascade.py"},
    "pymeshlab": {"mesh/meshlab.py"},
    "ezdxf": {"mesh/files/polyhedra.py"},
}


def stage_of(path: Path) -> str:
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


def imports_of(path: Path) -> list[str]:
    names = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names += [node.module or ""] + [
                f"{node.module}.{alias.name}" for alias in node.names if node.module == "bonecam"
            ]
    return names


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_imports_follow_the_flow(path: Path) -> None:
    rank = ORDER.index(stage_of(path))
    for name in imports_of(path):
        parts = name.split(".")
        if parts[0] == "bonecam" and len(parts) > 1:
            assert ORDER.index(parts[1]) <= rank, f"{name} comes after {stage_of(path)}"


@pytest.mark.parametrize("stage", ROOMS)
def test_imports_inside_a_stage_follow_the_order_of_its_rooms(stage: str) -> None:
    rooms = ROOMS[stage]
    for path in (ROOT / stage).rglob("*.py"):
        room = path.relative_to(ROOT / stage).parts[0].removesuffix(".py")
        if room == "__init__":
            continue
        for name in imports_of(path):
            parts = name.split(".")
            if parts[:2] == ["bonecam", stage] and len(parts) > 2:
                assert rooms.index(parts[2]) <= rooms.index(room), f"{name} comes after {stage}/{room}"


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_libraries_come_in_by_one_door(path: Path) -> None:
    place = str(path.relative_to(ROOT))
    for name in imports_of(path):
        doors = DOORS.get(name.split(".")[0])
        is_door = doors is None or any(f"{place}/".startswith(f"{door}/") for door in doors)
        assert is_door, f"{place} imports {name}"
