from .material import Material as Material
from .material import remove_material as remove_material
from .material import uncut_material as uncut_material
