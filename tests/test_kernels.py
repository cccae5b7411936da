"""Kernels without an entry for Python are called by kernels alone; none is kept when the source of another changes."""

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
KERNELS = ROOT / "bonecam" / "kernels"


def decorators(node: ast.stmt) -> set[str]:
    """The names in the decorators of a function; none of any other statement."""
    found = node.decorator_list if isinstance(node, ast.FunctionDef) else []
    return {part.id for each in found for part in ast.walk(each) if isinstance(part, ast.Name)}


def modules(folder: Path) -> dict[str, ast.Module]:
    """The trees of the modules in a folder by their names."""
    files = sorted(folder.rglob("*.py"))
    return {
        ".".join(file.relative_to(ROOT).with_suffix("").parts): ast.parse(file.read_text()) for file in files
    }


def imports(tree: ast.AST) -> set[tuple[str, str]]:
    """Modules and names that are imported anywhere in a tree."""
    parts = [part for part in ast.walk(tree) if isinstance(part, ast.ImportFrom)]
    return {(part.module or "", name.name) for part in parts for name in part.names}


INNER = {
    (module, node.name)
    for module, tree in modules(KERNELS).items()
    for node in tree.body
    if isinstance(node, ast.FunctionDef) and "inner_njit" in decorators(node)
}


@pytest.mark.parametrize("folder", ["bonecam", "plugins", "meshes", "docs", "tests"])
def test_no_module_beside_the_kernels_imports_one_without_an_entry(folder: str) -> None:
    beside = {
        name: tree for name, tree in modules(ROOT / folder).items() if not name.startswith("bonecam.kernels")
    }
    assert len(INNER) > 50
    assert beside
    assert {name: imports(tree) & INNER for name, tree in beside.items() if imports(tree) & INNER} == {}


@pytest.mark.parametrize("module", sorted(modules(KERNELS)))
def test_what_is_not_compiled_among_the_kernels_names_none_without_an_entry(module: str) -> None:
    tree = modules(KERNELS)[module]
    known = {name for source, name in INNER if source == module} | {name for _, name in imports(tree) & INNER}
    plain = [node for node in tree.body if not decorators(node) & {"njit", "inner_njit"}]
    named = {part.id for node in plain for part in ast.walk(node) if isinstance(part, ast.Name)}
    assert named & known == set()


def test_a_kept_kernel_is_compiled_again_when_one_that_it_calls_has_changed(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "bonecam", tmp_path / "bonecam", ignore=shutil.ignore_patterns("__pycache__"))
    called = tmp_path / "bonecam" / "kernels" / "called.py"
    calling = called.with_name("calling.py")
    header = "from bonecam.kernels import inner_njit, njit\n"
    calling.write_text(
        f"{header}from bonecam.kernels.called import value\n@njit(cache=True)\ndef twice():\n    return 2 * value()\n"
    )
    asked = "from bonecam.kernels.calling import twice; print(twice(), sum(twice.stats.cache_hits.values()))"
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kept")}
    told = []
    for value in (1, 1, 25):
        called.write_text(f"{header}@inner_njit()\ndef value():\n    return {value}\n")
        run = [sys.executable, "-c", asked]
        told.append(subprocess.check_output(run, cwd=tmp_path, env=environment, text=True))
    assert told == ["2 0\n", "2 1\n", "50 0\n"]
