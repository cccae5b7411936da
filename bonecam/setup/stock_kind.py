"""How a job gives a stock: what each kind of stock, a file of `bonecam.setup.stocks`, tells of itself."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import cast

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import JobError, did_you_mean
from bonecam.job import StockJob, field_error
from bonecam.job.stock_section import PUBLISHED_KINDS
from bonecam.runtime.extensions import added, run_added
from bonecam.setup.schedule import Schedule
from bonecam.setup.stock import Stock

POSE_FIELDS = ("offset_x", "offset_y", "offset_z", "tilt_x_deg", "tilt_y_deg", "turn_deg")
"""The fields of [stock] that say how the part lies in it."""

SIZES = ("diameter", "length", "width", "depth", "mesh", "scale")
"""The fields of [stock] that are sizes: a kind has some of them."""


@dataclass(frozen=True, eq=False)
class LyingPart:
    """The part as it lies in its stock: points (n, 3), mm, with the stock's axis along Z.

    `middle` is the height of the middle of a stock of given length.
    """

    points: Float[ndarray, "n 3"]
    middle: float


@dataclass(frozen=True)
class StockKind:
    """A kind of stock.

    `sizes` are the fields of [stock] that give its size. `make` gives the stock round a part. `shape` is what must
    be mounted, in words for the program's header. `turn` gives an angle about Z (degrees) and the middle (x, y) of
    the part's base then, where the kind finds them itself. `centres` tells whether a part is shifted across the
    axis to the best place in a stock of given sizes.
    """

    sizes: tuple[str, ...]
    make: Callable[[StockJob, LyingPart, Schedule], Stock]
    shape: str
    turn: Callable[[StockJob, Float[ndarray, "n 3"]], tuple[float, Float[ndarray, "2"]] | None] = lambda job, points: (
        None
    )
    centres: bool = False


def kind_of(job: StockJob) -> StockKind:
    """What the kind of stock of a job tells of itself."""
    return _kind(job.kind)


def stock_round(job: StockJob, part: "LyingPart", schedule: Schedule) -> Stock:
    """The stock of a job round a part. JobError where a kind that was added makes none."""
    make = kind_of(job).make
    if job.kind in PUBLISHED_KINDS:
        return make(job, part, schedule)
    with run_added("stocks", job.kind):
        stock = make(job, part, schedule)
    if not isinstance(stock, Stock):
        what = f"the stock {job.kind!r} that was added makes {stock!r}"
        raise JobError(f"{what}: let `make` return a stock, such as a ConvexStock", name=job.kind)
    return stock


def _kind(name: str) -> StockKind:
    if find_spec(f"bonecam.setup.stocks.{name}"):
        return cast(StockKind, import_module(f"bonecam.setup.stocks.{name}").KIND)
    kind = added("stocks", name, "KIND")
    if not isinstance(kind, StockKind):
        raise JobError(f"the stock {name!r} that was added is {kind!r}: give a StockKind as KIND", name=name)
    return kind


def check_sizes(job: StockJob) -> None:
    """JobError where a size is given that this kind of stock does not have, which would be ignored, or where the kind
    has one that is no field of [stock]. Kinds that a user added and the job does not name are not loaded."""
    sizes_of = {name: _kind(name).sizes for name in (*PUBLISHED_KINDS, job.kind)}
    own = sizes_of[job.kind]
    for size in own:
        if size not in StockJob.__dataclass_fields__:
            what = f"the stock {job.kind!r} has the size {size!r}, which is no field of [stock]"
            raise JobError(f"{what}{did_you_mean(size, SIZES)}: use {', '.join(SIZES)}", name=job.kind)
    for size in SIZES:
        value = getattr(job, size)
        if size not in own and value != getattr(StockJob, size):
            kinds = " or ".join(kind for kind, sizes in sizes_of.items() if size in sizes)
            why = f"a {job.kind} has none: give {' and '.join(own)}, or kind = {kinds}"
            raise field_error("stock", size, value, why)


def is_posed(job: StockJob) -> bool:
    """Whether a job says how the part lies in its stock."""
    return any(getattr(job, name) for name in POSE_FIELDS)


def pose_remedy(job: StockJob) -> str:
    """The end of a refusal's remedy where the job says how the part lies in its stock; else nothing."""
    given = [f"stock.{name}" for name in POSE_FIELDS if getattr(job, name)]
    return f", or less of {', '.join(given)}" if given else ""


def half_size(size: float, extent: Float[ndarray, " n"], allowance: float) -> float:
    """Half a given size, or where that is 0 the largest of the part's coordinates and the allowance, mm."""
    return size / 2 or float(np.abs(extent).max()) + allowance
