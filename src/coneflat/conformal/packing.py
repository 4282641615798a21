"""Discrete Ricci flow: circle packings with given inversive distances."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .._arrays import FloatArray, IntArray
from ..geometry.delaunay import make_delaunay
from ..geometry.triangles import slacks
from ..mesh import NEXT
from .newton import ConformalProblem, centred


@dataclass(eq=False)
class PackingProblem(ConformalProblem):
    """Find u, so that circles of radii g_i exp(u_i) with the inversive distances of the input have the curvature.

    K(u) - target is the gradient of the Ricci energy (Jin, Kim, Gu 2007), convex for disjoint circles (Guo 2011;
    Luo 2011), whose Hessian is the Laplacian with the weights h / l of the radical centres. Flipped to weighted
    Delaunay by flips that keep the inversive distances, it has a minimum for all curvatures that sum to what
    they must (Bobenko, Lutz 2023).

    Attributes:
        radii: (n,) g, model units; set by `prepare`, from when on the triangulation has inversive distances for
            lengths.
    """

    radii: FloatArray = field(default_factory=lambda: np.empty(0))

    def prepare(self, delaunay: bool) -> int:
        """Put circles on the input, made Delaunay and then weighted Delaunay, if so wanted; return the number of flips.

        Neither changes the surface, and circles in the triangles around their centres do not overlap whatever
        the triangles.
        """
        flips = super().prepare(delaunay)
        self.radii = packed_radii(self.triangulation.length.reshape(-1, 3), self.triangulation.faces)
        if delaunay:
            self.records.append(make_delaunay(self.triangulation, radii=self.radii))
            flips += len(self.records[-1])
        one, two = self._ends(self.radii)
        gap, both = self.triangulation.length - (one + two), self.triangulation.length + (one + two)
        self.triangulation.length = 1 + gap * both / (2 * (one * two))
        return flips

    def flat_lengths(self, log_scale: FloatArray) -> FloatArray:
        """Return (3m,) the lengths for the radii, the same bits on both sides of an edge."""
        one, two = self._ends(self.radii * np.exp(log_scale))
        product = one * two
        lengths: FloatArray = np.sqrt((one**2 + two**2) + 2 * self.triangulation.length * product)
        return lengths

    def sum_angles(self, log_scale: FloatArray, sums: FloatArray, cots: FloatArray) -> int:
        """Fill the (n,) angle sums and (3m,) weights for the radii; return the number of broken triangles."""
        from .packing_kernel import sum_packing_angles

        radii = self.radii * np.exp(centred(log_scale))
        return sum_packing_angles(self.triangulation.tail, self.triangulation.length, radii, sums, cots)

    def flip(self, log_scale: FloatArray, suspects: IntArray | None) -> IntArray:
        """Flip to weighted Delaunay for the radii, from some half-edges or all; return the half-edges flipped."""
        radii = self.radii * np.exp(centred(log_scale))
        return make_delaunay(self.triangulation, radii=radii, has_lengths=False, suspects=suspects)

    def _ends(self, radii: FloatArray) -> tuple[FloatArray, FloatArray]:
        tail = self.triangulation.tail
        return radii[tail], radii[tail.reshape(-1, 3)[:, NEXT].ravel()]


@dataclass(eq=False)
class FixedPackingProblem(PackingProblem):
    """The same on the triangles as they are; a minimum may lie where some break the triangle inequality."""

    def flip(self, log_scale: FloatArray, suspects: IntArray | None) -> IntArray:
        """Flip nothing."""
        return np.empty(0, dtype=np.int64)


def packed_radii(lengths: FloatArray, faces: IntArray) -> FloatArray:
    """Return (n,) the radii of circles at the vertices of which no two of a triangle overlap.

    Each is the least, over the triangles around, of the radius in the packing of the triangle's three tangent circles,
    (l_ij + l_ki - l_jk) / 2: inversive distances are 1 and more.
    """
    radii = np.full(int(faces.max()) + 1, np.inf)
    np.minimum.at(radii, faces.ravel(), slacks(lengths).ravel() / 2)
    return radii
