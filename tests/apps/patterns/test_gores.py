from __future__ import annotations

import numpy as np
import pytest
import shapely
from polyhedra import cube, icosphere, turned, uv_sphere
from shapes import renumber, rotation, torus

import coneflat
from coneflat import check_mesh
from coneflat.apps.patterns.drawing.shapes import tails
from coneflat.apps.patterns.gores.gores import cut_gores
from coneflat.apps.patterns.pieces.borders import find_borders
from coneflat.errors import MeshError
from coneflat.geometry import surface_distances

UP = np.array([0.0, 0.0, 1.0])
HEIGHTS = np.linspace(0, 2, 25)
VASE = turned(0.6 + 0.3 * np.sin(2.5 * HEIGHTS), HEIGHTS)
SHADE = turned(np.linspace(1.0, 0.4, 7), np.linspace(0, 1, 7))
BOWL = turned(np.sin(np.linspace(0, np.pi / 2, 9)), 1 - np.cos(np.linspace(0, np.pi / 2, 9)))


def largest_difference(surface) -> float:
    """The largest distance of a point of a strip from that of the first strip, at the same place."""
    strips = []
    for piece in range(surface.pieces.max() + 1):
        points = surface.points[np.unique(surface.corners[surface.pieces == piece])]
        strips.append(points[np.lexsort(np.round(points, 6).T)])
    return max(np.abs(strip - strips[0]).max() for strip in strips)


@pytest.mark.parametrize(
    ("mesh", "count"),
    [
        (uv_sphere(), 12),
        (uv_sphere(), 6),
        (uv_sphere(), 4),
        (icosphere(2), 2),
        (VASE, 8),
        (SHADE, 6),
        (BOWL, 8),
    ],
    ids=lambda value: f"{len(value.faces)} triangles" if hasattr(value, "faces") else str(value),
)
def test_gores_of_a_symmetric_body_are_congruent(mesh, count):
    mesh = mesh.moved_to(100 * mesh.vertices)
    surface = cut_gores(mesh, count, UP).surface
    assert surface.pieces.max() + 1 == count
    assert largest_difference(surface) < 1e-6
    assert not len(surface.overlaps())
    lengths = np.linalg.norm(surface.edges.vectors(surface.points), axis=1)
    first, second = surface.edges.partners.T
    assert np.abs(lengths[first] / lengths[second] - 1).max() < 1e-9


@pytest.mark.parametrize("count", [2, 7, 12])
def test_triangles_are_divided_exactly_where_half_planes_cross_them(count):
    mesh = icosphere(2)
    surface = cut_gores(mesh, count, UP).surface
    divided = surface.mesh
    x, y = divided.vertices[np.unique(divided.edges[surface.seams])][:, :2].T
    turns = np.arctan2(y, x) * count / (2 * np.pi)
    is_on_axis = np.hypot(x, y) < 1e-9
    offsets = (turns - turns[~is_on_axis][0] + 0.5) % 1 - 0.5
    assert np.abs(offsets[~is_on_axis]).max() < 1e-4
    assert is_on_axis.sum() == 2

    def area(part):
        a, b, c = part.vertices[part.faces].transpose(1, 0, 2)
        return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()

    # Vertices near half-planes slide along edges, a little below the sphere.
    assert area(divided) == pytest.approx(area(mesh), rel=2e-3)
    assert surface_distances(mesh.vertices, mesh.faces, divided.vertices).max() < 1e-9
    assert divided.euler_characteristic == 2


def tilted(angle: float):
    return np.array([0.8 * np.sin(angle), 0.6 * np.sin(angle), np.cos(angle)])


@pytest.mark.parametrize("mesh", [uv_sphere(24, 16), icosphere(3)], ids=["rings", "icosphere"])
def test_half_planes_near_vertices_leave_no_needles(mesh):
    mesh = mesh.moved_to(100 * mesh.vertices)
    strains = []
    for tilt in (0, 1e-5, 1e-3, 2e-3):
        surface = cut_gores(mesh, 12, tilted(tilt)).surface
        strains.append(np.abs(surface.edges.strains(surface.points)).max())
        assert surface.edges.lengths.min() > 0.5
    limit = 1.1 * strains[0]
    assert max(strains) < limit


@pytest.mark.parametrize(("around", "tilt"), [(32, 0.02), (64, 0.01)])
def test_vertices_beside_the_axis_do_not_slide_across_half_planes(around, tilt):
    surface = cut_gores(uv_sphere(around, around // 2), 8, np.array([0.0, tilt, 1.0])).surface
    assert surface.pieces.max() + 1 == 8


def test_gores_along_a_tilted_axis_are_nearly_congruent():
    mesh = uv_sphere(24, 16)
    tilt = 1e-3
    surface = cut_gores(mesh.moved_to(100 * mesh.vertices), 12, tilted(tilt)).surface
    loops = [loops[0] for loops in find_borders(surface).loops]
    outlines = [shapely.LinearRing(surface.points[tails(surface, loop)]) for loop in loops]
    # Points of the outlines move by the tilt along nearly straight lines.
    assert max(outline.hausdorff_distance(outlines[0]) for outline in outlines) < 0.2 * tilt * 100


def test_corners_do_not_slide():
    mesh = cube()
    mesh = mesh.moved_to(100 * mesh.vertices)
    divided = cut_gores(mesh, 4, tilted(0.05)).surface.mesh
    distances = np.linalg.norm(mesh.vertices[:, None] - divided.vertices, axis=2).min(axis=1)
    size = np.ptp(mesh.vertices, axis=0).max()
    assert distances.max() <= 0.03 * size


def test_more_gores_have_less_strain():
    strains = []
    for count in (4, 8, 16):
        surface = cut_gores(uv_sphere(32, 16), count, UP).surface
        strains.append(np.abs(surface.edges.strains(surface.points)).max())
    # The strain of a strip across a sphere grows with the square of its width.
    assert strains[0] > 2.5 * strains[1] > 6 * strains[2]


def test_a_lamp_shade_is_exact_and_its_gores_stand_upright():
    surface = cut_gores(SHADE, 6, UP).surface
    assert np.abs(surface.edges.strains(surface.points)).max() < 1e-9
    for piece in range(6):
        corners, first = np.unique(surface.corners[surface.pieces == piece], return_index=True)
        points = surface.points[corners]
        heights = surface.mesh.vertices[surface.mesh.faces[surface.pieces == piece].ravel()[first], 2]
        # A part of a ring, symmetric about the vertical axis, with the wide end below.
        mirrored = points * [-1, 1]
        assert max(np.linalg.norm(points - point, axis=1).min() for point in mirrored) < 1e-9
        assert points[heights.argmax(), 1] > points[heights.argmin(), 1]


def test_gores_do_not_depend_on_numbers_motion_or_scale():
    mesh = VASE
    expected = np.sort(cut_gores(mesh, 5, UP).surface.edges.lengths)
    turn = rotation()
    vertices, faces, _ = renumber(mesh.vertices, mesh.faces)
    for scale in (1e-6, 1.0, 1e6):
        moved = check_mesh(scale * (vertices @ turn.T + [3, 4, 5]), faces).mesh
        surface = cut_gores(moved, 5, turn @ UP).surface
        np.testing.assert_allclose(np.sort(surface.edges.lengths), scale * expected, rtol=1e-6)


@pytest.mark.parametrize("axis", [[0, 0, 1], [1, 0, 0]])
def test_a_ring_has_no_gores(axis):
    with pytest.raises(MeshError, match=r"strip \d of 8 (is not a disk|consists of 2 pieces)"):
        cut_gores(check_mesh(*torus()).mesh, 8, np.array(axis, dtype=float))


def test_the_axis_is_that_of_least_strain_unless_it_is_given():
    ball = uv_sphere(24, 12)
    bottle = ball.moved_to(ball.vertices * [1, 1, 2] * (1 + 0.2 * ball.vertices[:, 2:]))
    for turns in range(3):
        moved = bottle.moved_to(np.roll(bottle.vertices, turns, axis=1))
        result = coneflat.pattern(moved.vertices, moved.faces, kind="gores", gores=8, height=100.0)
        assert result.settings["axis"] == tuple(np.roll([0.0, 0.0, 1.0], turns))
        assert np.ptp(result.surface.mesh.vertices, axis=0)[(2 + turns) % 3] == pytest.approx(100)
    assert coneflat.pattern(bottle, kind="gores", gores=8, height=100.0, axis=(0, 1, 0)).settings["axis"] == (
        0,
        1,
        0,
    )
