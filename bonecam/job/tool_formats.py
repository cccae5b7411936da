"""Lists of cutters as other programs write them: Fusion, FreeCAD, LinuxCNC, and tables.

Each gives entries: what the file states of a tool, by the names of a cutter's section; lengths are turned into mm. What
a file does not state, or not as it should be, an entry lacks, and `bonecam.job.tool_list` asks for it.

A shaft of Fusion's becomes a neck and a shank that hold it: it is taken to begin at the flutes, and is shank from its
first piece on that is wider than the cutter.
"""

import csv
import io
import json
import math
import re
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields
from fractions import Fraction
from itertools import takewhile
from pathlib import Path
from typing import Any

from bonecam.errors import JobError
from bonecam.files import LARGEST_INPUT, input_bytes
from bonecam.job.parameter import record
from bonecam.job.tool_section import ToolJob
from bonecam.machine.bodies import stack_as_text, stack_from_text
from bonecam.text.numbers import number, shown, whole_number

FOREIGN = (".json", ".tools", ".fctl", ".fctb", ".tbl", ".csv")
"""How the names of these files end."""
KEYS = {item.name: item for item in fields(ToolJob) if item.name != "preset"}
"""What a list may state of a cutter, beside its `name`."""
SHAPES = {
    **dict.fromkeys(("ball", "ball end mill", "ballend"), "ball"),
    **dict.fromkeys(("bull", "bull nose end mill", "bullnose", "torus"), "bull"),
    **dict.fromkeys(("flat", "flat end mill", "endmill"), "flat"),
}
"""The ends that are kept, by their names in bonecam, Fusion and FreeCAD."""
MM = {"mm": 1.0, "millimeters": 1.0, "inch": 25.4, "inches": 25.4, "in": 25.4, '"': 25.4}
"""Millimetres of the units that files name."""
FUSION = {"DC": "diameter", "LCF": "flute_length", "SFDM": "shank_diameter", "LB": "overhang", "RE": "corner_radius"}
"""The keys of a tool's `geometry` in Fusion (those of ISO 13399; LB is the length below the holder)."""
FREECAD = {
    "Diameter": "diameter",
    "CuttingEdgeHeight": "flute_length",
    "ShankDiameter": "shank_diameter",
    "CornerRadius": "corner_radius",
    "TorusRadius": "corner_radius",
}
"""The parameters of a toolbit of FreeCAD. Its `Length` is that of the whole tool: it states no stick-out."""
QUANTITY = re.compile(r"\s*([0-9.,/]{1,20})\s*([^\s0-9]*)\s*")
"""A length of FreeCAD: number and unit."""
TBL_WORD = re.compile(r"([A-Za-z])\s*([-+]?[0-9.]+)")
"""A word of a tool table of LinuxCNC."""
UNREADABLE = (ValueError, csv.Error, zipfile.BadZipFile, zlib.error, EOFError, RuntimeError)
"""What is raised where a file is not what its name says (RuntimeError: a locked zip, or JSON that nests too deep)."""
LARGEST = 1e6
"""No size of a tool is larger, mm or inch: what is counts as not stated."""

Entry = dict[str, Any]
"""What a list states of a tool."""


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """A block that reads a list; a JobError that names the file where it cannot be read."""
    try:
        yield
    except OSError as error:
        raise JobError(f"{path}: {error.strerror}: give a list of cutters", file=str(path)) from error
    except UNREADABLE as error:
        raise JobError(f"{path}: {error}", file=str(path)) from error


def called(entry: Mapping[str, Any]) -> str:
    """A tool as messages call it."""
    number, name = entry.get("number"), entry.get("name")
    return " ".join([f"tool {number}"] * bool(number) + [shown(name)] * bool(name)) or "a tool"


def _decoded(content: bytes) -> str:
    """A text in UTF-8, else as Windows and older programs write names."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def foreign_entries(path: Path, scale: float | None = None) -> tuple[list[Entry], list[Path]]:
    """The entries of the tools of a file, and the files that were read; lengths of a table are in units of `scale` mm.
    JobError names the file."""
    files = [path]
    with naming(path):
        content = input_bytes(path)
        if path.suffix == ".fctl":
            found = []
            for bit, position in _toolbits(path, _json(content)):
                (entry,), read = foreign_entries(bit)
                found.append(entry | position)
                files += read
        elif path.suffix == ".fctb":
            found = [_toolbit(path, _json(content))]
        elif path.suffix == ".tbl":
            found = list(_linuxcnc(_decoded(content), scale))
        elif path.suffix == ".csv":
            found = list(_table(_decoded(content), scale or 1.0))
        else:
            found = list(_fusion(content))
    for entry in found:
        if "diameter" in entry:
            entry["radius"] = entry.pop("diameter") / 2
    return found, files


def _json(content: bytes) -> Mapping[str, Any]:
    """The table of a JSON text; ValueError where it is none."""
    try:
        return _as_table(json.loads(_decoded(content)))
    except ValueError as error:
        raise ValueError(f"is no JSON ({error}): export it again") from error


def _as_table(value: object) -> Mapping[str, Any]:
    """A table that another program wrote; empty where it is none."""
    return value if isinstance(value, dict) else {}


def _as_tables(value: object) -> list[Mapping[str, Any]]:
    """The tables of a list; none where it is no list."""
    return list(map(_as_table, value)) if isinstance(value, list) else []


def _whole(value: object, key: str) -> Entry:
    """An entry of a whole number; empty where it is none."""
    return {key: value} if isinstance(value, int) else {}


def _sizes(table: Mapping[str, Any], scale: float) -> dict[str, float]:
    """The numbers of a table, times `scale`, rounded to a nanometre: what is left of conversions from inches."""
    numbers = {key: value for key, value in table.items() if isinstance(value, int | float)}
    return {key: round(value * scale, 6) for key, value in numbers.items() if abs(value) < LARGEST}


def _fusion(content: bytes) -> Iterator[Entry]:
    """The tools of a library of Fusion, plain or in a zip."""
    if content.startswith(b"PK"):
        with zipfile.ZipFile(io.BytesIO(content)) as packed:
            inner = [item for item in packed.infolist() if item.filename.endswith(".json")]
            if len(inner) != 1 or inner[0].file_size > LARGEST_INPUT:
                raise ValueError("is no library of Fusion: give one that holds tools.json")
            content = packed.read(inner[0])
    library = _json(content)
    if "data" not in library:
        raise ValueError("has no `data`, as a tool library of Fusion has: give one that Fusion exported")
    yield from map(_fusion_tool, _as_tables(library["data"]))


def _fusion_tool(tool: Mapping[str, Any]) -> Entry:
    """A tool of Fusion, which has its own unit, and its holder another."""
    geometry, posted, held = (_as_table(tool.get(key)) for key in ("geometry", "post-process", "holder"))
    shape = str(tool.get("type"))
    entry: Entry = {"shape": shape, "name": str(tool.get("description") or tool.get("product-id") or "")}
    entry |= _whole(posted.get("number"), "number") | _whole(geometry.get("NOF"), "flutes")
    if shape not in SHAPES or geometry.get("TA"):
        return entry | {"shape": shape if shape not in SHAPES else f"tapered {shape}"}
    units = [str(tool.get("unit")), str(held.get("unit", tool.get("unit")))]
    if not MM.keys() >= set(units):
        raise ValueError(f"{called(entry)}: unit = {', '.join(units)}: give millimeters or inches")
    scale, held_scale = (MM[unit] for unit in units)
    sizes = _sizes(geometry, scale)
    entry |= {name: sizes[key] for key, name in FUSION.items() if key in sizes}
    if SHAPES[shape] != "bull":
        entry.pop("corner_radius", None)
    shaft = _as_tables(_as_table(tool.get("shaft")).get("segments"))
    entry |= _neck(sizes, [_sizes(piece, scale) for piece in shaft])
    holder = _below_gauge_line(held, held_scale)
    return entry | ({"holder": stack_as_text(holder)} if holder else {})


def _neck(sizes: Mapping[str, float], shaft: list[dict[str, float]]) -> Entry:
    """Neck and shank that hold what stands between flutes and holder of a tool of Fusion: its shoulder, of which
    `sizes` have the length from the tip and the diameter, and the pieces of a `shaft`, from the flutes up. Nothing
    where it states neither; mm."""
    if not {"DC", "LCF", "SFDM", "LB"} <= sizes.keys() or not (shaft or "shoulder-length" in sizes):
        return {}
    start = sizes["LCF"]
    pieces = [
        (one.get("height", 0.0), max(one.get("lower-diameter", 0.0), one.get("upper-diameter", 0.0))) for one in shaft
    ]
    shoulder = sizes.get("shoulder-length", start) - start
    relief = [(shoulder, sizes.get("shoulder-diameter") or sizes["DC"])] if shoulder > 0 else []
    pieces = pieces or relief
    slim = list(takewhile(lambda piece: piece[1] <= sizes["DC"], pieces))
    neck = start + sum(height for height, _ in slim)
    thick = max((diameter for _, diameter in (*relief, *slim)), default=0.0)
    shank = max([sizes["SFDM"], *(diameter for _, diameter in pieces[len(slim) :])])
    if neck >= sizes["LB"]:
        return {"neck_length": 0.0, "shank_diameter": thick}
    if not slim or thick >= shank:
        return {"neck_length": 0.0, "shank_diameter": max(shank, thick)}
    return {"neck_length": neck, "neck_diameter": thick, "shank_diameter": shank}


def _below_gauge_line(holder: Mapping[str, Any], scale: float) -> list[list[float]]:
    """Length, lower and upper diameter (mm) of the pieces of a holder of Fusion from its nose to the gauge line; to its
    end, where it states no gauge length."""
    left = _sizes(holder, scale).get("gaugeLength", math.inf)
    rows = []
    for piece in _as_tables(holder.get("segments")):
        sizes = _sizes(piece, scale)
        height, lower, upper = (sizes.get(key, 0.0) for key in ("height", "lower-diameter", "upper-diameter"))
        taken = min(height, left)
        if taken > 0:
            rows.append([taken, lower, round(lower + (upper - lower) * taken / height, 6)])
        left = round(left - taken, 6)
    return rows


def _toolbits(path: Path, library: Mapping[str, Any]) -> Iterator[tuple[Path, Entry]]:
    """The files of the toolbits that a library of FreeCAD names, beside it or in the folder Bit beside its own, and
    their numbers."""
    for item in _as_tables(library.get("tools")):
        name = str(item.get("path")).replace("\\", "/")
        places = [path.parent / name, path.parent.parent / "Bit" / Path(name).name]
        bit = next((place for place in places if place.is_file()), None)
        if bit is None:
            raise ValueError(f"names {name}, which is neither beside it nor in ../Bit: put it there")
        yield bit, _whole(item.get("nr"), "number")


def _toolbit(path: Path, bit: Mapping[str, Any]) -> Entry:
    """A toolbit of FreeCAD."""
    sizes = _as_table(bit.get("parameter"))
    shape = str(bit.get("shape-type") or Path(str(bit.get("shape")).replace("\\", "/")).stem).lower()
    entry: Entry = {"shape": shape, "name": str(bit.get("name") or path.stem)}
    if shape in SHAPES:
        entry |= {FREECAD[key]: _quantity(key, value) for key, value in sizes.items() if key in FREECAD}
        flutes = str(sizes.get("Flutes", ""))
        entry |= {"flutes": int(flutes)} if flutes.isdecimal() else {}
    return entry


def _quantity(key: str, value: object) -> float:
    """A length of FreeCAD, like "6.00 mm", "6,00 mm" or "1/4 in", mm; a number alone is one of mm."""
    found = QUANTITY.fullmatch(str(value))
    try:
        if found and (found[2] or "mm") in MM:
            return round(float(Fraction(found[1].replace(",", "."))) * MM[found[2] or "mm"], 6)
    except (ValueError, ZeroDivisionError):
        pass
    raise ValueError(f"{key} = {shown(value)}: give a length with its unit, like '6.00 mm'")


def _linuxcnc(text: str, scale: float | None) -> Iterator[Entry]:
    """The tools of a tool table of LinuxCNC, in units of `scale` mm: number, diameter, and the comment as name."""
    if scale is None:
        what = "a tool table has the unit of its machine, and states no shape, flutes, shank, stick-out or holder"
        toml = 'name it in a .toml file that says from = "tool.tbl", units = "mm" (or "inch"), and [[tool]] of each'
        raise ValueError(f"{what}: {toml}")
    for line, row in enumerate(text.splitlines(), 1):
        words, _, comment = row.partition(";")
        found = {letter.upper(): word for letter, word in TBL_WORD.findall(words)}
        if not words.strip():
            continue
        if "T" not in found:
            raise ValueError(f"line {line}: is none of a tool table: write it like 'T3 P3 D6 Z50 ;6 mm ball'")
        try:
            entry: Entry = {"number": whole_number(found["T"]), "name": comment.strip()}
            diameter = number(found.get("D", "0"))
        except ValueError as error:
            raise ValueError(f"line {line}: {error}: correct it") from error
        yield entry | ({"diameter": round(diameter * scale, 6)} if diameter else {})


def _table(text: str, scale: float) -> Iterator[Entry]:
    """The tools of a table with a head line, columns apart by commas, semicolons or tabs, named as the keys of a
    section, in any case, or `name` and `diameter`; lengths in units of `scale` mm. Other columns are passed over."""
    delimiter = max(",;\t", key=text.partition("\n")[0].count)
    reader = csv.reader(io.StringIO(text), delimiter=delimiter, strict=True)
    head = [re.sub(r"[\s-]+", "_", cell.strip().lower()) for cell in next(reader, [])]
    for row in reader:
        entry: Entry = {}
        for key, cell in zip(head, map(str.strip, row), strict=False):
            if cell and key in {*KEYS, "name", "diameter"}:
                try:
                    entry[key] = _cell(key, cell, delimiter, scale)
                except ValueError as error:
                    raise ValueError(f"line {reader.line_num}: {key} = {error}: correct it") from error
        if entry:
            yield entry


def _cell(key: str, cell: str, delimiter: str, scale: float) -> Any:
    """The value of a cell of a table; decimal commas are read where no comma parts the columns."""
    if key == "holder":
        rows = [[piece.length, piece.diameter, piece.top_diameter] for piece in stack_from_text(cell)]
        return stack_as_text([[round(size * scale, 6) for size in row] for row in rows])
    if key in ("name", "shape"):
        return cell if key == "name" else cell.lower()
    if key in ("number", "flutes"):
        return whole_number(cell)
    value = number(cell if delimiter == "," else cell.replace(",", "."))
    return round(value * scale, 6) if key == "diameter" or record(KEYS[key]).unit == "mm" else value
