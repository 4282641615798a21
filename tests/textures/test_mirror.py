"""Halves of mirrored models that share their texels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapes
from command import command

import coneflat
from coneflat import errors, measure_uv, unwrap
from coneflat.geometry import signed_double_areas
from coneflat.mesh.charts import point_seams


def mirrored(vertices, faces):
    """A model and its image across the plane x = 0, joined where it touches this plane."""
    on_plane = vertices[:, 0] == 0
    image = np.arange(len(vertices))
    image[~on_plane] = len(vertices) + np.arange((~on_plane).sum())
    return (
        np.concatenate([vertices, vertices[~on_plane] * [-1, 1, 1]]),
        np.concatenate([faces, image[faces][:, ::-1]]),
    )


def half_ball(rounds=16, steps=10, bump=0.2):
    """Half a ball without symmetry, x >= 0, whose border is on the plane x = 0."""
    points, faces = shapes.grid(rounds, steps)
    around, along = np.pi * (points[:, 0] - 0.5), np.pi * (0.08 + 0.84 * points[:, 1])
    radius = 1 + bump * np.sin(2 * along + 1) * np.cos(around)
    x, y, z = np.cos(around) * np.sin(along), np.sin(around) * np.sin(along), np.cos(along)
    on_border = (points[:, 0] == 0) | (points[:, 0] == 1)
    return radius[:, None] * np.stack([np.where(on_border, 0.0, x), y, z], axis=1), faces


def with_eyes():
    """A ball open at its ends, and a small ball on either side."""
    ball, eye = half_ball(), shapes.sphere(1)
    return mirrored(*shapes.join(ball, (0.2 * eye[0] + [2, 0, 0.3], eye[1])))


SHAPES = {
    "open": mirrored(*shapes.hill()),
    "ball": mirrored(*half_ball()),
    "with eyes": with_eyes(),
}


@pytest.fixture(scope="module", params=SHAPES.values(), ids=SHAPES)
def stacked(request):
    return unwrap(*request.param, stack="mirrored")


def image_of_faces(result, normal=(1.0, 0.0, 0.0)):
    """The mirror image of each face across a plane through the origin, found by the positions of its corners."""
    corners = result.vertices[result.faces]
    normal = np.asarray(normal)
    turned = corners - 2 * (corners @ normal)[:, :, None] * normal
    middles, images = corners.mean(axis=1), turned.mean(axis=1)
    distance = ((images[:, None] - middles[None]) ** 2).sum(axis=2)
    return distance.argmin(axis=1), turned


@pytest.mark.slow
def test_each_face_has_the_points_of_its_mirror_image(stacked):
    image, turned = image_of_faces(stacked)
    corners, uv = stacked.vertices[stacked.faces], stacked.corner_uv
    for face in range(len(image)):
        matched = ((turned[face][:, None] - corners[image[face]][None]) ** 2).sum(axis=2).argmin(axis=1)
        np.testing.assert_array_equal(uv[face], uv[image[face]][matched])
    signs = signed_double_areas(uv) > 0
    assert (signs != signs[image]).all()


def test_the_measures_are_those_of_one_half(stacked):
    d = stacked.distortion
    half = stacked.vertices[stacked.faces][:, :, 0].mean(axis=1) > 0
    mesh = coneflat.check_mesh(stacked.vertices, stacked.faces[half]).mesh
    measures = coneflat.measure(mesh, stacked.corner_uv[half])
    assert 4 <= d.energy <= 4.1
    assert (measures.flipped, measures.overlapping_pairs, measures.mirrored_charts) == (0, 0, 0)
    assert (d.flipped, d.overlapping_pairs, d.charts) == (0, 0, measures.charts)
    assert d.energy == pytest.approx(measures.energy, rel=1e-12)
    assert len(d.qc) == len(stacked.faces)
    assert "share their texels" in stacked.notes[-1]


def test_arrays_are_those_of_the_whole(stacked):
    image, _ = image_of_faces(stacked)
    np.testing.assert_array_equal(np.sort(stacked.face_origin), np.arange(len(stacked.faces)))
    assert np.isfinite(stacked.log_scale).all()
    np.testing.assert_array_equal(stacked.distortion.qc, stacked.distortion.qc[image])
    for vertices in (stacked.vertices[stacked.cones], stacked.vertices[stacked.seams].mean(axis=1)):
        assert {*map(tuple, vertices)} == {*map(tuple, vertices * [-1, 1, 1])}


def test_the_middle_is_a_seam(stacked):
    on_plane = stacked.vertices[:, 0] == 0
    mesh = coneflat.TriangleMesh(stacked.vertices, stacked.faces)
    middle = mesh.edges[on_plane[mesh.edges].all(axis=1)]
    seams = {tuple(edge) for edge in np.sort(stacked.seams, axis=1).tolist()}
    assert {tuple(edge) for edge in np.sort(middle, axis=1).tolist()} <= seams


@pytest.mark.parametrize("ending", [".glb", ".obj", ".ply", ".npz"])
def test_measures_of_written_files_are_those_of_one_half(stacked, ending):
    written = stacked.as_written(ending)
    d = written.distortion
    assert (d.flipped, d.overlapping_pairs, d.charts) == (0, 0, stacked.distortion.charts)
    assert d.energy == pytest.approx(stacked.distortion.energy, rel=1e-5)
    image, _ = image_of_faces(written)
    low = written.corner_uv.min(axis=1)
    np.testing.assert_array_equal(low, low[image])


def test_flips_of_the_measured_half_are_found(stacked):
    uv = stacked.uv.copy()
    face = int(np.flatnonzero(signed_double_areas(stacked.corner_uv) > 0)[0])
    uv[stacked.uv_faces[face, 0]] += 2 * (
        uv[stacked.uv_faces[face, 1:]].mean(axis=0) - uv[stacked.uv_faces[face, 0]]
    )
    assert replace(stacked, uv=uv).as_written(".glb").distortion.flipped > 0


def test_the_texture_has_more_texels_per_length():
    ball = SHAPES["ball"]
    assert unwrap(*ball, stack="mirrored").uv_scale > 1.25 * unwrap(*ball).uv_scale


@pytest.mark.parametrize(
    "options", [{"charts": 4}, {"seams": "none"}, {"area": 0.05}, {"texel_density": 300.0}]
)
def test_other_options_apply_to_the_half(options):
    result = unwrap(*SHAPES["ball"], stack="mirrored", **options)
    assert (result.distortion.flipped, result.distortion.overlapping_pairs) == (0, 0)
    if "charts" in options:
        assert result.distortion.charts == 4
    if "seams" in options:
        assert result.distortion.seam_length == 0
    if "area" in options:
        assert result.distortion.area_std <= 0.05
    if "texel_density" in options:
        assert result.uv_scale * result.settings["resolution"] >= 300


def test_scale_motion_and_numbering_change_nothing():
    vertices, faces = SHAPES["ball"]
    base = unwrap(vertices, faces, stack="mirrored").distortion
    other_vertices, other_faces, _ = shapes.renumber(vertices, faces)
    for mesh in (
        (vertices * 1e-5 + 1e-4, faces),
        (vertices @ shapes.rotation().T + 3, faces),
        (other_vertices, other_faces),
        (vertices.astype(np.float32), faces),
    ):
        measures = unwrap(*mesh, stack="mirrored").distortion
        assert measures.energy == pytest.approx(base.energy, rel=1e-4)
        assert measures.seam_length == pytest.approx(base.seam_length, rel=1e-4)


def level_edges(side):
    """The mesh of the ball, and a chain of its edges in the half on a side of the mirror plane."""
    vertices, faces = SHAPES["ball"]
    mesh = coneflat.TriangleMesh(vertices, faces)
    is_level = np.isclose(vertices[mesh.edges][:, :, 2], np.median(vertices[:, 2]), atol=0.05).all(axis=1)
    return mesh, mesh.edges[is_level & (side * vertices[mesh.edges][:, :, 0] >= 0).all(axis=1)]


def edge_set(pairs):
    return {tuple(pair) for pair in np.sort(pairs, axis=1).tolist()}


def edges_with_two_points(result):
    """The edges whose two sides have different UV points."""
    mesh = coneflat.TriangleMesh(result.vertices, result.faces)
    return edge_set(mesh.edges[point_seams(mesh, result.uv_faces)])


@pytest.mark.parametrize("side", [1, -1])
def test_marked_edges_of_either_half_are_cut_in_both(side):
    mesh, edges = level_edges(side)
    result = unwrap(mesh.vertices, mesh.faces, stack="mirrored", seams=edges)
    assert edge_set(edges) | edge_set(level_edges(-side)[1]) <= edge_set(result.seams)
    assert edge_set(result.seams) == edges_with_two_points(result)
    assert result.settings["seams"] == edges.tolist()


def test_a_marked_edge_whose_image_is_forbidden_is_no_seam():
    mesh, edges = level_edges(-1)
    result = unwrap(
        mesh.vertices, mesh.faces, stack="mirrored", seams=edges, no_seams=level_edges(1)[1], charts="one"
    )
    assert edge_set(result.seams) == edges_with_two_points(result)
    assert not edge_set(edges) & edge_set(result.seams)
    assert any(f"{len(edges)} marked edges are not cut" in note for note in result.notes)


def moved(vertices, faces):
    vertices = vertices.copy()
    vertices[np.argmax(vertices[:, 0]), 2] += 1e-3
    return vertices, faces


def flipped_edge(vertices, faces):
    """The same vertices; a pair of faces has the other diagonal."""
    mesh = coneflat.TriangleMesh(vertices, faces)
    inner = mesh.edge_halfedges[
        (mesh.edge_halfedges >= 0).all(axis=1) & (vertices[mesh.edges][:, :, 0] > 0).all(axis=1)
    ]
    halfedge, twin = inner[len(inner) // 2]
    faces = faces.copy()
    face = 3 * (halfedge // 3)
    tail, head = mesh.faces.ravel()[[face + (halfedge + 1) % 3, face + (halfedge + 2) % 3]]
    left, right = mesh.faces.ravel()[[halfedge, twin]]
    faces[halfedge // 3], faces[twin // 3] = (left, tail, right), (right, head, left)
    return vertices, faces


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        (shapes.sphere(3), "vertices of 642 without an image about the plane across"),
        (
            moved(*SHAPES["ball"]),
            "2 vertices of [0-9]+ without an image about the plane across \\(1, 0, 0\\)",
        ),
        (
            flipped_edge(*SHAPES["ball"]),
            "4 faces of 640 without an image about the plane across \\(1, 0, 0\\)",
        ),
    ],
)
def test_models_without_a_mirror_plane_are_refused(shape, message):
    with pytest.raises(errors.OptionError, match=f"stack mirrored needs a model that is mirrored.*{message}"):
        unwrap(*shape, stack="mirrored")


def test_faces_across_the_plane_are_refused_with_their_number():
    across = np.array([[-1.0, 0, 3], [1, 0, 3], [0, 1, 4], [0, -2, 3.5]]), np.array([[0, 1, 2], [1, 0, 3]])
    with pytest.raises(
        errors.OptionError, match=r"2 faces of 642 cross or lie in the plane across \(1, 0, 0\)"
    ):
        unwrap(*shapes.join(SHAPES["ball"], across), stack="mirrored")


def test_the_command_measures_one_half_and_names_refused_models(tmp_path):
    mesh = shapes.write_obj(tmp_path / "ball.obj", *SHAPES["ball"])
    done = command(
        "unwrap", mesh, "-o", tmp_path / "out.obj", "--stack", "mirrored", "--require", "overlap=0,flipped=0"
    )
    assert done.returncode == 0, done.stderr
    assert measure_uv(tmp_path / "out.obj").distortion.overlap == pytest.approx(1, abs=1e-6)
    bumpy = shapes.write_obj(tmp_path / "bumpy.obj", *shapes.sphere(2))
    done = command("unwrap", bumpy, "-o", tmp_path / "no.obj", "--stack", "mirrored")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "no.obj").exists()


@pytest.mark.parametrize("turned", [True, False], ids=["back", "again"])
def test_both_sides_of_mirrored_cloth_have_their_images(turned):
    vertices, faces = mirrored(*shapes.hill(6, 5))
    count = len(faces)
    second = faces[:, [0, 2, 1]] if turned else faces
    result = unwrap(vertices, np.concatenate([faces, second]), repair=True, stack="mirrored")
    assert len(result.faces) == 2 * count
    # The two halves of each sheet share their texels.
    texels = [np.sort(np.round(uv, 9), axis=0).tobytes() for uv in result.uv[result.uv_faces]]
    assert len(set(texels)) == count


def test_edges_that_are_forbidden_in_either_half_are_not_cut():
    vertices, faces = SHAPES["ball"]
    seams = unwrap(vertices, faces, stack="mirrored", max_energy=4.05).seams
    places = vertices[seams].mean(axis=1)[:, 0]
    for in_half in (places > 1e-9, places < -1e-9):
        forbidden = seams[in_half]
        assert len(forbidden)
        result = unwrap(vertices, faces, stack="mirrored", max_energy=4.05, no_seams=forbidden)
        cut, kept_edges = (
            set(map(tuple, np.sort(edges, axis=1).tolist())) for edges in (result.seams, forbidden)
        )
        assert not cut & kept_edges


def test_a_forbidden_edge_whose_image_is_marked_is_noted():
    vertices, faces = SHAPES["ball"]
    seams = unwrap(vertices, faces, stack="mirrored", max_energy=4.05).seams
    places = vertices[seams].mean(axis=1)[:, 0]
    marks, forbidden = (seams[in_half] for in_half in (places > 1e-9, places < -1e-9))
    result = unwrap(vertices, faces, stack="mirrored", seams=marks, no_seams=forbidden)
    assert any("that must not be cut are cut" in note for note in result.notes)
