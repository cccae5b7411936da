"""Machine: the five-axis mill as data, its kinematics and limits, the bodies that a tool path keeps clear of.

Notation:

    x y z, a b c      linear words (mm) and rotary words (rad)
    tool axis         unit vector from the tip to the spindle, in the frame of the part
    polar angle       angle between the tool axis and +Z; the azimuth is its turn about Z
    kinematic chain   rotary axes and XYZ in their order from the part outward to the tool
    tool-centre control (TCPM, RTCP)  the control moves the tip, not the joints
    gauge line        where the holder meets the spindle nose
    frustum           a cylinder or cone of a holder, a nose, or what stands on the table
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
