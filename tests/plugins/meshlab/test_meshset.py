"""MeshSet is pymeshlab's plus ours: by name, as methods; values travel beside the layers; a failure leaves
nothing."""

from dataclasses import replace

import numpy as np
import pymeshlab
import pytest
from bonecam_plugins.meshlab import Filter, FilterParameter, Kind, MeshSet, Registry, apply_script

from bonecam.errors import BonecamError, Cancelled, FilterError, StockError
from bonecam.progress import report

SCRIPT_OF_UNKNOWN = '<!DOCTYPE FilterScript><FilterScript><filter name="nothing"/></FilterScript>'


def test_both_sorts_apply_by_name_and_as_methods(meshes):
    assert isinstance(meshes, pymeshlab.MeshSet)
    before = meshes.current_mesh().vertex_matrix().copy()
    result = meshes.apply_filter("generate_offset", distance=2.0, how="down")
    assert result == {"distance": 2.0, "how": "down"}
    assert meshes.generate_offset(distance=pymeshlab.PureValue(3.0))["distance"] == 3.0
    assert meshes.apply_filter("get_geometric_measures")["mesh_volume"] == pytest.approx(
        meshes.get_geometric_measures()["mesh_volume"]
    )
    assert meshes.mesh_number() == 3
    assert np.allclose(meshes.current_mesh().vertex_matrix(), before + np.array([0, 0, 5.0]))
    assert meshes.current_mesh().label() == "moved(1)"
    assert np.allclose(meshes.current_mesh().vertex_scalar_array(), before[:, 2] + 5.0)
    assert np.ptp(meshes.current_mesh().vertex_color_matrix(), axis=0).max() > 0.5


def test_percentages_are_of_the_diagonal_of_the_current_layer(meshes):
    diagonal = meshes.current_mesh().bounding_box().diagonal()
    assert meshes.generate_offset(distance=pymeshlab.PercentageValue(10))["distance"] == pytest.approx(diagonal / 10)


def test_lists_and_parameters_hold_both_sorts(meshes, capfd):
    assert {"generate_offset", "meshing_isotropic_explicit_remeshing"} <= set(meshes.filter_list())
    assert {"generate_offset", "apply_filter", "create_cube"} <= set(dir(meshes))
    assert "Moves a copy" in meshes.generate_offset.__doc__
    meshes.print_filter_parameter_list("generate_offset")
    meshes.print_filter_list()
    printed = capfd.readouterr().out
    assert "distance : length = 1.0 mm" in printed
    assert "\tgenerate_offset\n" in printed
    values = meshes.filter_parameter_values("generate_offset", distance=2)
    assert values["distance"] == 2.0
    assert values["share"] == 5.0
    assert values["size"] == pytest.approx(meshes.current_mesh().bounding_box().diagonal())
    assert meshes.filter_parameter_values("create_cube") == {"size": 1.0}


@pytest.mark.parametrize(
    ("name", "values", "reason"),
    [
        ("generate_nothing", {}, "no filter 'generate_nothing'"),
        ("generate_offset", {"nope": 1}, "knows no parameter 'nope'"),
        ("generate_offset", {"distance": 21.0}, "distance = 21: keep it within 0 .. 20 mm"),
        ("create_cube", {"nope": 1}, "nope"),
        ("create_cube", {"size": "x"}, "create_cube: parameter size = 'x': give a value of type float"),
        ("set_matrix", {"transformmatrix": "x"}, "transformmatrix = .x.: give a value of type ndarray"),
        ("create_sphere", {"radius": 2.0, "subdiv": 2.5}, "subdiv = 2.5: give a value of type int"),
    ],
)
def test_wrong_calls_are_filter_errors(meshes, name, values, reason):
    with pytest.raises(FilterError, match=reason):
        meshes.apply_filter(name, **values)
    assert meshes.mesh_number() == 1


def test_without_a_layer_a_filter_says_so(registry):
    with pytest.raises(FilterError, match="load a mesh first"):
        MeshSet(registry=registry).generate_offset()


def test_unknown_attribute_is_an_attribute_error(meshes):
    with pytest.raises(AttributeError, match="generate_nothing"):
        _ = meshes.generate_nothing


def test_a_failed_filter_leaves_the_layers_as_they_were(meshes):
    key = meshes.current_mesh_id()
    with pytest.raises(StockError, match="too small"):
        meshes.generate_offset(fail=True)
    assert meshes.mesh_number() == 1
    assert meshes.current_mesh_id() == key


def test_a_cancelled_filter_leaves_the_layers_as_they_were(turn_filter, phalanx):
    def act(layers, values, progress):
        layers.add(layers.mesh(), "half made")
        report(progress, 0.5, "half way")
        return {}

    meshes = MeshSet(progress=lambda fraction, message: False, registry=Registry([replace(turn_filter, act=act)]))
    meshes.load_new_mesh(str(phalanx))
    with pytest.raises(Cancelled):
        meshes.apply_turn()
    assert meshes.mesh_number() == 1


def test_kept_values_travel_with_new_layers_and_stay_off_others(meshes):
    first = meshes.current_mesh_id()
    with pytest.raises(FilterError, match=r"layer 0 'phalanx\.ply' has no distance: apply generate_offset first"):
        meshes.compute_recall()
    meshes.generate_offset(distance=2.0)
    assert meshes.compute_recall() == {"distance": 2.0}
    meshes.set_current_mesh(first)
    with pytest.raises(FilterError, match="apply generate_offset first"):
        meshes.compute_recall()


def test_kept_values_of_a_layer_that_was_changed_are_refused(meshes):
    meshes.generate_offset(distance=2.0)
    meshes.apply_coord_taubin_smoothing()
    with pytest.raises(FilterError, match="was changed after its distance was made: apply generate_offset again"):
        meshes.compute_recall()


def test_the_saved_script_gives_the_same_layers_again(meshes, phalanx, registry, tmp_path):
    meshes.meshing_isotropic_explicit_remeshing(targetlen=pymeshlab.PercentageValue(4), iterations=2)
    meshes.generate_offset(distance=pymeshlab.PercentageValue(10), how="down")
    meshes.apply_turn()
    for name, values in (
        ("get_hausdorff_distance", {"targetmesh": 0, "sampledmesh": 0}),
        ("generate_offset", {"fail": True}),
        ("create_cube", {"nope": 1}),
    ):
        with pytest.raises(BonecamError):
            meshes.apply_filter(name, **values)
    meshes.apply_coord_taubin_smoothing()
    meshes.save_filter_script(str(tmp_path / "all.mlx"))
    again = MeshSet(registry=registry)
    again.load_new_mesh(str(phalanx))
    apply_script(again, tmp_path / "all.mlx")
    assert again.mesh_number() == meshes.mesh_number()
    assert np.allclose(again.current_mesh().vertex_matrix(), meshes.current_mesh().vertex_matrix(), atol=1e-6)
    again.save_filter_script(str(tmp_path / "again.mlx"))
    assert (
        (tmp_path / "again.mlx").read_text().count("<filter")
        == (tmp_path / "all.mlx").read_text().count("<filter")
        == 4
    )
    loaded = MeshSet(registry=registry)
    loaded.load_new_mesh(str(phalanx))
    loaded.load_filter_script(str(tmp_path / "all.mlx"))
    loaded.apply_filter_script()
    assert np.array_equal(loaded.current_mesh().vertex_matrix(), again.current_mesh().vertex_matrix())
    meshes.clear_filter_script()
    meshes.save_filter_script(str(tmp_path / "none.mlx"))
    assert "<filter" not in (tmp_path / "none.mlx").read_text()


def test_errors_of_filters_are_pymeshlab_s_too(meshes):
    for name, values in (
        ("generate_offset", {"nope": 1}),
        ("create_cube", {"nope": 1}),
        ("apply_coord_taubin_smothing", {}),
    ):
        with pytest.raises(pymeshlab.PyMeshLabException) as caught:
            meshes.apply_filter(name, **values)
        assert isinstance(caught.value, FilterError)
    assert "did you mean 'apply_coord_taubin_smoothing'?" in str(caught.value)


@pytest.mark.parametrize(
    ("value", "words"),
    [(99, "Enum 99 not valid"), (-1, "Enum -1 not valid"), ("zzz", "'Custom Axis'$"), (None, "of type int")],
)
def test_a_choice_that_meshlab_has_not_is_told_with_its_filter(value, words, meshes):
    name = "generate_polyline_from_planar_section"
    for call in (meshes.apply_filter, meshes.filter_parameter_values):
        with pytest.raises(FilterError, match=rf"^{name}: .*{words}") as caught:
            call(name, planeaxis=value)
        assert isinstance(caught.value, pymeshlab.PyMeshLabException)


def test_a_filter_cannot_end_the_program(phalanx):
    def leave(*_):
        raise SystemExit(3)

    item = Filter("apply_leave", "Leave", "Calls sys.exit.", "Test", (), leave)
    meshes = MeshSet(registry=Registry([item]))
    meshes.load_new_mesh(str(phalanx))
    with pytest.raises(FilterError, match=r"apply_leave: it would end the program \(sys\.exit\(3\)\): mend"):
        meshes.apply_leave()
    assert meshes.layers.count == 1


@pytest.mark.parametrize("place", ["act", "value"])
def test_a_fault_in_the_code_of_a_filter_is_told_with_its_line(place, phalanx, tmp_path):
    def fail(*_):
        raise KeyError("no\nsuch")

    known = FilterParameter("size", Kind.FLOAT, 1.0, "Size", "The size.")
    item = Filter("apply_fail", "Fail", "Raises.", "Test", (known,), fail)
    if place == "value":
        item = replace(item, parameters=(replace(known, computed=fail),))
    meshes = MeshSet(registry=Registry([item]))
    meshes.load_new_mesh(str(phalanx))
    file = tmp_path / "a.mlx"
    file.write_text('<FilterScript>\n<filter name="apply_fail"/>\n</FilterScript>')
    with pytest.raises(FilterError, match=r"a.mlx, line 2: apply_fail: KeyError: 'no\\nsuch': mend") as caught:
        apply_script(meshes, file)
    assert caught.value.evidence["line"] == 2
    assert meshes.layers.count == 1


@pytest.mark.parametrize("text", [None, "junk", SCRIPT_OF_UNKNOWN])
def test_a_script_that_cannot_be_used_is_an_error_of_pymeshlab_too(text, tmp_path):
    file = tmp_path / "steps.mlx"
    if text is not None:
        file.write_text(text, encoding="utf-8")
    meshes = MeshSet()
    with pytest.raises(pymeshlab.PyMeshLabException, match=r"steps.mlx"):
        meshes.load_filter_script(str(file))
