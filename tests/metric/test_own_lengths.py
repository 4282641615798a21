"""A metric that the user brings: side lengths instead of distances between vertices."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

import coneflat
from coneflat import errors

HILL = shapes.hill()
SPHERE = shapes.sphere(2)


def lengths_of(vertices, faces):
    return coneflat.geometry.edge_lengths(np.asarray(vertices, dtype=float), np.asarray(faces))


@pytest.mark.parametrize("mesh", [HILL, SPHERE])
def test_lengths_between_the_vertices_change_nothing(mesh):
    plain, with_lengths = coneflat.flatten(*mesh), coneflat.flatten(*mesh, lengths=lengths_of(*mesh))
    np.testing.assert_allclose(with_lengths.corner_uv, plain.corner_uv, atol=1e-9)
    assert with_lengths.distortion.qc_mean == pytest.approx(plain.distortion.qc_mean, abs=1e-9)
    assert with_lengths.notes == plain.notes
    assert with_lengths.settings["lengths"] == "given"


def test_the_lengths_are_flattened_and_not_the_positions():
    """A flat sheet's lengths on the vertices of a hill: its map is an isometry of the sheet."""
    vertices, faces = HILL
    sheet = np.asarray(vertices) * [1, 1, 0]
    result = coneflat.flatten(vertices, faces, lengths=lengths_of(sheet, faces))
    assert len(result.cones) == 0
    assert result.distortion.qc_max == pytest.approx(1, abs=1e-9)
    assert result.distortion.area_std == pytest.approx(0, abs=1e-9)
    assert coneflat.flatten(vertices, faces).distortion.area_std > 1e-3


def test_boundary_lengths_are_the_prescribed_ones():
    vertices, faces = HILL
    lengths = lengths_of(np.asarray(vertices) * [2, 1, 1], faces)
    result = coneflat.flatten(vertices, faces, lengths=lengths, boundary="lengths", cones="none")
    assert not [note for note in result.notes if "boundary" in note]
    mesh = coneflat.TriangleMesh(np.asarray(vertices, dtype=float), np.asarray(faces))
    at = result.corner_uv @ [1, 1j] / result.uv_scale
    flat = np.abs(at[:, [2, 0, 1]] - at[:, [1, 2, 0]])
    sides = mesh.edge_halfedges[mesh.is_boundary_edge, 0]
    np.testing.assert_allclose(flat.ravel()[sides], lengths.ravel()[sides], rtol=1e-9)


def test_cones_are_those_of_the_metric():
    """A sphere's lengths on positions that are anything: the cones of the sphere."""
    vertices, faces = SPHERE
    wild = np.random.default_rng(1).normal(size=np.shape(vertices))
    cones = coneflat.find_cones(wild, faces, lengths=lengths_of(vertices, faces), distortion=0.3)
    assert len(cones.vertices) == len(coneflat.find_cones(vertices, faces, distortion=0.3).vertices)


def test_archives_preserve_lengths(tmp_path):
    result = coneflat.flatten(*HILL, lengths=lengths_of(*HILL))
    again = coneflat.read_flattening(result.save(tmp_path / "hill.npz"))
    np.testing.assert_array_equal(again.lengths, result.lengths)
    written = result.as_written(".glb")
    assert written.distortion.qc_mean == pytest.approx(result.distortion.qc_mean, abs=1e-6)


@pytest.mark.parametrize(
    ("change", "kind", "message"),
    [
        (lambda lengths: lengths[:-1], errors.ArrayShapeError, "lengths must have the shape"),
        (lambda lengths: lengths * np.nan, errors.NonFiniteError, "NaN or infinite"),
        (lambda lengths: -lengths, errors.MeshError, "not positive"),
        (lambda lengths: lengths * [1, 1, 9], errors.MeshError, "different lengths|triangle inequality"),
    ],
)
def test_invalid_lengths_are_refused(change, kind, message):
    with pytest.raises(kind, match=message):
        coneflat.flatten(*HILL, lengths=change(lengths_of(*HILL)))


def test_lengths_of_files_are_refused(tmp_path):
    path = coneflat.flatten(*HILL).save(tmp_path / "hill.obj")
    with pytest.raises(errors.OptionError, match="give vertices and faces"):
        coneflat.flatten(path, lengths=lengths_of(*HILL))
