"""MeshLab's filter scripts (.mlx) as text: XML read with line numbers and written in one canonical form.

<!DOCTYPE FilterScript>
<FilterScript>
 <filter name="Generate Morph Levels">
  <Param name="roughing_depth" type="RichPercentage" value="0.5"/>
 </filter>
</FilterScript>
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

from bonecam.errors import FileError, FilterError
from bonecam.files import input_bytes, write_whole

SHOWN_ONLY = ("tooltip", "description", "label")
"""Attributes that MeshLab adds for its dialogs; they say nothing about the value and are not kept."""


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
        raise FileError(f"{path}: {error.strerror}: give a readable .mlx script", file=str(path)) from error
    return _Reader(str(path)).read(data)


class _Reader:
    """Collects filters while expat walks the file."""

    def __init__(self, path: str) -> None:
        self._path = path
        self._calls: list[FilterCall] = []
        self._parameters: list[ScriptParameter] = []
        self._open: list[str] = []
        self._start = ("", 0)
        self._parser = expat.ParserCreate()
        self._parser.StartElementHandler = self._begin
        self._parser.EndElementHandler = self._end
        self._parser.EntityDeclHandler = self._refuse_entity

    def read(self, data: bytes) -> list[FilterCall]:
        try:
            self._parser.Parse(data, True)
        except expat.ExpatError as error:
            reason = expat.errors.messages[error.code]
            raise FileError(
                f"{self._path}, line {error.lineno}: {reason}: mend the XML there", file=self._path, line=error.lineno
            ) from error
        except (LookupError, ValueError) as error:  # of an encoding that Python has, but not for XML
            reason = f"its encoding cannot be read ({error})"
            raise FileError(f"{self._path}: {reason}: write the script in UTF-8", file=self._path) from error
        return self._calls

    def _begin(self, tag: str, attributes: dict[str, str]) -> None:
        line = self._parser.CurrentLineNumber
        wanted = ("FilterScript", "filter", "Param")
        depth = len(self._open)
        if depth >= len(wanted) or tag != wanted[depth]:
            place = f"inside <{self._open[-1]}>" if self._open else "at the top"
            raise FilterError(
                f"{self._path}, line {line}: <{tag}> {place}: {self._expected(depth)}", line=line, file=self._path
            )
        self._open.append(tag)
        if depth == 0:
            return
        if not attributes.get("name") or (tag == "Param" and not attributes.get("type")):
            raise FilterError(
                f"{self._path}, line {line}: <{tag}> without its name or type: add it", line=line, file=self._path
            )
        if tag == "filter":
            self._start = (attributes["name"], line)
            self._parameters = []
        else:
            kept = {key: value for key, value in attributes.items() if key not in ("name", "type", *SHOWN_ONLY)}
            self._parameters.append(ScriptParameter(attributes["name"], attributes["type"], kept, line))

    @staticmethod
    def _expected(depth: int) -> str:
        known = (
            "a script begins with <FilterScript>",
            "a script holds <filter> elements",
            "a filter holds <Param> elements",
        )
        return known[depth] if depth < len(known) else "a <Param> holds nothing"

    def _end(self, tag: str) -> None:
        self._open.pop()
        if tag == "filter":
            self._calls.append(FilterCall(self._start[0], tuple(self._parameters), self._start[1]))

    def _refuse_entity(self, name: str, *_: object) -> None:
        line = self._parser.CurrentLineNumber
        raise FileError(
            f"{self._path}, line {line}: entity {name!r}: write the text itself", file=self._path, line=line
        )


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
