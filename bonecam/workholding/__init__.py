"""Workholding: what the part stands on and what carries it, as obstacles to the tool.

Notation:

    post             upright cylinder left between part and table, on the Z axis; parted at the end
    chuck, columns   what holds the post or stands on the table
    clearance        distance that the tool keeps from these, mm
    tailstock        pin or second neck at the free end, under the arm of a bracket
    shell            the form that holds the finished end in the second clamping
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
