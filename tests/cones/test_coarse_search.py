"""The search for cones of large meshes on a coarse mesh."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

import coneflat
from coneflat import check_mesh
from coneflat.cones import ConeSurface
from coneflat.cones.sparse.coarse_search import CoarseStarts
from coneflat.cones.sparse.starts import DenseStarts
from coneflat.cones.surface import MAX_WITHOUT_COARSE_MESH
from coneflat.errors import CurvatureError
from coneflat.geometry import edge_lengths
from coneflat.geometry.operators import area_distortion
from coneflat.stages import ConeSpec


@pytest.fixture(scope="module")
def bumpy():
    """A sphere with bumps, of 20,480 triangles."""
    vertices, faces = shapes.sphere(5)
    assert len(faces) > MAX_WITHOUT_COARSE_MESH
    return vertices, faces


def surface_of(vertices, faces) -> ConeSurface:
    mesh = check_mesh(vertices, faces).mesh
    return ConeSurface.of(mesh, edge_lengths(mesh.vertices, mesh.faces))


def spec_of(surface: ConeSurface, is_allowed=None) -> ConeSpec:
    """Return the default specification, with further cones at allowed vertices (n,) only."""
    count = len(surface.areas)
    return ConeSpec(
        strategy="sparse", needs_sparse_search=True, distortion=0.2, count=None, max_count=None, min_angle=np.pi / 2,
        max_angle=4 * np.pi, positive_only=False, quantum=None, prescribed={}, required=np.empty(0, dtype=int),
        is_allowed=np.ones(count, dtype=bool) if is_allowed is None else is_allowed, weights=None,
        absorbs_curvature=surface.mesh.is_boundary_vertex, prescribes_boundary=False, searches_corners=False,
        scale_at_cones=False, names=np.arange(count),
    )  # fmt: skip


def test_the_bound_holds_on_the_mesh(bumpy):
    surface = surface_of(*bumpy)
    search = surface.search(spec_of(surface))
    assert isinstance(search.starts, CoarseStarts)
    result = search.fewest(0.1)
    measured = area_distortion(result.solution.log_scale, surface.areas / surface.areas.sum())
    assert result.distortion == pytest.approx(measured, rel=1e-6)
    assert measured <= 0.1


def test_no_more_cones_than_without_a_coarse_mesh(bumpy):
    search = coneflat.cones.ConeSearch.from_mesh(check_mesh(*bumpy).mesh)
    for distortion in (0.06, 0.1, 0.2):
        expected = len(search.fewest(distortion).solution.cones)
        cones = coneflat.find_cones(*bumpy, distortion=distortion)
        assert cones.distortion <= distortion
        assert len(cones.vertices) <= expected + (expected > 10)


def test_required_cones_and_their_order_stay(bumpy):
    required = [4321, 17, 9000]
    cones = coneflat.find_cones(*bumpy, required_cones=required)
    assert list(cones.vertices[:3]) == required


def test_cones_are_at_allowed_vertices(bumpy):
    """Of a hundred vertices the coarse mesh keeps few: the others represent their clusters."""
    allowed = np.random.default_rng(3).choice(len(bumpy[0]), 100, replace=False)
    forbidden = np.setdiff1d(np.arange(len(bumpy[0])), allowed)
    cones = coneflat.find_cones(*bumpy, forbidden_cones=forbidden)
    assert np.isin(cones.vertices, allowed).all()
    assert cones.distortion < 0.5


def test_allowed_vertices_that_share_a_cluster():
    """Four neighbours are enough for the curvature of a sphere, but not four clusters."""
    vertices, faces = shapes.sphere(5)
    surface = surface_of(vertices, faces)
    neighbours = np.argsort(((vertices - vertices[100]) ** 2).sum(axis=1))[:5]
    allowed = np.zeros(len(vertices), dtype=bool)
    allowed[neighbours] = True
    search = surface.search(spec_of(surface, allowed))
    assert np.isin(search.fewest(0.2).solution.cones, neighbours).all()
    allowed[neighbours[2:]] = False
    with pytest.raises(CurvatureError):
        surface.search(spec_of(surface, allowed))


def test_noise_needs_cones_beyond_those_of_the_coarse_mesh(bumpy):
    vertices, faces = bumpy
    rough = vertices + np.random.default_rng(0).normal(scale=0.012, size=vertices.shape)
    cones = coneflat.find_cones(rough, faces)
    assert cones.distortion <= 0.2
    assert not cones.notes


def test_a_sheet_keeps_its_boundary():
    vertices, faces = shapes.subdivide(*shapes.subdivide(*shapes.hill(50, 40)))
    vertices = vertices * [1, 1, 3]
    cones = coneflat.find_cones(vertices, faces, distortion=0.05)
    mesh = check_mesh(vertices, faces).mesh
    assert len(cones.vertices)
    assert cones.distortion <= 0.05
    assert not mesh.is_boundary_vertex[cones.vertices].any()


def test_lengths_that_are_not_distances_need_no_coarse_mesh(bumpy):
    vertices, faces = bumpy
    mesh = check_mesh(vertices / np.linalg.norm(vertices, axis=1)[:, None], faces).mesh
    surface = ConeSurface.of(mesh, edge_lengths(vertices, mesh.faces))
    assert isinstance(surface.search(spec_of(surface)).starts, DenseStarts)


def test_a_bound_out_of_reach_costs_few_cones(bumpy):
    """More cones on one half of a sphere hardly help the other half."""
    forbidden = np.flatnonzero(bumpy[0][:, 2] > 0)
    cones = coneflat.find_cones(*bumpy, forbidden_cones=forbidden, distortion=0.1)
    dense = coneflat.cones.ConeSearch.from_mesh(
        check_mesh(*bumpy).mesh, allowed=~np.isin(np.arange(len(bumpy[0])), forbidden)
    ).fewest(0.1)
    assert len(cones.vertices) <= 1.15 * len(dense.solution.cones)
    assert cones.distortion <= 1.02 * dense.distortion
