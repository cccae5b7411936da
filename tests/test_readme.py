"""The README: its snippets run as they stand, its commands parse, its options are all there, its pictures
exist."""

import argparse
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from bonecam_meshes import path as shipped

from bonecam.cli import _parser
from bonecam.mesh.files.mesh_files import read_mesh, write_mesh

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
LONG = ("bonecam.convert(", "generate_morph_levels", "bonecam.morph_levels(")
"""What takes more than ten seconds."""


def blocks(language: str) -> list[tuple[int, str]]:
    """Fenced blocks of one language, each with the number of its first line."""
    found = re.finditer(rf"^```{language}\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)
    return [(TEXT.count("\n", 0, item.start(1)) + 1, item.group(1)) for item in found]


def commands() -> list[list[str]]:
    lines = [line for _, block in blocks("bash") for line in block.splitlines()]
    return [shlex.split(line.partition(">")[0], comments=True) for line in lines]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where a stranger tries things: with a bone, and a folder of scans."""
    (tmp_path / "scans").mkdir()
    write_mesh(read_mesh(shipped("phalanx")), tmp_path / "bone.stl")
    shutil.copy(tmp_path / "bone.stl", tmp_path / "scans")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run_python(line: int, code: str) -> None:
    exec(compile("\n" * (line - 1) + code, str(ROOT / "README.md"), "exec"), {"__name__": "readme"})


def test_quick_python_snippets_run_in_order(folder: Path) -> None:
    for line, code in blocks("python"):
        if "bonecam.surface.files.cad" in code:
            pytest.importorskip("OCP", reason="the extra `cad` is not installed")
        if not any(word in code for word in LONG):
            run_python(line, code)
    assert {"bone.tspline", "bone.iga", "bone.step"} <= {item.name for item in folder.iterdir()}


@pytest.mark.slow
def test_long_python_snippets_and_all_commands_run(folder: Path) -> None:
    for line, code in blocks("python"):
        if any(word in code for word in LONG):
            run_python(line, code)
    there = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    for _, code in blocks("bash"):
        kept = [line for line in code.splitlines() if not line.startswith("rs274") or shutil.which("rs274")]
        subprocess.run(
            ["bash", "-e", "-c", "\n".join(kept)], env=there, check=True, stdout=subprocess.DEVNULL
        )
    made = {
        "phalanx.h",
        "levels.mlx",
        "bone.h",
        "bone.json",
        "bone.ngc",
        "job.toml",
        "programs/batch.csv",
        "layers/level_00.ply",
        "levels/coloured.png",
    }
    assert all((folder / name).exists() for name in made)


@pytest.mark.parametrize("words", [words for words in commands() if words[:1] == ["bonecam"]], ids=" ".join)
def test_every_command_parses(words: list[str]) -> None:
    assert callable(_parser().parse_args(words[1:]).run)


@pytest.mark.parametrize("name", ["convert", "demo", "levels", "batch"])
def test_every_option_is_told(name: str) -> None:
    command = next(
        action for action in _parser()._actions if isinstance(action, argparse._SubParsersAction)
    ).choices[name]
    names = {words[-1] for action in command._actions if (words := action.option_strings)} - {
        "--help",
        "--quiet",
        "--verbose",
        "--output",
    }
    assert sorted(option for option in names if f"`{option}" not in TEXT) == []


def test_pictures_and_files_exist() -> None:
    named = re.findall(
        r"\((tests/[\w/.]+)\)|src=\"([^\"]+)\"|`(tests/[\w/]+\.py|bonecam/[\w/]+(?:\.py|/)|meshes/\w+\.py)`",
        TEXT,
    )
    assert [name for names in named for name in names if name and not (ROOT / name).exists()] == []


def test_sections_that_are_linked_exist() -> None:
    titles = {
        re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-")
        for title in re.findall(r"^#+ (.*)$", TEXT, re.MULTILINE)
    }
    assert [anchor for anchor in re.findall(r"\]\(#([^)]+)\)", TEXT) if anchor not in titles] == []
