"""How well quads follow the sharp edges of their surface, to choose between two quad meshes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base import FloatArray
from ..geometry.nearest import surface_distances
from .cross_field import sharp_ends
from .features import edge_indices, lengths_along
from .quad_mesh import QuadMesh
from .quality import corner_angles_of

# A point of a sharp edge is on an edge of a quad if it is so near, in mean edges of the quads.
ON_EDGE = 0.15
# Points of each sharp edge that are measured, per edge of quads, and at most.
SAMPLES_PER_EDGE, MAX_SAMPLES = 4, 64
# Share of the length of sharp edges above which quads follow them.
FOLLOWED = 0.98
# Mean deviation of angles, in degrees, that counts as much as all sharp edges.
EQUIVALENT_ANGLE = 45.0


@dataclass(frozen=True)
class CreaseFit:
    """How well quads follow sharp edges.

    Attributes:
        share: share of the length of sharp edges within 0.15 edges of the edges of quads; 1 if there are none.
        angle: mean deviation of the angles of quads from right angles, degrees.
    """

    share: float
    angle: float

    @property
    def score(self) -> float:
        """The share, less the mean deviation in units of 45 degrees: the higher, the better."""
        return self.share - self.angle / EQUIVALENT_ANGLE

    @property
    def is_complete(self) -> bool:
        """Whether quads follow all sharp edges."""
        return self.share >= FOLLOWED


def crease_fit(quads: QuadMesh, sharp_angle: float) -> CreaseFit:
    """Return how well quads, at least one, follow the edges of their surface sharper than an angle, radians."""
    angle = float(np.abs(corner_angles_of(quads) - 90.0).mean())
    surface = quads.surface
    edges = edge_indices(surface, sharp_ends(surface, sharp_angle))
    lengths = lengths_along(surface, edges)
    side = float(lengths_of_sides(quads).mean())
    counts = np.clip(np.ceil(SAMPLES_PER_EDGE * lengths / side), 1, MAX_SAMPLES).astype(np.int64)
    if not lengths.any():
        return CreaseFit(1.0, angle)
    edge = np.repeat(np.arange(len(edges)), counts)
    place = np.arange(len(edge)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = ((place + 0.5) / counts[edge])[:, None]
    tails, heads = surface.vertices[surface.edges[edges[edge]]].transpose(1, 0, 2)
    # Each edge of a quad is a triangle without area.
    off = surface_distances(quads.vertices, quads.edges[:, [0, 1, 1]], (1 - share) * tails + share * heads)
    weights = (lengths / counts)[edge]
    return CreaseFit(float(weights @ (off < ON_EDGE * side) / weights.sum()), angle)


def lengths_of_sides(quads: QuadMesh) -> FloatArray:
    """Return (e,) the lengths of the edges of quads."""
    return np.linalg.norm(np.diff(quads.vertices[quads.edges], axis=1)[:, 0], axis=1)
