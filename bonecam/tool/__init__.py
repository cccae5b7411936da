"""Tool: cutters as bodies of revolution, and the paths they take, as values that pass from stage to stage.

Notation:

    R          radius of the ball, mm
    tip        lowest point of the ball on the tool axis; the centre lies R above it
    contact    where the ball touches the surface; centre = contact + R n, n the outward normal
    lift       what the centre is raised along n where the ball would gouge, mm
    lead       angle between n and the tool axis
    overhang   length of the tool below the holder (stick-out), mm
    cut, link, rapid   kinds of moves: at the feed on a pass, at the feed between passes, at the machine's rapid rate
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
