"""The example of Catmull-Clark subdivision: what it does to a cube, to planes and to boundaries."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from coneflat import read_mesh

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples"))
from catmull_clark import catmull_clark

EXAMPLE = Path(__file__).resolve().parents[1] / "examples" / "catmull_clark.py"
CUBE = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
SIDES = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])


def squares(columns, rows):
    """Return a sheet of unit squares."""
    x, y = np.meshgrid(np.arange(columns + 1.0), np.arange(rows + 1.0), indexing="ij")
    index = np.arange(x.size).reshape(x.shape)
    quads = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], axis=2).reshape(-1, 4)
    return np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1), quads


def test_a_cube_by_hand():
    vertices, quads = catmull_clark(CUBE, SIDES)
    assert len(vertices) == 8 + 12 + 6
    assert len(quads) == 24
    # (F + 2 R + 0 P) / 3 with F = 1/3 and R = 2/3 of the corner; edges (1 + 1/2) / 2; middles of sides.
    np.testing.assert_allclose(vertices[:8], 5 / 9 * CUBE, atol=1e-15)
    np.testing.assert_allclose(np.sort(np.abs(vertices[8:20]), axis=1), [[0, 0.75, 0.75]] * 12, atol=1e-15)
    np.testing.assert_allclose(np.sort(np.abs(vertices[20:]), axis=1), [[0, 0, 1]] * 6, atol=1e-15)
    # Closed, and oriented as before: the volume of a solid with corners that are cut off.
    sides = np.stack([quads.ravel(), np.roll(quads, -1, axis=1).ravel()], axis=1)
    assert len(np.unique(sides, axis=0)) == len(np.unique(np.sort(sides, axis=1), axis=0)) * 2 == 96
    a, b, c, d = np.moveaxis(vertices[quads], 1, 0)
    volume = ((np.cross(a, b) * c).sum() + (np.cross(a, c) * d).sum()) / 6
    assert 2 < volume < 8


def test_linear_functions_are_kept():
    sheet, quads = squares(5, 4)
    vertices, finer = catmull_clark(sheet, quads)
    # Edges and middles of a regular sheet halve its squares; inside, and along sides, vertices stay.
    np.testing.assert_allclose(vertices[: len(sheet)], sheet, atol=1e-15)
    corners = vertices[finer]
    np.testing.assert_allclose(np.ptp(corners, axis=1), [[0.5, 0.5, 0]] * len(finer), atol=1e-12)
    one, two = corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0]
    np.testing.assert_allclose(np.cross(one, two)[:, 2], 0.25)


def test_boundaries_are_splines_of_their_own():
    sheet, quads = squares(4, 3)
    lifted = sheet + [0, 0, 1] * (np.random.default_rng(0).normal(size=(len(sheet), 1)))
    bent = lifted.copy()
    inside = (sheet[:, 0] % 4 != 0) & (sheet[:, 1] % 3 != 0)
    bent[inside, 2] += 7
    one, two = catmull_clark(lifted, quads)[0], catmull_clark(bent, quads)[0]
    border = np.flatnonzero(~inside)
    np.testing.assert_array_equal(one[border], two[border])
    # 1/8, 3/4, 1/8 of the neighbours along it.
    row = np.flatnonzero(sheet[:, 0] == 0)
    z = lifted[row, 2]
    np.testing.assert_allclose(one[row, 2][1:-1], z[:-2] / 8 + 3 * z[1:-1] / 4 + z[2:] / 8)
    assert one[row[0], 2] == z[0]


def test_the_script(tmp_path):
    lines = [f"v {x} {y} {z}" for x, y, z in CUBE] + ["f " + " ".join(map(str, side + 1)) for side in SIDES]
    (tmp_path / "cube.obj").write_text("\n".join(lines) + "\n")
    subprocess.run([sys.executable, EXAMPLE, "cube.obj", "ball.obj", "3"], cwd=tmp_path, check=True)
    ball = read_mesh(tmp_path / "ball.obj")
    assert len(ball.corners) == 4 * 6 * 4**3
    radius = np.linalg.norm(ball.vertices, axis=1)
    # The limit of a vertex of valence 3 is (3 P + 4 R + F) / 8 in its terms: between the extremes of a round body.
    assert radius.max() / radius.min() == pytest.approx(1, abs=0.15)
