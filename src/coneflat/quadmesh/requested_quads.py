"""Quads that are asked for: symmetric or not, with sharp edges required or preferred, whichever are better."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from ..base import IntArray, Unmet, plural
from ..errors import CoarseGridError, ConeflatError, GridError
from .attempt import GridWithQuads, Outcome
from .borders import with_borders
from .crease_fit import crease_fit
from .cross_field import is_mechanical, sharp_ends
from .extract import DegenerateQuads, find_quads
from .integer_map import IntegerGrid
from .limits import NOTED_TIMES, SquareLimit
from .mirror_choice import (
    are_symmetric,
    asymmetry_note,
    fault,
    fault_of_angles,
    on_given_surface,
    topology_gap,
)
from .mirrored import doubled_quads, half_request, smoothed_beside
from .no_grid import REASONS, NoGrid, or_reason
from .policies import find_grid, on_coarse_mesh
from .quad_mesh import QuadMesh
from .quality import inverted_count
from .request import GridRequest
from .simpler_mesh import SimplerMesh
from .smooth import smooth_quads
from .snapping import snapped
from .surface_fit import fit_to_surface

#: Quads, and how they fail to follow the surface.
Attempt: TypeAlias = tuple[QuadMesh, tuple[str, ...]]
# Numbers of quads, relative to the requested one, that are tried to find one for which quads follow the surface.
TRIED_FACTORS = (2, 4, 8)


def quads_of_request(request: GridRequest, rounds: int) -> QuadMesh:
    """Return the smoothed quads that are asked for.

    Raises:
        CoarseGridError: they do not follow the surface; the message has a number of quads that do, if one is found.
    """
    quad_mesh, problems = _better_attempt(request, rounds)
    if not problems:
        return quad_mesh
    requested = round(request.limit.requested)
    text = f"{plural(requested, 'quad')} cannot follow the surface: {'; '.join(problems)}"
    largest = requested
    for count in [factor * requested for factor in TRIED_FACTORS]:
        try:
            finer, failures = _better_attempt(request.with_quads(count), rounds)
        except REASONS:
            break
        if not failures:
            advice = f"use {count:,} quads, which was tried and gives {len(finer.quads):,}"
            raise CoarseGridError(f"{text}: {advice}", count)
        largest = count
    raise CoarseGridError(
        f"{text}: nor can {largest:,}, the most that were tried; check the mesh for narrow gaps"
    )


def _better_attempt(request: GridRequest, rounds: int) -> Attempt:
    """Return quads; those without required sharp edges if these follow them better, see `CreaseFit`.

    They are compared only if the quads with required sharp edges do not follow all of them.
    """
    if request.sharp_angle is None:
        return _attempt(request, rounds)
    required = _attempt_or_error(request, rounds)
    reason = str(required)
    if isinstance(required, tuple):
        fit = crease_fit(required[0], request.sharp_angle)
        if fit.is_complete and not required[1]:
            return required
        reason = f"{100 * fit.share:.0f} %, and {fit.angle:.1f} degrees"
    preferred = _attempt_or_error(replace(request, sharp_angle=None), rounds)
    if not isinstance(preferred, tuple):
        if isinstance(required, tuple):
            return required
        raise required
    quad_mesh, problems = preferred
    preferred_fit = crease_fit(quad_mesh, request.sharp_angle)
    if isinstance(required, tuple) and (not required[1], fit.score) >= (not problems, preferred_fit.score):
        return required
    note = Unmet(
        f"Sharp edges are not required on grid lines, because quads are better: {100 * preferred_fit.share:.0f} % of "
        f"their length is on edges of quads, and angles are off by {preferred_fit.angle:.1f} degrees. If required: "
        f"{reason}."
    )
    return replace(quad_mesh, notes=(*quad_mesh.notes, note)), problems


def _attempt_or_error(request: GridRequest, rounds: int) -> Attempt | ConeflatError:
    """Return quads, or the error of a reason why there are none."""
    try:
        return _attempt(request, rounds)
    except REASONS as error:
        return error.with_traceback(None)


def _attempt(request: GridRequest, rounds: int) -> Attempt:
    """Return smoothed quads and how they fail to follow the surface; symmetric ones if the surface is symmetric."""
    with request.stages("symmetry"):
        half = half_request(request)
    if half is None or half.mirror is None:
        return _attempt_without_symmetry(request, rounds)
    plain = or_reason(_attempt_without_symmetry)(request.as_part(0.0, 0.5), rounds)
    if not isinstance(plain, NoGrid) and not plain[1] and are_symmetric(plain[0], half.mirror):
        return plain
    symmetric = _mirrored(request.as_part(0.5, 1.0), half.as_part(0.5, 1.0), rounds)
    if isinstance(plain, NoGrid):
        if isinstance(symmetric, NoGrid) or topology_gap(symmetric):
            raise plain.error
        return symmetric, ()
    quad_mesh, problems = plain
    if isinstance(symmetric, NoGrid):
        reason = symmetric.reason
    else:
        reason = ""
        if not problems:
            reason = fault(symmetric, quad_mesh, request) or fault_of_angles(symmetric, quad_mesh)
        if not reason:
            return symmetric, ()
    return replace(quad_mesh, notes=(*quad_mesh.notes, asymmetry_note(half.mirror, reason))), problems


def _attempt_without_symmetry(request: GridRequest, rounds: int) -> tuple[QuadMesh, tuple[str, ...]]:
    return _checked(request, _meshed(request, rounds))


@or_reason
def _mirrored(request: GridRequest, half: GridRequest, rounds: int) -> QuadMesh | NoGrid:
    """Return symmetric quads that follow the surface, or the reason why there are none."""
    assert half.mirror is not None
    meshed = _meshed(half, rounds)
    quad_mesh = meshed.quad_mesh
    grid = None if meshed.is_moved else quad_mesh.grid
    features = np.empty((0, 2), np.int64) if grid is None else grid.features
    with request.stages("smooth"):
        quad_mesh = smoothed_beside(quad_mesh, half.mirror, rounds, features)
    symmetric = doubled_quads(quad_mesh, half.mirror, request.angle)
    checked = request.checked
    surface = checked.mesh.moved_to(np.ldexp(checked.mesh.vertices, -checked.exponent))
    symmetric = on_given_surface(symmetric, surface)
    notes = *checked.notes, *symmetric.notes, f"The quads are symmetric about {half.mirror}."
    meshed = replace(meshed, quad_mesh=replace(symmetric, notes=notes), filled_area=2 * meshed.filled_area)
    quad_mesh, problems = _checked(request, meshed)
    return NoGrid(CoarseGridError("; ".join(problems))) if problems else quad_mesh


@dataclass(frozen=True, eq=False)
class _Meshed:
    """Smoothed quads of a request, and what a check of them needs to know.

    Attributes:
        quad_mesh: the quads, with the notes on the mesh, the grid and the extraction.
        is_moved: they are those of a simpler mesh, moved to the given one.
        filled_area: area of filled holes that they may cover.
        fills_holes: whether there are such holes.
    """

    quad_mesh: QuadMesh
    is_moved: bool = False
    filled_area: float = 0.0
    fills_holes: bool = False


def _meshed(request: GridRequest, rounds: int) -> _Meshed:
    """Return smoothed quads; those of a simpler mesh if this is needed, moved to the given one."""
    stages = request.stages
    source = request.flattening.source if request.flattening else request.source.input_mesh.source
    with stages("coarsen"):
        request, simpler = on_coarse_mesh(request)
    stages.done = 0.0
    gridded = with_coarse_grid(find_grid(request))
    grid = replace(gridded.grid, seconds=dict(stages.seconds))
    stages.done = 1.0
    with stages("extract"):
        quad_mesh = gridded.quad_mesh or _without_degenerate_quads(grid)
    quad_mesh = with_borders(quad_mesh) if quad_mesh.left_out else quad_mesh
    if simpler is None and _lacks_components(quad_mesh, request):
        simpler = SimplerMesh.of(request.checked, request.size, request.limit)
    with stages("smooth"):
        if simpler is None:
            quad_mesh = _smoothed(quad_mesh, rounds, request, grid.features)
        else:
            moved, ends = simpler.moved(quad_mesh), sharp_ends(simpler.surface, request.angle)
            quad_mesh = simpler.completed(_smoothed(moved, rounds, request, ends))
    notes = *(() if simpler is None else simpler.notes), *grid.notes, *quad_mesh.notes
    quad_mesh = replace(quad_mesh, notes=notes, grid=grid, source=source)
    if simpler is None:
        return _Meshed(quad_mesh)
    return _Meshed(quad_mesh, True, simpler.filled_area, bool(simpler.is_filling.any()))


def _smoothed(quad_mesh: QuadMesh, rounds: int, request: GridRequest, features: IntArray) -> QuadMesh:
    """Return smoothed quads, with vertices moved onto sharp edges that quads should follow."""
    quad_mesh = smooth_quads(quad_mesh, rounds, features)
    follows_edges = request.sharp_angle is not None or is_mechanical(quad_mesh.surface)
    return snapped(quad_mesh, request.angle, features) if rounds and follows_edges else quad_mesh


def _checked(request: GridRequest, meshed: _Meshed) -> tuple[QuadMesh, tuple[str, ...]]:
    """Return quads with all notes, and how they fail to follow the surface."""
    quad_mesh, stages = meshed.quad_mesh, request.stages
    require_sound(quad_mesh, request.limit)
    with stages("check"):
        problems = fit_to_surface(quad_mesh, meshed.filled_area).problems
    notes = map(Unmet, quad_notes(quad_mesh, meshed.fills_holes, request.limit.requested))
    seconds = {} if quad_mesh.grid is None else quad_mesh.grid.seconds
    source = quad_mesh.source or request.source.input_mesh.source
    quad_mesh = replace(
        quad_mesh, notes=(*quad_mesh.notes, *notes), seconds={**seconds, **stages.seconds}, source=source
    )
    return quad_mesh, problems


def with_coarse_grid(outcome: Outcome) -> GridWithQuads:
    """Return a grid, or the coarse one of a reason, or raise the error of a reason without any."""
    if isinstance(outcome, GridWithQuads):
        return outcome
    if outcome.coarse_grid is None:
        raise outcome.error
    return GridWithQuads(outcome.coarse_grid)


def _without_degenerate_quads(grid: IntegerGrid) -> QuadMesh:
    """Return the quads of a grid, without degenerate ones, or raise GridError if all are."""
    quad_mesh = find_quads(grid, leave_out=True)
    if isinstance(quad_mesh, DegenerateQuads):
        raise GridError(quad_mesh.reason)
    return quad_mesh


def _lacks_components(quad_mesh: QuadMesh, request: GridRequest) -> bool:
    """Return whether there is no grid, so no quads, for some components of a mesh."""
    return request.flattening is None and quad_mesh.surface.components[0] != request.mesh.components[0]


def require_sound(quad_mesh: QuadMesh, limit: SquareLimit) -> None:
    """Raise GridError for more quads than a limit, or coordinates that are not finite."""
    if error := limit.error(len(quad_mesh.quads)):
        raise error
    if bad := int((~np.isfinite(quad_mesh.vertices).all(axis=1)).sum()):
        raise GridError(f"{plural(bad, 'vertex', 'vertices')} of quads without a place: use fewer quads")


def quad_notes(quad_mesh: QuadMesh, fills_holes: bool, requested: float = math.inf) -> Iterator[str]:
    """Yield a note for each problem of a quad mesh.

    Args:
        quad_mesh: the mesh.
        fills_holes: it may cover filled holes.
        requested: number of quads that is requested.
    """
    if len(quad_mesh.quads) > NOTED_TIMES * requested:
        yield (
            f"{len(quad_mesh.quads):,} quads instead of {requested:,.0f}: narrow parts, handles or components of the "
            "surface need them."
        )
    if quad_mesh.left_out:
        share = 100 * quad_mesh.area_left_out / (quad_mesh.area_left_out + len(quad_mesh.quads))
        yield (
            f"Left out {plural(quad_mesh.left_out, 'square')} that the boundary cuts, {share:.1f} % of the area of the "
            "grid."
        )
    covered = quad_mesh.euler_characteristic - quad_mesh.surface_euler
    if covered > 0 and fills_holes:
        yield f"Quads cover {plural(covered, 'hole')}."
    elif covered:
        yield (
            f"The Euler characteristic of the quads is {quad_mesh.euler_characteristic}, that of the "
            f"surface {quad_mesh.surface_euler}: leaving out squares has opened or split the mesh."
        )
    if inverted := inverted_count(quad_mesh):
        yield f"{plural(inverted, 'quad')} with an angle of 180 degrees or more: use more quads."
