"""Seams are short, straight, and the same however the mesh is given."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import shapes
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra
from test_seams import NONE, SURFACES, lengths_of, remove_faces, with_cones

from coneflat import TriangleMesh, cut_open, find_seams
from coneflat.seams import find
from coneflat.seams.cut import open_along


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
        for some in itertools.combinations(range(len(ends) - 1), size):
            if size == 1:
                best[some] = away[ends[some[0]]]
                continue
            met = np.full(len(away), np.inf)
            for k in range(1, size):
                for part in itertools.combinations(some, k):
                    met = np.minimum(met, best[part] + best[tuple(i for i in some if i not in part)])
            best[some] = (met + away).min(axis=1)
    return best[tuple(range(len(ends) - 1))][ends[-1]]


SMALL = {
    "sphere": shapes.sphere(2),
    "disk": shapes.hill(14, 12),
    "annulus": shapes.annulus(20, 6),
    "3 holes": remove_faces(shapes.sphere(2), 3, seed=3),
}


@pytest.mark.parametrize("name", SMALL)
def test_trees_of_two_or_three_ends_are_the_shortest(name):
    for seed in range(8):
        mesh, _ = with_cones(SMALL[name], 0)
        loops = mesh.boundary_loops[0]
        for ends in (2, 3):
            mesh, cones = with_cones(SMALL[name], max(ends - loops, 0), seed)
            costs = lengths_of(mesh) * np.random.default_rng(seed).uniform(0.3, 1, len(mesh.edges))
            seams = find_seams(mesh, cones, costs, bending=0)
            assert costs[seams].sum() == pytest.approx(least_tree(mesh, cones, costs), rel=1e-6)


@pytest.mark.parametrize("name", SMALL)
def test_larger_trees_are_nearly_the_shortest(name):
    ratios = []
    for seed in range(16):
        mesh, cones = with_cones(SMALL[name], 4 + seed % 2 - (name == "3 holes"), seed)
        costs = lengths_of(mesh)
        seams = find_seams(mesh, cones, costs, bending=0)
        ratios.append(costs[seams].sum() / least_tree(mesh, cones, costs))
    assert min(ratios) > 1 - 1e-6
    assert np.median(ratios) < 1 + 1e-6
    assert np.mean(ratios) < 1.005


@pytest.mark.parametrize("name", SURFACES)
def test_the_search_never_makes_seams_longer_and_often_shorter(name, monkeypatch):
    gains = []
    for seed in range(6):
        mesh, cones = with_cones(SURFACES[name], 8, seed)
        costs = lengths_of(mesh)
        seams = find_seams(mesh, cones, costs, bending=0)
        with monkeypatch.context() as patched:
            patched.setattr(find, "shorten", lambda *_: None)
            first = find_seams(mesh, cones, costs, bending=0)
        gains.append(1 - costs[seams].sum() / costs[first].sum())
    assert min(gains) > -1e-6
    assert max(gains) > 0.005


def test_searches_end_after_a_given_effort(monkeypatch):
    mesh, cones = with_cones(shapes.sphere(4), 200)
    costs = lengths_of(mesh)
    totals = []
    for spare in (0, 20_000, 10**9):
        monkeypatch.setattr(find, "SHORTEN", 0)
        monkeypatch.setattr(find, "STRAIGHTEN", 0)
        monkeypatch.setattr(find, "SPARE", spare)
        seams = find_seams(mesh, cones, costs)
        assert cut_open(mesh, seams).pieces == 1
        totals.append(costs[seams].sum())
    assert totals[0] > 1.002 * totals[1] > 1.002**2 * totals[2]


@pytest.mark.parametrize("name", ["genus 1", "genus 2", "genus 3"])
def test_loops_around_handles_cannot_be_exchanged_one_by_one(name):
    """Independently of the search: between the two borders that gluing one seam makes there is no shorter way."""
    mesh = TriangleMesh(*SURFACES[name])
    costs = lengths_of(mesh)
    seams = find_seams(mesh, NONE, costs, bending=0)
    ends, degree = np.unique(mesh.edges[seams], return_counts=True)
    assert degree.min() == 2  # all are parts of loops
    forks = ends[degree > 2]
    for path in key_paths(mesh.edges[seams], forks):
        edges = seams[path]
        opened = open_along(mesh, np.setdiff1d(seams, edges))
        assert opened.mesh.boundary_loops[0] == 2
        least = least_tree(opened.mesh, NONE, lengths_of(opened.mesh))
        assert costs[edges].sum() == pytest.approx(least, rel=1e-6)


def key_paths(edges, forks):
    """The rows of edges that make up each path between forks."""
    rows = csr_matrix((np.ones(2 * len(edges)), (np.repeat(np.arange(len(edges)), 2), edges.ravel())))
    inner = np.ones(rows.shape[1], dtype=bool)
    inner[forks] = False
    count, label = connected_components(rows[:, inner] @ rows[:, inner].T, directed=False)
    return [np.flatnonzero(label == i) for i in range(count)]


def staggered_cylinder(around=40, rows=30):
    """A cylinder of equilateral triangles, none of whose sides run along it."""
    i, j = np.meshgrid(np.arange(around), np.arange(rows + 1), indexing="ij")
    angle, side = 2 * np.pi * (i + (j % 2) / 2) / around, 2 * np.sin(np.pi / around)
    points = np.stack([np.cos(angle), np.sin(angle), j * side * 0.75**0.5], axis=-1).reshape(-1, 3)
    at = lambda di, dj: ((i + di) % around * (rows + 1) + j + dj)[:, :-1]  # noqa: E731
    odd = j[:, :-1] % 2 == 1
    low, high = np.where(odd, at(1, 1), at(0, 1)), np.where(odd, at(0, 1), at(1, 1))
    one = np.stack([at(0, 0), at(1, 0), low], axis=-1)
    two = np.stack(
        [np.where(odd, at(0, 0), at(1, 0)), np.where(odd, low, high), np.where(odd, high, low)], axis=-1
    )
    return points, np.concatenate([one.reshape(-1, 3), two.reshape(-1, 3)])


class TestStraight:
    def test_a_cylinder_opens_along_one_line_of_its_grid(self):
        for noise in (0.0, 0.02, 0.1):
            points, faces = shapes.grid(30, 40, wrap=(True, False))
            angle = 2 * np.pi * points[:, 0]
            vertices = np.stack([np.cos(angle), np.sin(angle), 3 * points[:, 1]], axis=1)
            vertices += noise / 15 * np.random.default_rng(0).normal(size=vertices.shape)
            mesh = TriangleMesh(vertices, faces)
            seams = find_seams(mesh, NONE, lengths_of(mesh))
            assert len(seams) == 40
            assert len(np.unique(mesh.edges[seams] // 41)) == 1

    def test_of_zigzags_and_a_line_of_one_length_the_line_is_taken(self):
        mesh = TriangleMesh(*staggered_cylinder())
        assert mesh.euler_characteristic == 0
        turns = {}
        for bending in (0.0, 0.05):
            seams = find_seams(mesh, NONE, lengths_of(mesh), bending=bending)
            on_seam = np.unique(mesh.edges[seams])
            on_seam = on_seam[np.argsort(mesh.vertices[on_seam, 2])]
            assert len(on_seam) == 31
            angle = np.unwrap(np.arctan2(mesh.vertices[on_seam, 1], mesh.vertices[on_seam, 0]))
            turns[bending] = np.count_nonzero(np.diff(np.sign(np.diff(angle))))
        assert turns[0.05] == 0 < turns[0.0]

    @pytest.mark.parametrize("name", SURFACES)
    def test_what_is_gained_in_straightness_costs_little_length(self, name):
        mesh, cones = with_cones(SURFACES[name], 6, seed=1)
        costs = lengths_of(mesh)
        plain, straight = (find_seams(mesh, cones, costs, bending=bending) for bending in (0.0, 0.1))
        assert costs[straight].sum() <= costs[plain].sum() * 1.2
        assert cut_open(mesh, straight).pieces == 1


def named_pairs(mesh, seams, names):
    return {tuple(sorted(pair)) for pair in names[mesh.edges[seams]].tolist()}


@pytest.mark.parametrize("name", SURFACES)
@pytest.mark.parametrize("cones", [2, 7])
def test_neither_numbers_nor_place_nor_size_matter(name, cones):
    mesh, chosen = with_cones(SURFACES[name], cones)
    seams = find_seams(mesh, chosen, lengths_of(mesh))
    expected = named_pairs(mesh, seams, np.arange(len(mesh.vertices)))
    for seed, size in ((1, 1e-6), (2, 1.0), (3, 1e6)):
        vertices, faces, new = shapes.renumber(mesh.vertices, mesh.faces, seed)
        other = TriangleMesh(size * (vertices @ shapes.rotation(seed).T + [1, 2, 3]), faces)
        found = find_seams(other, new[chosen], lengths_of(other))
        assert named_pairs(other, found, np.argsort(new)) == expected


def test_the_same_input_gives_the_same_seams():
    mesh, cones = with_cones(SURFACES["genus 2"], 5)
    one, two = (find_seams(mesh, cones, lengths_of(mesh)) for _ in range(2))
    np.testing.assert_array_equal(one, two)
