"""The whole chain as a filter script, MeshLab's filters and ours side by side."""

from pathlib import Path

import bonecam_meshes
import numpy as np
import pymeshlab
import pytest
from bonecam_plugins.meshlab import MeshSet, run_script

from bonecam.errors import BonecamError, UnitsError

CHAIN = """<!DOCTYPE FilterScript>
<FilterScript>
 <filter name="Remove Duplicate Vertices"/>
 <filter name="Repair Bone"/>
 <filter name="Apply Upright Pose"/>
 <filter name="Generate Stock Capsule">
  <Param name="allowance" type="RichPercentage" value="2%"/>
 </filter>
 <filter name="Compute T-Spline Surface">
  <Param name="tolerance" type="RichPercentage" value="0.1"/>
 </filter>
 <filter name="Save T-Spline Surface"/>
 <filter name="Generate Morph Levels"/>
 <filter name="Compute Level Check"/>
 <filter name="Compute Geometric Measures"/>
</FilterScript>
"""


@pytest.fixture(scope="module")
def layers(tmp_path_factory):
    folder = tmp_path_factory.mktemp("chain")
    (folder / "chain.mlx").write_text(CHAIN)
    run_script(folder / "chain.mlx", [bonecam_meshes.path("phalanx")], folder / "out")
    return folder / "out"


@pytest.mark.slow
def test_the_layers_of_a_script_are_written(layers):
    names = {path.name for path in layers.iterdir()}
    assert {
        "phalanx.ply",
        "repaired.ply",
        "stock.ply",
        "part_on_post.ply",
        "surface.ply",
        "surface.tspline",
        "level_00.ply",
    } <= names


@pytest.mark.slow
def test_levels_enclose_one_another_and_carry_their_depth(layers):
    files = sorted(layers.glob("level_*.ply"))
    meshes = pymeshlab.MeshSet()
    volumes = []
    for index, file in enumerate(files):
        meshes.load_new_mesh(str(file))
        volumes.append(meshes.get_geometric_measures()["mesh_volume"])
        depth = meshes.current_mesh().vertex_scalar_array()
        limit = (0.0, *[0.1] * 4, *[0.5] * len(files))[index]
        assert 0.9 * limit <= depth.max() <= limit + 0.002 or file == files[-1]
    assert len(files) > 3
    assert (np.diff(volumes) > 0).all()


def test_a_box_is_told_by_its_sides(phalanx):
    meshes = MeshSet()
    meshes.load_new_mesh(str(phalanx))
    meshes.apply_upright_pose()
    found = meshes.generate_stock(kind="box", width=20.0, depth=14.0, length=38.0)
    assert set(found) == {"kind", "width_mm", "depth_mm", "length_mm", "transform"}
    assert [found[f"{name}_mm"] for name in ("width", "depth", "length")] == pytest.approx([20.0, 14.0, 38.0])
    with pytest.raises(BonecamError, match=r"stock \(box 11\.00 x 5\.00 x 38\.00 mm\) does not hold the part"):
        meshes.generate_stock(kind="box", width=11.0, depth=5.0, length=38.0)


FITTING = r'0\.03\d\d mm from corner to corner .*apply apply_units_in_mm with units="m" \(3\d\.\d mm\)'


@pytest.mark.parametrize(
    "name",
    [
        "meshing_repair_bone",
        "meshing_smooth_facets",
        "meshing_fill_pits",
        "compute_harmonic_rows",
        "compute_tspline_surface",
        "generate_stock",
    ],
)
def test_a_bone_in_metres_is_refused_by_every_filter_that_works_in_mm(name, metres):
    with pytest.raises(UnitsError, match=FITTING):
        metres.apply_filter(name)
    assert metres.mesh_number() == 1


def test_units_that_do_not_fit_are_refused_in_the_words_of_the_filter(metres):
    with pytest.raises(UnitsError, match=r'if its unit is inch: is it in m, .*\? give units="m" \(3\d') as caught:
        metres.apply_units_in_mm(units="inch")
    assert "--units" not in str(caught.value)
    metres.apply_units_in_mm(units="m")
    assert "repairs" in metres.meshing_repair_bone()


def test_a_layer_is_mirrored_and_scaled_and_faces_outward_as_before(phalanx):
    meshes = MeshSet()
    meshes.load_new_mesh(str(phalanx))
    volume = meshes.get_geometric_measures()["mesh_volume"]
    lowest = meshes.current_mesh().vertex_matrix()[:, 0].min()
    found = meshes.apply_units_in_mm(units="mm", mirror="x", scale=1.25)
    assert found["scale"] == 1.25
    assert meshes.get_geometric_measures()["mesh_volume"] == pytest.approx(volume * 1.25**3)
    assert meshes.current_mesh().vertex_matrix()[:, 0].max() == pytest.approx(-1.25 * lowest)


@pytest.mark.parametrize("size", [{}, {"diameter": 12.0, "length": 40.0}])
def test_a_part_that_lies_beside_its_stock_is_told_to_stand_upright(size, phalanx):
    meshes = MeshSet()
    meshes.load_new_mesh(str(phalanx))
    meshes.compute_matrix_from_translation(axisx=60.0)
    with pytest.raises(BonecamError, match=r"was apply_upright_pose applied\?"):
        meshes.generate_stock_capsule(**size)


@pytest.fixture
def metres(phalanx):
    meshes = MeshSet()
    meshes.load_new_mesh(str(phalanx))
    meshes.compute_matrix_from_scaling_or_normalization(axisx=0.001)
    return meshes


@pytest.mark.slow
def test_the_recipe_of_the_tutorial_fits_the_bone_that_pymeshlab_ships():
    meshes = MeshSet()
    meshes.load_new_mesh(str(Path(pymeshlab.__file__).parent / "tests" / "sample_meshes" / "bone.ply"))
    meshes.compute_matrix_from_scaling_or_normalization(axisx=35.0, uniformflag=True)
    meshes.apply_filter("apply_units_in_mm", units="mm")
    meshes.apply_filter("meshing_repair_bone")
    meshes.apply_filter("meshing_fill_pits")
    meshes.apply_filter("apply_upright_pose")
    meshes.apply_filter("generate_stock", diameter=pymeshlab.PercentageValue(50), length=45.0)
    found = meshes.apply_filter("compute_tspline_surface")
    assert found["deviation_max_mm"] < 0.1


def test_curvature_of_a_ball_is_a_layer_coloured_by_it():
    meshes = MeshSet()
    meshes.create_sphere(radius=4.0, subdiv=4)
    found = meshes.compute_mls_curvature(measure="mean")
    layer = meshes.current_mesh()
    np.testing.assert_allclose(layer.vertex_scalar_array(), 0.25, rtol=0.02)
    assert layer.has_vertex_color()
    assert found["minimum"] <= found["maximum"]
    meshes.compute_mls_curvature(measure="shape", radius=1.5)
    assert set(meshes.current_mesh().vertex_scalar_array()) == {0.0}
