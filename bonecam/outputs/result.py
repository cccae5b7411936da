"""What a run hands back: part, surface, stock, levels, tool paths, program and report."""

from dataclasses import dataclass
from typing import Any

from bonecam.levels.closed_morph import Morph
from bonecam.mesh.part import Part
from bonecam.nc.program import Program
from bonecam.setup.stock import Stock
from bonecam.surface.tspline import TSpline
from bonecam.toolpath.path import ToolPath
from bonecam.verify.removal.result import Removal
from bonecam.verify.summary import summary_of


@dataclass(frozen=True, eq=False, repr=False)
class Morphed:
    """The result of `bonecam.morph_levels`. `report` is the content of the file of --report."""

    part: Part
    surface: TSpline
    stock: Stock
    levels: Morph
    report: dict[str, Any]

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {self.part.file}: {self._told}>"

    @property
    def _told(self) -> str:
        """What was made, in a few words."""
        return f"{self.levels.cuts} cuts, K_min {self.levels.lower_bound}"

    @property
    def summary(self) -> str:
        """The report in a few lines of text."""
        return summary_of(self.report)


@dataclass(frozen=True, eq=False, repr=False)
class Result(Morphed):
    """The result of `bonecam.convert`: levels, the tool path of each level in machining order, the program, and what it
    removes (None where that was not simulated)."""

    paths: tuple[ToolPath, ...]
    program: Program
    removal: Removal | None = None

    @property
    def _told(self) -> str:
        """What was made, in a few words."""
        return f"{super()._told}, {self.program!r}"
