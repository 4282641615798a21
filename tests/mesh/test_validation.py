from __future__ import annotations

import numpy as np
import pytest
import shapes

from coneflat import check_mesh, errors, flatten

V, F = shapes.hill(4, 3)


@pytest.mark.parametrize(
    ("vertices", "faces", "kind", "message"),
    [
        ([], F, errors.EmptyMeshError, "no vertices"),
        (V, [], errors.EmptyMeshError, "no faces"),
        (V[:, :2], F, errors.ArrayShapeError, r"\(20, 2\)"),
        (V, F[:, :2], errors.ArrayShapeError, r"\(24, 2\)"),
        (V.astype(str), F, errors.ArrayShapeError, "numbers"),
        (V, F.astype(complex), errors.ArrayShapeError, "vertex indices"),
        (V, F + 0.5, errors.ArrayShapeError, "integers"),
        ([[0, 0, 0], [1]], F, errors.ArrayShapeError, "numbers"),
        (V, F + 1, errors.FaceIndexError, r"2 faces with a vertex index outside 0\.\.19: 11, 23"),
        (V, F - 1, errors.FaceIndexError, "2 faces"),
        (np.where(V == V[3], np.nan, V), F, errors.NonFiniteError, "NaN"),
        (np.where(np.arange(60).reshape(20, 3) == 7, np.inf, V), F, errors.NonFiniteError, "1 vertex of 20.*: 2;"),
        (V, np.r_[F, [[0, 0, 1]]], errors.DegenerateFaceError, "1 face with the same vertex twice: 24;"),
        (V, np.r_[F, F[:1]], errors.NonManifoldError, "edge"),
    ],
)  # fmt: skip
def test_bad_arrays_are_named(vertices, faces, kind, message):
    with pytest.raises(kind, match=message):
        check_mesh(vertices, faces)
    with pytest.raises(kind):
        flatten(vertices, faces)


def test_mixed_orientation_is_made_consistent():
    faces = F.copy()
    faces[[3, 7, 11]] = faces[[3, 7, 11]][:, [0, 2, 1]]
    checked = check_mesh(V, faces)
    np.testing.assert_array_equal(np.sort(np.flatnonzero(checked.is_flipped)), [3, 7, 11])
    assert checked.notes == ("Flipped 3 faces for a consistent orientation.",)
    assert set(map(tuple, np.sort(checked.mesh.faces, axis=1))) == set(map(tuple, np.sort(F, axis=1)))
    tails, heads = checked.mesh.tails, checked.mesh.heads
    assert len(set(zip(tails.tolist(), heads.tolist(), strict=True))) == len(tails)


def test_moebius_strip_is_refused_or_cut():
    strip = shapes.moebius()
    with pytest.raises(errors.NonOrientableError, match="not orientable"):
        check_mesh(*strip)
    mesh = check_mesh(*strip, repair=True).mesh
    assert mesh.euler_characteristic == 1
    assert mesh.boundary_loops[0] == 1


def test_isolated_vertices_are_left_out():
    checked = check_mesh(np.r_[[[9, 9, 9]], V, [[8, 8, 8]]], F + 1)
    assert len(checked.mesh.vertices) == len(V)
    np.testing.assert_array_equal(checked.vertex_origin, np.arange(1, len(V) + 1))
    assert checked.notes == ("Left out 2 vertices without a face.",)


def test_vertices_without_a_face_may_be_anywhere():
    result = flatten(np.r_[V, [[np.nan, 0, 0]]], F)
    assert np.isfinite(result.uv).all()


def test_touching_surfaces_are_refused_or_split():
    vertices, faces = shapes.join(shapes.tetrahedron(), shapes.tetrahedron())
    faces[faces == 4] = 0
    with pytest.raises(errors.NonManifoldError, match="1 vertex where surfaces touch in a single point: 0;"):
        check_mesh(vertices, faces)
    checked = check_mesh(vertices, faces, repair=True)
    assert checked.mesh.components[0] == 2
    assert checked.vertex_origin.tolist() == [0, 0, 1, 2, 3, 5, 6, 7]


def test_crowded_edges_are_refused_or_separated():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1.0]])
    faces = np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    with pytest.raises(errors.NonManifoldError, match="1 edge with more than two faces.*0-1"):
        check_mesh(vertices, faces)
    checked = check_mesh(vertices, faces, repair=True)
    assert checked.mesh.components[0] == 3
    result = flatten(vertices, faces, repair=True)
    assert np.isfinite(result.uv).all()
    assert result.distortion.qc_max == pytest.approx(1)
    np.testing.assert_array_equal(result.vertex_origin[result.faces], faces)
