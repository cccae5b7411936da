"""The mesh that a cutter is held against on a level, and how deep its flutes may go into that: no gouge of the part.

The ball is kept out of level and part alike. The flutes are held against the level alone, whose mesh is coarser than
the part's: an outer level that comes within microns of the part there is held as the part itself is.
"""

from collections.abc import Sequence

from bonecam.levels.measure.level import Level, MachinedLevel, morph_surfaces
from bonecam.mesh.distance import MeshDistance
from bonecam.planning.collision.scene import TANGENT_SLACK
from bonecam.planning.passes.gouge_lifts import MESH_SHARE, flute_slack, planned_tolerance

PART_CHORD = 0.002
"""Largest chord tolerance (mm) of the tessellated part that balls are kept out of: MESH_SHARE of the gouge
tolerance by default."""
LEVEL_CHORD = 0.01
"""Chord tolerance (mm) of the other tessellated levels: a ball that enters one of them leaves the part
alone."""
BETWEEN = 0.002
"""How much nearer to the part a level may be between the vertices of its mesh than at them, mm."""


def part_chord(gouge_tolerance: float) -> float:
    """The chord tolerance (mm) of the part's mesh where a gouge of `gouge_tolerance` mm is allowed."""
    return min(PART_CHORD, MESH_SHARE * planned_tolerance(gouge_tolerance))


def distance_to_part(levels: Sequence[Level], gouge_tolerance: float) -> MeshDistance:
    """Distances to the part, that of the `levels` from part to stock, tessellated as finely as the gouge tolerance (mm)
    asks for."""
    return MeshDistance(morph_surfaces(levels)[0].tessellate(part_chord(gouge_tolerance)))


def held_level(level: MachinedLevel, part: MeshDistance, gouge_tolerance: float) -> tuple[MeshDistance, float]:
    """Distances to the mesh of a `level`, and how deep (mm) flutes may go into it (`Scene.tangent_slack`) so that they
    go into the `part`, whose mesh has `part_chord`, by `flute_slack` at most."""
    slack = flute_slack(gouge_tolerance)
    if not level.index:
        return part, slack
    coarse = MeshDistance(level.surface.tessellate(LEVEL_CHORD))
    reach = TANGENT_SLACK - slack + BETWEEN
    if part.unsigned(coarse.mesh.vertices).min() >= reach:
        return coarse, TANGENT_SLACK
    return MeshDistance(level.surface.tessellate(part_chord(gouge_tolerance))), slack
