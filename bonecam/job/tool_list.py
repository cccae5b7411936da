"""Lists of cutters: the catalogue that ships, and a shop's own as it has it.

A list is read from bonecam's TOML, a tool library of Fusion (`.json`, or `.tools`: the same, plain or in a zip),
toolbits of FreeCAD (`.fctb`, or a library `.fctl` that names them), a tool table of LinuxCNC (`.tbl`) or a table
(`.csv`, columns named as the keys of a cutter's section). Each states values by name of every tool; lengths are mm.

Kept are ball, bull-nose and flat ends; other tools are left out and counted. What decides about a collision is asked
for where a file does not state it (`REQUIRED`), and never guessed. A TOML list completes another file:

    from = "tool.tbl"                # beside this file
    units = "mm"                     # of a table that states none
    only = [3, 7, "6 mm ball"]       # the tools that are used, by number or name; all without it
    holder = "60 10 19, 20 63"       # of the tools that state none, like every key above the first [[tool]]
    [holders]
    collet = "25 28, 40 50"          # stacks by name, for `holder`
    [[tool]]
    number = 3                       # which, by number, name or both; the other keys are its values
    overhang = 24

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
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
from fractions import Fraction
from itertools import takewhile
from pathlib import Path
from typing import Any

from bonecam.errors import JobError, did_you_mean
from bonecam.files import LARGEST_INPUT, input_bytes
from bonecam.job.parameter import is_list, record
from bonecam.job.tool_section import ToolJob, misfit
from bonecam.machine.frustum import stack_as_text, stack_from_text
from bonecam.runtime.extensions import named_files
from bonecam.text.faults import Faults, shown
from bonecam.text.numbers import number, whole_number
from bonecam.text.toml import parse_toml

ENDINGS = (".toml", ".json", ".tools", ".fctl", ".fctb", ".tbl", ".csv")
"""How the names of the files of lists end; of two lists of one name the former counts."""
CATALOGUE = "catalogue"
"""The name of the list that ships."""
SHIPPED = Path(__file__).parents[1] / "tool" / "tools"
SHAPES = {
    **dict.fromkeys(("ball", "ball end mill", "ballend"), "ball"),
    **dict.fromkeys(("bull", "bull nose end mill", "bullnose", "torus"), "bull"),
    **dict.fromkeys(("flat", "flat end mill", "endmill"), "flat"),
}
"""The ends that are kept, by their names in bonecam, Fusion and FreeCAD."""
REQUIRED = ("number", "radius", "flute_length", "shank_diameter", "overhang", "holder")
"""What every tool states; where the shank is wider than the cutter, `neck_length` too (0: no neck)."""
MM = {
    "mm": 1.0,
    "millimeters": 1.0,
    "cm": 10.0,
    "m": 1000.0,
    "in": 25.4,
    "inch": 25.4,
    "inches": 25.4,
    '"': 25.4,
}
"""Millimetres of the units that files name."""
FUSION = {
    "DC": "diameter",
    "LCF": "flute_length",
    "SFDM": "shank_diameter",
    "LB": "overhang",
    "RE": "corner_radius",
}
"""The keys of a tool's `geometry` in Fusion (those of ISO 13399; LB is the length below the holder)."""
FREECAD = {
    "Diameter": "diameter",
    "CuttingEdgeHeight": "flute_length",
    "ShankDiameter": "shank_diameter",
    "CornerRadius": "corner_radius",
    "TorusRadius": "corner_radius",
}
"""The parameters of a toolbit of FreeCAD. Its `Length` is that of the whole tool: it states no stick-out."""
KEYS = {item.name: item for item in fields(ToolJob) if item.name != "preset"}
"""What a list states of a tool, beside its `name` and `source`, and `diameter` for radius."""
COLUMNS = {
    "t": "number",
    "description": "name",
    "type": "shape",
    "stickout": "overhang",
    "stick_out": "overhang",
}
"""Columns of a table that are called otherwise than these."""
QUANTITY = re.compile(r"\s*([0-9.,/]{1,20})\s*([^\s0-9]*)\s*")
"""A length of FreeCAD: number and unit."""
TBL_WORD = re.compile(r"([A-Za-z])\s*([-+]?[0-9.]+)")
"""A word of a tool table of LinuxCNC."""
UNREADABLE = (ValueError, csv.Error, zipfile.BadZipFile, zlib.error, EOFError, RuntimeError)
"""What is raised where a file is not what its name says (RuntimeError: a locked zip, or JSON that nests too deep)."""
LARGEST = 1e6
"""No size of a tool is larger, mm or inch: what is counts as not stated."""
HELD = frozenset({"holder", "holder_diameter", "holder_length"})
"""What states a holder."""

Entry = dict[str, Any]
"""What a list states of a tool."""


@dataclass(frozen=True)
class ListedTool:
    """A cutter of a list, by the name that the list or the shop has for it."""

    name: str
    tool: ToolJob


@dataclass(frozen=True)
class ToolList:
    """The cutters of a list, what it states of each, how many tools of which other kinds were left out, and the files
    that were read."""

    tools: tuple[ListedTool, ...]
    stated: tuple[Entry, ...]
    left_out: Counter[str]
    files: tuple[Path, ...]

    def matching(self, called: str) -> list[tuple[ListedTool, Entry]]:
        """The cutters of a name, else those of a number, with what is stated of them."""
        pairs = list(zip(self.tools, self.stated, strict=True))
        named = [pair for pair in pairs if pair[0].name == called]
        return named or [pair for pair in pairs if called == str(pair[0].tool.number or "")]


def list_files() -> dict[str, Path]:
    """The files of the lists that ship, are the user's, or come with other packages, by name."""
    return named_files("toollists", SHIPPED, ENDINGS)


def user_cutters() -> dict[str, Path]:
    """The files of single cutters that are the user's, or come with other packages, by name."""
    return named_files("tools")


def read_tool_list(file: str) -> tuple[ListedTool, ...]:
    """The cutters of a list, as `tool_list` reads it."""
    return tool_list(file).tools


def tool_list(file: str) -> ToolList:
    """The list of a name (`list_files`), of a path, or the catalogue ("").

    JobError names the file, and every tool with what is wrong with it, or lacks and where to state it.
    """
    known = list_files()
    path = known.get(file or CATALOGUE, Path(file))
    if path.suffix not in ENDINGS:
        remedy = f"use one of {', '.join(known)}, or a file that ends in {', '.join(ENDINGS)}"
        what = f"{shown(file)}: is no list of cutters{did_you_mean(file, known)}"
        raise JobError(f"{what}: {remedy}", file=file)
    entries, files = _entries(path)
    left_out = Counter[str]()
    stated, tools = list[Entry](), list[ListedTool]()
    faults = list[tuple[str, str]]()
    asked = False
    for entry in entries:
        kind = str(entry.get("shape", "without a stated shape"))
        if kind not in SHAPES:
            left_out[kind] += 1
            continue
        entry["shape"] = SHAPES[kind]
        try:
            tool = ToolJob(**{name: value for name, value in entry.items() if name in KEYS})
        except JobError as error:
            faults.append((_called(entry), str(error)))
            continue
        lacking = _lacking(entry, tool)
        asked |= bool(lacking)
        fault = f"states no {', '.join(lacking)}" if lacking else _misfit(tool)
        if fault:
            faults.append((_called(entry), fault))
        stated.append(entry)
        tools.append(ListedTool(entry.get("name") or f"T{tool.number}", tool))
    if faults:
        place = "" if path.suffix == ".toml" else f' of a .toml file beside it that says from = "{path.name}"'
        remedy = (
            f": state it in its [[tool]]{place}, or above the first for all that lack it" if asked else ""
        )
        raise JobError(f"{path}: {Faults(faults)}{remedy}", file=str(path))
    if not tools:
        others = ", ".join(f"{count} {kind}" for kind, count in left_out.items())
        what = f"has no ball, bull nose or flat end ({others or 'no tool at all'})"
        raise JobError(f"{path}: {what}: state their shapes, or give another list", file=str(path))
    return ToolList(tuple(tools), tuple(stated), left_out, files)


def _called(entry: Mapping[str, Any]) -> str:
    """A tool as messages call it."""
    number, name = entry.get("number"), entry.get("name")
    return " ".join([f"tool {number}"] * bool(number) + [shown(name)] * bool(name)) or "a tool"


def _lacking(entry: Entry, tool: ToolJob) -> list[str]:
    """What an entry does not state; `tool` has the defaults in its place."""
    asked = [name for name in REQUIRED if name != "holder" or not entry.keys() >= HELD - {"holder"}]
    if {"shank_diameter", "radius"} <= entry.keys() and tool.shank_diameter > 2 * tool.radius:
        asked.append("neck_length")
    if tool.shape == "bull":
        asked.append("corner_radius")
    return [name for name in asked if entry.get(name) in (None, "")]


def _misfit(tool: ToolJob) -> str:
    """What does not fit in a cutter, with its bound; empty where all does."""
    fault = misfit(tool, tool.holder_stack[0].diameter)
    if tool.shape == "ball" and tool.flute_length < tool.radius:
        fault = "flute_length", f"give at least the ball's radius ({tool.radius:g} mm)"
    if tool.shape == "bull" and tool.corner_radius >= tool.radius:
        fault = "corner_radius", f"give less than the radius ({tool.radius:g} mm)"
    return f"{fault[0]} = {getattr(tool, fault[0]):g}: {fault[1]}" if fault else ""


def preset_values(preset: str, tools: str) -> Entry:
    """The values of the cutter that `preset` names: by name or number in the list `tools` of a job, by name among the
    user's own or in the catalogue, or by the path of a .toml file of one.

    What is not stated of it has its default, but the scallop, which is no property of a cutter: it is left out.
    JobError where there is no such cutter, or more than one.
    """
    if preset.endswith(".toml"):
        one = tool_list(preset)
        matching = list(zip(one.tools, one.stated, strict=True))
    else:
        own = {name: str(file) for name, file in user_cutters().items()}
        lists = [tool_list(file) for file in [*filter(None, (tools, own.get(preset))), ""]]
        matching = next(filter(None, (one.matching(preset) for one in lists)), [])
        if not matching:
            names = dict.fromkeys([*(tool.name for one in lists for tool in one.tools), *own])
            known = f"use one of {', '.join(names)}, or the path of a .toml file"
            what = f"preset = {shown(preset)}{did_you_mean(preset, names)}: {known}"
            raise JobError(what, field="preset")
    if len(matching) > 1:
        numbers = ", ".join(f"{listed.tool.number}" for listed, _ in matching)
        what = f"preset = {shown(preset)}: these are {len(matching)} cutters"
        remedy = f"name the list in nc.tools, and here one by its number ({numbers})"
        raise JobError(f"{what}: {remedy}", field="preset")
    listed, stated = matching[0]
    return {name: getattr(listed.tool, name) for name in KEYS if name != "scallop" or name in stated}


def described(tool: ToolJob) -> str:
    """A cutter in a line; mm."""
    bull = f"bull nose with corners of {tool.corner_radius:g}"
    end = {"ball": "ball", "bull": bull, "flat": "flat end"}[tool.shape]
    neck = f"neck {tool.neck_diameter:g} up to {tool.neck_length:g}, " if tool.neck_length else ""
    held = f"{tool.overhang:g} out of a holder of {tool.holder_stack[0].diameter:g}"
    flutes = f"{end} of {2 * tool.radius:g} mm, flutes of {tool.flute_length:g}"
    return f"{flutes}, {neck}shank {tool.shank_diameter:g}, {held}"


def _entries(path: Path, scale: float | None = None) -> tuple[list[Entry], tuple[Path, ...]]:
    """What a file states of each of its tools, and the files that were read; lengths of a table are in units of `scale`
    mm. JobError names the file."""
    try:
        if path.suffix == ".toml":
            return _toml(path)
        if path.suffix == ".fctl":
            return _freecad_library(path)
        if path.suffix == ".fctb":
            found = [_toolbit(path)]
        elif path.suffix == ".tbl":
            found = list(_linuxcnc(_decoded(input_bytes(path)), scale))
        elif path.suffix == ".csv":
            found = list(_table(_decoded(input_bytes(path)), scale or 1.0))
        else:
            found = list(_fusion(input_bytes(path)))
        return [_with_radius(entry) for entry in found], (path,)
    except OSError as error:
        raise JobError(f"{path}: {error.strerror}: give a list of cutters", file=str(path)) from error
    except UNREADABLE as error:
        raise JobError(f"{path}: {error}", file=str(path)) from error


def _with_radius(entry: Mapping[str, Any]) -> Entry:
    """What is stated of a tool, with the radius for its diameter."""
    values = dict(entry)
    diameter = values.pop("diameter", None)
    if diameter is not None:
        if not isinstance(diameter, int | float):
            raise ValueError(f"{_called(values)}: diameter = {shown(diameter)}: give a number")
        values["radius"] = diameter / 2
    return values


def _decoded(content: bytes) -> str:
    """A text in UTF-8, else as Windows and older programs write names."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def _json(content: bytes) -> Mapping[str, Any]:
    """The table of a JSON text; ValueError where it is none."""
    try:
        return _as_table(json.loads(_decoded(content)))
    except ValueError as error:
        raise ValueError(f"is no JSON ({error}): export it again") from error


def _as_table(value: object) -> Mapping[str, Any]:
    """A table that another program wrote; empty where it is none, so that what it lacks is asked for."""
    return value if isinstance(value, dict) else {}


def _as_list(value: object) -> list[Any]:
    return value if isinstance(value, list) else []


def _toml(path: Path) -> tuple[list[Entry], tuple[Path, ...]]:
    """The tools of bonecam's own list, and of the file that it completes; without [[tool]] and `from` it is one cutter,
    of the file's name."""
    values = parse_toml(_decoded(input_bytes(path)))
    tables, source = values.pop("tool", []), values.pop("from", None)
    units, only = values.pop("units", None), values.pop("only", None)
    holders = values.pop("holders", {})
    if not tables and source is None:
        tables, values = [{**values, "name": path.stem}], {}
    if not is_list(tables) or not all(isinstance(table, dict) for table in [*tables, holders]):
        raise ValueError(
            "write [[tool]] before the values of each tool, and [holders] before the holders by name"
        )
    known = {*KEYS, "diameter", "source"}
    for table, keys in [(values, known), *((table, known | {"name"}) for table in tables)]:
        for key in table.keys() - keys:
            raise ValueError(
                f"unknown key {key!r}{did_you_mean(key, keys)}: use one of {', '.join(sorted(keys))}"
            )
        if str(table.get("shape", "ball")) not in SHAPES:
            raise ValueError(f"shape = {shown(table['shape'])}: choose one of ball, bull, flat")
        if not isinstance(table.get("name", ""), str):
            raise ValueError(f"name = {shown(table['name'])}: give a text")
    if units not in (None, *MM):
        raise ValueError(f"units = {shown(units)}: give mm or inch")
    tables = [_with_radius(table) for table in tables]
    files: tuple[Path, ...] = (path,)
    if source is None:
        entries = tables
        values = {"number": 0, "neck_length": 0.0, "shape": "ball", **values}
    elif isinstance(source, str) and Path(source).suffix in ENDINGS[1:]:
        entries, read = _entries(path.parent / source, MM.get(units or ""))
        files += read
        for table in tables:
            _complete(entries, table, source)
    else:
        raise ValueError(f"from = {shown(source)}: give a file that ends in {', '.join(ENDINGS[1:])}")
    if only is not None:
        wanted = only if is_list(only) else [only]
        for item in wanted:
            if not any(_is(entry, item) for entry in entries):
                raise ValueError(f"only: there is no tool {shown(item)}: use {_calls(entries)}")
        entries = [entry for entry in entries if any(_is(entry, item) for item in wanted)]
    values = _with_radius(values)
    unheld = {key: value for key, value in values.items() if key not in HELD}
    entries = [{**(unheld if HELD & entry.keys() else values), **entry} for entry in entries]
    for entry in entries:
        held = entry.get("holder")
        held = holders.get(held, held) if isinstance(held, str) else held
        if held is not None:
            entry["holder"] = held
    return entries, files


def _is(entry: Mapping[str, Any], item: object) -> bool:
    """Whether a number or a name is that of an entry."""
    return item in (entry.get("number"), entry.get("name"))


def _calls(entries: Iterable[Mapping[str, Any]]) -> str:
    return ", ".join(dict.fromkeys(map(_called, entries)))


def _complete(entries: list[Entry], values: Entry, source: str) -> None:
    """Give the entry of `source` that has the number and the name of `values`, as far as these have any, the values
    instead of its own; ValueError where there is none, or more than one."""
    which: Entry = {name: values[name] for name in ("number", "name") if name in values}
    if not which:
        raise ValueError(f"[[tool]]: give the number or the name that it has in {source}")
    matching = [one for one in entries if all(one.get(key, value) == value for key, value in which.items())]
    told = f"[[tool]] {_called(which)}: {source} has"
    if not matching:
        raise ValueError(f"{told} none: use {_calls(entries)}")
    if len(matching) > 1:
        raise ValueError(f"{told} {len(matching)}: give number and name")
    gone = [*HELD] * bool(HELD & values.keys()) + ["neck_diameter"] * (values.get("neck_length") == 0)
    for key in gone:
        matching[0].pop(key, None)
    matching[0].update(values)


def _fusion(content: bytes) -> Iterator[Entry]:
    """The tools of a library of Fusion, plain or in a zip. Each has its own unit, and its holder another."""
    if content.startswith(b"PK"):
        with zipfile.ZipFile(io.BytesIO(content)) as packed:
            inner = [item for item in packed.infolist() if item.filename.endswith(".json")]
            if len(inner) != 1 or inner[0].file_size > LARGEST_INPUT:
                raise ValueError("is no library of Fusion: give one that holds tools.json")
            content = packed.read(inner[0])
    library = _json(content)
    if "data" not in library:
        raise ValueError("has no `data`, as a tool library of Fusion has: give one that Fusion exported")
    for tool in map(_as_table, _as_list(library["data"])):
        geometry, posted = _as_table(tool.get("geometry")), _as_table(tool.get("post-process"))
        shape = str(tool.get("type"))
        entry: Entry = {"shape": shape, "name": str(tool.get("description") or tool.get("product-id") or "")}
        for key, value in (("number", posted.get("number")), ("flutes", geometry.get("NOF"))):
            entry |= {key: value} if isinstance(value, int) else {}
        if shape in SHAPES and geometry.get("TA"):
            entry["shape"] = f"tapered {shape}"
        elif shape in SHAPES:
            unit, held = tool.get("unit"), _as_table(tool.get("holder"))
            units = [str(unit), str(held.get("unit", unit))]
            if not MM.keys() >= set(units):
                raise ValueError(f"{_called(entry)}: unit = {', '.join(units)}: give millimeters or inches")
            scale, held_scale = (MM[one] for one in units)
            sizes = _sizes(geometry, scale)
            entry |= {FUSION[key]: size for key, size in sizes.items() if key in FUSION}
            if SHAPES[shape] != "bull":
                entry.pop("corner_radius", None)
            shaft = _as_table(tool.get("shaft")).get("segments")
            entry |= _neck(sizes, [_sizes(piece, scale) for piece in _as_list(shaft)])
            rows = _below_gauge_line(held, held_scale)
            entry |= {"holder": stack_as_text(rows)} if rows else {}
        yield entry


def _sizes(table: object, scale: float) -> dict[str, float]:
    """The numbers of a table, times `scale`, rounded to a nanometre: what is left of conversions from inches."""
    numbers = {key: value for key, value in _as_table(table).items() if isinstance(value, int | float)}
    return {key: round(value * scale, 6) for key, value in numbers.items() if abs(value) < LARGEST}


def _neck(sizes: Mapping[str, float], shaft: list[dict[str, float]]) -> Entry:
    """Neck and shank that hold what stands between flutes and holder of a tool of Fusion: its shoulder, of which
    `sizes` have the length from the tip and the diameter, and the pieces of a `shaft`, from the flutes up. Nothing
    where it states neither; mm."""
    if not {"DC", "LCF", "SFDM", "LB"} <= sizes.keys() or not (shaft or "shoulder-length" in sizes):
        return {}
    start = sizes["LCF"]
    pieces = [
        (one.get("height", 0.0), max(one.get("lower-diameter", 0.0), one.get("upper-diameter", 0.0)))
        for one in shaft
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
    for piece in _as_list(holder.get("segments")):
        sizes = _sizes(piece, scale)
        height, lower, upper = (sizes.get(key, 0.0) for key in ("height", "lower-diameter", "upper-diameter"))
        taken = min(height, left)
        if taken > 0:
            rows.append([taken, lower, round(lower + (upper - lower) * taken / height, 6)])
        left = round(left - taken, 6)
    return rows


def _freecad_library(path: Path) -> tuple[list[Entry], tuple[Path, ...]]:
    """The toolbits that a library of FreeCAD names, with their numbers: beside it, or in the folder Bit beside its
    own."""
    entries, files = list[Entry](), [path]
    for item in map(_as_table, _as_list(_json(input_bytes(path)).get("tools"))):
        name = str(item.get("path")).replace("\\", "/")
        places = [path.parent / name, path.parent.parent / "Bit" / Path(name).name]
        bit = next((place for place in places if place.is_file()), None)
        if bit is None:
            raise ValueError(f"names {name}, which is neither beside it nor in ../Bit: put it there")
        ((entry,), read) = _entries(bit)
        entries.append(entry | ({"number": item["nr"]} if isinstance(item.get("nr"), int) else {}))
        files += read
    return entries, tuple(files)


def _toolbit(path: Path) -> Entry:
    """A toolbit of FreeCAD."""
    bit = _json(input_bytes(path))
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
    """The tools of a table with a head line, columns apart by commas, semicolons or tabs; lengths in units of `scale`
    mm. Columns that no cutter has are passed over."""
    delimiter = max(",;\t", key=text.partition("\n")[0].count)
    reader = csv.reader(io.StringIO(text), delimiter=delimiter, strict=True)
    head = [re.sub(r"[\s-]+", "_", cell.strip().lower()) for cell in next(reader, [])]
    head = [COLUMNS.get(cell, cell) for cell in head]
    for row in reader:
        entry: Entry = {"shape": "ball"}
        for key, cell in zip(head, map(str.strip, row), strict=False):
            if cell and key in {*KEYS, "name", "diameter"}:
                try:
                    entry[key] = _cell(key, cell, delimiter, scale)
                except ValueError as error:
                    raise ValueError(f"line {reader.line_num}: {key} = {error}: correct it") from error
        if len(entry) > 1:
            yield entry


def _cell(key: str, cell: str, delimiter: str, scale: float) -> Any:
    """The value of a cell of a table."""
    kind = type(KEYS[key].default) if key in KEYS else float if key == "diameter" else str
    if kind is int:
        return whole_number(cell)
    if kind is float:
        value = number(cell if delimiter == "," else cell.replace(",", "."))
        return round(value * scale, 6) if key == "diameter" or record(KEYS[key]).unit == "mm" else value
    if key == "holder":
        rows = [[piece.length, piece.diameter, piece.top_diameter] for piece in stack_from_text(cell)]
        return stack_as_text([[round(size * scale, 6) for size in row] for row in rows])
    return cell.lower() if key == "shape" else cell
