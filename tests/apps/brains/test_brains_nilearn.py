"""Flat maps of the cortex beside nilearn, which reads them and has the surfaces of FreeSurfer's average subject."""
# ruff: noqa: F811  (fixtures that are imported)

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest
from test_brains import flat, folder  # noqa: F401

import coneflat
from coneflat.apps.brains import flatten_cortex, measure_flat, read_flat

nibabel = pytest.importorskip("nibabel")
nilearn = pytest.importorskip("nilearn")


def test_a_gifti_map_is_read(flat, tmp_path):
    from nilearn.surface import load_surf_mesh

    path = flat.save(tmp_path / "lh.flat.gii")
    points, faces = nibabel.load(path).agg_data("pointset"), nibabel.load(path).agg_data("triangle")
    mesh = load_surf_mesh(str(path))
    assert np.array_equal(mesh.coordinates, points)
    assert np.array_equal(mesh.faces, faces)


def fsaverage(name):
    return gzip.decompress(
        (Path(nilearn.__file__).parent / f"datasets/data/fsaverage5/{name}.gii.gz").read_bytes()
    )


@pytest.mark.parametrize("kind", ["pial", "white"])
def test_freesurfers_own_map_is_worse_in_all_measures(tmp_path, kind):
    for name, content in (("lh.surface", fsaverage(f"{kind}_left")), ("lh.flat", fsaverage("flat_left"))):
        (tmp_path / f"{name}.gii").write_bytes(content)
    surface = tmp_path / "lh.surface.gii"
    theirs = measure_flat(read_flat(tmp_path / "lh.flat.gii", surface))
    assert theirs.uv.distortion.qc_mean == pytest.approx(1.595, abs=0.005)
    missing = np.ones(10242, np.float32)
    missing[coneflat.read_mesh(tmp_path / "lh.flat.gii").triangles] = 0
    nibabel.freesurfer.write_morph_data(tmp_path / "lh.curv", missing)
    ours = flatten_cortex(surface, remove=[f"{tmp_path}/lh.curv"])
    ours = measure_flat(ours.uv_mesh(tmp_path / "x.gii"))
    assert ours.uv.distortion.qc_mean < theirs.uv.distortion.qc_mean
    assert ours.uv.distortion.area_std < theirs.uv.distortion.area_std
    assert (ours.metric < theirs.metric, ours.areal < theirs.areal, ours.inverted) == (True, True, 0)


@pytest.mark.parametrize("side", ["left", "right"])
def test_maps_lie_as_freesurfers_do(tmp_path, side):
    """Superior is up, and anterior is on the side of the hemisphere, to half a right angle."""
    for name in ("pial", "flat"):
        (tmp_path / f"surface.{name}.gii").write_bytes(fsaverage(f"{name}_{side}"))
    surface, theirs = (coneflat.read_mesh(tmp_path / f"surface.{name}.gii") for name in ("pial", "flat"))
    missing = np.ones(10242, np.float32)
    missing[theirs.triangles] = 0
    nibabel.freesurfer.write_morph_data(tmp_path / "wall.curv", missing)
    ours = flatten_cortex(tmp_path / "surface.pial.gii", remove=[f"{tmp_path}/wall.curv"])

    def angles(points, vertices):
        placed = np.column_stack([surface.vertices[vertices], np.ones(len(vertices))])
        affine = np.linalg.lstsq(placed, points[vertices, :2], rcond=None)[0]
        return np.degrees(np.arctan2(affine[1:3, 1], affine[1:3, 0]))

    off = angles(ours.points, np.unique(ours.faces)) - angles(theirs.vertices, np.unique(theirs.triangles))
    assert np.abs((off + 180) % 360 - 180).max() < 45
