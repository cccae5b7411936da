"""Whether a closed surface bounds a body: levels can be made round no other."""

from bonecam.errors import SurfaceError, place_name
from bonecam.mesh.solids.intersections import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.tessellation.tessellate import tessellate
from bonecam.surface.tmesh.surface import Surface


def require_valid(surface: Surface, chord_tolerance: float, name: str) -> TriangleMesh:
    """The tessellation within `chord_tolerance` mm; SurfaceError where the closed surface cuts itself or its
    normals point inwards."""
    mesh = tessellate(surface, chord_tolerance).mesh
    what = f"{name}: the surface of {surface.tmesh.size} control points"
    cut = self_intersections(mesh)
    if len(cut):
        place = mesh.vertices[mesh.faces[cut]].mean(axis=1)[0]
        remedy = "raise surface.max_control_points, or smooth the mesh or fill the cleft there"
        raise SurfaceError(
            f"{what} cuts itself in {len(cut)} faces, first near {place_name(place)}: {remedy}", faces=cut, place=place
        )
    if mesh.volume <= 0:
        raise SurfaceError(
            f"{what} is turned inside out, its normals point inwards: reverse its s parameter or do not mirror it"
        )
    return mesh
