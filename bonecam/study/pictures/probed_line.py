"""Picture: deviations along the line that was probed (Gan et al. 2014, Fig. 18), with the paper's band."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.report.pictures.panels import DPI, save_figure
from bonecam.verify.probing.probe import BAND, Probed

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00")
"""Of Okabe & Ito (2008): colour-blind readers tell them apart."""
SIZE = (8.0, 4.0)
"""Inches."""
RIGID_WIDTH = 0.9
"""Points that the curves without bending are wide."""
SHOWN = 0.9
"""Share of the points of each curve that the plot holds, if they are within LARGEST: an uncut end leaves it."""
LARGEST = 4 * BAND
"""What is farther off leaves the plot, mm."""


def draw_probed(curves: Sequence[tuple[str, Probed]], path: str | Path) -> None:
    """Write the deviation of each curve over the way along its line, as it comes out, and dotted as if nothing bent.
    The legend tells how far a curve goes that leaves the plot."""
    from matplotlib import figure

    drawing = figure.Figure(figsize=SIZE, dpi=DPI, layout="constrained")
    plot = drawing.subplots()
    low, high = _limits([each for _, one in curves for each in (one.deviation, one.rigid)])
    plot.axhspan(-BAND, BAND, color="0.9", zorder=0, label=f"\u00b1{BAND:g} mm")
    for (name, probed), colour in zip(curves, COLOURS):
        known = probed.deviation[np.isfinite(probed.deviation)]
        outside = known[(known < low) | (known > high)]
        label = f"{name}, to {outside[np.abs(outside).argmax()]:.2g} mm" if len(outside) else name
        plot.plot(probed.line.along, probed.deviation, color=colour, lw=1.2, label=label)
        plot.plot(probed.line.along, probed.rigid, color=colour, lw=RIGID_WIDTH, ls=":")
    plot.plot([], [], color="0.4", lw=RIGID_WIDTH, ls=":", label="as if nothing bent")
    plot.set(xlabel="along the line (mm)", ylabel="deviation (mm)", ylim=(low, high))
    drawing.legend(fontsize="small", ncols=3, loc="outside upper center")
    save_figure(drawing, path)


def _limits(values: Sequence[Float[ndarray, " n"]]) -> tuple[float, float]:
    """The lowest and the highest deviation of the plot, mm: round the band and most points of each curve."""
    low, high = -BAND, BAND
    for each in values:
        known = each[np.isfinite(each)]
        if len(known):
            ends = np.clip(np.quantile(known, [1 - SHOWN, SHOWN]), -LARGEST, LARGEST)
            low, high = min(low, ends[0]), max(high, ends[1])
    return low - BAND / 2, high + BAND / 2
