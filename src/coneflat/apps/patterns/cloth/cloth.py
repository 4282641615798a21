"""Pieces of cloth: the shortest seams for which no edge is strained by more than the material allows.

The cones of a texture with a small energy give the seams, and where few edges are still strained too much, slits from
the nearest seam relax them. The energy is varied, and the shortest seams are kept.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from .... import unwrap
from ....base import IntArray, Unmet, part_of_work, plural
from ....linalg import MultiGraph
from ..model import Model
from ..options import PatternOptions
from ..pieces.borders import find_borders
from ..pieces.cut_surface import CutSurface
from ..pieces.development import Development
from ..pieces.grain import grain_up
from ..pieces.relaxing import excess
from ..pieces.strain import Stretch
from ..units import percentage
from .joining import with_joined_pieces
from .mirrored import half_of_model, joined_across, with_images
from .simplification import simplified
from .slits import Slitting, slit_until_within
from .smooth_seams import with_smooth_seams

# The symmetric Dirichlet energy of an isometry.
ISOMETRIC = 4.0
# Energies above that of an isometry, relative to the squared strain that is allowed, of the textures that are tried.
# Strains that are evenly distributed up to the bound in all directions give 8/3. More energy leaves more to slits.
ENERGIES_PER_STRAIN = (3.0, 6.0, 12.0, 24.0)
# Fraction of edges beyond the bound above which the seams of a texture are so few that slits get longer than they were.
MAX_STRAINED = 0.2
# Length of seams, relative to the shortest ones that were found, at which the slits of a texture are given up: pieces
# that are joined again hardly ever make up for so many.
MAX_LENGTH = 1.5
# Fractions of the work that is left, for the progress, that one of them is, and smoothing.
TEXTURE_SHARE, SMOOTHING_SHARE = 0.4, 0.7
# The same for the half of a symmetric model.
HALF_SHARE = 0.8
# Rounds in which darts are cut on to a border.
ROUNDS = 16


def cloth_pieces(model: Model, options: PatternOptions) -> Development:
    """Return a model cut into pieces of cloth with the grain upward, and notes on bounds that were not met."""
    warp, weft = options.stretch_warp or options.strain, options.stretch_weft or options.strain
    stretch = Stretch(warp, weft)
    pieces = _symmetric_pieces(model, stretch, options.tolerance) if options.symmetry == "auto" else None
    if pieces is None:
        pieces = _smooth_pieces(model, stretch, options.tolerance)
    surface = pieces.surface
    if options.darts == "none":
        surface = without_darts(surface, stretch)
    return Development(surface, notes=(*pieces.notes, *map(Unmet, unmet(surface, stretch, options))))


def _symmetric_pieces(model: Model, stretch: Stretch, tolerance: float) -> Development | None:
    """Return a symmetric model cut into symmetric pieces; None if it is not symmetric, or they are beyond the bound."""
    half = half_of_model(model)
    if half is None:
        return None
    with part_of_work(HALF_SHARE):
        pieces = _smooth_pieces(half.model, stretch, tolerance, copies=2)
    surface = joined_across(with_images(pieces.surface, half.plane), half.plane, stretch)
    return None if excess(surface, stretch).any() else replace(pieces, surface=surface)


def _smooth_pieces(model: Model, stretch: Stretch, tolerance: float, copies: int = 1) -> Development:
    """Return a model, simplified if it is dense, cut into pieces along smooth seams; copies: 2 for a half."""
    mesh, notes = model.mesh, tuple[str, ...]()
    if model.seams is None:
        mesh, distances = simplified(model.mesh, tolerance, copies)
        if mesh is not model.mesh:
            counts = [copies * len(surface.faces) for surface in (mesh, model.mesh)]
            notes = (
                f"The pattern is that of a mesh with {counts[0]:,} instead of {counts[1]:,} triangles, "
                f"{distances.mean():.2g} mm from it on average and {distances.max():.2g} mm at most.",
            )
    required = np.empty((0, 2), dtype=np.int64) if model.seams is None else model.seams
    surface = cut_cloth(replace(model, mesh=mesh), stretch, required)
    with part_of_work(SMOOTHING_SHARE, "smooth seams"):
        smooth = slit_until_within(with_smooth_seams(surface, tolerance, model.seams), stretch)
        if smooth.piece_count > surface.piece_count:
            smooth = with_joined_pieces(smooth, stretch, required)
    if not excess(smooth, stretch).any() or excess(surface, stretch).any():
        surface = smooth
    return Development(surface, notes=notes)


def unmet(surface: CutSurface, stretch: Stretch, options: PatternOptions) -> Iterator[str]:
    """Yield which bounds of the strain and requests of the options a cut surface does not meet."""
    beyond = excess(surface, stretch)
    if beyond.any():
        worst = int(beyond.argmax())
        strain = abs(float(surface.edges.strains(surface.points)[worst]))
        yield (
            f"The strain is beyond its bound at {int((beyond > 0).sum()):,} of {plural(len(beyond), 'edge')}: up to "
            f"{percentage(strain)} instead of {percentage(strain / (1 + beyond[worst]))}. No cut with less was found: "
            "allow more, or refine the mesh there."
        )
    darts = sum(seam.is_dart for seam in find_borders(surface).seams)
    if options.darts == "none" and darts:
        yield f"{plural(darts, 'dart')} could not be continued to a border: allow darts, or more strain."


def cut_cloth(model: Model, stretch: Stretch, required: IntArray) -> CutSurface:
    """Return a model cut into the fewest pieces that were found, and of those the ones with the shortest seams.

    Args:
        model: the model.
        stretch: what the material allows; if no cut was found within it, the largest strain is as small as was found.
        required: (k, 2) the vertices of edges that remain cut.
    """
    surfaces, max_length = list[CutSurface](), np.inf
    for number, energy in enumerate(ENERGIES_PER_STRAIN):
        with part_of_work(TEXTURE_SHARE, f"attempt {number + 1}"):
            texture = _texture(model, ISOMETRIC + energy * (stretch.warp**2 + stretch.weft**2) / 2)
            slitting = Slitting.of(texture, stretch)
            if surfaces and slitting.strained_share > MAX_STRAINED:
                break
            slit = slitting.until_within(max_length)
            if slit.seam_length > max_length:
                break
            surfaces.append(with_joined_pieces(slit, stretch, required))
            max_length = MAX_LENGTH * min(surface.seam_length for surface in surfaces)
        if not len(texture.seams):
            break
    return min(
        surfaces,
        key=lambda surface: (excess(surface, stretch).max(), surface.piece_count, surface.seam_length),
    )


def _texture(model: Model, max_energy: float) -> CutSurface:
    mesh = model.mesh
    texture = unwrap(mesh.vertices, mesh.faces, max_energy=max_energy, packing_cuts=0.0, seams=model.seams)
    return grain_up(CutSurface.of(texture), model.grain)


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
