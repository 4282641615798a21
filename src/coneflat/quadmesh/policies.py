"""Which grids are tried, and in which order, until one has quads that are a mesh.

1. `on_coarse_mesh`: the grid of a simpler mesh, if the surface has very many triangles, holes or components.
2. `finer_grid`: more squares, if some quads are degenerate.
3. `components_apart`: a grid for each component.
4. `other_cones`: costlier cones, then the fewest cones.
5. `boundary_free`: a boundary that cuts squares, if it cannot lie on grid lines.

`find_grid` calls the others: around each attempt `finer_grid`; for several components `components_apart`; for one,
`other_cones` if the options leave the cones open, else `boundary_free`. Each returns a grid, or the reason why there is
none, except `on_coarse_mesh`, which returns the request for a simpler mesh. A single attempt is in `attempt.py`.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from ..base import IntArray, Unmet, plural
from ..errors import CoarseGridError, ConvergenceError, GridError, OptionError
from ..geometry import coarse_mesh, double_areas, edge_lengths
from ..io import as_input
from ..mesh import with_fans
from ..mesh.connectivity import TriangleMesh
from ..result import Flattening
from ..source import Source
from .aligned_cones import aligned_flattening
from .attempt import (
    AlignedFlattenings,
    GridWithQuads,
    Outcome,
    SeamlessMap,
    aligned_map,
    flattened_map,
    grid_of_map,
)
from .features import without_pillows
from .integer_map import IntegerGrid, joined_grids
from .limits import COARSE_TRIANGLES
from .no_grid import NoGrid
from .options import QUADS
from .remesh import MAX_CORNERS, MAX_HOLES, area_of, is_thin, manageable_parts, part_of, remeshed
from .request import GridRequest, names_vertices
from .simpler_mesh import SimplerMesh
from .sizes import extended

# A surface is remeshed if more than this share of its triangles is thin, as in files of CAD programs: few grids are
# found for such meshes.
MAX_THIN_SHARE = 0.1
# Largest number of new triangles for each thin one, in meshes of more than COARSE_TRIANGLES: the plane parts of a
# surface are not better the finer they are.
MAX_REFINEMENT = 100
# How many sizes are tried. Each has GROWTH times the squares of the last grid, and MIN_SQUARES at least; if the limit
# leaves less than MIN_GROWTH times as many, none is tried.
MAX_SIZES, GROWTH, MIN_GROWTH, MIN_SQUARES = 3, 1.6, 1.2, 32.0
# Closed surfaces have so many squares at least, unless they have a handle.
SQUARES_OF_CUBE = 6
# Factors of the price of cones that are tried, the latter on meshes of few triangles, which are split for it.
PRICE_FACTORS, MAX_SPLIT_TRIANGLES = (1.0, 4.0), COARSE_TRIANGLES // 6
# With a lower Euler characteristic, so more holes and handles, other cones hardly ever help: rotations along handles
# are not reached, which takes long. On a boot with twelve handles, they took 60% of the time.
MIN_EULER_FOR_OTHER_CONES = -8


def find_grid(request: GridRequest) -> Outcome:
    """Return the grid that is asked for, with its quads, or the reason why there is none."""

    @cache
    def flattening_of(price: float, is_split: bool) -> Flattening:
        return aligned_flattening(
            request.checked, price, is_split, request.options, request.stages, request.sharp_angle,
            request.scales, request.limit, request.mirror,
        )  # fmt: skip

    # Sizes with the same price of cones share a flattening.
    return finer_grid(request, flattening_of)


# -- 1. a coarse mesh


def on_coarse_mesh(request: GridRequest) -> tuple[GridRequest, SimplerMesh | None]:
    """Return the request for the grid of a simpler mesh, and this mesh.

    The request is the given one if its options name vertices, or if the mesh has few triangles, holes and components.
    With an angle of sharp edges, the mesh is simplified only if many triangles are thin, since other edges may be sharp
    on a coarse mesh.

    Raises:
        MeshError: the mesh cannot be flattened.
        OptionError: sizes are not positive numbers.
    """
    if names_vertices(request) or request.flattening:
        return request, None
    checked, mesh = request.checked, request.mesh
    if request.sharp_angle is not None and not _has_many_thin(mesh):
        return request, None
    side = float(np.ldexp(request.size, checked.exponent))
    is_manageable, walks, is_jagged = manageable_parts(mesh, side)
    walks, is_jagged = (walks, is_jagged) if request.boundary == "auto" else ([], False)
    part, part_vertices = part_of(mesh, is_manageable)
    loops = [np.searchsorted(part_vertices, mesh.tails[walk]) for walk in walks]
    filled, notes = with_fans(part, loops), list(checked.notes)
    simple, vertex_origin, face_origin = _with_few_triangles(filled, side)
    if simple is filled and is_manageable.all() and not (loops or is_jagged):
        return request, None
    if is_jagged:
        request = replace(request, boundary="free")
        notes.append(Unmet(f"The boundary cuts squares, because it has more than {MAX_CORNERS} corners."))
    if loops:
        notes.append(
            f"Filled {plural(len(loops), 'hole')}: small ones, and those beyond the {MAX_HOLES} longest."
        )
    shared = part_vertices[vertex_origin[vertex_origin < len(part_vertices)]]
    sizes = None if request.scales is None else np.exp(extended(-request.scales[shared], simple))
    simple = simple.moved_to(np.ldexp(simple.vertices, -checked.exponent))
    simpler = replace(
        SimplerMesh.of(checked, request.size, request.limit),
        mesh=simple,
        vertex_origin=shared,
        is_filling=face_origin >= len(part.faces),
        notes=tuple(notes),
    )
    return replace(request, source=Source(as_input(simple)), sizes=sizes), simpler


def _with_few_triangles(mesh: TriangleMesh, side: float) -> tuple[TriangleMesh, IntArray, IntArray]:
    """Return a mesh of few triangles, not too thin, for quads with a length of their sides.

    And the vertices and triangles of the given mesh that its own are; it is the given mesh if this is simple already.
    """
    quads = area_of(mesh) / side**2
    count = COARSE_TRIANGLES * max(1.0, quads / QUADS)
    simple, vertex_origin, face_origin = mesh, np.arange(len(mesh.vertices)), np.arange(len(mesh.faces))
    if _has_many_thin(mesh):
        finest = min(count, max(COARSE_TRIANGLES, MAX_REFINEMENT * len(mesh.faces)))
        simple, vertex_origin, face_origin = remeshed(
            mesh, int(np.clip(4 * quads, COARSE_TRIANGLES // 6, finest))
        )
    if len(simple.faces) > 2 * count:
        coarse = coarse_mesh(mesh, int(count))
        simple, vertex_origin, face_origin = coarse.mesh, coarse.vertices, coarse.faces
    return simple, vertex_origin, face_origin


def _has_many_thin(mesh: TriangleMesh) -> bool:
    """Return whether so many triangles of a mesh are thin that it is remeshed."""
    return bool(is_thin(mesh).mean() > MAX_THIN_SHARE) and len(without_pillows(mesh).faces) == len(mesh.faces)


# -- 2. a finer grid


def finer_grid(request: GridRequest, flattening_of: AlignedFlattenings) -> Outcome:
    """Return a grid, with more squares if some quads of one of the requested size are degenerate.

    This is so where the surface is as thin as a square. If no finer grid is found, the coarse one is the reason.
    """
    coarsest = None
    for _ in range(MAX_SIZES):
        outcome = grid_of_size(request, flattening_of)
        if isinstance(outcome, GridWithQuads):
            if coarsest is None:
                return outcome
            return outcome.with_note(Unmet("More quads than requested: with fewer, some are degenerate."))
        coarsest = coarsest or outcome
        finer = None if outcome.coarse_grid is None else _with_more_squares(request, outcome.coarse_grid)
        if finer is None:
            break
        request = finer
    assert coarsest is not None
    return coarsest


def _with_more_squares(request: GridRequest, grid: IntegerGrid) -> GridRequest | None:
    """Return the request for more squares than those of a grid; None if these would be too many or hardly more."""
    squares = grid.squares
    more_squares = min(max(GROWTH * squares, MIN_SQUARES), request.limit.squares)
    size = request.extent / float(np.sqrt(more_squares))
    return None if more_squares < MIN_GROWTH * squares else replace(request, size=size)


def grid_of_size(request: GridRequest, flattening_of: AlignedFlattenings) -> Outcome:
    """Return a grid of the requested size: that of a given flattening, of components, or of cones to be chosen."""
    if request.flattening:
        return grid_of_map(request, SeamlessMap(request.flattening))
    if not request.leaves_cones_open:
        if request.sizes is not None:
            raise OptionError("sizes cannot be combined with options of cones, boundaries or weights")
        return boundary_free(request)
    if request.mesh.components[0] > 1:
        return components_apart(request)
    return other_cones(request, flattening_of)


# -- 3. components apart


def components_apart(request: GridRequest) -> Outcome:
    """Return the grid of the components, each with a search of its own.

    One that needs a finer grid, or that has none, thus does not change those of the others. On human.obj, five
    components, 3,000 quads become 3,099 in half the time; 12,040 if all are rounded together.
    """
    checked, grids, reasons = request.checked, list[IntegerGrid](), list[str]()
    mesh, grow = checked.mesh, np.exp2(-checked.exponent)
    scales = np.zeros(len(mesh.vertices)) if request.scales is None else request.scales
    areas = double_areas(edge_lengths(mesh.vertices, mesh.faces))
    of_face = scales[mesh.faces].mean(axis=1)
    # Nothing of a component without area can be seen.
    components = [split for split in mesh.split_components() if areas[split[2]].any()]
    shares = np.array([areas[faces].sum() for *_, faces in components]) / max(
        areas.sum(), np.finfo(float).tiny
    )
    fewest = [_fewest_squares(part) for part, *_ in components]
    expected = np.maximum(shares * (request.extent / request.size) ** 2, fewest)
    for k, (part, vertices, faces) in enumerate(components):
        if excess := request.limit.error(sum(grid.squares for grid in grids) + float(expected[k:].sum())):
            return NoGrid(excess)
        # The mean of the log conformal factor on the component, relative to that on all components.
        mean = np.average(of_face[faces], weights=areas[faces]) - np.average(of_face, weights=areas)
        outcome = find_grid(
            replace(
                request,
                source=Source(as_input(part.moved_to(grow * part.vertices))),
                size=request.size * float(np.exp(-mean)),
                sizes=None if request.sizes is None else np.exp(-scales[vertices]),
            )
        )
        if isinstance(outcome, GridWithQuads):
            grids.append(outcome.grid)
        elif outcome.coarse_grid is not None:  # its degenerate quads are left out
            grids.append(outcome.coarse_grid)
        else:
            count = plural(len(part.faces), "triangle")
            reasons.append(Unmet(f"No grid for a component of {count}: {outcome.reason}."))
    if excess := request.limit.error(sum(grid.squares for grid in grids)):
        return NoGrid(excess)
    if not grids:
        reason = reasons[0] if reasons else "they have no area."
        return NoGrid(GridError(f"no grid was found for any of {mesh.components[0]} components: {reason}"))
    return GridWithQuads(joined_grids(grids, (*checked.notes, *reasons)))


def _fewest_squares(component: TriangleMesh) -> int:
    """Return the fewest squares of a connected mesh."""
    return SQUARES_OF_CUBE if component.euler_characteristic == 2 else 1


# -- 4. other cones


def other_cones(request: GridRequest, flattening_of: AlignedFlattenings) -> Outcome:
    """Return a grid of a connected mesh whose cones are aligned; if there is none, one with other cones.

    On a coarse mesh that is split, costlier cones are different ones, for which there may be a grid. Where rotations
    are not reached, other cones hardly ever help, and each metric takes long. With many holes and handles, or requested
    sizes, a coarse grid is made finer instead.
    """
    failures = list[NoGrid]()
    has_many_loops = request.mesh.euler_characteristic < MIN_EULER_FOR_OTHER_CONES
    is_small = len(request.mesh.faces) <= MAX_SPLIT_TRIANGLES
    for price_factor in PRICE_FACTORS if is_small and not has_many_loops else PRICE_FACTORS[:1]:
        outcome = grid_of_map(request, aligned_map(request, price_factor, flattening_of))
        if isinstance(outcome, GridWithQuads):
            return outcome
        if has_many_loops or (outcome.coarse_grid is not None and request.sizes is not None):
            return outcome
        failures.append(outcome)
        if isinstance(outcome.error, ConvergenceError):
            break
    if request.mirror is not None:
        return _most_helpful(failures)
    directions = "the boundary, sharp edges or curvature"
    if request.sizes is not None:
        directions += ", nor for requested sizes"
    note = Unmet(
        f"Cones are not chosen for {directions}, because no grid with such cones was found: {failures[-1].reason}."
    )
    outcome = grid_of_map(request, flattened_map(request, note=note))
    if isinstance(outcome, GridWithQuads):
        return outcome
    return _most_helpful([*failures, outcome])


def _most_helpful(failures: list[NoGrid]) -> NoGrid:
    """Return the first reason with a coarse grid, or that with the fewest quads that are possible, or the last."""
    if with_grid := [failure for failure in failures if failure.coarse_grid is not None]:
        return with_grid[0]
    counts = {
        failure.error.quads: failure
        for failure in failures
        if isinstance(failure.error, CoarseGridError) and failure.error.quads is not None
    }
    return counts[min(counts)] if counts else failures[-1]


# -- 5. a free boundary


def boundary_free(request: GridRequest) -> Outcome:
    """Return a grid with the fewest cones, or given ones, whose boundary lies on grid lines if possible."""
    may_be_straight = request.boundary == "auto" and isinstance(request.options.get("cones", "auto"), str)
    if not (may_be_straight and request.mesh.is_boundary_edge.any()):
        return grid_of_map(request, flattened_map(request))
    outcome = grid_of_map(request, flattened_map(request, "straight", requires_sides=True))
    if isinstance(outcome, GridWithQuads) or outcome.coarse_grid is not None:
        return outcome
    note = Unmet(
        f"The boundary cuts squares, because no grid with the boundary on grid lines was found: {outcome.reason}."
    )
    return grid_of_map(request, flattened_map(request, note=note))
