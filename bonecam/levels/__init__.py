"""Levels: the surfaces between the part and the stock, each at most one depth of cut from the next (Gan et al. 2014).

Notation:

    P_k, D          control points of level k (level 0 is the part, level K the stock), and what they are moved by
    d_k             the depth allowed to cut k, mm
    K_min           the fewest cuts that any sequence with these depths could have
    H_l, R_l        target of sample l on the stock, and the row of blending functions there: x_l + R_l D towards H_l
    energy          attraction to the stock + thin plate + stretching, quadratic in D
    limits          depth, nesting and stock as linear or cone constraints at watched samples, exchanged until all hold
    certificate     an upper bound of a depth over whole elements, from control nets instead of samples
    edge rounding   levels between the stock with rounded edges and the stock itself
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
