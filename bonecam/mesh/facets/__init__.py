"""Facets between points: triangulation, normals, curvature, and which side of them a point is on."""
