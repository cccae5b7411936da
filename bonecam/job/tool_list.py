"""Lists of cutters: the catalogue that ships, and a shop's own as it has it.

A list is a file of another program (`bonecam.job.tool_formats`) or a TOML file; lengths are mm. Cutters with a ball, a
bull nose or a flat end are kept; other tools are left out and counted. What decides about a collision is never guessed:
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

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from bonecam.errors import JobError, did_you_mean
from bonecam.files import input_text
from bonecam.job.tool_formats import FOREIGN, KEYS, MM, SHAPES, Entry, called, foreign_entries, naming
from bonecam.job.tool_section import SIZES, ToolJob, misfit
from bonecam.runtime.extensions import named_files
from bonecam.text.numbers import Faults, shown
from bonecam.text.toml import parse_toml

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
        if kind not in SHAPES:
            left_out[kind] += 1
            continue
        entry["shape"] = SHAPES[kind]
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
        what = f"has no ball, bull nose or flat end ({others})"
        raise JobError(f"{path}: {what}: state `shape` {place}, or give another list", file=str(path))
    return ToolList(tuple(tools), left_out, tuple(files))


LACKS = "states no "
"""How a fault begins that is something that a list does not state."""


def _lack(entry: Entry, tool: ToolJob) -> str:
    """What an entry does not state, in words, empty where it states all; `tool` has the defaults in its place."""
    asked = [key for key in REQUIRED if key != "holder" or not entry.keys() >= HELD - {"holder"}]
    if {"shank_diameter", "radius"} <= entry.keys() and tool.shank_diameter > 2 * tool.radius:
        asked.append("neck_length")
    if tool.shape == "bull":
        asked.append("corner_radius")
    lacking = [key for key in asked if entry.get(key) in (None, "")]
    return f"{LACKS}{', '.join(lacking)}" if lacking else ""


def _misfit(tool: ToolJob) -> str:
    """What does not fit in a cutter, with its bound (mm); empty where all does."""
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
        found = list(read_tool_list(preset))
    else:
        own = {name: str(file) for name, file in user_cutters().items()}
        lists = [read_tool_list(file) for file in [*filter(None, (tools, own.get(preset))), ""]]
        found = next(filter(None, (_of_name(preset, one) for one in lists)), [])
        if not found:
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


def _of_name(name: str, tools: tuple[ListedTool, ...]) -> list[ListedTool]:
    """The cutters of a name, else those of a number."""
    named = [listed for listed in tools if listed.name == name]
    return named or [listed for listed in tools if name == str(listed.tool.number or "")]


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
            entries = _chosen(entries, only if isinstance(only, list) else [only])
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
    if str(table.get("shape", "ball")) not in SHAPES:
        raise ValueError(f"{place}shape = {shown(table['shape'])}: choose one of ball, bull, flat")


def _chosen(entries: list[Entry], wanted: list[Any]) -> list[Entry]:
    """The entries of which a number or a name is wanted; ValueError where one that is wanted is of none."""
    chosen = [entry for entry in entries if entry.get("number") in wanted or entry.get("name") in wanted]
    for item in wanted:
        if not any(item in (entry.get("number"), entry.get("name")) for entry in chosen):
            raise ValueError(f"only: there is no tool {shown(item)}: use {_calls(entries)}")
    return chosen


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
