"""Quads of symmetric surfaces are symmetric."""

from __future__ import annotations

from dataclasses import replace

import mechanical
import numpy as np
import pytest
import shapes
from scipy.spatial import cKDTree
from stored_meshes import find_model

import coneflat
from coneflat import check_mesh
from coneflat.errors import OptionError
from coneflat.mesh.connectivity import TriangleMesh
from coneflat.quadmesh.extract import extract_quads
from coneflat.quadmesh.mirror_choice import fault, fault_of_angles, on_given_surface
from coneflat.quadmesh.mirror_planes import MirrorPlane, symmetry_planes
from coneflat.quadmesh.mirrored import half_of
from coneflat.quadmesh.remesh import area_of
from coneflat.quadmesh.request import GridRequest


def mirrored_ball(rounds=3, seed=0):
    """Return a closed surface with bumps that is mirrored at x = 0, its larger half by a cut of a bumpy sphere."""
    vertices, faces = shapes.sphere(rounds, bumps=0.25, seed=seed)
    heights = vertices[:, 0]
    # The bumps are those at the image with x > 0.
    radii = np.linalg.norm(vertices, axis=1)
    unit = vertices / radii[:, None]
    tree = cKDTree(unit)
    _, image = tree.query(unit * [-1, 1, 1])
    chosen = np.where(heights >= 0, np.arange(len(unit)), image)
    return unit * radii[chosen][:, None], faces


def spot(tmp_path):
    """Return the half of spot with x > 0, whose vertices are symmetric, and its image: a mesh that is symmetric."""
    mesh = coneflat.read_mesh(find_model("spot.obj", tmp_path))
    half = half_of(check_mesh(mesh.vertices, mesh.triangles).mesh)
    count = len(half.mesh.vertices)
    is_on = half.plane.contains(half.mesh.vertices)
    image = np.where(is_on, np.arange(count), count + np.cumsum(~is_on) - 1)
    vertices = np.concatenate([half.mesh.vertices, half.plane.reflected(half.mesh.vertices[~is_on])])
    return vertices, np.concatenate([half.mesh.faces, image[half.mesh.faces[:, [0, 2, 1]]]])


def image_gaps(mesh, plane):
    """Return the distances of the mirror images of the vertices of quads from vertices."""
    return cKDTree(mesh.vertices).query(plane.reflected(mesh.vertices))[0]


def check_symmetric(mesh, plane):
    """Quads are mirror images, and a mesh of their surface, whose vertices are on it and not duplicated."""
    assert f"The quads are symmetric about {plane}." in mesh.notes
    gaps, images = cKDTree(mesh.vertices).query(plane.reflected(mesh.vertices))
    assert gaps.max() <= 1e-12 * plane.size
    assert (images[images] == np.arange(len(images))).all()
    assert len(np.unique(np.round(mesh.vertices / plane.size, 9), axis=0)) == len(mesh.vertices)
    quads = {tuple(sorted(quad)) for quad in mesh.quads.tolist()}
    assert {tuple(sorted(quad)) for quad in images[mesh.quads].tolist()} == quads
    assert mesh.euler_characteristic == mesh.surface_euler
    corners = mesh.surface.vertices[mesh.surface.faces[mesh.faces]]
    places = np.einsum("qi,qix->qx", mesh.barycentric, corners)
    np.testing.assert_allclose(places, mesh.vertices, atol=1e-9 * plane.size)


def plate_with_a_hole(side=1.0):
    """Return a flat plate: two triangles on the left, and on the right, for side 1, triangles around a hole."""
    turns = 2 * np.pi * np.arange(16) / 16
    circle = np.stack([1.25 + 0.3 * np.cos(turns), 0.4 + 0.3 * np.sin(turns)], axis=1)
    corners = np.array([(0.0, -1.0), (2.0, -1.0), (2.0, 1.0), (0.0, 1.0)])
    turns_of_corners = np.arctan2(corners[:, 1] - 0.4, corners[:, 0] - 1.25) % (2 * np.pi)
    events = sorted([(turn, 6 + i) for i, turn in enumerate(turns)])
    events = sorted(events + [(turn, 2 + i) for i, turn in enumerate(turns_of_corners)])
    outer = max((turn, 2 + i) for i, turn in enumerate(turns_of_corners))[1]
    inner, faces = 21, [(0, 2, 5), (0, 5, 1)]
    for _, vertex in events:
        faces.append((outer, vertex, inner))
        outer, inner = (outer, vertex) if vertex >= 6 else (vertex, inner)
    points = np.concatenate([[(-2.0, -1.0), (-2.0, 1.0)], corners, circle])
    vertices = np.stack([side * points[:, 0], points[:, 1], np.zeros(len(points))], axis=1)
    return vertices, np.array(faces)[:, :: int(side)]


def overlapping_ellipsoids():
    """Return two ellipsoids that overlap at x = 0, of which each is the image of the other."""
    vertices, faces = shapes.sphere(3, bumps=0)
    vertices = vertices * [1.0, 0.6, 0.4] @ motion(5)[0].T + [0.3, 0.0, 0.0]
    count = len(vertices)
    return np.concatenate([vertices, vertices * [-1, 1, 1]]), np.concatenate([faces, faces[:, ::-1] + count])


def motion(seed):
    """Return a rotation and a translation."""
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return turn * np.sign(np.linalg.det(turn)), rng.normal(size=3)


@pytest.mark.parametrize("count", [400, 2000])
def test_spot_is_symmetric(tmp_path, count):
    vertices, faces = spot(tmp_path)
    mesh = coneflat.quads(vertices, faces, quads=count)
    (plane,) = symmetry_planes(TriangleMesh(vertices, faces))
    assert str(plane) == "the plane across (1, 0, 0) at 0"
    check_symmetric(mesh, plane)
    assert 0.8 < len(mesh.quads) / count < 1.5
    without = coneflat.quads(vertices, faces, quads=count, symmetry="none")
    assert len(mesh.irregular) <= 1.1 * len(without.irregular)
    assert image_gaps(without, plane).max() > 1e-3
    # UVs and the grid are those of the quads.
    assert mesh.uv.shape == (len(mesh.quads), 4, 2)
    assert len(extract_quads(mesh.grid).quads) == len(mesh.quads)
    assert (mesh.valences[mesh.irregular] != 2).all()


def test_a_moved_and_renumbered_surface():
    vertices, faces = mirrored_ball()
    turn, shift = motion(1)
    order = np.random.default_rng(2).permutation(len(vertices))
    number = np.argsort(order)
    first = coneflat.quads(vertices, faces, quads=600)
    check_symmetric(first, next(symmetry_planes(TriangleMesh(vertices, faces))))
    moved = 100 * (vertices @ turn.T + shift)
    (plane,) = symmetry_planes(TriangleMesh(moved[order], number[faces]))
    second = coneflat.quads(moved[order], number[faces], quads=600)
    check_symmetric(second, plane)
    assert len(first.quads) == len(second.quads)
    places = 100 * (first.vertices @ turn.T + shift)
    assert cKDTree(places).query(second.vertices)[0].max() < 1e-3


@pytest.mark.parametrize("name", ["bracket", "wedge"])
def test_mechanical_shapes_whose_triangles_are_not_symmetric(name):
    vertices, faces = mechanical.SHAPES[name]()
    mesh = coneflat.quads(vertices, faces, quads=1500)
    planes = list(symmetry_planes(check_mesh(vertices, faces).mesh))
    check_symmetric(mesh, planes[0].scaled(-check_mesh(vertices, faces).exponent))
    # They are quads of the given surface, not of a half and its image.
    np.testing.assert_array_equal(mesh.surface.faces, faces)
    np.testing.assert_allclose(mesh.surface.vertices, vertices, rtol=1e-15)


def test_an_open_surface_with_sizes():
    """A bumpy sheet, symmetric about x = 0.5."""
    vertices, faces = shapes.grid(30, 30, lambda x, y: 0.4 * np.sin(3 * y) * x * (1 - x))
    mesh = coneflat.quads(vertices, faces, quads=300, size=None)
    curved = coneflat.quads(vertices, faces, size="curvature")
    for quad_mesh in (mesh, curved):
        assert image_gaps(quad_mesh, MirrorPlane(np.array([1.0, 0, 0]), 0.5, 1.0)).max() < 1e-6


def test_vertices_on_the_plane_have_an_even_valence(tmp_path):
    vertices, faces = spot(tmp_path)
    mesh = coneflat.quads(vertices, faces, quads=1000)
    (plane,) = symmetry_planes(TriangleMesh(vertices, faces))
    on_plane = plane.contains(mesh.vertices)
    assert on_plane.sum() > 20
    assert set(mesh.valences[on_plane]) <= {4, 6}


def test_the_grid_is_symmetric(tmp_path):
    vertices, faces = mirrored_ball()
    (plane,) = symmetry_planes(TriangleMesh(vertices, faces))
    grid = coneflat.integer_grid(vertices, faces, quads=500)
    assert f"The grid is symmetric about {plane}." in grid.notes
    cones = grid.vertices[grid.cones]
    assert cKDTree(cones).query(plane.reflected(cones))[0].max() < 1e-9
    path = grid.save(tmp_path / "grid.npz")
    again = coneflat.IntegerGrid.load(path)
    np.testing.assert_array_equal(again.quarters, grid.quarters)
    assert image_gaps(extract_quads(again), plane).max() < 1e-6


class TestPlanes:
    def test_a_cube_has_nine(self):
        vertices, faces = shapes.box(4, (1.0, 1.0, 1.0))
        planes = list(symmetry_planes(TriangleMesh(vertices, faces)))
        assert len(planes) == 9
        turn, shift = motion(3)
        planes = list(symmetry_planes(TriangleMesh(vertices @ turn.T + shift, faces)))
        assert len(planes) == 9

    def test_an_icosahedron_has_fifteen(self):
        vertices, faces = shapes.sphere(1, bumps=0)
        turn, shift = motion(4)
        assert len(list(symmetry_planes(TriangleMesh(vertices @ turn.T + shift, faces)))) == 15

    def test_noise_far_above_rounding_leaves_none(self):
        vertices, faces = mirrored_ball()
        noise = np.random.default_rng(0).normal(size=vertices.shape)
        assert len(list(symmetry_planes(TriangleMesh(vertices + 1e-9 * noise, faces)))) == 1
        assert not list(symmetry_planes(TriangleMesh(vertices + 1e-4 * noise, faces)))

    def test_a_bumpy_sphere_has_none(self):
        assert not list(symmetry_planes(TriangleMesh(*shapes.sphere(3))))

    @pytest.mark.parametrize("side", [1.0, -1.0])
    def test_a_hole_on_one_side_leaves_none(self, side):
        mesh = TriangleMesh(*plate_with_a_hole(side))
        assert mesh.euler_characteristic == 0
        assert all(abs(plane.normal[2]) > 0.9 for plane in symmetry_planes(mesh))
        assert half_of(mesh) is None

    def test_a_missing_triangle_of_a_box_leaves_none(self):
        vertices, faces = shapes.box(1, (1.0, 1.3, 1.7))
        for face in range(len(faces)):
            assert not list(symmetry_planes(TriangleMesh(vertices, np.delete(faces, face, 0))))

    def test_overlapping_parts_that_are_images_of_each_other_have_no_half(self):
        mesh = TriangleMesh(*overlapping_ellipsoids())
        assert any(abs(plane.normal[0]) > 1 - 1e-9 for plane in symmetry_planes(mesh))
        assert half_of(mesh) is None

    def test_a_flat_sheet_is_not_divided_by_its_plane(self):
        vertices, faces = shapes.grid(7, 5)
        half = half_of(TriangleMesh(vertices * [2.0, 1.0, 1.0], faces))
        assert half is not None
        assert abs(half.plane.normal[2]) < 1e-9
        assert half.length == pytest.approx(1.0)  # the shorter of the two cuts

    def test_triangles_that_cross_the_plane_are_cut(self):
        vertices, faces = shapes.grid(5, 4)  # five columns: the plane x = 0.5 is inside the third
        half = half_of(TriangleMesh(vertices * [2.0, 1.0, 1.0], faces))
        assert area_of(half.mesh) == pytest.approx(1.0)
        assert half.mesh.euler_characteristic == 1


def test_worse_quads_are_not_symmetric():
    """Corridors of a box with windows: the only plane is a diagonal one."""
    vertices, faces = mechanical.NARROW_SHAPES["pierced_shell"]()
    mesh = coneflat.quads(vertices, faces, quads=3000)
    without = coneflat.quads(vertices, faces, quads=3000, symmetry="none")
    np.testing.assert_array_equal(mesh.vertices, without.vertices)
    (note,) = set(mesh.notes) - set(without.notes)
    assert note.startswith("The quads are not symmetric about the plane across (0.707, -0.707, 0) at")
    assert "irregular vertices instead of" in note


def test_a_note_on_the_number_of_squares_is_about_the_whole():
    vertices, faces = mirrored_ball()
    grid = coneflat.integer_grid(vertices, faces, quads=40)
    assert any(note.startswith("The grid is symmetric") for note in grid.notes)
    assert f"The grid has an area of {grid.squares:,.0f} squares, not 40." in grid.notes


def test_progress_of_both_searches_rises():
    fractions = []
    mesh = coneflat.quads(
        *mirrored_ball(), quads=300, progress=lambda _, fraction: fractions.append(fraction)
    )
    assert any(note.startswith("The quads are symmetric") for note in mesh.notes)
    assert fractions == sorted(fractions)
    assert fractions[0] == 0
    assert fractions[-1] == 1
    assert sum(0.5 < fraction < 1 for fraction in fractions) > 2


class TestChoice:
    @pytest.fixture
    def ball(self):
        mesh = mirrored_ball()
        options = {"quads": 300, "symmetry": "none"}
        return coneflat.quads(*mesh, **options), GridRequest.of(*mesh, options, {})

    def test_quads_are_not_worse_than_themselves(self, ball):
        quads, request = ball
        assert not fault(quads, quads, request)
        assert not fault_of_angles(quads, quads)

    def test_inverted_quads_are_worse(self, ball):
        quads, _ = ball
        vertices = quads.vertices.copy()
        first, second = quads.quads[0, [0, 2]]
        vertices[[first, second]] = vertices[[second, first]]
        assert "180 degrees or more instead of 0" in fault_of_angles(replace(quads, vertices=vertices), quads)

    def test_worse_angles_are_worse(self, ball):
        quads, _ = ball
        sheared = replace(quads, vertices=quads.vertices @ [[1, 0.2, 0], [0, 1, 0], [0, 0, 1]])
        assert "degrees on average instead of" in fault_of_angles(sheared, quads)
        vertices, quad = quads.vertices.copy(), quads.quads[0]
        vertices[quad[0]] += 0.35 * (vertices[quad[2]] - vertices[quad[0]])
        assert "an angle would be off by" in fault_of_angles(replace(quads, vertices=vertices), quads)

    def test_a_filled_hole_is_worse(self, ball):
        quads, request = ball
        first = np.arange(len(quads.quads)) == 0
        assert "holes or components" in fault(quads.without(first), quads, request)

    def test_quads_of_the_given_surface_stay_in_place(self, ball):
        quads, _ = ball
        mesh = quads.surface
        moved = replace(quads, vertices=1.001 * quads.vertices)
        restored = on_given_surface(moved, mesh)
        np.testing.assert_array_equal(restored.vertices, moved.vertices)
        places = np.einsum("qi,qix->qx", restored.barycentric, mesh.vertices[mesh.faces[restored.faces]])
        assert np.linalg.norm(places - moved.vertices, axis=1).max() < 0.002


def test_unknown_words_are_refused():
    with pytest.raises(OptionError, match="unknown symmetry 'both': choose from auto, none"):
        coneflat.quads(*shapes.grid(3, 3), quads=9, symmetry="both")
