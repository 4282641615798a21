"""What quads are used for, on whole meshes: sizes where they matter, several parts, and flattening them again."""

from __future__ import annotations

import numpy as np
import shapes
from grid_maps import quad_areas

import coneflat


def test_quads_are_more_alike_where_weights_are():
    vertices, faces = shapes.sphere(4, bumps=0.5)
    matters = vertices[:, 2] > np.quantile(vertices[:, 2], 0.7)

    def spread(weights):
        quads = coneflat.quads(vertices, faces, quads=2000, distortion=0.3, weights=weights)
        centres = quads.vertices[quads.quads].mean(axis=1)
        sizes = np.log(np.abs(quad_areas(quads))) / 2
        there = centres[:, 2] > np.quantile(vertices[:, 2], 0.7)
        return sizes[there].std()

    assert spread(np.where(matters, 100.0, 1.0)) < 0.9 * spread(None)


def test_each_part_has_its_quads():
    vertices, faces = shapes.join(shapes.sphere(3), shapes.torus())
    quads = coneflat.quads(vertices, faces, quads=1500)
    assert quads.euler_characteristic == quads.surface_euler == 2
    assert not quads.is_boundary_edge.any()


def test_quads_are_flattened_again(tmp_path):
    path = coneflat.quads(*shapes.sphere(3), quads=800).save(tmp_path / "quads.obj")
    result = coneflat.flatten(path)
    assert result.distortion.flipped == 0
    assert result.distortion.qc_mean < 1.1
    again = coneflat.read_mesh(result.save(tmp_path / "flat.obj"))
    assert (np.diff(again.offsets) == 4).all()
    assert len(again.offsets) == len(coneflat.read_mesh(path).offsets)
