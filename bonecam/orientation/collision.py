"""The judge: FCL collision of the tessellated tool with level, material, post and table. The only importer of
fcl.

FCL reports intersecting surfaces, never containment, so points of the tool are tested for being inside the
meshes, and a point of each obstacle for being inside the tool.
"""

import fcl
import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.orientation.clear import SLACK
from bonecam.orientation.scene import Scene
from bonecam.setup.holding import Post
from bonecam.toolpath.cutter import Cutter

SIDES = 48
TABLE_HALF_WIDTH = 2000.0


class Judge:
    """Collision tests of one cutter in one scene. `margin` (mm) thickens shank and holder."""

    def __init__(self, scene: Scene, cutter: Cutter, margin: float = 0.0) -> None:
        self._scene, self._cutter = scene, cutter
        self._tools = {
            name: _object(mesh)
            for name, mesh in tool_meshes(cutter, margin + scene.material_deviation).items()
        }
        slim, thick = scene.post, scene.thick_post(cutter.radius)
        table = _object(_table())
        level, material = _object(scene.level), _object(scene.material)
        self._against = {
            "cutter": (level, _object(_post_mesh(slim)), table),
            "shank": (material, _object(_post_mesh(thick)), table),
            "holder": (material, _object(_post_mesh(thick)), table),
        }
        self._air = {**self._against, "cutter": (material, *self._against["cutter"][1:])}
        self._request = fcl.CollisionRequest(num_max_contacts=1, enable_contact=False)

    def hits(self, tip: Float[ndarray, "3"], axis: Float[ndarray, "3"], *, cutting: bool = True) -> str:
        """The name of the first part of the tool that collides (cutter, shank, holder), or an empty
        string."""
        transform = fcl.Transform(_rotation(axis), tip)
        for name, tool in self._tools.items():
            tool.setTransform(transform)
            for obstacle in (self._against if cutting else self._air)[name]:
                if fcl.collide(tool, obstacle, self._request, fcl.CollisionResult()):
                    return name
        return self._contained(tip, axis, cutting)

    def _contained(self, tip: ndarray, axis: ndarray, cutting: bool) -> str:
        """Which part lies wholly inside a mesh, the post or the table, or holds an obstacle inside itself."""
        for name, start, end, radius in self._cutter.sections:
            touching = cutting and name == "cutter"
            middle = (tip + (start + end) / 2 * axis)[None]
            mesh: MeshDistance = self._scene.level_distance if touching else self._scene.material_distance
            post = self._scene.post if name == "cutter" else self._scene.thick_post(self._cutter.radius)
            if mesh.signed(middle)[0] < 0 or post.distance(middle)[0] < 0 or middle[0, 2] < 0:
                return name
            obstacle = self._scene.level if touching else self._scene.material
            for point in (obstacle.vertices[0], np.array([0.0, 0.0, post.top])):
                height = (point - tip) @ axis
                if start < height < end and np.linalg.norm(point - tip - height * axis) < radius - SLACK:
                    return name
        return ""


def tool_meshes(cutter: Cutter, margin: float = 0.0) -> dict[str, TriangleMesh]:
    """Closed meshes of cutter, shank and holder with the tip at the origin and the axis along +Z.

    The cutter is shrunk by SLACK; shank and holder hold their true shapes, thickened by `margin`.
    """
    around = 1 / np.cos(np.pi / SIDES)
    ball, shank, holder = cutter.sections
    angle = np.linspace(0, np.pi / 2, 9)[1:]
    thin = cutter.radius - SLACK
    rings = [(cutter.radius - thin * float(np.cos(a)), thin * float(np.sin(a))) for a in angle]
    shapes = {"cutter": revolved([*rings, (ball[2], thin)], cutter.radius - thin)}
    for name, start, end, radius in (shank, holder):
        wide = (radius + margin) * around
        shapes[name] = revolved([(start - margin, wide), (end + margin, wide)], start - margin)
    return shapes


def revolved(rings: list[tuple[float, float]], bottom: float) -> TriangleMesh:
    """The closed solid of circles (height, radius), with points at `bottom` and on the last circle's plane,
    about +Z."""
    angle = np.arange(SIDES) * (2 * np.pi / SIDES)
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(SIDES)])
    vertices = (
        [np.array([[0.0, 0.0, bottom]])]
        + [r * circle + [0.0, 0.0, z] for z, r in rings]
        + [np.array([[0.0, 0.0, rings[-1][0]]])]
    )
    here, there = np.arange(SIDES), np.roll(np.arange(SIDES), -1)
    faces = [np.column_stack([np.zeros(SIDES, int), 1 + there, 1 + here])]
    for k in range(len(rings) - 1):
        a, b = 1 + k * SIDES, 1 + (k + 1) * SIDES
        faces += [
            np.column_stack([a + here, a + there, b + there]),
            np.column_stack([a + here, b + there, b + here]),
        ]
    last = 1 + (len(rings) - 1) * SIDES
    faces.append(np.column_stack([last + here, last + there, np.full(SIDES, last + SIDES)]))
    return TriangleMesh(np.vstack(vertices), np.vstack(faces).astype(np.int32))


def _post_mesh(post: Post) -> TriangleMesh:
    wide = post.radius / np.cos(np.pi / SIDES)
    return revolved([(0.0, wide), (post.top, wide)], 0.0)


def _table() -> TriangleMesh:
    """A slab below z = 0."""
    w = TABLE_HALF_WIDTH
    corners = np.array([[x, y, z] for z in (-w, 0.0) for x, y in ((-w, -w), (w, -w), (w, w), (-w, w))])
    quads = [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    return TriangleMesh(
        corners, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))], dtype=np.int32)
    )


def _object(mesh: TriangleMesh) -> fcl.CollisionObject:
    model = fcl.BVHModel()
    model.beginModel(len(mesh.vertices), len(mesh.faces))
    model.addSubModel(np.array(mesh.vertices), np.array(mesh.faces))
    model.endModel()
    return fcl.CollisionObject(model, fcl.Transform())


def _rotation(axis: ndarray) -> ndarray:
    """A rotation that takes +Z to `axis`."""
    side = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(side, axis)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x), axis])
