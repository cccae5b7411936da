"""Convex meshes cut out of material on rays."""

from collections.abc import Sequence

import numpy as np

from bonecam.kernels.removal.rays import RaySet, summarise
from bonecam.material.rays import ROOM, RayGrid, chords_of
from bonecam.setup.stocks.mesh import ConvexStock

SLIVER = 1e-3
"""What is cut out leaves no interval as short as this, mm: none between two bodies that meet."""


def cut_out(rays: RaySet, bodies: Sequence[ConvexStock], grid: RayGrid, direction: int) -> RaySet:
    """The rays along a direction of the grid without what lies in one of the convex meshes."""
    spans, counts = rays.spans, rays.counts
    for body in bodies:
        low, high = (ends[:, :, None] for ends in chords_of(body.surface, grid, direction, rays.tile_of))
        met = np.isfinite(low) & np.isfinite(high) & (low < high)
        used = np.arange(spans.shape[2] // 2) < counts[:, :, None]
        starts, ends = np.where(used, spans[:, :, ::2], np.inf), np.where(used, spans[:, :, 1::2], -np.inf)
        first = np.stack([starts, np.where(met, np.minimum(ends, low), ends)], axis=3)
        second = np.stack([np.where(met, np.maximum(starts, high), np.inf), ends], axis=3)
        pieces = np.concatenate([first, second], axis=2)
        kept = pieces[..., 0] + SLIVER < pieces[..., 1]
        order_ = np.argsort(np.where(kept, pieces[..., 0], np.inf), axis=2, kind="stable")
        pieces = np.take_along_axis(pieces, order_[..., None], axis=2)
        counts = kept.sum(axis=2).astype(np.uint8)
        room = max(ROOM, int(counts.max()))
        pieces = np.where((np.arange(pieces.shape[2]) < counts[:, :, None])[..., None], pieces, 0.0)
        spans = pieces[:, :, :room].reshape(*counts.shape, 2 * room).astype(np.float32)
    cut = rays._replace(spans=np.ascontiguousarray(spans), counts=counts)
    summarise(cut)
    return cut
