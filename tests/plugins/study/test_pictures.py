"""The picture of a probed line: it shows most of each curve, and tells how far one goes that leaves it.

The picture of what strategies leave: what is nearest to the viewer is seen, lit by its slope.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from bonecam_plugins.study import pictures
from bonecam_plugins.study.pictures import LARGEST, _seen, draw_probed
from bonecam_plugins.study.probing import BAND


def probed(deviation):
    """Deviations at points 1 mm apart, mm."""
    line = SimpleNamespace(along=np.arange(len(deviation), dtype=float))
    return SimpleNamespace(line=line, deviation=deviation, rigid=np.zeros(len(deviation)))


@pytest.fixture
def drawn(monkeypatch):
    """Draws curves, and answers the plot and the words of its legend."""
    figures = []
    monkeypatch.setattr(pictures, "save_figure", lambda figure, _: figures.append(figure))

    def draw(*curves):
        draw_probed(curves, "probe.png")
        (figure,) = figures
        return figure.axes[0], [text.get_text() for text in figure.legends[0].get_texts()]

    return draw


def test_an_uncut_end_leaves_the_plot_and_is_told(drawn):
    uncut = np.r_[np.full(95, 0.01), np.full(5, 4.2)]
    plot, words = drawn(("morph", probed(np.full(100, 0.02))), ("rotary", probed(uncut)))
    assert plot.get_ylim() == pytest.approx((-1.5 * BAND, 1.5 * BAND))
    assert {"morph", "rotary, to 4.2 mm"} <= set(words)


def test_a_curve_beyond_the_band_is_shown_up_to_the_largest(drawn):
    plot, words = drawn(("near", probed(np.full(50, 2 * BAND))), ("far", probed(np.full(50, -1.0))))
    assert plot.get_ylim() == pytest.approx((-LARGEST - BAND / 2, 2.5 * BAND))
    assert {"near", "far, to -1 mm"} <= set(words)


def test_points_that_the_ball_did_not_touch_are_left_out(drawn):
    plot, words = drawn(("one", probed(np.r_[np.nan, 0.01, np.nan])), ("none", probed(np.full(3, np.nan))))
    assert plot.get_ylim() == pytest.approx((-1.5 * BAND, 1.5 * BAND))
    assert {"one", "none"} <= set(words)


def test_the_place_nearest_to_the_viewer_is_seen():
    near, far, beside = [0.0, -1.0, 0.0], [0.01, 1.0, 0.01], [0.52, 2.0, 0.12]
    index, covered, _, extent = _seen(np.array([far, near, beside]), 0.1)
    assert index[0, 0] == 1
    assert index[1, 5] == 2
    assert covered.sum() == 2
    assert extent == pytest.approx((0.0, 0.6, 0.0, 0.2))


def test_a_face_towards_the_light_is_lighter_than_one_that_turns_away():
    x, z = (each.ravel() for each in np.meshgrid(np.arange(0.05, 2, 0.1), np.arange(0.05, 2, 0.1)))
    roof = np.column_stack([x, np.abs(x - 1), z])
    _, _, shades, _ = _seen(roof, 0.1)
    assert (shades[:, 12:18] > shades[:, 2:8] + 0.1).all()
