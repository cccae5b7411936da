from .limits import AxisLimits as AxisLimits
from .orient import orient as orient
from .scene import Scene as Scene
