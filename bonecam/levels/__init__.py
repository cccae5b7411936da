"""Stage 4, levels: the surfaces between the part and the stock, each one cut apart from the next."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
