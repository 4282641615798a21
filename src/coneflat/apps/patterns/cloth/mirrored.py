"""Symmetric cloth: the pieces of the half beside a plane of symmetry, and their mirror images.

Left and right of a sewn object should be alike, and mirrored pieces can be cut from doubled cloth. The search takes
half of the time: for spot at 3 % 15 instead of 31 s. The seams are longer by 2 to 9 %: for spot at 3 % by 8 %, with 10
pieces and 42 darts instead of 8 and 46.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from ....quadmesh import MirrorPlane, doubled, half_beside, symmetry_planes
from ..model import Model
from ..pieces.cut_surface import CutSurface
from ..pieces.strain import Stretch
from .joining import with_joined_pieces

# Largest component of the grain along the normal of the plane, for axes that are typed with two or three digits: the
# grain of mirror images points elsewhere by twice as much.
IN_PLANE = 0.01


@dataclass(frozen=True, eq=False)
class HalfModel:
    """The half of a symmetric model.

    Attributes:
        model: the half.
        plane: the plane of symmetry.
    """

    model: Model
    plane: MirrorPlane


def half_of_model(model: Model) -> HalfModel | None:
    """Return the half of a model with one plane of symmetry, along the grain; None if it has no such half.

    Models with several planes, such as balls and vases, have no left and right: their seams are shorter without
    symmetry. A model with seams of its own has no half.
    """
    planes = [] if model.seams is not None else list(islice(symmetry_planes(model.mesh), 2))
    if len(planes) != 1 or abs(model.grain @ planes[0].normal) > IN_PLANE:
        return None
    half = half_beside(model.mesh, planes[0])
    return None if half is None else HalfModel(replace(model, mesh=half.mesh), half.plane)


def with_images(half: CutSurface, plane: MirrorPlane) -> CutSurface:
    """Return the pieces of the half of a surface, and their mirror images; both meet at seams along the plane."""
    corners = np.concatenate([half.corners, (half.corners + len(half.points))[:, [0, 2, 1]]])
    points = np.concatenate([half.points, half.points * [-1, 1]])
    return CutSurface(doubled(half.mesh, plane).mesh, corners, points)


def joined_across(surface: CutSurface, plane: MirrorPlane, stretch: Stretch) -> CutSurface:
    """Return a symmetric cut surface with pieces joined along the plane where the strain allows it."""
    ends = surface.mesh.edges[surface.seams]
    is_across = plane.contains(surface.mesh.vertices)[ends].all(axis=1)
    return with_joined_pieces(surface, stretch, ends[~is_across])
