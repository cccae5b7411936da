from .dexels import Dexels as Dexels
from .dexels import uncut_rays as uncut_rays
from .in_process_stock import InProcessStock as InProcessStock
from .in_process_stock import remove_material as remove_material
from .in_process_stock import uncut_material as uncut_material
