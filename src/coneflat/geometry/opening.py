"""Opening of triangles without area: their edges are lengthened until every triangle has angles."""

from __future__ import annotations

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..base.text import list_some, plural
from ..errors import DegenerateFaceError
from ..mesh.connectivity import TriangleMesh
from .triangles import as_triples, double_areas

# The thickness of a triangle is twice its area divided by the square of its longest side; the flattest triangles of
# real scans have 1e-3. At ZERO_AREA a triangle counts as having no area. At THIN_AREA it is opened: the scale of a
# metric is accurate to 1e-13, which is a fortieth of the slack of the longest side of such a triangle.
ZERO_AREA, THIN_AREA = 1e-7, 2e-6
# The thickness of opened triangles. They are laid out about as thin as they are, which keeps their share of the
# distortion small: with 1e-3, single triangles have raised a mean QC distortion of 1.05 to 2.34.
OPENED_AREA, MAX_OPENED = 4e-6, 0.25
# Length that an edge of a triangle without any length gets, and height of an opened triangle, relative to the mean
# edge: a million roundings of coordinates in the plane.
POINT_SIZE, MIN_HEIGHT = 1e-5, 1e-10
# Thickness of triangles that may keep a solve from converging, and length added to all edges then, relative to the
# mean.
RISKY_AREA, SLACK = 1e-4, 1e-5
# Relative difference of lengths that count as equal.
EQUAL_LENGTHS = 1e-9
# Rounds of lengthening, and of those the number after which all triangles grow alike: each may thin a neighbour.
MAX_ROUNDS, ROUNDS_ALONE = 40, 4
# Halvings of the interval of a growth, as logarithms.
BISECTIONS = 40


def mollify(
    lengths: FloatArray, mesh: TriangleMesh, *, strict: bool = False, names: IntArray | None = None
) -> tuple[FloatArray, str | None]:
    """Return lengths with which every triangle has area, and a note if one had none.

    The shortest edges of thin triangles are lengthened as little as possible, so that hardly any other triangle
    changes. (N. Sharp and K. Crane 2020, Section 4.5, add the same length to all edges of the mesh.)

    Args:
        lengths: (m, 3) side lengths, equal on both sides of an edge.
        mesh: the mesh.
        strict: raise an error for triangles without area instead.
        names: (m,) face numbers of the input, for messages.

    Returns:
        (m, 3) the lengths, and the note or None.

    Raises:
        DegenerateFaceError: `strict` is True and a triangle has no area, or the total area of the mesh is zero.
    """
    lengths = as_triples(lengths)
    thick = thickness(lengths)
    if not (thick <= THIN_AREA).any():
        return lengths, None
    bad = np.flatnonzero(thick <= ZERO_AREA)
    if not len(bad):
        return opened_lengths(lengths, mesh), None
    if double_areas(lengths).sum() <= ZERO_AREA * (lengths.max(axis=1) ** 2).sum():
        raise DegenerateFaceError(
            f"the mesh has no area: {plural(len(lengths), 'triangle')} on a line or point"
        )
    where = list_some(bad if names is None else names[bad])
    if strict:
        raise DegenerateFaceError(
            f"{plural(len(bad), 'triangle')} without area: {where}; "
            "leave out --strict (strict=False) to open them by a tiny perturbation"
        )
    opened = opened_lengths(lengths, mesh)
    change = float((opened - lengths).max() / lengths.mean())
    note = (
        f"Opened {plural(len(bad), 'triangle')} without area ({where}) by lengthening their edges by up to "
        f"{change:.1e} of the mean edge."
    )
    return opened, note


def with_slack(lengths: FloatArray) -> FloatArray:
    """Return (m, 3) lengths of a mesh that has thin triangles, all longer by the same small length, which opens them.

    For meshes of so many thin triangles that a metric cannot be solved for otherwise. Thin triangles become thicker
    than by `mollify`, a thousandth of their length, and are distorted as much more.
    """
    return np.asarray(lengths + SLACK * lengths.mean())


def thickness(lengths: FloatArray) -> FloatArray:
    """Return (m,) twice the area of triangles divided by the square of their longest side; 0 without any length."""
    lengths = as_triples(lengths)
    a, b, c = lengths.T
    squares = np.maximum(np.maximum(a, b), c) ** 2
    return np.divide(double_areas(lengths), squares, out=np.zeros(len(lengths)), where=squares > 0)


def opened_lengths(lengths: FloatArray, mesh: TriangleMesh) -> FloatArray:
    """Return (m, 3) lengths with which every triangle is thicker than `THIN_AREA`."""
    sides = mesh.halfedge_edges.reshape(-1, 3)
    of_edge = lengths.ravel()[mesh.edge_halfedges[:, 0]]
    mean = float(lengths.mean())
    for k in range(MAX_ROUNDS):
        thin = np.flatnonzero(thickness(of_edge[sides]) <= THIN_AREA)
        if not len(thin):
            break
        lengths = of_edge[sides[thin]]
        # Where that thins the neighbours again and again, all sides grow alike.
        grows = is_shortest(lengths) if k < ROUNDS_ALONE else np.ones(lengths.shape, dtype=bool)
        growth = needed_growth(lengths, grows, mean)
        if k >= ROUNDS_ALONE:
            growth[:] = growth.max()
        longer = np.zeros(len(of_edge))
        np.maximum.at(longer, sides[thin], growth[:, None] * grows)
        of_edge = of_edge + longer
    else:
        of_edge = of_edge + POINT_SIZE * mean
    return np.asarray(of_edge[sides])


def is_shortest(lengths: FloatArray) -> BoolArray:
    """Return (k, 3) the shortest side of triangles, several if they are equal up to rounding."""
    return np.asarray(lengths <= lengths.min(axis=1, keepdims=True) * (1 + EQUAL_LENGTHS))


def needed_growth(lengths: FloatArray, grows: BoolArray, mean: float) -> FloatArray:
    """Return (k,) the smallest growth of some sides that opens triangles (k, 3).

    Args:
        lengths: (k, 3) side lengths; they may break the triangle inequality.
        grows: (k, 3) the sides that grow.
        mean: the mean length of all edges of the mesh.
    """
    longest = lengths.max(axis=1)
    smallest = np.finfo(np.float64).tiny
    aim = np.clip(MIN_HEIGHT * mean / np.maximum(longest, smallest), OPENED_AREA, MAX_OPENED)
    slack = np.minimum(lengths.sum(axis=1) - 2 * longest, 0.0)
    low = np.log(np.maximum(OPENED_AREA**2 * longest, smallest))
    high = np.log(np.maximum(4 * aim * longest - slack, smallest))
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        suffices: BoolArray = thickness(lengths + np.exp(middle)[:, None] * grows) >= aim
        low, high = np.where(suffices, low, middle), np.where(suffices, middle, high)
    return np.maximum(np.exp(high), np.where(longest > 0, 0.0, POINT_SIZE * mean))
