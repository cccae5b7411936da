"""What a bull nose takes out of material."""

from dataclasses import replace

import numpy as np
import pytest

from bonecam.job import Job
from bonecam.kernels.bodies import body_chord
from bonecam.material.dexels import uncut_rays
from bonecam.nc.header import _shapes, tool_text
from bonecam.nc.motions import described_tool
from bonecam.setup.stocks.cylinder import Cylinder
from bonecam.tool.cutter import Cutter
from bonecam.verify.sweeping import volumes

CUTTER = Cutter.from_job(1, "roughing", Job().with_values(roughing={"shape": "bull"}).tool("roughing"))


def test_chords_end_where_the_cones_do() -> None:
    rng = np.random.default_rng(5)
    sine, cosine, bound = CUTTER.body.T
    hits = 0
    for _ in range(500):
        axis, way = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
        point = rng.uniform(-3, 3, 3)
        low, high = body_chord(tuple(point), tuple(way), axis, CUTTER.body)
        t = np.linspace(-15, 15, 3001)
        line = point + t[:, None] * way
        h = line @ axis
        r = np.linalg.norm(line - h[:, None] * axis, axis=1)
        inside = (np.outer(r, sine) - np.outer(h, cosine) <= bound).all(axis=1)
        hits += inside.any()
        np.testing.assert_array_equal(inside, (low <= t) & (t <= high))
    assert hits > 50


def test_a_straight_cut_removes_what_the_profile_sweeps() -> None:
    stock = Cylinder(10.0, 0.0, 6.0)
    dexels = uncut_rays(stock).balls
    up = np.array([[0.0, 0.0, 1.0]])
    # upright, 1 mm deep, right across: the corners of radius 0.5 leave what they round
    centre = np.array([[-15.0, 0.0, 5.0 + CUTTER.centre_height]])
    after = dexels.without((centre, up), (centre * [-1, 1, 1], up), CUTTER.radius, body=CUTTER.body)
    removed = np.mean(volumes(dexels.sets)) - np.mean(volumes(after.sets))
    y = np.linspace(-2, 2, 4001)
    rounded = np.maximum(np.abs(y) - 1.5, 0.0)
    depth = 1.0 - (0.5 - np.sqrt(0.25 - rounded**2))
    expected = np.trapezoid(depth * 2 * np.sqrt(100 - y**2), y)
    assert removed == pytest.approx(expected, rel=0.01)


def test_a_header_tells_a_bull_nose() -> None:
    tool = described_tool(tool_text(CUTTER, 100.0), 7)
    assert tool is not None
    assert (tool.radius, tool.corner, tool.length) == (2.0, 0.5, 100.0)
    assert tool.envelope.radius == pytest.approx(CUTTER.envelope_radius)
    assert tool.envelope.height == pytest.approx(CUTTER.centre_height)
    first, *_ = _shapes(CUTTER)
    assert "R 2.0000, corner R2 0.5000" in first


def test_a_header_tells_a_flat_end_and_no_ball() -> None:
    flat = Cutter.from_job(1, "roughing", Job().with_values(roughing={"shape": "flat"}).tool("roughing"))
    tool = described_tool(tool_text(flat, 100.0), 7)
    assert tool is not None
    assert (tool.radius, tool.corner, tool.length) == (2.0, 0.0, 100.0)
    assert tool.envelope.radius == pytest.approx(flat.envelope_radius) == pytest.approx(4.0)
    ball = described_tool(tool_text(replace(flat, corner_radius=None), 100.0), 7)
    assert ball is not None
    assert (ball.corner, ball.arc) == (None, 2.0)
