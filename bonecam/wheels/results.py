"""What a wheel hands back: its report, page, sheet and pictures, and its folder to keep."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from bonecam.files import write_whole
from bonecam.job import Job
from bonecam.levels import Morph
from bonecam.mesh import write_mesh
from bonecam.mesh.triangle_mesh import side_by_side
from bonecam.nc.header import setup_texts, zero_words
from bonecam.nc.requirements import machine_and_dialect
from bonecam.report import levels_report
from bonecam.report.kept import keep_elements
from bonecam.report.outputs import Machined, fill_shared
from bonecam.report.page.contents import Contents, contents_with_program, held, pack
from bonecam.report.pictures import DPI, outline, save_figure
from bonecam.report.sheet.setup_sheet import (
    IN_AIR,
    Paper,
    article,
    draw_table,
    draw_zero,
    items,
    left_lines,
    proof_lines,
    setup_sheet,
    simulated_lines,
)
from bonecam.report.stage_reports import uncut_areas
from bonecam.report.summary import cuts_text, surface_summary
from bonecam.report.warnings import Warned, warning_texts
from bonecam.tool import MoveKind, ToolPath
from bonecam.wheels.proof import wheel_surfaces
from bonecam.wheels.wheel import TurnedBlank, Wheel, repeated


@dataclass(frozen=True, eq=False, repr=False)
class Bladed(Machined):
    """The result of `bonecam.blades`, with the wheel as it stands on its post, its blank, the levels of a channel, and
    the paths of all channels and blades."""

    wheel: Wheel
    blank: TurnedBlank
    levels: Morph
    paths: tuple[ToolPath, ...]

    @property
    def all_paths(self) -> Sequence[ToolPath]:
        """The paths in machining order."""
        return self.paths

    @cached_property
    def packed_view(self) -> bytes:
        """What `view` shows, packed as `bonecam.report.page` has it: the wheel as level 0, the levels of all its
        channels, and the program's moves."""
        solid, report = self.workpiece.solid, self.report
        levels = [
            {
                "index": level.index,
                "name": "channel" if level.index else "the wheel",
                "faces": f"faces_{level.index}",
                "limit": level.limit,
            }
            for level in self.levels.levels
        ]
        facts = {
            "levels": levels,
            "name": report["surface"]["file"],
            "stock": {"text": self.blank.text},
            "stock_bounds": self.blank.mesh.bounds.tolist(),
            **held(solid, self.job),
        }
        arrays = {"solid": solid.vertices, "solid_faces": solid.faces}
        meshes = wheel_surfaces(self.wheel, solid, self.levels.levels)
        for index, mesh in meshes.items():
            arrays |= {f"level_{index}": mesh.vertices, f"faces_{index}": mesh.faces}
        followed = {index: mesh for index, mesh in meshes.items() if index < max(meshes)}
        posted = {"paths": self.paths, "removal": self.removal, "surfaces": followed}
        shape = Contents(facts, arrays)
        return pack(contents_with_program(shape, self.program.text, meshes, self.job, report, self.summary, **posted))

    @property
    def sheet(self) -> str:
        """The setup sheet as the text of an HTML file."""
        blank, job, report, wheel = self.blank, self.job, self.report, self.report["wheel"]
        machine, dialect = machine_and_dialect(job.nc)
        zero = zero_words(machine, dialect)
        radius = blank.diameter / 2
        low, top = float(blank.profile[:, 1].min()), float(blank.profile[:, 1].max())
        paper = Paper(radius, top)
        draw_table(paper, machine.table)
        paper.column(job.holding.diameter / 2, 0.0, low, "post")
        paper.path(np.vstack([blank.profile, blank.profile[::-1] * [-1.0, 1.0]]), "stock")
        for ends in outline(self.workpiece.solid):
            paper.path(ends, "part", closed=False)
        paper.height(0.0, low, radius, 32.0, f"{low:.2f}")
        paper.height(low, top, radius, 32.0, f"{top - low:.2f}")
        paper.width(radius, top, f"\u2300 {blank.diameter:.2f}", 4.0)
        draw_zero(paper, zero)
        page = article(
            self._title,
            self.program,
            job,
            report["nc"],
            heading="Setup sheet: wheel",
            caption="From the front (\u2212Y), sizes in mm: the blank, and the wheel in section Y 0.",
            mounted="Blank, clamping, zero",
            drawing=paper.svg("Turned blank, wheel, post and table from the front"),
            setup=items([blank.text, PROFILE, *setup_texts(job, None, zero)]),
            checks=items(
                [
                    *proof_lines(report["nc"]),
                    f"{wheel['blades']} blades, {wheel['gap_mm']:.2f} mm apart where they are nearest",
                    *simulated_lines(report),
                ]
            ),
            left=items(left_lines(report, "blades and hub")),
            warnings=items([*warning_texts(report["warnings"]), IN_AIR]),
        )
        return setup_sheet(self._title, [page])

    def fill_folder(self, work: Path) -> None:
        """Write surface.iga, solid.ply, blank.ply, blank.csv, toolpath.png, and what all runs have."""
        keep_elements(self.wheel.blade, work)
        write_mesh(self.workpiece.solid, work / "solid.ply")
        write_mesh(self.blank.mesh, work / "blank.ply")
        rows = [f"{radius:.4f},{height:.4f}\n" for radius, height in self.blank.profile]
        write_whole(work / "blank.csv", "".join(["radius_mm,height_mm\n", *rows]))
        self._draw(work / "toolpath.png")
        fill_shared(work, self)

    @property
    def _title(self) -> str:
        return str(self.report["surface"]["file"])

    def _draw(self, file: Path) -> str:
        # The cuts of the first channel (from red at the blank to blue at the hub) and of the first blade (black) beside
        # the blank's profile with the levels' contacts
        from matplotlib import colormaps, figure
        from matplotlib.tri import Triangulation

        solid = self.workpiece.solid
        drawing = figure.Figure(figsize=(14, 7), dpi=DPI)
        plot = drawing.add_subplot(1, 2, 1, projection="3d")
        faces = solid.faces[:: max(1, len(solid.faces) // MOST_FACES)]
        plot.plot_trisurf(
            Triangulation(solid.vertices[:, 0], solid.vertices[:, 1], faces),
            solid.vertices[:, 2],
            color="0.8",
            linewidth=0,
            alpha=0.4,
        )
        flat = drawing.add_subplot(1, 2, 2)
        flat.fill(*np.vstack([self.blank.profile]).T, color="0.9", label="blank")
        colours = colormaps["coolwarm"](np.linspace(1, 0, max(len(self.paths) - 1, 1)))
        for path, colour in zip(self.paths, [*colours, "black"]):
            one = slice(0, len(path.tips) // self.wheel.count)
            cuts = path.kinds[one] == MoveKind.CUT
            contacts = np.where(cuts[:, None], path.contacts[one], np.nan)
            plot.plot(*contacts.T, color=colour, linewidth=0.4)
            flat.plot(np.hypot(*contacts[:, :2].T), contacts[:, 2], color=colour, linewidth=0.3)
        plot.set(xlabel="x (mm)", ylabel="y (mm)", zlabel="z (mm)")
        plot.set_aspect("equal")
        plot.view_init(*WHEEL_VIEW)
        flat.set(xlabel="radius (mm)", ylabel="z (mm)", aspect="equal")
        flat.legend(loc="upper right")
        save_figure(drawing, file)
        return "the wheel with the paths of one channel and of one blade, and its blank in section"

    def __repr__(self) -> str:
        return f"<Bladed of {self._title}: {self.wheel.count} blades, {self.program!r}>"

    @property
    def summary(self) -> str:
        """The report in a few lines of text."""
        return bladed_summary(self.report)


WHEEL_CHORD = 0.01
"""Chord tolerance of the blade on which uncut areas are told, mm."""


def wheel_figures(
    name: str, wheel: Wheel, blank: TurnedBlank, morph: Morph, job: Job, paths: Sequence[ToolPath]
) -> dict[str, Any]:
    """`surface` (blades and the hub between them), `wheel`, `levels`, `post` and `uncut_mm2` of the report."""
    blade = wheel.blade
    gap, place = wheel.gap()
    blade_mesh = blade.tessellate(WHEEL_CHORD)
    whole = repeated(side_by_side([blade_mesh, morph.levels[0].mesh]), wheel.count)
    shape = {
        "file": name,
        "control_points": len(blade.control_points),
        "kind": "closed round s",
        "area_mm2": round(whole.area, 3),
        "solids": len(wheel.others),
    }
    about = {
        "blades": wheel.count,
        "gap_mm": round(gap, 3),
        "blunt_edge_mm": round(wheel.edge, 3),
        "gap_place": [round(float(x), 3) for x in place],
        "blank_diameter_mm": round(blank.diameter, 3),
        "blank_profile_mm": blank.profile.round(4).tolist(),
    }
    return {
        "surface": shape,
        "wheel": about,
        "levels": levels_report(morph.levels),
        "levels_lower_bound": morph.lower_bound,
        "post": {"diameter_mm": job.holding.diameter, "length_mm": job.holding.length},
        "uncut_mm2": uncut_areas(paths, whole),
    }


def bladed_summary(report: Mapping[str, Any]) -> str:
    """The report of a wheel likewise: wheel, blank, channels, program and removal."""
    wheel, area = report["wheel"], report["surface"]["area_mm2"]
    shape = [
        f"wheel     {wheel['blades']} blades, {wheel['gap_mm']:.2f} mm apart; {area:.0f} mm2 with the hub",
        f"blank     turned to the blades' tips, diameter {wheel['blank_diameter_mm']:.2f} mm",
    ]
    return surface_summary(report, shape, [f"channels  {cuts_text(report)}"])


PROFILE = "the blank's profile stands in blank.csv of the kept folder and in the report, rows (radius, Z)"
"""Where the machinist finds what to turn."""


MOST_FACES = 40_000
"""Faces of the wheel that are drawn at most: every so many of more."""
WHEEL_VIEW = (50, -20)
"""Elevation and azimuth, degrees."""


def edge_warnings(wheel: Wheel) -> list[Warned]:
    """That the blades have a blunt edge, which was rounded."""
    width = round(wheel.edge, 3)
    if not width:
        return []
    text = f"the blades' blunt edge, up to {width:.2f} mm wide, is rounded by half circles that stand out of it"
    remedy = "turn it off afterwards, or give sections with their edge"
    return [Warned("blunt_edge", text, width, 0.0, remedy=remedy)]
