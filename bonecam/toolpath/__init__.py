"""Stage 5, toolpath: passes of a ball-end cutter on a level, their distance limited by the scallop height."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
