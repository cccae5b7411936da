"""Tool paths as a table of comma-separated values."""

import csv
import io
from collections.abc import Sequence

from bonecam.tool.path import MoveKind, ToolPath

COLUMNS = (
    *("level", "pass", "index"),
    *("contact_x", "contact_y", "contact_z"),
    *("tip_x", "tip_y", "tip_z"),
    *("axis_x", "axis_y", "axis_z"),
    *("kind", "feed"),
)


def toolpath_csv(paths: Sequence[ToolPath]) -> str:
    """One line a point in machining order: mm, unit axes, mm/min. Contacts are empty on links and rapids."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for path in paths:
        for i in range(len(path.tips)):
            writer.writerow(_row(path, i))
    return text.getvalue()


def _row(path: ToolPath, i: int) -> list[object]:
    """The line of point `i`."""
    kind = MoveKind(path.kinds[i])
    contact = [f"{value:.6f}" for value in path.contacts[i]] if kind == MoveKind.CUT else ["", "", ""]
    tip = [f"{value:.6f}" for value in path.tips[i]]
    axis = [f"{value:.9f}" for value in path.axes[i]]
    feed = f"{path.feed_rates[i]:.1f}"
    return [path.level, path.pass_index[i], i, *contact, *tip, *axis, kind.name.lower(), feed]
