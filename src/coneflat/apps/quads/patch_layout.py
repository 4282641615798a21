"""Layouts with sharp edges along the axes.

Either the patches between them are flattened with straight sides and joined, or those that are nearly along the axes of
a layout are moved there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ... import TriangleMesh
from ...base import BoolArray, ComplexArray, FloatArray, IntArray
from ...cones import CONE_ANGLE_PER_TRIANGLE, ConeSearch, quantise_cones
from ...errors import CurvatureError, GridError, MetricError, OptionError, SeamError
from ...geometry import as_complex, as_pairs, double_areas, signed_angles, signed_double_areas
from ...layout import Lines, PointConstraints, SeamChains, StretchEnergy, lay_out, relax
from ...mesh import NEXT, PREVIOUS, cut_open, open_along, tie_key
from ...metric import ExactChoices, exact_flat_metric, straight_boundary
from ...options import Options
from ...seams import find_seams
from ...stages import ConeSolution, Cut, Surface
from .cross_field import sharp_ends
from .features import Opened, edge_indices, without_stubs
from .layout import GridLayout, Sides, at_origin, find_sides, joined_charts

# Edges are put on a line if their direction differs from an axis by less, radians.
MAX_TURN = np.deg2rad(20.0)
# Squares: shorter chains of sharp edges are not put on lines.
SHORTEST = 4.0
# Largest numbers of Newton steps: to join patches, and to move sharp edges to lines, which takes about ten steps, or
# does not converge.
PATCH_STEPS, LINE_STEPS = 200, 40
# Patches of equal scale are easier to join.
PATCHES = StretchEnergy(1.0)


class PatchError(GridError):
    """A patch cannot be flattened; `faces` are its triangles."""

    def __init__(self, faces: IntArray, why: str) -> None:
        super().__init__(why)
        self.faces = faces


class CoarseError(PatchError):
    """A patch cannot be flattened because some of its triangles, `faces`, are too coarse."""


def sharp_layout(
    opened: Opened, lengths: FloatArray, size: float, options: Options, tell: Callable[[int, int], None]
) -> GridLayout:
    """Return a seamless layout of a mesh with sharp edges along the axes, in units of a grid.

    Args:
        opened: the mesh, cut open along its sharp edges.
        lengths: (m, 3) side lengths of its triangles.
        size: edge length of a square of the grid.
        options: options of the cones inside patches.
        tell: progress function, called before each patch is flattened, with its index and the number of patches.

    Raises:
        CoarseError: triangles are too coarse.
        PatchError: a patch has no flat metric with angles of quarter turns.
        ConvergenceError: no layout was found in which the patches match.
        GridError: the nearest axes of sides and seams contradict each other.
    """
    return straightened(_flat_patches(opened, lengths, size, options, tell), opened.is_feature)


def straightened(
    layout: GridLayout, is_feature: BoolArray | None = None, energy: StretchEnergy = PATCHES
) -> GridLayout:
    """Return a layout with all sides of the boundary along the axes, and features, which are seams, too.

    Args:
        layout: a layout whose sides and seams are along the axes up to less than 45 degrees.
        is_feature: (e,) whether each edge of its mesh is a feature; None for no features.
        energy: what the layout minimises.

    Raises:
        ConvergenceError: no such layout without flipped triangles was found.
        GridError: the nearest axes of sides and seams contradict each other.
    """
    if is_feature is None:
        is_feature = np.zeros(len(layout.mesh.edges), dtype=bool)
        layout = replace(layout, sides=find_sides(layout, np.ones(len(layout.points), dtype=bool)))
    area = float(double_areas(layout.lengths).sum()) / layout.size**2
    layout, component = joined_charts(replace(layout, points=_fitting(layout, is_feature, energy)))
    layout = replace(layout, points=layout.points * np.sqrt(area / float(layout.double_areas().sum())))
    return at_origin(replace(layout, sides=_all_sides(layout, is_feature, layout.chains())), component)


def _flat_patches(
    opened: Opened, lengths: FloatArray, size: float, options: Options, tell: Callable[[int, int], None]
) -> GridLayout:
    """Return the layout of all patches of an opened mesh, each with its own area; they do not match yet.

    Raises:
        CoarseError: triangles are too coarse.
        PatchError: a patch has no flat metric with angles of quarter turns.
    """
    corners = np.empty_like(opened.mesh.faces)
    points, cones, flipped, count = [], [], [], 0
    parts = opened.cut.mesh.split_components()
    areas = double_areas(lengths)
    for number, (part, vertices, faces) in enumerate(parts):
        tell(number, len(parts))
        # The overall distortion is a root mean square weighted by area, to which small patches contribute little.
        share = float(areas[faces].sum() / areas.mean() / len(areas))
        distortion = options.distortion * min(max(1.0, 1 / np.sqrt(len(parts) * share)), 3.0)
        # Each cone needs a grid point inside. By Pick's theorem, there are fewer of them than squares.
        most = int(np.ceil(areas[faces].sum() / 2 / size**2))
        own = replace(options, distortion=distortion, max_cones=most)
        try:
            plane, at, inside = _flat_patch(part, lengths[faces], opened.quarters[vertices], own)
        except (CurvatureError, MetricError, SeamError) as error:
            raise PatchError(faces, str(error)) from error
        flipped.append(faces[signed_double_areas(plane[at]) <= 0])
        corners[faces] = at + count
        points.append(_along_axes(part, at, as_complex(plane)))
        cones.append(opened.cut.origin[vertices[inside]])
        count += len(plane)
    coarse = np.concatenate(flipped)
    if len(coarse):
        raise CoarseError(
            coarse, f"{len(coarse)} of {len(corners):,} triangles are flipped on straight sides"
        )
    every = np.concatenate([*cones, opened.irregular])
    sides = Sides(np.setdiff1d(opened.nodes, opened.irregular))
    return GridLayout(opened.mesh, lengths, corners, np.concatenate(points), every, sides, size)


def _flat_patch(
    mesh: TriangleMesh, lengths: FloatArray, quarters: IntArray, options: Options
) -> tuple[FloatArray, IntArray, IntArray]:
    """Return the conformal flattening of a connected patch, with multiples of pi/2 as angles on its boundary.

    The results are points (u, 2) in the plane, (m, 3) the point of each triangle corner, and cones, inner vertices.
    Triangles that are too coarse for straight sides may be flipped.

    Args:
        mesh: the patch.
        lengths: (m, 3) side lengths.
        quarters: (n,) the angle at each boundary vertex in quarter turns.
        options: options of the cones.

    Raises:
        CurvatureError: no inner cones have the total curvature that the corners require.
        ConvergenceError, MetricError: no metric was found.
    """
    corners = np.where(mesh.is_boundary_vertex, (np.pi / 2) * (2 - quarters), 0.0)
    solution = _cones(mesh, lengths, corners, options)
    choices = ExactChoices(scale_at_cones=False, boundary=straight_boundary(mesh, solution.target))
    # Holonomy along handles is not yet a multiple of a quarter turn, and different boundary loops are not yet parallel.
    # Both are corrected when the patches are joined.
    metric = exact_flat_metric(mesh, lengths, solution, choices)
    seams = find_seams(mesh, solution.cones, lengths.ravel()[mesh.edge_halfedges[:, 0]])
    layout = lay_out(metric, Cut(cut_open(mesh, seams).mesh, seams))
    return layout.points, layout.corners, solution.cones


def _cones(mesh: TriangleMesh, lengths: FloatArray, corners: FloatArray, options: Options) -> ConeSolution:
    """Return the inner cones of a patch with prescribed corners (n,), whose curvature is subtracted from its own."""
    surface = Surface.of(mesh, lengths)
    inside = ~mesh.is_boundary_vertex
    total = 4 * mesh.euler_characteristic - round(float(corners.sum()) / (np.pi / 2))
    max_angles = CONE_ANGLE_PER_TRIANGLE * np.bincount(mesh.faces.ravel(), minlength=len(mesh.vertices))
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
            max_angles=max_angles.astype(np.float64),
        )
        found = quantise_cones(search, np.pi / 2, distortion=options.distortion, most=options.max_cones)
    except CurvatureError as error:
        raise CurvatureError(
            f"a patch of {len(mesh.faces):,} triangles with corners of {corners.sum() / np.pi:.3g} pi in all: {error}"
        ) from error
    target = np.where(inside, found.solution.target, corners)
    return ConeSolution(found.solution.cones, target, found.solution.log_scale)


def _along_axes(mesh: TriangleMesh, corners: IntArray, points: ComplexArray) -> ComplexArray:
    """Return the points of a patch, rotated so that most of its boundary is along the axes."""
    border = mesh.edge_halfedges[mesh.is_boundary_edge, 0]
    side = points[corners[:, PREVIOUS].ravel()[border]] - points[corners[:, NEXT].ravel()[border]]
    angle = float(np.angle((np.abs(side) * (side / np.abs(side)) ** 4).sum()) / 4)
    return points * np.exp(-1j * angle)


def _fitting(layout: GridLayout, is_feature: BoolArray, energy: StretchEnergy) -> ComplexArray:
    """Return the relaxed points of patches: sides are along the axes, and both sides of seams match by quarter turns.

    Raises:
        ConvergenceError: no such layout without flipped triangles was found.
        GridError: the nearest axes of sides and seams contradict each other.
    """
    sides = _all_sides(layout, is_feature, layout.chains(quarter_turns=True))
    offsets = np.full(len(sides.axis), np.nan)
    constraints = PointConstraints(
        lines=Lines(sides.points, sides.side, sides.directions, offsets) if len(offsets) else None,
        quarter_turns=True,
        nodes=layout.nodes,
    )
    points = as_pairs(layout.points)
    try:
        found = relax(
            layout.mesh,
            points,
            layout.corners,
            energy,
            constraints,
            lengths=layout.lengths,
            steps=PATCH_STEPS if energy is PATCHES else LINE_STEPS,
        )
    except OptionError as error:
        raise GridError(f"sides and seams cannot all lie along the axes: {error}") from error
    return as_complex(found.points)


def _all_sides(layout: GridLayout, is_feature: BoolArray, chains: SeamChains) -> Sides:
    """Return the sides along the axes: sides of the boundary, and the left sides of feature chains."""
    points = layout.points
    border = find_sides(layout, np.ones(len(points), dtype=bool))
    feature = is_feature[chains.edges]
    left, chain = chains.left[feature], chains.chain[feature]
    along = points[left[:, 1]] - points[left[:, 0]]
    # The doubled angle makes opposite directions equal.
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


def with_sharp_lines(layout: GridLayout, energy: StretchEnergy) -> tuple[GridLayout, IntArray]:
    """Return a layout relaxed so that sharp edges along the axes are on lines, and these edges (k,).

    Raises:
        ConvergenceError: no such layout without flipped triangles was found.
        GridError: the nearest axes of sides and seams contradict each other.
    """
    mesh, points, (starts, ends) = layout.mesh, layout.points, layout.ends
    sharp = edge_indices(mesh, sharp_ends(mesh))
    one = mesh.edge_halfedges[sharp, 0]
    off = np.abs(np.angle((points[ends[one]] - points[starts[one]]) ** 4)) / 4
    sharp = sharp[off < MAX_TURN]
    edges = sharp[without_stubs(mesh, sharp, SHORTEST * layout.size)]
    places = points[layout.corners]
    angles = signed_angles(places[:, PREVIOUS] - places[:, NEXT])
    cut = open_along(mesh, edges)
    sums = np.bincount(cut.mesh.faces.ravel(), angles.ravel(), len(cut.origin)) / (np.pi / 2)
    quarters = np.where(cut.mesh.is_boundary_vertex, np.maximum(np.rint(sums), 1).astype(np.int64), 0)
    nodes = np.setdiff1d(Opened(mesh, edges, cut, quarters).nodes, layout.cones)
    is_feature = np.zeros(len(mesh.edges), dtype=bool)
    is_feature[edges] = True
    inner = ~mesh.is_boundary_edge
    there, back = mesh.edge_halfedges[inner].T
    is_seam = is_feature.copy()
    is_seam[inner] |= (starts[there] != ends[back]) | (ends[there] != starts[back])
    opened = open_along(mesh, np.flatnonzero(is_seam))
    moved = np.zeros(len(opened.origin), dtype=np.complex128)
    moved[opened.mesh.faces.ravel()] = points[layout.corners.ravel()]
    sides = Sides(np.union1d(nodes, layout.sides.corners))
    cut_layout = replace(layout, corners=opened.mesh.faces, points=moved, sides=sides)
    return straightened(cut_layout, is_feature, energy), edges
