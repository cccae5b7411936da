"""Study: strategies side by side on one part (Gan et al. 2014, section 5.3), and what a probe tells of a program.

Notation:

    strategy     a way to machine the part: morphing as published, as bonecam does it, iso-height, rotary
    row          what came of one strategy, or why nothing did
    claim        what the paper says of the strategies, beside what came out
    band         the largest deviation that the paper names, 0.05 mm
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
