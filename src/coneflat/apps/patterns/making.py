"""Patterns of meshes: `pattern` is the method, top to bottom."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ... import TriangleMesh, check_mesh
from ...base import FloatArray, stage, timing, warns
from ...errors import OptionError
from ...io import as_input
from ...options import read_options, settings, takes
from ..view import upward_axis
from .cloth import cloth_pieces
from .development import Development
from .gores import cut_gores
from .nesting import grain_up, nested
from .net import unfold_net
from .options import PatternOptions
from .result import Pattern
from .shapes import Tab
from .sheet import develop_sheet
from .tabs import glue_tabs
from .units import MILLIMETRES, text_of_size

#: Units of formats whose specification gives one.
FORMAT_UNITS = {".glb": "m", ".gltf": "m"}
AXES: Mapping[str, FloatArray] = dict(zip("xyz", np.eye(3), strict=True))


@dataclass(frozen=True, eq=False)
class Model:
    """A mesh at the size of its pattern.

    Attributes:
        mesh: the mesh, mm.
        axis: (3,) unit vector of its upward direction, along which the grain is.
        millimetres: millimetres per unit of the input.
        notes: what was changed or assumed, one sentence each.
    """

    mesh: TriangleMesh
    axis: FloatArray
    millimetres: float
    notes: tuple[str, ...]


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
        GuaranteeWarning: a guarantee, or a request, is not met; notes of the result say which.

    Examples:
        >>> result = coneflat.pattern(coneflat.sample_path(), height="200mm", strain="5%")
        >>> abs(result.strains).max() <= 0.05, result.kind
        (True, 'cloth')
    """
    parsed = read_options(options, PatternOptions)
    with timing(parsed.progress):
        with stage("check"):
            model = read_model(mesh, faces, parsed)
        with stage("cut"):
            developed = _METHODS[parsed.kind](model, parsed)
        with stage("pack"):
            return _placed(model, developed, parsed)


def read_model(mesh: Any, faces: ArrayLike | None, options: PatternOptions) -> Model:
    """Return a mesh at the size of its pattern.

    Raises:
        OptionError: its size is not given.
        MeshError, MeshFileError: as for `coneflat.flatten`.
    """
    source = as_input(mesh, faces)
    checked = check_mesh(source.vertices, source.faces, repair=options.repair)
    vertices = checked.mesh.vertices
    ending = "" if source.source is None else source.source.path.suffix.lower()
    axis = AXES[upward_axis(vertices, checked.mesh.faces, ending)]
    if options.axis is not None:
        axis = np.array(options.axis) / np.linalg.norm(options.axis)
    factor, notes = _millimetres(vertices, axis, ending, options)
    # Far from the origin, differences of coordinates would lose digits.
    centred = (vertices - vertices.mean(axis=0)) * factor
    return Model(checked.mesh.moved_to(centred), axis, factor, (*checked.notes, *notes))


def _millimetres(
    vertices: FloatArray, axis: FloatArray, ending: str, options: PatternOptions
) -> tuple[float, tuple[str, ...]]:
    """Return millimetres per unit of a model, and notes on what was assumed."""
    if options.height is not None:
        extent = float(np.ptp(vertices @ axis))
        if not extent > 0:
            raise OptionError(
                "height needs a model with a height, but its extent along the axis is 0: give a unit"
            )
        return options.height / extent, ()
    extents = np.ptp(vertices, axis=0)
    unit = options.unit or FORMAT_UNITS.get(ending)
    if unit is None:
        sizes = " or ".join(f"{name} ({text_of_size(extents * MILLIMETRES[name])})" for name in MILLIMETRES)
        raise OptionError(
            f"the model has no unit: give unit as {sizes}, or give the height of the finished object"
        )
    factor = MILLIMETRES[unit] * options.scale
    size = text_of_size(extents * factor)
    assumed = () if options.unit else (f"{ending} files are in metres: the model is {size}.",)
    return factor, assumed


def _cloth(model: Model, options: PatternOptions) -> Development:
    return cloth_pieces(model.mesh, options)


def _net(model: Model, options: PatternOptions) -> Development:
    return unfold_net(model.mesh)


def _gores(model: Model, options: PatternOptions) -> Development:
    return cut_gores(model.mesh, options.gores, model.axis)


def _sheet(model: Model, options: PatternOptions) -> Development:
    return develop_sheet(model.mesh)


_METHODS: Mapping[str, Callable[[Model, PatternOptions], Development]] = {
    "cloth": _cloth,
    "net": _net,
    "gores": _gores,
    "sheet": _sheet,
}


def _placed(model: Model, developed: Development, options: PatternOptions) -> Pattern:
    """Return the pattern of developed pieces, with glue tabs, placed side by side."""
    # Gores stand along their axis already.
    surface = developed.surface if options.kind == "gores" else grain_up(developed.surface, model.axis)
    result = Pattern(
        kind=options.kind,
        surface=surface,
        millimetres=model.millimetres,
        folds=developed.folds,
        fold_angles=developed.fold_angles,
        notes=(*model.notes, *developed.notes),
        settings=settings(options),
    )
    if options.kind == "net" and options.tabs > 0:
        glued = glue_tabs(surface, result.borders, options.tabs)
        tabs = tuple(Tab(tab.polygon, tab.piece) for tab in glued.tabs)
        result = replace(result, tabs=tabs, notes=(*result.notes, *glued.notes))
    return nested(result)
