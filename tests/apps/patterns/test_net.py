from __future__ import annotations

import numpy as np
import pytest
from polyhedra import (
    box_on_box,
    cube,
    dodecahedron,
    hull,
    icosahedron,
    octahedron,
    prism,
    tetrahedron,
)
from shapes import box, cylinder, grid, join, renumber, rotation, sphere
from stored_meshes import at_hand

import coneflat
from coneflat import TriangleMesh, check_mesh
from coneflat.apps.patterns.net.net import unfold_net
from coneflat.apps.patterns.net.polyhedron import Polyhedron
from coneflat.errors import MeshError
from coneflat.geometry import coarse_mesh, find_overlaps, signed_double_areas

# Angles between the normals of adjacent faces, and numbers of faces.
REGULAR = {
    tetrahedron: (np.pi - np.arccos(1 / 3), 4),
    cube: (np.pi / 2, 6),
    octahedron: (np.arccos(1 / 3), 8),
    dodecahedron: (np.arccos(1 / 5**0.5), 12),
    icosahedron: (np.arccos(5**0.5 / 3), 20),
}
CONVEX = [make() for make in REGULAR] + [prism(sides) for sides in (3, 5, 6, 12)]


def checked(mesh: TriangleMesh, pieces: int = 1):
    """Unfold a mesh; return its net, of which all laws hold."""
    net = unfold_net(mesh)
    surface = net.surface
    assert surface.pieces.max() + 1 == pieces
    assert np.abs(surface.edges.strains(surface.points)).max() < 1e-9
    apart = 3 * np.ptp(surface.points, axis=0).max() * np.arange(pieces)
    places = surface.places + np.stack([apart, 0 * apart], axis=1)[surface.pieces][:, None]
    assert find_overlaps(places).area < 1e-12 * np.prod(np.ptp(surface.points, axis=0))
    assert (signed_double_areas(places) > 0).all()
    return net


@pytest.mark.parametrize("mesh", CONVEX, ids=lambda mesh: f"{len(mesh.vertices)} corners")
def test_convex_polyhedra_unfold_to_one_piece_without_a_cut_through_a_face(mesh):
    net = checked(mesh)
    faces = Polyhedron.of(mesh)
    # A tree of faces.
    assert len(net.folds) == faces.face.max()
    cut = faces.face[mesh.edge_faces[net.surface.seams]]
    assert (cut[:, 0] != cut[:, 1]).all()
    # The cut edges form a tree of all corners.
    assert len(net.surface.seams) == len(mesh.vertices) - 1


@pytest.mark.parametrize("make", REGULAR, ids=lambda make: make.__name__)
def test_folds_have_the_dihedral_angle_of_regular_polyhedra(make):
    angle, faces = REGULAR[make]
    net = checked(make())
    assert len(net.folds) == faces - 1
    np.testing.assert_allclose(net.fold_angles, angle, atol=1e-12)


def test_folds_have_the_length_of_their_edges_and_valleys_are_negative():
    mesh = check_mesh(*grid(2, 1, height=lambda x, y: np.abs(x - 0.5))).mesh
    up, down = unfold_net(mesh), unfold_net(TriangleMesh(mesh.vertices, mesh.faces[:, ::-1].copy()))
    (fold,), (angle,) = up.folds, up.fold_angles
    assert np.linalg.norm(np.diff(up.surface.points[fold], axis=0)) == pytest.approx(1)
    assert abs(angle) == pytest.approx(np.pi / 2)
    np.testing.assert_allclose(down.fold_angles, -up.fold_angles)
    assert all((unfold_net(solid).fold_angles > 0).all() for solid in CONVEX)


def test_triangles_of_a_face_are_not_cut_apart():
    fine, coarse = checked(check_mesh(*box(5)).mesh), checked(check_mesh(*box(1)).mesh)
    assert fine.surface.seam_length == pytest.approx(coarse.surface.seam_length)
    assert len(fine.folds) == 5 * len(coarse.folds)


def test_a_ring_around_a_tower_needs_a_second_piece():
    """The walls of the tower do not fit into the hole of the ring (Biedl et al., 1998)."""
    checked(box_on_box(2.5), pieces=2)


def test_surfaces_with_a_border_and_several_components():
    checked(check_mesh(*cylinder(12, 4)).mesh)
    two = join((cube().vertices, cube().faces), (dodecahedron().vertices + 9, dodecahedron().faces))
    checked(check_mesh(*two).mesh, pieces=2)
    checked(check_mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]).mesh)


def rough(seed: int = 3) -> TriangleMesh:
    """A polyhedron of random corners without symmetry, with some pushed inward."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(60, 3))
    mesh = hull(points / np.linalg.norm(points, axis=1, keepdims=True))
    return mesh.moved_to(mesh.vertices * rng.uniform(0.6, 1.2, (60, 1)))


def test_nets_do_not_depend_on_numbers_motion_or_scale():
    mesh = rough()
    lengths = checked(mesh).surface.seam_length
    vertices, faces, _ = renumber(mesh.vertices, mesh.faces)
    assert checked(check_mesh(vertices, faces).mesh).surface.seam_length == pytest.approx(lengths)
    turned = mesh.moved_to(mesh.vertices @ rotation().T + 5)
    assert checked(turned).surface.seam_length == pytest.approx(lengths)
    for scale in (1e-6, 1e6):
        scaled = checked(mesh.moved_to(scale * mesh.vertices))
        assert scaled.surface.seam_length == pytest.approx(scale * lengths)


def test_far_from_the_origin():
    mesh = dodecahedron()
    checked(mesh.moved_to(mesh.vertices + 1e4))


def test_edges_of_divided_faces_remain_joined_despite_the_rounding_of_coordinates():
    """Coordinates of single precision, as in STL files: the parts of an edge are not quite on a line."""
    vertices, faces = box(5)
    rounded = (vertices @ rotation().T).astype(np.float32).astype(float)
    surface = unfold_net(check_mesh(rounded, faces).mesh).surface
    assert surface.pieces.max() == 0
    assert surface.seam_length == pytest.approx(unfold_net(check_mesh(*box(5)).mesh).surface.seam_length)
    assert np.abs(surface.edges.strains(surface.points)).max() < 1e-5


def test_a_model_of_many_facets_is_one_piece():
    model = coneflat.read_mesh(coneflat.sample_path())
    mesh = coarse_mesh(check_mesh(model.vertices, model.triangles).mesh, 600).mesh
    net = checked(mesh)
    assert net.fold_angles.min() < 0 < net.fold_angles.max()


@pytest.mark.parametrize("name", at_hand("knight.off"))
def test_a_shared_model_is_one_piece(name, shared):
    model = coneflat.read_mesh(shared(name))
    checked(check_mesh(model.vertices, model.triangles).mesh)


def test_a_net_that_nobody_can_fold_is_refused():
    with pytest.raises(MeshError, match=r"net of 20,4\d\d plane faces.*simplify the mesh"):
        coneflat.pattern(*sphere(5), height=100, kind="net")
