"""The table of a batch (batch.csv): what came of each part, of earlier runs too."""

import csv
import io
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from bonecam.errors import FileError
from bonecam.runtime.staging import NAME_BYTES
from bonecam.setup.stock import stock_text

TABLE = "batch.csv"
"""The name of the table."""


@dataclass(frozen=True)
class Outcome:
    """What came of one part: state `done`, `kept` (from an earlier run, as its seconds are) or `failed` with its
    message.

    `name` is that of its results, `job` the job file that is its own. Largest distance of the surface from the mesh
    (`deviation_mm`), `stock`, machining time, and area of the part that keeps more than 0.02 mm away from the post
    (`left_mm2`); `warnings` are their codes, of a part that was refused the refusal's. What is not known, as of a part
    that failed, is 0 or empty.
    """

    name: str
    mesh: str
    job: str
    state: str
    program: str = ""
    second: str = ""
    levels: int = 0
    time_min: float = 0.0
    deviation_mm: float = 0.0
    stock: str = ""
    left_mm2: float = 0.0
    warnings: str = ""
    seconds: float = 0.0
    message: str = ""


COLUMNS = [item.name for item in fields(Outcome)]
"""The columns of batch.csv."""


def outcome_of(
    name: str, mesh: str, job: str, report: Mapping[str, Any], seconds: float, state: str = "done"
) -> Outcome:
    """The outcome of a part with its report."""
    left = report["removal"].get("left") or {}
    return Outcome(
        name=name,
        mesh=mesh,
        job=job,
        state=state,
        program=report["nc"]["file"],
        second=report.get("second", {}).get("file", ""),
        levels=len(report["levels"]) - 1,
        time_min=report["nc"]["time_min"],
        deviation_mm=report["surface"]["deviation_max_mm"],
        stock=stock_text(report["stock"]),
        left_mm2=left.get("area_over_0_02_mm2", 0.0),
        warnings=" ".join(warning["code"] for warning in report.get("warnings", ())),
        seconds=round(seconds, 2),
    )


def failed(name: str, mesh: str, job: str, seconds: float, message: str, code: str = "") -> Outcome:
    """The outcome of a part that has none; `code` is that of its refusal."""
    return Outcome(name, mesh, job, "failed", warnings=code, seconds=round(seconds, 2), message=message)


def read_rows(table: Path) -> dict[str, dict[str, Any]]:
    """The rows of an earlier run's table by name; none where there is no table. FileError where it is another file."""
    if not table.exists():
        return {}
    try:
        with open(table, encoding="utf-8", errors=NAME_BYTES, newline="") as file:
            reader = csv.DictReader(file, strict=True)
            rows = list(reader)
            ours = reader.fieldnames == COLUMNS and all(None not in {*row, *row.values()} for row in rows)
    except (OSError, ValueError, csv.Error) as error:
        raise FileError(f"{table}: cannot be read ({error}): move it away", file=str(table)) from error
    if not ours:
        raise FileError(f"{table}: is no table of a batch: move it away, or use another folder", file=str(table))
    return {row["name"]: dict(row) for row in rows}


def table_text(rows: Iterable[dict[str, Any]]) -> str:
    """The text of the table with these rows."""
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()
