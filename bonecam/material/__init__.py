"""Material: what stands while the program runs, for the planner and for the proof alike.

level set of rays (tri-dexels)   parallel lines along X, Y and Z, each with the intervals that lie in material
dexel              one such interval, mm
in-process stock   the material that stands before a path
depth of cut       distance from the in-process stock's surface to the finished one along the surface's normal, mm
footprint, hull    vertices of a level's mesh moved out to the surface of what stands there
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
