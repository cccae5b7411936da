from .beam import Beam as Beam
from .beam import Sections as Sections
from .beam import Support as Support
from .beam import column_sections as column_sections
from .beam import join as join
from .beam import mesh_sections as mesh_sections
from .beam import ray_sections as ray_sections
from .beam import shoulder as shoulder
