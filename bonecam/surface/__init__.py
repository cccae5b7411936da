"""Surface: T-splines, their fit to a mesh, skinning, refinement, tessellation and files.

Notation:

    S(s, t)           the surface: s in [0, 1) round the part, t in [0, 1] from the lower to the upper pole
    P, w              control points (n, 3), mm, and their weights
    T-mesh            the grid of control points, whose rows may end in T-junctions (Sederberg et al. 2003)
    knot interval     distance of two neighbouring knots; a local knot vector has five of a cubic blending function
    B_i(s, t)         blending functions; they sum to one
    element           a patch of the parameter domain on which the surface is one bicubic (Bezier extraction)
    deviation         largest distance between surface and mesh, one way each, mm
    chord tolerance   largest distance between the surface and its tessellation, mm
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
