"""The finished part or its stock as a beam, before anything is cut: on neck and stub, and under a tailstock."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.job import HoldingJob
from bonecam.job.materials.mechanical import StiffnessTable
from bonecam.mechanics.beam import Beam
from bonecam.mechanics.sections import Sections, column_sections, join, mesh_sections, shoulder
from bonecam.mechanics.tailstock import tailstock_support
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.workholding.post import Post

SHARE = 95.0
"""Compliance is told of this share of the area, in percent."""


def finished_beam(body: TriangleMesh, post: Post, holding: HoldingJob, stiffness: StiffnessTable) -> Beam:
    """The finished part, or whatever `body` is made of it, on its neck and stub as a beam that the chuck, or else the
    table, holds rigidly, and a tailstock at its free end."""
    diameter = 2 * post.radius
    foot = max(holding.chuck_height, holding.riser_height)
    pieces: list[Sections] = []
    if holding.stub_length:
        pieces.append(column_sections(holding.stub_diameter / 2, foot, holding.support_height))
        pieces.append(shoulder(diameter, holding.support_height, holding.stub_diameter))
    above = mesh_sections(body, post.top)
    wide = 2 * float(np.sqrt(np.interp(post.top + diameter, above.z, above.area) / np.pi))
    pieces.append(column_sections(post.radius, holding.support_height, post.top))
    pieces += [shoulder(diameter, post.top, max(wide, diameter)), above]
    support = tailstock_support(holding, post.pin, stiffness.elasticity)
    return Beam(join(pieces), stiffness.elasticity, support=support)


def normal_compliance(beam: Beam, part: TriangleMesh) -> float:
    """Compliance (mm/N) along the normal that SHARE of the part's area does not exceed."""
    compliances, areas = normal_compliances(beam, part)
    order = np.argsort(compliances)
    below = np.cumsum(areas[order]) / areas.sum()
    return float(compliances[order][np.searchsorted(below, SHARE / 100)])


def normal_compliances(beam: Beam, part: TriangleMesh) -> tuple[Float[ndarray, " f"], Float[ndarray, " f"]]:
    """Compliance along the normal (mm/N) and twice the area (mm2) of each face of the part."""
    middles = part.vertices[part.faces].mean(axis=1)
    vectors = part.face_vectors
    areas = np.linalg.norm(vectors, axis=1)
    normals = vectors / np.maximum(areas, np.finfo(float).tiny)[:, None]
    return np.einsum("ni,nij,nj->n", normals, beam.compliance(middles), normals), areas
