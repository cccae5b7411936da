"""A net of nodes on the surface of ball centres, each of which stands for the contacts round it.

The tool on a contact is the tool at the node moved by less than the node's reach. So what is proven at a node with
that much to spare holds for all of its contacts, and on the moves between them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.spatial import KDTree

from bonecam.arrays import frozen, lengths, unit


@dataclass(frozen=True, eq=False)
class ConeNodes:
    """Nodes at `places` (ball centres, mm); `node_of` each contact; how far a node's contacts are from it, with half
    of the moves that begin or end there (`reach`, mm); their mean normal, and the largest angle of one from it
    (`spread`, radians)."""

    places: Float[ndarray, "k 3"]
    node_of: Int[ndarray, " n"]
    reach: Float[ndarray, " k"]
    normals: Float[ndarray, "k 3"]
    spread: Float[ndarray, " k"]

    def __post_init__(self) -> None:
        for name in ("places", "reach", "normals", "spread"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        object.__setattr__(self, "node_of", frozen(self.node_of, np.int64))


def make_net(
    centres: Float[ndarray, "n 3"], normals: Float[ndarray, "n 3"], middles: Float[ndarray, "n 2 3"], spacing: float
) -> ConeNodes:
    """Nodes about `spacing` (mm) apart; `middles` are those of the moves to and from each contact."""
    cells = np.floor(centres / spacing).astype(np.int64)
    facing = normals @ np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]).T
    _, first = np.unique(np.column_stack([cells, facing.argmax(axis=1)]), axis=0, return_inverse=True)
    means = np.column_stack([_means(first, x) for x in np.hstack([centres, normals]).T])
    # a contact goes to the nearest node that faces its way: a groove's walls are near each other
    apart = np.hstack([means[:, :3] / spacing, unit(means[:, 3:])])
    _, node = KDTree(apart).query(np.hstack([centres / spacing, normals]))
    _, node_of = np.unique(node, return_inverse=True)
    points = np.column_stack([_means(node_of, x) for x in centres.T])
    facing_of = unit(np.column_stack([_means(node_of, x) for x in normals.T]))
    # half a move, being straight, is no further off than its ends
    ends = np.concatenate([centres[:, None], middles], axis=1)
    off = np.linalg.norm(ends - points[node_of][:, None], axis=2).max(axis=1)
    turned = 2 * np.arcsin(np.clip(lengths(normals - facing_of[node_of]) / 2, 0, 1))
    return ConeNodes(points, node_of, _largest(node_of, off), facing_of, _largest(node_of, turned))


def _means(group: Int[ndarray, " n"], values: Float[ndarray, " n"]) -> Float[ndarray, " k"]:
    return np.bincount(group, values) / np.bincount(group)


def _largest(group: Int[ndarray, " n"], values: Float[ndarray, " n"]) -> Float[ndarray, " k"]:
    largest = np.zeros(group.max(initial=-1) + 1)
    np.maximum.at(largest, group, values)
    return largest


def join_nets(nets: Sequence[tuple[ndarray, ConeNodes, ndarray]], contacts: int) -> ConeNodes:
    """One net over all `contacts` of nets over some of them (their rows) each, with those of its nodes that are
    kept."""
    node_of = np.full(contacts, -1)
    count = 0
    for rows, net, kept in nets:
        number = np.where(kept, count + np.cumsum(kept) - 1, -1)
        node_of[rows] = number[net.node_of]
        count += int(kept.sum())
    fields = ("places", "reach", "normals", "spread")
    joined = {name: np.concatenate([getattr(net, name)[kept] for _, net, kept in nets]) for name in fields}
    return ConeNodes(joined["places"], node_of, joined["reach"], joined["normals"], joined["spread"])
