"""A short posted program of two tools in each dialect that ships, and edits of it."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import pytest

from bonecam.job import Job
from bonecam.machine.machine import Machine, read_machine
from bonecam.nc.dialect import Dialect, dialect_names, read_dialect
from bonecam.nc.feeds import drivable_paths
from bonecam.nc.motions import Motions
from bonecam.nc.posting import write_program
from bonecam.nc.reading import read_program
from bonecam.nc.words import number_blocks
from bonecam.tool.path import ToolPath
from bonecam.verify.removal import cutters_of


@dataclass(frozen=True, eq=False)
class Posted:
    """A program: its `blocks` without numbers, and what it was written for."""

    dialect: Dialect
    machine: Machine
    job: Job
    blocks: tuple[str, ...]

    @property
    def klartext(self) -> bool:
        return self.dialect.grammar == "klartext"

    def text(self, blocks: list[str] | None = None) -> str:
        """The numbered text of blocks."""
        return number_blocks(list(self.blocks if blocks is None else blocks), self.dialect)[0]

    @cached_property
    def motions(self) -> Motions:
        """The program as its control would run it."""
        return read_program(self.text(), self.machine, self.dialect)

    def line(self, block: int) -> int:
        """The line of a block."""
        return block + 1

    @cached_property
    def cuts(self) -> list[int]:
        """The blocks that cut, between a comment CUT and the next LINK."""
        found, cutting = [], False
        for at, block in enumerate(self.blocks):
            if block.strip("(); ") in ("CUT", "LINK"):
                cutting = "CUT" in block
            elif cutting and re.match(r"(L|G0?1) X.* F\d", block):
                found.append(at)
        return found


@pytest.fixture(scope="package")
def posted_of(capsule_path: Callable[..., ToolPath]) -> Callable[[str], Posted]:
    """The short program of a dialect, by its name."""
    made: dict[str, Posted] = {}

    def post(name: str) -> Posted:
        if name not in made:
            machine = read_machine("linuxcnc-xyzbc" if name == "linuxcnc" else "mikron-ucp600")
            dialect = read_dialect(name)
            job = Job().with_values(nc={"machine": machine.name, "controller": name}, material={"name": "paper"})
            roughing, finishing = cutters_of(job, machine)
            paths = (
                replace(capsule_path(level=1, radius=2.0, offset=0.3, count=90, turns=3.0), cutter=roughing),
                replace(capsule_path(level=0, radius=1.0, count=90, turns=3.0), cutter=finishing),
            )
            text = write_program(drivable_paths(paths, machine, dialect, job), machine, dialect, job).text
            made[name] = Posted(dialect, machine, job, tuple(unnumbered(text, dialect)))
        return made[name]

    return post


def unnumbered(text: str, dialect: Dialect) -> list[str]:
    """The blocks of a text without their numbers."""
    if not dialect.numbering.format:
        return text.splitlines()
    return [re.sub(r"^N?\d+ ", "", line) for line in text.splitlines()]


@pytest.fixture(params=dialect_names())
def posted(request: pytest.FixtureRequest, posted_of: Callable[[str], Posted]) -> Posted:
    return posted_of(request.param)
