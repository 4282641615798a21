"""Patches between sharp edges, each flattened with straight sides."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ... import TriangleMesh
from ...base import ComplexArray, FloatArray, IntArray
from ...cones import ROOM, ConeSearch, quantise_cones
from ...errors import CurvatureError, GridError, MetricError, OptionError, SeamError
from ...geometry import as_complex, as_pairs, double_areas, signed_double_areas
from ...layout import Lines, PointConstraints, SeamChains, StretchEnergy, find_chains, lay_out, relax
from ...mesh import NEXT, PREVIOUS, cut_open, tie_key
from ...metric import ExactChoices, exact_flat_metric, straight_boundary
from ...options import Options
from ...seams import find_seams
from ...stages import ConeSolution, Cut, Surface
from .aligned import Layout, joined_charts, origins
from .features import Opened
from .sides import Sides, find_sides


@dataclass(frozen=True, eq=False)
class FlatPatch:
    """A patch in the plane, at its own area, its sides along the axes.

    Attributes:
        points: (u,) of the plane.
        corners: (m, 3) the point at each triangle corner.
        cones: vertices of the patch, inside.
        turned: (t,) triangles that are turned over, as they are too coarse for straight sides.
    """

    points: ComplexArray
    corners: IntArray
    cones: IntArray
    turned: IntArray


def flatten_patch(
    mesh: TriangleMesh, lengths: FloatArray, quarters: IntArray, distortion: float, options: Options
) -> FlatPatch:
    """Return a connected patch flattened conformally, with angles of whole quarter turns on its boundary.

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
    on_boundary = mesh.is_boundary_vertex
    corners = np.where(on_boundary, (np.pi / 2) * (2 - quarters), 0.0)
    solution = _cones(mesh, lengths, corners, distortion, options)
    choices = ExactChoices(scale_at_cones=False, boundary=straight_boundary(mesh, solution.target))
    # Rotations along handles are no quarter turns yet, nor are loops of the boundary parallel: both come to be so when
    # patches are brought together.
    metric = exact_flat_metric(mesh, lengths, solution, choices)
    seams = find_seams(mesh, solution.cones, lengths.ravel()[mesh.edge_halfedges[:, 0]])
    laid_out = lay_out(metric, Cut(cut_open(mesh, seams).mesh, seams))
    turned = np.flatnonzero(signed_double_areas(laid_out.points[laid_out.corners]) <= 0)
    points = as_complex(laid_out.points)
    points = points * np.exp(-1j * _side_angle(mesh, laid_out.corners, points))
    return FlatPatch(points, laid_out.corners, solution.cones, turned)


def _cones(
    mesh: TriangleMesh, lengths: FloatArray, corners: FloatArray, distortion: float, options: Options
) -> ConeSolution:
    """Return cones inside a patch whose (n,) corners are given: these are taken off the curvature to be made up for."""
    surface = Surface.of(mesh, lengths)
    inside = ~mesh.is_boundary_vertex
    total = 4 * mesh.euler_characteristic - round(float(corners.sum()) / (np.pi / 2))
    room = ROOM * np.bincount(mesh.faces.ravel(), minlength=len(mesh.vertices))
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
        found = quantise_cones(search, (np.pi / 2), distortion=distortion).solution
    except CurvatureError as error:
        raise CurvatureError(
            f"a patch of {len(mesh.faces):,} triangles with corners of {corners.sum() / np.pi:.3g} pi in all: {error}"
        ) from error
    target = np.where(inside, found.target, corners)
    return ConeSolution(found.cones, target, found.log_scale)


def _side_angle(mesh: TriangleMesh, corners: IntArray, points: ComplexArray) -> float:
    """Return the direction of most of a boundary, up to quarter turns."""
    border = mesh.edge_halfedges[mesh.is_boundary_edge, 0]
    side = points[corners[:, PREVIOUS].ravel()[border]] - points[corners[:, NEXT].ravel()[border]]
    return float(np.angle((np.abs(side) * (side / np.abs(side)) ** 4).sum()) / 4) if len(side) else 0.0


@dataclass(frozen=True, eq=False)
class Loose:
    """Patches in the plane that do not fit each other yet.

    Attributes:
        points: (u,) of the plane.
        corners: (m, 3) the point at each triangle corner.
        cones: vertices, inside patches.
    """

    points: ComplexArray
    corners: IntArray
    cones: IntArray


class PatchError(GridError):
    """A patch cannot be flattened; `faces` are its triangles."""

    def __init__(self, faces: IntArray, why: str) -> None:
        super().__init__(why)
        self.faces = faces


class CoarseError(PatchError):
    """A patch cannot be flattened as some of its triangles, `faces`, are too coarse."""


def flatten_patches(
    opened: Opened, lengths: FloatArray, options: Options, tell: Callable[[int, int], None]
) -> Loose:
    """Return all patches of an opened mesh, flattened at their own areas; lengths are (m, 3), of its sides.

    tell: called before each patch with its number and how many there are.

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
            flat = flatten_patch(part, lengths[faces], opened.quarters[vertices], distortion, options)
        except (CurvatureError, MetricError, SeamError) as error:
            raise PatchError(faces, str(error)) from error
        turned.append(faces[flat.turned])
        corners[faces] = flat.corners + count
        points.append(flat.points)
        cones.append(opened.cut.origin[vertices[flat.cones]])
        count += len(flat.points)
    coarse = np.concatenate(turned)
    if len(coarse):
        raise CoarseError(
            coarse, f"{len(coarse)} of {len(corners):,} triangles are turned over on straight sides"
        )
    return Loose(np.concatenate(points), corners, np.concatenate(cones))


def glued(opened: Opened, lengths: FloatArray, loose: Loose) -> Loose:
    """Return patches relaxed so that their sides are straight, along the axes, and quarter turns of each other.

    Raises:
        ConvergenceError: they cannot be without turning a triangle over, as far as is known.
        GridError: sides and seams, each turned to the nearest axis, contradict each other.
    """
    mesh, whole = opened.mesh, np.concatenate([loose.cones, opened.nodes])
    chains = find_chains(mesh, loose.corners, loose.points, whole, quarter_turns=True)
    sides = all_sides(opened, loose.corners, loose.points, chains)
    offsets = np.full(len(sides.axis), np.nan)
    constraints = PointConstraints(
        lines=Lines(sides.points, sides.side, sides.directions, offsets) if len(offsets) else None,
        quarter_turns=True,
        nodes=whole,
    )
    # Patches of one size meet more easily.
    points, energy = as_pairs(loose.points), StretchEnergy(1.0)
    try:
        found = relax(mesh, points, loose.corners, energy, constraints, lengths=lengths, steps=200)
    except OptionError as error:
        raise GridError(f"sides and seams cannot all lie along the axes: {error}") from error
    return replace(loose, points=as_complex(found.points))


def all_sides(opened: Opened, corners: IntArray, points: ComplexArray, chains: SeamChains) -> Sides:
    """Return the sides that lie along the axes: of the boundary, and the left ones of chains of features."""
    mesh = opened.mesh
    border = find_sides(mesh, corners, points, np.ones(len(points), dtype=bool))
    feature = opened.is_feature[chains.edges]
    left, chain = chains.left[feature], chains.chain[feature]
    along = points[left[:, 1]] - points[left[:, 0]]
    # Twice the direction, so that to and fro are the same.
    numbers, which = np.unique(chain, return_inverse=True)
    double = np.abs(along) * (along / np.abs(along)) ** 2
    sums = np.bincount(which, double.real, len(numbers))
    axis = np.where(sums >= 0, 1, 0)
    both = np.stack([left.ravel(), which.repeat(2)], axis=1)
    both = np.unique(both, axis=0)
    return Sides(
        np.setdiff1d(opened.nodes, opened.irregular),
        np.concatenate([border.points, both[:, 0]]),
        np.concatenate([border.side, both[:, 1] + len(border.axis)]),
        np.concatenate([border.axis, axis]),
    )


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
    """
    loose = glued(opened, lengths, flatten_patches(opened, lengths, options, tell))
    mesh, corners = opened.mesh, loose.corners
    whole = np.concatenate([loose.cones, opened.nodes])
    chains = find_chains(mesh, corners, loose.points, whole)
    points, of_point = joined_charts(corners, loose.points, chains)
    flat = float(signed_double_areas(as_pairs(points)[corners]).sum())
    points = points * np.sqrt(float(double_areas(lengths).sum()) / flat) / size
    chains = find_chains(mesh, corners, points, whole)
    sides = all_sides(opened, corners, points, chains)
    cones = np.concatenate([loose.cones, opened.irregular])
    layout = Layout(mesh, lengths, corners, points, cones, sides, size)
    return replace(layout, points=points - origins(layout, of_point)[of_point])
