"""MeshLab's filter scripts (.mlx) as text: XML read with line numbers and written in one canonical form.

<!DOCTYPE FilterScript>
<FilterScript>
 <filter name="Generate Morph Levels">
  <Param name="roughing_depth" type="RichPercentage" value="0.5"/>
 </filter>
</FilterScript>

Values of MeshLab's own filters: from a script's <Param> to what pymeshlab takes, checked on a scratch mesh
before a run.
"""

import reprlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

import numpy as np
from bonecam_plugins.meshlab.guards import meshlab_refusals

from bonecam.errors import BonecamError, FileError, FilterError, file_error
from bonecam.files import input_bytes, write_whole
from bonecam.mesh.meshlab import meshlab

SHOWN_ONLY = ("tooltip", "description", "label")
"""Attributes that MeshLab adds for its dialogs; they say nothing about the value and are not kept."""
TAGS = ("FilterScript", "filter", "Param")
"""The elements of a script, each inside the one before."""
EXPECTED = (
    "a script begins with <FilterScript>",
    "a script holds <filter> elements",
    "a filter holds <Param> elements",
    "a <Param> holds nothing",
)
"""What stands at a depth."""


@dataclass(frozen=True)
class ScriptParameter:
    """One <Param>: its name, MeshLab's type and the attributes that hold the value; `line` 0 where it was not
    read."""

    name: str
    type: str
    attributes: Mapping[str, str]
    line: int = field(default=0, compare=False)


@dataclass(frozen=True)
class FilterCall:
    """One <filter>: the name as written (shown or Python's) and its parameters."""

    name: str
    parameters: tuple[ScriptParameter, ...] = ()
    line: int = field(default=0, compare=False)


def read_calls(path: str | Path) -> list[FilterCall]:
    """The filters of a script. FileError names a missing or malformed file, FilterError an element that is
    none of a script's, by line."""
    try:
        data = input_bytes(path)
    except OSError as error:
        raise file_error(path, f"{error.strerror}", "give a readable .mlx script") from error
    calls: list[FilterCall] = []
    parameters: list[ScriptParameter] = []
    inside: list[str] = []
    began = ("", 0)
    parser = expat.ParserCreate()

    def fault(what: str, kind: type[BonecamError] = FilterError) -> BonecamError:
        line = parser.CurrentLineNumber
        return kind(f"{path}, line {line}: {what}", line=line, file=str(path))

    def begin(tag: str, attributes: dict[str, str]) -> None:
        nonlocal began
        depth = len(inside)
        if depth >= len(TAGS) or tag != TAGS[depth]:
            place = f"inside <{inside[-1]}>" if inside else "at the top"
            raise fault(f"<{tag}> {place}: {EXPECTED[depth]}")
        inside.append(tag)
        if depth == 0:
            return
        if not attributes.get("name") or (tag == "Param" and not attributes.get("type")):
            raise fault(f"<{tag}> without its name or type: add it")
        if tag == "filter":
            began = attributes["name"], parser.CurrentLineNumber
            parameters.clear()
        else:
            kept = {key: value for key, value in attributes.items() if key not in ("name", "type", *SHOWN_ONLY)}
            line = parser.CurrentLineNumber
            parameters.append(ScriptParameter(attributes["name"], attributes["type"], kept, line))

    def end(tag: str) -> None:
        inside.pop()
        if tag == "filter":
            calls.append(FilterCall(began[0], tuple(parameters), began[1]))

    def refuse_entity(name: str, *_: object) -> None:
        raise fault(f"entity {name!r}: write the text itself", FileError)

    parser.StartElementHandler = begin
    parser.EndElementHandler = end
    parser.EntityDeclHandler = refuse_entity
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        reason = expat.errors.messages[error.code]
        raise FileError(
            f"{path}, line {error.lineno}: {reason}: mend the XML there", file=str(path), line=error.lineno
        ) from error
    except (LookupError, ValueError) as error:  # of an encoding that Python has, but not for XML
        reason = f"its encoding cannot be read ({error})"
        raise file_error(path, reason, "write the script in UTF-8") from error
    return calls


def write_script(calls: Sequence[FilterCall], path: str | Path) -> None:
    """Write filters as a script: `read_calls` gives equal calls back. FileError where it cannot be
    written."""
    write_whole(path, script_text(calls))


def script_text(calls: Sequence[FilterCall]) -> str:
    """The text of a script, attributes in alphabetical order after name and type."""
    lines = ["<!DOCTYPE FilterScript>", "<FilterScript>"]
    for call in calls:
        if not call.parameters:
            lines.append(f" <filter name={_quoted(call.name)}/>")
            continue
        lines.append(f" <filter name={_quoted(call.name)}>")
        for item in call.parameters:
            rest = "".join(f" {key}={_quoted(value)}" for key, value in sorted(item.attributes.items()))
            lines.append(f"  <Param name={_quoted(item.name)} type={_quoted(item.type)}{rest}/>")
        lines.append(" </filter>")
    return "\n".join([*lines, "</FilterScript>", ""])


def _quoted(text: str) -> str:
    return quoteattr(text, {"\n": "&#10;", "\t": "&#9;", "\r": "&#13;"})


CAMERAS = frozenset({"set_camera_per_mesh", "set_camera_per_raster", "raster_alignment_mutual_information"})
"""MeshLab's filters with a parameter of a type that pymeshlab does not know; asked for it, it calls exit()
(measured, pymeshlab 2025.7)."""
FULL = "wanted more memory than it may have: give it less to do, or a script more with --memory-limit"
"""What is told of a filter for which MeshLab found no memory."""
OTHER_TYPE = "it is of another type"
"""Why a value is refused that pybind11 cannot hand to MeshLab."""
Attributes = Mapping[str, str]


def checked_value(filter_name: str, item: ScriptParameter) -> tuple[str, Any]:
    """pymeshlab's parameter name and value. FilterError names an unknown parameter or a value that MeshLab
    refuses."""
    known = parameters(filter_name)
    name = known.get(_plain(item.name))
    if name is None:
        hint = ", ".join(sorted(known.values())) or "none"
        raise FilterError(f"{filter_name} knows no parameter {item.name!r}: use one of {hint}", parameter=item.name)
    value = converted(item)
    reason = refusal(filter_name, name, value)
    if reason:
        message = f"parameter {name} = {_shown(item)} ({item.type}): {reason}: mend the value or its type"
        raise FilterError(message, parameter=item.name)
    return name, value


def refusal(filter_name: str, name: str, value: Any) -> str:
    """Why one of MeshLab's filters does not take a value of a parameter, in one line; "" where it does."""
    try:
        _scratch().filter_parameter_values(filter_name, **{name: value})
    except meshlab_refusals() as error:
        return OTHER_TYPE if _is_of_other_type(error) else _in_one_line(error)
    return ""


@contextmanager
def refusals_told(filter_name: str, values: Mapping[str, Any]) -> Iterator[None]:
    """What pymeshlab raises of one of MeshLab's filters with these values is told as FilterError."""
    try:
        yield
    except meshlab_refusals() as error:
        raise FilterError(f"{filter_name}: {_failure(filter_name, values, error)}", filter=filter_name) from error


def _failure(filter_name: str, values: Mapping[str, Any], error: Exception) -> str:
    """Why one of MeshLab's filters failed, in one line: MeshLab's words, but for too little memory and for a value of
    a type that it does not take."""
    words = _in_one_line(error)
    if "bad_alloc" in words:
        return FULL
    if not _is_of_other_type(error) or filter_name in CAMERAS:
        return words
    defaults = _scratch().filter_parameter_values(filter_name)
    wrong = (name for name in values if refusal(filter_name, name, values[name]) == OTHER_TYPE)
    reported = (
        f"parameter {name} = {reprlib.repr(values[name])}: give a value of type {type(defaults[name]).__name__}"
        for name in wrong
    )
    return next(reported, words)


def _is_of_other_type(error: Exception) -> bool:
    """Whether pybind11 could not hand a value to MeshLab; of None it says so with a TypeError."""
    return isinstance(error, TypeError) or "Unable to cast" in str(error)


def _in_one_line(error: Exception) -> str:
    return " ".join(str(error).split()).rstrip(" ;")


@cache
def parameters(filter_name: str) -> dict[str, str]:
    """pymeshlab's parameter names of one of MeshLab's filters (none of CAMERAS), by their plain letters."""
    return {_plain(name): name for name in _scratch().filter_parameter_values(filter_name)}


@cache
def free_texts(filter_name: str) -> dict[str, str]:
    """The defaults of those parameters of one of MeshLab's filters that take any text: a formula, a name or a
    file, not a choice."""
    defaults = _scratch().filter_parameter_values(filter_name)
    texts = {name: value for name, value in defaults.items() if isinstance(value, str)}
    return {name: value for name, value in texts.items() if not refusal(filter_name, name, "no choice")}


def _plain(name: str) -> str:
    """Letters and digits only: scripts write `TargetLen` and `lambda` where pymeshlab has `targetlen` and
    `lambda_`."""
    return "".join(letter for letter in name.lower() if letter.isalnum())


def converted(item: ScriptParameter) -> Any:
    """The value of a <Param> by its type. FilterError names a type that is unknown here and a value that is
    malformed."""
    if item.type not in _READERS:
        raise FilterError(
            f"parameter {item.name}: type {item.type!r} is unknown: use one of {', '.join(sorted(_READERS))}",
            parameter=item.name,
        )
    try:
        return _READERS[item.type](item.attributes)
    except (KeyError, ValueError) as error:
        message = f"parameter {item.name} = {_shown(item)}: no {item.type}: write the value as MeshLab does"
        raise FilterError(message, parameter=item.name) from error


@cache
def _scratch() -> Any:
    """A cube with every attribute that filters ask for before they tell their parameters."""
    meshset = meshlab().MeshSet()
    meshset.create_cube()
    meshset.compute_scalar_by_function_per_face(q="0")
    meshset.compute_scalar_by_function_per_vertex(q="0")
    return meshset


def _bool(text: Attributes) -> bool:
    return {"true": True, "false": False, "1": True, "0": False}[text["value"].strip().lower()]


def _choice(text: Attributes) -> int | str:
    value = text["value"]
    return int(value) if value.strip().lstrip("-").isdigit() else value


def _finite(text: str) -> float:
    value = float(text)
    if not np.isfinite(value):
        raise ValueError(text)
    return value


def _length(text: Attributes) -> Any:
    value = text["value"].strip()
    if value.endswith("%"):
        percent = _finite(value[:-1])
        if not 0 <= percent <= 100:
            raise ValueError(value)
        return meshlab().PercentageValue(percent)
    return meshlab().PureValue(_finite(value))


def _color(text: Attributes) -> Any:
    parts = [int(text[key]) for key in "rgb"] + [int(text.get("a", "255"))]
    if not all(0 <= value <= 255 for value in parts):
        raise ValueError(str(parts))
    return meshlab().Color(*parts)


def _shown(item: ScriptParameter) -> str:
    return repr(item.attributes["value"]) if "value" in item.attributes else repr(dict(sorted(item.attributes.items())))


_READERS: dict[str, Callable[[Attributes], Any]] = {
    "RichBool": _bool,
    **dict.fromkeys(("RichInt", "RichMesh"), lambda text: int(text["value"])),
    "RichEnum": _choice,
    **dict.fromkeys(("RichFloat", "RichDynamicFloat"), lambda text: _finite(text["value"])),
    **dict.fromkeys(("RichAbsPerc", "RichPercentage"), _length),
    **dict.fromkeys(
        ("RichString", "RichOpenFile", "RichSaveFile", "RichFileOpen", "RichFileSave"), lambda text: text["value"]
    ),
    "RichColor": _color,
    **dict.fromkeys(
        ("RichPoint3f", "RichPosition", "RichDirection"), lambda text: np.array([_finite(text[key]) for key in "xyz"])
    ),
    "RichMatrix44f": lambda text: np.array([_finite(text[f"val{index}"]) for index in range(16)]).reshape(4, 4),
}
