"""Mesh: triangle meshes, their files and units, repair, pose, facets, harmonic rows and distances.

Notation:

    V, F            vertices (n, 3), mm, and faces (m, 3) with outward normals
    given mesh      as it was read and scaled; the part is that mesh repaired and placed
    hollow, pit     what the smallest ball of a job cannot reach; filled up to the ball (closing by a ball)
    seam, junction  vertices that should be one; edges and vertices at which shells touch
    harmonic rows   closed curves round the part, the level sets of a harmonic function between its poles
    facet           Delaunay neighbours of a contact (Xu et al. 2013, section 2); MLS curvature k1 >= k2
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
