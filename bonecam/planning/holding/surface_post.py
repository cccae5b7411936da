"""The post below a surface that is machined alone: the piece of the solids that it carries, and how thick it is."""

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from bonecam.job import HoldingJob
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.healing.topology import half_edges
from bonecam.mesh.triangle_mesh import TriangleMesh, keep_faces
from bonecam.surface.tspline import TSpline
from bonecam.workholding.bar import in_collet
from bonecam.workholding.post import thickest_below
from bonecam.workholding.tailstock import refuse_tailstock

CHORD = 0.05
"""Chord tolerance of the surface, which tells the pieces of the solids apart, mm."""


def carrying_solid(surface: TSpline, solid: TriangleMesh) -> TriangleMesh:
    """The piece of a solid that the surface belongs to: what is beside it, such as a casing, carries nothing."""
    edges = half_edges(solid).reshape(-1, 2)
    count = len(solid.vertices)
    graph = coo_matrix((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(count, count))
    _, piece = connected_components(graph, directed=False)
    of_face = piece[solid.faces[:, 0]]
    pieces = [keep_faces(solid, of_face == number) for number in np.unique(of_face)]
    if len(pieces) == 1:
        return pieces[0]
    points = surface.tessellate(CHORD).vertices
    away = [float(np.median(MeshDistance(one).unsigned(points))) for one in pieces]
    return pieces[int(np.argmin(away))]


def surface_holding(holding: HoldingJob, surface: TSpline, solid: TriangleMesh) -> HoldingJob:
    """The holding with the sizes that it leaves open but the length: the post as thick as the underside of what carries
    the surface allows, since a solid of any form has no neck, and where nothing is named in a collet on a riser.
    JobError for a tailstock."""
    refuse_tailstock(holding, "what machines a surface alone")
    diameter = holding.diameter or thickest_below(carrying_solid(surface, solid))
    settled = in_collet(holding, diameter) if holding.names_nothing else holding
    return replace(settled, diameter=diameter)
