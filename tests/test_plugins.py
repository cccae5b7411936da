"""What a user's folder adds by name: one that is no such thing is told in one line, and what ships is not replaced."""

import os
import subprocess
import sys

import pytest

from bonecam.cli.parser import make_parser
from bonecam.plugins import ATTRIBUTES, added

SECTION = """
from dataclasses import dataclass
from bonecam.job.parameter import JobSection, parameter

@dataclass(frozen=True)
class SECTION(JobSection):
    depth: float = parameter(1.0, "Depth", "How deep.", 0.0, 2.0)
"""


@pytest.fixture
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("BONECAM_HOME", str(tmp_path))
    return tmp_path


def put(home, kind, name, text):
    (home / kind).mkdir(exist_ok=True)
    (home / kind / f"{name}.py").write_text(text)


def run(*words):
    there = {**os.environ, "BONECAM_NO_PLUGINS": "1"}
    return subprocess.run([sys.executable, "-m", "bonecam", *words], env=there, capture_output=True, text=True)


@pytest.mark.parametrize(("kind", "attribute"), ATTRIBUTES.items())
def test_a_file_of_every_kind_holds_its_object(kind, attribute, home):
    put(home, kind, "mine", f"{attribute} = 7\n")
    assert added(kind, "mine") == 7


def test_what_is_no_command_or_section_is_one_line_and_all_else_works(home):
    put(home, "commands", "odd", "COMMAND = 3\n")
    put(home, "demos", "odd", "DEMO = 3\n")
    put(home, "sections", "odd", "SECTION = 3\n")
    done = run("job")
    assert done.returncode == 0
    lines = done.stderr.splitlines()
    assert [line.split(": ", 2)[1] for line in sorted(lines)] == ["commands odd", "demos odd", "sections odd"]
    assert all("odd.py: fails: TypeError: 3 is no " in line for line in lines)


def test_a_section_is_added_and_none_that_ships_is_replaced(home):
    put(home, "sections", "pocket", SECTION)
    put(home, "sections", "stock", SECTION)
    put(home, "commands", "convert", "COMMAND = 3\n")
    done = run("job", "--set", "pocket.depth=0.5", "--set", "stock.diameter=15")
    assert done.stderr == ""
    assert "[pocket]\ndepth = 0.5" in done.stdout
    assert "diameter = 15.0" in done.stdout


def test_a_batch_that_is_stopped_tells_what_is_kept():
    options = make_parser().parse_args(["batch", "bone.stl", "-o", "out"])
    kept = "finished programs are kept, --resume continues from there"
    assert (options.stopped, options.stopped_late) == (kept, kept)
