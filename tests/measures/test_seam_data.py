"""The cut as data: the motion between the two sides of every seam edge, charts, cone angles and scales."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cache

import numpy as np
import pytest
import shapes
from comparisons import flatten_by
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

import coneflat
from coneflat.measures.seam_data import seam_rotations
from coneflat.mesh.connectivity import TriangleMesh

RIGHT = np.pi / 2
RIGID = {
    "one chart": (shapes.sphere(2), {}),
    "atlas": (shapes.join(shapes.torus(), shapes.sphere(2)), {"charts": "atlas", "sharp_angle": 0.5}),
    "quanta": (shapes.sphere(2), {"quantise": RIGHT, "charts": "atlas"}),
    "handles": (shapes.genus(2), {"quantise": RIGHT, "correct_handles": True}),
    "faces of a box": (shapes.box(), {"sharp_angle": 1.0, "charts": "atlas"}),
    "straight border": (shapes.hill(), {"boundary": "straight"}),
}
LOOSE = {
    "least squares": (shapes.sphere(2), {}),
    "linear": (shapes.sphere(2), {"method": "linear"}),
}


@cache
def flattened(name):
    mesh, options = (RIGID | LOOSE)[name]
    if name == "least squares":
        return flatten_by("lscm", *mesh)
    return coneflat.flatten(*mesh, **options)


def moved(data, z):
    """Points on side 0, (k, ends), after the motions."""
    factor = data.seam_scale * np.exp(1j * data.seam_rotation)
    return factor[:, None] * z + (data.seam_translation @ [1, 1j])[:, None]


@pytest.mark.parametrize("name", RIGID | LOOSE)
class TestEveryResult:
    def test_the_motion_takes_one_side_to_the_other(self, name):
        result = flattened(name)
        data = result.seam_data
        left, right = (result.uv @ [1, 1j])[data.seam_points].transpose(1, 0, 2)
        np.testing.assert_allclose(moved(data, left), right, atol=1e-14)
        assert (np.abs(data.seam_rotation) <= np.pi).all()
        if name in RIGID:
            np.testing.assert_allclose(data.seam_scale, 1.0, atol=1e-12)
        else:
            assert np.abs(data.seam_scale - 1.0).max() > 0.01

    def test_sides_are_those_of_the_seams(self, name):
        result = flattened(name)
        data = result.seam_data
        np.testing.assert_array_equal(data.seams, result.seams)
        for side in (0, 1):
            face, corner = data.seam_faces[:, side], data.seam_corners[:, side]
            start, end = (result.faces[face, (corner + step) % 3] for step in (1, 2))
            # Side 0 is on the left of the way along the edge, side 1 on its right.
            np.testing.assert_array_equal(np.stack([start, end][:: 1 - 2 * side], 1), data.seams)
            points = [result.uv_faces[face, (corner + step) % 3] for step in (1, 2)]
            np.testing.assert_array_equal(np.stack(points[:: 1 - 2 * side], 1), data.seam_points[:, side])
            np.testing.assert_array_equal(data.seam_charts[:, side], data.face_chart[face])

    def test_all_inner_edges_with_different_points_are_seams(self, name):
        result = flattened(name)
        sides = {}
        for face, points in zip(result.faces.tolist(), result.uv_faces.tolist(), strict=True):
            for i in range(3):
                j = (i + 1) % 3
                ends = tuple(sorted([(face[i], points[i]), (face[j], points[j])]))
                sides.setdefault((ends[0][0], ends[1][0]), []).append(ends)
        cut = {edge for edge, ends in sides.items() if len(ends) == 2 and ends[0] != ends[1]}
        assert cut == {tuple(edge) for edge in np.sort(result.seam_data.seams, axis=1).tolist()}

    def test_charts_are_the_connected_pieces(self, name):
        result = flattened(name)
        corners = result.uv_faces
        shape = (len(result.faces), len(result.uv))
        at = csr_matrix((np.ones(corners.size), (np.repeat(np.arange(shape[0]), 3), corners.ravel())), shape)
        count, piece = connected_components(at @ at.T, directed=False)
        chart = result.seam_data.face_chart
        assert count == chart.max() + 1 == result.distortion.charts
        assert len(np.unique(np.stack([piece, chart]), axis=1).T) == count
        # They are counted in the order of their first triangles.
        assert (np.diff(np.unique(chart, return_index=True)[1]) > 0).all()

    def test_types_and_shapes(self, name):
        result = flattened(name)
        k, m, n = len(result.seams), len(result.faces), len(result.vertices)
        shape = {
            "seams": (k, 2), "seam_faces": (k, 2), "seam_corners": (k, 2), "seam_points": (k, 2, 2),
            "seam_charts": (k, 2), "seam_rotation": (k,), "seam_translation": (k, 2), "seam_scale": (k,),
            "face_chart": (m,), "cones": (len(result.cones),), "cone_angles": (len(result.cones),),
            "vertex_log_scale": (n,), "log_area_scale": (m,),
        }  # fmt: skip
        real = (
            "seam_rotation",
            "seam_translation",
            "seam_scale",
            "cone_angles",
            "vertex_log_scale",
            "log_area_scale",
        )
        arrays = result.seam_data.as_arrays()
        assert {key: array.shape for key, array in arrays.items()} == shape
        assert {key for key, array in arrays.items() if array.dtype == np.float64} == set(real)
        assert all(array.dtype == np.int64 for key, array in arrays.items() if key not in real)
        assert result.seam_data is result.seam_data


def turning(result, vertex):
    """The sum of the rotations of the seams crossed on a way around an inner vertex counterclockwise."""
    data = result.seam_data
    mesh = TriangleMesh(result.vertices, result.faces)
    seam_of = {tuple(sorted(edge)): i for i, edge in enumerate(data.seams.tolist())}
    total, first = 0.0, int(np.flatnonzero((mesh.faces == vertex).any(axis=1))[0])
    face = first
    while True:
        corner = mesh.faces[face].tolist().index(vertex)
        # Counterclockwise: out over the side that arrives at the vertex.
        leaving = 3 * face + (corner + 1) % 3
        edge = mesh.halfedge_edges[leaving]
        face = int(mesh.edge_faces[edge][mesh.edge_halfedges[edge] != leaving][0])
        seam = seam_of.get(tuple(mesh.edges[edge].tolist()))
        if seam is not None:
            total += data.seam_rotation[seam] * (1 if data.seam_faces[seam, 1] == face else -1)
        if face == first:
            return total


@pytest.mark.parametrize("name", RIGID)
def test_rotations_around_a_vertex_sum_to_its_curvature(name):
    result = flattened(name)
    z = result.corner_uv @ [1, 1j]
    angles = np.abs(np.angle((np.roll(z, -1, 1) - z) / (np.roll(z, 1, 1) - z)))
    curvature = 2 * np.pi - np.bincount(result.faces.ravel(), angles.ravel(), len(result.vertices))
    border = TriangleMesh(result.vertices, result.faces).is_boundary_vertex
    vertices = np.unique(np.concatenate([result.cones, result.seams.ravel()[:40]]))
    for vertex in vertices[~border[vertices]]:
        assert abs(np.exp(1j * (turning(result, vertex) - curvature[vertex])) - 1) < 1e-10
    np.testing.assert_allclose(result.seam_data.cone_angles, 2 * np.pi - curvature[result.cones], atol=1e-12)
    np.testing.assert_allclose(curvature[result.cones], result.curvatures, atol=1e-10)


@pytest.mark.parametrize("name", ["quanta", "handles"])
def test_quanta_turn_by_multiples(name):
    turns = flattened(name).seam_data.seam_rotation / RIGHT
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-9)


def test_scales_of_a_plane_that_is_stretched_in_half():
    """Two triangles of areas 1/2 and 1; the layout has 9 times the area of the first, 4 times that of the second."""
    flat = coneflat.flatten(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 2, 0.0]]), [[0, 1, 2], [1, 3, 2]])
    scale = np.log([3.0, 2.0])
    data = replace(flat, distortion=replace(flat.distortion, log_area_scale=scale)).seam_data
    np.testing.assert_allclose(
        data.vertex_log_scale, np.log([9, (4.5 + 4) / 1.5, (4.5 + 4) / 1.5, 4]) / 2, rtol=1e-14
    )


@pytest.mark.parametrize("exponent", [-300, 300])
def test_measured_scales_follow_the_metric(exponent):
    """Of a fine mesh they are the log conformal factor, but for the size of the layout."""
    vertices, faces = shapes.hill(60, 50)
    result = coneflat.flatten(np.ldexp(vertices, exponent), faces, distortion=0.1)
    scale = result.seam_data.vertex_log_scale - np.log(result.uv_scale)
    off = np.abs(scale - result.log_scale)
    assert np.median(off) < 0.01
    assert np.isfinite(scale).all()


def test_vertices_without_a_face_have_no_scale():
    vertices, faces = shapes.hill()
    result = coneflat.flatten(np.concatenate([[[9.0, 9, 9]], vertices]), faces + 1)
    np.testing.assert_array_equal(
        np.isnan(result.seam_data.vertex_log_scale), np.arange(len(vertices) + 1) == 0
    )


def test_seam_pairs_that_are_no_inner_edges_have_unknown_motion():
    """Pairs that are a border of the model, or no edge at all, as a damaged file may have them."""
    result = flattened("one chart")
    hill = coneflat.flatten(*shapes.hill())
    mesh = TriangleMesh(hill.vertices, hill.faces)
    border = mesh.edges[mesh.is_boundary_edge][:2]
    data = replace(
        hill, seams=np.concatenate([border, [[0, len(hill.vertices) - 1], [3, 3]], hill.seams])
    ).seam_data
    assert (data.seam_faces[:2] < 0).sum(axis=1).tolist() == [1, 1]
    assert (data.seam_faces[2:4] == -1).all()
    for name in ("seam_rotation", "seam_scale", "seam_translation"):
        assert np.isnan(getattr(data, name)[:4]).all()
        np.testing.assert_array_equal(getattr(data, name)[4:], getattr(hill.seam_data, name))
    assert (data.seam_points[data.seam_faces < 0] == -1).all()
    assert (data.seam_charts[data.seam_faces < 0] == -1).all()
    none = replace(result, seams=np.empty((0, 2), dtype=np.int64)).seam_data
    assert none.seam_points.shape == (0, 2, 2)


class TestArchives:
    def test_seam_data_is_written_and_read_back(self, tmp_path):
        result = flattened("quanta")
        path = result.save(tmp_path / "out.npz")
        again = coneflat.read_flattening(path).seam_data
        with np.load(path) as archive:
            for name, array in result.seam_data.as_arrays().items():
                np.testing.assert_array_equal(archive[name], array)
                assert archive[name].dtype == array.dtype
                np.testing.assert_array_equal(getattr(again, name), array)
        assert {field.name for field in fields(again)} == set(again.as_arrays())

    def test_older_archives_do_without(self, tmp_path):
        result = flattened("quanta")
        with np.load(result.save(tmp_path / "out.npz")) as archive:
            older = ("seams", "cones", "log_area_scale")
            arrays = {
                name: archive[name]
                for name in archive.files
                if name in older or name not in result.seam_data.as_arrays()
            }
        np.savez(tmp_path / "old.npz", **arrays)
        old = coneflat.read_flattening(tmp_path / "old.npz").seam_data
        np.testing.assert_array_equal(old.seam_rotation, result.seam_data.seam_rotation)


@pytest.mark.parametrize("collapsed", [0, 1])
def test_a_side_without_length_has_no_rotation(collapsed: int):
    mesh = TriangleMesh(np.eye(4, 3), np.array([[0, 1, 2], [0, 2, 3]]))
    corners = np.array([[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], [[0.0, 0.0], [1.0, 2.0], [0.0, 1.0]]])
    assert seam_rotations(mesh, corners, 1.0)[0] > 0.01
    side = [0, 2] if collapsed == 0 else [0, 1]
    corners[collapsed, side] = 0.25
    assert seam_rotations(mesh, corners, 1.0)[0] == 0.0
