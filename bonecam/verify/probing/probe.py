"""The probe of Gan et al. (2014, section 5.3): a ruby ball of 1 mm touches the machined surface at points of a line.

Round each point a patch of the machined surface is laid out, its nodes SPACING apart, exact at every
node (`machined.py`). The ball comes along the nominal normal. The deviation is the signed distance of its centre from
the nominal surface less its radius.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import dots, perpendicular
from bonecam.errors import JobError
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.tspline import TSpline
from bonecam.verify.probing.line import ProbeLine
from bonecam.verify.probing.machined import Machined, PostedProgram

RUBY = 0.5
"""Radius of the ruby ball of the paper, mm."""
BAND = 0.05
"""The paper's largest deviation, mm."""
PATCH = 0.6
"""Half the width of a patch in radii of the ball: on a surface that leans by up to 35 degrees it touches within."""
LARGEST = 3.0
"""Largest radius of a ball, mm: its patches have 15,000 nodes each."""
SPACING = 0.03
"""Distance of the nodes of a patch, mm: a cusp between two is missed by 2 um where a ball of 1 mm leaves scallops of
0.01 mm, by 6 um where it leaves 0.1 mm."""


@dataclass(frozen=True, eq=False)
class Probed:
    """The `line` that was probed with a ball of this `radius` (mm), the `centres` (n, 3) of the ball where it touched
    the surface as it comes out, and the deviation (mm) there (`deviation`) and on the surface as if nothing bent
    (`rigid`); NaN where it touched nothing. `patches`: the surface that was touched."""

    line: ProbeLine
    radius: float
    centres: Float[ndarray, "n 3"]
    deviation: Float[ndarray, " n"]
    rigid: Float[ndarray, " n"]
    patches: TriangleMesh

    @cached_property
    def within(self) -> float:
        """Share of the points whose deviation stays within BAND."""
        return float((np.abs(self.deviation) < BAND).mean())

    @property
    def largest(self) -> float:
        """The largest deviation either way, mm; infinite where a point touched nothing."""
        return float(np.abs(np.nan_to_num(self.deviation, nan=np.inf)).max())

    def __str__(self) -> str:
        """What the probe found, in a line."""
        figures = self.report
        summary = "no point touched"
        if figures["touched"]:
            share = 100 * figures["within_0_05_share"]
            summary = (
                f"deviation {figures['min_mm']:g} to {figures['max_mm']:g} mm, {share:.0f} % of the points within "
                f"{BAND:g} mm; as if nothing bent at most {figures['rigid_max_mm']:g} mm"
            )
        return f"{figures['touched']} of {figures['points']} points of line s = {figures['line']:g}: {summary}"

    @property
    def report(self) -> dict[str, Any]:
        """`probe` of the report."""
        known = self.deviation[np.isfinite(self.deviation)]
        return {
            "line": round(self.line.s, 4),
            "points": len(self.deviation),
            "touched": len(known),
            "mean_mm": round(float(known.mean()), 4) if len(known) else None,
            "min_mm": round(float(known.min()), 4) if len(known) else None,
            "max_mm": round(float(known.max()), 4) if len(known) else None,
            "within_0_05_share": round(self.within, 4),
            "rigid_max_mm": round(float(np.nanmax(np.abs(self.rigid))), 4) if len(known) else None,
        }

    @property
    def csv(self) -> str:
        """The points: number, way along the line, nominal place and normal, deviations; mm."""
        head = "number,along,x,y,z,nx,ny,nz,deviation,deviation_rigid"
        rows = np.column_stack([self.line.along, self.line.places, self.line.normals, self.deviation, self.rigid])
        lines = [f"{k}," + ",".join(f"{value:.6f}" for value in row) for k, row in enumerate(rows, 1)]
        return "\n".join([head, *lines]) + "\n"


def probe_surface(program: PostedProgram, line: ProbeLine, radius: float = RUBY) -> Probed:
    """Touch the surface that a program leaves along a `line`, with a ball of this `radius`, mm; JobError for one beyond
    LARGEST."""
    if not 0 < radius <= LARGEST:
        raise JobError(f"a ball of radius {radius:g} mm: give more than 0 and at most {LARGEST:g}")
    side = np.arange(-PATCH * radius, PATCH * radius + SPACING / 2, SPACING)
    nodes, faces = _patches(line, side)
    machined = program.machined(nodes)
    kept, centres = _touched(machined, machined.kept, faces, line, radius)
    _, rigid = _touched(machined, machined.cut, faces, line, radius)
    part = program.part
    return Probed(
        line,
        radius,
        centres=centres,
        deviation=deviations(part, centres, radius),
        rigid=deviations(part, rigid, radius),
        patches=kept,
    )


def _touched(
    machined: Machined, heights: Float[ndarray, " m"], faces: ndarray, line: ProbeLine, radius: float
) -> tuple[TriangleMesh, Float[ndarray, "n 3"]]:
    """The patches with these heights, and the centres of a ball that touches them."""
    mesh = TriangleMesh(machined.points + heights[:, None] * machined.normals, faces)
    of_point = heights.reshape(len(line.places), -1)
    start, end = of_point.max(axis=1) + 2 * radius, float(heights.min()) - radius
    return mesh, touching_centres(
        MeshDistance(mesh), line.places, normals=line.normals, radius=radius, start=start, end=end
    )


def _patches(line: ProbeLine, side: Float[ndarray, " k"]) -> tuple[Float[ndarray, "m 3"], ndarray]:
    """Nodes round each place of a line, in its tangent plane, and the triangles between them."""
    first = perpendicular(line.normals)
    second = np.cross(line.normals, first)
    a, b = (each.ravel() for each in np.meshgrid(side, side, indexing="ij"))
    nodes = line.places[:, None] + a[:, None] * first[:, None] + b[:, None] * second[:, None]
    corner = np.arange(len(side) ** 2).reshape(len(side), -1)
    low = corner[:-1, :-1]
    right = corner[1:, :-1]
    up = corner[:-1, 1:]
    far = corner[1:, 1:]
    cells = np.vstack([np.column_stack([x.ravel() for x in three]) for three in ((low, right, far), (low, far, up))])
    faces = np.arange(len(line.places))[:, None, None] * len(a) + cells
    return nodes.reshape(-1, 3), faces.reshape(-1, 3).astype(np.int32)


TOUCHES = 1e-6
"""A ball touches what it is nearer to, mm."""
MOST_STEPS = 500
"""A ball that slides past something so often without touching it is where it is."""


def touching_centres(
    surface: MeshDistance,
    places: Float[ndarray, "n 3"],
    normals: Float[ndarray, "n 3"],
    radius: float,
    start: Float[ndarray, " n"],
    end: float,
) -> Float[ndarray, "n 3"]:
    """Centres of the ball where it first touches the `surface` on its way along each normal, from the height `start`
    (mm, of the centre, clear of everything) down to the height `end`; NaN where it touches nothing."""
    heights = np.array(start)
    coming = np.arange(len(places))
    for _ in range(MOST_STEPS):
        gap = surface.unsigned(places[coming] + heights[coming, None] * normals[coming]) - radius
        heights[coming] -= np.maximum(gap, 0.0)
        coming = coming[(gap > TOUCHES) & (heights[coming] > end)]
        if not len(coming):
            break
    centres = places + heights[:, None] * normals
    centres[heights <= end] = np.nan
    return centres


def deviations(part: TSpline, centres: Float[ndarray, "n 3"], radius: float) -> Float[ndarray, " n"]:
    """Signed distance of each centre from the nominal surface less the ball's radius, mm; NaN where there is none."""
    deviation = np.full(len(centres), np.nan)
    known = np.isfinite(centres[:, 0])
    near = part.project(centres[known])
    outside = dots(part.normals(near.s, near.t), centres[known] - near.points) >= 0
    deviation[known] = np.where(outside, near.distances, -near.distances) - radius
    return deviation
