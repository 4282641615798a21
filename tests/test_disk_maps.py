"""Methods that map the cut mesh: least squares conformal maps, boundary first flattening."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapes
from comparisons import flatten_by
from comparisons.bff import HarmonicExtension, best_fit_lengths, boundary_first
from comparisons.disk_maps import conformal_equations, least_squares_conformal
from shapes import laid_out, lengths_of

from coneflat import TriangleMesh, errors
from coneflat.cones import cones_at, cones_with_curvature
from coneflat.geometry import edge_lengths
from coneflat.layout import far_pins
from coneflat.mesh import cut_open
from coneflat.seams import find_seams
from coneflat.stages import Surface


def bent(columns=16, rows=10):
    """A sheet bent without stretching, and where it comes from."""
    vertices, faces = shapes.grid(columns, rows)
    angle = 2.5 * vertices[:, 0]
    return np.stack([np.sin(angle) / 2.5, vertices[:, 1], np.cos(angle) / 2.5], axis=1), faces


def layout(result):
    """Return the points of a result at the model's scale, corner by corner of the faces in their order."""
    return result.corner_uv.reshape(-1, 2) / result.uv_scale


class TestEnergy:
    def test_vanishes_on_similarities_only(self):
        mesh = TriangleMesh(*shapes.grid(5, 4))
        equations = conformal_equations(mesh, lengths_of(mesh))
        z = mesh.vertices[:, 0] + 1j * mesh.vertices[:, 1]
        assert np.abs(equations @ ((2 - 1j) * z + 3)).max() < 1e-13
        assert np.abs(equations @ np.conj(z)).max() > 0.1

    def test_the_map_minimises_the_energy(self):
        disk = TriangleMesh(*shapes.hill())
        lengths = lengths_of(disk)
        pins = far_pins(disk, lengths)
        z = least_squares_conformal(disk, lengths) @ [1, 1j]
        np.testing.assert_array_equal(z[pins], [0, 1])
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

    @pytest.mark.parametrize("method", ["lscm", "bff"])
    def test_sheets_and_boxes_unfold(self, method):
        for vertices, faces in (bent(), shapes.cylinder(), shapes.box(), shapes.tetrahedron()):
            result = flatten_by(method, vertices, faces)
            assert result.distortion.qc_max < 1 + 1e-9
            assert result.distortion.area_std < 1e-9
            assert result.distortion.flipped == 0
            assert result.distortion.mirrored_charts == 0
            assert result.distortion.curvature_error_max < 1e-9
            assert result.distortion.seam_mismatch_max < 1e-9


class TestInvariance:
    @pytest.mark.parametrize("method", ["lscm", "bff"])
    @pytest.mark.parametrize("scale", [1e-6, 1e6])
    def test_rigid_motion_and_scale(self, method, scale):
        vertices, faces = shapes.sphere(3)
        cones = {0: 1.2 * np.pi, 200: 1.5 * np.pi, 400: 1.3 * np.pi}
        plain = flatten_by(method, vertices, faces, cones=cones)
        moved = flatten_by(method, (vertices @ shapes.rotation().T + 5) * scale, faces, cones=cones)
        assert shapes.similar(layout(moved), layout(plain) * scale) < 1e-7 * scale


class TestPipeline:
    @pytest.mark.parametrize(("method", "name"), [("lscm", "LSCM")])
    def test_a_note_names_the_cut_of_closed_surfaces(self, method, name):
        closed = flatten_by(method, *shapes.sphere(2))
        note = closed.notes[-1]
        assert "cut open first" in note
        assert name in note
        assert "prescribes no cones" in note
        assert not flatten_by(method, *shapes.hill(), cones="none").notes
        notes_of_two = flatten_by(method, *shapes.join(shapes.sphere(1), shapes.sphere(2))).notes
        assert notes_of_two == (note.replace("match.", "match (and similarly 1 component more)."),)

    @pytest.mark.parametrize("method", ["lscm", "bff"])
    def test_closed_surfaces_need_cones_and_tori_do_not(self, method):
        with pytest.raises(errors.CurvatureError, match="closed surface .* needs cones"):
            flatten_by(method, *shapes.sphere(1), cones="none")
        assert flatten_by(method, *shapes.torus(20, 10), cones="none").distortion.flipped == 0

    @pytest.mark.parametrize("option", [{"boundary": "disk"}, {"stretch": 0.5}])
    def test_options_of_the_exact_metric_are_refused(self, option):
        with pytest.raises(errors.OptionError, match="method 'lscm'"):
            flatten_by("lscm", *shapes.hill(), **option)


def test_no_finite_solution_is_refused():
    disk = TriangleMesh(*shapes.grid(2, 2))
    with pytest.raises(errors.MetricError, match="8 triangles"):
        least_squares_conformal(disk, np.full((8, 3), np.nan))


@pytest.mark.parametrize("method", ["lscm", "bff"])
def test_a_component_without_area_keeps_its_size(method):
    """A triangle on a line, opened by a hair, beside one that is not: both are there, as long as they were."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 5, 0], [1, 5, 0], [0, 6, 0.0]])
    result = flatten_by(method, vertices, [[0, 1, 2], [3, 4, 5]])
    lengths = np.linalg.norm(np.diff(result.corner_uv / result.uv_scale, axis=1), axis=2)
    assert lengths == pytest.approx(np.array([[1, 1], [1, np.sqrt(2)]]), rel=1e-3)
    assert np.isfinite(result.solve.area_distortion)


def solved(vertices, faces, cones=(), curvatures=None):
    """Return a mesh, its side lengths and the cones with their linear scale."""
    mesh = TriangleMesh(vertices, faces)
    surface = Surface.of(mesh, lengths_of(mesh))
    operators = surface.laplacian, surface.curvature, mesh.is_boundary_vertex, mesh.euler_characteristic
    cones = np.array(cones, dtype=np.int64)
    if curvatures is None:
        return mesh, surface.lengths, cones_at(*operators, cones)
    return mesh, surface.lengths, cones_with_curvature(*operators, cones, np.array(curvatures))


class TestSteps:
    def test_dirichlet_to_neumann(self):
        """Of the cut mesh, it finds what the whole mesh's scale has on both sides of seams together."""
        mesh, lengths, solution = solved(*shapes.sphere(3), (3, 77, 300))
        cut = cut_open(mesh, find_seams(mesh, solution.cones, np.ones(len(mesh.edges))))
        on_border = cut.mesh.is_boundary_vertex
        k = HarmonicExtension(cut.mesh, lengths).boundary_curvature(
            np.where(on_border, solution.log_scale[cut.origin], np.nan)
        )
        np.testing.assert_allclose(k[on_border].sum(), 2 * np.pi, atol=1e-10)
        # What is left of a full turn around each vertex of the seams.
        copies = np.bincount(cut.origin)[cut.origin[on_border]]
        around = np.bincount(cut.origin[on_border], (np.pi - k[on_border]), len(mesh.vertices))
        curvature = 2 * np.pi - around[cut.origin[on_border]]
        assert copies.max() > 1
        np.testing.assert_allclose(curvature, solution.target[cut.origin[on_border]], atol=1e-10)

    def test_best_fit_is_the_closest_closed_curve(self):
        rng = np.random.default_rng(0)
        count = 40
        edge_numbers = np.concatenate([np.arange(30), np.arange(10)])
        lengths, targets = rng.uniform(1, 2, 30)[edge_numbers], rng.uniform(1, 1.1, 30)[edge_numbers]
        tangents = np.exp(2j * np.pi * (np.arange(count) + rng.random(count)) / count)
        edge = 7 * edge_numbers
        fitted = best_fit_lengths(targets, lengths, tangents, edge)
        assert abs((fitted * tangents).sum()) < 1e-12
        # Stationary under changes that keep it closed, and of one length where sides belong together.
        change = fitted - targets
        force = np.bincount(edge_numbers, change / lengths)
        effect = np.stack(
            [np.bincount(edge_numbers, tangents.real), np.bincount(edge_numbers, tangents.imag)]
        )
        multipliers = np.linalg.lstsq(effect.T, force, rcond=None)[0]
        np.testing.assert_allclose(effect.T @ multipliers, force, atol=1e-12)
        np.testing.assert_allclose(fitted[:10], fitted[30:], rtol=1e-14)
        assert np.abs(change).max() > 1e-3


class TestPromises:
    @pytest.mark.parametrize(
        ("shape", "cones"),
        [
            (shapes.sphere(3), (3, 77, 300, 500)),
            (shapes.torus(), (11, 400)),
            (shapes.hill(), (200,)),
            (shapes.annulus(), ()),
        ],
    )
    def test_cones_have_their_curvature_and_seams_fit(self, shape, cones):
        """The scale is a first approximation: but what the curve has is just what was asked for."""
        mesh, lengths, solution = solved(*shape, cones)
        result = laid_out(boundary_first(mesh, lengths, solution))
        inside = ~mesh.is_boundary_vertex
        np.testing.assert_allclose(result.curvature[inside], solution.target[inside], atol=1e-10)
        sides = result.points[result.corners][:, [2, 0, 1]] - result.points[result.corners][:, [1, 2, 0]]
        first, second = mesh.edge_halfedges[~mesh.is_boundary_edge].T
        flat = np.linalg.norm(sides.reshape(-1, 2), axis=1)
        np.testing.assert_allclose(flat[first], flat[second], rtol=1e-10)


class TestNotes:
    def test_a_note_gives_the_change_of_boundary_lengths(self):
        closed = flatten_by("bff", *shapes.sphere(3))
        assert "lengths were changed by up to" in closed.notes[0]
        assert not flatten_by("bff", *shapes.hill(), cones="none").notes

    def test_charts_are_never_mirrored(self):
        """These cones are too sharp for a linear scale: triangles flip, but not most of them."""
        cones = {0: 1.99 * np.pi, 50: 1.99 * np.pi, 51: 0.02 * np.pi}
        result = flatten_by("bff", *shapes.sphere(3), cones=cones)
        assert result.distortion.flipped
        assert result.distortion.mirrored_charts == 0
        points = result.corner_uv @ [1, 1j]
        assert (np.conj(points[:, 1] - points[:, 0]) * (points[:, 2] - points[:, 0])).imag.sum() > 0

    def test_scales_that_overflow_are_refused(self):
        mesh, lengths, solution = solved(*shapes.sphere(2), (3, 77, 100))
        wild = replace(solution, log_scale=solution.log_scale * 1e4)
        with pytest.raises(errors.MetricError, match="overflows double precision"):
            boundary_first(mesh, lengths, wild)
