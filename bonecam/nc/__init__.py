"""Stage 7, nc: machines, dialects, writing and reading NC programs."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
