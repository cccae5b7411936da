"""Planning: the loop over the levels, from the outermost inward, in `levels.py`.

For each level: contacts and passes (`passes`), their tool axes (`axes`, `collision`), moves between passes (`links`),
the material that stands afterwards (`bonecam.material`). `layers` holds what cuts in layers beside these.

    pass          cutter contacts joined by cutting moves
    step over     distance between neighbouring passes, set by the scallop height h: about sqrt(8 h R) on a plane
    scallop       ridge that two neighbouring passes leave, mm
    engaged segment   stretch of a pass on which the cutter removes material
    rest machining    steps before a level's own path where material stands deeper than a cut may be
    admissible cone   tool axes at a contact for which the tool is proven free (Xu et al. 2013, section 3)
    axis field        T-spline of two angles over the level's parameters; its energy is Eq. 22 of Xu et al. 2013
    link          move between passes: over the surface, or by retract, traverse and approach
    clearance surface   capsule at a fixed distance round the stock, on which the ball centre traverses
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
