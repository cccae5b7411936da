"""The errors bonecam raises, each carrying the evidence needed to look at the trouble.

A wrong *call* raises ValueError or TypeError. A wrong bone, job, machine or file raises a
subclass of BonecamError: its message is one line that names the place and the remedy, and its
`evidence` holds the data (face ids, level number, contact indices, axis, ...).
"""

import difflib
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any


class BonecamError(Exception):
    """What went wrong, where (`evidence`), in one line that ends with the remedy."""

    def __init__(self, message: str, **evidence: Any) -> None:
        super().__init__(message)
        self.evidence = evidence

    def __reduce__(self) -> tuple[Any, ...]:
        return _restore, (type(self), str(self), self.evidence)


@contextmanager
def knowing(sections: Mapping[str, Any], part: str = "") -> Iterator[None]:
    """A BonecamError of the block knows these `sections` of the run's report (its evidence `report`) beside those that
    it knows itself, which are sections of the `part` of the report, if one is named."""
    try:
        yield
    except BonecamError as error:
        own = error.evidence.get("report", {})
        error.evidence["report"] = {**sections, **({part: own} if part and own else own)}
        raise


def place_name(place: Iterable[float]) -> str:
    """A place (mm) as messages name it, like (1.50, -0.20, 43.00)."""
    return "({:z.2f}, {:z.2f}, {:z.2f})".format(*place)


def hundredths(size: float) -> str:
    """A size in mm as remedies name it, rounded up to hundredths."""
    return f"{math.ceil(round(100 * size, 6)) / 100:.2f}"


def counted(number: int, noun: str) -> str:
    """A number with its noun as messages have it, like 1 hole, 3 holes, 2 vertices."""
    return (
        f"{number} "
        f"{noun if number == 1 else noun.removesuffix('ex') + 'ices' if noun.endswith('vertex') else noun + 's'}"
    )


SHORT = 2
"""Words of so many letters, such as units, are close to anything."""


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """A remark on an unknown word, such as " (did you mean 'levels'?)", where a known one is close or begins with
    it, else nothing.

    Of known names the shortest that holds all words of a given one, if these are two or more, comes first.
    """
    names = sorted(known)
    words = _words(word)
    holding = [name for name in names if len(words) > 1 and words <= _words(name)]
    if holding:
        return f" (did you mean {min(holding, key=len)!r}?)"
    if len(word) <= SHORT:
        return ""
    close = difflib.get_close_matches(word, names, n=1) or [name for name in names if name.startswith(word)]
    return f" (did you mean {close[0]!r}?)" if close else ""


def _words(name: str) -> set[str]:
    return set(re.findall(r"[a-z0-9]+", name.lower()))


def require_type(value: object, kind: type, name: str, wanted: str) -> None:
    """TypeError where a call's argument `name` is of another kind; `wanted` says what to give."""
    if not isinstance(value, kind):
        raise TypeError(f"{name} is a {type(value).__name__}: give a {wanted}")


def _restore(kind: type[BonecamError], message: str, evidence: dict[str, Any]) -> BonecamError:
    return kind(message, **evidence)


class FileError(BonecamError):
    """A file cannot be read or written: `file`, and `line` or `record` where there is one."""


def file_error(file: object, what: str, remedy: str, **evidence: Any) -> FileError:
    """The FileError of a `file`: what it is or holds, and what to do."""
    return FileError(f"{file}: {what}: {remedy}", file=str(file), **evidence)


class UnitsError(BonecamError):
    """The size of the mesh is implausible in the stated unit."""


class MeshError(BonecamError):
    """The mesh cannot be made into one closed genus-0 part."""


class JobError(BonecamError):
    """A job file or parameter is unknown, out of range or of the wrong type."""


class SurfaceError(BonecamError):
    """The T-spline cannot be built, read or fitted."""


class StockError(BonecamError):
    """The stock does not hold the part: `distance` in mm and `place` (3,)."""


class LevelError(BonecamError):
    """A morph level cannot be solved or failed its check: `level`, `place`."""


class ToolPathError(BonecamError):
    """A level cannot be covered by the cutter."""


class OrientationError(BonecamError):
    """No collision-free tool axis exists where one is needed."""


class MachineError(BonecamError):
    """A machine or dialect is unknown, or the part leaves the machine's travel."""


class ProgramError(BonecamError):
    """An NC text cannot be written or read: `line`."""


class VerifyError(BonecamError):
    """The posted program was read back and is wrong: `line`, `place`, `error`."""


class BodiesError(VerifyError):
    """A body of the machine's links meets the tool, another body, table or stock: paths are planned round nose and
    table alone."""


class BendingError(VerifyError):
    """The part, its neck or the cutter gives way more under the cut than the job allows: no fault of the program, but
    of what holds the part."""


class LimitError(BonecamError):
    """A figure of the run is beyond the second limit of [warnings]: the job is refused unless it says otherwise."""


class FilterError(BonecamError):
    """A filter, its parameter or a script line is unknown or wrong: `line`."""


class Cancelled(BonecamError):
    """The progress callback returned False."""
