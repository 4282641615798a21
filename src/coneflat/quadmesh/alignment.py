"""The seamless map of a surface: the layout of a flattening, in units of a grid and along preferred directions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..base import BoolArray, ComplexArray, FloatArray, IntArray
from ..errors import GridError
from ..geometry import (
    as_complex,
    complex_sums,
    corner_angles,
    double_areas,
    edge_lengths,
    mollify,
    sides_between,
    signed_double_areas,
)
from ..mesh.connectivity import TriangleMesh
from ..result import Flattening
from .cross_field import SHARP_ANGLE, halfedge_angles, preferred_directions
from .grid_layout import GridLayout, Sides, at_origin, find_sides, joined_charts
from .options import GRID_TOLERANCE

# Bounds of the largest coordinate: beyond, areas and their products overflow or vanish.
MIN_COORDINATE, MAX_COORDINATE = 1e-60, 1e60


def aligned(result: Flattening, size: float, sharp_angle: float = SHARP_ANGLE) -> GridLayout:
    """Return the layout of a flattening, rotated so that the grid is aligned with creases and boundaries.

    Charts are joined at some seams, and a cone of each component is at the origin.

    Args:
        result: a flattening with quantised cones.
        size: edge length of a square in model units.
        sharp_angle: dihedral angle of edges that are creases, radians.

    Raises:
        GridError: triangles are flipped.
        SeamError: the sides of a seam are not congruent.
    """
    mesh = TriangleMesh(result.vertices, result.faces)
    largest = float(np.abs(result.vertices).max())
    if not MIN_COORDINATE < largest < MAX_COORDINATE:
        raise GridError(f"the largest coordinate is {largest:.3g}, out of range for quads: scale the mesh")
    side_lengths = edge_lengths(mesh.vertices, mesh.faces) if result.lengths is None else result.lengths
    lengths, _ = mollify(side_lengths, mesh)
    flat, bad = signed_double_areas(result.corner_uv), int((~has_area(result)).sum())
    if bad:
        raise GridError(f"{bad} of {len(flat):,} triangles of the layout are flipped or have no area")
    area = float(double_areas(lengths).sum()) / 2
    scale = np.sqrt(area / size**2 / (flat.sum() / 2))
    points = scale * as_complex(result.uv)
    cones = np.setdiff1d(result.cones, np.flatnonzero(mesh.is_boundary_vertex))
    apart = GridLayout(mesh, lengths, result.uv_faces, points, cones, Sides(), size)
    layout, component = joined_charts(apart)
    is_straight, angles = _side_angles(layout, component)
    angles = np.where(is_straight, angles, _preferred_angles(layout, component, sharp_angle))
    layout = replace(layout, points=layout.points * np.exp(-1j * angles)[component])
    return at_origin(replace(layout, sides=find_sides(layout, is_straight[component])), component)


def has_area(result: Flattening) -> BoolArray:
    """Return (m,) whether triangles of a flattening have an area and are not flipped."""
    flat, sides = signed_double_areas(result.corner_uv), np.abs(sides_between(result.corner_uv))
    return flat > GRID_TOLERANCE**2 * sides.max(axis=1) ** 2


def _preferred_angles(layout: GridLayout, component: IntArray, sharp_angle: float) -> FloatArray:
    """Return (c,) the rotation of each component up to quarter turns at which it follows preferred directions best."""
    mesh, (starts, ends) = layout.mesh, layout.ends
    preferred = preferred_directions(mesh, sharp_angle).combined
    # A triangle rotates as its half-edges do on average.
    directions_before = layout.lengths.ravel() * np.exp(1j * halfedge_angles(corner_angles(layout.lengths)))
    turned = (
        ((layout.points[ends] - layout.points[starts]) * directions_before.conj()).reshape(-1, 3).sum(axis=1)
    )
    return _directions(
        np.abs(preferred), turned * np.exp(0.25j * np.angle(preferred)), component, component[starts[::3]]
    )


def _side_angles(layout: GridLayout, component: IntArray) -> tuple[BoolArray, FloatArray]:
    """Return (c,) whether the boundary of each component consists of sides at right angles, and (c,) their direction.

    component: (u,) the component of each point.
    """
    starts, ends = (points[layout.border] for points in layout.ends)
    vector, label = layout.points[ends] - layout.points[starts], component[starts]
    angles = _directions(np.abs(vector), vector, component, label)
    off = np.zeros(len(angles))
    np.maximum.at(off, label, np.abs(np.angle((vector * np.exp(-1j * angles[label])) ** 4) / 4))
    return (np.bincount(label, minlength=len(angles)) > 0) & (off <= GRID_TOLERANCE), angles


def _directions(
    weights: FloatArray, vectors: ComplexArray, component: IntArray, label: IntArray
) -> FloatArray:
    """Return (c,) the mean direction of weighted vectors up to quarter turns; `label` is the component of each."""
    fourth = weights * (vectors / np.abs(vectors)) ** 4
    return np.angle(complex_sums(label, fourth, int(component.max(initial=-1)) + 1)) / 4
