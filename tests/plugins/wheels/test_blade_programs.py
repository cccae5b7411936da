"""Programs of blades among their neighbours, audited by points of trimesh and plain geometry: nothing collides, and no
pass is left out because the tool would not get there."""

from dataclasses import replace

import bonecam_meshes
import numpy as np
import pytest
import trimesh

import bonecam
from bonecam.job import ToolJob
from bonecam.tool import MoveKind
from bonecam.wheels import impeller, read_flow_path, read_sections

WHEEL = bonecam.Job().with_values(
    holding={"diameter": 20.0},
    finishing={
        "radius": 1.5,
        "flute_length": 4.0,
        "shank_diameter": 2.4,
        "overhang": 42.0,
        "holder_diameter": 16.0,
        "scallop": 0.1,
        "feed": 1200.0,
    },
    path={"max_tilt_deg": 85.0},
)
HECC = replace(
    WHEEL,
    holding=replace(WHEEL.holding, diameter=40.0),
    finishing=replace(WHEEL.finishing, radius=2.0, shank_diameter=3.4, overhang=80.0),
)
AUDITED = 300
"""Poses."""
POINTS = 200_000
"""Of the solid."""


@pytest.mark.slow
def test_no_point_of_the_shipped_wheel_or_its_casing_is_inside_the_tool():
    files = [bonecam_meshes.path(f"impeller_{name}") for name in ("hub", "blades", "shroud")]
    made = bonecam.finish(bonecam_meshes.path("impeller_blade"), files[0], files[1:], WHEEL)
    audit(made, WHEEL)


@pytest.mark.slow
def test_every_pass_of_the_hecc_blade_is_reached_between_its_neighbours(shared):
    folder = shared / "meshes" / "blades" / "sections" / "hecc"
    files = sorted(folder.glob("*main_blade_section*"))
    blade = read_sections(files, columns="x r*theta r", axis="-x", scale=10.0).skin(0.01)
    flow = [read_flow_path(next(folder.glob(f"*{end}.txt")), axis="-x", scale=10.0) for end in ("hub", "shroud")]
    wheel = impeller(blade, *flow, 15)
    made = bonecam.finish(blade, wheel.hub, wheel.blades[1:], HECC)
    assert made.path.reasons.count("collision") == sum(made.path.blocked_by.values())
    assert made.path.reasons.count("collision") < 0.01 * np.isfinite(made.path.contacts[:, 0]).sum()
    audit(made, HECC)


def audit(made: bonecam.Finished, job: bonecam.Job) -> None:
    """No point on the solids is deeper in the tool than the gouge tolerance, in poses spread over cuts and links."""
    assert made.report["nc"]["gouge_max_mm"] <= job.path.gouge_tolerance
    moves = np.flatnonzero(made.path.kinds != MoveKind.RAPID)
    assert len(moves) > AUDITED
    solid = trimesh.Trimesh(made.workpiece.solid.vertices, made.workpiece.solid.faces)
    points, _ = trimesh.sample.sample_surface(solid, POINTS, seed=1)
    for pose in moves[np.linspace(0, len(moves) - 1, AUDITED).astype(int)]:
        deep = depth_in_tool(points, made.path.tips[pose], made.path.axes[pose], job.finishing)
        assert deep < job.path.gouge_tolerance


def depth_in_tool(points: np.ndarray, tip: np.ndarray, axis: np.ndarray, tool: ToolJob) -> float:
    """How deep the deepest of the points is inside ball, flute, neck or holder, mm; negative outside."""
    off = points - tip - tool.radius * axis
    up = off @ axis
    aside = np.linalg.norm(off - up[:, None] * axis, axis=1)
    height = up + tool.radius
    ball = tool.radius - np.linalg.norm(off, axis=1)
    flute = np.minimum(tool.radius - aside, np.minimum(up, tool.flute_length - height))
    neck = np.minimum(tool.shank_diameter / 2 - aside, np.minimum(up, tool.overhang - height))
    holder = np.minimum(tool.holder_diameter / 2 - aside, height - tool.overhang)
    return float(np.max([ball, flute, neck, holder]))
