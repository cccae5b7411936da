"""`bonecam machines | dialects | materials | tools`: what there is by name, one shown, or a file checked."""

import argparse
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from bonecam.errors import JobError, did_you_mean
from bonecam.job.materials.preset import material_files, read_material
from bonecam.job.tool_list import KEYS, ToolList, known_lists, list_files, tool_list
from bonecam.job.tool_section import ToolJob
from bonecam.machine.check import MachineCheck, check_machine
from bonecam.machine.machine import machine_files, read_machine
from bonecam.nc.dialect import dialect_files, read_dialect
from bonecam.text.toml import toml_lines

CATALOGUES: dict[str, tuple[Callable[[], Mapping[str, Path]], Callable[[str], Any], str]] = {
    "machines": (machine_files, check_machine, "machine"),
    "dialects": (dialect_files, read_dialect, "dialect of a controller"),
    "materials": (material_files, read_material, "material"),
    "tools": (list_files, tool_list, "list of cutters"),
}
"""By the name of the command, of things that are TOML files: what lists these by name, what reads one and raises a
BonecamError, and what one is called."""


def run_catalogue(kind: str, options: argparse.Namespace) -> int:
    """List all names, show the file of one, check a file, or print the schema of such files."""
    files, read, one = CATALOGUES[kind]
    lists = known_lists(options.tools or "") if kind == "tools" else []
    if lists:
        entries = _cutters(lists, options.what)
    else:
        entries = {name: (_about(path), path.read_text(encoding="utf-8")) for name, path in files().items()}
    if options.schema:
        from bonecam.cli.schemas import file_schema

        print(json.dumps(file_schema(kind), indent=2))
    elif options.what == "check":
        if options.file is None:
            raise JobError(f"bonecam {kind} check: name a file")
        content = read(options.file)
        lines = [f"{options.file}: a {one} as it should be"]
        if isinstance(content, MachineCheck):
            from bonecam.planning.collision import body_texts

            bodies = body_texts(content.machine)  # a MachineError where a body cannot be
            lines += [str(content), *(f"{'' if k else 'bodies':10}{text}" for k, text in enumerate(bodies))]
        print(*lines, sep="\n")
        _draw(options, options.file)
    elif options.what is not None:
        if options.what not in entries:
            close = did_you_mean(options.what, entries)
            raise JobError(f"{options.what!r} is unknown{close}: use check FILE, or one of {', '.join(entries)}")
        print(entries[options.what][1], end="")
        _draw(options, options.what)
    else:
        wide = max(map(len, entries), default=0)
        print("".join(f"{name:{wide}}  {about}\n" for name, (about, _) in entries.items()), end="")
        for left, count in (lists[0].left_out if lists else {}).items():
            print(f"left out: {count} {left}")
    return 0


def _cutters(lists: Sequence[ToolList], asked: str | None) -> dict[str, tuple[str, str]]:
    """What the cutters of lists are, and the text of a file of each, by name, or by number where that is `asked` for or
    the name is taken; left out where it has none."""
    entries = dict[str, tuple[str, str]]()
    for one in lists:
        for listed in one.tools:
            tool, stated = listed.tool, listed.stated
            place = "" if tool.number or _ships(one.files[0]) else f" ({one.files[0]})"
            about = f"{f'tool {tool.number}: ' if tool.number else ''}{described(tool)}{place}"
            lines = toml_lines({key: getattr(tool, key) for key in KEYS if key in stated})
            source = [f"# {stated['source']}"] if "source" in stated else []
            text = "\n".join([f"# {listed.name}: {about}", *source, *lines, ""])
            number = str(tool.number or listed.name)
            by_number = listed.name in entries or asked == number
            entries.setdefault(number if by_number else listed.name, (about, text))
    return entries


def described(tool: ToolJob) -> str:
    """A cutter in a line; mm."""
    neck = f"neck {tool.neck_diameter:g} up to {tool.neck_length:g}, " if tool.neck_length else ""
    held = f"{tool.overhang:g} out of a holder of {tool.holder_stack[0].diameter:g}"
    flutes = f"ball of {2 * tool.radius:g} mm, flutes of {tool.flute_length:g}"
    return f"{flutes}, {neck}shank {tool.shank_diameter:g}, {held}"


def _ships(path: Path) -> bool:
    return Path(__file__).parents[2] in path.parents


def _draw(options: argparse.Namespace, name: str) -> None:
    """Draw the machine of a name or a file, where a picture is asked for."""
    if getattr(options, "picture", None):
        from bonecam.report import draw_machine_file

        draw_machine_file(read_machine(name), options.picture)
        print(f"drawn in {options.picture}")


def _about(path: Path) -> str:
    """The title or the first comment of a file, and its place where it does not ship."""
    text = path.read_text(encoding="utf-8")
    titles = [line.partition("=")[2].strip().strip('"') for line in text.splitlines() if line.startswith("title")]
    about = (titles or [text.partition("\n")[0].lstrip("# ")])[0]
    return about if _ships(path) else f"{about} ({path})"
