"""A wheel from files: tables of sections and of the hub's flow path, CAD files, T-splines, and meshes."""

from collections.abc import Sequence
from pathlib import Path

from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import SurfaceError
from bonecam.mesh.files.mesh_files import read_in_mm
from bonecam.mesh.files.point_files import POINTS
from bonecam.mesh.triangle_mesh import MeshLike, TriangleMesh, mesh_from
from bonecam.mesh.units import mm_of, to_mm
from bonecam.surface.blades.blade_solid import blade_solid
from bonecam.surface.blades.blunt_edge import rounded_edge, widest_edge
from bonecam.surface.blades.flow_path import MERIDIONAL, read_flow_path
from bonecam.surface.blades.impeller import limits_beside, profile_over, thinned
from bonecam.surface.blades.meridian import hub_profile, meridional, stretch
from bonecam.surface.blades.section_tables import CARTESIAN, read_sections
from bonecam.surface.blades.wheel import COARSE
from bonecam.surface.files.machined_surface import machined_surface
from bonecam.surface.tspline import TSpline

BACK = 4.0
"""A hub that is given by its flow path is solid, with a back of so many mm."""
HUB_CHORD = 0.005
"""Chord tolerance of the hub's profile, mm."""

BladeFile = str | Path | TSpline | Sequence[str | Path]
"""A blade: a file, several files of sections, or the surface itself."""


def read_blade(
    blade: BladeFile, units: str, tolerance: float, *, columns: str = CARTESIAN, axis: str = "z"
) -> tuple[TSpline, float]:
    """The surface of a blade, mm, about the Z axis, and how wide the blunt edge is that was rounded (0: none): tables
    of sections (`columns` and `axis` as in `read_sections`) are skinned within `tolerance` mm, blunt edges rounded;
    other files are those of `machined_surface`."""
    if isinstance(blade, TSpline):
        return blade, 0.0
    files = [blade] if isinstance(blade, str | Path) else list(blade)
    if len(files) == 1 and Path(files[0]).suffix.lower() not in POINTS:
        return machined_surface(files[0], units, tolerance), 0.0
    given = read_sections(files, columns=columns, axis=axis, scale=mm_of(units))
    rows = rounded_edge(given)
    try:
        return rows.skin(tolerance), widest_edge(given) if rows.closed else 0.0
    except (ValueError, SurfaceError) as error:
        raise SurfaceError(f"{files[0]}: {error}", file=str(files[0])) from error


def read_hub(
    hub: str | Path | MeshLike, blade: TSpline, units: str, *, columns: str = MERIDIONAL, axis: str = "z"
) -> Float[ndarray, "n 2"]:
    """The profile of a solid hub, mm: that of a closed mesh of revolution, or of a table of its flow path (`columns` as
    in `read_flow_path`, whose first column runs along the machine's axis, down where `axis` has a -), cut off beside
    the blade."""
    if isinstance(hub, str | Path) and Path(hub).suffix.lower() in POINTS:
        along = "-x" if axis.startswith("-") else "x"
        curve = read_flow_path(hub, columns=columns, axis=along, scale=mm_of(units))
        points = meridional(blade_solid(blade, COARSE).vertices)
        return profile_over(thinned(stretch(curve, *limits_beside(curve, points)), HUB_CHORD), BACK)
    return hub_profile(read_solid(hub, units), str(hub) if isinstance(hub, str | Path) else "the hub")


def read_solid(solid: str | Path | MeshLike, units: str) -> TriangleMesh:
    """The triangles of a solid in a file or in memory, mm."""
    if isinstance(solid, str | Path):
        return read_in_mm(solid, units)
    return to_mm(mesh_from(solid), units)
