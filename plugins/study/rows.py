"""What came of one strategy: the figures of its row, all from the posted text, its simulation and its probe.

Depths and forces are told for the roughing and for the finishing cutter, as their limits differ. Shares are of time.

depth    where something was cut, mm: mean, 99 %, max, cv (standard deviation / mean)
force    while cutting, N: mean; peak at 99 % and at most; ripple: cv of the mean force; jumps: how far the mean force
         rises from one move to the next (from nothing behind air) at 99 % and at most, and rises of JUMP a minute
bend     um: deflection under the mean force while finishing (95 %), and the error that the part keeps
left     away from the post, mm: mean, 99 %, max, and mm2 that keep more than LEFT
probe    mm: the deviation of a ball along a line (`verify/probing`)

What Gan et al. (2014) say in section 5.3 of the three strategies, each beside the figures of a comparison.

A claim that one strategy is better than others holds where its figure is better than that of each of them by MARGIN,
and is contradicted where one of them is better by as much; between, or where a figure is missing, it is not decidable.
What is claimed of morphing is asked of the published method and of bonecam's, each by itself.

What a comparison is: its rows, the claims beside them, and what was measured.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from bonecam_plugins.study.probing import BAND, UM, Probed, Roughness
from jaxtyping import Float
from numpy import ndarray

from bonecam import Result
from bonecam.mechanics.loads import PathLoads, cut_shares
from bonecam.nc import Motions
from bonecam.planning.contacts import at_post
from bonecam.tool import Cutter
from bonecam.verify import Removal
from bonecam.verify.findings import LEFT
from bonecam.verify.sweeping import AIR, feed_minutes
from bonecam.workholding import post_below

JUMP = 10.0
"""N: bends a part of 5 um/N by the paper's 0.05 mm."""
Figures = dict[str, float | None]


@dataclass(frozen=True, eq=False)
class Row:
    """A strategy by `name` and `title`: `state` is done, refused (its proof refuses the program, which is measured all
    the same) or failed (there is none), with the `reason`; `figures` by name, empty where it failed."""

    name: str
    title: str
    state: str
    reason: str = ""
    figures: Figures = field(default_factory=dict)

    @property
    def report(self) -> dict[str, Any]:
        """The row as JSON has it."""
        return {
            "strategy": self.name,
            "title": self.title,
            "state": self.state,
            "reason": self.reason,
            "figures": self.figures,
        }


def figures_of(
    result: Result, motions: Motions, cutters: Sequence[Cutter], probed: Probed, roughness: Roughness
) -> Figures:
    """The figures of a program that was simulated."""
    removal = result.removal
    assert removal is not None
    figures = _times(motions, cutters, removal) | {"program_min": result.report["nc"]["time_min"]}
    for cutter in cutters[:2]:
        figures |= _depths(removal, cutter)
        figures |= _forces(removal, cutter)
    figures |= _bending(removal)
    figures |= _left(removal, result)
    figures |= {f"probe_{name}": value for name, value in probed.report.items()}
    figures |= {"probe_waves_mm": waves(probed), "probe_lean_mm": lean(probed)}
    return figures | {f"rough_{name}": value for name, value in roughness.report.items()}


def waves(probed: Probed) -> float | None:
    """How much the deviation goes up and down from point to point: the standard deviation of what neighbours differ by,
    mm."""
    steps = np.diff(probed.deviation)
    steps = steps[np.isfinite(steps)]
    return _told(float(steps.std())) if len(steps) else None


def lean(probed: Probed) -> float | None:
    """How far the part leans: what a straight line through that part of the deviations that bending adds rises by over
    the length of the line, mm."""
    bent = probed.deviation - probed.rigid
    known = np.isfinite(bent)
    if known.sum() < 2:
        return None
    along = probed.line.along
    slope = np.polyfit(along[known], bent[known], 1)[0]
    return _told(float(slope * np.ptp(along)))


def _times(motions: Motions, cutters: Sequence[Cutter], removal: Removal) -> Figures:
    """Length of the cuts, feed times without and with the limits of the axes, and the share in air."""
    ways = motions.lengths
    cuts = ~motions.rapid & ~motions.links & motions.known_start
    feeds = np.ones(len(ways))
    for cutter in cutters:
        feeds[motions.tools == cutter.number] = cutter.feed
    minutes = feed_minutes(motions)
    air = minutes[removal.move_volumes < AIR].sum()
    return {
        "length_m": _told(float(ways[cuts].sum()) / 1000),
        "feed_min": _told(float((ways[cuts] / feeds[cuts]).sum())),
        "axes_min": _told(float(minutes[cuts].sum())),
        "air_share": _told(float(air / max(minutes.sum(), np.finfo(float).tiny))),
    }


def _depths(removal: Removal, cutter: Cutter) -> Figures:
    """Depths of the cut by one cutter."""
    depths = np.concatenate([np.zeros(0), *(one.depths for one in removal.levels if one.tool == cutter.number)])
    name = f"depth_{cutter.name}"
    if not len(depths):
        return dict.fromkeys((f"{name}_mean", f"{name}_p99", f"{name}_max", f"{name}_cv"))
    return {
        f"{name}_mean": _told(depths.mean()),
        f"{name}_p99": _told(np.percentile(depths, 99)),
        f"{name}_max": _told(depths.max()),
        f"{name}_cv": _told(depths.std() / depths.mean()),
    }


def _forces(removal: Removal, cutter: Cutter) -> Figures:
    """Forces of one cutter, weighted by time."""
    name = f"force_{cutter.name}"
    columns = ("mean", "peak_p99", "peak_max", "ripple", "jump_p99", "jump_max", "jumps_per_min")
    loads = _loads(removal, cutter.number)
    if not loads:
        return dict.fromkeys(f"{name}_{column}" for column in columns)
    mean, peak, minutes = (
        np.concatenate([getattr(one, what) for one in loads]) for what in ("mean", "peak", "minutes")
    )
    rises = np.concatenate([_rises(one) for one in loads])
    average = float(np.average(mean, weights=minutes))
    spread = float(np.sqrt(np.average((mean - average) ** 2, weights=minutes)))
    high, most = cut_shares(peak, minutes, (0.99, 1.0))
    values = (
        average,
        high,
        most,
        spread / average,
        np.percentile(rises, 99),
        rises.max(),
        (rises > JUMP).sum() / minutes.sum(),
    )
    return {f"{name}_{column}": _told(float(value)) for column, value in zip(columns, values, strict=True)}


def _rises(loads: PathLoads) -> Float[ndarray, " k"]:
    """How far the mean force rises into each piece of a path from the piece before, N; from nothing behind air."""
    follows = np.r_[False, np.diff(loads.moves) <= 1]
    return np.maximum(loads.mean - np.where(follows, np.r_[0.0, loads.mean[:-1]], 0.0), 0.0)


def _loads(removal: Removal, tool: int) -> list[PathLoads]:
    """The loads of the paths of one cutter that cut; paths and levels of a removal are in one order."""
    if removal.mechanics is None:
        return []
    both = zip(removal.mechanics.paths, removal.levels, strict=True)
    return [loads for loads, level in both if level.tool == tool and len(loads.moves)]


def _bending(removal: Removal) -> Figures:
    """Deflection while finishing, of iso-height on each of its sides, and the error kept, um; stress, N/mm^2."""
    figures: Figures = dict.fromkeys(("bend_finishing_p95_um", "bend_before_last_p95_um", "bend_last_p95_um"))
    loads = _loads(removal, 2)
    if loads:
        figures["bend_finishing_p95_um"] = _deflection(loads)
        figures["bend_last_p95_um"] = _deflection([one for one in loads if one.index == 0])
        figures["bend_before_last_p95_um"] = _deflection([one for one in loads if one.index == 1])
    mechanics = removal.mechanics
    error = mechanics.error if mechanics else None
    for name in ("median", "p95", "p99"):
        figures[f"error_kept_{name}_um"] = _told(UM * getattr(error, name)) if error else None
    figures["stress_p99_mpa"] = _told(float(mechanics.stress[1])) if mechanics else None
    return figures


def _deflection(loads: Sequence[PathLoads]) -> float | None:
    """The deflection under the mean force that 95 % of the cutting time stay below, um."""
    if not loads:
        return None
    bent, minutes = (np.concatenate([getattr(one, what) for one in loads]) for what in ("deflection", "minutes"))
    return _told(UM * float(cut_shares(bent, minutes, (0.95,))[0]))


def _left(removal: Removal, result: Result) -> Figures:
    """What stays away from the post."""
    probes = removal.remaining.probes
    post = post_below(result.levels.levels[0].mesh, result.job.holding)
    away = ~at_post(probes.points, probes.normals, post, result.job.smallest_ball)
    heights, areas = probes.heights[away], probes.areas[away]
    highest = removal.left.highest.place[2] if removal.left else None
    low, high = probes.points[:, 2].min(), probes.points[:, 2].max()
    return {
        "left_mean_mm": _told(float(np.average(heights, weights=areas))),
        "left_p99_mm": _told(float(cut_shares(heights, areas, (0.99,))[0])),
        "left_max_mm": _told(float(heights.max())),
        "left_area_mm2": _told(float(areas[heights > LEFT].sum())),
        "left_highest_at": None if highest is None else _told(float((highest - low) / (high - low))),
        "gouge_mm": _told(max(-float(heights.min()), 0.0)),
    }


def _told(value: float) -> float:
    """A figure to four significant digits."""
    return float(f"{float(value):.4g}")


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


@dataclass(frozen=True, eq=False)
class Measured:
    """The program of a strategy, with what it removes and what a probe tells of it."""

    result: Result
    probed: Probed


@dataclass(frozen=True, eq=False)
class Comparison:
    """The `rows` of a comparison in the order of their strategies, the `claims` of the paper beside them, and what was
    `measured` by name of the strategy, for pictures and pages."""

    part: str
    rows: tuple[Row, ...]
    claims: tuple[Claim, ...]
    measured: dict[str, Measured]

    @property
    def report(self) -> dict[str, Any]:
        """The comparison as JSON has it."""
        return {
            "part": self.part,
            "strategies": [row.report for row in self.rows],
            "claims": [claim.report for claim in self.claims],
        }
