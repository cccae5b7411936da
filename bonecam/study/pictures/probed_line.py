"""Picture: deviations along the line that was probed (Gan et al. 2014, Fig. 18), with the paper's band."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bonecam.report.pictures.panels import DPI, save_figure
from bonecam.verify.probing.probe import BAND, Probed

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00")
"""Of Okabe & Ito (2008): colour-blind readers tell them apart."""
SIZE = (8.0, 4.0)
"""Inches."""
LARGEST = 4 * BAND
"""Curves that go beyond leave the plot, mm."""


def draw_probed(curves: Sequence[tuple[str, Probed]], path: str | Path) -> None:
    """Write the deviation of each curve over the way along its line, as it comes out, and thin as if nothing bent."""
    from matplotlib import figure

    drawing = figure.Figure(figsize=SIZE, dpi=DPI, layout="constrained")
    plot = drawing.subplots()
    plot.axhspan(-BAND, BAND, color="0.9", zorder=0, label=f"\u00b1{BAND:g} mm")
    for (name, probed), colour in zip(curves, COLOURS):
        plot.plot(probed.line.along, probed.deviation, color=colour, lw=1.2, label=name)
        plot.plot(probed.line.along, probed.rigid, color=colour, lw=0.5, ls=":")
    plot.plot([], [], color="0.4", lw=0.5, ls=":", label="as if nothing bent")
    known = np.concatenate(
        [[-BAND, BAND], *(each for _, one in curves for each in (one.deviation, one.rigid))]
    )
    known = np.clip(known, -LARGEST, LARGEST)
    plot.set_ylim(np.nanmin(known) - BAND / 2, np.nanmax(known) + BAND / 2)
    plot.set(xlabel="along the line (mm)", ylabel="deviation (mm)")
    plot.legend(fontsize="small", ncols=2)
    save_figure(drawing, path)
