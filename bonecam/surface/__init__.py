"""Stage 2: the T-spline surface: kernel, fit, tessellation, files.

Functions that share their name with the module they live in (fit, skin, refine, diagnose, project, tessellate, deviation) are the
functions here: write `from bonecam.surface.fit import ...` for what else the module holds.
"""

from bonecam.surface.as_general import as_general
from bonecam.surface.curvature import Curvature
from bonecam.surface.deviation import Deviation, deviation
from bonecam.surface.diagnose import Diagnosis, diagnose
from bonecam.surface.elements import Elements
from bonecam.surface.extracted import ExtractedTMesh
from bonecam.surface.files import read_tsm, write_tsm
from bonecam.surface.fit import Fit, fit
from bonecam.surface.general_tmesh import TMesh
from bonecam.surface.iga import read_iga, write_iga
from bonecam.surface.open_rows import OpenRowTMesh
from bonecam.surface.project import Projection, project
from bonecam.surface.refine import refine
from bonecam.surface.skin import skin
from bonecam.surface.tessellate import Tessellation, tessellate
from bonecam.surface.tmesh import RowTMesh
from bonecam.surface.tspline import TSpline

__all__ = [
    "Curvature", "Deviation", "Diagnosis", "Elements", "ExtractedTMesh", "Fit", "OpenRowTMesh", "Projection", "RowTMesh", "TMesh",
    "TSpline", "Tessellation", "as_general", "deviation", "diagnose", "fit", "project", "read_iga", "read_tsm", "refine", "skin",
    "tessellate", "write_iga", "write_tsm",
]  # fmt: skip
