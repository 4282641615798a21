"""The mesh of a pattern: at its final size, with its upward direction and the seams that are given."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ... import TriangleMesh, check_mesh
from ...base import FloatArray, IntArray
from ...errors import OptionError
from ...io import as_input
from ...mesh import CheckedMesh
from ...options import Options
from ...source import InputMesh, marked_edges
from ..view import upward_axis
from .degenerate import without_degenerate
from .options import PatternOptions
from .units import MILLIMETRES, text_of_direction, text_of_size

#: Units of formats whose specification gives one.
FORMAT_UNITS = {".glb": "m", ".gltf": "m"}
# Largest extent of a model, mm; a larger one has another unit.
LARGEST = 1e6
# Extent of flat models along an axis, relative to the largest one.
FLAT = 1e-9
AXES: Mapping[str, FloatArray] = dict(zip("xyz", np.eye(3), strict=True))


@dataclass(frozen=True, eq=False)
class Model:
    """A mesh at the size of its pattern.

    Attributes:
        mesh: the mesh, mm.
        axis: (3,) unit vector of its upward direction.
        grain: (3,) unit vector along which the grain is; the upward one unless another one is given.
        millimetres: millimetres per unit of the input.
        seams: (k, 2) the vertices of edges that must be cut; None for none.
        notes: what was changed or assumed, one sentence each.
    """

    mesh: TriangleMesh
    axis: FloatArray
    grain: FloatArray
    millimetres: float
    seams: IntArray | None
    notes: tuple[str, ...]


def read_model(mesh: Any, faces: ArrayLike | None, options: PatternOptions) -> Model:
    """Return a mesh at the size of its pattern.

    Raises:
        OptionError: its size is not given.
        MeshError, MeshFileError: as for `coneflat.flatten`.
    """
    source = as_input(mesh, faces)
    checked = check_mesh(source.vertices, source.faces, repair=options.repair)
    # Far from the origin, differences of coordinates would lose digits.
    centred = checked.mesh.moved_to(checked.mesh.vertices - checked.mesh.vertices.mean(axis=0))
    sound = without_degenerate(centred, _own_seams(source, checked, options))
    vertices = sound.mesh.vertices
    ending = "" if source.source is None else source.source.path.suffix.lower()
    if options.axis is not None:
        axis = np.array(options.axis) / np.linalg.norm(options.axis)
    else:
        axis = _guessed_axis(vertices, sound.mesh.faces, ending)
    factor, notes = _millimetres(vertices, axis, ending, options)
    extents = np.ptp(vertices, axis=0) * factor
    if extents.max() > LARGEST:
        raise OptionError(
            f"the model would be {text_of_size(extents)}, more than {LARGEST / 1e6:g} km: choose another unit, "
            "a smaller scale, or a height"
        )
    scaled = sound.mesh.moved_to(vertices * factor)
    grain = axis
    if isinstance(options.grain, tuple):
        grain = np.array(options.grain) / np.linalg.norm(options.grain)
    return Model(scaled, axis, grain, factor, sound.seams, (*checked.notes, *notes, *sound.notes()))


def _guessed_axis(vertices: FloatArray, faces: IntArray, ending: str) -> FloatArray:
    """Return the axis (3,) that most probably points up; for a flat model, one in which it extends."""
    name = upward_axis(vertices, faces, ending)
    extents = dict(zip(AXES, np.ptp(vertices, axis=0).tolist(), strict=True))
    if extents[name] <= FLAT * max(extents.values()):
        name = max("yzx", key=lambda axis: extents[axis] > FLAT * max(extents.values()))
    return AXES[name]


def _own_seams(source: InputMesh, checked: CheckedMesh, options: PatternOptions) -> IntArray | None:
    """Return (k, 2) the vertices of the edges that the options name as seams; None if they name none."""
    if options.seams is None:
        return None
    mesh = checked.mesh
    is_free = np.zeros(len(mesh.edges), dtype=bool)
    return mesh.edges[marked_edges(checked, Options(seams=options.seams), source, is_free)]


def _millimetres(
    vertices: FloatArray, axis: FloatArray, ending: str, options: PatternOptions
) -> tuple[float, tuple[str, ...]]:
    """Return millimetres per unit of a model, and notes on what was assumed."""
    if options.height is not None:
        extent = float(np.ptp(vertices @ axis))
        if extent <= FLAT * np.ptp(vertices, axis=0).max():
            raise OptionError(
                f"height needs a model with a height, but its extent along the axis {text_of_direction(axis)} is 0: "
                "give another axis, or a unit instead of a height"
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
