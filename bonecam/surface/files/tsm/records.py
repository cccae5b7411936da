"""The records of a .tsm file (`#TS0200`), read and checked one by one.

    f LINK FLAG                         a face and one of its links
    e LINK INTERVAL                     an edge and its knot interval
    v LINK NORTH|WEST|SOUTH|EAST        a vertex, a link that starts there, and its direction
    l PREVIOUS NEXT OPPOSITE VERTEX FACE EDGE FLAG
                                        a half edge; face -1: outside; flag: 0 turns left at its start,
                                        1 goes straight on, 2 turns right
    ec EDGE 0                           a border edge with a Bezier end condition
    0m gvp VERTEX                       the next control point is the vertex' own one
    0m gv VERTEX                        ... is another one of the vertex (-1: not in use)
    0m cg VERTEX 4 D0 D1 D2 D3 GRIPS... the control points of a border vertex, see surface.files.tsm.layout
    0g X Y Z W                          a control point

The n-th record of a kind has the number n - 1; a bare `f`, `e`, `v`, `l` or `0g` is a deleted one that keeps
its number. What follows a # is a comment; records of other kinds (100..., 105..., 50000..., tol, ver) carry
nothing for the surface.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from bonecam.errors import FileError
from bonecam.text.numbers import number, whole_number

DIRECTIONS = ("EAST", "NORTH", "WEST", "SOUTH")
TSM_HEADER = "#TS0200"
COMMENTS = ("#s-knots ", "#t-knots ", "#s-period ", "#t-period ")
"""Comments that `surface.files.tsm.write` adds: knots and periods with all digits, which sums of intervals
lose."""

LARGEST = 1e18
"""No number is as large: record numbers fit 64 bits, and nothing overflows."""

HEADER_WORDS = ("degree", "units", "end-conditions")


@dataclass(eq=False)
class Records:
    """The file's records; None is a deleted one. `lines` says where record n of a kind stands."""

    path: Path
    faces: list[tuple[int, int] | None] = field(default_factory=list)
    edges: list[tuple[int, float] | None] = field(default_factory=list)
    vertices: list[tuple[int, int] | None] = field(default_factory=list)
    links: list[tuple[int, int, int, int, int, int, int] | None] = field(default_factory=list)
    conditions: list[tuple[int, int]] = field(default_factory=list)
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
    _check_references(records)
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
        records.conditions.append(tuple(_numbers(path, n, words, whole_number, 2)))  # type: ignore[arg-type]
    elif kind == "0g":
        records.lines["0g", len(records.grips)] = n
        records.grips.append(tuple(_numbers(path, n, words, number, 4)) if words else None)  # type: ignore[arg-type]
    elif kind == "0m" and words[:1] in (["gv"], ["gvp"]):
        records.lines["0m", len(records.owners)] = n
        records.owners.append((words[0] == "gvp", _numbers(path, n, words[1:], whole_number, 1)[0]))
    elif kind == "0m" and words[:1] == ["cg"]:
        numbers = _numbers(path, n, words[1:], whole_number, None)
        if len(numbers) < 6:
            raise FileError(
                f"{path} line {n}: 'cg' needs a vertex, a valence, extents and grips", file=str(path), line=n
            )
        records.lines["cg", numbers[0]] = n
        records.corners[numbers[0]] = numbers[1:]


def _entity(path: Path, n: int, kind: str, words: list[str]) -> tuple:
    """The numbers of a record f, e, v or l in line n; FileError where they are not as they should be."""
    if kind == "e":
        link = _numbers(path, n, words[:1], whole_number, 1)[0]
        interval = _numbers(path, n, words[1:], number, 1)[0]
        if interval < 0:
            raise FileError(
                f"{path} line {n}: knot interval {interval} is negative: knots must not decrease",
                file=str(path),
                line=n,
            )
        return link, interval
    if kind == "v":
        if len(words) != 2 or words[1] not in DIRECTIONS:
            raise FileError(
                f"{path} line {n}: a vertex needs a link and one of {', '.join(DIRECTIONS)}", file=str(path), line=n
            )
        return _numbers(path, n, words[:1], whole_number, 1)[0], DIRECTIONS.index(words[1])
    return tuple(_numbers(path, n, words, whole_number, 2 if kind == "f" else 7))


def _numbers(path: Path, n: int, words: list[str], kind: Callable[[str], float], count: int | None) -> list:
    """The words of line n as `count` numbers (None: any number of them); FileError where they are not."""
    try:
        values = [kind(word) for word in words]
    except ValueError as error:
        raise FileError(f"{path} line {n}: {error}", file=str(path), line=n) from error
    if count is not None and len(values) != count:
        raise FileError(
            f"{path} line {n}: expected {count} finite numbers, found {len(values)}", file=str(path), line=n
        )
    if not all(abs(value) < LARGEST for value in values):
        raise FileError(f"{path} line {n}: expected finite numbers of a size below {LARGEST:g}", file=str(path), line=n)
    return values


def _check_references(records: Records) -> None:
    """FileError where a record names one that does not exist, or where links contradict one another."""
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
            _check_link(records, n, link)
    for short, entities in (("f", records.faces), ("e", records.edges), ("v", records.vertices)):
        for n, entity in enumerate(entities):
            if entity is not None and not _exists(records.links, entity[0]):
                raise records.error(short, n, f"link {entity[0]} does not exist")


def _exists(table: list, number: int) -> bool:
    """Whether the table has a record of that number which is not deleted."""
    return 0 <= number < len(table) and table[number] is not None


def _check_link(records: Records, n: int, link: tuple[int, ...]) -> None:
    """FileError where link n and the links before, after and opposite to it do not name one another."""
    previous, following, opposite = (records.links[k] for k in link[:3])
    assert previous is not None
    assert following is not None
    assert opposite is not None
    if previous[1] != n or following[0] != n:
        raise records.error("l", n, f"previous link {link[0]} and next link {link[1]} do not point back to it")
    if opposite[2] != n or link[2] == n or opposite[5] != link[5]:
        raise records.error("l", n, f"opposite link {link[2]} does not point back to it along edge {link[5]}")
    if opposite[3] != following[3]:
        raise records.error(
            "l", n, f"it ends at vertex {following[3]}, its opposite link {link[2]} starts at vertex {opposite[3]}"
        )
    if following[4] != link[4]:
        raise records.error("l", n, f"it belongs to face {link[4]}, its next link {link[1]} to face {following[4]}")
