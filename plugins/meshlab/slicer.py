"""`bonecam-slicer`: bonecam as a command-line module of 3D Slicer. Asked with `--xml` it describes itself; called with
`--section.name VALUE ... MESH PROGRAM` it makes the program, and tells its progress as Slicer reads it.
"""

import math
import sys
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from xml.etree import ElementTree
from xml.sax.saxutils import escape

import bonecam
from bonecam.cli.command import job_with
from bonecam.errors import BonecamError, JobError
from bonecam.job import Job
from bonecam.job.parameter import record
from bonecam.text.numbers import in_one_line


def main(arguments: Sequence[str] | None = None) -> int:
    """Describe the module, or make the program of the call; the exit code, 2 with one line on stderr where something
    is wrong."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if given == ["--xml"]:
        print(module_xml(), end="")
        return 0
    try:
        settings, files = [], []
        rest = iter(given)
        for word in rest:
            if word.startswith("--"):
                name, equals, value = word.removeprefix("--").partition("=")
                settings.append(f"{name}={value if equals else next(rest, '')}")
            else:
                files.append(Path(word))
        if len(files) != 2:
            raise JobError(f"{len(files)} files are named: give the mesh and the program")
        result = bonecam.convert(files[0], job_with(Job(), settings), program=files[1], progress=_tell)
    except BonecamError as error:
        print(f"bonecam: {in_one_line(str(error))}", file=sys.stderr)
        return 2
    print(result.summary)
    return 0


def _tell(fraction: float, message: str) -> None:
    """Progress as Slicer reads it from standard output."""
    text = escape(in_one_line(message))
    print(f"<filter-progress>{fraction:.3f}</filter-progress><filter-comment>{text}</filter-comment>", flush=True)


SLICER = {int: "integer", float: "double", str: "string"}
"""What a module of 3D Slicer calls the type of a parameter."""
SLICER_FILES = (
    ("geometry", ".stl", "mesh", "Bone", "The bone's surface, in mm.", "input", 0),
    ("file", ".h,.mpf,.nc,.ngc", "program", "Program", "File for the NC program.", "output", 1),
)
"""The files of the module: tag, endings, name, label, description, channel, place in the call."""


def module_xml() -> str:
    """The description of a command-line module of 3D Slicer: files first, then every section of the job as a group;
    parameters are `--section.name`."""
    root = ElementTree.Element("executable")
    for tag, text in (
        ("category", "Surface Models"),
        ("title", "bonecam: NC program of a bone"),
        ("description", "From a bone mesh to a verified five-axis NC program."),
        ("version", bonecam.__version__),
        ("license", "GPL-3.0-or-later"),
    ):
        ElementTree.SubElement(root, tag).text = text
    group = _group(root, "Files", "What is read and written.", advanced=False)
    for tag, endings, name, label, description, channel, index in SLICER_FILES:
        texts = {"name": name, "label": label, "description": description, "channel": channel}
        _texts(ElementTree.SubElement(group, tag, fileExtensions=endings), texts | {"index": str(index)})
    job = Job()
    for section in fields(job):
        values = getattr(job, section.name)
        described = (type(values).__doc__ or "").strip().partition("\n")[0]
        group = _group(root, section.name, described, advanced=True)
        for item in fields(values):
            known, value = record(item), getattr(values, item.name)
            choices = ("true", "false") if isinstance(value, bool) else known.choices
            element = ElementTree.SubElement(group, "string-enumeration" if choices else SLICER[type(value)])
            unit = f" [{known.unit}]" if known.unit else ""
            default = str(value).lower() if isinstance(value, bool) else str(value)
            names = {"name": f"{section.name}_{item.name}", "longflag": f"{section.name}.{item.name}"}
            about = {"label": known.label, "description": f"{known.tooltip}{unit}", "default": default}
            _texts(element, names | about)
            for choice in choices:
                ElementTree.SubElement(element, "element").text = choice
            if math.isfinite(known.low) and math.isfinite(known.high):
                limits = {"minimum": f"{known.low:g}", "maximum": f"{known.high:g}"}
                _texts(ElementTree.SubElement(element, "constraints"), limits)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _group(root: ElementTree.Element, label: str, description: str, *, advanced: bool) -> ElementTree.Element:
    group = ElementTree.SubElement(root, "parameters", {"advanced": "true"} if advanced else {})
    _texts(group, {"label": label, "description": description})
    return group


def _texts(element: ElementTree.Element, texts: dict[str, str]) -> None:
    """Elements of these names and texts below one."""
    for tag, text in texts.items():
        ElementTree.SubElement(element, tag).text = text
