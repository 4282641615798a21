"""Boundary first flattening: its steps against dense algebra, the cones it promises, invariance, refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapes
from shapes import cut_disk, lengths_of

from coneflat import TriangleMesh, cut_open, edge_lengths, errors, find_seams, flatten
from coneflat.cones import cones_at, cones_with_curvature
from coneflat.cones.choose import Surface
from coneflat.flat.bff import HarmonicExtension, best_fit_lengths, boundary_first


def solved(vertices, faces, cones=(), curvatures=None):
    """Return a mesh, its side lengths and the cones with their linear scale."""
    mesh = TriangleMesh(vertices, faces)
    surface = Surface.of(mesh, lengths_of(mesh))
    given = surface.laplacian, surface.curvature, mesh.is_boundary_vertex, mesh.euler_characteristic
    cones = np.array(cones, dtype=np.int64)
    if curvatures is None:
        return mesh, surface.lengths, cones_at(*given, cones)
    return mesh, surface.lengths, cones_with_curvature(*given, cones, np.array(curvatures))


def laid_out(mesh, lengths, solution):
    costs = np.linalg.norm(np.diff(mesh.vertices[mesh.edges], axis=1)[:, 0], axis=1)
    seams = find_seams(mesh, solution.cones, costs)
    return boundary_first(mesh, lengths, solution).lay_out(cut_open(mesh, seams).mesh, seams)


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
        found = 2 * np.pi - around[cut.origin[on_border]]
        assert copies.max() > 1
        np.testing.assert_allclose(found, solution.target[cut.origin[on_border]], atol=1e-10)

    def test_best_fit_is_the_closest_closed_curve(self):
        rng = np.random.default_rng(0)
        count = 40
        which = np.concatenate([np.arange(30), np.arange(10)])
        lengths, wanted = rng.uniform(1, 2, 30)[which], rng.uniform(1, 1.1, 30)[which]
        tangents = np.exp(2j * np.pi * (np.arange(count) + rng.random(count)) / count)
        edge = 7 * which
        found = best_fit_lengths(wanted, lengths, tangents, edge)
        assert abs((found * tangents).sum()) < 1e-12
        # Stationary under changes that keep it closed, and of one length where sides belong together.
        change = found - wanted
        force = np.bincount(which, change / lengths)
        effect = np.stack([np.bincount(which, tangents.real), np.bincount(which, tangents.imag)])
        multipliers = np.linalg.lstsq(effect.T, force, rcond=None)[0]
        np.testing.assert_allclose(effect.T @ multipliers, force, atol=1e-12)
        np.testing.assert_allclose(found[:10], found[30:], rtol=1e-14)
        assert np.abs(change).max() > 1e-3

    def test_shifted_sides_cannot_close_a_curve(self):
        """A parallelogram whose opposite sides belong together is closed, and open if one is short."""
        tangents = np.array([1, 1j, -1, -1j])
        edge = np.array([0, 1, 0, 1])
        wanted = np.array([2.0, 1.0, 2.0, 1.0])
        np.testing.assert_array_equal(best_fit_lengths(wanted, wanted, tangents, edge), wanted)
        turned = tangents * np.exp(1j * np.array([0, 0, 1e-4, 0]))
        found = best_fit_lengths(wanted, wanted, turned, edge)
        assert abs((found * turned).sum()) < 1e-12
        assert np.abs(found - wanted).max() < 1e-3

    def test_extension_is_harmonic(self):
        disk = TriangleMesh(*shapes.grid(9, 7))
        values = np.where(disk.is_boundary_vertex, disk.vertices @ [2, -1, 0], np.nan)
        extended = HarmonicExtension(disk, lengths_of(disk)).extend(values)
        np.testing.assert_allclose(extended, disk.vertices @ [2, -1, 0], atol=1e-13)


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
        result = laid_out(mesh, lengths, solution)
        inside = ~mesh.is_boundary_vertex
        np.testing.assert_allclose(result.curvature[inside], solution.target[inside], atol=1e-10)
        sides = result.points[result.corners][:, [2, 0, 1]] - result.points[result.corners][:, [1, 2, 0]]
        one, two = mesh.edge_halfedges[~mesh.is_boundary_edge].T
        flat = np.linalg.norm(sides.reshape(-1, 2), axis=1)
        np.testing.assert_allclose(flat[one], flat[two], rtol=1e-10)

    def test_given_curvatures(self):
        wanted = np.array([1.7, 0.9, 0.6, 0.8]) * np.pi
        mesh, lengths, solution = solved(*shapes.sphere(3), (3, 77, 300, 500), wanted)
        np.testing.assert_allclose(
            laid_out(mesh, lengths, solution).curvature[solution.cones], wanted, atol=1e-10
        )

    def test_boundary_keeps_its_lengths(self):
        """The scale factors are zero there: but for what closes the curve, the lengths are the mesh's."""
        mesh, lengths, solution = solved(*shapes.hill(48, 40))
        result = laid_out(mesh, lengths, solution)
        border = mesh.edge_halfedges[mesh.is_boundary_edge, 0]
        ends = result.points[result.corners].reshape(-1, 2)
        corner = border % 3
        start, end = border - corner + (corner + 1) % 3, border - corner + (corner + 2) % 3
        ratio = np.linalg.norm(ends[end] - ends[start], axis=1) / lengths.ravel()[border]
        assert ratio.std() / ratio.mean() < 5e-3

    def test_comes_close_to_the_exact_metric_on_fine_meshes(self):
        """Measured, standard deviation of the log scale: 0.050, 0.015, 0.004 for meshes twice as fine each time."""
        off = []
        for fine in (1, 2, 4):
            shape = shapes.hill(12 * fine, 10 * fine)
            one, two = (
                flatten(*shape, cones="none", method=method, polish="off") for method in ("bff", "exact")
            )
            off.append(np.std(one.log_scale - two.log_scale))
        assert off[1] < off[0] / 2
        assert off[2] < off[1] / 2

    def test_tori_without_cones(self):
        """Sides of seams are shifted, not turned: together they cannot close the curve."""
        result = flatten(*shapes.torus(), cones="none", method="bff")
        assert result.distortion.flipped == 0
        assert result.distortion.qc_mean < 1.08
        assert 0 < result.distortion.seam_mismatch_max < 1e-3


class TestInvariance:
    def test_renumbering(self):
        mesh, lengths, solution = solved(*shapes.sphere(3), (3, 77, 300))
        plain = laid_out(mesh, lengths, solution)
        vertices, faces, new = shapes.renumber(mesh.vertices, mesh.faces)
        other = laid_out(*solved(vertices, faces, new[[3, 77, 300]]))
        np.testing.assert_allclose(other.log_scale[new], plain.log_scale, atol=1e-8)

    def test_a_constant_in_the_scale(self):
        mesh, lengths, solution = solved(*shapes.sphere(3), (3, 77, 300))
        one, two = (laid_out(mesh, lengths, s) for s in (solution, solution.shifted(7.0)))
        np.testing.assert_allclose(two.points, one.points, atol=1e-9)


class TestNotes:
    def test_says_how_far_the_curve_was_from_closed(self):
        closed = flatten(*shapes.sphere(2), method="bff")
        assert "lengths were changed by up to" in closed.notes[-1]
        assert not flatten(*shapes.hill(), cones="none", method="bff").notes

    def test_layouts_are_never_upside_down(self):
        """These cones are too sharp for a linear scale: triangles flip, but not most of them."""
        cones = {0: 1.99 * np.pi, 50: 1.99 * np.pi, 51: 0.02 * np.pi}
        result = flatten(*shapes.sphere(3), cones=cones, method="bff")
        assert result.distortion.flipped
        assert result.distortion.mirrored_charts == 0
        points = result.corner_uv @ [1, 1j]
        assert (np.conj(points[:, 1] - points[:, 0]) * (points[:, 2] - points[:, 0])).imag.sum() > 0

    def test_scales_that_overflow_are_refused(self):
        mesh, lengths, solution = solved(*shapes.sphere(2), (3, 77, 100))
        wild = replace(solution, log_scale=solution.log_scale * 1e4)
        with pytest.raises(errors.MetricError, match="more than numbers"):
            boundary_first(mesh, lengths, wild)


def test_cut_disk_of_a_developable_surface():
    vertices, faces = shapes.cylinder()
    disk = cut_disk(vertices, faces)
    flat = HarmonicExtension(disk, edge_lengths(disk.vertices, disk.faces))
    assert np.abs(flat.boundary_curvature(np.zeros(len(disk.vertices))).sum() - 2 * np.pi) < 1e-12
