"""Congruent meshes with other numbers of vertices and faces."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

from coneflat import TriangleMesh
from coneflat.source import congruence

ROUNDING = 1e-5
MESHES = {
    "sphere": shapes.sphere(2, seed=3),
    "round sphere": shapes.sphere(2, bumps=0.0),
    "hill": shapes.hill(9, 8),
    "box": shapes.box(),
    "sheet": shapes.grid(5, 4),
}


def copied(mesh, seed, is_mirrored=False):
    """Return a mesh turned, moved and renumbered, mirrored first if required."""
    vertices, faces, _ = shapes.renumber(*mesh, seed=seed)
    if is_mirrored:
        vertices, faces = vertices * [1, 1, -1], faces[:, ::-1]
    return TriangleMesh(vertices @ shapes.rotation(seed).T + [3.0, seed, -1.0], faces)


@pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES)
@pytest.mark.parametrize("seed", [1, 2])
def test_corners_of_copies_have_the_same_distances(mesh, seed):
    first, second = TriangleMesh(*mesh), copied(mesh, seed)
    match = congruence(first, second, ROUNDING)
    assert match is not None
    assert not match.is_mirrored
    assert np.array_equal(np.sort(match.corners), np.arange(3 * len(first.faces)))
    points = first.vertices[first.faces.ravel()[match.corners]]
    images = second.vertices[second.faces.ravel()]
    rows = np.random.default_rng(0).integers(len(points), size=(2, 500))
    np.testing.assert_allclose(
        np.linalg.norm(points[rows[0]] - points[rows[1]], axis=1),
        np.linalg.norm(images[rows[0]] - images[rows[1]], axis=1),
        atol=1e-9,
    )


def test_mirror_images_are_found_where_no_rotation_fits():
    mesh = MESHES["sphere"]
    match = congruence(TriangleMesh(*mesh), copied(mesh, 1, is_mirrored=True), ROUNDING)
    assert match is not None
    assert match.is_mirrored


def test_a_symmetric_mesh_needs_no_reflection():
    vertices, faces = shapes.box()
    mirrored = TriangleMesh(vertices * [-1, 1, 1], faces[:, ::-1])
    match = congruence(TriangleMesh(vertices, faces), mirrored, ROUNDING)
    assert match is not None


@pytest.mark.parametrize("change", ["dent", "size", "face", "turned inside out"])
def test_other_meshes_are_not_congruent(change):
    vertices, faces = (np.array(values) for values in MESHES["sphere"])
    first = TriangleMesh(vertices.copy(), faces.copy())
    if change == "dent":
        vertices[7] *= 1.01
    elif change == "size":
        vertices *= 1.001
    elif change == "turned inside out":
        faces = faces[:, ::-1]
    else:
        pair = first.edge_halfedges[0]
        a, b = first.edges[0]
        c, d = (first.faces[side // 3][side % 3] for side in pair)
        faces[pair // 3] = [[a, d, c], [b, c, d]]
    assert congruence(first, copied((vertices, faces), 1), ROUNDING) is None


@pytest.mark.parametrize("distance", [0.0, 1e3, 1e5])
@pytest.mark.parametrize("stretch", [(1.0, 1.0, 1.01), (1.01, 1.01, 1.01), (1.0, 1.0, 1.4)])
@pytest.mark.parametrize("sizes", [(1.0, 1.0, 1.0), (0.01, 0.01, 10.0), (0.01, 10.0, 10.0)])
def test_meshes_of_another_shape_are_not_congruent_however_far_they_are(distance, stretch, sizes):
    """The rounding of positions far from the origin is larger than these meshes differ."""
    vertices, faces = shapes.box()
    vertices = vertices * np.array(sizes)
    first, second = TriangleMesh(vertices, faces), copied((vertices * np.array(stretch), faces), 1)
    moved = TriangleMesh(second.vertices + np.array([distance, 0, 0]), second.faces)
    assert congruence(first, moved, ROUNDING) is None


def test_the_section_of_a_long_mesh_matters():
    """The section has the same perimeter: the area differs little."""
    vertices, faces = shapes.box()
    first = TriangleMesh(vertices * [1, 1, 10.0], faces)
    flatter = TriangleMesh(vertices * [1.02, 0.98, 10.0] + [1e4, 0, 0], faces)
    assert congruence(first, flatter, ROUNDING) is None


def test_rounded_copies_are_congruent():
    vertices, faces = MESHES["sphere"]
    moved = (vertices @ shapes.rotation(1).T + [100.0, 0, 0]).astype(np.float32).astype(float)
    assert congruence(TriangleMesh(vertices, faces), TriangleMesh(moved, faces), ROUNDING) is not None


def test_labels_choose_among_the_congruences_of_a_symmetric_mesh():
    vertices, faces = shapes.box()
    first, second = TriangleMesh(vertices, faces), copied((vertices, faces), 3)
    labels = (np.arange(3 * len(faces)) == 0).astype(int)
    images = [congruence(first, second, ROUNDING, (labels, np.roll(labels, k))) for k in range(labels.size)]
    matched = [(k, match.corners) for k, match in enumerate(images) if match is not None]
    assert len(matched) > 1
    assert all(corners[k] == 0 for k, corners in matched)


def test_meshes_with_other_labels_are_not_congruent():
    first, second = TriangleMesh(*MESHES["sphere"]), copied(MESHES["sphere"], 1)
    labels = np.zeros(first.faces.size, dtype=int)
    assert congruence(first, second, ROUNDING, (labels, labels)) is not None
    assert congruence(first, second, ROUNDING, (labels, np.eye(1, labels.size, dtype=int)[0])) is None
