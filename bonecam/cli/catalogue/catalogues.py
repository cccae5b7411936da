"""`bonecam machines | dialects | materials | tools`: what there is by name, one shown, or a file checked."""

import argparse
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bonecam.errors import JobError, did_you_mean
from bonecam.job.materials.preset import material_files, read_material
from bonecam.job.tool_section import read_tool, tool_files
from bonecam.machine.check import MachineCheck, check_machine
from bonecam.machine.machine import machine_files, read_machine
from bonecam.nc.dialect import dialect_files, read_dialect


@dataclass(frozen=True)
class Catalogue:
    """Things that are TOML files: where they are by name, and what reads one; that raises a BonecamError."""

    files: Callable[[], Mapping[str, Path]]
    read: Callable[[str], Any]
    one: str


CATALOGUES = {
    "machines": Catalogue(machine_files, check_machine, "machine"),
    "dialects": Catalogue(dialect_files, read_dialect, "dialect of a controller"),
    "materials": Catalogue(material_files, read_material, "material"),
    "tools": Catalogue(tool_files, read_tool, "cutter"),
}
"""By the name of the command."""


def add_catalogue(add_command: Any, parsers: Any, kind: str) -> None:
    """The command of a kind."""
    one = CATALOGUES[kind].one
    text = f"List the {kind} that are known by name, show one, or check a file."
    command = add_command(parsers, kind, text, run_catalogue)
    command.set_defaults(kind=kind)
    command.add_argument("what", metavar="NAME|check", nargs="?", help=f"a {one} to show, or check")
    command.add_argument("file", metavar="FILE", nargs="?", help="the .toml file to check")
    if kind == "machines":
        command.add_argument("--picture", metavar="PNG", help="draw the machine of NAME, or of the file")
    command.add_argument("--schema", action="store_true", help="print the JSON schema of such files")


def run_catalogue(options: argparse.Namespace) -> int:
    """List all names, show the file of one, check a file, or print the schema of such files."""
    known = CATALOGUES[options.kind]
    files = known.files()
    if options.schema:
        from bonecam.cli.catalogue.schemas import file_schema

        print(json.dumps(file_schema(options.kind), indent=2))
    elif options.what == "check":
        if options.file is None:
            raise JobError(f"bonecam {options.kind} check: name a .toml file")
        content = known.read(options.file)
        bodies = _body_lines(content) if isinstance(content, MachineCheck) else []
        print(f"{options.file}: a {known.one} as it should be")
        if isinstance(content, MachineCheck):
            print(content, *bodies, sep="\n")
        _draw(options, options.file)
    elif options.what is not None:
        if options.what not in files:
            close = did_you_mean(options.what, files)
            raise JobError(
                f"{options.what!r} is unknown{close}: use check FILE, or one of {', '.join(files)}"
            )
        print(files[options.what].read_text(encoding="utf-8"), end="")
        _draw(options, options.what)
    else:
        wide = max(map(len, files), default=0)
        print("".join(f"{name:{wide}}  {_about(path)}\n" for name, path in files.items()), end="")
    return 0


def _body_lines(check: MachineCheck) -> list[str]:
    """What moves with what; MachineError where a body cannot be."""
    from bonecam.planning.collision.link_bodies import body_texts

    return [f"{'' if k else 'bodies':10}{text}" for k, text in enumerate(body_texts(check.machine))]


def _draw(options: argparse.Namespace, name: str) -> None:
    """Draw the machine of a name or a file, where a picture is asked for."""
    if getattr(options, "picture", None):
        from bonecam.report import draw_machine_file

        draw_machine_file(read_machine(name), options.picture)
        print(f"drawn in {options.picture}")


def _about(path: Path) -> str:
    """The title or the first comment of a file, and its place where it does not ship."""
    text = path.read_text(encoding="utf-8")
    titles = [
        line.partition("=")[2].strip().strip('"') for line in text.splitlines() if line.startswith("title")
    ]
    about = (titles or [text.partition("\n")[0].lstrip("# ")])[0]
    ships = Path(__file__).parents[2] in path.parents
    return about if ships else f"{about} ({path})"
