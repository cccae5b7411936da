"""What Gan et al. (2014) say in section 5.3 of the three strategies, each beside the figures of a comparison.

A claim that one strategy is better than others holds where its figure is better than that of each of them by MARGIN,
and is contradicted where one of them is better by as much; between, or where a figure is missing, it is not decidable.
What is claimed of morphing is asked of the published method and of bonecam's, each by itself.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from bonecam.study.rows import Row
from bonecam.verify.probing.probe import BAND

MARGIN = 0.1
"""Share by which a figure has to be better; less is a matter of how it was measured."""
TOP = 0.9
"""The free end of the part begins at this share of its height."""
SUPPORTED, CONTRADICTED, OPEN = "supported", "contradicted", "not decidable"
Rows = Mapping[str, Row]
"""Rows that have figures, by the name of their strategy."""
Verdict = tuple[str, str]
"""Whether a claim holds, and the figures that say so."""


@dataclass(frozen=True)
class Claim:
    """A claim in short, of which strategy, what the figures say of it, and these."""

    text: str
    of: str
    verdict: str
    figures: str

    @property
    def report(self) -> dict[str, Any]:
        """The claim as JSON has it."""
        return {"claim": self.text, "of": self.of, "verdict": self.verdict, "figures": self.figures}


def claims_of(rows: Sequence[Row]) -> tuple[Claim, ...]:
    """All claims beside the rows of a comparison."""
    known = {row.name: row for row in rows if row.figures}
    claims = []
    for text, names, decide in CLAIMS:
        for name in names:
            verdict, figures = decide(known, name)
            claims.append(Claim(text, name, verdict, figures))
    return tuple(claims)


def _value(rows: Rows, name: str, figure: str) -> float | None:
    return rows[name].figures.get(figure) if name in rows else None


def _less(*figures: str, than: Sequence[str]) -> Callable[[Rows, str], Verdict]:
    """Whether all these figures of a strategy are less than those of each of the others."""

    def decide(rows: Rows, name: str) -> Verdict:
        verdicts, texts = [], []
        for figure in figures:
            own = _value(rows, name, figure)
            others = {other: _value(rows, other, figure) for other in than}
            texts.append(f"{figure} {_shown(own)}; " + ", ".join(f"{k} {_shown(v)}" for k, v in others.items()))
            verdicts.append(_smaller(own, list(others.values())))
        if CONTRADICTED in verdicts:
            verdict = CONTRADICTED
        else:
            verdict = SUPPORTED if set(verdicts) == {SUPPORTED} else OPEN
        return verdict, " / ".join(texts)

    return decide


def _smaller(own: float | None, others: Sequence[float | None]) -> str:
    if own is None:
        return OPEN
    known = [abs(value) for value in others if value is not None]
    own = abs(own)
    if any(value < (1 - MARGIN) * own for value in known):
        return CONTRADICTED
    if len(known) < len(others) or any(own > (1 - MARGIN) * value for value in known):
        return OPEN
    return SUPPORTED


def _within_band(rows: Rows, name: str) -> Verdict:
    low, high = _value(rows, name, "probe_min_mm"), _value(rows, name, "probe_max_mm")
    share = _value(rows, name, "probe_within_0_05_share")
    if low is None or high is None or share is None:
        return OPEN, "no probe"
    text = f"from {low:g} to {high:g} mm, {100 * share:g} % of the points within {BAND:g}"
    return (SUPPORTED if share == 1 else CONTRADICTED), text


def _second_side(rows: Rows, name: str) -> Verdict:
    """Whether the second side bends more while it is finished than the first."""
    first, second = _value(rows, name, "bend_before_last_p95_um"), _value(rows, name, "bend_last_p95_um")
    verdict = OPEN if first is None or second is None else _smaller(first, [second])
    return (verdict, f"deflection at 95 % while finishing: first side {_shown(first)}, second {_shown(second)} um")


def _uncut_end(rows: Rows, name: str) -> Verdict:
    """Whether the highest rest is at the free end, and higher than what the morphs leave at most."""
    place, most = _value(rows, name, "left_highest_at"), _value(rows, name, "left_max_mm")
    morphs = [_value(rows, other, "left_max_mm") for other in MORPHS]
    known = [value for value in morphs if value is not None]
    text = f"at most {_shown(most)} mm at {_shown(place)} of the height; morphs {', '.join(map(_shown, morphs))}"
    if place is None or most is None or not known:
        return OPEN, text
    return (SUPPORTED if place > TOP and min(known) < (1 - MARGIN) * most else CONTRADICTED), text


def _shown(value: float | None) -> str:
    return "-" if value is None else f"{value:g}"


MORPHS = ("published", "bonecam")
OTHERS = ("iso-height", "rotary")
CLAIMS: tuple[tuple[str, Sequence[str], Callable[[Rows, str], Verdict]], ...] = (
    (
        "the cutting force remains stable all through",
        MORPHS,
        _less("force_roughing_ripple", "force_finishing_ripple", than=OTHERS),
    ),
    (
        "no sudden impact is exerted on the part",
        MORPHS,
        _less("force_roughing_jump_p99", "force_finishing_jump_p99", than=OTHERS),
    ),
    ("cutting depths are evenly distributed", MORPHS, _less("depth_roughing_cv", "depth_finishing_cv", than=OTHERS)),
    ("the part bends less", MORPHS, _less("error_kept_p95_um", "bend_finishing_p95_um", than=("iso-height",))),
    ("the deviation is below 0.05 mm at every probed point", MORPHS, _within_band),
    ("no uncut material, a better surface", MORPHS, _less("left_area_mm2", "left_p99_mm", than=OTHERS)),
    ("iso-height is fast", ("iso-height",), _less("axes_min", than=MORPHS)),
    ("iso-height leaves waves", MORPHS, _less("probe_waves_mm", than=("iso-height",))),
    ("iso-height bends the part as its second side is made", ("iso-height",), _second_side),
    ("rotary keeps the part straighter", ("rotary",), _less("probe_lean_mm", than=("iso-height", *MORPHS))),
    ("rotary leaves the end uncut", ("rotary",), _uncut_end),
)
"""Claims with the strategies that they are asked of."""
