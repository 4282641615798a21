"""Patterns of meshes: `pattern` is the method, top to bottom."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...base import component_at_work, timing, warns
from ...options import read_options, settings, takes
from .cloth.cloth import cloth_pieces
from .drawing.gaps import notes_on_gaps, notes_on_short_seams
from .gores.gores import best_axis, cut_gores
from .model import Model, read_model
from .net.net import unfold_net
from .net.tabs import glue_tabs
from .options import PatternOptions
from .pages.nesting import nested
from .pieces.cut_surface import piece_areas
from .pieces.development import Development
from .pieces.grain import grain_up
from .pieces.numbering import order_around
from .result import Pattern
from .sheet.sheet import develop_sheet

# Fractions of the work that are done after checking the mesh and after cutting it.
CHECKED, AXIS_FOUND, CUT = 0.02, 0.6, 0.95


@takes(PatternOptions)
@warns()
def pattern(mesh: Any, faces: ArrayLike | None = None, **options: Any) -> Pattern:
    """Return the pattern of a surface: pieces in the plane, in millimetres, and how they are joined.

    Cones of the flattening are the tips of darts. Both sides of a seam are equally long.

    Args:
        mesh, faces: as for `coneflat.flatten`.
        options: see below. Lengths are numbers in millimetres, or texts with a unit such as "7mm" or "0.25in".

    Returns:
        The pattern. `save` writes it as PDF, SVG or DXF.

    Raises:
        OptionError: the model has no unit and no height is given, or an option is unknown or invalid.
        MeshError, MeshFileError, SeamError, MetricError, TooLargeError: as for `coneflat.unwrap`.

    Warns:
        GuaranteeWarning: the strain is beyond its bound, or darts remain that are not wanted; notes of the result
            say by how much.

    Examples:
        >>> result = coneflat.pattern(coneflat.sample_path(), height="200mm", strain="5%")
        >>> bool(abs(result.strains).max() <= 0.05), result.kind
        (True, 'cloth')
    """
    parsed = read_options(options, PatternOptions)
    with timing(parsed.progress) as stages, component_at_work("", 1.0):
        with stages("check", CHECKED):
            model = read_model(mesh, faces, parsed)
        if parsed.kind == "gores" and parsed.axis is None:
            with stages("axis", AXIS_FOUND):
                parsed = replace(parsed, axis=best_axis(model.mesh, parsed.gores, model.axis))
                model = read_model(mesh, faces, parsed)
        with stages("cut", CUT):
            developed = _METHODS[parsed.kind](model, parsed)
        with stages("pack", 1.0):
            return _placed(model, developed, parsed)


def _net(model: Model, options: PatternOptions) -> Development:
    return unfold_net(model.mesh)


def _gores(model: Model, options: PatternOptions) -> Development:
    developed = cut_gores(model.mesh, options.gores, model.axis)
    surface = developed.surface
    if isinstance(options.grain, tuple):
        surface = grain_up(surface, model.grain)
    centres = piece_areas(surface.mesh, surface.pieces)[1]
    rank = np.argsort(order_around(centres, model.axis))
    return replace(developed, surface=replace(surface, sequence=rank[surface.pieces]))


def _sheet(model: Model, options: PatternOptions) -> Development:
    return develop_sheet(model.mesh)


_METHODS: Mapping[str, Callable[[Model, PatternOptions], Development]] = {
    "cloth": cloth_pieces,
    "net": _net,
    "gores": _gores,
    "sheet": _sheet,
}


def _placed(model: Model, developed: Development, options: PatternOptions) -> Pattern:
    """Return the pattern of developed pieces, with glue tabs, placed side by side."""
    result = Pattern(
        kind=options.kind,
        surface=developed.surface,
        millimetres=model.millimetres,
        folds=developed.folds,
        fold_angles=developed.fold_angles,
        notes=(*model.notes, *developed.notes),
        settings={
            **settings(options),
            "axis": tuple(model.axis.tolist()),
            "grain": options.grain if options.grain == "none" else tuple(model.grain.tolist()),
        },
    )
    if options.kind == "net" and options.tabs > 0:
        glued = glue_tabs(developed.surface, result.borders, options.tabs)
        result = replace(result, tabs=glued.tabs, notes=(*result.notes, *glued.notes))
    notes = [*notes_on_gaps(result.surface, result.borders, result.finish)]
    if result.is_sewn:
        notes = [*notes_on_short_seams(result.seams, result.finish), *notes]
    return nested(replace(result, notes=(*result.notes, *notes)))
