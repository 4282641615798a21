from __future__ import annotations

import numpy as np
import pytest
import shapes
from scipy.sparse import csr_matrix

from coneflat import check_mesh, edge_lengths, read_mesh
from coneflat.cones.sparse import ConeSearch, fit_curvatures
from coneflat.cones.sparse.aggregation import coarse_basis
from coneflat.cones.sparse.green import GreenOperator
from coneflat.errors import CurvatureError, OptionError
from coneflat.geometry import angle_defect, corner_angles, cotangent_laplacian, cotangents, double_areas
from coneflat.geometry.operators import area_distortion
from coneflat.geometry.ties import tie_key

HANDLE = shapes.genus(3)
CLOSED = {"sphere": shapes.sphere(4), "torus": shapes.torus(), "genus 3": HANDLE}
BOUNDED = {"hill": shapes.hill(), "annulus": shapes.annulus()}
SHAPES = CLOSED | BOUNDED


def surface(vertices, faces):
    """Return what the search takes, and what it takes by name."""
    mesh = check_mesh(vertices, faces).mesh
    lengths = edge_lengths(mesh.vertices, mesh.faces)
    curvature = angle_defect(mesh.faces, corner_angles(lengths), mesh.is_boundary_vertex)
    laplacian = cotangent_laplacian(mesh.faces, cotangents(lengths), len(mesh.vertices))
    areas = np.bincount(mesh.faces.ravel(), np.repeat(double_areas(lengths) / 6, 3), len(mesh.vertices))
    return laplacian, curvature, areas, mesh.is_boundary_vertex, mesh.euler_characteristic


def pursue_cones(*given, distortion=0.2, count=None, **options):
    search = ConeSearch(*given, **options)
    return search.fewest(distortion) if count is None else search.best_of(count)


def pursue(vertices, faces, **options):
    return pursue_cones(*surface(vertices, faces), tie_key=tie_key(vertices), **options)


@pytest.mark.parametrize("name", SHAPES)
def test_reported_distortion_is_that_of_the_log_scale(name):
    laplacian, curvature, areas, is_boundary, chi = surface(*SHAPES[name])
    found = pursue_cones(laplacian, curvature, areas, is_boundary, chi, distortion=0.1)
    solution = found.solution
    assert found.distortion <= 0.1
    assert found.distortion == pytest.approx(area_distortion(solution.log_scale, areas), rel=1e-9)
    residual = laplacian @ solution.log_scale - solution.target + curvature
    assert np.abs(residual).max() < 1e-9
    outside = np.setdiff1d(np.arange(len(areas)), solution.cones)
    assert not solution.target[outside][~is_boundary[outside]].any()


@pytest.mark.parametrize("name", SHAPES)
def test_curvatures_sum_to_gauss_bonnet(name):
    given = surface(*SHAPES[name])
    chi = given[-1]
    solution = pursue_cones(*given, distortion=0.1).solution
    assert solution.target.sum() == pytest.approx(2 * np.pi * chi, abs=1e-9)
    if name in CLOSED:
        assert solution.curvatures.sum() == pytest.approx(2 * np.pi * chi, abs=1e-9)


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("angles", [(np.pi, None), (0.5 * np.pi, 2.5 * np.pi), (1.5 * np.pi, 3 * np.pi)])
def test_cone_angles_keep_to_their_bounds(name, angles):
    low, high = angles
    found = pursue(*SHAPES[name], distortion=0.15, min_cone_angle=low, max_cone_angle=high)
    cone_angles = 2 * np.pi - found.solution.curvatures
    assert (cone_angles >= low - 1e-9).all()
    assert high is None or (cone_angles <= high + 1e-9).all()


def test_positive_only():
    found = pursue(*shapes.sphere(4), distortion=0.1, positive_only=True)
    assert (found.solution.curvatures >= 0).all()
    with pytest.raises(CurvatureError, match="-8 pi"):
        pursue(*HANDLE, positive_only=True)


def test_bounds_that_leave_nothing_to_gain_end_the_search():
    """On a torus curvatures sum to 0: without negative ones there are none."""
    vertices, faces = shapes.genus(1)
    search = ConeSearch(*surface(vertices, faces), positive_only=True)
    found = search.fewest(0.01)
    assert found.distortion > 0.01
    assert max(search.coarse.best.sizes) < 30
    assert not found.solution.cones.size


@pytest.mark.parametrize("name", SHAPES)
def test_no_cone_can_be_left_out(name):
    search = ConeSearch(*surface(*SHAPES[name]), tie_key=tie_key(SHAPES[name][0]))
    found = search.fewest(0.1)
    assert found.distortion <= 0.1
    members = search.exact.insert(search.unknowns_of(found.solution.cones))
    for place in range(len(members)):
        assert search.exact.energy(np.delete(members, place)) > 0.01


@pytest.mark.parametrize("name", SHAPES)
def test_renumbering_changes_nothing(name):
    vertices, faces = SHAPES[name]
    shuffled, turned, _ = shapes.renumber(vertices, faces)
    one = pursue(vertices, faces, distortion=0.1)
    two = pursue(shuffled, turned, distortion=0.1)
    assert len(one.solution.cones) == len(two.solution.cones)
    assert one.distortion == pytest.approx(two.distortion, rel=1e-6)


def test_size_does_not_matter():
    vertices, faces = shapes.hill()
    one, two = pursue(vertices, faces, distortion=0.1), pursue(1e-3 * vertices, faces, distortion=0.1)
    assert one.distortion == pytest.approx(two.distortion, rel=1e-6)
    assert len(one.solution.cones) == len(two.solution.cones)


def test_a_torus_has_no_cones_or_two_and_more():
    vertices, faces = shapes.torus()
    loose = pursue(vertices, faces, distortion=10)
    assert len(loose.solution.cones) == 0
    tight = pursue(vertices, faces, distortion=0.9 * loose.distortion)
    assert len(tight.solution.cones) >= 2
    assert len(pursue(vertices, faces, count=1).solution.cones) == 0


def test_a_sphere_needs_enough_cones():
    vertices, faces = shapes.sphere(3)
    with pytest.raises(CurvatureError, match=r"2 cones of at most 1\.5 pi each .* 4 pi: 3 or more"):
        pursue(vertices, faces, count=2)
    assert len(pursue(vertices, faces, count=3).solution.cones) == 3
    needles = pursue(vertices, faces, distortion=5, min_cone_angle=1e-3)
    assert len(needles.solution.cones) == 3


def test_more_cones_are_no_worse():
    given = surface(*shapes.sphere(4))
    energies = [pursue_cones(*given, count=count).distortion for count in range(3, 9)]
    assert (np.diff(energies) < 0).all()


def test_required_cones_are_kept_and_forbidden_ones_avoided():
    vertices, faces = shapes.hill(30, 30)
    search = surface(vertices, faces)
    free = pursue_cones(*search, distortion=0.05)
    x = vertices[:, 0]
    forbidden = x > 0.4
    found = pursue_cones(*search, distortion=0.05, allowed=~forbidden)
    assert not forbidden[found.solution.cones].any()
    inner = np.flatnonzero(~search[3])
    required = [int(inner[7]), int(inner[300])]
    found = pursue_cones(*search, distortion=0.05, required=required)
    assert found.solution.cones[:2].tolist() == required
    allowed = np.zeros(len(x), dtype=bool)
    allowed[free.solution.cones] = True
    found = pursue_cones(*search, distortion=0.05, allowed=allowed)
    assert set(found.solution.cones) <= set(free.solution.cones)
    assert found.distortion == pytest.approx(free.distortion, rel=0.05)


def test_weights_shift_distortion_away():
    vertices, faces = shapes.sphere(4)
    given = surface(vertices, faces)
    face = vertices[:, 2] > 0.5
    plain = pursue_cones(*given, count=5)
    careful = pursue_cones(*given, count=5, weights=np.where(face, 50.0, 1.0))

    def inside(found):
        return area_distortion(found.solution.log_scale[face], given[2][face])

    assert inside(careful) < 0.7 * inside(plain)


def test_what_cannot_be_reached_is_the_best_there_is():
    vertices, faces = shapes.sphere(3)
    allowed = np.zeros(len(vertices), dtype=bool)
    allowed[[0, 5, 9, 11]] = True
    found = pursue(vertices, faces, distortion=1e-3, allowed=allowed)
    assert found.distortion > 1e-3
    assert set(found.solution.cones) <= {0, 5, 9, 11}


def test_a_distortion_whose_square_is_zero_may_be_asked_for():
    cylinder = shapes.cylinder()
    assert pursue(*cylinder, distortion=1e-300).distortion <= pursue(*cylinder).distortion


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"distortion": 0}, OptionError),
        ({"distortion": -1}, OptionError),
        ({"distortion": np.nan}, OptionError),
        ({"count": -1}, OptionError),
        ({"count": 2.5}, OptionError),
        ({"min_cone_angle": 0}, OptionError),
        ({"max_cone_angle": 1}, OptionError),
        ({"required": [10**6]}, OptionError),
        ({"required": [3, 3]}, OptionError),
        ({"weights": np.ones(3)}, OptionError),
        ({"required": [1, 2, 3, 4], "count": 3}, CurvatureError),
        ({"min_cone_angle": 2.5 * np.pi}, CurvatureError),
        ({"allowed": np.zeros(162, dtype=bool)}, CurvatureError),
    ],
)
def test_options_that_make_no_sense(options, error):
    with pytest.raises(error):
        pursue(*shapes.sphere(2), **options)


def fit_one_by_one(gram, slope, least, most, total):
    size = len(slope)
    curvatures, state, room = np.zeros(size), np.zeros(size, dtype=np.int64), np.empty((size, size))
    multiplier = fit_curvatures.fit_one_by_one(gram, slope, least, most, total, state, curvatures, room)
    return curvatures, multiplier, True


@pytest.mark.parametrize(
    "fit", [fit_curvatures.fit_curvatures, fit_one_by_one], ids=["at once", "one by one"]
)
def test_fit_agrees_with_the_optimality_conditions(fit):
    rng = np.random.default_rng(3)
    for trial in range(210):
        size = int(rng.integers(1, 9)) if trial < 200 else 60
        root = rng.normal(size=(size, size + 2))
        gram, slope = root @ root.T, 3 * rng.normal(size=size)
        least, most = -rng.uniform(0, 2), rng.uniform(0, 2)
        total = rng.uniform(size * least, size * most) if rng.random() < 0.5 else np.nan
        k, multiplier, feasible = fit(gram, slope, np.full(size, least), np.full(size, most), total)
        gradient = gram @ k + slope + (0 if np.isnan(total) else multiplier)
        assert feasible
        assert (k >= least - 1e-12).all()
        assert (k <= most + 1e-12).all()
        assert np.isnan(total) or k.sum() == pytest.approx(total, abs=1e-9)
        assert (gradient[k < most - 1e-9] > -1e-7).all()
        assert (gradient[k > least + 1e-9] < 1e-7).all()


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("fandisk.obj", 5),
        ("rocker-arm.obj", 6),
        ("hand.obj", 10),
        ("bunny.obj", 8),
        ("camelhead.off", 6),
        ("face.obj", 8),
        ("horse.ply", 16),
        ("3holes.off", 9),
    ],
)
def test_fewer_cones_than_published(shared, name, count):
    """Li et al. 2023 report 5, 8, 10, 11, 7, 10, 16 and 10 cones for E <= 0.2."""
    model = read_mesh(shared(name))
    vertices, faces = model.vertices, model.corners.reshape(-1, 3)
    found = pursue(vertices, faces, distortion=0.2, min_cone_angle=0.1 * np.pi)
    assert found.distortion <= 0.2
    assert len(found.solution.cones) <= count


def test_long_thin_triangles_take_no_more_cones_than_needed(shared):
    """Where the coarse model is far off, it is the mesh that tells how many cones do."""
    model = read_mesh(shared("spot.obj"))
    found = pursue(model.vertices * [30, 1, 1], model.corners.reshape(-1, 3), distortion=0.2)
    assert found.distortion <= 0.2
    assert len(found.solution.cones) <= 16


@pytest.mark.parametrize("shape", ["sphere", "torus", "hill", "annulus"])
def test_the_laplacian_of_the_unknowns_is_that_of_the_mesh(shape):
    laplacian, _, areas, is_boundary, _ = surface(*SHAPES[shape])
    order = np.random.default_rng(2).permutation(len(areas))
    operator = GreenOperator(laplacian, areas / areas.sum(), is_boundary, order)
    free = order[~is_boundary[order]]
    np.testing.assert_array_equal(operator.vertices, free)
    np.testing.assert_array_equal(operator.laplacian.toarray(), laplacian.toarray()[free][:, free])
    assert operator.laplacian.has_canonical_format
    source = np.zeros(len(free))
    source[3], source[-5] = 1.0, -1.0
    np.testing.assert_allclose(operator.laplacian @ operator.solve(source), source, atol=1e-9)


def test_scale_does_not_change_the_coarse_model():
    """Weights across right angles are 0 or rounding, as the scale has it."""
    vertices, faces = shapes.grid(60, 60)

    def basis(scale):
        cots = cotangents(edge_lengths(vertices * scale, faces))
        laplacian = csr_matrix(cotangent_laplacian(faces, cots, len(vertices)))
        return coarse_basis(laplacian, np.full(len(vertices), 1 / len(vertices)), 60)

    one = basis(1.0)
    for scale in (7.0, 1e-6, 0.3):
        other = basis(scale)
        for matrix in ("functions", "laplacian", "mass"):
            known, found = getattr(one, matrix), getattr(other, matrix)
            np.testing.assert_array_equal(found.indices, known.indices)
            np.testing.assert_allclose(found.data, known.data, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("shape", ["hub", "strip", "pockets"])
def test_coarse_model_of_odd_connectivity_stays_small(shape):
    """One vertex that all others meet, a line of vertices between two boundaries, vertices that meet no other."""
    if shape == "hub":
        vertices, faces = shapes.cylinder(3000, 1, caps=True)
    else:
        vertices, faces = shapes.grid(3000, 2)
    laplacian, _, areas, is_boundary, _ = surface(vertices, faces)
    inside = np.flatnonzero(~is_boundary)
    if shape == "pockets":
        inside = inside[::2]
    inner = csr_matrix(laplacian)[inside][:, inside]
    basis = coarse_basis(inner, areas[inside] / areas[inside].sum(), 400)
    assert basis.functions.shape[1] <= 700
    assert basis.functions.nnz < 30 * len(inside)


def test_more_cones_than_are_searched_for_is_an_error():
    with pytest.raises(CurvatureError, match="400 cones or more"):
        pursue(*SHAPES["sphere"], min_cone_angle=1.99 * np.pi)
    with pytest.raises(CurvatureError, match="cones were found"):
        pursue(*HANDLE, room=np.full(len(HANDLE[0]), 2 * np.pi))
    with pytest.raises(CurvatureError, match="no 15 cones"):
        pursue(*HANDLE, room=np.full(len(HANDLE[0]), 2.5 * np.pi), count=15)


def test_the_few_vertices_with_room_are_found():
    """Four saddles of 4 pi carry the curvature, and only six vertices have room for one."""
    wide = np.random.default_rng(0).choice(len(HANDLE[0]), 6, replace=False)
    room = np.full(len(HANDLE[0]), 2 * np.pi)
    room[wide] = 4 * np.pi
    found = pursue(*HANDLE, room=room, count=8).solution
    assert np.isin(found.cones[found.curvatures < 0], wide).all()
    assert found.curvatures.min() >= -2 * np.pi - 1e-9
