"""Integer grids and quad meshes of surfaces: the pipeline from a mesh to quads.

Cones are chosen, the surface is flattened to a seamless map, which is rounded to an integer grid; quads are extracted
from it and smoothed. Each step is a function of the previous result, and returns its result or a reason;
`policies.py` says which other grids are tried then.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ..base import IntArray, Stopwatch, Unmet, plural, warns
from ..errors import CoarseGridError, ConeflatError, GridError, OptionError
from ..options import read_options
from .attempt import GridWithQuads, Outcome
from .borders import with_borders
from .crease_fit import crease_fit
from .cross_field import is_mechanical, sharp_ends
from .extract import DegenerateQuads, extract_quads, find_quads
from .integer_map import IntegerGrid
from .limits import NO_LIMIT, NOTED_TIMES, SquareLimit
from .mirror_choice import (
    are_symmetric,
    asymmetry_note,
    fault,
    fault_of_angles,
    on_given_surface,
    topology_gap,
)
from .mirrored import doubled_grid, doubled_quads, half_request, smoothed_beside
from .no_grid import REASONS, NoGrid, or_reason
from .options import QuadOptions
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


@warns()
def quads(
    mesh: Any,
    faces: ArrayLike | None = None,
    *,
    quads: int | None = None,
    size: ArrayLike | None = None,
    stretch: float = QuadOptions.stretch,
    sharp_angle: float | str | None = None,
    symmetry: str = QuadOptions.symmetry,
    loops: bool = QuadOptions.loops,
    smooth: int = QuadOptions.smooth,
    **options: Any,
) -> QuadMesh:
    """Return a quad mesh of a surface; all faces are quads, and irregular vertices are the cones of a flattening.

    Args:
        mesh, faces: as for `coneflat.flatten`; or an `IntegerGrid`, which accepts the options `smooth` and `progress`
            only.
        quads: approximate number of quads; None: 10,000, unless `size` is given.
        size: length of the edges of quads in model units, which replaces `quads`; or relative sizes of quads, see
            `integer_grid`.
        stretch: trade-off between equal angles (0) and also equal areas (1); see `integer_grid`.
        sharp_angle: radians, or a text such as "40deg"; edges of quads follow edges with a larger dihedral angle; None
            for none.
        symmetry: "auto": quads of a surface with a plane of symmetry are symmetric about it; "none": they need not be.
        loops: prefer short loops and few patches to angles close to 90 degrees; see `integer_grid`.
        smooth: rounds of smoothing on the surface, see `smooth_quads`; 0 for none.
        options: those of `coneflat.flatten`; by default cones have three, five or six quads.

    Returns:
        The quad mesh, with the position of its vertices on the surface.

    Raises:
        CoarseGridError: the quads would be more than four times as many as requested, or would not follow the surface:
            some leap to another part of it, or their area or distance is far off. The message has a number of quads
            that works, if one is found.
        GridError: no grid of this size, or somewhat finer, without flipped triangles was found; or there would be more
            quads than the triangles of the mesh can carry.
        TooLargeError: the quads do not fit into the free memory.
        OptionError: an option is unknown or invalid.
        MeshError, CurvatureError, SeamError, MetricError: as for `coneflat.flatten`.

    Warns:
        GuaranteeWarning: a guarantee, or a request, is not met; notes of the result say which.

    Examples:
        >>> square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]
        >>> mesh = coneflat.quads(*square, quads=9)
        >>> mesh.quads.shape, mesh.vertices.shape
        ((9, 4), (16, 3))
    """
    quad_options = {
        "quads": quads,
        "size": size,
        "stretch": stretch,
        "sharp_angle": sharp_angle,
        "symmetry": symmetry,
        "loops": loops,
        "smooth": smooth,
    }
    if isinstance(mesh, IntegerGrid):
        has_options = loops or any(value is not None for value in (faces, quads, size, sharp_angle))
        is_default = stretch == QuadOptions.stretch and symmetry == QuadOptions.symmetry
        if has_options or not is_default or options.keys() - {"progress"}:
            raise OptionError("a grid already has faces, size, stretch and options: no others can be given")
        read_options(quad_options, QuadOptions)
        return _quads_of_grid(mesh, smooth, Stopwatch(options.get("progress")))
    return _quads_of_request(
        replace(GridRequest.of(mesh, faces, quad_options, options), for_quads=True), smooth
    )


def _quads_of_grid(grid: IntegerGrid, rounds: int, stages: Stopwatch) -> QuadMesh:
    """Return the smoothed quads of a given grid."""
    stages.done = 1.0
    with stages("extract"):
        quad_mesh = extract_quads(grid)
    quad_mesh = with_borders(quad_mesh) if quad_mesh.left_out else quad_mesh
    with stages("smooth"):
        quad_mesh = smooth_quads(quad_mesh, rounds, grid.features)
    _require_sound(quad_mesh, NO_LIMIT)
    if problems := fit_to_surface(quad_mesh).problems:
        text = "; ".join(problems)
        raise CoarseGridError(
            f"the quads of the grid cannot follow the surface: {text}: use a grid of more squares"
        )
    notes = (*grid.notes, *quad_mesh.notes, *map(Unmet, _notes(quad_mesh, fills_holes=False)))
    return replace(quad_mesh, notes=notes, seconds={**grid.seconds, **stages.seconds}, grid=grid)


def _quads_of_request(request: GridRequest, rounds: int) -> QuadMesh:
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
    gridded = _with_coarse_grid(find_grid(request))
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
    _require_sound(quad_mesh, request.limit)
    with stages("check"):
        problems = fit_to_surface(quad_mesh, meshed.filled_area).problems
    notes = map(Unmet, _notes(quad_mesh, meshed.fills_holes, request.limit.requested))
    seconds = {} if quad_mesh.grid is None else quad_mesh.grid.seconds
    source = quad_mesh.source or request.source.input_mesh.source
    quad_mesh = replace(
        quad_mesh, notes=(*quad_mesh.notes, *notes), seconds={**seconds, **stages.seconds}, source=source
    )
    return quad_mesh, problems


def _with_coarse_grid(outcome: Outcome) -> GridWithQuads:
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


@warns("grid.notes")
def integer_grid(
    mesh: Any,
    faces: ArrayLike | None = None,
    *,
    quads: int | None = None,
    size: ArrayLike | None = None,
    stretch: float = QuadOptions.stretch,
    sharp_angle: float | str | None = None,
    symmetry: str = QuadOptions.symmetry,
    loops: bool = QuadOptions.loops,
    **options: Any,
) -> IntegerGrid:
    """Return a seamless map of a surface to the integer grid: unit squares become quads that match across seams.

    Args:
        mesh, faces: as for `coneflat.flatten`; or a `Flattening` with cones quantised to quarter turns.
        quads: approximate number of unit squares that cover the surface; None: 10,000, unless `size` is given.
        size: edge length of a square in model units, which replaces `quads`; or relative sizes of squares: (n,)
            numbers, the name of a vertex property of the file, or "curvature", for squares up to four times smaller
            where the surface is more curved.
        stretch: trade-off between angles (0) and areas (1); see `StretchEnergy`.
        sharp_angle: radians, or a text such as "40deg"; edges with a larger dihedral angle, and the boundary, are put
            on grid lines; None for none.
        symmetry: "auto": the grid of a surface with a plane of symmetry is symmetric about it; "none": it need not be.
        loops: prefer integers for which grid lines from irregular vertices soon end at other ones, so that strips of
            squares are short and the patches between these lines are few; angles deviate more from 90 degrees.
        options: those of `coneflat.flatten`; by default cones have three, five or six quads. Given cones need
            curvatures, multiples of pi/2; on surfaces with handles or several boundaries, a grid rarely exists for
            them. boundary may also be "auto", the default: "straight" if such a grid is found and cones are not given,
            else "free".

    Returns:
        The map, with its cones and measures.

    Raises:
        GridError: no grid of this size without flipped triangles was found; or there would be more than four
            times as many squares, or more than the triangles of the mesh can carry.
        TooLargeError: the grid does not fit into the free memory.
        MeshError, CurvatureError, OptionError, SeamError, MetricError: as for `coneflat.flatten`.

    Warns:
        GuaranteeWarning: a guarantee, or a request, is not met; notes of the result say which.

    Notes:
        A smooth layout with quantised cones (Kaelberer, Nieser, Polthier, "QuadCover", 2007) is scaled. Translations of
        seams and positions of cones are rounded together, to the nearest lattice point in the metric of the least
        energy that a displacement needs. The layout is then relaxed to these constraints (integer-grid maps: Bommes,
        Campen, Ebke, Alliez, Kobbelt 2013), from the smooth one by steps that flip no triangle. Edges between cones are
        split before.

    Examples:
        >>> square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]
        >>> grid = coneflat.integer_grid(*square, quads=16)
        >>> round(grid.size, 6)  # sides of the squares, in model units
        0.25
        >>> grid.corners, grid.corner_quarters
        (array([0, 1, 2, 3]), array([1, 1, 1, 1]))
    """
    quad_options = {
        "quads": quads,
        "size": size,
        "stretch": stretch,
        "sharp_angle": sharp_angle,
        "symmetry": symmetry,
        "loops": loops,
    }
    request = GridRequest.of(mesh, faces, quad_options, options)
    request.stages.done = 0.0
    half = half_request(request)
    outcome = find_grid(request) if half is None else _symmetric_grid(request, half)
    if isinstance(outcome, NoGrid):
        raise outcome.error
    return replace(outcome.grid, seconds=dict(request.stages.seconds))


def _symmetric_grid(request: GridRequest, half: GridRequest) -> Outcome:
    """Return the grid of a symmetric surface: a symmetric one, unless it is worse than another."""
    assert half.mirror is not None
    plain = find_grid(request.as_part(0.0, 0.5))
    symmetric = _mirrored_grid(request, half.as_part(0.5, 1.0))
    if isinstance(plain, NoGrid):
        return plain if isinstance(symmetric, NoGrid) else symmetric
    if isinstance(symmetric, NoGrid):
        return plain.with_note(asymmetry_note(half.mirror, symmetric.reason))
    quads = [find_quads(outcome.grid, leave_out=True) for outcome in (plain, symmetric)]
    meshes = [mesh for mesh in quads if isinstance(mesh, QuadMesh)]
    if len(meshes) < len(quads) or are_symmetric(meshes[0], half.mirror):
        return plain
    reason = fault(meshes[1], meshes[0], request)
    return plain.with_note(asymmetry_note(half.mirror, reason)) if reason else symmetric


@or_reason
def _mirrored_grid(request: GridRequest, half: GridRequest) -> Outcome:
    """Return the grid of a surface from one of its half, or the reason why there is none."""
    assert half.mirror is not None
    outcome = find_grid(half)
    if isinstance(outcome, NoGrid):
        return outcome
    notes = *request.checked.notes, *outcome.grid.notes, f"The grid is symmetric about {half.mirror}."
    return GridWithQuads(doubled_grid(replace(outcome.grid, notes=notes), half.mirror, request.angle))


def _require_sound(quad_mesh: QuadMesh, limit: SquareLimit) -> None:
    """Raise GridError for more quads than a limit, or coordinates that are not finite."""
    if error := limit.error(len(quad_mesh.quads)):
        raise error
    if bad := int((~np.isfinite(quad_mesh.vertices).all(axis=1)).sum()):
        raise GridError(f"{plural(bad, 'vertex', 'vertices')} of quads without a place: use fewer quads")


def _notes(quad_mesh: QuadMesh, fills_holes: bool, requested: float = math.inf) -> Iterator[str]:
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
