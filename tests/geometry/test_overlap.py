from __future__ import annotations

from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest
import shapes

import coneflat
from coneflat import errors
from coneflat.atlas import separate_touching
from coneflat.geometry import coverage, overlap
from coneflat.geometry.orientation import fill_orientations
from coneflat.geometry.overlap import bounding_boxes, find_overlaps, has_overlaps

UNIT = [[0, 0], [1, 0], [0, 1]]
ULP = 2.0**-53


def turn(p, q, r):
    return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])


def exact(triangle):
    """The corners as fractions, counterclockwise."""
    corners = [(Fraction(x), Fraction(y)) for x, y in np.asarray(triangle, dtype=float).tolist()]
    return corners if turn(*corners) > 0 else corners[::-1]


def common_area(first, second):
    """Twice the area that two triangles have in common, a fraction, by clipping."""
    polygon, clip = exact(first), exact(second)
    if turn(*polygon) == 0 or turn(*clip) == 0:
        return 0
    for i in range(3):
        p, q = clip[i], clip[(i + 1) % 3]
        clipped = []
        for k, b in enumerate(polygon):
            a = polygon[k - 1]
            side_a, side_b = turn(p, q, a), turn(p, q, b)
            if side_a * side_b < 0:
                t = side_a / (side_a - side_b)
                clipped.append((a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])))
            if side_b >= 0:
                clipped.append(b)
        polygon = clipped
    return sum(a[0] * b[1] - a[1] * b[0] for a, b in zip(polygon, polygon[1:] + polygon[:1], strict=True))


def brute_force(corners):
    return [
        (i, j) for i, j in combinations(range(len(corners)), 2) if common_area(corners[i], corners[j]) > 0
    ]


def pairs_of(corners, **options):
    return [tuple(pair) for pair in find_overlaps(np.array(corners, dtype=float), **options).pairs.tolist()]


def sampled(corners, size=2000):
    """The share of covered sample points, a square grid of them, that are covered twice."""
    corners = (corners - corners.min(axis=(0, 1))) / np.ptp(corners, axis=(0, 1)).max() * size
    covered = np.zeros((size, size), dtype=int)
    for triangle in corners:
        low, high = np.ceil(triangle.min(axis=0) - 0.5), np.ceil(triangle.max(axis=0) - 0.5)
        block = tuple(slice(int(a), int(b)) for a, b in zip(low, high, strict=True))
        x, y = np.meshgrid(*(np.arange(s.start, s.stop) + 0.5 for s in block), indexing="ij")
        sides = [turn(triangle[i - 1], triangle[i], (x, y)) for i in range(3)]
        covered[block] += (np.min(sides, axis=0) > 0) | (np.max(sides, axis=0) < 0)
    return np.count_nonzero(covered > 1) / np.count_nonzero(covered)


CONTACTS = {
    "a side": [[1, 0], [1, 1], [0, 1]],
    "a part of a side": [[2, -1], [3, 0], [-1, 2]],
    "a longer side": [[3, -2], [3, 3], [-2, 3]],
    "a side along the same line, apart": [[2, 0], [3, 0], [2, 1]],
    "the corner on a corner": [[1, 0], [2, 0], [2, 1]],
    "the corner on a side": [[0.5, 0.5], [1, 1], [0.5, 1]],
    "a side on a corner": [[1, -1], [2, 0], [1, 1]],
    "nothing, boxes overlap": [[0.75, 0.75], [1, 0.75], [0.75, 1]],
    "the corner, an ulp off": [[0.5 + ULP, 0.5], [1, 1], [0.5, 1]],
    "no area": [[-1, 0.1], [0, 0.1], [1, 0.1]],
    "a point": [[0.25, 0.25]] * 3,
}

OVERLAPS = {
    "the same": UNIT,
    "the same, upside down": [[0, 0], [0, 1], [1, 0]],
    "contained": [[0.25, 0.25], [0.5, 0.25], [0.25, 0.5]],
    "contained, on the sides": [[0.5, 0], [0.5, 0.5], [0, 0.5]],
    "on the same side of a line": [[0, 0], [1, 0], [1, 1]],
    "crosswise, no corner inside": [[-1, 0.2], [2, 0.2], [2, 0.3]],
    "a side, flipped": [[1, 0], [0, 1], [0.1, 0.1]],
    "an ulp of a corner": [[0.5 - ULP, 0.5], [1, 1], [0.5, 1]],
    "a sliver through": [[-1e9, 0.25], [1e9, 0.25], [1e9, np.nextafter(0.25, 1)]],
}


@pytest.mark.parametrize("name", CONTACTS)
def test_contact_is_no_overlap(name):
    for pair in ([UNIT, CONTACTS[name]], [CONTACTS[name], UNIT]):
        overlaps = find_overlaps(np.array(pair, dtype=float))
        assert (len(overlaps.pairs), overlaps.area, overlaps.fraction) == (0, 0, 0)


@pytest.mark.parametrize("name", OVERLAPS)
def test_inner_points_in_common_are_overlap(name):
    for pair in ([UNIT, OVERLAPS[name]], [OVERLAPS[name], UNIT]):
        assert pairs_of(pair) == [(0, 1)]
        area = float(common_area(*pair)) / 2
        assert find_overlaps(np.array(pair, dtype=float)).area == pytest.approx(area, abs=1e-15)


def test_orientation_where_rounding_would_decide():
    rng = np.random.default_rng(3)
    base = rng.random((400, 1, 2)) * 10.0 ** rng.integers(-3, 4, (400, 1, 1))
    along = base + rng.random((400, 2, 1)) * (rng.random((400, 1, 2)) - 0.5)
    corners = np.concatenate([base, along], axis=1) + rng.integers(-2, 3, (400, 3, 2)) * ULP
    corners[200:] = 0.5 + rng.integers(0, 9, (200, 3, 2)) * ULP
    corners[200:, 1:] = [[12, 12], [24, 24]]
    signs = np.empty(400, dtype=np.int64)
    fill_orientations(corners.reshape(-1, 6), np.empty(12), signs)
    expected = [np.sign(turn(*[[Fraction(x) for x in p] for p in c])) for c in corners.tolist()]
    assert signs.tolist() == expected
    assert set(signs[200:].tolist()) == {-1, 0, 1}


@pytest.mark.parametrize("seed", range(2))
def test_pairs_are_those_of_exact_clipping(seed):
    rng = np.random.default_rng(seed)
    integers = rng.integers(0, 7, (40, 3, 2))  # many contacts of every kind, some triangles without area
    assert pairs_of(integers) == brute_force(integers)
    spread = rng.random((40, 1, 2)) + 0.3 * rng.normal(size=(40, 3, 2)) * np.exp(-8 * rng.random((40, 1, 1)))
    assert pairs_of(spread) == brute_force(spread)
    close = rng.integers(0, 5, (40, 3, 2)) / 8 + 0.5 + rng.integers(-1, 2, (40, 3, 2)) * ULP
    assert pairs_of(close) == brute_force(close)


def test_a_triangulation_has_no_overlaps_at_any_scale():
    for scale in (1e-6, 1, 1e6, 1e-150, 1e150):
        vertices, faces = shapes.grid(40, 30)
        points = (vertices @ shapes.rotation())[:, :2] * scale
        overlaps = find_overlaps(points, faces)
        assert len(overlaps.pairs) == 0
        assert overlaps.fraction == 0


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_fans_leave_the_pairs_as_they_are(seed, monkeypatch):
    monkeypatch.setattr("coneflat.geometry.fans.MIN_CORNERS", 2)
    rng = np.random.default_rng(seed)
    corners = np.concatenate(
        [
            rng.integers(0, 5, (60, 3, 2)) / 8 + 0.5 + rng.integers(0, 2, (60, 3, 2)) * ULP,
            -rng.random((20, 3, 2)),
        ]
    )
    corners[60:70, 1] = corners[70:, 2] = corners[60, 1]
    assert pairs_of(corners) == brute_force(corners)


@pytest.mark.parametrize("count", [17, 301])
def test_fan_around_a_cone_of_three_half_turns(count):
    angles = np.linspace(0, 3 * np.pi, count + 1)
    points = np.concatenate([[[0, 0]], np.stack([np.cos(angles), np.sin(angles)], axis=1)])
    k = np.arange(count)
    overlaps = find_overlaps(points, np.stack([0 * k, k + 1, k + 2], axis=1))
    # Triangle i of n covers the angles from 3 i / n to 3 (i + 1) / n half turns, so j covers some of them from
    # 3 (j - i) > 2 n - 3 on, that is two half turns less one triangle.
    expected = [(i, j) for i, j in combinations(range(count), 2) if abs(3 * (j - i) - 2 * count) < 3]
    assert overlaps.pairs.tolist() == [list(pair) for pair in expected]
    assert 0.45 < overlaps.fraction < 0.51  # half, but for the corners of polygons


def spiral(turns, pitch, per_turn=48, across=5):
    """A strip of width 1 that runs around the origin, and outwards by `pitch` each turn."""
    points, faces = shapes.grid(round(turns * per_turn), across)
    angle, radius = 2 * np.pi * turns * points[:, 0], 2 + points[:, 1] + pitch * turns * points[:, 0]
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1), faces


def test_spiral_overlaps_if_its_pitch_is_less_than_its_width():
    points, faces = spiral(2.2, 1.01)
    assert len(find_overlaps(points, faces).pairs) == 0
    points, faces = spiral(2.2, 0.9)
    overlaps = find_overlaps(points, faces)
    assert overlaps.fraction == pytest.approx(sampled(points[faces]), abs=2e-3)
    upside_down = find_overlaps(points, faces[:, ::-1])
    np.testing.assert_array_equal(upside_down.pairs, overlaps.pairs)
    assert upside_down.area == pytest.approx(overlaps.area, rel=1e-12)


@pytest.mark.parametrize(("turns", "share"), [(1.25, 0.25), (2, 1), (3.25, 1)])
def test_layers_that_coincide_but_for_rounding(turns, share):
    points, faces = spiral(turns, 0)
    overlaps = find_overlaps(points, faces)
    assert overlaps.fraction == pytest.approx(share, abs=1e-13)
    sector = np.sin(2 * np.pi / 48) / 2
    assert overlaps.area == pytest.approx(share * 48 * sector * (3**2 - 2**2), rel=1e-12)


def test_areas_do_not_depend_on_the_blocks_of_the_sweep(monkeypatch):
    points, faces = spiral(3.3, 0.4)
    unblocked = find_overlaps(points, faces)
    monkeypatch.setattr(coverage, "CROSSINGS_PER_BLOCK", 100)
    blocked = find_overlaps(points, faces)
    assert blocked.area == pytest.approx(unblocked.area, rel=1e-12)
    assert blocked.fraction == pytest.approx(unblocked.fraction, rel=1e-12)
    assert unblocked.fraction == pytest.approx(sampled(points[faces]), abs=2e-3)


def test_triangles_of_very_different_size():
    # A disk in which sizes vary by e^16, laid out over more than a turn.
    points, faces = shapes.grid(60, 100)
    z = np.exp(16 * points[:, 1] + 2.2j * np.pi * points[:, 0])
    layout = np.stack([z.real, z.imag], axis=1)
    overlaps = find_overlaps(layout, faces)
    columns = faces[:, 0] // 101  # the overlap runs along the first and last six of them
    apart = columns[overlaps.pairs[:, 1]] - columns[overlaps.pairs[:, 0]]
    assert np.abs(apart).min() >= 53
    assert len(np.unique(overlaps.pairs)) == 2 * 2 * 6 * 100
    assert overlaps.fraction == pytest.approx(0.1, abs=5e-3)


def test_renumbering_renumbers_the_pairs():
    rng = np.random.default_rng(5)
    corners = rng.random((300, 1, 2)) + 0.1 * rng.normal(size=(300, 3, 2))
    number = rng.permutation(300)
    shuffled = np.empty_like(corners)
    shuffled[number] = np.roll(corners, 1, axis=1)
    overlaps, shuffled_overlaps = find_overlaps(corners), find_overlaps(shuffled)
    pairs = np.sort(number[overlaps.pairs], axis=1)
    np.testing.assert_array_equal(pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))], shuffled_overlaps.pairs)
    assert overlaps.area == pytest.approx(shuffled_overlaps.area, rel=1e-12)
    for scale in (1e-6, 1e6):
        scaled = find_overlaps(corners * scale)
        np.testing.assert_array_equal(scaled.pairs, overlaps.pairs)
        assert scaled.area == pytest.approx(overlaps.area * scale**2, rel=1e-12)


def test_limit():
    corners = np.array([UNIT] * 200, dtype=float)
    every = find_overlaps(corners)
    assert every.complete
    np.testing.assert_array_equal(every.pairs, np.stack(np.triu_indices(200, 1), axis=1))
    assert (every.area, every.fraction) == pytest.approx((0.5, 1))
    assert find_overlaps(corners, limit=len(every.pairs)).complete
    limited = find_overlaps(corners, limit=17)
    assert len(limited.pairs) == 17
    assert not limited.complete
    assert np.isnan([limited.area, limited.fraction]).all()
    assert len(find_overlaps(corners[:1]).pairs) == 0
    assert find_overlaps(0 * corners).fraction == 0  # no triangle has area
    assert find_overlaps(corners[:2], limit=1).complete


def separate_cells(columns=12, rows=9):
    """Squares in rows, each with separate points, which touch along their sides or parts of them."""
    low = np.stack(
        np.meshgrid(np.arange(columns, dtype=float), np.arange(rows, dtype=float), indexing="ij"), -1
    )
    low[..., 0] += 0.37 * (np.arange(rows) % 2)
    quads = low.reshape(-1, 1, 2) + np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    corners = np.arange(4 * columns * rows).reshape(-1, 4)
    return quads.reshape(-1, 2), np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])


@pytest.mark.parametrize("angle", [0.1, 2.5])
@pytest.mark.parametrize("mirrored", [False, True])
def test_touching_triangles_are_separated(angle, mirrored):
    points, triangles = separate_cells()
    turned = points @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]) / 31
    triangles = triangles[:, ::-1] if mirrored else triangles
    assert len(find_overlaps(turned, triangles).pairs) > 0  # by rounding
    parted, overlaps = separate_touching(turned, triangles)
    assert len(overlaps.pairs) == len(find_overlaps(parted, triangles).pairs) == 0
    assert np.abs(parted - turned).max() < 1e-13


def test_overlapping_triangles_are_not_separated():
    points, triangles = separate_cells(2, 1)
    points[4:, 0] -= 1e-6
    parted, overlaps = separate_touching(points, triangles)
    assert np.array_equal(parted, points)
    np.testing.assert_array_equal(overlaps.pairs, find_overlaps(points, triangles).pairs)
    assert len(overlaps.pairs) > 0


@pytest.mark.parametrize("angle", [0.0, 0.3])
def test_long_triangles_askew(angle):
    """Beside one another, every tenth lying on the one after."""
    count = 400
    way = np.array([np.cos(angle), np.sin(angle)])
    start = np.arange(count)[:, None] * [-way[1], way[0]] / count
    wide = np.where(np.arange(count) % 10 == 5, 1.5, 0.9)[:, None] * [-way[1], way[0]] / count
    corners = np.stack([start, start + 2 * way, start + way + wide], axis=1)
    boxes = bounding_boxes(corners / 4)
    assert (-boxes[:, 3] - boxes[:, 1]).max() < 0.01
    expected = np.arange(5, count - 1, 10)
    np.testing.assert_array_equal(find_overlaps(corners).pairs, np.stack([expected, expected + 1], axis=1))


def test_overlaps_of_a_layout_begin_at_its_seams():
    result = coneflat.flatten(*shapes.genus(2), charts="one")
    overlaps = find_overlaps(result.uv, result.uv_faces)
    assert len(overlaps.pairs)
    assert overlaps.fraction == pytest.approx(sampled(result.corner_uv), abs=2e-3)
    by_corner = find_overlaps(result.corner_uv)
    np.testing.assert_array_equal(by_corner.pairs, overlaps.pairs)
    assert by_corner.area == pytest.approx(overlaps.area, abs=1e-15)


@pytest.mark.parametrize(
    ("points", "triangles", "kind", "message"),
    [
        (np.zeros((3, 3)), [[0, 1, 2]], errors.ArrayShapeError, r"shape \(n, 2\), got \(3, 3\)"),
        (np.zeros((4, 2)), None, errors.ArrayShapeError, r"shape \(m, 3, 2\), got \(4, 2\)"),
        ("nothing", None, errors.ArrayShapeError, "array of numbers"),
        (np.zeros((3, 2)), [[0, 1, 3]], errors.FaceIndexError, r"outside 0\.\.2"),
        (np.full((1, 3, 2), np.nan), None, errors.NonFiniteError, "3 vertices of 3"),
        (np.zeros((0, 3, 2)), None, errors.EmptyMeshError, "no faces"),
    ],
)
def test_bad_input_is_refused(points, triangles, kind, message):
    with pytest.raises(kind, match=message):
        find_overlaps(points, triangles)


def test_bad_limit_is_refused():
    with pytest.raises(errors.OptionError, match="1 or more, got 0"):
        find_overlaps(np.zeros((1, 3, 2)), limit=0)


@pytest.mark.parametrize("limit", [0, 2, 500])
def test_groups_with_overlaps_are_those_with_pairs(monkeypatch, limit):
    """Groups may overlap one another, touch themselves, and have flipped and degenerate triangles.

    It makes no difference whether all pairs of a group are compared.
    """
    monkeypatch.setattr(overlap, "MAX_COMPARED", limit)
    random = np.random.default_rng(3)
    groups = [random.integers(0, 7, (int(random.integers(1, 5)), 3, 2)).astype(float) for _ in range(300)]
    starts = np.cumsum([0, *map(len, groups)])
    expected = [len(find_overlaps(group).pairs) > 0 for group in groups]
    assert has_overlaps(np.concatenate(groups), starts).tolist() == expected
    assert 0 < sum(expected) < len(groups)
