"""Measures of quad meshes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np

from ..base import FloatArray, dots, short_repr
from ..errors import ArrayShapeError
from ..geometry.nearest import surface_distances
from .quad_mesh import QuadMesh, least_jacobians
from .strips import find_patches, find_strips
from .surface_fit import fit_to_surface, surface_samples

# Least scaled Jacobian of a quad that is not inverted: an angle of 180 degrees has 0, up to rounding.
MIN_SOUND_JACOBIAN = 1e-9


@dataclass(frozen=True)
class QuadMeasures:
    """Measures of a quad mesh.

    Attributes:
        vertices, quads: numbers of vertices and quads.
        irregular: number of inner vertices with a valence other than 4.
        irregular_valences: number of irregular vertices for each valence.
        euler_characteristic: vertices minus edges plus quads.
        surface_euler: Euler characteristic of the surface, which is the same unless squares were left out.
        angle_mean, angle_p95, angle_max: deviation of all corner angles from 90 degrees, in degrees.
        edge_mean, edge_cv: mean edge length, and the standard deviation of edge lengths divided by the mean.
        jacobian_mean, jacobian_min: mean and minimum of the least scaled Jacobian of each quad, 1 for rectangles,
            negative if a quad is flipped at a corner.
        inverted: number of quads with an angle of 180 degrees or more.
        hausdorff: largest distance between quads and surface, model units; see `hausdorff_distance`.
        area_ratio: area of the quads over that of the surface.
        leaps: number of quads that leap to another part of the surface; see `SurfaceFit`.
        left_out, area_left_out: see `QuadMesh`.
        strips: number of strips of quads, each of which crosses quads from one side to the opposite one; edge rings.
        longest_strip: number of quads of the longest one, where it crosses itself twice.
        patches: number of parts between all grid lines from irregular vertices, the faces of the base complex.
    """

    vertices: int
    quads: int
    irregular: int
    irregular_valences: dict[int, int]
    euler_characteristic: int
    surface_euler: int
    angle_mean: float
    angle_p95: float
    angle_max: float
    edge_mean: float
    edge_cv: float
    jacobian_mean: float
    jacobian_min: float
    inverted: int
    hausdorff: float
    area_ratio: float
    leaps: int
    left_out: int
    area_left_out: float
    strips: int
    longest_strip: int
    patches: int

    def report(self) -> dict[str, Any]:
        """Return the measures by name, ready for JSON."""
        return asdict(self)

    def rows(self) -> Iterator[tuple[str, str, str]]:
        """Yield table rows (measure, value, meaning)."""
        valences = ", ".join(f"{count:,} of {valence}" for valence, count in self.irregular_valences.items())
        holds = self.euler_characteristic == self.surface_euler
        euler = "same as the surface" if holds else f"the surface has {self.surface_euler}"
        yield "quads", f"{self.quads:,}", f"Euler characteristic {self.euler_characteristic}, {euler}"
        irregular = f"inner vertices with a valence other than 4: {valences or 'none'}"
        yield "irregular", f"{self.irregular:,}", irregular
        off = f"mean; 95th percentile {self.angle_p95:.1f}, largest {self.angle_max:.1f}"
        yield "angle deviation", f"{self.angle_mean:.2f}", off
        spread = f"standard deviation of edge lengths divided by their mean, {self.edge_mean:.4g}"
        yield "edge cv", f"{self.edge_cv:.3f}", spread
        jacobian = f"scaled, mean of each quad's minimum; minimum {self.jacobian_min:.3f}"
        yield "Jacobian", f"{self.jacobian_mean:.3f}", jacobian
        strips = f"the longest has {self.longest_strip:,} quads, {self.longest_strip / self.quads**0.5:.1f} sqrt(quads)"
        yield "strips", f"{self.strips:,}", strips
        yield "patches", f"{self.patches:,}", "between all grid lines from irregular vertices"
        yield "inverted", f"{self.inverted:,}", "quads with an angle of 180 degrees or more"
        yield "area", f"{self.area_ratio:.3f}", "area of the quads over that of the surface"
        yield "leaps", f"{self.leaps:,}", "quads that leap to another part of the surface"
        edges = self.hausdorff / self.edge_mean
        distance = f"largest between quads and surface, at samples; {edges:.2f} edges"
        yield "distance", f"{self.hausdorff:.3g}", distance


#: Names of the numbers in the report of a quad mesh.
QUAD_MEASURES = tuple(field.name for field in fields(QuadMeasures) if field.name != "irregular_valences")


def measure_quads(quads: QuadMesh) -> QuadMeasures:
    """Return the measures of a quad mesh on a surface.

    Angles are in degrees, lengths and distances in model units; Jacobians and `edge_cv` are ratios. Distances to and
    from the surface are the largest at samples, see `hausdorff_distance`.

    Args:
        quads: p quads, at least one, with q vertices on their surface, as `coneflat.quads` returns them or
            `QuadMesh.load` reads them; not modified.

    Returns:
        The measures as Python numbers, see `QuadMeasures`.

    Raises:
        ArrayShapeError: `quads` is not a `QuadMesh`.

    Examples:
        >>> square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]
        >>> measures = coneflat.measure_quads(coneflat.quads(*square, quads=4))
        >>> measures.quads, measures.irregular, round(measures.edge_mean, 6)
        (4, 0, 0.5)
        >>> round(measures.angle_max, 6), round(measures.jacobian_min, 6)
        (0.0, 1.0)
    """
    if not isinstance(quads, QuadMesh):
        raise ArrayShapeError(
            f"quads must be a QuadMesh, as `coneflat.quads` returns, not {short_repr(quads)}"
        )
    points = quads.vertices
    off = np.abs(corner_angles_of(quads) - 90.0)
    length = np.linalg.norm(points[quads.edges[:, 0]] - points[quads.edges[:, 1]], axis=1)
    jacobians = least_jacobians(points, quads.quads)
    fit, strips = fit_to_surface(quads), find_strips(quads)
    valences, counts = np.unique(quads.valences[quads.irregular], return_counts=True)
    return QuadMeasures(
        vertices=len(points),
        quads=len(quads.quads),
        irregular=len(quads.irregular),
        irregular_valences=dict(zip(valences.tolist(), counts.tolist(), strict=True)),
        euler_characteristic=quads.euler_characteristic,
        surface_euler=quads.surface_euler,
        angle_mean=float(off.mean()),
        angle_p95=float(np.percentile(off, 95)),
        angle_max=float(off.max()),
        edge_mean=float(length.mean()),
        edge_cv=float(length.std() / length.mean()),
        jacobian_mean=float(jacobians.mean()),
        jacobian_min=float(jacobians.min()),
        inverted=inverted_count(quads),
        hausdorff=hausdorff_distance(quads),
        area_ratio=fit.area_ratio,
        leaps=fit.leaps,
        left_out=quads.left_out,
        area_left_out=quads.area_left_out,
        strips=len(strips.lengths),
        longest_strip=int(strips.lengths.max()),
        patches=int(find_patches(quads).max()) + 1,
    )


def inverted_count(quads: QuadMesh) -> int:
    """Return the number of quads with an angle of 180 degrees or more."""
    return int((least_jacobians(quads.vertices, quads.quads) <= MIN_SOUND_JACOBIAN).sum())


def corner_angles_of(quads: QuadMesh) -> FloatArray:
    """Return (p, 4) the corner angles of quads, degrees."""
    corners = quads.vertices[quads.quads]
    backward, forward = np.roll(corners, 1, axis=1) - corners, np.roll(corners, -1, axis=1) - corners
    scale = np.maximum(np.sqrt(dots(backward, backward) * dots(forward, forward)), np.finfo(float).tiny)
    return np.degrees(np.arccos(np.clip(dots(backward, forward) / scale, -1.0, 1.0)))


def hausdorff_distance(quads: QuadMesh) -> float:
    """Return the largest sampled distance from the quads to the surface, or from the surface to the quads.

    Distances to nearest points are measured at 5 x 5 points of the bilinear patch of each quad, and at points of each
    triangle with a spacing of at most half the mean edge of the quads. Distances to quads are those to their two
    triangles on both sides of the shorter diagonal.
    """
    mesh, corners = quads.surface, quads.vertices[quads.quads]
    u, v = np.indices((5, 5)).reshape(2, -1) / 4
    patch = np.stack([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v], axis=1)
    # Corners are shared by several quads, so they are sampled once.
    inner = np.einsum("si,pix->psx", patch[patch.max(axis=1) < 1], corners).reshape(-1, 3)
    to_surface = surface_distances(mesh.vertices, mesh.faces, np.concatenate([quads.vertices, inner]))
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    samples = surface_samples(mesh.vertices, mesh.faces, float(sides.mean()) / 2)
    from_surface = surface_distances(quads.vertices, quads.triangles, samples)
    return float(max(to_surface.max(), from_surface.max()))
