"""Files of welded vertices name vertices that are there."""

from __future__ import annotations

import numpy as np
import pytest
from shapes import join, sphere

import coneflat
from coneflat.files import read_mesh

trimesh = pytest.importorskip("trimesh")


def doubled(folder, ending):
    """Write a ball of which every corner has a vertex of its own."""
    vertices, faces = sphere(2)
    loose = trimesh.Trimesh(
        vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3), process=False
    )
    path = folder / f"ball{ending}"
    loose.export(path)
    return path, vertices, faces


@pytest.mark.parametrize("ending", [".stl", ".ply", ".glb", ".off", ".obj"])
def test_an_obj_of_welded_vertices_has_these_and_no_others(tmp_path, ending):
    path, vertices, faces = doubled(tmp_path, ending)
    source = read_mesh(path, weld=True)
    assert len(source.vertices) == len(vertices)
    out = coneflat.flatten(source).save(tmp_path / "flat.obj")
    lines = out.read_text().splitlines()
    # An OBJ keeps its own vertices, and its faces their numbers.
    kept = faces.size if ending == ".obj" else len(vertices)
    assert sum(line.startswith("v ") for line in lines) == kept
    named = {int(word.split("/")[0]) for line in lines if line.startswith("f ") for word in line.split()[1:]}
    assert named == set(range(1, kept + 1))
    assert len(read_mesh(out, weld=True).vertices) == len(vertices)
    seen = trimesh.load(out, process=False, maintain_order=True)
    np.testing.assert_allclose(seen.vertices[seen.faces], vertices[faces], atol=1e-6)


def test_what_is_written_of_a_welded_mesh_can_be_flattened_again(tmp_path):
    path, _, faces = doubled(tmp_path, ".stl")
    out = coneflat.flatten(path).save(tmp_path / "flat.obj")
    again = coneflat.flatten(out)
    assert len(again.faces) == len(faces)
    assert again.distortion.charts == 1


def test_the_parts_of_a_welded_vertex_that_is_split_again_have_one_number_in_an_obj(tmp_path):
    ball, other = sphere(1), sphere(1)
    top = ball[0][ball[0][:, 2].argmax()]
    shifted = (other[0] + top - other[0][other[0][:, 2].argmin()], other[1])
    vertices, faces = join(ball, shifted)
    trimesh.Trimesh(vertices, faces, process=False).export(tmp_path / "two.stl")
    result = coneflat.flatten(tmp_path / "two.stl", repair=True)
    assert result.distortion.charts == 2
    out = result.save(tmp_path / "two.obj")
    assert len(read_mesh(out).vertices) == len(vertices) - 1
    seen = trimesh.load(out, process=False, maintain_order=True)
    np.testing.assert_allclose(seen.vertices[seen.faces], vertices[faces], atol=1e-6)
