"""General T-splines in .tsm files, as Rhino and Fusion write them.

The text of a .tsm file (`#TS0200`) is records, read and checked one by one.

    f LINK FLAG                         a face and one of its links
    e LINK INTERVAL                     an edge and its knot interval
    v LINK NORTH|WEST|SOUTH|EAST        a vertex, a link that starts there, and its direction
    l PREVIOUS NEXT OPPOSITE VERTEX FACE EDGE FLAG
                                        a half edge; face -1: outside; flag: 0 turns left at its start,
                                        1 goes straight on, 2 turns right
    ec EDGE 0                           a border edge with a Bezier end condition
    0m gvp VERTEX                       the next control point is the vertex' own one
    0m gv VERTEX                        ... is another one of the vertex (-1: not in use)
    0m cg VERTEX 4 D0 D1 D2 D3 GRIPS... the control points of a border vertex, as told below
    0g X Y Z W                          a control point

The n-th record of a kind has the number n - 1; a bare `f`, `e`, `v`, `l` or `0g` is a deleted one that keeps
its number. What follows a # is a comment; records of other kinds (100..., 105..., 50000..., tol, ver) carry
nothing for the surface.

Open borders of .tsm files that name `end-conditions SUBD_CREASES` (Fusion writes them): the borders of a
subdivision surface with creases.

Such a border is not clamped: knots and control points are mirrored beyond it, P_{-1} = 2 P_0 - P_1, so that
the border is the cubic B-spline of the control points on it, the corners are met and the second derivative
across the border vanishes (Catmull & Clark 1978 with the crease rules of Hoppe et al. 1994, on any knots).
The mirrored points are vertices outside the domain. Only rectangular T-meshes are treated, and the two lines
next to a border must run along all of it.

A general T-mesh as half edges: its vertices, the two links of every edge, and the loops they make.

Where the vertices of a .tsm file lie: its half edges laid out in one chart.

Link flags give every link its direction (a turn to the left at each corner of a face), edges their knot
intervals: walking them lays the T-mesh out in one chart. A walk that comes home one period further on closes
that direction; any other contradiction is an extraordinary point or a broken interval, and an error that
names the record.

The T-mesh of a .tsm file on its index grid, and which control point belongs to which vertex.

A border vertex has further control points beside its own one, which lies outermost. `cg` says to which sides
(D0..D3 = 1: to its north, west, south and east in its own frame) and lists them counter-clockwise from the
north, corners between two such sides included (-1: not there). In index space each of these is a line of its
own with the same knot: the clamped border. A corner of the domain that turns inwards has them on all four
sides.

In a file that is written control points with the same knots that touch are one vertex; the outermost is its own, the
others become its `cg` record. Walking the edges, always turning left, gives the loops: faces, and the outside. Comments
keep what half edges lose: all digits of the knots.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from bonecam_plugins.tsplines.tmesh import TMesh
from jaxtyping import Float, Int64
from numpy import ndarray

from bonecam.errors import FileError, SurfaceError, file_error
from bonecam.files import write_whole
from bonecam.mesh import bytes_of
from bonecam.plugins import Reader
from bonecam.surface import RowTMesh, TSpline
from bonecam.text.numbers import number, number_words, whole_number

DIRECTIONS = ("EAST", "NORTH", "WEST", "SOUTH")
TSM_HEADER = "#TS0200"
COMMENTS = ("#s-knots ", "#t-knots ", "#s-period ", "#t-period ")
"""Comments that `write_tsm` adds: knots and periods with all digits, which sums of intervals
lose."""

LARGEST = 1e18
"""No number is as large: record numbers fit 64 bits, and nothing overflows."""

MILLIMETRES = {"millimeters": 1.0, "centimeters": 10.0, "meters": 1000.0, "inches": 25.4, "feet": 304.8}

HEADER_WORDS = ("degree", "units", "end-conditions")


@dataclass(eq=False)
class Records:
    """The file's records; None is a deleted one. `lines` says where record n of a kind stands."""

    path: Path
    faces: list[tuple[int, int] | None] = field(default_factory=list)
    edges: list[Any] = field(default_factory=list)
    vertices: list[tuple[int, int] | None] = field(default_factory=list)
    links: list[Any] = field(default_factory=list)
    grips: list[tuple[float, float, float, float] | None] = field(default_factory=list)
    owners: list[tuple[bool, int]] = field(default_factory=list)
    corners: dict[int, list[int]] = field(default_factory=dict)
    header: dict[str, list[str]] = field(default_factory=dict)
    knots: dict[str, list[float]] = field(default_factory=dict)
    lines: dict[tuple[str, int], int] = field(default_factory=dict)

    def error(self, kind: str, number: int, message: str) -> FileError:
        """The FileError that names the line of one record and what is wrong with it."""
        line = self.lines.get((kind, number))
        place = f"{self.path} line {line}" if line else str(self.path)
        return FileError(
            f"{place}: {kind} {number}: {message}", file=str(self.path), line=line, record=f"{kind} {number}"
        )


def parse_tsm(text: str, path: Path) -> Records:
    """The records of the file's text. Raises FileError with the line of a record that cannot be read."""
    records = Records(path)
    for n, line in enumerate(text.splitlines(), 1):
        if line.startswith(COMMENTS):
            words = line[1:].split()
            records.knots[words[0]] = _numbers(path, n, words[1:], number, None)
            continue
        words = line.split("#", 1)[0].split()
        if words:
            _add_record(records, n, words[0], words[1:])
    # FileError where a record names one that does not exist, or where links contradict one another.
    if records.header.get("degree", ["3"]) != ["3"]:
        degree = " ".join(records.header["degree"])
        raise FileError(f"{records.path}: degree '{degree}': only cubic T-splines are read", file=str(records.path))
    if not any(link is not None for link in records.links):
        raise FileError(f"{records.path}: the file has no links (l records)", file=str(records.path))
    tables: dict[str, list] = {
        "link": records.links,
        "vertex": records.vertices,
        "face": records.faces,
        "edge": records.edges,
    }
    kinds = ("link", "link", "link", "vertex", "face", "edge")
    for n, link in enumerate(records.links):
        if link is None:
            continue
        for kind, named in zip(kinds, link):
            if not (kind == "face" and named == -1) and not _exists(tables[kind], named):
                raise records.error("l", n, f"{kind} {named} does not exist")
        if link[6] not in (0, 1, 2):
            raise records.error("l", n, f"flag {link[6]} must be 0, 1 or 2")
    for n, link in enumerate(records.links):
        if link is not None:
            # FileError where link n and the links before, after and opposite to it do not name one another
            previous, following, opposite = (records.links[k] for k in link[:3])
            if previous[1] != n or following[0] != n:
                raise records.error("l", n, f"previous link {link[0]} and next link {link[1]} do not point back to it")
            if opposite[2] != n or link[2] == n or opposite[5] != link[5]:
                raise records.error("l", n, f"opposite link {link[2]} does not point back to it along edge {link[5]}")
            if opposite[3] != following[3]:
                raise records.error(
                    "l",
                    n,
                    f"it ends at vertex {following[3]}, its opposite link {link[2]} starts at vertex {opposite[3]}",
                )
            if following[4] != link[4]:
                raise records.error(
                    "l", n, f"it belongs to face {link[4]}, its next link {link[1]} to face {following[4]}"
                )
    for short, entities in (("f", records.faces), ("e", records.edges), ("v", records.vertices)):
        for n, entity in enumerate(entities):
            if entity is not None and not _exists(records.links, entity[0]):
                raise records.error(short, n, f"link {entity[0]} does not exist")
    return records


def _add_record(records: Records, n: int, kind: str, words: list[str]) -> None:
    """Add the record in line n to its table."""
    path = records.path
    if kind in HEADER_WORDS:
        records.header[kind] = words
    elif kind in ("f", "e", "v", "l"):
        tables: dict[str, list] = {"f": records.faces, "e": records.edges, "v": records.vertices, "l": records.links}
        target = tables[kind]
        records.lines[kind, len(target)] = n
        target.append(_entity(path, n, kind, words) if words else None)
    elif kind == "ec":
        _numbers(path, n, words, whole_number, 2)
    elif kind == "0g":
        records.lines["0g", len(records.grips)] = n
        records.grips.append(tuple(_numbers(path, n, words, number, 4)) if words else None)  # type: ignore[arg-type]
    elif kind == "0m" and words[:1] in (["gv"], ["gvp"]):
        records.lines["0m", len(records.owners)] = n
        records.owners.append((words[0] == "gvp", _numbers(path, n, words[1:], whole_number, 1)[0]))
    elif kind == "0m" and words[:1] == ["cg"]:
        numbers = _numbers(path, n, words[1:], whole_number, None)
        if len(numbers) < 6:
            raise _line_error(path, n, "'cg' needs a vertex, a valence, extents and grips")
        records.lines["cg", numbers[0]] = n
        records.corners[numbers[0]] = numbers[1:]


def _entity(path: Path, n: int, kind: str, words: list[str]) -> tuple:
    """The numbers of a record f, e, v or l in line n; FileError where they are not as they should be."""
    if kind == "e":
        link = _numbers(path, n, words[:1], whole_number, 1)[0]
        interval = _numbers(path, n, words[1:], number, 1)[0]
        if interval < 0:
            raise _line_error(path, n, f"knot interval {interval} is negative: knots must not decrease")
        return link, interval
    if kind == "v":
        if len(words) != 2 or words[1] not in DIRECTIONS:
            raise _line_error(path, n, f"a vertex needs a link and one of {', '.join(DIRECTIONS)}")
        return _numbers(path, n, words[:1], whole_number, 1)[0], DIRECTIONS.index(words[1])
    return tuple(_numbers(path, n, words, whole_number, 2 if kind == "f" else 7))


def _line_error(path: Path, n: int, what: object) -> FileError:
    return FileError(f"{path} line {n}: {what}", file=str(path), line=n)


def _numbers(path: Path, n: int, words: list[str], kind: Callable[[str], float], count: int | None) -> list:
    """The words of line n as `count` numbers (None: any number of them); FileError where they are not."""
    try:
        values = [kind(word) for word in words]
    except ValueError as error:
        raise _line_error(path, n, error) from error
    if count is not None and len(values) != count:
        raise _line_error(path, n, f"expected {count} finite numbers, found {len(values)}")
    if not all(abs(value) < LARGEST for value in values):
        raise _line_error(path, n, f"expected finite numbers of a size below {LARGEST:g}")
    return values


def _exists(table: list, number: int) -> bool:
    """Whether the table has a record of that number which is not deleted."""
    return 0 <= number < len(table) and table[number] is not None


MIRRORED = "SUBD_CREASES"


def with_mirrored_borders(tmesh: TMesh, points: Float[ndarray, "n 4"]) -> tuple[TMesh, Float[ndarray, "m 4"]]:
    """The T-mesh and the homogeneous control points with one more, mirrored, beside every one on an open
    border; the given ones come first.

    Raises SurfaceError where the T-mesh is no rectangle, a line ends beside a border, or a mirrored weight is
    not positive.
    """
    if not tmesh.inside.all():
        raise SurfaceError("its open border is no rectangle: give clamped borders ('0m cg' records)")
    for axis in (0, 1):
        if not tmesh.period[axis]:
            # The T-mesh and its homogeneous control points (m, 4) with mirrored ones beyond both borders across s
            mesh = _with_axis_first(tmesh, axis)
            crossings = mesh.crossings
            last = len(mesh.s_lines) - 1
            new = []
            rows = []
            for border, step in ((0, 1), (last, -1)):
                near = [border, border + step, border + 2 * step][: last + 1]
                outer = crossings[border]
                inner = crossings[border + step]
                if not mesh.along_t[near].all() or ((outer >= 0) != (inner >= 0)).any():
                    what = f"a line ends beside its open border at s- or t-line {border}"
                    raise SurfaceError(f"{what}: let two lines run along all of it")
                rows.append(np.flatnonzero(outer >= 0))
                new.append(2 * points[outer[rows[-1]]] - points[inner[rows[-1]]])
            added = [np.column_stack([np.full(len(row), line), row]) for row, line in zip(rows, (1, last + 3))]
            vertices = np.vstack([mesh.vertices + np.array([2, 0]), *added])
            steps = np.diff(mesh.s_lines)
            low = steps[:2]
            high = steps[::-1][:2]
            before = mesh.s_lines[0] - np.cumsum(np.resize(low, 2))
            behind = mesh.s_lines[-1] + np.cumsum(np.resize(high, 2))
            lines = np.concatenate([before[::-1], mesh.s_lines, behind])
            along_s, along_t = (np.pad(edges, ((2, 2), (0, 0)), mode="edge") for edges in (mesh.along_s, mesh.along_t))
            inside = np.pad(mesh.inside, ((2, 2), (0, 0)))
            tmesh, points = (
                TMesh(
                    lines,
                    mesh.t_lines,
                    vertices=vertices,
                    along_s=along_s,
                    along_t=along_t,
                    inside=inside,
                    period=mesh.period,
                ),
                np.vstack([points, *new]),
            )
            tmesh = _with_axis_first(tmesh, axis)
    wrong = np.flatnonzero(~(points[:, 3] > 0))
    if len(wrong):
        raise SurfaceError(
            f"the weights at its open border fall to {points[wrong[0], 3]:.6g} beyond it: make them more even"
        )
    return tmesh, points


def _with_axis_first(mesh: TMesh, axis: int) -> TMesh:
    """The T-mesh with s and t exchanged where `axis` is 1, so that `axis` comes first."""
    if axis == 0:
        return mesh
    return TMesh(
        s_lines=mesh.t_lines,
        t_lines=mesh.s_lines,
        vertices=mesh.vertices[:, ::-1],
        along_s=mesh.along_t.T,
        along_t=mesh.along_s.T,
        inside=mesh.inside.T,
        period=mesh.period[::-1],
    )


def _vertices(mesh: TMesh) -> tuple[list[int], Int64[ndarray, " n"], Int64[ndarray, "n 2"], Int64[ndarray, "v 4"]]:
    """The vertices, each of which joins the control points with its knots: control points that are joined by edges of
    no length are one.

    The control point that stands for each vertex; the vertex of each control point, and its place (lines in s and t)
    from the vertex' own one; the next vertex to the east, north, west and south (-1: none). SurfaceError where more
    than three lines with one knot meet.
    """
    label = np.arange(mesh.size)
    steps = [_neighbours(mesh, direction) for direction in range(4)]
    s, t = mesh.s_lines[mesh.vertices[:, 0]], mesh.t_lines[mesh.vertices[:, 1]]
    joined = [np.where((n >= 0) & (s == s[n]) & (t == t[n]), n, -1) for n in steps]
    for _ in range(8):
        for other in joined:
            label = np.where(other >= 0, np.minimum(label, label[other]), label)
    kinds, vertex_of = np.unique(label, return_inverse=True)
    own = []
    offsets = np.zeros((mesh.size, 2), dtype=np.int64)
    for v in range(len(kinds)):
        members = np.flatnonzero(vertex_of == v)
        # The control point of a vertex that lies outermost; the middle one where three lines meet.
        place = mesh.vertices[members]
        wanted = []
        for axis in (0, 1):
            lines = np.unique(place[:, axis])
            if len(lines) < 3:
                low, high = (members[place[:, axis] == line] for line in (lines[0], lines[-1]))
                wanted.append(
                    lines[0] if _at_border(low, mesh, axis, -1) and not _at_border(high, mesh, axis, 1) else lines[-1]
                )
            else:
                wanted.append(lines[1])
        outermost = members[(place == wanted).all(axis=1)]
        if not len(outermost):
            raise SurfaceError(f"control point {members[0]} belongs to a corner that .tsm files have no form for")
        own.append(int(outermost[0]))
        offsets[members] = mesh.vertices[members] - mesh.vertices[own[-1]]
    if (np.abs(offsets) > 1).any():
        raise SurfaceError("more than three lines with one knot meet at a vertex: a .tsm file cannot hold it")
    neighbours = np.full((len(kinds), 4), -1)
    for direction, other in enumerate(steps):
        for v, node in enumerate(own):
            while other[node] >= 0 and vertex_of[other[node]] == v:
                node = int(other[node])
            neighbours[v, direction] = vertex_of[other[node]] if other[node] >= 0 else -1
    return own, vertex_of, offsets, neighbours


def _neighbours(mesh: TMesh, direction: int) -> ndarray:
    """The next control point of each along the edges in a direction (0 east, 1 north, 2 west, 3 south), -1
    where no edge starts."""
    grid = mesh.crossings
    i, j = mesh.vertices.T
    axis = direction % 2
    sign = 1 if direction < 2 else -1
    edges = (mesh.along_s, mesh.along_t)[axis]
    count = grid.shape[axis]
    closed = bool(mesh.period[axis])
    place = [i.copy(), j.copy()]
    neighbours = np.full(mesh.size, -1)
    walking = np.ones(mesh.size, dtype=bool)
    for _ in range(count):
        piece = place[axis] if sign > 0 else place[axis] - 1
        possible = walking & (closed | ((piece >= 0) & (piece < edges.shape[axis])))
        at = [place[0], place[1]]
        at[axis] = np.where(possible, piece, 0) % edges.shape[axis]
        walking = possible & edges[at[0], at[1]]
        place[axis] = np.where(walking, (place[axis] + sign) % count if closed else place[axis] + sign, place[axis])
        here = grid[place[0], place[1]]
        neighbours = np.where(walking & (here >= 0), here, neighbours)
        walking &= here < 0
    return neighbours


def _at_border(nodes: ndarray, mesh: TMesh, axis: int, sign: int) -> bool:
    """Whether the domain ends beside these control points, on the side `sign` along `axis`."""
    place = mesh.vertices[nodes]
    shape = mesh.inside.shape
    cells = []
    for across in (0, -1):
        cell = place.copy()
        cell[:, axis] += 0 if sign > 0 else -1
        cell[:, 1 - axis] += across
        for d in (0, 1):
            if mesh.period[d]:
                cell[:, d] %= shape[d]
        valid = ((cell >= 0) & (cell < shape)).all(axis=1)
        cells.append(valid & mesh.inside[tuple(np.where(valid[:, None], cell, 0).T)])
    return not np.logical_or(*cells).all()


STEPS = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])
"""Steps in s and t of the directions 0 east, 1 north, 2 west, 3 south."""

SLACK = 1e-9
"""Share of the widest knot range: knots nearer to each other are one."""


def _places(records: Records, directions: list[int]) -> tuple[ndarray, tuple[float, float]]:
    """Positions (s, t) of the vertices, summed from knot intervals, and the periods in s and t (0: open). In
    an open direction the least position is 0, in a closed one that of the first vertex."""
    out: dict[int, list[tuple[int, int, ndarray]]] = {}
    for n, link in enumerate(records.links):
        if link is not None:
            edge, following = records.edges[link[5]], records.links[link[1]]
            out.setdefault(link[3], []).append((n, following[3], STEPS[directions[n]] * edge[1]))
    positions = np.zeros((len(records.vertices), 2))
    start = min(out)
    seen = {start}
    queue = deque([start])
    misses = []
    while queue:
        v = queue.popleft()
        for n, w, step in out[v]:
            if w not in seen:
                seen.add(w)
                positions[w] = positions[v] + step
                queue.append(w)
            else:
                misses.append((n, positions[v] + step - positions[w]))
    used = sorted(out)
    positions[used] -= positions[used].min(axis=0)
    slack = SLACK * float(np.ptp(positions[used]))

    total = np.zeros((len(records.faces), 2))  # of the knot intervals round each face
    for n, _, step in (link for links in out.values() for link in links):
        face = records.links[n][4]
        if face >= 0:
            total[face] += step
    wrong = np.flatnonzero(np.abs(total).max(axis=1) > slack)
    if len(wrong):
        s, t = total[wrong[0]]
        what = f"the knot intervals round it do not add up: they miss by {s:.6g} in s and {t:.6g} in t"
        raise records.error("f", int(wrong[0]), what)

    # The periods in s and t: by how much walks round the surface miss their start. FileError where two walks miss it
    # by different lengths, or in s and t at once.
    periods = [0.0, 0.0]
    for n, miss in misses:
        for axis in (0, 1):
            length = abs(float(miss[axis]))
            if length <= slack:
                continue
            if abs(miss[1 - axis]) > slack or (periods[axis] and abs(length - periods[axis]) > slack):
                raise records.error(
                    "l",
                    n,
                    f"knot intervals do not add up round a loop: they miss by {miss[0]:.6g} in s and "
                    f"{miss[1]:.6g} in t",
                )
            periods[axis] = periods[axis] or length
    for axis in (0, 1):
        if periods[axis]:
            positions[used, axis] -= positions[start, axis]
    return positions, (periods[0], periods[1])


def _lines(values: ndarray, slack: float, period: float) -> tuple[ndarray, ndarray]:
    """The knots of the lines in ascending order, and the number of the line that each value lies on. A line
    has the value of its first vertex; values nearer than `slack` are one."""
    values = np.mod(values + slack, period) - slack if period else values
    order = np.argsort(values, kind="stable")
    new = np.concatenate([[True], np.diff(values[order]) > slack])
    number = np.empty(len(values), dtype=np.int64)
    number[order] = np.cumsum(new) - 1
    first = np.full(int(number.max()) + 1, len(values))
    np.minimum.at(first, number, np.arange(len(values)))
    return np.maximum(values[first], 0.0), number


def tmesh_of(records: Records) -> tuple[TMesh, list[int]]:
    """The T-mesh and, for each of its vertices, the number of its control point in the file."""
    # The direction of every link: 0 east, 1 north, 2 west, 3 south. The link that the first face names runs east; the
    # directions that `v` records state need not agree with it
    directions = [-1] * len(records.links)
    start = next((face[0] for face in records.faces if face is not None), -1)
    if start < 0:
        raise records.error("f", 0, "the file has no face")
    directions[start] = 0
    queue = deque([start])
    while queue:
        n = queue.popleft()
        link = records.links[n]
        following = records.links[link[1]]
        for other, direction in ((link[2], directions[n] + 2), (link[1], directions[n] + 1 - following[6])):
            if directions[other] < 0:
                directions[other] = direction % 4
                queue.append(other)
            elif directions[other] != direction % 4:
                message = (
                    f"its direction contradicts link {n} (a wrong flag, or an extraordinary point, "
                    "which only .iga files can hold)"
                )
                raise records.error("l", other, message)
    for n, link in enumerate(records.links):
        if link is not None and directions[n] < 0:
            raise records.error("l", n, "it is not connected to the first face")
    positions, period = _places(records, directions)
    used = np.flatnonzero([vertex is not None for vertex in records.vertices])
    lines = np.zeros((len(positions), 2), dtype=np.int64)
    knots = []
    for axis in (0, 1):
        values, number = _lines(positions[used, axis], SLACK * np.ptp(positions[used]), period[axis])
        lines[used, axis] = number
        # The knots with all digits, from the file's comment #s-knots or #t-knots; `knots`, summed from intervals,
        # where it has none. FileError where the two differ.
        letter = "st"[axis]
        stated = np.array(records.knots.get(f"{letter}-knots", values))
        if len(stated) != len(values) or (np.abs(stated - stated[0] - values) > 1e-6 * np.ptp(values)).any():
            raise records.error(f"#{letter}-knots", 0, "its knots are not those that the edges' intervals add up to")
        knots.append(stated)
    s_period, t_period = (records.knots.get(f"{letter}-period", [length])[0] for letter, length in zip("st", period))
    nodes, grips = _nodes(records, directions)
    return _index_grid(records, nodes, directions, lines=lines, line_knots=knots, period=(s_period, t_period)), grips


def _nodes(records: Records, directions: list[int]) -> tuple[ndarray, list[int]]:
    """The control points in use, in the order of the file: the vertex of each and its offset (di, dj) in
    lines from the vertex' own control point, (n, 3); and their numbers in the file."""
    if not records.owners:
        # The control points of a file without `0m` records (Fusion): one a vertex, in order
        used = [v for v, vertex in enumerate(records.vertices) if vertex is not None]
        if len(used) != len(records.grips):
            raise records.error("0g", len(records.grips), f"{len(used)} vertices need as many control points")
        return np.array([(v, 0, 0) for v in used]), list(range(len(used)))
    nodes = []
    grips = []
    own = {vertex: grip for grip, (primary, vertex) in enumerate(records.owners) if primary}
    for v, vertex in enumerate(records.vertices):
        if vertex is None:
            continue
        if v not in own:
            raise records.error("v", v, "it has no control point: a '0m gvp' record is missing")
        nodes.append((v, 0, 0))
        grips.append(own[v])
        turn = directions[vertex[0]] - vertex[1]
        for grip, offset in _further_points(records, v):
            if grip >= 0:
                for _ in range(turn % 4):
                    offset = (-offset[1], offset[0])
                nodes.append((v, *offset))
                grips.append(grip)
    if len(set(grips)) < len(grips) or max(grips) >= len(records.grips):
        grip = max(grips) if max(grips) >= len(records.grips) else next(g for g in grips if grips.count(g) > 1)
        raise records.error("0g", grip, "it is missing, or belongs to two places of the T-mesh")
    order = np.argsort(grips)
    return np.array(nodes)[order], [grips[k] for k in order]


def _further_points(records: Records, v: int) -> list[tuple[int, tuple[int, int]]]:
    """The control points of a vertex beside its own one: number (-1: not there) and offset (di, dj) in the
    vertex' own frame."""
    if v not in records.corners:
        return []
    valence = records.corners[v][0]
    extents = records.corners[v][1:5]
    grips = records.corners[v][5:]
    offsets = _offsets(extents)
    if valence != 4 or not set(extents) <= {0, 1} or len(grips) != len(offsets):
        raise records.error("cg", v, f"extents {extents} need valence 4 and {len(offsets)} control points")
    for grip in grips:
        if grip != -1 and (not 0 <= grip < len(records.owners) or records.owners[grip] != (False, v)):
            raise records.error("cg", v, f"control point {grip} is not one of vertex {v} ('0m gv {v}')")
    return list(zip(grips, offsets))


def _index_grid(
    records: Records,
    nodes: ndarray,
    directions: list[int],
    lines: Int64[ndarray, "n 2"],
    line_knots: list[ndarray],
    period: tuple[float, float],
) -> TMesh:
    """The T-mesh on its index grid, which has one line for every knot and offset in use. `lines` are the numbers in s
    and t of those that the vertices lie on."""
    knots = []
    vertices = []
    principal = []
    for axis in (0, 1):
        keys = np.column_stack([lines[nodes[:, 0], axis], nodes[:, 1 + axis]])
        distinct, number = np.unique(keys, axis=0, return_inverse=True)
        knots.append(line_knots[axis][distinct[:, 0]])
        vertices.append(number.ravel())
        principal.append(np.flatnonzero(distinct[:, 1] == 0))
    own = np.column_stack([principal[axis][lines[:, axis]] for axis in (0, 1)])
    index = np.column_stack(vertices)
    cells = [len(k) - (not length) for k, length in zip(knots, period)]
    edges = []
    for axis in (0, 1):
        empty = np.zeros((cells[axis], len(knots[1 - axis])), dtype=bool)
        edges.append(_edges(empty, records, directions, nodes=nodes, index=index, axis=axis))
    inside = np.zeros(cells, dtype=bool)
    for k, face in enumerate(records.faces):
        if face is not None:
            # Mark the cells of face k; its sides are the lines of its corners' own control points
            start = face[0]
            corners = []
            n = start
            for _ in range(len(records.links)):
                link = records.links[n]
                if link[4] != k:
                    raise records.error("f", k, f"link {n} of its loop belongs to face {link[4]}")
                if link[6] == 0:
                    corners.append((directions[n], own[link[3]]))
                n = link[1]
                if n == start:
                    break
            sides = dict(corners)
            if len(corners) != 4 or len(sides) != 4:
                raise records.error("f", k, f"it has {len(corners)} corners (links with flag 0): a face needs four")
            # a link that starts at a corner and runs east starts at the lower left one
            (low_i, low_j), (high_i, high_j) = sides[0], sides[2]
            i = np.arange(low_i, high_i if high_i > low_i else high_i + inside.shape[0]) % inside.shape[0]
            j = np.arange(low_j, high_j if high_j > low_j else high_j + inside.shape[1]) % inside.shape[1]
            inside[np.ix_(i, j)] = True
    return TMesh(
        s_lines=knots[0],
        t_lines=knots[1],
        vertices=index,
        along_s=edges[0],
        along_t=edges[1].T.copy(),
        inside=inside,
        period=period,
    )


def _edges(
    edges: ndarray, records: Records, directions: list[int], nodes: ndarray, index: ndarray, axis: int
) -> ndarray:
    """Edges along one axis, [line along, line across], with those between control points of one vertex and, row by
    row, of neighbours.

    Two neighbours share those rows that reach the side at which they face each other.
    """
    groups: dict[
        int, dict[tuple[int, int], tuple[int, int]]
    ] = {}  # vertex -> (offset along, across) -> (line along, across)
    for node, place in zip(nodes, index):
        offset = (int(node[1 + axis]), int(node[2 - axis]))
        groups.setdefault(int(node[0]), {})[offset] = (int(place[axis]), int(place[1 - axis]))
    for group in groups.values():
        for (along, across), (line, row) in group.items():
            if (along + 1, across) in group:
                edges[line, row] = True
    for n, link in enumerate(records.links):
        if link is not None and directions[n] == axis:
            following = records.links[link[1]]
            first = _facing(groups[link[3]], max)
            last = _facing(groups[following[3]], min)
            for across in first.keys() & last.keys():
                (start, row), (end, _) = first[across], last[across]
                edges[start : (end if end > start else None), row] = True
                edges[: (end if end <= start else 0), row] = True
    return edges


def _facing(group: dict[tuple[int, int], tuple[int, int]], extreme: Callable) -> dict[int, tuple[int, int]]:
    """The control points at one side of a vertex, by their offset across."""
    side = extreme(along for along, _ in group)
    return {across: place for (along, across), place in group.items() if along == side}


AROUND = ((0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0), (1, 1))
"""Offsets (lines in s and t) of the control points round a vertex' own one, from the north,
counter-clockwise."""


def _offsets(sides: Sequence[Any]) -> list[tuple[int, int]]:
    """Those of AROUND that lie to these of the four sides (north, west, south, east), or between two of them."""
    return [a for k, a in enumerate(AROUND) if sides[k // 2] and (k % 2 == 0 or sides[(k // 2 + 1) % 4])]


def tsm_text(surface: TSpline[TMesh], homogeneous: bool = False) -> str:
    """The file's text. Raises SurfaceError for a T-mesh that half edges cannot hold (rows without edges
    across them)."""
    mesh = surface.tmesh
    own, vertex_of, offsets, neighbours = _vertices(mesh)
    lines = [
        TSM_HEADER,
        "",
        "degree 3",
        "cap-type 1",
        "star-smoothness 0",
        "units 0.001 millimeters",
        "force-bezier-end-conditions 1",
    ]
    # Knots and periods to all digits
    for letter, knots, period in zip("st", (mesh.s_lines, mesh.t_lines), mesh.period):
        lines.append(f"#{letter}-knots {number_words(knots[np.concatenate([[True], np.diff(knots) > 0])])}")
        if period:
            lines.append(f"#{letter}-period {period!r}")
    lines += _topology(mesh, own, neighbours)

    # Which control point belongs to which vertex, and where
    lines += ["0m odd-grip-map"] + [f"0m {'gvp' if own[v] == n else 'gv'} {v}" for n, v in enumerate(vertex_of)]
    for v in range(len(own)):
        members = np.flatnonzero(vertex_of == v)
        if len(members) > 1:
            member_at = {tuple(offsets[n].tolist()): int(n) for n in members}
            sides = [any(o[axis] == sign for o in member_at) for axis, sign in ((1, 1), (0, -1), (1, -1), (0, 1))]
            words = [*(int(side) for side in sides), *(member_at.get(a, -1) for a in _offsets(sides))]
            lines.append(f"0m cg {v} 4 {' '.join(map(str, words))}")

    points = surface.control_points
    if homogeneous:
        # Numbers that give the points to the last bit when divided by the weights
        weights = surface.weights[:, None]
        product = points * weights
        whole = product
        for other in (np.nextafter(product, -np.inf), np.nextafter(product, np.inf)):
            whole = np.where(whole / weights == points, whole, other)
        exact = (whole / weights == points).all(axis=1)
        if not exact.all():
            raise SurfaceError(f"control point {int(np.argmin(exact))} has no homogeneous form to the last bit")
        points = whole
    lines += [f"0g {number_words((*p, w))}" for p, w in zip(points, surface.weights)]
    return "\n".join([*lines, "", "tol 1e-05", ""])


def _topology(mesh: TMesh, own: list[int], neighbours: Int64[ndarray, "v 4"]) -> list[str]:
    """The records f, e, v, l and ec."""
    # The half edges (vertex, direction), the two of an edge one after the other, and of each the next round its face:
    # the one that turns left most.
    links = []
    for v, row in enumerate(neighbours):
        for direction, w in enumerate(row.tolist()):
            if w >= 0 and neighbours[w, (direction + 2) % 4] != v:
                message = (
                    f"lines with one knot part between control points {own[v]} and {own[w]}: a .tsm file cannot hold it"
                )
                raise SurfaceError(message, control_points=(own[v], own[w]))
            if direction < 2 and w >= 0:
                links += [(v, direction), (w, direction + 2)]
    ids = {link: n for n, link in enumerate(links)}
    following = []
    for v, direction in links:
        end = int(neighbours[v, direction])
        turns = [ids[end, k % 4] for k in (direction + 1, direction, direction - 1) if (end, k % 4) in ids]
        if not turns:
            raise SurfaceError(f"an edge ends at control point {own[end]} inside a face: a .tsm file cannot hold it")
        following.append(turns[0])
    previous = {n: k for k, n in enumerate(following)}
    flags = [1 - (links[n][1] - links[previous[n]][1] + 1) % 4 + 1 for n in range(len(links))]
    face = [-2] * len(links)
    faces: list[int] = []
    for n in sorted(range(len(links)), key=lambda n: (links[n][1] != 0, n)):
        if face[n] == -2:
            loop = [n]
            while following[loop[-1]] != n:
                loop.append(following[loop[-1]])

            # Whether the cell to the left of the link belongs to the domain
            v, direction = links[n]
            cell = mesh.vertices[own[v]] + ((0, 0), (-1, 0), (-1, -1), (0, -1))[direction]
            shape = mesh.inside.shape
            there = all(mesh.period[axis] or 0 <= cell[axis] < shape[axis] for axis in (0, 1))
            number = len(faces) if there and mesh.inside[tuple(cell % shape)] else -1
            if number >= 0 and sum(flags[k] == 0 for k in loop) != 4:
                raise SurfaceError(
                    "a face has no four corners (rows without edges across them): a .tsm file cannot hold it"
                )
            faces += [n] if number >= 0 else []
            for k in loop:
                face[k] = number
    knots = (mesh.s_lines, mesh.t_lines)
    ids = {link: n for n, link in enumerate(links)}
    records = [f"f {n} 0" for n in faces]
    for n in range(0, len(links), 2):
        v, direction = links[n]
        w = links[n + 1][0]
        low, high = (knots[direction][mesh.vertices[own[k], direction]] for k in (v, w))
        records.append(f"e {n} {float(high - low if high > low else high + mesh.period[direction] - low)!r}")
    for v, row in enumerate(neighbours):
        direction = int(np.flatnonzero(row >= 0)[0])
        records.append(f"v {ids[v, direction]} {DIRECTIONS[direction]}")
    for n, (v, _) in enumerate(links):
        records.append(f"l {previous[n]} {following[n]} {n ^ 1} {v} {face[n]} {n // 2} {flags[n]}")
    return records + [f"ec {n // 2} 0" for n in range(0, len(links), 2) if -1 in (face[n], face[n + 1])]


def read_tsm(path: str | Path, *, homogeneous: bool = False, to_mm: bool = False) -> TSpline[TMesh]:
    """The T-spline of a .tsm file.

    A .tsm file does not say whether its control points are (x, y, z) or homogeneous (w x, w y, w z): they are
    taken as they stand, S = sum w P B / sum w B, unless `homogeneous`, which divides them by their weight
    first. `to_mm` converts them from the file's `units` (only the unit's name counts; the number before it is
    a tolerance). An open border without clamped control points needs `end-conditions SUBD_CREASES`.
    Raises FileError naming line and record.
    """
    path = Path(path)
    text = bytes_of(path).decode("utf-8", errors="replace")
    first = text.split("\n", 1)[0].strip()
    if first.split()[:1] != [TSM_HEADER]:
        raise FileError(f"{path}: the first line must be '{TSM_HEADER}', not '{first[:40]}'", file=str(path), line=1)
    records = parse_tsm(text, path)
    try:
        tmesh, numbers = tmesh_of(records)
        # x, y, z and weight of the control points with these numbers in the file.
        rows = []
        for k in numbers:
            point = records.grips[k]
            if point is None:
                raise records.error("0g", k, "a control point in use is deleted")
            if not point[3] > 0:
                raise records.error("0g", k, f"weight {point[3]} is not positive")
            rows.append(point)
        values = np.array(rows)
        weights = values[:, 3:]
        points = values[:, :3] / weights if homogeneous else values[:, :3]
        if to_mm:
            unit = records.header.get("units", ["", "?"])[-1]
            if unit not in MILLIMETRES:
                remedy = f"state one of {', '.join(MILLIMETRES)} (units)"
                raise file_error(path, f"its unit {unit!r} is not known", remedy)
            points = points * MILLIMETRES[unit]
        stated = records.header.get("end-conditions") == [MIRRORED]
        if stated and not records.owners and not all(tmesh.period):
            tmesh, control_points = with_mirrored_borders(tmesh, np.column_stack([points * weights, weights]))
            added = control_points[len(points) :]
            points = np.vstack([points, added[:, :3] / added[:, 3:]])
            weights = control_points[:, 3:]
        assert len(tmesh.elements.boxes)
        return TSpline(tmesh, points, weights[:, 0])
    except (SurfaceError, ValueError) as error:
        raise FileError(f"{path}: {error}", file=str(path), **getattr(error, "evidence", {})) from error


def write_tsm(surface: TSpline, path: str | Path, *, homogeneous: bool = False) -> None:
    """Write the surface over a general T-mesh; `read_tsm` gives every number back bit for bit.

    `homogeneous` as in `read_tsm`. FileError where the T-mesh is of another kind, SurfaceError where half edges cannot
    hold it: some that were refined beside a corner of the domain that turns inwards. `write_iga` holds every surface.
    """
    if not isinstance(surface.tmesh, TMesh):
        rows = isinstance(surface.tmesh, RowTMesh)
        what = f"{'rows of control points' if rows else 'Bezier elements or open rows'} have no .tsm form"
        raise FileError(f"{path}: {what}: end the name in {'.tspline' if rows else '.iga'}", file=str(path))
    text = tsm_text(surface, homogeneous)
    # Read the text back: every vertex must see what it saw, else the file would hold another surface.
    place = Path(path)
    try:
        tmesh, numbers = tmesh_of(parse_tsm(text, place))
        same = numbers == list(range(surface.tmesh.size)) and all(
            np.array_equal(a, b) for a, b in zip(tmesh.local_knots, surface.tmesh.local_knots)
        )
    except (FileError, SurfaceError):
        same = False
    if not same:
        raise SurfaceError(
            "half edges cannot hold this T-mesh, whose lines with one knot part at a corner: write_iga can",
            file=str(place),
        )
    write_whole(path, text)


READER = Reader("surface", partial(read_tsm, to_mm=True), write_tsm)
"""What bonecam reads and writes .tsm files with."""
