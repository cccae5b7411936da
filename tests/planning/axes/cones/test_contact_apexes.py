"""The contacts of a node as apexes: all of them, each with its own moves, normal and room."""

import numpy as np

from bonecam.planning.axes.cones import AxisCones, at_contacts
from bonecam.planning.scene import Scene
from bonecam.tool.path import ContactPath


def test_each_contact_of_the_nodes_is_an_apex_with_less_growth_and_no_less_room(
    made: tuple[ContactPath, Scene], cones: AxisCones
) -> None:
    path, scene = made
    free = cones.free
    alone = np.diff(free.starts) == 1
    nodes = np.flatnonzero(alone & (np.bincount(free.net.node_of) > 1))[:40]
    near = at_contacts(free, nodes, path, scene)
    node = near.apex_nodes
    contacts = np.flatnonzero(np.isin(free.net.node_of, nodes))
    assert len(node) == len(contacts) > 2 * len(nodes)
    assert set(node.tolist()) == set(nodes.tolist())
    assert {tuple(place) for place in near.apexes.places} == {tuple(place) for place in path.centres[contacts]}
    assert near.apexes.growth.mean() < 0.8 * free.net.reach[node].mean()
    assert (near.apexes.room >= free.apexes.room[free.starts[node]]).all()
    away = np.linalg.norm(near.apexes.places - free.net.places[node], axis=1)
    assert (away <= free.net.reach[node] + 1e-9).all()


def test_nodes_with_several_apexes_keep_them(made: tuple[ContactPath, Scene], cones: AxisCones) -> None:
    path, scene = made
    several = np.flatnonzero(np.diff(cones.free.starts) > 1)
    near = at_contacts(cones.free, several, path, scene)
    kept = np.isin(cones.free.apex_nodes, several)
    np.testing.assert_array_equal(near.apexes.places, cones.free.apexes.places[kept])
    np.testing.assert_array_equal(near.apex_nodes, cones.free.apex_nodes[kept])
