"""What the symmetry of a model was used for, in numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..flat import LaidOut


@dataclass(frozen=True)
class MirrorSymmetry:
    """A component's plane of mirror symmetry, normal . x = offset, and what it was used for.

    Attributes:
        normal: unit vector.
        offset: model units.
        deviation: how far the surface is from symmetric: the root mean square of the distance of mirrored vertices
            from it, over the square root of its area.
        is_exact: whether every face has a mirror image; else vertices or the shape alone have.
        cones: whether the cones are symmetric.
        seams: whether the first cut is; what is split or glued later so that nothing overlaps need not be.
        layout: how far charts are from being mirror images, of themselves or of each other: a root mean square over
            the square root of the area; None where some have no mirror image.
        overlaid: whether both sides lie on each other in the texture.
    """

    normal: tuple[float, float, float]
    offset: float
    deviation: float
    is_exact: bool
    cones: bool
    seams: bool
    layout: float | None
    overlaid: bool


def mirror_symmetry(one: LaidOut, off: float, exponent: int) -> MirrorSymmetry | None:
    """Return what the symmetry of a component was used for; None without one.

    Args:
        one: the component.
        off: how far its charts are from mirror images, infinite or NaN where they are none.
        exponent: of the power of two by which the model was scaled.
    """
    if one.symmetry is None:
        return None
    mirror = one.symmetry.symmetry.mirror
    x, y, z = mirror.normal.tolist()
    overlaid = one.lies_on is not None
    return MirrorSymmetry(
        normal=(x, y, z),
        offset=float(np.ldexp(mirror.offset, -exponent)),
        deviation=mirror.deviation,
        is_exact=mirror.is_exact,
        cones=one.symmetry.cones,
        seams=one.symmetry.seams,
        layout=0.0 if overlaid else off if np.isfinite(off) else None,
        overlaid=overlaid,
    )
