"""Seams open every surface to disks, as they are asked to."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from scipy.sparse.csgraph import dijkstra

from coneflat import TriangleMesh, errors
from coneflat.atlas.sheet import grown
from coneflat.linalg.shortest_paths import MultiGraph, Regions
from coneflat.mesh import cut_open, find_holes
from coneflat.mesh.connectivity import label_components
from coneflat.seams import find_seams

NONE = np.array([], dtype=int)
SURFACES = {
    "sphere": shapes.sphere(2),
    "torus": shapes.torus(),
    "disk": shapes.hill(),
    "annulus": shapes.annulus(),
    "genus 1": shapes.genus(1),
    "genus 2": shapes.genus(2),
}


def lengths_of(mesh):
    return np.linalg.norm(mesh.vertices[mesh.edges[:, 0]] - mesh.vertices[mesh.edges[:, 1]], axis=1)


def remove_faces(shape, count, seed):
    """Cut holes of one vertex's fan each, no two of them touching."""
    vertices, faces = shape
    rng = np.random.default_rng(seed)
    gone = np.zeros(len(faces), dtype=bool)
    is_adjacent = np.zeros(len(vertices), dtype=bool)
    for v in rng.permutation(len(vertices)):
        ring = (faces == v).any(axis=1)
        if count and not is_adjacent[faces[ring]].any():
            gone |= ring
            is_adjacent[faces[is_adjacent[faces].any(axis=1) | ring]] = True
            count -= 1
    kept_vertices, index = np.unique(faces[~gone], return_inverse=True)
    return vertices[kept_vertices], index.reshape(-1, 3)


def with_cones(shape, count, seed=0):
    """A mesh and some of its inner vertices."""
    mesh = TriangleMesh(*shape)
    inside = np.flatnonzero(~mesh.is_boundary_vertex)
    return mesh, np.random.default_rng(seed).choice(inside, count, replace=False)


def assert_opened(mesh, seams, cones):
    disk = cut_open(mesh, seams)
    assert disk.mesh.components[0] == disk.mesh.boundary_loops[0] == disk.mesh.euler_characteristic == 1
    assert not mesh.is_boundary_edge[seams].any()
    assert (np.diff(disk.origin) >= 0).all()
    np.testing.assert_array_equal(disk.origin[disk.mesh.faces], mesh.faces)
    on_border = np.zeros(len(mesh.vertices), dtype=bool)
    on_border[disk.origin[disk.mesh.is_boundary_vertex]] = True
    assert on_border[cones].all()
    # Nothing dangles: a seam ends at cones and boundaries.
    ends, degree = np.unique(mesh.edges[seams], return_counts=True)
    loose = ends[(degree == 1) & ~mesh.is_boundary_vertex[ends]]
    assert set(loose.tolist()) <= set(cones.tolist())


@pytest.mark.parametrize("name", SURFACES)
@pytest.mark.parametrize("holes", [0, 5])
@pytest.mark.parametrize("cones", [0, 1, 9])
def test_seams_open_every_surface_to_a_disk(name, holes, cones):
    shape = remove_faces(SURFACES[name], holes, seed=holes) if holes else SURFACES[name]
    mesh, terminals = with_cones(shape, cones, seed=cones)
    seams = find_seams(mesh, terminals, lengths_of(mesh))
    if name == "sphere" and holes == 0 and cones < 2:
        assert len(seams) == 0  # a point does not open a sphere
        return
    assert_opened(mesh, seams, terminals)


def test_a_slit_between_neighbours_is_two_edges_long():
    # One edge has the same two vertices on both sides: a triangle mesh cannot be open there.
    mesh = TriangleMesh(*shapes.tetrahedron())
    cones = np.array([0, 1])
    seams = find_seams(mesh, cones, lengths_of(mesh))
    assert len(seams) == 2
    assert cut_open(mesh, seams).mesh.euler_characteristic == 1
    edge = np.flatnonzero((mesh.edges == cones).all(axis=1))
    with pytest.raises(errors.MetricError, match="does not give disks"):
        cut_open(mesh, edge)


def test_wrong_seams_are_refused():
    mesh = TriangleMesh(*shapes.torus())
    with pytest.raises(errors.MetricError, match="does not give disks"):
        cut_open(mesh, np.array([0]))
    with pytest.raises(errors.MetricError, match="does not give disks"):
        cut_open(mesh, NONE)


def test_diagonals_are_avoided():
    mesh = TriangleMesh(*shapes.torus(30, 20))
    # Each of the second half of the faces shares a diagonal with one of the first.
    diagonal = np.diff(mesh.edge_faces % (len(mesh.faces) // 2), axis=1)[:, 0] == 0
    assert diagonal.sum() == len(mesh.faces) // 2
    cones = np.array([3, 100, 250])
    seams = find_seams(mesh, cones, lengths_of(mesh), diagonal)
    assert not diagonal[seams].any()
    assert_opened(mesh, seams, cones)
    # Where a cone has nothing else around it, one of them is cut, but no more.
    around = (mesh.edges == cones[0]).any(axis=1)
    seams = find_seams(mesh, cones, lengths_of(mesh), diagonal | around)
    assert (diagonal | around)[seams].sum() == 1


class TestForbidden:
    @pytest.mark.parametrize("name", ["sphere", "annulus", "genus 1"])
    def test_seams_are_found_if_and_only_if_they_exist(self, name):
        # The surface minus all edges that may be cut and can be reached falls into disks just if some seams do.
        outcomes = set()
        for seed in range(12):
            rng = np.random.default_rng(seed)
            mesh, cones = with_cones(remove_faces(SURFACES[name], 1 + seed % 2, seed), 1 + seed % 4, seed)
            inside = ~mesh.is_boundary_edge
            forbidden = (rng.random(len(mesh.edges)) < rng.uniform(0.3, 0.8)) & inside
            _, part = label_components(len(mesh.vertices), *mesh.edges[~forbidden].T)
            parts = np.unique(part[np.concatenate([cones, np.flatnonzero(mesh.is_boundary_vertex)])])
            reachable = ~forbidden & inside & (part[mesh.edges[:, 0]] == parts[0])
            possible = len(parts) == 1
            try:
                cut_open(mesh, np.flatnonzero(reachable))
            except errors.MetricError:
                possible = False
            outcomes.add(possible)
            if possible:
                seams = find_seams(mesh, cones, lengths_of(mesh), forbidden=np.flatnonzero(forbidden))
                assert not forbidden[seams].any()
                assert_opened(mesh, seams, cones)
            else:
                with pytest.raises(errors.SeamError, match="forbidden as seams"):
                    find_seams(mesh, cones, lengths_of(mesh), forbidden=np.flatnonzero(forbidden))
        assert outcomes == {False, True}

    def test_errors_count_the_forbidden_edges_needed(self):
        mesh, cones = with_cones(shapes.sphere(2), 3)
        around = np.flatnonzero((mesh.edges == cones[0]).any(axis=1))
        message = f"1 edge of {len(mesh.edges)} is needed to open the mesh, but forbidden as seams"
        with pytest.raises(errors.SeamError, match=message):
            find_seams(mesh, cones, lengths_of(mesh), forbidden=around)


def test_graph_prefers_the_cheaper_of_parallel_edges_and_ignores_loops():
    graph = MultiGraph(3, np.array([[0, 1], [1, 0], [0, 0], [1, 2], [2, 1]]), np.array([3.0, 2, 0.1, 1, 5]))
    assert sorted(graph.minimum_spanning_tree().tolist()) == [1, 3]
    paths = graph.shortest_paths(np.array([0]))
    assert paths.distance.tolist() == [0, 2, 3]
    assert paths.before.tolist() == [-1, 0, 1]
    assert paths.edge.tolist() == [-1, 1, 3]
    assert paths.source.tolist() == [0, 0, 0]
    assert paths.nodes_to(np.array([2, 1])).tolist() == [2, 1]


def random_graph(seed, nodes=60, edges=150):
    rng = np.random.default_rng(seed)
    return MultiGraph(nodes, rng.integers(0, nodes, (edges, 2)), rng.uniform(0.1, 1.0, edges))


@pytest.mark.parametrize("seed", range(2))
def test_paths_are_those_of_scipy_and_the_nearest_target_is_reached(seed):
    graph, sources = random_graph(seed), np.array([3, 7])
    matrix = np.full((graph.nodes, graph.nodes), np.inf)
    for pair in graph.ends.T, graph.ends[:, ::-1].T:
        np.minimum.at(matrix, tuple(pair), graph.costs)
    expected = dijkstra(np.where(np.isfinite(matrix), matrix, 0), indices=sources, min_only=True)
    paths = graph.shortest_paths(sources)
    distance, before, source = paths.distance, paths.before, paths.source
    assert distance == pytest.approx(expected)
    reached = np.flatnonzero(before >= 0)
    assert distance[reached] == pytest.approx(distance[before[reached]] + matrix[before[reached], reached])
    assert (source[reached] == source[before[reached]]).all()
    targets = np.array([11, 23, 42])
    short = graph.shortest_paths(sources, targets).distance
    assert short[targets].min() == distance[targets].min()
    assert (short >= distance).all()


@pytest.mark.parametrize("min_size", [0.0, 5.0, 100.0])
def test_sets_grow_by_the_nearest_nodes(min_size):
    graph = random_graph(5)
    paths = graph.shortest_paths(np.array([3, 30]))
    for seed in (3, 30):
        chosen = np.arange(graph.nodes) == seed
        region = np.flatnonzero(paths.source == seed)
        nearest = region[np.argsort(paths.distance[region])][: max(1, int(min_size))]
        assert set(np.flatnonzero(grown(paths, chosen, np.ones(graph.nodes), min_size))) == set(nearest)


@pytest.mark.parametrize("total", [0.0, 4.5, 8.0])
def test_a_search_ends_where_both_regions_are_large_enough(total):
    graph = random_graph(5)
    is_second = np.arange(graph.nodes) == 30
    weights = np.random.default_rng(5).uniform(0.5, 1.5, graph.nodes)
    paths = graph.shortest_paths(np.array([3, 30]))
    limited = graph.shortest_paths(np.array([3, 30]), regions=Regions(is_second, weights, total))
    ends = []
    for seed in (3, 30):
        region = np.flatnonzero(paths.source == seed)
        region = region[np.argsort(paths.distance[region])]
        ends.append(paths.distance[region[np.argmax(np.cumsum(weights[region]) > total)]])
    inside = paths.distance <= max(ends)
    assert 1 < np.count_nonzero(inside) < graph.nodes
    for name in ("distance", "before", "edge", "source"):
        np.testing.assert_array_equal(getattr(limited, name)[inside], getattr(paths, name)[inside])
    assert (limited.distance[~inside] > max(ends)).all()
    assert np.isinf(limited.distance).any()


def test_seams_of_components_are_independent():
    # Of the closed one, two adjacent cones: one edge alone would not open it.
    closed, bounded = TriangleMesh(*shapes.sphere(1)), TriangleMesh(*shapes.hill(7, 5))
    joined = TriangleMesh(*shapes.join((closed.vertices, closed.faces), (bounded.vertices, bounded.faces)))
    cones = closed.edges[0]
    joint_seams = joined.edges[find_seams(joined, cones, lengths_along_edges(joined))]
    alone = closed.edges[find_seams(closed, cones, lengths_along_edges(closed))]
    np.testing.assert_array_equal(np.sort(joint_seams), np.sort(alone))
    assert len(joint_seams) == 2


def lengths_along_edges(mesh):
    ends = mesh.vertices[mesh.edges]
    return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)


def planar_domain(seed):
    return TriangleMesh(*remove_faces(shapes.hill(24, 20), 6, seed))


def test_kept_holes_need_no_seams():
    mesh = planar_domain(0)
    assert len(find_seams(mesh, NONE, lengths_of(mesh), kept_holes=find_holes(mesh))) == 0


@pytest.mark.parametrize("seed", range(4))
def test_seams_through_kept_holes_leave_one_piece(seed):
    mesh = planar_domain(seed)
    holes, inside = find_holes(mesh), np.flatnonzero(~mesh.is_boundary_vertex)
    cones = np.random.default_rng(seed).choice(inside, 8, replace=False)
    costs = lengths_of(mesh)
    seams = find_seams(mesh, cones, costs, kept_holes=holes)
    cut = cut_open(mesh, seams, len(holes)).mesh
    assert cut.components[0] == 1
    assert cut.euler_characteristic == 2 - cut.boundary_loops[0]
    assert np.isin(cones, mesh.edges[seams]).all()
    assert not mesh.is_boundary_edge[seams].any()
    # Reaching all holes as well costs more.
    assert costs[seams].sum() < costs[find_seams(mesh, cones, costs)].sum()


def test_passing_a_kept_hole_costs_nothing():
    """A cone three edges from the border, but one from a hole that ends one edge from the border."""
    vertices, faces = shapes.grid(12, 12)
    x, y = vertices[faces].mean(axis=1)[:, :2].T
    hole = (np.abs(x - 0.5) < 1 / 12) & (y > 1 / 12) & (y < 8 / 12)
    vertex_indices, corners = np.unique(faces[~hole], return_inverse=True)
    mesh = TriangleMesh(vertices[vertex_indices], corners.reshape(-1, 3))
    cone = int(np.argmin(np.linalg.norm(mesh.vertices[:, :2] - [0.5, 9 / 12], axis=1)))
    costs = lengths_of(mesh)
    seams = find_seams(mesh, np.array([cone]), costs, kept_holes=find_holes(mesh))
    assert costs[seams].sum() == pytest.approx(2 / 12)
    assert cut_open(mesh, seams, 1).mesh.boundary_loops[0] == 1
