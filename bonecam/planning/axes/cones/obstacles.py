"""What the sections of a cutter stay out of in a scene, as compiled marching takes it, and the places where the
cutter pivots."""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.kernels.closest.cone_marching import Apexes, Obstacles
from bonecam.planning.axes.cones.cone_nodes import ConeNodes
from bonecam.planning.axes.cones.obstacle_grids import distance_grids
from bonecam.planning.collision.scene import Scene
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import ContactPath

ROOMS = tuple(0.2 * 2 ** (k / 2) for k in range(14))
"""By how much larger (mm) empty balls are sought that touch a contact; even the least is as if the surface were as
hollow as a ball that much larger than the cutter's."""

NOWHERE = 1e6
"""A mesh that is this far off (mm) is no obstacle."""


def obstacles_of(scene: Scene, cutter: Cutter, centres: Float[ndarray, "n 3"]) -> Obstacles:
    """The sections of the cutter with their obstacles round balls at `centres` (mm).

    OrientationError where a mesh of the scene is not closed.
    """
    rows: list[tuple[float, ...]] = []
    columns: list[tuple[float, ...]] = []
    for section in reversed(cutter.profile):
        around = scene.around(section.name, cutter.envelope_radius)
        is_level = around.obstacle == "level"
        first = len(columns)
        columns += [column.row for column in around.columns]
        start, end = section.start - cutter.centre_height, section.end - cutter.centre_height
        radius = section.widest - (scene.tangent_slack if is_level else 0.0)
        rows.append((start, end, radius, float(is_level), around.deviation, first, len(columns), 0, 0))
    sections = np.array(rows)
    to_level = sections[:, 3] > 0
    grids = [
        distance_grids(
            distance, cutter.envelope_radius, sections[held, 1].max(initial=0.0) + cutter.envelope_radius, centres
        )
        for distance, held in ((scene.level_distance, to_level), (scene.material_distance, ~to_level))
    ]
    cells = [grid.cells.copy() for grid in grids]
    cells[1][:, 7] += len(grids[0].values)
    sections[:, 7] = np.where(to_level, 0, len(cells[0]))
    sections[:, 8] = np.where(to_level, len(cells[0]), len(cells[0]) + len(cells[1]))
    values = np.concatenate([grid.values for grid in grids])
    return Obstacles(sections, np.array(columns, dtype=float).reshape(-1, 5), np.concatenate(cells), values)


def single_obstacles(obstacles: Obstacles, section: int) -> Iterator[tuple[str, Obstacles]]:
    """Each obstacle of a section of the tool by its name, alone."""
    row = obstacles.sections[section].copy()
    first, end = int(row[5]), int(row[6])
    row[6] = first
    yield ("level" if row[3] else "material"), obstacles._replace(sections=row[None])
    row = row.copy()
    row[4] = -NOWHERE
    for column in range(first, end):
        alone = row.copy()
        alone[5:7] = column, column + 1
        yield ("clamping" if column > first else "post"), obstacles._replace(sections=alone[None])


def rooms_at(path: ContactPath, scene: Scene) -> Float[ndarray, " n"]:
    """How much larger (mm) than the cutter's ball a ball may be that touches each contact from outside and meets no
    obstacle: of ROOMS the largest for which this holds, or 0."""
    around = scene.around("cutter", path.cutter.envelope_radius)
    rooms = np.array([0.0, *ROOMS])
    free, most = np.zeros((2, len(path.centres)), dtype=np.int64)
    most += len(ROOMS)
    left = np.arange(len(path.centres))
    while len(left):
        # a ball contains the smaller ones that touch the same contact
        tried = (free[left] + most[left] + 1) // 2
        more = rooms[tried]
        radius = path.cutter.envelope_radius + more - scene.tangent_slack
        middles = path.centres[left] + more[:, None] * path.normals[left]
        empty = around.distance_bound(middles, radius, outside=True) >= radius
        free[left[empty]] = tried[empty]
        most[left[~empty]] = tried[~empty] - 1
        left = left[free[left] < most[left]]
    return rooms[free]


def apexes_of(net: ConeNodes, room: Float[ndarray, " n"]) -> Apexes:
    """Where the cutter pivots: the nodes of a net, with the least `room` (mm, `rooms_at`) of their contacts."""
    least = np.full(len(net.places), np.inf)
    np.minimum.at(least, net.node_of, room)
    return Apexes(net.places, net.reach, net.normals, net.spread, least)
