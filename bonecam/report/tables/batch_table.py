"""The table of a batch (batch.csv): what came of each mesh, of earlier runs too."""

import csv
import io
from collections.abc import Iterable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from bonecam.errors import FileError
from bonecam.files import NAME_BYTES


@dataclass(frozen=True)
class Outcome:
    """What came of one mesh: state `done`, `kept` (from an earlier run, as its seconds are) or `failed` with
    its message."""

    mesh: str
    state: str
    program: str
    levels: int
    time_min: float
    seconds: float
    message: str


COLUMNS = [item.name for item in fields(Outcome)]
"""The columns of batch.csv."""


def read_rows(table: Path) -> dict[str, dict[str, Any]]:
    """The rows of an earlier run's table by mesh; none where there is no table. FileError where it is another file."""
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
        raise FileError(
            f"{table}: is no table of a batch: move it away, or use another folder", file=str(table)
        )
    return {row["mesh"]: dict(row) for row in rows}


def table_text(rows: Iterable[dict[str, Any]]) -> str:
    """The text of the table with these rows."""
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()
