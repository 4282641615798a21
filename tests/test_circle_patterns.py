"""Circle patterns: the quadratic program, the radii, known metrics, the paper's figures, refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapes
from scipy.optimize import minimize
from scipy.spatial import Delaunay
from scipy.special import spence

from coneflat import TriangleMesh, cut_open, errors, find_seams, flatten
from coneflat.cones import ConeSolution, greedy_cones
from coneflat.cones.choose import Surface
from coneflat.flat.circle_patterns.coherent_angles import LEAST_PART, coherent_angles
from coneflat.flat.circle_patterns.flatten import RadiiProblem, circle_pattern, circle_patterns
from coneflat.flat.circle_patterns.proper import make_proper
from coneflat.geometry import angle_defect, corner_angles, edge_lengths
from coneflat.geometry.delaunay import intrinsic_delaunay
from coneflat.geometry.intrinsic import intrinsic_triangulation
from coneflat.geometry.straight import straight_triangles
from coneflat.geometry.ties import tie_key
from coneflat.input.components import prepare
from coneflat.options import Options
from coneflat.quality.distortion import measure
from coneflat.solver.newton import Point, minimise


def lengths_of(mesh):
    return edge_lengths(mesh.vertices, mesh.faces)


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
    return (
        triangulation,
        angles,
        coherent_angles(triangulation, angles, 2 * np.pi - solution.target, inner),
    )


class TestAngles:
    @pytest.mark.parametrize("noise", [0.0, 0.25])
    def test_they_are_the_nearest_as_another_solver_finds_them(self, noise):
        mesh = noisy(shapes.sphere(1), noise)
        triangulation, angles, found = angles_for(mesh, even_cones(mesh, 20))
        assert found.converged
        twin = triangulation.twin
        one = np.flatnonzero(twin > np.arange(len(twin)))
        equations = np.zeros((len(mesh.faces) + len(mesh.vertices), len(angles)))
        equations[np.arange(len(angles)) // 3, np.arange(len(angles))] = 1
        equations[len(mesh.faces) + mesh.faces.ravel(), np.arange(len(angles))] = 1
        equations = equations[:-1]
        wanted = np.full(len(equations), np.pi)
        wanted[len(mesh.faces) :] = 2 * np.pi - even_cones(mesh, 20).target[:-1]
        best = minimize(
            lambda x: ((x - angles) ** 2).sum() / 2,
            angles,
            jac=lambda x: x - angles,
            bounds=[(min(LEAST_PART * a, 0.02), None) for a in angles],
            constraints=[
                {"type": "eq", "fun": lambda x: equations @ x - wanted, "jac": lambda x: equations},
                {
                    "type": "ineq",
                    "fun": lambda x: np.pi - x[one] - x[twin[one]],
                    "jac": lambda x: -(np.eye(len(x))[one] + np.eye(len(x))[twin[one]]),
                },
            ],
            method="SLSQP",
            options={"maxiter": 300, "ftol": 1e-14},
        )
        assert best.success
        np.testing.assert_allclose(found.angles, best.x, atol=1e-6)
        assert (noise > 0) == bool((found.angles[one] + found.angles[twin[one]] > np.pi - 1e-9).any())

    def test_one_step_suffices_where_no_bound_holds(self):
        mesh = TriangleMesh(*shapes.sphere(3, bumps=0.0))
        *_, found = angles_for(mesh, even_cones(mesh, len(mesh.vertices)))
        assert found.steps <= 2  # the second mends what damping did

    def test_squares_have_one_circle(self):
        mesh = TriangleMesh(*shapes.box())
        corners = np.flatnonzero(
            np.abs(angle_defect(mesh.faces, corner_angles(lengths_of(mesh)), mesh.is_boundary_vertex)) > 1
        )
        *_, found = angles_for(mesh, solution_of(mesh, dict.fromkeys(corners.tolist(), np.pi / 2)))
        assert found.is_inside.sum() == len(mesh.faces)


class TestRadii:
    def test_the_residual_is_the_slope_of_the_papers_energy(self):
        mesh = noisy(shapes.hill(5, 4), 0.1)
        triangulation, _ = intrinsic_delaunay(mesh, lengths_of(mesh))
        own = corner_angles(triangulation.length.reshape(-1, 3)).ravel()
        full = np.full(len(mesh.vertices), 2 * np.pi)
        angles = coherent_angles(triangulation, own, full, ~mesh.is_boundary_vertex)
        problem = RadiiProblem(triangulation.twin, angles)
        assert problem.count == len(mesh.faces) - angles.is_inside.sum() // 2
        twin = triangulation.twin
        inner = np.flatnonzero((twin > np.arange(len(twin))) & ~angles.is_inside)
        border = np.flatnonzero(twin < 0)
        theta = np.pi - angles.angles[inner] - angles.angles[twin[inner]]

        def energy(rho):
            one, two = rho[problem.circle[inner // 3]], rho[problem.circle[twin[inner] // 3]]
            total = (
                2 * np.pi * rho.sum() - 2 * (angles.angles[border] * rho[problem.circle[border // 3]]).sum()
            )
            for x in (one - two, two - one):
                total += spence(1 - np.exp(x + 1j * theta)).imag.sum()
            return total - ((np.pi - theta) * (one + two)).sum()

        rho = np.random.default_rng(1).normal(0, 0.3, problem.count)
        problem.base = np.zeros_like(rho)
        slope = np.array(
            [(energy(rho + 1e-5 * e) - energy(rho - 1e-5 * e)) / 2e-5 for e in np.eye(problem.count)]
        )
        np.testing.assert_allclose(problem.evaluate(rho).residual, -slope / 2, atol=1e-8)
        step = 1e-6 * np.random.default_rng(2).normal(size=problem.count)
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
        for found in (flat, angles.angles):
            assert (found[inner] + found[triangulation.twin[inner]]).max() < np.pi + 1e-9
        opposite = triangulation.twin[inner]
        np.testing.assert_allclose(
            flat[inner] + flat[opposite], angles.angles[inner] + angles.angles[opposite], atol=1e-9
        )
        curvature = angle_defect(mesh.faces, flat.reshape(-1, 3), mesh.is_boundary_vertex)
        np.testing.assert_allclose((curvature - solution.target)[~mesh.is_boundary_vertex], 0, atol=1e-9)


def test_a_plane_comes_back_as_it_is():
    points = np.random.default_rng(0).random((300, 2))
    faces = Delaunay(points).simplices
    vertices = np.column_stack([points, np.zeros(300)])
    for mesh in ((vertices, faces), shapes.grid()):
        result = flatten(*mesh, cones="none", method="circle-patterns")
        assert result.distortion.qc_max < 1 + 1e-8
        assert np.ptp(result.log_scale) < 1e-8


def test_what_can_be_unrolled_is_unrolled():
    for mesh in (shapes.cylinder(), shapes.box()):
        result = flatten(*mesh, method="circle-patterns")
        assert result.distortion.qc_max < 1 + 1e-8
        assert result.distortion.area_std < 1e-8


@pytest.mark.parametrize(
    "shape", [shapes.sphere(3), shapes.torus(), shapes.hill(), shapes.annulus(), shapes.genus(2)]
)
def test_the_curvature_is_the_one_prescribed(shape):
    result = flatten(*shape, method="circle-patterns")
    assert result.solve.residual < 1e-9
    assert np.abs(result.curvature_residual).max() < 1e-9
    assert result.distortion.flipped == 0
    assert result.distortion.seam_mismatch_max < 1e-8


def test_with_and_without_delaunay_on_a_delaunay_mesh():
    mesh = TriangleMesh(*shapes.sphere(3, bumps=0.1))
    one, two = (
        circle_patterns(mesh, lengths_of(mesh), even_cones(mesh), delaunay=delaunay)
        for delaunay in (True, False)
    )
    assert one.solved.euclidean_flips == 0
    np.testing.assert_array_equal(one.solved.triangulation.length, two.solved.triangulation.length)


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
        metric = circle_patterns(
            surface, lengths_of(surface), solution_of(surface, cones), best_effort=True, delaunay=False
        )
        assert np.isfinite(metric.solved.triangulation.length).all()
        assert metric.notes[0].startswith("No circle pattern")

    def test_flips_make_room_for_it(self):
        mesh, cones = self.too_wide()
        result = flatten(*mesh, cones=cones, method="circle-patterns")
        assert result.solve.residual < 1e-9

    def test_curvatures_that_do_not_sum(self):
        mesh = TriangleMesh(*shapes.sphere(2))
        with pytest.raises(errors.CurvatureError, match="must sum to"):
            circle_patterns(mesh, lengths_of(mesh), solution_of(mesh, {0: np.pi, 5: np.pi}))


@pytest.mark.parametrize("seed", range(4))
def test_proper_triangulations(seed):
    """On a spiky surface, being Delaunay joins vertices more than once, which as many flips as can be made undo."""
    mesh = noisy(shapes.sphere(2), 0.45, seed)
    triangulation, flips = intrinsic_delaunay(mesh, lengths_of(mesh))
    before = triangulation.copy()
    more = make_proper(triangulation, np.full(len(mesh.vertices), 4))
    assert len(more)
    faults = []
    for each in (before, triangulation):
        ends = np.sort(
            np.stack([each.tail, each.tail[each.twin]], axis=1)[each.twin > np.arange(len(each.twin))], axis=1
        )
        repeated = len(ends) - len(np.unique(ends, axis=0)) + int((ends[:, 0] == ends[:, 1]).sum())
        faults.append((repeated, int(np.maximum(4 - np.bincount(each.tail), 0).sum())))
    assert faults[1][0] <= faults[0][0]
    assert faults[1][1] <= faults[0][1]
    assert sum(faults[1]) < sum(faults[0])
    curvature, expected = (
        angle_defect(faces, corner_angles(lengths), mesh.is_boundary_vertex)
        for faces, lengths in (
            (triangulation.faces, triangulation.length.reshape(-1, 3)),
            (mesh.faces, lengths_of(mesh)),
        )
    )
    np.testing.assert_allclose(curvature, expected, atol=1e-9)
    undone = straight_triangles(triangulation, np.concatenate([flips, more]))
    np.testing.assert_array_equal(undone.twin, intrinsic_triangulation(mesh, lengths_of(mesh)).twin)
    np.testing.assert_allclose(np.abs(undone.sides).reshape(-1, 3) > 0, True)


@pytest.mark.parametrize(
    ("name", "published", "with_flips"), [("fandisk.obj", 1.013, 1.0118), ("rocker-arm.obj", 1.045, 1.0288)]
)
def test_the_figures_of_table_2(shared, name, published, with_flips):
    """The cones of the paper's search; its circle patterns were made without intrinsic Delaunay triangulations."""
    part = prepare(shared(name), None, Options()).components[0]
    mesh, surface = part.mesh, Surface.of(part.mesh, part.lengths)
    given = surface.laplacian, surface.curvature, mesh.is_boundary_vertex, mesh.euler_characteristic
    solution = greedy_cones(*given, epsilon=1.0, tie_key=tie_key(mesh.vertices))
    seams = find_seams(mesh, solution.cones, part.lengths.ravel()[mesh.edge_halfedges[:, 0]])
    metric = circle_patterns(mesh, part.lengths, solution, delaunay=False)
    laid_out = metric.lay_out(cut_open(mesh, seams).mesh, seams)
    assert measure(mesh, laid_out.points[laid_out.corners]).qc_mean == pytest.approx(published, abs=0.001)
    result = flatten(shared(name), cones="greedy", method="circle-patterns")
    assert result.distortion.qc_mean == pytest.approx(with_flips, abs=0.0005)


@pytest.mark.parametrize(
    "name", ["hand.obj", "elephant.obj", "spot.obj", "camelhead.off", "3holes.off", "knight.off"]
)
def test_real_models(shared, name):
    result = flatten(shared(name), method="circle-patterns")
    assert result.solve.residual < 1e-9
    assert result.distortion.curvature_error_max < 1e-9
    assert result.distortion.flipped == 0


def test_radii_that_no_numbers_hold_are_refused(monkeypatch):
    """As of a pattern that does not exist, whose radii run away while the steps last."""

    def run_away(problem, start, limits):
        found, steps = minimise(problem, start, limits)
        return replace(found, place=found.place + 700.0 * np.eye(1, len(start.place))[0]), steps

    monkeypatch.setattr("coneflat.flat.circle_patterns.flatten.minimise", run_away)
    with pytest.raises(errors.ConvergenceError, match="the logs of radii came to differ by 7"):
        flatten(*shapes.hill(6, 5), method="circle-patterns", best_effort=True)
