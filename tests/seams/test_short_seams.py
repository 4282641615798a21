"""Seams are short, and the same however the mesh is given."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import shapes
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from test_seams import NONE, SURFACES, lengths_of, remove_faces, with_cones

from coneflat import TriangleMesh
from coneflat.mesh import cut_open
from coneflat.seams import find_seams


def distances(mesh, costs):
    """All distances between vertices, those of a boundary loop taken for one place: (n, n)."""
    n = len(mesh.vertices)
    matrix = csr_matrix((costs, mesh.edges.T), shape=(n, n)).tolil()
    count, loop = mesh.boundary_loops
    for i in range(count):
        ring = np.flatnonzero(loop == i)
        matrix[ring[0], ring[1:]] = 1e-12
    return dijkstra(matrix.tocsr(), directed=False)


def least_tree(mesh, cones, costs):
    """The cost of the shortest tree through cones and boundary loops (Dreyfus and Wagner 1971)."""
    away = distances(mesh, costs)
    count, loop = mesh.boundary_loops
    ends = [*cones.tolist(), *(int(np.argmax(loop == i)) for i in range(count))]
    best = {}
    for size in range(1, len(ends)):
        for terminals in itertools.combinations(range(len(ends) - 1), size):
            if size == 1:
                best[terminals] = away[ends[terminals[0]]]
                continue
            met = np.full(len(away), np.inf)
            for k in range(1, size):
                for part in itertools.combinations(terminals, k):
                    met = np.minimum(met, best[part] + best[tuple(i for i in terminals if i not in part)])
            best[terminals] = (met + away).min(axis=1)
    return best[tuple(range(len(ends) - 1))][ends[-1]]


SMALL = {
    "sphere": shapes.sphere(2),
    "disk": shapes.hill(14, 12),
    "annulus": shapes.annulus(20, 6),
    "3 holes": remove_faces(shapes.sphere(2), 3, seed=3),
}


@pytest.mark.parametrize("name", SMALL)
def test_a_tree_of_two_ends_is_the_shortest(name):
    for seed in range(4):
        loops = TriangleMesh(*SMALL[name]).boundary_loops[0]
        mesh, cones = with_cones(SMALL[name], max(2 - loops, 0), seed)
        costs = lengths_of(mesh) * np.random.default_rng(seed).uniform(0.3, 1, len(mesh.edges))
        seams = find_seams(mesh, cones, costs)
        expected = least_tree(mesh, cones, costs)
        assert costs[seams].sum() <= 2 * expected * (1 + 1e-6)
        if loops <= 2:
            assert costs[seams].sum() == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("name", SMALL)
def test_larger_trees_are_nearly_the_shortest(name):
    ratios = []
    for seed in range(8):
        mesh, cones = with_cones(SMALL[name], 4 + seed % 2 - (name == "3 holes"), seed)
        costs = lengths_of(mesh)
        seams = find_seams(mesh, cones, costs)
        ratios.append(costs[seams].sum() / least_tree(mesh, cones, costs))
    assert min(ratios) > 1 - 1e-6
    assert max(ratios) < 2
    assert np.mean(ratios) < 1.1


@pytest.mark.parametrize("name", ["genus 1", "genus 2"])
def test_loops_around_handles_have_no_loose_ends(name):
    mesh = TriangleMesh(*SURFACES[name])
    seams = find_seams(mesh, NONE, lengths_of(mesh))
    assert cut_open(mesh, seams).mesh.components[0] == 1
    assert np.unique(mesh.edges[seams], return_counts=True)[1].min() == 2


def named_pairs(mesh, seams, names):
    return {tuple(sorted(pair)) for pair in names[mesh.edges[seams]].tolist()}


@pytest.mark.parametrize("name", SURFACES)
def test_numbering_position_and_size_do_not_matter(name):
    mesh, chosen = with_cones(SURFACES[name], 7)
    seams = find_seams(mesh, chosen, lengths_of(mesh))
    expected = named_pairs(mesh, seams, np.arange(len(mesh.vertices)))
    for seed, size in ((1, 1e-6), (3, 1e6)):
        vertices, faces, number = shapes.renumber(mesh.vertices, mesh.faces, seed)
        moved = TriangleMesh(size * (vertices @ shapes.rotation(seed).T + [1, 2, 3]), faces)
        moved_seams = find_seams(moved, number[chosen], lengths_of(moved))
        assert named_pairs(moved, moved_seams, np.argsort(number)) == expected


def test_the_same_input_gives_the_same_seams():
    mesh, cones = with_cones(SURFACES["genus 2"], 5)
    first, second = (find_seams(mesh, cones, lengths_of(mesh)) for _ in range(2))
    np.testing.assert_array_equal(first, second)
