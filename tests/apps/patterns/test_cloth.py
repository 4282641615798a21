"""Cloth: strain within its bound, where it is cut, and what the options promise."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from flat_pieces import assert_lawful, cut_sphere
from scipy.spatial import cKDTree

import coneflat
from coneflat import TriangleMesh
from coneflat.apps.patterns.cloth.cloth import unmet
from coneflat.apps.patterns.cloth.joining import with_joined_pieces
from coneflat.apps.patterns.cloth.simplification import simplified
from coneflat.apps.patterns.cloth.slits import slit_until_within
from coneflat.apps.patterns.cloth.smooth_seams import with_smooth_seams
from coneflat.apps.patterns.options import PatternOptions
from coneflat.apps.patterns.pieces.borders import find_borders
from coneflat.apps.patterns.pieces.cut_surface import CutSurface
from coneflat.apps.patterns.pieces.numbering import letters
from coneflat.apps.patterns.pieces.relaxing import excess
from coneflat.apps.patterns.pieces.strain import Stretch
from coneflat.apps.patterns.units import length_of, percentage
from coneflat.errors import OptionError
from coneflat.geometry import surface_distances
from coneflat.mesh import open_along


@pytest.fixture(scope="module")
def ball():
    """A bumpy sphere of 1,280 triangles and its pattern of 100 mm in height, with a strain of 8 %."""
    vertices, faces = shapes.sphere(3)
    return (vertices, faces), coneflat.pattern(vertices, faces, height=100, strain=0.08, page="none")


def test_cloth_is_within_its_strain_without_overlaps(ball):
    assert_lawful(ball[1])
    _, result = ball
    assert np.abs(result.strains).max() <= 0.08
    assert result.notes == ()
    assert not len(result.surface.overlaps())
    assert max(seam.largest_gap for seam in result.seams) < 1e-6
    assert sum(seam.surface_length for seam in result.seams) == pytest.approx(result.surface.seam_length)
    heights = np.ptp(result.surface.mesh.vertices, axis=0)
    assert heights.max() == pytest.approx(100, rel=0.2)


@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_scale_position_and_numbering_do_not_matter(ball, factor):
    (vertices, faces), result = ball
    order = np.random.default_rng(1).permutation(len(vertices))
    number = np.argsort(order)
    moved = factor * (vertices[order] + 5.0)
    moved_result = coneflat.pattern(moved, number[faces], height=100, strain=0.08, page="none")
    assert moved_result.piece_count == result.piece_count
    assert moved_result.surface.seam_length == pytest.approx(result.surface.seam_length, rel=0.02)
    assert np.abs(moved_result.strains).max() <= 0.08


def test_less_strain_needs_longer_seams(ball):
    (vertices, faces), result = ball
    tighter = coneflat.pattern(vertices, faces, height=100, strain="4%", page="none")
    assert np.abs(tighter.strains).max() <= 0.04
    assert tighter.surface.seam_length > result.surface.seam_length


@pytest.mark.parametrize("strain", [0.01, 0.003])
def test_small_bounds_are_met(strain):
    rng = np.random.default_rng(2)
    vertices, faces = shapes.sphere(2)
    vertices = vertices * (1 + 0.1 * rng.standard_normal((len(vertices), 1)))
    result = coneflat.pattern(vertices, faces, height=100, strain=strain, page="none")
    assert np.abs(result.strains).max() <= strain
    assert not len(result.surface.overlaps())


def test_pieces_are_joined_and_darts_closed_within_the_bound():
    stretch = Stretch(0.1, 0.1)
    surface = slit_until_within(cut_sphere(), Stretch(0.02, 0.02))
    apart = surface.cut_along(np.union1d(surface.seams, surface.mesh.halfedge_edges[:60]))
    joined = with_joined_pieces(apart, stretch, np.empty((0, 2), dtype=np.int64))
    assert apart.piece_count > surface.piece_count
    assert joined.piece_count == 1
    assert joined.seam_length < surface.seam_length
    assert not excess(joined, stretch).any()
    assert not len(joined.overlaps())
    required = apart.mesh.edges[apart.seams]
    assert np.array_equal(with_joined_pieces(apart, stretch, required).seams, apart.seams)


def test_strain_may_differ_along_the_grain(ball):
    (vertices, faces), _ = ball
    stretch = {"stretch_warp": "4%", "stretch_weft": "20%"}
    result = coneflat.pattern(vertices, faces, height=100, **stretch, page="none")
    vectors = result.surface.edges.vectors(result.surface.points)
    share = vectors[:, 1] ** 2 / (vectors**2).sum(axis=1)
    bounds = 0.04 * share + 0.2 * (1 - share)
    assert (np.abs(result.strains) <= bounds * (1 + 1e-6)).all()
    assert np.abs(result.strains).max() > 0.05


def test_without_darts_no_cut_ends_inside_a_piece(ball):
    (vertices, faces), result = ball
    assert len(result.darts)
    dartless = coneflat.pattern(vertices, faces, height=100, strain=0.08, darts="none", page="none")
    assert not len(dartless.darts)
    assert np.abs(dartless.strains).max() <= 0.08


def lopsided_ball():
    """A ball of 320 triangles whose only plane of symmetry is across x."""
    x, y, z = shapes.sphere(2, bumps=0)[0].T
    radius = 1 + 0.3 * y + 0.2 * z + 0.2 * y * z + 0.5 * x**2 * z
    return np.stack([x, y, z], axis=1) * radius[:, None], shapes.sphere(2, bumps=0)[1]


def middles_of_seams(result):
    surface = result.surface
    return surface.mesh.vertices[surface.mesh.edges[surface.seams]].mean(axis=1)


def test_symmetric_surfaces_have_symmetric_seams():
    options = {"height": 100, "axis": (0, 0, 1), "page": "none"}
    result = coneflat.pattern(*lopsided_ball(), strain=0.05, **options)
    assert len(result.counterparts.pairs) == result.piece_count / 2
    middles = middles_of_seams(result)
    centre = (middles[:, 0].min() + middles[:, 0].max()) / 2
    gaps = cKDTree(middles).query((middles - [2 * centre, 0, 0]) * [-1, 1, 1])[0]
    assert gaps.max() < 1e-6
    assert np.abs(middles[:, 0] - centre).max() > 10
    without = middles_of_seams(coneflat.pattern(*lopsided_ball(), strain=0.05, symmetry="none", **options))
    centre = (without[:, 0].min() + without[:, 0].max()) / 2
    assert cKDTree(without).query((without - [2 * centre, 0, 0]) * [-1, 1, 1])[0].max() > 1


def test_a_grain_across_the_plane_allows_no_mirror_images():
    across = coneflat.pattern(*lopsided_ball(), height=100, strain=0.05, grain=(1, 0, 0), page="none")
    plain = coneflat.pattern(
        *lopsided_ball(), height=100, strain=0.05, grain=(1, 0, 0), symmetry="none", page="none"
    )
    assert np.array_equal(across.surface.seams, plain.surface.seams)


def test_named_edges_are_seams(ball):
    (vertices, faces), _ = ball
    around = faces[(faces == 0).any(axis=1)]
    pairs = np.array([np.roll(face, -int(np.flatnonzero(face == 0)[0]))[1:] for face in around])
    result = coneflat.pattern(vertices, faces, height=100, strain=0.3, seams=pairs, tolerance=0, page="none")
    cut = {tuple(edge) for edge in result.surface.mesh.edges[result.surface.seams].tolist()}
    named = {tuple(sorted(pair)) for pair in pairs.tolist()}
    assert len(named) >= 5
    assert named <= cut  # though they cut off a small piece


def test_smooth_seams_stay_near_the_surface():
    surface = cut_sphere()
    tolerance = 0.02
    smooth = with_smooth_seams(surface, tolerance)
    before, after = surface.mesh, smooth.mesh
    assert np.abs(after.vertices - before.vertices).max() > 0.01
    assert surface_distances(before.vertices, before.faces, after.vertices).max() <= tolerance
    assert surface_distances(after.vertices, after.faces, before.vertices).max() <= tolerance
    assert smooth.seam_length < surface.seam_length
    assert with_smooth_seams(surface, 0.0) is surface


def test_seams_on_creases_stay_there():
    angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    rim = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rings = [
        np.pad(radius * rim, ((0, 0), (0, 1)), constant_values=z) for radius, z in ((0.5, 1), (1, 1), (1, 0))
    ]
    i, j = np.arange(24), np.roll(np.arange(24), -1)
    faces = [np.stack([i + a, i + a + 24, j + a + 24], axis=1) for a in (0, 24)]
    faces += [np.stack([i + a, j + a + 24, j + a], axis=1) for a in (0, 24)]
    mesh = TriangleMesh(np.concatenate(rings), np.concatenate(faces))
    cut = open_along(mesh, np.flatnonzero(((mesh.edges >= 24) & (mesh.edges < 48)).all(axis=1)))
    surface = CutSurface(mesh, cut.mesh.faces, np.zeros((len(cut.mesh.vertices), 2)))
    assert len(surface.seams) == 24
    assert np.array_equal(with_smooth_seams(surface, 0.05).mesh.vertices, mesh.vertices)


def test_dense_meshes_are_simplified_within_the_tolerance():
    mesh = TriangleMesh(*shapes.sphere(5))
    coarse, distances = simplified(mesh, 0.01)
    assert len(coarse.faces) < len(mesh.faces) / 2
    assert 0 < distances.mean() <= 0.01
    assert distances.max() >= surface_distances(coarse.vertices, coarse.faces, mesh.vertices).max()
    assert simplified(mesh, 1e-9)[0] is mesh
    assert np.array_equal(np.ptp(coarse.vertices, axis=0), np.ptp(mesh.vertices, axis=0))


def test_a_strain_beyond_its_bound_is_named_with_it():
    surface = cut_sphere()
    strains = surface.edges.strains(surface.points)
    bound = float(np.abs(strains).max()) / 2
    (note,) = unmet(surface, Stretch(bound, bound), PatternOptions())
    assert f"up to {percentage(2 * bound)} instead of {percentage(bound)}" in note


def test_every_border_half_edge_is_on_one_side(ball):
    _, result = ball
    borders = find_borders(result.surface)
    sides = [side for seam in borders.seams for side in seam.sides] + list(borders.hems)
    on_sides = np.concatenate([side.halfedges for side in sides])
    on_loops = np.concatenate([loop for loops in borders.loops for loop in loops])
    assert np.array_equal(np.sort(on_sides), np.sort(on_loops))
    assert len(np.unique(on_sides)) == len(on_sides)


@pytest.mark.parametrize(
    ("number", "name"), [(0, "A"), (25, "Z"), (26, "AA"), (27, "AB"), (701, "ZZ"), (702, "AAA")]
)
def test_letters_continue_after_z(number, name):
    assert letters(number) == name


@pytest.mark.parametrize(
    ("text", "length"), [("7mm", 7.0), ("0.7cm", 7.0), ("1in", 25.4), ("2 m", 2000.0), (3, 3.0), ("x", None)]
)
def test_lengths_have_units(text, length):
    assert length_of(text) == length


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "has no unit: give unit as mm"),
        ({"height": "0mm"}, "height must be a length, above 0"),
        ({"height": 100, "unit": "mm"}, "height and unit or scale cannot be combined"),
        ({"unit": "mm", "strain": "0%"}, "strain must be from 0.01 % to 100 %"),
        ({"unit": "mm", "kind": "net", "seams": [[0, 1]]}, "seams and kind net cannot be combined"),
        ({"unit": "furlong"}, "unknown unit"),
    ],
)
def test_errors_say_what_to_do(options, message):
    with pytest.raises(OptionError, match=message):
        coneflat.pattern(*shapes.sphere(1), **options)


def test_the_size_is_that_of_the_unit():
    vertices, faces = shapes.sphere(1)
    inches = coneflat.pattern(vertices, faces, unit="in", kind="net", page="none")
    assert inches.millimetres == 25.4
    assert np.ptp(inches.surface.mesh.vertices, axis=0) == pytest.approx(25.4 * np.ptp(vertices, axis=0))


def test_triangles_without_area_are_replaced():
    corners = [[x, y, 0.1 * x * y] for y in range(4) for x in range(4)]
    quads = [[4 * j + i, 4 * j + i + 1, 4 * j + i + 5, 4 * j + i + 4] for j in range(3) for i in range(3)]
    faces = [triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))]
    middle = len(corners)
    corners.append(np.mean([corners[5], corners[10]], axis=0).tolist())
    # The diagonal from 5 to 10 has a vertex in its middle on one side only, closed by a triangle without area.
    split = [[5, middle, 9], [middle, 10, 9], [5, 10, middle]]
    faces = [face for face in faces if face != (5, 10, 9)] + split
    result = coneflat.pattern(corners, faces, unit="mm", scale=30, strain=0.1, page="none")
    assert any("1 triangle without area" in note for note in result.notes)
    assert np.abs(result.strains).max() <= 0.1
    assert result.surface.mesh.euler_characteristic == 1


def test_a_seam_with_two_tips_is_not_a_dart():
    vertices, faces = shapes.sphere(2)
    result = coneflat.pattern(vertices * [1, 1, 3], faces, height=100, strain="40%", tolerance=0, page="none")
    doubly_closed = [
        s for s in result.seams if all(s.sides[0].points[e] == s.sides[1].points[-1 - e] for e in (0, -1))
    ]
    assert not any(seam.is_dart for seam in doubly_closed)


def test_given_seams_stay_in_their_places():
    count = 11
    corners = [[x, y, 0] for y in range(count) for x in range(count)]
    at = [(j * count + i) for j in range(count - 1) for i in range(count - 1)]
    faces = [t for a in at for t in ((a, a + 1, a + count + 1), (a, a + count + 1, a + count))]
    place = lambda x, y: y * count + x  # noqa: E731
    ring = [
        place(3, 3),
        place(4, 3),
        place(5, 3),
        place(5, 4),
        place(5, 5),
        place(4, 5),
        place(3, 5),
        place(3, 4),
    ]
    pairs = np.stack([ring, np.roll(ring, -1)], axis=1)
    result = coneflat.pattern(corners, faces, unit="cm", seams=pairs, page="none")
    areas = np.bincount(result.surface.pieces, result.surface.edges.double_areas / 2)
    assert sorted(areas) == pytest.approx([400, 9600])


@pytest.mark.parametrize(
    "options", [{"kind": "net", "strain": 0.1}, {"gores": 5}, {"kind": "net", "allowance": 7}, {"strain": 1}]
)
def test_options_of_other_kinds_are_errors(options):
    with pytest.raises(OptionError):
        coneflat.pattern(*shapes.sphere(1), unit="mm", **options)


def test_a_long_strip_fits_on_one_sheet():
    strip = [[0, 0, 0], [100, 0, 0], [100, 5, 0], [0, 5, 0]], [[0, 1, 2], [0, 2, 3]]
    result = coneflat.pattern(*strip, unit="mm", page="none")
    assert result.report()["pages"] == 1
    assert result.piece_count == 1
