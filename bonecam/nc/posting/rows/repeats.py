"""Rows of a tool path that would be blocks of no length: their words are those of the row before."""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool
from numpy import ndarray

from bonecam.nc.posting.path_words import Posted
from bonecam.tool.path import MoveKind, ToolPath

ROWS = ("kinds", "pass_index", "parameters", "contacts", "tips", "axes", "feed_rates")
"""The columns of a tool path, a value a row."""


def moved_rows(posted: Posted) -> Bool[ndarray, "n"]:
    """Which rows of a path move an axis by their words, or must stay: rapids, the first row of a run, and the ends of
    ways on which rotary axes are rewound."""
    path, moves = posted.path, posted.moves
    moved = np.r_[True, np.any(np.diff(posted.words, axis=0) != 0, axis=1)]
    moved[[first for first, _ in posted.runs]] = True
    kept = np.zeros(len(path.tips), dtype=bool)
    np.logical_or.at(kept, moves.rows, moved)
    kept |= path.kinds == MoveKind.RAPID
    kept[path.lifts.ravel()] = True
    kept[-1] = True
    return kept


def with_rows(path: ToolPath, kept: Bool[ndarray, "n"]) -> ToolPath:
    """The path with these rows alone."""
    if kept.all():
        return path
    indices = np.cumsum(kept) - 1
    cones = path.cones and replace(path.cones, cone_of=path.cones.cone_of[kept])
    columns = {name: getattr(path, name)[kept] for name in ROWS}
    return replace(path, **columns, cones=cones, lifts=indices[path.lifts])
