"""Circle patterns: the quadratic program, the radii, known metrics, the paper's figures, refusals."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from comparisons import compare_methods, flatten_by
from comparisons.pattern_angles import MIN_ANGLE_FRACTION, MIN_MEETING, coherent_angles
from comparisons.pattern_radii import RadiiProblem, circle_pattern
from comparisons.patterns import circle_patterns
from scipy.optimize import minimize
from scipy.special import spence
from shapes import laid_out, lengths_of

from coneflat import TriangleMesh, errors
from coneflat.cones import greedy_cones
from coneflat.geometry import angle_defect, corner_angles, edge_lengths
from coneflat.geometry.delaunay import intrinsic_delaunay
from coneflat.geometry.intrinsic import intrinsic_triangulation
from coneflat.io import as_input
from coneflat.linalg.newton import Point
from coneflat.measures.distortion import measure
from coneflat.mesh.ties import tie_key
from coneflat.options import Options
from coneflat.source import Source
from coneflat.stages import ConeSolution, Surface


def solution_of(mesh, curvatures):
    target = np.zeros(len(mesh.vertices))
    target[list(curvatures)] = list(curvatures.values())
    return ConeSolution(np.array(list(curvatures), dtype=np.int64), target, np.zeros(len(target)))


def noisy(shape, noise, seed=0):
    vertices, faces = shape
    size = edge_lengths(vertices, faces).mean()
    return TriangleMesh(
        vertices + noise * size * np.random.default_rng(seed).normal(size=vertices.shape), faces
    )


def even_cones(mesh, count=8):
    """The same curvature at so many vertices, far from each other in number."""
    where = np.linspace(0, len(mesh.vertices) - 1, count).astype(int)
    return solution_of(mesh, dict.fromkeys(where.tolist(), 2 * np.pi * mesh.euler_characteristic / count))


def angles_for(mesh, solution):
    triangulation = intrinsic_triangulation(mesh, lengths_of(mesh))
    angles = corner_angles(lengths_of(mesh)).ravel()
    inner = ~mesh.is_boundary_vertex
    return (triangulation, angles, coherent_angles(triangulation, angles, 2 * np.pi - solution.target, inner))


def test_angles_are_the_nearest_as_another_solver_finds_them():
    mesh = noisy(shapes.sphere(0), 0.25)
    solution = even_cones(mesh, 12)
    triangulation, angles, coherent = angles_for(mesh, solution)
    assert coherent.converged
    first_halves = np.flatnonzero(triangulation.twin > np.arange(len(angles)))
    corner = np.arange(len(angles))
    rows = np.zeros((len(mesh.faces) + len(mesh.vertices), len(angles)))
    rows[corner // 3, corner] = rows[len(mesh.faces) + mesh.faces.ravel(), corner] = 1
    sums = np.concatenate([np.full(len(mesh.faces), np.pi), 2 * np.pi - solution.target])
    meeting = np.eye(len(angles))[first_halves] + np.eye(len(angles))[triangulation.twin[first_halves]]
    best = minimize(
        lambda x: ((x - angles) ** 2).sum() / 2,
        angles,
        jac=lambda x: x - angles,
        bounds=[(min(MIN_ANGLE_FRACTION * a, 0.02), None) for a in angles],
        constraints=[
            {"type": "eq", "fun": lambda x: (rows @ x - sums)[:-1], "jac": lambda x: rows[:-1]},
            {"type": "ineq", "fun": lambda x: np.pi - MIN_MEETING - meeting @ x, "jac": lambda x: -meeting},
        ],
        method="SLSQP",
        options={"maxiter": 300, "ftol": 1e-14},
    )
    assert best.success
    np.testing.assert_allclose(coherent.angles, best.x, atol=1e-6)
    assert (meeting @ coherent.angles > np.pi - MIN_MEETING - 1e-9).any()


class TestRadii:
    def test_the_residual_is_the_slope_of_the_papers_energy(self):
        mesh = noisy(shapes.hill(5, 4), 0.1)
        triangulation, _ = intrinsic_delaunay(mesh, lengths_of(mesh))
        mesh_angles = corner_angles(triangulation.length.reshape(-1, 3)).ravel()
        full = np.full(len(mesh.vertices), 2 * np.pi)
        angles = coherent_angles(triangulation, mesh_angles, full, ~mesh.is_boundary_vertex)
        problem = RadiiProblem(triangulation.twin, angles)
        twin = triangulation.twin
        inner = np.flatnonzero(twin > np.arange(len(twin)))
        border = np.flatnonzero(twin < 0)
        theta = np.pi - angles.angles[inner] - angles.angles[twin[inner]]

        def energy(rho):
            first, second = rho[inner // 3], rho[twin[inner] // 3]
            total = 2 * np.pi * rho.sum() - 2 * (angles.angles[border] * rho[border // 3]).sum()
            for x in (first - second, second - first):
                total += spence(1 - np.exp(x + 1j * theta)).imag.sum()
            return total - ((np.pi - theta) * (first + second)).sum()

        rho = np.random.default_rng(1).normal(0, 0.3, len(mesh.faces))
        problem.base = np.zeros_like(rho)
        slope = np.array(
            [(energy(rho + 1e-5 * e) - energy(rho - 1e-5 * e)) / 2e-5 for e in np.eye(len(mesh.faces))]
        )
        np.testing.assert_allclose(problem.evaluate(rho).residual, -slope / 2, atol=1e-8)
        step = 1e-6 * np.random.default_rng(2).normal(size=len(mesh.faces))
        bend = problem.evaluate(rho).residual - problem.evaluate(rho + step).residual
        back, _ = problem.direction(Point(rho, bend), False)
        np.testing.assert_allclose(back, step - step.mean(), atol=1e-10)

    @pytest.mark.parametrize("shape", [shapes.sphere(3), shapes.torus(), shapes.hill(), shapes.genus(2)])
    def test_circles_meet_at_the_angles_given(self, shape):
        mesh = noisy(shape, 0.05)
        solution = solution_of(mesh, {}) if mesh.is_boundary_vertex.any() else even_cones(mesh)
        triangulation, _, angles = angles_for(mesh, solution)
        pattern = circle_pattern(triangulation.twin, angles)
        flat = corner_angles(pattern.lengths.reshape(-1, 3)).ravel()
        inner = np.flatnonzero(triangulation.twin >= 0)
        for corner_angles_found in (flat, angles.angles):
            assert (
                corner_angles_found[inner] + corner_angles_found[triangulation.twin[inner]]
            ).max() < np.pi + 1e-9
        opposite = triangulation.twin[inner]
        np.testing.assert_allclose(
            flat[inner] + flat[opposite], angles.angles[inner] + angles.angles[opposite], atol=1e-9
        )
        curvature = angle_defect(mesh.faces, flat.reshape(-1, 3), mesh.is_boundary_vertex)
        np.testing.assert_allclose((curvature - solution.target)[~mesh.is_boundary_vertex], 0, atol=1e-9)


@pytest.mark.parametrize(
    "shape", [shapes.sphere(3), shapes.torus(), shapes.hill(), shapes.annulus(), shapes.genus(2)]
)
def test_the_curvature_is_the_one_prescribed(shape):
    result = flatten_by("circle-patterns", *shape)
    assert result.solve.residual < 1e-9
    assert np.abs(result.curvature_residual).max() < 1e-9
    assert result.distortion.flipped == 0
    assert result.distortion.seam_mismatch_max < 1e-8


def test_scale_motion_and_numbering():
    vertices, faces = shapes.sphere(3)
    renumbered_vertices, renumbered_faces, numbers = shapes.renumber(vertices, faces)
    base = flatten_by("circle-patterns", vertices, faces, cones="greedy")
    for mesh in (
        (vertices * 1e-6, faces),
        (vertices * 1e6, faces),
        (vertices @ shapes.rotation().T, faces),
        (renumbered_vertices, renumbered_faces),
    ):
        result = flatten_by("circle-patterns", *mesh, cones="greedy")
        assert result.distortion.qc_mean == pytest.approx(base.distortion.qc_mean, rel=1e-7)
        assert result.distortion.qc_max == pytest.approx(base.distortion.qc_max, rel=1e-6)
    np.testing.assert_array_equal(result.cones, numbers[base.cones])
    np.testing.assert_allclose(result.log_scale[numbers], base.log_scale, atol=1e-7)


def test_they_are_compared_with_the_same_cones_and_cut():
    names = ("circle-patterns/fixed", "linear", "circle-patterns", "exact")
    comparison = compare_methods(*shapes.sphere(3), methods=names, atlases=())
    assert [entry.method for entry in comparison.entries] == list(names)
    for entry in comparison.entries:
        assert np.array_equal(entry.result.cones, comparison["exact"].result.cones)
        assert np.array_equal(entry.result.seams, comparison["exact"].result.seams)
        assert "other edges" not in entry.note
    reached = [comparison[name].result.distortion.qc_mean for name in ("circle-patterns", "exact")]
    assert np.ptp(reached) < 1e-3


class TestRefusals:
    def too_wide(self):
        """A cone of 5 pi at a vertex of four triangles."""
        mesh = TriangleMesh(*shapes.torus())
        apex, base = len(mesh.vertices), mesh.faces[0]
        faces = np.concatenate(
            [mesh.faces[1:], [[base[0], base[1], apex], [base[1], base[2], apex], [base[2], base[0], apex]]]
        )
        vertices = np.concatenate([mesh.vertices, [mesh.vertices[base].mean(axis=0)]])
        return (vertices, faces), {apex: -3 * np.pi, 5: np.pi, 100: np.pi, 250: np.pi}

    def test_a_cone_too_wide_for_its_triangles(self):
        mesh, cones = self.too_wide()
        surface = TriangleMesh(*mesh)
        with pytest.raises(errors.ConvergenceError, match="no circle pattern .* angles are off by .* rad"):
            circle_patterns(surface, lengths_of(surface), solution_of(surface, cones), delaunay=False)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "published", "with_flips"), [("fandisk.obj", 1.013, 1.0118), ("rocker-arm.obj", 1.045, 1.0288)]
)
def test_the_figures_of_table_2(shared, name, published, with_flips):
    """The cones of the paper's search; its circle patterns were made without intrinsic Delaunay triangulations."""
    part = Source(as_input(shared(name))).prepared(Options()).components[0]
    mesh, surface = part.mesh, Surface.of(part.mesh, part.lengths)
    operators = surface.laplacian, surface.curvature, mesh.is_boundary_vertex, mesh.euler_characteristic
    solution = greedy_cones(*operators, epsilon=1.0, tie_key=tie_key(mesh.vertices))
    layout = laid_out(circle_patterns(mesh, part.lengths, solution, delaunay=False))
    assert measure(mesh, layout.points[layout.corners]).qc_mean == pytest.approx(published, abs=0.001)
    result = flatten_by("circle-patterns", shared(name), cones="greedy")
    assert result.distortion.qc_mean == pytest.approx(with_flips, abs=0.0005)
