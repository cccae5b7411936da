from .collision.scene import Scene as Scene
from .cones.cone import ObliqueEllipticCone as ObliqueEllipticCone
from .cones.cone import oblique_elliptic_cone as oblique_elliptic_cone
from .cones.intersection import IntersectionCurve as IntersectionCurve
from .cones.intersection import intersect as intersect
from .level_paths import plan_paths as plan_paths
from .limits import AxisLimits as AxisLimits
from .oriented_path import orient as orient
