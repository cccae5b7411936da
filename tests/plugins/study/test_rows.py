"""Claims of the paper beside rows whose answer is known.

The table of a comparison: every figure has a line, a failed strategy its reason.
"""

import csv
import io

import pytest
from bonecam_plugins.study.comparison import LINES, table_csv, table_text
from bonecam_plugins.study.rows import CONTRADICTED, OPEN, SUPPORTED, Row, claims_of


def row(name: str, **figures: float) -> Row:
    return Row(name, name, "done", "", dict(figures))


def verdicts(rows: list[Row], text: str) -> dict[str, str]:
    return {claim.of: claim.verdict for claim in claims_of(rows) if text in claim.text}


@pytest.mark.parametrize(
    ("morph", "rotary", "verdict"),
    [(0.5, 0.8, SUPPORTED), (0.8, 0.5, CONTRADICTED), (0.78, 0.8, OPEN), (0.8, None, OPEN)],
)
def test_even_force_is_judged_by_both_cutters_beside_both_others(morph, rotary, verdict):
    other = {"force_roughing_ripple": 0.9, "force_finishing_ripple": 0.9}
    last = {"force_roughing_ripple": 0.9, "force_finishing_ripple": rotary}
    rows = [
        row("bonecam", force_roughing_ripple=morph, force_finishing_ripple=morph),
        row("iso-height", **other),
        Row("rotary", "rotary", "done", "", last),
    ]
    found = verdicts(rows, "force remains stable")
    assert found == {"published": OPEN, "bonecam": verdict}


@pytest.mark.parametrize(("share", "verdict"), [(1.0, SUPPORTED), (0.99, CONTRADICTED)])
def test_one_point_beyond_the_band_contradicts(share, verdict):
    probe = {"probe_min_mm": -0.01, "probe_max_mm": 0.04, "probe_within_0_05_share": share}
    assert verdicts([row("bonecam", **probe)], "0.05 mm")["bonecam"] == verdict


def test_a_second_side_that_bends_more_is_found():
    sides = row("iso-height", bend_before_last_p95_um=10.0, bend_last_p95_um=15.0)
    assert verdicts([sides], "second side") == {"iso-height": SUPPORTED}
    other = row("iso-height", bend_before_last_p95_um=15.0, bend_last_p95_um=10.0)
    assert verdicts([other], "second side") == {"iso-height": CONTRADICTED}


def test_an_end_is_uncut_where_the_highest_rest_is_there_and_higher_than_a_morphs():
    morph = row("bonecam", left_max_mm=0.1)
    for place, most, verdict in ((0.97, 2.0, SUPPORTED), (0.5, 2.0, CONTRADICTED), (0.97, 0.1, CONTRADICTED)):
        rows = [morph, row("rotary", left_highest_at=place, left_max_mm=most)]
        assert verdicts(rows, "end uncut") == {"rotary": verdict}


def test_a_failed_strategy_decides_nothing():
    assert {claim.verdict for claim in claims_of([Row("bonecam", "", "failed", "why")])} == {OPEN}


ROWS = [
    Row("bonecam", "", "done", "", {"length_m": 4.7, "air_share": None}),
    Row("rotary", "", "failed", "no axis, so"),
]


def test_a_failed_strategy_is_a_column_with_its_reason():
    text = table_text(ROWS).splitlines()
    assert text[0].split() == ["bonecam", "rotary"]
    assert text[1].split() == ["ended", "done", "failed"]
    assert text[2].split()[-2:] == ["4.7", "-"]
    assert text[-1] == "rotary failed: no axis, so"
    assert len(text) == 2 + len(LINES) + 1


def test_the_csv_has_a_row_a_strategy():
    first, second = csv.DictReader(io.StringIO(table_csv(ROWS)))
    assert first["length_m"] == "4.7"
    assert first["air_share"] == ""
    assert second == {"strategy": "rotary", "state": "failed", "reason": "no axis, so", "length_m": "", "air_share": ""}
