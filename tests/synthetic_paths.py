"""Tool paths made by hand: a helix round an upright capsule with leaning axes, with links and rapids."""

import numpy as np

from bonecam.toolpath.cutter import Cutter
from bonecam.toolpath.path import Kind, ToolPath

BOTTOM, TOP, CAPSULE_RADIUS = 45.0, 65.0, 5.0


def cutter(number: int = 1, radius: float = 1.0) -> Cutter:
    return Cutter(number, "ball", radius, 4 * radius, 2 * radius, 25.0, 20.0, 50.0, 12000.0, 900.0, 0.02)


def capsule_points(turns: float, count: int, offset: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Points and normals on a spiral from the lower cap's side to the top pole of a capsule about Z."""
    radius = CAPSULE_RADIUS + offset
    low, arc = -0.2 * radius, 0.97 * np.pi / 2 * radius
    along = np.linspace(low, TOP - BOTTOM + arc, count)
    angle = 2 * np.pi * turns * np.linspace(0, 1, count)
    lower, upper = np.clip(along, None, 0) / radius, np.clip(along - (TOP - BOTTOM), 0, None) / radius
    slope = lower + upper
    normals = np.column_stack([np.cos(slope) * np.cos(angle), np.cos(slope) * np.sin(angle), np.sin(slope)])
    centres = np.column_stack([np.zeros((count, 2)), BOTTOM + np.clip(along, 0, TOP - BOTTOM)])
    return centres + radius * normals, normals


def capsule_path(
    level: int = 0,
    radius: float = 1.0,
    number: int = 1,
    offset: float = 0.0,
    turns: float = 6.0,
    count: int = 900,
    lift_deg: float = 30.0,
) -> ToolPath:
    """A helix in three passes joined by a link and a rapid; the axis is the normal turned upwards by
    `lift_deg` at most."""
    contacts, normals = capsule_points(turns, count, offset)
    centres = contacts + radius * normals
    up = np.array([0.0, 0.0, 1.0])
    flat = up - (normals @ up)[:, None] * normals
    lean = np.radians(lift_deg) * np.linalg.norm(flat, axis=1)[:, None]
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    axes = np.cos(lean) * normals + np.sin(lean) * flat
    tips = centres - radius * axes
    third = count // 3
    rows, kinds, passes, feeds = [], [], [], []

    def add(tip: np.ndarray, axis: np.ndarray, kind: Kind, index: int, feed: float) -> None:
        rows.append((tip, axis))
        kinds.append(kind)
        passes.append(index)
        feeds.append(feed)

    for index in range(3):
        part = range(index * third, (index + 1) * third if index < 2 else count)
        first, last = part[0], part[-1]
        add(tips[first] + 12 * axes[first], axes[first], Kind.RAPID, -1, 10000.0)
        add(tips[first] + 2 * axes[first], axes[first], Kind.LINK, -1, 1500.0)
        for i in part:
            add(tips[i], axes[i], Kind.CUT, index, 900.0)
        add(tips[last] + 2 * axes[last], axes[last], Kind.LINK, -1, 1500.0)
        add(tips[last] + 12 * axes[last], axes[last], Kind.RAPID, -1, 10000.0)
    return made_path(
        np.array([row[0] for row in rows]),
        np.array([row[1] for row in rows]),
        kinds=np.array(kinds, dtype=np.int64),
        passes=np.array(passes, dtype=np.int64),
        feeds=np.array(feeds),
        tool=cutter(number, radius),
        level=level,
    )


def made_path(tips, axes, kinds=None, passes=None, feeds=None, tool=None, level=0) -> ToolPath:
    """A tool path of given tips and axes; one pass of cuts begun by a rapid where nothing else is said."""
    n = len(tips)
    nan = np.full((n, 3), np.nan)
    if kinds is None:
        kinds = np.full(n, int(Kind.CUT))
        kinds[0] = Kind.RAPID
    return ToolPath(
        level=level,
        cutter=tool or cutter(),
        kinds=kinds,
        pass_index=np.where(kinds == Kind.CUT, 0, -1) if passes is None else passes,
        parameters=nan[:, :2],
        contacts=nan,
        tips=np.asarray(tips, dtype=float),
        axes=np.asarray(axes, dtype=float),
        feed_rates=np.where(kinds == Kind.RAPID, 10000.0, 900.0) if feeds is None else feeds,
        uncut=np.zeros((0, 3)),
        reasons=(),
    )
