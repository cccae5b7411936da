"""Material: what stands while the program runs, for the planner and for the proof alike.

Notation:

    ray, tri-dexel     a line with its intervals in material; three sets of parallel ones, equally inclined to Z
    height field       how high, mm, material stands on the vertices of a level, along the lines from level to level
    in-process stock   the material that stands before a path
    depth of cut       how far below the surface that stood before it a move removes material, mm
    in-process mesh    a closed mesh that holds what stands, for the clearance of shank, holder and spindle
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
