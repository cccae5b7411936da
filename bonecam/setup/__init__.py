"""Stage 2, setup: the stock, how the part lies in it and is held, and how deep each cut may be."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
