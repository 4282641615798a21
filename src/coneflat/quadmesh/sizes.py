"""Target sizes of quads: one for each vertex, or smaller ones where the surface is more curved."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from ..base import FloatArray
from ..errors import OptionError
from ..geometry import double_areas, edge_lengths, mollify, signed_double_areas
from ..measures import quantile
from ..mesh import NEXT, PREVIOUS, CheckedMesh
from ..mesh.connectivity import TriangleMesh
from ..source import Source, vertex_numbers
from .cross_field import CURVATURE_SCALE, curvature_tensors, diffused
from .features import vertex_graph
from .grid_layout import GridLayout
from .integer_map import IntegerGrid


def target_scales(source: Source, checked: CheckedMesh, sizes: Any) -> FloatArray:
    """Return (n,) the target log conformal factor of a flattening at the vertices: minus the log of the sizes.

    Args:
        source: the input.
        checked: the same, checked.
        sizes: relative sizes of quads, one for each vertex of the input or the name of a vertex property; or
            "curvature".

    Raises:
        OptionError: the sizes are not positive numbers.
    """
    if isinstance(sizes, str) and sizes == "curvature":
        return _scales_of_curvature(checked.mesh)
    numbers = vertex_numbers("sizes", sizes, source.input_mesh, checked.vertex_origin)
    if numbers is None or not numbers.min() > 0:
        raise OptionError("sizes must be positive; there are some of 0")
    return -np.log(numbers)


def _scales_of_curvature(mesh: TriangleMesh, ratio: float = 4.0) -> FloatArray:
    """Return (n,) log conformal factors at which quads of the same size deviate equally from the surface.

    An edge of length h deviates by h^2 / 8 times the curvature, so that sizes are inverse to its root. The curvature is
    the root of the sum of the squared principal curvatures, averaged over the same radius as their directions. Values
    are bounded around their median, such that sizes differ by `ratio` at most, and smoothed over twice this radius.
    """
    lengths, _ = mollify(edge_lengths(mesh.vertices, mesh.faces), mesh)
    areas, count = double_areas(lengths) / 2, len(mesh.vertices)
    radius = CURVATURE_SCALE * float(np.sqrt(areas.sum()))
    tensors = curvature_tensors(mesh, areas, radius)
    squared = np.maximum((tensors**2).sum(axis=(1, 2)), np.finfo(float).tiny)
    corners = mesh.faces.ravel()
    share = np.asarray(np.bincount(corners, areas.repeat(3) / 3, count), dtype=np.float64)
    mean = np.bincount(corners, (areas * np.log(squared) / 4).repeat(3) / 3, count) / share
    middle = quantile(mean, share, 0.5)
    bound = np.log(ratio) / 2
    return diffused(mesh, np.clip(mean - middle, -bound, bound)[:, None], 2 * CURVATURE_SCALE)[:, 0]


def with_target_lengths(layout: GridLayout, log_scale: FloatArray) -> GridLayout:
    """Return a layout whose triangles have the lengths at which all squares have the same size, and its area.

    The grid is relaxed towards isometry; with the lengths of the surface, this would even out the requested sizes.

    log_scale: (k,) the target log conformal factor at the first vertices of its mesh.
    """
    mesh = layout.mesh
    scale = extended(log_scale, mesh)[mesh.faces]
    longer = layout.lengths * np.exp((scale[:, NEXT] + scale[:, PREVIOUS]) / 2)
    lengths, _ = mollify(longer, mesh)
    areas = [double_areas(sides).sum() for sides in (layout.lengths, lengths)]
    return replace(layout, lengths=lengths * np.sqrt(areas[0] / areas[1]))


def extended(values: FloatArray, mesh: TriangleMesh) -> FloatArray:
    """Return (n,) values at all vertices: given ones at the first vertices, then means of the neighbours that have one.

    Refinement of a mesh appends vertices.
    """
    values_at = np.zeros(len(mesh.vertices))
    values_at[: len(values)] = values
    has_value = np.arange(len(values_at)) < len(values)
    adjacency = csr_matrix((vertex_graph(mesh) > 0).astype(np.float64))
    while not has_value.all():
        count = adjacency @ has_value.astype(np.float64)
        reached = ~has_value & (count > 0)
        values_at[reached] = (adjacency @ (values_at * has_value))[reached] / count[reached]
        has_value |= reached
    return values_at


def note_on_sizes(grid: IntegerGrid, target_scale: FloatArray) -> str:
    """Return a note on how well the sizes of the squares of a grid agree with the target sizes, up to a common factor.

    target_scale: (k,) the log conformal factor at the first vertices of the grid.
    """
    mesh = TriangleMesh(grid.vertices, grid.faces)
    number = signed_double_areas(grid.corner_grid)
    area = double_areas(edge_lengths(grid.vertices, grid.faces))
    reached = np.log(np.maximum(area, np.finfo(float).tiny) / number) / 2
    asked = -extended(target_scale, mesh)[mesh.faces].mean(axis=1)
    off, weight = reached - asked, number / number.sum()
    covariance = np.cov(np.stack([asked, reached]), aweights=weight)
    spread = np.sqrt(covariance[0, 0] * covariance[1, 1])
    low, high = (quantile(off, weight, part) for part in (0.05, 0.95))
    return (
        f"Sizes of quads have a correlation of {covariance[0, 1] / spread if spread else 1.0:.2f} with the requested "
        f"ones; the ratio of both varies by a factor of {np.exp(high - low):.2f} over 90 % of the quads."
    )
