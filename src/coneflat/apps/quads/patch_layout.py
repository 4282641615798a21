"""A layout with sharp edges along the axes: the patches between them, flattened with straight sides and joined."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ... import TriangleMesh
from ...base import ComplexArray, FloatArray, IntArray
from ...cones import CONE_ANGLE_PER_TRIANGLE, ConeSearch, quantise_cones
from ...errors import CurvatureError, GridError, MetricError, OptionError, SeamError
from ...geometry import as_complex, as_pairs, double_areas, signed_double_areas
from ...layout import Lines, PointConstraints, SeamChains, StretchEnergy, lay_out, relax
from ...mesh import NEXT, PREVIOUS, cut_open, tie_key
from ...metric import ExactChoices, exact_flat_metric, straight_boundary
from ...options import Options
from ...seams import find_seams
from ...stages import ConeSolution, Cut, Surface
from .features import Opened
from .layout import Layout, Sides, at_origin, find_sides, joined_charts


class PatchError(GridError):
    """A patch cannot be flattened; `faces` are its triangles."""

    def __init__(self, faces: IntArray, why: str) -> None:
        super().__init__(why)
        self.faces = faces


class CoarseError(PatchError):
    """A patch cannot be flattened as some of its triangles, `faces`, are too coarse."""


def sharp_layout(
    opened: Opened, lengths: FloatArray, size: float, options: Options, tell: Callable[[int, int], None]
) -> Layout:
    """Return a seamless layout of a mesh with sharp edges along the axes, in units of a grid.

    Args:
        opened: the mesh, opened along its sharp edges.
        lengths: (m, 3) side lengths of its triangles.
        size: of a square of the grid.
        options: what is asked of the cones inside patches.
        tell: called before each patch is flattened with its number and how many there are.

    Raises:
        CoarseError: triangles are too coarse.
        PatchError: a patch has no flat metric with angles of quarter turns.
        ConvergenceError: patches cannot be brought together, as far as is known.
        GridError: sides and seams, each turned to the nearest axis, contradict each other.
    """
    layout = _flat_patches(opened, lengths, size, options, tell)
    layout, component = joined_charts(replace(layout, points=_fitting(opened, layout)))
    flat = float(layout.double_areas().sum())
    points = layout.points * np.sqrt(float(double_areas(lengths).sum()) / flat) / size
    layout = replace(layout, points=points)
    return at_origin(replace(layout, sides=_all_sides(opened, layout, layout.chains())), component)


def _flat_patches(
    opened: Opened, lengths: FloatArray, size: float, options: Options, tell: Callable[[int, int], None]
) -> Layout:
    """Return all patches of an opened mesh, flattened at their own areas, that do not fit each other yet.

    Raises:
        CoarseError: triangles are too coarse.
        PatchError: a patch has no flat metric with angles of quarter turns.
    """
    corners = np.empty_like(opened.mesh.faces)
    points, cones, turned, count = [], [], [], 0
    parts = opened.cut.mesh.split_components()
    areas = double_areas(lengths)
    for number, (part, vertices, faces) in enumerate(parts):
        tell(number, len(parts))
        # What all have in common is the mean of squares by area, to which small ones add little.
        share = float(areas[faces].sum() / areas.mean() / len(areas))
        distortion = options.distortion * min(max(1.0, 1 / np.sqrt(len(parts) * share)), 3.0)
        try:
            plane, at, inside = _flat_patch(
                part, lengths[faces], opened.quarters[vertices], distortion, options
            )
        except (CurvatureError, MetricError, SeamError) as error:
            raise PatchError(faces, str(error)) from error
        turned.append(faces[signed_double_areas(plane[at]) <= 0])
        corners[faces] = at + count
        points.append(_along_axes(part, at, as_complex(plane)))
        cones.append(opened.cut.origin[vertices[inside]])
        count += len(plane)
    coarse = np.concatenate(turned)
    if len(coarse):
        raise CoarseError(
            coarse, f"{len(coarse)} of {len(corners):,} triangles are flipped on straight sides"
        )
    every = np.concatenate([*cones, opened.irregular])
    sides = Sides(np.setdiff1d(opened.nodes, opened.irregular))
    return Layout(opened.mesh, lengths, corners, np.concatenate(points), every, sides, size)


def _flat_patch(
    mesh: TriangleMesh, lengths: FloatArray, quarters: IntArray, distortion: float, options: Options
) -> tuple[FloatArray, IntArray, IntArray]:
    """Return a connected patch flattened conformally, with angles of whole quarter turns on its boundary.

    Points (u, 2) of the plane, (m, 3) that at each triangle corner, and cones, vertices inside. Triangles that are too
    coarse for straight sides may be flipped.

    Args:
        mesh: the patch.
        lengths: (m, 3) side lengths.
        quarters: (n,) the quarter turns of the angle at each vertex on the boundary.
        distortion: the area distortion allowed, the standard deviation of the log of the scale by area.
        options: what else is asked of the cones inside.

    Raises:
        CurvatureError: no cones inside make up for the corners.
        ConvergenceError, MetricError: no metric was found.
    """
    corners = np.where(mesh.is_boundary_vertex, (np.pi / 2) * (2 - quarters), 0.0)
    solution = _cones(mesh, lengths, corners, distortion, options)
    choices = ExactChoices(scale_at_cones=False, boundary=straight_boundary(mesh, solution.target))
    # Rotations along handles are not quarter turns yet, nor are loops of the boundary parallel: both come to be so when
    # patches are brought together.
    metric = exact_flat_metric(mesh, lengths, solution, choices)
    seams = find_seams(mesh, solution.cones, lengths.ravel()[mesh.edge_halfedges[:, 0]])
    laid_out = lay_out(metric, Cut(cut_open(mesh, seams).mesh, seams))
    return laid_out.points, laid_out.corners, solution.cones


def _cones(
    mesh: TriangleMesh, lengths: FloatArray, corners: FloatArray, distortion: float, options: Options
) -> ConeSolution:
    """Return cones inside a patch whose (n,) corners are given: these are taken off the curvature to be made up for."""
    surface = Surface.of(mesh, lengths)
    inside = ~mesh.is_boundary_vertex
    total = 4 * mesh.euler_characteristic - round(float(corners.sum()) / (np.pi / 2))
    room = CONE_ANGLE_PER_TRIANGLE * np.bincount(mesh.faces.ravel(), minlength=len(mesh.vertices))
    try:
        search = ConeSearch(
            surface.laplacian,
            surface.curvature - corners,
            surface.areas,
            np.zeros(len(inside), dtype=bool),
            total / 4,
            tie_key=tie_key(mesh.vertices),
            min_cone_angle=options.min_cone_angle,
            max_cone_angle=options.max_cone_angle,
            allowed=inside,
            room=room.astype(np.float64),
        )
        found = quantise_cones(search, np.pi / 2, distortion=distortion).solution
    except CurvatureError as error:
        raise CurvatureError(
            f"a patch of {len(mesh.faces):,} triangles with corners of {corners.sum() / np.pi:.3g} pi in all: {error}"
        ) from error
    target = np.where(inside, found.target, corners)
    return ConeSolution(found.cones, target, found.log_scale)


def _along_axes(mesh: TriangleMesh, corners: IntArray, points: ComplexArray) -> ComplexArray:
    """Return points of a patch turned so that most of its boundary is along the axes."""
    border = mesh.edge_halfedges[mesh.is_boundary_edge, 0]
    side = points[corners[:, PREVIOUS].ravel()[border]] - points[corners[:, NEXT].ravel()[border]]
    angle = float(np.angle((np.abs(side) * (side / np.abs(side)) ** 4).sum()) / 4)
    return points * np.exp(-1j * angle)


def _fitting(opened: Opened, layout: Layout) -> ComplexArray:
    """Return the points of patches relaxed so that sides are straight, along the axes, and quarter turns of each other.

    Raises:
        ConvergenceError: they cannot be without flipping a triangle, as far as is known.
        GridError: sides and seams, each turned to the nearest axis, contradict each other.
    """
    sides = _all_sides(opened, layout, layout.chains(quarter_turns=True))
    offsets = np.full(len(sides.axis), np.nan)
    constraints = PointConstraints(
        lines=Lines(sides.points, sides.side, sides.directions, offsets) if len(offsets) else None,
        quarter_turns=True,
        nodes=layout.whole,
    )
    # Patches of one size meet more easily.
    points, energy = as_pairs(layout.points), StretchEnergy(1.0)
    try:
        found = relax(
            layout.mesh, points, layout.corners, energy, constraints, lengths=layout.lengths, steps=200
        )
    except OptionError as error:
        raise GridError(f"sides and seams cannot all lie along the axes: {error}") from error
    return as_complex(found.points)


def _all_sides(opened: Opened, layout: Layout, chains: SeamChains) -> Sides:
    """Return the sides that lie along the axes: of the boundary, and the left ones of chains of features."""
    points = layout.points
    border = find_sides(layout, np.ones(len(points), dtype=bool))
    feature = opened.is_feature[chains.edges]
    left, chain = chains.left[feature], chains.chain[feature]
    along = points[left[:, 1]] - points[left[:, 0]]
    # Twice the direction, so that to and fro are the same.
    numbers, which = np.unique(chain, return_inverse=True)
    double = np.abs(along) * (along / np.abs(along)) ** 2
    sums = np.bincount(which, double.real, len(numbers))
    axis = np.where(sums >= 0, 1, 0)
    both = np.unique(np.stack([left.ravel(), which.repeat(2)], axis=1), axis=0)
    return Sides(
        layout.sides.corners,
        np.concatenate([border.points, both[:, 0]]),
        np.concatenate([border.side, both[:, 1] + len(border.axis)]),
        np.concatenate([border.axis, axis]),
    )
