"""Verify: the posted text is read back and proved against paths, part, machine and the mesh as given.

Notation:

    readback     the text's tips and axes beside those that were planned
    gouge        how far the ball goes into the surface, mm
    removal      what the text removes from the stock, level by level, by rays
    given        the mesh as it was given, before repairs
    verdict      a bound that a program keeps, or is refused
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
