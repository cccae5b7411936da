"""The public names: typed, loaded when first used, and nothing else."""

import subprocess
import sys
import tomllib
from importlib import import_module
from inspect import signature
from pathlib import Path
from types import ModuleType
from typing import get_type_hints

import mypy.api
import pytest

import bonecam

ROOT = Path(__file__).parents[1]
STAGES = "machine tool mesh surface workholding setup levels material mechanics planning nc verify report".split()
PLUGINS = [f"bonecam_plugins.{name}" for name in "meshlab reposting study tsplines".split()]
PACKAGES = ["bonecam", *(f"bonecam.{name}" for name in STAGES), *PLUGINS]


WANTED = [
    "convert",
    "Job",
    "Job(stock={'diameter': 15.0})",
    "mesh.read_mesh",
    "surface.fit",
    "levels.Level",
    "machine.read_machine",
    "verify.Verification",
]
MISSPELT = ["convret", "mesh.read_meshes", "surface.Tspline", "levels.Levle", "machine.red_machine"]


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    """What mypy says of each public name of WANTED and each MISSPELT one."""
    lines = [f"reveal_type(bonecam.{name})" for name in WANTED] + [f"bonecam.{name}" for name in MISSPELT]
    file = tmp_path_factory.mktemp("typed") / "names_used.py"
    file.write_text("\n".join(["import bonecam", *lines]), encoding="utf-8")
    settings = ["--config-file", str(ROOT / "pyproject.toml"), "--cache-dir", str(ROOT / ".mypy_cache")]
    output, trouble, _ = mypy.api.run([*settings, "--hide-error-context", str(file)])
    assert not trouble, trouble
    told = [line.split(":", 2)[1:] for line in output.splitlines() if "names_used.py:" in line]
    names = dict(enumerate([*WANTED, *MISSPELT], start=2))
    return {names[int(line)]: text for line, text in told}


@pytest.mark.parametrize("name", PACKAGES)
def test_public_names_are_what_a_package_shows(name):
    package = import_module(name)
    names = {item for item in dir(package) if not item.startswith("__")}
    assert names == set(package.__all__)
    assert len(names) > 1
    for item in names:
        assert getattr(package, item) is not None


@pytest.mark.parametrize("name", PACKAGES[1:])
def test_no_module_hides_a_public_name(name):
    package = import_module(name)
    modules = {path.stem for path in Path(package.__path__[0]).iterdir()}
    assert not modules & set(package.__all__)
    assert not [item for item in package.__all__ if isinstance(getattr(package, item), ModuleType)]


@pytest.mark.parametrize("name", PACKAGES)
def test_an_unknown_name_is_refused(name):
    with pytest.raises(AttributeError, match="convret"):
        _ = import_module(name).convret


def test_import_loads_no_library():
    code = "import sys, bonecam, bonecam.mesh; print(*{name.split('.')[0] for name in sys.modules})"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert not {"numpy", "scipy", "numba", "open3d", "pymeshlab"} & set(answer.stdout.split())


def test_help_loads_nothing_that_computes():
    """What a command needs is loaded when it runs: kernels and mesh libraries take two seconds."""
    code = """
import sys
from bonecam.cli import main
try:
    main(["--help"])
finally:
    print("LOADED", *{name.split(".")[0] for name in sys.modules})
"""
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    _, loaded = answer.stdout.split("LOADED")
    assert not {"numba", "open3d", "pymeshlab", "igl", "fcl", "matplotlib"} & set(loaded.split())


@pytest.mark.parametrize("name", WANTED)
def test_public_names_are_typed(name, answers):
    assert "Revealed type is" in answers[name]
    assert 'is "Any"' not in answers[name]
    assert "bonecam." in answers[name]


@pytest.mark.parametrize("name", MISSPELT)
def test_misspelt_names_fail_in_the_type_checker(name, answers):
    assert "[attr-defined]" in answers[name]


def test_every_package_is_installed_with_its_stubs():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
    named = set(settings["packages"])
    found = {path.parent.relative_to(ROOT) for path in (ROOT / "bonecam").rglob("__init__.py")}
    assert {".".join(place.parts) for place in found} <= named
    assert "*.pyi" in settings["package-data"]["*"]
    for name in named:
        top, *rest = name.split(".")
        assert ROOT.joinpath(settings["package-dir"][top], *rest).is_dir(), f"{name} is no folder"
    assert bonecam.__version__


@pytest.mark.parametrize("function", [bonecam.convert, bonecam.morph_levels, bonecam.clamping_shell, bonecam.finish])
def test_help_names_the_kinds_of_meshes_in_a_word(function):
    told = str(signature(function))
    assert "MeshLike" in told
    assert "Open3d" not in told
    assert get_type_hints(function)
