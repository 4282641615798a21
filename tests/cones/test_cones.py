"""The cone search, against the paper's literal equations."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

from coneflat import TriangleMesh, errors
from coneflat.cones import cones_at, cones_with_curvature, greedy_cones
from coneflat.cones.prescribed import fitted_cones
from coneflat.cones.sparse.linear_model import LinearModel
from coneflat.geometry import angle_defect, corner_angles, cotangent_laplacian, cotangents, edge_lengths
from coneflat.geometry.operators import vertex_areas


def surface(shape):
    """Return (laplacian, curvature, is_boundary, euler_characteristic)."""
    mesh = TriangleMesh(*shape)
    lengths = edge_lengths(*shape)
    curvature = angle_defect(mesh.faces, corner_angles(lengths), mesh.is_boundary_vertex)
    laplacian = cotangent_laplacian(mesh.faces, cotangents(lengths), len(mesh.vertices))
    return laplacian, curvature, mesh.is_boundary_vertex, mesh.euler_characteristic


def absorbing_walk_targets(laplacian, curvature, is_singular):
    """Eq. 2-5 of the paper: curvature walks from vertex to vertex until a singular one absorbs it."""
    dense = laplacian.toarray()
    walk = -dense / np.diag(dense)[:, None]
    np.fill_diagonal(walk, 0)
    is_regular = ~is_singular
    absorbed = np.linalg.solve(
        np.eye(is_regular.sum()) - walk[np.ix_(is_regular, is_regular)], walk[np.ix_(is_regular, is_singular)]
    )
    target = np.zeros(len(curvature))
    target[is_singular] = curvature[is_singular] + absorbed.T @ curvature[is_regular]
    return target


@pytest.mark.parametrize("shape", [shapes.sphere(2), shapes.hill(12, 10), shapes.torus(20, 10)])
def test_one_dirichlet_problem_gives_the_papers_targets_and_scale(shape):
    laplacian, curvature, is_boundary, chi = surface(shape)
    cones = np.random.default_rng(3).choice(np.flatnonzero(~is_boundary), 6, replace=False)
    solution = cones_at(laplacian, curvature, is_boundary, chi, cones)
    is_singular = is_boundary.copy()
    is_singular[cones] = True
    literal = absorbing_walk_targets(laplacian, curvature, is_singular)
    np.testing.assert_allclose(solution.target, literal, atol=1e-10)
    # Eq. 1 with these targets: the same phi up to a constant.
    phi = np.linalg.lstsq(laplacian.toarray(), literal - curvature, rcond=None)[0]
    difference = solution.log_scale - phi
    np.testing.assert_allclose(difference, difference[0], atol=1e-9)


@pytest.mark.parametrize("shape", [shapes.sphere(3), shapes.torus(), shapes.annulus(), shapes.genus(2)])
def test_greedy_search_is_one_dirichlet_problem_in_the_end(shape):
    laplacian, curvature, is_boundary, chi = surface(shape)
    solution = greedy_cones(laplacian, curvature, is_boundary, chi, epsilon=0.05)
    assert np.ptp(solution.log_scale) <= 0.05
    assert len(np.unique(solution.cones)) == len(solution.cones) > 0
    direct = cones_at(laplacian, curvature, is_boundary, chi, solution.cones)
    np.testing.assert_allclose(solution.target, direct.target, atol=1e-10)
    np.testing.assert_allclose(solution.log_scale, direct.log_scale, atol=1e-10)
    np.testing.assert_allclose(solution.target.sum(), 2 * np.pi * chi, atol=1e-9)


def test_greedy_search_for_very_many_cones_ends():
    solution = greedy_cones(*surface(shapes.sphere(3)), epsilon=1e-3)
    assert len(solution.cones) > 256  # so that it has started over from its cones
    assert np.ptp(solution.log_scale) < 1e-3


def test_greedy_search_takes_the_extrema_of_phi():
    laplacian, curvature, is_boundary, chi = surface(shapes.sphere(2))
    five_cones = greedy_cones(laplacian, curvature, is_boundary, chi, epsilon=0.3, max_cones=5)
    three_cones = greedy_cones(laplacian, curvature, is_boundary, chi, epsilon=0.3, max_cones=3)
    assert five_cones.cones[0] == np.argmax(curvature)
    np.testing.assert_array_equal(five_cones.cones[:3], three_cones.cones)
    phi = cones_at(laplacian, curvature, is_boundary, chi, three_cones.cones).log_scale
    extrema = {int(np.argmax(phi)), int(np.argmin(phi))} - set(three_cones.cones.tolist())
    assert extrema
    assert set(five_cones.cones[3 : 3 + len(extrema)].tolist()) == extrema


def test_negative_surfaces_start_from_the_most_negative_vertex():
    laplacian, curvature, is_boundary, chi = surface(shapes.genus(2))
    assert greedy_cones(laplacian, curvature, is_boundary, chi).cones[0] == np.argmin(curvature)


def test_flat_surfaces_need_no_cones():
    laplacian, curvature, is_boundary, chi = surface(shapes.grid())
    solution = greedy_cones(laplacian, curvature, is_boundary, chi)
    assert len(solution.cones) == 0
    np.testing.assert_allclose(solution.log_scale, 0, atol=1e-12)
    torus = greedy_cones(*surface(shapes.torus()), epsilon=50)
    assert len(torus.cones) == 0
    assert not torus.target.any()


def test_prescribed_curvatures_are_met():
    laplacian, curvature, is_boundary, chi = surface(shapes.sphere(2))
    cones, curvatures = np.array([5, 40, 99]), np.array([1.5, 1.5, 1.0]) * np.pi
    solution = cones_with_curvature(laplacian, curvature, is_boundary, chi, cones, curvatures)
    np.testing.assert_allclose(solution.curvatures, curvatures)
    np.testing.assert_allclose(laplacian @ solution.log_scale, solution.target - curvature, atol=1e-9)


def fitted(shape, cones, curvatures, **bounds):
    laplacian, curvature, is_boundary, chi = surface(shape)
    areas = vertex_areas(shape[1], edge_lengths(*shape), len(curvature))
    areas /= areas.sum()
    bounds = {"min_cone_angle": 0.1, "max_cone_angle": None, **bounds}
    linear = LinearModel.of(laplacian, curvature, areas, is_boundary, np.zeros(len(areas)))
    solution = fitted_cones(linear, chi, np.array(cones), np.array(curvatures), **bounds)

    def energy(curvatures):
        log_scale = cones_with_curvature(
            laplacian, curvature, is_boundary, chi, np.array(cones), curvatures
        ).log_scale
        return areas @ (log_scale - areas @ log_scale) ** 2

    return solution, energy


@pytest.mark.parametrize(
    ("shape", "cones"), [(shapes.sphere(3), (5, 60, 140, 300)), (shapes.hill(12, 12), (30, 80, 100, 110))]
)
def test_curvatures_that_are_not_prescribed_minimise_the_energy(shape, cones):
    solution, energy = fitted(shape, cones, [1.1, np.nan, np.nan, np.nan])
    assert solution.curvatures[0] == pytest.approx(1.1)
    optimum = energy(solution.curvatures)
    for giver, taker in ((1, 2), (2, 3), (1, 3)):
        for step in (-0.05, 0.05):
            changed = solution.curvatures.copy()
            changed[[giver, taker]] += step, -step  # which leaves the sum
            assert energy(changed) > optimum


def test_the_last_cone_absorbs_the_remaining_curvature():
    solution, _ = fitted(shapes.sphere(2), (5, 40, 99), [1.5 * np.pi, 1.5 * np.pi, np.nan])
    np.testing.assert_allclose(solution.curvatures[2], np.pi)


def test_bounds_hold_for_computed_curvatures_only():
    bounds = {"min_cone_angle": np.pi, "max_cone_angle": 2.5 * np.pi}
    solution, _ = fitted(shapes.sphere(3), (5, 60, 140, 300, 200), [5.0, *[np.nan] * 4], **bounds)
    assert solution.curvatures[0] == pytest.approx(5.0)
    assert solution.curvatures[1:].max() <= np.pi + 1e-9
    assert solution.curvatures[1:].min() >= -np.pi / 2 - 1e-9
    assert solution.curvatures.sum() == pytest.approx(4 * np.pi)


def test_the_boundary_absorbs_the_remaining_curvature():
    laplacian, curvature, is_boundary, chi = surface(shapes.hill(10, 10))
    solution = cones_with_curvature(laplacian, curvature, is_boundary, chi, np.array([60]), np.array([0.7]))
    assert solution.target[60] == pytest.approx(0.7)
    np.testing.assert_allclose(solution.target.sum(), 2 * np.pi * chi)
    assert not solution.log_scale[is_boundary].any()


def test_curvatures_must_satisfy_gauss_bonnet():
    operators = surface(shapes.sphere(1))
    with pytest.raises(errors.CurvatureError, match=r"must sum to .* \(4 pi\).*sum to 3\.1\d+ \(1 pi\)"):
        cones_with_curvature(*operators, np.array([1, 2]), np.array([0.5, 0.5]) * np.pi)
    with pytest.raises(errors.CurvatureError, match="has none"):
        cones_at(*operators, np.array([], dtype=int))
    with pytest.raises(errors.CurvatureError, match="needs cones to absorb it"):
        greedy_cones(*operators, max_cones=0)
    for epsilon in (0, -1, float("nan")):
        with pytest.raises(errors.OptionError, match="epsilon"):
            greedy_cones(*operators, epsilon=epsilon)
