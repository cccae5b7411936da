"""All that a page shows, gathered by stage, and how it is packed into one block of bytes, which a page and a kept
folder hold.

Shown are levels, the mesh as given, deviation, and the bodies round the part; of a program its moves as read back from
the text, the cones of their axes, the tools, what stands after each level and what is left; the machine's rotary axes
and what they carry. A run has all of it, a finished surface and a second clamping their own shapes.

Floats become whole numbers of 16 bits over the range of their array (a range of 100 mm in steps of 1.5 um). Columns
follow one another as differences, their bytes in planes: neighbours on paths and meshes differ little, so that gzip
halves them. Bytes (of a text) stay as they are. `assets/unpack.js` reads it too.
"""

import gzip
import json
import zlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8
from numpy import ndarray
from scipy.spatial import cKDTree

import bonecam
from bonecam.arrays import dots, lengths
from bonecam.errors import file_error
from bonecam.job import Job
from bonecam.levels.measure import Level, rounding_cuts
from bonecam.machine.bodies import Table
from bonecam.machine.machine import Machine, read_machine
from bonecam.machine.machine_file import RotaryAxis
from bonecam.mesh.distance import exact_closest
from bonecam.mesh.facets import vertex_normals
from bonecam.mesh.part import Part
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.dialect import Dialect
from bonecam.nc.motions import Motions
from bonecam.nc.reading import read_program
from bonecam.nc.requirements import machine_and_dialect
from bonecam.nc.words import LIFTED, REWIND, comment
from bonecam.report.summary import WHY, finished_summary, second_text, summary_of
from bonecam.setup.stock import Stock, stock_figures, stock_text
from bonecam.tool.cutter import Cutter
from bonecam.tool.elliptic_cones import EllipticCones
from bonecam.tool.path import BLANK, PARTING, MoveKind, ToolPath
from bonecam.verify.findings import LEFT, Removal
from bonecam.verify.readback import Tolerances, compare_moves
from bonecam.verify.removal import cutters_of, followed_surfaces
from bonecam.verify.sweeping import feed_minutes, groups_of
from bonecam.workholding.clamping import holding_columns
from bonecam.workholding.post import post_below, tailstock_bodies
from bonecam.workholding.shell import SecondClamping

VERSION = 1
"""Of the format. A reader refuses others."""
FLOAT_BYTES, INTEGER_BYTES = 2, 3
"""Bytes of a packed number: integers are below 2^24."""
LEVEL = 6
"""Of gzip: 9 takes three times as long and saves 1 %."""


@dataclass(frozen=True, eq=False)
class Contents:
    """What a page shows: `facts` are values of JSON, `arrays` have one item a row, lengths in mm."""

    facts: dict[str, Any]
    arrays: dict[str, ndarray]


def pack(contents: Contents) -> bytes:
    """The contents as bytes, without empty arrays: equal contents make equal bytes."""
    index = {}
    blocks = []
    at = 0
    for name, array in contents.arrays.items():
        if not len(array):
            continue
        columns = array.reshape(len(array), -1)
        entry: dict[str, Any] = {"shape": list(array.shape)}
        if array.dtype == np.uint8:
            size, block = 1, array.tobytes()
        else:
            size, whole = INTEGER_BYTES, columns
            if array.dtype.kind == "f":
                size = FLOAT_BYTES
                low = columns.min(axis=0)
                step = float(np.ptp(columns, axis=0).max()) / (2 ** (8 * size) - 1)
                entry |= {"low": low.tolist(), "step": step}
                whole = np.rint((columns - low) / (step or 1.0))
            differences = np.diff(whole.astype(np.int64), axis=0, prepend=0) & (2 ** (8 * size) - 1)
            block = b"".join((differences >> (8 * k)).astype(np.uint8).T.tobytes() for k in range(size))
        index[name] = {**entry, "bytes": size, "at": at}
        blocks.append(block)
        at += len(block)
    head = json.dumps({"bonecam_view": VERSION, "facts": contents.facts, "arrays": index}).encode()
    return gzip.compress(b"".join([len(head).to_bytes(4, "little"), head, *blocks]), LEVEL, mtime=0)


def unpack(packed: bytes, file: str) -> Contents:
    """The contents of packed bytes; FileError, which names the `file`, where they are damaged or of another version."""
    try:
        data = gzip.decompress(packed)
        size = int.from_bytes(data[:4], "little")
        head = json.loads(data[4 : 4 + size])
        version = head["bonecam_view"]
        if version != VERSION:
            what = f"has version {version!r}, this bonecam reads {VERSION}"
            raise file_error(file, what, "make it again with --keep, or use the bonecam that made it")
        arrays = {name: _unpacked(entry, data, 4 + size) for name, entry in head["arrays"].items()}
        return Contents(dict(head["facts"]), arrays)
    except (OSError, EOFError, zlib.error, ValueError, KeyError, TypeError, AttributeError) as error:
        raise file_error(file, "is damaged", "make it again with --keep") from error


def _unpacked(entry: Mapping[str, Any], data: bytes, start: int) -> ndarray:
    """The array that an entry describes; ValueError where bytes are missing."""
    shape, size = tuple(entry["shape"]), int(entry["bytes"])
    count = int(np.prod(shape))
    flat: UInt8[ndarray, " b"] = np.frombuffer(data, np.uint8, count * size, start + int(entry["at"]))
    if size == 1:
        return flat.reshape(shape)
    planes = flat.reshape(size, -1, shape[0]).astype(np.int64)
    differences = sum(planes[k] << (8 * k) for k in range(size))
    whole = (np.cumsum(differences, axis=1) & (2 ** (8 * size) - 1)).T.reshape(shape)
    if "step" not in entry:
        return np.asarray(whole)
    low = np.array(entry["low"])
    return whole * entry["step"] + (low if len(shape) > 1 else low[0])


def rows_of_moves(
    motions: Motions, paths: Sequence[ToolPath], dialect: Dialect
) -> tuple[Int[ndarray, " n"], Bool[ndarray, " n"], Bool[ndarray, " n"]]:
    """The row of all paths that each move of a program leads to, whether it arrives there, rather than ends on the way
    to it (a row's move may be split), and whether it is away from all rows, before a first one."""
    source = compare_moves(motions, paths, dialect, Tolerances()).source
    return np.where(source >= 0, source, np.maximum(-2 - source, 0)), source >= 0, source == -1


def _of_rows(
    motions: Motions, paths: Sequence[ToolPath], rows: Int[ndarray, " n"], away: Bool[ndarray, " n"]
) -> tuple[Int[ndarray, " n"], Float[ndarray, "n 3"]]:
    """The kind of each move and the place where its ball touches the level (its tip where it does not cut), from the
    row of the paths that it leads to; moves that are away from all rows are rapids."""
    radius = np.repeat([path.cutter.radius for path in paths], [len(path.tips) for path in paths])[rows]
    tips, axes, contacts = (
        np.vstack([getattr(path, name) for path in paths])[rows] for name in ("tips", "axes", "contacts")
    )
    of_path = []
    for path in paths:
        # the move to the first contact of a pass is a link to look at
        cutting = path.kinds == MoveKind.CUT
        goes_on = np.r_[False, cutting[:-1] & (path.pass_index[1:] == path.pass_index[:-1])]
        of_path.append(np.where(cutting & ~goes_on, int(MoveKind.LINK), path.kinds))
    kinds = np.where(away, int(MoveKind.RAPID), np.concatenate(of_path).astype(np.int64)[rows])
    outward = tips + radius[:, None] * axes - contacts
    touches = motions.tips + radius[:, None] * motions.axes - outward
    at_level = (kinds != MoveKind.RAPID) & np.isfinite(touches).all(1)
    return kinds, np.where(at_level[:, None], touches, motions.tips)


MOST_FACES = 100_000
"""A mesh as given with more faces is shown as it was after repair and decimation."""


def shape_contents(part: Part, levels: Sequence[Level], stock: Stock, job: Job) -> Contents:
    """Levels with the depth of their cuts, part as given and as fitted, stock, post, what holds it, and table."""
    facts, arrays = _levels(levels, job)
    shown, which = part.placed_given, "as given"
    if len(part.given.faces) > MOST_FACES:
        shown, which = part.mesh, "as repaired: the given one has too many faces to show"
    # How far each vertex of the fitted mesh lies outside the given one, and outside that of the given one, mm
    fitted = levels[0].mesh
    away = fitted.vertices - exact_closest(shown, fitted.vertices)[0]
    closest, faces = exact_closest(fitted, shown.vertices)
    back = closest - shown.vertices
    arrays |= {
        "given": shown.vertices,
        "given_faces": shown.faces,
        "given_deviation": np.sign(dots(back, fitted.face_vectors[faces])) * lengths(back),
        "deviation": np.sign(dots(away, vertex_normals(fitted))) * lengths(away),
    }
    post = post_below(part.mesh, job.holding)
    facts |= {
        "name": Path(part.file).name,
        "file": part.file,
        "given": which,
        "stock": {**stock_figures(stock), "text": stock_text(stock_figures(stock))},
        "stock_bounds": stock.bounds.tolist(),
        "post": {"radius": post.radius, "top": post.top},
        **bodies(job, read_machine(job.nc.machine).table),
    }
    if post.pin is not None:
        facts["tailstock"] = [asdict(column) for column in (post.pin, *tailstock_bodies(job.holding))]
    return Contents(facts, arrays)


def _levels(levels: Sequence[Level], job: Job) -> tuple[dict[str, Any], dict[str, ndarray]]:
    rounding = rounding_cuts(levels)
    reported = []
    arrays: dict[str, ndarray] = {}
    faces: dict[bytes, str] = {}
    before = levels[0].mesh
    for level in levels:
        shape = level.mesh.faces.tobytes()
        if shape not in faces:
            faces[shape] = f"faces_{len(faces)}"
            arrays[faces[shape]] = level.mesh.faces
        arrays[f"level_{level.index}"] = level.mesh.vertices
        arrays[f"depth_{level.index}"] = lengths(level.mesh.vertices - exact_closest(before, level.mesh.vertices)[0])
        before = level.mesh
        name = "finishing" if job.is_finishing(level.index) else "roughing"
        if level.index == 0:
            name = "the part"
        elif level.index == len(levels) - 1:
            name = "the stock"
        elif level.index in rounding:
            name = "rounds the stock"
        reported.append(
            {
                "index": level.index,
                "name": name,
                "faces": faces[shape],
                "limit": level.limit,
                "deepest": level.deepest,
                "mean": level.depth_mean,
                "certified": level.certified,
            }
        )
    return {"levels": reported}, arrays


def bodies(job: Job, table: Table) -> dict[str, Any]:
    """Sizes of riser, chuck, stub (None or absent where the job has none) and table, mm: the table's None where it has
    no edge, with what stands on it as (length, radius, upper radius)."""
    held = {
        name: {"radius": column.radius, "top": column.top, "bottom": column.bottom}
        for name, column in holding_columns(job.holding).items()
    }
    sizes = {"radius": table.radius, "half_width": table.half_width, "half_depth": table.half_depth}
    shown: dict[str, Any] = {name: float(size) if np.isfinite(size) else None for name, size in sizes.items()}
    shown["standing"] = [[piece.length, piece.diameter / 2, piece.top_diameter / 2] for piece in table.standing]
    return {"chuck": None, **held, "table": shown}


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


def _cones(paths: Sequence[ToolPath], rows: Int[ndarray, " n"], arrives: Bool[ndarray, " n"]) -> dict[str, ndarray]:
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
    numbers = {None: NO_LEVEL, PARTING: PARTED, BLANK: NO_LEVEL}
    level_of = np.concatenate(
        [
            np.full(len(group.moves), numbers.get(group.level, group.level))
            for group in groups_of(text, motions, dialect)
        ]
    )

    if paths:
        rows, arrives, away = rows_of_moves(motions, paths, dialect)
        kinds, contacts = _of_rows(motions, paths, rows, away)
    else:
        feeds = np.where(motions.links, int(MoveKind.LINK), int(MoveKind.CUT))
        kinds, contacts = np.where(motions.rapid, int(MoveKind.RAPID), feeds), motions.tips
    moves = _moves(motions, kinds, contacts, level_of)
    if removal is not None:
        moves |= _removed(motions, removal, level_of, contacts, surfaces)
    kept = _shown(motions, kinds, level_of)
    arrays = {f"move_{name}": values[kept] for name, values in moves.items()}
    arrays |= rotary_angles(machine, motions.words[kept])
    arrays |= rewind_contents(text, motions, dialect)
    arrays["text"] = np.frombuffer(text.encode("latin-1", "replace"), np.uint8)
    reported = {
        "machine": machine.name,
        "controller": dialect.name,
        "blocks": motions.blocks,
        "time": f"about {moves['minute'][-1]:.1f} min at the feed",
        "chord": CHORD if len(kept) < len(kinds) else 0.0,
        "layers": _layers(level_of, surfaces, meshes),
        **machine_facts(machine),
    }
    facts: dict[str, Any] = {"tools": [_tool(cutter) for cutter in cutters_of(job, machine)], "program": reported}
    if paths:
        facts["uncut"], uncut = _uncut(paths)
        arrays |= {**uncut, **_cones(paths, rows[kept], arrives[kept])}
    if removal is not None:
        arrays |= _standing(removal, surfaces, contacts[kept], kinds[kept], level_of[kept])
    if removal is not None and removal.left is not None:
        # The surface of the part with what stays on it
        left = removal.left
        post_area = left.by_reason["post"]
        facts["left"] = {"highest": left.highest.value, "area": left.area, "post_area": post_area, "over": LEFT}
        arrays |= {"left": left.mesh.vertices, "left_faces": left.mesh.faces, "left_height": left.heights}
        if removal.mechanics is not None and removal.mechanics.error is not None:
            facts["left"]["bent"] = removal.mechanics.error.p99
            arrays["left_bent"] = removal.mechanics.error.sizes
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
    return {
        "tip": motions.tips,
        "axis": motions.axes,
        "contact": contacts,
        "kind": kinds,
        "level": levels,
        "tool": motions.tools,
        "line": motions.lines,
        "feed": np.where(motions.rapid, 0.0, motions.tip_feeds),
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
    length = motions.lengths
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
    """A cutter: (name, start, end, radius, end radius) of cylinders and cones, mm, above its ball; its
    `length` is that from the tip to the spindle nose."""
    return {
        "number": cutter.number,
        "name": cutter.name,
        "radius": cutter.radius,
        "length": cutter.length,
        "end": "ball",
        "sections": [
            [section.name, section.start, section.end, section.radius, section.end_radius] for section in cutter.profile
        ],
    }


def rewind_contents(text: str, motions: Motions, dialect: Dialect) -> dict[str, Float[ndarray, "k 3"]]:
    """`rewinds`: the tips (mm) from which the tool leaves for a rewind, in order; nothing where there is none."""
    marks = tuple(comment(mark, dialect) for mark in (LIFTED, REWIND))
    lines = [number for number, line in enumerate(text.split("\n"), 1) if line.endswith(marks)]
    before = np.searchsorted(motions.lines, lines) - 1
    return {"rewinds": motions.tips[np.maximum(before, 0)]} if lines else {}


def contents_with_program(
    shape: Contents,
    program: str,
    meshes: Mapping[int, TriangleMesh],
    job: Job,
    report: Mapping[str, Any],
    summary: str,
    **posted: Any,
) -> Contents:
    """All that a page shows: a `shape`, the report, and the moves of the `program`, of which `posted` tells as in
    `program_contents`; "" where there is none."""
    facts = {**shape.facts, "report": report, "summary": summary, "version": bonecam.__version__}
    if not program:
        return Contents(facts, shape.arrays)
    machine, dialect = machine_and_dialect(job.nc)
    moves = program_contents(program, meshes, job, machine, dialect, **posted)
    moves.facts["program"]["time"] = report.get("nc", report)["time_texts"][0]
    return Contents({**facts, **moves.facts}, {**shape.arrays, **moves.arrays})


def surface_contents(
    surface: TriangleMesh,
    solid: TriangleMesh,
    path: ToolPath,
    program: str,
    job: Job,
    report: dict[str, Any],
    removal: Removal | None,
) -> Contents:
    """The surface, the solid that is kept free of gouges, and the program's moves, with what they remove if that was
    simulated."""
    figures = report["surface"]
    facts = {
        "levels": [{"index": 0, "name": "the surface", "faces": "faces_0", "limit": 0.0}],
        "name": figures["file"] or "a surface",
        "stock": {"text": f"surface {figures['kind']}, {figures['area_mm2']:.0f} mm\u00b2"},
        "stock_bounds": surface.bounds.tolist(),
        **held(solid, job),
    }
    shape = Contents(facts, _level_in_solid(surface, solid))
    posted = {"paths": [path], "removal": removal, "surfaces": {0: surface}}
    return contents_with_program(
        shape, program, {0: surface, 1: solid}, job, report, finished_summary(report), **posted
    )


def held(solid: TriangleMesh, job: Job) -> dict[str, Any]:
    """The post below a solid, and what holds it, mm."""
    post = {"radius": job.holding.diameter / 2, "top": float(solid.bounds[0, 2])}
    return {"post": post, **bodies(job, read_machine(job.nc.machine).table)}


def _level_in_solid(level: TriangleMesh, solid: TriangleMesh) -> dict[str, ndarray]:
    return {"level_0": level.vertices, "faces_0": level.faces, "solid": solid.vertices, "solid_faces": solid.faces}


def second_contents(
    clamping: SecondClamping,
    program: str,
    paths: Sequence[ToolPath],
    removal: Removal,
    job: Job,
    report: Mapping[str, Any],
    name: str,
) -> Contents:
    """The finished part turned over, its shell, and the moves of the program; the job's [holding] is the shell's.
    `turned` of the facts tells the height of the first program's zero, and where the post was cut off there, mm."""
    low, high = clamping.solids.bounds
    facts = {
        "levels": [{"index": 0, "name": "the finished part", "faces": "faces_0", "limit": 0.0}],
        "stock": {"text": f"turned over in its shell, stump up to Z {clamping.top:.2f} mm"},
        "stock_bounds": [low.tolist(), np.maximum(high, [-np.inf, -np.inf, clamping.top]).tolist()],
        "post": None,
        "solid": "shell",
        "turned": {"zero_mm": float(clamping.pose[2, 3]), "cut_off_mm": clamping.cut_off},
        "name": f"{name}, second clamping",
        **bodies(job, read_machine(job.nc.machine).table),
    }
    shape = Contents(facts, _level_in_solid(clamping.part, clamping.shell))
    posted = {"paths": paths, "removal": removal, "surfaces": layers_on(clamping.part, removal)}
    return contents_with_program(shape, program, {0: clamping.part}, job, report, second_text(report), **posted)


def layers_on(part: TriangleMesh, removal: Removal) -> dict[int, TriangleMesh]:
    """The part for every layer of a program that was simulated: all of them lie on it."""
    return {level.index: part for level in removal.levels if level.index is not None}


PROGRAM_FACTS = ("tools", "program", "uncut", "left")
PROGRAM_ARRAYS = ("move_", "before_", "after_", "cut_at_", "uncut", "left", "text")
"""Names of facts, and beginnings of names of arrays, that belong to a program."""


def run_contents(
    part: Part,
    levels: Sequence[Level],
    stock: Stock,
    job: Job,
    report: Mapping[str, Any],
    *,
    program: str = "",
    paths: Sequence[ToolPath] = (),
    removal: Removal | None = None,
) -> Contents:
    """Levels and fit, and where there is a `program` its moves, what it removes and what it leaves."""
    shape = shape_contents(part, levels, stock, job)
    meshes = {level.index: level.mesh for level in levels}
    return contents_with_program(shape, program, meshes, job, report, summary_of(report), paths=paths, removal=removal)


def level_meshes(contents: Contents) -> dict[int, TriangleMesh]:
    """The meshes of the levels that a page shows, by number."""
    arrays = contents.arrays
    return {
        level["index"]: TriangleMesh(arrays[f"level_{level['index']}"], arrays[level["faces"]].astype(np.int32))
        for level in contents.facts["levels"]
    }


def with_program(run: Contents, posted: Contents, report: dict[str, Any], summary: str) -> Contents:
    """A page of the levels of a `run` with another program; `report` has the sections that are told of it."""
    facts = {name: fact for name, fact in run.facts.items() if name not in PROGRAM_FACTS}
    arrays = {name: array for name, array in run.arrays.items() if not name.startswith(PROGRAM_ARRAYS)}
    sections = {name: section for name, section in facts["report"].items() if name not in ("nc", "toolpath")}
    reported = {"report": {**sections, **report}, "summary": summary}
    return Contents({**facts, **reported, **posted.facts}, {**arrays, **posted.arrays})
