"""Edges of a layout split in the middle: the same surface, seams still rigid copies, all kinds of triangles."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

from coneflat import flatten
from coneflat.geometry.planar import signed_double_areas
from coneflat.geometry.triangles import double_areas, edge_lengths
from coneflat.grid.aligned import aligned
from coneflat.grid.split import split_edges
from coneflat.layout.relax.seam_chains import find_chains
from coneflat.mesh import TriangleMesh

OPTIONS = {"quantise": np.pi / 2, "charts": "one", "min_cone_angle": 1.5 * np.pi, "max_cone_angle": 3 * np.pi}


@pytest.mark.parametrize("share", [0.0, 0.3, 0.7, 1.0])
@pytest.mark.parametrize("boundary", ["free", "straight"])
def test_splitting_keeps_the_surface_and_its_seams(share, boundary):
    shape = shapes.hill() if boundary == "straight" else shapes.sphere(2)
    sharpest = {"min_cone_angle": np.pi / 2} if boundary == "straight" else {}
    layout = aligned(flatten(*shape, **{**OPTIONS, **sharpest}, boundary=boundary), 100, None)
    is_split = np.random.default_rng(3).random(len(layout.mesh.edges)) < share
    split = split_edges(layout, is_split)
    before, mesh = layout.mesh, split.mesh
    assert len(mesh.vertices) == len(before.vertices) + is_split.sum()
    inner = 2 - before.is_boundary_edge.astype(int)
    assert len(mesh.faces) == len(before.faces) + (inner * is_split).sum()
    assert mesh.euler_characteristic == before.euler_characteristic
    assert isinstance(mesh, TriangleMesh)
    # Lengths are those between positions, areas add up, in space and in the plane, and none is turned over.
    assert split.lengths == pytest.approx(edge_lengths(mesh.vertices, mesh.faces))
    assert double_areas(split.lengths).sum() == pytest.approx(double_areas(layout.lengths).sum())
    flat = [np.stack([z.points.real, z.points.imag], axis=1)[z.corners] for z in (split, layout)]
    assert signed_double_areas(flat[0]).min() > 0
    assert signed_double_areas(flat[0]).sum() == pytest.approx(signed_double_areas(flat[1]).sum())
    # Rigid seams, or this raises; a seam edge that is split is two.
    chains, old = (find_chains(z.mesh, z.corners, z.points, z.cones) for z in (split, layout))
    assert len(chains.edges) == len(old.edges) + is_split[old.edges].sum()
    # Sides of the boundary are what they were, with the points in between.
    assert len(split.sides.axis) == len(layout.sides.axis)
    assert sorted(split.sides.corners) == sorted(layout.sides.corners)
    border = (is_split & before.is_boundary_edge).sum() if boundary == "straight" else 0
    assert len(split.sides.points) == len(layout.sides.points) + border
