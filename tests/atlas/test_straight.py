"""Charts whose border is straight lie along the axes."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

import coneflat
from coneflat.atlas import pack_charts
from coneflat.atlas.border_runs import straight_runs
from coneflat.atlas.charts import Outlines, read_charts
from coneflat.atlas.orient import border_directions
from coneflat.atlas.pack import arrange_charts

CROSS = ((1, 0), (0, 1), (1, 1), (2, 1), (3, 1), (1, 2))
ANGLES = (0.0, np.pi / 4, 1.234)


def straight_directions(sides):
    """Return the directions of the straight parts of one border, (s, 2) sides in any order."""
    return border_directions(Outlines(sides, np.array([0, len(sides)])))[0]


def squares(places, cells: int = 1, turn: float = 0.0, noise: float = 0.0):
    """Unit squares at places, each of so many cells a side, turned, their points off by noise."""
    steps = np.linspace(0, 1, cells + 1)[:-1]
    x, y = (coordinates.ravel()[:, None] for coordinates in np.meshgrid(steps, steps))
    lower_left = np.concatenate([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]]).reshape(2, 3, 2) / cells
    cell = (lower_left[None] + np.stack([x, y], axis=2)[:, None]).reshape(-1, 3, 2)
    corners = np.concatenate([cell + place for place in np.asarray(places, dtype=float)])
    points, number = np.unique(np.round(corners.reshape(-1, 2), 9), axis=0, return_inverse=True)
    points = points + noise * np.random.default_rng(0).normal(size=points.shape)
    return turned(points, turn)[number.ravel()].reshape(-1, 3, 2)


def turned(points, angle: float):
    cosine, sine = np.cos(angle), np.sin(angle)
    return points @ np.array([[cosine, sine], [-sine, cosine]])


def sides_of(corners, chart=None):
    """The sides of each chart's outline, as vectors."""
    charts = read_charts(corners, chart)
    outlines = charts.outlines()
    vectors = outlines.sides[:, 1] - outlines.sides[:, 0]
    return np.split(vectors, outlines.start[1:-1])


def off_axes(vectors):
    """How far vectors are from the axes, radians."""
    angles = np.angle(vectors)
    return np.abs(angles - np.pi / 2 * np.round(angles / (np.pi / 2)))


@pytest.mark.parametrize("turn", ANGLES)
@pytest.mark.parametrize("cells", [1, 7])
def test_the_net_of_a_cube_lies_along_the_axes(turn, cells):
    """Alone it would fill more of a square on its corner."""
    corners = squares(CROSS, cells, turn)
    for rotate in ("any", "quarter"):
        laid = pack_charts(corners, rotate=rotate).corner_uv
        assert off_axes(sides_of(laid)[0]).max() < 1e-9
    assert 1 / pack_charts(corners, padding=0).scale == pytest.approx(4, rel=1e-12)


@pytest.mark.parametrize("turn", ANGLES)
def test_noise_hardly_rotates_a_straight_chart(turn):
    """The mean of 14 sides, the ends of each off by 1e-3, is off by less than that."""
    laid = pack_charts(squares(CROSS, 8, turn, noise=1e-3)).corner_uv
    angles = np.angle(sides_of(laid)[0])
    mean = np.angle(np.exp(4j * angles).sum()) / 4
    assert abs(mean) < 1e-3


def test_several_straight_charts_only_take_quarter_turns():
    parts = [squares(CROSS[: 2 + c % 4], 3, 0.3 * c) * (1 + c % 3) for c in range(8)]
    chart = np.repeat(np.arange(8), [len(part) for part in parts])
    for rotate in ("any", "quarter"):
        packed = pack_charts(np.concatenate(parts), chart, rotate=rotate)
        for vectors in sides_of(packed.corner_uv, chart):
            assert off_axes(vectors).max() < 1e-9


@pytest.mark.parametrize(
    ("sides", "options"),
    [((1, 1, 1), {}), ((1, 2, 3), {"up": (0, 0, 1)}), ((1, 1, 1), {"sharp_angle": 0.7})],
)
def test_boxes(sides, options):
    vertices, faces = shapes.box(4, sides)
    result = coneflat.flatten(vertices @ shapes.rotation().T, faces, charts="atlas", **options)
    for vectors in sides_of(result.corner_uv, result.seam_data.face_chart):
        assert off_axes(vectors).max() < 1e-6


def test_a_cylinder_with_caps_comes_apart_into_a_straight_strip_and_disks():
    vertices, faces = shapes.cylinder(caps=True)
    result = coneflat.flatten(vertices @ shapes.rotation().T, faces, charts="atlas", sharp_angle=0.7)
    off = sorted(
        off_axes(vectors).max() for vectors in sides_of(result.corner_uv, result.seam_data.face_chart)
    )
    assert len(off) == 3
    assert off[0] < 1e-6
    assert off[1] > 0.1


def polygon(count: int, phase: float = 0.2):
    return np.exp(1j * (phase + 2 * np.pi * np.arange(count) / count))


def as_sides(points):
    return np.column_stack([points, np.roll(points, -1)])


def test_runs_and_directions_by_hand():
    # A rectangle of 4 x 1 whose sides are of several edges: four runs, however the sides are numbered.
    x = np.concatenate([np.arange(4), np.full(2, 4.0), np.arange(4, 0, -1), np.zeros(2)])
    y = np.concatenate([np.zeros(4), [0, 0.5], np.ones(4), [1, 0.5]])
    sides = as_sides((x + 1j * y) * np.exp(0.3j))
    for seed in range(3):
        mixed = sides[np.random.default_rng(seed).permutation(len(sides))]
        np.testing.assert_allclose(
            np.sort(np.abs(straight_runs(Outlines(mixed, np.array([0, len(mixed)])))[0])),
            [1, 1, 4, 4],
            rtol=1e-12,
        )
        np.testing.assert_allclose(straight_directions(mixed), [0.3], rtol=1e-12)
    # Of an octagon there are two; of a hexagon no direction has more than a third.
    assert len(straight_directions(as_sides(polygon(8)))) == 2
    assert len(straight_directions(as_sides(polygon(6)))) == 0


def test_most_of_the_border_wins_over_sides_at_45_degrees():
    """Cut off a square's corners, little or much: sides along the axes, then those at 45 degrees."""
    for cut, along in ((0.2, 0.0), (0.45, np.pi / 4)):
        corner = np.array(
            [cut, 1 - cut, 1 + 1j * cut, 1 + 1j * (1 - cut), 1 - cut + 1j, cut + 1j, 1j * (1 - cut), 1j * cut]
        )
        direction = straight_directions(as_sides(corner * np.exp(0.4j)))
        np.testing.assert_allclose(direction, [0.4 + along], rtol=1e-9)


@pytest.mark.parametrize("count", [24, 400])
def test_a_disk_has_no_straight_border(count):
    assert len(straight_directions(as_sides(polygon(count)))) == 0


def test_free_forms_have_no_straight_border():
    result = coneflat.flatten(*shapes.sphere(4, bumps=0.6))
    charts = read_charts(result.corner_uv, result.seam_data.face_chart)
    assert not any(len(directions) for directions in border_directions(charts.outlines()))


def test_rounded_corners_do_not_turn_a_box():
    """A quarter arc at each corner, of many points, and then not turned alike."""
    arc = np.exp(0.5j * np.pi * np.linspace(0, 1, 30))
    corner = np.array([1 + 0.5j, -1 + 0.5j, -1 - 0.5j, 1 - 0.5j])
    points = np.concatenate([corner[k] + 0.15 * arc * 1j**k for k in range(4)]) * np.exp(0.7j)
    assert straight_directions(as_sides(points)) == pytest.approx([0.7], abs=1e-3)


def turn_of(before, after):
    """The angle that a chart was turned by."""
    side_before, side_after = (corners[0, 1] - corners[0, 0] for corners in (before, after))
    return np.angle(complex(*side_after) / complex(*side_before))


@pytest.mark.parametrize("up", [None, (0.0, 1.0, 0.0), (1.0, 1.0, 0.0)])
def test_charts_of_a_component_keep_to_the_quantum(up):
    """Before a disk, although that is larger, a strip is laid straight; the disk is turned by sixths from there."""
    angle = 2 * np.pi * np.arange(31) / 30
    rim = 2 * np.column_stack([np.cos(angle), np.sin(angle)])
    disk = np.stack([np.zeros((30, 2)), rim[:-1], rim[1:]], axis=1)
    strip = squares([(0, 0), (1, 0), (2, 0)], 1, 0.3)
    corners, chart = np.concatenate([disk, strip]), np.repeat([0, 1], [30, 6])
    laid = arranged(corners, chart, np.pi / 3, up)
    assert off_axes(sides_of(laid, chart)[1]).max() < 1e-9
    parts = (turn_of(strip, laid[30:]) - turn_of(disk, laid[:30])) / (np.pi / 3)
    assert abs(parts - round(parts)) < 1e-9


@pytest.mark.parametrize("up", [None, (0.0, 1.0, 0.0), (1.0, 1.0, 0.0)])
def test_eighths_of_a_turn_leave_straight_charts_on_the_axes(up):
    """Two strips an eighth of a turn apart: one is turned by an odd number of eighths, whatever is up."""
    parts = [squares([(0, 0), (1, 0), (2, 0)], 1, turn) for turn in (0.3, 0.3 + np.pi / 4)]
    chart = np.repeat([0, 1], 6)
    laid = arranged(np.concatenate(parts), chart, np.pi / 4, up)
    for vectors in sides_of(laid, chart):
        assert off_axes(vectors).max() < 1e-9


def arranged(corners, chart, quantum, up):
    """The charts of one flat component in a texture."""
    heights = None if up is None else corners @ np.array(up[:2])
    component = np.zeros(chart.max() + 1, dtype=int)
    keys = np.column_stack([np.repeat(chart, 3), np.round(corners.reshape(-1, 2), 9)])
    points, number = np.unique(keys, axis=0, return_inverse=True)
    mesh = coneflat.TriangleMesh(points, number.reshape(-1, 3))
    options = {"resolution": 512, "padding": 2, "tiles": 1, "edge_halfedges": mesh.edge_halfedges}
    return arrange_charts(corners, chart, component, heights, quantum=quantum, **options).corner_uv


@pytest.mark.parametrize("turn", ANGLES[1:])
def test_packing_is_invariant_under_rotation_and_renumbering(turn):
    places = np.array([(0, 0), (1, 0), (2, 0), (3, 0), (0, 1), (1, 1), (0, 2)])
    parts = [squares(places[: 4 + c], 3, 0.3 * c) * (1 + c % 3) for c in (1, 2, 3)]
    chart = np.repeat(np.arange(3), [len(part) for part in parts])
    corners = np.concatenate(parts)
    packed = pack_charts(corners, chart)
    order = np.random.default_rng(0).permutation(len(chart))
    again = pack_charts(turned(corners, turn)[order][:, [1, 2, 0]] * 3 + 5, chart[order])
    assert 3 * again.scale == pytest.approx(packed.scale, rel=1e-9)
    np.testing.assert_allclose(again.corner_uv[:, [2, 0, 1]], packed.corner_uv[order], atol=1e-9)
