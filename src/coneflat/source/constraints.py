"""The user's constraints on vertices, in the numbering of the checked mesh and of its components."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..errors import OptionError
from ..geometry.operators import at_unit_scale
from ..mesh.check import CheckedMesh
from ..mesh.polygons import COLOURS
from ..options import Options
from ..options.kinds import as_integer, as_number
from ..stages import VertexCurvatures
from .input_mesh import InputMesh

# Weight of a vertex of a pure colour minus that of a grey one.
PAINTED = 99.0


@dataclass(frozen=True, eq=False)
class Constraints:
    """The user's constraints on the vertices of a mesh.

    Attributes:
        names: (n,) the index of each vertex in the user's input.
        cones: given cones.
        corners: given corners of the boundary.
        required: vertices that every search must use as cones; their curvatures are NaN.
        is_allowed: (n,) vertices where a search may put a cone.
        weights: (n,) importance of each vertex, or None.
        seam_weights: (n,) factors of the cost of seams, or None.
        on_marks: (n,) vertices on marked seams, or None.
    """

    names: IntArray
    cones: VertexCurvatures
    corners: VertexCurvatures
    required: VertexCurvatures
    is_allowed: BoolArray
    weights: FloatArray | None
    seam_weights: FloatArray | None = None
    on_marks: BoolArray | None = None

    def check_off_seams(self, seams: IntArray) -> None:
        """Raise OptionError if a given or required cone is among the vertices of marked seams."""
        for place in (self.cones, self.required):
            for vertex in place.vertices[np.isin(place.vertices, seams)]:
                raise OptionError(
                    f"cone {self.names[vertex]} lies on a seam that is marked, where the curvature is free"
                )

    def within(self, component: IntArray) -> Constraints:
        """Return the constraints of a component, in its numbering; `component` holds the component's vertices."""
        return Constraints(
            self.names[component],
            self.cones.within(component),
            self.corners.within(component),
            self.required.within(component),
            self.is_allowed[component],
            _weights_within(self.weights, component),
            _weights_within(self.seam_weights, component),
            None if self.on_marks is None else self.on_marks[component],
        )


def _weights_within(weights: FloatArray | None, component: IntArray) -> FloatArray | None:
    """Return the weights of a component, scaled; None if all are 0, which is the same as equal weights."""
    return None if weights is None or not weights[component].any() else at_unit_scale(weights[component])


def locate_constraints(checked: CheckedMesh, options: Options, input_mesh: InputMesh) -> Constraints:
    """Return the constraints of the options, in the numbering of the checked mesh.

    Args:
        checked: the mesh.
        options: the options with the constraints.
        input_mesh: the input.

    Raises:
        OptionError: a vertex does not exist or cannot be a cone or a corner; weights are invalid.
    """
    names, count = checked.vertex_origin, len(np.asarray(input_mesh.vertices))
    required = _locate(checked, "cone", dict.fromkeys(options.required_cones))
    for vertex in options.forbidden_cones:
        if not 0 <= vertex < count:
            raise OptionError(f"forbidden cone {vertex} is not a vertex: indices are from 0 to {count - 1}")
    is_allowed = ~np.isin(names, list(options.forbidden_cones))
    for name in names[required.vertices[~is_allowed[required.vertices]]]:
        raise OptionError(f"vertex {name} is both a required and a forbidden cone")
    noun = "cone or corner" if options.boundary_kind == "straight" else "cone"
    return Constraints(
        names,
        _locate(checked, noun, options.named_cones),
        _locate(checked, "corner", options.corners),
        required,
        is_allowed,
        vertex_numbers("weights", options.weights, input_mesh, names),
        vertex_numbers("seam weights", options.seam_weights, input_mesh, names),
    )


def _locate(checked: CheckedMesh, noun: str, prescribed: Mapping[int, float | None]) -> VertexCurvatures:
    """Return given cones, which must be inner vertices, given corners, which must be on the boundary, or both."""
    names, origin = np.array(list(prescribed), dtype=np.int64), checked.vertex_origin
    for name in names[~np.isin(names, origin)]:
        raise OptionError(f"{noun} {name} is not a vertex of a face: indices are from 0 to {origin[-1]}")
    vertices = np.searchsorted(origin, names)
    on_boundary = checked.mesh.is_boundary_vertex[vertices]
    if noun == "cone":
        for name in names[on_boundary]:
            raise OptionError(
                f"cone {name} lies on the boundary, where the curvature is free: choose inner vertices, "
                "or prescribe the boundary's curvature (boundary)"
            )
    elif noun == "corner":
        # Repair may have split a corner. All of its copies on the boundary are corners.
        vertices = np.flatnonzero(np.isin(origin, names) & checked.mesh.is_boundary_vertex)
        for name in np.setdiff1d(names, origin[vertices]):
            raise OptionError(f"corner {name} does not lie on the boundary")
    values = (prescribed[name] for name in origin[vertices].tolist())
    return VertexCurvatures(
        vertices, np.array([np.nan if k is None else k for k in values], dtype=np.float64)
    )


def _weights_of_some(noun: str, weights: Mapping[Any, Any], count: int) -> FloatArray:
    """Return (n,) the weights of the vertices in a map, and 1 for the others."""
    values = np.ones(count)
    for vertex, weight in weights.items():
        at = as_integer(f"a vertex of {noun}", vertex)
        if not 0 <= at < count:
            raise OptionError(f"{noun}: {at} is not a vertex: indices are from 0 to {count - 1}")
        values[at] = as_number(f"{noun}: that of vertex {at}", weight)
    return values


def vertex_numbers(noun: str, weights: object, input_mesh: InputMesh, names: IntArray) -> FloatArray | None:
    """Return (n,) nonnegative numbers for the vertices `names` of the input, such as their importance; None for None.

    Args:
        noun: what the numbers are, for messages.
        weights: one number for each vertex of the input, a map for some, or the name of a vertex property.
        input_mesh: the input.
        names: (n,) vertices.

    Raises:
        OptionError: they are not such numbers.
    """
    if weights is None:
        return None
    count = len(np.asarray(input_mesh.vertices))
    if isinstance(weights, str):
        weights = _property(noun, weights, input_mesh)
    if isinstance(weights, Mapping):
        weights = _weights_of_some(noun, weights, count)
    try:
        numbers = np.asarray(weights)
    except (TypeError, ValueError, OverflowError) as error:
        raise OptionError(f"{noun} must be numbers, one for each vertex: {error}") from error
    if numbers.dtype.kind not in "fiub" and numbers.size:
        raise OptionError(f"{noun} must be numbers, one for each vertex, got type {numbers.dtype}")
    values = numbers.astype(np.float64)
    if values.shape != (count,):
        raise OptionError(f"{noun} must be {count:,} numbers, one for each vertex, got shape {values.shape}")
    if not np.isfinite(values).all():
        at = int(np.flatnonzero(~np.isfinite(values))[0])
        raise OptionError(f"{noun} must be finite; that of vertex {at} is {values[at]:g}")
    if not (values.min() >= 0 and values.max() > 0):
        raise OptionError(
            f"{noun} must be nonnegative and not all 0; they are {values.min():g} to {values.max():g}"
        )
    return values[names]


def _property(noun: str, name: str, input_mesh: InputMesh) -> FloatArray:
    """Return (n,) a vertex property of the input's file; "color" stands for the saturation of the vertex colour."""
    properties = {} if input_mesh.source is None else input_mesh.source.properties
    if name == "color" and all(colour in properties for colour in COLOURS):
        return 1.0 + PAINTED * np.ptp(np.stack([properties[colour] for colour in COLOURS]), axis=0)
    if name not in properties:
        has = "it has " + ", ".join(properties) if properties else "it has none"
        raise OptionError(f"the mesh has no vertex property {name!r} for {noun}; {has}")
    return properties[name]
