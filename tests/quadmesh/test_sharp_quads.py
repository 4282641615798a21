"""Sharp edges on grid lines: exactly, all along, and quads' edges along them."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from grid_maps import L_SHAPE, polycube
from scipy.sparse import block_diag, csr_matrix
from test_integer_grid import check_laws

from coneflat import errors, integer_grid, quads
from coneflat.linalg.elimination import solutions_of
from coneflat.mesh.connectivity import TriangleMesh
from coneflat.quadmesh.extract import extract_quads
from coneflat.quadmesh.features import edge_indices, sharp_edges
from coneflat.quadmesh.quad_mesh import least_jacobians
from coneflat.quadmesh.quality import measure_quads

SHARP = np.deg2rad(40)


def prism(corners: int):
    """A prism over a regular polygon, with caps of one triangle per side."""
    return shapes.cylinder(corners, 3, 1.5, caps=True)


def l_block(size: int = 2):
    """Three unit cubes in the form of an L, their square faces split alike."""
    vertices, squares = polycube(L_SHAPE)
    a, b, c, d = squares.T
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    for _ in range(size):
        vertices, faces = shapes.subdivide(vertices, faces)
    return vertices, faces


SHAPES = {
    "cube": shapes.box(1, (1.0, 1.0, 1.0)),
    "box": shapes.box(3),
    "L": l_block(),
    "cylinder": shapes.cylinder(caps=True),
    "hexagon": prism(6),
    "two": shapes.join(shapes.box(2), (shapes.cylinder(caps=True)[0] + 5, shapes.cylinder(caps=True)[1])),
}


def check_features(grid):
    """Both ends of each sharp edge have the same integer coordinate, to the bit, in every triangle beside it."""
    mesh = TriangleMesh(grid.vertices, grid.faces)
    edges = edge_indices(mesh, grid.features)
    assert (mesh.edges[edges] == np.sort(grid.features, axis=1)).all()
    sides = mesh.edge_halfedges[edges]
    sides = sides[sides >= 0]
    start = grid.corner_grid[:, [1, 2, 0]].reshape(-1, 2)[sides]
    end = grid.corner_grid[:, [2, 0, 1]].reshape(-1, 2)[sides]
    assert ((start == end) & (start == np.rint(start))).any(axis=1).all()
    nodes = vertices_that_turn(mesh, edges)
    at = grid.corner_grid[np.isin(grid.faces, nodes)]
    assert (at == np.rint(at)).all()


def vertices_that_turn(mesh, edges):
    """Vertices at which other than two sharp edges meet."""
    degree = np.bincount(mesh.edges[edges].ravel(), minlength=len(mesh.vertices))
    return np.flatnonzero((degree != 2) & (degree > 0))


@pytest.mark.parametrize("count", [300, 2000])
@pytest.mark.parametrize("name", SHAPES)
def test_laws(name, count):
    grid = integer_grid(*SHAPES[name], quads=count, sharp_angle=SHARP, distortion=0.1)
    assert not any("sharp edge" in note for note in grid.notes)
    check_laws(grid)
    check_features(grid)
    mesh = TriangleMesh(grid.vertices, grid.faces)
    sharp = sharp_edges(mesh, SHARP)
    assert set(sharp.tolist()) == set(edge_indices(mesh, grid.features).tolist())
    quad_mesh = extract_quads(grid)
    assert quad_mesh.left_out == 0
    assert quad_mesh.euler_characteristic == quad_mesh.surface_euler
    assert abs(quad_mesh.area_left_out) < 1e-3


@pytest.mark.parametrize("count", [100, 1000])
def test_cube_is_of_squares(count):
    mesh = quads(*SHAPES["cube"], quads=count, sharp_angle=SHARP)
    assert mesh.valences[mesh.irregular].tolist() == [3] * 8
    measures = measure_quads(mesh)
    assert measures.angle_max < 1e-6
    assert measures.edge_cv < 1e-6
    assert measures.hausdorff < 1e-9
    corners = mesh.vertices[mesh.irregular]
    assert sorted(map(tuple, np.round(corners, 9).tolist())) == [
        (x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)
    ]


@pytest.mark.parametrize("name", ["cylinder", "hexagon"])
def test_quads_follow_round_edges(name):
    """All sharp edges are on edges of quads, and irregular vertices add up to 8 quarter turns (Gauss-Bonnet)."""
    mesh = quads(*SHAPES[name], quads=1000, sharp_angle=SHARP)
    assert (4 - mesh.valences[mesh.irregular]).sum() == 8
    vertices, faces = SHAPES[name]
    for level in (vertices[:, 2].min(), vertices[:, 2].max()):
        # Each quad is on a cap or beside it, so those on the cap cover it.
        areas = [
            double_areas_of(points, corners[(np.abs(points[:, 2] - level) < 1e-9)[corners].all(axis=1)])
            for points, corners in (
                (vertices, faces),
                (mesh.vertices, mesh.quads[:, :3]),
                (mesh.vertices, mesh.quads[:, [0, 2, 3]]),
            )
        ]
        assert areas[1] + areas[2] == pytest.approx(areas[0], rel=0.01)


def double_areas_of(vertices, faces):
    """Return twice the area of triangles."""
    a, b, c = vertices[faces].transpose(1, 0, 2)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()


def test_surface_without_sharp_edges():
    grid = integer_grid(*shapes.sphere(3), quads=500, sharp_angle=SHARP)
    assert len(grid.features) == 0
    assert any("sharp edge" in note for note in grid.notes)
    check_laws(grid)


def test_angles_as_texts():
    grids = [
        integer_grid(*SHAPES["cube"], quads=100, sharp_angle=angle) for angle in ("40deg", np.deg2rad(40))
    ]
    np.testing.assert_array_equal(grids[0].corner_grid, grids[1].corner_grid)


@pytest.mark.parametrize("angle", [0.0, -1.0, 4.0, np.nan, "40 degrees", "0deg"])
def test_impossible_angles(angle):
    with pytest.raises(errors.OptionError, match=r"angle|number"):
        integer_grid(*SHAPES["cube"], quads=100, sharp_angle=angle)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("size", [12, 150])
def test_elimination_spans_all_solutions(size, seed):
    """More than a hundred equations are eliminated before the factorization, fewer are not."""
    rng = np.random.default_rng(seed)
    variables = size * 5 // 2
    rows = rng.choice([-1.0, 1.0, 0.6, 0.8], (size, variables)) * (
        rng.random((size, variables)) < 6 / variables
    )
    rows = np.concatenate([rows, rows[:3] - rows[3:6]])
    right = rows @ rng.normal(size=variables)
    solutions, left = solutions_of(csr_matrix(rows), right)
    basis = solutions.toarray()
    assert np.abs(left).max(initial=0.0) < 1e-9
    assert rows @ basis[:, -1] == pytest.approx(right, abs=1e-9)
    assert np.abs(rows @ basis[:, :-1]).max() < 1e-9
    rank = np.linalg.matrix_rank(rows)
    assert np.linalg.matrix_rank(basis[:, :-1]) == variables - rank == basis.shape[1] - 1
    # The basis does not become ill-conditioned by the elimination.
    assert np.linalg.cond(basis[:, :-1]) < 1e3
    right[-1] += 1
    missed = solutions_of(csr_matrix(rows), right)[1]
    # As long as what least squares leave, or longer if equations are eliminated before.
    nearest = np.linalg.norm(right - rows @ np.linalg.lstsq(rows, right)[0])
    assert np.linalg.norm(missed) >= nearest - 1e-9
    if len(rows) <= 100:
        assert np.linalg.norm(missed) == pytest.approx(nearest)


@pytest.mark.parametrize("noise", [0.0, 1e-13, 1e-12])
def test_elimination_does_not_divide_by_rounding(noise):
    """Rings of points whose rotations add up to a full turn: the last equation of each is dependent up to rounding."""
    rng = np.random.default_rng(0)
    rings, size = 60, 6
    turns = rng.uniform(-np.pi, np.pi, (rings, size))
    turns[:, -1] = -turns[:, :-1].sum(axis=1)
    unknown = np.arange(rings * size)
    neighbour = (unknown.reshape(rings, size)[:, [*range(1, size), 0]]).ravel()
    factor = np.exp(1j * (turns.ravel() + noise * rng.normal(size=unknown.size)))
    rows = np.zeros((2 * unknown.size, 2 * unknown.size))
    for axis, unit in enumerate((1.0, 1j)):
        image = -factor * unit
        rows[2 * unknown, 2 * unknown + axis], rows[2 * unknown + 1, 2 * unknown + axis] = (
            image.real,
            image.imag,
        )
        rows[2 * unknown + axis, 2 * neighbour + axis] += 1.0
    solutions, _ = solutions_of(csr_matrix(rows), np.zeros(len(rows)))
    basis = solutions[:, :-1].toarray()
    assert basis.shape[1] == 2 * rings
    assert np.abs(rows @ basis).max() <= 50 * noise + 1e-12
    assert np.abs(basis).max() < 10


@pytest.mark.parametrize(("equations", "variables"), [(3, 0), (3, 4), (0, 4), (200, 4)])
def test_elimination_without_coefficients(equations, variables):
    solutions, left = solutions_of(csr_matrix((equations, variables)), np.ones(equations))
    np.testing.assert_array_equal(solutions.toarray(), np.eye(variables, variables + 1))
    np.testing.assert_array_equal(left, np.ones(equations))


@pytest.mark.slow
def test_elimination_of_many_separate_equations_stays_sparse():
    """The basis has 20,000 vectors, of two entries each: as an array it would need 6 GB."""
    blocks = block_diag([csr_matrix([[1.0, -1.0]])] * 20_000, format="csr")
    solutions, left = solutions_of(blocks, np.zeros(20_000))
    assert solutions.shape == (40_000, 20_001)
    assert solutions.nnz == 40_000
    assert not np.abs(left).any()


@pytest.mark.parametrize("boundary", [np.array([]), np.array([0, 2])], ids=["none", "two"])
def test_corners_in_an_array_are_read_or_refused(boundary):
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]])
    with pytest.raises(errors.ConeflatError, match=r"corner|curvature"):
        integer_grid(*square, quads=16, boundary=boundary)


def test_caps_that_are_fans_have_places_for_cones():
    """Else three cones are on the rim, where a cap has a corner of 180 degrees, and the last is in its middle."""
    cylinder = shapes.cylinder(48, 8, 1.0, caps=True)
    mesh = quads(*cylinder, quads=1500, sharp_angle=0.7, symmetry="none")
    assert least_jacobians(mesh.vertices, mesh.quads).min() > 0.4


@pytest.mark.parametrize("count", [10, 300])
def test_two_triangles_back_to_back(count):
    """Splitting an edge of both would join the new vertex to the third one by two edges."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0.3, 0.8, 0]])
    mesh = quads(vertices, np.array([[0, 1, 2], [0, 2, 1]]), quads=count, sharp_angle=0.8)
    assert mesh.euler_characteristic == 2
    assert abs(len(mesh.quads) - count) < 0.1 * count + 5


@pytest.mark.slow
def test_sharp_edges_without_room_are_left_out_with_a_note():
    """Between the edges of a pyramid of 40 quads there is less than a square."""
    angle = np.pi / 6 * np.arange(12)
    around = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    sides = [[i, (i + 1) % 12, 12] for i in range(12)]
    base = [[(i + 1) % 12, i, 13] for i in range(12)]
    grid = integer_grid(
        np.vstack([around, [[0, 0, 6.8], [0, 0, -0.4]]]), sides + base, quads=40, sharp_angle=0.3
    )
    check_laws(grid)
    check_features(grid)
    assert any("% of their length, not on grid lines: " in note for note in grid.notes)
