from .collision.scene import Scene as Scene
from .level_paths import plan_paths as plan_paths
from .limits import AxisLimits as AxisLimits
from .oriented_path import orient as orient
