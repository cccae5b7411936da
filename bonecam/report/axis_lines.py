"""Smooth tool axes beside the surface's normals and axes that lean by a lead angle, at the same contacts (Xu et al.
2013, Fig. 10 and section 7.3).

Turning is that of the axis along a pass, a length of way of the ball's centre; travels, speeds and time are those of
the machine's rotary axes, tilt (polar angle) and turn (azimuth), without accelerations.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between, dots, lengths, unit
from bonecam.job import PathJob
from bonecam.machine.limits import MachineLimits, rotary_turns
from bonecam.planning.axes.lead import lead_axes
from bonecam.planning.axes.tool_axes import choose_axes
from bonecam.planning.collision import CollisionChecker
from bonecam.planning.scene import Scene
from bonecam.tool.path import ContactPath, MoveKind, ToolPath

FEEDS = (900, 1200, 3000)
"""Feeds at which the time is told beside that at the cutter's own, mm/min: the paper's before and after, and more."""
HIGH = 90
"""Percentile of the moves whose axis speeds are told."""


@dataclass(frozen=True, eq=False)
class AxisChoice:
    """Unit tool `axes` at the contacts of a path, and at which of them the tool is `free` of collision and the machine
    can take the axis (`reached`)."""

    name: str
    axes: Float[ndarray, "n 3"]
    free: Bool[ndarray, " n"]
    reached: Bool[ndarray, " n"]


@dataclass(frozen=True, eq=False)
class AxisComparison:
    """Choices of axes at the contacts that a path cuts: its own last. `balls` are the ball's centres, mm; `feed` is the
    cutter's, mm/min."""

    contacts: Float[ndarray, "n 3"]
    balls: Float[ndarray, "n 3"]
    passes: Int[ndarray, " n"]
    feed: float
    limits: MachineLimits
    choices: tuple[AxisChoice, ...]

    @cached_property
    def steps(self) -> Float[ndarray, " m"]:
        """Lengths of the moves between contacts of one pass, mm."""
        return lengths(np.diff(self.balls, axis=0))[self.joined]

    @cached_property
    def joined(self) -> Bool[ndarray, " m"]:
        """Which contacts but the last are followed by one of the same pass, in another place."""
        apart = lengths(np.diff(self.balls, axis=0)) > np.finfo(float).eps
        return (np.diff(self.passes) == 0) & apart

    def figures(self, choice: AxisChoice) -> dict[str, Any]:
        """What is measured of a choice, as in the table."""
        minutes = self.steps / self.feed
        turn, tilt = np.abs(rotary_turns(choice.axes)[self.joined]).T
        slowest = self.limits.turning_minutes(choice.axes)[self.joined]
        driven = np.maximum(minutes, slowest)
        rate = np.degrees(angles_between(choice.axes[1:], choice.axes[:-1]))[self.joined] / self.steps
        return {
            "axes": choice.name,
            "collide": int((~choice.free).sum()),
            "beyond_limits": int((~choice.reached).sum()),
            "turning_rms_deg_mm": _rms(rate),
            "turning_change_rms_deg_mm2": _rms(self._changes(rate)),
            "tilt_travel_deg": float(np.degrees(tilt.sum())),
            "turn_travel_deg": float(np.degrees(turn.sum())),
            "tilt_speed_deg_s": _high(np.degrees(tilt) / (60 * minutes)),
            "turn_speed_deg_s": _high(np.degrees(turn) / (60 * minutes)),
            "limited_share": float((driven > minutes).mean()),
            "seconds": 60 * float(driven.sum()),
            "feed_mean_mm_min": float(self.steps.sum() / driven.sum()),
            **{f"seconds_at_{feed}": 60 * float(np.maximum(self.steps / feed, slowest).sum()) for feed in FEEDS},
        }

    def _changes(self, rate: Float[ndarray, " m"]) -> Float[ndarray, " k"]:
        """How a rate changes from one move to the next of the same pass, a mm."""
        place = np.flatnonzero(self.joined)
        follows = np.diff(place) == 1
        between = (self.steps[1:] + self.steps[:-1]) / 2
        return (np.diff(rate) / between)[follows]

    @property
    def report(self) -> list[dict[str, Any]]:
        """The figures of each choice."""
        return [
            {name: round(value, 4) if isinstance(value, float) else value for name, value in row.items()}
            for row in map(self.figures, self.choices)
        ]

    @property
    def table(self) -> str:
        """The figures in Markdown, a column for each choice."""
        rows = list(map(self.figures, self.choices))
        alone = f"{60 * float(self.steps.sum()) / self.feed:.0f} by the feed alone"
        reported = {
            f"collide, of {len(self.contacts)}": "{collide}",
            "beyond the machine's limits": "{beyond_limits}",
            "turning, rms (deg/mm)": "{turning_rms_deg_mm:.2f}",
            "its change, rms (deg/mm²)": "{turning_change_rms_deg_mm2:.2f}",
            "tilt / turn in all (deg)": "{tilt_travel_deg:.0f} / {turn_travel_deg:.0f}",
            f"tilt / turn, {HIGH} % below (deg/s)": "{tilt_speed_deg_s:.0f} / {turn_speed_deg_s:.0f}",
            "moves that an axis limits": "{limited_share:.1%}",
            f"time (s; {alone})": "{seconds:.0f}",
            f"mean feed (mm/min; {self.feed:.0f} asked)": "{feed_mean_mm_min:.0f}",
            f"time at {_listed(FEEDS)} mm/min (s)": _listed(f"{{seconds_at_{feed}:.0f}}" for feed in FEEDS),
        }
        lines = [["", *(row["axes"] for row in rows)], ["---"] * (len(rows) + 1)]
        lines += [[name, *(text.format(**row) for row in rows)] for name, text in reported.items()]
        return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def compare_axes(path: ToolPath, scene: Scene, limits: MachineLimits, job: PathJob) -> AxisComparison:
    """The axes of a path beside its normals, axes that lean forward by the job's lead, and these turned to the nearest
    free ones, at the same contacts, in the scene and for the machine of the path."""
    cuts = path.kinds == MoveKind.CUT
    balls, passes = path.balls[cuts], path.pass_index[cuts]
    normals = unit(balls - path.contacts[cuts])

    # The direction of the feed at each contact: to the next one of the pass, at its end from the one before
    steps = np.diff(balls, axis=0)
    same = (np.diff(passes) == 0)[:, None]
    ahead = np.vstack([np.where(same, steps, 0), np.zeros((1, 3))])
    behind = np.vstack([np.zeros((1, 3)), np.where(same, steps, 0)])
    ways = np.where((ahead != 0).any(axis=1, keepdims=True), ahead, behind)

    along = unit(ways - dots(ways, normals)[:, None] * normals)
    contacts = ContactPath(
        level=path.level,
        cutter=path.cutter,
        pass_index=passes,
        parameters=path.parameters[cuts],
        contacts=path.contacts[cuts],
        normals=normals,
        feeds=along,
        centres=balls,
        lifts=np.zeros(len(balls)),
        ramp=np.zeros(len(balls), dtype=bool),
        uncut=np.zeros((0, 3)),
        reasons=(),
    )
    checker = CollisionChecker(scene, path.cutter)
    lead = f"lead {job.lead_deg:g} deg"
    named = {
        "surface normal": normals,
        lead: lead_axes(normals, along, np.radians(job.lead_deg)),
        f"{lead}, turned free": choose_axes(contacts, checker, limits, job).axes,
        "this path": path.axes[cuts],
    }
    choices = [AxisChoice(name, axes, checker.free(balls, axes), limits.allow(axes)) for name, axes in named.items()]
    return AxisComparison(
        path.contacts[cuts], balls, passes=passes, feed=path.cutter.feed, limits=limits, choices=tuple(choices)
    )


def _listed(items: Iterable[object]) -> str:
    return " / ".join(map(str, items))


def _rms(values: Float[ndarray, " k"]) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def _high(values: Float[ndarray, " k"]) -> float:
    return float(np.percentile(values, HIGH)) if len(values) else 0.0
