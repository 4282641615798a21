from __future__ import annotations

import numpy as np
import pytest
import shapes

from coneflat import TriangleMesh, cut_open, errors, find_seams
from coneflat.graph import MultiGraph

SURFACES = {
    "sphere": shapes.sphere(3),
    "torus": shapes.torus(),
    "disk": shapes.hill(),
    "annulus": shapes.annulus(),
    "genus 1": shapes.genus(1),
    "genus 4": shapes.genus(4),
}


def edge_costs(mesh):
    return np.linalg.norm(mesh.vertices[mesh.edges[:, 0]] - mesh.vertices[mesh.edges[:, 1]], axis=1)


def remove_faces(shape, count, seed):
    """Cut holes of one vertex's fan each, no two of them touching."""
    vertices, faces = shape
    rng = np.random.default_rng(seed)
    gone = np.zeros(len(faces), dtype=bool)
    near = np.zeros(len(vertices), dtype=bool)
    for v in rng.permutation(len(vertices)):
        ring = (faces == v).any(axis=1)
        if count and not near[faces[ring]].any():
            gone |= ring
            near[faces[near[faces].any(axis=1) | ring]] = True
            count -= 1
    used, index = np.unique(faces[~gone], return_inverse=True)
    return vertices[used], index.reshape(-1, 3)


@pytest.mark.parametrize("name", SURFACES)
@pytest.mark.parametrize("holes", [0, 1, 5])
@pytest.mark.parametrize("cones", [0, 1, 2, 9])
def test_seams_open_every_surface_to_a_disk(name, holes, cones):
    shape = remove_faces(SURFACES[name], holes, seed=holes) if holes else SURFACES[name]
    mesh = TriangleMesh(*shape)
    if name == "sphere" and holes == 0 and cones < 2:
        return  # a point does not open a sphere
    rng = np.random.default_rng(cones)
    terminals = rng.choice(np.flatnonzero(~mesh.is_boundary_vertex), cones, replace=False)
    seams = find_seams(mesh, terminals, edge_costs(mesh))
    disk = cut_open(mesh, seams)
    assert disk.mesh.euler_characteristic == 1
    assert disk.mesh.boundary_loops[0] == 1
    assert not mesh.is_boundary_edge[seams].any()
    on_border = np.zeros(len(mesh.vertices), dtype=bool)
    on_border[disk.origin[disk.mesh.is_boundary_vertex]] = True
    assert on_border[terminals].all()
    np.testing.assert_array_equal(disk.origin[disk.mesh.faces], mesh.faces)
    # Nothing dangles: a seam ends at cones and boundaries only.
    ends, degree = np.unique(mesh.edges[seams], return_counts=True)
    loose = ends[(degree == 1) & ~mesh.is_boundary_vertex[ends]]
    assert set(loose.tolist()) <= set(terminals.tolist())


def test_seams_avoid_forbidden_edges():
    mesh = TriangleMesh(*shapes.torus(30, 20))
    # The second half of the faces share a diagonal each with the first.
    count = len(mesh.faces) // 2
    diagonal = np.zeros(len(mesh.edges), dtype=bool)
    pairs = {tuple(sorted(face[[0, 2]])) for face in mesh.faces[:count].tolist() for face in [np.array(face)]}
    for edge, ends in enumerate(mesh.edges.tolist()):
        diagonal[edge] = tuple(ends) in pairs
    assert diagonal.sum() == count
    seams = find_seams(mesh, np.array([3, 100, 250]), edge_costs(mesh), diagonal)
    assert not diagonal[seams].any()
    assert cut_open(mesh, seams).mesh.euler_characteristic == 1


def test_torus_is_cut_along_short_loops():
    mesh = TriangleMesh(*shapes.torus(60, 30))
    seams = find_seams(mesh, np.array([], dtype=int), edge_costs(mesh))
    # Once around the tube at its widest and once around the hole from there, as edges go.
    assert edge_costs(mesh)[seams].sum() < 2 * np.pi * (1.6 + 0.6) * 1.1


def test_wrong_seams_are_refused():
    mesh = TriangleMesh(*shapes.torus())
    with pytest.raises(errors.MetricError, match="leaves no disk"):
        cut_open(mesh, np.array([0]))


def test_graph_prefers_the_cheaper_of_parallel_edges_and_ignores_loops():
    graph = MultiGraph(3, np.array([0, 1, 0, 1, 2]), np.array([1, 0, 0, 2, 1]), np.array([3.0, 2, 0.1, 1, 5]))
    assert sorted(graph.minimum_spanning_tree().tolist()) == [1, 3]
    distance, before, source = graph.shortest_paths(np.array([0]))
    assert distance.tolist() == [0, 2, 3]
    assert before.tolist() == [-1, 0, 1]
    assert source.tolist() == [0, 0, 0]
