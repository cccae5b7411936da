"""The study is found through entry points alone: the core neither imports nor names it, and runs without it."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

CORE = Path(__file__).parents[3] / "bonecam"
NAMED = re.compile(r"bonecam_plugins|\biso[-_]height|\bqcqp\b|\bclarabel\b|\bstudy\b", re.IGNORECASE)
OF_STUDY = {"rotary", "iso-height", "qcqp", "clarabel"}
"""Choices of a job that it adds."""


def told(*words: str, alone: bool = False) -> subprocess.CompletedProcess[str]:
    """What `bonecam` says to these words, with what packages add or without."""
    there = {**os.environ, "BONECAM_NO_PLUGINS": "1" if alone else ""}
    return subprocess.run([sys.executable, "-m", "bonecam", *words], env=there, capture_output=True, text=True)


def test_the_core_neither_imports_nor_names_it():
    for path in CORE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import | ast.ImportFrom):
                modules = [getattr(node, "module", None) or "", *(alias.name for alias in node.names)]
                assert not any(NAMED.search(module) for module in modules), f"{path}: line {node.lineno}"
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                assert not NAMED.search(node.value), f"{path}: line {node.lineno}"
            elif isinstance(node, ast.Compare) and "strategy" in ast.unparse(node):
                assert "rotary" not in ast.unparse(node), f"{path}: line {node.lineno}"


@pytest.mark.parametrize("command", ["compare", "probe"])
def test_its_commands_come_with_it_and_are_refused_in_a_line_without(command):
    with_it, without = told(command, "--help"), told(command, "--help", alone=True)
    assert with_it.returncode == 0
    assert "--points N" in with_it.stdout
    assert (without.returncode, without.stdout, without.stderr.count("\n")) == (2, "", 1)
    assert f"'{command}' is unknown" in without.stderr
    assert command not in told("--help", alone=True).stdout


@pytest.mark.parametrize(
    "settings",
    [
        {"path.strategy": "iso-height", "levels.method": "qcqp"},
        {"path.strategy": "rotary", "levels.method": "published"},
        {"path.orientation": "published", "levels.solver": "clarabel"},
    ],
)
def test_its_choices_come_with_it_and_are_refused_in_a_line_without(settings):
    words = [word for name, value in settings.items() for word in ("--set", f"{name}={value}")]
    with_it, without = (told("job", *words, alone=alone) for alone in (False, True))
    assert with_it.returncode == 0
    assert (without.returncode, without.stdout, without.stderr.count("\n")) == (2, "", 1)
    refused = without.stderr.split("; ")
    assert len(refused) == len(settings)
    for fault, (name, value) in zip(refused, settings.items(), strict=True):
        field = name.partition(".")[2]
        assert f'{field} = "{value}"' in with_it.stdout
        assert f"{field} = {value!r}" in fault
        assert "choose one of" in fault


def test_the_core_alone_has_none_of_its_names():
    code = "import bonecam, sys; print(sorted(name for name in ('compare', 'probe', 'study') if name in dir(bonecam)))"
    there = {**os.environ, "BONECAM_NO_PLUGINS": "1"}
    done = subprocess.run([sys.executable, "-c", code], env=there, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
    listed = told("job", alone=True).stdout
    assert not [name for name in OF_STUDY if f"{name}]" in listed or f"{name}," in listed]
