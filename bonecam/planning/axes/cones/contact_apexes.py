"""The contacts of some nodes as apexes of their own: a node's apex is grown by how far its contacts are from it, and
stands for the largest turn of their normals; those of contacts need half of their moves alone."""

from dataclasses import replace

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from bonecam.kernels.closest.cone_marching import Apexes
from bonecam.planning.axes.cones.free_axes import FreeAxes, half_moves
from bonecam.planning.axes.cones.obstacles import rooms_at
from bonecam.planning.collision.scene import Scene
from bonecam.tool.path import ContactPath


def at_contacts(free: FreeAxes, nodes: Int[ndarray, " m"], path: ContactPath, scene: Scene) -> FreeAxes:
    """The free axes of a path with an apex for each contact of these nodes, and none for other nodes; a node of one
    contact that has several apexes keeps them."""
    node_of = free.net.node_of
    of_apex = free.apex_nodes
    several = np.diff(free.starts) > 1
    rows = np.flatnonzero(np.isin(node_of, nodes) & ~several[node_of])
    kept = np.flatnonzero(np.isin(of_apex, nodes) & several[of_apex])
    places = path.centres[rows]
    growth = np.linalg.norm(half_moves(path)[rows] - places[:, None], axis=2).max(axis=1, initial=0.0)
    made = places, growth, path.normals[rows], np.zeros(len(rows)), rooms_at(path.take(rows), scene)
    each = np.r_[node_of[rows], of_apex[kept]]
    order = np.argsort(each, kind="stable")
    apexes = Apexes(*(np.concatenate([new, old[kept]])[order] for new, old in zip(made, free.apexes)))
    counts = np.bincount(each, minlength=len(free.net.places))
    return replace(free, apexes=apexes, starts=np.cumsum(np.r_[0, counts]))
