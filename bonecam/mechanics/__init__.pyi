from .beam import Beam as Beam
from .beam import Support as Support
from .sections import Sections as Sections
from .sections import column_sections as column_sections
from .sections import join as join
from .sections import mesh_sections as mesh_sections
from .sections import ray_sections as ray_sections
from .sections import shoulder as shoulder
