"""Integer grids and quad meshes of surfaces: the pipeline from a mesh to quads.

Cones are chosen, the surface is flattened to a seamless map, which is rounded to an integer grid; quads are extracted
from it and smoothed. Each step is a function of the previous result, and returns its result or a reason;
`policies.py` says which other grids are tried then.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from numpy.typing import ArrayLike

from ..base import Stopwatch, Unmet, warns
from ..errors import CoarseGridError, OptionError
from ..options import read_options
from .attempt import GridWithQuads, Outcome
from .borders import with_borders
from .extract import extract_quads, find_quads
from .integer_map import IntegerGrid
from .limits import NO_LIMIT
from .mirror_choice import (
    are_symmetric,
    asymmetry_note,
    fault,
)
from .mirrored import doubled_grid, half_request
from .no_grid import NoGrid, or_reason
from .options import QuadOptions
from .policies import find_grid
from .quad_mesh import QuadMesh
from .request import GridRequest
from .requested_quads import quad_notes, quads_of_request, require_sound
from .smooth import smooth_quads
from .surface_fit import fit_to_surface


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
    return quads_of_request(
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
    require_sound(quad_mesh, NO_LIMIT)
    if problems := fit_to_surface(quad_mesh).problems:
        text = "; ".join(problems)
        raise CoarseGridError(
            f"the quads of the grid cannot follow the surface: {text}: use a grid of more squares"
        )
    notes = (*grid.notes, *quad_mesh.notes, *map(Unmet, quad_notes(quad_mesh, fills_holes=False)))
    return replace(quad_mesh, notes=notes, seconds={**grid.seconds, **stages.seconds}, grid=grid)


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
