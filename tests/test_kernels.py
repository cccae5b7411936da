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
    return {".".join(file.relative_to(ROOT).with_suffix("").parts): ast.parse(file.read_text()) for file in files}


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
def test_no_module_beside_the_kernels_imports_one_without_an_entry(folder):
    beside = {name: tree for name, tree in modules(ROOT / folder).items() if not name.startswith("bonecam.kernels")}
    assert len(INNER) > 50
    assert beside
    assert {name: imports(tree) & INNER for name, tree in beside.items() if imports(tree) & INNER} == {}


@pytest.mark.parametrize("module", sorted(modules(KERNELS)))
def test_what_is_not_compiled_among_the_kernels_names_none_without_an_entry(module):
    tree = modules(KERNELS)[module]
    known = {name for source, name in INNER if source == module} | {name for _, name in imports(tree) & INNER}
    plain = [node for node in tree.body if not decorators(node) & {"njit", "inner_njit"}]
    named = {part.id for node in plain for part in ast.walk(node) if isinstance(part, ast.Name)}
    assert named & known == set()


SMALL = "from bonecam.kernels.small import twice; print(twice(21), sum(twice.stats.cache_hits.values()))"
"""Runs a kernel, and tells its result and how often what was kept was used."""


@pytest.fixture
def package(tmp_path):
    """A copy of the package with a kernel that doubles a number."""
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "bonecam", tmp_path / "bonecam", ignore=ignored)
    small = "from bonecam.kernels import njit\n@njit(cache=True)\ndef twice(x):\n    return 2 * x\n"
    (tmp_path / "bonecam" / "kernels" / "small.py").write_text(small)
    return tmp_path


def start(package: Path, limit: int = 0, **variables: str) -> subprocess.Popen[str]:
    """Runs SMALL; no file that it writes may have more than `limit` bytes, as on a disk that is full there."""
    full = f"import resource; resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit})); " if limit else ""
    environment = {"NUMBA_CACHE_DIR": str(package / "kept"), **os.environ, **variables}
    command = [sys.executable, "-B", "-c", full + SMALL]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    return subprocess.Popen(command, cwd=package, env=environment, **pipes)  # type: ignore[call-overload]


def told(run: subprocess.Popen[str]) -> str:
    return run.communicate(timeout=120)[0].strip()


def test_two_first_runs_at_once_have_the_kernel_that_one_has(package):
    answers = [told(run) for run in [start(package) for _ in range(3)]]
    assert set(answers) <= {"42 0", "42 1"}, "one that comes later may find what another has just kept"
    assert told(start(package)) == "42 1"


@pytest.mark.parametrize("ending", ["nbi", "nbc"])
@pytest.mark.parametrize("damage", ["cut", "empty", "flipped", "foreign"])
def test_a_kept_kernel_that_is_damaged_is_compiled_again(package, ending, damage):
    assert told(start(package)) == "42 0"
    (file,) = (package / "kept").rglob(f"small.twice*.{ending}")
    data = file.read_bytes()
    middle = len(data) // 2
    file.write_bytes(
        {
            "cut": data[:middle],
            "empty": b"",
            "flipped": data[:middle] + bytes([data[middle] ^ 255]) + data[middle + 1 :],
            "foreign": b"kept by another program" * 40,
        }[damage]
    )
    assert told(start(package)) == "42 0"
    assert told(start(package)) == "42 1"


def test_a_kernel_of_another_processor_is_not_used(package):
    assert told(start(package, NUMBA_CPU_NAME="x86-64")) == "42 0"
    (other,) = (package / "kept").rglob("small.twice*.nbc")
    data = other.read_bytes()
    assert told(start(package)) == "42 0"
    for file in (package / "kept").rglob("small.twice*.nbc"):
        file.write_bytes(data)  # as where both wrote the same name at once
    assert told(start(package)) == "42 0"


def test_a_kernel_is_kept_for_one_python(package):
    assert told(start(package)) == "42 0"
    own = f".py{sys.version_info.major}{sys.version_info.minor}{sys.abiflags}."
    files = list((package / "kept").rglob("small.twice*"))
    assert {file.suffix for file in files} == {".nbi", ".nbc"}
    for file in files:
        assert own in file.name
        file.rename(file.with_name(file.name.replace(own, ".py310.")))
    assert told(start(package)) == "42 0"


def test_a_kernel_that_cannot_be_kept_runs(package):
    assert told(start(package, limit=100)) == "42 0"
    assert told(start(package)) == "42 0"
    blocked = package / "blocked"
    blocked.write_text("a file, no folder")
    (package / "bonecam" / "kernels" / "__pycache__").write_text("")
    home = {"NUMBA_CACHE_DIR": "", "HOME": str(blocked), "XDG_CACHE_HOME": str(blocked)}
    assert told(start(package, **home)) == "42 0"


def test_an_index_without_its_data_leads_to_no_kernel_of_older_sources(package):
    kernels = package / "bonecam" / "kernels"
    twice = "from bonecam.kernels import njit\nfrom bonecam.kernels.called import product\n"
    (kernels / "small.py").write_text(f"{twice}@njit(cache=True)\ndef twice(x):\n    return product(x)\n")
    called = "from bonecam.kernels import inner_njit\n@inner_njit()\ndef product(x):\n    return {} * x\n"
    (kernels / "called.py").write_text(called.format(2))
    assert told(start(package)) == "42 0"
    (kernels / "called.py").write_text(called.format(3))
    sizes = [file.stat().st_size for file in (package / "kept").rglob("small.twice*")]
    between = sum(sizes) // 2
    assert told(start(package, limit=between)) == "63 0"
    assert told(start(package)) == "63 0"
    assert told(start(package)) == "63 1"


def test_a_kept_kernel_is_compiled_again_when_one_that_it_calls_has_changed(tmp_path):
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
