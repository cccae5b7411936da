"""Certify the cuts of a sequence of levels, one by one."""

from collections.abc import Sequence

import numpy as np

from bonecam.levels.measure.certificates.certificate import Certificate
from bonecam.levels.measure.certificates.depth import bound_depth
from bonecam.levels.measure.certificates.nesting import bound_nesting
from bonecam.levels.measure.certificates.nets import bezier_nets
from bonecam.levels.measure.certificates.stock_depth import bound_stock_depth
from bonecam.levels.measure.certificates.stock_distance import bound_inside, bound_outside
from bonecam.progress import Progress, report, silent
from bonecam.setup.stock import Stock
from bonecam.surface.tspline import TSpline


def certify(
    surfaces: Sequence[TSpline], stock: Stock, limits: Sequence[float], *, progress: Progress = silent
) -> tuple[Certificate, ...]:
    """One certificate for each cut: between levels 0 to K - 1 (`surfaces`), and from the last of them to the
    stock; limits in mm.

    Raises ValueError for surfaces that are not closed row-structured T-splines with poles and weights of one.
    """
    if len(limits) != len(surfaces):
        raise ValueError(f"{len(surfaces)} levels and the stock need as many limits, not {len(limits)}")
    certificates = []
    for k, (inner, limit) in enumerate(zip(surfaces, limits), start=1):
        report(progress, k / len(surfaces), f"certifying level {k}")
        if k < len(surfaces):
            certificates.append(certify_cut(inner, surfaces[k], stock, limit))
        else:
            certificates.append(certify_last_cut(inner, stock, limit))
    return tuple(certificates)


def certify_cut(inner: TSpline, outer: TSpline, stock: Stock, limit: float) -> Certificate:
    """The certificate of the cut from level k (`outer`) down to level k - 1 (`inner`), at most `limit` mm
    deep."""
    nets = bezier_nets(outer)
    of_outer = bound_depth(outer, inner, limit)
    of_inner = bound_depth(inner, outer, limit)
    nesting, nesting_place = bound_nesting(inner, nets)
    outside, outside_place = bound_outside(nets, stock)
    deeper = of_inner if of_inner.distance > of_outer.distance else of_outer
    return Certificate(
        depth=deeper.distance,
        nesting=nesting,
        outside=outside,
        depth_place=deeper.place,
        nesting_place=nesting_place,
        outside_place=outside_place,
        too_deep=np.vstack([of_outer.too_deep, of_inner.too_deep]),
        pieces=of_outer.pieces + of_inner.pieces,
    )


def certify_last_cut(inner: TSpline, stock: Stock, limit: float) -> Certificate:
    """The certificate of the last cut, from the stock down to level K - 1 (`inner`), at most `limit` mm
    deep."""
    nets = bezier_nets(inner)
    stock_depth, stock_place, pieces = bound_stock_depth(inner, stock, limit)
    inside, inside_place = bound_inside(nets, stock, limit)
    outside, outside_place = bound_outside(nets, stock)
    depth_place = inside_place if inside > stock_depth else stock_place
    return Certificate(
        depth=max(stock_depth, inside),
        nesting=-outside,
        outside=0.0,
        depth_place=depth_place,
        nesting_place=outside_place,
        outside_place=depth_place,
        too_deep=np.empty((0, 2)),
        pieces=pieces,
    )
