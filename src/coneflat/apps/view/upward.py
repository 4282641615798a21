"""The axis of a model that points up: by the convention of its format, or by its shape."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...base import FREESURFER, FloatArray, IntArray, short_repr
from ...errors import OptionError

if TYPE_CHECKING:
    from ... import Flattening

AXES = ("x", "y", "z")
#: The values of options that name an upward axis.
UPS = ("auto", *AXES)

#: The axis that points up in files of a format whose specification or whose programs agree on it.
FIXED_AXES = {".gltf": "y", ".glb": "y", ".stl": "z", ".gii": "z", **dict.fromkeys(FREESURFER, "z")}
#: The usual axis of formats without such a convention; models that stand on a ground of another one override it.
USUAL_AXES = {".ply": "z"}
OTHERWISE = "y"

#: A model stands on the ground of an axis if so much more of its surface, and so large a part, lies on it there.
GROUND_RATIO, MIN_GROUND = 3.0, 0.004
#: Height of what counts as ground, as a fraction of the height of the model.
GROUND_HEIGHT = 0.02
#: Least and largest height of a terrain, as fractions of its width, and how much of its surface faces up.
TERRAIN_HEIGHTS, MIN_FACING_UP = (0.01, 0.3), 0.8


def upward_axis(vertices: FloatArray, faces: IntArray, ending: str = "") -> str:
    """Return the axis of a model that most probably points up, "y" or "z".

    glTF files have y by their specification; STL files and surfaces of brains z, as programs agree. For other formats
    the shape decides: a model that lies on one side of its box stands on it, and the surface of a terrain faces up.
    Without a clear answer, it is z for PLY files, and y otherwise.

    Args:
        vertices: (n, 3) positions.
        faces: (m, 3) triangles.
        ending: ending of the file of the model, such as ".obj"; "" if there is none.

    Examples:
        >>> vertices = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0], [1, 1, 9]])  # It stands on z = 0.
        >>> coneflat.apps.view.upward_axis(vertices, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]))
        'z'
    """
    ending = ending.lower()
    if ending in FIXED_AXES:
        return FIXED_AXES[ending]
    return _axis_of_shape(vertices, faces) or USUAL_AXES.get(ending, OTHERWISE)


def axis_of(up: str, result: Flattening) -> str:
    """Return an upward axis, "x", "y" or "z"; for "auto" that of the model of a result.

    Raises:
        OptionError: `up` is not one of these.
    """
    check_up(up)
    if up != "auto":
        return up
    ending = "" if result.source is None else result.source.path.suffix
    return upward_axis(result.vertices, result.faces, ending)


def check_up(up: str) -> None:
    """Raise OptionError if a value is neither "auto" nor the name of an axis."""
    if not isinstance(up, str) or up not in UPS:  # Arrays cannot be compared with strings.
        raise OptionError(f'the upward axis must be "auto", "x", "y" or "z", got {short_repr(up)}')


def _axis_of_shape(vertices: FloatArray, faces: IntArray) -> str | None:
    """Return the axis, y or z, on whose ground a model stands, or to which a terrain faces; None if it is not clear."""
    if not len(faces):
        return None
    # Coordinates are divided first, because products could overflow.
    corners = vertices[faces]
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    corners = (corners - low) / (float((high - low).max()) or 1.0)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = float(np.linalg.norm(normals, axis=1).sum())
    extents = corners.max(axis=(0, 1))
    if not area:
        return None
    facing = np.abs(normals.sum(axis=0)) / area
    grounds = {}
    for axis, name in ((1, "y"), (2, "z")):
        width = float(np.delete(extents, axis).min())
        is_low = TERRAIN_HEIGHTS[0] * width < extents[axis] < TERRAIN_HEIGHTS[1] * width
        if is_low and facing[axis] > MIN_FACING_UP:
            return name
        is_ground = corners[:, :, axis].max(axis=1) <= GROUND_HEIGHT * extents[axis]
        grounds[name] = float(np.abs(normals[is_ground, axis]).sum()) / area
    (_, smaller), (name, larger) = sorted(grounds.items(), key=lambda item: item[1])
    return name if larger >= max(MIN_GROUND, GROUND_RATIO * smaller) else None
