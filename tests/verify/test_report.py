"""What the report says to a person."""

from bonecam.verify.report import uncut_text


def test_what_was_left_uncut_is_told_by_reason_in_one_line() -> None:
    rows = [
        {"level": 1, "uncut_contacts": 7, "uncut_reasons": {"gouge": 5, "post": 2}},
        {"level": 0, "uncut_contacts": 3, "uncut_reasons": {"post": 1, "collision": 2}},
    ]
    text = uncut_text(rows)
    assert text.startswith("10 contacts, 3 of them on the part: gouge 5 (ball too large for the hollow), post 3 (at the post)")
    assert "collision 2" in text
    assert "\n" not in text
    assert uncut_text([{"level": 0, "uncut_contacts": 0, "uncut_reasons": {}}]) == "nothing"
