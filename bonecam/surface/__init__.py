"""Stage 3, surface: T-splines, their fit to a mesh, refinement, tessellation and files."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
