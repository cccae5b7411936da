"""Facets between the contacts of a path, their normals, curvature and Voronoi cells (Xu et al. 2013, sections 2, 4)."""
