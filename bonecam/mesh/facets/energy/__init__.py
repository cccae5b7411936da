"""Elastic energy and Voronoi areas of values at the vertices of facets (Xu et al. 2013, Eqs. 10 and 22)."""
