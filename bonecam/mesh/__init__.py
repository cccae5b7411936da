"""Stage 1, mesh: triangle meshes, their files, units, repair, harmonic rows and distances."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
