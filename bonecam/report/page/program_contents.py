"""What a page shows of a program: its moves as read back from the text, the tools, what stands after each level, what
is left.

Fewer rows of a path within a chord tolerance.

The cones of free axes that a page shows at contacts.

What a page shows of a machine: its rotary axes, where they stand in each move, and what they carry.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.spatial import cKDTree

from bonecam.arrays import dots
from bonecam.job import Job
from bonecam.machine.axes import RotaryAxis
from bonecam.machine.machine import Machine
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.dialect import Dialect
from bonecam.nc.posting.marks import LIFTED, REWIND
from bonecam.nc.reading.motions import Motions
from bonecam.nc.reading.read import read_program
from bonecam.nc.words import comment
from bonecam.report.page.move_sources import of_rows, of_text, rows_of_moves
from bonecam.report.page.packing import Contents
from bonecam.report.summary import WHY
from bonecam.tool.cutter import Cutter
from bonecam.tool.elliptic_cones import EllipticCones
from bonecam.tool.path import PARTING, MoveKind, ToolPath
from bonecam.verify.removal.groups import feed_minutes, groups_of
from bonecam.verify.removal.left import LEFT
from bonecam.verify.removal.of_job import cutters_of, followed_surfaces
from bonecam.verify.removal.result import Left, Removal


def rotary_angles(machine: Machine, words: Float[ndarray, "n 5"]) -> dict[str, Float[ndarray, " n"]]:
    """`move_angle_B` and so on: the angles of the rotary axes that the machine has, degrees, from joints in radians."""
    return {f"move_angle_{axis.letter}": np.degrees(words[:, machine.column(axis)]) for axis in machine.own_rotary}


def machine_facts(machine: Machine) -> dict[str, Any]:
    """`rotary`: the letters of its axes; `kinematics`: those that carry the part, from the part outward, those of the
    head, from the base outward, and the place (mm) and the frame of the part in the machine, all axes at zero, as
    `bonecam.machine.kinematics` has them."""
    return {
        "rotary": [axis.letter for axis in machine.own_rotary],
        "kinematics": {
            "table": _axes(machine.part_axes),
            "head": _axes(machine.tool_axes),
            "zero": list(machine.part_zero),
            "frame": [list(row) for row in machine.part_frame],
        },
    }


def _axes(axes: Sequence[RotaryAxis]) -> list[list[Any]]:
    """Letter, direction and pivot (mm) of those that have a letter; the others stand at zero."""
    return [[axis.letter, list(axis.direction), list(axis.pivot)] for axis in axes if axis.letter]


def cone_contents(
    paths: Sequence[ToolPath], rows: Int[ndarray, " n"], arrives: Bool[ndarray, " n"]
) -> dict[str, ndarray]:
    """Axes, directions of the largest opening and semi-angles (radians) of cones, and for each move that `arrives` at
    one of the `rows` of all paths its cone's number from 1; 0 where it has none, or the move ends between contacts.
    Empty where no axis was chosen in a cone."""
    shapes = [EllipticCones.none(0)]
    cone_of = []
    count = 0
    for path in paths:
        cones = path.cones
        if cones is None:
            cone_of.append(np.zeros(len(path.tips), dtype=np.int64))
            continue
        cone_of.append(np.where(cones.cone_of >= 0, cones.cone_of + count + 1, 0))
        shapes.append(cones.shapes)
        count += len(cones.shapes)
    if not count:
        return {}
    used, number = np.unique(np.where(arrives, np.concatenate(cone_of)[rows], 0), return_inverse=True)
    shift = int(used[0] > 0)  # without a move that has no cone numbers begin at 0 too
    chosen = used[used > 0] - 1
    return {
        "cone_axis": np.vstack([part.axes for part in shapes])[chosen],
        "cone_side": np.vstack([part.sides for part in shapes])[chosen],
        "cone_angle": np.vstack([part.angles for part in shapes])[chosen],
        "move_cone": number + shift,
    }


def thinned(
    tips: Float[ndarray, "n 3"],
    axes: Float[ndarray, "n 3"],
    needed: Bool[ndarray, " n"],
    tolerance: float,
    length: float,
) -> Int[ndarray, " k"]:
    """Rows that are enough: tips, and the points `length` mm up the axes, lie within `tolerance` (mm) of the lines
    between neighbours. `needed` rows stay, so do the first and the last.

    Each round leaves out at most every other row, within half of the tolerance that is left.
    """
    kept = np.arange(len(tips))
    rest = tolerance
    while True:
        rest /= 2
        inner = kept[1:-1]
        far = np.maximum(_distances(tips, kept), _distances(tips + length * axes, kept))
        droppable = (far < rest) & ~needed[inner]
        droppable[1::2] = False
        if droppable.sum() < len(kept) / 100:
            return kept
        kept = np.delete(kept, 1 + np.flatnonzero(droppable))


def _distances(points: Float[ndarray, "n 3"], kept: Int[ndarray, " k"]) -> Float[ndarray, " m"]:
    """Distance of each inner point of a polyline from the segment between its neighbours, mm."""
    before = points[kept[:-2]]
    here = points[kept[1:-1]]
    after = points[kept[2:]]
    along = after - before
    square = np.maximum(dots(along, along), np.finfo(float).tiny)
    share = np.clip(dots(here - before, along) / square, 0.0, 1.0)
    return np.linalg.norm(before + share[:, None] * along - here, axis=1)


MOST_MOVES = 150_000
"""Of programs with more moves those that a line within CHORD does without are left out."""
CHORD = 0.05
"""Chord tolerance, mm, of the thinned paths of long programs, at the tip and AXIS_LENGTH up the tool."""
AXIS_LENGTH = 10.0
"""mm."""
NO_LEVEL = 2**16
"""Of moves that belong to no level."""
PARTED = NO_LEVEL + 1
"""Of moves that part the part from its post; `assets/program.js` knows it."""
NEAR = 1.0
"""A vertex that is farther from all contacts of a level, and keeps what stands there, is not cut on it, mm."""
UNCUT_SHOWN = 20_000
"""Uncut contacts shown at most: evenly chosen ones of more."""


def program_contents(
    text: str,
    meshes: Mapping[int, TriangleMesh],
    job: Job,
    machine: Machine,
    dialect: Dialect,
    *,
    paths: Sequence[ToolPath] = (),
    removal: Removal | None = None,
    surfaces: Mapping[int, TriangleMesh] | None = None,
) -> Contents:
    """The moves of the posted `text`, and what the simulation, if there was one, told of them.

    `meshes` are those of the levels by number, `surfaces` those of them that levels or layers follow (None: as the
    job's strategy does). Without the `paths` that the text was written from, its comments tell
    links from cuts, and tips stand for contacts.
    """
    motions = read_program(text, machine, dialect)
    surfaces = followed_surfaces(job, meshes) if surfaces is None else surfaces

    # The level of each move; NO_LEVEL where no comment names one, PARTED behind the last level
    numbers = {None: NO_LEVEL, PARTING: PARTED}
    level_of = np.concatenate(
        [
            np.full(len(group.moves), numbers.get(group.level, group.level))
            for group in groups_of(text, motions, dialect)
        ]
    )

    leads = rows_of_moves(motions, paths, dialect) if paths else None
    kinds, contacts = of_rows(motions, paths, leads) if leads else of_text(motions)
    moves = _moves(motions, kinds, contacts, level_of)
    if removal is not None:
        moves |= _removed(motions, removal, level_of, contacts, surfaces)
    kept = _shown(motions, kinds, level_of)
    arrays = {f"move_{name}": values[kept] for name, values in moves.items()}
    arrays |= rotary_angles(machine, motions.words[kept])
    arrays |= rewind_contents(text, motions, dialect)
    arrays["text"] = np.frombuffer(text.encode("latin-1", "replace"), np.uint8)
    reported = {
        **{"machine": machine.name, "controller": dialect.name, "blocks": motions.blocks},
        "time": f"about {moves['minute'][-1]:.1f} min at the feed",
        "chord": CHORD if len(kept) < len(kinds) else 0.0,
        "layers": _layers(level_of, surfaces, meshes),
        **machine_facts(machine),
    }
    facts: dict[str, Any] = {"tools": [_tool(cutter) for cutter in cutters_of(job, machine)], "program": reported}
    if leads:
        facts["uncut"], uncut = _uncut(paths)
        arrays |= {**uncut, **cone_contents(paths, leads.rows[kept], leads.arrives[kept])}
    if removal is not None:
        arrays |= _standing(removal, surfaces, contacts[kept], kinds[kept], level_of[kept])
    if removal is not None and removal.left is not None:
        facts["left"], left = _left(removal.left)
        if removal.mechanics is not None and removal.mechanics.error is not None:
            facts["left"]["bent"] = removal.mechanics.error.p99
            left["left_bent"] = removal.mechanics.error.sizes
        arrays |= left
    return Contents(facts, arrays)


def _layers(
    level_of: Int[ndarray, " n"], surfaces: Mapping[int, TriangleMesh], meshes: Mapping[int, TriangleMesh]
) -> list[dict[str, int]]:
    """The levels or layers of the moves in ascending order, and the level whose mesh each follows."""
    numbers = {id(mesh): index for index, mesh in meshes.items()}
    levels = [level for level in np.unique(level_of).tolist() if level in surfaces]
    return [{"level": level, "surface": numbers[id(surfaces[level])]} for level in levels]


def _shown(motions: Motions, kinds: Int[ndarray, " n"], levels: Int[ndarray, " n"]) -> Int[ndarray, " k"]:
    """The moves that are shown."""
    if len(kinds) <= MOST_MOVES:
        return np.arange(len(kinds))
    changes = [np.diff(values, append=values[-1]) != 0 for values in (kinds, levels, motions.tools)]
    return thinned(motions.tips, motions.axes, np.any(changes, axis=0), CHORD, AXIS_LENGTH)


def _moves(
    motions: Motions, kinds: Int[ndarray, " n"], contacts: Float[ndarray, "n 3"], levels: Int[ndarray, " n"]
) -> dict[str, ndarray]:
    """What is told of every move; a feed of 0 is a rapid."""
    length = np.r_[0.0, np.linalg.norm(np.diff(motions.tips, axis=0), axis=1)]
    feeds = np.where(motions.inverse_time, motions.feed_rates * length, motions.feed_rates)
    return {
        "tip": motions.tips,
        "axis": motions.axes,
        "contact": contacts,
        "kind": kinds,
        "level": levels,
        "tool": motions.tools,
        "line": motions.lines,
        "feed": np.where(motions.rapid, 0.0, feeds),
        "minute": np.cumsum(feed_minutes(motions)),
    }


def _removed(
    motions: Motions,
    removal: Removal,
    level_of: Int[ndarray, " n"],
    contacts: Float[ndarray, "n 3"],
    surfaces: Mapping[int, TriangleMesh],
) -> dict[str, ndarray]:
    """What each move removes of the material: its section (mm^2: volume a length), how deep the place where it touches
    lay (mm) when its level began, and where that was asked the mean force that it needs (N)."""
    length = np.r_[0.0, np.linalg.norm(np.diff(motions.tips, axis=0), axis=1)]
    section = np.divide(removal.move_volumes, length, out=np.zeros(len(length)), where=length > LEFT)
    depth = np.zeros(len(length))
    for standing in removal.standing:
        moves = np.flatnonzero(level_of == standing.level)
        nearest = cKDTree(surfaces[standing.level].vertices).query(contacts[moves])[1]
        depth[moves] = standing.before[nearest]
    bent = {"force": removal.mechanics.move_forces(len(length))} if removal.mechanics else {}
    return {"section": np.minimum(section, np.percentile(section, 99.9)), "depth": depth, **bent}


def _standing(
    removal: Removal,
    surfaces: Mapping[int, TriangleMesh],
    contacts: Float[ndarray, "n 3"],
    kinds: Int[ndarray, " n"],
    level_of: Int[ndarray, " n"],
) -> dict[str, ndarray]:
    """For each level the heights of what stands on it before and after its moves, and the move that cuts each vertex:
    the one that touches nearest to it; none, which is behind the last, where nothing goes and none comes near."""
    arrays: dict[str, ndarray] = {}
    for standing in removal.standing:
        k = standing.level
        moves = np.flatnonzero((level_of == k) & (kinds == MoveKind.CUT))
        arrays[f"before_{k}"] = standing.before
        arrays[f"after_{k}"] = standing.after
        if len(moves):
            away, nearest = cKDTree(contacts[moves]).query(surfaces[k].vertices)
            cut = (away < NEAR) | (standing.after < standing.before)
            arrays[f"cut_at_{k}"] = np.where(cut, moves[nearest], len(kinds))
    return arrays


def _left(left: Left) -> tuple[dict[str, Any], dict[str, ndarray]]:
    """The surface of the part with what stays on it."""
    facts = {"highest": left.highest.value, "area": left.area, "post_area": left.by_reason["post"], "over": LEFT}
    return facts, {"left": left.mesh.vertices, "left_faces": left.mesh.faces, "left_height": left.heights}


def _uncut(paths: Sequence[ToolPath]) -> tuple[dict[str, Any], dict[str, ndarray]]:
    """The contacts that were left out, by level, with the number of their reason."""
    points = np.vstack([path.uncut for path in paths])
    reasons = [reason for path in paths for reason in path.reasons]
    levels = np.repeat([path.level for path in paths], [len(path.uncut) for path in paths])
    names = sorted(set(reasons))
    numbers = np.array([names.index(reason) for reason in reasons], dtype=np.int64)
    on_part = Counter(reason for reason, level in zip(reasons, levels) if level == 0)
    some = np.unique(np.linspace(0, len(points) - 1, min(len(points), UNCUT_SHOWN)).astype(np.int64))
    facts = {
        "reasons": [{"name": name, "why": WHY.get(name, name), "on_part": on_part[name]} for name in names],
        "contacts": len(points),
    }
    return facts, {"uncut": points[some], "uncut_reason": numbers[some], "uncut_level": levels[some].astype(np.int64)}


def _tool(cutter: Cutter) -> dict[str, Any]:
    """A cutter: (name, start, end, radius, end radius) of cylinders and cones, mm, above its ball if it has one; its
    `length` is that from the tip to the spindle nose."""
    return {
        "number": cutter.number,
        "name": cutter.name,
        "radius": cutter.radius,
        "length": cutter.length,
        "ball": not cutter.is_bull,
        "end": cutter.end_name,
        "sections": [
            [section.name, section.start, section.end, section.radius, section.end_radius]
            for section in (*cutter.bull_end, *cutter.profile)
        ],
    }


def rewind_contents(text: str, motions: Motions, dialect: Dialect) -> dict[str, Float[ndarray, "k 3"]]:
    """`rewinds`: the tips (mm) from which the tool leaves for a rewind, in order; nothing where there is none."""
    marks = tuple(comment(mark, dialect) for mark in (LIFTED, REWIND))
    lines = [number for number, line in enumerate(text.split("\n"), 1) if line.endswith(marks)]
    before = np.searchsorted(motions.lines, lines) - 1
    return {"rewinds": motions.tips[np.maximum(before, 0)]} if lines else {}
