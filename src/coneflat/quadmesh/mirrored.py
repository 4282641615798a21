"""Halves of symmetric surfaces: the half beside a plane, and grids and quads of it, mirrored and joined."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..base import BoolArray, FloatArray, IntArray, mask_of
from ..errors import GridError
from ..geometry import quarters_around, sides_between
from ..io import as_input
from ..mesh.connectivity import TriangleMesh, are_among
from ..source import Source
from .features import lengths_along, sharp_edges, split_edges
from .integer_map import IntegerGrid, grid_of_corners, on_lines
from .mirror_planes import SAME_PLACE, MirrorPlane, at_seam_ends, on_seam, seam_edges, symmetry_planes
from .quad_mesh import QuadMesh
from .remesh import part_of
from .request import GridRequest, names_vertices
from .simpler_mesh import nearest_on_edges
from .smooth import blocked, is_on_feature, smooth_quads, square_corners

# Largest difference of the directions of a triangle at the plane and of the image of the one beyond, radians: where
# polygons that are not plane have other diagonals on both sides, these differ.
MAX_TURN = 0.3
# Rounds of smoothing between those of the vertices on the plane.
ROUNDS_AT_ONCE = 2


@dataclass(frozen=True, eq=False)
class Half:
    """The half of a symmetric surface on the side of the normal of its plane.

    Attributes:
        plane: the plane.
        mesh: the half; triangles that cross the plane are cut, and vertices near it are on it.
        origins: (n, 2) the ends of the edge of the surface that each vertex is on; twice the same for its vertices.
        length: the length of the curve along which both halves meet.
    """

    plane: MirrorPlane
    mesh: TriangleMesh
    origins: IntArray
    length: float


def half_of(mesh: TriangleMesh) -> Half | None:
    """Return the half of a surface with planes of symmetry, None if it has none.

    Of several planes it is that of the shortest cut, along which a grid must have lines.
    """
    halves = [half for plane in symmetry_planes(mesh) if (half := half_beside(mesh, plane)) is not None]
    return min(halves, key=lambda half: round(half.length / half.plane.size, 6), default=None)


def half_beside(mesh: TriangleMesh, plane: MirrorPlane) -> Half | None:
    """Return the half of a surface beside a plane, None if the plane does not divide it along a curve.

    This is so if triangles lie in the plane, or edges of the boundary.
    """
    heights = plane.heights(mesh.vertices)
    is_on = np.abs(heights) <= SAME_PLACE * plane.size
    heights[is_on] = 0.0
    points = np.where(is_on[:, None], plane.projected(mesh.vertices), mesh.vertices)
    tails, heads = mesh.edges.T
    crosses = heights[tails] * heights[heads] < 0
    if is_on[mesh.faces].all(axis=1).any() or is_on[mesh.edges[mesh.is_boundary_edge]].all(axis=1).any():
        return None
    cut = split_edges(mesh.moved_to(points), crosses)[0]
    ends = mesh.edges[crosses]
    share = (heights[ends[:, 0]] / (heights[ends[:, 0]] - heights[ends[:, 1]]))[:, None]
    middles = plane.projected((1 - share) * points[ends[:, 0]] + share * points[ends[:, 1]])
    heights = np.append(heights, np.zeros(len(ends)))
    is_half = heights[cut.faces].max(axis=1) > 0
    # Faces are numbered as before, but for the new vertices on the plane.
    cut = cut.moved_to(np.concatenate([points, middles]))
    half, vertices = part_of(cut, is_half)
    seam = seam_edges(half, plane)
    if not len(seam) or not _meets_its_image(cut, heights, plane):
        return None
    every = np.arange(len(mesh.vertices))
    origins = np.concatenate([np.stack([every, every], axis=1), ends])[vertices]
    return Half(plane, half, origins, float(lengths_along(half, seam).sum()))


def _meets_its_image(cut: TriangleMesh, heights: FloatArray, plane: MirrorPlane) -> bool:
    """Return whether the triangles on both sides of each edge on the plane are images of each other.

    Parts that cross the plane and each other there, of which each is the image of the other, have other halves.

    Args:
        cut: the surface, whose triangles do not cross the plane.
        heights: (n,) the distances of its vertices from the plane.
        plane: the plane.
    """
    halfedges = cut.edge_halfedges[(heights[cut.edges] == 0).all(axis=1) & ~cut.is_boundary_edge]
    apexes = cut.faces.ravel()[halfedges]
    crosses = heights[apexes].prod(axis=1) < 0
    apexes, halfedges = apexes[crosses], halfedges[crosses]
    tails, heads = (cut.vertices[ends] for ends in cut.ends_of(halfedges[:, 0]))
    along = heads - tails
    along = along / np.maximum(np.linalg.norm(along, axis=1), np.finfo(float).tiny)[:, None]
    first, second = cut.vertices[apexes[:, 0]], plane.reflected(cut.vertices[apexes[:, 1]])
    first, second = (
        arms - np.einsum("ex,ex->e", arms, along)[:, None] * along for arms in (first - tails, second - tails)
    )
    lengths = [np.linalg.norm(arms, axis=1) for arms in (first, second)]
    smallest = np.minimum(*lengths)
    gaps = np.linalg.norm(first * lengths[1][:, None] - second * lengths[0][:, None], axis=1)
    gaps /= np.maximum(np.maximum(*lengths), np.finfo(float).tiny)
    return bool((gaps <= np.maximum(MAX_TURN * smallest, 4 * SAME_PLACE * plane.size)).all())


def half_request(request: GridRequest) -> GridRequest | None:
    """Return the request for the grid of a half of a symmetric surface, None if it has none or options prevent it.

    Its boundary is straight. Options may not name vertices, nor fix cones.
    """
    is_simple = request.sizes is None or (isinstance(request.sizes, str) and request.sizes == "curvature")
    if request.symmetry == "none" or request.flattening or not (is_simple and request.leaves_cones_open):
        return None
    if names_vertices(request):
        return None
    checked = request.checked
    half = half_of(checked.mesh)
    if half is None:
        return None
    scales = None if request.scales is None else request.scales[half.origins].mean(axis=1)
    model = half.mesh.moved_to(np.ldexp(half.mesh.vertices, -checked.exponent))
    limit = replace(request.limit, requested=request.limit.requested / 2, triangles=len(model.faces))
    return replace(
        request,
        source=Source(as_input(model)),
        sizes=None if scales is None else np.exp(-scales),
        limit=limit,
        boundary="straight",
        mirror=half.plane.scaled(-checked.exponent),
    )


@dataclass(frozen=True, eq=False)
class Doubled:
    """A half surface with its mirror image: vertices of the half come first, and all triangles of the half.

    Attributes:
        mesh: the whole surface.
        image: (n,) the mirror image of each vertex of the half; itself on the plane.
    """

    mesh: TriangleMesh
    image: IntArray


def doubled(half: TriangleMesh, plane: MirrorPlane) -> Doubled:
    """Return a half surface joined to its mirror image."""
    is_shared = mask_of(len(half.vertices), half.edges[seam_edges(half, plane)])
    image = images_of(is_shared)
    vertices = np.concatenate([half.vertices, plane.reflected(half.vertices[~is_shared])])
    faces = np.concatenate([half.faces, image[half.faces[:, [0, 2, 1]]]])
    return Doubled(TriangleMesh(vertices, faces), image)


def images_of(is_shared: BoolArray) -> IntArray:
    """Return (n,) the numbers of the images of vertices: their own if shared, else the next after n in order."""
    image = np.arange(len(is_shared))
    image[~is_shared] = len(is_shared) + np.arange(int((~is_shared).sum()))
    return image


def doubled_grid(grid: IntegerGrid, plane: MirrorPlane, sharp_angle: float) -> IntegerGrid:
    """Return the grid of a whole surface from one of its half, whose seam is on grid lines.

    Args:
        grid: the grid of the half.
        plane: the plane.
        sharp_angle: dihedral angle above which edges of the seam are features, radians.

    Raises:
        GridError: the seam is not on grid lines, or not straight.
    """
    half = TriangleMesh(grid.vertices, grid.faces)
    whole_surface = doubled(half, plane)
    mesh, image = whole_surface.mesh, whole_surface.image
    _require_straight(half, plane, grid)
    ends = half.edges[seam_edges(half, plane)]
    sharp = mesh.edges[sharp_edges(mesh, sharp_angle)]
    joined_grid = grid_of_corners(
        mesh.vertices,
        mesh.faces,
        np.concatenate([grid.corner_grid, grid.corner_grid[:, [0, 2, 1]] * [-1, 1]]),
        size=grid.size,
        notes=grid.notes,
        features=np.unique(
            np.sort(
                np.concatenate([grid.features, image[grid.features], ends[are_among(ends, sharp)]]), axis=1
            ),
            axis=0,
        ),
        corners=_corners_of(grid, image),
    )
    return replace(joined_grid, seconds=grid.seconds)


def _corners_of(grid: IntegerGrid, image: IntArray) -> IntArray:
    """Return the corners of a doubled grid: those of the half that are not on the plane, and their images."""
    corners = grid.corners[image[grid.corners] != grid.corners]
    return np.union1d(corners, image[corners])


def _require_straight(half: TriangleMesh, plane: MirrorPlane, grid: IntegerGrid) -> None:
    """Raise GridError unless the seam is on grid lines, with corners of a single quad at its ends alone."""
    quarters = quarters_around(half, sides_between(grid.corner_grid))
    is_bent = (on_seam(half, plane) & (quarters < 2)) | (at_seam_ends(half, plane) & (quarters > 1))
    is_off = ~on_lines(half, grid.corner_grid)[seam_edges(half, plane)]
    if is_off.any() or is_bent.any():
        raise GridError(f"grid lines do not follow {plane}")


def doubled_quads(quads: QuadMesh, plane: MirrorPlane, sharp_angle: float) -> QuadMesh:
    """Return the quads of a whole surface from those of its half.

    Raises:
        GridError: the boundary of the quads does not follow the plane.
    """
    grid = None if quads.grid is None else doubled_grid(quads.grid, plane, sharp_angle)
    surface = doubled(quads.surface, plane)
    is_shared = mask_of(
        len(quads.vertices),
        quads.edges[quads.is_boundary_edge & plane.contains(quads.vertices)[quads.edges].all(axis=1)],
    )
    image, points = images_of(is_shared), quads.vertices.copy()
    points[is_shared] = plane.projected(points[is_shared])
    count = len(quads.surface.faces)
    joined_quads = replace(
        quads,
        vertices=np.concatenate([points, plane.reflected(points[~is_shared])]),
        quads=np.concatenate([quads.quads, image[quads.quads[:, [0, 3, 2, 1]]]]),
        faces=np.concatenate([quads.faces, count + quads.faces[~is_shared]]),
        barycentric=np.concatenate([quads.barycentric, quads.barycentric[~is_shared][:, [0, 2, 1]]]),
        left_out=2 * quads.left_out,
        area_left_out=2 * quads.area_left_out,
        surface=surface.mesh,
        grid=grid,
    )
    if joined_quads.euler_characteristic != joined_quads.surface_euler and not quads.left_out:
        raise GridError(f"quads do not follow {plane}")
    return joined_quads


def smoothed_beside(quads: QuadMesh, plane: MirrorPlane, rounds: int, features: IntArray) -> QuadMesh:
    """Return smoothed quads of a half, as parts of those of the whole surface.

    Vertices of the seam slide along it, to the nearest point to the mean of their positions in the nearest squares of
    both halves. Those at its ends and on features do not move.

    Args:
        quads: quads of the half, smoothed, with all boundaries in place.
        plane: the plane.
        rounds: rounds of smoothing, in which the vertices of the seam and the others move in turn.
        features: (f, 2) vertices of edges of the surface, along which vertices do not move.
    """
    surface, seam = quads.surface, seam_edges(quads.surface, plane)
    border = quads.edges[quads.is_boundary_edge]
    is_on = plane.contains(quads.vertices)
    ends = border[~is_on[border].all(axis=1)]
    movable = is_on & quads.is_boundary_vertex & ~mask_of(len(is_on), ends) & ~is_on_feature(quads, features)
    for _ in range(0, rounds, ROUNDS_AT_ONCE):
        targets = plane.projected(square_corners(quads.vertices, quads.quads)[movable])
        points, faces, weights = quads.vertices.copy(), quads.faces.copy(), quads.barycentric.copy()
        reach = np.full(len(targets), np.inf)
        _, faces[movable], weights[movable] = nearest_on_edges(
            surface, seam, surface.vertices, targets, reach
        )
        corners = surface.vertices[surface.faces[faces[movable]]]
        points[movable] = np.einsum("qi,qix->qx", weights[movable], corners)
        stays = blocked(quads.vertices, points, quads.quads)
        points[stays], faces[stays], weights[stays] = (
            quads.vertices[stays], quads.faces[stays], quads.barycentric[stays],
        )  # fmt: skip
        quads = replace(quads, vertices=points, faces=faces, barycentric=weights)
        quads = smooth_quads(quads, ROUNDS_AT_ONCE, features)
    return quads
