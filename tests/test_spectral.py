"""Spectral conformal maps: the eigenvector against dense algebra, invariance, refusals."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from scipy.sparse.linalg import ArpackNoConvergence
from shapes import cut_disk, lengths_of

from coneflat import TriangleMesh, edge_lengths, errors, flatten
from coneflat.flat import disk_maps as spectral
from coneflat.flat.disk_maps import conformal_equations, spectral_conformal


def energy(disk, points):
    """Return the conformal energy over the spread of the boundary: the quotient of the eigenproblem."""
    z = points @ [1, 1j]
    border = z[disk.is_boundary_vertex]
    spread = np.linalg.norm(border - border.mean()) ** 2
    return np.linalg.norm(conformal_equations(disk, lengths_of(disk)) @ z) ** 2 / spread


def dense_eigenvectors(disk):
    """Return all eigenvalues of L_C u = lambda B u, ascending, and the eigenvectors on the boundary."""
    equations = conformal_equations(disk, lengths_of(disk)).toarray()
    matrix = equations.conj().T @ equations
    on, off = np.flatnonzero(disk.is_boundary_vertex), np.flatnonzero(~disk.is_boundary_vertex)
    inner = matrix[np.ix_(on, off)] @ np.linalg.solve(matrix[np.ix_(off, off)], matrix[np.ix_(off, on)])
    return np.linalg.eigh(matrix[np.ix_(on, on)] - inner)


@pytest.mark.parametrize("shape", [shapes.hill(), shapes.sphere(2), shapes.annulus(), shapes.torus(20, 10)])
def test_is_the_second_eigenvector(shape):
    disk = cut_disk(*shape, cones=(5, 40, 111))
    values, vectors = dense_eigenvectors(disk)
    assert values[0] < 1e-10 < values[1]  # the constants
    points = spectral_conformal(disk, lengths_of(disk))
    np.testing.assert_allclose(energy(disk, points), values[1], rtol=1e-8)
    border = points[disk.is_boundary_vertex]
    reference = np.stack([vectors[:, 1].real, vectors[:, 1].imag], axis=1)
    assert shapes.similar(border, reference) < 1e-8


def test_has_less_energy_than_any_pinned_map():
    from coneflat.flat.disk_maps import least_squares_conformal

    disk = cut_disk(*shapes.sphere(3), cones=(3, 77, 300))
    least = energy(disk, spectral_conformal(disk, lengths_of(disk)))
    rng = np.random.default_rng(0)
    for _ in range(5):
        pins = rng.choice(len(disk.vertices), 2, replace=False)
        assert least < energy(disk, least_squares_conformal(disk, lengths_of(disk), pins))


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_flat_mesh_comes_back(scale):
    vertices, faces = shapes.grid(9, 5)
    points = spectral_conformal(TriangleMesh(vertices * scale, faces), edge_lengths(vertices * scale, faces))
    assert shapes.similar(points, vertices[:, :2]) < 1e-10


def test_slivers_do_not_hurt():
    vertices, faces = shapes.grid(30, 30)
    vertices[:, 1] *= 1e-3
    points = spectral_conformal(TriangleMesh(vertices, faces), edge_lengths(vertices, faces))
    assert shapes.similar(points, vertices[:, :2]) < 1e-8


def test_one_triangle():
    disk = TriangleMesh(np.array([[0.0, 0, 0], [1, 0, 0], [0.3, 0.8, 0]]), np.array([[0, 1, 2]]))
    points = spectral_conformal(disk, lengths_of(disk))
    assert shapes.similar(points, disk.vertices[:, :2]) < 1e-12


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("shape", [shapes.hill(), shapes.sphere(3), shapes.genus(2)])
def test_renumbering(shape, seed):
    disk = cut_disk(*shape, cones=(3, 77, 101))
    vertices, faces, new = shapes.renumber(disk.vertices, disk.faces, seed)
    points = spectral_conformal(disk, lengths_of(disk))
    again = spectral_conformal(TriangleMesh(vertices, faces), edge_lengths(vertices, faces))[new]
    assert shapes.similar(again, points) < 1e-8 * np.ptp(points)


def test_renumbering_of_a_closed_mesh():
    vertices, faces = shapes.sphere(3)
    shuffled, turned, new = shapes.renumber(vertices, faces)
    cones = {0: 1.2 * np.pi, 200: 1.5 * np.pi, 400: 1.3 * np.pi}
    plain = flatten(vertices, faces, cones=cones, method="spectral")
    other = flatten(shuffled, turned, cones={new[v]: k for v, k in cones.items()}, method="spectral")
    np.testing.assert_allclose(other.log_scale[new], plain.log_scale, atol=1e-8)
    np.testing.assert_allclose(other.curvature_residual[new], plain.curvature_residual, atol=1e-8)


def test_walk_around_the_boundary():
    disk = cut_disk(*shapes.sphere(2), cones=(5, 40, 111))
    border = disk.boundary_walk()
    assert len(border) == disk.is_boundary_edge.sum() == len(np.unique(border))
    np.testing.assert_array_equal(disk.heads[border], np.roll(disk.tails[border], -1))


def test_no_convergence_is_refused(monkeypatch):
    def gives_up(*args, **keywords):
        raise ArpackNoConvergence("no convergence", np.empty(0), np.empty((0, 0)))

    monkeypatch.setattr(spectral, "eigsh", gives_up)
    disk = cut_disk(*shapes.torus(), cones=(3, 77, 300))
    with pytest.raises(errors.ConvergenceError, match="1,600 triangles was not found in 300 restarts"):
        spectral_conformal(disk, lengths_of(disk))
