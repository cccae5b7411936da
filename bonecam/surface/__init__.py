"""Stage 2: the T-spline surface: kernel, fit, tessellation, files.

Functions that share their name with the module they live in (fit, skin, refine, diagnose, project,
tessellate, deviation) are the functions here: write `from bonecam.surface.fitting.fit import ...` for what
else the module holds.
"""

from bonecam.surface.basis.elements import Elements
from bonecam.surface.files.iga import read_iga, write_iga
from bonecam.surface.files.tspline_text import read_tsm, write_tsm
from bonecam.surface.fitting.deviation import Deviation, deviation
from bonecam.surface.fitting.fit import Fit, fit
from bonecam.surface.query.curvature import Curvature
from bonecam.surface.query.diagnose import Diagnosis, diagnose
from bonecam.surface.query.project import Projection, project
from bonecam.surface.refinement.as_general import as_general
from bonecam.surface.refinement.refine import refine
from bonecam.surface.skinning.skin import skin
from bonecam.surface.tessellation.tessellate import Tessellation, tessellate
from bonecam.surface.tmesh.extracted import ExtractedTMesh
from bonecam.surface.tmesh.general import TMesh
from bonecam.surface.tmesh.open_rows import OpenRowTMesh
from bonecam.surface.tmesh.rows import RowTMesh
from bonecam.surface.tspline import TSpline

__all__ = [
    "Curvature", "Deviation", "Diagnosis", "Elements", "ExtractedTMesh", "Fit", "OpenRowTMesh", "Projection", "RowTMesh", "TMesh",
    "TSpline", "Tessellation", "as_general", "deviation", "diagnose", "fit", "project", "read_iga", "read_tsm", "refine", "skin",
    "tessellate", "write_iga", "write_tsm",
]  # fmt: skip
