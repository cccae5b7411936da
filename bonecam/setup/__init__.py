"""Setup: the stock, how the part lies in it, and how deep each cut may be.

Notation:

    stock       what is machined: capsule, box, cylinder or mesh, upright on the Z axis; the table is z = 0
    schedule    d_k, the depth allowed to cut k; K cuts from the stock to the part
    rounding    radius by which the stock's edges are rounded so that levels can follow
    offset, rotation   the pose of the part in its stock
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
