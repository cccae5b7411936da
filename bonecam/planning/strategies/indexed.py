"""The path of one blade or channel of a wheel, repeated at every pitch about the Z axis."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.tool.elliptic_cones import EllipticCones
from bonecam.tool.path import FreeCones, ToolPath

ON_AXIS = 1e-6
"""A path that begins and ends so near to the Z axis with an upright tool goes on from turn to turn there, mm."""


def indexed(path: ToolPath, count: int) -> ToolPath:
    """The moves of a path and of its copies, each turned by a `count`-th of a turn more, one after the other.

    ValueError where the safe point of the path is not on the axis, the tool upright: turning there moves no tip.
    """
    ends = path.tips[[0, -1]], path.axes[[0, -1], :2]
    if max(float(np.abs(ends[0][:, :2]).max()), float(np.abs(ends[1]).max())) > ON_AXIS:
        raise ValueError("a path that is repeated about Z begins and ends over Z, its tool upright")
    rows = len(path.tips)
    passes = int(path.pass_index.max()) + 1
    number = np.repeat(np.arange(count), rows)
    index = np.tile(path.pass_index, count)
    return replace(
        path,
        kinds=np.tile(path.kinds, count),
        pass_index=np.where(index < 0, -1, index + number * passes),
        parameters=np.tile(path.parameters, (count, 1)),
        contacts=_turned(path.contacts, count),
        tips=_turned(path.tips, count),
        axes=_turned(path.axes, count),
        feed_rates=np.tile(path.feed_rates, count),
        uncut=_turned(path.uncut, count),
        reasons=path.reasons * count,
        trimmed=path.trimmed * count,
        blocked_by={what: number * count for what, number in path.blocked_by.items()},
        cones=None if path.cones is None else _cones(path.cones, count),
        lifts=np.vstack([path.lifts + k * rows for k in range(count)]),
    )


def _turned(vectors: Float[ndarray, "n 3"], count: int) -> Float[ndarray, "m 3"]:
    """Vectors, then those turned by a pitch about Z, and so on."""
    angle = 2 * np.pi * np.arange(count)[:, None] / count
    x, y, z = vectors.T
    flat = x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle)
    return np.stack([*flat, np.broadcast_to(z, flat[0].shape)], axis=2).reshape(-1, 3)


def _cones(cones: FreeCones, count: int) -> FreeCones:
    """The cones of all copies."""
    kept = len(cones.apexes)
    shapes = cones.shapes
    turned = EllipticCones(
        _turned(shapes.axes, count), _turned(shapes.sides, count), np.tile(shapes.angles, (count, 1))
    )
    copies: Int[ndarray, " n"] = np.concatenate(
        [np.where(cones.cone_of < 0, -1, cones.cone_of + k * kept) for k in range(count)]
    )
    return replace(cones, apexes=_turned(cones.apexes, count), shapes=turned, cone_of=copies)
