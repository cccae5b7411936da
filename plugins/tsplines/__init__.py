"""T-meshes of any kind: general ones and Bezier elements, their files (.tsm, .iga), local refinement and diagnosis.

A surface over them is a `bonecam.surface.TSpline` and does what others do: its `refine` cuts faces of a general T-mesh.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
