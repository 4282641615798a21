"""Meshes of many triangles, holes or components: the grid is that of a simpler mesh; quads lie on the given one."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

import coneflat
from coneflat import TriangleMesh, check_mesh
from coneflat.errors import GridError
from coneflat.quadmesh import policies, remesh
from coneflat.quadmesh.cross_field import SHARP_ANGLE, sharp_ends
from coneflat.quadmesh.no_grid import NoGrid
from coneflat.quadmesh.policies import on_coarse_mesh
from coneflat.quadmesh.quad_mesh import QuadMesh
from coneflat.quadmesh.request import GridRequest
from coneflat.quadmesh.simpler_mesh import SimplerMesh


@pytest.fixture
def coarser(monkeypatch):
    """Meshes of more than 2,000 triangles are made coarse."""
    monkeypatch.setattr(policies, "COARSE_TRIANGLES", 1000)


MODELS = {
    "ball": lambda: shapes.sphere(4, bumps=0.2),
    "two": lambda: shapes.join(shapes.sphere(4), (shapes.sphere(3)[0] + 3, shapes.sphere(3)[1])),
    "hill": lambda: shapes.hill(60),
    "box": lambda: shapes.box(14, (1.0, 0.7, 0.4)),
}


@pytest.mark.parametrize("name", MODELS)
def test_quads_lie_on_the_given_surface(coarser, name):
    vertices, faces = MODELS[name]()
    assert len(faces) > 2000
    mesh = coneflat.quads(vertices, faces, quads=300)
    np.testing.assert_array_equal(mesh.surface.vertices, vertices)
    assert len(mesh.grid.faces) < 0.9 * len(faces)
    on = np.einsum("qi,qix->qx", mesh.barycentric, vertices[mesh.surface.faces[mesh.faces]])
    np.testing.assert_allclose(on, mesh.vertices, atol=1e-12)
    measures = coneflat.measure_quads(mesh)
    assert measures.euler_characteristic == measures.surface_euler
    assert measures.jacobian_min > 0
    assert measures.hausdorff < 0.5 * measures.edge_mean
    # Borders lie on borders.
    weights = mesh.barycentric[mesh.is_boundary_vertex]
    sides = mesh.surface.is_boundary_edge[mesh.surface.halfedge_edges].reshape(-1, 3)
    at = mesh.faces[mesh.is_boundary_vertex]
    assert ((weights <= 1e-12) & (sides[at] | (weights.max(axis=1) > 1 - 1e-12)[:, None])).any(axis=1).all()


def test_vertices_stay_on_their_component_where_borders_touch(coarser):
    """Two hills, one of them inverted, have the same border."""
    vertices, faces = shapes.grid(60, 50, lambda x, y: x * (1 - x) * y * (1 - y))
    halves = shapes.join((vertices, faces), (vertices * [1, 1, -1], faces[:, ::-1]))
    # Without symmetry, which would renumber the triangles of the surface.
    mesh = coneflat.quads(*halves, quads=300, symmetry="none")
    of_quads = (mesh.faces >= len(faces))[mesh.quads]
    assert (of_quads == of_quads[:, :1]).all()
    assert len(np.unique(of_quads)) == 2


def test_vertices_slide_along_the_surface():
    """In a narrow channel, whose meshes have common vertices on one wall only, those of the other wall stay there."""

    def channel(columns, rows):
        points, faces = shapes.grid(columns, rows)
        along = 3 * points[:, 0]
        depth = np.maximum(1 - along, along - 2).clip(0)
        return TriangleMesh(np.stack([0.1 * (along - 1).clip(0, 1), points[:, 1], depth], axis=1), faces)

    coarse, finer = channel(3, 2), channel(12, 8)
    common, remaining = np.array([0, 4, 8]), np.setdiff1d(np.arange(len(finer.vertices)), [0, 4, 8])
    order = np.append(common, remaining)
    surface = TriangleMesh(finer.vertices[order], np.argsort(order)[finer.faces])
    first, second = surface.faces.reshape(2, -1, 3)
    at = np.argsort(surface.faces.ravel())[
        np.searchsorted(np.sort(surface.faces.ravel()), np.arange(len(order)))
    ]
    quads = QuadMesh(
        surface.vertices, np.column_stack([first, second[:, 2]]), at // 3, np.eye(3)[at % 3], 0, 0.0, surface
    )
    is_filling = np.zeros(len(surface.faces), dtype=bool)
    np.testing.assert_array_equal(coarse.vertices[[0, 1, 2]], surface.vertices[[0, 1, 2]])
    moved = SimplerMesh(surface, np.array([0, 1, 2]), coarse, is_filling, 0.1).moved(quads)
    np.testing.assert_allclose(moved.vertices, quads.vertices, atol=1e-12)


def test_creases_are_kept(coarser):
    vertices, faces = MODELS["box"]()
    mesh = coneflat.quads(vertices, faces, quads=300)
    # Vertices on two sides of the box are on its edges.
    off = np.minimum(np.abs(mesh.vertices), np.abs(mesh.vertices - vertices.max(axis=0)))
    assert ((off < 1e-12).sum(axis=1) >= 2).sum() > 70


@pytest.mark.parametrize(
    "options",
    [
        {"cones": {0: np.pi}},
        {"weights": "area"},
        {"forbidden_cones": [1]},
        {"sharp_angle": 1.0},
        {"quads": 100_000},
    ],
)
def test_options_for_which_the_given_mesh_is_used(coarser, options):
    vertices, faces = MODELS["ball"]()
    quad_options = {
        "quads": 300,
        **{name: options.pop(name) for name in ("quads", "sharp_angle") if name in options},
    }
    assert on_coarse_mesh(GridRequest.of(vertices, faces, {"quads": 300}, {}))[1] is not None
    request = GridRequest.of(vertices, faces, quad_options, options)
    assert on_coarse_mesh(request) == (request, None)


def test_sizes_are_those_of_the_given_mesh(coarser):
    vertices, faces = MODELS["ball"]()
    sizes = np.linspace(1, 2, len(vertices))
    request, simpler = on_coarse_mesh(GridRequest.of(vertices, faces, {"quads": 300, "size": sizes}, {}))
    np.testing.assert_allclose(request.sizes, sizes[simpler.vertex_origin])
    np.testing.assert_array_equal(simpler.mesh.vertices, vertices[simpler.vertex_origin])


def components_of(mesh):
    """The number of components of quads, and of their surface."""
    quads = csr_matrix((np.ones(len(mesh.edges)), mesh.edges.T), shape=(len(mesh.vertices),) * 2)
    return connected_components(quads)[0], mesh.surface.components[0]


@pytest.mark.slow
def test_small_components_are_divided(monkeypatch):
    monkeypatch.setattr(remesh, "MAX_COMPONENTS", 2)
    cube, (ball, faces) = shapes.box(1, (1.0, 1.0, 1.0)), shapes.sphere(3)
    parts = [(4.0 * k + size * cube[0], cube[1]) for k, size in enumerate((3, 1, 2, 0.1))]
    mesh = coneflat.quads(*shapes.join(*parts, (ball - 9, faces)), quads=300)
    assert components_of(mesh) == (5, 5)
    assert any("of 3 components without a grid" in note for note in mesh.notes)
    on = np.einsum("qi,qix->qx", mesh.barycentric, mesh.surface.vertices[mesh.surface.faces[mesh.faces]])
    np.testing.assert_allclose(on, mesh.vertices, atol=1e-12)
    measures = coneflat.measure_quads(mesh)
    assert measures.euler_characteristic == measures.surface_euler == 10
    assert measures.jacobian_min > 0
    assert measures.hausdorff < measures.edge_mean
    # The unit cube has about as many quads as its area needs, or up to four times as many.
    corners = mesh.vertices[mesh.quads].mean(axis=1)
    is_unit = (np.abs(corners - 4.5).max(axis=1) < 0.6).sum()
    assert 0.8 < is_unit / (300 * 6 / (14.01 * 6 + 4 * np.pi)) < 4


def with_holes(count, corners=((20, 20), (60, 20), (20, 60), (60, 60))):
    """A flat grid without some of its squares, and the sides of these."""
    vertices, faces = shapes.grid(count, count)
    middle = vertices[faces].mean(axis=1) * count
    gone = np.any([(np.abs(middle[:, :2] - corner - 0.5) < 0.5).all(axis=1) for corner in corners], axis=0)
    return vertices, faces[~gone]


@pytest.mark.slow
def test_holes_smaller_than_quads_are_filled():
    mesh = coneflat.quads(*with_holes(80), quads=100)
    assert (len(mesh.quads), mesh.euler_characteristic, len(mesh.irregular)) == (100, 1, 0)
    assert any(note.startswith("Filled 4 holes: small ones") for note in mesh.notes)
    assert mesh.surface.euler_characteristic == -3


def test_quads_over_filled_holes_are_left_out(monkeypatch):
    monkeypatch.setattr(remesh, "MAX_HOLES", 1)
    mesh = coneflat.quads(*with_holes(20, ((3, 3), (15, 3), (3, 15), (15, 15))), quads=1600)
    assert any(note.startswith("Filled 3 holes") for note in mesh.notes)
    assert mesh.euler_characteristic == mesh.surface_euler == -3
    places = mesh.vertices[mesh.quads].mean(axis=1)[:, None, :2] * 20 - [[3.5, 3.5], [15.5, 3.5]]
    assert (np.abs(places).max(axis=2) > 0.4).all()
    assert coneflat.measure_quads(mesh).jacobian_min > 0


@pytest.mark.slow
def test_round_holes_that_are_filled_give_no_flipped_quads(monkeypatch):
    monkeypatch.setattr(remesh, "MAX_HOLES", 1)
    vertices, faces = shapes.grid(60, 60)
    middle = vertices[faces].mean(axis=1)[:, :2]
    centres = np.array([[0.2, 0.25], [0.7, 0.3], [0.35, 0.7], [0.75, 0.75]])
    is_gone = (np.linalg.norm(middle[:, None] - centres, axis=2) < 0.07).any(axis=1)
    mesh = coneflat.quads(vertices, faces[~is_gone], quads=1000)
    assert mesh.euler_characteristic == mesh.surface_euler == -3
    assert coneflat.measure_quads(mesh).jacobian_min > 0


def test_a_boundary_with_very_many_corners_is_free(monkeypatch):
    for module in (remesh, policies):
        monkeypatch.setattr(module, "MAX_CORNERS", 3)
    mesh = coneflat.quads(*shapes.grid(8, 8), quads=50)
    assert "The boundary cuts squares, because it has more than 3 corners." in mesh.notes
    assert mesh.euler_characteristic == 1
    asked = coneflat.quads(*shapes.grid(8, 8), quads=50, boundary="straight")
    assert len(asked.irregular) == 0
    assert not any("corners" in note for note in asked.notes)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["as given", "coarse", "filled", "few"])
def test_components_for_which_no_grid_is_found_are_divided(monkeypatch, name):
    """Each triangle of the cube becomes three quads, and the surface is the given one."""
    find_grid = policies.find_grid

    def fail_for_cubes(request):
        mesh = request.mesh
        if mesh.components[0] == 1 and not mesh.is_boundary_edge.any() and len(mesh.faces) <= 12:
            return NoGrid(GridError("none"))
        return find_grid(request)

    monkeypatch.setattr(policies, "find_grid", fail_for_cubes)
    (sheet, faces), cube = with_holes(40, ((20, 20),)), shapes.box(1, (1.0, 1.0, 1.0))
    parts = [(20 * sheet, faces), (cube[0] + 30, cube[1])]
    if name == "coarse":
        monkeypatch.setattr(policies, "COARSE_TRIANGLES", 1000)
    if name == "few":
        monkeypatch.setattr(remesh, "MAX_COMPONENTS", 4)
        parts += [(0.1 * cube[0] - 5 * k, cube[1]) for k in range(1, 4)]
    vertices, triangles = shapes.join(*parts)
    quad_mesh = coneflat.quads(vertices, triangles, quads=2000 if name == "as given" else 200)
    assert components_of(quad_mesh) == (len(parts), len(parts))
    assert any(note.startswith("No grid for a component of 12 triangles: none.") for note in quad_mesh.notes)
    assert any(note.startswith("Made three quads of each triangle") for note in quad_mesh.notes)
    assert len(quad_mesh.surface.faces) == len(triangles)
    on = np.einsum(
        "qi,qix->qx",
        quad_mesh.barycentric,
        quad_mesh.surface.vertices[quad_mesh.surface.faces[quad_mesh.faces]],
    )
    np.testing.assert_allclose(on, quad_mesh.vertices, atol=1e-12)
    assert any("Filled 1 hole" in note for note in quad_mesh.notes) == (name != "as given")


def test_two_sided_triangles_are_divided(monkeypatch):
    """Splitting edges of two triangles with the same vertices would join two vertices twice."""
    monkeypatch.setattr(remesh, "MAX_COMPONENTS", 1)
    pillow = np.array([[5.0, 0, 0], [6, 0, 0], [5, 1, 0]]), np.array([[0, 1, 2], [0, 2, 1]])
    mesh = coneflat.quads(*shapes.join(shapes.sphere(3), pillow), quads=2000)
    assert components_of(mesh) == (2, 2)
    assert mesh.euler_characteristic == 4
    tails, heads = mesh.quads.ravel(), np.roll(mesh.quads, -1, axis=1).ravel()
    assert len(np.unique(np.stack([tails, heads], axis=1), axis=0)) == len(tails)


@pytest.mark.parametrize("size", [1e160, 1e-170])
def test_extreme_sizes_are_refused(size):
    with pytest.raises(GridError):
        coneflat.quads(*shapes.grid(8, 8), size=size)


@pytest.mark.slow
def test_noise_is_not_a_crease():
    """Of a noisy sphere there are no sharp edges, and not more irregular vertices; those of a noisy box are kept."""
    rng = np.random.default_rng(0)
    vertices, faces = shapes.sphere(4)
    noisy = vertices + 0.02 * rng.standard_normal(vertices.shape)
    mesh = check_mesh(noisy, faces).mesh
    assert (np.abs(coneflat.geometry.dihedral_angles(mesh)) > SHARP_ANGLE).sum() > 400
    assert len(sharp_ends(mesh)) <= 20
    assert len(coneflat.quads(noisy, faces, quads=1000).irregular) <= 16
    vertices, faces = MODELS["box"]()
    mesh = check_mesh(vertices + 0.002 * rng.standard_normal(vertices.shape), faces).mesh
    assert len(sharp_ends(mesh)) >= len(sharp_ends(check_mesh(vertices, faces).mesh))
    assert len(sharp_ends(mesh)) < 1.5 * len(sharp_ends(check_mesh(vertices, faces).mesh))


@pytest.mark.parametrize("cells", [10, 32])
def test_edges_of_a_small_part_are_no_noise(cells):
    """A pin of one cell, two cells high, on a plate of voxels: convex and concave edges meet at its foot."""
    solid = np.zeros((cells + 2, cells + 2, 5), dtype=bool)
    solid[1:-1, 1:-1, 1] = solid[cells // 2, cells // 2, 2:4] = True
    rows, turns = [], {0: (1, 2), 1: (2, 0), 2: (0, 1)}
    for axis, (first, second) in turns.items():
        for up in (True, False):
            neighbour = np.roll(solid, -1 if up else 1, axis=axis)
            for cell in np.argwhere(solid & ~neighbour):
                a = cell + up * np.eye(3, dtype=int)[axis]
                b, c = np.eye(3, dtype=int)[[first, second]]
                square = [a, a + b, a + b + c, a + c]
                rows.append(square if up else square[::-1])
    points, index = np.unique(np.array(rows).reshape(-1, 3), axis=0, return_inverse=True)
    square = index.reshape(-1, 4)
    mesh = check_mesh(points.astype(float), np.concatenate([square[:, :3], square[:, [0, 2, 3]]])).mesh
    assert len(sharp_ends(mesh)) == 4 + 8 + 4 + 8 * cells + 4


@pytest.mark.slow
def test_meshes_of_thin_triangles_are_remeshed():
    """As in files of CAD programs: a pipe of strips as long as it, and a cap with a fan around its centre."""
    count = 60
    turn = np.arange(count) * 2 * np.pi / count
    ring = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    vertices = np.concatenate([ring, ring + np.array([0, 0, 5.0]), [[0, 0, 5]]])
    low, high = np.arange(count), np.arange(count) + count
    after, above = np.roll(low, -1), np.roll(high, -1)
    fans = [[low, after, above], [low, above, high], [high, above, 0 * low + 2 * count]]
    faces = np.concatenate([np.stack(fan, axis=1) for fan in fans])
    checked = check_mesh(vertices, faces).mesh
    assert remesh.is_thin(checked).all()
    remeshed, vertices_of, of = remesh.remeshed(checked, 4000)
    common = vertices_of[vertices_of < len(vertices)]
    assert (np.diff(vertices_of) >= 0).all()
    np.testing.assert_array_equal(remeshed.vertices[: len(common)], checked.vertices[common])
    assert (remeshed.euler_characteristic, len(remeshed.faces)) == (1, len(of))
    assert remesh.is_thin(remeshed).mean() < 0.2
    # Symmetric quads lie on a half and its image.
    mesh = coneflat.quads(vertices, faces, quads=600, symmetry="none")
    np.testing.assert_array_equal(mesh.surface.vertices, vertices)
    assert (mesh.left_out, mesh.euler_characteristic) == (0, 1)
    assert coneflat.measure_quads(mesh).jacobian_min > 0.2
    assert not any("Cones are not chosen" in note for note in mesh.notes)
    np.testing.assert_allclose(mesh.vertices[mesh.is_boundary_vertex][:, 2], 0, atol=1e-9)


def test_meshes_whose_triangles_stay_thin_are_taken_as_given():
    vertices, faces = shapes.grid(40, 2)
    mesh = check_mesh(vertices * [0.2, 8, 1], faces).mesh
    remeshed, vertices_of, of = remesh.remeshed(mesh, 400)
    np.testing.assert_array_equal(remeshed.faces, mesh.faces)
    assert (vertices_of.tolist(), of.tolist()) == (
        list(range(len(mesh.vertices))),
        list(range(len(mesh.faces))),
    )


@pytest.mark.slow
def test_triangles_that_stay_thin_are_not_split_without_bound(monkeypatch):
    """The triangles of a cylinder of many sides are thin at their tips, however often they are split."""
    counts, coarse = [], remesh.coarse_mesh

    def watched(mesh, count):
        counts.append(len(mesh.faces) / count)
        return coarse(mesh, count)

    monkeypatch.setattr(remesh, "coarse_mesh", watched)
    vertices, faces = shapes.cylinder(300, 1, 9.0, caps=True)
    quad_mesh = coneflat.quads(vertices, faces, quads=1000, repair=True)
    assert 1 < counts[0] < 12
    assert len(quad_mesh.grid.faces) < 3 * len(faces)
