"""README and docs: every example runs as it stands, commands parse, names, files and links exist.

A fenced block is run, unless an HTML comment right before it says otherwise:

    <!-- slow -->               run by `pytest -m slow` only
    <!-- not run: REASON -->    never run
    <!-- output -->             what the command before it prints; compared by `pytest -m slow`, by the first words of
                                its lines, of a program by all words, speeds and minutes

A block with title="NAME" is written to that file first, so that later blocks can use it.
"""

import argparse
import ast
import importlib
import importlib.util
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import pytest
from bonecam_meshes import path as shipped

import bonecam
from bonecam.cli.catalogues import CATALOGUES
from bonecam.cli.parser import make_parser
from bonecam.machine import read_machine
from bonecam.mesh import TriangleMesh, read_mesh, write_mesh

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs" / "pages"
README = ROOT / "README.md"
PAGES = [README, *sorted(DOCS.rglob("*.md"))]
FENCE = re.compile(
    r'(?:^<!-- (?P<mark>slow|output|not run: [^\n]+) -->\n)?^```(?P<language>\w*)(?: title="(?P<title>[^"]+)")?\n'
    r"(?P<text>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)


@dataclass(frozen=True)
class Block:
    """A fenced block of a page: its first line, language, title, text, and what the comment before it says."""

    page: Path
    line: int
    language: str
    title: str
    text: str
    mark: str


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


def blocks(page: Path) -> list[Block]:
    text = page.read_text(encoding="utf-8")
    return [
        Block(
            page,
            text.count("\n", 0, found.start("text")) + 1,
            found["language"],
            found["title"] or "",
            found["text"],
            found["mark"] or "",
        )
        for found in FENCE.finditer(text)
    ]


def label(block: Block) -> str:
    return f"{name(block.page)}:{block.line}"


def words(block: Block) -> list[list[str]]:
    """The commands of a bash block, as words."""
    lines = [line.partition(">")[0] for line in block.text.splitlines()]
    return [found for line in lines if (found := shlex.split(line, comments=True))]


ALL = [block for page in PAGES for block in blocks(page)]
RUN = [page for page in PAGES if any(block.language in ("python", "toml") for block in blocks(page))]
SLOW = [page for page in PAGES if any(block.language in ("python", "bash") for block in blocks(page))]
OURS = "bonecam", "bonecam_plugins", "bonecam_meshes"
PYTHON = [block for block in ALL if block.language == "python"]
COMMANDS = [
    found for block in ALL if block.language == "bash" and "test_outside" not in block.mark for found in words(block)
]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder to try things in, as the working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def put_bones(folder: Path, page: Path) -> None:
    """The phalanx as bone.stl, in metres for the README and in mm for the docs, and a folder of scans."""
    mesh = read_mesh(shipped("phalanx"))
    scale = 1e-3 if page == README else 1.0
    (folder / "scans").mkdir()
    write_mesh(TriangleMesh(mesh.vertices * scale, mesh.faces), folder / "bone.stl")
    shutil.copy(folder / "bone.stl", folder / "scans")


def run_toml(block: Block) -> None:
    """A job, a machine or what stands in a folder of such files is read as such, anything else as TOML."""
    values = tomllib.loads(block.text)
    if (kind := Path(block.title).parent.name) in CATALOGUES:
        CATALOGUES[kind][1](block.title)
    elif "chain" in values:
        assert read_machine(block.title).title == values["title"]
    elif "project" not in values:
        bonecam.read_job(block.title)


def run_bash(block: Block) -> str:
    """What the block prints. LinuxCNC's interpreter is left out where it is not installed."""
    lines = block.text.splitlines()
    kept = [line for line in lines if not line.startswith("rs274") or shutil.which("rs274")]
    there = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    command = ["bash", "-e", "-c", "\n".join(kept)]
    return subprocess.run(command, env=there, check=True, stdout=subprocess.PIPE, text=True).stdout


def run(page: Path, folder: Path, *, slow: bool) -> None:
    """The blocks of one page, one after the other in one folder and with one set of Python names."""
    put_bones(folder, page)
    names: dict[str, object] = {"__name__": "documentation"}
    printed = ""
    for block in blocks(page):
        if block.mark.startswith("not run") or (block.mark == "slow" and not slow):
            continue
        if block.title:
            (folder / block.title).parent.mkdir(parents=True, exist_ok=True)
            (folder / block.title).write_text(block.text, encoding="utf-8")
        if block.language == "toml":
            run_toml(block)
        elif block.language == "python" and not ("surface.files.cad" in block.text and not has_cad()):
            exec(compile("\n" * (block.line - 1) + block.text, str(page), "exec"), names)
        elif block.language == "bash" and slow:
            printed = run_bash(block)
        elif block.mark == "output" and slow:
            shown, made = block.text, printed
            if re.match(r"0 BEGIN PGM ", shown):
                shown, made = program_words(shown), program_words(made)
                pairs = zip(SPEEDS.findall(shown), SPEEDS.findall(made), strict=True)
                assert all(0.5 < float(one) / float(other) < 2.0 for one, other in pairs)
                assert NUMBER.sub("#", shown) == NUMBER.sub("#", made)
            assert first_words(shown) == first_words(made)


NUMBER = re.compile(r"[+-]?\d[\d.]*")
SPEEDS = re.compile(r"(?:\bS|\bF|ABOUT )(\d[\d.]*)")
"""Figures of a program that tell an old text: speeds, feeds, minutes; others may be those of another run."""


def program_words(text: str) -> str:
    """The words of a program in one line, without the numbers of its blocks, wherever its comments are wrapped."""
    words = " ".join(re.sub(r"^\d+ (; )?", "", line) for line in text.splitlines())
    return re.sub(r"( -)+(?= )", "", words)


def first_words(text: str) -> list[str]:
    return [line.partition(" ")[0] for line in text.splitlines()]


def has_cad() -> bool:
    """Whether the extra `cad` is installed."""
    return importlib.util.find_spec("OCP") is not None


def resolve(path: str) -> object:
    """A dotted name: a module, or something in one."""
    head, _, tail = path.rpartition(".")
    holder = importlib.import_module(head) if head == "bonecam" or is_module(head) else resolve(head)
    return getattr(holder, tail) if hasattr(holder, tail) else importlib.import_module(path)


def is_module(path: str) -> bool:
    try:
        return importlib.util.find_spec(path) is not None
    except ModuleNotFoundError:
        return False


@pytest.mark.parametrize("page", RUN, ids=name)
def test_quick_examples_run(page, folder):
    run(page, folder, slow=False)


@pytest.mark.slow
@pytest.mark.parametrize("page", SLOW, ids=name)
def test_all_examples_run(page, folder):
    run(page, folder, slow=True)


@pytest.mark.parametrize("block", ALL, ids=label)
def test_every_block_is_run_or_says_why_not(block):
    known = block.language in ("python", "bash", "toml", "math")
    assert known or block.mark == "output" or block.mark.startswith("not run: ")


@pytest.mark.parametrize("command", [found for found in COMMANDS if found[0] == "bonecam"], ids=" ".join)
def test_every_command_parses(command):
    assert callable(make_parser().parse_args(command[1:]).run)


@pytest.mark.parametrize("command", ["convert", "demo", "levels", "finish", "batch", "script", "job"])
def test_every_option_is_told(command):
    text = (DOCS / "using" / "command-line.md").read_text(encoding="utf-8")
    actions = make_parser()._actions
    choices = next(item for item in actions if isinstance(item, argparse._SubParsersAction)).choices
    options = {item.option_strings[-1] for item in choices[command]._actions if item.option_strings}
    told = {"--help", "--quiet", "--verbose", "--output"}  # by their short forms
    assert sorted(option for option in options - told if f"`{option}" not in text) == []


@pytest.mark.parametrize("block", PYTHON, ids=label)
def test_every_import_exists(block):
    for node in ast.walk(ast.parse(block.text)):
        if isinstance(node, ast.ImportFrom) and str(node.module).split(".")[0] in OURS:
            assert [resolve(f"{node.module}.{item.name}") for item in node.names]


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_name_and_file_exists(page):
    text = page.read_text(encoding="utf-8")
    for found in re.findall(r"(?:`|::: )(bonecam(?:\.\w+)+)", text):
        resolve(found)
    for found in re.findall(r"`((?:bonecam|tests|meshes|docs)/[\w/.-]+)`", text):
        assert (ROOT / found).exists(), found
    for found in re.findall(r"^    make (\w+)|`make (\w+)`", text, re.MULTILINE):
        target = found[0] or found[1]
        assert f"\n{target}:" in (ROOT / "Makefile").read_text(), target


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub and mkdocs make them."""
    titles = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_somewhere(page):
    text = FENCE.sub("", page.read_text(encoding="utf-8"))
    for target in re.findall(r"\]\(([^)]+)\)", text):
        if "://" in target:
            continue
        file, _, anchor = target.partition("#")
        found = page.parent / file if file else page
        assert found.exists(), target
        assert not anchor or anchor in anchors(found), target


def test_every_page_is_in_the_navigation():
    listed = re.findall(r"^ +- ([\w/-]+\.md)$", (ROOT / "docs" / "mkdocs.yml").read_text(), re.MULTILINE)
    assert sorted(listed) == sorted(page.relative_to(DOCS).as_posix() for page in DOCS.rglob("*.md"))


def test_every_stage_has_a_page_of_the_reference():
    packages = {package.parent.name for package in (ROOT / "bonecam").glob("*/__init__.py")}
    pages = {page.stem for page in (DOCS / "reference").glob("*.md")}
    assert packages - {"kernels", "cli", "runtime", "wheels"} == pages - {"bonecam"}


def test_the_readme_is_short():
    assert len(README.read_text(encoding="utf-8").splitlines()) <= 200
