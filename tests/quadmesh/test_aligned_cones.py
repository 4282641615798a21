"""Cross fields, their singular vertices, the linear model of maps, and the cones found with it."""

import numpy as np
import pytest
import shapes

import coneflat
from coneflat import check_mesh, flatten
from coneflat.geometry import corner_angles, dihedral_angles, edge_lengths
from coneflat.mesh.connectivity import TriangleMesh
from coneflat.quadmesh.aligned_cones import aligned_cones
from coneflat.quadmesh.cross_field import (
    field_indices,
    halfedge_angles,
    preferred_directions,
    sharp_or_boundary,
    smoothest_cross_field,
)
from coneflat.quadmesh.map_model import MapModel

SURFACES = {
    "box": shapes.box(),
    "cylinder": shapes.cylinder(caps=True),
    "torus": shapes.torus(),
    "hill": shapes.hill(),
    "annulus": shapes.annulus(),
    "genus 2": shapes.genus(2),
}


def mesh_of(name):
    return check_mesh(*SURFACES[name]).mesh


@pytest.mark.parametrize("name", SURFACES)
def test_singular_vertices_have_the_total_curvature(name):
    mesh = mesh_of(name)
    indices = field_indices(mesh, smoothest_cross_field(mesh, preferred_directions(mesh)))
    assert indices.sum() == 4 * mesh.euler_characteristic


def test_a_box_has_its_corners():
    mesh = mesh_of("box")
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    corners = np.flatnonzero(((mesh.vertices == low) | (mesh.vertices == high)).all(axis=1))
    indices = field_indices(mesh, smoothest_cross_field(mesh, preferred_directions(mesh)))
    assert (len(corners), np.flatnonzero(indices).tolist()) == (8, corners.tolist())
    assert aligned_cones(mesh, 0.1) == dict.fromkeys(corners.tolist(), 1)


def test_directions_follow_the_axis_of_a_cylinder():
    mesh = check_mesh(*shapes.cylinder(around=40, along=20)).mesh
    curved = preferred_directions(mesh).curved
    first = np.diff(mesh.vertices[mesh.faces[:, 1:]], axis=1)[:, 0]
    across = np.angle(curved) / 4
    # Turned by the cross, the first side of a triangle is along the axis or at a right angle to it.
    slope = np.arcsin(first[:, 2] / np.linalg.norm(first, axis=1))
    off = (slope + across) % (np.pi / 2)
    inside = np.abs(mesh.vertices[mesh.faces][:, :, 2].mean(axis=1) - 1.5) < 1
    assert np.minimum(off, np.pi / 2 - off)[inside].max() < 0.05


def test_short_sharp_edges_are_noise():
    mesh = mesh_of("box")
    sharp = np.flatnonzero(np.abs(dihedral_angles(mesh)) > 1)
    assert set(sharp_or_boundary(mesh, 1.0)) == set(sharp)
    assert len(sharp_or_boundary(mesh, 100.0)) == 0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["box", "torus", "genus 2", "hill"])
def test_the_linear_model_agrees_with_an_exact_map(name):
    """Between two sets of cones that differ a little, log conformal factor and rotation change by nearly the same."""
    mesh = mesh_of(name)
    preferred = preferred_directions(mesh).combined
    start = field_indices(mesh, smoothest_cross_field(mesh, preferred_directions(mesh)))
    triangles = np.bincount(mesh.faces.ravel(), minlength=len(mesh.vertices))
    model = MapModel(mesh, preferred, -2, 1, triangles)
    indices = np.append(start[model.places], 0)
    model.linearise(indices)
    scale, waves, loops = model.state(indices)
    assert 0 < model.spread < 20 * np.linalg.norm(scale)
    assert np.abs(waves.sum()) <= model.weight
    cones = {int(model.places[i]): indices[i] * np.pi / 2 for i in np.flatnonzero(indices)}
    boundary = {"boundary": "straight"} if mesh.is_boundary_edge.any() else {}
    result = flatten(mesh.vertices, mesh.faces, cones=cones, charts="one", relax="off", **boundary)
    uv = result.corner_uv[..., 0] + 1j * result.corner_uv[..., 1]
    frame = halfedge_angles(corner_angles(edge_lengths(mesh.vertices, mesh.faces))).reshape(-1, 3)
    side = (uv[:, [2, 0, 1]] - uv[:, [1, 2, 0]]) * np.exp(-1j * frame)
    crosses = preferred * (side.sum(axis=1) / np.abs(side.sum(axis=1))) ** 4
    if not mesh.genus():
        assert abs(np.abs(crosses.sum()) - np.abs(waves.sum())) < 0.05 * model.weight
    assert len(loops) == 2 * mesh.genus()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["box", "torus", "hill", "genus 2"])
def test_cones_do_not_depend_on_numbering_scale_or_place(name):
    vertices, faces = SURFACES[name]
    shuffled, turned, _ = shapes.renumber(vertices, faces)
    moved = 7.0 * shuffled @ shapes.rotation().T + [1, 2, 3]
    cones, moved_cones = (
        aligned_cones(TriangleMesh(*arrays), 0.2) for arrays in ((vertices, faces), (moved, turned))
    )
    # On symmetric surfaces, equivalent vertices can be exchanged.
    assert sorted(cones.values()) == sorted(moved_cones.values())
    assert sum(cones.values()) == 4 * mesh_of(name).euler_characteristic


@pytest.mark.slow
@pytest.mark.parametrize("distortion", [0.1, 0.2])
def test_sizes_are_as_even_as_asked(distortion):
    mesh = coneflat.quads(*shapes.sphere(4), quads=2000, distortion=distortion)
    p = mesh.vertices[mesh.quads]
    areas = np.linalg.norm(np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]), axis=1)
    assert np.ptp(np.log(np.percentile(areas, [5, 95]))) < 8.5 * distortion


def test_quads_follow_the_sharp_edges_of_a_box():
    mesh = coneflat.quads(*shapes.box(8), quads=1000)
    assert len(mesh.irregular) == 8
    sides = np.sort(mesh.vertices[mesh.edges], axis=1)
    low, high = mesh.surface.vertices.min(axis=0), mesh.surface.vertices.max(axis=0)
    on = [(np.isclose(sides, low) | np.isclose(sides, high)).all(axis=1).sum(axis=1) == 2]
    length = np.linalg.norm(sides[on[0]][:, 0] - sides[on[0]][:, 1], axis=1).sum()
    assert length == pytest.approx(4 * (high - low).sum())


@pytest.mark.slow
def test_fewer_quads_have_fewer_cones():
    counts = [len(coneflat.quads(*shapes.sphere(4), quads=count).irregular) for count in (200, 5000)]
    assert counts[0] <= counts[1]
