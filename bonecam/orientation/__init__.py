"""Stage 6, orientation: tool axes free of collision, and the moves between passes."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
