from .cutter import Cutter as Cutter
from .path import ContactPath as ContactPath
from .path import FreeCones as FreeCones
from .path import MoveKind as MoveKind
from .path import ToolPath as ToolPath
