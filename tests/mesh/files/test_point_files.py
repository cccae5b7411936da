"""Points from text files, and surfaces round point clouds."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bonecam.errors import FileError, MeshError
from bonecam.mesh.files.mesh_files import read_mesh
from bonecam.mesh.files.points import read_blocks, reconstruct
from bonecam.mesh.triangle_mesh import TriangleMesh

SAME = {
    "a.xyz": "1 2 3\n4 5 6.5\n\n\n7 8 9\n",
    "a.csv": "x, y, z\n1,2,3\n4,5,6.5\n\n7,8,9",
    "tabs.txt": "# a comment\n1\t2\t3\t0 0 1\n4\t5\t6.5\t0 0 1\n\n7\t8\t9\t0 0 1\n",
    "turbo.dat": "# Profile 1 at 0%\n\t1 2 3\n4 5 6.5\n# Profile 2 at 20%\n7 8 9\n",
    "units.csv": '"X [mm]";"Y [mm]";"Z [mm]"\n1;2;3\n4;5;6,5\n\n7;8;9\n',
    "german.csv": "1,0;2,0;3,0\n4;5;6,5\n\n7;8;9\n",
    "german.asc": "1,0 2,0 3\n4 5\t6,5\n\n7,0E0 8 9\n",
    "narrow.csv": "1,2 ,3 ,4\n4, 5 ,6.5\n\n7,8  9\n",
    "heads.txt": "2 3\n1 2 3\n4 5 6.5\n1 3\n7 8 9\n",
    "count.pts": "2\n\n1 2 3\n4 5 6.5\n1\n# a comment\n7 8 9\n",
    "index.csv": ",x,y,z\n0,1,2,3\n1,4,5,6.5\n\n2,7,8,9\n",
    "quoted.csv": '"","x","y","z"\n0,1,2,3\n1,4,5,6.5\n\n2,7,8,9\n',
    "hash.csv": "#,x,y,z,\n0,1,2,3,\n1,4,5,6.5\n,,,\n2,7,8,9\n",
    "normals.csv": "x_normal;x;y;z\n0,5;1;2;3\n0,5;4;5;6,5\n\n0;7;8;9\n",
    "mark.asc": "\ufeff// a comment\n1 2 3\n4 5 6.5\n \n7 8 9",
}


@pytest.mark.parametrize("name", SAME)
def test_every_way_to_write_blocks_of_points_gives_the_same(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(SAME[name], encoding="utf-8")
    first, second = read_blocks(tmp_path / name)
    assert first.tolist() == [[1, 2, 3], [4, 5, 6.5]]
    assert second.tolist() == [[7, 8, 9]]


BAD = {
    "empty.xyz": (b"# nothing\n\n", "holds no points"),
    "word.xyz": (b"1 2 3\n4 five 6\n", "word.xyz line 2: '4 five 6' is no point"),
    "names.csv": (b"x,y,z\nx,y,z\n1,2,3\n", "names.csv line 2"),
    "polar.txt": (b"X R*THETA R\n1 2 3\n", "polar.txt line 1: 'X R*THETA R' is no point: write x y z"),
    "short.csv": (b"1,2,3\n4,5\n", "short.csv line 2: 2 numbers are no point"),
    "nan.xyz": (b"1 2 nan\n", "is not finite"),
    "inf head.xyz": (b"inf\n1 2 3\n", "line 1: 'inf' is not finite"),
    "nan head.xyz": (b"nan 3\n1 2 3\n", "line 1: 'nan 3' is not finite"),
    "far.xyz": (b"1 2 3\n4 -1e308 6\n", "far.xyz line 2: a coordinate of -1e+308: export the points again"),
    "binary.xyz": (b"\xff\xfe\x00\x80", "is no text"),
    "hole.csv": (b"1,2,3,4\n1,,2,3\n", "hole.csv line 2: '1,,2,3' is no point"),
    "wide.csv": (b"x,y,z\n0,1,2,3\n", "wide.csv line 2: 4 numbers under the names of 3 columns: name every column"),
    "stub.csv": (b"n,x,y,z\ninf,1\n", "stub.csv line 2: 'inf,1' is not finite"),
    "turned.csv": (b"x_normal,y_normal,z_normal\n0,1,2\n", "turned.csv line 1"),
    "cut.pts": (b"3\n1 2 3\n4 5 6\n", "cut.pts line 1: tells of 3 points, 2 follow it in one block"),
    "long.xyz": (b"2 3\n1 2 3\n4 5 6\n1\n\n7 8 9\n1 2 3\n", "long.xyz line 4: tells of 1 points, 2 follow"),
    "rows.csv": (b"1 2 3\n4 5 6\n\n1 2 4\n4 5 7\n", "holds 2 rows of points, no mesh"),
    "few.xyz": (b"1 2 3\n4 5 6\n", "2 points are no cloud"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_refused_in_one_line_that_names_it(
    check_refused: Callable[[Path, bytes | str, str], None], name: str, tmp_path: Path
) -> None:
    check_refused(tmp_path / name, *BAD[name])


def cloud(count: int) -> np.ndarray:
    """Points spread evenly on an ellipsoid of half axes 3, 4, 9."""
    k = np.arange(count) + 0.5
    height, angle = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    r = np.sqrt(1 - height**2)
    return np.column_stack([3 * r * np.cos(angle), 4 * r * np.sin(angle), 9 * height])


def test_the_surface_round_a_cloud_is_closed_outward_near_and_twice_the_same(tmp_path: Path) -> None:
    points = cloud(1500) + 100.0
    (tmp_path / "cloud.xyz").write_text("\n".join(" ".join(map(repr, point)) for point in points.tolist()))
    mesh = read_mesh(tmp_path / "cloud.xyz")
    edges = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 3 * 4 * 9, rel=0.01)
    assert reconstruct(points).vertices.tobytes() == mesh.vertices.tobytes()


def test_a_ply_without_faces_is_a_cloud(ellipsoid: Callable[..., TriangleMesh], tmp_path: Path) -> None:
    points = cloud(1000)
    head = (
        f"ply\nformat ascii 1.0\nelement vertex {len(points)}\n"
        + "".join(f"property double {x}\n" for x in "xyz")
        + "end_header\n"
    )
    (tmp_path / "cloud.ply").write_text(
        head + "\n".join(" ".join(map(repr, point)) for point in points.tolist()) + "\n"
    )
    assert read_mesh(tmp_path / "cloud.ply").volume == pytest.approx(ellipsoid(3, 4, 9).volume, rel=0.02)


def test_a_cloud_whose_surface_misses_a_point_is_refused() -> None:
    with pytest.raises(MeshError, match="misses one by"):
        reconstruct(np.vstack([cloud(400), [[0.0, 0.0, 0.0]]]))


def test_a_number_with_an_underscore_is_none(tmp_path: Path) -> None:
    (tmp_path / "a.xyz").write_text("0 0 0\n1_0 0 0\n")
    with pytest.raises(FileError, match=r"a\.xyz line 2: '1_0 0 0' is no point"):
        read_blocks(tmp_path / "a.xyz")


@pytest.mark.parametrize(
    ("lines", "match"),
    [
        (["1 2 3"] * 500, "a.xyz: 1 different points are too few for a surface"),
        ([f"{k}e-320 1e-320 0" for k in range(300)], "so close together that they have no size: export them in mm"),
    ],
)
def test_a_cloud_without_extent_is_refused(lines: list[str], match: str, tmp_path: Path) -> None:
    (tmp_path / "a.xyz").write_text("\n".join(lines))
    with pytest.raises(MeshError, match=match):
        read_mesh(tmp_path / "a.xyz")


def test_points_that_are_given_twice_count_once(tmp_path: Path) -> None:
    once = reconstruct(cloud(2000))
    assert reconstruct(np.repeat(cloud(2000), 2, axis=0)).vertices.tobytes() == once.vertices.tobytes()
