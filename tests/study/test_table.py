"""The table of a comparison: every figure has a line, a failed strategy its reason."""

import csv
import io

from bonecam.study.comparison import LINES, table_csv, table_text
from bonecam.study.rows import Row

ROWS = [
    Row("bonecam", "", "done", "", {"length_m": 4.7, "air_share": None}),
    Row("rotary", "", "failed", "no axis, so"),
]


def test_a_failed_strategy_is_a_column_with_its_reason() -> None:
    text = table_text(ROWS).splitlines()
    assert text[0].split() == ["bonecam", "rotary"]
    assert text[1].split() == ["ended", "done", "failed"]
    assert text[2].split()[-2:] == ["4.7", "-"]
    assert text[-1] == "rotary failed: no axis, so"
    assert len(text) == 2 + len(LINES) + 1


def test_the_csv_has_a_row_a_strategy() -> None:
    first, second = csv.DictReader(io.StringIO(table_csv(ROWS)))
    assert first["length_m"] == "4.7"
    assert first["air_share"] == ""
    assert second == {"strategy": "rotary", "state": "failed", "reason": "no axis, so", "length_m": "", "air_share": ""}
