"""Least squares conformal maps: the energy, exact cases, libigl's, invariance, notes."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from shapes import cut_disk, lengths_of

from coneflat import TriangleMesh, edge_lengths, errors, flatten
from coneflat.apps.compare.run import flatten as flatten_by_any
from coneflat.flat.disk_maps import conformal_equations, least_squares_conformal


def bent(columns=16, rows=10):
    """A sheet bent without stretching, and where it comes from."""
    vertices, faces = shapes.grid(columns, rows)
    angle = 2.5 * vertices[:, 0]
    return np.stack([np.sin(angle) / 2.5, vertices[:, 1], np.cos(angle) / 2.5], axis=1), faces


def layout(result):
    """Return the points of a result at the model's scale, corner by corner of the faces in their order."""
    return result.corner_uv.reshape(-1, 2) / result.uv_scale


class TestEnergy:
    def test_is_twice_dirichlet_less_area(self):
        mesh = TriangleMesh(*shapes.hill(7, 5))
        lengths = lengths_of(mesh)
        z = np.random.default_rng(0).normal(size=(len(mesh.vertices), 2)) @ [1, 1j]
        dirichlet = area = 0.0
        for face in mesh.faces:
            p, w = mesh.vertices[face], z[face]
            for i in range(3):
                one, two = p[(i + 1) % 3] - p[i], p[(i + 2) % 3] - p[i]
                cotangent = one @ two / np.linalg.norm(np.cross(one, two))
                dirichlet += cotangent * abs(w[(i + 1) % 3] - w[(i + 2) % 3]) ** 2 / 4
            area += (np.conj(w[1] - w[0]) * (w[2] - w[0])).imag / 2
        energy = np.linalg.norm(conformal_equations(mesh, lengths) @ z) ** 2
        np.testing.assert_allclose(energy, 2 * (dirichlet - area), rtol=1e-12)

    def test_vanishes_on_similarities_only(self):
        mesh = TriangleMesh(*shapes.grid(5, 4))
        equations = conformal_equations(mesh, lengths_of(mesh))
        z = mesh.vertices[:, 0] + 1j * mesh.vertices[:, 1]
        assert np.abs(equations @ ((2 - 1j) * z + 3)).max() < 1e-13
        assert np.abs(equations @ np.conj(z)).max() > 0.1

    def test_the_map_has_the_least(self):
        disk = TriangleMesh(*shapes.hill())
        lengths = lengths_of(disk)
        pins = np.array([3, 400])
        z = least_squares_conformal(disk, lengths, pins) @ [1, 1j]
        assert z[3] == 0
        assert z[400] == 1
        equations = conformal_equations(disk, lengths)
        force = equations.conj().T @ (equations @ z)
        force[pins] = 0
        assert np.abs(force).max() < 1e-12


class TestExactCases:
    @pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
    def test_flat_mesh_comes_back(self, scale):
        vertices, faces = shapes.grid(9, 5)
        points = least_squares_conformal(
            TriangleMesh(vertices * scale, faces), edge_lengths(vertices * scale, faces)
        )
        assert shapes.similar(points, vertices[:, :2]) < 1e-12

    def test_slivers_do_not_hurt(self):
        vertices, faces = shapes.grid(30, 30)
        vertices[:, 1] *= 1e-3
        points = least_squares_conformal(TriangleMesh(vertices, faces), edge_lengths(vertices, faces))
        assert shapes.similar(points, vertices[:, :2]) < 1e-8

    @pytest.mark.parametrize("method", ["lscm", "spectral", "bff"])
    def test_sheets_and_boxes_unfold(self, method):
        for vertices, faces in (bent(), shapes.cylinder(), shapes.box(), shapes.tetrahedron()):
            result = flatten(vertices, faces, method=method)
            assert result.distortion.qc_max < 1 + 1e-9
            assert result.distortion.area_std < 1e-9
            assert result.distortion.flipped == 0
            assert result.distortion.mirrored_charts == 0
            assert result.distortion.curvature_error_max < 1e-9
            assert result.distortion.seam_mismatch_max < 1e-9


class TestLibigl:
    @pytest.mark.parametrize("shape", [shapes.hill(), shapes.annulus(), shapes.sphere(3), shapes.torus()])
    def test_agrees(self, shape):
        self.check(cut_disk(*shape, cones=(5, 40, 111)))

    def test_agrees_on_a_real_model(self, shared):
        result = flatten(shared("fandisk.obj"), method="lscm")
        vertices = np.empty((len(result.uv), 3))
        vertices[result.uv_faces] = result.vertices[result.faces]
        self.check(TriangleMesh(vertices, result.uv_faces))

    def check(self, disk):
        igl = pytest.importorskip("igl")
        lengths = lengths_of(disk)
        border = np.flatnonzero(disk.is_boundary_vertex)
        pins = border[[0, len(border) // 2]]
        points = least_squares_conformal(disk, lengths, pins)
        theirs = igl.lscm(disk.vertices, disk.faces, pins, np.array([[0.0, 0.0], [1.0, 0.0]]))[0]
        assert shapes.similar(points, theirs) < 1e-6 * np.ptp(theirs)
        # The pins are the same: so is the place.
        assert np.abs(points - theirs).max() < 1e-6 * np.ptp(theirs)


class TestInvariance:
    def test_renumbering(self):
        disk = cut_disk(*shapes.sphere(3), cones=(3, 77, 300))
        vertices, faces, new = shapes.renumber(disk.vertices, disk.faces)
        points = least_squares_conformal(disk, lengths_of(disk))
        again = least_squares_conformal(TriangleMesh(vertices, faces), edge_lengths(vertices, faces))[new]
        assert shapes.similar(again, points) < 1e-9 * np.ptp(points)

    @pytest.mark.parametrize("method", ["lscm", "spectral", "bff"])
    @pytest.mark.parametrize("scale", [1e-6, 1e6])
    def test_rigid_motion_and_scale(self, method, scale):
        vertices, faces = shapes.sphere(3)
        cones = {0: 1.2 * np.pi, 200: 1.5 * np.pi, 400: 1.3 * np.pi}
        plain = flatten(vertices, faces, cones=cones, method=method)
        moved = flatten((vertices @ shapes.rotation().T + 5) * scale, faces, cones=cones, method=method)
        assert shapes.similar(layout(moved), layout(plain) * scale) < 1e-7 * scale

    @pytest.mark.parametrize("method", ["lscm", "spectral", "bff"])
    def test_the_same_bits_again(self, method):
        one, two = (flatten(*shapes.torus(), method=method) for _ in range(2))
        np.testing.assert_array_equal(one.uv, two.uv)


class TestPipeline:
    @pytest.mark.parametrize(("method", "name"), [("lscm", "LSCM"), ("spectral", "the spectral method")])
    def test_says_that_it_cut(self, method, name):
        closed = flatten(*shapes.sphere(2), method=method)
        note = closed.notes[-1]
        assert "cut open first" in note
        assert name in note
        assert "prescribes no cones" in note
        assert not flatten(*shapes.hill(), cones="none", method=method).notes
        assert flatten(*shapes.join(shapes.sphere(1), shapes.sphere(2)), method=method).notes == (note,)

    @pytest.mark.parametrize("method", ["lscm", "spectral", "bff"])
    def test_nothing_to_cut_through(self, method):
        with pytest.raises(errors.CurvatureError, match="closed surface .* needs cones"):
            flatten(*shapes.sphere(1), cones="none", method=method)
        assert flatten(*shapes.torus(20, 10), cones="none", method=method).distortion.flipped == 0

    @pytest.mark.parametrize("method", ["lscm", "spectral", "bff"])
    def test_several_components(self, method):
        result = flatten(*shapes.join(shapes.sphere(2), shapes.hill(), shapes.genus(1)), method=method)
        assert result.distortion.charts == 3
        assert result.distortion.flipped == 0
        assert result.distortion.mirrored_charts == 0

    @pytest.mark.parametrize("method", ["lscm", "spectral", "bff"])
    @pytest.mark.parametrize("name", ["fandisk.obj", "rocker-arm.obj", "plane-holes.obj"])
    def test_real_models(self, shared, method, name):
        """Measured: QC below 1.063, but 1.115 for BFF on the plane with holes; one flipped triangle at most.

        These methods promise nothing about flips: with the fewer cones of the default, two on the plane with holes.
        """
        distortion = 0.15 if name == "plane-holes.obj" else 0.2
        result = flatten(shared(name), method=method, distortion=distortion)
        bound = 1.12 if (method, name) == ("bff", "plane-holes.obj") else 1.07
        assert result.distortion.qc_mean < bound
        assert result.distortion.flipped <= 1
        assert result.distortion.mirrored_charts == 0

    @pytest.mark.parametrize("option", [{"refine": True}, {"best_effort": True}, {"boundary": "disk"}])
    def test_options_of_the_exact_metric_are_refused(self, option):
        with pytest.raises(errors.OptionError, match="method 'lscm'"):
            flatten(*shapes.hill(), method="lscm", **option)


def test_no_finite_solution_is_refused():
    disk = TriangleMesh(*shapes.grid(2, 2))
    with pytest.raises(errors.MetricError, match="8 triangles"):
        least_squares_conformal(disk, np.full((8, 3), np.nan), np.array([0, 8]))


@pytest.mark.parametrize("method", ["lscm", "spectral", "bff", "abf++/free"])
def test_a_component_without_area_keeps_its_size(method):
    """A triangle on a line, opened by a hair, beside one that is not: both are there, as long as they were."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 5, 0], [1, 5, 0], [0, 6, 0.0]])
    result = flatten_by_any(vertices, [[0, 1, 2], [3, 4, 5]], method=method)
    lengths = np.linalg.norm(np.diff(result.corner_uv / result.uv_scale, axis=1), axis=2)
    assert lengths == pytest.approx(np.array([[1, 1], [1, np.sqrt(2)]]), rel=1e-3)
    assert np.isfinite(result.solve.area_distortion)
