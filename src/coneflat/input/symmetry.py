"""The plane of mirror symmetry that a component is worked on with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray
from ..errors import OptionError
from ..geometry.mirror import Mirror, find_mirror
from ..options import Options
from .components import Component, seam_costs

# The deviation, a share of the square root of the area, up to which a surface counts as symmetric of itself, and if
# its plane is named: what was modelled by hand has up to a thousandth, of what is no way symmetric 0.01 to 0.05.
AUTO, NAMED = 0.003, 0.03
# Radians: curvatures of a pair are the same within this.
EQUAL = 1e-6
AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


@dataclass(frozen=True, eq=False)
class Symmetry:
    """A plane of mirror symmetry and what it parts.

    Attributes:
        mirror: the plane.
        is_left: (m,) the faces on the left of a curve of edges along it; None if no curve parts the mesh in two.
        on_plane: (n,) the vertices of that curve, which count as on the plane.
        is_named: the user asked for this plane.
    """

    mirror: Mirror
    is_left: BoolArray | None
    on_plane: BoolArray
    is_named: bool

    @property
    def is_alike(self) -> bool:
        """Whether each side is the mirror image of the other, vertex for vertex."""
        return bool(
            self.is_left is not None and self.mirror.is_paired and self.mirror.own[self.on_plane].all()
        )


@dataclass(frozen=True, eq=False)
class SymmetryUse:
    """What a symmetry was used for.

    Attributes:
        symmetry: the plane.
        cones: whether the cones are symmetric.
        seams: whether the cut is.
    """

    symmetry: Symmetry
    cones: bool
    seams: bool


def find_symmetry(part: Component, options: Options) -> Symmetry | None:
    """Return the symmetry of a component that the options ask for; None if there is none."""
    # A metric of one's own is not that of the positions.
    if options.symmetric == "off" or options.lengths is not None:
        return None
    axis = AXES.get(options.symmetric)
    normal = None if axis is None else np.array(axis)
    tolerance = AUTO if normal is None else NAMED
    mirror = find_mirror(part.mesh, part.lengths, tolerance, normal)
    if mirror is None:
        return None
    from ..geometry.halves import part_halves

    costs, avoided, forbidden = seam_costs(part, options)
    is_left = part_halves(part.mesh, mirror, costs, avoided | forbidden)
    on_plane = mirror.own.copy()
    if is_left is not None:
        inside = np.flatnonzero(~part.mesh.is_boundary_edge)
        sides = is_left[part.mesh.edge_faces[inside]]
        on_plane = np.zeros(len(on_plane), dtype=bool)
        on_plane[part.mesh.edges[inside[sides[:, 0] != sides[:, 1]]]] = True
    return Symmetry(mirror, is_left, on_plane, normal is not None)


def are_mirrored(symmetry: Symmetry, cones: IntArray, curvatures: FloatArray) -> bool:
    """Return whether cones off the plane lie in pairs of images of each other, of equal curvature."""
    carried = np.full(len(symmetry.on_plane), np.nan)
    carried[cones] = curvatures
    partner = symmetry.mirror.partner
    off = symmetry.on_plane[cones]
    # Where images are the nearest vertices only, it is enough that one is the other's.
    sources = np.flatnonzero(np.isfinite(carried[partner]) & np.isfinite(carried))
    paired = sources[np.abs(carried[partner[sources]] - carried[sources]) <= EQUAL]
    return bool((off | np.isin(cones, paired) | np.isin(cones, partner[paired])).all())


def symmetry_notes(use: SymmetryUse | None) -> tuple[str, ...]:
    """Return what was not made symmetric although the model is."""
    if use is None or (use.cones and use.seams):
        return ()
    if not use.cones:
        return (
            "The model is symmetric, its cones and seams are not: cones that are given, required, of whole quanta or "
            "greedy are as they are, and others must not take many more.",
        )
    return (
        "The model and its cones are symmetric, its seams are not: such would be much longer, or need forbidden edges.",
    )


def check_symmetry(parts: Sequence[Component], options: Options) -> None:
    """Raise OptionError if a plane is named about which no component is symmetric."""
    axis = AXES.get(options.symmetric)
    if axis is None or options.lengths is not None:
        return
    normal = np.array(axis)
    if any(find_mirror(part.mesh, part.lengths, NAMED, normal) is not None for part in parts):
        return
    part = max(parts, key=lambda part: len(part.faces))
    nearest = find_mirror(part.mesh, part.lengths, np.inf, normal)
    off = (
        "lies in one"
        if nearest is None
        else f"is off its mirror image by {nearest.deviation:.2g} of its size"
    )
    raise OptionError(
        f"the model is not symmetric about a plane of normal {options.symmetric}: it {off}, and {NAMED:g} at most is "
        "allowed"
    )
