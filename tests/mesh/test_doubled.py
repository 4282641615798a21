"""Surfaces with several layers on the same vertices: each layer is what it is alone, and no face is lost."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import shapes

from coneflat import check_mesh, flatten, unwrap
from coneflat.io import read_mesh
from coneflat.mesh.check import weld

V, F = shapes.hill(7, 6)
BACK = F[:, [0, 2, 1]]
#: The faces of one side of the hill, which is bounded by inner vertices.
PART = V[F].mean(axis=1)[:, 0] < 0.5


def layers_of(vertices, faces):
    """Return the input faces of each component, and the checked mesh, which must have all faces and be a manifold."""
    checked = check_mesh(vertices, faces, repair=True)
    mesh = checked.mesh
    np.testing.assert_array_equal(np.sort(checked.face_origin), np.arange(len(faces)))
    corners = np.where(checked.is_flipped[:, None], mesh.faces[:, [0, 2, 1]], mesh.faces)
    np.testing.assert_array_equal(checked.vertex_origin[corners], np.asarray(faces)[checked.face_origin])
    again = check_mesh(mesh.vertices, mesh.faces)
    assert again.notes == ()
    component = mesh.components[1][mesh.faces[:, 0]]
    layers = [checked.face_origin[component == number] for number in np.unique(component)]
    return sorted(layers, key=lambda layer: layer[0]), checked


@pytest.mark.parametrize("count", [2, 3, 5])
@pytest.mark.parametrize("second", [BACK, F], ids=["back", "again"])
def test_each_layer_is_the_sheet_alone(second, count):
    faces = np.concatenate([(F, second)[i % 2] for i in range(count)])
    layers, checked = layers_of(V, faces)
    assert not checked.is_flipped.any()
    alone = check_mesh(V, F).mesh
    for number, (part, vertices, _) in enumerate(checked.mesh.split_components()):
        np.testing.assert_array_equal(checked.vertex_origin[vertices], np.arange(len(V)))
        np.testing.assert_array_equal(part.faces, (F, second)[number % 2])
        assert part.boundary_loops[0] == alone.boundary_loops[0] == 1
    assert [len(layer) for layer in layers] == [len(F)] * count
    stacked = (count - 1) * len(F)
    assert (
        checked.notes[0] == f"Put {stacked} faces on the same three vertices as others into separate layers."
    )
    assert not any("Separated" in note for note in checked.notes)


def test_front_and_back_are_told_apart_by_their_orientation():
    """Also where the faces of both sides are mixed and renumbered."""
    order = np.random.default_rng(0).permutation(2 * len(F))
    layers, _ = layers_of(V, np.concatenate([F, BACK])[order])
    assert {frozenset(order[layer] < len(F)) for layer in layers} == {frozenset([True]), frozenset([False])}


@pytest.mark.parametrize("lining", [BACK, F], ids=["back", "again"])
def test_a_partial_lining_is_separated_and_the_cloth_stays_whole(lining):
    layers, checked = layers_of(V, np.concatenate([F, lining[PART]]))
    assert [len(layer) for layer in layers] == [len(F), PART.sum()]
    sides = (
        {frozenset(side) for face in faces for side in pairwise([*face, face[0]])}
        for faces in map(np.ndarray.tolist, (F[PART], F[~PART]))
    )
    assert (
        f"Separated the faces at {len(set.intersection(*sides))} edges with more than two." in checked.notes
    )


def test_a_single_doubled_face_is_a_layer():
    layers, _ = layers_of(V, np.concatenate([F, BACK[40:41]]))
    assert [len(layer) for layer in layers] == [len(F), 1]


def test_an_inconsistently_oriented_sheet_given_twice_is_two_sheets():
    turned = F.copy()
    turned[::3] = BACK[::3]
    layers, checked = layers_of(V, np.concatenate([turned, turned]))
    assert [len(layer) for layer in layers] == [len(F)] * 2
    assert checked.is_flipped.sum() == 2 * len(F[::3])


def test_the_two_sides_of_a_one_sided_surface_are_one_sheet():
    vertices, faces = shapes.moebius()
    layers, checked = layers_of(vertices, np.concatenate([faces, faces[:, ::-1]]))
    assert len(layers) == 1
    assert checked.mesh.euler_characteristic == 0
    assert checked.mesh.boundary_loops[0] == 2


def test_a_wall_on_a_doubled_sheet_is_separated_and_both_sides_stay_whole():
    edge = F[40, :2]
    vertices = np.concatenate([V, [[0.5, 0.5, 3]]])
    layers, checked = layers_of(vertices, np.concatenate([F, BACK, [[*edge, len(V)]]]))
    assert [len(layer) for layer in layers] == [len(F), len(F), 1]
    assert any("Separated the faces at 1 edge " in note for note in checked.notes)


def test_a_closed_envelope_stays_closed():
    """Two sheets with common border vertices are a sphere, although two of its corners are triangles given twice."""
    vertices, faces = shapes.grid(5, 5)
    is_border = ((vertices[:, :2] == 0) | (vertices[:, :2] == 1)).any(axis=1)
    behind = np.where(is_border, 0, len(vertices)) + np.arange(len(vertices))
    back = behind[faces][:, ::-1]
    points = np.concatenate([vertices, vertices - [0, 0, 0.1]])
    layers, _ = layers_of(points, np.concatenate([faces, back]))
    corners = is_border[faces].all(axis=1)
    assert [len(layer) for layer in layers] == [2 * (~corners).sum(), 2, 2]
    assert len(layers_of(points, np.concatenate([faces[~corners], back[~corners]]))[0]) == 1


@pytest.mark.parametrize("second", [[0, 2, 1], [0, 1, 2]])
def test_two_triangles_back_to_back_are_a_closed_surface(second):
    mesh = check_mesh(V[:3], [[0, 1, 2], second]).mesh
    assert mesh.euler_characteristic == 2
    beside = np.concatenate([[[0, 1, 2], second], F + 3, F[:1] + 3])
    layers, _ = layers_of(np.concatenate([V[:3], V]), beside)
    assert [len(layer) for layer in layers] == [2, len(F), 1]


def test_single_sheets_at_an_edge_are_separated():
    vertices = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 1, 0], [-1, -1, 0], [1, 1, 0.0]])
    faces = np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    assert len(layers_of(vertices, faces)[0]) == 3


@pytest.mark.parametrize("seed", range(20))
def test_any_triangles_become_a_manifold_with_all_faces_however_they_are_numbered(seed):
    rng = np.random.default_rng(seed)
    for count in rng.integers(3, 9, 20):
        faces = np.array([rng.choice(count, 3, replace=False) for _ in range(rng.integers(1, 40))])
        vertices = rng.normal(size=(count, 3))
        number, order = rng.permutation(count), rng.permutation(len(faces))
        layers, _ = layers_of(vertices, faces)
        renumbered, _ = layers_of(vertices[np.argsort(number)], number[faces][order])
        assert sorted(map(len, layers)) == sorted(map(len, renumbered))


@pytest.mark.parametrize("command", [flatten, unwrap])
def test_maps_of_both_sides_are_those_of_one(command):
    doubled = command(V, np.concatenate([F, BACK]), repair=True, charts="one")
    alone = command(V, F, charts="one")
    assert len(doubled.faces) == 2 * len(F)
    assert doubled.distortion.charts == 2 * alone.distortion.charts
    assert doubled.distortion.flipped == 0
    for name in ("qc_mean", "energy"):
        assert getattr(doubled.distortion, name) == pytest.approx(getattr(alone.distortion, name), rel=1e-6)
    # Seams are relative to the root of the area.
    assert doubled.distortion.seam_length == pytest.approx(2**0.5 * alone.distortion.seam_length, rel=1e-6)


@pytest.mark.parametrize("command", [flatten, unwrap])
def test_the_atlas_is_that_of_two_sheets_with_vertices_of_their_own(command):
    shared = command(V, np.concatenate([F, BACK]), repair=True)
    separate = command(np.concatenate([V, V]), np.concatenate([F, BACK + len(V)]))
    np.testing.assert_array_equal(shared.uv[shared.uv_faces], separate.uv[separate.uv_faces])


def test_no_primitive_of_a_file_is_lost(tmp_path):
    lines = [f"v {x} {y} {z}\n" for x, y, z in V]
    for name, faces in (("front", F), ("back", BACK)):
        lines += [f"g {name}\nusemtl {name}\n", *(f"f {a} {b} {c}\n" for a, b, c in (faces + 1).tolist())]
    (tmp_path / "cloth.obj").write_text("".join(lines))
    for ending in ("obj", "glb", "ply"):
        result = unwrap(tmp_path / "cloth.obj", repair=True)
        result.save(tmp_path / f"textured.{ending}")
        file = read_mesh(tmp_path / f"textured.{ending}")
        assert len(file.offsets) - 1 == 2 * len(F)
        assert file.uv is not None
        assert (file.texture >= 0).all()


@pytest.mark.parametrize("shift", [0.0, 1e6])
def test_two_sides_with_other_diagonals_are_two_sheets(shift):
    """Quads that each side splits from its own first corner."""
    vertices, _ = shapes.grid(6, 6, lambda x, y: 0.2 * np.sin(3 * x) * np.cos(2 * y))
    number = np.arange(49).reshape(7, 7)
    a, b, c, d = (
        corner.ravel() for corner in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:])
    )
    front = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    back = np.concatenate([np.stack([b, a, d], axis=1), np.stack([b, d, c], axis=1)])
    checked = check_mesh(vertices + shift, np.concatenate([front, back]), repair=True)
    assert checked.mesh.components[0] == 2
    assert len(checked.mesh.faces) == len(front) + len(back)


def test_solids_that_touch_along_an_edge_stay_apart():
    vertices, faces = shapes.box(1, (1.0, 1.0, 1.0))
    two_boxes = shapes.join((vertices, faces), (vertices + np.array([1.0, 1.0, 0.0]), faces))
    first, place = weld(np.round(two_boxes[0], 9))
    checked = check_mesh(np.round(two_boxes[0], 9)[first], place[two_boxes[1]], repair=True)
    assert checked.mesh.components[0] == 2


def test_sheets_that_cross_are_two_sheets():
    vertices = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]], dtype=float)
    faces = [[0, 1, 2], [1, 0, 3], [0, 1, 4], [1, 0, 5]]
    checked = check_mesh(vertices, faces, repair=True)
    assert checked.mesh.components[0] == 2
