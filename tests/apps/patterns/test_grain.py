"""The direction of the grain."""

from __future__ import annotations

import numpy as np
import pytest
from flat_pieces import two_pieces
from polyhedra import uv_sphere
from shapes import grid

import coneflat
from coneflat.errors import OptionError

BALL = uv_sphere()
ELLIPSOID = BALL.vertices * [1.0, 1.3, 0.8]


def grains(pattern) -> int:
    """The number of grain lines: vertical lines that are not at the border of anything."""
    return sum(
        line.layer == "mark" and len(line.points) == 2 and not line.dashes and np.ptp(line.points[:, 0]) < 1e-9
        and np.ptp(line.points[:, 1]) >= 10
        for line in pattern.drawing().lines
    )  # fmt: skip


def flat_direction(pattern, direction):
    """Return the mean direction (2,) in the plane of a direction on the surface of a flat pattern."""
    surface = pattern.surface
    edges = surface.mesh.vertices[surface.mesh.faces]
    sides, flat = edges[:, 1:] - edges[:, :1], surface.places[:, 1:] - surface.places[:, :1]
    # flat = gradient @ side for both sides of a triangle.
    normal = np.cross(sides[:, 0], sides[:, 1])
    frame = np.stack([sides[:, 0], sides[:, 1], normal], axis=2)
    image = np.concatenate([flat.transpose(0, 2, 1), np.zeros((len(flat), 2, 1))], axis=2)
    moved = (image @ np.linalg.inv(frame)) @ np.asarray(direction)
    return moved.mean(axis=0) / np.linalg.norm(moved.mean(axis=0))


@pytest.mark.parametrize("grain", [(1.0, 1.0, 0.0), (0.0, 1.0, 0.0), (-3.0, 1.0, 5.0)])
def test_the_grain_is_along_the_second_axis_of_a_flat_piece(grain):
    vertices, faces = grid(4, 6)
    pattern = coneflat.pattern(vertices, faces, unit="cm", grain=grain)
    assert abs(flat_direction(pattern, [*grain[:2], 0.0])[1]) == pytest.approx(1.0, abs=1e-6)
    assert pattern.settings["grain"] == pytest.approx(np.array(grain) / np.linalg.norm(grain))


def test_the_axis_is_the_grain_by_default():
    options = {"unit": "cm", "scale": 5, "strain": "5%"}
    results = [
        coneflat.pattern(ELLIPSOID, BALL.faces, axis=(0, 1, 0), **options, **grain)
        for grain in ({}, {"grain": (0, 2, 0)}, {"grain": (1, 0, 0)})
    ]
    assert results[0].settings["grain"] == (0, 1, 0)
    assert np.array_equal(results[0].surface.points, results[1].surface.points)
    # The height is along the axis, not along the grain.
    heights = [
        coneflat.pattern(ELLIPSOID, BALL.faces, height="20cm", strain="5%", axis=(0, 1, 0), **grain)
        for grain in ({}, {"grain": (1, 0, 0)})
    ]
    for result in heights:
        assert np.ptp(result.surface.mesh.vertices[:, 1]) == pytest.approx(200, rel=0.01)


@pytest.mark.parametrize("kind", ["cloth", "gores"])
def test_without_a_grain_there_is_no_arrow(kind):
    options = {"kind": kind, "unit": "cm", "scale": 5, "axis": (0, 0, 1)}
    options |= {"strain": "5%"} if kind == "cloth" else {"gores": 4}
    result = coneflat.pattern(BALL.vertices, BALL.faces, **options)
    assert grains(result) == result.piece_count
    without = coneflat.pattern(BALL.vertices, BALL.faces, grain="none", **options)
    assert grains(without) == 0
    assert not without.has_grain
    share, share_without = (pattern.report()["sheet_share"] for pattern in (result, without))
    assert share_without >= 0.9 * share


def test_the_stretch_along_the_grain_is_that_of_the_given_direction():
    options = {"unit": "cm", "scale": 5, "strain": "2%", "stretch_weft": "12%", "axis": (0, 0, 1)}
    for grain in ((0, 0, 1), (1, 0, 0)):
        pattern = coneflat.pattern(ELLIPSOID, BALL.faces, grain=grain, **options)
        vectors = pattern.surface.edges.vectors(pattern.surface.points)
        shares = vectors**2 / (vectors**2).sum(axis=1)[:, None]
        assert (np.abs(pattern.strains) <= (0.12 * shares[:, 0] + 0.02 * shares[:, 1]) * (1 + 1e-6)).all()


@pytest.mark.parametrize("kind", ["net", "sheet"])
def test_nets_and_sheets_have_no_grain(kind):
    with pytest.raises(OptionError, match=f"grain and kind {kind} cannot be combined"):
        coneflat.pattern(BALL.vertices, BALL.faces, kind=kind, unit="cm", grain=(0, 1, 0))
    assert not two_pieces(kind).has_grain


@pytest.mark.parametrize("grain", ["some", (0, 0, 0), (1, 2), 3.0])
def test_other_grains_are_errors(grain):
    with pytest.raises(OptionError, match="grain must be"):
        coneflat.pattern(BALL.vertices, BALL.faces, unit="cm", grain=grain)


def test_a_stretch_along_the_grain_needs_a_grain():
    with pytest.raises(OptionError, match="grain none and stretch_warp or stretch_weft cannot be combined"):
        coneflat.pattern(BALL.vertices, BALL.faces, unit="cm", grain="none", stretch_warp="2%")
