"""NC: dialects of controls as data, the posting of tool paths, and the reading of programs.

Notation:

    block, word   a line of a program; an address with its number
    dialect       the words of one control: how it states axes, feeds, spindle, tool-centre control
    header        what a program tells the operator before its first move, the air check among it
    inverse time  feed as 1 / minutes of a block (G93)
    rewind        turn of a rotary axis back by 360 degrees, with the tool lifted
    motions       what a text makes the machine do, block by block, as read back
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
