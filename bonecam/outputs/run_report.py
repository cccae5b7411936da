"""The report of a run, section by section, as --report writes it."""

from collections.abc import Sequence
from typing import Any

from bonecam.levels.closed_morph import Morph
from bonecam.mesh.part import Part
from bonecam.nc.program import Program
from bonecam.setup.stock import Stock, stock_figures
from bonecam.surface.fitting.fit import Fit
from bonecam.toolpath.path import ToolPath
from bonecam.verify.proof import Verification
from bonecam.verify.report import levels_report, nc_report, surface_report, toolpath_report


def report_to_levels(part: Part, fitted: Fit, stock: Stock, morph: Morph, method: str) -> dict[str, Any]:
    """The sections of input, surface, stock and levels."""
    return {
        "input": {
            "file": part.file,
            "faces": part.faces,
            "units": part.units,
            "repairs": list(part.repairs),
        },
        "surface": surface_report(fitted),
        "stock": stock_figures(stock),
        "levels": levels_report(morph.levels),
        "levels_lower_bound": morph.lower_bound,
        "levels_break_mm": round(morph.breaks, 6),
        "levels_method": method,
    }


def report_to_program(
    file: str, paths: Sequence[ToolPath], program: Program, proof: Verification
) -> dict[str, Any]:
    """The sections of tool paths and program; `file` is the program's, empty where none is written."""
    return {"toolpath": toolpath_report(paths), "nc": {"file": file, **nc_report(program, proof)}}
