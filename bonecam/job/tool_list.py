"""Lists of cutters as other programs write them: Fusion, FreeCAD, LinuxCNC, and tables.

Each gives entries: what the file states of a tool, by the names of a cutter's section; lengths are turned into mm. What
a file does not state, or not as it should be, an entry lacks, and `bonecam.job.tool_list` asks for it.

A shaft of Fusion's becomes a neck and a shank that hold it: it is taken to begin at the flutes, and is shank from its
first piece on that is wider than the cutter.

Lists of cutters: the catalogue that ships, and a shop's own as it has it.

A list is a file of another program (`bonecam.job.tool_list`) or a TOML file; lengths are mm. Cutters with a ball
end are kept; other tools are left out and counted. What decides about a collision is never guessed:
where a file does not state it (`REQUIRED`), it is asked for. A TOML list completes another file:

    from = "tool.tbl"                # beside this file
    units = "mm"                     # of a table that states none
    only = [3, 7, "6 mm ball"]       # the tools that are used, by number or name; all without it
    holder = "60 10 19, 20 63"       # of the tools that state none, like every key above the first [[tool]]
    [holders]
    collet = "25 28, 40 50"          # stacks by name, for `holder`
    [[tool]]
    number = 3                       # which, by number, name or both; the other keys are its values
    overhang = 24

Without `from` its tools are its own; without [[tool]] too it is one cutter, of the file's name.
"""

import csv
import io
import json
import math
import re
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, replace
from fractions import Fraction
from itertools import takewhile
from pathlib import Path
from typing import Any

from bonecam.errors import JobError, did_you_mean
from bonecam.files import LARGEST_INPUT, input_bytes, input_text
from bonecam.job.parameter import record
from bonecam.job.tool_section import SIZES, ToolJob, misfit
from bonecam.machine.bodies import stack_as_text, stack_from_text
from bonecam.plugins import named_files
from bonecam.text.numbers import Faults, number, shown, whole_number
from bonecam.text.toml import parse_toml

FOREIGN = (".json", ".tools", ".fctl", ".fctb", ".tbl", ".csv")
"""How the names of these files end."""
KEYS = {item.name: item for item in fields(ToolJob) if item.name != "preset"}
"""What a list may state of a cutter, beside its `name`."""
BALLS = ("ball", "ball end mill", "ballend")
"""The end that is kept, by its names in bonecam, Fusion and FreeCAD."""
MM = {"mm": 1.0, "millimeters": 1.0, "inch": 25.4, "inches": 25.4, "in": 25.4, '"': 25.4}
"""Millimetres of the units that files name."""
FUSION = {"DC": "diameter", "LCF": "flute_length", "SFDM": "shank_diameter", "LB": "overhang"}
"""The keys of a tool's `geometry` in Fusion (those of ISO 13399; LB is the length below the holder)."""
FREECAD = {"Diameter": "diameter", "CuttingEdgeHeight": "flute_length", "ShankDiameter": "shank_diameter"}
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
            for item in _as_tables(_json(content).get("tools")):
                name = str(item.get("path")).replace("\\", "/")
                places = [path.parent / name, path.parent.parent / "Bit" / Path(name).name]
                bit = next((place for place in places if place.is_file()), None)
                if bit is None:
                    raise ValueError(f"names {name}, which is neither beside it nor in ../Bit: put it there")
                (entry,), read = foreign_entries(bit)
                found.append(entry | _whole(item.get("nr"), "number"))
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
    if shape not in BALLS or geometry.get("TA"):
        return entry | {"shape": shape if shape not in BALLS else f"tapered {shape}"}
    units = [str(tool.get("unit")), str(held.get("unit", tool.get("unit")))]
    if not MM.keys() >= set(units):
        raise ValueError(f"{called(entry)}: unit = {', '.join(units)}: give millimeters or inches")
    scale, held_scale = (MM[unit] for unit in units)
    sizes = _sizes(geometry, scale)
    entry |= {name: sizes[key] for key, name in FUSION.items() if key in sizes}
    shaft = _as_tables(_as_table(tool.get("shaft")).get("segments"))
    entry |= _neck(sizes, [_sizes(piece, scale) for piece in shaft])
    holder = []
    left = _sizes(held, held_scale).get("gaugeLength", math.inf)  # from the nose to the gauge line, else to the end
    for piece in _as_tables(held.get("segments")):
        size = _sizes(piece, held_scale)
        height, lower, upper = (size.get(key, 0.0) for key in ("height", "lower-diameter", "upper-diameter"))
        taken = min(height, left)
        if taken > 0:
            holder.append([taken, lower, round(lower + (upper - lower) * taken / height, 6)])
        left = round(left - taken, 6)
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


def _toolbit(path: Path, bit: Mapping[str, Any]) -> Entry:
    """A toolbit of FreeCAD."""
    sizes = _as_table(bit.get("parameter"))
    shape = str(bit.get("shape-type") or Path(str(bit.get("shape")).replace("\\", "/")).stem).lower()
    entry: Entry = {"shape": shape, "name": str(bit.get("name") or path.stem)}
    if shape in BALLS:
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


ENDINGS = (".toml", *FOREIGN)
"""How the names of the files of lists end; of two lists of one name the former counts."""
CATALOGUE = "catalogue"
"""The name of the list that ships."""
SHIPPED = Path(__file__).parents[1] / "tool" / "tools"
REQUIRED = ("number", "radius", "flute_length", "shank_diameter", "overhang", "holder")
"""What every tool states; where the shank is wider than the cutter, `neck_length` too (0: no neck)."""
HELD = frozenset({"holder", "holder_diameter", "holder_length"})
"""What states a holder: the first, or both others."""


@dataclass(frozen=True)
class ListedTool:
    """A cutter of a list, by the name that the list has for it; `stated` is what the list says, and the rest of `tool`
    has its defaults."""

    name: str
    tool: ToolJob
    stated: Mapping[str, Any] = field(default_factory=dict, compare=False)

    def in_section(self, section: ToolJob) -> ToolJob:
        """The cutter in a section of a job, with what that states of its use: number, flutes, speed, feed, scallop."""
        used = {key: getattr(section, key) for key in KEYS.keys() - SIZES}
        return replace(self.tool, preset=self.name, **{key: value for key, value in used.items() if value})


@dataclass(frozen=True)
class ToolList:
    """The cutters of a list, how many tools of which other kinds were left out, and the files that were read, its own
    first."""

    tools: tuple[ListedTool, ...]
    left_out: Counter[str]
    files: tuple[Path, ...]


def list_files() -> dict[str, Path]:
    """The files of the lists that ship, are the user's, or come with other packages, by name."""
    return named_files("toollists", SHIPPED, ENDINGS)


def user_cutters() -> dict[str, Path]:
    """The files of single cutters that are the user's, or come with other packages, by name."""
    return named_files("tools")


def known_lists(tools: str) -> list[ToolList]:
    """The list `tools` of a job; where it names none the user's own cutters, and the catalogue."""
    return [tool_list(file) for file in ([tools] if tools else [*map(str, user_cutters().values()), ""])]


def known_cutters(tools: str) -> list[ListedTool]:
    """The cutters of `known_lists` by the names that a preset has for them: of one name in two lists that of the first,
    of one name in a list by their numbers."""
    found: dict[str, ListedTool] = {}
    for one in known_lists(tools):
        names = Counter(listed.name for listed in one.tools)
        for listed in one.tools:
            called = listed.name if names[listed.name] == 1 else str(listed.tool.number)
            found.setdefault(called, replace(listed, name=called))
    return list(found.values())


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
    entries, files = _own_entries(path) if path.suffix == ".toml" else foreign_entries(path)
    left_out = Counter[str]()
    tools = list[ListedTool]()
    faults = list[tuple[str, str]]()
    for entry in entries:
        kind = str(entry.get("shape", "without a stated shape"))
        if kind not in BALLS:
            left_out[kind] += 1
            continue
        entry["shape"] = "ball"
        try:
            tool = ToolJob(**{key: value for key, value in entry.items() if key in KEYS})
            fault = _lack(entry, tool) or _misfit(tool)
        except JobError as error:
            fault = str(error)
        if fault:
            faults.append((called(entry), fault))
        else:
            tools.append(ListedTool(str(entry.get("name") or f"T{tool.number}"), tool, entry))
    own = path.suffix == ".toml"
    place = "there" if own else f'in its [[tool]] of a .toml file beside it that says from = "{path.name}"'
    if faults:
        first = "the first [[tool]]" if own else "the first"
        asked = any(fault.startswith(LACKS) for _, fault in faults)
        remedy = f": state it {place}, or above {first} for all that lack it" if asked else ""
        raise JobError(f"{path}: {Faults(faults)}{remedy}", file=str(path))
    if not tools:
        others = ", ".join(f"{count} {kind}" for kind, count in left_out.items()) or "no tool at all"
        what = f"has no ball end ({others})"
        raise JobError(f"{path}: {what}: state `shape` {place}, or give another list", file=str(path))
    return ToolList(tuple(tools), left_out, tuple(files))


LACKS = "states no "
"""How a fault begins that is something that a list does not state."""


def _lack(entry: Entry, tool: ToolJob) -> str:
    """What an entry does not state, in words, empty where it states all; `tool` has the defaults in its place."""
    asked = [key for key in REQUIRED if key != "holder" or not entry.keys() >= HELD - {"holder"}]
    if {"shank_diameter", "radius"} <= entry.keys() and tool.shank_diameter > 2 * tool.radius:
        asked.append("neck_length")
    lacking = [key for key in asked if entry.get(key) in (None, "")]
    return f"{LACKS}{', '.join(lacking)}" if lacking else ""


def _misfit(tool: ToolJob) -> str:
    """What does not fit in a cutter, with its bound (mm); empty where all does."""
    fault = misfit(tool, tool.holder_stack[0].diameter)
    if tool.flute_length < tool.radius:
        fault = "flute_length", f"give at least the ball's radius ({tool.radius:g} mm)"
    return f"{fault[0]} = {getattr(tool, fault[0]):g}: {fault[1]}" if fault else ""


def preset_values(preset: str, tools: str) -> Entry:
    """The values of the cutter that `preset` names: by name or number in the list `tools` of a job, by name among the
    user's own or in the catalogue, or by the path of a .toml file of one.

    What is not stated of it has its default, but the scallop, which is no property of a cutter: it is left out.
    JobError where there is no such cutter, or more than one.
    """
    if preset.endswith(".toml"):
        found = list(read_tool_list(preset))
    else:
        own = {name: str(file) for name, file in user_cutters().items()}
        lists = [read_tool_list(file) for file in [*filter(None, (tools, own.get(preset))), ""]]
        for one in lists:
            named = [listed for listed in one if listed.name == preset]
            found = named or [listed for listed in one if preset == str(listed.tool.number or "")]
            if found:
                break
        else:
            names = dict.fromkeys([*(listed.name for one in lists for listed in one), *own])
            known = f"use one of {', '.join(names)}, or the path of a .toml file"
            what = f"preset = {shown(preset)}{did_you_mean(preset, names)}: {known}"
            raise JobError(what, field="preset")
    if len(found) > 1:
        numbers = ", ".join(str(listed.tool.number) for listed in found)
        what = f"preset = {shown(preset)}: these are {len(found)} cutters"
        remedy = f"name the list in nc.tools, and here one by its number ({numbers})"
        raise JobError(f"{what}: {remedy}", field="preset")
    tool, stated = found[0].tool, found[0].stated
    return {key: getattr(tool, key) for key in KEYS if key != "scallop" or key in stated}


def _own_entries(path: Path) -> tuple[list[Entry], list[Path]]:
    """What a TOML list states of each of its tools, or of those of the file that it completes, and the files that were
    read; JobError names the file."""
    with naming(path):
        common = parse_toml(input_text(path))
        source, units, only = (common.pop(key, None) for key in ("from", "units", "only"))
        tools, holders = common.pop("tool", []), common.pop("holders", {})
        if not tools and source is None:
            tools, common = [{"name": path.stem, **common}], {}
        if not isinstance(tools, list) or not all(isinstance(table, dict) for table in [*tools, holders]):
            what = "write [[tool]] before the values of each tool, and [holders] before the holders by name"
            raise ValueError(what)
        _check_keys("", common)
        for table in tools:
            _check_keys(f"[[tool]] {called(table)}: ", table)
        if units not in (None, *MM):
            raise ValueError(f"units = {shown(units)}: give mm or inch")
        files = [path]
        if source is None:
            entries = tools
            common = {"number": 0, "neck_length": 0.0, "shape": "ball", **common}
        elif isinstance(source, str) and Path(source).suffix in FOREIGN:
            entries, read = foreign_entries(path.parent / source, MM.get(units))
            files += read
            for table in tools:
                _complete(entries, table, source)
        else:
            raise ValueError(f"from = {shown(source)}: give a file that ends in {', '.join(FOREIGN)}")
        if only is not None:
            wanted = only if isinstance(only, list) else [only]
            chosen = [entry for entry in entries if entry.get("number") in wanted or entry.get("name") in wanted]
            for item in wanted:
                if not any(item in (entry.get("number"), entry.get("name")) for entry in chosen):
                    raise ValueError(f"only: there is no tool {shown(item)}: use {_calls(entries)}")
            entries = chosen
        for entry in entries:
            taken = HELD if HELD & entry.keys() else frozenset()
            entry |= {key: value for key, value in common.items() if key not in taken | entry.keys()}
            if isinstance(entry.get("holder"), str):
                entry["holder"] = holders.get(entry["holder"], entry["holder"])
        return entries, files


def _check_keys(place: str, table: Mapping[str, Any]) -> None:
    """ValueError, which names the place, where a table has a key or a shape that no tool has."""
    known = sorted({*KEYS, "name", "source"})
    for key in table:
        if key not in known:
            what = f"{place}unknown key {shown(key)}{did_you_mean(key, known)}"
            raise ValueError(f"{what}: use one of {', '.join(known)}")
    if str(table.get("shape", "ball")) not in BALLS:
        raise ValueError(f"{place}shape = {shown(table['shape'])}: only balls cut: give ball, or leave the tool out")


def _complete(entries: list[Entry], values: Entry, source: str) -> None:
    """Give the entry of `source` that has the number or the name of `values`, and no other number or name, the values
    instead of its own; ValueError where there is none, or more than one."""
    which = [(key, values[key]) for key in ("number", "name") if key in values]
    if not which:
        raise ValueError(f"[[tool]]: give the number or the name that it has in {source}")
    matching = [
        one
        for one in entries
        if any(one.get(key) == value for key, value in which)
        and all(one.get(key) in (None, "", value) for key, value in which)
    ]
    told = f"[[tool]] {called(values)}: {source} has"
    if not matching:
        raise ValueError(f"{told} none: use {_calls(entries)}")
    if len(matching) > 1:
        raise ValueError(f"{told} {len(matching)}: give number and name")
    gone = [*HELD] * bool(HELD & values.keys()) + ["neck_diameter"] * (values.get("neck_length") == 0)
    for key in gone:
        matching[0].pop(key, None)
    matching[0].update(values)


def _calls(entries: list[Entry]) -> str:
    return ", ".join(dict.fromkeys(map(called, entries)))
