"""Pieces of cloth: the shortest seams for which no edge is strained by more than the material allows.

The cones of a texture with a small energy give the seams, and where few edges are still strained too much, slits from
the nearest seam relax them. The energy is varied, and the shortest seams are kept.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ... import TriangleMesh, unwrap
from ...base import BoolArray, FloatArray, IntArray, Unmet, begin_step, has_any, mask_of, part_of_work, plural
from ...geometry import angle_defect, corner_angles, edge_lengths
from ...linalg import MultiGraph
from ...mesh import label_components, nearby
from .borders import find_borders
from .cut_surface import CutSurface
from .development import Development
from .model import Model
from .nesting import grain_up
from .options import PatternOptions
from .relaxing import EVEN, SMALLEST, closed_seams, excess, relaxed
from .separation import without_overlaps
from .simplification import simplified
from .small_pieces import without_small_pieces
from .smooth_seams import with_smooth_seams
from .strain import Stretch

# The symmetric Dirichlet energy of an isometry.
ISOMETRIC = 4.0
# The energy above that of an isometry, relative to the squared strain that is allowed, of the first texture. Strains
# that are evenly distributed up to the bound in all directions give 8/3.
ENERGY_PER_STRAIN = 3.0
# Textures that are tried: with twice the energy as long as seams get shorter, or half of it if the strain is too large.
TEXTURES = 5
# Fractions of the work that is left, for the progress, that one of them is, and smoothing.
TEXTURE_SHARE, SMOOTHING_SHARE = 0.5, 0.7
# Fraction of edges beyond the bound above which the seams of a texture are too few, so that slits cannot help.
MAX_STRAINED = 0.15
# Rings of triangles around new cuts whose points move.
RINGS = 16
# Rounds of slits, each at the worst vertex of every strained region.
ROUNDS = 16


def cloth_pieces(model: Model, options: PatternOptions) -> Development:
    """Return a model cut into pieces of cloth with the grain upward, and notes on bounds that were not met."""
    warp, weft = options.stretch_warp or options.strain, options.stretch_weft or options.strain
    stretch = Stretch(warp, weft)
    mesh, notes = model.mesh, list[str]()
    if model.seams is None:
        mesh, distances = simplified(model.mesh, options.tolerance)
        if mesh is not model.mesh:
            notes.append(
                f"The pattern is that of a mesh with {len(mesh.faces):,} instead of {len(model.mesh.faces):,} "
                f"triangles, {distances.mean():.2g} mm from it on average and {distances.max():.2g} mm at most."
            )
    surface = cut_cloth(replace(model, mesh=mesh), stretch)
    with part_of_work(SMOOTHING_SHARE, "smooth seams"):
        smooth = slit_until_within(with_smooth_seams(surface, options.tolerance, model.seams), stretch)
    if not excess(smooth, stretch).any() or excess(surface, stretch).any():
        surface = smooth
    required = np.empty((0, 2), dtype=np.int64) if model.seams is None else model.seams
    surface = without_small_pieces(surface, stretch, required)
    if options.darts == "none":
        surface = without_darts(surface, stretch)
    return Development(surface, notes=(*notes, *map(Unmet, _unmet(surface, stretch, options))))


def _unmet(surface: CutSurface, stretch: Stretch, options: PatternOptions) -> Iterator[str]:
    beyond = excess(surface, stretch)
    if beyond.any():
        reached = 100 * float(np.abs(surface.edges.strains(surface.points)).max())
        yield (
            f"{plural(int((beyond > 0).sum()), 'edge')} of {len(beyond):,} are strained more than allowed, up to "
            f"{reached:.2g} %, and no cut with less was found: allow more, or refine the mesh there."
        )
    darts = sum(seam.is_dart for seam in find_borders(surface).seams)
    if options.darts == "none" and darts:
        yield f"{plural(darts, 'dart')} could not be continued to a border: allow darts, or more strain."


def cut_cloth(model: Model, stretch: Stretch) -> CutSurface:
    """Return a model cut into the pieces with the shortest seams that were found for a bound of the strain.

    If no cut within the bound was found, it is the one with the smallest largest strain.
    """
    mesh, first = model.mesh, ENERGY_PER_STRAIN * (stretch.warp**2 + stretch.weft**2) / 2
    factor = 1.0
    shortest: CutSurface | None = None
    smallest: CutSurface | None = None
    for number in range(TEXTURES):
        with part_of_work(TEXTURE_SHARE, f"attempt {number + 1}"):
            texture = unwrap(
                mesh.vertices,
                mesh.faces,
                max_energy=ISOMETRIC + factor * first,
                packing_cuts=0.0,
                seams=model.seams,
            )
            surface = slit_until_within(grain_up(CutSurface.of(texture), model.axis), stretch)
        beyond = excess(surface, stretch).max()
        if beyond == 0:
            if shortest is not None and surface.seam_length >= shortest.seam_length:
                break
            shortest = surface
            if not len(surface.seams) or smallest is not None:
                break
            factor *= 2
        elif shortest is not None:
            break
        else:
            if smallest is None or beyond < excess(smallest, stretch).max():
                smallest = surface
            factor /= 2
    best = shortest or smallest
    assert best is not None
    return best


def without_darts(surface: CutSurface, stretch: Stretch) -> CutSurface:
    """Return a surface whose cuts that ended in a tip inside a piece go on to another border.

    As further cuts may be needed for the strain, darts may remain after some rounds.
    """
    for _ in range(ROUNDS):
        longer = _with_longer_darts(surface)
        if len(longer.seams) == len(surface.seams):
            break
        surface = slit_until_within(longer, stretch)
    return surface


def _with_longer_darts(surface: CutSurface) -> CutSurface:
    """Return a surface with all darts cut on to the nearest border that is not their own."""
    mesh, vertex = surface.mesh, surface.vertex_of_point
    unreached = set[int]()
    while darts := [
        seam
        for seam in find_borders(surface).seams
        if seam.tip is not None and vertex[seam.tip] not in unreached
    ]:
        tip = int(vertex[darts[0].tip])
        costs = surface.edge_lengths.copy()
        costs[surface.seams] = np.inf
        is_goal = surface.is_border_vertex.copy()
        is_goal[mesh.edges[mesh.halfedge_edges[darts[0].sides[0].halfedges]]] = False
        graph = MultiGraph(len(mesh.vertices), mesh.edges, costs, mesh.incident_edges)
        paths = graph.shortest_paths(np.flatnonzero(is_goal))
        nodes = paths.nodes_to(np.array([tip]))
        if len(nodes):
            surface = surface.cut_along(np.union1d(surface.seams, paths.edge[nodes]))
            vertex = surface.vertex_of_point
        else:
            unreached.add(tip)
    return surface


def slit_until_within(surface: CutSurface, stretch: Stretch) -> CutSurface:
    """Return a cut surface with slits from its seams, until its strain is within the bound, or no slit helps.

    Slits end where the strain is concentrated if it is only moderately even: the more even it is, the more edges have
    the largest one.
    """
    even = relaxed(surface, stretch, EVEN)
    flat = relaxed(even, stretch, SMALLEST)
    for _ in range(ROUNDS):
        begin_step()
        separated = without_overlaps(flat)
        if separated is not flat:
            even = even.cut_along(separated.seams, separated.places)
            even, flat = _relaxed_near(even, even, np.setdiff1d(separated.seams, flat.seams), stretch)
        closed = closed_seams(flat)
        beyond = excess(closed, stretch)
        if not beyond.any() or (beyond > 0).mean() > MAX_STRAINED:
            break
        tips = _worst_vertices(even, excess(even, stretch), beyond > 0)
        if not len(tips):
            break
        slits = _slits(even, tips)
        seams = np.union1d(even.seams, slits)
        even, flat = _relaxed_near(even.cut_along(seams), flat.cut_along(seams), slits, stretch)
    return closed


def _relaxed_near(
    even: CutSurface, flat: CutSurface, cuts: IntArray, stretch: Stretch
) -> tuple[CutSurface, CutSurface]:
    """Return both layouts of a surface relaxed around new cuts (k,), the second from the first one there.

    Args:
        even: the layout in which strain is moderately even.
        flat: the layout with the smallest largest strain.
        cuts: edges of the mesh.
        stretch: what the material allows.
    """
    is_cut = mask_of(len(even.mesh.vertices), even.mesh.edges[cuts])
    is_free = nearby(even.corners, has_any(is_cut, even.mesh.faces), RINGS)
    even = relaxed(even, stretch, EVEN[-1:], is_free)
    start = replace(flat, points=np.where(is_free[:, None], even.points, flat.points))
    return even, relaxed(start, stretch, SMALLEST, is_free)


def _worst_vertices(surface: CutSurface, beyond: FloatArray, remains: BoolArray) -> IntArray:
    """Return the vertices to which slits are cut: of each strained region, the most curved of the most strained ones.

    Where a region has only vertices on seams, a neighbour is chosen.

    Args:
        surface: the surface.
        beyond: (k,) the excess of the strain of its edges.
        remains: (k,) edges whose strain remains too large if the largest strain is minimised. Only regions with such
            edges count.
    """
    mesh, count = surface.mesh, len(surface.mesh.vertices)
    angles = corner_angles(edge_lengths(mesh.vertices, mesh.faces))
    curvature = np.abs(angle_defect(mesh.faces, angles, mesh.is_boundary_vertex))
    ends = mesh.edges[surface.edges.edges]
    score = np.bincount(ends.ravel(), np.repeat(beyond, 2), count)
    is_strained = (score > 0) | mask_of(count, ends[remains])
    inside = mesh.edges[is_strained[mesh.edges].all(axis=1)]
    _, region = label_components(count, inside[:, 0], inside[:, 1])
    tips = []
    is_needed = mask_of(count, ends[remains])
    for members in _groups(region, is_strained):
        if not is_needed[members].any():
            continue
        inner = members[~surface.is_border_vertex[members]]
        weight = score * curvature
        if not len(inner):
            inner = _inner_neighbours(mesh, surface.is_border_vertex, members)
            weight = curvature
        if len(inner):
            tips.append(inner[np.argmax(weight[inner])])
    return np.array(tips, dtype=np.int64)


def _groups(label: IntArray, chosen: BoolArray) -> list[IntArray]:
    """Return the chosen items of each label."""
    items = np.flatnonzero(chosen)
    items = items[np.argsort(label[items], kind="stable")]
    return np.split(items, np.flatnonzero(np.diff(label[items])) + 1)


def _inner_neighbours(mesh: TriangleMesh, is_border: BoolArray, vertices: IntArray) -> IntArray:
    """Return the neighbours of vertices that are not on seams."""
    is_given = mask_of(len(mesh.vertices), vertices)
    ends = np.unique(mesh.edges[is_given[mesh.edges].any(axis=1)])
    return ends[~is_border[ends]]


def _slits(surface: CutSurface, tips: IntArray) -> IntArray:
    """Return the edges on the way from the tips to the nearest seam or border."""
    mesh = surface.mesh
    graph = MultiGraph(len(mesh.vertices), mesh.edges, surface.edge_lengths, mesh.incident_edges)
    paths = graph.shortest_paths(np.flatnonzero(surface.is_border_vertex))
    return paths.edge[paths.nodes_to(tips)]
