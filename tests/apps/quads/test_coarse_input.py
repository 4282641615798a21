"""Meshes of many triangles: the grid is that of a coarse mesh, and quads lie on the given one."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

import coneflat
from coneflat import check_mesh
from coneflat.apps.quads import coarse_input as module
from coneflat.apps.quads.coarse_input import coarse_input
from coneflat.apps.quads.cross_field import SHARP_ANGLE, sharp_ends
from coneflat.apps.quads.integer_grid import GridSearch


@pytest.fixture
def coarser(monkeypatch):
    """Meshes of more than 2,000 triangles are made coarse."""
    monkeypatch.setattr(module, "COARSE", 1000)


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
    found = coneflat.quads(vertices, faces, quads=300)
    np.testing.assert_array_equal(found.surface.vertices, vertices)
    assert len(found.grid.faces) < 0.9 * len(faces)
    on = np.einsum("qi,qix->qx", found.barycentric, vertices[found.surface.faces[found.faces]])
    np.testing.assert_allclose(on, found.vertices, atol=1e-12)
    measures = coneflat.measure_quads(found)
    assert measures.euler_characteristic == measures.surface_euler
    assert measures.jacobian_min > 0
    assert measures.hausdorff < 0.5 * measures.edge_mean
    # Borders lie on borders.
    weights = found.barycentric[found.is_boundary_vertex]
    sides = found.surface.is_boundary_edge[found.surface.halfedge_edges].reshape(-1, 3)
    at = found.faces[found.is_boundary_vertex]
    assert ((weights <= 1e-12) & (sides[at] | (weights.max(axis=1) > 1 - 1e-12)[:, None])).any(axis=1).all()


def test_vertices_stay_on_their_component_where_borders_touch(coarser):
    """Two hills, one of them upside down, have the same border."""
    vertices, faces = shapes.grid(60, 50, lambda x, y: x * (1 - x) * y * (1 - y))
    both = shapes.join((vertices, faces), (vertices * [1, 1, -1], faces[:, ::-1]))
    found = coneflat.quads(*both, quads=300)
    of_quads = (found.faces >= len(faces))[found.quads]
    assert (of_quads == of_quads[:, :1]).all()
    assert len(np.unique(of_quads)) == 2


def test_creases_are_kept(coarser):
    vertices, faces = MODELS["box"]()
    found = coneflat.quads(vertices, faces, quads=300)
    # Vertices on two sides of the box are on its edges.
    off = np.minimum(np.abs(found.vertices), np.abs(found.vertices - vertices.max(axis=0)))
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
    own = {"quads": 300, **{name: options.pop(name) for name in ("quads", "sharp_angle") if name in options}}
    assert coarse_input(GridSearch.of(vertices, faces, {"quads": 300}, {})) is not None
    assert coarse_input(GridSearch.of(vertices, faces, own, options)) is None


def test_sizes_are_those_of_the_given_mesh(coarser):
    vertices, faces = MODELS["ball"]()
    sizes = np.linspace(1, 2, len(vertices))
    small = coarse_input(GridSearch.of(vertices, faces, {"quads": 300, "size": sizes}, {}))
    np.testing.assert_allclose(small.sizes, sizes[small.kept])
    np.testing.assert_array_equal(small.mesh.vertices, vertices[small.kept])


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
    for axis, (one, two) in turns.items():
        for up in (True, False):
            other = np.roll(solid, -1 if up else 1, axis=axis)
            for cell in np.argwhere(solid & ~other):
                a = cell + up * np.eye(3, dtype=int)[axis]
                b, c = np.eye(3, dtype=int)[[one, two]]
                square = [a, a + b, a + b + c, a + c]
                rows.append(square if up else square[::-1])
    points, index = np.unique(np.array(rows).reshape(-1, 3), axis=0, return_inverse=True)
    square = index.reshape(-1, 4)
    mesh = check_mesh(points.astype(float), np.concatenate([square[:, :3], square[:, [0, 2, 3]]])).mesh
    assert len(sharp_ends(mesh)) == 4 + 8 + 4 + 8 * cells + 4
