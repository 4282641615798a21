"""The examples: the notebook, and Catmull-Clark subdivision of a cube and of planes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from catmull_clark import catmull_clark

from coneflat import read_mesh

NOTEBOOK = Path(__file__).resolve().parents[1] / "examples" / "flatten.ipynb"


@pytest.fixture(scope="module")
def executed(tmp_path_factory):
    nbformat = pytest.importorskip("nbformat")
    client = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbformat.validate(notebook)
    folder = tmp_path_factory.mktemp("notebook")
    client.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(folder)}}).execute()
    return notebook, folder


@pytest.mark.slow
def test_results_show_themselves(executed):
    notebook, folder = executed
    pages = [
        output.data["text/html"]
        for cell in notebook.cells
        for output in cell.get("outputs", ())
        if "data" in output and "text/html" in output.data
    ]
    assert len(pages) == 2
    assert all(page.startswith("<iframe srcdoc=") and len(page) < 5e6 for page in pages)
    assert {path.name for path in folder.iterdir()} == {"sample.html", "sample.glb"}


def test_the_notebook_is_stored_without_output():
    nbformat = pytest.importorskip("nbformat")
    cells = nbformat.read(NOTEBOOK, as_version=4).cells
    assert not any(cell.get("outputs") for cell in cells)


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
    across, up = corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0]
    np.testing.assert_allclose(np.cross(across, up)[:, 2], 0.25)


@pytest.mark.slow
def test_the_script(tmp_path):
    lines = [f"v {x} {y} {z}" for x, y, z in CUBE] + ["f " + " ".join(map(str, side + 1)) for side in SIDES]
    (tmp_path / "cube.obj").write_text("\n".join(lines) + "\n")
    subprocess.run([sys.executable, EXAMPLE, "cube.obj", "ball.obj", "3"], cwd=tmp_path, check=True)
    ball = read_mesh(tmp_path / "ball.obj")
    assert len(ball.corners) == 4 * 6 * 4**3
    radius = np.linalg.norm(ball.vertices, axis=1)
    # The limit of a vertex of valence 3 is (3 P + 4 R + F) / 8 in its terms: between the extremes of a round body.
    assert radius.max() / radius.min() == pytest.approx(1, abs=0.15)
