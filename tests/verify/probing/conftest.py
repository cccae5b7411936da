"""A program on a pebble as it was simulated."""

from dataclasses import replace

import numpy as np
import pytest

from bonecam.job import Job
from bonecam.machine.machine import read_machine
from bonecam.nc.dialect import read_dialect
from bonecam.nc.posting import write_program
from bonecam.tool.path import MoveKind
from bonecam.verify.probing import PostedProgram
from bonecam.verify.removal import simulate_removal
from bonecam.verify.sweeping import Accuracy
from bonecam.workholding.post import Post

PAIR = read_machine("mikron-ucp600"), read_dialect("heidenhain")


@pytest.fixture(scope="session")
def posted(path_of, pebble, finishing_cutter, roughing_cutter, upright_capsule):
    """Rings 0.3 mm apart round the middle of a pebble, the axis along the normal but for a lean upwards."""
    part = pebble()
    tool = replace(finishing_cutter, flute_length=8.0)
    rows = []
    for t in np.linspace(0.62, 0.4, 12):
        s = np.linspace(0, 1, 121)
        points, normals = part.positions(s, np.full(121, t)), part.normals(s, np.full(121, t))
        up = np.array([0.0, 0.0, 1.0]) - normals[:, 2:] * normals
        axes = np.cos(0.5) * normals + np.sin(0.5) * up / np.linalg.norm(up, axis=1, keepdims=True)
        rows += list(zip(points + tool.radius * (normals - axes), axes, [MoveKind.CUT] * 121))
    (tip, axis, _), (last, lean, _) = rows[0], rows[-1]
    rows = [(tip + 12 * axis, axis, MoveKind.RAPID), *rows, (last + 12 * lean, lean, MoveKind.LINK)]
    tips, axes, kinds = (np.array(column) for column in zip(*rows))
    path = path_of(tips, axes, kinds=kinds.astype(np.int64), tool=tool, level=0)
    text = write_program([path], *PAIR, Job()).text
    cutters = (roughing_cutter, tool)
    post = Post(1.0, 32.0)
    removal = simulate_removal(text, *PAIR, upright_capsule, post, cutters, part=part, accuracy=Accuracy(0.2))
    return PostedProgram(text, *PAIR, cutters, part, removal)
