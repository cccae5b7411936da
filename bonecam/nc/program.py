"""A posted program: its text and what was counted while writing it."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Program:
    """An NC program as text, ending with a newline.

    `blocks` are its blocks (comments and continued blocks count once), `moves` the blocks that move an axis.
    `time_min` is from feeds and axis speeds, without accelerations, tool changes and retracts of unknown
    length. `rotary_max_deg_per_block` is the largest turn of one axis in a feed move, `tools` the cutter
    numbers in their order.
    """

    text: str
    name: str
    machine: str
    controller: str
    extension: str
    blocks: int
    moves: int
    split_moves: int
    rewinds: int
    tools: tuple[int, ...]
    time_min: float
    rotary_max_deg_per_block: float
