"""Tool paths as cutter location data in APT words (ISO 4343), which other systems and post processors read.

Written are PARTNO, UNITS, MULTAX, PPRINT (level; LINK and CUT before feeds of that kind), LOADTL, CUTTER, SPINDL,
RAPID, FEDRAT, GOTO and FINI, in the frame of the tool paths. Other systems pass over PPRINT: to them links and cuts
are both feeds. `cl_data.py` reads them back.
"""

from collections.abc import Iterator, Sequence

from bonecam.tool.path import PARTING, MoveKind, ToolPath


def apt_text(paths: Sequence[ToolPath], name: str = "PART") -> str:
    """Tool paths as APT statements: mm and mm/min, tips with 6 decimals, axes with 9."""
    lines = [f"PARTNO/{name}", "UNITS/MM", "MULTAX/ON"]
    tool = None
    for path in paths:
        lines.append(f"PPRINT/LEVEL {path.level}" if path.level != PARTING else "PPRINT/PARTING")
        if path.cutter.number != tool:
            tool = path.cutter.number
            lines += [f"LOADTL/{tool}", f"CUTTER/{2 * path.cutter.radius:.6f},{path.cutter.corner:.6f}"]
            lines.append(f"SPINDL/RPM,{path.cutter.spindle:.0f},CLW")
        lines += _moves(path)
    return "\n".join([*lines, "FINI", ""])


def _moves(path: ToolPath) -> Iterator[str]:
    """RAPID, or a kind and a feed that change, and GOTO, of each move."""
    feed, feeding = None, None
    rows = zip(path.kinds.tolist(), path.feed_rates.tolist(), path.tips.tolist(), path.axes.tolist())
    for kind, wanted, tip, axis in rows:
        if kind == MoveKind.RAPID:
            yield "RAPID"
        elif kind != feeding:
            feeding = kind
            yield f"PPRINT/{MoveKind(kind).name}"
        if kind != MoveKind.RAPID and wanted != feed:
            feed = wanted
            yield f"FEDRAT/MMPM,{feed:.3f}"
        yield "GOTO/{:.6f},{:.6f},{:.6f},{:.9f},{:.9f},{:.9f}".format(*(value + 0.0 for value in (*tip, *axis)))
