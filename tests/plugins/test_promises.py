"""The core names no plugin, and a plugin imports promised names of bonecam alone."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EXPORT = re.compile(r"^from \.+([\w.]*) import (\w+) as \2$", re.MULTILINE)
MODULES = {
    "bonecam",
    *(f"bonecam.{name}" for name in "plugins errors files progress arrays cli.command job.parameter".split()),
    *(f"bonecam.{name}" for name in "mesh.meshlab runtime.own_files runtime.staging runtime.worker".split()),
    *(f"bonecam.{name}" for name in "kernels kernels.triangles text.numbers".split()),
}
"""Modules whose names are all promised (docs/pages/using/extend.md lists them)."""
PLUGINS = sorted(path.parent for path in (ROOT / "plugins").glob("*/__init__.py"))


def promised() -> set[tuple[str, str]]:
    """Packages, or modules, and their names that a stub promises."""
    found = set()
    for stub in (ROOT / "bonecam").rglob("__init__.pyi"):
        package = ".".join(stub.parent.relative_to(ROOT).parts)
        for module, name in EXPORT.findall(stub.read_text(encoding="utf-8")):
            found |= {(package, name), (f"{package}.{module}", name)}
    return found


def imports_of(file: Path) -> set[tuple[str, str]]:
    """Modules and names that a file imports."""
    nodes = ast.walk(ast.parse(file.read_text(encoding="utf-8")))
    return {
        (str(node.module), alias.name) for node in nodes if isinstance(node, ast.ImportFrom) for alias in node.names
    }


@pytest.mark.parametrize("plugin", PLUGINS, ids=lambda plugin: plugin.name)
def test_a_plugin_imports_promised_names_alone(plugin):
    taken = {item for file in plugin.rglob("*.py") for item in imports_of(file) if item[0].split(".")[0] == "bonecam"}
    assert taken, "it builds on bonecam"
    assert not [item for item in taken if "wheels" in (*item[0].split("."), item[1])], "wheels stand apart"
    assert not {item for item in taken if item[0] not in MODULES} - promised()


@pytest.mark.parametrize("plugin", PLUGINS, ids=lambda plugin: plugin.name)
def test_a_plugin_imports_no_other(plugin):
    own = f"bonecam_plugins.{plugin.name}"
    taken = {module for file in plugin.rglob("*.py") for module, _ in imports_of(file)}
    assert not {module for module in taken if module.startswith("bonecam_plugins.") and not module.startswith(own)}


def test_the_core_names_no_plugin_and_no_wheels():
    for file in (ROOT / "bonecam").rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        assert "bonecam_plugins" not in text, file
        assert "bonecam.wheels" not in text or file.parent.name == "wheels", file
