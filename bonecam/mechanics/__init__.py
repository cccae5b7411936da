"""Mechanics: what force a cut takes, how far what is cut and cutter give way, and what error that leaves.

Notation:

    slice          the part of what stands between two heights, its section taken as even
    compliance     displacement for a force, mm/N, as a matrix (3, 3)
    shoulder       step from a slender to a wide section, which gives way as .24 diameters more of the slender one
    engagement     the part of a cutter's edge that lies in material before a move is cut
    chip           what one edge takes: the feed a tooth fz, thinner where the surface leans along the feed
    mean, peak     the force over a turn of the spindle: its mean vector, and the largest
    error kept     how far a finished place stays from where it should be, along its normal: what bending leaves
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
