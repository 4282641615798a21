"""The whole way, on meshes of every topology."""

from __future__ import annotations

import dataclasses
import json
import re
import warnings
from importlib import import_module

import numpy as np
import pytest
import shapes

import coneflat
from coneflat import errors, flatten, read_mesh, sample_path

SHAPES = {
    "tetrahedron": shapes.tetrahedron(),
    "sphere": shapes.sphere(3),
    "torus": shapes.torus(),
    "disk": shapes.hill(),
    "annulus": shapes.annulus(),
    "genus 2": shapes.genus(2),
    "triangle": (np.eye(3), np.array([[0, 1, 2]])),
    "two components": shapes.join(shapes.sphere(2), shapes.hill()),
    "many components": shapes.join(*[shapes.tetrahedron()] * 30, shapes.torus(12, 8)),
}


@pytest.mark.parametrize("name", SHAPES)
def test_every_topology_comes_through(name):
    vertices, faces = SHAPES[name]
    result = flatten(vertices, faces, charts="one")
    components = coneflat.TriangleMesh(vertices, faces).components[0]
    assert result.uv.min() >= 0
    assert result.uv.max() <= 1
    assert result.distortion.charts == components
    assert result.distortion.mirrored_charts == 0
    np.testing.assert_array_equal(result.faces, faces)
    np.testing.assert_array_equal(result.vertices, vertices)
    assert result.uv_faces.min() == 0
    assert len(np.unique(result.uv_faces)) == len(result.uv)
    # Corners that share a UV point share a vertex.
    pairs = np.unique(np.stack([result.uv_faces.ravel(), faces.ravel()]), axis=1)
    assert pairs.shape[1] == len(result.uv)


@pytest.mark.parametrize("name", ["sphere", "torus", "disk", "annulus", "genus 2"])
def test_smooth_shapes_have_little_distortion(name):
    d = flatten(*SHAPES[name], distortion=0.1).distortion
    assert d.flipped == d.degenerate == 0
    assert d.qc_mean < 1.1
    assert d.area_std < 0.25
    assert d.curvature_error_max < 0.2


def test_scale_is_the_models_own():
    vertices, faces = shapes.grid(5, 5)
    result = flatten(vertices * 7, faces)
    lengths = np.linalg.norm(result.corner_uv[:, 1] - result.corner_uv[:, 0], axis=1) / result.uv_scale
    expected = np.linalg.norm(vertices[faces[:, 1]] - vertices[faces[:, 0]], axis=1) * 7
    np.testing.assert_allclose(lengths, expected, rtol=1e-9)
    np.testing.assert_allclose(result.log_scale, 0, atol=1e-9)


def assert_same_measures(first, second, rtol=1e-6):
    for field in dataclasses.fields(first.distortion):
        if field.name not in ("qc", "log_area_scale", "strain"):
            value = getattr(first.distortion, field.name), getattr(second.distortion, field.name)
            np.testing.assert_allclose(*value, rtol=rtol, atol=1e-8, err_msg=field.name)


@pytest.mark.parametrize("name", ["sphere", "annulus", "genus 2"])
def test_numbering_and_motion_change_nothing(name):
    vertices, faces = SHAPES[name]
    base = flatten(vertices, faces, distortion=0.15)
    moved = flatten(vertices @ shapes.rotation().T + [5, -3, 2], faces, distortion=0.15)
    np.testing.assert_array_equal(moved.cones, base.cones)
    assert_same_measures(moved, base)
    new_vertices, new_faces, numbers = shapes.renumber(vertices, faces)
    renumbered = flatten(new_vertices, new_faces, distortion=0.15)
    np.testing.assert_array_equal(renumbered.cones, numbers[base.cones])
    assert_same_measures(renumbered, base)


def test_same_input_same_bits():
    first, second = flatten(*SHAPES["genus 2"]), flatten(*SHAPES["genus 2"])
    np.testing.assert_array_equal(first.uv, second.uv)
    np.testing.assert_array_equal(first.seams, second.seams)


def test_cones_of_the_users_own():
    vertices, faces = SHAPES["sphere"]
    computed = flatten(vertices, faces, cones=[1, 2, 3, 4, 100])
    assert computed.cones.tolist() == [1, 2, 3, 4, 100]
    np.testing.assert_allclose(computed.curvatures.sum(), 4 * np.pi)
    cones = dict(zip(computed.cones.tolist(), computed.curvatures.tolist(), strict=True))
    again = flatten(vertices, faces, cones=cones)
    np.testing.assert_allclose(again.log_scale, computed.log_scale, atol=1e-9)
    np.testing.assert_allclose(again.uv, computed.uv, atol=1e-7)
    np.testing.assert_array_equal(
        flatten(vertices, faces, cones=(v for v in (1, 2, 3, 4, 100))).uv, computed.uv
    )
    # Isolated vertices before them shift nothing.
    shifted = flatten(np.r_[vertices[:2], vertices], faces + 2, cones=[3, 4, 5, 6, 102])
    np.testing.assert_allclose(shifted.uv, computed.uv, atol=1e-12)
    assert np.isnan(shifted.log_scale[:2]).all()
    # A component each.
    two = flatten(*SHAPES["two components"], cones=[5, 50, 100, 162 + 250])
    assert two.distortion.charts == 2
    none = flatten(*SHAPES["disk"], cones="none")
    assert len(none.cones) == 0


@pytest.mark.parametrize(
    ("options", "kind", "message"),
    [
        (
            {"cones": "magic"},
            errors.OptionError,
            "unknown cones 'magic': choose from auto, sparse, greedy, none",
        ),
        ({"method": "magic"}, errors.OptionError, "unknown method"),
        ({"distorsion": 0.1}, errors.OptionError, "did you mean distortion"),
        ({"quantise": 1.5, "quantize": 1.5}, errors.OptionError, "different spellings"),
        ({"distortion": 0}, errors.OptionError, "distortion must be a number above 0, got 0"),
        ({"distortion": "x"}, errors.OptionError, "distortion must be a number"),
        ({"distortion": float("inf")}, errors.OptionError, "distortion"),
        ({"max_cones": -1}, errors.OptionError, "max_cones"),
        ({"max_cones": 2.5}, errors.OptionError, "max_cones must be an integer"),
        ({"cones": "greedy", "max_cones": 0}, errors.CurvatureError, "allow some"),
        ({"cones": "greedy", "max_cones": 2}, errors.CurvatureError, "2 cones cannot absorb"),
        ({"cones": "greedy", "max_cones": 2, "method": "linear"}, errors.CurvatureError, "2 pi or more"),
        ({"cones": "none"}, errors.CurvatureError, "has none"),
        ({"cones": [1, 2, 3, 3]}, errors.OptionError, "vertex 3 is given as a cone twice"),
        ({"cones": [1, 2, 642]}, errors.OptionError, "cone 642 is not a vertex .* 0 to 641"),
        ({"cones": [1, 2, -1]}, errors.OptionError, "cone -1"),
        ({"cones": [1.5]}, errors.OptionError, "integer"),
        ({"cones": 3.5}, errors.OptionError, "cones must be vertices"),
        ({"cones": 10}, errors.OptionError, "use cone_count=10"),
        ({"cones": None}, errors.OptionError, "got NoneType"),
        ({"cones": {10**30: 1.0}}, errors.OptionError, "integer"),
        ({"cones": [True, False]}, errors.OptionError, "integer"),
        ({"boundary": {1: 2.0, 2: None}}, errors.OptionError, "vertex 2 has none"),
        ({"cones": {1: 7.0, 2: None}}, errors.CurvatureError, "vertex 1 has 2.2282 pi"),
        ({"cones": {1: float("nan")}}, errors.OptionError, "curvature of cone 1 must be finite, got nan"),
        ({"cones": {1: 2.0, 2: 3.0}}, errors.CurvatureError, r"must sum to 2 pi chi = 12\.56637"),
        (
            {"cones": {1: 2.5 * np.pi, 2: np.pi, 3: np.pi / 2}},
            errors.CurvatureError,
            "vertex 1 has 2.5000 pi",
        ),
    ],
)
def test_bad_options_are_named(options, kind, message):
    with pytest.raises(kind, match=message):
        flatten(*SHAPES["sphere"], **options)


def test_a_file_has_faces_of_its_own():
    with pytest.raises(errors.ArrayShapeError, match="leave out faces"):
        flatten("hand.obj", [[0, 1, 2]])


def test_cones_on_boundaries_and_loose_vertices_are_refused():
    vertices, faces = SHAPES["disk"]
    with pytest.raises(errors.OptionError, match="cone 0 lies on the boundary"):
        flatten(vertices, faces, cones=[0])
    with pytest.raises(errors.OptionError, match="cone 0 is not a vertex of a face"):
        flatten(np.r_[vertices[:1], vertices], faces + 1, cones=[0])


def test_triangles_without_area_are_opened_and_reported():
    vertices, faces = shapes.grid(6, 6, lambda x, y: 0.2 * x * y)
    vertices[24] = vertices[25]
    result = flatten(vertices, faces)
    assert np.isfinite(result.uv).all()
    assert result.distortion.degenerate_input == 2
    assert "Opened 2 triangles without area" in result.notes[0]
    with pytest.raises(errors.DegenerateFaceError, match="2 triangles without area"):
        flatten(vertices, faces, strict=True)
    # The message has the input's own numbers, in whatever component they are.
    apart = shapes.join(SHAPES["sphere"], (vertices, faces))
    bad = 1280 + np.flatnonzero(np.isin(faces, [24, 25]).sum(axis=1) == 2)
    assert f"({bad[0]}, {bad[1]})" in flatten(*apart).notes[0]


def test_flat_corners_count_as_without_area():
    """A vertex on the side of its triangle makes an area of rounding's size, whatever its sign."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        a, b, c = rng.normal(size=(3, 3))
        t = rng.uniform(0.2, 0.8)
        vertices = np.array([a, b, (1 - t) * a + t * b, c])
        with pytest.raises(errors.DegenerateFaceError, match="1 triangle without area: 0"):
            flatten(vertices, [[0, 1, 2], [1, 0, 3]], strict=True)


def test_components_without_area_do_not_spoil_the_rest():
    vertices, faces = SHAPES["sphere"]
    line = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 0], [2, 2, 2], [2, 2, 2], [2, 2, 2.0]])
    result = flatten(np.r_[vertices, line], np.r_[faces, [[642, 643, 644], [645, 646, 647]]])
    assert "Opened 2 triangles without area (1280, 1281)" in result.notes[-1]
    assert result.distortion.charts == 3
    assert np.isfinite(result.uv).all()
    with pytest.raises(errors.DegenerateFaceError, match="no area: 1,280 triangles on a line"):
        flatten(vertices * [1, 0, 0], faces)


@pytest.mark.parametrize("scale", [1e-150, 1e-6, 1e300])
def test_any_unit_of_length_will_do(scale):
    vertices, faces = SHAPES["sphere"]
    base, scaled = flatten(vertices, faces), flatten(vertices * scale, faces)
    assert_same_measures(scaled, base)
    np.testing.assert_array_equal(scaled.vertices, vertices * scale)
    assert scaled.uv_scale == pytest.approx(base.uv_scale / scale, rel=1e-6)


def test_mirror_images_are_told_apart():
    """On a symmetric shape every choice ties; it must not hang on the numbering or on rounding."""
    vertices, faces = shapes.sphere(3)
    vertices = vertices * (
        1 + 0.3 * vertices[:, :1] ** 2 + 0.2 * np.cos(4 * vertices[:, 2:]) * vertices[:, :1]
    )
    vertices[:, 1] = np.where(np.abs(vertices[:, 1]) < 1e-12, 0, vertices[:, 1])
    base = flatten(vertices, faces, distortion=0.15)
    new_vertices, new_faces, numbers = shapes.renumber(vertices @ shapes.rotation().T, faces)
    turned = flatten(new_vertices, new_faces, distortion=0.15)
    assert set(turned.cones.tolist()) == set(numbers[base.cones].tolist())
    assert_same_measures(turned, base)


def test_extreme_metrics_are_refused_in_one_line():
    with pytest.raises(errors.MetricError, match="overflows double precision"):
        flatten(*shapes.hill(20, 20), cones={200: 1.0, 220: -1e6}, method="linear")


def test_surfaces_with_very_many_handles_come_through(monkeypatch):
    monkeypatch.setattr("coneflat.cones.sparse.limits.MAX_SEARCHED", 8)
    monkeypatch.setattr("coneflat.cones.strategies.auto.MAX_SEARCHED", 8)
    result = flatten(*shapes.genus(5))
    assert len(result.cones) > 8
    assert result.distortion.flipped == 0
    assert result.distortion.seam_mismatch_max < 1e-11
    assert any("5 handles" in note for note in result.notes)


def test_notes_name_every_cone_and_vertex_where_triangles_fail():
    """Five triangles around a vertex cannot form an angle of 5.1 pi."""
    vertices, faces = shapes.sphere(2)
    wide = np.flatnonzero(np.bincount(faces.ravel()) == 5)[[0, -1]].tolist()
    narrow = [v for v in range(len(vertices)) if v not in wide][::2]
    cones = {**dict.fromkeys(narrow, 10.2 * np.pi / len(narrow)), **dict.fromkeys(wide, -3.1 * np.pi)}
    notes = flatten(vertices, faces, cones=cones).notes
    cannot = next(note for note in notes if "surrounding triangles cannot form" in note)
    assert f"form: vertex {wide[0]} (5.1 pi), vertex {wide[1]} (5.1 pi), vertex" in cannot
    unmatched = next(note for note in notes if "could not be untangled" in note)
    assert re.search(r"next to vertex \d+, vertex \d+.*: they are positively oriented", unmatched)


def test_bounds_of_angles_count_for_the_sparse_search():
    bounded = flatten(*SHAPES["sphere"], min_cone_angle=1.97 * np.pi)
    assert len(bounded.cones) > 133
    assert bounded.curvatures.max() <= 0.03 * np.pi + 1e-9


def test_meshes_of_other_packages():
    import meshio
    import trimesh

    vertices, faces = SHAPES["disk"]
    expected = flatten(vertices, faces).uv
    meshes = [
        (vertices, faces),
        (vertices.tolist(), faces.tolist()),
        trimesh.Trimesh(vertices, faces, process=False),
        meshio.Mesh(vertices, [("line", [[0, 1]]), ("triangle", faces)]),
        type("PolyData", (), {"points": vertices, "faces": np.c_[np.full(len(faces), 3), faces].ravel()})(),
        type("PolyData", (), {"points": vertices, "faces": faces})(),
    ]
    for mesh in meshes:
        np.testing.assert_array_equal(flatten(mesh).uv, expected)
    quads = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])
    flat = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0.0]])
    for mesh in (
        meshio.Mesh(flat, [("quad", quads)]),
        type("PolyData", (), {"points": flat, "faces": np.c_[[4, 4], quads].ravel()})(),
    ):
        assert len(flatten(mesh).faces) == 4
    with pytest.raises(errors.ArrayShapeError, match="its cells are: tetra"):
        flatten(meshio.Mesh(vertices, [("tetra", [[0, 1, 2, 3]])]))
    flat_mesh = meshio.Mesh(flat[:, :2], [("quad", quads)])
    assert len(flatten(flat_mesh).faces) == 4
    for broken in ([-1, 0, 1], [3, 0, 1, 2, 4, 0, 1, 2], [0, 3, 0, 1, 2]):
        with pytest.raises(errors.ArrayShapeError, match="flat array of faces is invalid at"):
            flatten(type("PolyData", (), {"points": vertices, "faces": np.array(broken)})())
    with pytest.raises(errors.ArrayShapeError, match="cannot read a mesh from int"):
        flatten(3)


def test_report_is_json_with_the_promised_keys():
    result = flatten(*SHAPES["two components"])
    report = json.loads(json.dumps(result.report(), allow_nan=False))
    promised = (
        "cones curvature_error curvature_error_max qc_mean qc_p95 qc_max area_std flipped degenerate charts "
        "seam_length seam_mismatch seconds"
    )
    assert set(promised.split()) <= set(report)
    assert report["cones"] == len(result.cones)
    assert {"check", "cones", "metric", "cut", "layout", "measure"} <= set(report["seconds"])


def test_progress_names_the_stages():
    seen = []
    flatten(*SHAPES["two components"], progress=lambda stage, fraction: seen.append((stage, fraction)))
    stages, fractions = zip(*seen, strict=True)
    assert stages[0] == "check"
    assert stages[-1] == "measure"
    assert list(fractions) == sorted(fractions)
    assert {"cones, component 1 of 2", "cones, component 2 of 2"} <= {
        stage.partition(":")[0] for stage in stages
    }


def test_sample_has_limbs_and_a_handle():
    model = read_mesh(sample_path())
    mesh = coneflat.TriangleMesh(model.vertices, model.corners.reshape(-1, 3))
    assert mesh.genus() == 1
    assert 5_000 <= len(mesh.faces) <= 20_000
    assert sample_path().stat().st_size < 1_000_000


@pytest.mark.parametrize("first", [False, True])
def test_vertices_of_no_triangle_stay_where_they_are(first):
    vertices, faces = shapes.sphere(2)
    unused = np.random.default_rng(0).random((7, 3))
    blocks, shift = ([unused, vertices], 7) if first else ([vertices, unused], 0)
    result = flatten(np.vstack(blocks), faces + shift)
    plain = flatten(vertices, faces)
    assert np.array_equal(result.vertices, np.vstack(blocks))
    assert np.array_equal(result.cones, plain.cones + shift)
    assert np.array_equal(result.distortion.qc, plain.distortion.qc)


@pytest.mark.slow
@pytest.mark.parametrize("allowed", [0.1, 0.2])
def test_the_area_distortion_of_the_result_is_at_most_the_allowed_one_or_noted(allowed):
    """Also of coarse meshes and several components, whose relaxed triangles may exceed that of the model."""
    rng = np.random.default_rng(0)
    exceeded = 0
    for _ in range(8):
        parts = [shapes.sphere(level) for level in (1, 2)]
        vertices = np.concatenate(
            [v * rng.uniform(0.5, 1.5, v.shape) + 4 * i for i, (v, _) in enumerate(parts)]
        )
        faces = np.concatenate([parts[0][1], parts[1][1] + len(parts[0][0])])
        result = coneflat.flatten(vertices, faces, distortion=allowed)
        if result.distortion.area_std > allowed * 1.03:
            exceeded += 1
            assert any("area distortion" in note for note in result.notes)
    assert exceeded <= 4


def test_a_small_component_above_the_allowed_area_distortion_is_noted_next_to_a_large_one_within_it():
    plate = shapes.grid(40, 40)
    vertices, faces = shapes.sphere(3)  # more corners than cones are searched for
    ball = vertices * np.random.default_rng(0).uniform(0.7, 1.3, len(vertices))[:, None], faces
    result = coneflat.flatten(*shapes.join(ball, (plate[0] * 30, plate[1])), distortion=0.05, charts="one")
    assert result.distortion.area_std < 0.05
    assert any("of a component have an area distortion" in note for note in result.notes)


def test_components_have_the_same_texel_density():
    rng = np.random.default_rng(9)
    vertices, faces = shapes.sphere(2)
    vertices = np.concatenate([vertices * rng.uniform(0.5, 1.5, vertices.shape), vertices[:3] + 3])
    faces = np.concatenate([faces, [[len(vertices) - 3, len(vertices) - 2, len(vertices) - 1]]])
    scale = coneflat.flatten(vertices, faces).distortion.log_area_scale
    assert abs(scale[:-1].mean() - scale[-1]) < 0.1


def test_no_more_cones_are_searched_for_than_a_search_can_find(monkeypatch):
    """A distortion that needs more cones than the search allows is named at once: each search would take longest."""
    retries = import_module("coneflat.retries")
    searches, lay_out = [], retries.lay_out_with_thick_triangles
    monkeypatch.setattr(
        retries, "lay_out_with_thick_triangles", lambda *arguments: searches.append(0) or lay_out(*arguments)
    )
    monkeypatch.setattr(retries, "MAX_SEARCHED", 5)
    for module in (retries, import_module("coneflat.bounds")):
        monkeypatch.setattr(module, "excess", lambda *_: 2.0)
    result = coneflat.flatten(coneflat.sample_path())
    assert len(searches) == 1
    assert any("above the 0.2 allowed" in note for note in result.notes)


def test_a_vertex_without_a_face_may_be_anywhere():
    """Heights of charts are those of faces: what is left out does not warn."""
    vertices, faces = shapes.sphere(2)
    further = np.concatenate([vertices, [[np.nan, np.inf, 0.0]]])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = flatten(further, faces, repair=True, up=(0, 0, 1))
    np.testing.assert_array_equal(result.uv, flatten(vertices, faces, up=(0, 0, 1)).uv)
