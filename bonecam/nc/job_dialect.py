"""The dialect of a job: that of its controller, with the axes, work offset, coolant, block numbers and decimals
it asks for.

The texts of a dialect that name its first work offset are replaced in all of its file, so that what is written, what
is read back and what must be stated are of the offset that the job asks for.
"""

import json
import re

from bonecam.errors import MachineError
from bonecam.job import NcJob
from bonecam.job.nc_section import HOME
from bonecam.machine.machine import read_machine
from bonecam.nc.dialect import Dialect, read_dialect
from bonecam.nc.parts.grouping import is_split

FIRST_CODE = 53
"""Work offset n is the code of this and n: G54 is the first."""


USUAL = "heidenhain"
"""The controller of machines whose files name none."""


def controller_of(nc: NcJob) -> str:
    """The controller of the section [nc] of a job: the stated one, or the usual one of its machine."""
    return nc.controller or read_machine(nc.machine).controller or USUAL


def job_dialect(nc: NcJob) -> Dialect:
    """The dialect of the section [nc] of a job. MachineError where it has no such work offset, coolant or axes, or
    cannot leave its block numbers out."""
    try:
        dialect = read_dialect(controller_of(nc)).in_form(nc.axes)
    except MachineError as error:
        place = "" if nc.controller else f"{nc.machine}: "
        raise MachineError(f"{place}{error}", **error.evidence) from error
    if nc.work_offset != 1:
        dialect = _with_work_offset(dialect, nc.work_offset)
    changes: dict[str, object] = {}
    if nc.coolant and nc.coolant_kind != "flood":
        if nc.coolant_kind not in dialect.coolants:
            raise _refused(dialect, f"nc.coolant_kind = {nc.coolant_kind!r}", "add it to [coolants] of its file")
        changes["templates"] = dialect.templates.model_copy(update={"coolant_on": dialect.coolants[nc.coolant_kind]})
    for asked, missing, template in _asked(nc, dialect):
        if missing:
            raise _refused(dialect, asked, f"leave it out, or add {template} to its file")
    if is_split(nc) and dialect.calls is not None:
        changes["needs"] = [*dialect.needs, *dialect.calls.needs]
    if not nc.block_numbers:
        if dialect.grammar == "klartext":
            raise _refused(dialect, "nc.block_numbers = false", "leave it out, its blocks have numbers")
        changes["numbering"] = dialect.numbering.model_copy(update={"format": None})
    if nc.decimals:
        numbers = dialect.numbers
        fine = {"decimals": nc.decimals}
        lengths = numbers.length.model_copy(update=fine), numbers.angle.model_copy(update=fine)
        changes["numbers"] = numbers.model_copy(update={"length": lengths[0], "angle": lengths[1]})
    return dialect.model_copy(update=changes) if changes else dialect


def _asked(nc: NcJob, dialect: Dialect) -> list[tuple[str, bool, str]]:
    """What of a section [nc] needs words that a dialect may not have: as the job says it, whether they are missing
    though it is asked for, and what has them."""
    templates = dialect.templates
    parks = HOME if nc.park.strip() == HOME else "park"
    name = "split" if nc.split != "none" else "split_blocks"
    split = f"nc.{name} = {getattr(nc, name)!r}"
    return [
        (split, is_split(nc) and dialect.calls is None, "a table [calls]"),
        (split, is_split(nc) and not templates.restart, "a template restart"),
        (
            f"nc.optional_stop = {nc.optional_stop!r}",
            nc.optional_stop != "none" and not templates.optional_stop,
            "a template optional_stop",
        ),
        (f"nc.park = {nc.park!r}", bool(nc.park.strip()) and not getattr(templates, parks), f"a template {parks}"),
    ]


def _with_work_offset(dialect: Dialect, number: int) -> Dialect:
    """The dialect with another work offset than its first."""
    if number > dialect.work_offsets:
        most = f"give 1 to {dialect.work_offsets}" if dialect.work_offsets > 1 else "leave it out"
        raise _refused(dialect, f"nc.work_offset = {number}", most)
    text = json.dumps(dialect.model_dump(exclude={"name"}, exclude_unset=True))
    for first, form in dialect.work_offset.items():
        own = form.format(number=number, code=FIRST_CODE + number)
        text = re.sub(rf"(?<![A-Z0-9.]){re.escape(first)}(?![0-9.])", own, text)
    values = json.loads(text)
    return Dialect.model_validate({**values, "name": dialect.name})


def _refused(dialect: Dialect, what: str, remedy: str) -> MachineError:
    return MachineError(f"{what}: {dialect.name} has no such: {remedy}", dialect=dialect.name)
