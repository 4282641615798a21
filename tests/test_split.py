"""Triangles that cannot be upright on straight sides are cut, and no others: the surface stays what it is."""

from __future__ import annotations

import re

import numpy as np
import pytest
import shapes

import coneflat
from coneflat import TriangleMesh, edge_lengths
from coneflat.files import read_mesh
from coneflat.geometry import double_areas
from coneflat.geometry.delaunay import make_delaunay
from coneflat.geometry.intrinsic import intrinsic_triangulation
from coneflat.geometry.planar import heights
from coneflat.layout.insert import insert_edges
from coneflat.layout.overlay import count_crossings


def wide_cone():
    """A sphere with a cone of 7 pi at a vertex of six triangles, each of which has room for less than pi."""
    vertices, faces = shapes.sphere(3)
    degree = np.bincount(faces.ravel())
    six = int(np.flatnonzero(degree == 6)[0])
    others = np.flatnonzero(degree == 5)[:9]
    return vertices, faces, {six: -5 * np.pi, **dict.fromkeys(others.tolist(), np.pi)}, six


def stretched():
    vertices, faces = shapes.sphere(3)
    vertices = vertices + 0.2 * np.sin(5 * vertices[:, [1, 2, 0]])
    return vertices * [300, 1, 1], faces


def check_cut(result, vertices, faces):
    """What holds of every mesh that was cut."""
    measures = result.distortion
    assert measures.flipped == measures.degenerate == 0
    assert measures.seam_mismatch_max < 1e-9
    assert measures.angle_sum_error < 1e-6
    assert np.abs(result.curvature_residual[np.isfinite(result.curvature_residual)]).max() < 1e-6
    added = len(result.faces) - len(faces)
    assert result.solve.split_triangles == added > 0
    assert any("cut at their edges" in note for note in result.notes)
    # The vertices of the input come first, and the others lie on its edges.
    assert np.array_equal(result.vertices[: len(vertices)], vertices)
    assert (result.vertex_origin[len(vertices) :] == -1).all()
    before, after = (
        double_areas(edge_lengths(*mesh)) for mesh in ((vertices, faces), (result.vertices, result.faces))
    )
    np.testing.assert_allclose(np.bincount(result.face_origin, after), before, rtol=1e-9)
    whole = np.bincount(result.face_origin)[result.face_origin] == 1
    assert np.array_equal(result.faces[whole], faces[result.face_origin[whole]])
    mesh = TriangleMesh(result.vertices, result.faces)
    assert not mesh.is_boundary_vertex.any()
    assert mesh.euler_characteristic == TriangleMesh(vertices, faces).euler_characteristic


def test_a_cone_too_wide_for_its_triangles_gets_more_of_them():
    vertices, faces, cones, six = wide_cone()
    result = coneflat.flatten(vertices, faces, cones=cones)
    check_cut(result, vertices, faces)
    assert np.count_nonzero(result.faces == six) > 7
    assert result.solve.split_triangles < 30


def test_without_cutting_the_faces_are_those_of_the_input():
    vertices, faces, cones, _ = wide_cone()
    result = coneflat.flatten(vertices, faces, cones=cones, split=False)
    assert np.array_equal(result.faces, faces)
    assert result.solve.split_triangles == 0
    assert result.distortion.flipped
    assert any("upside down" in note for note in result.notes)


def test_a_stretched_surface_has_no_triangle_upside_down():
    vertices, faces = stretched()
    check_cut(coneflat.flatten(vertices, faces), vertices, faces)


@pytest.mark.parametrize("axis", range(3))
def test_a_stretched_model_has_no_triangle_upside_down(shared, axis):
    source = read_mesh(shared("3holes.off"))
    vertices = source.vertices * np.where(np.arange(3) == axis, 100.0, 1.0)
    check_cut(coneflat.flatten(vertices, source.triangles), vertices, source.triangles)


def test_numbers_of_vertices_make_no_difference():
    vertices, faces = stretched()
    order = np.random.default_rng(0).permutation(len(vertices))
    number = np.argsort(order)
    one, two = coneflat.flatten(vertices, faces), coneflat.flatten(vertices[order], number[faces])
    assert one.solve.split_triangles == two.solve.split_triangles
    assert one.solve.qc_mean_unrelaxed == pytest.approx(two.solve.qc_mean_unrelaxed, rel=1e-6)
    # Newton's method ends a little short of the least distortion, from triangles that are bent a thousandfold.
    assert one.distortion.qc_mean == pytest.approx(two.distortion.qc_mean, rel=1e-4)


def test_nothing_is_cut_where_all_can_be_upright():
    vertices, faces = shapes.sphere(4)
    result = coneflat.flatten(vertices, faces)
    assert np.array_equal(result.faces, faces)
    assert not any("cut" in note for note in result.notes)


def test_own_lengths_are_not_cut():
    """Positions of new vertices would tell nothing of lengths that are given."""
    vertices, faces, cones, _ = wide_cone()
    result = coneflat.flatten(vertices, faces, cones=cones, lengths=edge_lengths(vertices, faces))
    assert np.array_equal(result.faces, faces)


class TestInsertion:
    def flat(self, seed):
        """A triangulated square in the plane, which is not Delaunay, and its Delaunay triangulation."""
        points, faces = shapes.grid(9, 9)
        points[:, 2] = 0
        inner = (np.abs(points[:, :2] - points[:, :2].mean(axis=0)) < 0.49 * np.ptp(points[:, 0])).all(axis=1)
        shift = np.random.default_rng(seed).uniform(-1, 1, (inner.sum(), 2))
        points[inner, :2] += 0.2 * np.ptp(points[:, 0]) / 9 * shift
        points = points * [20, 1, 1]
        mesh = TriangleMesh(points, faces)
        source = intrinsic_triangulation(mesh, edge_lengths(points, faces))
        delaunay = source.copy()
        return source, delaunay, make_delaunay(delaunay)

    @pytest.mark.parametrize("seed", range(4))
    def test_edges_of_a_plane_mesh_all_come_back(self, seed):
        """They are straight in its own plane, whatever was flipped."""
        source, delaunay, flips = self.flat(seed)
        counts, _ = count_crossings(source, delaunay, flips)
        assert (counts > 0).sum() > 100
        back = insert_edges(source, delaunay, flips)
        counts, first = count_crossings(source, back.triangulation, back.flips)
        assert (counts == -1).all()
        assert np.array_equal(np.sort(first), np.arange(len(counts)))
        np.testing.assert_allclose(back.triangulation.length, source.length[first], rtol=1e-9)

    def test_triangles_stay_upright_and_fit_their_neighbours(self):
        source, delaunay, flips = self.flat(0)
        back = insert_edges(source, delaunay, flips)
        assert heights(back.sides.reshape(-1, 3)).min() > 0
        twin = back.triangulation.twin
        inner = twin >= 0
        np.testing.assert_allclose(
            back.sides[inner],
            -back.turns[inner] * back.sides[twin[inner]],
            atol=1e-12 * np.abs(back.sides).max(),
        )


class TestFiles:
    @pytest.fixture
    def path(self, tmp_path):
        """The sphere with the wide cone as an OBJ file with groups, a comment and normals."""
        vertices, faces, cones, _ = wide_cone()
        lines = ["# a sphere", *(" ".join(("v", *map(repr, row))) for row in vertices.tolist())]
        lines += [" ".join(("vn", *map(repr, row))) for row in vertices.tolist()]
        for i, face in enumerate((faces + 1).tolist()):
            if i % 100 == 0:
                lines.append(f"g part{i}")
            lines.append("f " + " ".join(f"{v}//{v}" for v in face))
        path = tmp_path / "sphere.obj"
        path.write_text("\n".join(lines) + "\n")
        return path, cones

    def test_an_obj_keeps_its_groups_and_normals(self, path, tmp_path):
        path, cones = path
        result = coneflat.flatten(path, cones=cones)
        assert result.solve.split_triangles
        result.save(tmp_path / "out.obj")
        text = (tmp_path / "out.obj").read_text()
        assert re.findall("g part[0-9]+", text) == re.findall("g part[0-9]+", path.read_text())
        assert "# a sphere" in text
        assert len(re.findall("(?m)^v ", text)) == len(result.vertices)
        assert all(
            corner.count("/") == 2 for line in re.findall("(?m)^f (.*)$", text) for corner in line.split()
        )
        again = read_mesh(tmp_path / "out.obj")
        assert np.array_equal(np.sort(again.triangles, axis=1), np.sort(result.faces, axis=1))
        np.testing.assert_allclose(again.vertices, result.vertices)

    def test_groups_hold_what_they_held(self, path, tmp_path):
        path, cones = path
        result = coneflat.flatten(path, cones=cones)
        result.save(tmp_path / "out.obj")
        given, written = (
            [part.count("\nf ") for part in re.split("g part[0-9]+", file.read_text())[1:]]
            for file in (path, tmp_path / "out.obj")
        )
        pieces = np.bincount(result.face_origin // 100)
        assert written == pieces.tolist()
        assert sum(written) - sum(given) == result.solve.split_triangles

    @pytest.mark.parametrize("ending", ["obj", "ply", "glb", "npz"])
    def test_what_is_written_has_no_triangle_upside_down(self, path, tmp_path, ending):
        path, cones = path
        result = coneflat.flatten(path, cones=cones)
        result.save(tmp_path / f"out.{ending}")
        again = coneflat.measure_uv(tmp_path / f"out.{ending}")
        assert again.distortion.flipped == again.distortion.degenerate == 0
        assert len(again.distortion.qc) == len(result.faces)

    def test_colours_are_between_those_of_the_ends(self, path, tmp_path):
        path, cones = path
        vertices = read_mesh(path).vertices
        shade = np.round(127 + 100 * vertices).astype(int)
        count = iter(shade.tolist())
        lines = [
            " ".join((line, *(f"{one:g}" for one in np.array(next(count)) / 255)))
            if line.startswith("v ")
            else line
            for line in path.read_text().splitlines()
        ]
        path.write_text("\n".join(lines) + "\n")
        result = coneflat.flatten(path, cones=cones)
        new = np.flatnonzero(result.vertex_origin < 0)
        colours = np.stack([result.source.properties[name] for name in ("red", "green", "blue")], axis=1)
        np.testing.assert_allclose(colours[new], (127 + 100 * result.vertices[new]) / 255, atol=1 / 255)
